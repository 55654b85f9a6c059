"""Pictures for the report: linear radiance to sRGB, signed error to colour, PNG data URIs."""

import base64

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.images import Bytes as Bytes
from raycheck.base.images import display as display
from raycheck.base.images import exposure as exposure
from raycheck.base.images import png

RANGE = 4.0
"""The error map goes from −RANGE to +RANGE standard errors."""
# Blue (too dark) through near white to red (too bright), even in lightness to both sides; after ColorBrewer's
# RdBu.
STOPS = np.array([[33, 102, 172], [146, 197, 222], [247, 247, 247], [244, 165, 130], [178, 24, 43]]) / 255


def error_map(ours: Array, reference: Array, error: Array) -> Bytes:
    """Signed error of the channel mean in units of its standard error `error`, (H, W, 3) each, as colours.

    White where nothing varies and nothing differs; the end colours where nothing varies but something
    differs.
    """
    bias = (ours - reference).mean(axis=2)
    sigma = np.sqrt((error**2).sum(axis=2)) / 3
    exact = np.where(np.abs(bias) > 1e-5 * np.abs(reference.mean(axis=2)), np.sign(bias) * RANGE, 0.0)
    return colour(np.where(sigma > 0, bias / np.where(sigma > 0, sigma, 1.0), exact))


def colour(z: Array) -> Bytes:
    """Values in standard errors (…) to (…, 3) 8-bit colours, clipped at ±RANGE; NaN is black."""
    place = (np.clip(z, -RANGE, RANGE) + RANGE) / (2 * RANGE) * (len(STOPS) - 1)
    channels = [np.interp(place, np.arange(len(STOPS)), STOPS[:, c]) for c in range(3)]
    return np.round(np.nan_to_num(np.stack(channels, axis=-1)) * 255).astype(np.uint8)


def legend() -> Bytes:
    """The colour scale, dark to bright, as a strip."""
    return np.repeat(colour(np.linspace(-RANGE, RANGE, 256))[None], 8, axis=0)


def data_uri(pixels: Bytes) -> str:
    """A PNG in the page itself."""
    return "data:image/png;base64," + base64.b64encode(png(pixels)).decode("ascii")
