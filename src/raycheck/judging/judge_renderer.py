"""One case: a renderer's pictures of a scene, made with many seeds and judged."""

import hashlib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from functools import partial

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.errors import CannotRender, NotFound, RenderError, RenderLate, RenderTimeout
from raycheck.base.text import percent
from raycheck.judging import checks
from raycheck.judging.agenda import Task, kept_scene
from raycheck.judging.cases import Case
from raycheck.judging.checks import Broken, check_contract
from raycheck.judging.conclusion import case_maker, conclude, figures, gross_mistake, measured, template_name
from raycheck.judging.looks import Look, look
from raycheck.judging.plan import Goals, Pilot, Plan, measure_pilot, pace, plan, reached
from raycheck.judging.settings import (
    BATCHES,
    MOST_SPP,
    PILOT_IMAGES,
    PILOT_SPP,
    TIMING_SEEDS,
    TIMING_STEP,
    Settings,
    case_seeds,
)
from raycheck.renderers.renderer import Rendering
from raycheck.stats.tiles import SMALLEST, region_means
from raycheck.stats.verdict import ALPHA, Judgement, Outcome, judge
from raycheck.truth.expected import Truth
from raycheck.truth.provenance import provenance

METHOD = 1
"""Version of how pictures are judged, see truth.provenance."""


def judge_task(task: Task, truth: Truth, taken: range, settings: Settings) -> Case:
    """Render and judge one case; `taken` are the seeds of the reference. Raises CannotRender where the
    renderer says that it cannot render the scene.
    """
    case = maker(task, truth)
    technique = f"{task.technique}/look {settings.look}" if settings.look else task.technique
    seeds = case_seeds(task.label, technique, settings.seed, taken)

    def judging() -> Case:
        with pool_of(settings.jobs) as pool:
            return _judge_renders(Renders(task, truth, settings, pool), seeds, case)

    return ended(judging, task, case)


@dataclass(frozen=True)
class Planned:
    """What a case will take."""

    task: Task
    spp: int
    seconds: float


def plan_to_detect(task: Task, truth: Truth, taken: range, settings: Settings) -> Planned:
    """The samples that show a bias of `settings.detect`, by a probe and a pilot as a verdict begins with;
    NotFound where none can, RenderError.
    """
    goals = Goals(settings.detect)
    if not task.renderer.takes_spp:
        raise NotFound("--detect plans samples: the renderer command takes no {spp}")
    seeds = case_seeds(task.label, task.technique, settings.seed, taken)
    with pool_of(settings.jobs) as pool:
        renders = Renders(task, truth, settings, pool)
        _, [probe] = renders.render(1, seeds[:1])
        images, made = renders.render(PILOT_SPP, seeds[1 : 1 + PILOT_IMAGES])
        times = {1: probe.seconds, PILOT_SPP: min(one.seconds for one in made)}
        pilot, chosen = renders.plan(
            measure_pilot(images, PILOT_SPP, truth, times), times, seeds[-TIMING_SEEDS:]
        )
    if not reached(pilot, truth, BATCHES, goals, settings.limits, chosen):
        noisy = f"not even {chosen.spp} samples per pixel would show it, or its reference is too noisy"
        raise NotFound(
            f"--detect {percent(settings.detect or 0.0)} on {task.label}, {task.technique}: {noisy}"
        )
    return Planned(task, chosen.spp, 2 * BATCHES * pilot.seconds(chosen.spp) / settings.jobs)


def maker(task: Task, truth: Truth) -> Callable[..., Case]:
    """As `case_maker` gives it, with what the verdict on this task rests on."""
    rests = provenance(METHOD, [f"{task.label} {task.technique} auto", f"reference {task.label}"])
    return case_maker(task.label, task.technique, truth, unbounded=task.unbounded, provenance=rests)


def ended(judging: Callable[[], Case], task: Task, case: Callable[..., Case]) -> Case:
    """What was judged, or the case that an error of the renderer is; CannotRender is raised on."""
    try:
        return judging()
    except Broken as error:
        return case(Outcome.FAIL, str(error))
    except RenderTimeout as error:
        return case(Outcome.INCONCLUSIVE, f"{error}; --timeout SECONDS allows more")
    except RenderLate as error:
        return case(Outcome.FAIL, str(error), late=True)
    except CannotRender:
        raise
    except RenderError as error:
        return case(Outcome.FAIL, kept_scene(task, str(error)))


