"""Mistakes are called by their names, and what nobody has catalogued is called unknown."""

import os
import re
import resource
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from raycheck.base.images import write_pfm
from raycheck.calibration import mutants
from raycheck.judging import conventions, mistakes, sentences
from raycheck.judging.explanations import Explanation, Near, explain
from raycheck.judging.inspection import Inspection, guesses, report
from raycheck.judging.looks import look
from raycheck.scene import lecture
from raycheck.stats.tiles import grid
from raycheck.truth import references
from raycheck.truth.expected import truth_of

HERE = Path(__file__).parent
SCENE = "area-light"


def enlarge(tiles: np.ndarray, height: int, width: int) -> np.ndarray:
    """(T, 3) of the fine tiles as an image."""
    image = np.zeros((height, width, 3))
    for tile, value in zip(grid(height, width), tiles, strict=True):
        image[tile.window] = value
    return image


@pytest.fixture(scope="module")
def truth():
    return truth_of(references.load_reference(SCENE))


def images(truth, error=0.0, seed=1, count=32):
    """As noisy as the reference's renderer is with 64 samples."""
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal((count, *truth.mean.shape)) * np.sqrt(truth.sample_variance / 64)
    return truth.mean + error + noise


def told(truth, error=0.0, **settings):
    return explain([look(SCENE, images(truth, error, **settings), truth)])


def signature(name: str, strength: float = 1.0) -> np.ndarray:
    of = mistakes.load(SCENE)
    return strength * enlarge(of.error[list(of.names).index(name)], 64, 64)


@pytest.mark.parametrize("name", ["light-no-cosine", "nee-cosine-squared", "light-distance-not-squared"])
def test_named(truth, name):
    assert name in [mistake.name for mistake in told(truth, signature(name)).mistakes]


def test_a_mistake_of_half_its_strength_is_not_it(truth):
    """It comes nearest, which is said of what it accounts for."""
    found = told(truth, signature("nee-cosine-squared", 0.5))
    assert not found.mistakes and "No known mistake" in guesses(found)[0]


def test_a_mere_factor_is_said_as_that(truth):
    found = told(truth, -0.3 * truth.mean)
    assert found.convention and found.factors[0].value == pytest.approx(0.7, rel=0.01)


def test_mistakes_that_look_alike_are_all_named(truth):
    found = told(truth, signature("light-no-cosine"))
    assert {"light-no-cosine", "nee-no-cosine"} <= {mistake.name for mistake in found.mistakes}
    said = sentences.suspicion(found)
    assert said.startswith("; it looks like one of these mistakes: “") and said.endswith("tells them apart)")
    one = replace(found, mistakes=found.mistakes[:1])
    words = f": “{found.mistakes[0].mistake.rstrip('.')}”"
    assert sentences.suspicion(one) == f"; it looks like this mistake{words}"
    factor = replace(one, convention=conventions.FACTOR)
    assert sentences.suspicion(factor) == f"; this mistake can do that, and so can others{words}"
    assert guesses(told(truth, signature("light-no-cosine")))[-1].endswith("tells them apart.")


def test_without_its_signature_a_mistake_is_not_named(truth):
    seen = look(SCENE, images(truth, signature("nee-cosine-squared")), truth)
    assert not explain([seen], without=["nee-cosine-squared"]).mistakes


def test_signatures_belong_to_the_catalogue():
    """Their pictures are those of today, see test_stale.py."""
    catalogue = {mutant.name: mutant for mutant in mutants.catalogue() if mutant.catalogued}
    for name, entry in mistakes.manifest()["mistakes"].items():
        assert name in catalogue, f"{name}: raycheck calibrate signatures"
        assert lecture.argument(entry["technique"])
    for scene in mistakes.scenes():
        mistakes.load(scene)


def command(*words) -> subprocess.CompletedProcess:
    environment = os.environ | {"COLUMNS": "200"}
    return subprocess.run(
        [sys.executable, "-m", "raycheck", "diagnose", *map(str, words)],
        capture_output=True, text=True, env=environment,
    )  # fmt: skip


def test_command_names_the_forgotten_cosine_of_another_renderer(tmp_path):
    """One picture by a program that shares nothing with oneray, at one sample, named in two seconds."""
    picture = tmp_path / "mine.pfm"
    subprocess.run([sys.executable, HERE / "pfm_renderer.py", picture, "1", "1", "forget-cosine"], check=True)
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    done = command(picture, "--map", tmp_path / "error.png")
    assert done.returncode == 1, done.stderr
    assert "taken for a picture of point-light" in done.stdout
    assert "1. “I sent a ray to the light and multiplied BRDF, light and visibility" in done.stdout
    assert "L10 next event estimation: direct and indirect light do not overlap" in done.stdout
    assert (tmp_path / "error.png").stat().st_size > 500
    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before < 3


def test_command_on_a_right_picture(truth, tmp_path):
    for index, image in enumerate(images(truth)):
        write_pfm(tmp_path / f"{index}.pfm", image)
    done = command(*sorted(tmp_path.glob("*.pfm")), "--scene", SCENE)
    assert done.returncode == 0 and "No difference beyond noise." in done.stdout
    assert f"would have been seen ({SCENE}: " in done.stdout


def test_what_few_samples_cannot_see_is_not_denied(truth):
    """A tenth of a percent: what would have been seen is more than that, and `verify` sees it."""
    for size in (0.0, 1e-3):
        found = Inspection()
        found.look(SCENE, images(truth, -size * truth.mean), truth, 1)
        told, wrong = report(found)
        assert not wrong and told.startswith("No difference beyond noise.")
        seen = re.search(r"would have been seen \(area-light: ([\d.]+) %\)", told)
        assert seen and float(seen[1]) > 0.1 and "raycheck verify" in told


def test_what_explains_next_to_nothing_is_not_the_nearest():
    """Nor is the lecture's argument quoted where no mistake is named."""
    shares = {
        "nee-cosine-squared": 0.63,
        "light-no-cosine": 0.49,
        "nee-no-cosine": 0.0,
        "depth-too-few": -0.2,
    }
    near = tuple(Near(mistakes.catalogue()[name], share) for name, share in shares.items())
    lines = guesses(Explanation(nearest=near))
    assert lines[0] == "No known mistake explains all of this." and len(lines) == 3
    assert lines[2] == f"- “{near[0].mistake.mistake}” (63 % of the squared error)"
    assert len(guesses(Explanation(nearest=near[1:]))) == 1


def test_command_says_what_is_missing(tmp_path):
    assert "either IMAGE files or --renderer" in command().stderr
    assert command().returncode == 2
    done = command(tmp_path / "none.pfm")
    assert done.returncode == 2 and done.stderr.count("\n") == 1
