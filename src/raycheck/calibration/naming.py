"""How often a mistake is called by its name.

Held out: other patches, or other strengths, of the catalogued mistakes, rendered with seeds of their own. And
mistakes without a counterpart: each catalogued one, with its own signature taken away, must be "unknown".
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from raycheck.calibration import trials
from raycheck.calibration.signatures import COMPLETE, Pair, pairs, read_pair
from raycheck.diagnosis import Diagnosis, Evidence, diagnose, fine_tiles
from raycheck.mutants import Mutant
from raycheck.tiles import region_means, region_variances


def evidence_of(
    work: Path, mutant: Mutant, wanted: Sequence[Mutant], scene: str | None = None
) -> list[Evidence]:
    """Of the complete scenes that its technique applies to, or of one; none if nothing was rendered."""
    found = []
    for pair in pairs(wanted):
        if pair.mutant is mutant and (pair.scene == scene if scene else pair.scene in COMPLETE):
            found += _evidence(work, pair)
    return found


def _evidence(work: Path, pair: Pair) -> list[Evidence]:
    """The broken program against the reference; nothing where it does not differ from the correct one."""
    read = read_pair(work, pair)
    if read is None:
        return []
    truth = trials.load_truth(pair.scene)
    tiles = fine_tiles(*truth.shape)
    mean = region_means(truth.mean, tiles)
    floor = np.abs(truth.mean).mean(axis=(0, 1)) / 10
    scale = np.maximum(np.abs(mean), np.where(floor > 0, floor, 1.0))
    broken = read[0]
    variance = broken.var(axis=0, ddof=1) / len(broken) + region_variances(truth.variance, tiles)
    return [Evidence(pair.scene, broken.mean(axis=0) - mean, variance, scale)]


def summary(work: Path, wanted: Sequence[Mutant]) -> dict[str, object]:
    """Shares, and every case that went wrong."""
    result: dict[str, object] = {}
    for which in ("all scenes", "one image"):
        variants = [m for m in wanted if m.variant]
        named = {m.name: _diagnosis(work, m, wanted, which) for m in variants}
        right = {m.name: m.variant for m in variants}
        told = {name: found for name, found in named.items() if found and found.significant}
        first = [n for n, f in told.items() if f.known and f.guesses[0].mistake.name == right[n]]
        three = [n for n, f in told.items() if right[n] in [g.mistake.name for g in f.guesses]]
        unknown = {
            m.name: _diagnosis(work, m, wanted, which, without=[m.name]) for m in wanted if m.catalogued
        }
        orphans = {name: found for name, found in unknown.items() if found and found.significant}
        result[which] = {
            "held_out": len(told), "first": len(first), "among_three": len(three),
            "missed": {n: _told(f) for n, f in told.items() if n not in first},
            "orphans": len(orphans), "unknown": sum(not f.known for f in orphans.values()),
            "misnamed": {n: _told(f) for n, f in orphans.items() if f.known},
        }  # fmt: skip
    return result


def _diagnosis(
    work: Path, mutant: Mutant, wanted: Sequence[Mutant], which: str, without: Sequence[str] = ()
) -> Diagnosis | None:
    found = evidence_of(work, mutant, wanted, mutant.scene if which == "one image" else None)
    return diagnose(found, without) if found else None


def _told(found: Diagnosis) -> list[str]:
    return [f"{g.mistake.name} {g.fit:.2f}" for g in found.guesses]
