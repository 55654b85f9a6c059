"""T4 resampled lights: of several samples one, by the light that it would bring; the mean stays the same."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from building import ROOT
from numpy.typing import NDArray
from sampling import Driver
from scipy import stats

from raycheck.calibration import mutants, trials
from raycheck.scene.content import read_content
from raycheck.scene.techniques import ON_REQUEST, applicable, technique

Array = NDArray[np.float64]

LADDER = sorted(path.stem for path in (ROOT / "scenes").glob("*.xml"))
RESAMPLED = ("--light-choice", "resampled")
SMALL = ("--width", "32", "--spp", "32")
SEEDS = range(12)


def render(oneray: Path, name: str, target: Path, *words: str) -> Array:
    """The picture and its standard errors, (height, width, 6); but three channels by Sobol' points."""
    if name == "crop" and words[0] == "--width":  # a film that has no other size
        words = words[2:]
    command = [oneray, ROOT / f"scenes/{name}.xml", "-o", target, "--quiet", *words]
    subprocess.run(command, check=True, capture_output=True, text=True)
    return oiio.ImageBuf(str(target)).get_pixels(oiio.FLOAT).astype(float)


def quarters(oneray: Path, name: str, target: Path, first: int, *words: str) -> Array:
    """Means of the four quarters of a picture, by seed: (seeds, 4)."""
    found = []
    for seed in SEEDS:
        image = render(oneray, name, target, *SMALL, "--seed", str(first + seed), *words)[..., :3].mean(-1)
        height, width = image.shape[0] // 2 * 2, image.shape[1] // 2 * 2
        halves = image[:height, :width].reshape(2, height // 2, 2, width // 2)
        found.append(halves.mean((1, 3)).ravel())
    return np.array(found)


def p_alike(a: Array, b: Array) -> float:
    """p-value of "both have these means", of quarters by seed; that of the worst quarter, for four."""
    floor = 1e-6 * np.abs(a).mean()  # what does not vary is the same to rounding
    if np.abs(a - b).max() <= floor:
        return 1.0
    return float(min(1, 4 * np.nanmin(stats.ttest_ind(a, b, equal_var=False).pvalue)))


@pytest.mark.sample(24)
@pytest.mark.parametrize("estimator", ["nee", "mis"])
@pytest.mark.parametrize("name", LADDER)
def test_the_mean_of_every_scene_is_that_of_one_sample(
    oneray: Path, tmp_path: Path, name: str, estimator: str
) -> None:
    """All of them together raise a false alarm in one choice of the seeds of a thousand."""
    words = ("--estimator", estimator)
    one = quarters(oneray, name, tmp_path / "a.exr", 100, *words)
    of_four = quarters(oneray, name, tmp_path / "a.exr", 0, *words, *RESAMPLED)
    assert p_alike(one, of_four) > 1e-3 / (2 * len(LADDER)), (one.mean(0), of_four.mean(0))


@pytest.mark.sample(30)
@pytest.mark.parametrize(
    "words", ["--estimator nee", "--mis-pdf survival", "--sampler sobol --light-points area"]
)
@pytest.mark.parametrize("name", LADDER)
def test_of_one_candidate_it_is_the_choice_by_contribution(
    oneray: Path, tmp_path: Path, name: str, words: str
) -> None:
    """To the last bit, in both precisions: candidate 0 is the very sample that there is without."""
    for precision in ("single", "double"):
        options = ("--width", "24", "--spp", "5", "--precision", precision, *words.split())
        plain = render(oneray, name, tmp_path / "a.exr", *options)
        alone = render(oneray, name, tmp_path / "b.exr", *options, *RESAMPLED, "--candidates", "1")
        np.testing.assert_array_equal(alone, plain)


@pytest.mark.parametrize("m", ["2", "3", "16", "64"])
@pytest.mark.parametrize("name", ["area-light", "many-lights", "open-sky"])
def test_any_number_of_candidates_has_the_same_mean(oneray: Path, tmp_path: Path, name: str, m: str) -> None:
    one = quarters(oneray, name, tmp_path / "a.exr", 100)
    of_m = quarters(oneray, name, tmp_path / "a.exr", 0, *RESAMPLED, "--candidates", m)
    assert p_alike(one, of_m) > 1e-4, (one.mean(0), of_m.mean(0))


@pytest.mark.parametrize("name", ["cornell-box", "thousand-lights"])
def test_sobol_points_have_the_same_mean(oneray: Path, tmp_path: Path, name: str) -> None:
    one = quarters(oneray, name, tmp_path / "a.exr", 100)
    evenly = quarters(oneray, name, tmp_path / "a.exr", 0, *RESAMPLED, "--sampler", "sobol")
    assert p_alike(one, evenly) > 1e-4, (one.mean(0), evenly.mean(0))


def test_more_candidates_have_less_variance(oneray: Path, tmp_path: Path) -> None:
    """Of a thousand lights that nothing occludes: of four candidates a third at most, of sixteen a sixth."""

    def variance(*words: str) -> float:
        image = render(oneray, "thousand-lights", tmp_path / "a.exr", "--width", "64", "--spp", "64", *words)
        return float((image[..., 3:6] ** 2).mean())

    one = variance()
    by_m = {m: one / variance(*RESAMPLED, "--candidates", m) for m in ("2", "4", "16")}
    assert 1.5 < by_m["2"] < by_m["4"] < by_m["16"] and by_m["4"] > 3 and by_m["16"] > 6, by_m


@pytest.mark.parametrize(("precision", "bits"), [("single", 23), ("double", 32)])
def test_a_candidate_s_numbers_are_as_uniform_as_the_first_s(
    tmp_path: Path, precision: str, bits: int
) -> None:
    """Turning permutes the midpoints that a number may be: exactly, so that none has more than its share."""
    driver, cells = Driver(tmp_path, precision), 2**bits
    some = np.random.default_rng(1).choice(cells, 4000, replace=False)
    u = (some + 0.5) / cells
    for m in (2, 3, 4, 7, 64):
        for number in range(4):
            for i in {0, 1, m // 2, m - 1}:
                turned = driver("candidate_number", u, number, i, m)[0]
                place = turned * cells - 0.5
                assert (place == np.round(place)).all() and (place >= 0).all() and (place < cells).all()
                assert len({*((place - some) % cells)}) == 1
                assert i or (turned == u).all()


def test_the_candidates_lie_evenly(driver: Driver) -> None:
    """The first of four numbers at steps of 1/M; and all four together, around the torus, no two nearer to
    each other than 0.49 M^(-1/4), where of a lattice of cubes they were M^(-1/4) apart.
    """
    for m in range(2, 65):
        at = np.array(
            [[driver("candidate_number", [0.3], k, i, m)[0, 0] for k in range(4)] for i in range(m)]
        )
        np.testing.assert_allclose(np.diff(np.sort(at[:, 0])), 1 / m, atol=2**-22)
        apart = np.abs(at[:, None] - at)
        distance = np.sqrt((np.minimum(apart, 1 - apart) ** 2).sum(-1))[~np.eye(m, dtype=bool)]
        assert distance.min() * m**0.25 > 0.49, m


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--estimator bidirectional --light-choice resampled",
         "--light-choice resampled is not supported (uniform, power, contribution)"),
        ("--estimator light --light-choice resampled", "--light-choice uniform or power"),
        ("--estimator walk --light-choice resampled", "--estimator walk sends no ray to a light"),
        ("--candidates 4", "--candidates are those of --light-choice resampled: there are none with"),
        ("--light-choice power --candidates 4", "there are none with --light-choice power"),
        ("--light-choice resampled --candidates 0", "a whole number from 1 to 64 is wanted"),
        ("--light-choice resampled --candidates 65", "a whole number from 1 to 64 is wanted"),
        ("--light-choice resampled --candidates few", "a whole number from 1 to 64 is wanted"),
    ],
)  # fmt: skip
def test_what_it_cannot_is_said(oneray: Path, tmp_path: Path, words: str, said: str) -> None:
    target = tmp_path / "a.exr"
    command = [oneray, ROOT / "scenes/area-light.xml", "-o", target, *words.split()]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2 and said in done.stderr and len(done.stderr.splitlines()) == 1, done.stderr
    assert not target.exists()


