"""oneray's command line: what it writes, how it ends, what it refuses."""

from __future__ import annotations

import contextlib
import json
import os
import re
import resource
import shlex
import shutil
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from building import ROOT, build, cpu_seconds
from disks import on_a_full_disk

BOX = ROOT / "scenes/cornell-box.xml"
POINT = ROOT / "scenes/point-light.xml"
MIRROR = ROOT / "scenes/mirror-light.xml"


def run(*command: str | Path, **settings) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, **settings)


def refusal(oneray: Path, *words: str | Path) -> str:
    """The one line of an error, with its exit status."""
    done = run(oneray, *words)
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1
    assert done.stdout == ""
    return done.stderr


def test_picture_and_attributes(oneray: Path, tmp_path: Path) -> None:
    """Float32 channels of mean and standard error, and what the picture was made with."""
    assert run(oneray, BOX, "-o", tmp_path / "out.exr", "--spp", "16", "--seed", "3").returncode == 0
    image = oiio.ImageBuf(str(tmp_path / "out.exr"))
    spec = image.spec()
    assert list(spec.channelnames) == ["R", "G", "B", "stderr.R", "stderr.G", "stderr.B"]
    assert spec.format == oiio.FLOAT
    assert spec.getattribute("samplesPerPixel") == 16
    assert spec.getattribute("renderTimeSeconds") > 0
    assert "--seed 3" in spec.getattribute("oneray")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.exr"]


def test_noise_is_written_as_it_is(oneray: Path, tmp_path: Path) -> None:
    """Every float of a noisy picture reads back as the film has it, whatever the noise."""
    for seed in [*range(12), 1505037579]:
        options = [oneray, ROOT / "scenes/furnace.xml", "--estimator", "walk", "--seed", str(seed)]
        assert run(*options, "--spp", "128", "-o", tmp_path / "out.exr").returncode == 0
        assert run(*options, "--samples", "0:128", "--film", tmp_path / "film").returncode == 0
        film = (tmp_path / "film").read_bytes()
        layer = np.frombuffer(film[-32 * 32 * 6 * 8 :], "<f8").reshape(32, 32, 6)
        pixels = oiio.ImageBuf(str(tmp_path / "out.exr")).get_pixels(oiio.FLOAT)
        np.testing.assert_array_equal(pixels[..., :3], (layer[..., :3] / 128).astype(np.float32))


def test_standard_error_is_the_spread_of_seeds(oneray: Path, tmp_path: Path) -> None:
    """stderr², averaged over 24 seeds, is the variance between them: in the mean over the pixels within 5
    standard errors, √(2 / 23 / 4096) each if a pixel's channels say the same."""
    means, squares = [], []
    for seed in range(24):
        assert (
            run(oneray, BOX, "-o", tmp_path / "out.exr", "--spp", "64", "--seed", str(seed)).returncode == 0
        )
        pixels = oiio.ImageBuf(str(tmp_path / "out.exr")).get_pixels(oiio.FLOAT).astype(float)
        means.append(pixels[..., :3])
        squares.append(pixels[..., 3:] ** 2)
    of_seeds, claimed = np.var(means, axis=0, ddof=1), np.mean(squares, axis=0)
    assert abs((of_seeds[claimed > 0] / claimed[claimed > 0]).mean() - 1) < 0.023


def test_one_sample_has_no_standard_error(oneray: Path, tmp_path: Path) -> None:
    assert run(oneray, BOX, "-o", tmp_path / "out.exr", "--spp", "1").returncode == 0
    assert list(oiio.ImageBuf(str(tmp_path / "out.exr")).spec().channelnames) == ["R", "G", "B"]


def test_sobol_points_have_no_standard_error(oneray: Path, tmp_path: Path) -> None:
    """Their spread is not that of a mean of independent samples. Picture and figures name the sampler."""
    for sampler, channels in (("sobol", ["R", "G", "B"]), ("independent", None)):
        options = ["-o", tmp_path / "out.exr", "--spp", "16", "--sampler", sampler, "--stats", "-"]
        done = run(oneray, BOX, *options)
        assert done.returncode == 0, done.stderr
        stats, spec = json.loads(done.stdout), oiio.ImageBuf(str(tmp_path / "out.exr")).spec()
        assert channels is None or list(spec.channelnames) == channels
        assert f"--sampler {sampler}" in stats["technique"]
        assert f"--sampler {sampler} " in spec.getattribute("oneray")
        assert ("Sobol' points" in stats["features"]) == (sampler == "sobol")


