"""Evidence that grows from look to look: its level holds however often one looks.

A p-value of a fresh set, one for each region, channel and direction (too bright, too dark), becomes

    e(p) = c κ max(p, FLOOR)^(κ−1)    with c so that ∫₀¹ e(p) dp = 1.

e falls with p, so that E[e] ≤ 1 wherever p is at least uniform, whatever was seen before: the product over
sets is a non-negative supermartingale that begins at 1. So is an average of such products with weights fixed
beforehand, and the chance that it *ever* reaches 1/a is at most a (Ville's inequality). A tile that is
divided in a later look leaves its product to its parts, which changes no sum. No p below FLOOR counts for
more than FLOOR: that is how far null runs have shown p-values to be even.

All sets share the reference's error. It is no noise here: the null hypothesis is a bias of at most what is
always allowed and `reference_errors` standard errors of the reference. However many sets there are they find
what lies beyond, so that the chance of a reference that does so anywhere is kept far below any level.

Sources: G. Shafer, "Testing by betting" (J. R. Statist. Soc. A 184, 2021); V. Vovk and R. Wang, "E-values:
calibration, combination and applications" (Ann. Statist. 49, 2021) for e(p); A. Ramdas, P. Grünwald, V. Vovk
and G. Shafer (Statist. Sci. 38, 2023) for stopping at any time.
"""

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from raycheck.base.arrays import Array, Flags
from raycheck.stats import statistics as st
from raycheck.stats.tiles import SMALLEST, Tile, in_squares

KAPPA = 0.2
FLOOR = 1e-4
"""The smallest p-value that null runs have shown to be as rare as it says."""
SCALE = 1 / (1 - (1 - KAPPA) * FLOOR**KAPPA)
"""c: ∫ κ max(p, f)^(κ−1) dp = f^κ κ + 1 − f^κ."""
IMAGE = 0.5
"""Weight of the whole image; the tiles have the rest, by their area."""
REFERENCE_CHANCE = 1e-6
"""Chance that a right reference is off by more than `reference_errors` in its image, or in any of its
tiles.
"""
SIMULATED = 4000
"""Runs of which the power of looks is counted."""


def log_e(p: Array) -> Array:
    """ln e(p)."""
    return np.asarray(np.log(SCALE * KAPPA) + (KAPPA - 1) * np.log(np.maximum(p, FLOOR)))


def gain(found: st.Moments, allowance: Array, skewed: Flags) -> Array:
    """(2, R, 3) ln e of a set, too bright and too dark, from its moments without the reference's error.
    `allowance` (R, 3) is the bias of the null hypothesis. Where batches are `skewed` (R, 3), or nothing
    varies, e is at most 1.
    """
    won = log_e(np.stack(st.one_sided_p(found, allowance)))
    return np.where(skewed | found.exact, np.minimum(won, 0.0), won)


def reference_errors(tiles: int, batches: int) -> Array:
    """(1 + tiles,) standard errors that a reference of so many batches may be off in the image and in each
    tile: two-sided quantiles of t that share REFERENCE_CHANCE, over three channels, and over the tiles.
    """
    tests = 3 * np.array([1, *[tiles] * tiles])
    return np.asarray(-special.stdtrit(max(batches - 1, 1), REFERENCE_CHANCE / 2 / tests))


