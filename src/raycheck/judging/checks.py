"""The plain checks: mistakes of convention that are found, and named, before any statistics.

Images are (B, H, W, 3) of B seeds, references (H, W, 3). Each check returns a sentence, or None where nothing
is wrong.
"""

import hashlib
import math
from collections.abc import Collection, Sequence

import numpy as np

from raycheck.base.arrays import Array, Flags
from raycheck.base.images import Image, Window
from raycheck.stats.tiles import SMALLEST
from raycheck.truth.expected import Truth

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
LAMP, FEWEST_CAPPED = 4.0, 32
"""Share of a cap from which a pixel may show a lamp; samples that end at it, in half as many pixels."""
CURVED = 0.1
"""By how much values below a cap may be off where it only cuts what is brighter."""
OTHER_ERRORS, OTHER_SIZE = 8.0, 0.02
"""Means of an image that differ by more standard errors, and by a larger share, are of two pictures."""

SEEN_WITHIN = 16.0
"""Times its own noise that the reference varies within tiles, where pictures are compared with that."""
FOLLOWS, FOLLOWS_ERRORS = 0.5, 8.0
"""Slope within tiles below which a picture does not follow the reference, by more standard errors."""
FEWEST_SLOPES = 16
"""Images whose slopes tell by how much their mean is off by chance: of sixteen with normal noise one set in a
million seems not to follow, of eight fifty.
"""


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


def shared_noise(images: Array, filtered: bool = False) -> str | None:
    """Seeds whose noise is alike, or neighbouring pixels, if no filter of the scene makes it so."""
    noise, varies = _noise(images)
    if varies.sum() < FEWEST_VARYING or len(images) < 8:
        return None
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
    if filtered:
        return None
    for where, alike in _neighbours(noise, varies).items():
        if alike > SHARED:
            return (
                f"pixels {where} share noise (correlation {alike:.2f}): they use the same random numbers, or "
                "a filter wider than the pixel, where the scene asks for a box"
            )
    return None


def neighbours_noise(images: Array) -> float:
    """Correlation of the noise of neighbouring pixels, side by side or above each other; 0 where it cannot be
    known.
    """
    return max(_neighbours(*_noise(images)).values()) if len(images) >= 8 else 0.0


def _noise(images: Array) -> tuple[Array, Flags]:
    """(B, H, W) noise of mean 0 and deviation 1 in each pixel, without rare events, and (H, W) where there is
    any.
    """
    grey = images.mean(axis=3)
    deviation = grey.std(axis=0)
    varies = deviation > 0
    noise = np.clip((grey - grey.mean(axis=0)) / np.where(varies, deviation, 1.0), -RARE, RARE)
    noise -= noise.mean(axis=0)
    size = noise.std(axis=0)
    return np.where(varies, noise / np.where(size > 0, size, 1.0), 0.0), varies


def _neighbours(noise: Array, varies: Flags) -> dict[str, float]:
    """The correlation of pixels, by where they are."""
    found = {}
    for where, one, other in (
        ("side by side", np.s_[..., 1:], np.s_[..., :-1]),
        ("above each other", np.s_[..., 1:, :], np.s_[..., :-1, :]),
    ):
        pairs = varies[one] & varies[other]
        alike = (noise[one] * noise[other]).mean(axis=0)[pairs]
        found[where] = float(alike.mean()) if pairs.sum() >= FEWEST_VARYING else 0.0
    return found


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
    if (growth - stuck) * math.copysign(1, stuck) > GROWTH_ERRORS * error:
        return None  # more samples have more noise: `few` lack what is rare
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


def slopes_within(images: Array, truth: Truth) -> Array:
    """How each image (B, H, W, 3) follows the reference within the smallest tiles, whose means say nothing of
    it: (B,) slopes, in the mean 1 of what is right; none where the reference hardly varies there.
    """
    reference, noise = _within(truth.mean.mean(axis=2)), float(truth.variance.mean(axis=2).sum())
    size = float((reference**2).sum())
    if size <= SEEN_WITHIN * noise or size == 0.0:
        return np.empty(0)
    slopes: Array = (_within(images.mean(axis=3)) * reference).sum(axis=(1, 2)) / (size - noise)
    return slopes


