"""Gradescope's run_autograder: one submission, within the platform's time.

A failing result comes first and is replaced as a whole: whatever happens, there is one. Details for the
teacher go to standard output, which students do not see.
"""

import argparse
import time
from dataclasses import replace as changed
from pathlib import Path

from raycheck.base.errors import NotFound, ReferenceError_
from raycheck.base.files import write_whole
from raycheck.grading import course, one_submission
from raycheck.grading.assignment import read_assignment
from raycheck.grading.assignment_bundle import ASSIGNMENT
from raycheck.grading.jail import sandbox
from raycheck.grading.judge import Grader
from raycheck.grading.written.gradescope import failed_json, results_json

UNFINISHED = "The grading was ended before it was finished. These are no final points: tell your teacher."
NOT_STARTED = "The grading could not start, and it is not your fault: tell your teacher."


def run(root: Path, seconds: float) -> None:
    """Grade root/submission into root/results/results.json."""
    started = time.perf_counter()
    results = root / "results/results.json"
    write_whole(results, failed_json(UNFINISHED))
    try:
        assignment = read_assignment(root / "source" / ASSIGNMENT)
        grader = Grader.prepare(assignment, sandbox.best_tier())
    except (NotFound, ReferenceError_) as error:
        print(error)
        write_whole(results, failed_json(NOT_STARTED))
        return
    grader = changed(grader, seconds=seconds - (time.perf_counter() - started))
    result = one_submission.grade_one(grader, course.content(root / "submission"), "submission")
    write_whole(results, results_json(result))
    print(result.to_json(pictures=False))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("root", type=Path)
    parser.add_argument("--seconds", type=float, required=True)
    arguments = parser.parse_args()
    run(arguments.root, arguments.seconds)
