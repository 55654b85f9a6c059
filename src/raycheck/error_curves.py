"""Error against run time: renderers race over a scene at doubling sample counts with independent seeds.

Rounds are interleaved: each renders every contestant at all its sample counts, in turn, so that a machine
whose speed drifts is slow for all. What was rendered is kept on disk until the scene is finished, and the
scene's figures and pictures then, so that a run can be interrupted and continued. A contestant that fails is
out with its reason; the others go on.

The time of a picture is process time. A straight line through it over the samples, in each round, tells what
a picture costs before its first sample (start-up) from what each sample costs; curves are drawn over the
latter. Mitsuba's start, loading and compiling are measured by themselves.
"""

import hashlib
import json
import shutil
import statistics
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from raycheck.base.errors import NotFound, RenderError
from raycheck.base.images import Image
from raycheck.base.seeds import make_seeds
from raycheck.contestants import Contestant, Shot
from raycheck.judging import checks, sentences
from raycheck.judging.agenda import standard_technique
from raycheck.judging.pictures import judge_few
from raycheck.judging.plan import pace
from raycheck.prices import FALLBACK, Step, rounded
from raycheck.scene import variants
from raycheck.scene.content import read_content
from raycheck.scene.techniques import BASELINE, TECHNIQUES
from raycheck.scene.variants import Variant
from raycheck.stats import convergence
from raycheck.stats.convergence import Band, Fit, Level, Scores
from raycheck.stats.spread import Spread
from raycheck.stats.verdict import Outcome
from raycheck.truth import references
from raycheck.truth.expected import Truth, truth_of

Array = NDArray[np.float64]

SCHEMA = 1
LEAST_SPP, MOST_SPP = 4, 4096
LEAST_LEVELS = 4
LEAST_ROUNDS, ROUNDS = 6, 8
TARGET = 0.01
"""The relative RMSE that a time is given for."""
MOST_SHOWN = 5
"""Contestants whose pictures are shown."""


@dataclass(frozen=True)
class Curve:
    """What one contestant showed in a scene."""

    name: str
    about: str
    command: str
    reason: str = ""
    """Why it has no curve; empty where it has."""
    levels: list[Level] = field(default_factory=list)
    start_seconds: float = 0.0
    """Process time of a picture before its first sample."""
    opened: dict[str, float] = field(default_factory=dict)
    """Seconds to get ready once, by what took them."""
    sample_seconds: Spread | None = None
    """Process time of one sample of every pixel, over the rounds."""
    slope: Band | None = None
    """Of log RMSE over log samples."""
    relative_slope: Band | None = None
    """The same of the root of relMSE."""
    slope_without_outliers: Band | None = None
    flag: str = ""
    """"bias", "heavy tails", "slow" or nothing."""
    why: str = ""
    detectable: float | None = None
    """Relative bias of the image mean that would have been found nine times in ten."""
    seconds_to_target: float | None = None
    """None where it does not vary, or its bias is larger."""
    efficiency: Band | None = None
    """1/(variance · time), s⁻¹ (W·sr⁻¹·m⁻²)⁻²."""
    relative_efficiency: Band | None = None

    def seconds(self, spp: float) -> float:
        return spp * self.sample_seconds.median if self.sample_seconds else 0.0


@dataclass(frozen=True)
class Shown:
    """A picture for the page; its pixels are in the scene's file of pictures under `key`."""

    key: str
    name: str
    spp: int
    seconds: float
    rmse: float
    relmse: float
    command: str


@dataclass(frozen=True)
class SceneCurves:
    scene: str
    width: int
    height: int
    rounds: int
    baseline: str
    mean: float
    """Of the reference over pixels and channels."""
    epsilon: float
    floor: float
    """RMSE of the reference itself, 0 where a closed form stands."""
    reference: str
    curves: list[Curve]
    left_out: dict[str, str] = field(default_factory=dict)
    equal_samples: list[Shown] = field(default_factory=list)
    equal_time: list[Shown] = field(default_factory=list)


@dataclass
class Entry:
    """A contestant with what it rendered so far."""

    contestant: Contestant
    opened: dict[str, float] = field(default_factory=dict)
    levels: list[int] = field(default_factory=list)
    shots: dict[tuple[int, int], Shot] = field(default_factory=dict)
    """By samples per pixel and round."""
    reason: str = ""
    is_open: bool = False

    @property
    def name(self) -> str:
        return self.contestant.name


