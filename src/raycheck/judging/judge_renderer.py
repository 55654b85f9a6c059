"""One case: a renderer's pictures of a scene, made with many seeds and judged."""

import contextlib
import hashlib
import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from statistics import median
from typing import TypeVar

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.errors import CannotRender, NotFound, OutOfTime, RenderError, RenderLate, RenderTimeout
from raycheck.base.text import duration, percent
from raycheck.judging import checks
from raycheck.judging.agenda import Task, kept_scene
from raycheck.judging.cases import Case
from raycheck.judging.checks import Broken, check_contract
from raycheck.judging.conclusion import case_maker, conclude, figures, gross_mistake, measured, template_name
from raycheck.judging.looks import Look, look
from raycheck.judging.plan import Goals, Pilot, Plan, measure_pilot, more_needed, plan, reached
from raycheck.judging.settings import (
    BATCHES,
    MOST_SPP,
    PICTURES,
    PILOT_IMAGES,
    PILOT_SPP,
    TIMED_NEAR,
    TIMING_SEEDS,
    TIMING_STEP,
    Settings,
    case_seeds,
)
from raycheck.judging.timetable import FEWEST_SPP, FLUCTUATION, SEEN, case_seconds, pace, sample_seconds, seen
from raycheck.renderers.renderer import Rendering
from raycheck.stats.tiles import SMALLEST, region_means
from raycheck.stats.verdict import ALPHA, Judgement, Outcome, judge
from raycheck.truth.expected import Truth
from raycheck.truth.provenance import provenance

METHOD = 1
"""Version of how pictures are judged, see truth.provenance."""
AGAIN = 4
"""Noise that seems stuck is looked at again, with so many times fewer samples than were judged."""


def judge_task(task: Task, truth: Truth, taken: Collection[int], settings: Settings) -> Case:
    """Render and judge one case; `taken` are the seeds of the reference."""
    return judge_surveyed(survey(task, truth, taken, settings), settings)


@dataclass
class Survey:
    """A case whose first two pictures were rendered: what the others will take. Then its whole pilot."""

    renders: "Renders"
    seeds: Sequence[int]
    fingerprint: str = ""
    first: list[Rendering] = field(default_factory=list)
    """The probe, of one sample, and the first picture of the pilot."""
    images: list[Array] = field(default_factory=list)
    """Of the pilot so far, (B, H, W, 3)."""
    warm: float = math.nan
    """Seconds of the probe when it was made again: the first picture of all may have waited for a disk."""
    seconds: float = 0.0
    case: Case | None = None
    """The verdict, where it is known already."""
    pilot: Pilot | None = None
    """What the pilot shows, once all of it was rendered…"""
    typical: float = math.nan
    """…and the seconds of one of its pictures."""

    @property
    def task(self) -> Task:
        return self.renders.task

    @property
    def times(self) -> dict[int, float]:
        """Seconds of the pictures by samples per pixel. Of two probes it is the second's, which waited for no
        disk: the faster would be too fast.
        """
        probe, pilot = (made.seconds for made in self.first)
        spp, probe = self.renders.first_spp, probe if math.isnan(self.warm) else self.warm
        first = {1: probe, spp: pilot} if spp > 1 else {1: min(probe, pilot)}
        return first | ({} if math.isnan(self.typical) else {spp: self.typical})

    def make_again(self) -> None:
        """The probe, for its time."""
        if not self.case and self.renders.first_spp > 1 and math.isnan(self.warm):
            self.warm = self.renders.one(1, self.seeds[-1]).seconds

    def least(self, jobs: int, own: float, spp: int) -> float:
        """Seconds that the rest of the case takes, of `spp` samples per pixel where the plan may choose."""
        if self.case:
            return 0.0
        fixed = not self.task.renderer.takes_spp
        given = 1 if fixed else self.renders.settings.spp
        return case_seconds(self.times, given or spp, jobs, own, planned=given is None)


