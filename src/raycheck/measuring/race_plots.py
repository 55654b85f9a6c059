"""Error curves as SVG and tables for the report, and their pictures packed for its viewer."""

import base64
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np
from markupsafe import Markup

from raycheck.base import pictures
from raycheck.base.arrays import Array
from raycheck.base.text import number
from raycheck.measuring import log_log
from raycheck.measuring.log_log import LEFT, RIGHT, WIDTH, Axes
from raycheck.measuring.races.curves import Curve, SceneCurves, Shown
from raycheck.stats.convergence import SLOPE, SLOPE_WITHIN, Band, Level

COLOURS = 5
"""Curves that have a colour of their own; the others are grey until they are chosen in the table."""


def _root(band: Band) -> Band:
    return Band(*(math.sqrt(max(x, 0.0)) for x in (band.value, band.low, band.high)))


METRICS: Mapping[str, Callable[[Level], Band]] = {
    "RMSE": lambda level: level.rmse,
    "RMSE without outliers": lambda level: level.rmse_without_outliers,
    "√relMSE": lambda level: _root(level.relmse),
    "√relMSE without outliers": lambda level: _root(level.relmse_without_outliers),
}
SPLIT = "bias and standard deviation"


@dataclass(frozen=True)
class Figure:
    """Two plots of one metric."""

    metric: str
    over_seconds: Markup
    over_samples: Markup


@dataclass(frozen=True)
class Cell:
    text: str
    value: float | str
    """The number by which the table sorts."""


@dataclass(frozen=True)
class Row:
    name: str
    colour: int | None
    about: str
    cells: list[Cell]
    flag: str
    why: str
    command: str
    reason: str


def colours(scene: SceneCurves) -> dict[str, int]:
    """The contestants that are drawn in colour: those whose pictures are shown."""
    names = [one.name for one in scene.equal_samples] or [c.name for c in scene.curves if not c.reason]
    return {name: index for index, name in enumerate(names[:COLOURS])}


def figures(scene: SceneCurves) -> list[Figure]:
    """The plots of each metric, then bias and standard deviation apart."""
    found = []
    for metric, of in METRICS.items():
        floor = scene.floor if metric.startswith("RMSE") else 0.0
        plots = [_plot(scene, metric, of, floor, over) for over in ("seconds", "samples")]
        if all(plots):
            found.append(Figure(metric, *plots))
    split = [_split(scene, over) for over in ("seconds", "samples")]
    return [*found, Figure(SPLIT, *split)] if all(split) else found


Places = list[tuple[float, Band]]


def _points(curve: Curve, of: Callable[[Level], Band], over: str) -> Places:
    """(seconds or samples, error) where there is an error."""
    pairs = [(curve.seconds(x.spp) if over == "seconds" else float(x.spp), of(x)) for x in curve.levels]
    return [(x, band) for x, band in pairs if band.value > 0]


def _label(over: str) -> str:
    return "process time, seconds" if over == "seconds" else "samples per pixel"


def _plot(scene: SceneCurves, metric: str, of: Callable[[Level], Band], floor: float, over: str) -> Markup:
    """All curves of a metric, the grey ones below; the slope −½ and the noise of the reference."""
    shown = {c.name: _points(c, of, over) for c in scene.curves}
    shown = {name: points for name, points in shown.items() if points}
    if not shown:
        return Markup("")
    axes = _axes(list(shown.values()), [floor] if floor > 0 else [])
    parts = axes.begin(_label(over), metric, f"{scene.scene}, {metric} over {over}: {', '.join(shown)}")
    parts += [_guide(axes, list(shown.values())), _floor(axes, floor)]
    chosen = colours(scene)
    for name in sorted(shown, key=lambda name: chosen.get(name, -1)):
        parts.append(_drawn(axes, name, shown[name], chosen.get(name), _spread(scene, name, over)))
    return Markup("".join([*parts, "</svg>"]))


def _spread(scene: SceneCurves, name: str, over: str) -> tuple[float, float] | None:
    """Fastest and slowest round over the median."""
    spread = next(c.sample_seconds for c in scene.curves if c.name == name)
    if over != "seconds" or spread is None:
        return None
    return spread.low / spread.median, spread.high / spread.median


