"""Speed beside oneray: the same technique, scene and samples, in turn, in the same jail.

What a picture takes is the whole command's time, from its start to its end. Seconds differ from run to run:
points for speed are the only ones that a regrade may change, and an interval says how sure the ratio is.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import stats

from raycheck.base.arrays import Array
from raycheck.grading.jail import folders
from raycheck.grading.program import Program
from raycheck.renderers.bundle import bundle_oneray
from raycheck.scene.techniques import technique

PAIRS = 8
SURE = 0.99
"""Confidence of the interval."""


@dataclass(frozen=True)
class Speed:
    """Seconds of a picture over oneray's, with their interval."""

    ratio: float
    low: float
    high: float
    seconds: float
    """Seconds of the median picture."""
    technique: str


def compare(
    program: Program, spp: int, name: str, seeds: Sequence[int]
) -> tuple[Speed | None, list[Array]]:  # fmt: skip
    """The speeds by one pair of pictures for each seed, None where oneray cannot run in this jail; and the
    program's pictures (H, W, 3).

    RenderError where the program makes no picture.
    """
    oneray = program.scratch / "oneray"
    if not oneray.is_dir():
        bundle_oneray(oneray)
    pairs: list[tuple[float, float]] = []
    made: list[Array] = []
    for seed in seeds:
        theirs = _oneray_seconds(program, oneray, spp, seed, name)
        if theirs is None:
            return None, made
        own = program.render(program.scene, spp, seed, program.limits.picture_seconds)
        made.append(own.image.pixels)
        pairs.append((own.seconds, theirs))
    return ratio_of(pairs, name), made


def ratio_of(pairs: Sequence[tuple[float, float]], name: str) -> Speed:
    """The ratio of (own, oneray's) seconds, with Student's interval of the mean of log(own / oneray's)."""
    own, theirs = np.array(pairs).T
    logs = np.log(own / theirs)
    middle = float(logs.mean())
    error = float(logs.std(ddof=1)) / math.sqrt(len(logs))
    half = float(stats.t.ppf((1 + SURE) / 2, len(logs) - 1)) * error
    bounds = (math.exp(middle), math.exp(middle - half), math.exp(middle + half))
    return Speed(*bounds, float(np.median(own)), name)


def _oneray_seconds(program: Program, folder: Path, spp: int, seed: int, name: str) -> float | None:
    words = ["/submission/oneray", "/task/scene.xml", "-o", "/out/image.exr", "--quiet"]
    words += ["--spp", str(spp), "--seed", str(seed), *technique(name).options]
    with folders.temporary("oneray-", program.scratch) as place:
        output = place / "out"
        output.mkdir()
        done = program.jail.run(
            words, seconds=program.limits.picture_seconds, folder=folder, writable=False,
            readable={program.scene: "/task"}, output=output,
        )  # fmt: skip
    return None if done.problem else done.seconds
