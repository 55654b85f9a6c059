"""A Python function as a renderer."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from raycheck.base.errors import CannotRender, RenderError
from raycheck.base.images import Image
from raycheck.base.text import UNSUPPORTED
from raycheck.renderers.renderer import Rendering, repeat


@dataclass(frozen=True)
class Function:
    """A Python callable: render(scene, spp, seed) gives (H, W, 3). That is copied, so that it may give the
    same array each time. NotImplementedError: it does not support the scene.
    """

    function: Callable[[Path, int, int], ArrayLike]
    takes_scene: bool = True
    takes_spp: bool = True
    takes_seed: bool = True

    def render(self, scene: Path, spp: int, seed: int, timeout: float) -> Rendering:
        started = time.perf_counter()
        try:
            pixels = np.array(self.function(scene, spp, seed), dtype=np.float64)
        except NotImplementedError as error:
            raise CannotRender(f"{UNSUPPORTED} {error}") from error
        except Exception as error:
            again = f"render(Path({str(scene)!r}), {spp}, {seed})"
            raise RenderError(f"{type(error).__name__}: {error}{repeat(spp, seed, again)}") from error
        if pixels.ndim != 3 or pixels.shape[2] != 3:
            raise RenderError(
                f"the callable gave an array of shape {pixels.shape}, (height, width, 3) is needed"
            )
        return Rendering(Image(pixels), time.perf_counter() - started)
