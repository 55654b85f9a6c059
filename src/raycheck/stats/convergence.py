"""How the error of a renderer falls with its samples: error, bias and variance, slope, and why a curve bends.

All figures come from images x of R independent seeds (rounds) at each of several sample counts n, and from a
reference r whose mean has variance v per pixel. Means ⟨·⟩ run over pixels and channels.

    MSE     ⟨(x − r)²⟩                       RMSE its root
    relMSE  ⟨(x − r)²/(r² + ε)⟩              ε = 0.01 ⟨r⟩²
    bias²   mean over pairs of seeds i ≠ j of ⟨(xᵢ − r)(xⱼ − r)⟩, less ⟨v⟩: without bias itself
    variance  mean over seeds of ⟨(x − x̄)²⟩·R/(R − 1)

so that MSE = bias² + variance + ⟨v⟩. "Without outliers" leaves out the 0.1 % of an image's pixels with the
largest squared error (of the channel mean). Errors of these figures, and of whatever is computed from them,
are from leaving out one round at a time (the jackknife); intervals are 95 %, Student's t with R − 1 degrees.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from raycheck.base.arrays import Array, Flags, Indices

OUTLIERS = 0.001
"""Share of the pixels that the figures without outliers leave out."""
RELATIVE_EPSILON = 0.01
"""ε of relMSE over the squared mean of the reference."""
CONFIDENCE = 0.95
NOTHING = 1e-12
"""MSE over the squared mean below which a picture is exact: rounding of 32-bit floats."""
FLOOR_FACTOR = 2.0
"""Levels whose MSE is below so many ⟨v⟩ show the reference's noise, and do not count for a slope."""
SLOPE = -0.5
SLOPE_WITHIN = 0.03
HEAVY_LUCK = 0.25
"""Luck from which tails are heavy; bounded samples at the edge of a light have up to 0.2."""
UNSURE = 0.2
"""A slope whose interval is wider is not known."""


