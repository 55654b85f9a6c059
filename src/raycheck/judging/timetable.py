"""The seconds of a run: which cases fit into them, and how much of them each may take.

A picture takes the renderer's start-up, and its samples. A case takes a probe, a pilot and two sets of
pictures, so many at a time, so that its start-ups alone may fill a run: then fewer cases are judged, and each
takes the samples that cost little beside them.
"""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from raycheck.base.text import duration
from raycheck.judging.settings import PICTURES, PILOT_IMAGES

START_SHARE = 0.25
"""Samples that take up to so much of the start-up's time are worth it: a case takes a quarter longer."""
FEWEST_SPP = 4
"""Samples per pixel that a case takes at least, whatever time it has, if no fewer decide."""
FLUCTUATION = 0.85
"""Part of the time left that is planned for: another program may slow the rest."""
OWN_SECONDS = 0.5
"""What judging takes beside rendering, before it was measured."""
SEEN = 2.0
"""Times of so many times the samples tell start-up and pace apart."""


@dataclass(frozen=True)
class Pace:
    """The time of a picture."""

    start: float
    """Seconds that it takes with no samples at all."""
    sample: float
    """Seconds for each sample per pixel."""

    def seconds(self, spp: float) -> float:
        return self.start + self.sample * spp

    def affordable(self, seconds: float) -> float:
        """Samples per pixel of a picture that may take so long, or that cost little beside its start."""
        each = max(seconds - self.start, START_SHARE * self.start)
        return each / self.sample if self.sample > 0 else math.inf

    def longer(self, spp: float, other: float) -> float:
        """How many times as long a picture of `other` samples takes as one of `spp`."""
        taken = self.seconds(spp)
        return self.seconds(other) / taken if taken > 0 else other / spp


def pace(times: Mapping[int, float]) -> Pace:
    """From the seconds of pictures by samples per pixel: least squares of relative errors. Where more samples
    took no longer, they are taken to need a fiftieth of the time.
    """
    spp, seconds = (np.array(list(of), dtype=np.float64) for of in (times.keys(), times.values()))
    if len(spp) == 1:
        return Pace(float(seconds[0]), 0.0)
    weight = 1 / np.maximum(seconds, 1e-9) ** 2
    middle, mean = ((weight * of).sum() / weight.sum() for of in (spp, seconds))
    slope = (weight * (spp - middle) * seconds).sum() / (weight * (spp - middle) ** 2).sum()
    many = int(spp.argmax())
    each = float(np.clip(slope, 0.02 * seconds[many] / spp[many], mean / middle))
    return Pace(max(float(mean - each * middle), 0.0), each)


def seen(times: Mapping[int, float]) -> Mapping[int, float]:
    """The times without the first picture's, which may have waited for a disk, where others tell the pace."""
    others = {spp: seconds for spp, seconds in times.items() if spp != min(times)}
    return others if len(others) > 1 and max(others) >= SEEN * min(others) else times


def sample_seconds(times: Mapping[int, float]) -> float | None:
    """Seconds of a sample of every pixel, start-up apart; None where that hides them."""
    told = seen(times)
    return pace(told).sample if told[max(told)] >= SEEN * told[min(told)] else None


def case_seconds(times: Mapping[int, float], spp: int, jobs: int, own: float, *, planned: bool) -> float:
    """What a case takes after its probe and one picture of the pilot, of those seconds, if its sets have
    `spp` samples per pixel, or where these are `planned` as many as cost little beside the start-up.
    """
    found = pace(times)
    each = max(found.seconds(spp), (1 + START_SHARE) * found.start if planned else 0.0)
    return own + ((PILOT_IMAGES - 1) * times[max(times)] + PICTURES * each) / jobs / FLUCTUATION


