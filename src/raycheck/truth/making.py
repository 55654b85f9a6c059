"""Making references: independent batches by Mitsuba 3 or oneray, averaged in double.

Batches are small (256 samples per pixel) and many, and their spread gives the variance of the mean. Another
set of many tiny batches (4 samples per pixel) comes first: it gives the skewness of tile means, and says
how many samples the wanted standard errors take.
"""

import datetime
import math
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.seeds import reference_seed
from raycheck.renderers.oneray import oneray_command, oneray_path
from raycheck.scene import variants
from raycheck.scene.techniques import BEST, technique
from raycheck.stats.tiles import SMALLEST, tile_means, tile_sums
from raycheck.truth import references

WEIGHT_ROUNDING = 2.0**-24
"""Of the weights of Mitsuba's filters, over the largest."""


class Batches(Protocol):
    """A renderer of independent batches; batch k always has the same samples."""

    @property
    def made_by(self) -> Mapping[str, str]:
        """Entries of the manifest that say which renderer it is."""

    def batches(self, first: int, count: int, spp: int) -> Iterator[Array]:
        """Images (H, W, 3) of batches first … first + count − 1, `spp` samples per pixel each."""
        ...


class OnerayBatches:
    """oneray with its best technique, `jobs` processes at a time: for scenes that Mitsuba renders wrong."""

    def __init__(self, of: variants.Variant, jobs: int = 2):
        program = oneray_path()
        self.made_by: Mapping[str, str] = {"renderer": "oneray", "technique": BEST}
        self._command = oneray_command(program, technique(BEST).options, of.parameters)
        self._path = of.path
        self._jobs = jobs

    def batches(self, first: int, count: int, spp: int) -> Iterator[Array]:
        def render(batch: int) -> Array:
            return self._command.render(self._path, spp, reference_seed(batch), 3600.0).image.pixels

        with ThreadPoolExecutor(self._jobs) as pool:
            for start in range(first, first + count, 64):
                yield from pool.map(render, range(start, min(start + 64, first + count)))


@dataclass(frozen=True)
class Goal:
    """Standard errors of the reference to reach, relative: of the image mean, and of 90 % of the 8×8 tiles.

    A test that detects a bias of 0.3 % of the image and 1 % of a tile at 90 % power has standard errors of
    about 4.5e-4 and 1.8e-3 (0.05 % are allowed, and t + t_β is 5 to 6). The reference's own are to be at
    most a quarter or so. Where a closed form outranks it, the reference serves as its check and in the few
    pixels with edges: `checked_tile` is enough.
    """

    image: float = 1e-4
    tile: float = 5e-4
    checked_tile: float = 1e-3
    spp_per_batch: int = 256
    small_batches: int = 1024
    small_spp: int = 4
    min_batches: int = 64
    most_seconds: float = math.inf
    """Time from the start after which the large batches end even if the errors are not reached."""


@dataclass(frozen=True)
class Plan:
    """What the small batches say: skewness by tile size, samples per pixel to take, seconds they cost."""

    skewness: dict[int, list[list[list[float | None]]]]
    spp: int
    seconds: float
    spent: float
    """Seconds that went before: to start, to load the scene, and to plan."""

    @property
    def total(self) -> float:
        """Seconds that the reference takes from the first to the last."""
        return self.spent + self.seconds


def skewness_tables(images: Array, spp: int) -> dict[int, list[list[list[float | None]]]]:
    """Skewness of tile means at one sample per pixel, for tiles of 8, 16, … pixels up to the whole image.

    `images` (B, H, W, 3) are independent, of `spp` samples; a mean of n samples has 1/√n of the skewness of
    one.
    """
    side = max(images.shape[1:3])
    sizes = [8 * 2**k for k in range(max(1, math.ceil(math.log2(side / 8)) + 1))]
    tables = {}
    for size in sizes:
        means = tile_means(images, size)
        spread = means - means.mean(axis=0)
        deviation = np.sqrt((spread**2).mean(axis=0))
        constant = deviation <= 1e-6 * np.abs(means).mean(axis=0)
        with np.errstate(invalid="ignore", divide="ignore"):
            skewness = (spread**3).mean(axis=0) / deviation**3 * math.sqrt(spp)
        rounded = np.round(np.where(constant, 0.0, skewness), 3).astype(object)
        rounded[constant] = None
        tables[size] = rounded.tolist()
    return tables


def samples_needed(images: Array, spp: int, goal: Goal, checked: bool) -> int:
    """Samples per pixel that reach the goal, from images (B, H, W, 3) of `spp` samples each."""
    image = images.mean(axis=(1, 2))
    tiles = tile_means(images, SMALLEST)
    floor = np.maximum(np.abs(tiles.mean(axis=0)), np.abs(image.mean(axis=0)) / 10)
    with np.errstate(invalid="ignore", divide="ignore"):
        image_error = np.nan_to_num(image.std(axis=0) / image.mean(axis=0)).max()
        tile_error = np.nan_to_num(tiles.std(axis=0) / floor).max(axis=-1)
    tile = goal.checked_tile if checked else goal.tile
    worst = max(float(image_error) / goal.image, float(np.quantile(tile_error, 0.9)) / tile)
    return math.ceil(spp * worst**2)


