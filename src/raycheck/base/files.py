"""Files that are written as a whole or not at all, and folders in which one process at a time works."""

import contextlib
import functools
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from raycheck.base.errors import NotFound

PREFIX = ".writing-"


@contextlib.contextmanager
def scratch(folder: Path) -> Iterator[Path]:
    """A folder in `folder` for files that are not finished yet; what is left in it goes with it. Those that
    killed processes left are removed by the next one: they are locked as long as their process lives, except
    on Windows.
    """
    _sweep(folder)
    lock = None
    while lock is None:
        made = Path(tempfile.mkdtemp(dir=folder, prefix=PREFIX))
        lock = _locked(made)  # another process may have swept it away before it was locked
    try:
        yield made
    finally:
        shutil.rmtree(made, ignore_errors=True)
        if lock >= 0:
            os.close(lock)


def _locked(folder: Path) -> int | None:
    """A descriptor that locks a folder until it is closed, -1 where there are no locks; None where another
    process has the lock, or the folder is gone.
    """
    try:
        import fcntl
    except ImportError:
        return -1
    descriptor = -1
    try:
        descriptor = os.open(folder, os.O_RDONLY)
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        folder.stat()
        return descriptor
    except OSError:
        if descriptor >= 0:
            os.close(descriptor)
        return None


@functools.cache
def _sweep(folder: Path) -> None:
    for left in folder.glob(PREFIX + "*"):
        lock = _locked(left)
        if lock is not None and lock >= 0:
            shutil.rmtree(left, ignore_errors=True)
            os.close(lock)


@contextlib.contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Gives a path to write to, which takes the place of `path` at the end; or nothing is left of it. A
    symbolic link stays, and the file that it leads to is written, also where there is none yet. An OSError
    names `path`.
    """
    real = Path(os.path.realpath(path))
    try:
        with scratch(real.parent) as folder:
            partial = folder / real.name
            yield partial
            partial.replace(real)
    except OSError as error:
        if error.filename is None or PREFIX in str(error.filename):
            raise OSError(error.errno, error.strerror, str(path)) from None
        raise


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
