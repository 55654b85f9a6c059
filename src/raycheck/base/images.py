"""Reading images: EXR and anything else OpenImageIO knows, and PFM. Writing PNG, PFM and EXR.

Pixels are (H, W, 3) float64, row 0 at the top, linear radiance. How the file stored them is kept as its
`precision`, since what was rounded away cannot be judged, and which part of an image they are as its
`window`.
"""

import glob
import re
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raycheck.base.arrays import Array
from raycheck.base.errors import ImageError
from raycheck.base.files import whole

Bytes = NDArray[np.uint8]
MAX_PIXELS = 1 << 26
"""Larger images are refused before they are decoded."""
MOST_PARTS = 1024
SHOWN = 256
"""Pixels of a side of a picture in Jupyter, or its own where it has more."""
ERRORS = ("stderr", "variance")
"""Layers of a picture's own errors."""
_WHOLE = re.compile(rb"[0-9]{1,9}")
_NUMBER = re.compile(rb"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")


@dataclass(frozen=True)
class Window:
    """Where the first pixel, at the top left, is in an image of another size."""

    x: int
    y: int
    width: int
    height: int


@dataclass(frozen=True)
class Image:
    """Pixels and what the file said about them."""

    pixels: Array
    """(H, W, 3)"""
    precision: str = "float"
    """"float", "half", "rgbe", or how many bits a whole number has: "8-bit"."""
    stderr: Array | None = None
    """(H, W, 3) standard error of the mean, where the file has channels stderr.R/G/B."""
    attributes: Mapping[str, object] = field(default_factory=dict)
    window: Window | None = None
    """None: the pixels are the whole image."""

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
        if is_whole(self.precision):
            code, half = encode_srgb(self.pixels), 0.5 / (2.0 ** int(self.precision.split("-")[0]) - 1)
            return decode_srgb(code + half) - decode_srgb(code - half)
        return np.zeros_like(size)

    def _repr_png_(self) -> bytes:
        """How Jupyter shows it: as sRGB, exposed as the pages are, small ones enlarged."""
        shown = display(self.pixels, exposure(self.pixels))
        scale = max(SHOWN // max(shown.shape[:2]), 1)
        return png(shown.repeat(scale, axis=0).repeat(scale, axis=1))


def load_image(path: Path | str) -> Image:
    """Read an image by its content, whatever its name says; ImageError if it cannot be.

    `IMAGE:LAYER` is a layer, or a part, of a file that has several.
    """
    path, layer = _split(Path(path))
    try:
        with path.open("rb") as file:
            magic = file.read(3)
    except OSError as error:
        raise ImageError(f"{path}: {error.strerror}") from None
    if magic[:2] in (b"PF", b"Pf") and magic[2:3].isspace():
        if layer:
            raise ImageError(f"{path}: a PFM has no layer {layer}")
        return Image(_read_pfm(path))
    return _read_oiio(path, layer)


def _split(path: Path) -> tuple[Path, str]:
    """The file, and the layer behind a colon, or ""; a file may have a colon in its name."""
    file, colon, layer = str(path).rpartition(":")
    has_layer = colon and layer and not path.exists() and Path(file).is_file()
    return (Path(file), layer) if has_layer else (path, "")


def find_images(pattern: str) -> list[Path]:
    """The files that a glob means, sorted; of each the layer where it ends in :LAYER. The name of a file
    means that file, whatever stands in it.
    """
    file, colon, layer = pattern.rpartition(":")
    for found, behind in ((pattern, ""), (file, colon + layer)):
        if Path(found).is_file():
            return [Path(found + behind)]
        paths = sorted(glob.glob(found))  # noqa: PTH207 (absolute patterns too)
        if paths:
            return [Path(p + behind) for p in paths]
    return []


def _read_pfm(path: Path) -> Array:
    """PFM: "PF", width and height, scale, then float32 rows from the bottom up. Little-endian if the scale is
    negative; its size is a factor.
    """
    with path.open("rb") as file:
        words: list[bytes] = []
        while len(words) < 4:
            line = file.readline(200)
            if not line:
                raise ImageError(f"{path}: the PFM header is cut short")
            words += line.split(b"#")[0].split()
        sizes = len(words) == 4 and all(_WHOLE.fullmatch(word) for word in words[1:3])
        if not sizes or not _NUMBER.fullmatch(words[3]) or not 0 < abs(float(words[3])) < np.inf:
            raise ImageError(f"{path}: the PFM header is not 'PF WIDTH HEIGHT SCALE', SCALE a number but 0")
        width, height, scale = int(words[1]), int(words[2]), float(words[3])
        if words[0] != b"PF":
            raise ImageError(f"{path}: 1 channel, 3 are needed (the first line of a colour PFM is 'PF')")
        if width < 1 or height < 1 or width * height > MAX_PIXELS:
            raise ImageError(f"{path}: {width}×{height} is not a size that can be read")
        data = file.read(width * height * 12)
    if len(data) < width * height * 12:
        raise ImageError(f"{path}: {len(data)} bytes of pixels, {width}×{height} needs {width * height * 12}")
    values = np.frombuffer(data, dtype="<f4" if scale < 0 else ">f4")
    return values.reshape(height, width, 3)[::-1].astype(np.float64) * abs(scale)


def load_exr(path: Path, check: Callable[[Any, int], None]) -> Image:
    """Read NAME.exr as an EXR and as nothing else, which holds for all that this process reads from then on.
    Before memory is taken for its pixels, what it says of its first part and the number of parts go to
    `check`, which may raise. ImageError if it cannot be read.
    """
    import OpenImageIO as oiio

    oiio.attribute("try_all_readers", 0)
    return _read_oiio(path, "", check)


def _read_oiio(path: Path, wanted: str, check: Callable[[Any, int], None] | None = None) -> Image:
    import OpenImageIO as oiio

    reader = None
    try:
        reader = oiio.ImageInput.open(utf8(path))  # by content where the name's ending is wrong
        if reader is None:
            said, hint = _said(oiio.geterror(), path), "EXR or PFM of 32-bit floats are best"
            raise ImageError(f"{path}: not an image that can be read ({hint}){': ' + said if said else ''}")
        if check:
            spec = reader.spec()
            check(spec, max(spec.get_int_attribute("oiio:subimages", 1), 1))
        return _read(path, reader, wanted)
    except UnicodeDecodeError:  # of a name in it, or in what OpenImageIO says of it
        raise ImageError(f"{path}: not an image that can be read: a text in it is not UTF-8") from None
    finally:
        if reader is not None:
            reader.close()


def _read(path: Path, reader: Any, wanted: str) -> Image:
    import OpenImageIO as oiio

    kind = reader.format_name()
    part, layer = _choose(path, reader, kind, wanted)
    reader.seek_subimage(part, 0)
    spec = reader.spec()
    count = spec.width * spec.height
    if count > MAX_PIXELS or count * spec.nchannels > 16 * MAX_PIXELS:
        raise ImageError(f"{path}: {spec.width}×{spec.height} pixels are more than can be read")
    if spec.deep or spec.depth > 1:
        raise ImageError(f"{path}: {'deep pixels' if spec.deep else 'a volume'}, an image is needed")
    precision = _precision(path, spec, kind, layer.colour)
    window = _window(path, spec) if kind == "openexr" else None
    data = reader.read_image(part, 0, 0, spec.nchannels, oiio.FLOAT)
    if data is None:
        raise ImageError(f"{path}: {_said(reader.geterror(), path) or 'the pixels cannot be read'}")
    pixels = np.asarray(data, dtype=np.float64).reshape(spec.height, spec.width, spec.nchannels)
    values = pixels[:, :, layer.colour]
    return Image(
        pixels=decode_srgb(values) if is_whole(precision) else values,
        precision=precision,
        stderr=pixels[:, :, layer.errors] if layer.errors else None,
        attributes={a.name: a.value for a in spec.extra_attribs},
        window=window,
    )


@dataclass(frozen=True)
class _Layer:
    """Indices of the channels of a colour, and of its standard errors, if it has any."""

    name: str
    colour: list[int]
    errors: list[int]


def _choose(path: Path, reader: Any, kind: str, wanted: str) -> tuple[int, _Layer]:
    """The part of the file and the layer in it that are wanted, or the only ones, or R, G, B themselves."""
    found: list[tuple[int, _Layer]] = []
    names: list[str] = []
    parts = max(reader.spec().get_int_attribute("oiio:subimages", 1), 1)
    for part in range(min(parts, MOST_PARTS)):
        if not reader.seek_subimage(part, 0):
            break
        spec = reader.spec()
        names += spec.channelnames
        name = spec.get_string_attribute("oiio:subimagename") or str(part)
        layers = _layers(spec.channelnames)
        if not layers and kind != "openexr" and spec.nchannels >= 3:
            layers = [_Layer("", [0, 1, 2], [])]
        for one in layers:
            called = one.name if parts == 1 or one.name == name else ".".join(filter(None, (name, one.name)))
            found.append((part, replace(one, name=called)))
    if not found:
        count = f"{len(names)} channel{'s' if len(names) != 1 else ''}"
        raise ImageError(f"{path}: {count} ({', '.join(names)}); R, G and B are needed")
    listed = ", ".join([one.name or "R, G and B" for _, one in found[:16]] + ["…"] * (len(found) > 16))
    if wanted:
        chosen = [each for each in found if each[1].name == wanted]
        chosen = chosen or [each for each in found if each[1].name.lower() == wanted.lower()]
        if len(chosen) != 1:
            raise ImageError(f"{path}: no layer {wanted}; it has {listed}")
        return chosen[0]
    chosen = found if len(found) == 1 else [each for each in found if not each[1].name]
    if len(chosen) != 1:
        raise ImageError(f"{path}: several layers ({listed}): choose one as IMAGE:LAYER")
    return chosen[0]


def _layers(names: Sequence[str]) -> list[_Layer]:
    """Those that have R, G and B: of the image itself the name is "", of beauty.R it is beauty. Standard
    errors are those of beauty.stderr.R, or of stderr.R where no other layer may be meant.
    """
    lower = [name.lower() for name in names]

    def rgb(prefix: str) -> list[int]:
        wanted = [f"{prefix}{c}" for c in "rgb"]
        return [lower.index(name) for name in wanted] if all(name in lower for name in wanted) else []

    of_layer = [name[:-1] for name in lower if name == "r" or name.endswith(".r")]
    prefixes = [p for p in dict.fromkeys(of_layer) if rgb(p) and p[:-1].split(".")[-1] not in ERRORS]
    return [
        _Layer(
            names[rgb(p)[0]][:-1].removesuffix("."), rgb(p),
            rgb(f"{p}stderr.") or (rgb("stderr.") if len(prefixes) == 1 else []),
        )
        for p in prefixes
    ]  # fmt: skip


def _window(path: Path, spec: Any) -> Window | None:
    """Where the pixels are in the image, where they are not all of it."""
    x, y = spec.x - spec.full_x, spec.y - spec.full_y
    width, height = spec.full_width, spec.full_height
    if x < 0 or y < 0 or x + spec.width > width or y + spec.height > height:
        data = _corners(spec.x, spec.y, spec.width, spec.height)
        display = _corners(spec.full_x, spec.full_y, width, height)
        raise ImageError(f"{path}: the data window, {data}, is not inside the display window, {display}")
    return None if (spec.width, spec.height) == (width, height) else Window(x, y, width, height)


def _corners(x: int, y: int, width: int, height: int) -> str:
    return f"({x}, {y}) to ({x + width - 1}, {y + height - 1})"


def _precision(path: Path, spec: Any, kind: str, colour: list[int]) -> str:
    if kind == "hdr":
        return "rgbe"
    formats = list(spec.channelformats) or [spec.format] * spec.nchannels
    kinds = {str(formats[i]) for i in colour}
    if kinds <= {"float", "double"}:
        return "float"
    if kinds <= {"half", "float", "double"}:
        return "half"
    bits = {"uint8": 8, "int8": 8, "uint16": 16, "int16": 16}
    if len(kinds) > 1 or not kinds <= bits.keys():
        raise ImageError(f"{path}: pixels of type {' and '.join(sorted(kinds))}, floats are needed")
    stored = bits[kinds.pop()]
    told = spec.get_int_attribute("oiio:BitsPerSample", 0)
    return f"{told if 8 < told < stored else stored}-bit"


def is_whole(precision: str) -> bool:
    """Whether the pixels were stored as whole numbers, sRGB from black to white: "8-bit", "16-bit"."""
    return precision.endswith("-bit")


def utf8(path: Path) -> str:
    """The name as OpenImageIO takes it; ImageError where it is no text."""
    try:
        str(path).encode()
    except UnicodeEncodeError:
        raise ImageError(f"{path}: the name is not UTF-8: give the file another") from None
    return str(path)


def _said(text: str, path: Path) -> str:
    """What OpenImageIO said, in a line and without the name that stands before it anyway."""
    return _first_line(text.replace(f" ({path})", "").replace(str(path), path.name))


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


def exposure(reference: Array) -> float:
    """Factor that brings the 90th percentile of luminance to 0.6: one for all pictures of a scene. NaN and
    Inf count as black.
    """
    finite = np.nan_to_num(reference.mean(axis=2), nan=0.0, posinf=0.0, neginf=0.0)
    level = float(np.quantile(finite, 0.9))
    return 0.6 / level if level > 0 else 1.0


def display(linear: Array, factor: float = 1.0) -> Bytes:
    """Linear (H, W, 3), times `factor`, as 8-bit sRGB; brighter than white is clipped, NaN is black."""
    shown = np.nan_to_num(linear * factor, nan=0.0, posinf=1.0, neginf=0.0)
    return np.round(encode_srgb(shown) * 255).astype(np.uint8)


def png(pixels: Bytes) -> bytes:
    """What write_png writes."""
    with tempfile.TemporaryDirectory(prefix="raycheck-") as folder:
        path = Path(folder) / "picture.png"
        write_png(path, pixels)
        return path.read_bytes()


def write_png(path: Path, pixels: Bytes) -> None:
    """Write (H, W, 3) 8-bit sRGB."""
    import OpenImageIO as oiio

    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], 3, oiio.UINT8)
    write_image(path, spec, pixels)


def write_image(path: Path, spec: Any, data: NDArray[Any]) -> None:
    """Write an image of that specification as a whole or not at all; OSError where the disk is full."""
    import OpenImageIO as oiio

    with whole(path) as partial:
        writer = oiio.ImageOutput.create(utf8(partial))
        if writer is not None and writer.open(str(partial), spec):
            writer.write_image(np.ascontiguousarray(data))
            writer.close()
        said = writer.geterror() if writer else oiio.geterror()
        if said:
            with partial.open("ab") as file:  # where it is the disk that is full, this says so
                file.write(bytes(1 << 20))
            raise ImageError(f"{path}: {_said(said, path)}")
