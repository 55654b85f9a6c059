"""How often a mistake is called by its name.

Held out: other patches, or other strengths, of the catalogued mistakes, rendered with seeds of their own. And
mistakes without a counterpart: each catalogued one, with its own signature taken away, ought to be "unknown".
Those that look just like another one in all that is seen, by their signatures, are counted apart: to tell
them as that one is no error. `diagnosis.KNOWN` is the least hundredth with the most unknown of the even half
of the catalogue, by all scenes; the other half, and what is held out, had no part in it.
"""

import hashlib
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from raycheck.calibration import trials
from raycheck.calibration.mutants import Mutant
from raycheck.calibration.signatures import COMPLETE, Pair, pairs, read_pair
from raycheck.judging.diagnosis import USUAL, Diagnosis, catalogue, diagnose, load, scenes
from raycheck.judging.tile_errors import TileErrors, errors_of_means
from raycheck.truth.provenance import provenance

METHOD = 1
"""Version of how mistakes are named, see truth.provenance."""
SAME = 0.15
"""Relative difference of signatures below which two mistakes look the same."""


def errors_of(work: Path, pair: Pair) -> TileErrors | None:
    """The broken program against the reference; None where it gives no image."""
    read = read_pair(work, pair)
    if read is None:
        return None
    return errors_of_means(pair.scene, read[0], trials.load_truth(pair.scene))


def summary(work: Path, wanted: Sequence[Mutant]) -> dict[str, object]:
    """Shares, and every case that went wrong: by all complete scenes, and by the one that shows it."""
    found = {(p.mutant.name, p.scene): errors_of(work, p) for p in pairs(wanted) if p.scene in scenes()}

    def told(mutant: Mutant, by: Sequence[str], without: Sequence[str] = ()) -> Diagnosis | None:
        seen = [one for scene in by if (one := found.get((mutant.name, scene))) is not None]
        result = diagnose(seen, without) if seen else None
        return result if result and result.significant else None

    return {
        "provenance": provenance(METHOD, {name for pair in pairs(wanted) for name in pair.rests_on}),
        "all scenes": _shares(wanted, lambda m, w=(): told(m, COMPLETE, w), lambda m: COMPLETE),
        "one image": _shares(wanted, lambda m, w=(): told(m, [m.scene], w), lambda m: [m.scene]),
    }


def _shares(
    wanted: Sequence[Mutant], told: Callable[..., Diagnosis | None], by: Callable[[Mutant], Sequence[str]]
) -> dict[str, object]:
    named = {m: one for m in wanted if m.variant and (one := told(m))}
    first = [m for m, one in named.items() if one.known and one.guesses[0].mistake.name == m.variant]
    three = [m for m, one in named.items() if m.variant in [g.mistake.name for g in one.guesses]]
    orphans = {m: one for m in wanted if m.catalogued and (one := told(m, [m.name]))}
    misnamed = {m: one for m, one in orphans.items() if one.known}
    twins = [m for m in orphans if twin(m.name, by(m))]
    odd = [m for m in orphans if not even(m.name)]
    by_strength = [m for m, one in misnamed.items() if abs(np.log(one.guesses[0].strength)) > USUAL]
    return {
        "held_out": len(named), "first": len(first), "among_three": len(three),
        "missed": {m.name: _words(one) for m, one in named.items() if m not in first},
        "orphans": len(orphans), "unknown": len(orphans) - len(misnamed),
        "odd_half": len(odd), "odd_half_unknown": len([m for m in odd if m not in misnamed]),
        "twins": len(twins), "twins_unknown": len([m for m in twins if m not in misnamed]),
        "told_as_another_strength": len(by_strength),
        "misnamed": {m.name: _words(one) for m, one in misnamed.items()},
    }  # fmt: skip


def even(name: str) -> bool:
    """Whether it is in the half of the catalogue by which KNOWN was chosen."""
    return hashlib.sha256(name.encode()).digest()[0] % 2 == 0


def twin(name: str, by: Sequence[str]) -> str | None:
    """A mistake whose signatures in these scenes are the same; None if there is none."""
    size: dict[str, float] = {}
    for scene in by:
        of = load(scene)
        relative = of.error / np.maximum(np.abs(of.error).max(axis=0), 1e-30)
        signatures = dict(zip(of.names, relative, strict=True))
        nothing = np.zeros(of.error.shape[1:])
        own = signatures.get(name, nothing)
        for other in catalogue():
            distance = float(((signatures.get(other, nothing) - own) ** 2).sum())
            size[other] = size.get(other, 0.0) + distance
        size[""] = size.get("", 0.0) + float((own**2).sum())
    whole = size.pop("")
    same = [other for other, distance in size.items() if other != name and distance < SAME**2 * whole]
    return same[0] if same else None


def _words(found: Diagnosis) -> list[str]:
    return [f"{g.mistake.name} {g.fit:.2f} × {g.strength:.2f}" for g in found.guesses]
