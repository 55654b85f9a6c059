"""What a task earns, and why: for pictures without bias, for noise and for speed."""

from collections.abc import Mapping, Sequence
from typing import Any

from raycheck.grading.assignment import REVIEW, Assignment, Task
from raycheck.grading.results import SceneResult, TaskResult
from raycheck.verdict import Outcome

CALM = (
    "; that is less noise than this technique has: these points wait for a look at the program, whether its "
    "technique is a better one or it takes more samples than {spp} says"
)
Ratio = Mapping[str, Any]
"""A comparison with oneray: ratio, low, high."""


def earned(assignment: Assignment, task: Task, scenes: list[SceneResult]) -> TaskResult:
    """The scenes share the points; those for noise and speed are earned where no scene fails."""
    outcomes = [scene.verdict for scene in scenes]
    share = task.points / len(scenes)
    points = share * outcomes.count(Outcome.PASS)
    waiting = share * outcomes.count(Outcome.INCONCLUSIVE)
    verdict = next((o for o in (Outcome.FAIL, Outcome.INCONCLUSIVE) if o in outcomes), Outcome.PASS)
    quiet = fast = review = 0.0
    comments = []
    if task.noise_points and verdict is not Outcome.FAIL:
        found = [s.noise for s in scenes]
        worst, within = _worst(found, task.noise_limit)
        calm = any(one["high"] < 1 / task.noise_limit for one in found if one)
        quiet = task.noise_points if within and not calm else 0.0
        review = task.noise_points if within and calm else 0.0
        comments.append(_noise_comment(task, worst, within) + (CALM if review else ""))
    if task.measures_speed and verdict is not Outcome.FAIL:
        worst, within = _worst([s.speed for s in scenes], task.speed_limit)
        fast = task.speed_points if within else 0.0
        comments.append(_speed_comment(task, worst, within))
    if assignment.inconclusive != REVIEW:
        points += float(assignment.inconclusive) * waiting
        waiting = 0.0
    hint = task.hint if verdict is not Outcome.PASS else ""
    return TaskResult(
        task.id, task.heading, task.lecture, verdict, round(points + quiet + fast, 4),
        round(waiting + review, 4),
        task.most, scenes, quiet, fast, hint, "; ".join(comments),
    )  # fmt: skip


def _worst(found: Sequence[Ratio | None], limit: float) -> tuple[Ratio | None, bool]:
    """The largest ratio, of those surely beyond the limit if there are any; and whether none is."""
    measured = [one for one in found if one]
    beyond = [one for one in measured if one["low"] > limit]
    worst = max(beyond or measured, key=lambda one: one["ratio"], default=None)
    return worst, worst is not None and not beyond


def _interval(ratio: Ratio) -> str:
    return f"({ratio['low']:.3g} … {ratio['high']:.3g})"


def _noise_comment(task: Task, worst: Ratio | None, within: bool) -> str:
    if worst is None:
        return "noise not compared: the scene is undecided, or the run command takes no {spp}"
    figures = f"{worst['ratio']:.3g} times the variance {_interval(worst)} of oneray's {task.technique}"
    limit = f"up to {task.noise_limit:g} times earn the {task.noise_points:g} points for noise"
    return f"{'' if within else 'too noisy: '}a sample has {figures}; {limit}"


def _speed_comment(task: Task, worst: Ratio | None, within: bool) -> str:
    if worst is None:
        return "speed not compared: the scene is undecided, or oneray does not run in this jail"
    figures = f"a picture takes {worst['seconds']:.2g} s, {worst['ratio']:.3g} times {_interval(worst)}"
    limit = f"; up to {task.speed_limit:g} times earn the {task.speed_points:g} points for speed"
    said = f"{figures} what oneray's {task.technique} takes{limit if task.speed_points else ''}"
    return said if within else f"too slow: {said}"
