"""The figures of a contestant from the pictures that it rendered."""

import statistics

import numpy as np

from raycheck.base.arrays import Array
from raycheck.judging import sentences
from raycheck.judging.conclusion import template_name
from raycheck.judging.explanations import explain
from raycheck.judging.judge_images import judge_few
from raycheck.judging.looks import look
from raycheck.measuring.races.curves import Curve
from raycheck.measuring.races.race import Entry
from raycheck.scene.content import read_content
from raycheck.scene.techniques import ON_REQUEST, TECHNIQUES
from raycheck.scene.variants import Variant
from raycheck.stats import convergence
from raycheck.stats.convergence import Fit, Scores
from raycheck.stats.spread import Spread
from raycheck.stats.verdict import Outcome
from raycheck.truth.expected import Truth

TARGET = 0.01
"""The relative RMSE to which the time is told."""


def measured_curve(entry: Entry, of: Variant, truth: Truth, rounds: int) -> Curve:
    """The figures of a contestant that rendered everything."""
    stacks = {spp: np.stack([entry.shots[spp, k].image for k in range(rounds)]) for spp in entry.levels}
    scores = [convergence.score(spp, images, truth.mean) for spp, images in stacks.items()]
    floor2, mean = float(truth.variance.mean()), float(truth.mean.mean())
    start, each = _times(entry, rounds)
    levels = [convergence.level(one, floor2) for one in scores]
    shown = convergence.usable(scores, floor2, mean)
    lines = convergence.slopes(shown, truth.mean, truth.variance)
    whole = lines.rmse
    bias, detectable = _bias(entry.name, stacks[entry.levels[-1]], of, truth)
    flag, why = convergence.bend(whole.slope if whole else None, levels[-1].luck, bias)
    varies = scores[-1].variance > convergence.NOTHING * mean**2
    return Curve(
        name=entry.name, about=entry.contestant.about, command=entry.contestant.command, levels=levels,
        start_seconds=start, opened=entry.opened, sample_seconds=each, slope=whole.slope if whole else None,
        relative_slope=lines.relative.slope if lines.relative else None,
        slope_without_outliers=lines.without_outliers.slope if lines.without_outliers else None, flag=flag,
        why=why, detectable=detectable,
        seconds_to_target=_to_target(whole, scores[-1], floor2, mean, each.median, flag),
        efficiency=convergence.efficiency(scores[-1], each.median) if varies else None,
    )  # fmt: skip


def _times(entry: Entry, rounds: int) -> tuple[float, Spread]:
    """Seconds before the first sample, and for each sample, over the rounds."""
    lines = [
        convergence.line_of_times({spp: entry.shots[spp, k].seconds for spp in entry.levels})
        for k in range(rounds)
    ]
    return statistics.median(start for start, _ in lines), Spread.of([each for _, each in lines])


def _bias(name: str, images: Array, of: Variant, truth: Truth) -> tuple[str | None, float]:
    """What is wrong with the pictures of most samples beyond chance, and what bias would have been found."""
    traced = any(one.name == name and "L17" in one.lecture for one in (*TECHNIQUES, *ON_REQUEST))
    found, regions, _ = judge_few(images - truth.mean, truth, independent_pixels=not traced)
    if found.outcome is not Outcome.FAIL:
        return None, found.mde_image
    lights = read_content(of.path, of.parameters).lights
    explained = explain([look(template_name(of), images, truth, lights)])
    return sentences.reason(found, regions, None, explained, lights), found.mde_image


def _to_target(
    line: Fit | None, top: Scores, floor2: float, mean: float, each: float, flag: str
) -> float | None:
    """Seconds to a relative RMSE of 1 %, from the fitted line."""
    target = TARGET * mean
    if line is None or line.slope.value > -0.05:
        return None
    if flag == "bias" and top.bias2(floor2) > target**2:
        return None
    return max(line.samples_for(target), 1.0) * each
