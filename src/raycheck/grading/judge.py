"""Verdicts and points for one submission.

Where noise leaves a verdict open, fresh samples follow until they decide or the time for them is over, at a
level that holds however often one looks. A FAIL by statistics counts only when fresh samples, looked at anew,
confirm it: each has a chance of 1e-5 of being wrong, both together 1e-10. What needs no statistics (no
picture, a wrong size, seeds that change nothing) counts at once.
"""

import hashlib
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.errors import CannotRender, RenderError, RenderLate, RenderTimeout
from raycheck.base.images import Image
from raycheck.base.seeds import make_seeds
from raycheck.grading import handed_in, noise, points, speed
from raycheck.grading.assignment import PICTURES, Assignment, Task
from raycheck.grading.hidden import hidden_variants, pool_index, pool_variant, with_reference
from raycheck.grading.jail import folders
from raycheck.grading.jail.pixels import Decoder
from raycheck.grading.jail.sandbox import GRADING, Jail, Tier, best_tier
from raycheck.grading.keys import Keys, digest_of, private_folder, read_keys
from raycheck.grading.program import OVER, Program, Tried, build, write_scene
from raycheck.grading.results import NOT_EXECUTED, SceneResult, StudentResult, TaskResult, failed_everything
from raycheck.grading.shown import pictures_of, scene_result
from raycheck.grading.submission import Submission, SubmissionError, open_submission
from raycheck.judging import checks
from raycheck.judging.agenda import Task as ToJudge
from raycheck.judging.cases import Case
from raycheck.judging.judge_images import judge_pictures
from raycheck.judging.repeated import Repeated, judge_until
from raycheck.judging.settings import Settings
from raycheck.renderers import builds
from raycheck.renderers.manifest import MANIFEST
from raycheck.scene import export, lecture
from raycheck.scene.variants import Variant
from raycheck.stats.tiles import region_means
from raycheck.stats.verdict import Limits, Outcome
from raycheck.truth import references
from raycheck.truth.expected import truth_of

TILES = Limits.tile / Limits.image
UNREADABLE = "the run command takes neither {scene} nor {json}: it cannot render a scene unknown to it"
STORED = (
    "it shows the scene as it is published where another is given: its picture is stored, or its scene is in "
    "the source and the run command should take {name} in place of {scene} or {json}"
)
UNPROVEN = {
    Outcome.INCONCLUSIVE: "the picture is right, none of its hidden variants was decided, its points wait",
    Outcome.FAIL: "the picture is right, and of its hidden variants none is; the points wait for a look",
    Outcome.SKIP: "the picture is right; its hidden variants were refused, and the points wait for a look",
}
"""Why points of a published scene are open, by what became of its hidden variants."""
OTHER = "the pictures show another student's variant of the scene, not yours"
PUBLISHED = "the pictures show the scene as it is published, not your variant of it"
NOT_TRIED = {
    Outcome.FAIL: "not tried: the scene itself fails",
    Outcome.SKIP: "not tried: the program does not support the scene itself",
}
FEW_IMAGES = 8
MORE = 4
"""Times the samples, which show the same picture with a quarter of the noise."""
FURTHER = 0.5
"""Part of the time for further looks until one decides; the rest is for confirming it."""
HOPELESS = 4.0
"""Times the time there is: where it is said that so much would decide, no further look is begun."""