class Shelf:
    """Pictures of an unfinished scene on disk: a folder that belongs to just this race."""

    def __init__(self, folder: Path, key: str):
        self.folder = folder
        marker = folder / "key"
        if not marker.is_file() or marker.read_text() != key:
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir(parents=True)
            marker.write_text(key)

    def _path(self, name: str, what: str) -> Path:
        return self.folder / f"{hashlib.blake2b(name.encode(), digest_size=8).hexdigest()}-{what}"

    def shot(self, name: str, what: str, render: Callable[[], Shot]) -> Shot:
        """The picture that is there, else a new one."""
        path = self._path(name, f"{what}.npz")
        if path.is_file():
            with np.load(path) as kept:
                return Shot(kept["image"].astype(np.float64), float(kept["seconds"]))
        made = render()
        partial = path.with_name(f".{path.name}.part.npz")
        np.savez(partial, image=made.image.astype(np.float32), seconds=made.seconds)
        partial.replace(path)
        return Shot(made.image.astype(np.float32).astype(np.float64), made.seconds)

    def note(self, name: str, make: Callable[[], object]) -> object:
        """A decision or measurement that is made once."""
        path = self._path(name, "note.json")
        if path.is_file():
            return json.loads(path.read_text())
        value = make()
        partial = path.with_suffix(".part")
        partial.write_text(json.dumps(value))
        partial.replace(path)
        return value


def doubling(start: float, each: float, seconds: float, rounds: int) -> list[int]:
    """4, 8, 16, …: as many as take `seconds` in all rounds, at least four."""
    levels = [LEAST_SPP << k for k in range(LEAST_LEVELS)]
    while levels[-1] < MOST_SPP:
        more = [*levels, 2 * levels[-1]]
        if rounds * sum(start + each * spp for spp in more) > seconds:
            break
        levels = more
    return levels


@dataclass
class Race:
    """One scene."""

    of: Variant
    truth: Truth
    contestants: Sequence[Contestant]
    seconds: float
    """Of each contestant, all rounds together."""
    rounds: int
    shelf: Shelf
    tell: Callable[[str], None]

    def run(self) -> list[Entry]:
        entries = [Entry(one) for one in self.contestants]
        try:
            for entry in entries:
                self._attempt(entry, lambda entry=entry: self._prepare(entry))
            for number in range(self.rounds):
                for entry in entries:
                    self._attempt(entry, lambda entry=entry, number=number: self._round(entry, number))
                    self.tell(entry.name)
            for entry in entries:
                if not entry.reason:
                    entry.reason = self._problem(entry) or ""
            return entries
        except BaseException:
            self.close(entries)
            raise

    def close(self, entries: Iterable[Entry]) -> None:
        for entry in entries:
            if entry.is_open:
                entry.contestant.close()
                entry.is_open = False

    def _attempt(self, entry: Entry, action: Callable[[], None]) -> None:
        if entry.reason:
            return
        try:
            action()
        except (RenderError, NotFound) as error:
            entry.reason = str(error)
            self.close([entry])

    def _prepare(self, entry: Entry) -> None:
        """Two pictures tell what it costs, and so how far its samples double."""

        def plan() -> dict:
            opened = self._ready(entry)
            times = {spp: self._render(entry, spp, 1).seconds for spp in (LEAST_SPP, 4 * LEAST_SPP)}
            return {"opened": opened, "levels": doubling(*pace(times), self.seconds, self.rounds)}

        noted = self.shelf.note(entry.name, plan)
        assert isinstance(noted, dict)
        entry.opened, entry.levels = noted["opened"], noted["levels"]

    def _ready(self, entry: Entry) -> dict[str, float]:
        if entry.is_open:
            return entry.opened
        entry.is_open = True
        return entry.contestant.open()

    def _render(self, entry: Entry, spp: int, seed: int) -> Shot:
        self._ready(entry)
        made = entry.contestant.render(spp, seed)
        image = Image(made.image)
        problem = checks.size_problem(image, *self.truth.shape) or checks.number_problem(image)
        if problem:
            raise RenderError(problem)
        return made

    def _round(self, entry: Entry, number: int) -> None:
        seeds = make_seeds(f"{self.of.label}/{entry.name}/curves/{number}", len(entry.levels))
        for spp, seed in zip(entry.levels, seeds, strict=True):
            entry.shots[spp, number] = self.shelf.shot(
                entry.name, f"{spp}-{number}", lambda spp=spp, seed=seed: self._render(entry, spp, seed)
            )

    def _problem(self, entry: Entry) -> str | None:
        images = [Image(entry.shots[entry.levels[-1], number].image) for number in range(self.rounds)]
        digests = [checks.digest(image) for image in images]
        return checks.seed_problem(digests, [f"round {k + 1}" for k in range(self.rounds)], self.truth.varies)

    def picture(self, entry: Entry, spp: int, key: str) -> tuple[Shot, int]:
        """One more, with the seed that it was made with."""
        [seed] = make_seeds(f"{self.of.label}/{entry.name}/{key}", 1)
        return self.shelf.shot(entry.name, f"{key}-{spp}", lambda: self._render(entry, spp, seed)), seed


