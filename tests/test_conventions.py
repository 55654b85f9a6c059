"""The plain checks at their thresholds: what is named, what is noise, and what only looks alike."""

import numpy as np
import pytest

from raycheck.base.images import Image
from raycheck.judging import checks
from raycheck.truth.expected import Truth

SIGNS = np.where(np.arange(16) % 2, 1.0, -1.0)


def reference(height: int = 32, width: int = 32) -> np.ndarray:
    """In every channel and direction something else, up to 0.7."""
    row, column = np.indices((height, width)) / height
    return 0.1 + 0.3 * np.stack([row, column**2, row * column], axis=-1) + 0.3 * row[..., None] ** 3


def clamped(cap: float, pixels: int, deviation: float = 0.0) -> str:
    """Of images whose brightest value is in some pixels; the reference has 1.3 times it there."""
    of = np.full((32, 32, 3), 0.2)
    of.reshape(-1, 3)[:pixels] = 1.3 * cap
    rng = np.random.default_rng(1)
    images = np.minimum(of * rng.uniform(0.9, 1.1, (4, 32, 32, 1)), cap)
    return checks.clamped(images, of, np.full(of.shape, deviation**2)) or ""


def test_clamping_shows_by_many_values_at_a_round_cap() -> None:
    assert clamped(1.0, 20).startswith("values are clamped at 1: no pixel of 4 images is brighter")
    assert "clamped" not in clamped(1.3, 20)
    assert "clamped" not in clamped(1.0, 20, deviation=0.1), "the reference's noise reaches as far"
    one = np.full((4, 32, 32, 3), 0.2)
    one[0, 3, 4, 1] = 1.0
    of = np.full((32, 32, 3), 0.2)
    of[3, 4] = 1.3
    assert checks.clamped(one, of, 0 * of) is None


# ---- the contract ----


@pytest.mark.parametrize("curve", [lambda x: 1 - np.exp(-2 * x), lambda x: np.minimum(x**0.45, 1)])
def test_a_tone_curve_that_ends_at_its_white_is_not_clamping(curve) -> None:
    """Though all that is bright has one value: what is darker is changed too."""
    of = np.full((32, 32, 3), 0.2) * np.linspace(0.5, 2.5, 32)[:, None, None]
    of.reshape(-1, 3)[:40] = 30.0
    images = np.repeat(of[None], 4, axis=0)
    assert checks.clamped(np.minimum(images, 1.0), of, 0 * of)
    assert checks.clamped(curve(images), of, 0 * of) is None


def test_sizes() -> None:
    image = Image(np.zeros((16, 32, 3)))
    assert checks.size_problem(image, 16, 32) is None
    assert checks.size_problem(image, 32, 16) == (
        "the image is 32×16 pixels, the scene asks for 16×32, width and height are swapped"
    )
    assert checks.size_problem(image, 8, 8) == "the image is 32×16 pixels, the scene asks for 8×8"


def test_what_is_no_number_is_counted() -> None:
    pixels = np.zeros((4, 4, 3))
    assert checks.number_problem(Image(pixels)) is None
    pixels[1, 2, 0] = -np.inf
    found = checks.number_problem(Image(pixels))
    assert found == "1 Inf value in 1 of 16 pixels, the first in row 1, column 2 from the top left"
    pixels[3, 3] = np.nan
    assert "3 NaN and 1 Inf values in 2 of 16 pixels" in checks.number_problem(Image(pixels))


def test_equal_pictures_are_a_mistake_where_light_varies() -> None:
    labels = ["seed 1", "seed 2", "seed 3", "seed 4"]
    assert checks.seed_problem(list("abcd"), labels, True) is None
    assert "seed 2 and seed 4 gave the same one" in checks.seed_problem(list("abcb"), labels, True)
    assert "all 4 images are identical" in checks.seed_problem(list("aaaa"), labels, True)
    assert checks.seed_problem(list("aaaa"), labels, False) is None
    assert checks.seed_problem(["a"], labels[:1], True) is None


# ---- noise ----


