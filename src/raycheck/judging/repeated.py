"""Looking at cases again and again, with fresh samples, until all are decided or the time is over.

The first look has few samples, which is enough for gross mistakes; each further one takes half as many again
as all before it. What is rendered depends on the renderer's pictures alone; the clock only ends it. So the
same program gets the same seeds and shows the same: running it again spends nothing of the level.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from statistics import median

import numpy as np

from raycheck.base.arrays import Array
from raycheck.judging import checks, sentences
from raycheck.judging.agenda import Task
from raycheck.judging.cases import Case
from raycheck.judging.conclusion import conclude, figures, measured
from raycheck.judging.judge_renderer import Survey, ended, look_seeds, maker, pool_of, survey, take_pilot
from raycheck.judging.settings import MOST_SPP, PICTURES, PILOT_IMAGES, PILOT_SPP, Settings
from raycheck.judging.timetable import FLUCTUATION, pace, sample_seconds, seen
from raycheck.stats import verdict
from raycheck.stats.evidence import Evidence
from raycheck.stats.tiles import SMALLEST, Tile, means_of_sums, tile_sums
from raycheck.stats.verdict import CONFIDENCE, Judgement, Outcome
from raycheck.truth.expected import Truth


@dataclass
class Repeated:
    """One case, and what was seen of it so far."""

    task: Task
    truth: Truth
    taken: set[int]
    """Seeds of the reference, and of all looks so far."""
    settings: Settings
    seconds: float = 0.0
    """That all looks took…"""
    rendering: float = 0.0
    """…and the judged pictures of the last one…"""
    own: float = 0.0
    """…and judging them."""
    predicted: float = 0.0
    """Seconds of the next look."""
    case: Case | None = None
    """The verdict of the last look."""
    begun: Survey | None = None
    times: dict[int, float] = field(default_factory=dict)
    """Seconds of pictures by samples per pixel."""
    steady: bool = False
    """All looks take the samples per pixel of the settings."""
    cut: bool = False
    """A further look was not over in time: none is begun any more."""
    sets: list[tuple[Array, int]] = field(default_factory=list)
    """Sums of errors (B, rows, cols, 3) over the smallest squares, and the samples per pixel of the images:
    two a look.
    """
    slopes: list[float] = field(default_factory=list)
    """How the images of all looks follow the reference within tiles."""

    def __post_init__(self) -> None:
        self.seen = Evidence.none(*self.truth.shape)

    @property
    def open(self) -> bool:
        """Whether another look may decide: where the reference is too noisy none can."""
        if self.case is None:
            return True
        more = self.case.more_samples
        undecided = self.case.verdict is Outcome.INCONCLUSIVE and not self.cut
        return undecided and more is not None and bool(np.isfinite(more))

    @property
    def spp(self) -> int | None:
        """Samples per pixel of the next look; None where the renderer chooses."""
        if not self.task.renderer.takes_spp:
            return None
        return self._spp_after(self.samples)

    @property
    def samples(self) -> int:
        """Samples per pixel of all looks so far."""
        return sum(spp for _, spp in self.sets[::2])

    def _spp_after(self, samples: int) -> int:
        """Of the look that follows so many; 1 where the renderer chooses."""
        if not self.task.renderer.takes_spp:
            return 1
        first = self.settings.spp or PILOT_SPP
        return first if self.steady else min(max(first, samples // 2), MOST_SPP)

    def _look_seconds(self, spp: int) -> float:
        """That a further look takes."""
        return self.own + self.rendering * pace(seen(self.times)).longer(self.sets[-1][1], spp)

    def _takes(self, more: float, spent: float) -> float:
        """Seconds of a run that gets to so many times the samples: the `spent` ones, and those of the looks
        until then.
        """
        samples, seconds, needed = self.samples, 0.0, more * self.samples
        while samples < needed:
            spp = self._spp_after(samples)
            seconds += self._look_seconds(spp)
            samples += spp
        return spent + seconds / FLUCTUATION

    def look(self) -> Case:
        """Take another look."""
        settings, started = self.settings, self.settings.clock()
        begun = self.begun = self.begun or survey(self.task, self.truth, self.taken, settings)
        make = maker(self.task, self.truth, settings, fingerprint=begun.fingerprint)
        with pool_of(settings.jobs) as pool:
            begun.renders.pool = pool
            known = begun.case or ended(lambda: take_pilot(begun, make), self.task, make)
            case = known if known else ended(lambda: self._look(begun, make, started), self.task, make)
        self.seconds += settings.clock() - started
        late = case.late or (case.verdict is Outcome.INCONCLUSIVE and case.bias is None)
        if self.case and late:
            self.cut, case = True, replace(self.case, reason=f"{self.case.reason}; {case.reason}")
        if self.sets:
            self.predicted = self._look_seconds(self._spp_after(self.samples))
        self.case = replace(case, seconds=self.seconds)
        return self.case

    def _look(self, begun: Survey, make: Callable[..., Case], since: float) -> Case:
        """`since` the clock said that."""
        assert begun.pilot
        renders, settings = begun.renders, self.settings
        looks, spp = len(self.sets) // 2 + 1, self.spp
        again = replace(settings, look=settings.look + looks - 1)
        seeds = look_seeds(self.task, again, self.taken)
        self.taken.update(seeds)
        started, judged = settings.clock(), seeds[1 + PILOT_IMAGES :][:PICTURES]
        images, made = renders.render(spp or 1, judged)
        rendered = settings.clock()
        self.rendering = rendered - started
        self.times = begun.times | self.times | {spp or 1: median(one.seconds for one in made)}
        renders.check_seeds()
        if looks == 1:
            problem = renders.noise_problem(begun.images[0], images, spp, begun.pilot)
            if problem:
                return make(Outcome.FAIL, problem, spp=spp, images=PICTURES)
        errors = images - self.truth.mean
        self.sets += [(tile_sums(half, SMALLEST)[0], spp or 1) for half in np.split(errors, 2)]
        found, regions = self._judged()
        if spp:
            found = renders.counted(found, images, begun.pilot, spp, self.samples)
        self.own = settings.clock() - rendered
        self.slopes += list(checks.slopes_within(images, self.truth))
        exchanged = checks.exchanged_pixels(np.array(self.slopes))
        told = figures(found, regions) | {"looks": looks, "images": looks * PICTURES}
        if exchanged and found.outcome is Outcome.PASS:
            return make(Outcome.FAIL, exchanged, spp=spp, **told)
        takes = partial(self._takes, spent=self.seconds + settings.clock() - since)
        found, sentence = conclude(
            found, regions, partial(renders.look, images), precision=begun.first[0].image.precision,
            takes=takes, alike=partial(renders.alike, images),
        )  # fmt: skip
        sentence += sentences.may_be_the_reference(found) + renders.capped(found, judged[:PILOT_IMAGES])
        sentence += f" (after {looks} looks)" if looks > 1 else ""
        pixels = self.truth.mean[..., 0].size
        means = [(sums.sum(axis=(1, 2)) / pixels, n) for sums, n in self.sets]
        told |= measured(means, images, self.truth, spp or 1, sample_seconds(self.times))
        if found.outcome is Outcome.INCONCLUSIVE and np.isfinite(found.more_samples):
            told["more_seconds"] = takes(found.more_samples)
        return make(found.outcome, sentence, spp=spp, **told)

    def _judged(self) -> tuple[Judgement, list[Tile]]:
        """By all sets; the last two are new, and add to the evidence."""
        assert self.begun and self.begun.pilot
        pilot, probe, settings = self.begun.pilot, self.begun.first[0].image, self.settings
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


def judge_until(cases: Sequence[Repeated], ends: float, on_case: Callable[[Case], None]) -> None:
    """Look at all cases, at each once at least, until all are decided or their clock says `ends`; first at
    those whose next look is the shortest.
    """
    waiting = list(cases)
    while waiting:
        one = min(waiting, key=lambda case: case.predicted)
        if one.predicted and one.settings.clock() + one.predicted > ends:
            break
        case = one.look()
        if not one.open:
            waiting.remove(one)
            on_case(case)
    for one in waiting:
        if one.case:
            on_case(one.case)
