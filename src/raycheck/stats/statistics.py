"""The statistics of a verdict: tests, intervals and the bias that would have been noticed.

Arrays of residuals are (B, …): B independent batches of "mean of this batch − reference" for any number of
regions and channels, in the units of the image. Everything is vectorised over the trailing axes. No input or
output happens here.

Sources: P. Hall, "On the removal of skewness by transformation" (J. R. Statist. Soc. B 54, 1992) for the
monotone t; S. Holm (Scand. J. Statist. 6, 1979); J. P. Imhof (Biometrika 48, 1961) for three moments of a
quadratic form; Z. Bai and H. Saranadasa (Statistica Sinica 6, 1996) for the trace of a squared covariance;
D. J. Schuirmann (J. Pharmacokinet. Biopharm. 15, 1987) for equivalence by two one-sided tests.
Distributions are those of scipy.special: scipy.stats, which calls them, takes a second to import.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from raycheck.base.arrays import Array, Flags

# The skewness in Hall's t is itself estimated, which widens the tails: with 32 normal batches the false
# alarms of t with B−1 degrees of freedom are 1.2, 1.5 and 2.7 times too many at 1e-3, 1.4e-4 and 1e-5. Four
# fifths of the degrees bring them to 0.9–1.1 (simulated in tests/test_statistics.py).
FREEDOM_SHARE = 0.8

# With fewer effective dimensions a few common causes rule the omnibus, and 32 batches do not tell its tail.
FEWEST_DIMENSIONS = 20.0


@dataclass(frozen=True)
class Moments:
    """What one set of batches says about the bias of each region and channel; all arrays have the trailing
    shape.
    """

    count: int
    """Number of batches B."""
    bias: Array
    """Mean residual, in the units of the image."""
    spread: Array
    """Standard deviation of a batch's residual with the reference's own error added: √(s² + B·v)."""
    skewness: Array
    """Third central moment over spread³."""
    own_skewness: Array
    """Third central moment over s³: the skewness of the batches alone."""
    freedom: Array
    """Degrees of freedom (Welch–Satterthwaite over batches and reference)."""
    shared: Array
    """Share of the squared standard error that comes from the reference, 0…1: it is the same in every set."""

    @property
    def standard_error(self) -> Array:
        return np.asarray(self.spread / np.sqrt(self.count))

    @property
    def exact(self) -> Flags:
        """True where neither the batches nor the reference vary, so that bias is a plain difference."""
        return np.asarray(self.spread == 0)


def moments(
    residuals: Array,
    reference_variance: Array,
    reference_batches: int = 10**6,
    assumed_variance: Array | float = 0.0,
) -> Moments:
    """Moments of residuals (B, …) from a reference whose mean has variance `reference_variance` (…).

    `assumed_variance` (…) is the variance of a batch to assume where all batches agree although samples ought
    to vary, as where a small light was never hit: seeing no variance there does not mean that there is none.
    """
    count = residuals.shape[0]
    bias = residuals.mean(axis=0)
    centred = residuals - bias
    varies = np.ptp(residuals, axis=0) > 0  # equal numbers may still have a rounding error in their mean
    own = np.where(varies, (centred**2).sum(axis=0) / (count - 1), assumed_variance)
    third = np.where(varies, (centred**3).mean(axis=0), 0.0)
    reference_part = count * np.asarray(reference_variance, dtype=np.float64)
    spread = np.sqrt(own + reference_part)
    safe = np.where(spread > 0, spread, 1.0)
    own_safe = np.where(own > 0, np.sqrt(own), 1.0)
    batch_freedom = FREEDOM_SHARE * (count - 1)
    reference_freedom = max(reference_batches - 1, 1)
    freedom = safe**4 / (own**2 / batch_freedom + reference_part**2 / reference_freedom + (spread == 0))
    return Moments(
        count=count, bias=bias, spread=spread, skewness=third / safe**3, own_skewness=third / own_safe**3,
        freedom=np.where(spread > 0, freedom, batch_freedom), shared=reference_part / safe**2,
    )  # fmt: skip


def pooled(
    found: Sequence[Moments], sizes: Array, reference_variance: Array, reference_batches: int
) -> Moments:
    """The moments of sets of different sizes together, weighted by size, as if of one set of all their
    batches. Those of the sets are without the reference's error, which is added here, once for all.
    """
    weights = sizes / sizes.sum()
    count = sum(one.count for one in found)
    parts = [w**2 * one.spread**2 / one.count for w, one in zip(weights, found, strict=True)]
    own = np.sum(parts, axis=0)
    third = np.sum([
        w**3 * one.skewness * one.spread**3 / one.count**2 for w, one in zip(weights, found, strict=True)
    ], axis=0)  # fmt: skip
    variance = own + reference_variance
    safe, own_safe = np.where(variance > 0, variance, 1.0), np.where(own > 0, own, 1.0)
    spent = np.sum([part**2 / one.freedom for part, one in zip(parts, found, strict=True)], axis=0)
    spent = spent + np.square(reference_variance) / max(reference_batches - 1, 1)
    freedom = variance**2 / np.where(spent > 0, spent, 1.0)
    bias = np.sum([w * one.bias for w, one in zip(weights, found, strict=True)], axis=0)
    return Moments(
        count=count, bias=bias, spread=np.sqrt(variance * count), skewness=third * np.sqrt(count) / safe**1.5,
        own_skewness=third * np.sqrt(count) / own_safe**1.5,
        freedom=np.where(spent > 0, freedom, count - 1.0), shared=reference_variance / safe,
    )  # fmt: skip


def hall_t(s: Array, skewness: Array, count: int) -> Array:
    """Hall's skewness-corrected t for s = bias/spread: √B (s + γs²/3 + γ²s³/27 + γ/6B), which rises with s
    everywhere.
    """
    result: Array = np.sqrt(count) * (
        s + skewness * s**2 / 3 + skewness**2 * s**3 / 27 + skewness / (6 * count)
    )
    return result


def hall_inverse(t: Array, skewness: Array, count: int) -> Array:
    """The s of which `hall_t` is t; exact, because 1 + γ(s + γs²/3 + γ²s³/27) = (1 + γs/3)³."""
    skewness = np.asarray(skewness, dtype=np.float64)
    x = np.asarray(t) / np.sqrt(count) - skewness / (6 * count)
    flat = np.abs(skewness) < 1e-6
    safe = np.where(flat, 1.0, skewness)
    return np.asarray(np.where(flat, x - skewness * x**2 / 3, 3 / safe * (np.cbrt(1 + safe * x) - 1)))


def one_sided_p(found: Moments, allowance: Array) -> tuple[Array, Array]:
    """p-values of "the true bias is above −allowance … at most +allowance", against too bright and against
    too dark.

    `allowance` (…) is the bias that convention and rounding may cause, ≥ 0, in the units of the image. Where
    nothing varies the p-values are 0 or 1: a plain comparison.
    """
    safe = np.where(found.exact, 1.0, found.spread)
    bright = hall_t((found.bias - allowance) / safe, found.skewness, found.count)
    dark = hall_t((found.bias + allowance) / safe, found.skewness, found.count)
    p_bright = np.where(found.exact, found.bias <= allowance, special.stdtr(found.freedom, -bright))
    p_dark = np.where(found.exact, found.bias >= -allowance, special.stdtr(found.freedom, dark))
    return p_bright.astype(np.float64), p_dark.astype(np.float64)


def combine(first: Array | float, second: Array | float, shared: Array | float) -> Array:
    """p-value of "both of two sets say so": max(p₁, p₂)², since both must be that small.

    The reference's error is in both. With a correlation ρ = `shared` between the two, the probability of both
    beyond z falls like exp(−z²/(1+ρ)), so the exponent is 2/(1+ρ).
    """
    return np.maximum(first, second) ** (2 / (1 + np.asarray(shared)))


def two_set_p(first: Moments, second: Moments, allowance: Array) -> Array:
    """Two-sided p-value of "|true bias| ≤ allowance" from two disjoint sets that must agree, and in the same
    direction.
    """
    shared = np.maximum(first.shared, second.shared)
    one, two = one_sided_p(first, allowance), one_sided_p(second, allowance)
    bright = combine(one[0], two[0], shared)
    dark = combine(one[1], two[1], shared)
    return np.asarray(np.minimum(1.0, 2 * np.minimum(bright, dark)))


def holm(p: Array) -> Array:
    """Holm's adjusted p-values, of the same shape: adjusted ≤ α rejects at a family-wise level α."""
    flat = np.asarray(p, dtype=np.float64).ravel()
    if flat.size == 0:
        return np.asarray(p, dtype=np.float64)
    order = np.argsort(flat)
    stepped = np.maximum.accumulate((flat.size - np.arange(flat.size)) * flat[order])
    adjusted = np.empty_like(flat)
    adjusted[order] = np.minimum(1.0, stepped)
    return adjusted.reshape(np.shape(p))


