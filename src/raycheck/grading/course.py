"""A whole class: submissions in a pool of processes or machines, each with a result of its own on disk.

What is on disk and still belongs to the same submission and assignment is kept, so that a run can be
interrupted. Nothing that one submission does stops the rest.
"""

import functools
import hashlib
import os
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from raycheck.base.errors import Lost, NotFound
from raycheck.base.files import write_whole as write_whole
from raycheck.grading import assignment_bundle, one_submission, submission
from raycheck.grading.assignment import PICTURES, Assignment
from raycheck.grading.jail import folders
from raycheck.grading.jail.limits import Limits
from raycheck.grading.jail.sandbox import GRADING, Jail, Tier
from raycheck.grading.judge import Grader, make_picture_references
from raycheck.grading.keys import digest_of
from raycheck.grading.results import StudentResult
from raycheck.grading.submission import SubmissionError, is_archive
from raycheck.grading.written.gradescope import results_json
from raycheck.grading.written.pages import course_page, student_page
from raycheck.grading.written.tables import Override, apply_overrides, grades_csv, junit_xml, name_of
from raycheck.renderers import builds
from raycheck.renderers.builds import Build
from raycheck.renderers.pools import ATTEMPTS, Pool

LEFT_OUT = (".", "__MACOSX")
TABLES = (".csv", ".toml")
"""Files of the teacher's, which may lie beside the submissions."""
RESULT = "result.json"
TEACHERS = "teacher.html"


@dataclass(frozen=True)
class Entry:
    """A submission of the class."""

    student: str
    path: Path


def entries(folder: Path, roster: Sequence[str]) -> list[Entry]:
    """The submissions of a folder, as an LMS leaves it: a folder, an archive or a file for each student.

    The student is the whole name where the roster has it, else what stands before the first number between
    "_" (Moodle: "Name_123_assignsubmission_file", Canvas: "name_123_456_file.zip", "name_LATE_123_456_…"),
    else the whole name. Where several are called alike each is called what the LMS calls it; where that is
    the same name in other bytes, such as é as one letter or as two, a digest of these is added.
    """
    if not folder.is_dir():
        raise NotFound(f"{folder}: there is no such folder")
    paths = [path for path in sorted(folder.iterdir()) if not path.name.startswith(LEFT_OUT)]
    paths = [path for path in paths if path.is_dir() or path.suffix.lower() not in TABLES]
    if not paths:
        raise NotFound(f"{folder}: there is no submission in it (folders, zip or tar archives)")
    names = [_student(path, roster) for path in paths]
    for more in (lambda path: name_of(os.fsencode(path.name).decode(errors="replace")), _digest):
        called = Counter(names)
        names = [
            name if called[name] == 1 else f"{name} ({more(path)})"
            for name, path in zip(names, paths, strict=True)
        ]
    return [Entry(name, path) for name, path in zip(names, paths, strict=True)]


def _digest(path: Path) -> str:
    return hashlib.sha256(os.fsencode(path.name)).hexdigest()[:8]


def _student(path: Path, roster: Sequence[str]) -> str:
    text = name_of(os.fsencode(path.name).decode(errors="replace"))
    name = re.sub(r"(\.zip|\.tar(\.\w+)?|\.tgz)$", "", text, flags=re.IGNORECASE)
    if path.is_file() and name == text and name not in roster:
        name = text.removesuffix(path.suffix) or text
    found = re.match(r"(.+?)(_LATE)?_\d+_", name)
    return found[1] if found and name not in roster else name


def content(path: Path) -> Path:
    """A folder of an LMS often holds one archive."""
    if path.is_dir():
        inside = [p for p in path.iterdir() if not p.name.startswith(LEFT_OUT)]
        if len(inside) == 1 and is_archive(inside[0]):
            return inside[0]
    return path


def folder_name(student: str) -> str:
    """A name for a file system, different for different students."""
    plain = re.sub(r"[^-.A-Za-z0-9]+", "_", student).strip("._")[:60] or "student"
    tail = hashlib.sha256(student.encode()).hexdigest()[:6]
    return plain if plain == student else f"{plain}-{tail}"


