"""Which committed results are stale, since a picture that they rest on or the method has changed, or missing?

    python scripts/stale.py             # what is stale and why, a line each; exit status 1 if anything is
    python scripts/stale.py --measure   # measures that anew, and nothing else

What a result rests on stands in it (raycheck.truth.provenance), so that nothing is rendered to see it.
Calibrations and verify keep what is not stale by themselves.
"""

from __future__ import annotations

import argparse
import json
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import benchmark
import benchmark_measure

from raycheck.base.data import ROOT
from raycheck.base.files import write_whole
from raycheck.base.text import scenes_json
from raycheck.calibration import (
    gradings,
    kills,
    many_looks,
    mutants,
    naming,
    nulls,
    part_making,
    signatures,
    unseen,
)  # fmt: skip
from raycheck.judging import judge_renderer
from raycheck.measuring import prices
from raycheck.measuring.races import racing
from raycheck.measuring.stability import results, sweeps
from raycheck.truth.provenance import changes, payload

REFERENCES = ROOT / "references"
RAYCHECK = shlex.join([sys.executable, "-m", "raycheck"])


@dataclass(frozen=True)
class Result:
    """A part of a file of references/ whose entries each say what they rest on."""

    file: str
    at: str
    """Key of the list or dictionary of entries, or of the one entry; "" is the whole file."""
    method: int
    measure: str
    """The command that measures it; {stale} becomes the names of what is stale, {file} the file."""
    name: tuple[str, ...] = ()
    """Keys of an entry that together name it, of a list."""
    text: Callable[[dict[str, Any]], str] | None = None
    """How the file is written where the command writes what it measured alone: it is put among the others."""
    all: Callable[[], Iterable[str]] = tuple
    """What it has to have of all there is today, in this order: entries, or pictures of the one entry."""

    @property
    def path(self) -> Path:
        return REFERENCES / self.file

    def entries(self) -> dict[str, Any]:
        """The entries by name."""
        found = json.loads(self.path.read_text(encoding="utf-8"))
        found = found[self.at] if self.at else found
        if isinstance(found, list):
            return {", ".join(entry[key] for key in self.name): entry for entry in found}
        return {self.at: found} if "provenance" in found else found

    def stale(self) -> dict[str, list[str]]:
        """The reasons why entries are stale, by the names of these."""
        found = {name: changes(entry.get("provenance", {}), self.method)
                 for name, entry in self.entries().items()}  # fmt: skip
        if self.at in found:
            [entry] = self.entries().values()
            missing = set(self.all()) - set(entry.get("provenance", {}).get("pictures", ()))
            found[self.at] += [f"{name} is not in it" for name in sorted(missing) if payload(name)]
        else:
            found |= {name: ["it is not measured yet"] for name in self.all() if name not in found}
        return {name: reasons for name, reasons in found.items() if reasons}


def rows(key: str, found: dict[str, Any]) -> str:
    """The text of a file of scenes that have rows under `key`."""
    return scenes_json({k: v for k, v in found.items() if k != "scenes"}, key, found["scenes"])


def _calibrated(section: str, method: int, more: str = "", rests: Callable[[], set[str]] = set) -> Result:
    return Result("calibration.json", section, method, f"{RAYCHECK} calibrate {section} {more}", all=rests)


def _killed() -> set[str]:
    return {picture for mutant in mutants.catalogue() for picture in kills.rests_on(mutant)}


def _named() -> set[str]:
    return {picture for pair in signatures.pairs(mutants.catalogue()) for picture in pair.rests_on}


RESULTS = (
    Result("verification.json", "cases", judge_renderer.METHOD,
           f"{RAYCHECK} verify --thorough --resume --json {{file}}", ("scene", "technique")),
    Result("techniques.json", "scenes", prices.METHOD, f"{RAYCHECK} techniques {{stale}} --json {{file}}",
           ("scene",), partial(rows, "techniques")),
    Result("error_curves.json", "scenes", racing.METHOD,
           f"{RAYCHECK} report {{stale}} --against mitsuba --seconds 2 -o build/report --json {{file}} "
           "--verification references/verification.json", ("scene",), partial(rows, "curves")),
    Result("stability.json", "cases", sweeps.METHOD, f"{RAYCHECK} stability {{stale}} --json {{file}}",
           ("case",), results.as_text),
    Result("benchmark.json", "scenes", benchmark_measure.METHOD,
           f"{sys.executable} scripts/benchmark.py --no-growth {{stale}} --json {{file}}", ("name",)),
    _calibrated("nulls", nulls.METHOD),
    _calibrated("mde", nulls.METHOD),
    _calibrated("looks", many_looks.METHOD),
    _calibrated("mutants", kills.METHOD, rests=_killed),
    Result("signatures/manifest.json", "scenes", signatures.METHOD, f"{RAYCHECK} calibrate signatures",
           all=lambda: signatures.scenes_of(mutants.catalogue())),
    _calibrated("naming", naming.METHOD, rests=_named),
    _calibrated("unseen", unseen.METHOD),
    _calibrated("gradings", gradings.METHOD, "--assignment docs/lecture12.toml"),
    Result("parts/manifest.json", "", part_making.METHOD, f"{RAYCHECK} calibrate parts {{stale}}"),
)  # fmt: skip
"""All results, in an order in which each finds what it needs."""


def lines() -> Iterator[str]:
    """What is stale, and why."""
    for result in RESULTS:
        for name, reasons in result.stale().items():
            yield f"references/{result.file}: {name}: {'; '.join(reasons)}"


def command(result: Result, stale: Iterable[str], file: Path) -> list[str]:
    """The command that measures these entries of a result."""
    flag = "--scene " if result.name == ("name",) else ""
    names = " ".join(flag + shlex.quote(name) for name in stale)
    return shlex.split(result.measure.format(stale=names, file=shlex.quote(str(file))))


def measure(result: Result, stale: Iterable[str]) -> None:
    """Measure these entries of a result, and keep the others."""
    with tempfile.TemporaryDirectory(prefix="raycheck-") as folder:
        file = Path(folder) / "new.json" if result.text else result.path
        done = subprocess.run(command(result, stale, file), cwd=ROOT, check=False)
        if done.returncode == 2 or not file.is_file():
            sys.exit(f"stale: references/{result.file} could not be measured")
        if result.text:
            kept, new = (json.loads(path.read_text(encoding="utf-8")) for path in (result.path, file))
            for entry in new[result.at]:
                benchmark.put(kept[result.at], entry, result.name[0])
            if order := list(result.all()):
                kept[result.at].sort(key=lambda entry: order.index(entry[result.name[0]]))
            write_whole(result.path, result.text(kept))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--measure", action="store_true", help="measure what is stale anew")
    if parser.parse_args().measure:
        for result in RESULTS:
            if stale := result.stale():
                measure(result, stale)
    found = list(lines())
    print("\n".join([*found, f"{len(found)} stale results"]))
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
