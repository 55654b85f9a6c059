"""The border: a picture that a hostile program left in a folder becomes numbers, or a sentence.

Only a regular file with one link is read, through a descriptor that follows no link; size and header are
checked before anything is decoded, and other formats than PFM are decoded by a process that may crash or
swell alone.
"""

import contextlib
import multiprocessing
import os
import shutil
import stat
from multiprocessing.connection import Connection
from multiprocessing.context import ForkProcess
from pathlib import Path

import OpenImageIO as oiio

from raycheck.base.errors import ImageError, RenderError
from raycheck.base.images import Image, load_image

oiio.attribute("threads", 1)  # before it is used: processes forked later would lack the threads of its pool
oiio.attribute("exr_threads", -1)
MOST_CHANNELS = 64
DECODE_SECONDS = 20.0
DECODE_BYTES = 2 << 30
"""Address space of the decoding process beyond its own at the start."""


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
    """Reads the pictures of one submission; a context. What is no PFM is decoded by a process, started when
    it is first needed and anew after a picture that it did not survive.
    """

    def __init__(self) -> None:
        self.process: ForkProcess | None = None
        self.pipe: Connection | None = None

    def __enter__(self) -> "Decoder":
        return self

    def __exit__(self, *_: object) -> None:
        if self.process is not None and self.pipe is not None:
            self.pipe.close()
            self.process.kill()
            self.process.join()
        self.process = self.pipe = None

    def read(self, path: Path, size: tuple[int, int]) -> Image:
        """A file that is already ours; RenderError for anything but a picture of that height and width."""
        try:
            with path.open("rb") as file:
                if file.read(2) in (b"PF", b"Pf"):
                    _check_pfm(path, size)
                    return load_image(path)
        except ImageError as error:
            raise RenderError(_plain(error, path)) from None
        answer = self._apart(path, size)
        if isinstance(answer, str):
            raise RenderError(answer)
        return answer

    def _apart(self, path: Path, size: tuple[int, int]) -> Image | str:
        if self.process is None or self.pipe is None:
            context = multiprocessing.get_context("fork")
            self.pipe, theirs = context.Pipe()
            self.process = context.Process(target=_decode_all, args=(theirs, self.pipe), daemon=True)
            self.process.start()
            theirs.close()
        try:
            self.pipe.send((path, size))
            if self.pipe.poll(DECODE_SECONDS):
                result: Image | str = self.pipe.recv()
                return result
            problem = f"{{output}} was not decoded within {DECODE_SECONDS:.0f} s"
        except (EOFError, OSError):
            problem = "{output} is malformed: decoding it crashed"
        self.__exit__()
        return problem


def _plain(error: Exception, path: Path) -> str:
    return str(error).replace(str(path), "{output}")


def _check_pfm(path: Path, size: tuple[int, int]) -> None:
    """Before memory is taken for its pixels."""
    with path.open("rb") as file:
        words = file.read(200).split()
    if len(words) >= 3 and all(word.isdigit() and len(word) < 10 for word in words[1:3]):
        width, height = int(words[1]), int(words[2])
        if (height, width) != size:
            raise RenderError(_other_size(width, height, size))


def _other_size(width: int, height: int, size: tuple[int, int]) -> str:
    turned = ", width and height are swapped" if (width, height) == size and width != height else ""
    return f"the image is {width}×{height} pixels, the scene asks for {size[1]}×{size[0]}{turned}"


def _decode_all(pipe: Connection, other_end: Connection) -> None:
    """Answers (path, size) with an Image or what is wrong with it."""
    import resource  # POSIX alone

    other_end.close()  # else this process would never see that its owner has ended
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + DECODE_BYTES,) * 2)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with contextlib.suppress(EOFError):
        while True:
            pipe.send(_decode(*pipe.recv()))


def _decode(path: Path, size: tuple[int, int]) -> Image | str:
    try:
        return _header_problem(path, size) or load_image(path)
    except ImageError as error:
        return _plain(error, path)
    except MemoryError:
        return "{output} takes too much memory to decode"


def _header_problem(path: Path, size: tuple[int, int]) -> str:
    reader = oiio.ImageInput.open(str(path))
    if reader is None:
        return ""  # load_image says it better
    spec = reader.spec()
    reader.close()
    if (spec.height, spec.width) != size:
        return _other_size(spec.width, spec.height, size)
    if spec.nchannels > MOST_CHANNELS or spec.depth > 1:
        return f"the image has {spec.nchannels} channels, at most {MOST_CHANNELS} are read"
    return ""