def omnibus(
    residuals: Array, reference_variance: Array, weights: Array, allowance: Array
) -> tuple[float, float]:
    """Do many small deviations together say more than noise? A scaled F on Q = Σ wᵢ Dᵢ².

    `residuals` is (B, …); `weights` (…) ≥ 0 must not come from the same batches. |D| is first reduced by
    `allowance`. With C the covariance of √w D, E[Q] = tr C, and the first three moments of Q are those of a
    shifted and scaled χ² with tr(C²)³/tr(C³)² degrees of freedom; F instead of χ² allows for the estimation
    of E[Q]. The traces are estimated without bias. Returns the p-value and the reference's share of E[Q].
    """
    count = residuals.shape[0]
    root = np.sqrt(weights).ravel()
    flat = residuals.reshape(count, -1) * root
    reference_part = np.broadcast_to(reference_variance, weights.shape).ravel() * root**2
    mean = flat.mean(axis=0)
    own = ((flat - mean) ** 2).sum(axis=0) / (count - 1) / count
    expected = float((own + reference_part).sum())
    if expected <= 0:
        return 1.0, 0.0
    second, third = _traces(flat - mean)
    # The reference's errors are independent: their covariance v is diagonal, and so is what it adds.
    squared = second / count**2 + float((2 * own * reference_part + reference_part**2).sum())
    cubed = third / count**3 + float(
        (3 * own**2 * reference_part + 3 * own * reference_part**2 + reference_part**3).sum()
    )
    if squared <= 0:
        return 1.0, 0.0
    width = float(np.clip(expected**2 / squared, 1.0, flat.shape[1]))
    if width < FEWEST_DIMENSIONS:
        return 1.0, 0.0
    shape = float(np.clip(squared**3 / cubed**2 if cubed > 0 else width, 1.0, width))
    excess = np.maximum(np.abs(mean) - np.broadcast_to(allowance, weights.shape).ravel() * root, 0.0)
    deviations = (float((excess**2).sum()) / expected - 1) * np.sqrt(width / 2)
    ratio = 1 + deviations * np.sqrt(2 / shape)
    p = float(special.fdtrc(shape, width * (count - 1), ratio)) if ratio > 0 else 1.0
    return p, float(reference_part.sum() / expected)


