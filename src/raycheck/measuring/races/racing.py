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
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.errors import RenderError
from raycheck.base.files import whole, write_whole
from raycheck.base.machine import machine, today
from raycheck.judging.agenda import standard_technique
from raycheck.measuring.contestants import Contestant
from raycheck.measuring.races.curves import Curve, SceneCurves, Shown, from_dict
from raycheck.measuring.races.measured import measured_curve
from raycheck.measuring.races.race import MOST_SPP, Entry, Race, Shelf
from raycheck.measuring.step import Step
from raycheck.scene import variants
from raycheck.scene.techniques import BASELINE, FALLBACK, TECHNIQUES
from raycheck.scene.variants import Variant
from raycheck.stats import convergence
from raycheck.truth import references
from raycheck.truth.expected import Truth, truth_of
from raycheck.truth.provenance import provenance

METHOD = 1
"""Version of how races are run and read, see truth.provenance."""

LEAST_ROUNDS, ROUNDS = 6, 8

MOST_SHOWN = 5
"""Contestants whose pictures are shown."""


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
        provenance=provenance(METHOD, rests_on(of.label, [curve.name for curve in curves])),
        machine=machine(), date=today(),
    )  # fmt: skip
    pictures = {"reference": truth.mean} | pictures
    _keep(folder, found, pictures, key)
    shutil.rmtree(shelf.folder, ignore_errors=True)
    return found, pictures


def rests_on(label: str, contestants: Iterable[str]) -> list[str]:
    """The pictures that the curves of a scene rest on: oneray's, and the reference."""
    return [f"reference {label}", *(f"{label} {name} auto" for name in contestants)]


def _key(of: Variant, truth: Truth, contestants: Sequence[Contestant], seconds: float, rounds: int) -> str:
    """What makes two races the same."""
    who = [(c.name, c.command, getattr(c, "identity", "")) for c in contestants]
    what = [METHOD, variants.scene_hash(of.path, of.parameters), truth.digest, who, seconds, rounds]
    return hashlib.blake2b(json.dumps(what).encode(), digest_size=16).hexdigest()


def _baseline(curves: Sequence[Curve]) -> str:
    """The plain random walk, else `nee`, else the first that has an efficiency."""
    names = [one.name for one in curves if one.efficiency]
    return next((name for name in (BASELINE, FALLBACK, *names) if name in names), "")


def _relative(curves: list[Curve]) -> list[Curve]:
    """The curves with efficiencies relative to the baseline's."""
    base = next((one.efficiency for one in curves if one.name == _baseline(curves)), None)
    return [
        Curve(**{**one.__dict__, "relative_efficiency": convergence.relative(one.efficiency, base)})
        if base and one.efficiency else one
        for one in curves
    ]  # fmt: skip


def shown_names(of: Variant, curves: Mapping[str, Curve]) -> list[str]:
    """The contestants whose pictures are shown: oneray's default technique, the others that are not oneray's,
    the plain walk or `nee`.
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
    samples: list[Shown] = []
    times: list[Shown] = []
    pictures = {}
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
    with whole(folder / f"{found.scene}.npz") as partial:
        small: dict[str, Any] = {name: image.astype(np.float32) for name, image in pictures.items()}
        np.savez_compressed(partial, **small)
    write_whole(folder / f"{found.scene}.json", json.dumps({"key": key} | asdict(found)))


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
