"""What is said of an error whose parts and mistakes are made up, so that every χ² is known."""

from collections.abc import Callable

import numpy as np
import pytest

from raycheck.judging import diagnosis, parts, tile_errors
from raycheck.judging.diagnosis import Mistake, Signatures
from raycheck.judging.parts import Hypothesis, Parts
from raycheck.judging.tile_errors import TileErrors
from raycheck.truth.expected import Truth

SIGNS = np.where(np.arange(64) % 2, 1.0, -1.0)


# ---- errors of tiles ----


def truth(mean: float | np.ndarray = 1.0, variance: float = 0.0, sample_variance: float = 1.0) -> Truth:
    """Four tiles."""
    of = (np.broadcast_to(x, (16, 16, 3)).astype(float) for x in (mean, variance, sample_variance))
    return Truth(*of, {}, 64, False)


def means(noise: np.ndarray, batches: int, channels: tuple[float, ...] = (1, 1, 1)) -> np.ndarray:
    """Means of the tiles (B, 4, 3), all channels off by ±noise together."""
    return 1 + SIGNS[:batches, None, None] * noise[:, None] * np.array(channels)


def test_no_noise_is_below_a_thousandth() -> None:
    """Rounding of float32 images is no mistake: 1e-6 of the squared scale, in each tile and channel."""
    mean = np.ones((16, 16, 3)) * [4.0, 1.0, 0.25]
    found = tile_errors.errors_of_means("a", np.broadcast_to([4.0, 1.0, 0.25], (8, 4, 3)), truth(mean))
    np.testing.assert_allclose(found.noise_blocks(), np.tile(np.diag([4e-3, 1e-3, 0.25e-3]) ** 2, (4, 1, 1)))


def test_a_difference_below_a_thousandth_is_none() -> None:
    for size, differs in ((0.9e-3, False), (1.9e-3, True)):
        found = tile_errors.errors_of_means("a", np.full((8, 4, 3), 1 + size), truth())
        assert diagnosis._differs(found) == differs


def test_tiles_that_look_calm_are_as_noisy_as_the_rest() -> None:
    """By the median: samples that the reference's renderer varies by alike; that of tile 3 is as measured."""
    found = tile_errors.errors_of_means("a", means(np.array([0.01, 0.2, 0.2, 0.8]), 8), truth())
    one = 8 / 7 / 8
    expected = np.array([0.04, 0.04, 0.04, 0.64]) * one
    np.testing.assert_allclose(found.variance, np.repeat(expected[:, None], 3, axis=1))


def test_noise_is_that_of_the_mean_and_of_the_reference() -> None:
    found = tile_errors.errors_of_means("a", means(np.full(4, 0.1), 8), truth(variance=0.64))
    np.testing.assert_allclose(found.variance, 0.01 * 8 / 7 / 8 + 0.64 / 64)
    np.testing.assert_allclose(
        found.noise_blocks()[0], found.variance[0, 0] * (0.1 * np.eye(3) + 0.9) + 1e-6 * np.eye(3)
    )


@pytest.mark.parametrize(("batches", "alone"), [(8, False), (30, False), (32, True)])
def test_tiles_have_correlations_of_their_own_from_32_batches_on(batches: int, alone: bool) -> None:
    """Green goes against red in the first tile alone."""
    opposed = means(np.full(4, 0.1), batches)
    opposed[:, 0, 1] = 2 - opposed[:, 0, 1]
    found = tile_errors.errors_of_means("a", opposed, truth()).correlation
    assert found[1, 0, 1] == pytest.approx(0.9 if alone else 0.45)
    assert found[0, 0, 1] == pytest.approx(-0.9 if alone else 0.45)


def test_the_noise_of_one_picture_is_not_its_error() -> None:
    """Tiles that are off by a constant have none."""
    found = tile_errors.tile_errors("a", np.full((1, 16, 16, 3), 1.5), truth())
    assert np.allclose(found.error, 0.5) and np.allclose(found.variance, 0)
    pixels = 1.5 + 0.1 * SIGNS[:16, None] * np.ones((1, 16, 16, 3))
    assert np.allclose(tile_errors.tile_errors("a", pixels, truth()).variance, 0.01 / 64)


