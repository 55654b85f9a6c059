"""Error against run time: what is measured of renderers whose error is known, and which are flagged."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from raycheck.base.errors import NotFound, RenderError
from raycheck.judging.agenda import standard_technique
from raycheck.measuring.contestants import Shot, named_commands, pinned
from raycheck.measuring.races import racing
from raycheck.measuring.races.curves import Curve, read, to_json
from raycheck.measuring.races.race import MOST_SPP, doubling
from raycheck.scene import variants
from raycheck.stats import convergence
from raycheck.truth import references
from raycheck.truth.expected import truth_of

SCENE = variants.variant("furnace")
TRUTH = truth_of(references.load_reference(SCENE))
ROUNDS = 8
Samples = Callable[[np.random.Generator, int], np.ndarray]


class Made:
    """A renderer whose samples are r·x with x from `draw(generator, spp)`, (spp, H, W, 1), and whose time is
    a millisecond and `each` seconds a sample.
    """

    about, command, identity = "made up", "made --spp {spp} --seed {seed}", ""

    def __init__(self, name: str, draw: Samples, each: float = 1e-4):
        self.name, self.draw, self.each, self.renders = name, draw, each, 0

    def open(self) -> dict[str, float]:
        return {}

    def render(self, spp: int, seed: int) -> Shot:
        self.renders += 1
        x = self.draw(np.random.default_rng(seed), spp).mean(axis=0)
        return Shot(TRUTH.mean * x, 1e-3 + self.each * spp)

    def close(self) -> None:
        pass


def shape(spp: int) -> tuple[int, ...]:
    return (spp, *TRUTH.shape, 1)


def right(rng: np.random.Generator, spp: int) -> np.ndarray:
    return rng.exponential(size=shape(spp))


def biased(rng: np.random.Generator, spp: int) -> np.ndarray:
    return 1.05 * right(rng, spp)


def clamped(rng: np.random.Generator, spp: int) -> np.ndarray:
    """No sample is brighter than three times the mean: 5 % of the light is lost."""
    return np.minimum(right(rng, spp), 3)


def heavy(rng: np.random.Generator, spp: int) -> np.ndarray:
    """Pareto's distribution with exponent 1.2 and mean 1, whose variance is infinite."""
    return (1 + rng.pareto(1.2, size=shape(spp))) / 6


def repeating(rng: np.random.Generator, spp: int) -> np.ndarray:
    """Samples of a pixel that depend on each other: every fourth one only is new."""
    new = rng.exponential(size=shape(4))
    return np.where(np.arange(spp)[:, None, None, None] % 4 > 0, new[np.arange(spp) % 4], right(rng, spp))


def raced(folder: Path, *made: Made, seconds: float = 0.06) -> dict[str, Curve]:
    found, _ = racing.race(SCENE, made, seconds=seconds, rounds=ROUNDS, folder=folder)
    return {one.name: one for one in found.curves}


@pytest.fixture(scope="module")
def curves(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Curve]:
    draws = (right, biased, clamped, heavy, repeating)
    folder = tmp_path_factory.mktemp("race")
    return raced(folder, *(Made(draw.__name__, draw) for draw in draws))


def test_an_unbiased_curve_falls_with_slope_one_half(curves: dict[str, Curve]) -> None:
    one = curves["right"]
    assert one.flag == ""
    for slope in (one.slope, one.relative_slope, one.slope_without_outliers):
        assert slope.low < -0.5 < slope.high
        assert slope.high - slope.low < 0.06 and abs(slope.value + 0.5) < 0.03


