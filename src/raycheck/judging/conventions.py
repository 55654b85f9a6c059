"""Mistakes of convention: what a picture is like that was written, or sampled, in another way.

Most say what becomes of the reference: turned, channels exchanged, filtered. An encoding says how to undo
what was done to the values instead, since what becomes of noisy values depends on their noise.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.images import decode_srgb

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Of linear sRGB, ITU-R BT.709."""
TENT = (0.125, 0.75, 0.125)
"""What the tent filter of radius 1 takes from a pixel's neighbours, if radiance is even within pixels…"""
GAUSSIAN = (0.00135, 0.15731, 0.68268, 0.15731, 0.00135)
"""…and the gaussian of σ = ½."""
HALF = (0.5, 0.5, 0.0)
"""Half a pixel further."""


@dataclass(frozen=True)
class Convention:
    """What was done to the whole picture."""

    words: str
    """Empty where it is a mere factor."""
    factors: int = 0
    """0: none besides, 1: one for everything, 3: one for each channel."""


@dataclass(frozen=True)
class Encoding:
    """Values that are not radiance, and how they become it."""

    convention: Convention
    decode: Callable[[Array], Array]
    most: float
    """Values from which on nothing can be decoded…"""
    beyond: bool
    """…unless there are some above 1: then nothing was cut there, and all can be."""

    def decodes(self, values: Array) -> bool:
        """Whether all of these values can be decoded."""
        largest = values.max()
        return bool(values.min() >= 0 and (largest < self.most or (self.beyond and largest > 1)))


TURNS: Mapping[str, Callable[[Array], Array]] = {
    "the image is upside down (PFM stores rows from the bottom up, EXR from the top down)": lambda x: x[::-1],
    "the image is mirrored, left and right swapped": lambda x: x[:, ::-1],
    "the image is turned by 180°": lambda x: x[::-1, ::-1],
    "rows and columns are swapped": lambda x: x.transpose(1, 0, 2),
    "red and blue are swapped": lambda x: x[:, :, ::-1],
    "all three channels are the luminance": lambda x: np.repeat((x @ LUMINANCE)[..., None], 3, axis=2),
}
"""Each alone, or with a factor."""
FACTOR = Convention("", factors=1)
WHITE = Convention("", factors=3)
ENCODINGS = (
    Encoding(
        Convention("the values are sRGB-encoded, linear radiance is needed"), decode_srgb, 0.999, True
    ),
    Encoding(
        Convention("the values are gamma-encoded (2.2), linear radiance is needed"),
        lambda x: x**2.2, 0.999, True,
    ),
    Encoding(
        Convention("the values are tone-mapped, x / (1 + x), linear radiance is needed"),
        lambda x: x / (1 - x), 0.999, False,
    ),
)  # fmt: skip


def pictures(reference: Array) -> Iterator[tuple[Convention, Array]]:
    """What the reference (H, W, 3) would be by each convention that has no factor of its own."""
    square = reference.shape[0] == reference.shape[1]
    for words, turn in TURNS.items():
        if square or "rows and columns" not in words:
            yield Convention(words), turn(reference)
    for words, kernel in (("a tent of radius 1", TENT), ("a gaussian of σ = ½", GAUSSIAN)):
        sentence = f"your filter is wider than a pixel, {words} perhaps; the scene asks for a box"
        yield Convention(sentence), _filtered(reference, kernel, kernel)
    for rows, vertical in ((HALF, "down"), (HALF[::-1], "up"), ((0.0, 1.0, 0.0), "")):
        for columns, across in ((HALF, "right"), (HALF[::-1], "left"), ((0.0, 1.0, 0.0), "")):
            where = " and ".join(word for word in (vertical, across) if word)
            if where:
                sentence = f"the image lies half a pixel further {where} (a pixel's middle is at ½, not at 0)"
                yield Convention(sentence), _filtered(reference, rows, columns)


def _filtered(image: Array, rows: Sequence[float], columns: Sequence[float]) -> Array:
    """By odd kernels along rows and columns; beyond the rim stands what is nearest to it."""
    for axis, kernel in ((0, rows), (1, columns)):
        half, count = len(kernel) // 2, image.shape[axis]
        wide = np.pad(image, [(half, half) if a == axis else (0, 0) for a in range(3)], mode="edge")
        image = np.sum([w * wide.take(range(k, k + count), axis) for k, w in enumerate(kernel)], axis=0)
    return image