def test_constant_pixels_have_no_error_at_all(oneray: Path, tmp_path: Path) -> None:
    """Where every sample is the same, the standard error is exactly 0, also at odd counts."""
    assert run(oneray, BOX, "-Ddepth=1", "-o", tmp_path / "out.exr", "--spp", "37").returncode == 0
    pixels = oiio.ImageBuf(str(tmp_path / "out.exr")).get_pixels(oiio.FLOAT)
    lit = pixels[..., 0] == pixels[..., 0].max()
    assert lit.sum() > 10
    assert (pixels[lit][:, 3:] == 0).all()
    assert (pixels[pixels[..., 0] == 0][:, 3:] == 0).all()


def test_stats(oneray: Path, tmp_path: Path) -> None:
    """JSON that counts: paths, and rays within what the depth allows."""
    done = run(oneray, BOX, "--stats", "-", "--spp", "4", "-Ddepth=3")
    stats = json.loads(done.stdout)
    assert (stats["width"], stats["height"], stats["spp"], stats["paths"]) == (64, 64, 4, 64 * 64 * 4)
    assert stats["paths"] <= stats["rays"] <= 3 * stats["paths"]
    assert 0 < stats["shadow_rays"] <= 2 * stats["paths"]
    assert "mirror" not in stats["features"]
    assert set(stats["features"]).isdisjoint(stats["left_out"])
    assert {"load", "build", "render", "write"} == set(stats["seconds"])
    assert run(oneray, BOX, "--stats", tmp_path / "s.json", "--spp", "1").returncode == 0
    assert json.loads((tmp_path / "s.json").read_text())["spp"] == 1


