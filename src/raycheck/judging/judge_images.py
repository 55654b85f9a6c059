"""Pictures that are already rendered, even a single one."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from raycheck.base.arrays import Array
from raycheck.base.errors import ImageError, NotFound
from raycheck.base.images import Image, find_images, is_whole, load_image
from raycheck.base.text import signed
from raycheck.judging import checks
from raycheck.judging.cases import Case
from raycheck.judging.checks import Broken, check_contract
from raycheck.judging.conclusion import case_maker, conclude, figures, gross_mistake, template_name
from raycheck.judging.looks import look
from raycheck.judging.plan import (
    Goals,
    Pilot,
    cumulants,
    equivalent_spp,
    reached,
    residual_skewness,
    tile_skewness,
)
from raycheck.judging.settings import BATCHES, OnImages
from raycheck.scene import variants
from raycheck.scene.content import read_content
from raycheck.stats.tiles import Tile, region_means
from raycheck.stats.verdict import Judgement, Limits, Outcome, judge
from raycheck.truth import references
from raycheck.truth.expected import Truth, truth_of

FEWEST_IMAGES = 6
"""Images whose noise can be measured between them alone."""


def image_paths(images: str | Sequence[str | Path]) -> list[Path]:
    """The files of a glob, or those named; NotFound where no file matches."""
    if isinstance(images, str):
        paths = find_images(images)
        if not paths:
            raise NotFound(f"--images {images!r}: no file matches")
        return paths
    return [Path(p) for p in images]


def judge_files(
    of: variants.Variant, files: list[Path], limits: Limits, on_images: OnImages | None = None
) -> Case:
    """Judge picture files; one that cannot be read is a FAIL."""
    loaded: list[Image] = []
    for file in files:
        try:
            loaded.append(load_image(file))
        except ImageError as error:
            return Case(of.label, "images", Outcome.FAIL, str(error), images=len(files))
    return judge_pictures(of, loaded, [str(file) for file in files], limits, on_images)


def judge_pictures(
    of: variants.Variant, loaded: Sequence[Image], names: Sequence[str], limits: Limits,
    on_images: OnImages | None = None,
) -> Case:  # fmt: skip
    """Judge pictures that were already rendered, even a single one; their names are for messages. `on_images`
    hears of those that can be judged.
    """
    truth = truth_of(references.load_reference(of))
    case = case_maker(of.label, "images", truth, images=len(loaded))
    try:
        for image, name in zip(loaded, names, strict=True):
            check_contract(image, truth, name)
    except Broken as error:
        return case(Outcome.FAIL, str(error))
    if on_images:
        on_images(of.label, "images", truth, 1, np.stack([image.pixels for image in loaded]))
    problem = checks.seed_problem([checks.digest(i) for i in loaded], names, truth.varies)
    if problem:
        return case(Outcome.FAIL, problem)
    images = np.stack([image.pixels for image in loaded])
    coarse = next((image for image in loaded if image.precision != "float"), loaded[0])
    content = read_content(of.path, of.parameters)
    residuals = images - truth.mean
    if is_whole(coarse.precision):  # what is brighter than white cannot be compared
        residuals = np.where(images > 0.99, images - np.clip(truth.mean, 0, 1), residuals)
    shown = partial(look, template_name(of), images, truth, content.lights)
    mistake = gross_mistake(images, truth, shown())
    if mistake:
        return case(Outcome.FAIL, mistake)
    quantum = coarse.quantum if coarse.precision != "float" else None
    alike = content.filtered and len(loaded) >= FEWEST_IMAGES
    found, regions, classes = judge_few(residuals, truth, limits, quantum, independent_pixels=not alike)
    if found.outcome is Outcome.INCONCLUSIVE:
        needed = images_needed(residuals, truth, limits)
        more = max(needed / len(loaded), found.more_samples) if needed else math.inf
        found = replace(found, more_samples=more)
        return case(found.outcome, _few(found, len(loaded), needed), **figures(found, regions))
    exchanged = checks.exchanged_pixels(checks.slopes_within(images, truth))
    if exchanged and found.outcome is Outcome.PASS:
        return case(Outcome.FAIL, exchanged, **figures(found, regions))
    found, sentence = conclude(found, regions, shown, precision=coarse.precision, takes=None)
    if classes > 1:
        sentence += (
            f" (from {len(loaded)} image{'s' if len(loaded) > 1 else ''}, noise measured between pixels)"
        )
    return case(found.outcome, sentence, **figures(found, regions))


def judge_few(
    residuals: Array, truth: Truth, limits: Limits = Limits(), quantum: Array | None = None,
    independent_pixels: bool = True,
) -> tuple[Judgement, list[Tile], int]:  # fmt: skip
    """Judge the residuals (k, H, W, 3) of few images, with its regions and the classes of pixels that make
    them many batches; one where the noise of different pixels is not independent, of FEWEST_IMAGES at least.
    """
    parts = _interleave(residuals) if independent_pixels else _Interleaved(residuals, 1)
    if len(residuals) > 2:
        variance, third = cumulants(residuals)
        skewness = tile_skewness(variance, third, truth.skewness)
    else:
        variance = np.broadcast_to(residuals.var(axis=(0, 1, 2)), truth.mean.shape)
        skewness = residual_skewness(residuals, truth.skewness)
    equivalent = equivalent_spp(truth.sample_variance, variance)
    regions = parts.usable(truth.regions(1 / parts.classes, skewness))
    batches = parts.region_means(regions)
    expected = truth.expected(regions, equivalent / parts.classes, quantum)
    return judge(batches[0::2], batches[1::2], expected, limits), regions, parts.classes


MOST_IMAGES = 10_000


def images_needed(residuals: Array, truth: Truth, limits: Limits) -> int | None:
    """How many images like these (k, H, W, 3) would probably decide, k among them; None for MOST_IMAGES or
    more. Of few images only the level of the noise is known: how it differs from place to place is taken from
    the reference's renderer.
    """
    count = len(residuals)
    own = residuals.var(axis=0, ddof=1) if count >= FEWEST_IMAGES else np.full(truth.mean.shape, np.nan)
    level = residuals.var(axis=0, ddof=1) if count > 1 else residuals[0] ** 2
    alike = truth.sample_variance / equivalent_spp(truth.sample_variance, level)
    variance = own if count >= FEWEST_IMAGES else alike
    scale = np.sqrt(equivalent_spp(truth.sample_variance, variance))
    skewness = {size: table / scale for size, table in truth.skewness.items()}
    pilot = Pilot(variance, skewness, 1.0)
    needed = count + 1
    while needed < MOST_IMAGES:
        goals, share = Goals(fineness=0.0), needed / (2 * BATCHES)
        if reached(pilot, truth, BATCHES, goals, limits, share, sure=False):
            return needed
        needed = max(needed + 1, needed * 9 // 8)
    return None


def _few(found: Judgement, count: int, needed: int | None) -> str:
    wide = found.undecided[0] if found.undecided else None
    width = f"a tile is only known to {signed(wide.low)} … {signed(wide.high)}; " if wide else ""
    more = max(needed - count, math.ceil(count * (found.more_samples - 1))) if needed else MOST_IMAGES
    many = f"about {more:,} more images" if more < MOST_IMAGES else "far more samples per pixel"
    images = f"{count} image{'s' if count > 1 else ''}"
    return f"too noisy to say from {images}: {width}{many} like these would decide"


@dataclass(frozen=True)
class _Interleaved:
    """Few images as many batches: pixels are dealt to classes that each cover every tile evenly.

    It takes the noise of different pixels as independent.
    """

    pixels: Array
    """(k, H, W, 3) residuals."""
    classes: int

    def _member(self) -> NDArray[np.int64]:
        """(H, W) class of each pixel."""
        order = np.random.default_rng(0).permutation(64).reshape(8, 8) % self.classes
        height, width = self.pixels.shape[1:3]
        return np.tile(order, (-(-height // 8), -(-width // 8)))[:height, :width]

    def usable(self, regions: list[Tile]) -> list[Tile]:
        member = self._member()
        return [r for r in regions if len(np.unique(member[r.window])) == self.classes]

    def region_means(self, regions: list[Tile]) -> Array:
        """(k × classes, R, 3) means of each class of pixels over the regions."""
        if self.classes == 1:
            return region_means(self.pixels, regions)
        member = self._member()
        result = np.empty((self.classes, len(self.pixels), len(regions), 3))
        for index, region in enumerate(regions):
            window = self.pixels[:, region.window[0], region.window[1]]
            for one in range(self.classes):
                result[one, :, index] = window[:, member[region.window] == one].mean(axis=1)
        return result.reshape(-1, len(regions), 3)


def _interleave(residuals: Array) -> _Interleaved:
    """The residuals as at least 2 × BATCHES batches."""
    classes = 1
    while classes * len(residuals) < 2 * BATCHES:
        classes *= 2
    return _Interleaved(residuals, classes)