@dataclass(frozen=True)
class Grader:
    """An assignment, ready to grade: its keys, and its scenes with their hidden variants."""

    assignment: Assignment
    keys: Keys
    scenes: dict[str, list[tuple[Variant, str, Variant | None]]]
    """Scenes by task: what is rendered, its name, and the scene that it varies if it is a hidden variant."""
    tier: Tier | None
    """None: the strongest that works where it is graded."""
    seconds: float = math.inf
    """How long the whole of one submission may take."""

    @classmethod
    def prepare(cls, assignment: Assignment, tier: Tier | None) -> "Grader":
        """Make the hidden variants' references where they are missing, which takes a minute for each, and
        measure oneray's noise.
        """
        keys = read_keys(assignment.path, assignment.name)
        folder = private_folder(assignment.path) / "scenes"
        scenes: dict[str, list[tuple[Variant, str, Variant | None]]] = {}
        for task in assignment.tasks:
            scenes[task.id] = []
            for name in task.scenes:
                of = assignment.scene(name)
                scenes[task.id].append((of, of.label, None))
                hidden = hidden_variants(of, task.hidden, keys, folder, assignment.delta)
                scenes[task.id] += [(one, of.label, of) for one in hidden]
            for of, _, _ in scenes[task.id] if task.technique else ():
                noise.of_oneray(of, task.spp, task.technique, private_folder(assignment.path))
        return cls(assignment, keys, scenes, tier)

    def grade(self, path: Path, student: str, slot: int = GRADING) -> StudentResult:
        """Everything about one submission; never raises for what a submission does."""
        started = time.perf_counter()
        jail = Jail(self.tier or best_tier(), self.assignment.limits, slot, started + self.seconds)
        with folders.temporary("raycheck-grade-") as place:
            try:
                result = self._grade(path, student, jail, place)
            except SubmissionError as error:
                result = failed_everything(self.assignment, student, str(error), jail.describe())
        result.seconds = round(time.perf_counter() - started, 1)
        return result

    def _grade(self, path: Path, student: str, jail: Jail, place: Path) -> StudentResult:
        unpacked = place / "submission"
        unpacked.mkdir(mode=0o755)
        submission = open_submission(path, unpacked, jail.user)
        digest = digest_of(unpacked)
        command = "" if submission.pictures_alone else submission.manifest.command or self.assignment.run
        if not command and not submission.pictures_alone:
            raise SubmissionError('there is no command: write command = "…" into raycheck.toml')
        to_build = submission.manifest.build
        to_build = self.assignment.build if to_build is None else to_build
        problem = build(jail, submission.folder, to_build) if command else ""
        if problem:
            result = failed_everything(self.assignment, student, problem, jail.describe())
        else:
            with Decoder(jail.user) as decoder:
                scenes = sum(map(len, self.scenes.values()))
                refresh = _keep(unpacked) if command else lambda: None
                attempt = Attempt(
                    student, submission, command, digest, jail, place, decoder, refresh, scenes
                )  # fmt: skip
                tasks = [
                    self._pictures(task, attempt)
                    if task.accepts == PICTURES and submission.pictures(task.id)
                    else self._task(task, attempt)
                    for task in self.assignment.tasks
                ]
            result = StudentResult(student, self.assignment.name, tasks, jail.describe())
        result.digest, result.state = digest, self.state(digest)
        return result

    def _pictures(self, task: Task, attempt: "Attempt") -> TaskResult:
        """Judge pictures that were handed in."""
        started = time.perf_counter()
        student, files = attempt.student, attempt.submission.pictures(task.id)
        of = self.assignment.scene(task.scenes[0])
        pool = picture_pool(self.assignment, self.keys, task)
        own = pool[pool_index(of, student, task.variants, self.keys)]
        others = [(one, OTHER) for one in pool if one != own] + [(of, PUBLISHED)]
        entry = references.require(of)
        most, size = self.assignment.limits.output_mb << 20, (entry["height"], entry["width"])
        name = f"{of.label} (variant of {student})"
        try:
            case, images = handed_in.judge(files, own, others, self.finds, most, size, attempt.decoder)
            scene = scene_result(name, False, case, 1, size)
            scene.pictures = pictures_of(images, own, secret=True)
        except RenderError as error:
            scene = SceneResult(name, False, Outcome.FAIL, str(error))
        scene.seconds = round(time.perf_counter() - started, 1)
        result = points.earned(self.assignment, task, [scene], executed=False)
        many = f"{len(files)} picture{'s' if len(files) > 1 else ''} handed in"
        noisy = ", which earn no points for noise" if task.noise_points > 0 else ""
        result.comment = f"{NOT_EXECUTED}: judged by {many}{noisy}"
        return result

    def state(self, digest: str) -> str:
        """A digest of a submission and of all that it is graded by, wherever that is."""
        asked = replace(self.assignment, path=Path())
        scenes = [references.require(of) for every in self.scenes.values() for of, _, _ in every]
        programs = builds.raycheck_hash(), builds.oneray_hash() if self.compares else ""
        what = (programs, asked, scenes, self.keys.secret.hex(), self.tier, digest)
        return hashlib.sha256(repr(what).encode()).hexdigest()

    @property
    def finds(self) -> Limits:
        """What the judge looks for."""
        return Limits(image=self.assignment.delta, tile=TILES * self.assignment.delta)

    @property
    def compares(self) -> bool:
        """Whether a task compares with oneray, in noise or speed."""
        return any(task.technique for task in self.assignment.tasks)

    def _task(self, task: Task, attempt: "Attempt") -> TaskResult:
        if not attempt.command:
            what = f"pictures/{task.id}, which is empty" if task.accepts == PICTURES else "a program"
            nothing = SceneResult(task.scenes[0], False, Outcome.FAIL, f"this task asks for {what}")
            return points.earned(self.assignment, task, [nothing])
        scenes: list[SceneResult] = []
        for number, (of, name, varies) in enumerate(self.scenes[task.id]):
            share = attempt.jail.left() / attempt.waiting
            attempt.waiting -= 1
            before = scenes[-1].verdict if varies else None
            if before is Outcome.FAIL or before is Outcome.SKIP:
                scenes.append(SceneResult(name, True, before, NOT_TRIED[before]))
            elif attempt.jail.left() <= 0:
                reason = f"{OVER} before this scene"
                scenes.append(SceneResult(name, bool(varies), Outcome.INCONCLUSIVE, reason))
            else:
                work = attempt.place / f"{task.id}-{number}".replace("/", "_")
                scenes.append(self._scene(task, of, name, varies, attempt, work, share))
        _doubt(scenes)
        return points.earned(self.assignment, task, scenes)

    def _scene(
        self, task: Task, of: Variant, name: str, varies: Variant | None, attempt: "Attempt", work: Path,
        share: float,
    ) -> SceneResult:  # fmt: skip
        """The program on one scene, in the new folder `work`; `share` are the seconds that further looks may
        take from other scenes.
        """
        hidden = varies is not None
        (work / "scratch").mkdir(parents=True, mode=0o711)
        size = write_scene(of, name, work / "scene")
        own = attempt.submission.manifest
        lacks = own.needs.lacks(export.export(of)["needs"]) if own.needs else []
        if lacks:
            reason = f"needs {' and '.join(lacks)}, which {MANIFEST} does not name"
            return SceneResult(name, hidden, Outcome.SKIP, reason)
        purpose = f"{task.id}/{of.label}/{attempt.digest if hidden else ''}"
        jail = attempt.jail.within(attempt.jail.left(), own.limits.picture_seconds)
        try:
            program = Program(
                jail, attempt.submission.folder, attempt.command, work / "scene", name, size, task.id,
                work / "scratch", attempt.decoder, attempt.refresh,
            )  # fmt: skip
            if hidden and not program.reads_scene:
                return SceneResult(name, True, Outcome.INCONCLUSIVE, UNREADABLE)
            found = self.judge(task, of, name, hidden, program, purpose, share)
            made = max(program.pictures.values(), key=len, default=[])
            found.pictures = pictures_of(made, of, secret=hidden)
            if varies and found.verdict is Outcome.FAIL and made and self._stored(made, varies, of):
                found.stored, found.reason, found.mistake = True, STORED, ""
            if task.measures_speed and found.verdict is Outcome.PASS:
                found.speed, wrong = self._speed(task, of, program, purpose)
                if wrong:
                    found.verdict, found.reason = Outcome.FAIL, wrong
        except RenderTimeout as error:
            found = SceneResult(name, hidden, Outcome.INCONCLUSIVE, str(error))
        except CannotRender as error:
            found = SceneResult(name, hidden, Outcome.SKIP, str(error))
        except RenderError as error:
            found = SceneResult(name, hidden, Outcome.FAIL, str(error))
        found.secret = hidden
        return found

    def judge(
        self, task: Task, of: Variant, name: str, hidden: bool, program: Tried, purpose: str,
        share: float = math.inf,
    ) -> SceneResult:  # fmt: skip
        """One scene of a task, by as many looks as it takes; `purpose` decides the seeds, and beyond `share`
        seconds no further look is begun.
        """
        started = time.perf_counter()
        reference = references.load_reference(of)
        truth, taken = truth_of(reference), set(reference.seeds)

        def looked(what: str, share: float) -> Case:
            """The verdict of looks with seeds of their own, the first whatever time is left."""
            settings = Settings(
                seed=self.keys.number(f"{purpose}/{what}", hidden), spp=task.spp, jobs=1, limits=self.finds,
                timeout=self.assignment.limits.picture_seconds, clock=lambda: program.spent, times=False,
            )  # fmt: skip
            one = Repeated(ToJudge(of, "renderer", program, of.path), truth, taken, settings, steady=True)
            case, ends = one.look(), min(program.limits.task_seconds, share)
            if one.open and (case.more_seconds or math.inf) < HOPELESS * ends:
                judge_until([one], ends, lambda _: None)
            assert one.case
            return one.case

        tried = [looked("look 0", FURTHER * min(program.limits.task_seconds, share))]
        if tried[0].verdict is Outcome.FAIL and tried[0].bias is not None:
            tried.append(looked("confirmed", share))
        last = tried[-1]
        enough = program.takes_spp and len(program.pictures.get(task.spp, ())) >= FEW_IMAGES
        if last.verdict is not Outcome.FAIL and enough:
            wrong = self._many_samples(task.spp, of, program, purpose)
            last = replace(last, verdict=Outcome.FAIL, reason=wrong) if wrong else last
        found = scene_result(name, hidden, last, sum(case.looks for case in tried), truth.shape)
        found.seconds = round(time.perf_counter() - started, 1)
        found.borderline = last.verdict is not Outcome.FAIL and len(tried) > 1
        if last.verdict is Outcome.FAIL and task.lecture:
            found.mistake = lecture.argument(task.lecture)
        made = program.pictures.get(task.spp if program.takes_spp else 1, ())
        if task.technique and found.verdict is not Outcome.FAIL and len(made) >= FEW_IMAGES:
            kept = private_folder(self.assignment.path)
            compared = noise.compare(made, of, task.spp, task.technique, kept)
            if compared and compared.doubt and found.verdict is Outcome.PASS:
                found.verdict, found.reason = Outcome.INCONCLUSIVE, compared.doubt
            found.noise = asdict(compared) if compared and task.shows_noise and program.takes_spp else None
        return found

    def _stored(self, made: Sequence[Array], published: Variant, of: Variant) -> bool:
        """Whether these pictures, which should show `of`, can be of the scene that it varies."""
        if not handed_in.shows_rather(np.mean(made, axis=0), published, of):
            return False
        images, names = [Image(pixels) for pixels in made], [str(number) for number in range(len(made))]
        return judge_pictures(published, images, names, self.finds).verdict is not Outcome.FAIL

    def _speed(
        self, task: Task, of: Variant, program: Program, purpose: str
    ) -> tuple[dict[str, Any] | None, str]:  # fmt: skip
        """How fast it is, with the samples of a longer look where there is time: the less weighs the
        program's start. Not at all where even a picture of fewer is late. And what is wrong with the pictures
        whose time was taken: they are judged as all others.
        """
        spp = task.spp
        longer = program.takes_spp and program.has_time(spp, MORE * spp, speed.PAIRS)
        seeds = make_seeds(f"{purpose}/{self.keys.number(purpose, hidden=True)}/speed", speed.PAIRS)
        for samples in (MORE * spp, spp) if longer else (spp,):
            try:
                compared, made = speed.compare(program, samples, task.technique, seeds)
                return asdict(compared) if compared else None, self._wrong(made, of)
            except (RenderLate, RenderTimeout):
                continue
        return None, ""

    def _wrong(self, made: Sequence[Array], of: Variant) -> str:
        """What is wrong with these pictures, where each half of them shows it; empty if nothing is."""
        half, wrong = len(made) // 2, ""
        for part in (made[:half], made[half:]):
            images, names = [Image(pixels) for pixels in part], [str(number) for number in range(len(part))]
            case = judge_pictures(of, images, names, self.finds) if len(part) > 1 else None
            if case is None or case.verdict is not Outcome.FAIL:
                return ""
            wrong = f"of the pictures whose time was taken: {case.reason}"
        return wrong

    def _many_samples(self, spp: int, of: Variant, program: Tried, purpose: str) -> str | None:
        """What is wrong with four times the samples: they show the same picture with a quarter of the noise.
        No program knows these seeds.
        """
        many = MORE * spp
        if len(program.pictures.get(many, ())) < FEW_IMAGES:
            if not program.has_time(spp, many, FEW_IMAGES):
                return None
            key = f"{purpose}/{self.keys.number(purpose, hidden=True)}/samples"
            try:
                for seed in make_seeds(key, FEW_IMAGES):
                    program.render(of.path, many, seed, self.assignment.limits.picture_seconds)
            except (RenderLate, RenderTimeout):
                return None
        truth = truth_of(references.load_reference(of))
        regions = truth.regions(spp)
        means = [region_means(np.stack(program.pictures[n]), regions) for n in (spp, many)]
        problem = checks.stuck_noise(means[0], spp, means[1], many)
        return problem or checks.another_picture(means[0][:, 0], spp, means[1][:, 0], many)