@dataclass(frozen=True)
class Band:
    """A figure with its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Level:
    """One number of samples per pixel."""

    spp: int
    rmse: Band
    relmse: Band
    rmse_without_outliers: Band
    relmse_without_outliers: Band
    bias2: Band
    """May come out below 0 where there is none."""
    variance: Band
    luck: float
    """Share of the squared error that the outliers of an image have there, less what the same pixels have in
    the images of other seeds: pixels that are noisy in every image are not luck.
    """


@dataclass(frozen=True)
class Scores:
    """What the images of one level say, one entry a round."""

    spp: int
    gram: Array
    """(R, R) ⟨(xᵢ − r)(xⱼ − r)⟩; the diagonal is the MSE of each."""
    relmse: Array
    """(R,)"""
    mse_without_outliers: Array
    relmse_without_outliers: Array
    luck: Array
    """(R,)"""

    def keep(self, rounds: Indices) -> "Scores":
        return Scores(self.spp, self.gram[np.ix_(rounds, rounds)], self.relmse[rounds],
                      self.mse_without_outliers[rounds], self.relmse_without_outliers[rounds],
                      self.luck[rounds])  # fmt: skip

    @property
    def mse(self) -> float:
        return float(np.diag(self.gram).mean())

    @property
    def variance(self) -> float:
        count = len(self.gram)
        return float((np.trace(self.gram) - self.gram.sum() / count) / (count - 1))

    def bias2(self, reference_variance: float) -> float:
        count = len(self.gram)
        pairs = (self.gram.sum() - np.trace(self.gram)) / (count * (count - 1))
        return float(pairs) - reference_variance


def score(spp: int, images: Array, reference: Array) -> Scores:
    """The scores of images (R ≥ 2, H, W, 3) at `spp` samples beside the reference (H, W, 3)."""
    residuals = images - reference
    flat = residuals.reshape(len(images), -1)
    weight = 1 / (reference**2 + epsilon(reference))
    squared = residuals**2
    left = _without_outliers(residuals)
    return Scores(
        spp=spp,
        gram=flat @ flat.T / flat.shape[1],
        relmse=(squared * weight).mean(axis=(1, 2, 3)),
        mse_without_outliers=np.array([s[k].mean() for s, k in zip(squared, left, strict=True)]),
        relmse_without_outliers=np.array(
            [(s * weight)[k].mean() for s, k in zip(squared, left, strict=True)]
        ),
        luck=_luck(squared.sum(axis=3), ~left),
    )


def epsilon(reference: Array) -> float:
    """ε of relMSE, (W·sr⁻¹·m⁻²)²."""
    return RELATIVE_EPSILON * float(reference.mean()) ** 2 or 1e-12


def _without_outliers(residuals: Array) -> Flags:
    """(R, H, W) pixels that are not among the 0.1 % with the largest squared error."""
    size = (residuals.mean(axis=3) ** 2).reshape(len(residuals), -1)
    out = max(1, round(OUTLIERS * size.shape[1]))
    kept = np.ones(size.shape, dtype=bool)
    np.put_along_axis(kept, np.argpartition(size, -out, axis=1)[:, -out:], False, axis=1)
    return kept.reshape(residuals.shape[:3])


def _luck(squared: Array, outliers: Flags) -> Array:
    """(R,) from squared errors (R, H, W) and where the outliers of each image are."""
    share = np.array([[other[out].sum() for other in squared] for out in outliers])
    share = share / np.maximum(squared.sum(axis=(1, 2)), 1e-300)
    count = len(squared)
    own = np.diag(share)
    return np.asarray(own - (share.sum(axis=1) - own) / (count - 1))


def jackknife(rounds: int, figure: Callable[[Indices], float]) -> Band:
    """A figure of all rounds, which `figure` computes from those it is given, with its interval."""
    every = np.arange(rounds)
    value = figure(every)
    parts = np.array([figure(np.delete(every, one)) for one in every])
    error = np.sqrt((rounds - 1) / rounds * ((parts - parts.mean()) ** 2).sum())
    half = float(-special.stdtrit(rounds - 1, (1 - CONFIDENCE) / 2) * error)
    return Band(value, value - half, value + half)


def _root(band: Band) -> Band:
    return Band(*(float(np.sqrt(max(x, 0.0))) for x in (band.value, band.low, band.high)))


def level(found: Scores, reference_variance: float) -> Level:
    """The figures of a level."""
    rounds = len(found.relmse)

    def band(figure: Callable[[Scores], float]) -> Band:
        return jackknife(rounds, lambda kept: figure(found.keep(kept)))

    return Level(
        spp=found.spp,
        rmse=_root(band(lambda s: s.mse)),
        relmse=band(lambda s: float(s.relmse.mean())),
        rmse_without_outliers=_root(band(lambda s: float(s.mse_without_outliers.mean()))),
        relmse_without_outliers=band(lambda s: float(s.relmse_without_outliers.mean())),
        bias2=band(lambda s: s.bias2(reference_variance)),
        variance=band(lambda s: s.variance),
        luck=float(found.luck.mean()),
    )


def usable(levels: Sequence[Scores], reference_variance: float, reference_mean: float) -> list[Scores]:
    """The levels that show the renderer's error, not the reference's noise or rounding."""
    least = max(FLOOR_FACTOR * reference_variance, NOTHING * reference_mean**2)
    return [one for one in levels if one.mse > least]


@dataclass(frozen=True)
class Fit:
    """A straight line on logarithmic axes: log RMSE = log_rmse + slope · (log n − log_spp)."""

    slope: Band
    log_spp: float
    """log of the samples at the middle of the points."""
    log_rmse: float

    def samples_for(self, rmse: float) -> float:
        """Samples per pixel at which the line reaches `rmse`: that of slope −½ where the fitted slope may be
        that, since far off a small error of the slope is a large one of the samples.
        """
        slope = SLOPE if self.slope.low <= SLOPE <= self.slope.high else self.slope.value
        return float(np.exp(self.log_spp + (np.log(rmse) - self.log_rmse) / slope))


def fit(levels: Sequence[Scores], error2: Callable[[Scores], float]) -> Fit | None:
    """The line through the roots of the squared errors `error2` of at least three levels, on logarithmic
    axes; None where there are fewer, or one is not above 0.
    """
    x = np.log([one.spp for one in levels])
    if len(levels) < 3 or min(error2(one) for one in levels) <= 0:
        return None

    def slope(kept: Indices) -> float:
        squares = [max(error2(one.keep(kept)), 1e-300) for one in levels]
        return float(np.polyfit(x, 0.5 * np.log(squares), 1)[0])

    middle = float(np.mean([0.5 * np.log(error2(one)) for one in levels]))
    return Fit(jackknife(len(levels[0].relmse), slope), float(x.mean()), middle)


@dataclass(frozen=True)
class Slopes:
    """The lines of a curve, the reference's own part taken off the errors."""

    rmse: Fit | None
    relative: Fit | None
    """The line of the root of relMSE."""
    without_outliers: Fit | None
    """The line of the RMSE without outliers."""


