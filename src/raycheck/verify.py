"""Verify: render with many seeds, judge against the references, say what was found."""

import datetime
import glob
import hashlib
import json
import math
import os
import tempfile
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raycheck import checks, diagnosis, references, renderers, words
from raycheck.base.errors import ImageError, NotFound, RenderError, RenderLate, RenderTimeout
from raycheck.base.images import Image, load_image
from raycheck.base.machine import machine, raycheck_version
from raycheck.base.seeds import make_seeds
from raycheck.base.text import signed
from raycheck.evidence import Evidence, evidence
from raycheck.pilot import (
    Goals,
    Pilot,
    Plan,
    cumulants,
    equivalent_spp,
    measure,
    pace,
    plan,
    residual_skewness,
    tile_skewness,
)
from raycheck.scene import variants
from raycheck.scene.content import read_content
from raycheck.stats.tiles import SMALLEST, Tile, region_means
from raycheck.stats.verdict import Judgement, Limits, Outcome, judge
from raycheck.tasks import Agenda, Task, oneray_agenda, renderer_agenda
from raycheck.truth import Truth, truth_of

Array = NDArray[np.float64]

BATCHES = 32
"""Images of each of the two judged sets."""
PILOT_IMAGES = 8
PILOT_SPP = 16
TIMING_STEP, TIMING_SEEDS = 8, 4
"""A plan for more than 8 times the samples that were timed is timed again nearer to it, so often at most: a
short render's time says little of a long one's.
"""
QUICK_SECONDS = 90.0
"""Budget of a quick run over everything, and what no single case may exceed."""
QUICK_CASE_SECONDS = 20.0
THOROUGH_IMAGE = 0.0027
"""Detectable bias of the image that a thorough case plans for, so that chance leaves it below 0.3 %."""
FINE_SECONDS, THOROUGH_SECONDS = 8.0, 300.0
"""A thorough case takes up to the second to see a bias of 0.3 % of the image, and up to the first to see
smaller ones and 1 % of most tiles.
"""
MOST_SPP = 1 << 16


@dataclass(frozen=True)
class Case:
    """The verdict on one scene and one technique; figures are relative, None where a plain check already
    failed.
    """

    scene: str
    technique: str
    verdict: Outcome
    reason: str
    bias: float | None = None
    bias_low: float | None = None
    bias_high: float | None = None
    mde_image: float | None = None
    mde_tile_p90: float | None = None
    spp: int | None = None
    """Samples per pixel of each image, None where the renderer chooses."""
    seconds: float = 0.0
    images: int = 0
    """Judged images of both sets together."""
    tiles: int = 0
    channel: str | None = None
    mde_tile_max: float | None = None
    p_image: float | None = None
    p_tile: float | None = None
    p_omnibus: float | None = None
    tile_differences: int = 0
    heavy_tailed: int = 0
    more_samples: float | None = None
    closed_form: bool = False
    """Nine pixels in ten or more have a closed form, which outranks the Mitsuba reference."""
    unbounded: bool = False
    """The scene says that this technique's samples have no bound: no small detectable bias is asked then."""
    late: bool = False
    """It FAILs because a picture took longer than it may."""
    looks: int = 1
    """With fresh samples each; the last one's figures."""
    fingerprint: str = ""
    """Of the reference, the settings and the renderer's first picture: a case that has it need not be judged
    again.
    """


