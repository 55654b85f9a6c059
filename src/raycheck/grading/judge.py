"""Verdicts and points for one submission.

A FAIL by statistics counts only when a second look with fresh seeds confirms it: each has a chance of 1e-5 of
being wrong, both together 1e-10. Where noise leaves it open, one more look takes four times the samples. What
needs no statistics (no picture, a wrong size, seeds that change nothing) counts at once.
"""

import hashlib
import math
import tempfile
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from raycheck import checks, lecture, pictures, references
from raycheck.grading import handed_in, noise
from raycheck.grading.assignment import PICTURES, REVIEW, Assignment, Task
from raycheck.grading.hidden import hidden_variants, pool_index, pool_variant
from raycheck.grading.keys import Keys, digest_of, private_folder, read_keys
from raycheck.grading.program import Program, build, write_scene
from raycheck.grading.results import (
    NOT_EXECUTED,
    SceneResult,
    StudentResult,
    TaskResult,
    failed_everything,
)
from raycheck.grading.sandbox import Jail, Tier
from raycheck.grading.simulated import Simulated
from raycheck.grading.submission import Submission, SubmissionError, open_submission, remove
from raycheck.references import Variant
from raycheck.renderers import NotFound, RenderError, RenderTimeout
from raycheck.seeds import make_seeds
from raycheck.tiles import region_means
from raycheck.truth import truth_of
from raycheck.verdict import Limits, Outcome
from raycheck.verify import BATCHES, PILOT_IMAGES, Case, raycheck_version, verify

Array = NDArray[np.float64]
TILES = Limits.tile / Limits.image
UNREADABLE = "the run command takes neither {scene} nor {json}: it cannot render scenes unknown to it"
OPTION = "; --timeout SECONDS allows more"
"""What verify advises, and no student can do."""
LOOK = 1 + PILOT_IMAGES + 2 * BATCHES
"""Pictures of a look."""
OTHER = "the pictures show another student's variant of the scene, not yours"
PUBLISHED = "the pictures show the scene as it is published, not your variant of it"
OVER = "the time for the whole grading was over before this scene"
FEW_IMAGES = 8
MORE = 4
"""Times the samples of a look that noise makes necessary."""


