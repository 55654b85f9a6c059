"""The student's page and the class's: one offline file each; whatever students control is escaped."""

import re
import statistics
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import jinja2
from markupsafe import Markup

from raycheck.base.data import PACKAGE
from raycheck.base.machine import raycheck_version
from raycheck.base.text import duration, percent
from raycheck.grading.assignment import Assignment
from raycheck.grading.results import NOT_EXECUTED, StudentResult
from raycheck.stats.verdict import Outcome

TEMPLATES = PACKAGE / "templates"
MADE_UP = (
    "its noise is that of normally distributed numbers, which an estimator with these samples does not make: "
    "does the program trace rays, or add noise to a picture?"
)


def number(points: float) -> str:
    """Points with at most two digits behind the point."""
    return f"{points:.2f}".rstrip("0").rstrip(".")


def sentence(text: str) -> str:
    text = text.strip()
    return text[:1].upper() + text[1:] + ("" if text.endswith((".", "!", "?")) else ".")


def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES), autoescape=True, undefined=jinja2.StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.globals.update(
        number=number, sentence=sentence, percent=percent, duration=duration,
        version=raycheck_version(), not_executed=NOT_EXECUTED,
        css=Markup((TEMPLATES / "grading.css").read_text(encoding="utf-8")),
    )  # fmt: skip
    return environment


def student_page(assignment: Assignment, result: StudentResult, everything: bool = False) -> str:
    """What the student reads, or with everything, also of hidden scenes, what the teacher does."""
    template = _environment().get_template("student.html")
    return template.render(assignment=assignment, result=result, everything=everything)


@dataclass
class Cluster:
    """Students who probably share a mistake."""

    what: str
    written: bool
    """Whether there was a picture: else there is hardly a mistake to speak of."""
    tasks: dict[str, list[str]] = field(default_factory=dict)
    """By student: where it is seen."""
    picture: str = ""
    """The address of one that shows it."""

    @property
    def students(self) -> list[str]:
        return list(self.tasks)


def course_page(assignment: Assignment, results: Sequence[StudentResult], pages: Mapping[str, str]) -> str:
    """`pages` are addresses of the students' pages, relative to this one."""
    solved = [sum(r.tasks[i].verdict is Outcome.PASS for r in results) for i in range(len(assignment.tasks))]
    return _environment().get_template("course.html").render(
        assignment=assignment, results=results, pages=pages, solved=solved,
        clusters=[one for one in clusters(results) if one.written],
        unwritten=[one for one in clusters(results) if not one.written],
        borderline=list(borderline(results)), review=sum(r.review for r in results),
        median=statistics.median(r.total for r in results) if results else 0.0,
        sandbox=results[0].sandbox if results else "", again=any(r.earlier for r in results),
    )  # fmt: skip


def clusters(results: Sequence[StudentResult]) -> list[Cluster]:
    """Failures by what they look like, whatever the task, the most frequent first."""
    found: dict[str, Cluster] = {}
    for result in results:
        if result.problem:
            kind = _kind(result.problem)
            found.setdefault(kind, Cluster(kind, written=False)).tasks[result.student] = []
        for task in result.tasks:
            failed = [scene for scene in task.scenes if scene.verdict is Outcome.FAIL]
            if failed and task.verdict is Outcome.FAIL:
                kind = _kind(failed[0].reason)
                one = found.setdefault(kind, Cluster(kind, written=bool(failed[0].pictures)))
                one.tasks.setdefault(result.student, []).append(task.id)
                one.picture = one.picture or next((p["uri"] for p in failed[0].pictures[-1:]), "")
    return sorted(found.values(), key=lambda one: (-len(one.tasks), one.what))


def _kind(reason: str) -> str:
    """A reason without its figures and details: two that differ in them alone are one kind. Strangers' words
    are no part of it.
    """
    named = re.search(r"it looks like this mistake: “(.+?)”", reason)
    if named:
        return named.group(1)
    general = re.sub(r" \(seed \d+\)", "", re.sub("“[^”]*”", "“…”", reason)).split("; ")[0]
    return re.sub(r"\d[\d.,…±−–%×^ ]*[\d%]|\d", "…", general)[:160]


def borderline(results: Sequence[StudentResult]) -> Iterator[tuple[str, str, str]]:
    """(student, task, why) of verdicts that are open, failures that fresh samples did not confirm, and noise
    that looks made up.
    """
    for result in results:
        for task in result.tasks:
            for scene in task.scenes:
                if scene.verdict is Outcome.INCONCLUSIVE:
                    yield result.student, task.id, scene.reason
                elif scene.borderline:
                    yield result.student, task.id, "a difference was seen that fresh samples did not confirm"
                if scene.noise and scene.noise.get("made_up"):
                    yield result.student, task.id, MADE_UP
