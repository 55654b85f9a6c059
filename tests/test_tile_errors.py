"""The error of pictures in tiles, and its noise."""

import numpy as np
import pytest

from raycheck.judging import mistakes, tile_errors
from raycheck.judging.looks import Look, look_at_means
from raycheck.judging.tile_errors import TileErrors
from raycheck.truth.expected import Truth

SIGNS = np.where(np.arange(64) % 2, 1.0, -1.0)


def truth(
    mean: float | np.ndarray = 1.0, variance: float = 0.0, sample_variance: float | np.ndarray = 1.0
) -> Truth:
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
        found = look_at_means("a", np.ones((8, 4, 3)) + size * SIGNS[:4, None], truth())
        assert found.differs == differs


def test_tiles_that_look_calm_are_as_noisy_as_the_rest() -> None:
    """By the median: samples that the reference's renderer varies by alike; that of tile 3 is as measured."""
    found = tile_errors.errors_of_means("a", means(np.array([0.01, 0.2, 0.2, 0.8]), 8), truth())
    one = 8 / 7 / 8
    expected = np.array([0.04, 0.04, 0.04, 0.64]) * one
    np.testing.assert_allclose(found.variance, np.repeat(expected[:, None], 3, axis=1))


def test_tiles_that_no_image_reached_are_not_noiseless() -> None:
    """All images miss the light in tile 0, where the reference's samples vary; tile 3 cannot vary."""
    varies = np.ones((16, 16, 3))
    varies[8:, 8:] = 0
    of = truth(sample_variance=varies)
    found = tile_errors.errors_of_means("a", means(np.array([0.0, 0.2, 0.2, 0.0]), 8), of)
    expected = np.array([0.04, 0.04, 0.04, 0.0]) / 7
    np.testing.assert_allclose(found.variance, np.repeat(expected[:, None], 3, axis=1))
    pixels = np.ones((1, 16, 16, 3))
    pixels[0, :8, 8:] += 0.2 * SIGNS[:8, None, None]
    found = tile_errors.tile_errors("a", pixels, of)
    expected = np.array([0.04, 0.04, 0.04, 0.0]) / 64
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


# ---- what differs ----

FLAT = np.ones((64, 3))


def seen(error: np.ndarray, noise: float) -> Look:
    """One set of images."""
    correlation = np.broadcast_to(np.eye(3), (64, 3, 3))
    one = TileErrors("a", error, noise**2 * FLAT, correlation, FLAT)
    return Look("a", truth(), (one, one), {})


@pytest.mark.parametrize(
    ("error", "differs"),
    [
        (SIGNS[:, None] * FLAT * 0.01, False),
        (SIGNS[:, None] * FLAT * 0.0115, False),  # 32 % more than noise has, three deviations
        (SIGNS[:, None] * FLAT * 0.013, True),  # everywhere a little
        (FLAT * 0.064 * (np.arange(192) == 7).reshape(64, 3), False),
        (FLAT * 0.066 * (np.arange(192) == 7).reshape(64, 3), True),  # six deviations and half a percent
        (FLAT * 0.0066, False),  # less than five deviations of the mean, and a half per mille
        (FLAT * 0.0069, True),
    ],
)
def test_what_differs_for_sure(error: np.ndarray, differs: bool) -> None:
    assert seen(error, 0.01).differs == differs


def test_what_would_be_seen_is_said() -> None:
    """Five standard errors, 0.01 / √64 each, and a half per mille."""
    assert seen(0 * FLAT, 0.01).detectable == pytest.approx(0.0005 + 5 * 0.01 / 8)


def test_gross_is_far_beyond_noise_and_no_trifle() -> None:
    assert seen(0.1 * FLAT, 0.018).gross
    assert not seen(0.1 * FLAT, 0.019).gross
    assert not seen(0.019 * FLAT, 1e-4).gross


def test_signatures_are_kept_with_their_deviation() -> None:
    scene = mistakes.scenes()[0]
    with np.load(mistakes.folder() / f"{scene}.npz") as arrays:
        deviation = np.asarray(arrays["deviation"], dtype=np.float64)
    np.testing.assert_array_equal(mistakes.load(scene).variance, deviation**2)
