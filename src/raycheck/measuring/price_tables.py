"""Prices as tables, for a terminal and for docs/techniques.md."""

from collections.abc import Sequence

from raycheck.base.text import number
from raycheck.measuring.prices import Price, ScenePrices
from raycheck.scene.techniques import BASELINE, TECHNIQUES, technique
from raycheck.stats.spread import Spread

COLUMNS = ("technique", "lecture", "variance ×", "± %", "time ×", "efficiency × (min … max)")


def row(one: Price) -> tuple[str, ...]:
    """The cells of a technique's line under COLUMNS."""
    if one.variance == 0:
        variance, error, gain = "0", "", "∞"
    elif one.relative_variance is None:
        variance, error, gain = "∞", "", "0"
    else:
        variance = number(one.relative_variance.median)
        error = f"{100 * one.variance_error:.2g}"
        gain = spread_text(one.efficiency) if one.efficiency else ""
    name = f"{one.technique} *" if one.unbounded else one.technique
    lecture = lecture_ids(technique(one.technique).lecture)
    return name, lecture, variance, error, number(one.relative_time.median), gain


def spread_text(spread: Spread) -> str:
    return f"{number(spread.median)} ({number(spread.low)} … {number(spread.high)})"


def footnotes(one: ScenePrices) -> list[str]:
    """What has to be said below a scene's table."""
    notes = [f"{name} is left out: {why}." for name, why in one.left_out.items()]
    if one.baseline != BASELINE:
        notes.insert(0, f"No random ray hits these lights: relative to {one.baseline}.")
    if any(p.unbounded for p in one.prices):
        notes.append("* Samples without bound: the variance may be infinite and grow with their number.")
    for p in one.prices:
        if not technique(p.technique).independent:
            notes.append(f"{p.technique}: the variance of {p.spp} samples, times {p.spp}; more have less.")
        if p.technique.endswith("-learned"):
            notes.append(f"{p.technique} learns for {number(p.build_seconds)} s first, which is not counted.")
    return notes


def lecture_ids(ids: Sequence[str]) -> str:
    """("L1", "L2", "L3", "L9") as "L1–3 L9"."""
    numbers = sorted({int(name[1:]) for name in ids})
    runs: list[list[int]] = []
    for n in numbers:
        if runs and n == runs[-1][-1] + 1:
            runs[-1].append(n)
        else:
            runs.append([n])
    parts = [f"L{r[0]}–{r[-1]}" if len(r) > 2 else " ".join(f"L{n}" for n in r) for r in runs]
    return " ".join(parts)


def markdown(scenes: Sequence[ScenePrices]) -> str:
    """A page's table of some scenes: a technique a line, in the order of the lecture, and in each scene's
    column "efficiency × (variance × · time ×)".
    """
    by_name = [{p.technique: p for p in one.prices} for one in scenes]
    lines = ["| | | " + " | ".join(one.scene for one in scenes) + " |", "| --- " * (len(scenes) + 2) + "|"]
    for each in TECHNIQUES:
        if any(each.name in prices for prices in by_name):
            cells = [_cell(prices.get(each.name)) for prices in by_name]
            lines.append(f"| `{each.name}` | {lecture_ids(each.lecture)} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _cell(one: Price | None) -> str:
    if one is None:
        return ""
    _, _, variance, _, time, _ = row(one)
    gain = number(one.efficiency.median) if one.efficiency else "∞" if one.variance == 0 else "0"
    return f"**{gain}** ({variance} · {time})"
