"""raycheck grade: submissions of an assignment."""

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from raycheck.base.errors import NotFound
from raycheck.base.files import made_folder
from raycheck.commands.grade_check import check_assignment
from raycheck.commands.support import COLOURS, make_console, make_table, plain_errors
from raycheck.grading import course
from raycheck.grading.assignment import Assignment, read_assignment
from raycheck.grading.jail import sandbox
from raycheck.grading.judge import Grader
from raycheck.grading.package import write_package
from raycheck.grading.results import StudentResult
from raycheck.grading.written import tables
from raycheck.grading.written.pages import number, sentence
from raycheck.renderers import pools

STUDENT_SPEED = 3e5
"""Paths a second: what tests/submissions/honest traces of cornell-box, its slowest scene, on one core."""
PLATFORM_SECONDS = 600.0
"""How long Gradescope lets a submission take by default."""

Submitted = Annotated[
    Path | None, typer.Argument(metavar="[SUBMISSION]", help="A folder or an archive (zip, tar).")
]
AssignmentFile = Annotated[Path | None, typer.Option(metavar="FILE.toml", help="What is asked.")]
ClassFolder = Annotated[
    Path | None,
    typer.Option(
        "--class", metavar="DIR", help="Grade all submissions in this folder; goes on where it was."
    ),
]
Results = Annotated[Path, typer.Option(metavar="DIR", help="Where results go.")]
Student = Annotated[str, typer.Option(metavar="NAME", help="Whose SUBMISSION it is.")]
Roster = Annotated[
    Path | None,
    typer.Option(metavar="FILE.csv", help="Names in the order of grades.csv, in a column student."),
]
Overrides = Annotated[
    Path | None,
    typer.Option(metavar="FILE.csv", help="Points set by hand, in columns student,task,points,comment."),
]
Jobs = Annotated[int | None, typer.Option(min=1, help="Submissions at a time, one a core by default.")]
Cluster = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="The scheduler of a Dask cluster that grades.")
]
Platform = Annotated[
    str, typer.Option(metavar="gradescope", help="Instead: write an autograder for that platform.")
]
PackageFile = Annotated[Path, typer.Option("-o", metavar="FILE.zip", help="With --package: the file.")]
NoSandbox = Annotated[
    bool, typer.Option("--no-sandbox", help="Run submissions with your own rights: only what you trust.")
]
Check = Annotated[
    Path | None,
    typer.Option(metavar="FILE.toml", help="Instead: try an assignment out, with oneray as the student."),
]
PathsPerSecond = Annotated[float, typer.Option(min=1, help="With --check: of that student's program.")]
PlatformLimit = Annotated[float, typer.Option(min=1, help="With --check: seconds that the platform allows.")]
Mistakes = Annotated[
    list[str] | None,
    typer.Option(
        "--mutants", metavar="NAME", help="With --check: few, all, none, or a name of tests/mutants."
    ),
]


def grade(
    submission: Submitted = None,
    assignment: AssignmentFile = None,
    class_folder: ClassFolder = None,
    out: Results = Path("grades"),
    student: Student = "",
    roster: Roster = None,
    overrides: Overrides = None,
    jobs: Jobs = None,
    dask: Cluster = None,
    package: Platform = "",
    package_file: PackageFile = Path("autograder.zip"),
    no_sandbox: NoSandbox = False,
    check: Check = None,
    paths_per_second: PathsPerSecond = STUDENT_SPEED,
    limit: PlatformLimit = PLATFORM_SECONDS,
    mistakes: Mistakes = None,
) -> None:
    """Grade one SUBMISSION, or with --class all of a class. Exit status 0 when everything is graded, 3 if
    points are left open for a manual review, 2 if nothing could be graded.
    """
    with plain_errors():
        if sys.platform != "linux":
            raise NotFound("grading needs Linux (or WSL); raycheck verify --renderer runs everywhere")
        if check is not None:
            check_assignment(check, paths_per_second, limit, mistakes or ())
        if assignment is None:
            raise NotFound("grade needs --assignment FILE.toml, or --check FILE.toml")
        if package:
            _package(package, assignment, package_file)
            raise typer.Exit(0)
        if (submission is None) == (class_folder is None):
            raise NotFound("grade needs either a SUBMISSION or --class DIR")
        asked = read_assignment(assignment)
        names = tables.read_roster(roster) if roster else []
        found = course.entries(class_folder, names) if class_folder else []
        if submission is not None:
            found = [course.Entry(student or submission.resolve().name.split(".")[0], submission)]
            if not submission.exists():
                raise NotFound(f"{submission}: there is no such file or folder")
        students = {entry.student for entry in found}
        by_hand = tables.read_overrides(overrides, asked, students) if overrides else {}
        pool = pools.chosen(jobs, dask)
        grader = Grader.prepare(asked, _tier(no_sandbox, dask))
        made_folder(out)
        progress = Console(stderr=True)

        def on_result(result: StudentResult) -> None:
            if len(found) > 1:
                points = f"{number(result.total)} of {number(result.most)}"
                progress.print(f"{result.student}: {points}", highlight=False, markup=False)

        results = course.grade_class(grader, found, out, pool, on_result)
        course.write_class(asked, results, out, names, by_hand)
    _show(asked, results, out)
    raise typer.Exit(3 if any(result.review for result in results) else 0)


def _tier(no_sandbox: bool, dask: str | None) -> sandbox.Tier | None:
    """Which sandbox is used; None where each machine of a cluster takes its strongest."""
    if no_sandbox:
        return sandbox.Tier.NONE
    return None if dask else sandbox.best_tier()


def _package(platform: str, assignment: Path, path: Path) -> None:
    if platform != "gradescope":
        raise NotFound(f"--package {platform}: gradescope is what there is")
    write_package(Grader.prepare(read_assignment(assignment), sandbox.Tier.NONE), path)
    typer.echo(f"{path}: upload it to Gradescope. It holds the secret of {assignment}: keep it from students")


def _show(asked: Assignment, results: list[StudentResult], out: Path) -> None:
    console = make_console()
    numbers = [*(task.id for task in asked.tasks), "total"]
    table = make_table(("student", *numbers), right=numbers)
    for result in results:
        cells = [
            f"[{COLOURS[t.verdict]}]{number(t.points)}{'?' if t.pending else ''}[/]" for t in result.tasks
        ]
        table.add_row(result.student.replace("[", "("), *cells, number(result.total))
    console.print(table)
    if len(results) == 1:
        for line in _details(results[0]):
            console.print(line, markup=False, highlight=False, soft_wrap=True)
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