def survey(task: Task, truth: Truth, taken: Collection[int], settings: Settings) -> Survey:
    """Render the first two pictures of a case, one after the other. What they already show is its verdict: a
    plain mistake, SKIP where the renderer says that it does not support the scene, or an earlier run's.
    """
    renders = Renders(task, truth, settings, None)
    found = Survey(renders, look_seeds(task, settings, taken))
    started, case = settings.clock(), maker(task, truth, settings)

    def first_pictures() -> Case | None:
        _, found.first = renders.render(1, found.seeds[:1])
        found.fingerprint = _fingerprint(task, renders.digests[0], truth, settings)
        earlier = settings.earlier.get(found.fingerprint)
        if earlier and not (settings.repeated and earlier.verdict is Outcome.INCONCLUSIVE):
            return earlier
        images, made = renders.render(renders.first_spp, found.seeds[1:2])
        found.first, found.images = [*found.first, *made], [images]
        return None

    found.case = ended(first_pictures, task, case)
    found.seconds = settings.clock() - started
    return found


def look_seeds(task: Task, settings: Settings, taken: Collection[int]) -> list[int]:
    """The seeds of a case, or of a later look at it, which are none of those `taken`."""
    name = f"{task.technique}/look {settings.look}" if settings.look else task.technique
    return case_seeds(task.label, name, settings.seed, taken)


def take_pilot(found: Survey, case: Callable[..., Case]) -> Case | None:
    """Render the rest of the pilot and measure it, once; the verdict, where it shows a plain mistake."""
    if found.pilot:
        return None
    renders, fixed = found.renders, not found.task.renderer.takes_spp
    others, made = renders.render(renders.first_spp, found.seeds[2 : 1 + PILOT_IMAGES])
    images = np.concatenate([*found.images, others])
    found.images, found.typical = [images], median(one.seconds for one in made)
    renders.check_seeds()
    mistake = gross_mistake(images, renders.truth, renders.look(images))
    if mistake:
        return case(Outcome.FAIL, mistake, spp=None if fixed else renders.first_spp, images=PILOT_IMAGES)
    found.pilot = measure_pilot(images, None if fixed else renders.first_spp, renders.truth)
    return None


@dataclass(frozen=True)
class Planned:
    """What a case will take."""

    found: Survey
    spp: int = 0
    """Samples per pixel; none where the verdict is known already."""
    seconds: float = 0.0

    @property
    def task(self) -> Task:
        return self.found.task


def plan_to_detect(task: Task, truth: Truth, taken: Collection[int], settings: Settings) -> Planned:
    """The samples that show a bias of `settings.detect`, by the probe and the pilot of the verdict; NotFound
    where none can.
    """
    if not task.renderer.takes_spp:
        raise NotFound("--detect plans samples: the renderer command takes no {spp}")
    found, started = survey(task, truth, taken, settings), settings.clock()
    if found.case:
        return Planned(found)
    renders, chosen, times = found.renders, Plan(0, SMALLEST), found.times
    case = maker(task, truth, settings, found.seconds, fingerprint=found.fingerprint)

    def planning() -> Case | None:
        nonlocal chosen, times
        known = take_pilot(found, case)
        if found.pilot:
            found.make_again()
            times = found.times
            chosen = renders.plan(found.pilot, times, found.seeds[-TIMING_SEEDS:-1], math.inf)
        return known

    with pool_of(settings.jobs) as pool:
        renders.pool = pool
        found.case = ended(planning, task, case)
    found.seconds += settings.clock() - started
    if found.case or not found.pilot:
        return Planned(found)
    goals, of = Goals(settings.detect), (found.pilot, truth, BATCHES)
    if not reached(*of, goals, settings.limits, chosen.spp, chosen.smallest, alpha=settings.alpha):
        noisy = f"not even {chosen.spp} samples per pixel would show it, or its reference is too noisy"
        raise NotFound(f"--detect {percent(settings.detect or 0.0)} on {task.name}: {noisy}")
    return Planned(found, chosen.spp, PICTURES * pace(seen(times)).seconds(chosen.spp) / settings.jobs)


def judge_surveyed(found: Survey, settings: Settings) -> Case:
    """The verdict on a case that was surveyed."""
    if found.case:
        return found.case
    task, renders = found.task, found.renders
    case = maker(task, renders.truth, settings, found.seconds, fingerprint=found.fingerprint)
    with pool_of(settings.jobs) as pool:
        renders.settings, renders.pool = settings, pool
        return ended(lambda: _judge_renders(found, case), task, case)


