"""Verdicts as sentences: where, how much, how sure, and what would decide."""

import math
import re
from collections.abc import Mapping, Sequence

from raycheck.base.text import duration, percent, signed
from raycheck.judging.diagnosis import Mistake
from raycheck.judging.parts import Explanation, Hypothesis
from raycheck.stats.tiles import Tile, place
from raycheck.stats.verdict import Finding, Judgement, Outcome

CHANNELS = ("red", "green", "blue")


def reason(
    found: Judgement, regions: list[Tile], seconds: float, mistake: str | None = None,
    explained: Explanation | None = None,
) -> str:  # fmt: skip
    """The sentence of a verdict. `mistake` is what the plain checks think it is, `explained` the parts of the
    light that account for all of a bias.
    """
    height, width = regions[0].height, regions[0].width
    if found.outcome is Outcome.PASS:
        return (
            f"no bias: the image is within {percent(max(abs(found.bias_low), abs(found.bias_high)))} of the "
            f"reference, and a bias of {percent(found.mde_image)} would have been noticed"
        )
    if found.outcome is Outcome.FAIL:
        where = explanation(explained) if explained else _failure(found, regions, height, width)
        chance = min([f.p for f in found.findings] + [found.p_omnibus])
        sentence = f"{where} ({odds(chance)})"
        return f"{mistake}: {sentence}" if mistake else sentence
    return _undecided(found, regions, height, width, seconds)


def amount(bias: float, low: float, high: float) -> str:
    """A relative bias and its interval: "12 % ± 0.3 % too dark"."""
    half = (high - low) / 2
    if bias >= 1:
        digits = max(0, -math.floor(math.log10(half))) if half > 0 else 3
        return f"{1 + bias:.{digits}f} ± {half:.{digits}f} times as bright as it should be"
    return f"{percent(bias)} ± {percent(half)} too {'bright' if bias > 0 else 'dark'}"


LENGTHS = {
    "emission": "what the eye sees of the lamps themselves",
    "direct": "the direct light",
    "two bounces": "the light after two bounces",
    "more bounces": "the light after more bounces",
    "reflected": "all reflected light",
    "indirect": "the indirect light",
}
LISTED = 3
"""Parts that are told one by one."""


def part(of: Hypothesis) -> str:
    """A part of the light: "the direct light of light 2 of 8 on “floor”"."""
    surface = of.surface if of.surface.startswith("the ") else f"“{of.surface}”"
    what = LENGTHS.get(of.length, "")
    if of.light:
        what = f"{what} of {of.light}" if what else of.light
    if not what:
        return surface if of.surface else "the image as a whole"
    return f"{what} on {surface}" if of.surface else what


def explanation(found: Explanation) -> str:
    """What is wrong with the light, and that nothing else is."""
    told = []
    for one in found.factors[:LISTED]:
        gone = one.low <= -1 <= one.high
        size = "missing" if gone else amount(one.bias, one.low, one.high)
        name = part(one.of)
        if found.other:
            name = f"either {name} or {part(found.other)}, which look alike here,"
        told.append(f"{name} is {size}")
    more = len(found.factors) - LISTED
    if more > 0:
        kind = "lights" if found.factors[0].of.light else "path lengths"
        told.append(f"{more} more of the {kind} are off too")
    whole = not found.factors[0].of.says and not found.other
    return "; ".join([*told, "all of it by the same factor" if whole else "everything else agrees"])


def suspicion(mistakes: Sequence[Mistake]) -> str:
    """The mistakes that a FAIL looks like, as the end of its sentence."""
    quoted = [f"“{mistake.mistake.rstrip('.')}”" for mistake in mistakes]
    if len(quoted) < 2:
        return f"; it looks like this mistake: {quoted[0]}" if quoted else ""
    return f"; it looks like one of these mistakes: {', '.join(quoted[:-1])} or {quoted[-1]}"


def _amount_of(finding: Finding) -> str:
    return amount(finding.bias, finding.low, finding.high)


def _failure(found: Judgement, regions: list[Tile], height: int, width: int) -> str:
    image = [f for f in found.findings if f.region == 0]
    tiles = [f for f in found.findings if f.region > 0]
    parts = []
    if image:
        worst = max(image, key=lambda f: abs(f.bias))
        alone = "" if len(image) == 3 else f" in {' and '.join(sorted({CHANNELS[f.channel] for f in image}))}"
        parts.append(f"the image as a whole is {_amount_of(worst)}{alone}")
    if tiles:
        largest = max(tiles, key=lambda f: min(abs(f.low), abs(f.high)) if f.low * f.high > 0 else 0.0)
        where = place(regions[largest.region], height, width)
        count, total = found.tile_differences, len(regions) - 1
        which = f"all {total} tiles differ" if count == total else f"{count} of {total} tiles differ"
        others = "" if count > total / 2 else ", and no difference is seen in the others"
        much = f"{_amount_of(largest)} in {CHANNELS[largest.channel]}"
        parts.append(f"{which}, most of all {where}, which is {much}{others}")
    if not parts:
        parts.append(
            "no single tile is far off, but together the tiles differ from the reference by more than noise"
        )
    return "; ".join(parts)


def odds(p: float, who: str = "correct renderers") -> str:
    """How rarely chance alone looks like this."""
    if p < 1e-15:
        return f"{who} never look like this by chance"
    exponent = math.floor(-math.log10(max(p, 1e-300)))
    return f"by chance {who} look like this less than once in 10^{exponent} times"


def _undecided(found: Judgement, regions: list[Tile], height: int, width: int, seconds: float) -> str:
    time = f" ({duration(seconds * found.more_samples)})" if seconds > 0 else ""
    need = f"about {found.more_samples:.2g} times the samples{time} would decide"
    if found.undecided:
        first = found.undecided[0]
        where = (
            "the image mean"
            if first.region == 0
            else f"the tile at {place(regions[first.region], height, width)}"
        )
        interval = f"{signed(first.low)} … {signed(first.high)}"
        return f"too noisy to say: {where} is only known to lie within {interval} of the reference; {need}"
    return (
        f"a few samples carry so much of the light in {found.heavy_tailed} places that intervals cannot be "
        f"trusted; {need}"
    )


def left_out(cases: Mapping[str, str]) -> list[str]:
    """A sentence for each reason why cases ("scene, technique" or "scene") are not judged; places in images
    do not count as reasons of their own.
    """
    found: dict[str, dict[str, list[str]]] = {}
    for case, why in cases.items():
        scene, _, technique = case.partition(", ")
        reason = re.sub(r"^pixel \(.*?\)", "a pixel", why)
        found.setdefault(reason, {}).setdefault(technique, []).append(scene)
    lines = []
    for why, by_technique in found.items():
        together: dict[str, list[str]] = {}
        for technique, scenes in by_technique.items():
            together.setdefault(", ".join(scenes), []).append(technique)
        parts = [f"{', '.join(t)} on {scenes}" if any(t) else scenes for scenes, t in together.items()]
        lines.append(f"Left out: {'; '.join(parts)}: {why}.")
    return lines
