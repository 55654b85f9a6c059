"""What each technique costs: variance of a sample, seconds of a sample, and both together.

The variance is that of one sample per pixel, from the `stderr` channels times the samples, the mean over
pixels and channels, (W·sr⁻¹·m⁻²)². Samples that are not independent have no such number: theirs is from two
renders with different seeds, half of the squared difference, times the samples at which it was measured, a
power of two; with more of them it would be less. The time is that of one sample of every pixel, from oneray's
own clock around the rendering; reading the scene and the pre-pass that learns are apart. Efficiency is
1/(variance · time): twice as efficient is the same noise in half the time. A technique's figures are relative
to the plain random walk's, or where no random ray can hit a light, to those of `nee`.

Rounds are interleaved, each with seeds of its own: every round runs all techniques of a scene in turn, so
that a machine whose speed drifts is slow for all, and a ratio is taken within a round.
"""

import json
import shlex
import statistics
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.errors import NotFound, RenderError
from raycheck.base.images import Image, load_image
from raycheck.base.seeds import make_seeds
from raycheck.base.text import scenes_json
from raycheck.judging.agenda import Task, oneray_agenda
from raycheck.measuring.step import Step
from raycheck.renderers.commands import Command
from raycheck.renderers.renderer import repeat
from raycheck.scene import variants
from raycheck.scene.techniques import BASELINE, FALLBACK
from raycheck.scene.variants import Variant
from raycheck.stats.spread import Spread
from raycheck.truth.provenance import Provenance, provenance

METHOD = 1
"""Version of how prices are measured, see truth.provenance."""
LEAST_ROUNDS = 3
PILOT_SPP = 8
LEAST_SPP, MOST_SPP = 8, 16384
NOTHING = 1e-12
"""Variance over mean² below which samples do not vary: what 32-bit standard errors of equal samples leave."""


@dataclass(frozen=True)
class Measurement:
    """What one render costs."""

    variance: Array
    """(H, W) of one sample of each pixel, the mean over the channels."""
    seconds: float
    """Seconds of one sample of every pixel."""
    build_seconds: float
    """Seconds before the first sample: trees, tables, and the pre-pass of learned choice."""


@dataclass(frozen=True)
class Price:
    """What a technique costs in a scene."""

    technique: str
    spp: int
    """Samples per pixel of each round."""
    variance: float
    """The variance of one sample per pixel, (W·sr⁻¹·m⁻²)², over all rounds."""
    variance_error: float
    """Its standard error, relative to it."""
    seconds_per_sample: float
    """Median over the rounds, for one sample of every pixel."""
    build_seconds: float
    relative_variance: Spread | None
    """The variance over the baseline's; None where the baseline's is 0."""
    relative_time: Spread
    efficiency: Spread | None
    """The efficiency over the baseline's; None where the variance of either is 0."""
    unbounded: bool = False
    """The scene says that its samples have no bound: the variance may be infinite."""


@dataclass(frozen=True)
class ScenePrices:
    """The techniques of a scene, the most efficient first."""

    scene: str
    baseline: str
    rounds: int
    prices: list[Price]
    left_out: dict[str, str] = field(default_factory=dict)
    """Why oneray cannot render the scene with a technique, by the technique."""
    provenance: Provenance = field(default_factory=dict)


def sample_variance(stderr: Array, spp: int) -> Array:
    """(H, W) variance of one sample from the standard error (H, W, 3) of the mean of `spp`."""
    return np.asarray((stderr**2).mean(axis=2) * spp)


def pair_variance(one: Array, other: Array, spp: int) -> Array:
    """(H, W) variance of the mean of `spp` samples, times these, from two independent images (H, W, 3)."""
    return np.asarray(((one - other) ** 2).mean(axis=2) / 2 * spp)


