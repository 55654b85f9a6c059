"""The parts of a scene's light: what the paths of one light, of one length, first seen on one surface, add.

That to the image of a correct renderer, as means of 8×8 tiles (`raycheck calibrate parts`;
`references/parts/SCENE.npz`). A hypothesis is that one sum of them has another factor and all else is right.
"""

import functools
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from raycheck.base import data
from raycheck.base.arrays import Array
from raycheck.scene import variants

INEXACT = 0.01
"""What a template may be off in a tile, relative to what it explains there: some pixels show two surfaces."""

LENGTH_GROUPS = {
    "": ("emission", "direct", "two bounces", "more bounces"),
    "emission": ("emission",),
    "direct": ("direct",),
    "two bounces": ("two bounces",),
    "more bounces": ("more bounces",),
    "reflected": ("direct", "two bounces", "more bounces"),
    "indirect": ("two bounces", "more bounces"),
}
"""Sets of path lengths that mistakes are about; "" is all."""


@dataclass(frozen=True)
class Parts:
    """What each light, path length and surface adds to one scene."""

    lights: Sequence[str]
    lengths: Sequence[str]
    surfaces: Sequence[str]
    image: Array
    """(L, D, S, T, 3), W·sr⁻¹·m⁻²; the sum over L, D and S is the image."""
    variance: Array
    """(L, D, S, T, 3) of that."""


@dataclass(frozen=True)
class Hypothesis:
    """The part of the light that has another factor; "" says nothing."""

    light: str = ""
    length: str = ""
    surface: str = ""

    @property
    def says(self) -> int:
        """How many of light, length and surface it names."""
        return sum(map(bool, (self.light, self.length, self.surface)))


class Part(NamedTuple):
    """A part of the light and what it adds."""

    of: Hypothesis
    image: Array
    """(T, 3) template, W·sr⁻¹·m⁻²."""
    variance: Array
    """(T, 3) of that."""


def folder() -> Path:
    return data.references_dir() / "parts"


@functools.lru_cache(maxsize=1)
def manifest() -> Mapping[str, Any]:
    path = folder() / "manifest.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}


@functools.lru_cache(maxsize=64)
def load(scene: str) -> Parts | None:
    """The parts of a scene; None where there are none, or those of another state of it."""
    entry = manifest().get(scene)
    if entry is None or entry["hash"] != variants.scene_hash(variants.scene_path(scene)):
        return None
    with np.load(folder() / f"{scene}.npz") as arrays:
        image, deviation = (np.asarray(arrays[k], dtype=np.float64) for k in ("image", "deviation"))
    return Parts(entry["lights"], entry["lengths"], entry["surfaces"], image, deviation**2)


def hypotheses(of: Parts) -> Iterator[Part]:
    """Those that say least first."""
    lengths = {name: [of.lengths.index(x) for x in group if x in of.lengths]
               for name, group in LENGTH_GROUPS.items()}  # fmt: skip
    lengths = {
        name: found
        for index, (name, found) in enumerate(lengths.items())
        if found and (not index or found not in list(lengths.values())[1:index])
    }  # a set that is the same as one before it is the same part of the light
    lights = {"": range(len(of.lights))} | {n: [i] for i, n in enumerate(of.lights) if len(of.lights) > 1}
    shown = {"": range(len(of.surfaces))} | {n: [i] for i, n in enumerate(of.surfaces)}
    all_of_them = [Hypothesis(a, b, c) for a in lights for b in lengths for c in shown]
    for one in sorted(all_of_them, key=lambda h: (h.says, bool(h.surface), bool(h.light))):
        at = np.ix_(lights[one.light], lengths[one.length], shown[one.surface])
        image = of.image[at].sum(axis=(0, 1, 2))
        if image.any():
            yield Part(one, image, of.variance[at].sum(axis=(0, 1, 2)))


def families(of: Parts, found: Sequence[Part]) -> Iterator[list[Part]]:
    """Parts that may each have a factor of their own: all lights, or their direct or reflected light, all
    path lengths, all surfaces.
    """
    told = [
        [part for part in found if part.of.says == 1 and getattr(part.of, kind) in names]
        for kind, names in (("light", of.lights), ("length", of.lengths), ("surface", of.surfaces))
    ]
    for length in ("direct", "reflected"):
        told.append([p for p in found if p.of.light and p.of.length == length and not p.of.surface])
    yield from (family for family in told if len(family) > 1)
