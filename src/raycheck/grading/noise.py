"""The noise: variance of a sample over oneray's, which shows what was really written; is it made up?"""

import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.files import write_whole
from raycheck.base.seeds import make_seeds
from raycheck.renderers import builds
from raycheck.renderers.oneray import oneray_command, oneray_path
from raycheck.scene import variants
from raycheck.scene.techniques import technique
from raycheck.scene.variants import Variant
from raycheck.stats.spread import log_variance, shape

IMAGES = 32
KEPT = "noise.json"
SURE = 3.0
"""Half the width of the interval in standard errors."""
NORMAL, FAR = 4.0, 12.0
"""`shape` of noise that may be a normal distribution's, and of such as cannot."""
HIDES = 30.0
"""Times the variance of the technique that is asked for, from which noise hides what a task is to show."""


@dataclass(frozen=True)
class Noise:
    """Ratio of variances per sample, with its interval."""

    ratio: float
    low: float
    high: float
    technique: str
    made_up: bool = False
    """It is that of normally distributed numbers, where oneray's is far from it."""

    @property
    def doubt(self) -> str:
        """Why a PASS with so much noise waits for a look; empty if it does not."""
        if self.low <= HIDES:
            return ""
        return (
            "as far as its noise lets it be seen the picture is right, but a sample has "
            f"{self.ratio:.0f} times the variance of oneray's {self.technique}: whether the program does "
            "what the task asks for is not decided, and the points wait for a look at it"
        )


def compare(pictures: Sequence[Array], of: Variant, spp: int, name: str, folder: Path) -> Noise | None:
    """Pictures (H, W, 3) of `spp` samples per pixel each; None where either side does not vary. `folder` is
    as of `of_oneray`.
    """
    ours, ours_error = log_variance(np.stack(pictures))
    theirs, theirs_error, *far = of_oneray(of, spp, name, folder)
    if not (math.isfinite(ours) and math.isfinite(theirs)):
        return None
    half = SURE * math.hypot(ours_error, theirs_error)
    middle = ours - theirs
    low, high = math.exp(middle - half), math.exp(middle + half)
    return Noise(math.exp(middle), low, high, name, made_up(np.stack(pictures), far, low))


def made_up(pictures: Array, far: Sequence[float], ratio: float) -> bool:
    """Whether noise is normal where that of the estimator asked for is `far` (`shape` of IMAGES pictures),
    also with so many samples more that the variance is `ratio` times as large: sums of k samples have 1/√k of
    their skewness and 1/k of their kurtosis.
    """
    fewer = math.sqrt(len(pictures) / IMAGES)
    wanted = far[0] * fewer * math.sqrt(min(ratio, 1.0)), far[1] * fewer * min(ratio, 1.0)
    return max(map(abs, shape(pictures))) < NORMAL and max(map(abs, wanted)) > FAR


def of_oneray(of: Variant, spp: int, name: str, folder: Path) -> tuple[float, float, float, float]:
    """log of the mean variance of a pixel and its standard error, and the noise's `shape`, with oneray's
    technique `name`: measured once and kept in `folder` by all that it depends on.
    """
    scene = variants.scene_hash(of.path, of.parameters)
    what = ("shape", builds.oneray_hash(), scene, of.label, name, technique(name).options, spp, IMAGES)
    key = hashlib.sha256(repr(what).encode()).hexdigest()
    file = folder / KEPT
    kept = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}
    if key not in kept:
        command = oneray_command(oneray_path(), technique(name).options, of.parameters)
        seeds = make_seeds(f"noise/{of.label}/{name}", IMAGES)
        images = [command.render(of.path, spp, seed, 600.0).image.pixels for seed in seeds]
        kept[key] = (*log_variance(np.stack(images)), *shape(np.stack(images)))
        write_whole(file, json.dumps(kept, indent=1) + "\n")
    return tuple(kept[key])
