"""oneray by itself: budgets, checkpoints, kinds of pictures, crops, sizes, interruption, limits."""

from __future__ import annotations

import json
import os
import pty
import random
import re
import resource
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from building import ROOT, cpu_seconds

from raycheck.base.images import encode_srgb, load_image

BOX = ROOT / "scenes/cornell-box.xml"


def run(*command: object, **settings) -> subprocess.CompletedProcess[str]:
    words = [str(word) for word in command]
    return subprocess.run(words, capture_output=True, text=True, timeout=60, check=False, **settings)


def figures(oneray: Path, *options: object) -> dict:
    done = run(oneray, BOX, "--stats", "-", *options)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def pixels(path: Path) -> np.ndarray:
    return oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT)


def refusal(oneray: Path, *words: object) -> str:
    done = run(oneray, *words)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    return done.stderr


def heed_interrupts() -> None:
    """What runs the tests may ignore them, and oneray would take that over."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


@pytest.mark.parametrize("estimator", ["mis", "light"])
def test_killed_twenty_times(oneray: Path, tmp_path: Path, estimator: str) -> None:
    """kill -9 at 20 random moments: the last run's film and picture are those of one run, bit for bit."""
    spp = 8000 if estimator == "mis" else 4000
    film = tmp_path / "box.film"
    command = [str(oneray), str(BOX), "--estimator", estimator, "--width", "16", "--spp", str(spp)]
    resumed = [*command, "--checkpoint", str(film), "--checkpoint-seconds", "0.03", "--resume"]
    moments = random.Random(1)
    for _ in range(20):
        process = subprocess.Popen([*resumed, "-o", str(tmp_path / "a.exr")], cwd=tmp_path)
        time.sleep(moments.uniform(0, 0.06))
        process.kill()
        process.wait()
    stats = json.loads(run(*resumed, "-o", tmp_path / "a.exr", "--stats", "-").stdout)
    assert stats["resumed_spp"] > 0
    assert stats["spp"] == spp
    whole = tmp_path / "whole.film"
    assert run(*command, "--checkpoint", whole, "-o", tmp_path / "b.exr").returncode == 0
    assert film.read_bytes() == whole.read_bytes()
    np.testing.assert_array_equal(pixels(tmp_path / "a.exr"), pixels(tmp_path / "b.exr"))


def test_no_more_is_lost_than_the_interval(oneray: Path, tmp_path: Path) -> None:
    """Between two checkpoints the program works no longer than the interval, however busy the machine is."""
    film, interval = tmp_path / "box.film", 0.6
    process = subprocess.Popen(
        [
            oneray,
            BOX,
            "--spp",
            "10000000",
            "--checkpoint",
            film,
            "--checkpoint-seconds",
            str(interval),
            "--stats",
            "-",
        ]
    )
    written, worked = 0, []
    while len(worked) < 4 and process.poll() is None:
        now = film.stat().st_mtime_ns if film.is_file() else 0
        if now != written:
            written = now
            worked.append(cpu_seconds(process.pid))
        time.sleep(0.005)
    process.kill()
    process.wait()
    assert len(worked) == 4 and np.diff([0.0, *worked]).max() < interval + 0.2, worked


def test_a_checkpoint_of_something_else(oneray: Path, tmp_path: Path) -> None:
    """Other scene, seed, technique, size or crop, or more samples than are wanted: refused, and kept."""
    film, kept = (
        tmp_path / "a.film",
        ["--checkpoint", tmp_path / "a.film", "--resume", "-o", tmp_path / "a.exr"],
    )
    assert run(oneray, BOX, "--spp", 8, *kept).returncode == 0  # there is none yet: from the start
    before = film.read_bytes()
    for other in (
        ["--seed", 1],
        ["-Ddepth=2"],
        ["--width", 32],
        ["--crop", "0,0,64,63"],
        ["--estimator", "nee"],
    ):
        assert "is a film of something else" in refusal(oneray, BOX, "--spp", 8, *other, *kept)
    assert "samples 0 to 7" in refusal(oneray, BOX, "--spp", 4, *kept)
    (tmp_path / "a.film").write_bytes(before[:-1])
    assert "the film ends early" in refusal(oneray, BOX, "--spp", 16, *kept)
    film.write_bytes(before)
    assert figures(oneray, "--spp", 16, *kept)["paths"] == 8 * 64 * 64
    assert run(oneray, BOX, "--spp", 16, "--checkpoint", tmp_path / "b.film", "--stats", "-").returncode == 0
    assert film.read_bytes() == (tmp_path / "b.film").read_bytes()
    assert "--checkpoint FILE is wanted" in refusal(oneray, BOX, "--resume", "-o", tmp_path / "c.exr")


