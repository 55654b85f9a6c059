"""The error of an image in tiles, and its noise, by which mistakes and wrong parts of the light are told."""

from dataclasses import dataclass

import numpy as np

from raycheck.base.arrays import Array
from raycheck.stats.tiles import grid, region_means, region_variances
from raycheck.truth.expected import Truth

RELATIVE_FLOOR = 1e-6
"""Squared relative error that no noise is taken to be below: float32 images and references."""
FEW = 32
"""Batches below which the channels' correlation is taken as that of all tiles together."""


@dataclass(frozen=True)
class TileErrors:
    """The error of an image of one scene."""

    scene: str
    error: Array
    """(T, 3) mean of the images − reference."""
    variance: Array
    """(T, 3) of that, the reference's included."""
    correlation: Array
    """(T, 3, 3) of the channels of a tile: one path adds to all of them."""
    scale: Array
    """(T, 3) the unit of a relative bias."""

    def noise_blocks(self) -> Array:
        """(T, 3, 3) covariance of the error, with the floor."""
        deviation = np.sqrt(self.variance)
        blocks = self.correlation * deviation[:, :, None] * deviation[:, None, :]
        return blocks + (RELATIVE_FLOOR * self.scale**2)[:, :, None] * np.eye(3)

    @property
    def size(self) -> float:
        """Root mean square of the relative error."""
        return float(np.sqrt(np.mean((self.error / self.scale) ** 2)))


def tile_errors(scene: str, images: Array, truth: Truth) -> TileErrors:
    """The errors of images (B ≥ 1, H, W, 3). The noise of a single one is taken from how its pixels differ
    within tiles, and in tiles where they do not from the others.
    """
    tiles = grid(*truth.shape)
    if len(images) > 1:
        return errors_of_means(scene, region_means(images, tiles), truth)
    rest = images[0] - truth.mean
    for tile in tiles:
        rest[tile.window] -= rest[tile.window].mean(axis=(0, 1))
    own = region_variances(rest**2, tiles)
    alike = _correlation(rest.reshape(-1, 1, 3), len(tiles))
    own = np.where(own > 0, own, _as_noisy_as_the_rest(own, truth))
    return _tile_errors(scene, region_means(images[0], tiles), own, alike, truth)


def errors_of_means(scene: str, means: Array, truth: Truth) -> TileErrors:
    """The errors of images from their means (B > 1, T, 3) over the tiles.

    A few images that missed rare bright samples, or all light, look calmer than they are: no tile's noise is
    taken to be less than the reference's renderer would have there with as many samples.
    """
    own = _as_noisy_as_the_rest(means.var(axis=0, ddof=1) / len(means), truth)
    alike = _correlation(means - means.mean(axis=0), means.shape[1])
    return _tile_errors(scene, means.mean(axis=0), own, alike, truth)


def _as_noisy_as_the_rest(own: Array, truth: Truth) -> Array:
    """The variance (T, 3) of tiles; none is below that of the reference's samples times the median ratio."""
    one = region_variances(truth.sample_variance, grid(*truth.shape))
    noisy = (own > 0) & (one > 0)
    return np.maximum(own, one * np.median(own[noisy] / one[noisy])) if noisy.any() else own


def _correlation(rest: Array, tiles: int) -> Array:
    """(tiles, 3, 3) from deviations (B, T, 3): of each tile, or of all where there are few batches. A tenth
    of it is left out, so that no mix of the channels is taken to be free of noise.
    """
    covariance = np.einsum("bti,btj->tij", rest, rest)
    if len(rest) < FEW:
        size = np.einsum("tii->t", covariance)
        covariance = (covariance / np.where(size > 0, size, 1.0)[:, None, None]).sum(axis=0, keepdims=True)
    deviation = np.sqrt(np.einsum("tii->ti", covariance))
    safe = np.where(deviation > 0, deviation, 1.0)
    found = 0.9 * covariance / (safe[:, :, None] * safe[:, None, :])
    found[:, range(3), range(3)] = 1.0
    return np.broadcast_to(found, (tiles, 3, 3))


def _tile_errors(scene: str, mean: Array, own: Array, correlation: Array, truth: Truth) -> TileErrors:
    tiles = grid(*truth.shape)
    expected = region_means(truth.mean, tiles)
    floor = np.abs(truth.mean).mean(axis=(0, 1)) / 10
    scale = np.maximum(np.abs(expected), np.where(floor > 0, floor, 1.0))
    variance = own + region_variances(truth.variance, tiles)
    return TileErrors(scene, mean - expected, variance, correlation, scale)