def test_time_budget(oneray: Path) -> None:
    """--time renders for about as long, and says how many samples that gave; at least one."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    done = run(oneray, BOX, "--time", "1", "--stats", "-")
    stats = json.loads(done.stdout)
    assert stats["spp"] > 1
    worked = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    assert stats["seconds"]["render"] > 0.3 and worked < 2, "no longer, however busy the machine is"
    assert json.loads(run(oneray, BOX, "--time", "0.000001", "--stats", "-").stdout)["spp"] == 1


def test_sample_count_is_the_scenes_unless_given(oneray: Path) -> None:
    assert json.loads(run(oneray, BOX, "--stats", "-").stdout)["spp"] == 64


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGKILL])
def test_a_signal_leaves_no_half_file(oneray: Path, tmp_path: Path, number: signal.Signals) -> None:
    """Ended in the middle of the render: no picture, no temporary file, and an older picture untouched."""
    (tmp_path / "out.exr").write_bytes(b"older")

    def heed() -> None:  # what runs the tests may ignore it, and oneray would take that over
        if number != signal.SIGKILL:
            signal.signal(number, signal.SIG_DFL)

    command = [oneray, BOX, "-o", tmp_path / "out.exr", "--spp", "1000000"]
    process = subprocess.Popen(command, preexec_fn=heed)
    while process.poll() is None and cpu_seconds(process.pid) < 0.1:
        time.sleep(0.01)
    process.send_signal(number)
    assert process.wait(10) == -number
    assert [path.name for path in tmp_path.iterdir()] == ["out.exr"]
    assert (tmp_path / "out.exr").read_bytes() == b"older"


def test_full_disk(oneray: Path, tmp_path: Path) -> None:
    """A file that cannot be finished is an error, and gone."""

    def limit() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))

    for option in (["-o", tmp_path / "out.exr"], ["--samples", "0:4", "--film", tmp_path / "a.film"]):
        done = run(oneray, BOX, *option, preexec_fn=limit)
        assert done.returncode == 2, done.stderr
        assert "cannot be written" in done.stderr
        assert list(tmp_path.iterdir()) == []
    if Path("/dev/full").exists():
        with Path("/dev/full").open("w") as full:
            done = subprocess.run(
                [oneray, BOX, "--stats", "-"], stdout=full, stderr=subprocess.PIPE, check=False
            )
        assert done.returncode == 2
        assert b"cannot be written" in done.stderr


def test_output_is_checked_before_rendering(oneray: Path, tmp_path: Path) -> None:
    """What cannot be written is said at once, not after a render of hours."""
    start = time.monotonic()
    line = refusal(oneray, BOX, "-o", tmp_path / "no/such/out.exr", "--spp", "100000000")
    assert "No such file or directory" in line
    assert "a folder" in refusal(oneray, BOX, "--stats", tmp_path)
    assert "a device" in refusal(oneray, BOX, "--stats", "/dev/null")
    assert time.monotonic() - start < 30


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "a scene is wanted"),
        (["missing.xml", "-o", "out.exr"], "missing.xml"),
        ([BOX], "nothing to do"),
        ([BOX, BOX, "-o", "out.exr"], "one scene is wanted"),
        ([BOX, "-o"], "a value is wanted after it"),
        ([BOX, "--spp", "0", "-o", "out.exr"], "--spp 0: a whole number from 1"),
        ([BOX, "--spp", "1e3", "-o", "out.exr"], "--spp 1e3: a whole number"),
        ([BOX, "--spp", "-3", "-o", "out.exr"], "--spp -3: a whole number"),
        (
            [BOX, "--seed", "18446744073709551616", "-o", "out.exr"],
            "--seed 18446744073709551616: a whole number",
        ),
        ([BOX, "--time", "soon", "-o", "out.exr"], "--time soon: a number between 0 and"),
        ([BOX, "--spp", "1", "--time", "1", "-o", "out.exr"], "give one of them"),
        ([BOX, "--estimator", "bdpt", "-o", "out.exr"], "is not supported (walk, nee, mis, light, bidirec"),
        ([BOX, "--estimator", "light", "--light-points", "area", "-o", "out.exr"], "does nothing there"),
        ([BOX, "--estimator", "light", "--light-choice", "learned", "-o", "out.exr"], "uniform or power"),
        ([MIRROR, "--estimator", "light", "-o", "out.exr"], "shows a mirror or glass"),
        (
            [BOX, "--mis-pdf", "survival", "--estimator", "nee", "-o", "out.exr"],
            "goes with --estimator mis only",
        ),
        ([BOX, "--mis-pdf", "survival", "--roulette", "none", "-o", "out.exr"], "every path survives"),
        ([BOX, "--light-points", "corner", "-o", "out.exr"], "is not supported (area, facing, cone)"),
        ([BOX, "--sampler", "halton", "-o", "out.exr"], "is not supported (independent, sobol)"),
        ([BOX, "--light-choice", "best", "-o", "out.exr"], "power, contribution, learned, resampled)"),
        ([BOX, "--mis", "power", "--estimator", "nee", "-o", "out.exr"], "goes with --estimator mis only"),
        ([BOX, "--light-choice", "power", "--estimator", "walk", "-o", "out.exr"], "sends no ray to a light"),
        ([POINT, "--estimator", "walk", "-o", "out.exr"], "no random ray hits a point light"),
        ([BOX, "-Ddepth=-1", "--roulette", "none", "-o", "out.exr"], "its paths would never end"),
        ([BOX, "-Ddeep=3", "-o", "out.exr"], "deep"),
        ([BOX, "-Ddepth=3", "-Ddepth=4", "-o", "out.exr"], "is given twice"),
        ([BOX, "-Ddepth", "-o", "out.exr"], "-Dname=value is wanted"),
        ([BOX, "--lanes", "3", "-o", "out.exr"], "no such kernel"),
        ([BOX, "--precision", "half", "-o", "out.exr"], "is not supported (auto, double, single)"),
        ([BOX, "--samples", "0:4", "-o", "out.exr"], "--samples and --film go together"),
        ([BOX, "--samples", "4", "--film", "a.film"], "FIRST:COUNT is wanted"),
        ([BOX, "--bounces", "4", "-o", "out.exr"], "--bounces is no option"),
        (["merge", "-o", "out.exr"], "no film is given"),
        (["merge", BOX, "-o", "out.exr"], "is not a film"),
        (["merge", "a.film"], "-o OUT.exr is wanted"),
    ],
    ids=lambda value: " ".join(Path(word).name for word in value) if isinstance(value, list) else "",
)
def test_refused(oneray: Path, words: list[str | Path], message: str, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert message in refusal(oneray, *words)
    assert list(tmp_path.iterdir()) == []


def test_endless_paths_are_an_error(oneray: Path, tmp_path: Path) -> None:
    """A closed scene that absorbs nothing, without a depth limit: said with the pixel, not cut short."""
    scene = tmp_path / "closed.xml"
    scene.write_text(
        '<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="-1"/></integrator>'
        '<sensor type="perspective"><float name="fov" value="40"/><film type="hdrfilm">'
        '<integer name="width" value="2"/><integer name="height" value="1"/><rfilter type="box"/></film>'
        '<sampler type="independent"><integer name="sample_count" value="1"/></sampler></sensor>'
        '<shape type="cube"><boolean name="flip_normals" value="true"/><bsdf type="conductor">'
        '<string name="material" value="none"/></bsdf></shape></scene>'
    )
    done = run(oneray, scene, "-o", tmp_path / "out.exr", "--quiet")
    assert done.returncode == 2
    assert "a path did not end within" in done.stderr
    assert not (tmp_path / "out.exr").exists()


def test_nothing_that_is_read_is_overwritten(oneray: Path, tmp_path: Path) -> None:
    """An output that is the scene, a film being merged, or another output is refused; a link is followed."""
    scene = tmp_path / "box.xml"
    scene.write_bytes(BOX.read_bytes())
    assert "it is read as" in refusal(oneray, scene, "--stats", scene)
    assert scene.read_bytes() == BOX.read_bytes()
    part = tmp_path / "film.exr"
    assert run(oneray, scene, "--samples", "0:2", "--film", part).returncode == 0
    before = part.read_bytes()
    assert "it is read as" in refusal(oneray, "merge", part, "-o", part)
    assert part.read_bytes() == before
    assert "two outputs" in refusal(oneray, scene, "-o", tmp_path / "x.exr", "--stats", tmp_path / "x.exr")
    (tmp_path / "real.exr").touch()
    (tmp_path / "link.exr").symlink_to("real.exr")
    assert run(oneray, scene, "-o", tmp_path / "link.exr", "--spp", "1").returncode == 0
    assert (tmp_path / "link.exr").is_symlink()
    assert (tmp_path / "real.exr").stat().st_size > 0


def test_damaged_films_are_refused(oneray: Path, tmp_path: Path) -> None:
    assert run(oneray, BOX, "--samples", "0:2", "--film", tmp_path / "good").returncode == 0
    good = (tmp_path / "good").read_bytes()
    damaged = [
        good[:-1],
        good + b"x",
        good[:-8] + np.array([np.nan]).tobytes(),
        good.replace(b"\n1 0\n", b"\n1 -1\n"),
    ]
    for number, data in enumerate(damaged):
        (tmp_path / "bad").write_bytes(data)
        assert "film" in refusal(oneray, "merge", tmp_path / "bad", "-o", tmp_path / "out.exr"), number
    assert not (tmp_path / "out.exr").exists()


def test_films_are_little_endian(oneray: Path, tmp_path: Path) -> None:
    """On every machine, and lines of text before the numbers: made here by hand, and one of oneray's read."""
    sums = np.array([[[1, 2, 3, 0, 0, 0], [4, 0.1, 1e-30, 0, 0, 0]]])
    made = tmp_path / "made.film"
    made.write_bytes(b"oneray film 2\nby hand\n2 1 0 0 2 1 1\n1 0\n" + sums.astype("<f8").tobytes())
    assert run(oneray, "merge", made, "-o", tmp_path / "made.pfm").returncode == 0
    picture = oiio.ImageBuf(str(tmp_path / "made.pfm")).get_pixels(oiio.FLOAT)
    np.testing.assert_array_equal(picture, (sums[..., :3] / 2).astype(np.float32))
    command = [oneray, BOX, "--width", "3", "--height", "2", "--samples", "0:2", "--film", tmp_path / "ours"]
    assert run(*command).returncode == 0
    start, identity, size, layer, numbers = (tmp_path / "ours").read_bytes().split(b"\n", 4)
    assert (start, size, layer) == (b"oneray film 2", b"3 2 0 0 3 2 1", b"1 0")
    assert identity.startswith(b"scene ")
    assert run(oneray, "merge", tmp_path / "ours", "-o", tmp_path / "ours.exr").returncode == 0
    picture = oiio.ImageBuf(str(tmp_path / "ours.exr")).get_pixels(oiio.FLOAT)
    means = np.frombuffer(numbers, "<f8").reshape(2, 3, 6)[..., :3] / 2
    np.testing.assert_array_equal(picture[..., :3], means.astype(np.float32))


