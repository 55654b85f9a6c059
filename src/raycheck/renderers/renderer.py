"""What every renderer is to a judge: scene, samples and seed go in, an image comes out."""

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

from raycheck.base.images import Image


def repeat(spp: int, seed: int, words: str) -> str:
    """What goes wrong, goes wrong again by these words: the end of a sentence."""
    return f" (seed {seed}, {spp} sample{'s' if spp > 1 else ''} per pixel; again: `{words}`)"


@dataclass(frozen=True)
class Rendering:
    image: Image
    seconds: float


@runtime_checkable
class Renderer(Protocol):
    """Renders `scene` with `spp` samples per pixel and `seed`; raises RenderError."""

    @property
    def takes_scene(self) -> bool: ...
    @property
    def takes_spp(self) -> bool: ...
    @property
    def takes_seed(self) -> bool: ...

    def render(self, scene: Path, spp: int, seed: int, timeout: float) -> Rendering: ...