@dataclass(frozen=True)
class _Pieces(Sequence[Any]):
    """The arguments of `one_submission.grade` for each submission, made one at a time."""

    grader: Grader
    entries: Sequence[Entry]

    @functools.cached_property
    def _assignment(self) -> bytes:
        return assignment_bundle.pack(self.grader.assignment)

    @functools.cached_property
    def _build(self) -> Build:
        return Build(builds.raycheck_hash(), builds.oneray_hash())

    def __len__(self) -> int:
        return len(self.entries)

    def __getitem__(self, index: Any) -> Any:
        entry = self.entries[index]
        handed, slot = submission.pack(content(entry.path)), GRADING + index
        return self._assignment, handed, entry.student, slot, self.grader.tier, self._build


def grade_class(
    grader: Grader, found: Sequence[Entry], out: Path, pool: Pool, on_result: Callable[[StudentResult], None]
) -> list[StudentResult]:
    """Results in the order of `found`; each is written as it comes."""
    results = {entry.student: kept for entry in found if (kept := _kept(grader, entry, out))}
    todo = [entry for entry in found if entry.student not in results]
    for result in results.values():
        on_result(result)
    _make_picture_references(grader, todo)

    def on_lost(index: int, error: Lost) -> bytes:
        why = f"the grader failed {ATTEMPTS} times ({error})"
        return one_submission.ungraded(grader.assignment, todo[index].student, why).to_json().encode()

    for index, data in pool.run(one_submission.grade, _Pieces(grader, todo), on_lost):
        result = StudentResult.from_json(data)
        results[todo[index].student] = result
        write_student(grader.assignment, result, out)
        on_result(result)
    return [results[entry.student] for entry in found]


def _make_picture_references(grader: Grader, todo: Sequence[Entry]) -> None:
    """Here, once: they are kept, and must not depend on who grades."""
    for task in grader.assignment.tasks:
        accepted = todo if task.accepts == PICTURES else ()
        students = [e.student for e in accepted if submission.may_have_pictures(content(e.path), task.id)]
        if students:
            make_picture_references(grader.assignment, grader.keys, task, students)


def _kept(grader: Grader, entry: Entry, out: Path) -> StudentResult | None:
    """The result on disk, if nothing has changed since."""
    result = _read(student_folder(out, entry.student) / RESULT)
    if result is None:
        return None
    try:
        with folders.temporary("raycheck-kept-") as place:
            (unpacked := place / "submission").mkdir()
            submission.open_submission(content(entry.path), unpacked, Jail(Tier.NONE, Limits()).user)
            digest = digest_of(unpacked)
    except (OSError, SubmissionError):
        return None
    tiers = [grader.tier] if grader.tier else [tier for tier in Tier if tier is not Tier.NONE]
    states = [replace(grader, tier=tier).state(digest) for tier in tiers]
    return result if result.state in states else None


def _read(path: Path) -> StudentResult | None:
    """The result that is kept; None where there is none, or one of another raycheck."""
    try:
        return StudentResult.read(path)
    except (OSError, ValueError, KeyError, TypeError):
        return None


def student_folder(out: Path, student: str) -> Path:
    return out / "students" / folder_name(student)


def write_student(assignment: Assignment, result: StudentResult, out: Path) -> None:
    """The result as it was graded, and what the student gets."""
    folder = student_folder(out, result.student)
    folder.mkdir(parents=True, exist_ok=True)
    before = _read(folder / RESULT)
    if before:
        another = before.digest and before.digest != result.digest  # none: it was not graded
        result.earlier = before.earlier + [before.total] * bool(another)
    write_whole(folder / RESULT, result.to_json())
    write_for_student(assignment, result, folder)


def write_for_student(assignment: Assignment, result: StudentResult, folder: Path) -> None:
    """The page, Gradescope's results and JUnit, which tell nothing of hidden scenes; beside them the page
    that the teacher reads.
    """
    write_whole(folder / "index.html", student_page(assignment, result))
    write_whole(folder / TEACHERS, student_page(assignment, result, everything=True))
    write_whole(folder / "results.json", results_json(result))
    write_whole(folder / "junit.xml", junit_xml([result]))


def write_class(
    assignment: Assignment, results: Sequence[StudentResult], out: Path, roster: Sequence[str],
    overrides: Mapping[tuple[str, str], Override],
) -> None:  # fmt: skip
    """grades.csv and the class page, with the teacher's overrides, which the students' files get too."""
    for result in results:
        apply_overrides(result, overrides)
        write_for_student(assignment, result, student_folder(out, result.student))
    pages = {r.student: f"students/{folder_name(r.student)}/{TEACHERS}" for r in results}
    write_whole(out / "grades.csv", grades_csv(assignment, results, roster, overrides))
    write_whole(out / "index.html", course_page(assignment, results, pages))
