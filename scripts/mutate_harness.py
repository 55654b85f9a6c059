"""Do the tests of raycheck guard what they say? Small changes of its sources, each to be noticed by a test.

    python scripts/mutate_harness.py                                 # all, ten minutes of one core
    python scripts/mutate_harness.py --jobs 2 --only NAME --only OTHER
    python scripts/mutate_harness.py --json FILE                     # all, kept in FILE
    python scripts/mutate_harness.py --missing --json FILE           # what FILE does not have as it is

The list is harness_mutants.py. Each change is made in a copy of the sources, whose modules come before those
of any installation, and the tests that guard it run with the copy: the change is killed if one of them fails,
and has survived if none does. All of them pass with the copy as it is, which is shown first. The exit status
is 1 if a change survived that is not equivalent, or is stale: its old text is not there once.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from queue import Queue
from typing import Any

from harness_mutants import CHANGES, Change

ROOT = Path(__file__).resolve().parent.parent
SOURCES, RESULT = ROOT / "src" / "raycheck", ROOT / "references" / "harness_mutants.json"
SECONDS = 300.0
"""Time for the tests of one change; a change that makes them take longer is noticed too."""
KILLED, SURVIVED, STALE, BROKEN = "killed", "survived", "stale", "broken"
"""Broken: the tests could not be run at all, which says nothing."""

RUN = """
import sys
from importlib.machinery import PathFinder

place, *words = sys.argv[1:]

class Copy:
    def find_spec(name, path=None, target=None):
        return PathFinder.find_spec(name, path or [place]) if name.split(".")[0] == "raycheck" else None

sys.meta_path.insert(0, Copy)
import raycheck
from raycheck.stats import verdict
assert raycheck.__file__.startswith(place) and verdict.__file__.startswith(place), raycheck.__file__
import pytest
sys.exit(pytest.main(words))
"""
"""Runs pytest with the modules of a folder, before those that any installation's finder would find."""


@dataclass(frozen=True)
class Run:
    outcome: str
    by: str = ""
    """The test that noticed."""
    seconds: float = 0.0


@contextmanager
def copy_of_sources() -> Iterator[Path]:
    """A folder with src/raycheck; scenes and references are those of the checkout."""
    with tempfile.TemporaryDirectory(prefix="raycheck-") as name:
        folder = Path(name).resolve()
        shutil.copytree(SOURCES, folder / "src" / "raycheck", ignore=shutil.ignore_patterns("__pycache__"))
        for shared in ("scenes", "references", "docs", "tests"):
            (folder / shared).symlink_to(ROOT / shared)
        yield folder


def digest(change: Change) -> str:
    """A digest of a change and its guards: what was found belongs to it."""
    return hashlib.blake2b(repr(change).encode(), digest_size=8).hexdigest()


def kept(file: Path) -> dict[str, Run]:
    """What a file says of the changes that are still the same."""
    found = json.loads(file.read_text(encoding="utf-8"))["found"] if file.is_file() else {}
    same = {one.name for one in CHANGES if found.get(one.name, {}).get("change") == digest(one)}
    return {name: Run(found[name]["outcome"], found[name]["by"]) for name in same}


def changed(change: Change) -> str | None:
    """The text of the changed file; None where the old text is not there once."""
    text = (SOURCES / change.file).read_text(encoding="utf-8")
    return text.replace(change.old, change.new) if text.count(change.old) == 1 else None


def judge(folder: Path, change: Change) -> Run:
    """Make a change in the copy, run its tests, take it back."""
    text = changed(change)
    if text is None:
        return Run(STALE)
    file = folder / "src" / "raycheck" / change.file
    file.write_text(text, encoding="utf-8")
    os.utime(file, (0, 0))  # no kept bytecode is of that time
    try:
        return run_tests(folder, change.guards)
    finally:
        shutil.copy2(SOURCES / change.file, file)


def judge_all(changes: Sequence[Change], jobs: int) -> Iterator[tuple[Change, Run]]:
    """In order, with a copy for each of `jobs` changes at a time."""
    folders: Queue[Path] = Queue()

    def with_a_copy(change: Change) -> Run:
        folder = folders.get()
        try:
            return judge(folder, change)
        finally:
            folders.put(folder)

    with ExitStack() as stack, ThreadPoolExecutor(jobs) as pool:
        for _ in range(jobs):
            folders.put(stack.enter_context(copy_of_sources()))
        yield from zip(changes, pool.map(with_a_copy, changes), strict=True)


