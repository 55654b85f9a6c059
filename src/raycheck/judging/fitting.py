"""How well candidates explain the error of pictures: generalised least squares, all candidates alike.

With D the error of the tiles, V its covariance (blocks of the three channels of a tile, as tiles are
independent) and a candidate that adds B + Σ aₖ Sₖ to a correct picture,
    χ²(a) = (D − B − Σ aₖ Sₖ)ᵀ V⁻¹ (D − B − Σ aₖ Sₖ),   ℓ = −½ χ² − ½ ln det V − ½ k ln n,
the last term being Schwarz's price of k free strengths by n values (Annals of Statistics 6, 1978), so that a
candidate that can be anything wins only where it has to. V has the noise of the images, of the reference
and of the Sₖ, and a share of what the candidate explains in each tile, by which it may be inexact.
"""

from dataclasses import dataclass

import numpy as np

from raycheck.base.arrays import Array

ROUNDS = 3
"""V depends on the strengths, by so little that these are enough."""


@dataclass(frozen=True)
class Stack:
    """M candidates with k strengths each, over T tiles."""

    base: Array
    """(M, T, 3) what they add at any strength, W·sr⁻¹·m⁻²."""
    directions: Array
    """(M, k, T, 3) what they add at strength 1."""
    variance: Array
    """(M, k, T, 3) of the directions."""
    low: float
    high: float
    """Strengths that the candidates may have."""
    inexact: float
    """What they may be off in a tile, relative to what they explain there."""

    def __len__(self) -> int:
        return len(self.base)


def stack(
    directions: Array, variance: Array | None = None, *, base: Array | None = None, low: float = -np.inf,
    high: float = np.inf, inexact: float = 0.01,
) -> Stack:  # fmt: skip
    """Candidates of (M, k, T, 3) directions that are known exactly, and add nothing else, if not given."""
    m, _, tiles, channels = directions.shape
    return Stack(
        np.zeros((m, tiles, channels)) if base is None else base, directions,
        np.zeros(directions.shape) if variance is None else variance, low, high, inexact,
    )  # fmt: skip


@dataclass(frozen=True)
class Fits:
    """The candidates of a stack, fitted."""

    strengths: Array
    """(M, k), within what they may be."""
    deviations: Array
    """(M, k) standard errors."""
    likelihood: Array
    """(M,) ℓ"""
    explained: Array
    """(M, T, 3) B + Σ aₖ Sₖ"""
    misfit: Array
    """(M,) standard deviations √(2n) by which χ² exceeds its mean, n values less k strengths."""


def fit(error: Array, noise: Array, of: Stack) -> Fits:
    """The candidates of a stack by errors (T, 3) whose covariance is `noise` (T, 3, 3)."""
    free = of.directions.shape[1]
    strengths = np.clip(np.ones((len(of), free)), of.low, of.high)
    deviations = np.zeros(strengths.shape)
    for _ in range(ROUNDS):
        covariance = noise + _own(of, strengths)[..., None] * np.eye(error.shape[1])
        inverse = np.linalg.inv(covariance)
        weighted = np.einsum("mtij,mktj->mkti", inverse, of.directions)
        information = np.einsum("mkti,mlti->mkl", weighted, of.directions)
        inverted = np.linalg.pinv(information, rcond=1e-12, hermitian=True)
        wanted = np.einsum("mkti,mti->mk", weighted, error - of.base)
        strengths = np.clip(np.einsum("mkl,ml->mk", inverted, wanted), of.low, of.high)
        deviations = np.sqrt(np.einsum("mkk->mk", inverted))
    explained = _explained(of, strengths)
    rest = error - explained
    chi = np.einsum("mti,mtij,mtj->m", rest, inverse, rest)
    spread = np.linalg.slogdet(covariance)[1].sum(axis=1)
    likelihood = -(chi + spread + free * np.log(error.size)) / 2
    misfit = (chi - (error.size - free)) / np.sqrt(2 * error.size)
    return Fits(strengths, deviations, likelihood, explained, misfit)


def _explained(of: Stack, strengths: Array) -> Array:
    return np.asarray(of.base + np.einsum("mk,mkti->mti", strengths, of.directions))


def _own(of: Stack, strengths: Array) -> Array:
    """(M, T, 3) variance of what the candidates explain."""
    known = np.einsum("mk,mkti->mti", strengths**2, of.variance)
    return np.asarray(known + (of.inexact * _explained(of, strengths)) ** 2)
