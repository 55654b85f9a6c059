"""The results of the sweeps as tables."""

import math
from collections.abc import Sequence

from raycheck.base.text import percent
from raycheck.measuring.stability.case import Case
from raycheck.measuring.stability.results import Point, Result
from raycheck.measuring.stability.sweeps import cases_named

COLUMNS = ("case", "swept", "allowed", "goal", "oneray holds to", "fails at", "Mitsuba holds to", "fails at")


def value(x: float) -> str:
    """1e-12, 0.1, 20; powers of two as such."""
    exponent = math.log2(x)
    if x > 4 and exponent == int(exponent) and exponent >= 10:
        return f"2^{int(exponent)}"
    return f"{x:g}"


def error_text(point: Point) -> str:
    """What is wrong there."""
    if point.reason == "noise":
        return f"noise ± {percent(2 * point.noise)}"
    if point.reason:
        return point.reason if point.reason in ("black", "not finite") else "no picture"
    if point.found == 0 and point.expected != 0:
        return "black"
    size = abs(point.error or 0.0)
    return f"off by {size:.3g} times" if size >= 10 else f"off by {percent(size)}"


def row(result: Result) -> tuple[str, ...]:
    """The cells of a case's line."""
    case = cases_named([result.case])[0]
    limit = (
        f"spread {case.within:g}"
        if case.measure == "spread"
        else f"{case.within:.0e}"
        if case.within < 1e-4
        else percent(case.within)
    )
    limit = limit if case.within else "none"
    cells = [result.case, result.parameter, limit, value(result.goal)]
    for curve in result.curves:
        bad = curve.first_bad
        cells.append("–" if curve.last_good is None else value(curve.last_good))
        cells.append("–" if bad is None else f"{value(bad.x)}, {_how(case, bad)}")
    return tuple(cells)


def _how(case: Case, point: Point) -> str:
    if case.measure == "spread" and point.found and math.isfinite(point.error or 0.0):
        return f"spread {point.found:.3g}"
    return error_text(point)


def markdown(results: Sequence[Result]) -> str:
    """The table of all cases for docs/stability.md."""
    lines: list[Sequence[str]] = [COLUMNS, ["---"] * len(COLUMNS)]
    lines += [[*cells, *[""] * (len(COLUMNS) - len(cells))] for cells in map(row, results)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)
