"""Methods that are only consistent (photon maps, filters, denoisers): is the limit of their bias nothing?

A renderer is rendered with at least four values of a parameter, each a constant factor from the one before,
from coarse to fine. Its biases are fitted by b₀ + c·hᵖ (stats.consistency), and b₀ is judged as the bias of
an unbiased renderer is: by equivalence for a PASS, by two disjoint sets for a FAIL.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from statistics import median

import numpy as np
from scipy import special

from raycheck.base.arrays import Array
from raycheck.base.errors import NotFound
from raycheck.base.text import percent, signed
from raycheck.judging.agenda import Task
from raycheck.judging.cases import Case
from raycheck.judging.judge_renderer import Renders, ended, maker, pool_of
from raycheck.judging.plan import measure_pilot
from raycheck.judging.sentences import CHANNELS
from raycheck.judging.settings import BATCHES, PILOT_IMAGES, PILOT_SPP, TIMING_SEEDS, Settings, case_seeds
from raycheck.judging.timetable import FLUCTUATION
from raycheck.stats import consistency
from raycheck.stats import statistics as st
from raycheck.stats.consistency import Limit
from raycheck.stats.tiles import Tile, place, region_means
from raycheck.stats.verdict import CONFIDENCE, Expected, Outcome
from raycheck.truth.expected import Truth

FEWEST = 4
GEOMETRIC = 0.02
"""Relative deviation of a factor from the others that rounding of the values may cause."""


@dataclass(frozen=True)
class Sweep:
    """A parameter of the renderer's command and its values, from coarse to fine."""

    name: str
    values: tuple[str, ...]

    @classmethod
    def parse(cls, text: str) -> "Sweep":
        """Of "radius=0.2,0.1,0.05,0.025"; NotFound for anything else."""
        name, equals, listed = text.partition("=")
        values = tuple(value.strip() for value in listed.split(","))
        if not (name.isidentifier() and equals):
            raise NotFound(f"--consistent {text}: PARAM=v1,v2,v3,v4 is wanted")
        numbers = []
        for value in values:
            try:
                numbers.append(float(value))
            except ValueError:
                raise NotFound(f"--consistent {text}: {value!r} is no number") from None
        if len(values) < FEWEST or min(numbers) <= 0 or not all(map(math.isfinite, numbers)):
            raise NotFound(
                f"--consistent {text}: at least {FEWEST} values above 0 are wanted, from coarse to fine"
            )
        factors = np.array(numbers[1:]) / np.array(numbers[:-1])
        if factors[0] == 1 or np.any(np.abs(factors / factors[0] - 1) > GEOMETRIC):
            raise NotFound(f"--consistent {text}: each value must be the same factor times the one before")
        return cls(name, values)

    @property
    def h(self) -> Array:
        """(N,) what goes to 0: the values if they fall, else one over them."""
        numbers = np.array([float(value) for value in self.values])
        return numbers if numbers[0] > numbers[-1] else 1 / numbers

    def commands(self, command: str) -> list[str]:
        """The renderer's command with each value."""
        if f"{{{self.name}}}" not in command:
            raise NotFound(f"--consistent {self.name}=…: the renderer command has no {{{self.name}}}")
        return [command.replace(f"{{{self.name}}}", value) for value in self.values]


def judge_limit(sweep: Sweep, tasks: Sequence[Task], truth: Truth, taken: range, settings: Settings) -> Case:
    """The verdict on one scene, `tasks` being the same with each value."""
    make = maker(tasks[0], truth, settings)
    return ended(lambda: _judged(sweep, tasks, truth, taken, settings, make), tasks[0], make)


def _judged(
    sweep: Sweep, tasks: Sequence[Task], truth: Truth, taken: range, settings: Settings,
    make: Callable[..., Case],
) -> Case:  # fmt: skip
    used, sets = set(taken), list[Array]()
    timed = replace(settings, case_seconds=settings.case_seconds / len(tasks))
    until = settings.clock() + FLUCTUATION * timed.case_seconds
    regions: list[Tile] = []
    spp: int | None = settings.spp
    for number, task in reversed(list(enumerate(tasks))):  # the finest plans, as the noisiest and slowest
        seeds = case_seeds(task.label, f"{task.technique}/{sweep.name} {number}", settings.seed, used)
        used.update(seeds)
        with pool_of(settings.jobs) as pool:
            renders = Renders(task, truth, timed, pool)
            fixed = not task.renderer.takes_spp
            if not regions:
                few = 1 if fixed else PILOT_SPP
                _, [probe] = renders.render(1, seeds[:1])
                images, made = renders.render(few, seeds[1 : 1 + PILOT_IMAGES])
                times = {1: probe.seconds, few: median(one.seconds for one in made)}
                pilot = measure_pilot(images, None if fixed else few, truth)
                if not fixed and not spp:
                    spp = renders.plan(pilot, times, seeds[-TIMING_SEEDS:-1], until).spp
                regions = truth.regions(spp or 1, pilot.skewness)
            both, _ = renders.render(spp or 1, seeds[1 + PILOT_IMAGES :][: 2 * BATCHES])
            renders.check_seeds()
        sets.append(region_means(both, regions) - region_means(truth.mean, regions))
    residuals = np.stack(sets[::-1])
    expected = truth.expected(regions, spp or 1)
    outcome, reason, figures = judge(sweep, residuals, regions, expected, settings)
    return make(outcome, reason, spp=spp, images=2 * BATCHES * len(tasks), tiles=len(regions) - 1, **figures)


