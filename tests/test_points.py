"""What a task earns, point by point, and how the noise behind it is measured."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from raycheck.base.arrays import Array
from raycheck.base.seeds import make_seeds
from raycheck.grading import noise, points
from raycheck.grading.assignment import REVIEW, Assignment, Task
from raycheck.grading.results import SceneResult, StudentResult, TaskResult
from raycheck.grading.written.pages import MADE_UP, borderline
from raycheck.renderers.oneray import oneray_command, oneray_path
from raycheck.scene.techniques import technique
from raycheck.scene.variants import Variant, variant
from raycheck.stats import spread
from raycheck.stats.spread import shape
from raycheck.stats.verdict import Outcome

RIGHT, WRONG, OPEN = Outcome.PASS, Outcome.FAIL, Outcome.INCONCLUSIVE
AS_NOISY = {"ratio": 1.0, "low": 0.9, "high": 1.1, "seconds": 0.1}


def ratio(low: float, high: float) -> dict[str, float]:
    return {"ratio": (low * high) ** 0.5, "low": low, "high": high, "seconds": 0.1}


def scene(verdict: Outcome, of_noise: dict | None = None, of_speed: dict | None = None) -> SceneResult:
    return SceneResult("point-light", False, verdict, "", noise=of_noise, speed=of_speed)


def earned(
    *scenes: SceneResult, inconclusive: str | float = REVIEW, executed: bool = True, **settings: float
) -> TaskResult:
    """Of a task of 12 points, with 2 for noise and 1 for speed where they are asked for."""
    task = Task("a", ("point-light",), 12, hint="Divide by d².", technique="nee", **settings)
    asked = Assignment(Path("a.toml"), "a", (task,), inconclusive=inconclusive)
    return points.earned(asked, task, list(scenes), executed)


def sure_and_open(found: TaskResult) -> tuple[float, float]:
    return found.points, found.pending


@pytest.mark.parametrize(
    ("verdicts", "verdict", "sure", "waits"),
    [((RIGHT, RIGHT, RIGHT), RIGHT, 12, 0), ((RIGHT, WRONG, OPEN), WRONG, 4, 4),
     ((OPEN, RIGHT, RIGHT), OPEN, 8, 4), ((WRONG, WRONG, WRONG), WRONG, 0, 0)],
)  # fmt: skip
def test_scenes_share_the_points(verdicts, verdict: Outcome, sure: float, waits: float) -> None:
    """A FAIL decides what the task is called, and earns nothing; only the right need no hint."""
    found = earned(*map(scene, verdicts))
    assert (found.verdict, *sure_and_open(found)) == (verdict, sure, waits)
    assert bool(found.hint) == (verdict is not RIGHT)


def test_open_points_wait_or_count_for_a_share() -> None:
    assert sure_and_open(earned(scene(RIGHT), scene(OPEN))) == (6, 6)
    assert sure_and_open(earned(scene(RIGHT), scene(OPEN), inconclusive=0.25)) == (7.5, 0)


def test_points_for_noise_and_speed_need_a_program_without_a_fail() -> None:
    asked = {"noise_points": 2, "speed_points": 1}
    right, wrong = (scene(verdict, AS_NOISY, AS_NOISY) for verdict in (RIGHT, WRONG))
    assert sure_and_open(earned(right, **asked)) == (15, 0)
    assert sure_and_open(earned(right, executed=False, **asked)) == (12, 0)
    assert sure_and_open(earned(right, wrong, **asked)) == (6, 0)


@pytest.mark.parametrize(
    ("verdict", "found", "sure", "waits"),
    [
        (RIGHT, ratio(1.5, 2.5), 14, 0),  # may be within the limit of 2
        (RIGHT, ratio(1.9, 3.0), 14, 0),
        (RIGHT, ratio(2.0, 3.0), 14, 0),
        (RIGHT, ratio(2.1, 3.0), 12, 0),  # surely is not
        (RIGHT, ratio(0.3, 0.6), 14, 0),  # may be as noisy as half
        (RIGHT, ratio(0.3, 0.45), 12, 2),  # surely is calmer
        (RIGHT, None, 12, 0),  # nothing varies
        (OPEN, None, 0, 14),
        (OPEN, AS_NOISY, 0, 14),
        (OPEN, ratio(2.1, 3.0), 0, 12),
    ],
)
def test_noise(verdict: Outcome, found: dict | None, sure: float, waits: float) -> None:
    assert sure_and_open(earned(scene(verdict, found), noise_points=2)) == (sure, waits)


@pytest.mark.parametrize(
    ("verdict", "found", "sure", "waits"),
    [(RIGHT, ratio(19, 22), 13, 0), (RIGHT, ratio(21, 22), 12, 0), (RIGHT, None, 12, 1), (OPEN, None, 0, 13),
     (OPEN, AS_NOISY, 0, 13)],
)  # fmt: skip
def test_speed(verdict: Outcome, found: dict | None, sure: float, waits: float) -> None:
    """What could not be measured waits."""
    assert sure_and_open(earned(scene(verdict, None, found), speed_points=1)) == (sure, waits)


def test_the_worst_scene_is_shown_of_those_that_are_surely_too_noisy() -> None:
    within = earned(scene(RIGHT, ratio(1, 1)), scene(RIGHT, ratio(1.5, 1.5)), noise_points=2)
    assert "1.5 times the variance" in within.comment and "too noisy" not in within.comment
    unsure, sure = scene(RIGHT, ratio(1, 64)), scene(RIGHT, ratio(3, 3))
    assert "too noisy: a sample has 3 times" in earned(unsure, sure, noise_points=2).comment


def test_students_are_told_no_figure_of_a_hidden_scene() -> None:
    """It would tell the scene, to a program that is as noisy or as slow as it likes there."""
    shown, asked = scene(RIGHT, ratio(1, 1), ratio(2, 2)), {"noise_points": 2, "speed_points": 1}
    for others in (1.2, 77.0):
        hidden = replace(scene(RIGHT, ratio(others, others), ratio(others, others)), hidden=True)
        found = earned(shown, hidden, **asked)
        assert f"{others:g}" not in found.comment.replace("1.2 of", "")
        assert ("in a hidden variant" in found.comment) == (others > 20)
        assert found.points == (15 if others < 20 else 12)


def test_noise_may_be_shown_and_earn_nothing() -> None:
    found = earned(scene(RIGHT, ratio(0.3, 0.45)), noise_points=0)
    assert (found.points, found.pending) == (12, 0) and "points" not in found.comment


# ---- the noise ----


def test_variance_is_unbiased_whatever_the_number_of_pictures() -> None:
    pictures = np.repeat([0.0, 2.0], noise.IMAGES // 2).reshape(-1, 1, 1, 1)
    assert np.exp(spread.log_variance(pictures)[0]) == pytest.approx(32 / 31)


def test_the_standard_error_of_a_log_variance_is_its_scatter() -> None:
    """400 measurements of 32 pictures of four values each."""
    pictures = np.random.default_rng(1).standard_normal((400, noise.IMAGES, 2, 2, 1))
    found = np.array([spread.log_variance(one) for one in pictures])
    assert np.mean(found[:, 1] ** 2) == pytest.approx(found[:, 0].var(), rel=0.25)


def test_the_interval_of_a_ratio_is_three_standard_errors(monkeypatch) -> None:
    monkeypatch.setattr(noise, "of_oneray", lambda *of: (np.log(2.0), 0.4, 0.0, 0.0))
    monkeypatch.setattr(noise, "log_variance", lambda images: (np.log(6.0), 0.3))
    found = noise.compare([np.zeros((1, 1, 3))] * 8, Variant(Path("a.xml")), 4, "nee", Path())
    assert found is not None and found.ratio == pytest.approx(3)
    assert (found.low, found.high) == pytest.approx((3 * np.exp(-1.5), 3 * np.exp(1.5)))


# ---- noise that is made up ----


@pytest.mark.parametrize("count", [8, 32])
def test_the_shape_of_normal_noise_is_zero_in_its_own_errors(count: int) -> None:
    """Whatever the deviations of its pixels are."""
    rng = np.random.default_rng(7)
    deviation = 10 ** rng.uniform(-3, 3, (1, 12, 12, 1))
    found = np.array([shape(5 + deviation * rng.standard_normal((count, 12, 12, 3))) for _ in range(300)])
    assert np.abs(found.mean(axis=0)).max() < 4 / np.sqrt(300)
    assert found.std(axis=0) == pytest.approx([1, 1], rel=0.17)


def test_shape_tells_skewed_and_flat_noise() -> None:
    rng = np.random.default_rng(8)
    assert shape(rng.exponential(size=(16, 16, 16, 3)))[0] > 20
    assert shape(rng.uniform(size=(16, 16, 16, 1)))[1] < -10
    assert shape(np.ones((16, 4, 4, 3))) == (0, 0)


SEEN = ("area-light", "many-lights", "cornell-box")
"""Their noise is far from normal."""


@pytest.mark.parametrize("scene", SEEN)
def test_a_picture_with_normal_noise_is_told_from_an_estimator(scene: str, tmp_path: Path) -> None:
    """Its deviations are those of the estimator; that, and four times its samples, are not told."""
    of, spp, name = variant(scene), 4, "nee"
    command = oneray_command(oneray_path(), technique(name).options, of.parameters)

    def images(spp: int, salt: str) -> Array:
        return np.stack(
            [command.render(of.path, spp, s, 60.0).image.pixels for s in make_seeds(salt, noise.IMAGES)]
        )

    honest = images(spp, "honest")
    deviation = honest.std(axis=0, ddof=1)
    fake = honest.mean(axis=0) + deviation * np.random.default_rng(9).standard_normal(honest.shape)
    told = {
        which: noise.compare(list(made), of, spp, name, tmp_path)
        for which, made in (("honest", honest), ("more samples", images(4 * spp, "more")), ("fake", fake))
    }
    assert {which: found.made_up for which, found in told.items() if found} == {
        "honest": False, "more samples": False, "fake": True,
    }  # fmt: skip


def test_sums_of_many_samples_may_be_normal() -> None:
    """Of 1,600 exponential ones, which a program may take where one is asked for."""
    rng = np.random.default_rng(10)
    one = rng.exponential(size=(noise.IMAGES, 16, 16, 1))
    sums = list(rng.gamma(1600, size=one.shape) / 1600)
    assert not noise.made_up(sums, shape(one), 1 / 1600)
    assert noise.made_up(sums, shape(one), 1)


def test_the_class_page_says_who_should_look_at_made_up_noise() -> None:
    told = scene(RIGHT, {**ratio(1, 1), "made_up": True})
    results = [StudentResult("Ann", "a", [earned(told, noise_points=2)], "none")]
    assert [(who, why) for who, _, why in borderline(results)] == [("Ann", MADE_UP)]
    assert (
        results[0].total
        == StudentResult("Ann", "a", [earned(scene(RIGHT, ratio(1, 1)), noise_points=2)], "").total
    )