def _axes(curves_of_points: Sequence[Places], more: Sequence[float] = ()) -> Axes:
    every = [point for points in curves_of_points for point in points]
    return Axes([x for x, _ in every], [*(band.value for _, band in every), *more])


def _drawn(
    axes: Axes, name: str, points: Places, colour: int | None, spread: tuple[float, float] | None
) -> str:
    """A curve: its band, its line and markers, and how far apart the rounds were in time at its end."""
    places = [axes.place(x, band.value) for x, band in points]
    known = f'data-name="{escape(name)}"'
    title = f"<title>{escape(name)}</title>"
    if colour is None:
        return f'<g class="other" {known}>{title}{log_log.curve(3, places, [])}</g>'
    least = 10.0**axes.y0
    upper = [axes.place(x, max(band.high, least)) for x, band in points]
    lower = [axes.place(x, max(band.low, least)) for x, band in points]
    outline = " ".join(f"{x:.1f},{y:.1f}" for x, y in [*upper, *reversed(lower)])
    band = f'<g class="curve{colour}"><polygon points="{outline}"/></g>'
    line = log_log.curve(colour, places, places)
    return f"<g {known}>{title}{band}{line}{_whisker(axes, colour, points, spread)}</g>"


def _whisker(axes: Axes, colour: int, points: Places, spread: tuple[float, float] | None) -> str:
    if spread is None:
        return ""
    x, band = points[-1]
    (left, y), (right, _) = (axes.place(x * part, band.value) for part in spread)
    return f'<line class="curve{colour} whisker" x1="{left:.1f}" y1="{y:.1f}" x2="{right:.1f}" y2="{y:.1f}"/>'


def _guide(axes: Axes, curves_of_points: Sequence[Places]) -> str:
    """A dashed line of slope −½ through the middle of all points."""
    every = [(math.log10(x), math.log10(band.value)) for points in curves_of_points for x, band in points]
    x, y = (sum(values) / len(every) for values in zip(*every, strict=True))
    low, high = axes.x0, axes.x1
    if y + SLOPE * (low - x) > axes.y1:
        low = x + (axes.y1 - y) / SLOPE
    if y + SLOPE * (high - x) < axes.y0:
        high = x + (axes.y0 - y) / SLOPE
    ends = [axes.place(10**end, 10 ** (y + SLOPE * (end - x))) for end in (low, high)]
    (x1, y1), (x2, y2) = ends
    text = f'<text class="guide" x="{x2 - 4:.1f}" y="{y2 - 6:.1f}" text-anchor="end">slope −½</text>'
    return f'<line class="guide" x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"/>{text}'


def _floor(axes: Axes, floor: float) -> str:
    if floor <= 0:
        return ""
    _, y = axes.place(10.0**axes.x0, floor)
    return (
        f'<line class="floor" x1="{LEFT}" y1="{y:.1f}" x2="{WIDTH - RIGHT}" y2="{y:.1f}"/>'
        f'<text class="guide" x="{LEFT + 4}" y="{y - 4:.1f}">noise of the reference</text>'
    )


def _split(scene: SceneCurves, over: str) -> Markup:
    """Standard deviation (solid) and bias (dashed, with its band) of the curves in colour; a bias that its
    interval does not tell from 0 is drawn at the upper end of the interval.
    """
    chosen = colours(scene)
    found: list[tuple[str, int, Places, Places]] = []
    for curve in scene.curves:
        if curve.name in chosen and curve.levels:
            spread = _points(curve, lambda level: _root(level.variance), over)
            bias = _points(curve, lambda level: _bias_bound(level.bias2), over)
            found.append((curve.name, chosen[curve.name], spread, bias))
    every = [points for _, _, spread, bias in found for points in (spread, bias) if points]
    if not every:
        return Markup("")
    axes = _axes(every)
    about = f"{scene.scene}, standard deviation and bias over {over}: {', '.join(name for name, *_ in found)}"
    parts = [*axes.begin(_label(over), SPLIT, about), _guide(axes, [spread for _, _, spread, _ in found])]
    for name, colour, spread, bias in found:
        parts.append(_drawn(axes, name, spread, colour, None))
        line = log_log.curve(colour, [axes.place(x, band.value) for x, band in bias], [])
        parts.append(f'<g data-name="{escape(name)}">{line}</g>')
    return Markup("".join([*parts, "</svg>"]))


