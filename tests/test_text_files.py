"""Text files from any editor and any folder: scenes, assignments, manifests, scripts."""

import subprocess
from pathlib import Path
from types import SimpleNamespace

import pytest
from gradings import written
from typer.testing import CliRunner

import raycheck
from raycheck.base.errors import NotFound
from raycheck.base.images import write_exr
from raycheck.base.processes import windows_lines
from raycheck.commands.app import app
from raycheck.grading import package, program
from raycheck.grading.assignment import read_assignment
from raycheck.grading.submission import SubmissionError, open_submission
from raycheck.judging.agenda import write_variant
from raycheck.measuring import report
from raycheck.scene import variants
from raycheck.scene.content import read_content
from raycheck.truth import references

SCENE = """\
<!-- A closed form: é
     Unbounded: nee, light: because. -->
<scene version="3.0.0">
    <default name="depth" value="2"/>
    <integrator type="path"><integer name="max_depth" value="$depth"/></integrator>
    <sensor type="perspective"><float name="fov" value="40"/>
        <transform name="to_world"><lookat origin="0, -4, 0" target="0, 0, 0" up="0, 0, 1"/></transform>
        <film type="hdrfilm">
            <integer name="width" value="8"/><integer name="height" value="8"/><rfilter type="box"/>
        </film>
    </sensor>
    <shape type="obj"><string name="filename" value="mesh.obj"/></shape>
    <emitter type="constant"/>
</scene>
"""
MESH = "v -1 0 -1\nv 1 0 -1\nv 0 0 1\nf 1 2 3\n"
LATIN = '<?xml version="1.0" encoding="ISO-8859-1"?>\n'
ENCODED = {
    "plain": SCENE.encode(),
    "mark": SCENE.encode("utf-8-sig"),
    "windows": SCENE.replace("\n", "\r\n").encode(),
    "old-mac": SCENE.replace("\n", "\r").encode(),
    "mark-windows": SCENE.replace("\n", "\r\n").encode("utf-8-sig"),
    "utf-16": SCENE.encode("utf-16"),
    "utf-16-be": ("\ufeff" + SCENE.replace("\n", "\r\n")).encode("utf-16-be"),
    "latin-1": (LATIN + SCENE).encode("latin-1"),
}