def test_errors_are_relative_to_a_tenth_of_the_image_at_least() -> None:
    mean = np.ones((16, 16, 3))
    mean[:8, :8] = 1e-6
    found = tile_errors.errors_of_means("a", np.ones((8, 4, 3)), truth(mean))
    np.testing.assert_allclose(found.scale[0], mean[..., 0].mean() / 10)
    found = tile_errors.errors_of_means("a", np.full((8, 4, 3), 1.2), truth())
    assert found.size == pytest.approx(0.2)


# ---- parts ----

TILES = 40
Said = Callable[..., parts.Explanation | None]


def light(first: int, last: int, value: float = 1.0) -> np.ndarray:
    """(T, 3) of some tiles."""
    image = np.zeros((TILES, 3))
    image[first:last] = value
    return image


@pytest.fixture
def explained(monkeypatch: pytest.MonkeyPatch) -> Said:
    """What is said of an error where the light's parts are (light, length, surface) → (T, 3)."""

    def said(of: dict[tuple[str, str, str], np.ndarray], error: np.ndarray, noise: float = 0.05):
        names = [list(dict.fromkeys(key[i] for key in of)) for i in range(3)]
        image = np.zeros((*map(len, names), TILES, 3))
        for key, value in of.items():
            image[tuple(names[i].index(key[i]) for i in range(3))] = value
        monkeypatch.setattr(parts, "load", lambda scene: Parts(*names, image, 0 * image))
        full = np.ones((TILES, 3))
        correlation = np.broadcast_to(np.eye(3), (TILES, 3, 3))
        return parts.explain(TileErrors("a", error, noise**2 * full, correlation, 1e-3 * full))

    return said


def told(found: parts.Explanation | None) -> dict[str, float]:
    assert found is not None
    return {" ".join(filter(None, (f.of.light, f.of.length, f.of.surface))): f.bias for f in found.factors}


TWO = {
    ("A", "direct", "floor"): light(0, 7), ("A", "two bounces", "floor"): light(7, 10),
    ("B", "direct", "wall"): light(10, 17), ("B", "two bounces", "wall"): light(17, 20),
}  # fmt: skip


def also_on_the_table(chi: float) -> dict[tuple[str, str, str], np.ndarray]:
    """Light A shines on a table too, so little that it adds `chi` to χ², and B a lot on the floor."""
    table = light(20, 30, np.sqrt(chi / 30) * 0.05)
    return TWO | {("A", "direct", "table"): table, ("B", "direct", "floor"): light(30, 40)}


def test_nothing_is_said_that_the_picture_does_not_show(explained: Said) -> None:
    """That light A is wrong on the floor alone fits better by a χ² of 3; saying it costs 6. It may be so."""
    found = explained(also_on_the_table(3), light(0, 10))
    assert found is not None and told(found) == {"A": pytest.approx(1.0, abs=0.01)}
    assert found.other == Hypothesis("A", "", "floor")


def test_more_is_said_where_the_picture_shows_it(explained: Said) -> None:
    found = explained(also_on_the_table(40), light(0, 10))
    assert found is not None and told(found) == {"A floor": pytest.approx(1.0, abs=0.01)}
    assert found.other is None


def test_where_many_explain_it_nothing_is_said(explained: Said) -> None:
    """Light A, its direct light and either on the floor alone: pictures that noise does not tell apart."""
    of = TWO | {
        ("A", "direct", "table"): light(20, 30, 0.016),
        ("A", "two bounces", "floor"): light(30, 40, 0.016),
    }
    assert explained(of, light(0, 7)) is None


def uneven(gap: float) -> np.ndarray:
    return light(0, 10, -0.9 - gap / 2) + light(10, 20, -0.9 + gap / 2)


