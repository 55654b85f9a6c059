"""A judgement as the figures and the sentence of a case."""

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.images import is_whole
from raycheck.judging import checks, sentences
from raycheck.judging.cases import Case
from raycheck.judging.explanations import NOTHING, explain
from raycheck.judging.looks import Look
from raycheck.scene.variants import Variant
from raycheck.stats.spread import log_variance
from raycheck.stats.tiles import Tile
from raycheck.stats.verdict import Judgement, Outcome
from raycheck.truth.expected import Truth


def template_name(of: Variant) -> str:
    """The name by which signatures and parts know a scene; another scene may have the name of one here."""
    return of.label if of.canonical else str(of.path)


def conclude(
    found: Judgement, regions: list[Tile], shown: Callable[[], Look], *, precision: str,
    takes: Callable[[float], float] | None, alike: Callable[[], float] = lambda: 0.0,
) -> tuple[Judgement, str]:  # fmt: skip
    """The judgement as it stands with images of this precision, and its sentence: what `shown` explains,
    where it FAILs, or that a bias may be meant, by how `alike` the noise of neighbouring pixels is. So many
    times the samples take as many seconds as `takes` says, if anybody knows.
    """
    explained, lights = NOTHING, 1
    if found.outcome is Outcome.FAIL:
        look = shown()
        explained, lights = explain([look]), look.lights
        if precision != "float" and not explained.convention:  # of coarse images gross mistakes alone
            explained = NOTHING
    sentence = sentences.reason(found, regions, takes, explained, lights)
    if found.outcome is Outcome.FAIL and not explained:
        sentence += sentences.may_shrink(found.bias, alike())
    if is_whole(precision) and found.outcome is Outcome.PASS:
        found = Judgement(**{**found.__dict__, "outcome": Outcome.INCONCLUSIVE})
        bits = precision.replace("-bit", " bits")
        seen = "no gross mistake was seen; write EXR or PFM to pass"
        return found, f"{bits} cannot show that an image is right: {seen}"
    if precision != "float":
        sentence += f"; the images are {precision}, so that biases below their rounding are not seen"
    return found, sentence


def gross_mistake(images: Array, truth: Truth, seen: Look) -> str | None:
    """What a few images show at once: a convention that accounts for an error far beyond noise."""
    clamped = checks.clamped(images, truth.mean, truth.variance)
    if clamped or not seen.gross:
        return clamped
    explained = explain([seen])
    return sentences.explanation(explained, seen.lights) if explained.convention else None


def case_maker(
    label: str, technique: str, truth: Truth, clock: Callable[[], float] = time.perf_counter,
    spent: float = 0.0, **known: Any,
) -> Callable[..., Case]:  # fmt: skip
    """case(verdict, reason, **figures), with what is known already, and the seconds since now beside those
    that were `spent`.
    """
    started = clock() - spent

    def case(verdict: Outcome, reason: str, **figures: Any) -> Case:
        what = {"seconds": clock() - started, "closed_form": truth.closed_form} | known | figures
        return Case(label, technique, verdict, reason, **what)

    return case


FIGURES = (
    "bias", "bias_low", "bias_high", "mde_image", "mde_tile_p90", "mde_tile_max", "p_image", "p_tile",
    "p_omnibus", "tile_differences", "heavy_tailed",
)  # fmt: skip
"""The figures of a judgement that its case has too."""


def figures(found: Judgement, regions: list[Tile]) -> dict[str, Any]:
    """The figures of a case."""
    more = found.more_samples if found.outcome is Outcome.INCONCLUSIVE else None
    channel = sentences.CHANNELS[found.channel]
    same = {name: getattr(found, name) for name in FIGURES}
    return same | {
        "tiles": len(regions) - 1, "channel": channel, "more_samples": more, "tile": _tile(found, regions)
    }  # fmt: skip


def _tile(found: Judgement, regions: list[Tile]) -> tuple[int, int, int, int] | None:
    """Where the picture is furthest off, or known least; the first region is the whole."""
    told = [one for one in found.findings or found.undecided if one.region > 0]
    if not told:
        return None
    tile = regions[(sentences.furthest(told) if found.findings else told[0]).region]
    return tile.row, tile.column, tile.height, tile.width


def measured(
    sets: Sequence[tuple[Array, int]], images: Array, truth: Truth, spp: int,
    sample_seconds: float | None,
) -> dict[str, Any]:  # fmt: skip
    """The figures of a case that another day's is compared with: `sets` are errors (B, 3) of the image's
    mean and the samples of each image, `images` (B, H, W, 3) are of `spp` samples per pixel.
    """
    scale = np.abs(truth.mean.mean(axis=(0, 1)))
    scale = np.where(scale > 0, scale, scale.max() or 1.0)
    weights = np.array([samples for _, samples in sets]) / sum(samples for _, samples in sets)
    bias = sum(w * errors.mean(axis=0) for w, (errors, _) in zip(weights, sets, strict=True)) / scale
    square = sum(
        w**2 * errors.var(axis=0, ddof=1) / len(errors) for w, (errors, _) in zip(weights, sets, strict=True)
    )
    log, error = log_variance(images)
    noisy = bool(np.isfinite(log))
    return {
        "means": np.asarray(bias).tolist(), "errors": (np.sqrt(square) / scale).tolist(),
        "noise": float(np.exp(log) * spp / scale.mean() ** 2) if noisy else 0.0,
        "noise_error": error if noisy else None, "sample_seconds": sample_seconds,
    }  # fmt: skip
