"""What grading one submission found; plain data that is kept as JSON."""

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from raycheck.grading.assignment import Assignment
from raycheck.stats.verdict import Outcome

NOT_EXECUTED = "not executed"
"""The notice on every page and in every file about pictures that were handed in."""
UNTOLD = "nothing more is told of a hidden scene"


@dataclass
class SceneResult:
    """One scene of a task."""

    scene: str
    hidden: bool
    verdict: Outcome
    reason: str
    bias: float | None = None
    bias_low: float | None = None
    bias_high: float | None = None
    mde_image: float | None = None
    more_samples: float | None = None
    spp: int | None = None
    looks: int = 0
    """Sets of fresh seeds that were judged."""
    borderline: bool = False
    """A FAIL that fresh samples did not confirm."""
    mistake: str = ""
    """The lecture's argument that is likely to help."""
    noise: dict[str, Any] | None = None
    """Ratio of variances, low, high, technique."""
    speed: dict[str, Any] | None = None
    """Ratio of seconds, low, high, seconds of a picture, technique."""
    seconds: float = 0.0
    pictures: list[dict[str, str]] = field(default_factory=list)
    """Data URIs and captions for the page."""
    tile: dict[str, float] | None = None
    """The tile that is furthest off or known least: top, left, height and width in percent of the picture."""
    stored: bool = False
    """It shows the published scene in place of a hidden variant."""
    secret: bool = False
    """What the program said there, how far it is off and its pictures would tell a hidden scene."""

    @property
    def told(self) -> str:
        """What a student may read in place of the reason."""
        return UNTOLD if self.secret else self.reason


@dataclass
class TaskResult:
    id: str
    heading: str
    lecture: str
    verdict: Outcome
    points: float
    """Points that are earned for sure."""
    pending: float
    """Points that wait for a manual review."""
    most: float
    scenes: list[SceneResult]
    noise_points: float = 0.0
    """The share of `points` that is for noise."""
    speed_points: float = 0.0
    """The share of `points` that is for speed; another run may earn others."""
    hint: str = ""
    comment: str = ""
    executed: bool = True
    """Whether a program was run; if not, pictures were handed in."""


@dataclass
class StudentResult:
    student: str
    assignment: str
    tasks: list[TaskResult]
    sandbox: str
    digest: str = ""
    """A digest of the submission."""
    state: str = ""
    """A digest of the submission and of all that decides its grade."""
    problem: str = ""
    """Why nothing could be graded."""
    seconds: float = 0.0
    earlier: list[float] = field(default_factory=list)
    """Totals of submissions that this one replaced, the oldest first."""

    @property
    def total(self) -> float:
        return round(sum(task.points for task in self.tasks), 4)

    @property
    def pending(self) -> float:
        return round(sum(task.pending for task in self.tasks), 4)

    @property
    def most(self) -> float:
        return sum(task.most for task in self.tasks)

    @property
    def review(self) -> bool:
        return self.pending > 0

    def to_json(self, pictures: bool = True) -> str:
        totals = {"total": self.total, "pending": self.pending, "most": self.most}
        data = {**asdict(self), **totals}
        for scene in (scene for task in data["tasks"] for scene in task["scenes"] if not pictures):
            scene["pictures"] = []
        return json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False) + "\n"

    @classmethod
    def read(cls, path: Path) -> "StudentResult":
        """A file of what `to_json` gave."""
        return cls.from_json(path.read_text(encoding="utf-8"))

    @classmethod
    def from_json(cls, text: str | bytes) -> "StudentResult":
        found = json.loads(text)
        for name in ("total", "pending", "most"):
            del found[name]
        tasks = [
            TaskResult(**{**t, "verdict": Outcome(t["verdict"]), "scenes": [_scene(s) for s in t["scenes"]]})
            for t in found.pop("tasks")
        ]
        return cls(tasks=tasks, **found)


def _scene(values: dict[str, Any]) -> SceneResult:
    return SceneResult(**{**values, "verdict": Outcome(values["verdict"])})


def failed_everything(assignment: Assignment, student: str, reason: str, sandbox: str) -> StudentResult:
    """Nothing could be run: every task has 0 points and that reason."""
    tasks = [
        TaskResult(
            t.id, t.heading, t.lecture, Outcome.FAIL, 0.0, 0.0, t.most, [], hint=t.hint, comment=reason
        )
        for t in assignment.tasks
    ]
    return StudentResult(student, assignment.name, tasks, sandbox, problem=reason)