def test_help_and_version(oneray: Path) -> None:
    """--help names the lecture's technique of every value of an option, and marks each one's default."""
    text = run(oneray, "--help").stdout
    found = re.findall(r"^  (--\S+)[^\n]*\n((?:      \w+ *\*? +\S[^\n]*\n)+)", text, re.MULTILINE)
    line = re.compile(r"^ +(\w+) *\*? +(.*)$", re.MULTILINE)
    values = {option: dict(line.findall(listed)) for option, listed in found}
    assert {option: " ".join(listed) for option, listed in values.items()} == {
        "--estimator": "walk nee mis light bidirectional photons",
        "--hemisphere": "uniform cosine",
        "--normals": "all visible",
        "--light-choice": "uniform power contribution learned resampled",
        "--light-points": "area facing cone",
        "--mis": "balance power",
        "--mis-pdf": "bsdf survival",
        "--roulette": "none survival",
        "--fresnel": "exact schlick",
        "--sampler": "independent sobol",
        "--precision": "auto double single",
        "--lanes": "auto",
        "--kernel": "auto generic",
    }
    said = [words for option in list(values)[:9] for words in values[option].values()]
    assert all(re.match(r"[LPT]\d+", words) for words in said)
    named = {int(number) for number in re.findall(r"L(\d+)", text)}
    assert {*range(1, 20)} - named == {16}  # mixed materials are the scene's
    assert all(len(re.findall(r"^ +\w+ *\* ", listed, re.MULTILINE)) == 1 for _, listed in found)
    assert max(map(len, text.splitlines())) <= 110
    assert run(oneray, "--version").stdout.startswith("oneray ")


