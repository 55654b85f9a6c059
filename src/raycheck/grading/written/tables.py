"""grades.csv for the LMS, JUnit XML for CI, and the teacher's overrides."""

import csv
import io
import math
import unicodedata
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from junitparser import Failure, JUnitXml, Skipped, TestCase, TestSuite

from raycheck.base.errors import NotFound
from raycheck.base.text import plain
from raycheck.grading.assignment import Assignment
from raycheck.grading.results import NOT_EXECUTED, StudentResult, TaskResult
from raycheck.grading.written.pages import number, sentence
from raycheck.stats.verdict import Outcome


@dataclass(frozen=True)
class Override:
    points: float
    comment: str

    @property
    def words(self) -> str:
        return f"points set by hand{': ' + self.comment if self.comment else ''}"


def read_overrides(
    path: Path, assignment: Assignment, students: Collection[str]
) -> dict[tuple[str, str], Override]:
    """student,task,points,comment: by student and task; NotFound names the line that is wrong. `students`
    are those who handed in something or are on the roster.
    """
    known = {task.id: task for task in assignment.tasks}
    found: dict[tuple[str, str], Override] = {}
    for line, row in _rows(path, ("student", "task", "points")):
        try:
            points = float(row["points"])
            if not (math.isfinite(points) and points >= 0):
                raise ValueError
        except ValueError:
            raise NotFound(f"{path}:{line}: {row['points']!r} is no number of points, 0 or more") from None
        if row["task"] not in known:
            raise NotFound(f"{path}:{line}: no task {row['task']!r}; there are {', '.join(known)}")
        if points > known[row["task"]].most:
            most = number(known[row["task"]].most)
            raise NotFound(f"{path}:{line}: {row['points']} points for {row['task']}, which has {most}")
        if row["student"] not in students:
            raise NotFound(f"{path}:{line}: there is no submission of a student {row['student']!r}")
        if (row["student"], row["task"]) in found:
            raise NotFound(f"{path}:{line}: points of {row['student']!r} for {row['task']} are set twice")
        found[row["student"], row["task"]] = Override(points, row.get("comment") or "")
    return found


def read_roster(path: Path) -> list[str]:
    """The column `student`, in order."""
    return [row["student"] for _, row in _rows(path, ("student",))]


def _rows(path: Path, needed: Sequence[str]) -> Iterator[tuple[int, dict[str, str]]]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise NotFound(f"{path}: {getattr(error, 'strerror', None) or 'not UTF-8'}") from None
    first = text.partition("\n")[0]
    reader = csv.DictReader(io.StringIO(text), delimiter=max(",;\t", key=first.count))
    reader.fieldnames = [name.strip().lower() for name in reader.fieldnames or ()]
    missing = [name for name in needed if name not in reader.fieldnames]
    if missing:
        raise NotFound(f"{path}:1: there is no column {missing[0]!r}")
    for row in reader:
        cells = {k: (v or "").strip() for k, v in row.items() if isinstance(k, str)}
        if any(cells.values()):
            yield reader.line_num, {**cells, "student": name_of(cells["student"])}


def name_of(text: str) -> str:
    """A student's name, the same however its letters with accents are written."""
    return plain(unicodedata.normalize("NFC", text))


def apply_overrides(result: StudentResult, overrides: Mapping[tuple[str, str], Override]) -> None:
    """The teacher's points in place of the grader's."""
    for task in result.tasks:
        override = overrides.get((result.student, task.id))
        if override:
            task.points, task.pending = override.points, 0.0
            task.comment = "; ".join(filter(None, (override.words, task.comment)))


def grades_csv(
    assignment: Assignment, results: Sequence[StudentResult], roster: Sequence[str],
    overrides: Mapping[tuple[str, str], Override] | None = None,
) -> str:  # fmt: skip
    """The table in roster order, then whoever is not on it; who handed in nothing has empty cells, but for
    the teacher's points.
    """
    by_name = {result.student: result for result in results}
    order = [*roster, *sorted(set(by_name) - set(roster))]
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n", quoting=csv.QUOTE_ALL)
    writer.writerow(
        ["student", *(t.id for t in assignment.tasks), "total", "open", "verdict", "review", "comment"]
    )
    for student in order:
        result = by_name.get(student)
        set_ = [(overrides or {}).get((student, task.id)) for task in assignment.tasks]
        if result is None:
            total = number(sum(one.points for one in set_ if one)) if any(set_) else ""
            said = "; ".join(["nothing handed in", *(one.words for one in set_ if one)])
            cells = [number(one.points) if one else "" for one in set_]
            writer.writerow([_plain(student), *cells, total, "", "", "", _plain(said)])
            continue
        points = [number(task.points) for task in result.tasks]
        verdict = " ".join(f"{task.id}:{task.verdict.value}{_mark(task)}" for task in result.tasks)
        review = "yes" if result.review else ""
        told = _comment(result)
        by_hand = [
            f"{task.id}: {one.words}"
            for task, one in zip(assignment.tasks, set_, strict=True)
            if one and one.words not in told
        ]
        comment = " / ".join(filter(None, (*by_hand, told)))
        row = [number(result.total), number(result.pending), verdict, review, _plain(comment)]
        writer.writerow([_plain(student), *points, *row])
    return file.getvalue()


def _plain(text: str) -> str:
    """A text as a cell that no spreadsheet takes for a formula, also one that ends cells elsewhere than this
    table does: at ";", tabs and quotes.
    """
    text = plain(text).replace(";", ",").replace('"', "'")
    first = unicodedata.normalize("NFKC", text).lstrip(" '")[:1]
    return "'" + text if first and first in "=+-@|%" else text


def _comment(result: StudentResult) -> str:
    if result.problem:
        return result.problem
    failed = [f"{task.id}: {_why(task)}" for task in result.tasks if task.verdict is not Outcome.PASS]
    return " / ".join(failed)


def _mark(task: TaskResult) -> str:
    return "" if task.executed else f" ({NOT_EXECUTED})"


def _why(task: TaskResult) -> str:
    reasons = [s.told for s in task.scenes if s.verdict is task.verdict]
    return reasons[0] if reasons else task.comment


def junit_xml(results: Sequence[StudentResult]) -> str:
    """A suite for each student, a test case for each scene of a task, with names of their own."""
    xml = JUnitXml()
    for result in results:
        suite = TestSuite(result.student)
        for task in result.tasks:
            if not task.scenes:
                case = TestCase(task.id, classname=result.student, time=0.0)
                case.result = [Failure(_clean(task.comment), "submission")]
                suite.add_testcase(case)
            for index, scene in enumerate(task.scenes):
                name = f"{task.id} / {scene.scene}{f' / hidden {index}' if scene.hidden else ''}{_mark(task)}"
                case = TestCase(name, classname=result.student, time=0.0 if scene.hidden else scene.seconds)
                if scene.verdict is Outcome.FAIL:
                    case.result = [Failure(_clean(sentence(scene.told)), "verdict")]
                elif scene.verdict is Outcome.INCONCLUSIVE:
                    case.result = [Skipped(_clean(sentence(scene.told)), "inconclusive")]
                elif scene.verdict is Outcome.SKIP:
                    case.result = [Skipped(_clean(sentence(scene.told)), "unsupported")]
                suite.add_testcase(case)
        xml.add_testsuite(suite)
    return str(xml.tostring().decode("utf-8"))


def _clean(text: str) -> str:
    """The text without the characters that XML cannot hold."""
    return "".join(c if c in "\t\n" or " " <= c < "\ud800" or "\ue000" <= c < "\ufffe" else "�" for c in text)