def measured_curve(entry: Entry, of: Variant, truth: Truth, rounds: int) -> Curve:
    """The figures of a contestant that rendered everything."""
    stacks = {spp: np.stack([entry.shots[spp, k].image for k in range(rounds)]) for spp in entry.levels}
    scores = [convergence.score(spp, images, truth.mean) for spp, images in stacks.items()]
    floor2, mean = float(truth.variance.mean()), float(truth.mean.mean())
    start, each = _times(entry, rounds)
    levels = [convergence.level(one, floor2) for one in scores]
    shown = convergence.usable(scores, floor2, mean)
    lines = convergence.slopes(shown, truth.mean, truth.variance)
    whole = lines.rmse
    bias, detectable = _bias(entry.name, stacks[entry.levels[-1]], of, truth)
    flag, why = convergence.bend(whole.slope if whole else None, levels[-1].luck, bias)
    varies = scores[-1].variance > convergence.NOTHING * mean**2
    return Curve(
        name=entry.name,
        about=entry.contestant.about,
        command=entry.contestant.command,
        levels=levels,
        start_seconds=start,
        opened=entry.opened,
        sample_seconds=each,
        slope=whole.slope if whole else None,
        relative_slope=lines.relative.slope if lines.relative else None,
        slope_without_outliers=lines.without_outliers.slope if lines.without_outliers else None,
        flag=flag,
        why=why,
        detectable=detectable,
        seconds_to_target=_to_target(whole, scores[-1], floor2, mean, each.median, flag),
        efficiency=convergence.efficiency(scores[-1], each.median) if varies else None,
    )


def _times(entry: Entry, rounds: int) -> tuple[float, Spread]:
    """Seconds before the first sample, and for each sample, over the rounds."""
    lines = [
        convergence.line_of_times({spp: entry.shots[spp, k].seconds for spp in entry.levels})
        for k in range(rounds)
    ]
    return statistics.median(start for start, _ in lines), Spread.of([each for _, each in lines])


def _bias(name: str, images: Array, of: Variant, truth: Truth) -> tuple[str | None, float]:
    """What is wrong with the pictures of most samples beyond chance, and what bias would have been found."""
    traced = any(one.name == name and "L17" in one.lecture for one in TECHNIQUES)
    found, regions, _ = judge_few(images - truth.mean, truth, independent_pixels=not traced)
    if found.outcome is not Outcome.FAIL:
        return None, found.mde_image
    lights = read_content(of.path, of.parameters).lights
    mistake = checks.name_mistake(images, truth.mean, truth.variance, lights)
    return sentences.reason(found, regions, 0.0, mistake), found.mde_image


def _to_target(
    line: Fit | None, top: Scores, floor2: float, mean: float, each: float, flag: str
) -> float | None:
    """Seconds to a relative RMSE of 1 %, from the fitted line."""
    target = TARGET * mean
    if line is None or line.slope.value > -0.05:
        return None
    if flag == "bias" and top.bias2(floor2) > target**2:
        return None
    return max(line.samples_for(target), 1.0) * each


