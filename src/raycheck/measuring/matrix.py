"""The verdicts as a matrix, scene × technique, in the order of the ladder: what each cell says, and why a
blank one is blank.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from raycheck.scene.content import read_content
from raycheck.scene.techniques import TECHNIQUES, left_out
from raycheck.scene.variants import Variant
from raycheck.stats.verdict import Outcome

LETTERS = {Outcome.PASS: "P", Outcome.FAIL: "F", Outcome.INCONCLUSIVE: "?", Outcome.SKIP: "S"}
NOT_JUDGED = "·"
NO_REFERENCE = "no verdict at this depth: it is the scene's own, or has no reference"
ORDER = [Outcome.FAIL, Outcome.INCONCLUSIVE, Outcome.PASS, Outcome.SKIP]
"""The worst first."""


@dataclass(frozen=True)
class Cell:
    """A verdict, or the sign of why there is none."""

    technique: str
    sign: str
    verdict: str = ""
    said: str = ""
    scene: str = ""
    """Label of the scene, or of its variant, that was judged."""


@dataclass(frozen=True)
class Row:
    scene: str
    lecture: str
    cells: list[Cell]


@dataclass(frozen=True)
class Matrix:
    techniques: list[str]
    others: list[str]
    """Parameters of variants, "depth=-1", which have a column each; one technique is judged with them."""
    rows: list[Row]
    reasons: dict[str, str] = field(default_factory=dict)
    """What a sign of a blank cell means."""


def matrix(wanted: Sequence[Variant], cases: Sequence[Mapping[str, Any]]) -> Matrix:
    """Of these scenes, and of their variants that were judged."""
    found: dict[str, dict[str, Mapping[str, Any]]] = {}
    for case in cases:
        found.setdefault(case["scene"], {})[case["technique"]] = case
    judged = {name for by_technique in found.values() for name in by_technique}
    names = [one.name for one in TECHNIQUES] + sorted(judged - {one.name for one in TECHNIQUES})
    signs: dict[str, str] = {}
    own = {of.label for of in wanted}
    others = sorted({rest for label in found if (rest := label.partition("@")[2]) and label not in own})
    rows = []
    for of in wanted:
        why = _why_not(of)
        cells = [_cell(of.label, name, found.get(of.label, {}).get(name), why, signs) for name in names]
        lecture = " ".join(_lecture(cells))
        for rest in others:
            label = f"{of.label}@{rest}"
            there = found.get(label, {})
            worst = min(there.values(), key=_badness, default={"technique": ""})
            name = worst["technique"]
            cells.append(_cell(label, name, there.get(name), {name: NO_REFERENCE}, signs))
        rows.append(Row(of.label, lecture, cells))
    told = {sign: why for why, sign in signs.items()}
    return Matrix(names, others, rows, told | {NOT_JUDGED: "it applies, and was not judged in this run"})


def _badness(case: Mapping[str, Any]) -> int:
    """The lower the worse."""
    return ORDER.index(Outcome(case["verdict"]))


def _why_not(of: Variant) -> dict[str, str]:
    """Techniques that do not apply to a scene, with the reason."""
    reasons = left_out(read_content(of.path, of.parameters))
    return {name: why for why, names in reasons.items() for name in names}


def _cell(
    scene: str, name: str, case: Mapping[str, Any] | None, why: Mapping[str, str], signs: dict[str, str]
) -> Cell:
    """`signs` gets a letter for each reason, in the order in which they are met."""
    if case:
        verdict = Outcome(case["verdict"])
        return Cell(name, LETTERS[verdict], verdict, case["reason"], scene)
    if name not in why:
        return Cell(name, NOT_JUDGED)
    sign = signs.setdefault(why[name], chr(ord("a") + len(signs)))
    return Cell(name, sign, said=why[name])


def _lecture(cells: Sequence[Cell]) -> list[str]:
    judged = {cell.technique for cell in cells if cell.verdict}
    return list(dict.fromkeys(one for t in TECHNIQUES if t.name in judged for one in t.lecture))
