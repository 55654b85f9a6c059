"""What the sweeps showed, in memory and in a file."""

import copy
import json
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from raycheck.base.errors import NotFound
from raycheck.truth.provenance import Provenance


@dataclass(frozen=True)
class Point:
    """A value of the swept parameter.

    Attributes:
        expected, found: the closed form and the pixels' mean, W·sr⁻¹·m⁻²; for measures other than `mean` what
            is allowed, and the share or spread.
        error: relative; of a spread, the spread itself.
        noise: standard error of it.
    """

    x: float
    expected: float
    found: float | None
    error: float | None
    noise: float
    holds: bool
    reason: str = ""


@dataclass(frozen=True)
class Curve:
    """What a renderer did in a case."""

    renderer: str
    within: float
    points: list[Point]

    @property
    def last_good(self) -> float | None:
        """The last value up to which all hold."""
        good = [point.x for point in self.points[: self._failing]]
        return good[-1] if good else None

    @property
    def first_bad(self) -> Point | None:
        return self.points[self._failing] if self._failing < len(self.points) else None

    @property
    def _failing(self) -> int:
        return next((k for k, point in enumerate(self.points) if not point.holds), len(self.points))


@dataclass(frozen=True)
class Result:
    case: str
    title: str
    parameter: str
    goal: float
    curves: list[Curve]
    provenance: Provenance = field(default_factory=dict)

    def holds(self) -> bool:
        """Whether the first renderer reaches the goal, with every value up to it."""
        reached = self.curves[0].points
        order = -1 if reached[0].x > self.goal else 1
        return all(point.holds for point in reached if order * point.x <= order * self.goal)


def to_json(results: Sequence[Result], header: dict[str, Any]) -> str:
    """The JSON text of results and their header."""
    return as_text(header | {"cases": [asdict(result) for result in results]})


def as_text(found: dict[str, Any]) -> str:
    """The JSON text of such a file; one point a line."""
    found = copy.deepcopy(found)
    marks: dict[str, str] = {}
    for result in found["cases"]:
        for curve in result["curves"]:
            for k, point in enumerate(curve["points"]):
                mark = f"@{len(marks)}@"
                marks[mark] = json.dumps(point, ensure_ascii=False)
                curve["points"][k] = mark
    text = json.dumps(found, indent=1, ensure_ascii=False)
    return re.sub(r'"(@\d+@)"', lambda match: marks[match.group(1)], text) + "\n"


def read(path: Path) -> tuple[list[Result], dict[str, Any]]:
    """A result of `raycheck stability --json`, and its header; NotFound if it is none."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        results = [
            Result(**{**result, "curves": [
                Curve(c["renderer"], c["within"], [Point(**point) for point in c["points"]])
                for c in result["curves"]
            ]})
            for result in found.pop("cases")
        ]  # fmt: skip
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise NotFound(f"{path}: no result of raycheck stability --json ({error})") from None
    return results, found