def test_progress_only_on_a_terminal(oneray: Path, tmp_path: Path) -> None:
    import pty

    assert run(oneray, BOX, "-o", tmp_path / "out.exr", "--spp", "4").stderr == ""
    parent, child = pty.openpty()
    subprocess.run([oneray, BOX, "-o", tmp_path / "out.exr", "--spp", "64"], stderr=child, check=True)
    os.close(child)
    shown = os.read(parent, 10000).decode()
    assert "100 %" in shown
    assert "samples/s" in shown


FORMATS = {
    "exr": ["-o", "out.exr"],
    "pfm": ["-o", "out.pfm"],
    "png": ["-o", "out.png", "--width", "300"],
    "film": ["--samples", "0:4", "--film", "out.film"],
    "stats": ["--stats", "out.json"],
}


@pytest.mark.parametrize("kind", FORMATS)
def test_a_full_disk_is_called_that(kind: str, oneray: Path, tmp_path: Path) -> None:
    """In every format, and nothing is left."""
    disk = tmp_path / "disk"
    disk.mkdir()
    words = [disk / word if word.startswith("out.") else word for word in FORMATS[kind]]
    size = "4k" if kind == "stats" else "32k"
    full = f'head -c 4096 /dev/zero > "{disk}/x" && ' if kind == "stats" else ""
    done = on_a_full_disk(disk, ["sh", "-c", f'{full}exec "$0" "$@"', oneray, BOX, *words], size)
    assert done.returncode == 2
    [out] = [word for word in words if isinstance(word, Path)]
    line, *left = done.stderr.splitlines()
    assert line == f"oneray: {out}: cannot be written: No space left on device"
    assert left == (["x"] if full else [])


def test_a_checkpoint_that_cannot_be_written_is_a_warning(oneray: Path, tmp_path: Path) -> None:
    """The render goes on to its end, and its picture has all samples."""
    disk, picture = tmp_path / "disk", tmp_path / "out.pfm"
    disk.mkdir()
    options = ["--checkpoint", disk / "c", "--checkpoint-seconds", "0.01", "-o", picture, "--spp", "64"]
    done = on_a_full_disk(disk, [oneray, BOX, *options])
    assert done.returncode == 0
    assert done.stderr and set(done.stderr.splitlines()) == {
        f"oneray: warning: {disk / 'c'}: cannot be written: No space left on device; the render goes on"
    }
    assert run(oneray, BOX, "-o", tmp_path / "whole.pfm", "--spp", "64").returncode == 0
    assert picture.read_bytes() == (tmp_path / "whole.pfm").read_bytes()


def test_part_files_of_killed_renders_are_swept(oneray: Path, tmp_path: Path) -> None:
    """By the next run that writes the same file and can lock them; what a living run writes stays."""
    import fcntl

    out = tmp_path / "out.exr"
    names = ("out.exr.1.part", "out.exr.x.part", "out.exr.2.partly", "other.exr.1.part")
    for name in names:
        (tmp_path / name).write_bytes(b"x")
    with (tmp_path / "out.exr.2.part").open("w") as living:
        fcntl.lockf(living, fcntl.LOCK_EX)
        assert run(oneray, BOX, "-o", out, "--spp", "1").returncode == 0
        assert {path.name for path in tmp_path.iterdir()} == {*names[1:], "out.exr.2.part", "out.exr"}
    (tmp_path / "link.exr").symlink_to("out.exr")
    assert run(oneray, BOX, "-o", tmp_path / "link.exr", "--spp", "1").returncode == 0
    assert not (tmp_path / "out.exr.2.part").exists()


