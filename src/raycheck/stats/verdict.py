"""PASS, FAIL or INCONCLUSIVE from two disjoint sets of batches. Pure functions of arrays.

Region 0 is always the whole image, the others are its tiles. Residuals are (B, regions, channels) in the
units of the image; everything that a verdict reports is relative to the reference.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from raycheck.base.arrays import Array, Flags
from raycheck.stats import evidence as ev
from raycheck.stats import statistics as st
from raycheck.stats.evidence import Evidence
from raycheck.stats.tiles import Tile

ALPHA = 1e-5
"""Chance of a wrong FAIL of one case (a scene and a technique)."""
LEAST_ALPHA = 1e-7
"""Less would rest on p-values of a set below 1e-5, of which null runs have seen too few."""
SHARE_IMAGE, SHARE_TILES, SHARE_OMNIBUS = 0.4, 0.4, 0.2
"""How the three tests share it."""
SYSTEMATIC = 5e-4
"""Relative bias that conventions and float32 films may cause, and that never FAILs."""
CONFIDENCE = 0.99
"""Simultaneous confidence of all intervals that a PASS rests on."""
HIDDEN_ERRORS = 5.0
"""Standard errors of the samples beyond which a bias is no noise."""
HEAVY_ERRORS = 3.0
"""A batch is heavier-tailed than the tiles allow beyond this many standard errors of a skewness."""


class Outcome(StrEnum):
    PASS = "PASS"
    FAIL = "FAIL"
    INCONCLUSIVE = "INCONCLUSIVE"
    SKIP = "SKIP"
    """The renderer says that it does not support the scene: nothing was judged."""


@dataclass(frozen=True)
class Limits:
    """Equal means: the image mean to `image`, a tile to `tile` of max(r_tile, r_image/10)."""

    image: float = 0.01
    tile: float = 0.05

    @classmethod
    def of(cls, image: float | None) -> "Limits":
        """Those of the image, and of tiles in proportion; the usual ones where nothing is said."""
        return cls(image, cls.tile / cls.image * image) if image else cls()


@dataclass(frozen=True)
class Expected:
    """The reference over the regions."""

    mean: Array
    """(R, 3), region 0 the whole image."""
    variance: Array
    """(R, 3) variance of `mean`; 0 where a closed form stands."""
    batches: int
    """Batches that the variance came from."""
    batch_variance: Array
    """(R, 3) variance of a batch that samples like the reference's should have; what to assume where a
    renderer's batches all agree. 0 where nothing varies.
    """
    quantum: Array
    """(R, 3) step of quantised input, 0 for float32; a bias below it cannot be told from rounding."""

    @property
    def yardstick(self) -> Array:
        """(R, 3) what a bias is relative to: r for the image, max(r_tile, r_image/10) for a tile."""
        tiles = np.maximum(self.mean, self.mean[0] / 10)
        return np.asarray(np.abs(np.concatenate([self.mean[:1], tiles[1:]])))

    @property
    def allowance(self) -> Array:
        """(R, 3) bias that never FAILs where something varies."""
        return SYSTEMATIC * np.abs(self.mean) + self.quantum

    @property
    def exact_allowance(self) -> Array:
        """(R, 3) difference that never FAILs where nothing varies on either side."""
        return np.asarray(1e-5 * np.abs(self.mean) + 1e-7 * np.abs(self.mean[0]).max() + self.quantum)


@dataclass(frozen=True)
class Finding:
    """One region and channel that differs from the reference."""

    region: int
    channel: int
    bias: float
    """Relative, with its simultaneous interval."""
    low: float
    high: float
    p: float
    """Adjusted for the number of tests of its family."""


@dataclass(frozen=True)
class Judgement:
    outcome: Outcome
    channel: int
    """Channel of the largest |t| of the image mean; bias and interval are its."""
    bias: float
    bias_low: float
    bias_high: float
    mde_image: float
    """Bias of the image mean that FAILs with 90 % power, worst channel."""
    mde_tile_p90: float
    """90 % of the tiles are at least this sensitive, worst channel of each."""
    mde_tile_max: float
    p_image: float
    p_tile: float
    p_omnibus: float
    findings: list[Finding] = field(default_factory=list)
    """What differs, the surest first: the image's channels, then tiles."""
    undecided: list[Finding] = field(default_factory=list)
    """Regions whose interval is wider than the limits, the widest first."""
    more_samples: float = 1.0
    """INCONCLUSIVE: how many times the samples would probably decide."""
    heavy_tailed: int = 0
    """Regions whose batches are too skewed to be used."""
    tile_differences: int = 0
    """Tiles that differ by themselves."""
    within_reference: tuple[float, float] | None = None
    """The largest relative bias, if any, that is no noise but may be the reference's own error, and of how
    many standard errors.
    """


