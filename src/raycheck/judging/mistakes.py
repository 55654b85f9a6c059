"""The catalogued mistakes: what each adds to the picture of a correct renderer.

A signature is that, as means of 8×8 tiles: measured once with the patched program and the correct one from
the same seeds (`raycheck calibrate signatures`), so that their noise cancels.
`references/signatures/SCENE.npz` holds those of a scene, `manifest.json` what each mistake is, the hashes of
the scenes that they belong to and the payloads of the mistakes.
"""

import functools
import itertools
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from raycheck.base import data
from raycheck.base.arrays import Array
from raycheck.base.errors import ReferenceError_
from raycheck.scene import variants


@dataclass(frozen=True)
class Mistake:
    """One that has a signature."""

    name: str
    technique: str
    mistake: str
    symptom: str


@dataclass(frozen=True)
class Signatures:
    """The signatures of all mistakes that show in one scene."""

    names: Sequence[str]
    error: Array
    """(M, T, 3) what each mistake adds to the mean of each tile, W·sr⁻¹·m⁻²."""
    variance: Array
    """(M, T, 3) of that."""


class Signature(NamedTuple):
    """A mistake and what it adds to some scenes, their tiles side by side."""

    of: Mistake
    error: Array
    """(T, 3) W·sr⁻¹·m⁻²."""
    variance: Array
    """(T, 3) of that."""


def signatures_in(scenes: Sequence[str]) -> Iterator[Signature]:
    """Of each mistake that can be looked for in these scenes. One without a signature adds nothing to a scene
    that has those of all; in another scene nothing is known of it. ReferenceError_ where nothing is known of
    any.
    """
    found = {scene: load(scene) for scene in scenes}
    for mistake in catalogue().values():
        if all(mistake.name in found[s].names for s in scenes if s not in complete_scenes()):
            shown = [_shown(found[scene], mistake.name) for scene in scenes]
            if any(error.any() for error, _ in shown):
                error, variance = (np.concatenate([pair[i] for pair in shown]) for i in (0, 1))
                yield Signature(mistake, error, variance)


def _shown(of: Signatures, name: str) -> tuple[Array, Array]:
    if name not in of.names:
        nothing = np.zeros(of.error.shape[1:])
        return nothing, nothing
    at = list(of.names).index(name)
    return of.error[at], of.variance[at]


APART = 0.2
"""Difference of two signatures, relative to the larger, from which a scene tells the mistakes apart."""


def telling_scene(names: Sequence[str]) -> str | None:
    """The scene that has the signatures of all mistakes and tells any two of these apart the best; None if no
    scene does.
    """

    def apart(of: Signatures, one: str, other: str) -> float:
        a, b = _shown(of, one)[0], _shown(of, other)[0]
        size = max(float((a**2).sum()), float((b**2).sum()))
        return math.sqrt(float(((a - b) ** 2).sum()) / size) if size else 0.0

    pairs = list(itertools.combinations(names, 2))
    if not pairs:
        return None
    best = {scene: min(apart(load(scene), *pair) for pair in pairs) for scene in complete_scenes()}
    scene = max(best, key=best.__getitem__, default=None)
    return scene if scene and best[scene] > APART else None


def folder() -> Path:
    return data.references_dir() / "signatures"


@functools.lru_cache(maxsize=1)
def manifest() -> Mapping[str, Any]:
    """Scenes and mistakes; ReferenceError_ where there are no signatures."""
    path = folder() / "manifest.json"
    if not path.is_file():
        raise ReferenceError_(f"{path} is missing; make it with: raycheck calibrate signatures")
    result: Mapping[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return result


def scenes() -> list[str]:
    """The scenes that have signatures."""
    return list(manifest()["scenes"])


def complete_scenes() -> list[str]:
    """The scenes that have the signatures of all mistakes that show in them."""
    return [name for name, entry in manifest()["scenes"].items() if entry["complete"]]


def catalogue() -> dict[str, Mistake]:
    """The mistakes that can be named."""
    return {
        name: Mistake(name, m["technique"], m["mistake"], m["symptom"])
        for name, m in manifest()["mistakes"].items()
    }


@functools.lru_cache(maxsize=64)
def load(scene: str) -> Signatures:
    """ReferenceError_ where there are none, or those of another state of the scene."""
    entry = manifest()["scenes"].get(scene)
    if entry is None:
        raise ReferenceError_(f"there are no signatures for {scene}; there are for {', '.join(scenes())}")
    if entry["hash"] != variants.scene_hash(variants.scene_path(scene)):
        raise ReferenceError_(
            f"the signatures of {scene} are stale: the scene has changed since; "
            "renew them with: raycheck calibrate signatures"
        )
    with np.load(folder() / f"{scene}.npz") as arrays:
        error, deviation = (np.asarray(arrays[k], dtype=np.float64) for k in ("error", "deviation"))
    return Signatures(entry["mistakes"], error, deviation**2)
