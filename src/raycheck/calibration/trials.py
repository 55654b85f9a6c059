"""One renderer on one scene, judged by raycheck and, on the same images, by the other rules."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from raycheck import checks, references, renderers
from raycheck import statistics as st
from raycheck.calibration import rivals
from raycheck.mutants import OPTIONS
from raycheck.pilot import measure
from raycheck.renderers import Rendering
from raycheck.techniques import technique
from raycheck.tiles import SMALLEST, Tile, region_means
from raycheck.truth import Truth, truth_of
from raycheck.verdict import ALPHA, SHARE_IMAGE, SHARE_TILES, Expected, Judgement, Outcome, judge
from raycheck.verify import BATCHES, PILOT_IMAGES, Case, verify

Array = NDArray[np.float64]


def command(program: Path, name: str) -> renderers.Command:
    """A program of `mutants.program` with a technique of the table."""
    return renderers.oneray_command(program, (*technique(name).options, *OPTIONS))


def grid(truth: Truth) -> list[Tile]:
    """The finest tiles."""
    height, width = truth.shape
    return [
        Tile(row, column, min(SMALLEST, height - row), min(SMALLEST, width - column))
        for row in range(0, height, SMALLEST)
        for column in range(0, width, SMALLEST)
    ]


def load_truth(scene: str) -> Truth:
    return truth_of(references.load_reference(scene))


@dataclass(frozen=True)
class Sets:
    """Images of one renderer, judged as `raycheck verify` judges them at a given number of samples."""

    regions: list[Tile]
    expected: Expected
    first: Array
    second: Array
    """Residuals of the regions, (32, R, 3) each."""
    found: Judgement
    fails: bool
    """By the judgement, or by a plain check."""

    def detectable(self) -> Array:
        """(R, 3) smallest bias that FAILs with 90 % power, in the units of the image."""
        noise = (self.expected.variance, self.expected.batches, self.expected.batch_variance)
        sets = [st.moments(residuals, *noise) for residuals in (self.first, self.second)]
        return st.detectable_bias(*sets, self.levels(), self.expected.allowance)

    def levels(self) -> Array:
        """(R, 3) two-sided level of each test over both sets."""
        shape = self.expected.mean.shape
        level = np.full(shape, SHARE_TILES * ALPHA / max(shape[1] * (shape[0] - 1), 1))
        level[0] = SHARE_IMAGE * ALPHA / shape[1]
        return level


def judge_images(images: Array, pilot_images: Array, truth: Truth, spp: int) -> Sets:
    """64 images and a pilot's 8, all at `spp` samples per pixel."""
    pilot = measure(pilot_images, spp, truth, {spp: 1.0})
    regions = truth.regions(spp, pilot.skewness)
    expected = truth.expected(regions, spp / max(pilot.noise, 1.0))
    residuals = region_means(images, regions) - expected.mean
    first, second = residuals[:BATCHES], residuals[BATCHES:]
    found = judge(first, second, expected)
    fails = found.outcome is Outcome.FAIL or bool(
        checks.name_mistake(pilot_images, truth.mean, truth.variance, gross=True)
        or checks.shared_noise(images)
    )
    return Sets(regions, expected, first, second, found, fails)


@dataclass
class Recorder:
    """A renderer that remembers what it was asked and what it gave."""

    renderer: renderers.Renderer
    takes_scene: bool = True
    takes_spp: bool = True
    takes_seed: bool = True
    made: list[tuple[int, int, Array]] = field(default_factory=list)
    """(spp, seed, image) in order."""

    def render(self, scene: Path, spp: int, seed: int, timeout: float) -> Rendering:
        made = self.renderer.render(scene, spp, seed, timeout)
        self.made.append((spp, seed, made.image.pixels))
        return made


@dataclass(frozen=True)
class Trial:
    """What came out."""

    case: Case
    rejected: dict[str, bool]
    """By rule, raycheck's among them; empty where no image could be had."""
    images: Array | None
    """(64, H, W, 3), what the other rules saw: at least as many samples as raycheck."""
    pilot_images: Array | None
    """(8, H, W, 3)"""
    seeds: Sequence[int]
    """Of the pilot's images, then of the others."""
    spp: int
    seconds: float


def try_renderer(renderer: renderers.Renderer, scene: str, truth: Truth, spp: int, seed: int = 0) -> Trial:
    """Judge as `raycheck verify --spp` does; where that ended early, the others still get all 64 images."""
    started = time.perf_counter()
    recorder = Recorder(renderer)
    [case] = verify(recorder, [scene], spp=spp, seed=seed, jobs=1).cases
    made = [one for one in recorder.made if one[0] == spp]
    path = references.scene_path(scene)
    try:
        for extra in range(PILOT_IMAGES + 2 * BATCHES - len(made)):
            another = 10**9 + seed * 1000 + extra
            made.append((spp, another, renderer.render(path, spp, another, 60.0).image.pixels))
        images = np.stack([one[2] for one in made])
        usable = images.shape[1:3] == truth.shape and bool(np.isfinite(images).all())
    except (renderers.RenderError, ValueError):
        usable = False
    seconds = time.perf_counter() - started
    if not usable:
        return Trial(case, {}, None, None, [], spp, seconds)
    pilot_images, images = images[:PILOT_IMAGES], images[PILOT_IMAGES:]
    rejected = {"raycheck": case.verdict is Outcome.FAIL, **rivals.judge(images, spp, truth)}
    return Trial(case, rejected, images, pilot_images, [one[1] for one in made], spp, seconds)


def tile_means(images: Array, truth: Truth) -> Array:
    """(B, H, W, 3) → (B, tiles, 3) over the finest tiles."""
    return region_means(images, grid(truth))