def test_a_render_that_is_writing_has_its_file_locked(oneray: Path, tmp_path: Path) -> None:
    """Killed over its write, it leaves a file that the next run removes; before that nobody can."""
    import fcntl

    out = tmp_path / "out.film"
    command = [oneray, BOX, "--samples", "0:1", "--film", out, "--width", "1500"]
    process = subprocess.Popen(command)
    locked = False
    while process.poll() is None:
        for path in tmp_path.glob("out.film.*.part"):
            with contextlib.suppress(FileNotFoundError), path.open("r+") as part:
                if path.stat().st_size:
                    with pytest.raises(OSError):
                        fcntl.lockf(part, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    locked = True
                    process.kill()
                    process.wait()
    assert locked and len(list(tmp_path.iterdir())) == 1
    assert run(*command[:-1], "30").returncode == 0
    assert [path.name for path in tmp_path.iterdir()] == ["out.film"]


def test_words_of_the_command_line(oneray: Path, tmp_path: Path) -> None:
    """- is standard input, -- ends the options, --option=VALUE is --option VALUE, -h is --help."""
    (tmp_path / "--odd.xml").write_bytes(BOX.read_bytes())
    first, second, third = (tmp_path / f"{name}.pfm" for name in "abc")
    assert run(oneray, BOX, "-o", first, "--spp", "4", "--seed", "7").returncode == 0
    with BOX.open() as scene:
        words = ["-", "-o", second, "--spp=4", "--seed=7", "--estimator=mis"]
        done = run(oneray, *words, stdin=scene, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    options = ["-o", third, "--spp=4", "--seed=7"]
    assert run(oneray, *options, "--", "--odd.xml", cwd=tmp_path).returncode == 0
    assert first.read_bytes() == second.read_bytes() == third.read_bytes()
    assert run(oneray, BOX, "--samples=0:2", "--film", tmp_path / "--a.film").returncode == 0
    assert run(oneray, "merge", "-o", tmp_path / "m.exr", "--", "--a.film", cwd=tmp_path).returncode == 0
    assert run(oneray, "-h").stdout == run(oneray, "--help").stdout == run(oneray, "merge", "-h").stdout
    broken = run(oneray, "-", "--stats", "-", input="<scene")
    assert broken.returncode == 2 and broken.stderr.startswith("-:1: ")
    with BOX.open() as scene:
        done = run(oneray, "-", "--stats", "-", "--spp=1", stdin=scene)
    assert json.loads(done.stdout)["scene"] == "-"


def test_a_bug_is_no_error_of_the_users(tmp_path: Path) -> None:
    """Its exit status is 70; its line says which sample of how many, the seed, and the command to repeat it.
    Here sample 5 of a pixel counts as no radiance.
    """
    copy = tmp_path / "copy"
    shutil.copytree(ROOT / "src/oneray", copy / "src/oneray")
    shutil.copy(ROOT / "Makefile", copy)
    reduce = copy / "src/oneray/film/film.c"
    text = reduce.read_text(encoding="utf-8")
    assert text.count("if (!(radiance[i] >= 0 && radiance[i] <= DBL_MAX))") == 1
    reduce.write_text(text.replace("if (!(radiance[i] >= 0 && radiance[i] <= DBL_MAX))", "if (i == 15)"))
    broken = build(tmp_path / "build", copy, KERNELS="generic", LANES="native", CFLAGS="-O1")
    scene = tmp_path / "a scene.xml"
    scene.write_bytes(BOX.read_bytes())
    words = [broken, scene, "--seed", "7", "--spp", "8", "-Ddepth=3", "-o", tmp_path / "out.exr"]
    done = run(*words)
    assert done.returncode == 70 and done.stdout == "" and not (tmp_path / "out.exr").exists()
    start, again = done.stderr.split(": a bug, please report it; again: ")
    assert start.startswith(f"oneray: {scene}: pixel (0, 0), sample 5 of 8, seed 7: radiance (")
    assert shlex.split(again) == [str(word) for word in words] and done.stderr.count("\n") == 1
    assert run(*shlex.split(again)).stderr == done.stderr