def judge(
    first: Array, second: Array, expected: Expected, limits: Limits = Limits(), alpha: float = ALPHA,
    confidence: float = CONFIDENCE,
) -> Judgement:  # fmt: skip
    """Judge residuals of two disjoint sets, each (B, R, 3), against `expected`.

    FAIL is decided first: |bias| beyond the allowance in *both* sets, at `alpha` over the image mean per
    channel, the tiles (Holm) and the omnibus. PASS: simultaneous intervals of this confidence, of both sets
    together, lie within `limits`.
    """
    noise = (expected.variance, expected.batches, expected.batch_variance)
    one, two = st.moments(first, *noise), st.moments(second, *noise)
    both = st.moments(np.concatenate([first, second]), *noise)

    allowance = np.where(both.exact, expected.exact_allowance, expected.allowance)
    p = st.two_set_p(one, two, allowance)
    heavy = _heavy(one) | _heavy(two)
    p = np.where(heavy, 1.0, p)
    p_image, p_tile = st.holm(p[0]), st.holm(p[1:])
    p_omnibus = _omnibus(first, second, one, two, expected, heavy)
    fails = (
        p_image.min(initial=1.0) <= SHARE_IMAGE * alpha
        or p_tile.min(initial=1.0) <= SHARE_TILES * alpha
        or p_omnibus <= SHARE_OMNIBUS * alpha
    )

    scale = np.where(expected.yardstick > 0, expected.yardstick, np.abs(expected.mean[0]).max() or 1.0)
    low, high = st.interval(both, (1 - confidence) / 2 / both.bias.size)
    inside = _inside(low, high, both, expected, limits, scale)
    adjusted = np.concatenate([p_image[None], p_tile])
    level = np.full(p.shape, SHARE_TILES * alpha / max(p_tile.size, 1))
    level[0] = SHARE_IMAGE * alpha / p.shape[1]
    detectable = st.detectable_bias(one, two, level, allowance) / scale
    findings = _different(both, low, high, scale, p, adjusted, alpha)
    too_heavy = _too_heavy(heavy)
    return _concluded(
        both, low, high, scale, allowance, adjusted, inside, heavy, detectable, fails, findings, p_omnibus,
        _more_samples(one, both, low, high, inside, too_heavy, expected, limits, scale, level),
    )  # fmt: skip


def _too_heavy(heavy: Flags) -> bool:
    """Whether the batches of more regions are too skewed than by chance alone, which gives a few."""
    heavy_regions = int(heavy.any(axis=1).sum())
    return heavy_regions > 2 + 0.02 * len(heavy)