@dataclass(frozen=True)
class Grader:
    """An assignment, ready to grade: its keys, and its scenes with their hidden variants."""

    assignment: Assignment
    keys: Keys
    scenes: dict[str, list[tuple[Variant, str, bool]]]
    """By task: what is rendered, what it is called, whether it is hidden."""
    tier: Tier
    seconds: float = math.inf
    """For the whole of one submission."""

    @classmethod
    def prepare(cls, assignment: Assignment, tier: Tier) -> "Grader":
        """Make the hidden variants' references where they are missing, which takes a minute for each."""
        keys = read_keys(assignment.path, assignment.name)
        folder = private_folder(assignment.path) / "scenes"
        scenes: dict[str, list[tuple[Variant, str, bool]]] = {}
        for task in assignment.tasks:
            scenes[task.id] = []
            for name in task.scenes:
                of = assignment.scene(name)
                scenes[task.id].append((of, of.label, False))
                hidden = hidden_variants(of, task.hidden, keys, folder)
                scenes[task.id] += [(one, of.label, True) for one in hidden]
        return cls(assignment, keys, scenes, tier)

    def grade(self, path: Path, student: str, slot: int = 0) -> StudentResult:
        """Everything about one submission; never raises for what a submission does."""
        started = time.perf_counter()
        jail = Jail(self.tier, self.assignment.limits, slot, started + self.seconds)
        with tempfile.TemporaryDirectory(prefix="raycheck-grade-", ignore_cleanup_errors=True) as place:
            Path(place).chmod(0o711)
            try:
                result = self._grade(path, student, jail, Path(place))
            except SubmissionError as error:
                result = failed_everything(self.assignment, student, str(error), jail.describe())
            remove(Path(place) / "submission")
        result.seconds = round(time.perf_counter() - started, 1)
        return result

    def _grade(self, path: Path, student: str, jail: Jail, place: Path) -> StudentResult:
        unpacked = place / "submission"
        unpacked.mkdir(mode=0o755)
        submission = open_submission(path, unpacked)
        digest = digest_of(unpacked)
        command = "" if submission.pictures_alone else submission.run or self.assignment.run
        if not command and not submission.pictures_alone:
            raise SubmissionError('there is no run command: write run = "…" into raycheck.toml')
        to_build = submission.build or self.assignment.build
        problem = build(jail, submission.folder, to_build) if command else ""
        if problem:
            result = failed_everything(self.assignment, student, problem, jail.describe())
        else:
            tasks = [
                self._pictures(task, submission, student)
                if task.accepts == PICTURES and submission.pictures(task.id)
                else self._task(task, submission, command, digest, jail, place)
                for task in self.assignment.tasks
            ]
            result = StudentResult(student, self.assignment.name, tasks, jail.describe())
        result.digest, result.state = digest, self.state(digest)
        return result

    def _pictures(self, task: Task, submission: Submission, student: str) -> TaskResult:
        """Points for pictures that were handed in."""
        started = time.perf_counter()
        of, files = self.assignment.scene(task.scenes[0]), submission.pictures(task.id)
        pool = picture_pool(self.assignment, self.keys, task)
        own = pool[pool_index(of, student, task.variants, self.keys)]
        others = [(one, OTHER) for one in pool if one != own] + [(of, PUBLISHED)]
        entry = references.require(of)
        limits = Limits(image=self.assignment.delta, tile=TILES * self.assignment.delta)
        most, size = self.assignment.limits.output_mb << 20, (entry["height"], entry["width"])
        name = f"{of.label} (variant of {student})"
        try:
            case, images = handed_in.judge(files, own, others, limits, most, size)
            scene = _scene_result(name, False, case, 1)
            scene.pictures = _pictures(images, own, secret=True)
        except RenderError as error:
            scene = SceneResult(name, False, Outcome.FAIL, str(error))
        scene.seconds = round(time.perf_counter() - started, 1)
        result = self._points(task, [scene])
        result.executed = False
        many = f"{len(files)} picture{'s' if len(files) > 1 else ''} handed in"
        noisy = ", which earn no points for noise" if task.noise_points else ""
        result.comment = f"{NOT_EXECUTED}: judged by {many}{noisy}"
        return result

    def state(self, digest: str) -> str:
        """Of a submission's digest and of all that it is graded by."""
        what = (raycheck_version(), self.assignment, self.keys.secret.hex(), self.tier, digest)
        return hashlib.sha256(repr(what).encode()).hexdigest()

    def _task(
        self, task: Task, submission: Submission, command: str, digest: str, jail: Jail, place: Path
    ) -> TaskResult:
        if not command:
            what = f"pictures/{task.id}, which is empty" if task.accepts == PICTURES else "a program"
            nothing = SceneResult(task.scenes[0], False, Outcome.FAIL, f"this task asks for {what}")
            return self._points(task, [nothing])
        scenes = []
        for number, (of, name, hidden) in enumerate(self.scenes[task.id]):
            if jail.left() <= 0:
                scenes.append(SceneResult(name, hidden, Outcome.INCONCLUSIVE, OVER))
                continue
            jail = jail.within(jail.left())
            work = place / f"{task.id}-{number}".replace("/", "_")
            (work / "scratch").mkdir(parents=True, mode=0o711)
            size = write_scene(of, name, work / "scene")
            purpose = f"{task.id}/{of.label}/{digest if hidden else ''}"
            try:
                program = Program(
                    jail, submission.folder, command, work / "scene", name, size, task.id, work / "scratch"
                )
                if hidden and not program.reads_scene:
                    scenes.append(SceneResult(name, True, Outcome.FAIL, UNREADABLE))
                    continue
                scenes.append(self.judge(task, of, name, hidden, program, purpose))
                made = max(program.pictures.values(), key=len, default=[])
                scenes[-1].pictures = _pictures(made, of, secret=hidden)
            except RenderTimeout as error:
                scenes.append(SceneResult(name, hidden, Outcome.INCONCLUSIVE, str(error)))
            except (RenderError, NotFound) as error:
                scenes.append(SceneResult(name, hidden, Outcome.FAIL, str(error)))
        return self._points(task, scenes)

    def judge(
        self, task: Task, of: Variant, name: str, hidden: bool, program: Program | Simulated, purpose: str
    ) -> SceneResult:
        """One scene of a task, by as many looks as it takes; `purpose` decides the seeds."""
        limits = Limits(image=self.assignment.delta, tile=TILES * self.assignment.delta)
        started = time.perf_counter()

        def look(number: int, spp: int) -> Case:
            seed = self.keys.number(f"{purpose}/look {number}", hidden)
            label = of.label if of.canonical else of.path
            return verify(
                program, [label], seed=seed, spp=spp, jobs=1, limits=limits,
                timeout=self.assignment.limits.picture_seconds,
            ).cases[0]  # fmt: skip

        cases, spp = [look(0, task.spp)], task.spp
        open_ = cases[-1].verdict is Outcome.INCONCLUSIVE and cases[-1].more_samples and program.takes_spp
        if open_ and program.has_time(spp, MORE * spp, LOOK):
            spp = MORE * task.spp
            cases.append(look(1, spp))
        if cases[-1].verdict is Outcome.FAIL and cases[-1].bias is not None:
            cases.append(look(2, spp))
        last = cases[-1]
        if last.verdict is not Outcome.FAIL and program.takes_spp:
            stuck = self._stuck_noise(task.spp, of, hidden, program, purpose)
            last = replace(last, verdict=Outcome.FAIL, reason=stuck) if stuck else last
        found = _scene_result(name, hidden, last, len(cases))
        found.seconds = round(time.perf_counter() - started, 1)
        found.borderline = last.verdict is not Outcome.FAIL and any(c.verdict is Outcome.FAIL for c in cases)
        if last.verdict is Outcome.FAIL and task.lecture:
            found.mistake = lecture.argument(task.lecture)
        if task.noise_points and last.verdict is not Outcome.FAIL and program.takes_spp:
            compared = noise.compare(program.pictures[task.spp], of, task.spp, task.technique)
            found.noise = asdict(compared) if compared else None
        return found

    def _stuck_noise(self, spp: int, of: Variant, hidden: bool, program: Program, purpose: str) -> str | None:
        """What is wrong where {spp} changes nothing: four times the samples have a quarter of the noise."""
        many = MORE * spp
        if len(program.pictures.get(many, ())) < FEW_IMAGES:
            if not program.has_time(spp, many, FEW_IMAGES):
                return None
            key = f"{purpose}/{self.keys.number(purpose, hidden)}/samples"
            for seed in make_seeds(key, FEW_IMAGES):
                program.render(of.path, many, seed, self.assignment.limits.picture_seconds)
        truth = truth_of(references.load_reference(of))
        regions = truth.regions(spp)
        means = [region_means(np.stack(program.pictures[n]), regions) for n in (spp, many)]
        return checks.stuck_noise(means[0], spp, means[1], many)

    def _points(self, task: Task, scenes: list[SceneResult]) -> TaskResult:
        outcomes = [scene.verdict for scene in scenes]
        share = task.points / len(scenes)
        points = share * outcomes.count(Outcome.PASS)
        waiting = share * outcomes.count(Outcome.INCONCLUSIVE)
        verdict = next((o for o in (Outcome.FAIL, Outcome.INCONCLUSIVE) if o in outcomes), Outcome.PASS)
        quiet = 0.0
        comment = ""
        if task.noise_points:
            noisy = [s for s in scenes if s.noise and s.noise["low"] > task.noise_limit]
            judged = [s for s in scenes if s.noise]
            quiet = task.noise_points if judged and not noisy and verdict is not Outcome.FAIL else 0.0
            comment = _noise_comment(task, noisy or judged, bool(noisy))
        if self.assignment.inconclusive != REVIEW:
            points += float(self.assignment.inconclusive) * waiting
            waiting = 0.0
        return TaskResult(
            task.id, task.heading, task.lecture, verdict, round(points + quiet, 4), round(waiting, 4),
            task.most, scenes, quiet, task.hint if verdict is not Outcome.PASS else "", comment,
        )  # fmt: skip


