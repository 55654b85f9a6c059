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
