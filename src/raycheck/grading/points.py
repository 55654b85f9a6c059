"""What a task earns, and why: for pictures without bias, for noise and for speed."""

from collections.abc import Mapping, Sequence
from typing import Any

from raycheck.grading.assignment import REVIEW, Assignment, Task
from raycheck.grading.results import SceneResult, TaskResult
from raycheck.stats.verdict import Outcome

CALM = (
    "; that is less noise than this technique has, and whether a better technique or more samples than {spp} "
    "says make it is not decided: these points wait for a look at the program"
)
Ratio = Mapping[str, Any]
"""A comparison with oneray: ratio, low, high."""


def earned(
    assignment: Assignment, task: Task, scenes: list[SceneResult], executed: bool = True
) -> TaskResult:
    """The scenes share the points; those for noise and speed are earned where every scene passes, and wait
    with a verdict that is open. Pictures that were handed in, not executed, have none of these. A scene that
    the program does not support earns nothing.
    """
    outcomes = [scene.verdict for scene in scenes]
    share = task.points / len(scenes)
    points = share * outcomes.count(Outcome.PASS)
    waiting = share * outcomes.count(Outcome.INCONCLUSIVE)
    worst = (Outcome.FAIL, Outcome.INCONCLUSIVE, Outcome.SKIP)
    verdict = next((outcome for outcome in worst if outcome in outcomes), Outcome.PASS)
    compared = executed and verdict in (Outcome.PASS, Outcome.INCONCLUSIVE)
    open_ = verdict is Outcome.INCONCLUSIVE
    nothing = 0.0, 0.0, ""
    quiet, quiet_waits, of_noise = _noise(task, scenes, open_) if compared and task.shows_noise else nothing
    fast, fast_waits, of_speed = _speed(task, scenes, open_) if compared and task.measures_speed else nothing
    waiting += quiet_waits + fast_waits
    if assignment.inconclusive != REVIEW:
        points += float(assignment.inconclusive) * waiting
        waiting = 0.0
    hint = task.hint if verdict is not Outcome.PASS else ""
    return TaskResult(
        task.id, task.heading, task.lecture, verdict, round(points + quiet + fast, 4), round(waiting, 4),
        task.most, scenes, quiet, fast, hint, "; ".join(filter(None, (of_noise, of_speed))), executed,
    )  # fmt: skip


def _noise(task: Task, scenes: Sequence[SceneResult], open_: bool) -> tuple[float, float, str]:
    """Points that are earned, those that wait, and what is said."""
    found = [scene.noise for scene in scenes]
    worst, within = _worst(found, task.noise_limit)
    calm = within and any(one["high"] < 1 / task.noise_limit for one in found if one)
    points = task.noise_points if within or (open_ and worst is None) else 0.0
    comment = _noise_comment(task, *_told(scenes, found, worst, within))
    comment += CALM if calm and task.noise_points else ""
    return (0.0, points, comment) if open_ or calm else (points, 0.0, comment)


def _speed(task: Task, scenes: Sequence[SceneResult], open_: bool) -> tuple[float, float, str]:
    """The same; what could not be measured waits."""
    found = [scene.speed for scene in scenes]
    worst, within = _worst(found, task.speed_limit)
    points = task.speed_points if within or worst is None else 0.0
    comment = _speed_comment(task, *_told(scenes, found, worst, within))
    return (0.0, points, comment) if open_ or worst is None else (points, 0.0, comment)


def _worst(found: Sequence[Ratio | None], limit: float) -> tuple[Ratio | None, bool]:
    """The largest ratio, of those surely beyond the limit if there are any; and whether none is."""
    measured = [one for one in found if one]
    beyond = [one for one in measured if one["low"] > limit]
    worst = max(beyond or measured, key=lambda one: one["ratio"], default=None)
    return worst, worst is not None and not beyond


def _told(
    scenes: Sequence[SceneResult], found: Sequence[Ratio | None], worst: Ratio | None, within: bool
) -> tuple[Ratio | None, bool]:  # fmt: skip
    """What students are told of the worst: of a hidden scene nothing but that it decides."""
    shown = [one for scene, one in zip(scenes, found, strict=True) if not scene.hidden]
    if worst in shown:
        return worst, within
    return max((one for one in shown if one), key=lambda one: one["ratio"], default=None), within


def _interval(ratio: Ratio) -> str:
    return f"({ratio['low']:.3g} … {ratio['high']:.3g})"


def _noise_comment(task: Task, worst: Ratio | None, within: bool) -> str:
    if worst is None:
        return "noise not compared: the scene is undecided, or the run command takes no {spp}"
    figures = f"{worst['ratio']:.3g} times the variance {_interval(worst)} of oneray's {task.technique}"
    limit = f"; up to {task.noise_limit:g} times earn the {task.noise_points:g} points for noise"
    said = f"a sample has {figures}{limit if task.noise_points else ''}"
    return said if within else f"too noisy{_where(worst, task.noise_limit)}: {said}"


def _speed_comment(task: Task, worst: Ratio | None, within: bool) -> str:
    if worst is None:
        return "speed not compared: the scene is undecided, or oneray does not run in this jail"
    figures = f"a picture takes {worst['seconds']:.2g} s, {worst['ratio']:.3g} times {_interval(worst)}"
    limit = f"; up to {task.speed_limit:g} times earn the {task.speed_points:g} points for speed"
    said = f"{figures} what oneray's {task.technique} takes{limit if task.speed_points else ''}"
    return said if within else f"too slow{_where(worst, task.speed_limit)}: {said}"


def _where(shown: Ratio, limit: float) -> str:
    """Where it is beyond the limit, if the scene of which the figures are is not."""
    return "" if shown["low"] > limit else " in a hidden variant"