def judge(
    sweep: Sweep, residuals: Array, regions: Sequence[Tile], expected: Expected, settings: Settings
) -> tuple[Outcome, str, dict[str, float | str]]:
    """Judge the limit of residuals (N, 64, R, 3): outcome, sentence, and the figures of its case."""
    scale = np.where(expected.yardstick > 0, expected.yardstick, np.abs(expected.mean[0]).max() or 1.0)
    whole = _limit(sweep, residuals)
    variance = expected.variance
    error = np.sqrt(whole.errors**2 + variance)
    freedom = st.FREEDOM_SHARE * (2 * BATCHES - 1)
    half = -float(special.stdtrit(freedom, (1 - CONFIDENCE) / 2 / scale.size)) * error
    low, high = (whole.biases - half).min(axis=0), (whole.biases + half).max(axis=0)
    limit = np.full(scale.shape, settings.limits.tile) * scale
    limit[0] = settings.limits.image * scale[0]
    inside = (low >= -limit) & (high <= limit)

    p = two_set_p(sweep, residuals, whole, expected)
    adjusted = np.minimum(p * p.size, 1.0)
    at = np.unravel_index(int(np.argmin(p)), p.shape)
    factor = st.detection_factor(st.FREEDOM_SHARE * (BATCHES - 1), settings.alpha / p.size)
    of_half = np.sqrt(2 * whole.errors.max(axis=0) ** 2 + expected.variance)
    detectable = (expected.allowance + factor * of_half) / scale
    of_tiles = detectable[1:].max(axis=1) if len(detectable) > 1 else detectable[0]
    channel = int(np.argmax(np.abs(whole.bias[0]) / scale[0]))
    figures: dict[str, float | str] = {
        "bias": float(whole.bias[0, channel] / scale[0, channel]), "channel": CHANNELS[channel],
        "bias_low": float(low[0, channel] / scale[0, channel]),
        "bias_high": float(high[0, channel] / scale[0, channel]),
        "mde_image": float(detectable[0].max()), "order": whole.order,
        "mde_tile_p90": float(np.quantile(of_tiles, 0.9, method="higher")),
        "mde_tile_max": float(of_tiles.max()),
    }  # fmt: skip
    told = _order(sweep, whole)
    if not whole.fits:
        return (
            Outcome.INCONCLUSIVE,
            f"the bias does not follow one power of {sweep.name}: try finer values",
            figures,
        )
    if adjusted[at] <= settings.alpha:
        where = _where(int(at[0]), regions)
        amount = f"{signed(whole.bias[at] / scale[at])} in {CHANNELS[at[1]]}"
        return Outcome.FAIL, f"{where} is off by {amount} in the limit; {told}", figures
    if inside.all():
        most = percent(float(max(abs(low[0] / scale[0]).max(), abs(high[0] / scale[0]).max())))
        return (
            Outcome.PASS,
            f"no bias in the limit: the image is within {most} of the reference; {told}",
            figures,
        )
    wide = np.unravel_index(int(np.argmax(np.where(inside, 0, (high - low) / scale))), low.shape)
    span = f"{signed(low[wide] / scale[wide])} … {signed(high[wide] / scale[wide])}"
    more = float(np.max(np.where(inside, 1.0, ((high - low) / 2 / limit) ** 2)))
    where = (
        f"{_where(int(wide[0]), regions)} is only known to lie within {span} of the reference in the limit"
    )
    need = f"about {2 * more:.2g} times the samples, or finer values, would decide"
    return Outcome.INCONCLUSIVE, f"too noisy to say: {where}; {told}; {need}", figures


def _limit(sweep: Sweep, residuals: Array) -> Limit:
    error = residuals.std(axis=1, ddof=1) / np.sqrt(residuals.shape[1])
    return consistency.limit(sweep.h, residuals.mean(axis=1), error)


def two_set_p(sweep: Sweep, residuals: Array, whole: Limit, expected: Expected) -> Array:
    """(R, 3) two-sided p of "no bias in the limit", which both halves reject at every order that fits."""
    z = []
    for part in np.split(residuals, 2, axis=1):
        found = consistency.limit_at(sweep.h, part, whole)
        error = np.sqrt(found[1] ** 2 + expected.variance)
        z.append((found[0] / error, expected.allowance / error))
    freedom = st.FREEDOM_SHARE * (BATCHES - 1)
    bright = np.minimum(*(v - a for v, a in z)).min(axis=0)
    dark = np.minimum(*(-v - a for v, a in z)).min(axis=0)
    shared = expected.variance / np.maximum(whole.errors.min(axis=0) ** 2 * 2 + expected.variance, 1e-300)
    p = special.stdtr(freedom, -np.maximum(bright, dark))
    return np.minimum(2 * st.combine(p, p, shared), 1.0)


def _order(sweep: Sweep, found: Limit) -> str:
    if not found.shrinks:
        return f"no bias that changes with {sweep.name} is seen"
    rising = float(sweep.values[0]) < float(sweep.values[-1])
    power = f"{'1/' if rising else ''}{sweep.name}"
    orders = f"{found.orders.min():.2g} … {found.orders.max():.2g}"
    return f"the bias falls like {power}^{found.order:.2g} (order {orders})"


def _where(region: int, regions: Sequence[Tile]) -> str:
    height, width = regions[0].height, regions[0].width
    return "the image as a whole" if region == 0 else f"the tile at {place(regions[region], height, width)}"