def make_plan(renderer: Batches, goal: Goal, checked: bool = False, began: float | None = None) -> Plan:
    """Render the small batches (0 …) and plan the rest; `checked`: a closed form outranks the reference.
    `began`: when the work for it did, by time.perf_counter, if that was before.
    """
    began = time.perf_counter() if began is None else began
    next(renderer.batches(0, 1, goal.small_spp))
    next(renderer.batches(0, 1, goal.spp_per_batch))
    images = np.stack(list(renderer.batches(0, goal.small_batches, goal.small_spp)))
    middle = time.perf_counter()
    next(renderer.batches(0, 1, goal.spp_per_batch))
    per_batch = time.perf_counter() - middle
    batches = max(
        goal.min_batches,
        math.ceil(samples_needed(images, goal.small_spp, goal, checked) / goal.spp_per_batch),
    )
    spent = time.perf_counter() - began
    if spent + batches * per_batch > goal.most_seconds:
        batches = max(goal.min_batches, int((goal.most_seconds - spent) / per_batch))
    return Plan(
        skewness=skewness_tables(images, goal.small_spp),
        spp=batches * goal.spp_per_batch,
        seconds=batches * per_batch,
        spent=spent,
    )


def accumulate(
    images: Iterator[Array], progress: Callable[[], object] = lambda: None, *, shared: bool = False
) -> tuple[Array, Array, int]:
    """Mean, variance of the mean and number of images, by Welford's update in double.

    `shared`: samples count for several pixels, as with Mitsuba's filters, so that those vary together and a
    tile's variance is more than that of its pixels by themselves. All pixels' are raised by as much as it is
    on the whole, so that sums of them are those of tiles. Weights are single numbers, which near a filter's
    end are rounding: so is what a pixel has of lamps that far away, and its variance says so.
    """
    count = 0
    mean = squares = tile_mean = tile_squares = np.zeros(())
    for image in images:
        count += 1
        change = image - mean
        mean = mean + change / count
        squares = squares + change * (image - mean)
        if shared:
            tiles = tile_means(image, SMALLEST)
            change = tiles - tile_mean
            tile_mean = tile_mean + change / count
            tile_squares = tile_squares + change * (tiles - tile_mean)
        progress()
    if count < 2:
        raise ValueError("a variance takes at least 2 batches")
    if shared:
        sums, sizes = tile_sums(squares, SMALLEST)
        squares = squares * (tile_squares.sum() / (sums / sizes[..., None] ** 2).sum())
        squares = squares + (count - 1) * count * (WEIGHT_ROUNDING * np.abs(mean).max()) ** 2
    return mean, squares / (count - 1) / count, count


def make_reference(
    of: variants.Variant, renderer: Batches, plan: Plan, goal: Goal,
    progress: Callable[[], object] = lambda: None,
) -> dict[str, Any]:  # fmt: skip
    """Render the large batches, write image and manifest entry, return the entry.

    Raises ValueError for an image that holds NaN or Inf.
    """
    digest = variants.scene_hash(of.path, of.parameters)
    batches = plan.spp // goal.spp_per_batch
    start = time.perf_counter()
    images = renderer.batches(goal.small_batches, batches, goal.spp_per_batch)
    weights = [film.find("rfilter") for film in of.document().root.iter("film")]
    shared = any(one is None or one.get("type") != "box" for one in weights)
    mean, variance, count = accumulate(images, progress, shared=shared)
    if not (np.isfinite(mean).all() and np.isfinite(variance).all()):
        raise ValueError(f"{of.label}: the image holds NaN or Inf")
    image_error, tile_error = relative_errors(mean, variance)
    entry = {
        **renderer.made_by, "spp": goal.spp_per_batch, "batches": count,
        "seeds": [reference_seed(goal.small_batches), count], "skewness_spp": goal.small_spp,
        "skewness_batches": goal.small_batches, "skewness_seeds": [reference_seed(0), goal.small_batches],
        "hash": digest, "parameters": dict(of.parameters),
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(), "width": mean.shape[1],
        "height": mean.shape[0], "seconds": round(time.perf_counter() - start + plan.spent, 1),
        "image_goal": goal.image, "image_error": float(f"{image_error:.3g}"),
        "tile_error_p90": float(f"{tile_error:.3g}"),
        "skewness": {str(size): table for size, table in plan.skewness.items()},
    }  # fmt: skip
    references.write_reference(of, mean, variance, entry)
    return entry


def relative_errors(mean: Array, variance_of_mean: Array) -> tuple[float, float]:
    """Relative standard error of the image mean, and the 90 % quantile of that of 8×8 tiles (worst channel).

    A tile's error is relative to its mean or to a tenth of the image's, whichever is larger.
    """
    pixels = mean.shape[0] * mean.shape[1]
    image = mean.mean(axis=(0, 1))
    sums, sizes = tile_sums(variance_of_mean, SMALLEST)
    tile = (
        np.sqrt(sums) / sizes[..., None] / np.maximum(np.abs(tile_means(mean, SMALLEST)), np.abs(image) / 10)
    )
    return (
        float((np.sqrt(variance_of_mean.sum(axis=(0, 1))) / pixels / image).max()),
        float(np.quantile(tile.max(axis=-1), 0.9)),
    )