def test_pieces_and_windows_are_parts_of_the_whole(oneray: Path, tmp_path: Path) -> None:
    """Ranges of samples merged, a run that goes on, and a crop: the same bits; and parts of another number of
    candidates do not go together.
    """

    def run(*words: str | Path) -> str:
        command = [oneray, ROOT / "scenes/many-lights.xml", "--quiet", "--width", "32", *RESAMPLED, *words]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        return done.stderr

    def image(name: str) -> Array:
        return oiio.ImageBuf(str(tmp_path / name)).get_pixels(oiio.FLOAT)

    def merge(*parts: str) -> subprocess.CompletedProcess[str]:
        command = [oneray, "merge", *(tmp_path / part for part in parts), "-o", tmp_path / "merged.exr"]
        return subprocess.run(command, capture_output=True, text=True, check=False)

    assert not run("--spp", "24", "-o", tmp_path / "whole.exr")
    for number, samples in enumerate(("0:7", "7:17")):
        run("--samples", samples, "--film", tmp_path / f"{number}.film")
    assert merge("1.film", "0.film").returncode == 0
    run("--spp", "5", "--checkpoint", tmp_path / "kept.film", "-o", tmp_path / "some.exr")
    run("--spp", "24", "--checkpoint", tmp_path / "kept.film", "--resume", "-o", tmp_path / "resumed.exr")
    run("--spp", "24", "--crop", "3,5,8,6", "-o", tmp_path / "crop.exr")
    whole = image("whole.exr")
    assert (image("merged.exr") == whole).all() and (image("resumed.exr") == whole).all()
    assert (image("crop.exr") == whole[5:11, 3:11]).all()
    run("--samples", "24:7", "--film", tmp_path / "other.film", "--candidates", "5")
    refused = merge("0.film", "1.film", "other.film")
    assert refused.returncode == 2 and "other.film" in refused.stderr, refused.stderr