@contextmanager
def pool_of(jobs: int) -> Iterator[ThreadPoolExecutor | None]:
    """A thread pool that drops what is waiting as soon as something goes wrong; none for a single job, which
    this thread does.
    """
    if jobs == 1:
        yield None
        return
    pool = ThreadPoolExecutor(jobs)
    try:
        yield pool
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


@dataclass
class Renders:
    """The renders of one case: each goes through the plain checks, and no two may be the same."""

    task: Task
    truth: Truth
    settings: Settings
    pool: ThreadPoolExecutor | None
    labels: list[str] = field(default_factory=list)
    digests: list[str] = field(default_factory=list)

    def render(self, spp: int, seeds: Sequence[int]) -> tuple[Array, list[Rendering]]:
        """Images of some seeds, (B, H, W, 3)."""
        task, truth, timeout = self.task, self.truth, self.settings.timeout
        each = self.pool.map if self.pool else map
        made = list(each(lambda s: _render(task, truth, spp, s, timeout), seeds))
        first = len(self.labels)
        self.labels.extend(
            f"seed {seed}" if task.renderer.takes_seed else f"run {first + i}" for i, seed in enumerate(seeds)
        )
        self.digests.extend(checks.digest(m.image) for m in made)
        return np.stack([m.image.pixels for m in made]), made

    def check_seeds(self) -> None:
        problem = checks.seed_problem(self.digests, self.labels, self.truth.varies)
        if problem:
            hint = "; without {seed} in the command runs must differ by themselves"
            raise Broken(problem + ("" if self.task.renderer.takes_seed else hint))

    def look(self, images: Array) -> Look:
        return look(template_name(self.task.of), images, self.truth, self.task.content.lights)

    def noise_problem(self, few: Array, both: Array, spp: int | None, pilot: Pilot) -> str | None:
        """What is wrong with the noise of both sets (B, H, W, 3) beside that of the pilot's `few` images."""
        if not self.task.independent:
            return None
        problem = checks.shared_noise(both, self.task.content.filtered)
        if spp is None or problem:
            return problem
        tame = self.truth.regions(PILOT_SPP, pilot.skewness)
        return checks.stuck_noise(region_means(few, tame), PILOT_SPP, region_means(both, tame), spp)

    def capped(self, found: Judgement, seeds: Sequence[int]) -> str:
        """The end of the sentence of a FAIL whose samples seem to be clamped."""
        dark = found.outcome is Outcome.FAIL and found.bias_high < 0
        if not dark or not self.task.renderer.takes_spp:
            return ""
        singles, _ = self.render(1, seeds)
        told = checks.capped_samples(singles, self.truth, self.task.content.radiances)
        return f"; {told}" if told else ""

    def plan(self, pilot: Pilot, times: dict[int, float], seeds: Sequence[int]) -> tuple[Pilot, Plan]:
        """How many samples to take, and the pilot with times from nearer to them."""
        chosen = _affordable(pilot, self.truth, self.settings, self.task.unbounded)
        for seed in seeds:
            nearer = TIMING_STEP * max(times)
            if chosen.spp <= nearer:
                break
            times[nearer] = self.render(nearer, [seed])[1][0].seconds
            start, each = pace(times)
            pilot = replace(pilot, start_seconds=start, sample_seconds=each)
            chosen = _affordable(pilot, self.truth, self.settings, self.task.unbounded)
        return pilot, chosen