def test_two_wrong_lights_are_not_told_as_one(explained: Said) -> None:
    """One factor for both leaves a rest that noise could have and that a factor for each does not: the χ² of
    two more numbers is above 13.8 once in a thousand times. 12 may be chance, 16 is not.
    """

    def gap(chi: float) -> float:
        return float(np.sqrt(chi / 60) * 2 * np.hypot(0.05, 0.009))

    as_one = explained(TWO, uneven(gap(12)))
    assert told(as_one) == {"": pytest.approx(-0.9, abs=0.01)}
    each = explained(TWO, uneven(gap(16)))
    assert list(told(each)) == ["A", "B"], "the furthest off comes first"


def test_lights_that_are_right_are_not_called_wrong(explained: Said) -> None:
    of = TWO | {("C", "direct", "roof"): light(20, 27), ("C", "two bounces", "roof"): light(27, 30)}
    found = explained(of, light(0, 10) + light(10, 20, -0.5) + light(20, 30, 0.001))
    assert list(told(found)) == ["A", "B"]


def test_no_light_is_less_than_missing(explained: Said) -> None:
    assert told(explained(TWO, light(0, 10, -1.0))) == {"A": pytest.approx(-1.0, abs=0.01)}
    assert explained(TWO, light(0, 10, -2.0)) is None


def test_a_factor_has_the_interval_of_its_noise_and_of_its_template(explained: Said) -> None:
    """30 values of 1: 2.576 √(σ² + 1 %²)/√30 on each side."""
    for noise in (0.05, 0.002):
        found = explained(TWO, light(0, 10), noise)
        assert found is not None
        half = 2.576 * np.sqrt((noise**2 + 1e-4) / 30)
        assert (found.factors[0].high - found.factors[0].low) / 2 == pytest.approx(half, rel=0.01)


def test_pixels_that_show_two_surfaces_are_one_percent_off(explained: Said) -> None:
    """With hardly any noise: 1 % is the template's own error, 5 % is something else."""
    jitter = SIGNS[:TILES, None] * light(0, 10)
    assert told(explained(TWO, light(0, 10) + 0.01 * jitter, 1e-4)) == {"A": pytest.approx(1.0, abs=0.01)}
    assert explained(TWO, light(0, 10) + 0.05 * jitter, 1e-4) is None


def test_a_rest_beyond_noise_is_not_passed_over(explained: Said) -> None:
    """Four standard deviations of χ² are noise, ten are not."""
    for deviations, said in ((3, True), (10, False)):
        rest = np.sqrt((3 * TILES + deviations * np.sqrt(6 * TILES)) / (3 * TILES)) * 0.05
        assert (explained(TWO, light(0, 10) + rest * SIGNS[:TILES, None]) is not None) == said


def test_a_factor_that_noise_hides_is_not_said(explained: Said) -> None:
    """Its interval is to be within a tenth of it."""
    assert explained(TWO, light(0, 10, 0.3)) is not None
    assert explained(TWO, light(0, 10, 0.2)) is None


# ---- diagnosis ----

VALUES = 64 * 3
FLAT = np.ones((64, 3))
Diagnosed = Callable[..., diagnosis.Diagnosis]


@pytest.fixture
def diagnosed(monkeypatch: pytest.MonkeyPatch) -> Diagnosed:
    """What is said of an error of one scene where the catalogue is name → (T, 3)."""

    def said(
        signatures: dict[str, np.ndarray], error: np.ndarray, noise: float = 1e-3, own: float = 0.0
    ) -> diagnosis.Diagnosis:
        image = np.stack(list(signatures.values()))
        of = Signatures(list(signatures), image, np.full_like(image, own**2))
        monkeypatch.setattr(diagnosis, "load", lambda scene: of)
        monkeypatch.setattr(diagnosis, "complete_scenes", lambda: ["a"])
        monkeypatch.setattr(diagnosis, "catalogue", lambda: {n: Mistake(n, "", "", "") for n in signatures})
        monkeypatch.setattr(parts, "load", lambda scene: None)
        return diagnosis.diagnose([of_error(error, noise)])

    return said


def of_error(error: np.ndarray, noise: float) -> TileErrors:
    correlation = np.broadcast_to(np.eye(3), (64, 3, 3))
    return TileErrors("a", error, noise**2 * FLAT, correlation, FLAT)


