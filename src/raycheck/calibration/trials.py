"""One renderer on one scene, judged by raycheck and, on the same images, by the other rules."""

import functools
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.errors import RenderError
from raycheck.base.images import Image
from raycheck.calibration import rivals
from raycheck.calibration.mutants import OPTIONS
from raycheck.judging import checks
from raycheck.judging.conclusion import gross_mistake
from raycheck.judging.looks import look
from raycheck.judging.plan import measure_pilot
from raycheck.judging.settings import BATCHES, PILOT_IMAGES, PILOT_SPP, case_seeds
from raycheck.judging.verify import verify
from raycheck.renderers.renderer import Rendering
from raycheck.scene import variants
from raycheck.scene.techniques import technique
from raycheck.stats import statistics as st
from raycheck.stats.tiles import Tile, region_means
from raycheck.stats.verdict import ALPHA, SHARE_IMAGE, SHARE_TILES, Expected, Judgement, Outcome, judge
from raycheck.truth import references
from raycheck.truth.expected import Truth, truth_of


@dataclass(frozen=True)
class Program:
    """A program of `mutants.program` with a technique of the table; renders many seeds in one process."""

    path: Path
    technique: str

    def images(self, scene: str, requests: Sequence[tuple[int, int]]) -> Array:
        """Images (n, H, W, 3) of n requests (spp, seed); RenderError in its words where it gives up."""
        file = variants.scene_path(scene)
        entry = references.require(variants.variant(scene))
        words = [str(self.path.with_name("many-seeds")), str(file), "-o", "none.exr", "--quiet",
                 *technique(self.technique).options, *OPTIONS]  # fmt: skip
        lines = "".join(f"{spp} {seed}\n" for spp, seed in requests)
        done = subprocess.run(words, input=lines.encode(), capture_output=True, check=False)
        if done.returncode:
            raise RenderError(done.stderr.decode(errors="replace").strip() or f"{done.returncode}")
        values = np.frombuffer(done.stdout, dtype=np.float32).astype(np.float64)
        return values.reshape(len(requests), entry["height"], entry["width"], 3)


@functools.lru_cache(maxsize=32)
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
    """Whether the judgement or a plain check rejects it."""

    def detectable(self) -> Array:
        """(R, 3) smallest bias that FAILs with 90 % power, in the units of the image."""
        noise = (self.expected.variance, self.expected.batches, self.expected.batch_variance)
        one, two = (st.moments(residuals, *noise) for residuals in (self.first, self.second))
        return st.detectable_bias(one, two, self.levels(), self.expected.allowance)

    def levels(self) -> Array:
        """(R, 3) two-sided level of each test over both sets."""
        shape = self.expected.mean.shape
        level = np.full(shape, SHARE_TILES * ALPHA / max(shape[1] * (shape[0] - 1), 1))
        level[0] = SHARE_IMAGE * ALPHA / shape[1]
        return level


def judge_images(
    images: Array, pilot_images: Array, truth: Truth, spp: int, pilot_spp: int = PILOT_SPP
) -> Sets:
    """Judge 64 images at `spp` samples per pixel, and 8 of a pilot."""
    pilot = measure_pilot(pilot_images, pilot_spp, truth)
    regions = truth.regions(spp, pilot.skewness)
    expected = truth.expected(regions, spp / max(pilot.noise, 1.0))
    residuals = region_means(images, regions) - expected.mean
    first, second = residuals[:BATCHES], residuals[BATCHES:]
    found = judge(first, second, expected)
    fails = found.outcome is Outcome.FAIL or bool(
        gross_mistake(pilot_images, truth, look("", pilot_images, truth)) or checks.shared_noise(images)
    )
    return Sets(regions, expected, first, second, found, fails)


@dataclass
class Ready:
    """A renderer whose images are all rendered beforehand."""

    images: dict[tuple[int, int], Array]
    """(H, W, 3) by (spp, seed)."""
    takes_scene: bool = True
    takes_spp: bool = True
    takes_seed: bool = True

    def render(self, scene: Path, spp: int, seed: int, timeout: float) -> Rendering:
        return Rendering(Image(self.images[spp, seed]), 0.0)


@dataclass(frozen=True)
class Trial:
    """What the rules say of one renderer on one scene."""

    reason: str
    """raycheck's, or why there is no image."""
    rejected: dict[str, bool]
    """Whether each rule, raycheck's among them, rejects it; empty where no image could be had."""
    pilot_images: Array | None
    """(8, H, W, 3) at PILOT_SPP"""
    images: Array | None
    """(64, H, W, 3), what the other rules saw: at least as many samples as raycheck."""
    requests: Sequence[tuple[int, int]]
    """(spp, seed) of all images, the first one, the pilot's and the others."""
    spp: int


def try_program(program: Program, scene: str, truth: Truth, spp: int, seed: int = 0) -> Trial:
    """Judge as `raycheck verify --renderer … --spp` does; the other rules get all of its 64 images."""
    first, count = references.require(variants.variant(scene))["seeds"]
    seeds = case_seeds(scene, "renderer", seed, range(first, first + count))[: 1 + PILOT_IMAGES + 2 * BATCHES]
    ends = 1 + PILOT_IMAGES
    requests = [(1, seeds[0]), *((PILOT_SPP, s) for s in seeds[1:ends]), *((spp, s) for s in seeds[ends:])]
    singles = [(1, s) for s in seeds[1:ends]]
    try:
        made = program.images(scene, requests + singles)
    except RenderError as error:
        return Trial(str(error), {}, None, None, requests, spp)
    ready = Ready(dict(zip(requests + singles, made, strict=True)))
    [case] = verify(ready, [scene], spp=spp, seed=seed, jobs=1).cases
    images = made[ends : len(requests)]
    rejected = {"raycheck": case.verdict is Outcome.FAIL, **rivals.judge(images, spp, truth)}
    return Trial(case.reason, rejected, made[1:ends], images, requests, spp)
