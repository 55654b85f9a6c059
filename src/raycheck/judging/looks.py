"""A look at a scene: the errors of its tiles by two sets of images, one to choose by and one to confirm."""

import functools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from raycheck.base.arrays import Array
from raycheck.judging.conventions import ENCODINGS, Encoding
from raycheck.judging.tile_errors import RELATIVE_FLOOR, TileErrors, errors_of_means, tile_errors
from raycheck.stats.verdict import SYSTEMATIC
from raycheck.truth.expected import Truth

FEWEST = 4
"""Images that are two sets; fewer are one, and there is no other to confirm what they show."""
GROSS_RATIO = 30.0
"""Mean squared error over its expected noise, from which a mistake counts as gross…"""
GROSS_SIZE = 0.02
"""…if it is also at least this large, relative to the image."""
SIGNIFICANT = 5.0
"""Standard deviations √(2n) of χ² from which a scene differs for sure…"""
TILE_ERRORS, TILE_SIZE = 6.0, 0.005
"""…or errors of a tile, beyond so much of it…"""
IMAGE_ERRORS = 5.0
"""…or of the whole image, beyond what conventions may cause."""
Sets = tuple[TileErrors, TileErrors]


@dataclass(frozen=True, eq=False)
class Look:
    """What was seen of one scene."""

    scene: str
    truth: Truth
    sets: Sets
    decoded: Mapping[Encoding, tuple[Sets, float]]
    """Of the decoded values, where all can be decoded, and the logarithm of how much that stretches them: it
    takes a likelihood of decoded values to one of the values.
    """
    lights: int = 1

    @property
    def gross(self) -> bool:
        """Whether the error is far beyond noise, and no trifle."""
        error = np.mean([one.error for one in self.sets], axis=0) / self.sets[0].scale
        noise = np.mean([one.variance for one in self.sets], axis=0) / self.sets[0].scale ** 2
        square = float((error**2).mean())
        return square > GROSS_RATIO * float(noise.mean() + RELATIVE_FLOOR) and square > GROSS_SIZE**2

    @property
    def size(self) -> float:
        """Root mean square of the relative error."""
        error = np.mean([one.error for one in self.sets], axis=0) / self.sets[0].scale
        return float(np.sqrt(np.mean(error**2)))

    @functools.cached_property
    def _whole(self) -> tuple[Array, Array]:
        """(3,) relative error of the mean of all tiles, and its standard error."""
        expected = np.abs(self.truth.mean.mean(axis=(0, 1)))
        scale = np.where(expected > 0, expected, 1.0)
        of_sets = [
            (one.error.mean(axis=0), one.variance.sum(axis=0) / len(one.variance) ** 2) for one in self.sets
        ]
        error = np.mean([e for e, _ in of_sets], axis=0)
        variance = np.mean([v for _, v in of_sets], axis=0) / (1 if self.sets[0] is self.sets[1] else 2)
        return error / scale, np.sqrt(variance) / scale

    @property
    def detectable(self) -> float:
        """Relative bias of the image that would count as a difference, in the worst channel."""
        return float((SYSTEMATIC + IMAGE_ERRORS * self._whole[1]).max())

    @property
    def differs(self) -> bool:
        """Whether the scene differs for sure: as a whole, in all tiles, or in one tile by far."""
        one = self.sets[0] if self.sets[0] is self.sets[1] else None
        error = np.mean([s.error for s in self.sets], axis=0)
        variance = np.mean([s.variance for s in self.sets], axis=0) / (1 if one else 2)
        scale = self.sets[0].scale
        square = (error**2 / (variance + RELATIVE_FLOOR * scale**2)).sum()
        n = error.size
        if square > n + SIGNIFICANT * np.sqrt(2 * n):
            return True
        far = np.abs(error) > TILE_ERRORS * np.sqrt(variance) + TILE_SIZE * scale
        bias, deviation = self._whole
        return bool(far.any() or np.any(np.abs(bias) > SYSTEMATIC + IMAGE_ERRORS * deviation))


def look(scene: str, images: Array, truth: Truth, lights: int = 1) -> Look:
    """At images (B ≥ 1, H, W, 3) of a scene."""
    decoded = {}
    for encoding in ENCODINGS:
        if encoding.decodes(images):
            values = encoding.decode(images)
            sets = _sets(scene, values, truth)
            decoded[encoding] = sets, _stretch(_sets(scene, images, truth), sets)
    return Look(scene, truth, _sets(scene, images, truth), decoded, lights)


def look_at_means(scene: str, means: Array, truth: Truth) -> Look:
    """At the means (B ≥ 4, T, 3) of tiles; nothing can be decoded then."""
    half = len(means) // 2
    sets = errors_of_means(scene, means[:half], truth), errors_of_means(scene, means[half:], truth)
    return Look(scene, truth, sets, {})


def _sets(scene: str, images: Array, truth: Truth) -> Sets:
    half = len(images) // 2
    if len(images) < FEWEST:
        one = tile_errors(scene, images, truth)
        return one, one
    return tile_errors(scene, images[:half], truth), tile_errors(scene, images[half:], truth)


def _stretch(before: Sets, after: Sets) -> float:
    """Σ ln of the deviations of decoded values over those of the values."""
    variance = [np.mean([one.variance for one in sets], axis=0) for sets in (before, after)]
    varies = (variance[0] > 0) & (variance[1] > 0)
    return float(0.5 * np.log(variance[1][varies] / variance[0][varies]).sum())
