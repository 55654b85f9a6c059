"""Which part of the light is wrong, and by how much? Templates, fitted to the error of an image.

A template is what the paths of one light, of one length, first seen on one surface add to the image of a
correct renderer, as means of 8×8 tiles (`raycheck calibrate parts`; `references/parts/SCENE.npz`).
A hypothesis is that one sum of them, T, has the factor 1 + c and everything else is right. With D the error,
V its covariance (blocks of the three channels of a tile, as tiles are independent), the generalised least
squares estimate and its variance are
    c = TᵀV⁻¹D / TᵀV⁻¹T,   var c = 1 / TᵀV⁻¹T,   χ² = (D - cT)ᵀV⁻¹(D - cT).
V has the noise of image and reference, of the template, and 1 % of what the template explains in each tile,
for pixels that show two surfaces. Something is said only if χ² is one of noise, if a factor of its own for
each light, path length or surface would not lower it by more than noise does, and if no more than one other
hypothesis that gives another picture does nearly as well. Where no single part explains the error, each
light, or each path length, may have a factor of its own.
"""

import functools
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy import special

from raycheck.base import data
from raycheck.base.arrays import Array
from raycheck.judging.tile_errors import TileErrors
from raycheck.scene import variants

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
SHARP = 0.1
"""Half of an interval over the largest bias, beyond which noise may hide what else is wrong."""
SURELY = 4.0
"""Standard errors from which a factor is not 1."""
BY_CHANCE = 1e-3
"""How rarely a family's own factors may lower χ² so much by chance."""
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


@dataclass(frozen=True)
class Factor:
    """The factor of one part of the light: 1 + bias."""

    of: Hypothesis
    bias: float
    """−1 where it is missing, 1 where there is twice as much."""
    low: float
    high: float
    """The end of its 99 % interval, from `low`."""


@dataclass(frozen=True)
class Explanation:
    """All of the error: these parts have other factors, and everything else is right."""

    factors: list[Factor]
    """One, or several lights or path lengths, those furthest off first."""
    other: Hypothesis | None = None
    """Another part that would explain it just as well as the only one."""


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


def hypotheses(of: Parts) -> Iterator[tuple[Hypothesis, Array, Array]]:
    """Each with its template and that one's variance, (T, 3), those that say least first."""
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
            yield one, image, of.variance[at].sum(axis=(0, 1, 2))


@dataclass(frozen=True)
class _Fit:
    parts: Sequence[Hypothesis]
    factors: Array
    """(k,) the estimate c of each part."""
    deviations: Array
    """(k,) their standard errors."""
    chi: float
    explained: Array
    """(T, 3) the sum of c T over the parts."""
    freedom: int

    @property
    def score(self) -> float:
        return self.chi + SIMPLER * sum(part.says for part in self.parts)

    @property
    def good(self) -> bool:
        """χ² is one of noise."""
        return bool(self.chi <= self.freedom + NOISE_ERRORS * np.sqrt(2 * self.freedom))

    @property
    def possible(self) -> bool:
        """No part is less than missing."""
        return bool(np.all(self.factors + SURELY * self.deviations > -1 - INEXACT))

    def same(self, other: "_Fit") -> bool:
        size = np.abs(self.explained).max()
        return bool(np.abs(self.explained - other.explained).max() < ALIKE * size)


def _fit(parts: Sequence[tuple[Hypothesis, Array, Array]], found: TileErrors, noise: Array) -> _Fit:
    """V depends on c; three rounds are enough as it does so little."""
    images = np.stack([image for _, image, _ in parts])
    inexact = np.stack([variance + (INEXACT * image) ** 2 for _, image, variance in parts])
    factors = np.zeros(len(parts))
    for _ in range(3):
        own = np.einsum("k,kti->ti", factors**2, inexact)
        inverse = np.linalg.inv(noise + own[:, :, None] * np.eye(3))
        weighted = np.einsum("tij,ktj->kti", inverse, images)
        information = np.einsum("kti,lti->kl", weighted, images)
        covariance = np.linalg.pinv(information, rcond=1e-12, hermitian=True)
        factors = covariance @ np.einsum("kti,ti->k", weighted, found.error)
    explained = np.einsum("k,kti->ti", factors, images)
    rest = found.error - explained
    chi = float(np.einsum("ti,tij,tj->", rest, inverse, rest))
    deviations = np.sqrt(np.diag(covariance))
    names = [part for part, _, _ in parts]
    return _Fit(names, factors, deviations, chi, explained, found.error.size - len(parts))


def explain(found: TileErrors) -> Explanation | None:
    """The part of the light whose factor alone explains the error, or else the lights, or the path lengths,
    with a factor each; None if there is none, or if too many would.
    """
    of = load(found.scene)
    if of is None or of.image.shape[3] != len(found.error):
        return None
    noise = found.noise_blocks()
    parts = list(hypotheses(of))
    families = {
        kind: [p for p in parts if p[0].says == 1 and getattr(p[0], kind) in getattr(of, f"{kind}s")]
        for kind in ("light", "length", "surface")
    }
    free = {kind: _fit(family, found, noise) for kind, family in families.items() if len(family) > 1}
    fits = [_fit([one], found, noise) for one in parts]
    fits = [fit for fit in fits if fit.good and fit.possible and not _better(fit, free.values())]
    if not fits:
        of_lights = [p for p in parts if p[0].light and not p[0].surface]
        several = [free[kind] for kind in ("light", "length") if kind in free]
        for length in ("direct", "reflected"):
            family = [p for p in of_lights if p[0].length == length]
            several += [_fit(family, found, noise)] if family else []
        good = [fit for fit in several if fit.good and fit.possible]
        return _explanation(good[0]) if good else None
    best = min(fits, key=lambda f: f.score)
    near = [f for f in fits if f.score < best.score + CLEARLY]
    others = [f for f in near if not best.same(f)]
    if len(others) > 1:
        return None
    first = min((f for f in near if best.same(f)), key=lambda f: f.parts[0].says)
    return _explanation(first, others[0].parts[0] if others else None)


def _better(fit: _Fit, families: Iterable[_Fit]) -> bool:
    """Whether any family explains more than chance lets it."""
    return any(fit.chi - family.chi > special.chdtri(len(family.parts), BY_CHANCE) for family in families)


def _explanation(fit: _Fit, other: Hypothesis | None = None) -> Explanation | None:
    """The factors that are surely not 1; None if none is, or if any is too little known."""
    half = -special.ndtri((1 - CERTAINTY) / 2) * fit.deviations
    if half.max() > SHARP * np.abs(fit.factors).max():
        return None
    low, high = fit.factors - half, fit.factors + half
    order = [i for i in np.argsort(-np.abs(fit.factors)) if abs(fit.factors[i]) > SURELY * fit.deviations[i]]
    factors = [Factor(fit.parts[i], float(fit.factors[i]), float(low[i]), float(high[i])) for i in order]
    return Explanation(factors, other) if factors else None
