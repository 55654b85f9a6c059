"""What a check is: a smallest scene in a renderer's own language, and what its picture ought to be."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from raycheck.base.arrays import Array

LEVEL = 1e-5
"""Probability with which an interval misses the value that it is about."""
BUDGET = 1e-3
"""Probability that any interval of the whole audit does; Bonferroni, so BUDGET / LEVEL intervals at most."""
ALLOWED = 5e-4
"""Relative error of single floats and of conventions that is no finding."""

Measure = Callable[[Array], Array]
"""From pictures (B, H, W, C) to values (B, V), one for each name."""


def green(pictures: Array) -> Array:
    """The mean of all pixels, of one channel."""
    return np.asarray(pictures[..., pictures.shape[-1] // 2].mean(axis=(1, 2))[:, None])


def colours(pictures: Array) -> Array:
    """The mean of all pixels, of each channel."""
    return np.asarray(pictures.mean(axis=(1, 2)))


def columns(*which: int) -> Measure:
    """The mean of the inner pixels of some columns; those at the border see less of a filter."""
    return lambda pictures: np.asarray(pictures[:, 2:-2, list(which), 1].mean(axis=1))


@dataclass(frozen=True)
class Check:
    """A scene, and what is right for it."""

    id: str
    renderer: str
    """A name of `running.RENDERERS`."""
    says: str
    """What it shows, in one plain line."""
    scene: str
    samples: int
    """Of each pixel of each picture."""
    expected: Callable[[], tuple[float, ...]]
    """Exact values, radiances relative to that of the light: a closed form, one for each name."""
    why: str
    """Why they are sure."""
    names: tuple[str, ...] = ("radiance",)
    measure: Measure = green
    settings: Mapping[str, str] = field(default_factory=dict)
    """For the worker: a variant, or options of the command."""
    batches: int = 32
    """Pictures of different seeds; an even number."""
    within: float = 2e-3
    """Relative; health means that the interval lies within."""
    documented: str = ""
    """Where the renderer's makers say that this is an approximation, and which."""
    act: str = ""
    """What causes it, or what its maintainer could look at first."""
    report: str = ""
    """A public report or change, or that none was found."""
