"""How often a mistake is called by its name.

Held out: other patches, or other strengths, of the catalogued mistakes, rendered with seeds of their own. And
mistakes without a counterpart: each catalogued one, with its own signature taken away, ought to be "unknown";
some are the same as another but for their strength, and are then told as that one.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from raycheck.calibration import trials
from raycheck.calibration.signatures import COMPLETE, Pair, pairs, read_pair
from raycheck.diagnosis import Diagnosis, Evidence, diagnose, fine_tiles
from raycheck.mutants import Mutant
from raycheck.tiles import region_means, region_variances

SAME = 0.15
"""Logarithm of the strength within which a mistake counts as that mistake itself."""


def evidence(work: Path, pair: Pair) -> Evidence | None:
    """The broken program against the reference; None where it does not differ from the correct one."""
    read = read_pair(work, pair)
    if read is None:
        return None
    truth = trials.load_truth(pair.scene)
    tiles = fine_tiles(*truth.shape)
    mean = region_means(truth.mean, tiles)
    floor = np.abs(truth.mean).mean(axis=(0, 1)) / 10
    scale = np.maximum(np.abs(mean), np.where(floor > 0, floor, 1.0))
    broken = read[0]
    variance = broken.var(axis=0, ddof=1) / len(broken) + region_variances(truth.variance, tiles)
    return Evidence(pair.scene, broken.mean(axis=0) - mean, variance, scale)


def summary(work: Path, wanted: Sequence[Mutant]) -> dict[str, object]:
    """Shares, and every case that went wrong: by all complete scenes, and by the one that shows it."""
    found = {(p.mutant.name, p.scene): evidence(work, p) for p in pairs(wanted)}

    def told(mutant: Mutant, scenes: Sequence[str], without: Sequence[str] = ()) -> Diagnosis | None:
        seen = [one for scene in scenes if (one := found.get((mutant.name, scene))) is not None]
        result = diagnose(seen, without) if seen else None
        return result if result and result.significant else None

    return {
        "all scenes": _shares(wanted, lambda m, w=(): told(m, COMPLETE, w)),
        "one image": _shares(wanted, lambda m, w=(): told(m, [m.scene], w)),
    }


def _shares(wanted: Sequence[Mutant], told) -> dict[str, object]:
    named = {m: one for m in wanted if m.variant and (one := told(m))}
    first = [m for m, one in named.items() if one.known and one.guesses[0].mistake.name == m.variant]
    three = [m for m, one in named.items() if m.variant in [g.mistake.name for g in one.guesses]]
    orphans = {m: one for m in wanted if m.catalogued and (one := told(m, [m.name]))}
    misnamed = {m: one for m, one in orphans.items() if one.known}
    by_strength = [m for m, one in misnamed.items() if abs(np.log(one.guesses[0].strength)) > SAME]
    return {
        "held_out": len(named), "first": len(first), "among_three": len(three),
        "missed": {m.name: _words(one) for m, one in named.items() if m not in first},
        "orphans": len(orphans), "unknown": len(orphans) - len(misnamed),
        "told_as_another_strength": len(by_strength),
        "misnamed": {m.name: _words(one) for m, one in misnamed.items()},
    }  # fmt: skip


def _words(found: Diagnosis) -> list[str]:
    return [f"{g.mistake.name} {g.fit:.2f} × {g.strength:.2f}" for g in found.guesses]