def race(
    of: Variant,
    contestants: Sequence[Contestant],
    *,
    seconds: float,
    rounds: int = ROUNDS,
    folder: Path,
    left_out: Mapping[str, str] | None = None,
    tell: Callable[[str], None] = lambda name: None,
) -> tuple[SceneCurves, dict[str, Array]]:
    """Measure a scene, or take what `folder` holds of the same race; figures, and pictures (H, W, 3) by key.
    `tell` hears of each round of each contestant.
    """
    reference = references.load_reference(of)
    truth = truth_of(reference)
    key = _key(of, truth, contestants, seconds, rounds)
    kept = _read_kept(folder, of.label, key)
    if kept:
        for _ in range(rounds):
            for one in contestants:
                tell(one.name)
        return kept
    shelf = Shelf(folder / f"{of.label}.part", key)
    run = Race(of, truth, contestants, seconds, rounds, shelf, tell)
    entries = run.run()
    try:
        curves = _relative([
            Curve(e.name, e.contestant.about, e.contestant.command, e.reason)
            if e.reason else measured_curve(e, of, truth, rounds)
            for e in entries
        ])  # fmt: skip
        samples, times, pictures = _pictures(run, entries, {c.name: c for c in curves})
    finally:
        run.close(entries)
    height, width = truth.shape
    found = SceneCurves(
        scene=of.label, width=width, height=height, rounds=rounds, baseline=_baseline(curves),
        mean=float(truth.mean.mean()), epsilon=convergence.epsilon(truth.mean),
        floor=float(np.sqrt(truth.variance.mean())),
        reference="closed form" if truth.closed_form else reference.made_by,
        curves=curves, left_out=dict(left_out or {}), equal_samples=samples, equal_time=times,
    )  # fmt: skip
    pictures = {"reference": truth.mean} | pictures
    _keep(folder, found, pictures, key)
    shutil.rmtree(shelf.folder, ignore_errors=True)
    return found, pictures


def _key(of: Variant, truth: Truth, contestants: Sequence[Contestant], seconds: float, rounds: int) -> str:
    """What makes two races the same."""
    who = [(c.name, c.command, getattr(c, "identity", "")) for c in contestants]
    what = [SCHEMA, variants.scene_hash(of.path, of.parameters), truth.digest, who, seconds, rounds]
    return hashlib.blake2b(json.dumps(what).encode(), digest_size=16).hexdigest()


def _baseline(curves: Sequence[Curve]) -> str:
    """The plain random walk, else `nee`, else the first that has an efficiency."""
    names = [one.name for one in curves if one.efficiency]
    return next((name for name in (BASELINE, FALLBACK, *names) if name in names), "")


def _relative(curves: list[Curve]) -> list[Curve]:
    """With efficiencies relative to the baseline's."""
    base = next((one.efficiency for one in curves if one.name == _baseline(curves)), None)
    return [
        Curve(**{**one.__dict__, "relative_efficiency": convergence.relative(one.efficiency, base)})
        if base and one.efficiency else one
        for one in curves
    ]  # fmt: skip


def shown_names(of: Variant, curves: Mapping[str, Curve]) -> list[str]:
    """Whose pictures are shown: oneray's default technique, the others that are not oneray's, the plain walk
    or `nee`.
    """
    own = {one.name for one in TECHNIQUES}
    alive = [name for name, one in curves.items() if not one.reason]
    best = standard_technique(of).name
    plain = next((name for name in (BASELINE, FALLBACK) if name in alive and name != best), None)
    wanted = [best, *(name for name in alive if name not in own), *([plain] if plain else [])]
    return [name for name in dict.fromkeys(wanted) if name in alive][:MOST_SHOWN]


def _pictures(
    run: Race, entries: Sequence[Entry], curves: Mapping[str, Curve]
) -> tuple[list[Shown], list[Shown], dict[str, Array]]:
    """One of each shown contestant with the same samples, and one within the same time: that which the first
    of them takes for these samples.
    """
    names = shown_names(run.of, curves)
    if not names:
        return [], [], {}
    by_name = {entry.name: entry for entry in entries}
    spp = min(by_name[name].levels[-1] for name in names)
    seconds = curves[names[0]].seconds(spp)
    samples, times, pictures = [], [], {}
    for name in names:
        entry, curve = by_name[name], curves[name]
        affordable = min(max(1, round(seconds / curve.seconds(1))), MOST_SPP)
        for kind, count, found in (("samples", spp, samples), ("time", affordable, times)):
            try:
                shot, seed = run.picture(entry, count, kind)
            except RenderError:
                continue
            key = f"{name}/{kind}"
            pictures[key] = shot.image
            found.append(_shown(key, curve, count, seed, shot.image, run.truth.mean))
    return samples, times, pictures


def _shown(key: str, curve: Curve, spp: int, seed: int, image: Array, reference: Array) -> Shown:
    squared = (image - reference) ** 2
    relmse = float((squared / (reference**2 + convergence.epsilon(reference))).mean())
    command = curve.command.replace("{spp}", str(spp)).replace("{seed}", str(seed))
    return Shown(key, curve.name, spp, curve.seconds(spp), float(np.sqrt(squared.mean())), relmse, command)


