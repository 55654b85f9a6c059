"""An assignment tried out before students see it: how long each task takes a program of a stated speed, what
bias it would notice, and which mistakes would pass.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from raycheck.base.errors import NotFound
from raycheck.base.text import duration
from raycheck.calibration import mutants
from raycheck.calibration.mutants import Mutant
from raycheck.calibration.simulated import Simulated
from raycheck.grading.assignment import Assignment, Task
from raycheck.grading.judge import Grader
from raycheck.grading.results import SceneResult
from raycheck.scene.content import read_content
from raycheck.scene.techniques import BEST, applicable, technique
from raycheck.scene.variants import Variant
from raycheck.stats.verdict import Outcome

FEW, ALL, NONE = "few", "all", "none"
"""One mistake for each task, that of its technique which its scene shows; all of its technique; none."""


@dataclass
class TaskCheck:
    """What an honest program and those with mistakes get in one task."""

    task: Task
    seconds: float = 0.0
    picture_seconds: float = 0.0
    """Seconds of the slowest picture."""
    scene_seconds: float = 0.0
    """Seconds of the slowest scene."""
    honest: list[SceneResult] = field(default_factory=list)
    mistakes: dict[str, Outcome] = field(default_factory=dict)
    """The verdict on each mistake that changes the picture, by its name."""
    unseen: list[str] = field(default_factory=list)
    """Mistakes that change nothing in the task's scenes."""

    @property
    def detectable(self) -> float:
        """The bias of the image that would be noticed in the scene where it is noticed last."""
        return max((s.mde_image for s in self.honest if s.mde_image is not None), default=np.nan)

    @property
    def passes(self) -> bool:
        return all(scene.verdict is Outcome.PASS for scene in self.honest)


def choose(assignment: Assignment, names: Sequence[str]) -> dict[str, list[Mutant]]:
    """The mistakes to try, by task: those of its technique of these names, where some are given."""
    if list(names) == [NONE]:
        return {task.id: [] for task in assignment.tasks}
    known = [mutant for mutant in mutants.catalogue() if mutant.equivalent is None]
    unknown = sorted(set(names) - {mutant.name for mutant in known} - {FEW, ALL})
    if unknown:
        raise NotFound(f"{unknown[0]!r} is none of {FEW}, {ALL}, {NONE} and no mistake in {mutants.FOLDER}")
    found = {}
    for task in assignment.tasks:
        of_task = [m for m in known if m.technique.split()[0] == task.lecture]
        of_task.sort(key=lambda m: (m.scene not in task.scenes, m.variant is not None, m.name))
        if list(names) == [FEW]:
            of_task = of_task[:1]
        elif list(names) != [ALL]:
            of_task = [m for m in of_task if m.name in names]
        found[task.id] = of_task
    return found


def check(
    grader: Grader, paths_per_second: float, chosen: dict[str, list[Mutant]],
    on_task: Callable[[TaskCheck], None],
) -> list[TaskCheck]:  # fmt: skip
    """Every task with all its scenes; the programs are built where they are missing, 10 s each."""
    results = []
    for task in grader.assignment.tasks:
        result = TaskCheck(task)
        for number, (of, name, varies) in enumerate(grader.scenes[task.id]):
            with _student(grader, None, task.technique or BEST, of, paths_per_second) as honest:
                scene = grader.judge(task, of, name, bool(varies), honest, f"check/{task.id}/{number}")
                result.honest.append(scene)
                result.seconds += honest.spent
                result.scene_seconds = max(result.scene_seconds, honest.spent)
                result.picture_seconds = max(result.picture_seconds, honest.seconds(task.spp))
            if varies is None:
                for mutant in chosen[task.id]:
                    _try(grader, task, of, mutant, paths_per_second, result)
        result.unseen = [name for name in result.unseen if name not in result.mistakes]
        results.append(result)
        on_task(result)
    return results


def _student(
    grader: Grader, mutant: Mutant | None, name: str, of: Variant, paths_per_second: float
) -> Simulated:
    return Simulated(mutants.program(mutant), name, of, grader.assignment.limits, paths_per_second)


def _try(
    grader: Grader, task: Task, of: Variant, mutant: Mutant, paths_per_second: float, result: TaskCheck
) -> None:
    """A mistake is made in the technique that shows it, where that applies to the scene."""
    possible = technique(mutant.shows) in applicable(read_content(of.path, of.parameters))
    name = mutant.shows if possible else task.technique or BEST
    with _student(grader, None, name, of, paths_per_second) as right:
        correct = [right.render(of.path, 4, seed, np.inf).image.pixels for seed in (1, 2)]
    with _student(grader, mutant, name, of, paths_per_second) as wrong:
        purpose = f"check/{task.id}/{mutant.name}"
        scene = grader.judge(task, of, of.label, False, wrong, purpose)
    with _student(grader, mutant, name, of, paths_per_second) as wrong:
        if scene.verdict is not Outcome.FAIL:
            same = [wrong.render(of.path, 4, seed, np.inf).image.pixels for seed in (1, 2)]
            if np.array_equal(same, correct):
                result.unseen.append(mutant.name)
                return
    worst = result.mistakes.get(mutant.name)
    result.mistakes[mutant.name] = Outcome.FAIL if Outcome.FAIL in (worst, scene.verdict) else scene.verdict


def refusals(assignment: Assignment, results: Sequence[TaskCheck], limit: float) -> list[str]:
    """Why an honest program of that speed would not get through; a line each."""
    limits, lines = assignment.limits, []
    allowed = f"the platform's limit is {duration(limit)}"
    for result in results:
        if result.picture_seconds > limits.picture_seconds:
            lines.append(
                f"{result.task.id}: a picture of {result.task.spp} samples takes "
                f"{duration(result.picture_seconds)}, picture_seconds is {limits.picture_seconds:g}"
            )
        if result.scene_seconds > limits.task_seconds:
            lines.append(
                f"{result.task.id}: a scene takes {duration(result.scene_seconds)}, "
                f"task_seconds is {limits.task_seconds:g}"
            )
        if result.seconds > limit:
            lines.append(f"{result.task.id}: it takes {duration(result.seconds)}, {allowed}")
    total = sum(result.seconds for result in results)
    if total > limit:
        lines.append(f"all tasks: they take {duration(total)}, {allowed}")
    return lines