def jitter(size: float) -> np.ndarray:
    return size * SIGNS[:, None] * FLAT


def test_a_mistake_may_be_a_tenth_unlike_the_catalogued_one(diagnosed: Diagnosed) -> None:
    """Errors that are off by 30 % of it count as three standard deviations, not as hundreds."""
    for size, known in ((0.1, True), (0.3, True), (0.6, False)):
        assert diagnosed({"a": FLAT}, FLAT + jitter(size)).known == known


def test_another_strength_costs(diagnosed: Diagnosed) -> None:
    """A tenth of the squared logarithm."""
    for strength in (0.5, 1.0, 2.0):
        [guess] = diagnosed({"a": FLAT}, strength * FLAT).guesses
        assert guess.fit == pytest.approx(1 - 0.1 * np.log(strength) ** 2, abs=0.02)
        assert guess.strength == pytest.approx(strength, rel=0.25)


def test_what_leaves_a_tenth_of_the_error_is_unknown(diagnosed: Diagnosed) -> None:
    for tiles, known in ((62, True), (57, False)):
        part = FLAT * (np.arange(64) < tiles)[:, None]
        found = diagnosed({"a": part}, FLAT)
        assert found.known == known and found.guesses[0].fit == pytest.approx(tiles / 64, abs=0.02)


def test_noise_need_not_be_explained(diagnosed: Diagnosed) -> None:
    """An error of 1 σ beside noise of 1 σ: n of χ² are left, which is what noise has."""
    found = diagnosed({"a": 0.0126 * FLAT}, 0.0126 * FLAT + jitter(0.01), noise=0.01)
    assert found.known and found.guesses[0].fit > 0.95


def test_a_mistake_does_not_explain_its_opposite(diagnosed: Diagnosed) -> None:
    assert diagnosed({"a": FLAT}, FLAT).known
    assert not diagnosed({"a": -FLAT}, FLAT).known


def test_the_noise_of_a_signature_is_no_difference(diagnosed: Diagnosed) -> None:
    noisy = FLAT + jitter(0.5)
    assert diagnosed({"a": noisy}, FLAT, own=0.5).guesses[0].fit > 0.95
    assert diagnosed({"a": noisy}, FLAT).guesses[0].fit < 0.93


def test_three_are_guessed_the_best_first(diagnosed: Diagnosed) -> None:
    of = {name: FLAT * (np.arange(64) < tiles)[:, None] for name, tiles in
          (("half", 32), ("most", 48), ("few", 8), ("all", 64))}  # fmt: skip
    assert [guess.mistake.name for guess in diagnosed(of, FLAT).guesses] == ["all", "most", "half"]


@pytest.mark.parametrize(
    ("error", "differs"),
    [
        (FLAT * 0.01, False),
        (FLAT * 0.0115, False),  # 32 % more than noise has, three deviations
        (FLAT * 0.013, True),  # everywhere a little
        (FLAT * 0.064 * (np.arange(192) == 7).reshape(64, 3), False),
        (FLAT * 0.066 * (np.arange(192) == 7).reshape(64, 3), True),  # six deviations and half a percent
    ],
)
def test_what_differs_for_sure(error: np.ndarray, differs: bool) -> None:
    assert diagnosis._differs(of_error(error, 0.01)) == differs


@pytest.mark.parametrize(
    ("strength", "usual"), [(1.0, True), (1.15, True), (0.87, True), (1.2, False), (0.5, False)]
)
def test_a_mistake_is_usual_within_a_seventh(strength: float, usual: bool) -> None:
    assert diagnosis._usual(diagnosis.Guess(Mistake("a", "", "", ""), 1.0, strength)) == usual


def test_signatures_are_kept_with_their_deviation() -> None:
    scene = diagnosis.scenes()[0]
    with np.load(diagnosis.folder() / f"{scene}.npz") as arrays:
        deviation = np.asarray(arrays["deviation"], dtype=np.float64)
    np.testing.assert_array_equal(diagnosis.load(scene).variance, deviation**2)
