"""What a stiff case is, and the numbers of a scene as a program parses them: rounded to double for oneray, to
single for Mitsuba's scalar_rgb. Radiances, W·sr⁻¹·m⁻², are scaled with what is swept, so that the picture
stays within what single floats hold.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from mpmath import mpf

from raycheck.base import data
from raycheck.scene import document

Settings = Mapping[str, str]

DIGITS = 60
"""Digits to which mpmath evaluates closed forms."""
EXACT = 1e-6
"""Where the estimator has next to no variance, and a picture of single floats holds 6e-8."""


class Parsed:
    """The `<default>`s of a scene with some replaced, as numbers rounded the way a program parses them."""

    def __init__(self, scene: Path, settings: Settings, single: bool = False):
        said = document.read(scene, settings)
        self.root, self.texts = said.root, said.defaults
        self.single = single

    def __call__(self, name: str) -> mpf:
        return self.number(self.texts[name])

    def number(self, text: str | float) -> mpf:
        """A number of the file, exactly as it is after rounding."""
        value = float(self.texts[text[1:]] if isinstance(text, str) and text.startswith("$") else text)
        with np.errstate(over="ignore", under="ignore"):
            return mpf(float(np.float32(value)) if self.single else value)

    def numbers(self, name: str) -> list[mpf]:
        return [self.number(word) for word in self.texts[name].replace(",", " ").split()]


@dataclass(frozen=True)
class Truth:
    """The value that the picture ought to have, and the unit of its error."""

    value: mpf
    unit: mpf


@dataclass(frozen=True)
class Case:
    """A sweep. `settings` gives the renders for a value of the swept parameter; the worst of them counts."""

    name: str
    title: str
    parameter: str
    values: tuple[float, ...]
    """The values that are swept, from ordinary to extreme, beyond the goal."""
    goal: float
    within: float
    """Relative error that is allowed beyond noise."""
    settings: Callable[[float], Sequence[Settings]]
    truth: Callable[[Parsed], Truth]
    wrong: str
    instead: str
    scene: str = ""
    samples: Callable[[float], int] = field(default=lambda value: 1 << 16)
    """Samples of a whole picture."""
    quick: tuple[float, ...] = ()
    """The values of the coarse sweep; by default the first, the goal and one between."""
    measure: str = "mean"
    """`mean`: of the pixels; `spread`: relative standard deviation of a sample, which `within` bounds, of an
    unbiased mean; `bounces`: share of pixels that show the right number of mirrors."""
    most_mitsuba: int = 1 << 16
    """Samples of a picture that Mitsuba is given at most: its scalar variant is slow."""
    options: tuple[str, ...] = ()
    """oneray's options beyond its defaults."""

    @property
    def path(self) -> Path:
        return data.scenes_dir() / "stiff" / f"{self.scene or self.name}.xml"

    @property
    def coarse(self) -> tuple[float, ...]:
        if self.quick:
            return self.quick
        last = self.values.index(self.goal)
        return tuple(dict.fromkeys((self.values[0], self.values[last // 2], self.goal)))


def decades(first: int, last: int, step: int = 1) -> tuple[float, ...]:
    """10^first … 10^last, correctly rounded."""
    step = step if last > first else -step
    return tuple(float(f"1e{n}") for n in range(first, last + (1 if step > 0 else -1), step))


GAPS = decades(-1, -15)


def one(**settings: object) -> list[Settings]:
    """One render, with these settings."""
    return [{name: value if isinstance(value, str) else repr(value) for name, value in settings.items()}]
