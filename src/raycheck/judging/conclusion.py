"""A judgement as the figures and the sentence of a case."""

import time
from collections.abc import Callable
from typing import Any

from raycheck.base.arrays import Array
from raycheck.base.images import is_whole
from raycheck.judging import diagnosis, sentences
from raycheck.judging.cases import Case
from raycheck.judging.tile_errors import tile_errors
from raycheck.scene.variants import Variant
from raycheck.stats.tiles import Tile
from raycheck.stats.verdict import Judgement, Outcome
from raycheck.truth.expected import Truth


def template_name(of: Variant) -> str:
    """The name by which signatures and parts know a scene; another scene may have the name of one here."""
    return of.label if of.canonical else str(of.path)


def conclude(
    found: Judgement, regions: list[Tile], of: Variant, images: Array, truth: Truth, *,
    precision: str, mistake: str | None, seconds: float,
) -> tuple[Judgement, str]:  # fmt: skip
    """The judgement as it stands with images (B, H, W, 3) of this precision, and its sentence: `mistake`,
    where a plain check says what is wrong, else what the error looks like. What would decide takes `seconds`.
    """
    if found.outcome is Outcome.FAIL and not mistake and precision == "float":
        suspects, explained = diagnosis.likely(tile_errors(template_name(of), images, truth))
        sentence = sentences.reason(found, regions, seconds, explained=explained)
        sentence += sentences.suspicion(suspects)
    else:
        sentence = sentences.reason(found, regions, seconds, mistake)
    if is_whole(precision) and found.outcome is Outcome.PASS:
        found = Judgement(**{**found.__dict__, "outcome": Outcome.INCONCLUSIVE})
        bits = precision.replace("-bit", " bits")
        seen = "no gross mistake was seen; write EXR or PFM to pass"
        return found, f"{bits} cannot show that an image is right: {seen}"
    if precision != "float":
        sentence += f"; the images are {precision}, so that biases below their rounding are not seen"
    return found, sentence


def case_maker(label: str, technique: str, truth: Truth, **known: Any) -> Callable[..., Case]:
    """case(verdict, reason, **figures), with what is known already and the seconds since now."""
    started = time.perf_counter()

    def case(verdict: Outcome, reason: str, **figures: Any) -> Case:
        what = {"seconds": time.perf_counter() - started, "closed_form": truth.closed_form} | known | figures
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
    return same | {"tiles": len(regions) - 1, "channel": channel, "more_samples": more}
