"""Verdicts as sentences: where, how much, how sure, and what would decide."""

import math

from raycheck.tiles import Tile, place
from raycheck.verdict import Finding, Judgement, Outcome

CHANNELS = ("red", "green", "blue")


def percent(value: float) -> str:
    """Two or three digits: "12 %", "0.31 %", "0.004 %"."""
    size = abs(value) * 100
    if not math.isfinite(size):
        return "∞ %"
    digits = 0 if size >= 20 else 1 if size >= 2 else 2 if size >= 0.1 else 3
    return f"{size:.{digits}f} %"


def signed(value: float) -> str:
    return ("+" if value >= 0 else "−") + percent(value)


def reason(found: Judgement, regions: list[Tile], seconds: float, mistake: str | None = None) -> str:
    """The sentence of a verdict. `mistake` is what the plain checks think it is."""
    height, width = regions[0].height, regions[0].width
    if found.outcome is Outcome.PASS:
        return (
            f"no bias: the image is within {percent(max(abs(found.bias_low), abs(found.bias_high)))} of the "
            f"reference, and a bias of {percent(found.mde_image)} would have been noticed"
        )
    if found.outcome is Outcome.FAIL:
        sentence = _failure(found, regions, height, width)
        return f"{mistake}: {sentence}" if mistake else sentence
    return _undecided(found, regions, height, width, seconds)


def _amount(finding: Finding) -> str:
    size = abs(finding.bias)
    half = (finding.high - finding.low) / 2
    side = "bright" if finding.bias > 0 else "dark"
    if finding.bias >= 1:
        return f"{1 + finding.bias:.3g} ± {half:.2g} times as bright as it should be"
    return f"{percent(size)} ± {percent(half)} too {side}"


def _failure(found: Judgement, regions: list[Tile], height: int, width: int) -> str:
    image = [f for f in found.findings if f.region == 0]
    tiles = [f for f in found.findings if f.region > 0]
    parts = []
    if image:
        worst = max(image, key=lambda f: abs(f.bias))
        alone = "" if len(image) == 3 else f" in {' and '.join(sorted({CHANNELS[f.channel] for f in image}))}"
        parts.append(f"the image as a whole is {_amount(worst)}{alone}")
    if tiles:
        largest = max(tiles, key=lambda f: min(abs(f.low), abs(f.high)) if f.low * f.high > 0 else 0.0)
        where = place(regions[largest.region], height, width)
        count, total = found.tile_differences, len(regions) - 1
        which = f"all {total} tiles differ" if count == total else f"{count} of {total} tiles differ"
        others = "" if count > total / 2 else ", and no difference is seen in the others"
        amount = f"{_amount(largest)} in {CHANNELS[largest.channel]}"
        parts.append(f"{which}, most of all {where}, which is {amount}{others}")
    if not parts:
        parts.append(
            "no single tile is far off, but together the tiles differ from the reference by more than noise"
        )
    chance = min([f.p for f in found.findings] + [found.p_omnibus])
    return "; ".join(parts) + f" ({odds(chance)})"


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


def duration(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.1f} s" if seconds < 10 else f"{seconds:.0f} s"
    if seconds < 5400:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"
