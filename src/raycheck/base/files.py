"""Files that are written as a whole or not at all, and folders in which one process at a time works."""

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from raycheck.base.errors import NotFound


@contextlib.contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Gives a path to write to, which takes the place of `path` at the end; or nothing is left of it. A
    symbolic link stays, and the file that it leads to is written, also where there is none yet.
    """
    path = Path(os.path.realpath(path))
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".writing-") as scratch:
        partial = Path(scratch) / path.name
        yield partial
        partial.replace(path)


def made_folder(path: Path) -> Path:
    """The folder, made where it is not there, also behind a symbolic link; NotFound where it cannot be."""
    real = Path(os.path.realpath(path))
    try:
        real.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise NotFound(f"{path}: cannot be a folder: {error.strerror}") from None
    return real


def write_whole(path: Path, text: str) -> None:
    """Write a text as a whole or not at all."""
    with whole(path) as partial:
        partial.write_text(text, encoding="utf-8", newline="\n")


@contextlib.contextmanager
def one_process(folder: Path) -> Iterator[None]:
    """A folder that one process at a time has, of all on this machine that ask for it; not on Windows."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "lock").open("w") as lock:
        with contextlib.suppress(ImportError):
            import fcntl

            fcntl.flock(lock, fcntl.LOCK_EX)
        yield