def test_errors_are_the_known_ones(curves: dict[str, Curve]) -> None:
    """A sample of mean r has variance r²: RMSE r/√n, relMSE 1/n for a small ε, efficiency 1/(r² · time)."""
    squared = float((TRUTH.mean**2).mean())
    for level in curves["right"].levels:
        assert level.rmse.value == pytest.approx(math.sqrt(squared / level.spp), rel=0.03)
        assert level.relmse.value == pytest.approx(0.99 / level.spp, rel=0.05)
        assert level.variance.low < squared / level.spp * 1.05 and level.bias2.low < 0 < level.bias2.high
        assert level.rmse_without_outliers.value < level.rmse.value
    assert curves["right"].efficiency.value == pytest.approx(1 / squared / 1e-4, rel=0.1)
    samples = squared / (0.01 * TRUTH.mean.mean()) ** 2
    assert curves["right"].seconds_to_target == pytest.approx(samples * 1e-4, rel=0.05)


def test_bias_is_flagged(curves: dict[str, Curve]) -> None:
    one = curves["biased"]
    assert one.flag == "bias" and "too bright" in one.why
    squared = float((TRUTH.mean**2).mean())
    assert 0 < one.levels[-1].bias2.low < 0.05**2 * squared < one.levels[-1].bias2.high
    assert one.seconds_to_target is None  # 5 % off, it never gets there


def test_clamping_is_flagged_as_the_bias_that_it_is(curves: dict[str, Curve]) -> None:
    """Its error is lower than the right renderer's, and its curve looks as straight."""
    one = curves["clamped"]
    assert one.levels[0].rmse.value < curves["right"].levels[0].rmse.value
    assert one.flag == "bias" and "too dark" in one.why


def test_heavy_tails_and_dependent_samples_are_told_from_bias(curves: dict[str, Curve]) -> None:
    assert curves["heavy"].flag == "heavy tails"
    assert curves["heavy"].levels[-1].luck > 0.25 > 3 * curves["right"].levels[-1].luck
    assert curves["repeating"].flag == "slow"


def test_noisy_pixels_are_not_luck() -> None:
    """Four pixels have nearly all of the error in every image, as at the edge of a light; no luck in that."""
    noise = np.random.default_rng(1).normal(size=(8, 64, 64, 3))
    noise[:, 0, :4] *= 300
    found = convergence.score(4, 1 + noise, np.ones((64, 64, 3)))
    assert found.luck.mean() < 0.05
    assert found.mse_without_outliers.mean() < found.mse / 10


def test_error_splits_into_bias_variance_and_the_references_noise() -> None:
    rng = np.random.default_rng(2)
    truth, v = np.full((32, 32, 3), 2.0), 0.01
    reference = truth + np.sqrt(v) * rng.normal(size=truth.shape)
    images = truth + 0.3 + 0.5 * rng.normal(size=(8, *truth.shape))
    found = convergence.score(1, images, reference)
    assert found.bias2(v) == pytest.approx(0.09, rel=0.1)
    assert found.variance == pytest.approx(0.25, rel=0.05)
    assert found.mse == pytest.approx(found.bias2(v) + found.variance + v, rel=1e-9)


def test_start_up_is_told_from_sampling() -> None:
    start, each = convergence.line_of_times({4: 0.058, 8: 0.066, 16: 0.082, 32: 0.114})
    assert (start, each) == pytest.approx((0.05, 0.002), rel=1e-6)


def test_samples_double_as_far_as_the_time_allows() -> None:
    assert doubling(0.0, 1.0, 0.0, 8) == [1, 2, 4, 8, 16, 32]
    assert doubling(0.0, 1e-3, 8 * 0.256, 8)[-1] == 128
    assert doubling(0.0, 1e-9, 1.0, 8)[-1] == MOST_SPP


def test_equal_time_gives_the_slower_fewer_samples(tmp_path: Path) -> None:
    fast, slow = Made(standard_technique(SCENE).name, right), Made("slow one", right, 4e-4)
    found, pictures = racing.race(SCENE, [fast, slow], seconds=0.06, rounds=ROUNDS, folder=tmp_path)
    assert [one.spp for one in found.equal_samples] == [32, 32]
    assert [one.spp for one in found.equal_time] == [32, 8]
    assert [one.seconds for one in found.equal_time] == pytest.approx([3.2e-3, 3.2e-3], rel=1e-3)
    for one in (*found.equal_samples, *found.equal_time):
        error = math.sqrt(((pictures[one.key] - TRUTH.mean) ** 2).mean())
        assert one.rmse == pytest.approx(error, rel=1e-5)
    assert found.curves[1].relative_efficiency.value == pytest.approx(1 / 4, rel=0.1)


