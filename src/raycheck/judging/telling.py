"""A judgement as the figures and the sentence of a case."""

import time
from collections.abc import Callable
from typing import Any

from raycheck.base.images import Image, is_whole
from raycheck.judging import diagnosis, sentences
from raycheck.judging.evidence import Evidence
from raycheck.judging.verdicts import Case
from raycheck.scene import variants
from raycheck.stats.tiles import Tile
from raycheck.stats.verdict import Judgement, Outcome
from raycheck.truth.expected import Truth


def known_as(of: variants.Variant) -> str:
    """What signatures and parts go by; another scene may have the name of one here."""
    return of.label if of.canonical else str(of.path)


def told(
    found: Judgement, regions: list[Tile], seconds: float, mistake: str | None, image: Image,
    shown: Callable[[], Evidence],
) -> tuple[Judgement, str]:  # fmt: skip
    """The judgement's reason, and what coarse input means for it."""
    if found.outcome is Outcome.FAIL and not mistake and image.precision == "float":
        suspects, explained = diagnosis.likely(shown())
        sentence = sentences.reason(found, regions, seconds, explained=explained) + sentences.suspicion(
            suspects
        )
    else:
        sentence = sentences.reason(found, regions, seconds, mistake)
    if is_whole(image.precision) and found.outcome is Outcome.PASS:
        found = Judgement(**{**found.__dict__, "outcome": Outcome.INCONCLUSIVE})
        bits = image.precision.replace("-bit", " bits")
        seen = "no gross mistake was seen; write EXR or PFM to pass"
        return found, f"{bits} cannot show that an image is right: {seen}"
    if image.precision != "float":
        sentence += f"; the images are {image.precision}, so that biases below their rounding are not seen"
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
"""Of a judgement, that its case has too."""


def figures(found: Judgement, regions: list[Tile]) -> dict[str, Any]:
    """The figures of a case."""
    more = found.more_samples if found.outcome is Outcome.INCONCLUSIVE else None
    channel = sentences.CHANNELS[found.channel]
    same = {name: getattr(found, name) for name in FIGURES}
    return same | {"tiles": len(regions) - 1, "channel": channel, "more_samples": more}
