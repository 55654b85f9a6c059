"""References by Mitsuba 3: independent batches, averaged in double.

Mitsuba's film adds samples in single precision and drifts with their number (−2.2e-4 at 2¹⁸ samples per
pixel, measured), so batches are small (256) and many. Their spread gives the variance of the mean. Another
set of many tiny batches (4 samples per pixel) comes first: it gives the skewness of tile means, and says
how many samples the wanted standard errors take.

Seeds. Mitsuba's are 32 bits wide. Batch k has FIRST_SEED + k, at or above 2³¹, and tests stay below. The
llvm variants hash the seed; neighbouring seeds showed no correlation (mirror-light, 4096 batches of 4
samples and 1024 of 64: neighbours' correlation at most 0.06, means of groups of 4 and 16 vary as they
should). The scalar variants, by their source, use stream seed · pixels + pixel, modulo 2³²: neighbouring
seeds have nothing in common there either, but seeds that are 2³² / pixels apart give one and the same
picture, so that seeds must not be spaced by powers of two, and a scalar test may by chance repeat a scalar
reference's batch.

Mitsuba is imported only when something is rendered.
"""

import ctypes.util
import datetime
import math
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raycheck import references

Array = NDArray[np.float64]

FIRST_SEED = 2**31
MAX_PIXELS = 2**16
MAX_BATCHES = 2**16
MAX_SPP_PER_BATCH = 4096

LLVM_PLACES = (
    "/usr/lib/llvm-*/lib/libLLVM*.so*",
    "/usr/lib/*-linux-gnu/libLLVM*.so*",
    "/usr/lib64/libLLVM*.so*",
    "/usr/local/lib/libLLVM*.so*",
    "/opt/homebrew/opt/llvm*/lib/libLLVM.dylib",
    "/usr/local/opt/llvm*/lib/libLLVM.dylib",
)

_PROBE = """
import sys
import mitsuba as mi
mi.set_variant(sys.argv[1])
scene = mi.load_dict({"type": "scene", "integrator": {"type": "path"}, "light": {"type": "constant"},
    "sensor": {"type": "perspective", "film": {"type": "hdrfilm", "width": 4, "height": 4}}})
print("mean", float(mi.render(scene, spp=4).numpy().mean()))
"""


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


@dataclass(frozen=True)
class Pilot:
    """What the small batches say: skewness by tile size, samples per pixel to take, seconds they cost."""

    skewness: dict[int, list[list[list[float | None]]]]
    spp: int
    seconds: float
    spent: float


def llvm_candidates() -> list[Path]:
    """LLVM libraries here, the most promising first: newest, 14 to 16 last (they crash with AVX-512)."""
    found = {Path(os.environ["DRJIT_LIBLLVM_PATH"])} if os.environ.get("DRJIT_LIBLLVM_PATH") else set()
    libraries = {path.resolve() for place in LLVM_PLACES for path in Path("/").glob(place[1:])}
    named = ctypes.util.find_library("LLVM")

    def version(path: Path) -> int:
        number = re.search(r"(?:LLVM[-.](?:so\.)?|llvm[-@]?)(\d+)", str(path))
        return int(number.group(1)) if number else 0

    ordered = sorted(libraries, key=lambda p: (14 <= version(p) <= 16, -version(p), str(p)))
    return [*found, *ordered, *([Path(named)] if named else [])]


def choose_variant(wanted: str | None = None) -> str:
    """The fastest variant that works here; sets DRJIT_LIBLLVM_PATH.

    Each is tried in a process of its own, since LLVM may crash. RuntimeError if not even the scalar one runs.
    """
    if wanted != "scalar_rgb":
        for library in llvm_candidates():
            if _probe("llvm_ad_rgb", library) is None:
                os.environ["DRJIT_LIBLLVM_PATH"] = str(library)
                return "llvm_ad_rgb"
        if wanted is not None:
            raise RuntimeError(f"{wanted} does not run here (no LLVM library works)")
    problem = _probe("scalar_rgb", None)
    if problem is not None:
        raise RuntimeError(f"Mitsuba does not run here: {problem} (pip install mitsuba)")
    return "scalar_rgb"