def rendered(oneray: Path, path: Path) -> bytes:
    out = path.with_suffix(".pfm")
    done = subprocess.run(
        [oneray, path, "-o", out, "--spp", "2"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    return out.read_bytes()


@pytest.fixture
def plain(oneray: Path, tmp_path: Path) -> bytes:
    """The picture of SCENE."""
    written(tmp_path / "mesh.obj", MESH)
    return rendered(oneray, written(tmp_path / "plain-scene.xml", SCENE))


@pytest.mark.parametrize("name", ENCODED)
def test_scenes(oneray: Path, plain: bytes, tmp_path: Path, name: str) -> None:
    """oneray and raycheck read the same scene, whatever bytes say it."""
    path = tmp_path / "scene.xml"
    path.write_bytes(ENCODED[name])
    assert rendered(oneray, path) == plain
    content = read_content(path)
    assert content.max_depth == 2 and content.unbounded == {"nee", "light"}
    assert report._about(path) == "A closed form: é Unbounded: nee, light: because."
    assert variants.files_of(path) == [tmp_path / "mesh.obj"]
    assert variants.scene_hash(path) != variants.scene_hash(path, {"depth": "3"})


@pytest.mark.parametrize(
    "name", ["a b", "a$b", "$depth", "\\$", "é𝔸", "a&b", "<a>", "'\"", "%20", "{spp}", "[a]"]
)
def test_folders(oneray: Path, plain: bytes, tmp_path: Path, name: str) -> None:
    """A scene written anew with other parameters still finds its meshes."""
    folder = tmp_path / name
    folder.mkdir()
    written(folder / "mesh.obj", MESH)
    of = variants.variant(written(folder / "scene.xml", SCENE), {"depth": "2"})
    path = write_variant(of, tmp_path)
    assert rendered(oneray, path) == plain
    assert variants.files_of(path) == [folder / "mesh.obj"]


ASSIGNMENT = 'name = "a"\ntitle = "é"\n[[task]]\nid = "a"\nscenes = ["point-light"]\npoints = 1\n'


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_toml(tmp_path: Path, encoding: str, end: str) -> None:
    """With a byte order mark, and with the lines of Windows."""
    (tmp_path / "a.toml").write_bytes(ASSIGNMENT.replace("\n", end).encode(encoding))
    assert read_assignment(tmp_path / "a.toml").title == "é"
    (tmp_path / "mine").mkdir()
    manifest = f'build = "make"{end}command = "./mine {{output}}"{end}'
    (tmp_path / "mine/raycheck.toml").write_bytes(manifest.encode(encoding))
    submission = open_submission(tmp_path / "mine", tmp_path / "into")
    assert (submission.manifest.build, submission.manifest.command) == ("make", "./mine {output}")


def test_toml_of_other_encodings(tmp_path: Path) -> None:
    for encoding in ("utf-16", "latin-1"):
        (tmp_path / "a.toml").write_bytes(ASSIGNMENT.encode(encoding))
        with pytest.raises(NotFound, match=r"a\.toml: not TOML: 'utf-8' codec can't decode"):
            read_assignment(tmp_path / "a.toml")
        (tmp_path / "mine").mkdir(exist_ok=True)
        (tmp_path / "mine/raycheck.toml").write_bytes('run = "é"'.encode(encoding))
        with pytest.raises(SubmissionError, match=r"raycheck\.toml is not TOML"):
            open_submission(tmp_path / "mine", tmp_path / encoding)


WINDOWS = "has the line ends of Windows (CRLF): save it with those of Unix (LF)"


class TestScripts:
    def script(self, path: Path, end: str) -> Path:
        path.write_bytes('#!/bin/sh\nif test "$1"\nthen cp "$1" "$2"\nfi\n'.replace("\n", end).encode())
        path.chmod(0o755)
        return path

    @pytest.mark.parametrize("shell", ["", "sh ", "sh -e "])
    def test_renderers(self, tmp_path: Path, shell: str) -> None:
        """What such a script says of itself nobody understands."""
        truth = references.load_reference("point-light").best()[0]
        write_exr(tmp_path / "picture.exr", {c: truth[..., i] for i, c in enumerate("RGB")})
        for end, status in (("\n", 0), ("\r\n", 2)):
            script = self.script(tmp_path / "render.sh", end)
            command = f"{shell}{script} {tmp_path}/picture.exr {{output}}"
            done = CliRunner().invoke(app, ["verify", "point-light", "--renderer", command])
            found = done.stdout + done.stderr
            assert (f"{script} {WINDOWS}" in found) == (status > 0), found
            assert found.count("CRLF") == (status > 0)

    def test_which(self, tmp_path: Path) -> None:
        bad, good = self.script(tmp_path / "bad", "\r\n"), self.script(tmp_path / "good", "\n")
        (tmp_path / "Makefile").write_bytes(b"all:\r\n\ttrue\r\n")
        (tmp_path / "page.html").write_bytes(b"<p>\r\n")
        assert windows_lines(["./bad"], tmp_path) == f"; ./bad {WINDOWS}"
        assert windows_lines(["/bin/bash", "-x", "bad", "good"], tmp_path) == f"; bad {WINDOWS}"
        assert windows_lines(["make", "all"], tmp_path) == f"; Makefile {WINDOWS}"
        for words in (["./good"], ["sh", "good"], ["sh"], ["python3", str(bad)], ["cat", str(bad)],
                      ["page.html"], ["none"], ["sh", "\0"], [str(tmp_path)]):  # fmt: skip
            assert windows_lines(words, tmp_path) == ""
        assert windows_lines([str(good)]) == ""

    def test_builds(self, tmp_path: Path) -> None:
        self.script(tmp_path / "build.sh", "\r\n")
        jail = SimpleNamespace(
            limits=SimpleNamespace(build_seconds=1),
            run=lambda *_, **__: SimpleNamespace(problem="exit status 2"),
        )
        said = program.build(jail, tmp_path, "sh build.sh")
        assert said == f"the build failed: exit status 2; build.sh {WINDOWS}"

    def test_those_of_the_autograder(self, tmp_path: Path, monkeypatch) -> None:
        """They are Unix's also where git made them Windows'."""
        original = package.TEMPLATES / "gradescope"
        (tmp_path / "gradescope").mkdir()
        for name in package.SCRIPTS:
            text = (original / name).read_bytes()
            (tmp_path / "gradescope" / name).write_bytes(text.replace(b"\n", b"\r\n"))
        monkeypatch.setattr(package, "TEMPLATES", tmp_path)
        (tmp_path / "out").mkdir()
        package.copy_scripts(tmp_path / "out")
        for name in package.SCRIPTS:
            assert (tmp_path / "out" / name).read_bytes() == (original / name).read_bytes()
            assert (tmp_path / "out" / name).stat().st_mode & 0o111


UNREADABLE = SCENE.replace('type="box"', 'type="gaussian"').replace("mesh.obj", "none.obj")


class TestUnreadable:
    """raycheck verify of a scene that oneray cannot render."""

    def test_says_so_once(self, oneray: Path, tmp_path: Path, monkeypatch) -> None:
        monkeypatch.setenv("ONERAY", str(oneray))
        path = written(tmp_path / "mine.xml", UNREADABLE)
        alone = subprocess.run([oneray, path, "--stats", "-"], capture_output=True, text=True, check=False)
        said = "; ".join(alone.stderr.splitlines())
        for words in (
            ["verify", path],
            ["verify", path, "--technique", "nee"],
            ["verify", path, "-D", "depth=3"],
        ):
            done = CliRunner().invoke(app, list(map(str, words)))
            label = "mine@depth=3" if "-D" in words else "mine"
            assert (done.exit_code, done.stdout) == (2, "")
            assert done.stderr == f"raycheck: oneray cannot render {label}: {said}\n"

    def test_two_scenes(self, oneray: Path, tmp_path: Path, monkeypatch) -> None:
        monkeypatch.setenv("ONERAY", str(oneray))
        paths = [written(tmp_path / f"{name}.xml", UNREADABLE) for name in ("a", "b")]
        with pytest.raises(NotFound, match=r"cannot render a: [^;]*; oneray cannot render b: [^;]*$"):
            raycheck.verify(scenes=paths)

    def test_a_value_that_is_none(self, oneray: Path, monkeypatch) -> None:
        monkeypatch.setenv("ONERAY", str(oneray))
        with pytest.raises(NotFound, match=r"oneray cannot render furnace@depth=deep: .*furnace\.xml:\d+: "):
            raycheck.verify(scenes=["furnace"], parameters={"depth": "deep"})

    def test_a_scene_that_is_fine(self, oneray: Path, tmp_path: Path, monkeypatch) -> None:
        """Then what is missing is the reference."""
        monkeypatch.setenv("ONERAY", str(oneray))
        written(tmp_path / "mesh.obj", MESH)
        path = written(tmp_path / "mine.xml", SCENE)
        done = CliRunner().invoke(app, ["verify", str(path)])
        assert done.exit_code == 2
        assert done.stderr.startswith(
            "raycheck: there is no reference for mine; make it with: raycheck refer"
        )
