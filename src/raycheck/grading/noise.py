"""The noise level: variance of a sample over oneray's, which shows what was really written."""

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raycheck import renderers
from raycheck.references import Variant
from raycheck.seeds import make_seeds
from raycheck.techniques import technique

Array = NDArray[np.float64]

IMAGES = 32
GROUPS = 8
SURE = 3.0
"""Standard errors of the interval."""


@dataclass(frozen=True)
class Noise:
    """Ratio of variances per sample, with its interval."""

    ratio: float
    low: float
    high: float
    technique: str


def compare(pictures: Sequence[Array], of: Variant, spp: int, name: str) -> Noise | None:
    """Pictures (H, W, 3) of `spp` samples per pixel each; None where either side does not vary."""
    ours, ours_error = _log_variance(np.stack(pictures))
    theirs, theirs_error = _oneray(of.path, tuple(sorted(of.parameters.items())), spp, name)
    if not (math.isfinite(ours) and math.isfinite(theirs)):
        return None
    half = SURE * math.hypot(ours_error, theirs_error)
    middle = ours - theirs
    return Noise(math.exp(middle), math.exp(middle - half), math.exp(middle + half), name)


@functools.lru_cache(maxsize=64)
def _oneray(path, parameters: tuple[tuple[str, str], ...], spp: int, name: str) -> tuple[float, float]:
    of = Variant(path, dict(parameters))
    command = renderers.oneray_command(renderers.oneray_path(), technique(name).options, of.parameters)
    seeds = make_seeds(f"noise/{of.label}/{name}", IMAGES)
    return _log_variance(np.stack([command.render(path, spp, seed, 600.0).image.pixels for seed in seeds]))


def _log_variance(images: Array) -> tuple[float, float]:
    """log of the mean variance of a pixel, and its standard error by the jackknife over groups of images."""

    def log_mean(some: Array) -> float:
        value = float(some.var(axis=0, ddof=1).mean())
        return math.log(value) if value > 0 else -math.inf

    whole = log_mean(images)
    if not math.isfinite(whole):
        return whole, math.inf
    parts = np.array_split(np.arange(len(images)), GROUPS)
    without = np.array([log_mean(np.delete(images, part, axis=0)) for part in parts])
    return whole, float(np.sqrt((GROUPS - 1) / GROUPS * ((without - without.mean()) ** 2).sum()))
