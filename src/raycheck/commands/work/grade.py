"""Grading, with what it says about it."""

import copy
from dataclasses import dataclass
from pathlib import Path

from raycheck.base.errors import NotFound
from raycheck.base.files import made_folder
from raycheck.base.text import plain
from raycheck.commands.terminal import COLOURS, Columns, Output
from raycheck.grading import course
from raycheck.grading.assignment import Assignment, read_assignment
from raycheck.grading.jail import sandbox
from raycheck.grading.judge import Grader
from raycheck.grading.package import write_package
from raycheck.grading.results import StudentResult
from raycheck.grading.written import tables
from raycheck.grading.written.pages import number, sentence
from raycheck.renderers.pools import Pool


@dataclass(frozen=True)
class Lists:
    """Tables beside an assignment."""

    roster: Path | None
    overrides: Path | None


def grade(
    assignment: Path, submission: Path | None, student: str, class_folder: Path | None, out: Path,
    lists: Lists, pool: Pool, tier: sandbox.Tier | None,
) -> bool:  # fmt: skip
    """Grade one submission, or a folder of them; whether points are left open for a manual review."""
    asked = read_assignment(assignment)
    names = tables.read_roster(lists.roster) if lists.roster else []
    found = course.entries(class_folder, names) if class_folder else []
    if submission is not None:
        found = [course.Entry(tables.name_of(student or submission.resolve().name.split(".")[0]), submission)]
    students = {*names, *(entry.student for entry in found)}
    by_hand = tables.read_overrides(lists.overrides, asked, students) if lists.overrides else {}
    grader = Grader.prepare(asked, tier)
    made_folder(out)
    progress = Output(stderr=True)

    def on_result(graded: StudentResult) -> None:
        if len(found) > 1:
            result = copy.deepcopy(graded)
            tables.apply_overrides(result, by_hand)
            points = f"{number(result.total)} of {number(result.most)}"
            progress.print(plain(f"{result.student}: {points}"), highlight=False, markup=False)

    results = course.grade_class(grader, found, out, pool, on_result)
    course.write_class(asked, results, out, names, by_hand)
    show(asked, results, out)
    return any(result.review for result in results)


def tier(no_sandbox: bool, dask: str | None) -> sandbox.Tier | None:
    """Which sandbox is used; None where each machine of a cluster takes its strongest."""
    if no_sandbox:
        return sandbox.Tier.NONE
    return None if dask else sandbox.best_tier()


def package_for(platform: str, assignment: Path, path: Path) -> None:
    if platform != "gradescope":
        raise NotFound(f"--package {platform}: gradescope is what there is")
    write_package(Grader.prepare(read_assignment(assignment), sandbox.Tier.NONE), path)
    print(f"{path}: upload it to Gradescope. It holds the secret of {assignment}: keep it from students")


def show(asked: Assignment, results: list[StudentResult], out: Path) -> None:
    console = Output()
    numbers = [*(task.id for task in asked.tasks), "total"]
    table = Columns(("student", *numbers), right=numbers)
    for result in results:
        cells = [
            f"[{COLOURS[t.verdict]}]{number(t.points)}{'?' if t.pending else ''}[/]" for t in result.tasks
        ]
        table.add_row(plain(result.student).replace("[", "("), *cells, number(result.total))
    table.show(console)
    if len(results) == 1:
        for line in _details(results[0]):
            console.print(plain(line), markup=False, highlight=False, soft_wrap=True)
    for said in sorted({result.sandbox for result in results} - {""}):
        console.print(sentence(said), markup=False, highlight=False, soft_wrap=True)
    console.print(
        f"{out / 'index.html'}: open it in a browser", markup=False, highlight=False, soft_wrap=True
    )


def _details(result: StudentResult) -> list[str]:
    if result.problem:
        return [sentence(result.problem)]
    lines = []
    for task in result.tasks:
        for scene in task.scenes:
            where = f"{scene.scene} (hidden variant)" if scene.hidden else scene.scene
            lines.append(f"{task.id}, {where}: {scene.verdict.value}. {sentence(scene.reason)}")
        lines += [f"{task.id}: {sentence(task.comment)}"] if task.comment else []
    return lines
