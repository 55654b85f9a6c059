"""One scene of the benchmark: the pilot that picks Mitsuba's samplers, interleaved rounds, their figures."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from benchmark_contestants import (
    FOLDER,
    ROOT,
    SAMPLERS,
    Contestant,
    Failed,
    Mitsuba,
    Oneray,
    Render,
    oneray_contestants,
    spp_for,
    startup_mitsuba,
    startup_oneray,
)
from benchmark_scenes import BenchScene

from raycheck.truth.provenance import Provenance, provenance

METHOD = 1
"""Version of how scenes are measured, see raycheck.truth.provenance."""

Log = Callable[[str], None]
BASELINE = "mitsuba llvm"
VARIANTS = {BASELINE: "llvm_ad_rgb", "mitsuba scalar": "scalar_rgb"}
PILOT_RENDERS = 3
STARTUPS = 3


@dataclass
class Entry:
    """A contestant with its renders; `reason` says why there are no more."""

    contestant: Contestant
    spp: int = 0
    renders: list[Render] = field(default_factory=list)
    reason: str = ""


def spread(values: Sequence[float]) -> dict[str, float]:
    """Minimum, median and maximum."""
    return {"min": min(values), "median": statistics.median(values), "max": max(values)}


def path_variances(renders: Sequence[Render]) -> list[float]:
    """The variance of a path over the squared mean, as each of R renders of other seeds shows it.

    N·R/(R − 1)·⟨(x − x̄)²⟩ over pixels and channels, x̄ the mean of the R images: the average over the renders
    is the sample variance. For samples that are not independent it is N times the variance of the picture.
    """
    images = np.stack([one.image for one in renders])
    count, mean = len(images), images.mean(axis=0)
    square = float(images.mean()) ** 2
    scale = renders[0].spp * count / (count - 1) / square
    return [scale * float(((image - mean) ** 2).mean()) for image in images]


def variance_error(renders: Sequence[Render]) -> float:
    """Relative standard error of the variance over all renders; a few bright edges have most of it.

    A pixel's s² of R normal values has variance 2σ⁴/(R − 1), whose estimate is 2s⁴/(R + 1).
    """
    each = np.stack([one.image for one in renders]).var(axis=0, ddof=1).mean(axis=2)
    return math.sqrt(2 / (len(renders) + 1) * float((each**2).sum())) / float(each.sum() or 1)


def mean_and_error(renders: Sequence[Render]) -> tuple[float, float]:
    """The mean of the pictures and its standard error, pixels taken for independent."""
    grey = np.stack([one.image.mean(axis=2) for one in renders])
    return float(grey.mean()), math.sqrt(float(grey.var(axis=0, ddof=1).mean()) / grey.size)


def figures_by_round(renders: Sequence[Render], rays_per_path: float | None) -> dict[str, list[float]]:
    """Each figure's values over the rounds; `rays_per_path` for a renderer that does not count its rays."""
    rate = [one.paths / one.seconds for one in renders]
    variance = path_variances(renders)
    found = {"paths_per_second": rate, "variance": variance, "seconds": [one.seconds for one in renders]}
    if all(v > 0 for v in variance):
        found["efficiency"] = [r / v for r, v in zip(rate, variance, strict=True)]
    if renders[0].rays is not None:
        found["rays_per_second"] = [(one.rays or 0) / one.seconds for one in renders]
    elif rays_per_path is not None:
        found["rays_per_second"] = [r * rays_per_path for r in rate]
    return found


def pilot(name: str, scene: BenchScene, seconds: float, log: Log) -> list[dict]:
    """Every sampler of a Mitsuba variant, a few renders each, the one of least variance · time first."""
    worker = Mitsuba(name, VARIANTS[name])
    path, spp, outcome = scene.write(FOLDER), 0, []
    for sampler in SAMPLERS:
        worker.sampler = sampler
        try:
            worker.open(path)
            spp = spp or spp_for(worker, seconds, square=True)
            worker.render(spp, 1)
            renders = [worker.render(spp, 2 + i) for i in range(PILOT_RENDERS)]
        except (Failed, KeyboardInterrupt) as failed:
            worker.close()
            if isinstance(failed, KeyboardInterrupt):
                raise
            outcome.append({"sampler": sampler, "spp": spp, "cost": None, "reason": str(failed)})
            continue
        variance = statistics.fmean(path_variances(renders))
        time = statistics.median(one.seconds / one.paths for one in renders)
        outcome.append({"sampler": sampler, "spp": spp, "variance": variance, "seconds_per_path": time,
                        "cost": variance * time})  # fmt: skip
        log(f"{scene.name}: pilot {name} {sampler}: variance·time {variance * time:.3g} s")
    worker.close()
    return sorted(outcome, key=lambda one: math.inf if one["cost"] is None else one["cost"])


def best_of(outcome: list[dict]) -> str | None:
    """The best sampler but `independent`."""
    return next(
        (x["sampler"] for x in outcome if x["cost"] is not None and x["sampler"] != "independent"), None
    )


def entries_of(scene: BenchScene, offer: str, pilots: dict[str, list[dict]]) -> list[Entry]:
    """The baseline first; Mitsuba's samples per pixel as in the pilot."""
    entries = []
    for name, outcome in pilots.items():
        spp = max(one["spp"] for one in outcome)
        entries.append(Entry(Mitsuba(name, VARIANTS[name]), spp))
        best = best_of(outcome)
        if best is not None:
            entries.append(Entry(Mitsuba(f"{name} {best}", VARIANTS[name], best), spp))
    return entries + [Entry(one) for one in oneray_contestants(offer, scene.options, scene.choices)]