@dataclass(frozen=True)
class Evidence:
    """ln of the products of e so far."""

    image: Array
    """(2, 3) too bright and too dark, by channel."""
    cells: Array
    """(2, rows, cols, 3) of the smallest squares; those of a tile have the tile's."""
    sets: int = 0

    @classmethod
    def none(cls, height: int, width: int) -> "Evidence":
        rows, cols = -(-height // SMALLEST), -(-width // SMALLEST)
        return cls(np.zeros((2, 3)), np.zeros((2, rows, cols, 3)))

    def after(self, won: Array, regions: Sequence[Tile]) -> "Evidence":
        """With what another set won, `gain` over these regions."""
        cells = self.cells.copy()
        for index, region in enumerate(regions[1:], 1):
            rows, columns = in_squares(region).window
            cells[:, rows, columns] += won[:, index, None, None]
        return Evidence(self.image + won[:, 0], cells, self.sets + 1)

    @property
    def log_value(self) -> float:
        """ln of the weighted average of all products."""
        image, cells = (_log_sum(part) - np.log(part.size) for part in (self.image, self.cells))
        return float(np.logaddexp(np.log(IMAGE) + image, np.log(1 - IMAGE) + cells))

    def shares(self, regions: Sequence[Tile]) -> Array:
        """(R, 3) ln of what each region and channel adds to the average, of its stronger direction."""
        one = np.log(IMAGE / self.image.size) + self.image.max(axis=0)
        each = np.log((1 - IMAGE) / self.cells.size)
        tiles = [_log_sum(self.cells[:, *in_squares(r).window], axis=(1, 2)) for r in regions[1:]]
        return np.stack([one, *(each + tile.max(axis=0) for tile in tiles)])

    def thresholds(self, regions: Sequence[Tile], level: float) -> Array:
        """(R,) ln of the product with which each region alone takes the average to 1/level."""
        parts = [IMAGE / self.image.size]
        parts += [(1 - IMAGE) * in_squares(r).pixels / self.cells.size for r in regions[1:]]
        return np.asarray(-np.log(level) - np.log(parts))


def _log_sum(logarithms: Array, axis: tuple[int, ...] | None = None) -> Array:
    """ln Σ exp."""
    most = logarithms.max(axis=axis, keepdims=True)
    return np.asarray(np.log(np.exp(logarithms - most).sum(axis=axis)) + most.squeeze(axis))


@functools.lru_cache(maxsize=256)
def detection_factor(
    sizes: tuple[float, ...], freedom: float, threshold: float, first: float, power: float = 0.9
) -> float:
    """The bias beyond what is allowed, in standard errors of a set of size 1, that FAILs with this power by
    sets of these sizes (of which each look has two): at the first look by both of its sets at the two-sided
    level `first`, from then on by a product of `threshold` in ln. Standard errors fall with √size.
    """
    noise = np.random.default_rng(0).standard_t(freedom, (SIMULATED, len(sizes)))
    critical = -special.stdtrit(freedom, np.sqrt(first / 2))

    def noticed(factor: float) -> float:
        t = factor * np.sqrt(sizes) + noise
        found = (t[:, :2] > critical).all(axis=1)
        product = np.cumsum(np.interp(t, *_table(freedom)), axis=1)[:, 3::2]
        return float((found | (product >= threshold).any(axis=1)).mean())

    return _least(noticed, power)


@functools.lru_cache(maxsize=256)
def _table(freedom: float) -> tuple[Array, Array]:
    """t, and ln e of its p-value: which ends to rise where p is FLOOR."""
    t = np.linspace(-8.0, -float(special.stdtrit(freedom, FLOOR)), 2000)
    return t, log_e(special.stdtr(freedom, -t))


def detection_factor_apart(looks: int, freedom: float, level: float, power: float = 0.9) -> float:
    """The same where each look is judged by itself, at the two-sided level/looks by both of its sets."""
    noise = np.random.default_rng(0).standard_t(freedom, (SIMULATED, looks, 2))
    critical = -special.stdtrit(freedom, np.sqrt(level / looks / 2))
    return _least(lambda factor: float((factor + noise > critical).all(axis=2).any(axis=1).mean()), power)


def _least(noticed: Callable[[float], float], power: float) -> float:
    """The least factor that is noticed with this power, to 0.1 %."""
    low, high = 0.0, 16.0
    for _ in range(14):
        middle = (low + high) / 2
        low, high = (low, middle) if noticed(middle) >= power else (middle, high)
    return high