def test_a_few_pixels_that_vary_say_nothing_of_shared_noise() -> None:
    images = np.ones((16, 32, 32, 3))
    images[:, 4, 4:7] += np.random.default_rng(1).standard_normal((16, 3, 1))
    assert checks.shared_noise(images) is None


@pytest.mark.parametrize(("share", "said"), [(0.0, False), (0.35, False), (0.65, True)])
def test_seeds_share_noise_from_a_correlation_of_one_half(share: float, said: bool) -> None:
    """Between the first two of sixteen."""
    noise = np.random.default_rng(1).standard_normal((16, 64, 64, 1))
    noise[1] = share * noise[0] + np.sqrt(1 - share**2) * noise[1]
    found = checks.shared_noise(1 + 0.1 * np.repeat(noise, 3, axis=3))
    assert bool(found) == said
    assert not found or found.startswith("images 1 and 2 share noise")


def regions(batch: int, regions: int, deviation: float) -> np.ndarray:
    """Means (B, R, 3) of this deviation."""
    return 1 + deviation * SIGNS[np.arange(batch) % 2, None, None] * np.ones((batch, regions, 3))


def test_noise_is_stuck_where_many_regions_say_so() -> None:
    """1.6 times the samples have the same variance: of 16 regions it may be chance, of 900 it is not."""
    as_eight = np.sqrt(8 / 7 * 63 / 64)
    for count, said in ((16, False), (900, True)):
        few, many = regions(8, count, 0.1), regions(64, count, 0.1 * as_eight)
        assert bool(checks.stuck_noise(few, 10, many, 16)) == said
    nearer_to_what_it_should_be = regions(64, 900, 0.1 * as_eight / 1.6**0.3)
    assert checks.stuck_noise(regions(8, 900, 0.1), 10, nearer_to_what_it_should_be, 16) is None
    assert checks.stuck_noise(regions(8, 400, 0.1), 10, regions(64, 400, 0.1), 10) is None


@pytest.mark.parametrize(
    ("bias", "deviation", "said"),
    [(0.05, 0.05, False), (0.05, 0.01, True), (0.015, 1e-3, False), (0.0, 0.01, False)],
)
def test_another_picture_is_eight_errors_and_two_percent_away(bias, deviation, said: bool) -> None:
    """Eight images of 4 samples, and one of 64, whose own error is small: 0.37 of the deviation together."""
    few = 1 + deviation * SIGNS[:8, None] * np.sqrt(7 / 8) * np.ones((8, 3))
    found = checks.another_picture(few, 4, np.full((1, 3), 1 + bias), 64)
    assert bool(found) == said


def test_no_numbers_are_another_picture() -> None:
    assert "NaN or Inf" in checks.another_picture(np.ones((8, 3)), 4, np.full((1, 3), np.nan), 64)


def singles(scale: float, cap: float, seed: int = 1) -> np.ndarray:
    """Eight images with one heavy-tailed sample per pixel."""
    samples = np.random.default_rng(seed).exponential(scale, (8, 32, 32, 1)) * np.ones(3)
    return np.minimum(samples, cap)


def of_truth(mean: np.ndarray) -> Truth:
    return Truth(mean, 0 * mean, mean**2, {}, 64, False)


def test_samples_that_end_at_one_value_are_clamped() -> None:
    """5 in 1,000 do; not if none is the same, and not beside a lamp of that radiance."""
    even = np.ones((32, 32, 3))
    said = checks.capped_samples(singles(1.0, 5.3), of_truth(even))
    assert said and said.startswith("bright samples are clamped at 5.3: ")
    assert not checks.capped_samples(singles(1.0, 5.3), of_truth(even), [5.3]), "a lamp has that radiance"
    assert checks.capped_samples(singles(1.0, np.inf), of_truth(even)) is None
    assert checks.capped_samples(singles(1.0, 5.3), of_truth(2 * even)) is None
    few = singles(1.0, 5.3)
    few[1:] = np.minimum(few[1:], 5.2)
    assert checks.capped_samples(few, of_truth(even)) is None
