"""Gradescope's results.json. A test's status is one of its own words, and an open verdict has no score: its
points are neither given nor lost until somebody has looked.
"""

import json
from typing import Any

from raycheck.grading.results import NOT_EXECUTED, SceneResult, StudentResult, TaskResult
from raycheck.grading.written.pages import number, sentence
from raycheck.stats.verdict import Outcome


def results_json(result: StudentResult) -> str:
    """The file that Gradescope reads at /autograder/results/results.json."""
    data: dict[str, Any] = {
        "score": result.total, "output": _overall(result),
        "output_format": "text", "visibility": "visible", "stdout_visibility": "hidden",
        "tests": [_test(task, index + 1) for index, task in enumerate(result.tasks)],
        "leaderboard": _leaderboard(result),
        "extra_data": {"submission": result.digest, "pending": result.pending},
    }  # fmt: skip
    return json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def failed_json(why: str) -> str:
    """No points, for a reason that is not the submission's."""
    data = {"score": 0.0, "output": why, "output_format": "text", "stdout_visibility": "hidden", "tests": []}
    return json.dumps(data, indent=1, ensure_ascii=False) + "\n"


def _leaderboard(result: StudentResult) -> list[dict[str, Any]]:
    """What Gradescope shows under pseudonyms where the teacher has enabled it: of tasks that are passed, the
    noise and the time beside oneray's.
    """
    rows: list[dict[str, Any]] = [{"name": "Points", "value": result.total}]
    for task in (task for task in result.tasks if task.verdict is Outcome.PASS):
        for what in ("noise", "speed"):
            found = [getattr(scene, what) for scene in task.scenes if not scene.hidden]
            ratios = [one["ratio"] for one in found if one]
            if ratios:
                ratio = float(f"{max(ratios):.3g}")
                name = {"noise": "noise", "speed": "time"}[what]
                rows.append({"name": f"{task.id} {name}", "value": ratio, "order": "asc"})
    return rows


def _overall(result: StudentResult) -> str:
    lines = [sentence(result.problem)] if result.problem else []
    if result.pending:
        lines.append(f"{number(result.pending)} points are open until somebody has looked.")
    return "\n".join([*lines, sentence(result.sandbox)])


def _test(task: TaskResult, index: int) -> dict[str, Any]:
    lines = [sentence(task.comment)] if task.comment else []
    lines += [_line(scene) for scene in task.scenes]
    if task.hint:
        lines.append(sentence(task.hint))
    test: dict[str, Any] = {
        "name": task.heading, "number": str(index), "max_score": task.most, "score": task.points,
        "output": "\n".join(lines), "output_format": "text", "visibility": "visible",
        "tags": [t for t in (task.lecture, task.verdict.value, "" if task.executed else NOT_EXECUTED) if t],
        "extra_data": {"verdict": task.verdict.value, "pending": task.pending},
    }  # fmt: skip
    if task.pending:
        del test["score"]
    else:
        if task.verdict is not Outcome.SKIP:  # which is neither of its words
            test["status"] = "passed" if task.verdict is Outcome.PASS else "failed"
    return test


def _line(scene: SceneResult) -> str:
    """What the student reads of a scene."""
    where = f"{scene.scene} (hidden variant)" if scene.hidden else scene.scene
    hint = f" The lecture's argument: {scene.mistake}." if scene.mistake and not scene.secret else ""
    return f"{where}: {scene.verdict.value}: {sentence(scene.told)}{hint}"