def relative_error(variances: Array) -> float:
    """Relative standard error of the mean of variances (rounds, H, W), from how each pixel's differ between
    the rounds. What no sample has met yet it cannot know. The paths of light tracing reach several pixels,
    which are taken for independent here.
    """
    rounds = len(variances)
    mean = variances.mean()
    if mean == 0:
        return 0.0
    return float(np.sqrt((variances.var(axis=0, ddof=1) / rounds).sum()) / variances[0].size / mean)


def price(name: str, spp: int, own: Sequence[Measurement], baseline: Sequence[Measurement]) -> Price:
    """The price by measurements of a technique and of the baseline in the same rounds."""
    variances = np.array([one.variance for one in own])
    ours = [float(v.mean()) for v in variances]
    theirs = [float(one.variance.mean()) for one in baseline]
    times = [a.seconds / b.seconds for a, b in zip(own, baseline, strict=True)]
    ratios = [a / b for a, b in zip(ours, theirs, strict=True)] if min(theirs) > 0 else None
    gains = [1 / (v * t) for v, t in zip(ratios, times, strict=True)] if ratios and min(ratios) > 0 else None
    return Price(
        technique=name, spp=spp, variance=float(variances.mean()), variance_error=relative_error(variances),
        seconds_per_sample=statistics.median(one.seconds for one in own),
        build_seconds=statistics.median(one.build_seconds for one in own),
        relative_variance=Spread.of(ratios) if ratios else None, relative_time=Spread.of(times),
        efficiency=Spread.of(gains) if gains else None,
    )  # fmt: skip


def most_efficient_first(prices: Sequence[Price]) -> list[Price]:
    """The prices, those without variance first, then by efficiency, then by variance times time."""

    def key(one: Price) -> tuple[bool, float, float]:
        gain = one.efficiency.median if one.efficiency else 0.0
        return (one.variance > 0, -gain, one.variance * one.seconds_per_sample)

    return sorted(prices, key=key)


def measure(task: Task, spp: int, seed: int) -> Measurement:
    """Render once with oneray, twice where samples are not independent; RenderError if it cannot, NotFound if
    it cannot be started.
    """
    image, stats = _render(task, spp, seed)
    renders = [stats["seconds"]["render"]]
    if task.independent:
        if image.stderr is None:
            case = f"{task.label}, {task.technique}"
            raise RenderError(f"{case}: no standard errors at {spp} samples")
        variance = sample_variance(image.stderr, spp)
    else:
        [other_seed] = make_seeds(f"{seed}/other", 1, {seed})
        other, more = _render(task, spp, other_seed)
        renders.append(more["seconds"]["render"])
        variance = pair_variance(image.pixels, other.pixels, spp)
    if variance.mean() <= NOTHING * (image.pixels**2).mean():
        variance = np.zeros_like(variance)
    seconds = max(statistics.mean(renders), 1e-6) / spp
    return Measurement(variance, seconds, stats["seconds"]["build"])


def _render(task: Task, spp: int, seed: int) -> tuple[Image, dict[str, Any]]:
    """The picture and oneray's figures."""
    with tempfile.TemporaryDirectory(prefix="raycheck-") as folder:
        output = Path(folder) / "out.exr"
        assert isinstance(task.renderer, Command)
        words = [*task.renderer.arguments(task.path, output, spp, seed), "--stats", "-"]
        try:
            done = subprocess.run(words, capture_output=True, text=True, check=False)
        except OSError as error:
            raise NotFound(f"{words[0]}: cannot be started: {error.strerror}") from None
        if done.returncode:
            said = (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]
            again = shlex.join(word.replace(str(output), output.name) for word in words)
            raise RenderError(f"{task.label}, {task.technique}: {said}{repeat(spp, seed, again)}")
        return load_image(output), json.loads(done.stdout)


def samples_for(task: Task, seconds: float, seed: int) -> int:
    """Samples per pixel that take about so many seconds, of two renders where samples are not independent."""
    each = measure(task, PILOT_SPP, seed).seconds
    if task.independent:
        return int(min(max(seconds / each, LEAST_SPP), MOST_SPP))
    return 1 << int(np.log2(min(max(seconds / (2 * each), LEAST_SPP), MOST_SPP)))