def _doubt(scenes: Sequence[SceneResult]) -> None:
    """A right picture of a published scene may be a stored one: the hidden variants that follow tell."""
    variants: list[SceneResult] = []
    for scene in reversed(scenes):
        if scene.hidden:
            variants.append(scene)
            continue
        unproven = variants and not any(one.verdict is Outcome.PASS for one in variants)
        if any(one.stored for one in variants):
            scene.verdict, scene.reason = Outcome.FAIL, STORED
        elif unproven and scene.verdict is Outcome.PASS:
            outcomes = {one.verdict for one in variants}
            scene.verdict = Outcome.INCONCLUSIVE
            scene.reason = next(UNPROVEN[outcome] for outcome in UNPROVEN if outcome in outcomes)
        variants = []


@dataclass
class Attempt:
    """A submission that was built, with the places where it is tried."""

    student: str
    submission: Submission
    command: str
    digest: str
    jail: Jail
    place: Path
    decoder: Decoder
    refresh: Callable[[], None]
    """Makes the submission's folder as its build left it."""
    waiting: int
    """Scenes that were not tried yet."""


def _keep(folder: Path) -> Callable[[], None]:
    """Keep a submission as its build left it, and make its folder anew from that: what a picture read, and
    when, is not to be seen by the next, neither by times nor by what is still in memory.
    """
    kept = folder.with_name("kept")
    folder.rename(kept)
    kept.chmod(0o700)

    def refresh() -> None:
        folders.remove(folder)
        folder.mkdir(mode=0o755)
        folders.copy(kept, folder)

    refresh()
    return refresh


def make_picture_references(assignment: Assignment, keys: Keys, task: Task, students: Sequence[str]) -> None:
    """Make references of the variants of which these students hand in pictures."""
    of, pool = assignment.scene(task.scenes[0]), picture_pool(assignment, keys, task)
    for index in sorted({pool_index(of, student, task.variants, keys) for student in students}):
        with_reference(pool[index], assignment.delta)


def picture_pool(assignment: Assignment, keys: Keys, task: Task) -> list[Variant]:
    """The variants, of which each student hands in pictures of one."""
    folder, of = private_folder(assignment.path) / "pool", assignment.scene(task.scenes[0])
    return [pool_variant(of, index, keys, folder) for index in range(task.variants)]
