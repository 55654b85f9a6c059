"""The plain checks: mistakes of convention that are found, and named, before any statistics.

Images are (B, H, W, 3) of B seeds, references (H, W, 3). Each check returns a sentence, or None where nothing
is wrong.
"""

import hashlib
import math
from collections.abc import Callable, Sequence

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.images import Image, Window, decode_srgb
from raycheck.base.text import percent
from raycheck.stats.tiles import Tile, grid, region_means, region_variances
from raycheck.truth.expected import Truth

GROSS_RATIO = 30.0
"""Mean squared difference over its expected noise, from which a mistake counts as gross…"""
GROSS_SIZE = 0.02
"""…if it is also at least this large, relative to the image."""
SHARED = 0.5
"""Correlation of the noise of neighbouring pixels, or of two seeds, from which it is a mistake."""
RARE = 2.0
"""Deviations from which a pixel's noise counts no more: rare events alone would correlate by chance."""
FEWEST_VARYING = 256
"""Pixels that must vary for their correlation to say anything."""
GROWTH_ERROR, GROWTH_ERRORS = 0.7, 5.0
"""Standard error of the logarithm of a region's variance from eight images, and how many of the median's are
beyond chance.
"""
OTHER_ERRORS, OTHER_SIZE = 8.0, 0.02
"""Means of an image that differ by more standard errors, and by a larger share, are of two pictures."""
FEWER_NOISY = 0.5
"""Variance of a sample over the reference's, below which samples that are too dark look clamped."""


def size_problem(image: Image, height: int, width: int, part: Window | None = None) -> str | None:
    """Other pixels than those of an image of that size, or than that part of a larger one."""
    found = image.pixels.shape
    if found[:2] == (height, width) and image.window == part:
        return None
    turned = ", width and height are swapped" if found[:2] == (width, height) else ""
    size = f"{found[1]}×{found[0]} pixels{_place_of(image.window)}"
    asked = f"{width}×{height}{_place_of(part)}"
    return f"the image is {size}, the scene asks for {asked}{turned if width != height else ''}"


def _place_of(part: Window | None) -> str:
    return f" at column {part.x}, row {part.y} of {part.width}×{part.height}" if part else ""


def number_problem(image: Image) -> str | None:
    """Counts NaN and Inf and locates the first: they are never dropped."""
    bad = ~np.isfinite(image.pixels)
    if not bad.any():
        return None
    pixels = bad.any(axis=2)
    row, column = np.argwhere(pixels)[0]
    nan, infinite = int(np.isnan(image.pixels).sum()), int(np.isinf(image.pixels).sum())
    counts = [f"{n} {word}" for n, word in ((nan, "NaN"), (infinite, "Inf")) if n]
    count = int(pixels.sum())
    return (
        f"{' and '.join(counts)} value{'s' if nan + infinite > 1 else ''} in {count} of {pixels.size} pixels"
        f", the first in row {row}, column {column} from the top left"
    )


def digest(image: Image) -> str:
    """Equal for images that are equal bit for bit."""
    return hashlib.sha256(np.ascontiguousarray(image.pixels).tobytes()).hexdigest()


def seed_problem(digests: Sequence[str], labels: Sequence[str], reference_varies: bool) -> str | None:
    """Images of different seeds that are the same, where a Monte Carlo estimate has to vary."""
    if not reference_varies or len(digests) < 2 or len(set(digests)) == len(digests):
        return None
    if len(set(digests)) == 1:
        return f"all {len(digests)} images are identical: the seed changes nothing, noise cannot be measured"
    first: dict[str, str] = {}
    for key, label in zip(digests, labels, strict=True):
        if key in first:
            pair = f"{first[key]} and {label}"
            break
        first[key] = label
    return (
        f"only {len(set(digests))} of {len(digests)} images differ, {pair} gave the same one: "
        "every seed must give samples of its own"
    )


def shared_noise(images: Array) -> str | None:
    """Seeds, or neighbouring pixels, whose noise is alike: too little is measured between them."""
    grey = images.mean(axis=3)
    deviation = grey.std(axis=0)
    varies = deviation > 0
    if varies.sum() < FEWEST_VARYING or len(images) < 8:
        return None
    noise = np.clip((grey - grey.mean(axis=0)) / np.where(varies, deviation, 1.0), -RARE, RARE)
    noise -= noise.mean(axis=0)
    size = noise.std(axis=0)
    noise = np.where(varies, noise / np.where(size > 0, size, 1.0), 0.0)
    of_seeds = np.tensordot(noise, noise, axes=([1, 2], [1, 2]))
    length = np.sqrt(of_seeds.diagonal())
    of_seeds /= np.maximum(np.outer(length, length), 1e-30)
    np.fill_diagonal(of_seeds, 0.0)
    if of_seeds.max() > SHARED:
        one, other = sorted(np.unravel_index(int(of_seeds.argmax()), of_seeds.shape))
        return (
            f"images {one + 1} and {other + 1} share noise (correlation {of_seeds.max():.2f}): "
            "different seeds must give different samples"
        )
    for step, where in ((noise[:, :, 1:] * noise[:, :, :-1], "side by side"),
                        (noise[:, 1:] * noise[:, :-1], "above each other")):  # fmt: skip
        pairs = (varies[:, 1:] & varies[:, :-1]) if where == "side by side" else (varies[1:] & varies[:-1])
        alike = float(step.mean(axis=0)[pairs].mean()) if pairs.sum() >= FEWEST_VARYING else 0.0
        if alike > SHARED:
            return (
                f"pixels {where} share noise (correlation {alike:.2f}): they use the same random numbers, or "
                "a filter wider than the pixel, where the scene asks for a box"
            )
    return None