def slopes(levels: Sequence[Scores], reference: Array, reference_variance: Array) -> Slopes:
    """The slopes of the usable levels; reference and its variance (H, W, 3)."""
    floor2 = float(reference_variance.mean())
    relative_floor2 = float((reference_variance / (reference**2 + epsilon(reference))).mean())
    return Slopes(
        fit(levels, lambda one: one.mse - floor2),
        fit(levels, lambda one: float(one.relmse.mean()) - relative_floor2),
        fit(levels, lambda one: float(one.mse_without_outliers.mean()) - floor2),
    )


def bend(all_slope: Band | None, luck: float, bias: str | None) -> tuple[str, str]:
    """The flag "bias", "heavy tails", "slow" or "", and a sentence that says why.

    `bias` is what a test of the images against the reference found, None if nothing. A curve without bias
    whose slope is surely above −½ + 0.03, or not known, has heavy tails where luck carries its error; where
    it is surely above without that, its samples depend on each other.
    """
    if bias is not None:
        return "bias", bias
    if all_slope is None:
        return "", ""
    slow = all_slope.low > SLOPE + SLOPE_WITHIN
    unsure = all_slope.high - all_slope.low > UNSURE
    if luck >= HEAVY_LUCK and (slow or unsure):
        return "heavy tails", (
            f"a few samples carry the error: 0.1 % of the pixels, other ones with every seed, have "
            f"{100 * luck:.0f} % of it"
        )
    if slow:
        return "slow", (
            f"the error falls with exponent {all_slope.value:.2f}".replace("-", "−")
            + ", neither bias nor outliers explain it: samples may depend on each other"
        )
    return "", ""


def efficiency(top: Scores, seconds_per_sample: float) -> Band:
    """1/(variance · time), s⁻¹ (W·sr⁻¹·m⁻²)⁻²: variance of one sample per pixel as that of the level's
    pictures times their samples.
    """
    band = jackknife(len(top.relmse), lambda kept: top.keep(kept).variance)
    scale = top.spp * seconds_per_sample
    low = max(band.low, 1e-3 * band.value)
    return Band(1 / (band.value * scale), 1 / (band.high * scale), 1 / (low * scale))


def relative(band: Band, baseline: Band) -> Band:
    """`band` over `baseline`, their errors independent, on a logarithmic scale."""
    value = band.value / baseline.value
    up = np.hypot(np.log(band.high / band.value), np.log(baseline.value / baseline.low))
    down = np.hypot(np.log(band.value / band.low), np.log(baseline.high / baseline.value))
    return Band(value, float(value * np.exp(-down)), float(value * np.exp(up)))


def line_of_times(times: Mapping[int, float]) -> tuple[float, float]:
    """Seconds to start and seconds for each sample per pixel, from seconds by samples: a straight line,
    fitted with errors of half a millisecond and 2 %.
    """
    spp = np.array(list(times), dtype=np.float64)
    seconds = np.array(list(times.values()))
    weight = 1 / np.hypot(5e-4, 0.02 * seconds)
    each, start = np.polyfit(spp, seconds, 1, w=weight)
    if start < 0:  # less than nothing to start: noise
        start, each = 0.0, float((weight**2 * spp * seconds).sum() / (weight**2 * spp**2).sum())
    return float(start), max(float(each), 1e-9)
