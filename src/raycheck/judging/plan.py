"""A first small set of images: how noisy a renderer is, and so how many samples a verdict needs.

Pilot images plan; they are never judged.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy import special

from raycheck.base.arrays import Array
from raycheck.stats import statistics as st
from raycheck.stats.tiles import SMALLEST, region_variances
from raycheck.stats.verdict import ALPHA, CONFIDENCE, SHARE_IMAGE, SHARE_TILES, SYSTEMATIC, Limits
from raycheck.truth.expected import Truth


@dataclass(frozen=True)
class Goals:
    """The detectable bias to reach, relative; None: only what a PASS needs."""

    image: float | None = None
    tile_p90: float | None = None
    fineness: float = 0.5
    """Share of the finest tiles that must not have been merged for their skewness."""
    coarsest: int = SMALLEST
    """Side in pixels to which the finest tiles may grow where smaller ones would take too long."""


@dataclass(frozen=True)
class Pilot:
    sample_variance: Array
    """(H, W, 3) variance of one sample per pixel of this renderer."""
    skewness: Mapping[int, Array]
    """Skewness of its one-sample tile means, combined with the reference's: the larger of the two."""
    noise: float
    """Its variance over that of the reference's renderer at equal samples, over the whole image."""


def measure_pilot(images: Array, spp: int | None, truth: Truth) -> Pilot:
    """The pilot of images (B ≥ 3, H, W, 3) at `spp` samples; where that is not known, one counts as one."""
    variance, third = cumulants(images)
    skewness = tile_skewness(variance, third, truth.skewness)
    if spp is not None:
        skewness = {
            size: np.fmax(np.abs(table), np.abs(skewness[size]) * np.sqrt(spp))
            for size, table in truth.skewness.items()
        }
    return Pilot(
        sample_variance=variance * (spp or 1),
        skewness=skewness,
        noise=(spp or 1) / equivalent_spp(truth.sample_variance, variance),
    )


def cumulants(images: Array) -> tuple[Array, Array]:
    """Unbiased variance and third cumulant of each pixel, from images (B ≥ 3, H, W, 3)."""
    count = len(images)
    centred = images - images.mean(axis=0)
    variance = (centred**2).sum(axis=0) / (count - 1)
    return variance, (centred**3).sum(axis=0) * count / ((count - 1) * (count - 2))


def tile_skewness(variance: Array, third: Array, like: Mapping[int, Array]) -> dict[int, Array]:
    """Skewness of tile means from cumulants of pixels, which add up where pixels are independent."""
    result = {}
    for size, table in like.items():
        result[size] = np.full(table.shape, np.nan)
        for row, column in np.ndindex(*table.shape[:2]):
            window = slice(row * size, (row + 1) * size), slice(column * size, (column + 1) * size)
            v, t = variance[window].sum(axis=(0, 1)), third[window].sum(axis=(0, 1))
            result[size][row, column] = np.where(v > 0, t / np.where(v > 0, v, 1.0) ** 1.5, np.nan)
    return result


def residual_skewness(residuals: Array, like: Mapping[int, Array]) -> dict[int, Array]:
    """Skewness of tile means of one image from how residuals (k, H, W, 3) scatter within a tile.

    For images too few to measure each pixel. Two standard errors are taken off, since chance alone skews so
    few numbers.
    """
    result = {}
    for size, table in like.items():
        result[size] = np.full(table.shape, np.nan)
        for row, column in np.ndindex(*table.shape[:2]):
            window = residuals[:, row * size : (row + 1) * size, column * size : (column + 1) * size]
            count = window[..., 0].size
            centred = window - window.mean(axis=(0, 1, 2))
            spread = np.sqrt((centred**2).mean(axis=(0, 1, 2)))
            skewness = np.abs((centred**3).mean(axis=(0, 1, 2))) / np.where(spread > 0, spread, 1.0) ** 3
            sure = np.maximum(skewness - 2 * np.sqrt(6 / count), 0.0)
            result[size][row, column] = sure / np.sqrt(count / len(residuals))
    return result


def equivalent_spp(sample_variance: Array, image_variance: Array) -> float:
    """Samples per pixel of the reference's renderer that would be as noisy: what to assume where spp is
    unknown.
    """
    usable = (sample_variance > 0) & (image_variance > 0)
    if not usable.any():
        return 1.0
    return float(sample_variance[usable].sum() / image_variance[usable].sum())