def test_error_budget(oneray: Path, tmp_path: Path) -> None:
    """It ends at the first look that finds the stated error, which the picture's own channels confirm."""
    stats = figures(oneray, "--error", 0.08, "-o", tmp_path / "a.exr")
    image = pixels(tmp_path / "a.exr").astype(float)
    error = np.sqrt((image[..., 3:] ** 2).mean()) / image[..., :3].mean()
    assert stats["ended_by"] == "error"
    assert stats["relative_error"] == pytest.approx(error, rel=1e-4)
    assert error <= 0.08
    step = 2 ** (int(np.log2(stats["spp"] - 1)) - 3)
    assert stats["spp"] % step == 0
    assert figures(oneray, "--spp", stats["spp"] - step)["relative_error"] > 0.08


def test_error_budget_resumed(oneray: Path, tmp_path: Path) -> None:
    """Where it ends does not depend on where it was interrupted, even at the stated error."""
    one, two = tmp_path / "one.film", tmp_path / "two.film"
    error = ["--error", 1.00001 * figures(oneray, "--spp", 33)["relative_error"]]
    assert figures(oneray, *error, "--checkpoint", one)["spp"] == 36
    for spp in (3, 21, 33):
        assert figures(oneray, *error, "--spp", spp, "--checkpoint", two, "--resume")["spp"] == spp
    assert figures(oneray, *error, "--checkpoint", two, "--resume")["ended_by"] == "error"
    assert one.read_bytes() == two.read_bytes()


def test_budgets_that_cannot_be_met(oneray: Path, tmp_path: Path) -> None:
    """A black image has no relative error, Sobol' points no standard errors; the time is kept to."""
    dark = tmp_path / "dark.xml"
    dark.write_text(
        BOX.read_text().replace("<emitter", "<!-- <emitter").replace("</emitter>", "</emitter> -->")
    )
    done = run(oneray, dark, "--error", "0.01", "--stats", "-", "--width", "8")
    assert done.stderr.count("the scene has no light, the picture is black") == 1
    assert json.loads(done.stdout)["spp"] == 1024
    assert "not with --sampler sobol" in refusal(
        oneray, BOX, "--error", 0.1, "--sampler", "sobol", "--stats", "-"
    )
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    stats = figures(oneray, "--error", 1e-6, "--time", 0.3)
    assert stats["ended_by"] == "time"
    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before < 0.5


def test_kinds_of_pictures(oneray: Path, tmp_path: Path) -> None:
    """PFM holds the EXR's floats; PNG the same in sRGB, as bright as the exposure says."""
    for name in ("a.exr", "a.pfm", "a.png", "b.png"):
        options = ["--exposure", "-1.5"] if name == "b.png" else []
        assert run(oneray, BOX, "-o", tmp_path / name, "--spp", "16", *options).returncode == 0
    mean = pixels(tmp_path / "a.exr")[..., :3]
    np.testing.assert_array_equal(load_image(tmp_path / "a.pfm").pixels, mean)
    for name, stops in (("a.png", 0), ("b.png", -1.5)):
        linear = mean.astype(float) * 2**stops
        srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055).clip(0, 1)
        assert oiio.ImageBuf(str(tmp_path / name)).spec().format == oiio.UINT8
        assert np.abs(255 * pixels(tmp_path / name) - 255 * srgb).max() <= 0.501
    assert "ends with .exr, .pfm or .png" in refusal(oneray, BOX, "-o", tmp_path / "a.jpg")
    assert "--exposure is of a .png" in refusal(oneray, BOX, "-o", tmp_path / "a.exr", "--exposure", 1)