def _keep(folder: Path, found: SceneCurves, pictures: Mapping[str, Array], key: str) -> None:
    """Figures and pictures of a finished scene, each written as a whole; the figures last."""
    partial = folder / f".{found.scene}.part.npz"
    np.savez_compressed(partial, **{name: image.astype(np.float32) for name, image in pictures.items()})
    partial.replace(folder / f"{found.scene}.npz")
    text = folder / f".{found.scene}.json.part"
    text.write_text(json.dumps({"key": key} | asdict(found)), encoding="utf-8")
    text.replace(folder / f"{found.scene}.json")


def _read_kept(folder: Path, label: str, key: str) -> tuple[SceneCurves, dict[str, Array]] | None:
    """What is there of the same race."""
    figures, pixels = folder / f"{label}.json", folder / f"{label}.npz"
    if not (figures.is_file() and pixels.is_file()):
        return None
    kept = json.loads(figures.read_text(encoding="utf-8"))
    if kept.pop("key") != key:
        return None
    with np.load(pixels) as stored:
        return from_dict(kept), {name: stored[name].astype(np.float64) for name in stored.files}


def race_all(
    runners: Sequence[tuple[Variant, Sequence[Contestant], Mapping[str, str]]],
    *,
    seconds: float,
    minutes: float | None,
    rounds: int,
    folder: Path,
    on_step: Callable[[Step, int], None] | None = None,
) -> list[tuple[SceneCurves, dict[str, Array]]]:
    """Scene by scene: contestants, and which are left out and why. With `minutes`, `seconds` is lowered as
    needed for all to be done by then; a quarter of the time is for what is not rendering.
    """
    folder.mkdir(parents=True, exist_ok=True)
    total = rounds * sum(len(who) for _, who, _ in runners)
    started, result = time.monotonic(), []
    for index, (of, who, left_out) in enumerate(runners):

        def tell(name: str, of: Variant = of) -> None:
            if on_step:
                on_step(Step(of.label, name), total)

        each = seconds
        if minutes is not None:
            left = 60 * minutes - (time.monotonic() - started)
            each = max(0.0, min(seconds, 0.75 * left / sum(len(w) for _, w, _ in runners[index:])))
        kept = folder / f"{of.label}.seconds"
        if kept.is_file() and minutes is not None:
            each = float(kept.read_text())
        kept.write_text(repr(each))
        result.append(race(of, who, seconds=each, rounds=rounds, folder=folder, left_out=left_out, tell=tell))
    return result


def to_json(scenes: Sequence[SceneCurves], header: Mapping[str, object]) -> str:
    """All figures, four digits each, a contestant a line."""
    parts = []
    for one in scenes:
        lines = ",\n   ".join(
            json.dumps(rounded(asdict(c)), ensure_ascii=False, allow_nan=False) for c in one.curves
        )
        head = {k: v for k, v in asdict(one).items() if k != "curves"}
        text = json.dumps(rounded(head), ensure_ascii=False, allow_nan=False)
        parts.append(f'{text[:-1]}, "curves": [\n   {lines}]}}')
    top = json.dumps(dict(header), indent=1, ensure_ascii=False).removesuffix("\n}")
    listed = ",\n  ".join(parts)
    return f'{top},\n "scenes": [\n  {listed}\n ]\n}}\n'


def read(path: Path) -> tuple[list[SceneCurves], dict]:
    """The scenes and the header of a file that `to_json` wrote; NotFound if it is none."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        scenes = [from_dict(one) for one in found.pop("scenes")]
    except (OSError, ValueError, KeyError, TypeError) as error:
        what = error or "wrong structure"
        raise NotFound(f"{path}: no result of raycheck report --json ({what})") from None
    return scenes, found


BANDS = ("slope", "relative_slope", "slope_without_outliers", "efficiency", "relative_efficiency")


def from_dict(found: Mapping) -> SceneCurves:
    """From what asdict made of it."""
    shown = {k: [Shown(**one) for one in found[k]] for k in ("equal_samples", "equal_time")}
    curves = [_curve_from(one) for one in found["curves"]]
    return SceneCurves(**{**found, **shown, "curves": curves})


def _curve_from(found: Mapping) -> Curve:
    bands = {k: Band(**found[k]) for k in BANDS if found[k]}
    spread = {"sample_seconds": Spread(**found["sample_seconds"])} if found["sample_seconds"] else {}
    levels = [
        Level(**{k: Band(**v) if isinstance(v, dict) else v for k, v in one.items()})
        for one in found["levels"]
    ]
    return Curve(**{**found, **bands, **spread, "levels": levels})