def rests_on(label: str, techniques: Iterable[str]) -> list[str]:
    """The pictures that the prices of a scene rest on."""
    return [f"{label} {name} auto" for name in techniques]


def price_scene(
    tasks: Sequence[Task], rounds: int, seconds: float, spp: int | None, on_case: Callable[[Task], None],
) -> ScenePrices:  # fmt: skip
    """Measure all techniques of one scene in turn, round after round."""
    seeds = {task.technique: make_seeds(f"{task.label}/{task.technique}/price", rounds + 1) for task in tasks}
    samples = {
        task.technique: spp or samples_for(task, seconds / rounds, seeds[task.technique][rounds])
        for task in tasks
    }
    found: dict[str, list[Measurement]] = {task.technique: [] for task in tasks}
    for k in range(rounds):
        for task in tasks:
            name = task.technique
            found[name].append(measure(task, samples[name], seeds[name][k]))
            on_case(task)
    baseline = BASELINE if BASELINE in found else FALLBACK
    unbounded = {task.technique for task in tasks if task.unbounded}
    prices = [price(name, samples[name], own, found[baseline]) for name, own in found.items()]
    prices = [replace(one, unbounded=one.technique in unbounded) for one in prices]
    rests = provenance(METHOD, rests_on(tasks[0].label, found))
    return ScenePrices(tasks[0].label, baseline, rounds, most_efficient_first(prices), provenance=rests)


def price_list(
    scenes: Sequence[Variant],
    *,
    rounds: int = LEAST_ROUNDS,
    seconds: float = 0.6,
    spp: int | None = None,
    on_case: Callable[[Step, int], None] | None = None,
) -> list[ScenePrices]:
    """The price of every technique that applies, scene by scene, one render at a time.

    `seconds` is the rendering of one technique in one scene, in all rounds together; `spp` are the samples of
    each round instead. `on_case` is told each render and how many there will be.
    """
    agenda = oneray_agenda(scenes, ())
    total = rounds * len(agenda.tasks)
    by_scene: dict[str, list[Task]] = {}
    for task in agenda.tasks:
        by_scene.setdefault(task.label, []).append(task)

    def tell(task: Task) -> None:
        if on_case:
            on_case(Step(task.label, task.technique), total)

    result = []
    for label, tasks in by_scene.items():
        priced = price_scene(tasks, rounds, seconds, spp, tell)
        for case, why in agenda.left_out.items():
            if case.startswith(f"{label}, "):
                priced.left_out[case.removeprefix(f"{label}, ")] = why
        result.append(priced)
    return result


def to_json(result: Sequence[ScenePrices], header: Mapping[str, object]) -> str:
    """All figures, a technique a line."""
    whole = [asdict(one) for one in result]
    return scenes_json(header, "techniques", ({"techniques": one.pop("prices"), **one} for one in whole))


def read(path: Path) -> list[ScenePrices]:
    """The price list in a file that `to_json` wrote."""

    def spread(value: Mapping[str, float] | None) -> Spread | None:
        return Spread(**value) if value else None

    result = []
    for scene in json.loads(path.read_text(encoding="utf-8"))["scenes"]:
        prices = [
            Price(**{k: spread(v) if k in SPREADS else v for k, v in one.items()})  # type: ignore[arg-type]
            for one in scene["techniques"]
        ]
        del scene["techniques"]
        result.append(ScenePrices(prices=prices, **scene))
    return result


SPREADS = ("relative_variance", "relative_time", "efficiency")


def scenes_named(names: Sequence[str], parameters: Mapping[str, str]) -> list[Variant]:
    """The scenes named, or all canonical ones; ReferenceError_ for an unknown name or parameter."""
    return [variants.variant(name, parameters) for name in names or variants.scene_names()]