def test_the_figures_say_how_many_candidates(oneray: Path) -> None:
    command = [oneray, ROOT / "scenes/thousand-lights.xml", "--width", "8", "--spp", "1", "--stats", "-"]
    for words, said in (
        ((), "resampled --candidates 4 "),
        (("--candidates", "9"), "resampled --candidates 9 "),
    ):
        done = subprocess.run([*command, *RESAMPLED, *words], capture_output=True, text=True, check=True)
        assert said in json.loads(done.stdout)["technique"]
    plain = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "candidates" not in json.loads(plain.stdout)["technique"]


def test_the_technique_is_used_where_it_is_named(scene) -> None:
    names = {one.name for one in ON_REQUEST}
    assert {"nee-resampled", "mis-resampled"} <= names
    many = read_content(scene("thousand-lights"))
    assert technique("mis-resampled").why_not(many) is None
    assert not names & {one.name for one in applicable(many)}
    assert technique("nee-resampled").why_not(read_content(scene("point-light")))


MISTAKES = {mutant.name: mutant for mutant in mutants.catalogue(ROOT / "tests/mutants_resampled")}


def test_the_mistakes_are_patches_of_the_sources() -> None:
    assert len(MISTAKES) >= 4
    for mutant in MISTAKES.values():
        assert technique(mutant.shows) in ON_REQUEST
        command = ["patch", "--dry-run", "-p1", "--fuzz=1", "-f", "-i", str(mutant.patch)]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{mutant.name}: {done.stdout}"


@pytest.mark.parametrize("name", [*MISTAKES, None])
def test_a_mistake_is_seen(name: str | None) -> None:
    """By its picture; without one there is nothing to see."""
    for mutant in [MISTAKES[name]] if name else MISTAKES.values():
        program = trials.Program(mutants.program(MISTAKES[name] if name else None), mutant.shows)
        trial = trials.try_program(program, mutant.scene, trials.load_truth(mutant.scene), spp=32)
        assert trial.rejected["raycheck"] == (name is not None), trial.reason
