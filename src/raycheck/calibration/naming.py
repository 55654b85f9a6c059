"""How often a mistake is called by its name, and how often by another's.

Three questions, by all complete scenes together and by the one scene that shows a mistake best: is each
catalogued mistake named, by the images that its signature was made of; is each that is held out (another
patch, or another strength, of a catalogued one, with seeds of its own); and is one named that has no
counterpart, each catalogued mistake with its own signature taken away? What looks just like it in all that is
seen is said then, and that is no error.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from raycheck.calibration import trials
from raycheck.calibration.mutants import Mutant
from raycheck.calibration.signatures import COMPLETE, Pair, pairs, read_pair
from raycheck.judging.explanations import Explanation, explain
from raycheck.judging.looks import Look, look_at_means
from raycheck.judging.mistakes import catalogue, load, scenes
from raycheck.truth.provenance import provenance

METHOD = 3
"""Version of how mistakes are named, see truth.provenance."""
SAME = 0.15
"""Relative difference of signatures below which two mistakes look the same."""


def seen(work: Path, pair: Pair) -> Look | None:
    """The broken program against the reference; None where it gives no image."""
    read = read_pair(work, pair)
    return None if read is None else look_at_means(pair.scene, read[0], trials.load_truth(pair.scene))


def summary(work: Path, wanted: Sequence[Mutant]) -> dict[str, object]:
    """Counts, and every case that went wrong: by all complete scenes, and by the one that shows it."""
    found = {(p.mutant.name, p.scene): seen(work, p) for p in pairs(wanted) if p.scene in scenes()}

    def shown(mutant: Mutant, by: Sequence[str]) -> list[str]:
        return [scene for scene in by if found.get((mutant.name, scene)) is not None]

    def told(mutant: Mutant, by: Sequence[str], without: Sequence[str] = ()) -> Explanation | None:
        looks = [one for scene in by if (one := found.get((mutant.name, scene))) is not None]
        return explain(looks, without) if any(one.differs for one in looks) else None

    return {
        "provenance": provenance(METHOD, {name for pair in pairs(wanted) for name in pair.rests_on}),
        "all scenes": _counts(wanted, lambda m, w=(): told(m, COMPLETE, w), lambda m: shown(m, COMPLETE)),
        "one image": _counts(wanted, lambda m, w=(): told(m, [m.scene], w), lambda m: shown(m, [m.scene])),
    }


def _counts(
    wanted: Sequence[Mutant], told: Callable[..., Explanation | None], by: Callable[[Mutant], Sequence[str]]
) -> dict[str, object]:
    own = {m: one for m in wanted if m.catalogued and (one := told(m)) is not None}
    held_out = {m: one for m in wanted if m.variant and (one := told(m)) is not None}
    orphans = {m: one for m in wanted if m.catalogued and (one := told(m, [m.name])) is not None}
    result: dict[str, object] = {}
    for kind, cases in (("catalogued", own), ("held_out", held_out)):
        named = [m for m, one in cases.items() if (m.variant or m.name) in _names(one)]
        wrong = {m.name: _names(one) for m, one in cases.items() if m not in named and one.mistakes}
        near = [
            m for m, one in cases.items() if (m.variant or m.name) in [n.mistake.name for n in one.nearest]
        ]
        result[kind] = {"of": len(cases), "named": len(named), "wrong": wrong, "among_three": len(near)}
    wrong = {
        m.name: others
        for m, one in orphans.items()
        if (others := [name for name in _names(one) if name not in twins(m.name, by(m))])
    }
    result["orphans"] = {"of": len(orphans), "wrong": wrong}
    return result


def _names(told: Explanation) -> list[str]:
    return [mistake.name for mistake in told.mistakes]


def twins(name: str, by: Sequence[str]) -> list[str]:
    """Mistakes whose signatures in these scenes are the same."""
    rest: dict[str, float] = {}
    whole = 0.0
    for scene in by:
        of = load(scene)
        relative = of.error / np.maximum(np.abs(of.error).max(axis=0), 1e-30)
        signatures = dict(zip(of.names, relative, strict=True))
        nothing = np.zeros(of.error.shape[1:])
        own = signatures.get(name, nothing)
        whole += float((own**2).sum())
        for other in catalogue():
            distance = float(((signatures.get(other, nothing) - own) ** 2).sum())
            rest[other] = rest.get(other, 0.0) + distance
    return [other for other, distance in rest.items() if other != name and distance < SAME**2 * whole]
