"""A renderer whose time passes on a clock of its own: start-up, pace and the machine's load are given."""

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from raycheck.base.errors import RenderTimeout
from raycheck.base.images import Image
from raycheck.renderers.renderer import Rendering
from raycheck.scene.variants import variant
from raycheck.truth import references
from raycheck.truth.expected import Truth, truth_of

TRUTHS: dict[Path, Truth] = {}


def truth_at(scene: Path) -> Truth:
    if scene not in TRUTHS:
        TRUTHS[scene] = truth_of(references.load_reference(variant(scene)))
    return TRUTHS[scene]


@dataclass
class Simulated:
    """A renderer with right pictures of any noise, whose time passes on a clock of its own."""

    start: float
    """Seconds of a picture before its first sample."""
    sample: float
    """Seconds of each sample per pixel."""
    noise: float = 1.0
    """Variance of a sample over that of the reference's renderer."""
    load: float = 1.0
    """How many times slower the machine is than it could be…"""
    swing: float = 0.0
    """…and the standard deviation of its logarithm from picture to picture."""
    cold: float = 0.0
    """Seconds that the first picture takes besides."""
    now: float = 0.0
    pictures: list[int] = field(default_factory=list)
    """Samples per pixel of all pictures."""
    takes_scene: bool = True
    takes_spp: bool = True
    takes_seed: bool = True

    def clock(self) -> float:
        return self.now

    def seconds(self, spp: float) -> float:
        """Of a picture, on average."""
        return self.load * (self.start + self.sample * spp)

    def render(self, scene: Path, spp: int, seed: int, timeout: float) -> Rendering:
        rng, truth = np.random.default_rng(seed), truth_at(scene)
        seconds = self.seconds(spp) * math.exp(self.swing * rng.standard_normal()) + self.cold
        self.cold = 0.0
        self.now += min(seconds, timeout)
        if seconds > timeout:
            raise RenderTimeout(f"no image after {timeout:.0f} s")
        self.pictures.append(spp)
        deviation = np.sqrt(self.noise * truth.sample_variance / spp)
        return Rendering(Image(truth.mean + deviation * rng.standard_normal(truth.mean.shape)), seconds)
