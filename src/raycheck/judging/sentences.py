"""Verdicts as sentences: where, how much, how sure, and what would decide."""

import math
import re
from collections.abc import Callable, Mapping, Sequence

from raycheck.base.text import duration, percent, signed, times
from raycheck.judging import mistakes
from raycheck.judging.conventions import Convention
from raycheck.judging.explanations import NOTHING, Explanation, Factor
from raycheck.judging.parts import Hypothesis
from raycheck.stats.tiles import Tile, place
from raycheck.stats.verdict import Finding, Judgement, Outcome

CHANNELS = ("red", "green", "blue")


def reason(
    found: Judgement, regions: list[Tile], takes: Callable[[float], float] | None,
    explained: Explanation = NOTHING, lights: int = 1,
) -> str:  # fmt: skip
    """The sentence of a verdict. `takes` are the seconds of so many times the samples; `explained` is what
    may be said to account for all of a bias.
    """
    height, width = regions[0].height, regions[0].width
    if found.outcome is Outcome.PASS:
        none = "no bias" if found.within_reference is None else "no bias beyond the reference's own error"
        return (
            f"{none}: the image is within {percent(max(abs(found.bias_low), abs(found.bias_high)))} of the "
            f"reference, and a bias of {percent(found.mde_image)} would have been noticed"
        )
    if found.outcome is Outcome.FAIL:
        chance = min([f.p for f in found.findings] + [found.p_omnibus])
        where = explanation(explained, lights) or _failure(found, regions, height, width)
        return f"{where} ({odds(chance)}){suspicion(explained)}"
    return _undecided(found, regions, height, width, takes)


def amount(bias: float, low: float, high: float) -> str:
    """A relative bias and its interval: "12 % ± 0.3 % too dark"."""
    half = (high - low) / 2
    if bias >= 0.8:
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


def explanation(found: Explanation, lights: int = 1) -> str:
    """What is wrong with the picture, and that nothing else is; empty where only mistakes are known."""
    if found.convention:
        return _convention(found.convention, found.factors, lights)
    if not found.parts:
        return ""
    if len(found.factors) > len(found.parts):
        sizes = [f"{_size(f)} in {channel}" for f, channel in zip(found.factors, CHANNELS, strict=True)]
        told = [f"{part(found.parts[0])} is {', '.join(sizes)}"]
    else:
        off = [(p, f) for p, f in zip(found.parts, found.factors, strict=True) if not f.low <= 1 <= f.high]
        off.sort(key=lambda pair: -abs(pair[1].value - 1))
        told = [f"{part(p)} is {_size(f)}" for p, f in off[:LISTED]]
        more = len(off) - LISTED
        if more > 0:
            kind = (
                "lights" if found.parts[0].light else "surfaces" if found.parts[0].surface else "path lengths"
            )
            told.append(f"{more} more of the {kind} are off too")
    return "; ".join([*told, "everything else agrees"])


MISSING = 0.05
"""What may seem to be left of what is missing."""


def _size(factor: Factor) -> str:
    if factor.low <= 0 <= factor.high and factor.value < MISSING:
        return "missing"
    if factor.low <= 1 <= factor.high:
        return "right"
    return amount(factor.value - 1, factor.low - 1, factor.high - 1)


def _convention(found: Convention, factors: Sequence[Factor], lights: int) -> str:
    if found.factors == 3:
        sizes = [f"{_size(f)} in {channel}" for f, channel in zip(factors, CHANNELS, strict=True)]
        return f"everything is {', '.join(sizes)}, as by another white balance or colour space"
    if found.factors == 0:
        return found.words
    if factors[0].low <= 0:
        return "the image is black"
    size = f"everything is {_size(factors[0])}{_known_factor(factors[0], lights)}"
    return f"{found.words}, and {size}" if found.words else size


def _known_factor(factor: Factor, lights: int) -> str:
    """The number that a factor probably is, where one alone lies in its interval."""
    known = {
        "π": math.pi, "2π": 2 * math.pi, "4π": 4 * math.pi, "π/2": math.pi / 2, "2": 2.0, "4": 4.0,
        "1/π": 1 / math.pi, "1/(2π)": 0.5 / math.pi, "1/(4π)": 0.25 / math.pi, "2/π": 2 / math.pi,
        "1/2": 0.5, "1/4": 0.25,
    }  # fmt: skip
    if lights > 1:
        own = {
            f"{lights}, the number of lights": float(lights),
            f"1/{lights}, 1/number of lights": 1 / lights,
        }
        known = {name: value for name, value in known.items() if value not in own.values()} | own
    near = [name for name, value in known.items() if factor.low <= value <= factor.high]
    sharp = (factor.high - factor.low) / 2 < KNOWN_WITHIN * factor.value
    return f", a factor of {near[0]}" if len(near) == 1 and sharp else ""