def _bias_bound(bias2: Band) -> Band:
    """The bias where it is there for sure, else the largest that it may be."""
    root = _root(bias2)
    return root if bias2.low > 0 else Band(root.high, root.low, root.high)


BAR, GAP, NAMES = 18, 6, 150


def efficiency_bars(scene: SceneCurves) -> Markup:
    """1/(variance · time) over the baseline's, the best on top, on a logarithmic scale around 1."""
    shown = sorted(
        (c for c in scene.curves if c.relative_efficiency),
        key=lambda c: -c.relative_efficiency.value,  # type: ignore[union-attr]
    )
    if not shown:
        return Markup("")
    bands = [c.relative_efficiency for c in shown if c.relative_efficiency]
    low = math.floor(math.log10(min([1.0, *(b.low for b in bands)])))
    high = max(math.ceil(math.log10(max([1.0, *(b.high for b in bands)]))), low + 1)
    height = len(shown) * (BAR + GAP) + 22

    def across(value: float) -> float:
        return NAMES + (math.log10(value) - low) / (high - low) * (WIDTH - NAMES - 60)

    about = "; ".join(f"{c.name} {number(b.value)}" for c, b in zip(shown, bands, strict=True))
    parts = [f'<svg class="plot bars" viewBox="0 0 {WIDTH} {height}" role="img" '
             f'aria-label="{escape(f"efficiency over that of {scene.baseline}: {about}")}">']  # fmt: skip
    for n in range(low, high + 1):
        x = across(10.0**n)
        parts.append(f'<line class="grid" x1="{x:.1f}" y1="0" x2="{x:.1f}" y2="{height - 20}"/>')
        parts.append(f'<text x="{x:.1f}" y="{height - 5}" text-anchor="middle">{_power(n)}</text>')
    chosen = colours(scene)
    for index, (curve, band) in enumerate(zip(shown, bands, strict=True)):
        y = index * (BAR + GAP) + 2
        left, right = sorted((across(1.0), across(band.value)))
        colour = chosen.get(curve.name)
        kind = "other" if colour is None else f"curve{colour}"
        parts.append(
            f'<text x="{NAMES - 6}" y="{y + 13}" text-anchor="end">{escape(curve.name)}</text>'
            f'<g class="{kind}" data-name="{escape(curve.name)}"><rect x="{left:.1f}" y="{y}" '
            f'width="{max(right - left, 1):.1f}" height="{BAR}"/></g><line class="whisker" '
            f'x1="{across(band.low):.1f}" y1="{y + BAR / 2}" '
            f'x2="{across(band.high):.1f}" y2="{y + BAR / 2}"/>'
            f'<text x="{across(max(band.high, 1.0)) + 5:.1f}" y="{y + 13}">{number(band.value)}</text>'
        )
    return Markup("".join([*parts, "</svg>"]))


def _power(n: int) -> str:
    return f"{10.0**n:g}" if -3 <= n < 0 else log_log.power_of_ten(n)


COLUMNS = (
    "spp", "RMSE", "RMSE w/o outliers", "relMSE", "relMSE w/o outliers", "slope", "slope of √relMSE",
    "ms per sample", "± %", "start, ms", "s to 1 %", "efficiency ×", "bends by",
)  # fmt: skip


def rows(scene: SceneCurves) -> list[Row]:
    """A contestant a row under COLUMNS, in the order of the race."""
    chosen = colours(scene)
    return [_row(one, chosen.get(one.name)) for one in scene.curves]


def slope_text(band: Band | None) -> str:
    """The slope as text: "−0.50 ± 0.01"."""
    if band is None:
        return "–"
    return f"{band.value:.3f} ± {(band.high - band.low) / 2:.3f}".replace("-", "−")


