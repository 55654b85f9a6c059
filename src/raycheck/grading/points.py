"""What a task earns, and why: for pictures without bias, for noise and for speed."""

from raycheck.grading.assignment import REVIEW, Assignment, Task
from raycheck.grading.results import SceneResult, TaskResult
from raycheck.verdict import Outcome


def earned(assignment: Assignment, task: Task, scenes: list[SceneResult]) -> TaskResult:
    """The scenes share the points; those for noise and speed are earned where no scene fails."""
    outcomes = [scene.verdict for scene in scenes]
    share = task.points / len(scenes)
    points = share * outcomes.count(Outcome.PASS)
    waiting = share * outcomes.count(Outcome.INCONCLUSIVE)
    verdict = next((o for o in (Outcome.FAIL, Outcome.INCONCLUSIVE) if o in outcomes), Outcome.PASS)
    quiet = fast = 0.0
    comments = []
    if task.noise_points and verdict is not Outcome.FAIL:
        judged = [s for s in scenes if s.noise]
        noisy = [s for s in judged if s.noise["low"] > task.noise_limit]
        quiet = task.noise_points if judged and not noisy else 0.0
        comments.append(_noise_comment(task, noisy or judged, bool(noisy)))
    if task.measures_speed and verdict is not Outcome.FAIL:
        measured = [s for s in scenes if s.speed]
        slow = [s for s in measured if s.speed["low"] > task.speed_limit]
        fast = task.speed_points if measured and not slow else 0.0
        comments.append(_speed_comment(task, slow or measured, bool(slow)))
    if assignment.inconclusive != REVIEW:
        points += float(assignment.inconclusive) * waiting
        waiting = 0.0
    hint = task.hint if verdict is not Outcome.PASS else ""
    return TaskResult(
        task.id, task.heading, task.lecture, verdict, round(points + quiet + fast, 4), round(waiting, 4),
        task.most, scenes, quiet, fast, hint, "; ".join(comments),
    )  # fmt: skip


def _noise_comment(task: Task, scenes: list[SceneResult], noisy: bool) -> str:
    if not scenes:
        return "noise not compared: the scene is undecided, or the run command takes no {spp}"
    worst = max(scenes, key=lambda s: s.noise["ratio"]).noise
    interval = f"{worst['low']:.3g} … {worst['high']:.3g}"
    figures = f"{worst['ratio']:.3g} times the variance ({interval}) of oneray's {task.technique}"
    limit = f"up to {task.noise_limit:g} times earn the {task.noise_points:g} points for noise"
    return f"{'too noisy: ' if noisy else ''}a sample has {figures}; {limit}"


def _speed_comment(task: Task, scenes: list[SceneResult], slow: bool) -> str:
    if not scenes:
        return "speed not compared: the scene is undecided, or oneray does not run in this jail"
    worst = max(scenes, key=lambda s: s.speed["ratio"]).speed
    figures = f"a picture takes {worst['seconds']:.2g} s, {worst['ratio']:.3g} times"
    interval = f"({worst['low']:.3g} … {worst['high']:.3g}) what oneray's {task.technique} takes"
    points = f"; up to {task.speed_limit:g} times earn the {task.speed_points:g} points for speed"
    return f"{'too slow: ' if slow else ''}{figures} {interval}{points if task.speed_points else ''}"