def _attempt(entry: Entry, action: Callable[[], None], log: Log) -> None:
    """A contestant that fails is out, with its reason; the others go on."""
    if entry.reason:
        return
    try:
        action()
    except Failed as failed:
        entry.reason = str(failed)
        entry.contestant.close()
        log(f"{entry.contestant.name} failed: {failed}")


def _prepare(entry: Entry, scene: BenchScene, seconds: float) -> None:
    """Opens it, chooses the samples per pixel, compiles."""
    entry.contestant.open(scene.write(FOLDER))
    if not entry.spp:
        entry.spp = spp_for(entry.contestant, seconds)
        if "sobol" in entry.contestant.name:
            entry.spp = 1 << (entry.spp.bit_length() - 1)
    entry.contestant.render(entry.spp, 1)


def run_rounds(scene: BenchScene, entries: list[Entry], rounds: int, seconds: float, log: Log) -> None:
    """Every round renders each contestant in turn, with seeds of its own."""
    for entry in entries:
        _attempt(entry, lambda entry=entry: _prepare(entry, scene, seconds), log)
    for number in range(rounds):
        for index, entry in enumerate(entries):
            seed = 1000 * (index + 1) + number
            _attempt(
                entry,
                lambda entry=entry, seed=seed: entry.renders.append(entry.contestant.render(entry.spp, seed)),
                log,
            )
        log(f"{scene.name}: round {number + 1} of {rounds}")
    for entry in entries:
        entry.contestant.close()


def row(entry: Entry, baseline: Entry, rays_per_path: float | None) -> dict:
    """A contestant's figures, and its ratios to the baseline within each round."""
    name, options = entry.contestant.name, getattr(entry.contestant, "options", ())
    if entry.reason or len(entry.renders) < 2:
        return {"name": name, "status": "failed", "reason": entry.reason or "too few rounds were finished"}
    found = figures_by_round(entry.renders, rays_per_path)
    mean, error = mean_and_error(entry.renders)
    result = {
        "name": name,
        "status": "ok",
        "options": list(options),
        "kernel": entry.renders[0].kernel,
        "spp": entry.renders[0].spp,
        "variance_error": variance_error(entry.renders),
        "mean": mean,
        "mean_error": error,
        "build_seconds": statistics.median(one.build for one in entry.renders),
        "peak_memory_bytes": max(one.memory for one in entry.renders),
        "rays_assumed": entry.renders[0].rays is None and rays_per_path is not None,
        "figures": {key: spread(values) for key, values in found.items()},
        "rounds": found,
        "ratios": {},
    }
    if baseline.reason or len(baseline.renders) < len(entry.renders):
        return result
    base = figures_by_round(baseline.renders, rays_per_path)
    for key in ("paths_per_second", "rays_per_second", "variance", "efficiency"):
        if key in found and key in base:
            result["ratios"][key] = spread([a / b for a, b in zip(found[key], base[key], strict=False)])
    base_mean, base_error = mean_and_error(baseline.renders)
    sigma = math.hypot(error, base_error)
    sigmas = (mean - base_mean) / sigma if sigma else 0.0
    result["difference"] = {"relative": mean / base_mean - 1, "sigmas": sigmas}
    return result


def startups(scene: BenchScene, rounds: int, log: Log) -> list[dict]:
    """Seconds from the start of a process to a picture of one sample per pixel."""
    path, runs = scene.write(FOLDER), min(rounds, STARTUPS)
    found: list[dict] = []
    for precision in ("double", "single"):
        one = Oneray(f"oneray {precision}", ("--precision", precision, *scene.options))
        one.open(path)
        try:
            found.append({"name": one.name, "total": spread([startup_oneray(one) for _ in range(runs)])})
        except Failed as failed:
            found.append({"name": one.name, "reason": str(failed)})
    for name, cold in ((BASELINE, True), (BASELINE, False), ("mitsuba scalar", False)):
        label = f"{name}, nothing compiled" if cold else name
        try:
            parts = [startup_mitsuba(VARIANTS[name], path, cold) for _ in range(1 if cold else runs)]
            found.append({"name": label} | {key: spread([p[key] for p in parts]) for key in parts[0]})
        except Failed as failed:
            found.append({"name": label, "reason": str(failed)})
    log(f"{scene.name}: start-up measured")
    return found


def rests_on(scene: BenchScene) -> Provenance:
    """The pictures of the scene's file."""
    name = scene.write(FOLDER).with_suffix("").relative_to(ROOT / "build")
    return provenance(METHOD, [f"{name} mis-default {precision}" for precision in ("double", "single")])


def measure_scene(scene: BenchScene, rounds: int, seconds: float, offer: str, log: Log) -> dict:
    """All of a scene, as it goes into the JSON file. After Ctrl-C: what the finished rounds say."""
    pilots = {name: pilot(name, scene, seconds, log) for name in VARIANTS}
    entries = entries_of(scene, offer, pilots)
    interrupted = False
    try:
        run_rounds(scene, entries, rounds, seconds, log)
    except KeyboardInterrupt:
        interrupted = True
        for entry in entries:
            entry.contestant.close()
    baseline, double = entries[0], next(e for e in entries if e.contestant.name == "oneray double")
    counted = double.renders and not scene.roulette
    rays_per_path = (double.renders[0].rays or 0) / double.renders[0].paths if counted else None
    image = next((e.renders[0].image for e in entries if e.renders), np.zeros((0, 0, 3)))
    return {
        "name": scene.name,
        "about": scene.about,
        "height": image.shape[0],
        "width": image.shape[1],
        "rounds": min((len(e.renders) for e in entries if not e.reason), default=0),
        "interrupted": interrupted,
        "contestants": [row(entry, baseline, rays_per_path) for entry in entries],
        "pilot": pilots,
        "startup": [] if interrupted else startups(scene, rounds, log),
        "provenance": rests_on(scene),
    }
