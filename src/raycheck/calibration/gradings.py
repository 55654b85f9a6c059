"""False failures of the grader: an honest program graded many times over, with fresh keys each time.

Honest is oneray with each task's technique. Verdicts, second looks and plain checks are the grader's own, in
this process: no jail, no files, no clock. Pictures have few samples, which makes a grading affordable and the
tails of its statistics heavier than those of an assignment; a wide delta spares the looks that would only
tell PASS from INCONCLUSIVE, and has no part in a FAIL.
"""

import hashlib
import json
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from scipy import stats

from raycheck.calibration import checkout, mutants
from raycheck.calibration.checkout import Checkout
from raycheck.calibration.lines import append_lines, read_lines
from raycheck.calibration.simulated import Simulated
from raycheck.grading import assignment_bundle
from raycheck.grading.assignment import Assignment, read_assignment
from raycheck.grading.jail.limits import Limits
from raycheck.grading.jail.sandbox import Tier
from raycheck.grading.judge import Grader
from raycheck.grading.keys import Keys
from raycheck.renderers import workers
from raycheck.renderers.pools import Pool
from raycheck.scene.techniques import BEST
from raycheck.stats.verdict import Outcome
from raycheck.truth import provenance

METHOD = 1
"""Version of how honest programs are graded, see truth.provenance."""
SPP = 2
WIDE = 0.5
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Grading:
    """One grading of an honest program."""

    index: int
    verdicts: dict[str, str]
    """The verdicts by "task/number of its scene"."""
    reasons: list[str]
    """Why it failed where it did."""
    second_looks: int
    """Looks that failed and that a second one, with fresh seeds, did not confirm."""
    digest: str
    """Digest of the pictures, the method and what is asked: see `digest_of`."""


def quick(assignment: Assignment) -> Assignment:
    """The assignment with few samples and without limits of time."""
    tasks = tuple(replace(task, spp=SPP, technique=task.technique or BEST) for task in assignment.tasks)
    limits = Limits(picture_seconds=1e6, task_seconds=1e9)
    return replace(assignment, tasks=tasks, delta=WIDE, limits=limits)


def grade_honest(grader: Grader, index: int, digest: str) -> Grading:
    """Grade every scene of every task, with keys of their own."""
    secret = hashlib.sha256(f"gradings {index}".encode()).digest()
    fresh = replace(grader, keys=Keys(f"gradings {index}", secret))
    verdicts, reasons, second = {}, [], 0
    for task in grader.assignment.tasks:
        for number, (of, name, varies) in enumerate(grader.scenes[task.id]):
            program, limits = mutants.program(None), grader.assignment.limits
            with Simulated(program, task.technique, of, limits, 1e9) as honest:
                judged = replace(task, technique="")  # the noise is not compared
                found = fresh.judge(judged, of, name, bool(varies), honest, f"{task.id}/{of.label}/{index}")
            verdicts[f"{task.id}/{number}"] = found.verdict.value
            reasons += [f"{task.id}: {found.reason}"] if found.verdict is Outcome.FAIL else []
            second += found.borderline
    return Grading(index, verdicts, reasons, second, digest)


def rests_on(assignment: Assignment) -> list[str]:
    """The honest program's pictures of the tasks' scenes, of which hidden ones are variants, and what
    they are judged by.
    """
    shown = [(scene, task.technique or BEST) for task in assignment.tasks for scene in task.scenes]
    return [name for scene, how in shown for name in (f"{scene} {how} double", f"reference {scene}")]


def digest_of(assignment: Assignment) -> str:
    """A digest of the pictures, the method and what is asked: gradings that have it need not be repeated."""
    what = (provenance.digest(METHOD, rests_on(assignment)), assignment.tasks)
    return hashlib.sha256(repr(what).encode()).hexdigest()[:16]


def one_grading(assignment: bytes, index: int, digest: str, build: Checkout) -> bytes:
    """`grade_honest` as JSON: a piece of `measure`. `assignment` is of `assignment_bundle.pack`."""
    checkout.require(build)
    with tempfile.TemporaryDirectory(prefix="raycheck-") as folder:
        asked = quick(read_assignment(assignment_bundle.unpack(assignment, Path(folder))))
        found = grade_honest(Grader.prepare(asked, Tier.NONE), index, digest)
    return json.dumps(asdict(found)).encode()


def measure(file: Path, grader: Grader, count: int, pool: Pool | None = None) -> Iterator[Grading]:
    """Gradings 0 … count − 1 of a `quick` assignment; those that `file` has of the same program and tasks
    are kept.
    """
    digest, build = digest_of(grader.assignment), checkout.of_checkout()
    done = {line["index"] for line in read_lines(file) if line["digest"] == digest}
    assignment = assignment_bundle.pack(grader.assignment)
    pieces = [(assignment, index, digest, build) for index in sorted(set(range(count)) - done)]
    for _, data in workers.run(pool, one_grading, pieces):
        found = json.loads(data)
        append_lines(file, [found])
        yield Grading(**found)


def summary(file: Path, assignment: Assignment) -> dict[str, object]:
    """How many honest programs failed, and the upper bound of that rate: Clopper and Pearson, one-sided."""
    digest = digest_of(assignment)
    lines = sorted(
        (line for line in read_lines(file) if line["digest"] == digest), key=lambda line: line["index"]
    )
    failed = sum("FAIL" in line["verdicts"].values() for line in lines)
    outcomes = Counter(v for line in lines for v in line["verdicts"].values())
    verdicts = sum(outcomes.values())
    return {
        "provenance": provenance.provenance(METHOD, rests_on(assignment)),
        "gradings": len(lines),
        "false_failures": failed,
        "rate_below": _upper(failed, len(lines)),
        "verdicts": verdicts,
        "verdicts_failed": outcomes["FAIL"],
        "verdict_rate_below": _upper(outcomes["FAIL"], verdicts),
        "outcomes": dict(outcomes),
        "unconfirmed_failures": sum(line["second_looks"] for line in lines),
        "confidence": CONFIDENCE,
        "spp": SPP,
        "reasons": [reason for line in lines for reason in line["reasons"]],
    }


def _upper(failed: int, count: int) -> float:
    bound = stats.beta.ppf(CONFIDENCE, failed + 1, count - failed) if failed < count else 1.0
    return float(f"{bound:.3g}")
