"""Looking at cases again and again, with fresh samples, until all are decided or the time is over.

The first look has few samples, which is enough for gross mistakes; each further one takes half as many again
as all before it. What is rendered depends on the renderer's pictures alone; the clock only ends it. So the
same program gets the same seeds and shows the same: running it again spends nothing of the level.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.errors import CannotRender
from raycheck.base.images import Image
from raycheck.judging import sentences
from raycheck.judging.agenda import Task
from raycheck.judging.cases import Case
from raycheck.judging.conclusion import conclude, figures, gross_mistake, measured
from raycheck.judging.judge_renderer import Renders, ended, fingerprint_of, maker, pool_of
from raycheck.judging.plan import Pilot, measure_pilot
from raycheck.judging.settings import BATCHES, MOST_SPP, PILOT_IMAGES, PILOT_SPP, Settings, case_seeds
from raycheck.stats import verdict
from raycheck.stats.evidence import Evidence
from raycheck.stats.tiles import SMALLEST, Tile, means_of_sums, tile_sums
from raycheck.stats.verdict import CONFIDENCE, Judgement, Outcome
from raycheck.truth.expected import Truth


@dataclass(frozen=True)
class Begun:
    """What comes before the first look."""

    probe: Image
    pilot: Pilot
    pilot_images: Array
    fingerprint: str


@dataclass
class Repeated:
    """One case, and what was seen of it so far."""

    task: Task
    truth: Truth
    taken: set[int]
    """Seeds of the reference, and of all looks so far."""
    settings: Settings
    seconds: float = 0.0
    """That all looks took."""
    predicted: float = 0.0
    """Seconds of the next look."""
    case: Case | None = None
    """The verdict of the last look."""
    begun: Begun | None = None
    sets: list[tuple[Array, int]] = field(default_factory=list)
    """Sums of errors (B, rows, cols, 3) over the smallest squares, and the samples per pixel of the images:
    two a look.
    """

    def __post_init__(self) -> None:
        self.seen = Evidence.none(*self.truth.shape)
        self.renders = Renders(self.task, self.truth, self.settings, None)

    @property
    def open(self) -> bool:
        """Whether another look may decide: where the reference is too noisy none can."""
        if self.case is None:
            return True
        more = self.case.more_samples
        return self.case.verdict is Outcome.INCONCLUSIVE and more is not None and bool(np.isfinite(more))

    @property
    def spp(self) -> int | None:
        """Samples per pixel of the next look; None where the renderer chooses."""
        if not self.task.renderer.takes_spp:
            return None
        total = sum(spp for _, spp in self.sets[::2])
        return min(max(self.settings.spp or PILOT_SPP, total // 2), MOST_SPP)

    def look(self) -> Case:
        """Take another look; raises CannotRender."""
        started = time.perf_counter()
        make = maker(self.task, self.truth)
        with pool_of(self.settings.jobs) as pool:
            self.renders.pool = pool
            case = ended(lambda: self._look(make), self.task, make)
        took = time.perf_counter() - started
        self.seconds += took
        if self.sets:
            self.predicted = took * (self.spp or 1) / self.sets[-1][1]
        self.case = replace(case, seconds=self.seconds)
        if self.begun:
            self.case = replace(self.case, fingerprint=self.begun.fingerprint)
        return self.case

    def _look(self, make: Callable[..., Case]) -> Case:
        if self.begun is None:
            known = self._begin(make)
            if known:
                return known
        assert self.begun
        looks, spp = len(self.sets) // 2 + 1, self.spp
        seeds = self._seeds(looks)[1 + PILOT_IMAGES :][: 2 * BATCHES]
        images, _ = self.renders.render(spp or 1, seeds)
        self.renders.check_seeds()
        if looks == 1:
            problem = self.renders.noise_problem(self.begun.pilot_images, images, spp, self.begun.pilot)
            if problem:
                return make(Outcome.FAIL, problem, spp=spp, images=2 * BATCHES)
        errors = images - self.truth.mean
        self.sets += [(tile_sums(half, SMALLEST)[0], spp or 1) for half in np.split(errors, 2)]
        found, regions = self._judged()
        found, sentence = conclude(
            found, regions, partial(self.renders.look, images), precision=self.begun.probe.precision,
            seconds=self.seconds,
        )  # fmt: skip
        sentence += sentences.may_be_the_reference(found) + self.renders.capped(found, seeds[:PILOT_IMAGES])
        sentence += f" (after {looks} looks)" if looks > 1 else ""
        pixels = self.truth.mean[..., 0].size
        means = [(sums.sum(axis=(1, 2)) / pixels, n) for sums, n in self.sets]
        told = figures(found, regions) | {"looks": looks, "images": looks * 2 * BATCHES}
        told |= measured(means, images, self.truth, spp or 1, self.begun.pilot.sample_seconds)
        return make(found.outcome, sentence, spp=spp, **told)

    def _seeds(self, look: int) -> list[int]:
        """The seeds of look 1, 2, …, that no other look has."""
        number = self.settings.look + look - 1
        name = f"{self.task.technique}/look {number}" if number else self.task.technique
        seeds = case_seeds(self.task.label, name, self.settings.seed, self.taken)
        if look > 1 or self.begun:
            self.taken.update(seeds)
        return seeds

    def _begin(self, make: Callable[..., Case]) -> Case | None:
        """A probe and a pilot; the verdict, if they or an earlier run have it already."""
        seeds = self._seeds(1)
        spp = PILOT_SPP if self.task.renderer.takes_spp else None
        _, [probe] = self.renders.render(1, seeds[:1])
        fingerprint = fingerprint_of(self.task, self.renders.digests[0], self.truth, self.settings)
        earlier = self.settings.earlier.get(fingerprint)
        if earlier and earlier.verdict is not Outcome.INCONCLUSIVE:
            return earlier
        images, made = self.renders.render(spp or 1, seeds[1 : 1 + PILOT_IMAGES])
        self.renders.check_seeds()
        mistake = gross_mistake(images, self.truth, self.renders.look(images))
        if mistake:
            return make(Outcome.FAIL, mistake, spp=spp, images=PILOT_IMAGES)
        times = {1: probe.seconds, spp or 1: min(one.seconds for one in made)}
        pilot = measure_pilot(images, spp, self.truth, times)
        self.begun = Begun(probe.image, pilot, images, fingerprint)
        return None

    def _judged(self) -> tuple[Judgement, list[Tile]]:
        """By all sets; the last two are new, and add to the evidence."""
        assert self.begun
        pilot, probe, settings = self.begun.pilot, self.begun.probe, self.settings
        regions = self.truth.regions(self.sets[-1][1], pilot.skewness)
        quantum = probe.quantum if probe.precision != "float" else None
        noise = max(pilot.noise, 1.0) if self.task.renderer.takes_spp else pilot.noise
        expected = [self.truth.expected(regions, spp / noise, quantum) for _, spp in self.sets]
        residuals = [means_of_sums(sums, regions) for sums, _ in self.sets]
        own = [verdict.own_moments(*pair) for pair in zip(residuals, expected, strict=True)]
        for one in own[-2:]:
            self.seen = self.seen.after(verdict.gain(one, expected[-1]), regions)
        if len(own) == 2:
            confidence = 1 - (1 - CONFIDENCE) * verdict.spent(1)
            first, second = residuals
            found = verdict.judge(
                first, second, expected[-1], settings.limits, settings.alpha / 2, confidence
            )
            return found, regions
        sizes = np.array([spp / self.sets[0][1] for _, spp in self.sets])
        return verdict.judge_looks(
            own, sizes, self.seen, regions, expected[-1], settings.limits, settings.alpha
        ), regions


def judge_until(cases: Sequence[Repeated], ends: float, on_case: Callable[[Case], None]) -> dict[str, str]:
    """Look at all cases, at each once at least, until all are decided or the clock says `ends`; first at
    those whose next look is the shortest. Gives why cases ("scene, technique") cannot be rendered.
    """
    waiting, left_out = list(cases), dict[str, str]()
    while waiting:
        one = min(waiting, key=lambda case: case.predicted)
        if one.predicted and time.perf_counter() + one.predicted > ends:
            break
        try:
            case = one.look()
        except CannotRender as error:
            left_out[f"{one.task.label}, {one.task.technique}"] = str(error)
            waiting.remove(one)
            continue
        if not one.open:
            waiting.remove(one)
            on_case(case)
    for one in waiting:
        if one.case:
            on_case(one.case)
    return left_out