def _judge_renders(renders: Renders, seeds: list[int], case: Callable[..., Case]) -> Case:
    """A probe of one sample, a pilot that plans, two sets of images; plain checks come before statistics."""
    truth, settings = renders.truth, renders.settings
    fixed = not renders.task.renderer.takes_spp
    _, probe = renders.render(1, seeds[:1])
    fingerprint = fingerprint_of(renders.task, renders.digests[0], truth, settings)
    if fingerprint in settings.earlier:
        return settings.earlier[fingerprint]
    case = partial(case, fingerprint=fingerprint)
    first_spp = 1 if fixed else PILOT_SPP
    pilot_images, pilot_made = renders.render(first_spp, seeds[1 : 1 + PILOT_IMAGES])
    renders.check_seeds()
    mistake = gross_mistake(pilot_images, truth, renders.look(pilot_images))
    if mistake:
        return case(Outcome.FAIL, mistake, spp=None if fixed else first_spp, images=PILOT_IMAGES)
    times = {1: probe[0].seconds, first_spp: min(m.seconds for m in pilot_made)}
    pilot = measure_pilot(pilot_images, None if fixed else first_spp, truth, times)
    smallest, spp = SMALLEST, None if fixed else settings.spp
    if not fixed and not settings.spp:
        pilot, chosen = renders.plan(pilot, times, seeds[-TIMING_SEEDS:])
        smallest, spp = chosen.smallest, chosen.spp
        if not renders.task.independent:
            # The variance falls faster than 1/spp: the plan, which takes it as 1/spp, errs on the safe side
            # from the pilot's samples on, and expects too little noise below.
            spp = max(spp, PILOT_SPP)

    quantum = probe[0].image.quantum if probe[0].image.precision != "float" else None
    regions = truth.regions(spp or 1, pilot.skewness, smallest)
    second = 1 + PILOT_IMAGES + BATCHES
    set_a, _ = renders.render(spp or 1, seeds[1 + PILOT_IMAGES : second])
    set_b, _ = renders.render(spp or 1, seeds[second : second + BATCHES])
    renders.check_seeds()
    both = np.concatenate([set_a, set_b])
    problem = renders.noise_problem(pilot_images, both, spp, pilot)
    if problem:
        return case(Outcome.FAIL, problem, spp=spp, images=2 * BATCHES)
    means = region_means(both, regions)
    residuals = means - region_means(truth.mean, regions)
    noise = pilot.noise if fixed else max(pilot.noise, 1.0)
    expected = truth.expected(regions, (spp or 1) / noise, quantum)
    found = judge(residuals[:BATCHES], residuals[BATCHES:], expected, settings.limits, settings.alpha)
    seconds = 2 * BATCHES * pilot.seconds(spp or 1) / settings.jobs
    found, sentence = conclude(
        found, regions, partial(renders.look, both), precision=probe[0].image.precision, seconds=seconds
    )
    sentence += renders.capped(found, seeds[1 : 1 + PILOT_IMAGES])
    beside = measured([(residuals[:, 0], 1)], both, truth, spp or 1, pilot.sample_seconds)
    return case(found.outcome, sentence, spp=spp, images=2 * BATCHES, **figures(found, regions), **beside)


def fingerprint_of(task: Task, picture: str, truth: Truth, settings: Settings) -> str:
    what = (METHOD, task.label, task.technique, picture, truth.digest)
    how: tuple[object, ...] = (settings.thorough, settings.seed, settings.spp, asdict(settings.limits))
    if settings.repeated or settings.alpha != ALPHA:
        how = (*how, settings.repeated, settings.alpha)
    return hashlib.blake2b(repr((what, how)).encode(), digest_size=16).hexdigest()


def _render(task: Task, truth: Truth, spp: int, seed: int, timeout: float) -> Rendering:
    made = task.renderer.render(task.path, spp, seed, timeout)
    check_contract(made.image, truth, f"seed {seed}" if task.renderer.takes_seed else "")
    return made


def _affordable(pilot: Pilot, truth: Truth, settings: Settings, unbounded: bool) -> Plan:
    """Samples per pixel: what the goals need, at most what the time allows."""

    def most(seconds: float) -> int:
        each = seconds * settings.jobs / (2 * BATCHES)
        if pilot.sample_seconds <= 0 or seconds == np.inf:
            return MOST_SPP
        return int(np.clip((each - pilot.start_seconds) / pilot.sample_seconds, 1, MOST_SPP))

    wishes = [(goals, most(seconds)) for goals, seconds in settings.wishes(truth, unbounded)]
    return plan(pilot, truth, BATCHES, wishes, settings.limits)
