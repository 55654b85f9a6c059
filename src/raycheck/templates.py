"""Which part of the light is wrong, and by how much? Templates, fitted to the error of an image.

A template is what the paths of one light, of one length, first seen on one surface add to the image of a
correct renderer, as means of 8×8 tiles (`raycheck calibrate templates`; `references/templates/SCENE.npz`).
A hypothesis is that one sum of them, T, has the factor 1 + c and everything else is right. With D the error,
V its covariance (blocks of the three channels of a tile, as tiles are independent), the generalised least
squares estimate and its variance are
    c = TᵀV⁻¹D / TᵀV⁻¹T,   var c = 1 / TᵀV⁻¹T,   χ² = (D - cT)ᵀV⁻¹(D - cT).
V has the noise of image and reference, of the template, and 1 % of what the template explains in each tile,
for pixels that show two surfaces. Something is said only if χ² is one of noise, and if no other hypothesis
that gives another picture does nearly as well.
"""

import functools
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import special

from raycheck import references
from raycheck.evidence import Evidence

Array = NDArray[np.float64]

CERTAINTY = 0.99
"""Confidence of the interval of a factor."""
INEXACT = 0.01
"""What a template may be off in a tile, relative to what it explains there."""
NOISE_ERRORS = 4.0
"""Standard deviations √(2n) of χ² that are still noise."""
SIMPLER = 6.0
"""What χ² has to fall by for each thing that a hypothesis says more…"""
CLEARLY = 9.0
"""…and by which the best must beat those that say something else."""
ALIKE = 1e-2
"""Pictures of two hypotheses that differ by less, relative to their size, are the same."""

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
class Templates:
    """Of one scene."""

    lights: Sequence[str]
    lengths: Sequence[str]
    surfaces: Sequence[str]
    image: Array
    """(L, D, S, T, 3), W·sr⁻¹·m⁻²; the sum over L, D and S is the image."""
    variance: Array
    """(L, D, S, T, 3) of that."""


@dataclass(frozen=True)
class Hypothesis:
    """Which part of the light has another factor; "" says nothing."""

    light: str = ""
    length: str = ""
    surface: str = ""

    @property
    def says(self) -> int:
        """Number of things."""
        return sum(map(bool, (self.light, self.length, self.surface)))


@dataclass(frozen=True)
class Part:
    """A part of the light that explains all of the error."""

    hypothesis: Hypothesis
    bias: float
    """c: −1 where it is missing, 1 where there is twice as much."""
    low: float
    high: float
    """99 % interval."""
    other: Hypothesis | None = None
    """Another part that would explain it just as well."""


def folder() -> Path:
    return references.references_dir() / "templates"


@functools.lru_cache(maxsize=1)
def manifest() -> Mapping:
    path = folder() / "manifest.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}


@functools.lru_cache(maxsize=64)
def load(scene: str) -> Templates | None:
    """None where there are none, or those of another state of the scene."""
    entry = manifest().get(scene)
    if entry is None or entry["hash"] != references.scene_hash(references.scene_path(scene)):
        return None
    with np.load(folder() / f"{scene}.npz") as arrays:
        image, deviation = (np.asarray(arrays[k], dtype=np.float64) for k in ("image", "deviation"))
    return Templates(entry["lights"], entry["lengths"], entry["surfaces"], image, deviation**2)


def hypotheses(of: Templates) -> Iterator[tuple[Hypothesis, Array, Array]]:
    """Each with its template and that one's variance, (T, 3), those that say least first."""
    lengths = {name: [of.lengths.index(x) for x in group if x in of.lengths]
               for name, group in LENGTH_GROUPS.items()}  # fmt: skip
    lengths = {name: found for name, found in lengths.items() if found}
    lights = {"": range(len(of.lights))} | {n: [i] for i, n in enumerate(of.lights) if len(of.lights) > 1}
    shown = {"": range(len(of.surfaces))} | {n: [i] for i, n in enumerate(of.surfaces)}
    all_of_them = [Hypothesis(a, b, c) for a in lights for b in lengths for c in shown]
    for one in sorted(all_of_them, key=lambda h: (h.says, bool(h.surface), bool(h.light))):
        at = np.ix_(lights[one.light], lengths[one.length], shown[one.surface])
        image = of.image[at].sum(axis=(0, 1, 2))
        if image.any():
            yield one, image, of.variance[at].sum(axis=(0, 1, 2))


@dataclass(frozen=True)
class _Fit:
    hypothesis: Hypothesis
    factor: float
    deviation: float
    chi: float
    image: Array

    @property
    def score(self) -> float:
        return self.chi + SIMPLER * self.hypothesis.says


def _fit(one: Hypothesis, image: Array, variance: Array, found: Evidence, noise: Array) -> _Fit:
    """V depends on c; three rounds are enough as it does so little."""
    factor, add = 0.0, np.eye(3)
    weighted, information = image, 1.0
    for _ in range(3):
        own = (factor**2) * (variance + (INEXACT * image) ** 2)
        inverse = np.linalg.inv(noise + own[:, :, None] * add)
        weighted = np.einsum("tij,tj->ti", inverse, image)
        information = max(float((weighted * image).sum()), 1e-300)
        factor = float((weighted * found.error).sum()) / information
    rest = found.error - factor * image
    chi = float(np.einsum("ti,tij,tj->", rest, inverse, rest))
    return _Fit(one, factor, information**-0.5, chi, image)


def explain(found: Evidence) -> Part | None:
    """The part of the light whose factor alone explains the error; None if there is none, or several."""
    of = load(found.scene)
    if of is None or of.image.shape[3] != len(found.error):
        return None
    noise = found.noise_blocks()
    fits = [_fit(one, image, variance, found, noise) for one, image, variance in hypotheses(of)]
    n = found.error.size
    good = [f for f in fits if f.chi <= n + NOISE_ERRORS * np.sqrt(2 * n)]
    if not good:
        return None
    best = min(good, key=lambda f: f.score)
    size = np.abs(best.factor * best.image).max()
    near = [f for f in good if f.score < best.score + CLEARLY]
    same = [f for f in near if np.abs(f.factor * f.image - best.factor * best.image).max() < ALIKE * size]
    others = [f for f in near if f not in same]
    if len(others) > 1 or abs(best.factor) < 4 * best.deviation:
        return None
    first = min(same, key=lambda f: f.hypothesis.says)
    half = -float(special.ndtri((1 - CERTAINTY) / 2)) * first.deviation
    return Part(
        first.hypothesis, first.factor, first.factor - half, first.factor + half,
        others[0].hypothesis if others else None,
    )  # fmt: skip