@dataclass
class Budget:
    """The seconds of a run, as they go by."""

    seconds: float
    """Infinite where nobody set any."""
    asked: bool = False
    """The user said how many: no case may take longer."""
    clock: Callable[[], float] = time.perf_counter
    started: float = field(default=math.nan)
    own: float = OWN_SECONDS
    """The longest that judging a case took beside rendering."""

    def __post_init__(self) -> None:
        if math.isnan(self.started):
            self.started = self.clock()

    @property
    def ends(self) -> float:
        """By the clock."""
        return self.started + self.seconds

    @property
    def left(self) -> float:
        return max(self.ends - self.clock(), 0.0)


TRIES, TRIED = 3, 0.1
"""Cases that are surveyed though none is short enough, and the part of the time that this may take."""
LONG = 10.0
"""Seconds from which a run says how long it will take."""


@dataclass
class Timetable:
    """Which cases the seconds of a run are enough for."""

    budget: Budget
    cases: Sequence[tuple[str, str]]
    """Scene and technique of all."""
    fits: list[str] = field(default_factory=list)
    """Scenes of the cases that will be judged."""
    planned: float = 0.0
    """Seconds that these take at least."""
    least: list[float] = field(default_factory=list)
    """Seconds that cases take at least, of all that were looked at and are not decided yet."""
    decided: int = 0
    """Cases whose verdict is known by now."""
    forced: bool = False
    """The shortest is judged though it takes longer."""

    @property
    def count(self) -> int:
        return len(self.cases)

    @property
    def left(self) -> float:
        """Seconds that nothing is planned for."""
        return self.budget.left - self.planned

    @property
    def has_room(self) -> bool:
        """Whether one more case may fit."""
        budget, fewest = self.budget, min(self.least, default=0.0)
        early = budget.left > (1 - TRIED) * budget.seconds
        return self.left > fewest or (not self.fits and len(self.least) < TRIES and early)

    def take(self, scene: str, least: float, worth: float, *, decided: bool) -> bool:
        """Whether a case fits that is worth so many seconds, or takes so many at least and is the first; if
        so it is planned.
        """
        if decided:
            self.decided += 1
            return True
        self.least.append(worth if self.fits else least)
        if self.least[-1] > self.left:
            return False
        self.fits.append(scene)
        self.planned += min(worth, self.left)
        return True

    @property
    def all_seconds(self) -> float:
        """Seconds that all cases would take."""
        spent = self.budget.clock() - self.budget.started
        more = self.count - self.decided - len(self.least)
        looked = max(len(self.least) + self.decided, 1)
        return spent * self.count / looked + sum(self.least) + more * sum(self.least) / looked

    @property
    def why_not(self) -> str:
        """Why cases are left out."""
        return f"not judged, as the {duration(self.budget.seconds)} of this run are not enough for all"

    def not_enough(self, scene: str, least: float) -> str:
        """What is said where no case fits."""
        need = self.budget.clock() - self.budget.started + least
        return (
            f"--seconds {self.budget.seconds:g} is not enough for a verdict: {scene} takes at least "
            f"{duration(least)}; --seconds {_rounded_up(need)} would do"
        )

    def __str__(self) -> str:
        """What is said before the first verdict; empty where there is nothing to say."""
        cases = "case" if self.count == 1 else "cases"
        if math.isinf(self.budget.seconds):
            return ""
        scenes = ", ".join(dict.fromkeys(self.fits))
        if self.forced:
            usual = duration(self.budget.seconds)
            return f"{scenes} takes about {duration(min(self.least))}, longer than the usual {usual}."
        fit = len(self.fits) + self.decided
        if fit < self.count:
            need = _rounded_up(self.all_seconds)
            known = f", and {self.decided} decided already" if self.decided else ""
            return (
                f"{duration(self.budget.seconds)} are enough for {fit} of {self.count} {cases}: {scenes}"
                f"{known}. --seconds {need} would do for all ({duration(need)})."
            )
        if self.planned > LONG:
            return f"{self.count} {cases}, in at most {duration(self.budget.left)}."
        return ""


def _rounded_up(seconds: float) -> int:
    """To two digits."""
    seconds = max(seconds / FLUCTUATION, 1.0)
    step = int(10 ** max(math.floor(math.log10(seconds)) - 1, 0))
    return math.ceil(seconds / step) * step
