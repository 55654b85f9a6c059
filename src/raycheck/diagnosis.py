"""Which known mistake explains a wrong image? Signatures of the catalogued mistakes, fitted to its error.

A signature is what a mistake adds to the image of a correct renderer, as means of 8×8 tiles: measured once
with the patched program and the correct one from the same seeds (`raycheck calibrate signatures`), so that
their noise cancels. `references/signatures/SCENE.npz` holds those of a scene, `manifest.json` what each
mistake is, and the hashes of the scenes and patches that they belong to.

With D the error of the image, S a signature, a its strength and σ the noise of both,
    χ²(a) = Σ (D - a S)² / (σ² + (τ D)² + (τ a S)²),
where τ allows for mistakes that are like a catalogued one and not the same. The fit is the share of χ²(0)
that the signature explains, less ω (ln a)², since another strength is another mistake for all that is known.
"""

import functools
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from raycheck import references
from raycheck.tiles import SMALLEST, Tile, region_means, region_variances
from raycheck.truth import Truth

Array = NDArray[np.float64]

LIKENESS = 0.1
"""τ"""
STRENGTH = 0.1
"""ω"""
STRENGTHS = np.exp(np.linspace(np.log(0.2), np.log(3.0), 55))
KNOWN = 0.85
"""Fit from which a mistake counts as explained…"""
SIGNIFICANT = 4.0
"""…where χ²(0) is at least this many times the number of tiles: else there is nothing to explain."""


@dataclass(frozen=True)
class Mistake:
    """One that has a signature."""

    name: str
    technique: str
    mistake: str
    symptom: str


@dataclass(frozen=True)
class Signatures:
    """Of one scene."""

    names: Sequence[str]
    error: Array
    """(M, T, 3) what each mistake adds to the mean of each tile, W·sr⁻¹·m⁻²."""
    variance: Array
    """(M, T, 3) of that."""


@dataclass(frozen=True)
class Evidence:
    """The error of an image of one scene."""

    scene: str
    error: Array
    """(T, 3) mean of the images − reference."""
    variance: Array
    """(T, 3) of that, the reference's included."""
    scale: Array
    """(T, 3) what a bias is relative to."""


@dataclass(frozen=True)
class Guess:
    """A mistake and how well it explains the evidence."""

    mistake: Mistake
    fit: float
    """0…1"""
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


def fine_tiles(height: int, width: int) -> list[Tile]:
    """The tiles of signatures."""
    return [
        Tile(row, column, min(SMALLEST, height - row), min(SMALLEST, width - column))
        for row in range(0, height, SMALLEST)
        for column in range(0, width, SMALLEST)
    ]


def evidence(scene: str, images: Array, truth: Truth) -> Evidence:
    """From images (B ≥ 1, H, W, 3); the noise of a single one is taken from the reference's renderer."""
    tiles = fine_tiles(*truth.shape)
    means = region_means(images, tiles)
    mean = region_means(truth.mean, tiles)
    if len(images) > 1:
        own = means.var(axis=0, ddof=1) / len(images)
    else:
        own = region_variances(((images[0] - truth.mean) ** 2), tiles)
    floor = np.abs(truth.mean).mean(axis=(0, 1)) / 10
    scale = np.maximum(np.abs(mean), np.where(floor > 0, floor, 1.0))
    return Evidence(scene, means.mean(axis=0) - mean, own + region_variances(truth.variance, tiles), scale)


def diagnose(found: Sequence[Evidence], without: Sequence[str] = ()) -> Diagnosis:
    """The likeliest mistakes over all scenes together; `without` are left out of the catalogue."""
    mistakes = {name: m for name, m in catalogue().items() if name not in without}
    if any(one.scene not in complete_scenes() for one in found):
        known = [set(load(one.scene).names) for one in found if one.scene not in complete_scenes()]
        mistakes = {name: m for name, m in mistakes.items() if all(name in names for names in known)}
    names = list(mistakes)
    strengths = np.concatenate([[0.0], STRENGTHS])
    chi = np.zeros((len(names), len(strengths)))
    for one in found:
        chi += _chi_squared(one, names, strengths)
    nothing = float(chi[0, 0]) if len(names) else 0.0
    fit = 1 - chi[:, 1:] / max(nothing, 1e-30) - STRENGTH * np.log(STRENGTHS) ** 2
    best = fit.argmax(axis=1)
    order = np.argsort(-fit.max(axis=1), kind="stable")[:3]
    guesses = [
        Guess(mistakes[names[i]], float(np.clip(fit[i].max(), 0, 1)), float(STRENGTHS[best[i]]))
        for i in order
    ]
    values = sum(one.error.size for one in found)
    significant = nothing > SIGNIFICANT * values or _sure(found)
    return Diagnosis(guesses, bool(guesses) and guesses[0].fit >= KNOWN, significant, len(names))


SURE = 0.9
"""Fit from which the image of a single scene is enough to name a mistake unasked."""


def likely(scene: str, images: Array, truth: Truth) -> Mistake | None:
    """The mistake that an image of this scene looks like; None if that is not clear, or nothing is known of
    the scene.
    """
    try:
        told = diagnose([evidence(scene, images, truth)])
    except references.ReferenceError_:
        return None
    return told.guesses[0].mistake if told.significant and told.guesses[0].fit >= SURE else None


def _sure(found: Sequence[Evidence]) -> bool:
    """Does any tile differ by far more than noise?"""
    return any(
        bool(np.any(np.abs(one.error) > 6 * np.sqrt(one.variance) + 0.005 * one.scale)) for one in found
    )


def _chi_squared(one: Evidence, names: Sequence[str], strengths: Array) -> Array:
    """(M, A) for each mistake and strength; a mistake without a signature adds nothing to this scene."""
    signatures = load(one.scene)
    where = {name: index for index, name in enumerate(signatures.names)}
    d = one.error / one.scale
    noise = one.variance / one.scale**2 + 1e-6
    same = noise + (LIKENESS * d) ** 2
    result = np.full((len(names), len(strengths)), float((d**2 / same).sum()))
    for row, name in enumerate(names):
        if name in where:
            s = signatures.error[where[name]] / one.scale
            own = signatures.variance[where[name]] / one.scale**2
            a = strengths[:, None, None]
            result[row] = ((d - a * s) ** 2 / (same + a**2 * (own + (LIKENESS * s) ** 2))).sum(axis=(1, 2))
    return result


def folder() -> Path:
    return references.references_dir() / "signatures"


@functools.lru_cache(maxsize=1)
def manifest() -> Mapping:
    """Scenes and mistakes; ReferenceError_ where there are no signatures."""
    path = folder() / "manifest.json"
    if not path.is_file():
        raise references.ReferenceError_(f"{path} is missing; make it with: raycheck calibrate signatures")
    return json.loads(path.read_text(encoding="utf-8"))


def scenes() -> list[str]:
    """Those that have signatures."""
    return list(manifest()["scenes"])


def complete_scenes() -> list[str]:
    """Those that have the signatures of all mistakes that show in them."""
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
        raise references.ReferenceError_(
            f"there are no signatures for {scene}; there are for {', '.join(scenes())}"
        )
    if entry["hash"] != references.scene_hash(references.scene_path(scene)):
        raise references.ReferenceError_(
            f"the signatures of {scene} are stale: the scene has changed since; "
            "renew them with: raycheck calibrate signatures"
        )
    with np.load(folder() / f"{scene}.npz") as arrays:
        error, deviation = (np.asarray(arrays[k], dtype=np.float64) for k in ("error", "deviation"))
    return Signatures(entry["mistakes"], error, deviation**2)