def run_tests(folder: Path, tests: Sequence[str]) -> Run:
    """Run tests with the copy until the first that fails."""
    words = ["-x", "-q", "-p", "no:cacheprovider", "--rootdir", ROOT, *(ROOT / "tests" / t for t in tests)]
    command = [sys.executable, "-c", RUN, folder / "src", *words]
    started = time.perf_counter()
    try:
        done = subprocess.run([str(word) for word in command], capture_output=True, text=True, cwd=ROOT,
                              timeout=SECONDS, check=False)  # fmt: skip
    except subprocess.TimeoutExpired:
        return Run(KILLED, f"no end in {SECONDS:.0f} s", SECONDS)
    seconds = round(time.perf_counter() - started, 1)
    outcome = {0: SURVIVED, 1: KILLED}.get(done.returncode, BROKEN)
    by = re.search(r"^(?:FAILED|ERROR) (?:tests/)?(.*?)(?: - |$)", done.stdout, re.MULTILINE)
    if outcome == BROKEN:
        print(done.stdout[-2000:], done.stderr[-2000:], file=sys.stderr)
    return Run(outcome, by.group(1) if by else "", seconds)


def summary(found: Mapping[str, Run], changes: Sequence[Change]) -> dict[str, Any]:
    """As it is kept: what became of each change, and counts without the equivalent ones."""
    count = Counter(found[one.name].outcome for one in changes if not one.equivalent)
    return {
        "changes": len(changes), "not_equivalent": count.total(),
        "killed": count[KILLED],
        "survived": [one.name for one in changes
                     if not one.equivalent and found[one.name].outcome != KILLED],
        "equivalent": {one.name: one.equivalent for one in changes if one.equivalent},
        "found": {one.name: {"file": one.file, "breaks": one.breaks, "outcome": found[one.name].outcome,
                             "by": found[one.name].by, "change": digest(one)} for one in changes},
    }  # fmt: skip


def sentence(found: Mapping[str, Any]) -> str:
    """The figures as the README shows them."""
    missed = f"; not {', '.join(f'`{name}`' for name in found['survived'])}" if found["survived"] else ""
    return (
        f"raycheck's own tests are measured too: of {found['not_equivalent']} small changes of its "
        "statistics, checks and marks, a sign, a root, a level or a constant each "
        f"([scripts/harness_mutants.py](scripts/harness_mutants.py)), they notice {found['killed']}{missed}; "
        f"{len(found['equivalent'])} more change nothing that could be noticed."
    )


def main() -> int:
    parser = argparse.ArgumentParser(description="Changes of raycheck's sources that its tests must notice.")
    parser.add_argument("--only", metavar="NAME", action="append", help="this change; may be repeated")
    parser.add_argument("--jobs", metavar="N", type=int, default=1, help="changes tried at a time")
    parser.add_argument("--missing", action="store_true", help="only what FILE does not have as it is")
    parser.add_argument("--json", metavar="FILE", type=Path, help="where the result goes")
    wanted = parser.parse_args()
    chosen = [one for one in CHANGES if not wanted.only or one.name in wanted.only]
    if unknown := set(wanted.only or ()) - {one.name for one in chosen}:
        parser.error(f"no change {', '.join(sorted(unknown))}")
    found = kept(wanted.json) if wanted.json and (wanted.missing or wanted.only) else {}
    if wanted.missing:
        chosen = [one for one in chosen if one.name not in found]
    with copy_of_sources() as folder:
        unchanged = run_tests(folder, sorted({test for one in chosen for test in one.guards}))
        if unchanged.outcome != SURVIVED:
            print(f"mutate_harness: without a change {unchanged.by or 'the tests'} fails", file=sys.stderr)
            return 2
    for one, run in judge_all(chosen, wanted.jobs):
        found[one.name] = run
        print(f"{run.outcome:9}{run.seconds:6.1f} s  {one.name:34}{run.by or one.equivalent}", flush=True)
    result = summary(found, [one for one in CHANGES if one.name in found])
    print(f"{result['killed']} of {result['not_equivalent']} killed")
    for name in result["survived"]:
        print(f"{found[name].outcome}: {name}")
    if wanted.json:
        wanted.json.write_text(json.dumps(result, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return bool(result["survived"])


if __name__ == "__main__":
    sys.exit(main())