def test_crop(oneray: Path, tmp_path: Path) -> None:
    """The same bits as in the whole image, at their place; also of light paths and in films."""
    for estimator in ("mis", "light"):
        options = [oneray, BOX, "--spp", "9", "--estimator", estimator]
        assert run(*options, "-o", tmp_path / "whole.exr").returncode == 0
        assert run(*options, "-o", tmp_path / "crop.exr", "--crop", "10,20,30,5").returncode == 0
        spec = oiio.ImageBuf(str(tmp_path / "crop.exr")).spec()
        assert (spec.x, spec.y, spec.width, spec.height) == (10, 20, 30, 5)
        assert (spec.full_width, spec.full_height) == (64, 64)
        np.testing.assert_array_equal(
            pixels(tmp_path / "crop.exr"), pixels(tmp_path / "whole.exr")[20:25, 10:40]
        )
    part = [oneray, BOX, "--samples", "0:4"]
    assert run(*part, "--film", tmp_path / "a", "--crop", "0,0,64,2").returncode == 0
    assert run(*part, "--film", tmp_path / "b", "--crop", "0,2,64,2").returncode == 0
    merged = refusal(oneray, "merge", tmp_path / "a", tmp_path / "b", "-o", tmp_path / "c.png")
    assert "something else" in merged
    for wrong in ("0,0,65,1", "60,0,5,1", "0,64,1,1"):
        assert "64 x 64 pixels" in refusal(oneray, BOX, "--crop", wrong, "-o", tmp_path / "c.exr")
    assert "1 at least" in refusal(oneray, BOX, "--crop", "0,0,0,1", "-o", tmp_path / "c.exr")
    assert "X,Y,WIDTH,HEIGHT is wanted" in refusal(oneray, BOX, "--crop", "1,2,3", "-o", tmp_path / "c.exr")


def test_another_size(oneray: Path, tmp_path: Path) -> None:
    """As if the scene said so; one of the two alone keeps the image's shape."""
    scene = tmp_path / "wide.xml"
    text = BOX.read_text()
    assert '<integer name="width" value="64"/>' in text
    scene.write_text(text.replace('"width" value="64"', '"width" value="50"'))
    assert run(oneray, scene, "-o", tmp_path / "a.pfm", "--spp", "4").returncode == 0
    assert (
        run(oneray, BOX, "-o", tmp_path / "b.pfm", "--spp", "4", "--width", "50", "--height", "64").returncode
        == 0
    )
    assert (tmp_path / "a.pfm").read_bytes() == (tmp_path / "b.pfm").read_bytes()
    assert figures(oneray, "--spp", 1, "--width", 96)["height"] == 96
    assert "more than 2^28" in refusal(oneray, BOX, "--width", 60000, "-o", tmp_path / "c.exr")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("kind", ["picture", "film", "time"])
def test_interrupt_writes_what_there_is(
    oneray: Path, tmp_path: Path, kind: str, number: signal.Signals
) -> None:
    """SIGINT and SIGTERM end the render, not its result: what there is is written, and a line says so."""
    output = tmp_path / ("a.film" if kind == "film" else "a.exr")
    wanted = {
        "picture": ["--spp", "1000000", "-o", output],
        "film": ["--samples", "0:1000000", "--film", output],
        "time": ["--time", "100", "-o", output],
    }[kind]
    process = subprocess.Popen(
        [oneray, BOX, *wanted], preexec_fn=heed_interrupts, stderr=subprocess.PIPE, text=True
    )
    while process.poll() is None and cpu_seconds(process.pid) < 0.2:
        time.sleep(0.01)
    process.send_signal(number)
    said = process.communicate(timeout=20)[1]
    assert process.returncode == -number
    of = "" if kind == "time" else " of 1000000"
    line = rf"oneray: warning: interrupted: {re.escape(str(output))}: (\d+){of} samples per pixel\n"
    told = re.fullmatch(line, said)
    assert told, said
    samples = int(told[1])
    if kind == "film":
        assert run(oneray, "merge", output, "-o", tmp_path / "a.exr").returncode == 0
    assert oiio.ImageBuf(str(tmp_path / "a.exr")).spec().getattribute("samplesPerPixel") == samples
    assert run(oneray, BOX, "--spp", samples, "-o", tmp_path / "b.exr").returncode == 0
    np.testing.assert_array_equal(pixels(tmp_path / "a.exr"), pixels(tmp_path / "b.exr"))


def test_an_error_that_is_hours_away_is_said_so(oneray: Path, tmp_path: Path) -> None:
    command = [oneray, BOX, "--error", "0.00001", "-o", tmp_path / "a.exr"]
    process = subprocess.Popen(command, preexec_fn=heed_interrupts, stderr=subprocess.PIPE, text=True)
    assert process.stderr
    told = process.stderr.readline()
    process.send_signal(signal.SIGINT)
    rest = process.communicate(timeout=20)[1]
    found = re.match(r"oneray: warning: --error 1e-05 takes about ([\d.e+]+) hours more \(the error", told)
    assert found and float(found[1]) > 0.25, told
    assert "interrupted" in rest and "hours more" not in rest
    assert "hours more" not in run(oneray, BOX, "--error", "0.00001", "--time", "4").stderr