def _probe(variant: str, library: Path | None) -> str | None:
    """None if a tiny render works, else the last line of what went wrong."""
    environment = dict(os.environ)
    if library is not None:
        environment["DRJIT_LIBLLVM_PATH"] = str(library)
    command = [sys.executable, "-c", _PROBE, variant]
    try:
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=120, check=False
        )
    except subprocess.TimeoutExpired:
        return "no answer in 120 s"
    if done.returncode == 0 and done.stdout.startswith("mean 1"):
        return None
    return (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]


def seed_of(batch: int) -> int:
    """Mitsuba's seed of batch 0, 1, …"""
    if not 0 <= batch < MAX_BATCHES:
        raise ValueError(f"batch {batch}: there are seeds for {MAX_BATCHES}")
    return FIRST_SEED + batch


class Renderer:
    """A scene loaded into Mitsuba, rendered in batches; `variant` as `choose_variant` gave it."""

    def __init__(self, path: Path, parameters: Mapping[str, str], variant: str, threads: int | None = None):
        import mitsuba as mi

        if mi.variant() != variant:
            mi.set_variant(variant)
        if threads is not None and variant.startswith("llvm"):
            import drjit as dr

            dr.set_thread_count(threads)
        self.version: str = mi.__version__
        self._mi = mi
        self._scene = mi.load_file(str(path), **parameters)

    def batches(self, first: int, count: int, spp: int) -> Iterator[Array]:
        """Images (H, W, 3) of batches first … first + count − 1, `spp` samples per pixel each."""
        if not 0 < spp <= MAX_SPP_PER_BATCH:
            raise ValueError(
                f"{spp} samples per pixel in a batch; Mitsuba's film drifts beyond {MAX_SPP_PER_BATCH}"
            )
        for batch in range(first, first + count):
            image = np.array(self._mi.render(self._scene, spp=spp, seed=seed_of(batch)), dtype=np.float64)
            if image.shape[0] * image.shape[1] > MAX_PIXELS:
                raise ValueError(f"references are for images of at most {MAX_PIXELS} pixels")
            yield image


def tile_means(images: Array, size: int) -> Array:
    """Means (…, rows, cols, 3) of images (…, H, W, 3) over squares of `size` pixels, cut off at the rim."""
    height, width = images.shape[-3:-1]
    rows, cols = np.arange(0, height, size), np.arange(0, width, size)
    sums = np.add.reduceat(np.add.reduceat(images, rows, axis=-3), cols, axis=-2)
    pixels = np.outer(np.diff(np.append(rows, height)), np.diff(np.append(cols, width)))
    return sums / pixels[..., None]


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
        rounded = np.where(constant, None, np.round(np.where(constant, 0.0, skewness), 3).astype(object))
        tables[size] = rounded.tolist()
    return tables


def samples_needed(images: Array, spp: int, goal: Goal, checked: bool) -> int:
    """Samples per pixel that reach the goal, from images (B, H, W, 3) of `spp` samples each."""
    image = images.mean(axis=(1, 2))
    tiles = tile_means(images, 8)
    floor = np.maximum(np.abs(tiles.mean(axis=0)), np.abs(image.mean(axis=0)) / 10)
    with np.errstate(invalid="ignore", divide="ignore"):
        image_error = np.nan_to_num(image.std(axis=0) / image.mean(axis=0)).max()
        tile_error = np.nan_to_num(tiles.std(axis=0) / floor).max(axis=-1)
    tile = goal.checked_tile if checked else goal.tile
    worst = max(float(image_error) / goal.image, float(np.quantile(tile_error, 0.9)) / tile)
    return math.ceil(spp * worst**2)


