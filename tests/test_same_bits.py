"""The picture depends on scene, technique, precision, samples and seed: not on the lanes, the kernel, the
compiler, nor on the pieces in which it was rendered. Films are compared byte by byte."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from building import ROOT, build, kernels

SCENES = [*sorted((ROOT / "scenes").glob("*.xml")), ROOT / "tests/everything.xml"]
ODD = sorted((ROOT / "tests/odd").glob("*.xml"))
TECHNIQUES = {
    "mis": [],
    "nee-uniform": ["--estimator", "nee", "--hemisphere", "uniform", "--light-choice", "uniform"],
    "mis-balance": ["--mis", "balance", "--roulette", "none"],
    "walk": ["--estimator", "walk"],
    "learned": ["--light-choice", "learned", "--light-points", "facing", "--mis-pdf", "survival"],
    "light": ["--estimator", "light"],
    "bidirectional": ["--estimator", "bidirectional"],
    "joined": ["--estimator", "bidirectional", "--strategy", "2,2", "--mis", "balance"],
    "sobol": ["--sampler", "sobol"],
    "resampled": ["--light-choice", "resampled", "--candidates", "3"],
}


def film(oneray: Path, scene: Path, target: Path, *options: str, samples: str = "0:5") -> bytes | None:
    """The film of a few samples of each pixel; None where the technique does not apply to the scene."""
    command = [oneray, scene, "--samples", samples, "--film", target, *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if "walk" in options and "no random ray hits" in done.stderr:
        return None
    if "light" in options and "shows a mirror or glass" in done.stderr:
        return None
    refused = "hide_emitters" in done.stderr or "bumpmap" in done.stderr
    if refused and {"light", "bidirectional"} & set(options):
        return None
    if "none" in options and "would never end" in done.stderr:
        return None
    assert done.returncode == 0, done.stderr
    return target.read_bytes()


def instance(oneray: Path, scene: Path, *options: str) -> str:
    """The kernel's instance that renders the scene unasked; "generic" where the technique does not apply."""
    command = [oneray, scene, "--spp", "1", "--stats", "-", *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return json.loads(done.stdout)["kernel"] if done.returncode == 0 else "generic"


@pytest.mark.sample(100)
@pytest.mark.parametrize("technique", TECHNIQUES)
@pytest.mark.parametrize("scene", [*SCENES, *ODD], ids=lambda path: path.stem)
def test_lanes_and_kernels(oneray: Path, tmp_path: Path, scene: Path, technique: str) -> None:
    """Every width of each precision, specialised and generic, gives the same film."""
    available = kernels(oneray)
    assert {("double", 1), ("single", 1)} <= set(available)
    for precision in ("double", "single"):
        options = [*TECHNIQUES[technique], "--precision", precision]
        special = instance(oneray, scene, *options) != "generic"
        films = {
            f"{lanes} lanes, {kernel}": film(
                oneray, scene, tmp_path / "film", *options, "--lanes", str(lanes), "--kernel", kernel
            )
            for name, lanes in available
            if name == precision
            for kernel in (("auto", "generic") if special else ("generic",))
        }
        reference = films["1 lanes, generic"]
        assert [name for name, data in films.items() if data != reference] == []


def test_widths_that_this_machine_lacks(oneray: Path) -> None:
    """A width that the processor does not run is refused in a line."""
    missing = {("double", w) for w in (8, 4, 2, 1)} | {("single", w) for w in (16, 8, 4, 1)}
    missing -= set(kernels(oneray))
    for precision, lanes in missing:
        command = [oneray, SCENES[0], "--stats", "-", "--precision", precision, "--lanes", str(lanes)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 2
        assert "no such kernel" in done.stderr
    if missing:
        pytest.skip(f"not run by this processor: {sorted(missing)}")


@pytest.fixture(scope="module")
def by_clang(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """oneray as the newest clang builds it, warnings being errors: kernels for every scene, at each width."""
    newest = next((c for c in (*(f"clang-{n}" for n in range(30, 13, -1)), "clang") if shutil.which(c)), None)
    if not newest:
        pytest.fail("clang is not installed (make test installs it)")
    return build(tmp_path_factory.mktemp("clang"), CC=newest, KERNELS="generic")


@pytest.mark.sample(20)
@pytest.mark.parametrize("scene", [*SCENES, *ODD], ids=lambda path: path.stem)
def test_compilers(oneray: Path, by_clang: Path, tmp_path: Path, scene: Path) -> None:
    """gcc and clang give the same film, at each width."""
    for precision, lanes in kernels(by_clang):
        for options in TECHNIQUES.values():
            options = [*options, "--precision", precision, "--lanes", str(lanes)]
            ours = film(oneray, scene, tmp_path / "a", *options, samples="0:3")
            assert film(by_clang, scene, tmp_path / "b", *options, samples="0:3") == ours, (
                precision,
                lanes,
                options,
            )


def pixels(path: Path) -> np.ndarray:
    """All channels, (height, width, channels)."""
    image = oiio.ImageBuf(str(path))
    assert not image.has_error, image.geterror()
    return image.get_pixels(oiio.FLOAT)


@pytest.mark.parametrize(("sampler", "channels"), [("independent", 6), ("sobol", 3)])
@pytest.mark.parametrize("pieces", [["0:64"], ["0:31", "31:33"], ["50:14", "0:1", "1:49"], ["0:32", "32:32"]])
def test_merged_pieces(oneray: Path, tmp_path: Path, pieces: list[str], sampler: str, channels: int) -> None:
    """Ranges of samples merged, in any order, are the whole picture, standard error and all, which Sobol'
    points do not have.
    """
    scene, options = ROOT / "tests/everything.xml", ("--sampler", sampler)
    subprocess.run([oneray, scene, "--spp", "64", "-o", tmp_path / "whole.exr", *options], check=True)
    parts = [tmp_path / f"{number}.film" for number in range(len(pieces))]
    for part, piece in zip(parts, pieces, strict=True):
        film(oneray, scene, part, *options, samples=piece)
    subprocess.run([oneray, "merge", *parts, "-o", tmp_path / "merged.exr"], check=True)
    whole = pixels(tmp_path / "whole.exr")
    assert whole.shape == (11, 19, channels)
    np.testing.assert_array_equal(pixels(tmp_path / "merged.exr"), whole)


@pytest.mark.parametrize(
    ("second", "message"),
    [
        (["--samples", "8:8"], None),
        (["--samples", "9:8"], "samples 8 to 8 are in no film"),
        (["--samples", "4:8"], "samples 4 to 7 are in two films"),
        (["--samples", "8:8", "--seed", "1"], "is a film of something else"),
        (["--samples", "8:8", "--estimator", "nee"], "is a film of something else"),
        (["--samples", "8:8", "--sampler", "sobol"], "is a film of something else"),
        (["--samples", "8:8", "-Dhide=true"], "is a film of something else"),
    ],
)
def test_merge_wants_parts_of_one_picture(
    oneray: Path, tmp_path: Path, second: list[str], message: str | None
) -> None:
    """A gap, an overlap, another seed, technique or parameter: an error, and no picture."""
    scene = ROOT / "tests/everything.xml"
    film(oneray, scene, tmp_path / "a", samples="0:8")
    subprocess.run([oneray, scene, "--film", tmp_path / "b", *second], check=True)
    merge = [oneray, "merge", tmp_path / "a", tmp_path / "b", "-o", tmp_path / "out.exr"]
    done = subprocess.run(merge, capture_output=True, text=True, check=False)
    if message is None:
        assert done.returncode == 0, done.stderr
        return
    assert done.returncode == 2
    assert message in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "out.exr").exists()


def test_other_seeds_give_other_samples(oneray: Path, tmp_path: Path) -> None:
    """The comparison above can fail: another seed, or the same samples of another range, differ."""
    scene = ROOT / "scenes/cornell-box.xml"
    first = film(oneray, scene, tmp_path / "a")
    assert film(oneray, scene, tmp_path / "a") == first
    assert film(oneray, scene, tmp_path / "b", "--seed", "1")[200:] != first[200:]
    assert film(oneray, scene, tmp_path / "b", samples="5:5")[200:] != first[200:]
