"""A figure that was measured several times, and the noise of images."""

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from raycheck.base.arrays import Array


@dataclass(frozen=True)
class Spread:
    """A figure over the rounds."""

    median: float
    low: float
    high: float

    @classmethod
    def of(cls, values: Sequence[float]) -> "Spread":
        return cls(statistics.median(values), min(values), max(values))


GROUPS = 8
"""Groups of images, one left out at a time."""


def log_variance(images: Array) -> tuple[float, float]:
    """ln of the mean variance of a pixel of images (B, H, W, 3), and its standard error by the jackknife; −∞
    where nothing varies.
    """

    def log_mean(some: Array) -> float:
        value = float(some.var(axis=0, ddof=1).mean())
        return math.log(value) if value > 0 else -math.inf

    whole = log_mean(images)
    if not math.isfinite(whole):
        return whole, math.inf
    parts = np.array_split(np.arange(len(images)), GROUPS)
    without = np.array([log_mean(np.delete(images, part, axis=0)) for part in parts])
    return whole, float(np.sqrt((GROUPS - 1) / GROUPS * ((without - without.mean()) ** 2).sum()))


CONSTANT = 1e-12
"""Variance over the squared mean of a pixel that does not vary but for rounding."""


def shape(images: Array) -> tuple[float, float]:
    """How far the noise of images (B ≥ 4, H, W, 3) is from a normal distribution: the skewness and the excess
    kurtosis of a pixel (the mean of its channels), averaged over pixels, in standard errors that they have
    where it is normal, whatever its deviations. Cramér's unbiased G₁, G₂ and their variances; 0 where nothing
    varies.
    """
    pixels = np.asarray(images, dtype=np.float64).mean(axis=-1).reshape(len(images), -1)
    off = pixels - pixels.mean(axis=0)
    m2 = (off**2).mean(axis=0)
    off, m2 = (x[..., m2 > CONSTANT * pixels.mean(axis=0) ** 2] for x in (off, m2))
    n, count = len(off), len(m2)
    if not count:
        return 0.0, 0.0
    skewness = math.sqrt(n * (n - 1)) / (n - 2) * float(((off**3).mean(axis=0) / m2**1.5).mean())
    excess = float(((off**4).mean(axis=0) / m2**2).mean()) - 3
    kurtosis = (n - 1) / ((n - 2) * (n - 3)) * ((n + 1) * excess + 6)
    of_skewness = 6 * n * (n - 1) / ((n - 2) * (n + 1) * (n + 3))
    of_kurtosis = 4 * (n * n - 1) * of_skewness / ((n - 3) * (n + 5))
    return skewness / math.sqrt(of_skewness / count), kurtosis / math.sqrt(of_kurtosis / count)
