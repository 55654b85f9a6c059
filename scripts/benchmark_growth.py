"""How the cost of a picture grows with its size, samples, depth, lights and triangles."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from benchmark_contestants import FOLDER, Contestant, Failed, Mitsuba, Oneray
from benchmark_measure import BASELINE, VARIANTS, Log
from benchmark_scenes import ball, cornell, hall

LEAST_REPEATS, MOST_REPEATS, LEAST_SECONDS = 2, 5, 0.3
PATIENCE = 200.0
"""A contestant whose last point took longer than this many seconds in all is not asked for the next."""


@dataclass(frozen=True)
class Axis:
    """What grows."""

    name: str
    label: str
    scene: str
    xs: tuple[int, ...]
    at: Callable[[int], tuple[Path, int]]
    """The scene file and the samples per pixel at x."""
    options: tuple[str, ...] = ()


AXES = (
    Axis("pixels", "pixels", "Cornell box, depth 8, 1 sample per pixel",
         tuple(side**2 for side in (16, 32, 64, 128, 256, 512, 1024)),
         lambda x: (cornell(FOLDER, 8, size=math.isqrt(x)), 1)),
    Axis("spp", "samples per pixel", "Cornell box, depth 8, 16 × 16 pixels",
         (1, 4, 16, 64, 256, 1024, 4096), lambda x: (cornell(FOLDER, 8, size=16), x)),
    Axis("depth", "depth", "Cornell box without roulette, 64 × 64 pixels, 16 samples per pixel",
         (1, 2, 4, 8, 16, 32, 64), lambda x: (cornell(FOLDER, x, roulette=False, size=64), 16),
         ("--roulette", "none")),
    Axis("lights", "lights", "hall, direct light, 64 × 64 pixels, 16 samples per pixel",
         (1, 10, 100, 1000, 10_000), lambda x: (hall(FOLDER, x), 16)),
    Axis("triangles", "triangles", "displaced ball, depth 6, 128 × 128 pixels, 8 samples per pixel",
         (10, 100, 1000, 10_000, 100_000, 1_000_000), lambda x: (ball(FOLDER, x), 8)),
)  # fmt: skip


def exponent(xs: Sequence[float], seconds: Sequence[float]) -> dict[str, float] | None:
    """p of seconds ∝ xᵖ and its standard error, by least squares of the logarithms over the last decade, or
    the last two where one has fewer than four points, or all. None where there are fewer than three.
    """
    x, y = np.log10(np.array(xs, dtype=float)), np.log10(np.array(seconds, dtype=float))
    for decades in (1.0, 2.0, math.inf):
        used = x >= x.max(initial=0.0) - decades - 1e-9
        if used.sum() >= (4 if decades == 1 else 3):
            break
    else:
        return None
    x, y = x[used], y[used]
    centred = x - x.mean()
    slope = float(centred @ y / (centred @ centred))
    left = y - y.mean() - slope * centred
    error = math.sqrt(float(left @ left) / (len(x) - 2) / float(centred @ centred))
    return {"value": slope, "error": error, "from": 10 ** float(x[0]), "points": len(x)}


def point(contestant: Contestant, axis: Axis, x: int) -> dict[str, float]:
    """Seconds to build (with the compilation, for Mitsuba) and to render, the median of a few."""
    path, spp = axis.at(x)
    contestant.open(path)
    first = contestant.render(spp, 1)
    renders = []
    while len(renders) < LEAST_REPEATS or (
        len(renders) < MOST_REPEATS and sum(one.seconds for one in renders) < LEAST_SECONDS
    ):
        renders.append(contestant.render(spp, 2 + len(renders)))
    render = statistics.median(one.seconds for one in renders)
    compiled = max(0.0, first.seconds - render) if isinstance(contestant, Mitsuba) else 0.0
    return {"x": x, "render": render, "build": first.build, "compile": compiled, "memory": first.memory}


def grow(axis: Axis, log: Log, most: int | None = None) -> dict:
    """The curves of an axis, up to `most` points; after Ctrl-C those that are finished."""
    contestants: list[Contestant] = [
        Mitsuba(BASELINE, VARIANTS[BASELINE], cold=True),
        Oneray("oneray double", ("--precision", "double", *axis.options)),
        Oneray("oneray single", ("--precision", "single", *axis.options)),
    ]
    points: dict[str, list[dict]] = {one.name: [] for one in contestants}
    reasons: dict[str, str] = {}
    interrupted = False
    try:
        for x in axis.xs[:most]:
            for one in (c for c in contestants if c.name not in reasons):
                _add_point(one, axis, x, points[one.name], reasons)
            log(f"growth with {axis.label}: {x}")
    except KeyboardInterrupt:
        interrupted = True
    for one in contestants:
        one.close()
    curves = [
        {
            "name": name,
            "points": found,
            "exponent": exponent([p["x"] for p in found], [p["render"] for p in found]),
            "reason": reasons.get(name, ""),
        }
        for name, found in points.items()
    ]
    return {"axis": axis.name, "label": axis.label, "scene": axis.scene, "curves": curves,
            "interrupted": interrupted}  # fmt: skip


def _add_point(one: Contestant, axis: Axis, x: int, points: list[dict], reasons: dict[str, str]) -> None:
    last = points[-1] if points else None
    if last and last["render"] + last["build"] + last["compile"] > PATIENCE:
        reasons[one.name] = f"stopped: {axis.label} {last['x']} took longer than {PATIENCE:g} s"
        return
    try:
        points.append(point(one, axis, x))
    except Failed as failed:
        reasons[one.name] = str(failed)