def stuck_noise(few: Array, spp: int, many: Array, more: int) -> str | None:
    """Noise that more samples do not lessen. `few` and `many` are means of tame regions (B, R, 3), at `spp`
    and `more` samples per pixel; the median over the regions is taken of the variance per sample.
    """
    before, after = few.var(axis=0, ddof=1).mean(axis=1), many.var(axis=0, ddof=1).mean(axis=1)
    varies = (before > 0) & (after > 0)
    if not varies.any() or more == spp:
        return None
    growth = float(np.median(np.log(after[varies] * more / (before[varies] * spp))))
    stuck = math.log(more / spp)
    error = GROWTH_ERROR / math.sqrt(varies.sum())
    if abs(growth - stuck) > abs(growth) or abs(growth) < GROWTH_ERRORS * error:
        return None
    return (
        f"{more / spp:.2g} times the samples have {math.exp(growth - stuck):.2g} of the variance, not "
        f"{spp / more:.2g}: the samples of a pixel are not independent, are they all of one seed?"
    )


def another_picture(few: Array, spp: int, many: Array, more: int) -> str | None:
    """`few` and `many` are means (B, 3) of whole images with `spp` and `more` samples per pixel: of one
    picture, or not even numbers.
    """
    if not np.isfinite(many).all():
        return f"with {more} samples per pixel the image holds NaN or Inf"
    variance = few.var(axis=0, ddof=1) * (1 / len(few) + spp / more / len(many))
    difference = np.abs(many.mean(axis=0) - few.mean(axis=0))
    least = np.maximum(OTHER_ERRORS * np.sqrt(variance), OTHER_SIZE * np.abs(few.mean(axis=0)))
    if np.all(difference <= least):
        return None
    times = f"{many.mean() / few.mean() if few.mean() else math.inf:.3g} times"
    return f"with {more} samples per pixel it is another picture than with {spp}, {times} as bright"


def clamped_samples(bias: float, noise: float) -> str | None:
    """Too dark and yet calmer than the reference's renderer at equal samples: what is missing is the rare
    bright ones. `noise` is the ratio of the variances, `bias` that of the image, relative.
    """
    if bias >= 0 or noise > FEWER_NOISY:
        return None
    return (
        f"the image is too dark and its samples vary {noise:.2g} times as much as the reference's: it looks "
        "as if bright samples were clamped, or never taken"
    )


def name_mistake(
    images: Array, reference: Array, reference_variance: Array, lights: int = 1, gross: bool = False
) -> str | None:
    """A mistake of convention that explains how the images differ from the reference, or None.

    With `gross` only differences far beyond noise count, so that a few batches suffice; without it the caller
    already knows that the images differ.
    """
    clamp = _clamped(images, reference, reference_variance)
    if clamp:
        return clamp
    mean = images.mean(axis=0)
    tiles = grid(*reference.shape[:2])
    yardstick = _yardstick(reference, tiles)
    noise = _noise(images, tiles) + region_variances(reference_variance, tiles)
    before = _mismatch(mean, reference, tiles, yardstick, noise)
    size = math.sqrt(np.mean((region_means(mean - reference, tiles) / yardstick) ** 2))
    if gross and (before < GROSS_RATIO or size < GROSS_SIZE):
        return None

    def explains(after: float, before: float = before) -> bool:
        return after < before / 25 or (not gross and after < 2.5 and after < before / 4)

    turns = {
        "the image is upside down (PFM stores rows from the bottom up, EXR from the top down)": mean[::-1],
        "the image is mirrored, left and right swapped": mean[:, ::-1],
        "the image is turned by 180°": mean[::-1, ::-1],
        "red and blue are swapped": mean[:, :, ::-1],
    }
    if reference.shape[0] == reference.shape[1]:
        turns["rows and columns are swapped"] = mean.transpose(1, 0, 2)
    for sentence, turned in turns.items():
        if explains(_mismatch(turned, reference, tiles, yardstick, noise)):
            return sentence
    factor = _factor(mean, reference, tiles, yardstick)
    if factor > 0:
        if explains(_mismatch(mean / factor, reference, tiles, yardstick, noise / factor**2)):
            return _factor_sentence(factor, lights)
        for sentence, turned in turns.items():
            factor = _factor(turned, reference, tiles, yardstick)
            if factor > 0 and explains(
                _mismatch(turned / factor, reference, tiles, yardstick, noise / factor**2)
            ):
                return f"{sentence}, and {_factor_sentence(factor, lights)}"
    return _encoded(images, reference, reference_variance, explains)


