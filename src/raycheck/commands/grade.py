"""raycheck grade: submissions of an assignment."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from raycheck.base.errors import NotFound
from raycheck.base.statuses import Status
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
    if sys.platform != "linux":
        raise NotFound("grading needs Linux (or WSL); raycheck verify --renderer runs everywhere")
    if assignment is None and check is None:
        raise NotFound("grade needs --assignment FILE.toml, or --check FILE.toml")
    if not (check or package) and (submission is None) == (class_folder is None):
        raise NotFound("grade needs either a SUBMISSION or --class DIR")
    if submission is not None and not submission.exists():
        raise NotFound(f"{submission}: there is no such file or folder")
    if check is not None:
        from raycheck.commands.work.grade_check import check_assignment

        check_assignment(check, paths_per_second, limit, mistakes or ())
    assert assignment is not None
    from raycheck.commands.work import grade as work

    if package:
        work.package_for(package, assignment, package_file)
        raise typer.Exit
    tier = work.tier(no_sandbox, dask)
    pool = pools.chosen(jobs, dask)
    lists = work.Lists(roster, overrides)
    left_open = work.grade(assignment, submission, student, class_folder, out, lists, pool, tier)
    raise typer.Exit(Status.INCONCLUSIVE if left_open else Status.DONE)