def maker(
    task: Task, truth: Truth, settings: Settings, spent: float = 0.0, **known: str
) -> Callable[..., Case]:
    """As `case_maker` gives it, with what the verdict on this task rests on."""
    rests = provenance(METHOD, [f"{task.label} {task.technique} auto", f"reference {task.label}"])
    return case_maker(
        task.label, task.technique, truth, settings.clock, spent, unbounded=task.unbounded, provenance=rests,
        **known,
    )  # fmt: skip


Judged = TypeVar("Judged")


def ended(judging: Callable[[], Judged], task: Task, case: Callable[..., Case]) -> Judged | Case:
    """What was judged, or the case that an error of the renderer is."""
    try:
        return judging()
    except Broken as error:
        return case(Outcome.FAIL, str(error))
    except OutOfTime as error:
        return case(Outcome.INCONCLUSIVE, str(error))
    except RenderTimeout as error:
        return case(Outcome.INCONCLUSIVE, f"{error}; --timeout SECONDS allows more")
    except RenderLate as error:
        return case(Outcome.FAIL, str(error), late=True)
    except CannotRender as error:
        return case(Outcome.SKIP, str(error))
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
    there: list[float] = field(default_factory=list)
    """When each picture was there, by the clock, those for times alone among them."""
    most: int = 0
    """Of how many in all, once these are planned…"""
    each: float = 0.0
    """…and the seconds of one."""

    @property
    def first_spp(self) -> int:
        """Samples per pixel of the pilot."""
        return PILOT_SPP if self.task.renderer.takes_spp else 1

    def one(self, spp: int, seed: int) -> Rendering:
        """One image, before the time of the run is over."""
        settings, left = self.settings, self.settings.ends - self.settings.clock()
        if left <= 0:
            raise self.out_of_time()
        try:
            made = _render(self.task, self.truth, spp, seed, min(settings.timeout, left))
            self.there.append(settings.clock())
            return made
        except RenderTimeout:
            if left < settings.timeout:
                raise self.out_of_time() from None
            raise

    def out_of_time(self) -> OutOfTime:
        seconds, made = duration(self.settings.budget), len(self.there)
        done = f"the {seconds} of this run were over after {made} picture{'' if made == 1 else 's'}"
        if not self.most:
            return OutOfTime(done)
        more = duration((self.most - made) * self.each / self.settings.jobs)
        return OutOfTime(f"{done} of {self.most}; {more} more would do")

    def render(self, spp: int, seeds: Sequence[int]) -> tuple[Array, list[Rendering]]:
        """Images of some seeds, (B, H, W, 3)."""
        task = self.task
        each = self.pool.map if self.pool else map
        made = list(each(lambda seed: self.one(spp, seed), seeds))
        first = len(self.labels)
        self.labels.extend(
            f"seed {seed}" if task.renderer.takes_seed else f"run {first + i}" for i, seed in enumerate(seeds)
        )
        self.digests.extend(checks.digest(m.image) for m in made)
        images = np.stack([m.image.pixels for m in made])
        if self.settings.on_images:
            self.settings.on_images(task.label, task.technique, self.truth, spp, images)
        return images, made

    def check_seeds(self) -> None:
        problem = checks.seed_problem(self.digests, self.labels, self.truth.varies)
        if problem:
            hint = "; without {seed} in the command runs must differ by themselves"
            raise Broken(problem + ("" if self.task.renderer.takes_seed else hint))

    def look(self, images: Array) -> Look:
        return look(template_name(self.task.of), images, self.truth, self.task.content.lights)

    def alike(self, images: Array) -> float:
        """How much noise neighbouring pixels have in common, of a program of which nothing is known."""
        return checks.neighbours_noise(images) if self.task.swept and not self.task.content.filtered else 0.0

    def noise_problem(self, few: Array, both: Array, spp: int | None, pilot: Pilot) -> str | None:
        """What is wrong with the noise of both sets (B, H, W, 3) beside that of the pilot's `few` images."""
        if not self.task.independent:
            return None
        problem = checks.shared_noise(both, self.task.content.filtered)
        if spp is None or problem:
            return problem
        tame = self.truth.regions(PILOT_SPP, pilot.skewness)
        problem = checks.stuck_noise(region_means(few, tame), PILOT_SPP, region_means(both, tame), spp)
        less = spp // AGAIN
        if problem is None or less <= PILOT_SPP:
            return problem
        # Rare samples that the pilot's images lack make noise look as if it were stuck. Beside images that
        # have them, too, only noise that is stuck does.
        seeds = case_seeds(self.task.label, f"{self.task.technique}/again", self.settings.seed)
        again, _ = self.render(less, seeds[:PILOT_IMAGES])
        return checks.stuck_noise(region_means(again, tame), less, region_means(both, tame), spp)

    def capped(self, found: Judgement, seeds: Sequence[int]) -> str:
        """The end of the sentence of a FAIL whose samples seem to be clamped."""
        dark = found.outcome is Outcome.FAIL and found.bias_high < 0
        if not dark or not self.task.renderer.takes_spp:
            return ""
        singles, _ = self.render(1, seeds)
        told = checks.capped_samples(singles, self.truth, self.task.content.radiances)
        return f"; {told}" if told else ""

    def counted(
        self, found: Judgement, images: Array, pilot: Pilot, spp: int, samples: int, smallest: int = SMALLEST
    ) -> Judgement:
        """An INCONCLUSIVE judgement of so many `samples` of a pixel in a batch, with how many times these a
        PASS needs, by the noise of these images of `spp`.
        """
        if found.outcome is not Outcome.INCONCLUSIVE or math.isinf(found.more_samples):
            return found
        now = replace(pilot, sample_variance=spp * images.var(axis=0, ddof=1))
        more = more_needed(now, self.truth, BATCHES, self.settings.limits, samples, smallest)
        return replace(found, more_samples=max(found.more_samples, more))

    def plan(self, pilot: Pilot, times: dict[int, float], seeds: Sequence[int], until: float) -> Plan:
        """How many samples to take, so that the sets are there at `until` by the clock; `times` get those of
        pictures nearer to these. Where the start-up hides the pace of the pilot's samples, more show it.
        """
        chosen = self._affordable(pilot, times, until)
        for seed in seeds:
            most = max(times)
            hidden = most == PILOT_SPP and times[most] < SEEN * times[1]
            if chosen.spp <= TIMED_NEAR * most and not hidden:
                break
            spp = TIMING_STEP * most if hidden else min(TIMING_STEP * most, chosen.spp)
            times[spp] = self.render(spp, [seed])[1][0].seconds
            chosen = self._affordable(pilot, times, until)
        return chosen

    def time_more(self, times: dict[int, float], seeds: Sequence[int], spp: float) -> None:
        """Time pictures of more samples, up to `spp`, in the time that is left, until the pace of samples is
        seen beside the start-up.
        """
        with contextlib.suppress(OutOfTime, RenderTimeout):
            for seed in seeds:
                most = max(times)
                if most >= spp or most * TIMING_STEP > MOST_SPP or times[most] >= SEEN * min(times.values()):
                    break
                times[TIMING_STEP * most] = self.one(TIMING_STEP * most, seed).seconds

    def _affordable(self, pilot: Pilot, times: Mapping[int, float], until: float) -> Plan:
        """Samples per pixel: what the goals need, at most what the time allows."""
        settings, left = self.settings, until - self.settings.clock()
        fewest = 1 if settings.thorough else FEWEST_SPP

        def most(seconds: float) -> int:
            each = min(seconds, left) * settings.jobs / PICTURES
            return int(np.clip(pace(times).affordable(each), fewest, MOST_SPP))

        wished = settings.wishes(self.truth, self.task.unbounded)
        wishes = [(goals, most(seconds)) for goals, seconds in wished]
        return plan(pilot, self.truth, BATCHES, wishes, settings.limits, settings.alpha)


