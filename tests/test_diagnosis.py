"""Mistakes are called by their names, and what nobody has catalogued is called unknown."""

import os
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from raycheck.base.images import write_pfm
from raycheck.calibration import mutants
from raycheck.judging import diagnosis, sentences
from raycheck.judging.inspection import guesses
from raycheck.judging.tile_errors import tile_errors
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


def images(truth, error=0.0, seed=1, count=8):
    """As noisy as the reference's renderer is with 64 samples."""
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal((count, *truth.mean.shape)) * np.sqrt(truth.sample_variance / 64)
    return truth.mean + error + noise


def told(truth, error=0.0, **settings):
    return diagnosis.diagnose([tile_errors(SCENE, images(truth, error, **settings), truth)])


def signature(name: str, strength: float = 1.0) -> np.ndarray:
    of = diagnosis.load(SCENE)
    return strength * enlarge(of.error[list(of.names).index(name)], 64, 64)


@pytest.mark.parametrize("name", ["light-no-cosine", "nee-cosine-squared", "light-distance-not-squared"])
@pytest.mark.parametrize("strength", [0.5, 1.0])
def test_named(truth, name, strength):
    found = told(truth, signature(name, strength))
    assert found.known and found.significant
    assert found.guesses[0].mistake.name == name
    assert found.guesses[0].strength == pytest.approx(strength, rel=0.15)


def test_right_is_nothing_to_explain(truth):
    assert not told(truth).significant


def test_what_nobody_has_catalogued_is_unknown(truth):
    """A chessboard of too bright and too dark tiles."""
    signs = np.where(np.indices((8, 8)).sum(axis=0) % 2, 0.3, -0.3).reshape(-1, 1)
    error = enlarge(signs * np.ones(3), 64, 64) * truth.mean
    found = told(truth, error)
    assert found.significant and not found.known


def test_a_mere_factor_is_no_mistake_of_another_strength(truth):
    """All of the light three tenths too dark: mistakes that halve it are not it."""
    found = told(truth, -0.3 * truth.mean)
    assert found.guesses[0].fit > diagnosis.KNOWN and found.guesses[0].strength < 0.8
    assert not found.known and found.explained
    assert "since none has just this factor" in guesses(found)[0]


def test_mistakes_that_look_alike_are_all_named(truth):
    alike, _ = diagnosis.likely(tile_errors(SCENE, images(truth, signature("light-no-cosine")), truth))
    assert {"light-no-cosine", "nee-no-cosine"} <= {mistake.name for mistake in alike}
    assert sentences.suspicion(alike).startswith("; it looks like one of these mistakes: “")
    assert sentences.suspicion(alike[:1]) == f"; it looks like this mistake: “{alike[0].mistake.rstrip('.')}”"


def test_scenes_that_come_out_right_rule_mistakes_out(truth):
    """A wrong area of square lamps leaves the light of balls as it is, another BRDF does not."""
    balls = truth_of(references.load_reference("spherical-light"))
    wrong = tile_errors(SCENE, images(truth, signature("rectangle-area")), truth)
    alone = {guess.mistake.name: guess.fit for guess in diagnosis.diagnose([wrong]).guesses}
    both = diagnosis.diagnose([wrong, tile_errors("spherical-light", images(balls), balls)])
    assert alone["brdf-pi-twice"] > diagnosis.KNOWN
    assert both.known and both.guesses[0].mistake.name == "rectangle-area"
    assert "brdf-pi-twice" not in [guess.mistake.name for guess in both.guesses if guess.fit > 0.9]


def test_without_its_signature_a_mistake_is_not_named(truth):
    of = tile_errors(SCENE, images(truth, signature("light-no-cosine")), truth)
    assert "light-no-cosine" not in [
        guess.mistake.name for guess in diagnosis.diagnose([of], without=["light-no-cosine"]).guesses
    ]


def test_signatures_belong_to_the_catalogue():
    """Their pictures are those of today, see test_stale.py."""
    catalogue = {mutant.name: mutant for mutant in mutants.catalogue() if mutant.catalogued}
    for name, entry in diagnosis.manifest()["mistakes"].items():
        assert name in catalogue, f"{name}: raycheck calibrate signatures"
        assert lecture.argument(entry["technique"])
    for scene in diagnosis.scenes():
        diagnosis.load(scene)


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
    assert done.returncode == 0 and "Nothing to explain" in done.stdout


def test_command_says_what_is_missing(tmp_path):
    assert "either IMAGE files or --renderer" in command().stderr
    assert command().returncode == 2
    done = command(tmp_path / "none.pfm")
    assert done.returncode == 2 and done.stderr.count("\n") == 1
