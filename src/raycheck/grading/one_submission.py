"""One submission graded by a process of its own, on this machine or another: what a class is split into."""

import functools
import os
import platform
import tempfile
import traceback
from pathlib import Path

from raycheck.base.errors import Lost, NotFound
from raycheck.grading import assignment_bundle
from raycheck.grading.assignment import Assignment, read_assignment
from raycheck.grading.jail import folders, sandbox
from raycheck.grading.jail.sandbox import GRADING, Jail, Tier
from raycheck.grading.judge import Grader
from raycheck.grading.results import StudentResult, failed_everything
from raycheck.grading.submission import Handed
from raycheck.renderers import builds, workers
from raycheck.renderers.builds import Build
from raycheck.stats.verdict import Outcome


def grade(
    assignment: bytes, handed: Handed, student: str, slot: int, tier: Tier | None, build: Build
) -> bytes:
    """The result as JSON. `assignment` is of `assignment_bundle.pack`, `slot` the jail's; without a `tier`
    the strongest that works here.

    NotFound where this machine has other programs or no sandbox; Lost where the process gave no result.
    """
    builds.require(build)
    try:
        with folders.temporary("raycheck-piece-") as place:  # the jail's user reaches what is its own there
            jailed = tier or _best_tier()
            return workers.by_helper(_grade, str(place), assignment, handed, student, slot, jailed, fork=True)
    except OSError as error:
        raise Lost(str(error)) from None


@functools.cache
def _best_tier() -> Tier:
    try:
        return sandbox.best_tier()
    except NotFound as error:
        raise NotFound(f"{platform.node()}: {error}") from None


def _grade(place: str, assignment: bytes, handed: Handed, student: str, slot: int, tier: Tier) -> bytes:
    """All files are made in `place`, which is removed even if this process is killed."""
    scratch, given = Path(place) / "tmp", Path(place) / "given"
    scratch.mkdir(mode=0o711)
    given.mkdir(mode=0o700)
    os.environ["TMPDIR"] = tempfile.tempdir = str(scratch)
    asked = read_assignment(assignment_bundle.unpack(assignment, given))
    grader = Grader.prepare(asked, tier)
    if handed.problem:
        jail = Jail(tier, asked.limits).describe()
        return failed_everything(asked, student, handed.problem, jail).to_json().encode()
    (given / "submission").mkdir()
    path = given / "submission" / handed.name
    path.write_bytes(handed.data)
    return grade_one(grader, path, student, slot).to_json().encode()


def grade_one(grader: Grader, path: Path, student: str, slot: int = GRADING) -> StudentResult:
    """Never raises: where the grader itself is at fault all points are left open."""
    try:
        return grader.grade(path, student, slot)
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{Path(where.filename).name}:{where.lineno}"
        why = f"the grader failed ({type(error).__name__} in {place}: {error})"
        return ungraded(grader.assignment, student, why)


def ungraded(assignment: Assignment, student: str, why: str) -> StudentResult:
    """Every point is open."""
    result = failed_everything(assignment, student, why, "")
    for task in result.tasks:
        task.verdict, task.pending = Outcome.INCONCLUSIVE, task.most
    return result