def test_out_of_memory_is_an_error(oneray: Path, tmp_path: Path) -> None:
    limit = 200 << 20
    done = run(
        oneray, BOX, "-o", tmp_path / "a.exr", "--spp", "1", "--width", "4000",
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)),
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.startswith("oneray: out of memory (")
    assert list(tmp_path.iterdir()) == []


def test_memory(oneray: Path, tmp_path: Path) -> None:
    """48 bytes per pixel for a layer, one more and the block being rendered; 24 for the picture."""
    side = 400
    little = figures(oneray, "--width", 1, "--spp", 1)["peak_memory_bytes"]
    most = figures(oneray, "--width", side, "--spp", 12, "-Ddepth=2", "-o", tmp_path / "a.exr")[
        "peak_memory_bytes"
    ]
    assert most - little < side * side * (3 * 48 + 24) + (4 << 20)


def test_progress_has_the_error(oneray: Path, tmp_path: Path) -> None:
    parent, child = pty.openpty()
    subprocess.run([oneray, BOX, "--stats", tmp_path / "stats", "--time", "1.6"], stderr=child, check=True)
    os.close(child)
    shown = os.read(parent, 10000).decode()
    assert "samples/s  error " in shown
    assert " s left" in shown


def test_values_that_expand_without_end(oneray: Path, tmp_path: Path) -> None:
    """Twenty defaults, each twice the one before, would be a megabyte; forty, a terabyte."""
    doubling = "".join(f'<default name="a{i}_" value="$a{i - 1}_$a{i - 1}_"/>\n' for i in range(1, 40))
    many = "".join(f'<default name="b{i}" value="0"/>\n' for i in range(1100))
    wide = f'<default name="c" value="{"0" * 60000}"/>\n' + '<float name="$c" value="$c"/>\n' * 1000
    for lines, message in (
        (f'<default name="a0_" value="x"/>\n{doubling}', "19: a value of more than 65536 bytes"),
        (many, "1026: more than 1024 parameters"),
        (wide, "with the $parameters replaced, larger than 64 MiB"),
    ):
        scene = tmp_path / "scene.xml"
        scene.write_text(f'<scene version="3.0.0">\n{lines}</scene>\n')
        assert message in refusal(oneray, scene, "-o", tmp_path / "a.exr")


def test_a_png_beside_the_exr(oneray: Path, tmp_path: Path) -> None:
    """Of one render; the exposure is the PNG's alone."""
    both = ("-o", tmp_path / "a.exr", "--png", tmp_path / "a.png", "--exposure", 1)
    assert run(oneray, BOX, "--spp", 16, *both).returncode == 0
    mean = 2 * pixels(tmp_path / "a.exr")[..., :3].astype(float)
    assert np.abs(255 * pixels(tmp_path / "a.png") - 255 * encode_srgb(mean.clip(0, 1))).max() <= 0.501
    assert "--png a.jpg: its name ends with .png" in refusal(oneray, BOX, "--png", "a.jpg")
    same = ("-o", tmp_path / "a.png", "--png", tmp_path / "a.png")
    assert "is given for two outputs" in refusal(oneray, BOX, *same)


def test_a_look_in_the_terminal(oneray: Path, tmp_path: Path) -> None:
    """Half blocks: each colour is the mean of the pixels below it, in sRGB, with the exposure."""
    words = (oneray, BOX, "--spp", 16, "--quiet", "-o", tmp_path / "a.exr", "--show", "--exposure", -1)
    done = run(*words, env={"COLUMNS": "16", "TERM": "xterm"})
    assert done.returncode == 0 and done.stderr == ""
    found = [[list(map(int, cell)) for cell in re.findall(r"[34]8;2;(\d+);(\d+);(\d+)m", line)]
             for line in done.stdout.splitlines()]  # fmt: skip
    shown = np.array(found).reshape(8, 16, 2, 3).transpose(0, 2, 1, 3).reshape(16, 16, 3)
    mean = pixels(tmp_path / "a.exr")[..., :3].astype(float)
    blocks = 0.5 * mean.reshape(16, mean.shape[0] // 16, 16, mean.shape[1] // 16, 3).mean(axis=(1, 3))
    assert np.abs(shown - 255 * encode_srgb(blocks.clip(0, 1))).max() <= 0.51
    plain = run(*words, env={"COLUMNS": "16", "TERM": "xterm", "NO_COLOR": "1"}).stdout
    assert [len(line) for line in plain.splitlines()] == [16] * 8 and set(plain) <= set(" .:-=+*#%@\n")
    assert "both go to standard output" in refusal(oneray, BOX, "--show", "--stats", "-")
    assert "--show" in refusal(oneray, BOX, "--show", "--check")