def _judge_renders(surveyed: Survey, case: Callable[..., Case]) -> Case:
    """A pilot that plans, two sets of images; plain checks come before statistics."""
    renders, seeds, probe = surveyed.renders, surveyed.seeds, surveyed.first[0].image
    truth, settings = renders.truth, renders.settings
    begun, spent = settings.clock(), surveyed.seconds
    until = math.inf if settings.thorough else begun + FLUCTUATION * settings.case_seconds
    fixed = not renders.task.renderer.takes_spp
    mistake = take_pilot(surveyed, case)
    if mistake:
        return mistake
    pilot = surveyed.pilot
    assert pilot
    smallest, spp = SMALLEST, None if fixed else settings.spp
    if not fixed and not settings.spp:
        surveyed.make_again()
    times = surveyed.times
    if not fixed and not settings.spp:
        chosen = renders.plan(pilot, times, seeds[-TIMING_SEEDS:-1], until)
        smallest, spp = chosen.smallest, chosen.spp
        if not renders.task.independent:
            # The variance falls faster than 1/spp: the plan, which takes it as 1/spp, errs on the safe side
            # from the pilot's samples on, and expects too little noise below.
            spp = max(spp, PILOT_SPP)

    quantum = probe.quantum if probe.precision != "float" else None
    regions = truth.regions(spp or 1, pilot.skewness, smallest)
    second = 1 + PILOT_IMAGES + BATCHES
    renders.most, renders.each = len(renders.there) + PICTURES, pace(times).seconds(spp or 1)
    started = settings.clock()
    if started + PICTURES * renders.each / settings.jobs > settings.ends:
        raise renders.out_of_time()
    set_a, made_a = renders.render(spp or 1, seeds[1 + PILOT_IMAGES : second])
    set_b, made_b = renders.render(spp or 1, seeds[second : second + BATCHES])
    rendered = settings.clock()
    rendering = rendered - started
    times[spp or 1] = median(m.seconds for m in (*made_a, *made_b))
    renders.check_seeds()
    both = np.concatenate([set_a, set_b])
    problem = renders.noise_problem(surveyed.images[0], both, spp, pilot)
    if problem:
        return case(Outcome.FAIL, problem, spp=spp, images=PICTURES)
    means = region_means(both, regions)
    residuals = means - region_means(truth.mean, regions)
    noise = pilot.noise if fixed else max(pilot.noise, 1.0)
    expected = truth.expected(regions, (spp or 1) / noise, quantum)
    found = judge(residuals[:BATCHES], residuals[BATCHES:], expected, settings.limits, settings.alpha)
    if spp:
        found = renders.counted(found, both, pilot, spp, spp, smallest)
    exchanged = checks.exchanged_pixels(checks.slopes_within(both, truth))
    if exchanged and found.outcome is Outcome.PASS:
        return case(Outcome.FAIL, exchanged, spp=spp, images=PICTURES, **figures(found, regions))

    def takes(more: float) -> float:
        """Seconds of a case of so many times the samples: its start-ups stay as they are, where these are
        known, and so does what comes before and after its sets.
        """
        beside = spent + started - begun + settings.clock() - rendered
        if not fixed and settings.times:
            renders.time_more(times, seeds[-TIMING_SEEDS:-1], more * (spp or 1))
        told = pace(seen(times))
        samples = max(more * (spp or 1), FEWEST_SPP, told.affordable(0.0))  # a planned case has no fewer
        longer = more if fixed else told.longer(spp or 1, samples)
        return beside + rendering * longer / FLUCTUATION

    found, sentence = conclude(
        found, regions, partial(renders.look, both), precision=probe.precision, takes=takes,
        alike=partial(renders.alike, both),
    )  # fmt: skip
    sentence += renders.capped(found, seeds[1 : 1 + PILOT_IMAGES])
    beside = measured([(residuals[:, 0], 1)], both, truth, spp or 1, sample_seconds(times))
    if found.outcome is Outcome.INCONCLUSIVE:
        beside["more_seconds"] = takes(found.more_samples)
    return case(found.outcome, sentence, spp=spp, images=PICTURES, **figures(found, regions), **beside)


def _fingerprint(task: Task, picture: str, truth: Truth, settings: Settings) -> str:
    what = (METHOD, task.label, task.technique, picture, truth.digest)
    how: tuple[object, ...] = (settings.thorough, settings.seed, settings.spp, asdict(settings.limits))
    if settings.repeated or settings.alpha != ALPHA or settings.detect is not None:
        how = (*how, settings.repeated, settings.alpha, settings.detect)
    return hashlib.blake2b(repr((what, how)).encode(), digest_size=16).hexdigest()


def _render(task: Task, truth: Truth, spp: int, seed: int, timeout: float) -> Rendering:
    made = task.renderer.render(task.path, spp, seed, timeout)
    check_contract(made.image, truth, f"seed {seed}" if task.renderer.takes_seed else "")
    return made