@dataclass(frozen=True)
class Plan:
    spp: int
    """Samples per pixel of a batch."""
    smallest: int
    """Side of the finest tiles, pixels."""


def plan(
    pilot: Pilot, truth: Truth, batches: int, wishes: Sequence[tuple[Goals, int]], limits: Limits,
    alpha: float = ALPHA,
) -> Plan:  # fmt: skip
    """The fewest samples (1, 2, 3, 4, 6, 8, 12, …) at which a PASS and the first reachable wish are expected.

    A wish is goals and the most samples that they are worth. Where those do not suffice, larger tiles are
    tried, then the next wish; at last all that the last wish allows.
    """
    steps = sorted({k << i for k in (2, 3) for i in range(24)} | {1})
    affordable = [1]
    for goals, most in wishes:
        affordable = sorted({*(spp for spp in steps if spp <= most), max(most, 1)})
        smallest = SMALLEST
        while smallest <= goals.coarsest:
            best = affordable[-1]
            reaches = partial(reached, pilot, truth, batches, goals, limits, smallest=smallest, alpha=alpha)
            if reaches(best):
                return Plan(next((spp for spp in affordable if reaches(spp)), best), smallest)
            smallest *= 2
    return Plan(affordable[-1], SMALLEST)


GOOD_LUCK = 2.5
"""Standard errors that chance may take any region from the reference, where a PASS is to be sure."""
UNLUCKY = 0.2
"""Chance that it takes one too far, where a PASS is probable."""


def _unlucky(luck: Array, freedom: float) -> float:
    """The chance that any region is further off than so many standard errors (R, 3), by its worst channel."""
    return float((2 * special.stdtr(freedom, -luck.min(axis=1))).sum())


MOST_MORE = 1e5
FINER = 1.15
"""Steps of how many times the samples."""


def more_needed(
    pilot: Pilot, truth: Truth, batches: int, limits: Limits, spp: int, smallest: int = SMALLEST
) -> float:
    """How many times the `spp` samples per pixel a PASS probably needs: with more of them skewed tiles are no
    longer merged, and each has to be known by itself.
    """
    more = 1.0
    while more < MOST_MORE:
        if reached(pilot, truth, batches, Goals(fineness=0.0), limits, more * spp, smallest, sure=False):
            return more
        more *= FINER
    return more


def reached(
    pilot: Pilot, truth: Truth, batches: int, goals: Goals, limits: Limits, spp: float,
    smallest: int = SMALLEST, sure: bool = True, alpha: float = ALPHA,
) -> bool:  # fmt: skip
    """Whether a PASS and the goals are expected of two sets of so many images of `spp` samples per pixel;
    with bad luck too, if that is to be `sure`.
    """
    regions = truth.regions(spp, pilot.skewness, smallest)
    height, width = truth.shape
    if len(regions) - 1 < goals.fineness * -(-height // smallest) * -(-width // smallest):
        return False
    expected = truth.expected(regions, spp)
    scale = np.where(expected.yardstick > 0, expected.yardstick, np.inf)
    spare = 1.2 if sure else 1.0
    own = spare * region_variances(pilot.sample_variance, regions) / (spp * batches)
    one_set = np.sqrt(own + expected.variance) / scale
    both_sets = np.sqrt(own / 2 + expected.variance) / scale
    freedom = st.FREEDOM_SHARE * (batches - 1)

    tail = (1 - CONFIDENCE) / 2 / one_set.size
    limit = np.full((len(regions), 1), limits.tile)
    limit[0] = limits.image
    luck = limit / np.maximum(both_sets, 1e-300) + special.stdtrit(2 * freedom, tail)
    if luck.min() < GOOD_LUCK if sure else _unlucky(luck, 2 * freedom) > UNLUCKY:
        return False
    level_image = SHARE_IMAGE * alpha / 3
    level_tile = SHARE_TILES * alpha / max(one_set[1:].size, 1)
    image = SYSTEMATIC + st.detection_factor(freedom, level_image) * one_set[0].max()
    tiles = SYSTEMATIC + st.detection_factor(freedom, level_tile) * one_set[1:].max(axis=1)
    if goals.image is not None and image > goals.image:
        return False
    return goals.tile_p90 is None or float(np.quantile(tiles, 0.9, method="higher")) <= goals.tile_p90