def picture_pool(assignment: Assignment, keys: Keys, task: Task) -> list[Variant]:
    """The variants of which each student gets one to hand in pictures of."""
    folder, of = private_folder(assignment.path) / "pool", assignment.scene(task.scenes[0])
    return [pool_variant(of, index, keys, folder) for index in range(task.variants)]


def _scene_result(name: str, hidden: bool, case: Case, looks: int) -> SceneResult:
    figures = (case.bias, case.bias_low, case.bias_high, case.mde_image, case.more_samples)
    reason = case.reason.removesuffix(OPTION)
    return SceneResult(name, hidden, case.verdict, reason, *map(_finite, figures), case.spp, looks)


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def _noise_comment(task: Task, scenes: list[SceneResult], noisy: bool) -> str:
    if not scenes:
        return "noise not compared: the scene does not pass, or the run command takes no {spp}"
    worst = max(scenes, key=lambda s: s.noise["ratio"]).noise
    interval = f"{worst['low']:.3g} … {worst['high']:.3g}"
    figures = f"{worst['ratio']:.3g} times the variance ({interval}) of oneray's {task.technique}"
    limit = f"up to {task.noise_limit:g} times earn the {task.noise_points:g} points for noise"
    return f"{'too noisy: ' if noisy else ''}a sample has {figures}; {limit}"


def _pictures(made: list[Array], of: Variant, secret: bool) -> list[dict[str, str]]:
    """The mean of what was rendered, the reference where it is no secret, and where they differ."""
    if not made:
        return []
    truth = truth_of(references.load_reference(of))
    images = np.stack(made)
    mean = images.mean(axis=0)
    factor = pictures.exposure(truth.mean)
    shown = [(mean, f"your mean of {len(made)} pictures")]
    if not secret:
        shown.append((truth.mean, "what it should be"))
    own = images.var(axis=0, ddof=1) / len(images) if len(images) > 1 else truth.sample_variance
    result = [{"uri": pictures.data_uri(pictures.display(p, factor)), "caption": c} for p, c in shown]
    map_ = pictures.error_map(mean, truth.mean, np.sqrt(own + truth.variance))
    return [*result, {"uri": pictures.data_uri(map_), "caption": "where: blue is too dark, red too bright"}]
