"""A scene file that is not supported or not right gets one line that says where and why, and no picture.

Each file of malformed/ has one fault, and the message it must get in a comment.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

MALFORMED = Path(__file__).parent / "malformed"
FILES = sorted(MALFORMED.glob("*.xml"))
EXPECT = re.compile(rb"<!-- expect: (.*?) -->")

VALID = """<scene version="3.0.0">
    <default name="grey" value=".5"/>
    <default name="gr" value="never"/>
    <default name="max_depth" value="2"/>
    <integrator type="path">
        <integer name="max_depth" value="$max_depth"/>
    </integrator>
    <sensor type="perspective">
        <float name="fov" value="40"/>
        <film type="hdrfilm">
            <integer name="width" value="4"/>
            <integer name="height" value="2"/>
            <rfilter type="box"/>
        </film>
        <sampler type="independent">
            <integer name="sample_count" value="1"/>
        </sampler>
    </sensor>
    <bsdf type="diffuse" id="paint">
        <rgb name="reflectance" value="$grey, $grey .5"/>
    </bsdf>
    <shape type="sphere">
        <point name="center" x="0" y="0" z="5"/>
        <ref id="paint"/>
    </shape>
    <emitter type="constant"/>
</scene>
"""


def run(oneray: Path, scene: Path, out: Path, *options: str) -> subprocess.CompletedProcess[str]:
    """Runs oneray on a scene; what it prints may hold any bytes."""
    command = [str(oneray), str(scene), "-o", str(out), *options]
    return subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=60, check=False)


def refused(oneray: Path, scene: Path, out: Path, *options: str) -> str:
    """The one line with which oneray refuses a scene, after checking that this is all it does."""
    result = run(oneray, scene, out, *options)
    assert result.returncode == 2, result.stderr
    assert result.stdout == ""
    assert list(out.parent.iterdir()) == []
    assert result.stderr.endswith("\n")
    assert len(result.stderr.splitlines()) == 1
    return result.stderr.rstrip("\n")


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """A picture's name in a directory that is empty."""
    directory = tmp_path / "out"
    directory.mkdir()
    return directory / "out.exr"


def write(tmp_path: Path, text: str | bytes) -> Path:
    """A scene file with this text."""
    scene = tmp_path / "scene.xml"
    scene.write_bytes(text if isinstance(text, bytes) else text.encode())
    return scene


def test_there_are_enough_malformed_scenes() -> None:
    assert len(FILES) >= 60


@pytest.mark.parametrize("scene", FILES, ids=lambda scene: scene.stem)
def test_malformed(oneray: Path, out: Path, scene: Path) -> None:
    found = EXPECT.search(scene.read_bytes())
    assert found
    assert refused(oneray, scene, out) == f"{scene}:{found[1].decode()}"


def test_missing_file(oneray: Path, out: Path, tmp_path: Path) -> None:
    scene = tmp_path / "nothing.xml"
    assert refused(oneray, scene, out) == f"oneray: {scene}: No such file or directory"


def test_directory(oneray: Path, out: Path) -> None:
    assert refused(oneray, MALFORMED, out) == f"oneray: {MALFORMED}: Is a directory"


def test_empty(oneray: Path, out: Path, tmp_path: Path) -> None:
    scene = tmp_path / "empty.xml"
    scene.touch()
    assert refused(oneray, scene, out) == f"oneray: {scene}: the file is empty"


def test_too_large_a_file(oneray: Path, out: Path, tmp_path: Path) -> None:
    scene = tmp_path / "large.xml"
    with scene.open("wb") as stream:
        stream.truncate((64 << 20) + 1)
    message = f"oneray: {scene}: larger than 64 MiB, which is the limit for a scene file"
    assert refused(oneray, scene, out) == message


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "iso-8859-1"])
def test_encodings(oneray: Path, out: Path, tmp_path: Path, encoding: str) -> None:
    text = f'<?xml version="1.0" encoding="{encoding}"?>\n' + VALID
    result = run(oneray, write(tmp_path, text.encode(encoding)), out)
    assert (result.returncode, result.stderr) == (0, "")