def test_who_crashes_loses_its_own_curve_alone(tmp_path: Path) -> None:
    class Crashing(Made):
        def render(self, spp: int, seed: int) -> Shot:
            if spp == 32:
                raise RenderError("ended by signal SIGSEGV")
            return super().render(spp, seed)

    found = raced(tmp_path, Made("right", right), Crashing("crashing", right))
    assert found["crashing"].reason == "ended by signal SIGSEGV" and not found["crashing"].levels
    assert not found["right"].reason and len(found["right"].levels) == 6


@pytest.mark.parametrize(
    ("pixels", "why"),
    [(np.full((32, 32, 3), np.nan), "NaN"), (np.ones((8, 8, 3)), "8×8"), (TRUTH.mean, "identical")],
)
def test_pictures_that_cannot_be_judged(tmp_path: Path, pixels: np.ndarray, why: str) -> None:
    class Broken(Made):
        def render(self, spp: int, seed: int) -> Shot:
            return Shot(pixels, 1e-3)

    assert why in raced(tmp_path, Broken("broken", right))["broken"].reason


def test_an_interrupted_race_is_continued(tmp_path: Path) -> None:
    """No picture is rendered twice, and the figures are those of a race in one go."""

    class Interrupted(Made):
        def render(self, spp: int, seed: int) -> Shot:
            if self.renders == 20:
                raise KeyboardInterrupt
            return super().render(spp, seed)

    first = Interrupted("one", right)
    with pytest.raises(KeyboardInterrupt):
        raced(tmp_path, first)
    second, whole = Made("one", right), Made("one", right)
    continued = raced(tmp_path, second)
    assert continued == raced(tmp_path / "whole", whole)
    assert 20 + second.renders == whole.renders
    third = Made("one", right)
    assert raced(tmp_path, third) == continued and third.renders == 0  # the finished scene is kept
    other = Made("one", right)
    raced(tmp_path, other, seconds=0.2)
    assert other.renders > 0  # another race


def test_all_scenes_within_the_time(tmp_path: Path) -> None:
    steps = []
    runners = [(SCENE, [Made("one", right), Made("two", right)], {"light": "a mirror"})]
    [(found, _)] = racing.race_all(
        runners, seconds=1e9, minutes=0.002, rounds=ROUNDS, folder=tmp_path,
        on_step=lambda step, total: steps.append((step.technique, total)),
    )  # fmt: skip
    assert steps == [("one", 16), ("two", 16)] * 8
    assert found.curves[0].levels[-1].spp < MOST_SPP
    path = tmp_path / "all.json"
    path.write_text(to_json([found], {"machine": "m"}))
    [again], header = read(path)
    assert header == {"machine": "m"} and again.left_out == {"light": "a mirror"}
    assert again.curves[1].slope.value == pytest.approx(found.curves[1].slope.value, rel=1e-3)
    assert len(json.loads(path.read_text())["scenes"][0]["curves"]) == 2


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("mine", 'NAME="COMMAND" is wanted'),
        ("mine=sh {output} {spp}", "the command has no {seed}"),
        ("mine=sh {spp} {seed}", "has no {output}"),
        ("mine=/no/such/program {output} {spp} {seed}", "there is no such program"),
    ],
)
def test_renderers_that_cannot_race(option: str, message: str) -> None:
    with pytest.raises(NotFound, match=r"mine|output") as found:
        named_commands([option])
    assert message in str(found.value)


def test_a_core_that_is_not_there() -> None:
    with pytest.raises(NotFound, match="--core 4711: allowed are"), pinned(4711):
        pass