def _traces(centred: Array) -> tuple[float, float]:
    """Unbiased tr(Σ²) and tr(Σ³) from centred rows (B, M): the moments of a Wishart matrix with n = B−1,
    solved.
    """
    n = centred.shape[0] - 1
    gram = centred @ centred.T / n
    square = gram @ gram
    one, two, three = float(np.trace(gram)), float(np.trace(square)), float((square * gram).sum())
    second = n**2 / ((n - 1) * (n + 2)) * (two - one**2 / n)
    # E[tr S³], E[tr S tr S²] and E[(tr S)³] in terms of tr Σ³, tr Σ tr Σ² and (tr Σ)³, times n³.
    moments = n * np.array(
        [[n**2 + 3 * n + 4, 3 * (n + 1), 1], [4 * (n + 1), n**2 + n + 4, n], [8, 6 * n, n**2]],
        dtype=np.float64,
    )
    third = float(np.linalg.solve(moments, n**3 * np.array([three, one * two, one**3]))[0])
    return max(second, 0.0), max(third, 0.0)


def interval(found: Moments, tail: float) -> tuple[Array, Array]:
    """The interval of the true bias that misses it with probability `tail` on each side, by inverting Hall's
    t.
    """
    t = -special.stdtrit(found.freedom, tail)
    high = found.bias - found.spread * hall_inverse(-t, found.skewness, found.count)
    low = found.bias - found.spread * hall_inverse(t, found.skewness, found.count)
    return low, high


def detectable_bias(
    first: Moments, second: Moments, level: Array | float, allowance: Array, power: float = 0.9
) -> Array:
    """The smallest bias (units of the image) that FAILs with probability `power`: allowance + (t_crit +
    t_β)·SE.

    SE is the standard error of one set, its square averaged over the two. `level` is the two-sided level of
    this test over both sets. Each set must reach √(level/2) on its side and does so with probability √power.
    """
    error = np.sqrt((first.standard_error**2 + second.standard_error**2) / 2)
    freedom = np.minimum(first.freedom, second.freedom)
    return np.asarray(allowance + detection_factor(freedom, level, power) * error)


def detection_factor(freedom: Array | float, level: Array | float, power: float = 0.9) -> Array:
    """t_crit + t_β, in standard errors of one set."""
    result: Array = -special.stdtrit(freedom, np.sqrt(level / 2)) - special.stdtrit(
        freedom, 1 - np.sqrt(power)
    )
    return result
