"""The plain checks at their thresholds: what is named, what is noise, and what only looks alike."""

import math

import numpy as np
import pytest

from raycheck.base.images import Image, encode_srgb
from raycheck.judging import checks

SIGNS = np.where(np.arange(16) % 2, 1.0, -1.0)


def reference(height: int = 32, width: int = 32) -> np.ndarray:
    """In every channel and direction something else, up to 0.7."""
    row, column = np.indices((height, width)) / height
    return 0.1 + 0.3 * np.stack([row, column**2, row * column], axis=-1) + 0.3 * row[..., None] ** 3


def named(
    images: np.ndarray, of: np.ndarray, deviation: float = 0.0, lights: int = 1, gross: bool = False
) -> str:
    variance = np.full(of.shape, deviation**2)
    return checks.name_mistake(images, of, variance, lights, gross) or ""


def batches(mean: np.ndarray, noise: float = 1e-3, count: int = 16) -> np.ndarray:
    """Images whose mean is exactly this, each off by a share of its own that cancels."""
    return mean * (1 + noise * SIGNS[:count, None, None, None])


@pytest.mark.parametrize(
    ("turn", "words"),
    [
        (lambda x: x[::-1], "upside down"),
        (lambda x: x[:, ::-1], "left and right swapped"),
        (lambda x: x[::-1, ::-1], "turned by 180°"),
        (lambda x: x[:, :, ::-1], "red and blue are swapped"),
        (lambda x: x.transpose(1, 0, 2), "rows and columns are swapped"),
        (lambda x: math.pi * x[::-1],
         "from the top down), and everything is 3.142 times too bright, a factor of π"),
        (lambda x: encode_srgb(x), "sRGB-encoded"),
        (lambda x: x ** (1 / 2.2), "gamma-encoded (2.2)"),
    ],
)  # fmt: skip
def test_conventions_are_named(turn, words: str) -> None:
    for gross in (False, True):
        assert words in named(batches(turn(reference())), reference(), gross=gross)


def test_rows_and_columns_are_not_swapped_where_the_image_is_no_square() -> None:
    of = reference(16, 32)
    assert named(batches(of[::-1]), of).startswith("the image is upside down")
    chess = 1 + 0.5 * np.kron(np.indices((2, 4)).sum(axis=0) % 2, np.ones((8, 8)))[..., None]
    assert named(batches(of * chess), of) == ""


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (2.0, "everything is 2 times too bright, a factor of 2"),
        (math.pi, "everything is 3.142 times too bright, a factor of π"),
        (1.37, "everything is 1.37 times too bright"),
        (0.5, "everything is too dark, 0.5 of what it should be, a factor of 1/2"),
        (1.19, "everything is 19.0 % too bright"),
        (0.81, "everything is 19.0 % too dark"),
        (3.0, "everything is 3 times too bright, a factor of 3, the number of lights"),
    ],
)
def test_factors_are_named(factor: float, words: str) -> None:
    lights = 3 if factor == 3 else 1
    assert named(batches(factor * reference()), reference(), lights=lights) == words


def test_only_gross_mistakes_are_named_by_a_few_images() -> None:
    """Squares of thirty times what noise gives, and 2 % of the image: of a factor of 1.1, then of 1.01."""
    cases = (1.1, 0.1, False), (1.1, 0.04, True), (1.015, 1e-3, False), (1.03, 1e-3, True)
    for factor, noise, gross in cases:
        images = batches(factor * reference(), noise)
        assert named(images, reference()), "what is known to differ has a name"
        assert bool(named(images, reference(), gross=True)) == gross


def test_half_of_an_error_is_not_its_name() -> None:
    """A tenth too bright, and a chessboard of as much."""
    chess = 1 + 0.1 * (2 * np.kron(np.indices((4, 4)).sum(axis=0) % 2, np.ones((8, 8))) - 1)[..., None]
    assert named(batches(1.1 * chess * reference()), reference()) == ""


def flat(factor: float, noise: float, seed: int = 1) -> np.ndarray:
    """Images of a grey 1 whose tiles are off independently."""
    tiles = np.random.default_rng(seed).normal(1.0, noise, (16, 4, 4, 3))
    return factor * np.kron(tiles, np.ones((1, 8, 8, 1)))


def test_what_is_hardly_more_than_noise_is_no_factor() -> None:
    """Squares of about twice what noise gives; in 20 cases."""
    for seed in range(20):
        assert named(flat(1.03, 0.1, seed), np.ones((32, 32, 3))) == ""


def test_a_dark_image_s_noise_is_dark_too() -> None:
    """A factor of 1/π with noise of a fifth of what is left: taking the factor out takes its noise along."""
    for seed in range(5):
        words = named(flat(1 / math.pi, 0.8, seed), np.ones((32, 32, 3)))
        assert words.startswith("everything is too dark, 0.3")


def test_negative_values_are_no_encoding() -> None:
    images = batches(encode_srgb(reference()))
    images[:, 0, 0] = -1e-3
    assert "encoded" not in named(images, reference())


def clamped(cap: float, pixels: int, deviation: float = 0.0) -> str:
    """Of images whose brightest value is in some pixels; the reference has 1.3 times it there."""
    of = np.full((32, 32, 3), 0.2)
    of.reshape(-1, 3)[:pixels] = 1.3 * cap
    rng = np.random.default_rng(1)
    return named(np.minimum(of * rng.uniform(0.9, 1.1, (4, 32, 32, 1)), cap), of, deviation)


def test_clamping_shows_by_many_values_at_a_round_cap() -> None:
    assert clamped(1.0, 20).startswith("values are clamped at 1: no pixel of 4 images is brighter")
    assert "clamped" not in clamped(1.3, 20)
    assert "clamped" not in clamped(1.0, 20, deviation=0.1), "the reference's noise reaches as far"
    one = np.full((4, 32, 32, 3), 0.2)
    one[0, 3, 4, 1] = 1.0
    of = np.full((32, 32, 3), 0.2)
    of[3, 4] = 1.3
    assert "clamped" not in named(one, of)


# ---- the contract ----


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


def test_calm_and_dark_is_clamped() -> None:
    cases = (-0.02, 0.45, True), (-0.02, 0.55, False), (0.02, 0.2, False), (0.0, 0.2, False)
    for bias, noise, said in cases:
        assert bool(checks.clamped_samples(bias, noise)) == said
