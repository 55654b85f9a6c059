"""Signature images of the catalogued mistakes, and the images by which naming is measured.

A program with a mistake and the correct one render the same seeds; where a first picture is the same bit for
bit, the mistake does not show in that scene, and all its pictures are the correct ones. Tile means are kept
under build/calibration until the signatures are put together.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.errors import RenderError
from raycheck.base.files import whole, write_whole
from raycheck.base.seeds import make_seeds
from raycheck.calibration import mutants, trials
from raycheck.calibration.mutants import Mutant
from raycheck.judging.mistakes import folder
from raycheck.scene import variants
from raycheck.scene.content import read_content
from raycheck.scene.techniques import applicable, technique
from raycheck.stats.tiles import grid, region_means
from raycheck.truth import provenance, references

METHOD = 1
"""Version of how signatures are measured, see truth.provenance."""
SPP, SEEDS = 8, 8


@dataclass(frozen=True)
class Pair:
    """A program and a scene."""

    mutant: Mutant
    scene: str

    @property
    def rests_on(self) -> list[str]:
        """The pictures of the mistake, and the correct ones of the same technique."""
        return [f"mutant {self.mutant.name}", f"{self.scene} {self.mutant.shows} double"]


COMPLETE = (
    "point-light", "area-light", "many-lights", "spherical-light", "open-sky", "mirror-light",
    "mixed-material", "furnace", "cornell-box", "glass-ball",
)  # fmt: skip
"""Scenes that have the signatures of all mistakes that show in them; a mistake that shows best in another
scene has one there as well.
"""


def scenes_of(wanted: Sequence[Mutant]) -> list[str]:
    """The scenes for which signatures are made."""
    return [*COMPLETE, *sorted({mutant.scene for mutant in wanted} - set(COMPLETE))]


def pairs(wanted: Sequence[Mutant]) -> list[Pair]:
    """Each mistake in each complete scene that its technique applies to, and in the one that shows it."""
    found = []
    for scene in scenes_of(wanted):
        possible = applicable(read_content(variants.scene_path(scene)))
        found += [
            Pair(m, scene)
            for m in wanted
            if not m.equivalent and technique(m.shows) in possible and (scene in COMPLETE or scene == m.scene)
        ]
    return found


def render_pairs(work: Path, wanted: Sequence[Mutant], only: Sequence[Mutant] = ()) -> Iterator[Pair]:
    """Tile means of all pairs, or those of some mutants, kept in `work`; what is there already is kept."""
    work.mkdir(parents=True, exist_ok=True)
    for pair in pairs(wanted):
        if only and pair.mutant not in only:
            continue
        path = means_file(work, pair)
        if not path.is_file():
            _render_pair(pair, path, work)
            yield pair


def means_file(work: Path, pair: Pair) -> Path:
    """Where the means of a pair are kept: another picture of either program has another file."""
    return work / f"{pair.mutant.name}-{provenance.digest(METHOD, pair.rests_on)}@{pair.scene}.npz"


def _render_pair(pair: Pair, path: Path, work: Path) -> None:
    """(SEEDS, T, 3) tile means of the program, and of the correct one from the same seeds; empty where the
    mistake gives no image.
    """
    program, name = mutants.program(pair.mutant), pair.mutant.shows
    # Variants are tests of naming: they have seeds of their own.
    key = f"signature/{pair.scene}/{bool(pair.mutant.variant)}"
    seeds = make_seeds(key, SEEDS)
    none = np.zeros((0, len(grid(*_shape(pair.scene))), 3))
    broken = right = none
    try:
        first, correct = _correct_means(pair.scene, name, seeds, work)
        same = np.array_equal(trials.Program(program, name).images(pair.scene, [(1, 1)])[0], first)
        broken = correct if same else _tile_means(program, pair.scene, name, seeds)
        right = correct
    except RenderError:
        broken = right = none
    _save(path, broken=broken, right=right)


def _shape(scene: str) -> tuple[int, int]:
    entry = references.require(variants.variant(scene))
    return entry["height"], entry["width"]


def _tile_means(program: Path, scene: str, name: str, seeds: Sequence[int]) -> Array:
    images = trials.Program(program, name).images(scene, [(SPP, seed) for seed in seeds])
    return region_means(images, grid(*_shape(scene)))


def _correct_means(scene: str, name: str, seeds: Sequence[int], work: Path) -> tuple[Array, Array]:
    """A first picture by the correct program, and its tile means."""
    digest = provenance.digest(METHOD, [f"{scene} {name} double"])
    path = work / f"correct-{digest}-{name}-{seeds[0]}@{scene}.npz"
    if not path.is_file():
        program = mutants.program(None)
        first = trials.Program(program, name).images(scene, [(1, 1)])[0]
        _save(path, first=first, right=_tile_means(program, scene, name, seeds))
    with np.load(path) as arrays:
        return arrays["first"], arrays["right"]


def _save(path: Path, **arrays: Any) -> None:
    with whole(path) as partial:
        np.savez_compressed(partial, **arrays)


def read_pair(work: Path, pair: Pair) -> tuple[Array, Array] | None:
    """Tile means of the broken program and of the correct one; None if there is no image."""
    path = means_file(work, pair)
    if not path.is_file():
        return None
    with np.load(path) as arrays:
        broken, right = arrays["broken"], arrays["right"]
    return (broken, right) if len(broken) else None


def _shows(difference: Array) -> bool:
    """Whether the mean of (SEEDS, T, 3) differs by more than noise; mistakes in the seeds do not."""
    variance = difference.var(axis=0, ddof=1) / len(difference)
    varies = variance > 0
    z = difference.mean(axis=0)[varies] ** 2 / variance[varies]
    return bool((~varies & (difference.mean(axis=0) != 0)).any() or (varies.any() and z.mean() > 4))


def write_signatures(work: Path, wanted: Sequence[Mutant]) -> Path:
    """Put those of the catalogued mistakes together, scene by scene, and write the manifest last."""
    target = folder()
    target.mkdir(parents=True, exist_ok=True)
    mistakes = [m for m in wanted if m.catalogued]
    scenes, seen = {}, set()
    for scene in scenes_of(wanted):
        names, errors, deviations = [], [], []
        for mutant in mistakes:
            found = read_pair(work, Pair(mutant, scene))
            if found is None:
                continue
            difference = found[0] - found[1]
            if not _shows(difference):
                continue
            names.append(mutant.name)
            errors.append(difference.mean(axis=0))
            deviations.append(difference.std(axis=0, ddof=1) / np.sqrt(len(difference)))
        if not names:
            continue
        seen.update(names)
        _save(
            target / f"{scene}.npz",
            error=np.array(errors, dtype=np.float32), deviation=np.array(deviations, dtype=np.float16),
        )  # fmt: skip
        scenes[scene] = {
            "hash": variants.scene_hash(variants.scene_path(scene)), "mistakes": names,
            "spp": SPP * SEEDS, "complete": scene in COMPLETE,
            "provenance": provenance.provenance(
                METHOD, {p for m in mistakes if m.name in names for p in Pair(m, scene).rests_on}
            ),
        }  # fmt: skip
    listing = {
        "mistakes": {
            m.name: {"technique": m.technique, "mistake": m.mistake, "symptom": m.symptom}
            for m in mistakes
            if m.name in seen
        },
        "scenes": scenes,
    }
    write_whole(target / "manifest.json", json.dumps(listing, indent=1, ensure_ascii=False) + "\n")
    return target