@dataclass(frozen=True)
class Verification:
    """All verdicts of a run, and what they were made with."""

    cases: list[Case]
    header: dict[str, object] = field(default_factory=dict)

    @property
    def exit_status(self) -> int:
        """1 if any FAIL, else 3 if any INCONCLUSIVE, else 0."""
        outcomes = {case.verdict for case in self.cases}
        return 1 if Outcome.FAIL in outcomes else 3 if Outcome.INCONCLUSIVE in outcomes else 0

    @classmethod
    def read(cls, path: Path) -> "Verification":
        """What `to_json` wrote; NotFound if it is anything else."""
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
            cases = [Case(**{**case, "verdict": Outcome(case["verdict"])}) for case in found.pop("cases")]
        except OSError as error:
            raise NotFound(f"{path}: {error.strerror}") from None
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise NotFound(f"{path}: not a result of raycheck verify --json ({error})") from None
        return cls(cases, found)

    def to_json(self) -> str:
        cases = [asdict(case) for case in self.cases]
        for values in cases:
            for key, value in values.items():
                if isinstance(value, float):
                    values[key] = float(f"{value:.6g}") if np.isfinite(value) else None
        return (
            json.dumps({**self.header, "cases": cases}, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
        )


@dataclass(frozen=True)
class Settings:
    thorough: bool = False
    seed: int = 0
    look: int = 0
    """The second takes seeds of its own."""
    spp: int | None = None
    jobs: int = 2
    timeout: float = 60.0
    case_seconds: float = QUICK_CASE_SECONDS
    limits: Limits = Limits()
    earlier: Mapping[str, Case] = field(default_factory=dict)
    """Verdicts that stand, by fingerprint."""

    def wishes(self, truth: Truth, unbounded: bool) -> list[tuple[Goals, float]]:
        """Detectable biases to reach and the seconds that they are worth, the best first; of samples without
        bound only what a PASS needs.
        """
        most = THOROUGH_SECONDS if self.thorough else self.case_seconds
        if unbounded:
            return [(Goals(coarsest=max(truth.shape)), most)]
        if not self.thorough:
            return [(Goals(image=0.003), most), (Goals(), most)]
        fine = [
            (Goals(image, tile_p90=0.01, fineness=0.8, coarsest=16), FINE_SECONDS)
            for image in (0.001, THOROUGH_IMAGE)
        ]
        coarse = [(Goals(THOROUGH_IMAGE, coarsest=16), most), (Goals(coarsest=16), most)]
        return [*fine[0 if truth.closed_form else 1 :], *coarse]


def verify(
    renderer: str | Callable[[Path, int, int], ArrayLike] | renderers.Renderer | None = None,
    scenes: str | Path | Sequence[str | Path] = (),
    *,
    parameters: Mapping[str, str] | None = None,
    techniques: Sequence[str] = (),
    images: str | Sequence[str | Path] | None = None,
    thorough: bool = False,
    seed: int = 0,
    spp: int | None = None,
    jobs: int | None = None,
    seconds: float | None = None,
    timeout: float | None = None,
    limits: Limits = Limits(),
    earlier: Sequence[Case] = (),
    on_case: Callable[[Case, int], None] | None = None,
) -> Verification:
    """Judge a renderer on scenes that have references.

    `renderer` is a command with {output} and where it can {scene} {spp} {seed}, a callable render(scene, spp,
    seed) that returns (H, W, 3) linear radiance, or None for oneray with every technique that applies (or
    those named). `images`, a glob or paths, judges pictures of one scene that were already rendered. `scenes`
    are canonical names, labels ("furnace@depth=2") or scene files, or one of these; none means all canonical
    ones, of which a quick run of oneray picks cases that take in every technique and scene, and a thorough
    one adds the scenes' other depths. `parameters` replace `<default>` values of the scenes. `seconds` is the
    budget of a quick run. Verdicts of `earlier` stand where the renderer's first picture and the reference
    are still the same. `on_case(case, cases in all)` is called after each verdict. Raises
    `renderers.NotFound` where nothing can be judged.
    """
    started = time.perf_counter()
    scenes = [scenes] if isinstance(scenes, str | Path) else scenes
    named = [variants.variant(scene, parameters) for scene in scenes or variants.scene_names()]
    jobs = jobs or min(2, os.cpu_count() or 1)
    if images is not None:
        cases = [_judge_pictures(named, len(scenes), images, bool(renderer or techniques), limits)]
        if on_case:
            on_case(cases[0], 1)
        return Verification(cases, _header(started, cases, {}, thorough, seed, jobs))
    if renderer is not None and techniques:
        raise NotFound("--technique chooses among oneray's techniques: it does not go with --renderer")
    budget = QUICK_SECONDS if seconds is None else seconds
    settings = Settings(
        thorough=thorough, seed=seed, spp=spp, jobs=jobs, limits=limits,
        timeout=timeout or (600.0 if thorough else 60.0),
        earlier={case.fingerprint: case for case in earlier if case.fingerprint},
    )  # fmt: skip
    with tempfile.TemporaryDirectory(prefix="raycheck-") as folder:
        if renderer is None:
            whole = not scenes and not techniques and not parameters
            agenda = oneray_agenda(
                named, techniques, cover=whole and not thorough, variants=whole and thorough
            )
        else:
            agenda = renderer_agenda(renderer, named, Path(folder), explicit=bool(scenes))
        for of in {task.label: task.of for task in agenda.tasks}.values():
            references.require(of)
        cases = _judge_all(agenda, settings, budget, started, on_case)
    return Verification(cases, _header(started, cases, agenda.left_out, thorough, seed, jobs))


def _judge_pictures(
    named: Sequence[variants.Variant],
    scenes: int,
    images: str | Sequence[str | Path],
    more: bool,
    limits: Limits,
) -> Case:
    """The verdict on pictures that are already rendered; NotFound where the request makes no sense."""
    if more:
        raise NotFound("--images judges pictures: it goes with neither --renderer nor --technique")
    if scenes != 1:
        raise NotFound("--images needs one SCENE, the one that the pictures show")
    return _judge_files(named[0], _image_paths(images), limits)


def _judge_all(
    agenda: Agenda, settings: Settings, budget: float, started: float,
    on_case: Callable[[Case, int], None] | None,
) -> list[Case]:  # fmt: skip
    """All verdicts, a quick run's within the budget in seconds."""
    cases: list[Case] = []
    truths: dict[str, Truth] = {}
    taken: dict[str, range] = {}
    for index, task in enumerate(agenda.tasks):
        if task.label not in truths:
            reference = references.load_reference(task.of)
            truths[task.label] = truth_of(reference)
            taken[task.label] = _reference_seeds(reference)
        share = THOROUGH_SECONDS
        if not settings.thorough:
            each = budget / len(agenda.tasks)
            left = max(budget - (time.perf_counter() - started), 0.0) / (len(agenda.tasks) - index)
            share = min(QUICK_CASE_SECONDS, max(left, each / 2))  # what came before may not starve the rest
        timed = replace(settings, case_seconds=share)
        case = _judge_task(task, truths[task.label], taken[task.label], timed)
        cases.append(_second_look(case, task, truths[task.label], taken[task.label], timed))
        if on_case:
            on_case(cases[-1], len(agenda.tasks))
    return cases


def _second_look(case: Case, task: Task, truth: Truth, taken: range, settings: Settings) -> Case:
    """A thorough run does what an INCONCLUSIVE case says would decide, where it has the time: fresh samples,
    judged alone. Two looks double the chance of a wrong FAIL.
    """
    planned = settings.thorough and settings.spp is None and case.spp
    more = case.more_samples if case.verdict is Outcome.INCONCLUSIVE and case.looks == 1 else None
    if not (planned and more and case.seconds * more < THOROUGH_SECONDS):
        return case
    found = _judge_task(task, truth, taken, replace(settings, spp=math.ceil(case.spp * more), look=1))
    return replace(found, looks=2, fingerprint=case.fingerprint, seconds=found.seconds + case.seconds)


def _reference_seeds(reference: references.Reference) -> range:
    first, count = reference.entry["seeds"]
    return range(int(first), int(first) + int(count))


class _Broken(Exception):
    """An image that a plain check rejects, or none at all: the sentence that says so."""


def _judge_task(task: Task, truth: Truth, taken: range, settings: Settings) -> Case:
    started = time.perf_counter()

    def case(verdict: Outcome, reason: str, **figures: object) -> Case:
        seconds = time.perf_counter() - started
        closed = truth.closed_form
        return Case(
            task.label, task.technique, verdict, reason, seconds=seconds, closed_form=closed,
            unbounded=task.unbounded, **figures,
        )  # fmt: skip

    technique = f"{task.technique}/look {settings.look}" if settings.look else task.technique
    seeds = case_seeds(task.label, technique, settings.seed, taken)
    try:
        with _pool(settings.jobs) as pool:
            return _judge_renders(_Trial(task, truth, settings, pool), seeds, case)
    except _Broken as error:
        return case(Outcome.FAIL, str(error))
    except RenderTimeout as error:
        return case(Outcome.INCONCLUSIVE, f"{error}; --timeout SECONDS allows more")
    except RenderLate as error:
        return case(Outcome.FAIL, str(error), late=True)
    except RenderError as error:
        return case(Outcome.FAIL, str(error))


def case_seeds(label: str, name: str, seed: int, taken: Collection[int] = ()) -> list[int]:
    """Of a case's renders: one, the pilot's, the judged sets', and those that time is measured by."""
    return make_seeds(f"{label}/{name}/{seed}", 1 + PILOT_IMAGES + 2 * BATCHES + TIMING_SEEDS, taken)


@contextmanager
def _pool(jobs: int) -> Iterator[ThreadPoolExecutor]:
    """A thread pool that drops what is waiting as soon as something goes wrong."""
    pool = ThreadPoolExecutor(jobs)
    try:
        yield pool
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


@dataclass
class _Trial:
    """The renders of one case: each goes through the plain checks, and no two may be the same."""

    task: Task
    truth: Truth
    settings: Settings
    pool: ThreadPoolExecutor
    labels: list[str] = field(default_factory=list)
    digests: list[str] = field(default_factory=list)

    def render(self, spp: int, seeds: Sequence[int]) -> tuple[Array, list[renderers.Rendering]]:
        """Images of some seeds, (B, H, W, 3)."""
        task, truth, timeout = self.task, self.truth, self.settings.timeout
        made = list(self.pool.map(lambda s: _render(task, truth, spp, s, timeout), seeds))
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
            raise _Broken(problem + ("" if self.task.renderer.takes_seed else hint))

    def mistake(self, images: Array, gross: bool = False) -> str | None:
        lights = self.task.content.lights
        return checks.name_mistake(images, self.truth.mean, self.truth.variance, lights, gross=gross)

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


def _judge_renders(trial: _Trial, seeds: list[int], case: Callable[..., Case]) -> Case:
    truth, settings = trial.truth, trial.settings
    fixed = not trial.task.renderer.takes_spp
    _, probe = trial.render(1, seeds[:1])
    fingerprint = _fingerprint(trial.task, trial.digests[0], truth, settings)
    if fingerprint in settings.earlier:
        return settings.earlier[fingerprint]
    case = partial(case, fingerprint=fingerprint)
    first_spp = 1 if fixed else PILOT_SPP
    pilot_images, pilot_made = trial.render(first_spp, seeds[1 : 1 + PILOT_IMAGES])
    trial.check_seeds()
    mistake = trial.mistake(pilot_images, gross=True)
    if mistake:
        return case(Outcome.FAIL, mistake, spp=None if fixed else first_spp, images=PILOT_IMAGES)
    times = {1: probe[0].seconds, first_spp: min(m.seconds for m in pilot_made)}
    pilot = measure(pilot_images, None if fixed else first_spp, truth, times)
    smallest, spp = SMALLEST, None if fixed else settings.spp
    if not fixed and not settings.spp:
        pilot, chosen = trial.plan(pilot, times, seeds[-TIMING_SEEDS:])
        smallest, spp = chosen.smallest, chosen.spp
        if not trial.task.independent:
            # The variance falls faster than 1/spp: the plan, which takes it as 1/spp, errs on the safe side
            # from the pilot's samples on, and expects too little noise below.
            spp = max(spp, PILOT_SPP)

    quantum = probe[0].image.quantum if probe[0].image.precision != "float" else None
    regions = truth.regions(spp or 1, pilot.skewness, smallest)
    second = 1 + PILOT_IMAGES + BATCHES
    set_a, _ = trial.render(spp or 1, seeds[1 + PILOT_IMAGES : second])
    set_b, _ = trial.render(spp or 1, seeds[second : second + BATCHES])
    trial.check_seeds()
    both = np.concatenate([set_a, set_b])
    problem = checks.shared_noise(both)
    if not fixed and not problem:
        tame = truth.regions(first_spp, pilot.skewness)
        few = region_means(pilot_images, tame)
        problem = checks.stuck_noise(few, first_spp, region_means(both, tame), spp or 1)
    if problem and trial.task.independent:
        return case(Outcome.FAIL, problem, spp=spp, images=2 * BATCHES)
    means = region_means(both, regions)
    residuals = means - region_means(truth.mean, regions)
    noise = pilot.noise if fixed else max(pilot.noise, 1.0)
    expected = truth.expected(regions, (spp or 1) / noise, quantum)
    found = judge(residuals[:BATCHES], residuals[BATCHES:], expected, settings.limits)
    if found.outcome is Outcome.FAIL:
        mistake = trial.mistake(both)
        if not mistake and not fixed:
            mistake = checks.clamped_samples(found.bias_high, pilot.noise)
    seconds = 2 * BATCHES * pilot.seconds(spp or 1) / settings.jobs
    shown = partial(evidence, _known_as(trial.task.of), both, truth)
    found, sentence = _sentence(found, regions, seconds, mistake, probe[0].image, shown)
    return case(found.outcome, sentence, spp=spp, images=2 * BATCHES, **_figures(found, regions))


def _fingerprint(task: Task, picture: str, truth: Truth, settings: Settings) -> str:
    what = (task.label, task.technique, picture, truth.digest)
    how = (settings.thorough, settings.seed, settings.spp, asdict(settings.limits))
    return hashlib.blake2b(repr((what, how)).encode(), digest_size=16).hexdigest()


def _render(task: Task, truth: Truth, spp: int, seed: int, timeout: float) -> renderers.Rendering:
    made = task.renderer.render(task.path, spp, seed, timeout)
    _contract(made.image, truth, f"seed {seed}" if task.renderer.takes_seed else "")
    return made


def _contract(image: Image, truth: Truth, label: str) -> None:
    problem = checks.size_problem(image, *truth.shape) or checks.number_problem(image)
    if problem:
        raise _Broken(f"{problem} ({label})" if label else problem)


def _affordable(pilot: Pilot, truth: Truth, settings: Settings, unbounded: bool) -> Plan:
    """Samples per pixel: what the goals need, at most what the time allows."""

    def most(seconds: float) -> int:
        each = seconds * settings.jobs / (2 * BATCHES)
        if pilot.sample_seconds <= 0:
            return MOST_SPP
        return int(np.clip((each - pilot.start_seconds) / pilot.sample_seconds, 1, MOST_SPP))

    wishes = [(goals, most(seconds)) for goals, seconds in settings.wishes(truth, unbounded)]
    return plan(pilot, truth, BATCHES, wishes, settings.limits)


def _known_as(of: variants.Variant) -> str:
    """What signatures and parts go by; another scene may have the name of one here."""
    return of.label if of.canonical else str(of.path)


def _sentence(
    found: Judgement, regions: list[Tile], seconds: float, mistake: str | None, image: Image,
    shown: Callable[[], Evidence],
) -> tuple[Judgement, str]:  # fmt: skip
    """The judgement's reason, and what coarse input means for it."""
    if found.outcome is Outcome.FAIL and not mistake and image.precision == "float":
        suspects, explained = diagnosis.likely(shown())
        sentence = words.reason(found, regions, seconds, explained=explained) + words.suspicion(suspects)
    else:
        sentence = words.reason(found, regions, seconds, mistake)
    if image.precision == "8-bit" and found.outcome is Outcome.PASS:
        found = Judgement(**{**found.__dict__, "outcome": Outcome.INCONCLUSIVE})
        return (
            found,
            "8 bits cannot show that an image is right: no gross mistake was seen; write EXR or PFM to pass",
        )
    if image.precision != "float":
        sentence += f"; the images are {image.precision}, so that biases below their rounding are not seen"
    return found, sentence


def _figures(found: Judgement, regions: list[Tile]) -> dict[str, object]:
    return {
        "bias": found.bias,
        "bias_low": found.bias_low,
        "bias_high": found.bias_high,
        "mde_image": found.mde_image,
        "mde_tile_p90": found.mde_tile_p90,
        "mde_tile_max": found.mde_tile_max,
        "tiles": len(regions) - 1,
        "channel": words.CHANNELS[found.channel],
        "p_image": found.p_image,
        "p_tile": found.p_tile,
        "p_omnibus": found.p_omnibus,
        "tile_differences": found.tile_differences,
        "heavy_tailed": found.heavy_tailed,
        "more_samples": found.more_samples if found.outcome is Outcome.INCONCLUSIVE else None,
    }


def _image_paths(images: str | Sequence[str | Path]) -> list[Path]:
    if isinstance(images, str):
        paths = [Path(p) for p in sorted(glob.glob(images))]  # noqa: PTH207 (absolute patterns too)
        if not paths:
            raise NotFound(f"--images {images!r}: no file matches")
        return paths
    return [Path(p) for p in images]


def _judge_files(of: variants.Variant, files: list[Path], limits: Limits) -> Case:
    loaded: list[Image] = []
    for file in files:
        try:
            loaded.append(load_image(file))
        except ImageError as error:
            return Case(of.label, "images", Outcome.FAIL, str(error), images=len(files))
    return judge_pictures(of, loaded, [str(file) for file in files], limits)


def judge_pictures(
    of: variants.Variant, loaded: Sequence[Image], names: Sequence[str], limits: Limits
) -> Case:
    """Judge pictures that were already rendered, even a single one; their names are for messages."""
    started = time.perf_counter()
    truth = truth_of(references.load_reference(of))

    def case(verdict: Outcome, reason: str, **figures: object) -> Case:
        seconds, closed = time.perf_counter() - started, truth.closed_form
        return Case(
            of.label,
            "images",
            verdict,
            reason,
            seconds=seconds,
            closed_form=closed,
            images=len(loaded),
            **figures,
        )

    try:
        for image, name in zip(loaded, names, strict=True):
            _contract(image, truth, name)
    except _Broken as error:
        return case(Outcome.FAIL, str(error))
    problem = checks.seed_problem([checks.digest(i) for i in loaded], names, truth.varies)
    if problem:
        return case(Outcome.FAIL, problem)
    images = np.stack([image.pixels for image in loaded])
    coarse = next((image for image in loaded if image.precision != "float"), loaded[0])
    lights = read_content(of.path, of.parameters).lights
    residuals = images - truth.mean
    if coarse.precision == "8-bit":  # what is brighter than white cannot be compared
        residuals = np.where(images > 0.99, images - np.clip(truth.mean, 0, 1), residuals)
    mistake = checks.name_mistake(images, truth.mean, truth.variance, lights, gross=True)
    if mistake:
        return case(Outcome.FAIL, mistake)
    quantum = coarse.quantum if coarse.precision != "float" else None
    found, regions, classes = judge_few(residuals, truth, limits, quantum)
    if found.outcome is Outcome.FAIL:
        mistake = checks.name_mistake(images, truth.mean, truth.variance, lights)
    elif found.outcome is Outcome.INCONCLUSIVE:
        return case(found.outcome, _few(found, len(loaded)), **_figures(found, regions))
    shown = partial(evidence, _known_as(of), images, truth)
    found, sentence = _sentence(found, regions, 0.0, mistake, coarse, shown)
    if classes > 1:
        sentence += (
            f" (from {len(loaded)} image{'s' if len(loaded) > 1 else ''}, noise measured between pixels)"
        )
    return case(found.outcome, sentence, **_figures(found, regions))


def judge_few(
    residuals: Array,
    truth: Truth,
    limits: Limits = Limits(),
    quantum: Array | None = None,
    independent_pixels: bool = True,
) -> tuple[Judgement, list[Tile], int]:
    """Judge the residuals (k, H, W, 3) of few images, with its regions and the classes of pixels that make
    them many batches; one where the noise of different pixels is not independent, which needs k ≥ 6.
    """
    parts = _interleave(residuals) if independent_pixels else _Interleaved(residuals, 1)
    if len(residuals) > 2:
        variance, third = cumulants(residuals)
        skewness = tile_skewness(variance, third, truth.skewness)
    else:
        variance = np.broadcast_to(residuals.var(axis=(0, 1, 2)), truth.mean.shape)
        skewness = residual_skewness(residuals, truth.skewness)
    equivalent = equivalent_spp(truth.sample_variance, variance)
    regions = parts.usable(truth.regions(1 / parts.classes, skewness))
    batches = parts.region_means(regions)
    expected = truth.expected(regions, equivalent / parts.classes, quantum)
    return judge(batches[0::2], batches[1::2], expected, limits), regions, parts.classes


def _few(found: Judgement, count: int) -> str:
    more = max(int(np.ceil(count * (found.more_samples - 1))), 1)
    wide = found.undecided[0] if found.undecided else None
    width = f"a tile is only known to {signed(wide.low)} … {signed(wide.high)}; " if wide else ""
    many = f"{more} more images" if more < 10_000 else "far more samples per pixel"
    images = f"{count} image{'s' if count > 1 else ''}"
    return f"too noisy to say from {images}: {width}{many} like these would decide"


@dataclass(frozen=True)
class _Interleaved:
    """Few images as many batches: pixels are dealt to classes that each cover every tile evenly.

    It takes the noise of different pixels as independent.
    """

    pixels: Array
    """(k, H, W, 3) residuals"""
    classes: int

    def _member(self) -> NDArray[np.int64]:
        """(H, W) class of each pixel."""
        order = np.random.default_rng(0).permutation(64).reshape(8, 8) % self.classes
        height, width = self.pixels.shape[1:3]
        return np.tile(order, (-(-height // 8), -(-width // 8)))[:height, :width]

    def usable(self, regions: list[Tile]) -> list[Tile]:
        member = self._member()
        return [r for r in regions if len(np.unique(member[r.window])) == self.classes]

    def region_means(self, regions: list[Tile]) -> Array:
        """(k × classes, R, 3)"""
        if self.classes == 1:
            return region_means(self.pixels, regions)
        member = self._member()
        result = np.empty((self.classes, len(self.pixels), len(regions), 3))
        for index, region in enumerate(regions):
            window = self.pixels[:, region.window[0], region.window[1]]
            for one in range(self.classes):
                result[one, :, index] = window[:, member[region.window] == one].mean(axis=1)
        return result.reshape(-1, len(regions), 3)


def _interleave(residuals: Array) -> _Interleaved:
    """At least 2 × BATCHES batches."""
    classes = 1
    while classes * len(residuals) < 2 * BATCHES:
        classes *= 2
    return _Interleaved(residuals, classes)


def _header(
    started: float, cases: list[Case], left_out: Mapping[str, str], thorough: bool, seed: int, jobs: int
) -> dict[str, object]:
    spent = time.perf_counter() - started
    totals = {outcome.value: sum(case.verdict is outcome for case in cases) for outcome in Outcome}
    return {
        "raycheck": raycheck_version(),
        "date": datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        "machine": machine(),
        "mode": "thorough" if thorough else "quick",
        "seed": seed,
        "jobs": jobs,
        "alpha": 1e-5,
        "totals": totals | {"seconds": round(max(spent, sum(case.seconds for case in cases)), 1)},
        "left_out": dict(left_out),
    }