def _concluded(
    both: st.Moments, low: Array, high: Array, scale: Array, allowance: Array, adjusted: Array, inside: Flags,
    heavy: Flags, detectable: Array, fails: bool, findings: list[Finding], p_omnibus: float,
    more_samples: float, within_reference: tuple[float, float] | None = None,
) -> Judgement:  # fmt: skip
    """The judgement of what is known of all sets, `detectable` relative: by one look or by many."""
    worst_of_tile = detectable[1:].max(axis=1) if len(detectable) > 1 else detectable[:1].max(axis=1)
    passes = inside.all() and not _too_heavy(heavy)
    t = np.abs(both.bias[0]) / np.where(
        both.exact[0], np.maximum(allowance[0], 1e-300), both.standard_error[0]
    )
    channel = int(np.argmax(t))
    return Judgement(
        outcome=Outcome.FAIL if fails else Outcome.PASS if passes else Outcome.INCONCLUSIVE, channel=channel,
        bias=float(both.bias[0, channel] / scale[0, channel]),
        bias_low=float(low[0, channel] / scale[0, channel]),
        bias_high=float(high[0, channel] / scale[0, channel]), mde_image=float(detectable[0].max()),
        mde_tile_p90=float(np.quantile(worst_of_tile, 0.9, method="higher")),
        mde_tile_max=float(worst_of_tile.max()), p_image=float(adjusted[0].min()),
        p_tile=float(adjusted[1:].min(initial=1.0)), p_omnibus=p_omnibus,
        findings=sorted(findings, key=lambda f: f.region != 0),
        undecided=_too_wide(both, low, high, scale, adjusted, inside), more_samples=more_samples,
        heavy_tailed=int(heavy.any(axis=1).sum()),
        tile_differences=len({f.region for f in findings if f.region > 0}), within_reference=within_reference,
    )  # fmt: skip


def spent(look: int) -> float:
    """The share of a chance of error that look 1, 2, … may spend, of as many as there may be: Σ = 1."""
    return 1 / (look * (look + 1))


def null_bias(expected: Expected) -> Array:
    """(R, 3) the bias that later looks may find in what is right: the allowance and the reference's error."""
    return np.asarray(expected.allowance + _reference_errors(expected) * np.sqrt(expected.variance))


def _reference_errors(expected: Expected) -> Array:
    """(R, 1)"""
    return ev.reference_errors(len(expected.mean) - 1, expected.batches)[:, None]


def own_moments(residuals: Array, expected: Expected) -> st.Moments:
    """The moments of a set (B, R, 3) without the reference's error, which all sets share."""
    return st.moments(residuals, np.zeros_like(expected.mean), assumed_variance=expected.batch_variance)


def gain(found: st.Moments, expected: Expected) -> Array:
    """(2, R, 3) what a fresh set with these `own_moments` adds to the evidence."""
    return ev.gain(found, null_bias(expected), _heavy(found))


def judge_looks(
    sets: Sequence[st.Moments], sizes: Array, seen: Evidence, regions: Sequence[Tile], expected: Expected,
    limits: Limits = Limits(), alpha: float = ALPHA,
) -> Judgement:  # fmt: skip
    """Judge two or more looks, of two sets each, by their `own_moments` over these regions, their samples
    `sizes` (in those of the first set) and the evidence `seen` in them.

    `alpha` is the level of all looks, half of which the first has spent by `judge`: FAIL is evidence of
    2/alpha. PASS is as there, by all sets together; of its chance of error each look spends a share.
    """
    both = st.pooled(sets, sizes, expected.variance, expected.batches)
    looks = len(sets) // 2
    allowance = np.where(both.exact, expected.exact_allowance, null_bias(expected))
    scale = np.where(expected.yardstick > 0, expected.yardstick, np.abs(expected.mean[0]).max() or 1.0)
    shares, level = seen.shares(regions), alpha / 2
    fails = seen.log_value >= -np.log(level) or bool(np.any(both.exact & (np.abs(both.bias) > allowance)))

    tail = (1 - CONFIDENCE) * spent(looks) / 2 / both.bias.size
    low, high = st.interval(both, tail)
    inside = _inside(low, high, both, expected, limits, scale)
    adjusted = np.minimum(np.exp(-shares), 1.0)
    order = np.argsort(np.where(adjusted <= level, -shares, np.inf), axis=None, kind="stable")
    different = [int(i) for i in order[: int((adjusted <= level).sum())]]
    findings = [_finding(i, both, low, high, scale, adjusted) for i in different]

    own_error = both.standard_error * np.sqrt(1 - both.shared)
    detectable = detectable_by_looks(sets, sizes, seen, regions, expected, alpha)
    beyond = np.abs(both.bias) - expected.allowance
    hidden = (beyond > HIDDEN_ERRORS * own_error) & (adjusted > level) & (expected.variance > 0)
    return _concluded(
        both, low, high, scale, allowance, adjusted, inside, _heavy(both), detectable / scale, fails,
        findings, float(min(np.exp(-seen.log_value), 1.0)),
        _more_looks(both, own_error, low, high, inside, expected, limits, scale, detectable),
        _largest(np.abs(both.bias) / scale, hidden, _reference_errors(expected)),
    )  # fmt: skip


