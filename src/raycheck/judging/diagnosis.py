"""Which known mistake explains a wrong image? Signatures of the catalogued mistakes, fitted to its error.

A signature is what a mistake adds to the image of a correct renderer, as means of 8×8 tiles: measured once
with the patched program and the correct one from the same seeds (`raycheck calibrate signatures`), so that
their noise cancels. `references/signatures/SCENE.npz` holds those of a scene, `manifest.json` what each
mistake is, the hashes of the scenes that they belong to and what pictures they rest on.

With D the error of the image, S a signature, a its strength and σ the noise of both,
    χ²(a) = Σ (D - a S)² / (σ² + (τ D)² + (τ a S)²),
where τ allows for mistakes that are like a catalogued one and not the same. What of χ² is beyond the noise of
a scene counts: E(a) = Σ over scenes of max(χ² - n - 2√(2n), 0), n being the scene's values. The fit is the
share of E(0) that the signature explains, less ω (ln a)², since another strength is another mistake for all
that is known.
"""

import functools
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from raycheck.base import data
from raycheck.base.arrays import Array
from raycheck.base.errors import ReferenceError_
from raycheck.judging import parts
from raycheck.judging.tile_errors import RELATIVE_FLOOR, TileErrors
from raycheck.scene import variants

LIKENESS = 0.1
"""τ, how unlike the catalogued one a mistake may be, as a share of signature and error."""
STRENGTH = 0.1
"""ω, what another strength than the catalogued one costs the fit."""
STRENGTHS = np.exp(np.linspace(np.log(0.2), np.log(3.0), 55))
KNOWN = 0.93
"""Fit from which a mistake counts as explained: chosen by half of the catalogue (calibration/naming.py)."""
NOISE_ERRORS, SIGNIFICANT = 2.0, 5.0
"""Standard deviations √(2n) of χ² that are still noise, and from which a scene differs for sure."""


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


@dataclass(frozen=True)
class Guess:
    """A mistake and how well it explains the error."""

    mistake: Mistake
    fit: float
    """The share of the error that it explains, 0 … 1."""
    strength: float


@dataclass(frozen=True)
class Diagnosis:
    guesses: list[Guess]
    """The three likeliest, the best first."""
    known: bool
    """The best one explains the error."""
    significant: bool
    """There is an error to explain."""
    candidates: int
    explained: parts.Explanation | None = None
    """The parts of the light that have another factor, where one scene was looked at and they account for all
    of its error.
    """


def diagnose(found: Sequence[TileErrors], without: Sequence[str] = ()) -> Diagnosis:
    """The likeliest mistakes over all scenes together; `without` are left out of the catalogue."""
    mistakes = {name: m for name, m in catalogue().items() if name not in without}
    if any(one.scene not in complete_scenes() for one in found):
        looked_for = [set(load(one.scene).names) for one in found if one.scene not in complete_scenes()]
        mistakes = {name: m for name, m in mistakes.items() if all(name in names for names in looked_for)}
    names = list(mistakes)
    strengths = np.concatenate([[0.0], STRENGTHS])
    excess, unlikely = np.zeros((2, len(names), len(strengths)))
    for one in found:
        n = one.error.size
        noise = n + NOISE_ERRORS * np.sqrt(2 * n)
        chi, spread = _chi_squared(one, names, strengths)
        excess += np.maximum(chi - noise, 0)
        unlikely += chi + spread
    nothing = float(excess[0, 0]) if len(names) else 0.0
    fit = 1 - excess[:, 1:] / nothing if nothing > 0 else np.zeros((len(names), len(STRENGTHS)))
    fit -= STRENGTH * np.log(STRENGTHS) ** 2
    # Noise that is not to be explained leaves the fit flat: of strengths as good as the best the likeliest.
    good = fit >= fit.max(axis=1, keepdims=True) - ALIKE
    best = np.where(good, unlikely[:, 1:], np.inf).argmin(axis=1)
    left = unlikely[range(len(names)), 1 + best]
    order = np.lexsort([left, -fit.max(axis=1).round(2)])[:3]  # of equal fits the likeliest
    guesses = [
        Guess(mistakes[names[i]], float(np.clip(fit[i].max(), 0, 1)), float(STRENGTHS[best[i]]))
        for i in order
    ]
    explained = parts.explain(found[0]) if len(found) == 1 else None
    known = bool(guesses) and guesses[0].fit >= KNOWN and (not explained or _usual(guesses[0]))
    significant = any(map(_differs, found))
    return Diagnosis(guesses, known, significant, len(names), explained)


ALIKE = 0.03
"""Fits of mistakes that cannot be told apart differ by less."""
USUAL = 0.15
"""Logarithm of the strength within which a mistake counts as that mistake itself."""


def likely(found: TileErrors) -> tuple[list[Mistake], parts.Explanation | None]:
    """The mistakes that the images of one scene look like, all of them alike there, and the parts of the
    light that are wrong; none if that is not clear, or nothing is known of the scene.
    """
    try:
        told = diagnose([found])
    except ReferenceError_:
        return [], parts.explain(found)
    if not told.significant or not told.known:
        return [], told.explained
    best = told.guesses[0].fit
    return [g.mistake for g in told.guesses if g.fit > best - ALIKE and _usual(g)], told.explained


def _usual(guess: Guess) -> bool:
    """Whether it is as strong as the mistake is. Any number explains an error that is a mere factor of some
    light: a mistake at another strength is then no explanation.
    """
    return bool(abs(np.log(guess.strength)) < USUAL)


def _differs(one: TileErrors) -> bool:
    """Whether a scene differs, as a whole or in any tile by far."""
    square = one.error**2 / (one.variance + RELATIVE_FLOOR * one.scale**2)
    n = one.error.size
    whole = square.sum() > n + SIGNIFICANT * np.sqrt(2 * n)
    return bool(whole or np.any(np.abs(one.error) > 6 * np.sqrt(one.variance) + 0.005 * one.scale))


def _chi_squared(one: TileErrors, names: Sequence[str], strengths: Array) -> tuple[Array, Array]:
    """(M, A) χ² for each mistake and strength, and the logarithm of the variances, by which a noisy signature
    is no better; a mistake without a signature adds nothing to this scene.
    """
    signatures = load(one.scene)
    where = {name: index for index, name in enumerate(signatures.names)}
    d = one.error / one.scale
    noise = one.variance / one.scale**2 + RELATIVE_FLOOR
    same = noise + (LIKENESS * d) ** 2
    chi = np.full((len(names), len(strengths)), float((d**2 / same).sum()))
    spread = np.full(chi.shape, float(np.log(same).sum()))
    for row, name in enumerate(names):
        if name in where:
            s = signatures.error[where[name]] / one.scale
            own = signatures.variance[where[name]] / one.scale**2
            a = strengths[:, None, None]
            variance = same + a**2 * (own + (LIKENESS * s) ** 2)
            chi[row] = ((d - a * s) ** 2 / variance).sum(axis=(1, 2))
            spread[row] = np.log(variance).sum(axis=(1, 2))
    return chi, spread


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
