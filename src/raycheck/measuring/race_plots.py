"""Error curves as data for the pages' plots, and as tables; their pictures packed for the viewer."""

import base64
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from raycheck.base import pictures
from raycheck.base.arrays import Array
from raycheck.base.text import number
from raycheck.measuring.races.curves import Curve, SceneCurves, Shown
from raycheck.measuring.races.measured import TARGET
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
SPLIT = ("standard deviation", "bias")
"""The last of the choices shows both, without the noise of the reference."""


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


def plots(scene: SceneCurves) -> dict[str, Any] | None:
    """What plots.js draws of a scene: relative errors, with their bands, at the levels of each contestant,
    and the seconds of a sample; None where nobody has a curve.
    """
    chosen = colours(scene)
    drawn = [one for one in scene.curves if one.levels and one.sample_seconds]
    if not drawn or scene.mean <= 0:
        return None
    return {
        "scene": scene.scene, "floor": scene.floor / scene.mean, "target": TARGET,
        "choices": [*METRICS, "bias and standard deviation"],
        "curves": [_drawn(one, chosen.get(one.name), scene.mean) for one in drawn],
    }  # fmt: skip


def _drawn(one: Curve, colour: int | None, mean: float) -> dict[str, Any]:
    """A contestant: its errors over the mean of the reference, (value, low, high) at each level; None where
    there is none.
    """
    bands = {name: list(map(of, one.levels)) for name, of in METRICS.items()}
    spread = [_root(level.variance) for level in one.levels]
    bias = [_bias_bound(level.bias2) for level in one.levels]
    shares = {name: 1.0 if name.startswith("√") else mean for name in bands}
    errors = {name: [_relative(band, shares[name]) for band in found] for name, found in bands.items()}
    errors |= {name: [_relative(band, mean) for band in found]
               for name, found in zip(SPLIT, (spread, bias), strict=True)}  # fmt: skip
    spread_seconds = one.sample_seconds
    assert spread_seconds
    return {
        "name": one.name, "colour": colour, "spp": [level.spp for level in one.levels],
        "seconds": spread_seconds.median, "errors": errors, "told": told(one),
    }  # fmt: skip


def _relative(band: Band, mean: float) -> list[float] | None:
    return [band.value / mean, max(band.low, 0.0) / mean, band.high / mean] if band.value > 0 else None


def told(one: Curve) -> str:
    """How long to an error of 1 %, in words."""
    if one.seconds_to_target is None:
        return "never gets to 1 %: it is biased" if one.flag == "bias" else "no time to 1 % is known"
    return f"1 % after {number(one.seconds_to_target)} s"


def _bias_bound(bias2: Band) -> Band:
    """The bias where it is there for sure, else the largest that it may be."""
    root = _root(bias2)
    return root if bias2.low > 0 else Band(root.high, root.low, root.high)


def efficiencies(scene: SceneCurves) -> list[tuple[str, int | None, Band, float]]:
    """Contestants by 1/(variance · time) over the baseline's, the best first, each with its colour and the
    share of the widest bar, on a logarithmic scale that begins at the least.
    """
    found = [(one.name, one.relative_efficiency) for one in scene.curves if one.relative_efficiency]
    found.sort(key=lambda pair: -pair[1].value)
    if not found:
        return []
    low = math.log10(min(band.low for _, band in found) * 0.8)
    most = math.log10(max(band.high for _, band in found)) - low
    chosen = colours(scene)
    return [
        (name, chosen.get(name), band, max((math.log10(band.value) - low) / most, 0.01))
        for name, band in found
    ]


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