def test_windows_line_ends(oneray: Path, out: Path, tmp_path: Path) -> None:
    scene = write(tmp_path, VALID.replace("\n", "\r\n").replace('type="sphere"', 'type="ball"'))
    message = (
        '<shape type="ball"> is not supported (rectangle, disk, cube, sphere, cylinder, ply, obj, serialized)'
    )
    assert refused(oneray, scene, out) == f"{scene}:22: {message}"


def test_parameter_has_the_longest_name_that_fits(oneray: Path, out: Path, tmp_path: Path) -> None:
    """$grey is the parameter grey, not gr followed by "ey"."""
    result = run(oneray, write(tmp_path, VALID), out)
    assert (result.returncode, result.stderr) == (0, "")


def test_parameter_of_the_command_line(oneray: Path, out: Path, tmp_path: Path) -> None:
    scene = write(tmp_path, VALID)
    assert refused(oneray, scene, out, "-Dgrey=1.5") == f'{scene}:20: "reflectance" must be in [0,1], not 1.5'


def test_parameter_without_default(oneray: Path, out: Path, tmp_path: Path) -> None:
    scene = write(tmp_path, VALID.replace('<default name="grey" value=".5"/>', ""))
    assert run(oneray, scene, out, "-Dgrey=0.25").returncode == 0


def test_parameter_that_is_not_in_the_scene(oneray: Path, out: Path, tmp_path: Path) -> None:
    scene = write(tmp_path, VALID)
    message = 'oneray: -Dgray=1: the scene uses no parameter "gray" (it has: grey, gr, max_depth)'
    assert refused(oneray, scene, out, "-Dgray=1") == message


def test_parameter_that_no_attribute_mentions(oneray: Path, out: Path, tmp_path: Path) -> None:
    scene = write(tmp_path, VALID)
    message = 'oneray: -Dgr=1: the scene uses no parameter "gr" (it has: '
    assert refused(oneray, scene, out, "-Dgr=1").startswith(message)


def test_parameter_given_twice(oneray: Path, out: Path, tmp_path: Path) -> None:
    scene = write(tmp_path, VALID)
    assert refused(oneray, scene, out, "-Dgrey=0", "-Dgrey=1") == "oneray: -Dgrey is given twice"


def test_escaped_dollar_is_no_parameter(oneray: Path, out: Path, tmp_path: Path) -> None:
    scene = write(tmp_path, VALID.replace('type="sphere"', r'type="\$sphere"'))
    assert refused(oneray, scene, out).startswith(f'{scene}:22: <shape type="$sphere"> is not supported')


def test_reference_before_its_bsdf(oneray: Path, out: Path, tmp_path: Path) -> None:
    """As in Mitsuba, a <ref> may come first."""
    bsdf = re.search(r"    <bsdf.*?</bsdf>\n", VALID, re.DOTALL)
    assert bsdf is not None
    scene = write(tmp_path, VALID.replace(bsdf[0], "").replace("    <emitter", bsdf[0] + "    <emitter"))
    assert run(oneray, scene, out).returncode == 0


def test_bsdf_that_refers_to_one_that_refers_to_it(oneray: Path, out: Path, tmp_path: Path) -> None:
    loop = """    <bsdf type="twosided" id="one"><ref id="other"/></bsdf>
    <bsdf type="twosided" id="other"><ref id="one"/></bsdf>
</scene>"""
    scene = write(tmp_path, VALID.replace("</scene>", loop))
    assert refused(oneray, scene, out).endswith("the bsdf contains itself")


def test_many_shapes_with_ids_are_read_in_no_time(oneray: Path, out: Path, tmp_path: Path) -> None:
    """Looking up a hundred thousand ids must not take time by their square."""
    bsdfs = "".join(f'<bsdf type="diffuse" id="b{i}"/>\n' for i in range(100_000))
    scene = write(tmp_path, VALID.replace("</scene>", bsdfs + '<ref id="none"/></scene>'))
    assert "nothing has this id" in refused(oneray, scene, out)