def _largest(size: Array, of: Flags, errors: Array) -> tuple[float, float] | None:
    """The largest `size` (R, 3) of these, and the `errors` (R, 1) of its region."""
    if not of.any():
        return None
    region, channel = np.unravel_index(int(np.argmax(np.where(of, size, -1.0))), size.shape)
    return float(size[region, channel]), float(errors[region, 0])


def detectable_by_looks(
    sets: Sequence[st.Moments], sizes: Array, seen: Evidence, regions: Sequence[Tile], expected: Expected,
    alpha: float = ALPHA,
) -> Array:  # fmt: skip
    """(R, 3) the bias, in the units of the image, that FAILs with 90 % power by these looks, or by earlier
    ones.
    """
    weights = sizes / sizes.sum()
    own = np.sum([w**2 * one.standard_error**2 for w, one in zip(weights, sets, strict=True)], axis=0)
    first = np.full(len(regions), SHARE_TILES * alpha / 2 / max(3 * (len(regions) - 1), 1))
    first[0] = SHARE_IMAGE * alpha / 2 / 3
    thresholds, freedom = seen.thresholds(regions, alpha / 2), round(float(np.min(sets[0].freedom)), 1)
    looks = tuple(float(size) for size in sizes)
    factors = np.array([
        ev.detection_factor(looks, freedom, float(threshold), float(level))
        for threshold, level in zip(thresholds, first, strict=True)
    ])  # fmt: skip
    return np.asarray(null_bias(expected) + factors[:, None] * np.sqrt(own * sizes.sum()))


def _more_looks(
    both: st.Moments, own_error: Array, low: Array, high: Array, inside: Flags, expected: Expected,
    limits: Limits, scale: Array, detectable: Array,
) -> float:  # fmt: skip
    """How many times all samples so far would probably decide: as `_more_samples`, but the reference's error
    stays; ∞ where it alone is too much.
    """
    limit = _limit(expected, limits, scale)
    error = np.where(both.exact, 1.0, both.standard_error)
    most = (limit / ((high - low) / 2 / error + 2.5)) ** 2 - expected.variance
    pass_factor = np.where(most > 0, own_error**2 / np.where(most > 0, most, 1.0), np.inf)
    beyond = np.abs(both.bias) - null_bias(expected)
    needed = detectable - null_bias(expected)
    fail_factor = (needed / np.where(beyond > 0, beyond, np.inf)) ** 2
    biased = (np.abs(both.bias) > 3.5 * both.standard_error) & (beyond > 0)
    factor = np.where(inside | both.exact, 1.0, np.where(biased, fail_factor, pass_factor))
    return max(float(factor.max()), 1.2)


def _different(
    both: st.Moments, low: Array, high: Array, scale: Array, p: Array, adjusted: Array, alpha: float
) -> list[Finding]:
    """What differs at its level, the surest first."""
    threshold = np.full(p.shape, SHARE_TILES * alpha)
    threshold[0] = SHARE_IMAGE * alpha
    different = adjusted <= threshold
    order = np.argsort(np.where(different, p, 2.0), axis=None, kind="stable")[: int(different.sum())]
    return [_finding(int(i), both, low, high, scale, adjusted) for i in order]