def pilot(renderer: Renderer, goal: Goal, checked: bool = False) -> Pilot:
    """Render the small batches (0 …) and plan the rest; `checked`: a closed form outranks the reference."""
    next(renderer.batches(0, 1, goal.small_spp))
    next(renderer.batches(0, 1, goal.spp_per_batch))
    start = time.perf_counter()
    images = np.stack(list(renderer.batches(0, goal.small_batches, goal.small_spp)))
    middle = time.perf_counter()
    next(renderer.batches(0, 1, goal.spp_per_batch))
    per_batch = time.perf_counter() - middle
    batches = max(
        goal.min_batches,
        math.ceil(samples_needed(images, goal.small_spp, goal, checked) / goal.spp_per_batch),
    )
    return Pilot(
        skewness=skewness_tables(images, goal.small_spp),
        spp=batches * goal.spp_per_batch,
        seconds=batches * per_batch,
        spent=middle - start,
    )


def accumulate(
    images: Iterator[Array], progress: Callable[[], object] = lambda: None
) -> tuple[Array, Array, int]:
    """Mean, variance of the mean and number of images, by Welford's update in double."""
    count = 0
    mean = squares = np.zeros(())
    for image in images:
        count += 1
        change = image - mean
        mean = mean + change / count
        squares = squares + change * (image - mean)
        progress()
    if count < 2:
        raise ValueError("a variance takes at least 2 batches")
    return mean, squares / (count - 1) / count, count


def make_reference(
    name: str,
    renderer: Renderer,
    plan: Pilot,
    goal: Goal,
    variant: str,
    parameters: Mapping[str, str] | None = None,
    progress: Callable[[], object] = lambda: None,
) -> dict[str, Any]:
    """Render the large batches, write image and manifest entry, return the entry."""
    parameters = dict(parameters or {})
    digest = references.scene_hash(references.scene_path(name), parameters)
    batches = plan.spp // goal.spp_per_batch
    start = time.perf_counter()
    images = renderer.batches(goal.small_batches, batches, goal.spp_per_batch)
    mean, variance, count = accumulate(images, progress)
    if not (np.isfinite(mean).all() and np.isfinite(variance).all()):
        raise ValueError(f"{name}: Mitsuba's image holds NaN or Inf")
    image_error, tile_error = relative_errors(mean, variance)
    entry = {
        "mitsuba_version": renderer.version,
        "variant": variant,
        "spp": goal.spp_per_batch,
        "batches": count,
        "seeds": [seed_of(goal.small_batches), count],
        "skewness_spp": goal.small_spp,
        "skewness_batches": goal.small_batches,
        "skewness_seeds": [seed_of(0), goal.small_batches],
        "hash": digest,
        "parameters": parameters,
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "width": mean.shape[1],
        "height": mean.shape[0],
        "seconds": round(time.perf_counter() - start + plan.spent, 1),
        "image_error": float(f"{image_error:.3g}"),
        "tile_error_p90": float(f"{tile_error:.3g}"),
        "skewness": {str(size): table for size, table in plan.skewness.items()},
    }
    references.write_reference(references.key(name, parameters), mean, variance, entry)
    return entry


def relative_errors(mean: Array, variance_of_mean: Array) -> tuple[float, float]:
    """Relative standard error of the image mean, and the 90 % quantile of that of 8×8 tiles (worst channel).

    A tile's error is relative to its mean or to a tenth of the image's, whichever is larger.
    """
    pixels = mean.shape[0] * mean.shape[1]
    image = mean.mean(axis=(0, 1))
    rows, cols = (np.arange(0, n, 8) for n in mean.shape[:2])
    sums = np.add.reduceat(np.add.reduceat(variance_of_mean, rows, axis=0), cols, axis=1)
    sizes = np.outer(np.diff(np.append(rows, mean.shape[0])), np.diff(np.append(cols, mean.shape[1])))
    tile = np.sqrt(sums) / sizes[..., None] / np.maximum(np.abs(tile_means(mean, 8)), np.abs(image) / 10)
    return (
        float((np.sqrt(variance_of_mean.sum(axis=(0, 1))) / pixels / image).max()),
        float(np.quantile(tile.max(axis=-1), 0.9)),
    )


def parse_parameters(settings: Sequence[str]) -> dict[str, str]:
    """["a=1", "b=2"] as {"a": "1", "b": "2"}."""
    pairs = [setting.partition("=") for setting in settings]
    for name, equals, _ in pairs:
        if not name or not equals:
            raise ValueError(f"-D{name}: expected -Dname=value")
    return {name: value for name, _, value in pairs}