def _yardstick(reference: Array, tiles: list[Tile]) -> Array:
    means = region_means(reference, tiles)
    floor = np.abs(reference).mean(axis=(0, 1)) / 10
    return np.maximum(np.abs(means), np.where(floor > 0, floor, max(float(np.abs(reference).max()), 1e-30)))


def _noise(images: Array, tiles: list[Tile]) -> Array:
    means = region_means(images, tiles)
    return means.var(axis=0, ddof=1) / len(images) if len(images) > 1 else np.zeros(means.shape[1:])


def _mismatch(mean: Array, reference: Array, tiles: list[Tile], yardstick: Array, noise: Array) -> float:
    """Mean squared difference of tiles, relative to the brighter of the two, over what noise alone would give
    (with rounding as its floor). No tile counts for more than 1, so that a lamp where none should be does not
    outweigh the rest of the image.
    """
    found = region_means(mean, tiles)
    brighter = np.maximum(yardstick, np.abs(found))
    difference = (found - region_means(reference, tiles)) / brighter
    return float((difference**2).mean() / ((noise / brighter**2).mean() + 1e-8))


def _factor(mean: Array, reference: Array, tiles: list[Tile], yardstick: Array) -> float:
    r = region_means(reference, tiles) / yardstick
    m = region_means(mean, tiles) / yardstick
    return float((r * m).sum() / (r * r).sum()) if np.any(r) else 0.0


def _factor_sentence(factor: float, lights: int) -> str:
    known = {
        "π": math.pi, "2π": 2 * math.pi, "4π": 4 * math.pi, "π/2": math.pi / 2, "2": 2.0, "4": 4.0,
        "1/π": 1 / math.pi, "1/(2π)": 0.5 / math.pi, "1/(4π)": 0.25 / math.pi, "2/π": 2 / math.pi,
        "1/2": 0.5, "1/4": 0.25,
    }  # fmt: skip
    if lights > 1:
        known = {
            f"{lights}, the number of lights": float(lights),
            f"1/{lights}, 1/number of lights": 1 / lights,
        } | known
    close = {name: abs(factor / value - 1) for name, value in known.items()}
    best = min(close, key=close.__getitem__)
    likely = f", a factor of {best}" if close[best] < 0.015 else ""
    if abs(factor - 1) < 0.2:
        return f"everything is {percent(factor - 1)} too {'bright' if factor > 1 else 'dark'}"
    if factor < 1:
        return f"everything is too dark, {factor:.4g} of what it should be{likely}"
    return f"everything is {factor:.4g} times too bright{likely}"


def _clamped(images: Array, reference: Array, reference_variance: Array) -> str | None:
    """No value of any image above a cap that the reference's mean exceeds: no noise can do that."""
    cap = float(images.max())
    excess = reference - 6 * np.sqrt(reference_variance) > cap * 1.005
    at_cap = int((images >= cap * (1 - 1e-6)).sum())
    if cap <= 0 or not excess.any() or at_cap < max(len(images), 2) or abs(cap - round(cap)) > 0.004:
        return None
    return (
        f"values are clamped at {cap:.3g}: no pixel of {len(images)} images is brighter, but the reference "
        f"is up to {reference.max():.3g} in {int(excess.any(axis=2).sum())} pixels"
    )


def _encoded(
    images: Array, reference: Array, reference_variance: Array, explains: Callable[..., bool]
) -> str | None:
    """sRGB or gamma 2.2 instead of linear values; judged where the reference is too dark to have been
    clipped.
    """
    tiles = [t for t in grid(*reference.shape[:2]) if reference[t.window].max() < 0.8]
    if len(tiles) * 4 < len(grid(*reference.shape[:2])) or images.min() < 0:
        return None
    yardstick = _yardstick(reference, tiles)
    reference_noise = region_variances(reference_variance, tiles)
    before = _mismatch(
        images.mean(axis=0), reference, tiles, yardstick, _noise(images, tiles) + reference_noise
    )
    found = {}
    for name, decoded in (("sRGB-encoded", decode_srgb(images)), ("gamma-encoded (2.2)", images**2.2)):
        noise = _noise(decoded, tiles) + reference_noise
        found[name] = _mismatch(decoded.mean(axis=0), reference, tiles, yardstick, noise)
    nearer = min(found, key=found.__getitem__)
    return f"the values are {nearer}, linear radiance is needed" if explains(found[nearer], before) else None


class Broken(Exception):
    """An image that a plain check rejects, or none at all: the sentence that says so."""


def check_contract(image: Image, truth: Truth, label: str) -> None:
    problem = size_problem(image, *truth.shape) or number_problem(image)
    if problem:
        raise Broken(f"{problem} ({label})" if label else problem)
