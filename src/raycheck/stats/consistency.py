"""The limit of a bias that shrinks: b(h) = b₀ + c·hᵖ, with one order p for all regions and channels.

For a given p the model is linear: b₀ and c of each region and channel are weighted least squares, and their
errors are known. p is not: all p that explain the biases about as well (profile likelihood, χ² within the
quantile of one degree of freedom) are tried, and what is said of b₀ holds for each of them.
"""

from dataclasses import dataclass

import numpy as np
from scipy import special

from raycheck.base.arrays import Array

ORDERS = np.arange(0.5, 4.01, 0.05)
"""From √h, of a filter at an edge, to h⁴."""
MISFIT = 1e-4
"""Chance from which the biases do not follow one power; the three channels count as one, as where grey."""
SURE_OF_ORDER = 1e-6
"""Chance that the true order is not among those tried."""


@dataclass(frozen=True)
class Limit:
    """What biases at several h say of their limit."""

    order: float
    """The order that fits best."""
    orders: Array
    """(K,) those that fit about as well."""
    shrinks: bool
    """Whether the bias changes with h for sure."""
    fits: bool
    bias: Array
    """(R, 3) b₀ at the best order."""
    biases: Array
    """(K, R, 3) b₀ at all orders that fit."""
    errors: Array
    """(K, R, 3) their standard errors."""


def limit(h: Array, bias: Array, error: Array) -> Limit:
    """From biases (N, R, 3) at N values h > 0 and their independent standard errors."""
    weight = 1 / np.maximum(error, 1e-12 + 1e-6 * np.abs(bias)) ** 2
    fitted = [_fit((h / h.max()) ** p, bias, weight) for p in ORDERS]
    chi2 = np.array([one[2] for one in fitted])
    best = int(np.argmin(chi2))
    constant = (weight * bias).sum(axis=0) / weight.sum(axis=0)
    flat = float((weight * (bias - constant) ** 2).sum())
    values = bias[0].size
    freedom = (len(h) - 2) * values - 1
    near = chi2 <= chi2[best] + special.chdtri(1, SURE_OF_ORDER)
    return Limit(
        order=float(ORDERS[best]), orders=ORDERS[near],
        shrinks=bool(special.chdtrc(values + 1, flat - chi2[best]) < MISFIT),
        fits=bool(special.chdtrc(freedom / 3, chi2[best] / 3) > MISFIT), bias=fitted[best][0],
        biases=np.stack([one[0] for one, use in zip(fitted, near, strict=True) if use]),
        errors=np.stack([one[1] for one, use in zip(fitted, near, strict=True) if use]),
    )  # fmt: skip


def limit_at(h: Array, batches: Array, found: Limit) -> tuple[Array, Array]:
    """b₀ and its standard error, (K, R, 3) each, of batches (N, B, R, 3) at all orders that fit `found`."""
    bias, error = batches.mean(axis=1), batches.std(axis=1, ddof=1) / np.sqrt(batches.shape[1])
    weight = 1 / np.maximum(error, 1e-12 + 1e-6 * np.abs(bias)) ** 2
    fitted = [_fit((h / h.max()) ** p, bias, weight) for p in found.orders]
    return np.stack([one[0] for one in fitted]), np.stack([one[1] for one in fitted])


def _fit(x: Array, bias: Array, weight: Array) -> tuple[Array, Array, float]:
    """b₀, its standard error and the sum of squares over all, for b = b₀ + c·x."""
    x = x[:, None, None]
    s0, s1, s2 = (np.sum(weight * x**k, axis=0) for k in range(3))
    t0, t1 = np.sum(weight * bias, axis=0), np.sum(weight * bias * x, axis=0)
    determinant = s0 * s2 - s1**2
    start, slope = (s2 * t0 - s1 * t1) / determinant, (s0 * t1 - s1 * t0) / determinant
    square = float((weight * (bias - start - slope * x) ** 2).sum())
    return start, np.sqrt(s2 / determinant), square
