"""A whole class: one submission after another or several at a time, each with a result of its own on disk.

What is on disk and still belongs to the same submission and assignment is kept, so that a run can be
interrupted. Nothing that one submission does stops the rest.
"""

import hashlib
import multiprocessing
import re
import tempfile
import traceback
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

from raycheck.cli_support import replace
from raycheck.grading.assignment import Assignment
from raycheck.grading.gradescope import results_json
from raycheck.grading.judge import Grader
from raycheck.grading.keys import digest_of
from raycheck.grading.pages import course_page, student_page
from raycheck.grading.results import StudentResult, failed_everything
from raycheck.grading.submission import SubmissionError, is_archive, open_submission
from raycheck.grading.tables import Override, apply_overrides, grades_csv, junit_xml
from raycheck.renderers import NotFound
from raycheck.verdict import Outcome

RESULT = "result.json"
TEACHERS = "teacher.html"


@dataclass(frozen=True)
class Entry:
    """A submission of the class."""

    student: str
    path: Path


def entries(folder: Path, roster: Sequence[str]) -> list[Entry]:
    """The submissions of a folder, as an LMS leaves it: a folder or an archive for each student.

    The student is the whole name where the roster has it, else what stands before the first "_" (Moodle:
    "Name_123_assignsubmission_file", Canvas: "name_123_456_file.zip"), else the whole name.
    """
    if not folder.is_dir():
        raise NotFound(f"{folder}: there is no such folder")
    found: dict[str, Path] = {}
    for path in sorted(folder.iterdir()):
        if path.name.startswith(".") or not (path.is_dir() or is_archive(path)):
            continue
        student = _student(path, roster)
        if student in found:
            raise NotFound(f"{path} and {found[student]} are both of student {student!r}: keep one")
        found[student] = path
    if not found:
        raise NotFound(f"{folder}: there is no submission in it (folders, zip or tar archives)")
    return [Entry(student, path) for student, path in found.items()]


def _student(path: Path, roster: Sequence[str]) -> str:
    name = re.sub(r"(\.zip|\.tar(\.\w+)?|\.tgz)$", "", path.name, flags=re.IGNORECASE)
    if name in roster or not re.search(r"_\d+", name):
        return name
    return name.split("_")[0]


def _content(path: Path) -> Path:
    """A folder of an LMS often holds one archive."""
    if path.is_dir():
        inside = [p for p in path.iterdir() if not p.name.startswith(".")]
        if len(inside) == 1 and is_archive(inside[0]):
            return inside[0]
    return path


def folder_name(student: str) -> str:
    """A name for a file system, different for different students."""
    plain = re.sub(r"[^-.A-Za-z0-9]+", "_", student).strip("._")[:60] or "student"
    tail = hashlib.sha256(student.encode()).hexdigest()[:6]
    return plain if plain == student else f"{plain}-{tail}"


def grade_class(
    grader: Grader, found: Sequence[Entry], out: Path, jobs: int, on_result: Callable[[StudentResult], None]
) -> list[StudentResult]:
    """Results in the order of `found`; each is written as it comes."""
    results = {entry.student: kept for entry in found if (kept := _kept(grader, entry, out))}
    todo = [entry for entry in found if entry.student not in results]
    for result in results.values():
        on_result(result)
    with ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("fork")) as pool:
        waiting = {pool.submit(grade_one, grader, e, slot): e for slot, e in enumerate(todo)}
        for done in as_completed(waiting):
            entry = waiting[done]
            try:
                result = done.result()
            except Exception as error:  # the worker itself died
                result = _ungraded(grader, entry, f"the grader failed ({type(error).__name__}: {error})")
            results[entry.student] = result
            write_student(grader.assignment, result, out)
            on_result(result)
    return [results[entry.student] for entry in found]


def grade_one(grader: Grader, entry: Entry, slot: int = 0) -> StudentResult:
    """Never raises: where the grader itself is at fault all points are left open."""
    try:
        return grader.grade(_content(entry.path), entry.student, slot)
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{Path(where.filename).name}:{where.lineno}"
        return _ungraded(grader, entry, f"the grader failed ({type(error).__name__} in {place}: {error})")


def _ungraded(grader: Grader, entry: Entry, why: str) -> StudentResult:
    result = failed_everything(grader.assignment, entry.student, why, "")
    for task in result.tasks:
        task.verdict, task.pending = Outcome.INCONCLUSIVE, task.most
    return result


def _kept(grader: Grader, entry: Entry, out: Path) -> StudentResult | None:
    """The result on disk, if nothing has changed since."""
    path = student_folder(out, entry.student) / RESULT
    try:
        result = StudentResult.read(path)
        with tempfile.TemporaryDirectory(prefix="raycheck-") as place:
            open_submission(_content(entry.path), Path(place))
            digest = digest_of(Path(place))
    except (OSError, ValueError, KeyError, TypeError, SubmissionError):
        return None
    return result if result.state == grader.state(digest) else None


def student_folder(out: Path, student: str) -> Path:
    return out / "students" / folder_name(student)


def write_student(assignment: Assignment, result: StudentResult, out: Path) -> None:
    """The result as it was graded, and what the student gets."""
    folder = student_folder(out, result.student)
    folder.mkdir(parents=True, exist_ok=True)
    replace(folder / RESULT, result.to_json())
    write_for_student(assignment, result, folder)


def write_for_student(assignment: Assignment, result: StudentResult, folder: Path) -> None:
    """The page, Gradescope's results and JUnit, which tell nothing of hidden scenes; beside them the page
    that the teacher reads.
    """
    replace(folder / "index.html", student_page(assignment, result))
    replace(folder / TEACHERS, student_page(assignment, result, everything=True))
    replace(folder / "results.json", results_json(result))
    replace(folder / "junit.xml", junit_xml([result]))


def write_class(
    assignment: Assignment, results: Sequence[StudentResult], out: Path, roster: Sequence[str],
    overrides: Mapping[tuple[str, str], Override],
) -> None:  # fmt: skip
    """grades.csv and the class page, with the teacher's overrides, which the students' files get too."""
    for result in results:
        if apply_overrides(result, overrides):
            write_for_student(assignment, result, student_folder(out, result.student))
    pages = {r.student: f"students/{folder_name(r.student)}/{TEACHERS}" for r in results}
    replace(out / "grades.csv", grades_csv(assignment, results, roster))
    replace(out / "index.html", course_page(assignment, results, pages))
