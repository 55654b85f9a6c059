"""The pictures that scene files name: textures and environments."""

from pathlib import Path

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.errors import ReferenceError_


def read_picture(path: Path, raw: bool) -> Array:
    """(height, width, 3) linear sRGB, rows from the top; of 8 and 16 bits by sRGB's curve unless they are
    `raw`. ReferenceError_ where it is none. A grey one has three equal channels; transparency is passed over.
    """
    import OpenImageIO as oiio

    from raycheck.base.images import decode_srgb, utf8

    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)  # else colours are darkened by it
    file = oiio.ImageInput.open(utf8(path), config)
    count = 0 if file is None else file.spec().nchannels
    values = None if file is None else file.read_image(0, 0, 0, 3 if count >= 3 else 1, oiio.FLOAT)
    if file is None or values is None:
        why = " ".join((oiio.geterror() if file is None else file.geterror()).split())
        raise ReferenceError_(f"{path}: no picture that can be read ({why})")
    values = np.asarray(values, dtype=np.float64).reshape(*values.shape[:2], -1)
    if values.shape[2] == 1:
        values = np.repeat(values, 3, axis=2)
    whole = str(file.spec().format) in ("uint8", "uint16")
    return decode_srgb(values) if whole and not raw else values