def exchanged_pixels(slopes: Array) -> str | None:
    """Images that `slopes_within` shows to be right in the mean of tiles alone."""
    if len(slopes) < FEWEST_SLOPES:
        return None
    slope, error = float(slopes.mean()), float(slopes.std(ddof=1)) / math.sqrt(len(slopes))
    if slope > FOLLOWS or 1 - slope < FOLLOWS_ERRORS * error:
        return None
    return (
        f"tiles of {SMALLEST}×{SMALLEST} pixels have the right mean, but within them the image does not "
        f"follow the reference (slope {slope:.2f} ± {error:.2g}, 1 is right): are pixels exchanged?"
    )


def _within(grey: Array) -> Array:
    """(…, H, W) less the means of the whole smallest tiles, without what is left over at the edges."""
    rows, columns = (n // SMALLEST for n in grey.shape[-2:])
    whole = grey[..., : rows * SMALLEST, : columns * SMALLEST]
    tiles = whole.reshape(*grey.shape[:-2], rows, SMALLEST, columns, SMALLEST)
    inside: Array = tiles - tiles.mean(axis=(-3, -1), keepdims=True)
    return inside.reshape(whole.shape)


def clamped(images: Array, reference: Array, reference_variance: Array) -> str | None:
    """No value of any image above a cap that the reference's mean exceeds: no noise can do that. A tone curve
    ends at its white too, but changes what is darker.
    """
    cap = float(images.max())
    darker = (reference > cap / 8) & (reference < cap / 2)
    if darker.any() and abs(np.median(images.mean(axis=0)[darker] / reference[darker]) - 1) > CURVED:
        return None
    excess = reference - 6 * np.sqrt(reference_variance) > cap * 1.005
    at_cap = int((images >= cap * (1 - 1e-6)).sum())
    if cap <= 0 or not excess.any() or at_cap < max(len(images), 2) or abs(cap - round(cap)) > 0.004:
        return None
    return (
        f"values are clamped at {cap:.3g}: no pixel of {len(images)} images is brighter, but the reference "
        f"is up to {reference.max():.3g} in {int(excess.any(axis=2).sum())} pixels"
    )


def capped_samples(images: Array, truth: Truth, radiances: Collection[float] = ()) -> str | None:
    """Samples that all end at one value, in many places: of images (B, H, W, 3) with one sample per pixel.
    Not where the reference shows a lamp, whose radiance many samples have, nor at the `radiances` of lamps,
    which samples have that meet one through glass.
    """
    bright = images.max(axis=3)
    cap = float(bright.max())
    if any(abs(cap - radiance) <= 1e-3 * radiance for radiance in radiances):
        return None
    lamp = np.pad(truth.mean.max(axis=2) >= cap / LAMP, 1, mode="edge")
    near = np.any(
        [lamp[i : i + bright.shape[1], j : j + bright.shape[2]] for i in range(3) for j in range(3)], axis=0
    )
    at_cap = (bright >= cap * (1 - 1e-5)) & ~near
    pixels = int(at_cap.any(axis=0).sum())
    if cap <= 0 or at_cap.sum() < FEWEST_CAPPED or pixels < FEWEST_CAPPED // 2:
        return None
    return (
        f"bright samples are clamped at {cap:.4g}: {int(at_cap.sum())} samples in {pixels} pixels have just "
        "that value, and none has more"
    )


class Broken(Exception):
    """An image that a plain check rejects, or none at all: the sentence that says so."""


def check_contract(image: Image, truth: Truth, label: str) -> None:
    problem = size_problem(image, *truth.shape) or number_problem(image)
    if problem:
        raise Broken(f"{problem} ({label})" if label else problem)