def _row(one: Curve, colour: int | None) -> Row:
    made = Row(one.name, colour, one.about, [], one.flag, one.why, one.command, one.reason)
    if one.reason or not one.levels or one.sample_seconds is None:
        return made
    top, spread = one.levels[-1], one.sample_seconds
    wide = 50 * (spread.high - spread.low) / spread.median
    gain = one.relative_efficiency
    numbers = [top.spp, top.rmse.value, top.rmse_without_outliers.value, top.relmse.value,
               top.relmse_without_outliers.value]  # fmt: skip
    cells = [Cell(f"{x:,}" if isinstance(x, int) else f"{x:.3g}", x) for x in numbers]
    for slope in (one.slope, one.relative_slope):
        cells.append(Cell(slope_text(slope), slope.value if slope else math.inf))
    cells += [
        Cell(number(1e3 * spread.median), spread.median),
        Cell(f"{wide:.0f}", wide),
        Cell(number(1e3 * one.start_seconds), one.start_seconds),
        Cell(*to_target(one)),
        Cell(number(gain.value) if gain else "∞", gain.value if gain else math.inf),
        Cell(one.flag or "–", one.flag),
    ]
    return Row(**{**made.__dict__, "cells": cells})


def to_target(one: Curve) -> tuple[str, float]:
    """Seconds to a relative RMSE of 1 % as text, and as a number."""
    if one.seconds_to_target is None:
        return ("never" if one.flag == "bias" else "–"), math.inf
    return number(one.seconds_to_target), one.seconds_to_target


def startup_lines(scene: SceneCurves) -> list[str]:
    """What was spent once before the first picture, where a renderer stays."""
    return [
        f"{one.name}: " + ", ".join(f"{what} {number(seconds)} s" for what, seconds in one.opened.items())
        for one in scene.curves
        if one.opened
    ]


def flagged(scenes: Sequence[SceneCurves]) -> list[tuple[str, Curve]]:
    return [(scene.scene, one) for scene in scenes for one in scene.curves if one.flag]


def slopes_summary(scenes: Sequence[SceneCurves], unbounded: Mapping[str, frozenset[str]]) -> tuple[int, int]:
    """How many curves of bounded, independent samples have a fitted slope of RMSE within −½ ± 0.03, and how
    many there are.
    """
    within = total = 0
    for scene in scenes:
        for one in scene.curves:
            if one.slope is None or "sobol" in one.name or one.flag == "bias":
                continue
            if one.name in unbounded.get(scene.scene, frozenset()):
                continue
            total += 1
            within += abs(one.slope.value - SLOPE) <= SLOPE_WITHIN
    return within, total


def rgbe(image: Array) -> bytes:
    """(H, W, 3) as four bytes a pixel, row by row: three mantissas m and an exponent e, m·2^(e − 136)."""
    image = np.maximum(image, 0.0)
    largest = image.max(axis=2)
    exponent = np.where(largest > 1e-30, np.frexp(largest)[1], -128).astype(np.int64)
    mantissas = np.round(image * np.exp2(8.0 - exponent)[..., None])
    over = mantissas.max(axis=2) > 255  # rounded up to 256
    exponent = np.where(over, exponent + 1, exponent)
    mantissas = np.minimum(np.round(image * np.exp2(8.0 - exponent)[..., None]), 255)
    packed = np.concatenate([mantissas, (exponent + 128)[..., None]], axis=2)
    result: bytes = np.clip(packed, 0, 255).astype(np.uint8).tobytes()
    return result


def viewer(scene: SceneCurves, images: Mapping[str, Array]) -> dict[str, Any] | None:
    """What the viewer's script needs; None where there are no pictures."""
    if "reference" not in images or not scene.equal_samples:
        return None
    reference = images["reference"]

    def packed(one: Shown) -> dict[str, Any]:
        return {
            "name": one.name,
            "pixels": base64.b64encode(rgbe(images[one.key])).decode(),
            "caption": f"{one.spp:,} spp, {number(1e3 * one.seconds)} ms, RMSE {one.rmse:.3g}, "
            f"relMSE {one.relmse:.3g}",
            "command": one.command,
        }

    return {
        "scene": scene.scene, "width": scene.width, "height": scene.height,
        "exposure": pictures.exposure(reference), "mean": float(reference.mean()),
        "stops": np.round(pictures.STOPS * 255).astype(int).tolist(),
        "reference": base64.b64encode(rgbe(reference)).decode(),
        "samples": [packed(one) for one in scene.equal_samples],
        "time": [packed(one) for one in scene.equal_time],
    }  # fmt: skip
