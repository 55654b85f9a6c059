"""raycheck grade --check: an assignment tried out before students see it."""

import sys
from collections.abc import Sequence
from pathlib import Path

import typer

from raycheck.base.statuses import Status
from raycheck.base.text import duration, percent
from raycheck.calibration import assignments
from raycheck.commands.terminal import Columns, Output
from raycheck.grading.assignment import read_assignment
from raycheck.grading.jail.sandbox import Tier
from raycheck.grading.judge import Grader
from raycheck.stats.verdict import Outcome

COLUMNS = ("task", "honest", "time", "notices", "mistakes seen", "left open", "pass wrongly", "no effect")


def check_assignment(path: Path, paths_per_second: float, limit: float, names: Sequence[str]) -> None:
    """Print what an honest program of that speed and those with mistakes get, task by task: exit status 2 if
    the honest one exceeds a limit, 3 if it does not pass everything.
    """
    asked = read_assignment(path)
    chosen = assignments.choose(asked, names or [assignments.FEW])
    grader = Grader.prepare(asked, Tier.NONE)
    progress = Output(stderr=True)

    def on_task(found: assignments.TaskCheck) -> None:
        progress.print(f"{found.task.id}: {duration(found.seconds)}", highlight=False, markup=False)

    results = assignments.check(grader, paths_per_second, chosen, on_task)
    console = Output()
    _table(results).show(console)
    total = duration(sum(result.seconds for result in results))
    speed = f"{paths_per_second:,.0f} paths a second"
    console.print(f"All tasks: {total} for an honest program that traces {speed}.", highlight=False)
    refused = assignments.refusals(asked, results, limit)
    for line in refused:
        print(f"raycheck: {path}: {line}", file=sys.stderr)
    passed = all(result.passes for result in results)
    raise typer.Exit(Status.COULD_NOT_RUN if refused else Status.DONE if passed else Status.INCONCLUSIVE)


def _table(results: Sequence[assignments.TaskCheck]) -> Columns:
    table = Columns(COLUMNS, right=("time", "notices"), wrap=COLUMNS[4:])
    for one in results:
        by = {outcome: [n for n, o in one.mistakes.items() if o is outcome] for outcome in Outcome}
        seen = f"{len(by[Outcome.FAIL])} of {len(one.mistakes)}" if one.mistakes else ""
        honest = "PASS" if one.passes else ", ".join(s.verdict.value for s in one.honest)
        notices = percent(one.detectable) if one.detectable == one.detectable else ""
        names = (by[Outcome.INCONCLUSIVE], by[Outcome.PASS], one.unseen)
        cells = (one.task.id, honest, duration(one.seconds), notices, seen)
        table.add_row(*cells, *map(", ".join, names))
    return table
