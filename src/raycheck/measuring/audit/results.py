"""What came out, in memory and in a file, and what a new run changed."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from raycheck.base.errors import NotFound


@dataclass(frozen=True)
class Value:
    """A measured value and its interval, radiances relative to that of the light."""

    name: str
    expected: float
    measured: float
    low: float
    high: float
    deviates: bool
    """Whether it is claimed to differ from what is expected."""

    @property
    def off(self) -> float:
        """Relative."""
        return self.measured / self.expected - 1


@dataclass(frozen=True)
class Record:
    """A finding or a statement of health, with all that one needs to see it oneself."""

    id: str
    renderer: str
    version: str
    says: str
    verdict: str
    values: list[Value]
    why: str
    command: str
    scene: str
    settings: Mapping[str, str]
    samples: int
    batches: int
    within: float
    documented: str
    act: str
    report: str


def to_json(records: Sequence[Record], header: Mapping[str, Any]) -> str:
    """What `read` reads."""
    found = {**header, "records": [asdict(one) for one in records]}
    return json.dumps(found, indent=1, ensure_ascii=False) + "\n"


def read(path: Path) -> tuple[list[Record], dict[str, Any]]:
    """A result of scripts/audit.py --json, and its header; NotFound if it is none."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        records = [
            Record(**{**one, "values": [Value(**value) for value in one["values"]]})
            for one in found.pop("records")
        ]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise NotFound(f"{path}: no result of scripts/audit.py --json ({error})") from None
    return records, found


def changed(old: Record | None, new: Record) -> str:
    """What differs from the kept record, in words; empty if nothing does. Values differ where their intervals
    have nothing in common, by chance with less than twice the level.
    """
    if old is None:
        return f"new: {new.verdict}"
    said = []
    if old.version != new.version:
        said.append(f"{old.renderer} {old.version} is now {new.version}")
    if old.verdict != new.verdict:
        said.append(f"{old.verdict} is now {new.verdict}")
    if [v.name for v in old.values] != [v.name for v in new.values]:
        return "; ".join([*said, "the values are others"])
    for before, now in zip(old.values, new.values, strict=True):
        if before.expected != now.expected:
            said.append(f"{now.name}: {before.expected:.6g} was expected, now {now.expected:.6g}")
        if before.high < now.low or now.high < before.low:
            said.append(f"{now.name}: {before.measured:.5g} is now {now.measured:.5g}")
    return "; ".join(said)
