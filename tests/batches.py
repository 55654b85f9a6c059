"""Independent renders and what they say of one sample: mean, second moment, variance, with confidence
intervals; and small scenes for which theory knows them.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from raycheck.base.images import load_image

Array = NDArray[np.float64]

CONFIDENCE = 0.9999
BATCHES = 16


@dataclass(frozen=True)
class Batches:
    """Renders of one scene with different seeds, and moments of one sample, the mean over pixels and
    channels: (batches,) each.
    """

    pixels: Array
    """(batches, height, width, 3) means."""
    variance: Array
    second: Array
    """E[X²], unbiased: the variance of n samples over n, n - 1 times, and the square of their mean."""
    rays: Array
    """Rays of a path, without those to the lights."""

    @property
    def mean(self) -> Array:
        return self.pixels.mean(axis=(1, 2, 3))

    @property
    def squared_mean(self) -> Array:
        """E[X]² of each pixel, unbiased, then the mean over the pixels."""
        return self.second - self.variance

    @property
    def squared_mean_of_all(self) -> float:
        """The same from all batches together, by the products of different ones: a number of small error."""
        total, count = self.pixels.sum(axis=0), len(self.pixels)
        return float((total**2 - (self.pixels**2).sum(axis=0)).mean() / (count * (count - 1)))


@dataclass(frozen=True)
class Interval:
    """A confidence interval from independent batches by Student's t."""

    low: float
    high: float

    def __contains__(self, value: float) -> bool:
        return self.low <= value <= self.high

    @property
    def width(self) -> float:
        return self.high - self.low


def interval(values: Array) -> Interval:
    """Of the mean that the values estimate."""
    half = stats.t.ppf((1 + CONFIDENCE) / 2, len(values) - 1) * values.std(ddof=1) / np.sqrt(len(values))
    return Interval(values.mean() - half, values.mean() + half)


def ratio(above: Array, below: Array) -> Interval:
    """Of the ratio of two means, by its linear part: batch k of one may depend on batch k of the other."""
    value = above.mean() / below.mean()
    spread = interval((above - value * below) / below.mean())
    return Interval(value + spread.low, value + spread.high)


@dataclass(frozen=True)
class Oneray:
    """The renderer, and a folder for its pictures."""

    program: Path
    folder: Path

    def scene(self, text: str, name: str = "scene") -> Path:
        path = self.folder / f"{name}.xml"
        path.write_text(text, encoding="utf-8")
        return path

    def batches(
        self, scene: Path | str, options: str | Sequence[str], spp: int = 256, batches: int = BATCHES
    ) -> Batches:
        """Render with seeds 1, 2, …; a scene is a file, or its text. `options` are words, or a line."""
        path = scene if isinstance(scene, Path) else self.scene(scene)
        words = options.split() if isinstance(options, str) else list(options)
        output = self.folder / "out.exr"
        found = []
        for seed in range(1, batches + 1):
            command = [self.program, path, "-o", output, "--spp", spp, "--seed", seed, "--stats", "-", *words]
            done = subprocess.run([str(word) for word in command], check=True, capture_output=True, text=True)
            image, figures = load_image(output), json.loads(done.stdout)
            variance = (image.stderr**2).mean() * spp
            second = variance * (spp - 1) / spp + (image.pixels**2).mean()
            found.append((image.pixels, variance, second, figures["rays"] / figures["paths"]))
        return Batches(*(np.array(column) for column in zip(*found, strict=True)))


def world(
    body: str, *, eye: str = "0, 0, 1", up: str = "0, 1, 0", fov: float = 0.01, depth: int = 2,
    rr_depth: int = 5, size: int = 8,
) -> str:  # fmt: skip
    """A scene file with a camera that looks at the origin. At the field of view that it has unless told
    otherwise, its picture is 0.2 mm wide, m being metres: all pixels show one point.
    """
    return f"""<scene version="3.0.0">
<integrator type="path">
    <integer name="max_depth" value="{depth}"/>
    <integer name="rr_depth" value="{rr_depth}"/>
</integrator>
<sensor type="perspective">
    <float name="fov" value="{fov}"/>
    <string name="fov_axis" value="x"/>
    <transform name="to_world"><lookat origin="{eye}" target="0, 0, 0" up="{up}"/></transform>
    <film type="hdrfilm">
        <integer name="width" value="{size}"/>
        <integer name="height" value="{size}"/>
        <string name="pixel_format" value="rgb"/>
        <string name="component_format" value="float32"/>
        <rfilter type="box"/>
    </film>
    <sampler type="independent"><integer name="sample_count" value="4"/></sampler>
</sensor>
{body}
</scene>"""


def diffuse(reflectance: float) -> str:
    return f'<bsdf type="diffuse"><rgb name="reflectance" value="{reflectance}"/></bsdf>'


def glow(radiance: float | str) -> str:
    return f'<emitter type="area"><rgb name="radiance" value="{radiance}"/></emitter>'


def sky(radiance: float = 1) -> str:
    return f'<emitter type="constant"><rgb name="radiance" value="{radiance}"/></emitter>'


def floor(bsdf: str, z: float = 0) -> str:
    """A large square that faces up."""
    place = f'<scale x="100" y="100" z="1"/><translate z="{z}"/>'
    return f'<shape type="rectangle"><transform name="to_world">{place}</transform>{bsdf}</shape>'


def square(x: float, z: float, half: float, more: str = "") -> str:
    """A black square that faces down, its sides 2 half long."""
    steps = f"""<scale x="{half}" y="{half}" z="1"/><rotate x="1" angle="180"/>
        <translate x="{x}" y="0" z="{z}"/>"""
    return f"""<shape type="rectangle"><transform name="to_world">{steps}</transform>
    {diffuse(0)}{more}</shape>"""


def ball(x: float, z: float, radius: float, radiance: float) -> str:
    return f"""<shape type="sphere"><point name="center" x="{x}" y="0" z="{z}"/>
    <float name="radius" value="{radius}"/>{diffuse(0)}{glow(radiance)}</shape>"""
