"""Reading images: EXR and anything else OpenImageIO knows, and PFM. Writing PNG, PFM and EXR.

Pixels are (H, W, 3) float64, row 0 at the top, linear radiance. How the file stored them is kept as its
`precision`, since what was rounded away cannot be judged.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from raycheck.base.arrays import Array
from raycheck.base.errors import ImageError
from raycheck.base.files import whole

Precision = Literal["float", "half", "rgbe", "8-bit"]

MAX_PIXELS = 1 << 26
"""Larger images are refused before they are decoded."""


@dataclass(frozen=True)
class Image:
    """Pixels and what the file said about them."""

    pixels: Array
    """(H, W, 3)"""
    precision: Precision = "float"
    stderr: Array | None = None
    """(H, W, 3) standard error of the mean, where the file has channels stderr.R/G/B."""
    attributes: Mapping[str, object] = field(default_factory=dict)

    @property
    def quantum(self) -> Array:
        """(H, W, 3) the step to which each pixel was rounded, 0 for 32-bit floats."""
        size = np.abs(self.pixels)
        if self.precision == "half":
            return size * 2.0**-11
        if self.precision == "rgbe":
            brightest = size.max(axis=2, keepdims=True)
            step = np.exp2(np.frexp(brightest)[1] - 8.0)
            return np.broadcast_to(np.where(brightest > 0, step, 0.0), size.shape)
        if self.precision == "8-bit":
            code = encode_srgb(self.pixels)
            return decode_srgb(code + 0.5 / 255) - decode_srgb(code - 0.5 / 255)
        return np.zeros_like(size)


def load_image(path: Path | str) -> Image:
    """Read an image by its content, whatever its name says; ImageError if it cannot be."""
    path = Path(path)
    try:
        with path.open("rb") as file:
            magic = file.read(3)
    except OSError as error:
        raise ImageError(f"{path}: {error.strerror}") from None
    if magic[:2] in (b"PF", b"Pf") and magic[2:3].isspace():
        return Image(_read_pfm(path))
    return _read_oiio(path)


def _read_pfm(path: Path) -> Array:
    """PFM: "PF", width and height, scale (negative: little-endian), then float32 rows from the bottom up."""
    with path.open("rb") as file:
        words: list[bytes] = []
        while len(words) < 4:
            line = file.readline(200)
            if not line:
                raise ImageError(f"{path}: the PFM header is cut short")
            words += line.split(b"#")[0].split()
        try:
            width, height, scale = int(words[1]), int(words[2]), float(words[3])
        except ValueError:
            raise ImageError(f"{path}: the PFM header is not 'PF WIDTH HEIGHT SCALE'") from None
        if words[0] != b"PF":
            raise ImageError(f"{path}: 1 channel, 3 are needed (the first line of a colour PFM is 'PF')")
        if width < 1 or height < 1 or width * height > MAX_PIXELS:
            raise ImageError(f"{path}: {width}×{height} is not a size that can be read")
        data = file.read(width * height * 12)
    if len(data) < width * height * 12:
        raise ImageError(f"{path}: {len(data)} bytes of pixels, {width}×{height} needs {width * height * 12}")
    values = np.frombuffer(data, dtype="<f4" if scale < 0 else ">f4")
    return values.reshape(height, width, 3)[::-1].astype(np.float64)


def _read_oiio(path: Path) -> Image:
    import OpenImageIO as oiio

    reader = oiio.ImageInput.open(str(path))  # by content where the name's ending is wrong
    if reader is None:
        said = _first_line(oiio.geterror())
        hint = "EXR or PFM of 32-bit floats are best"
        raise ImageError(f"{path}: not an image that can be read ({hint}){': ' + said if said else ''}")
    try:
        spec = reader.spec()
        kind = reader.format_name()
        if (
            spec.width * spec.height > MAX_PIXELS
            or spec.width * spec.height * spec.nchannels > 16 * MAX_PIXELS
        ):
            raise ImageError(f"{path}: {spec.width}×{spec.height} pixels are more than can be read")
        data = reader.read_image(0, 0, 0, spec.nchannels, oiio.FLOAT)
        if data is None:
            raise ImageError(f"{path}: {_first_line(reader.geterror()) or 'the pixels cannot be read'}")
    finally:
        reader.close()
    pixels = np.asarray(data, dtype=np.float64).reshape(spec.height, spec.width, spec.nchannels)
    names = list(spec.channelnames)
    colour = _channels(names, "")
    if colour is None:
        if kind == "openexr" or spec.nchannels < 3:
            count = f"{spec.nchannels} channel{'s' if spec.nchannels != 1 else ''}"
            raise ImageError(f"{path}: {count} ({', '.join(names)}); R, G and B are needed")
        colour = [0, 1, 2]
    errors = _channels(names, "stderr.")
    precision = _precision(spec, kind, colour)
    values = pixels[:, :, colour]
    return Image(
        pixels=decode_srgb(values) if precision == "8-bit" else values,
        precision=precision,
        stderr=pixels[:, :, errors] if errors else None,
        attributes={a.name: a.value for a in spec.extra_attribs},
    )


def _channels(names: list[str], prefix: str) -> list[int] | None:
    """Indices of prefixR, prefixG, prefixB, also within one layer ("color.R")."""
    lower = [name.lower() for name in names]
    wanted = [prefix + c for c in "rgb"]
    if all(w in lower for w in wanted):
        return [lower.index(w) for w in wanted]
    for name in lower if not prefix else []:
        layer = name.removesuffix(".r")
        if layer != name and layer != "stderr" and layer != "variance":
            found = [f"{layer}.{c}" for c in "rgb"]
            if all(f in lower for f in found):
                return [lower.index(f) for f in found]
    return None


def _precision(spec: Any, kind: str, colour: list[int]) -> Precision:
    if kind == "hdr":
        return "rgbe"
    formats = list(spec.channelformats) or [spec.format] * spec.nchannels
    kinds = {str(formats[i]) for i in colour}
    if kinds <= {"float", "double", "uint32"}:
        return "float"
    return "half" if kinds <= {"half", "float"} else "8-bit"


def _first_line(text: str) -> str:
    return text.strip().splitlines()[0] if text.strip() else ""


def encode_srgb(linear: Array) -> Array:
    """Linear 0…1 to sRGB 0…1 (IEC 61966-2-1), values beyond clipped."""
    x = np.clip(linear, 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def decode_srgb(encoded: Array) -> Array:
    """sRGB to linear; negative values stay, values above 1 follow the curve."""
    x = np.maximum(encoded, 0.0)
    return np.where(encoded <= 0.04045, encoded / 12.92, ((x + 0.055) / 1.055) ** 2.4)


def write_pfm(path: Path, pixels: Array) -> None:
    """Write (H, W, 3) as a little-endian PFM."""
    height, width, _ = pixels.shape
    with whole(path) as partial, partial.open("wb") as file:
        file.write(f"PF\n{width} {height}\n-1.0\n".encode())
        file.write(np.ascontiguousarray(pixels[::-1], dtype="<f4").tobytes())


def write_exr(path: Path, channels: Mapping[str, Array], half: bool = False) -> None:
    """Write named (H, W) channels as an EXR of 32-bit floats, or of halves."""
    import OpenImageIO as oiio

    names = list(channels)
    data = np.stack([channels[n] for n in names], axis=2).astype(np.float32)
    spec = oiio.ImageSpec(data.shape[1], data.shape[0], len(names), oiio.HALF if half else oiio.FLOAT)
    spec.channelnames = tuple(names)
    write_image(path, spec, data)


def write_png(path: Path, pixels: NDArray[np.uint8]) -> None:
    """Write (H, W, 3) 8-bit sRGB."""
    import OpenImageIO as oiio

    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], 3, oiio.UINT8)
    write_image(path, spec, pixels)


def write_image(path: Path, spec: Any, data: NDArray[Any]) -> None:
    """Write an image of that specification as a whole or not at all; OSError where the disk is full."""
    import OpenImageIO as oiio

    with whole(path) as partial:
        writer = oiio.ImageOutput.create(str(partial))
        if writer is not None and writer.open(str(partial), spec):
            writer.write_image(np.ascontiguousarray(data))
            writer.close()
        said = _first_line(writer.geterror() if writer else oiio.geterror())
        if said:
            with partial.open("ab") as file:  # where it is the disk that is full, this says so
                file.write(bytes(1 << 20))
            raise ImageError(f"{path}: {said}")
