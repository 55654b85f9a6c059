"""What other projects' rules say of the same images. Each returns True where it rejects.

Images are (B, H, W, 3) of independent seeds, `spp` samples per pixel each; every rule gets all of them.
"""

import numpy as np
from scipy import stats

from raycheck.base.arrays import Array
from raycheck.base.images import encode_srgb
from raycheck.stats.tiles import Tile, region_means, region_variances
from raycheck.truth.expected import Truth

LEVEL = 0.01
"""Mitsuba's and Nori's level of significance; also given to Welch's test, which has no verdict of its own."""
LUMINANCE = np.array([0.212671, 0.715160, 0.072169])
WELCH_TILE = 32
"""Side of a tile in pixels: Jung, Hanika, Dachsbacher, Detecting Bias in Monte Carlo Renderers using Welch's
t-test, JCGT 9(2), 2020.
"""
IDIFF_FAIL, IDIFF_PERCENT = 0.016, 1.0
"""idiff's -fail and -failpercent in the tests of Blender's Cycles, which compare sRGB images of 8 bits."""


def mitsuba_z(images: Array, spp: int, truth: Truth) -> bool:
    """Mitsuba 3, `src/render/tests/test_renders.py`: z of each pixel by the reference's variance, at least
    1e-4; Šidák over the pixels; a quarter of a percent of all values may fail.
    """
    pixels = truth.mean.shape[0] * truth.mean.shape[1]
    variance = np.maximum(truth.sample_variance, 1e-4)
    z = np.abs(images.mean(axis=0) - truth.mean) * np.sqrt(len(images) * spp / variance)
    alpha = 1 - (1 - LEVEL) ** (1 / pixels)
    return bool((2 * stats.norm.sf(z) > alpha).sum() / 3 < 0.9975 * pixels)


def nori_t(images: Array, spp: int, truth: Truth) -> bool:
    """Nori, `src/ttest.cpp`: one-sample t on the luminance of the whole image; a batch is a sample here."""
    found = stats.ttest_1samp(images.mean(axis=(1, 2)) @ LUMINANCE, truth.mean.mean(axis=(0, 1)) @ LUMINANCE)
    return bool(found.pvalue < LEVEL)


def idiff(images: Array, spp: int, truth: Truth) -> bool:
    """Blender's Cycles, `idiff -fail 0.016 -failpercent 1`, on the sRGB values of the mean of all images."""
    difference = np.abs(encode_srgb(images.mean(axis=0)) - encode_srgb(truth.mean)).max(axis=2)
    return bool((difference > IDIFF_FAIL).mean() * 100 > IDIFF_PERCENT)


def welch(images: Array, spp: int, truth: Truth) -> bool:
    """Welch's t of tile means against the reference's, corrected by Bonferroni; no care for skewness."""
    height, width = truth.shape
    tiles = [
        Tile(row, column, min(WELCH_TILE, height - row), min(WELCH_TILE, width - column))
        for row in range(0, height, WELCH_TILE)
        for column in range(0, width, WELCH_TILE)
    ]
    means = region_means(images, tiles)
    own, other = means.var(axis=0, ddof=1) / len(images), region_variances(truth.variance, tiles)
    spread = np.sqrt(own + other)
    varies = spread > 0
    safe = np.where(varies, spread, 1.0)
    freedom = safe**4 / (own**2 / (len(images) - 1) + other**2 / (truth.batches - 1) + ~varies)
    difference = np.abs(means.mean(axis=0) - region_means(truth.mean, tiles))
    p = np.where(varies, 2 * stats.t.sf(difference / safe, freedom), difference <= 1e-6)
    return bool(p.min() < LEVEL / p.size)


RULES = {"mitsuba": mitsuba_z, "nori": nori_t, "idiff": idiff, "welch": welch}
NAMES = {
    "raycheck": "raycheck",
    "mitsuba": "Mitsuba's z-test",
    "nori": "Nori's t-test",
    "idiff": "idiff, as Cycles uses it",
    "welch": "Welch's t, 32×32 tiles",
}


def judge(images: Array, spp: int, truth: Truth) -> dict[str, bool]:
    """Whether each rule rejects the images."""
    return {name: rule(images, spp, truth) for name, rule in RULES.items()}