KNOWN_WITHIN = 0.02
"""Half of a factor's interval, relative, within which it may be called by the number that lies in it."""


CAN_DO_THAT = "can do that, and so can others"
"""Of a mistake that a mere factor suggests: mistakes that nobody has catalogued may have the same one."""


def suspicion(found: Explanation) -> str:
    """The mistakes that a FAIL looks like, as the end of its sentence."""
    quoted = [f"“{mistake.mistake.rstrip('.')}”" for mistake in found.mistakes]
    if not quoted:
        return ""
    factor = bool(found.convention or found.parts)
    if len(quoted) == 1:
        return f"; {f'this mistake {CAN_DO_THAT}' if factor else 'it looks like this mistake'}: {quoted[0]}"
    scene = mistakes.telling_scene([mistake.name for mistake in found.mistakes])
    apart = f" ({scene} tells them apart)" if scene else ""
    which = f"each of these mistakes {CAN_DO_THAT}" if factor else "it looks like one of these mistakes"
    return f"; {which}: {', '.join(quoted[:-1])} or {quoted[-1]}{apart}"


def _amount_of(finding: Finding) -> str:
    return amount(finding.bias, finding.low, finding.high)


def furthest(tiles: Sequence[Finding]) -> Finding:
    """The tile that is furthest off for sure."""
    return max(tiles, key=lambda f: min(abs(f.low), abs(f.high)) if f.low * f.high > 0 else 0.0)


def _failure(found: Judgement, regions: list[Tile], height: int, width: int) -> str:
    image = [f for f in found.findings if f.region == 0]
    tiles = [f for f in found.findings if f.region > 0]
    parts = []
    if image:
        worst = next((f for f in image if f.channel == found.channel), image[0])
        alone = "" if len(image) == 3 else f" in {' and '.join(sorted({CHANNELS[f.channel] for f in image}))}"
        parts.append(f"the image as a whole is {_amount_of(worst)}{alone}")
    if tiles:
        largest = furthest(tiles)
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


WHERE = re.compile(r"the image as a whole is|(all )?\d+ (of \d+ )?tiles differ|no single tile is far off")
"""How a sentence begins that says where a picture differs, and not by what."""
NAMED = re.compile(r"; ((?:it looks like|bright samples are) .*)")
"""How one goes on that says by what after all."""


def by_what(said: str) -> str:
    """What a FAIL's sentence says is wrong; empty where it only says where."""
    told = re.sub(r" \((by chance )?correct renderers [^()]*\)", "", said)
    return "".join(NAMED.findall(told)) if WHERE.match(told) else told


def odds(p: float, who: str = "correct renderers") -> str:
    """How rarely chance alone looks like this."""
    if p < 1e-15:
        return f"{who} never look like this by chance"
    exponent = math.floor(-math.log10(max(p, 1e-300)))
    return f"by chance {who} look like this less than once in 10^{exponent} times"


def _undecided(
    found: Judgement, regions: list[Tile], height: int, width: int, takes: Callable[[float], float] | None
) -> str:
    if math.isinf(found.more_samples):
        need = "no more samples would decide, but a reference with less noise"
    else:
        time = f" ({duration(takes(found.more_samples))})" if takes else ""
        need = f"about {times(found.more_samples)} times the samples{time} would decide"
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


def may_be_the_reference(found: Judgement) -> str:
    """The end of a sentence where a bias is no noise, but not beyond the reference's own error."""
    if found.within_reference is None:
        return ""
    size, errors = found.within_reference
    return (
        f"; a bias of {percent(size)} is no noise, but within {errors:.1f} standard errors of the reference"
    )


def may_shrink(bias: float, alike: float) -> str:
    """The end of the sentence of a FAIL that nothing explains, where neighbouring pixels have noise in
    common: what spreads samples over pixels is biased, and that bias may be meant to shrink.
    """
    if abs(bias) > SHRINKING or alike < SPREAD:
        return ""
    return (
        f"; the noise of neighbouring pixels goes together (correlation {alike:.2f}), as where a photon map, "
        "a filter or a denoiser spreads samples: of a bias that shrinks with a parameter of it "
        "--consistent PARAM=v1,v2,v3,v4 judges the limit"
    )


SHRINKING, SPREAD = 0.1, 0.1
"""Bias of an image that such a method may have on purpose; correlation of noise that chance does not give."""


def left_out(cases: Mapping[str, str], how: str = "Left out") -> list[str]:
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
        lines.append(f"{how}: {'; '.join(parts)}: {why}.")
    return lines
