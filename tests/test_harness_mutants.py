"""Small changes of raycheck's sources are noticed by its tests: a few here, all in the committed result."""

import json
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

import mutate_harness  # noqa: E402
from harness_mutants import CHANGES, Change  # noqa: E402

BY_NAME = {one.name: one for one in CHANGES}


def test_every_change_can_be_made() -> None:
    assert [one.name for one in CHANGES if mutate_harness.changed(one) is None] == [], "stale"
    assert len(BY_NAME) == len(CHANGES) and all(one.old != one.new for one in CHANGES)
    guards = {guard.split("::")[0] for one in CHANGES for guard in one.guards}
    assert all((ROOT / "tests" / guard).is_file() for guard in guards)


def test_the_committed_result_is_of_these_changes() -> None:
    """And nearly all of them are noticed."""
    found = json.loads(mutate_harness.RESULT.read_text(encoding="utf-8"))
    stale = BY_NAME.keys() - mutate_harness.kept(mutate_harness.RESULT).keys()
    assert not stale, "python scripts/mutate_harness.py --missing --json references/harness_mutants.json"
    assert found["found"].keys() == BY_NAME.keys()
    assert found["changes"] >= 200 and found["killed"] >= 0.95 * found["not_equivalent"]
    assert {found["found"][name]["outcome"] for name in found["equivalent"]} == {mutate_harness.SURVIVED}


@pytest.mark.parametrize(
    ("name", "outcome"),
    [(name, mutate_harness.KILLED) for name in ("surely", "unconfirmed", "noise-floor", "cover")]
    + [("tile-unvarying", mutate_harness.SURVIVED)],
)
def test_a_change_is_noticed_unless_it_changes_nothing(name: str, outcome: str) -> None:
    with mutate_harness.copy_of_sources() as folder:
        run = mutate_harness.judge(folder, BY_NAME[name])
    assert run.outcome == outcome and bool(run.by) == (outcome == mutate_harness.KILLED)


def test_a_text_that_is_not_there_once_is_stale() -> None:
    for old in ("no such text", "import"):
        change = Change("a", "stats/verdict.py", old, "", "", ())
        assert mutate_harness.judge(ROOT, change).outcome == mutate_harness.STALE