def _too_wide(
    both: st.Moments, low: Array, high: Array, scale: Array, adjusted: Array, inside: Flags
) -> list[Finding]:
    """What is not known to lie within its limits, the least known first."""
    half = np.where(inside, 0.0, (high - low) / 2 / scale)
    order = np.argsort(-half, axis=None, kind="stable")[: int((~inside).sum())]
    return [_finding(int(i), both, low, high, scale, adjusted) for i in order]


def _heavy(found: st.Moments) -> Flags:
    """Where batches are more skewed than the tiles were made for, beyond the error of a skewness of B
    batches.
    """
    b = found.count
    error = np.sqrt(6.0 * b * (b - 1) / ((b - 2) * (b + 1) * (b + 3)))
    return np.asarray(np.abs(found.own_skewness) > 0.4 + HEAVY_ERRORS * error)


def _omnibus(
    first: Array, second: Array, one: st.Moments, two: st.Moments, expected: Expected, heavy: Flags,
) -> float:  # fmt: skip
    """Each set's tiles, weighted by the other set's variances; too skewed or unvarying ones are left out."""
    if first.shape[1] < 2:
        return 1.0
    usable = ~heavy[1:] & ~one.exact[1:] & ~two.exact[1:]
    p = []
    for residuals, other in ((first, two), (second, one)):
        weights = np.where(usable, 1 / np.where(usable, other.spread[1:], 1.0) ** 2, 0.0)
        p.append(st.omnibus(residuals[:, 1:], expected.variance[1:], weights, expected.allowance[1:]))
    return float(st.combine(p[0][0], p[1][0], max(p[0][1], p[1][1])))


def _inside(
    low: Array, high: Array, both: st.Moments, expected: Expected, limits: Limits, scale: Array
) -> Flags:
    limit = _limit(expected, limits, scale)
    exact = np.abs(both.bias) <= expected.exact_allowance
    return np.where(both.exact, exact, (low >= -limit) & (high <= limit))


def _limit(expected: Expected, limits: Limits, scale: Array) -> Array:
    relative = np.full(scale.shape, limits.tile)
    relative[0] = limits.image
    return relative * scale + expected.quantum


def _finding(index: int, both: st.Moments, low: Array, high: Array, scale: Array, p: Array) -> Finding:
    region, channel = divmod(index, scale.shape[1])
    at = (region, channel)
    return Finding(
        region=region, channel=channel, bias=float(both.bias[at] / scale[at]), low=float(low[at] / scale[at]),
        high=float(high[at] / scale[at]), p=float(p[at]),
    )  # fmt: skip


def _more_samples(
    one: st.Moments, both: st.Moments, low: Array, high: Array, inside: Flags, too_heavy: bool,
    expected: Expected, limits: Limits, scale: Array, level: Array,
) -> float:  # fmt: skip
    """How many times the samples would probably take every region inside its limit, or outside for sure.

    A region that shows no bias needs its interval, and 2.5 standard errors of luck, within the limit; one
    that shows a bias beyond 3.5 standard errors needs the samples that would make it FAIL.
    """
    limit = _limit(expected, limits, scale)
    error = both.standard_error
    pass_factor = (((high - low) / 2 + 2.5 * error) / limit) ** 2
    beyond = np.abs(both.bias) - expected.allowance
    needed = st.detection_factor(one.freedom, level) * one.standard_error
    fail_factor = (needed / np.where(beyond > 0, beyond, np.inf)) ** 2
    biased = (np.abs(both.bias) > 3.5 * error) & (beyond > 0)
    factor = np.where(inside | both.exact, 1.0, np.where(biased, fail_factor, pass_factor))
    return max(float(factor.max()), 4.0 if too_heavy else 1.2)
