"""The report's part on stiff cases: tables, paragraphs, and curves over what is swept."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from raycheck.measuring import log_log
from raycheck.measuring.stability import precisions, sweeps, tables
from raycheck.measuring.stability.case import Case
from raycheck.measuring.stability.results import Curve, Point, Result, read

SMALLEST_ERROR = 1e-9
"""Smaller ones are drawn here."""
LARGEST_ERROR = 1e3


@dataclass(frozen=True)
class Plot:
    names: list[str]
    drawn: dict[str, Any]


@dataclass(frozen=True)
class Section:
    title: str
    wrong: str
    instead: str
    plots: list[Plot]


def section(path: Path, compared: Path | None = None) -> dict[str, Any]:
    """What stability.html shows of a result of `raycheck stability --json`, and of one of
    scripts/precisions.py --json.
    """
    results, header = read(path)
    shown = [(result, sweeps.cases_named([result.case])[0]) for result in results]
    return {
        "columns": tables.COLUMNS,
        "rows": [tables.row(result) for result in results],
        "cases": [
            Section(case.title, case.wrong, case.instead, plots(result, case)) for result, case in shown
        ],
        "machine": header["machine"],
        "date": header.get("date", ""),
        "command": header["command"],
        "precisions": _precisions(compared) if compared else None,
    }


def _precisions(path: Path) -> dict[str, Any]:
    pairs, header = precisions.read(path)
    return {
        "columns": precisions.COLUMNS,
        "rows": [precisions.row(pair) for pair in pairs],
        "summary": precisions.summary(pairs),
        "command": header["command"],
    }


def plots(result: Result, case: Case) -> list[Plot]:
    """Values beside the closed form, where it is not 0; errors, or spreads, beside what is allowed."""
    drawn = []
    if case.measure == "mean" and all(point.expected > 0 for point in result.curves[0].points):
        truth = [(point.x, point.expected) for point in result.curves[0].points]
        found = {curve.renderer: _values(curve) for curve in result.curves}
        drawn.append(_plot("closed form", truth, found, result.parameter, "radiance"))
    label = "relative standard deviation of a sample" if case.measure == "spread" else "relative error"
    limit = max(case.within, SMALLEST_ERROR)
    line = [(point.x, limit) for point in result.curves[0].points]
    found = {curve.renderer: [(p.x, _size(p)) for p in curve.points] for curve in result.curves}
    return [*drawn, _plot("allowed", line, found, result.parameter, label)]


def _values(curve: Curve) -> list[tuple[float, float]]:
    return [(point.x, point.found) for point in curve.points if point.found]


def _size(point: Point) -> float:
    """No picture counts as an error of 1: black."""
    return min(max(1.0 if point.error is None else abs(point.error), SMALLEST_ERROR), LARGEST_ERROR)


def _plot(
    name: str, line: log_log.Points, found: Mapping[str, log_log.Points], x_label: str, y_label: str
) -> Plot:
    """The plain line first, then Mitsuba where there is one, oneray last and on top."""
    others = dict(reversed(list(found.items()))) if len(found) > 1 else {"": [], **found}
    every = {name: line, **others}
    drawn = log_log.log_log(every, x_label, y_label, plain=(name,))
    return Plot([label for label in every if label], drawn)
