"""The border: a picture that a hostile program left in a folder becomes numbers, or a sentence.

Only a regular file with one link is read, through a descriptor that follows no link; size and header are
checked before anything is decoded, and decoded it is by a process without privileges that may crash or swell
alone: EXR and PFM, no other formats, one layer that is the whole picture. Of what the file says beside its
pixels nothing is taken but their precision.
"""

import contextlib
import json
import os
import shutil
import stat
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio

from raycheck.base.errors import ImageError, RenderError
from raycheck.base.images import ERRORS, Image, load_exr, load_image
from raycheck.base.text import plain
from raycheck.grading.jail import folders
from raycheck.grading.jail.apart import Apart, Broken

oiio.attribute("threads", 1)  # before it is used: processes forked later would lack the threads of its pool
oiio.attribute("exr_threads", -1)
MOST_CHANNELS = 64
DECODE_SECONDS = 20.0
DECODE_BYTES = 2 << 30
NAME = "picture.exr"
EXR = b"\x76\x2f\x31\x01"
"""How an EXR begins."""
PRECISIONS = ("float", "half")
MOST_SAID = 2000


def take_picture(
    folder: Path, private: Path, most_bytes: int, size: tuple[int, int], decoder: "Decoder", said: str = ""
) -> Image:
    """The picture image.exr, or the one file whose name begins so, as an Image of height and width `size`.

    `private` is a folder that no student's program reaches; RenderError says what is wrong.
    """
    try:
        names = sorted(p.name for p in folder.iterdir() if p.name.startswith("image.exr"))[:2]
    except OSError:
        raise RenderError("the folder of {output} was closed by the program: it cannot be read") from None
    name = "image.exr" if "image.exr" in names else names[0] if len(names) == 1 else ""
    if not name:
        raise RenderError(f"exit status 0, but {{output}} was not written{said}")
    copy = private / "picture"
    _copy(folder / name, copy, most_bytes)
    return decoder.read(copy, size)


def _copy(source: Path, target: Path, most_bytes: int) -> None:
    try:
        descriptor = os.open(source, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        kind = "a link" if source.is_symlink() else "not a file that can be read"
        raise RenderError(f"{{output}} is {kind}: a plain file is needed") from None
    found = os.fstat(descriptor)
    if not stat.S_ISREG(found.st_mode):
        os.close(descriptor)
        raise RenderError("{output} is a pipe, device or folder: a plain file is needed")
    with os.fdopen(descriptor, "rb") as file:
        if found.st_nlink != 1:
            raise RenderError(f"{{output}} has {found.st_nlink} hard links: a file of its own is needed")
        if found.st_size > most_bytes:
            raise RenderError(f"{{output}} has {found.st_size} bytes, at most {most_bytes} are read")
        with target.open("wb") as copy:
            shutil.copyfileobj(file, copy)


class Decoder:
    """Reads the pictures of one submission; a context. Each is decoded by a process without privileges, as
    `user` where this one is root.
    """

    def __init__(self, user: int | None = None) -> None:
        self.user = user

    def __enter__(self) -> "Decoder":
        with contextlib.ExitStack() as made:
            self.place = made.enter_context(folders.temporary("raycheck-decode-", mode=0o755))
            apart = Apart(_decode, self.place, self.user, seconds=DECODE_SECONDS, memory=DECODE_BYTES)
            self.apart = made.enter_context(apart)
            self.made = made.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self.made.close()

    def read(self, path: Path, size: tuple[int, int]) -> Image:
        """A file that is already ours; RenderError for anything but a picture of that height and width."""
        copy = self.place / NAME
        shutil.copyfile(path, copy)
        copy.chmod(0o644)
        height, width = size
        try:
            answer = self.apart.ask(json.dumps(size).encode(), height * width * 24 + MOST_SAID)
        except Broken as why:
            raise RenderError(f"{{output}} is malformed: decoding it {why}") from None
        finally:
            copy.unlink()
        said, _, data = answer.partition(b"\n")
        precision = said.decode(errors="replace")
        if precision not in PRECISIONS or len(data) != height * width * 24:
            raise RenderError(precision)
        pixels = np.frombuffer(data, "<f8").reshape(height, width, 3)
        return Image(pixels, precision)


def _decode(asked: bytes, folder: Path) -> bytes:
    """The precision of the picture NAME and its pixels (H, W, 3); or what is wrong with it."""
    height, width = json.loads(asked)
    path = folder / NAME
    try:
        if path.read_bytes()[:4] == EXR:
            image = load_exr(path, partial(_check_spec, (height, width)))
        else:
            _check_pfm(path, (height, width))
            image = load_image(path)
    except (ImageError, RenderError) as error:
        problem = str(error).replace(str(path), "{output}").replace(NAME, "{output}")
        return plain(problem).encode(errors="replace")[:MOST_SAID]
    except MemoryError:
        return b"{output} takes too much memory to decode"
    return image.precision.encode() + b"\n" + image.pixels.astype("<f8").tobytes()


def _check_spec(size: tuple[int, int], spec: Any, parts: int) -> None:
    """What an EXR says of itself, before memory is taken for its pixels."""
    if (spec.height, spec.width) != size:
        raise RenderError(_other_size(spec.width, spec.height, size))
    if (spec.full_height, spec.full_width) != size or (spec.x, spec.y) != (spec.full_x, spec.full_y):
        raise RenderError("the data window of {output} is not its display window: a whole picture is needed")
    if spec.nchannels > MOST_CHANNELS or spec.depth > 1:
        raise RenderError(f"the image has {spec.nchannels} channels, at most {MOST_CHANNELS} are read")
    layers = {name.rpartition(".")[0] for name in spec.channelnames}
    layers = {name for name in layers if name.rpartition(".")[2].lower() not in ERRORS}
    if parts > 1 or len(layers) > 1:
        raise RenderError(f"{{output}} has {max(parts, len(layers))} layers: a picture of one is needed")


def _check_pfm(path: Path, size: tuple[int, int]) -> None:
    """Before memory is taken for its pixels."""
    with path.open("rb") as file:
        words = file.read(200).split()
    if not words or words[0] not in (b"PF", b"Pf"):
        raise RenderError("{output} is not an image that is read here: EXR and PFM of 32-bit floats are")
    if len(words) >= 3 and all(word.isdigit() and len(word) < 10 for word in words[1:3]):
        width, height = int(words[1]), int(words[2])
        if (height, width) != size:
            raise RenderError(_other_size(width, height, size))


def _other_size(width: int, height: int, size: tuple[int, int]) -> str:
    turned = ", width and height are swapped" if (width, height) == size and width != height else ""
    return f"the image is {width}×{height} pixels, the scene asks for {size[1]}×{size[0]}{turned}"
