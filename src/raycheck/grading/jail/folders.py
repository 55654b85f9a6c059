"""Folders that somebody hostile filled: walked, copied and removed without recursion, by descriptors,
whatever their depth, the length of their names and their modes.
"""

import contextlib
import os
import shutil
import stat
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

MOST_DEPTH = 64
"""Folders within folders that are looked into."""
_FOLDER = os.O_RDONLY | getattr(os, "O_DIRECTORY", 0) | getattr(os, "O_NOFOLLOW", 0)
_FILE = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)


class TooDeep(Exception):
    """Folders that are nested too deep, or closed: a sentence without its end."""


@dataclass(frozen=True)
class Found:
    """Something in a folder, for as long as the walk stays at it."""

    path: str
    """Below the folder that is walked."""
    status: os.stat_result
    parent: int
    """A descriptor of the folder that it is in, …"""
    name: str
    """… where it has this name."""

    @property
    def is_folder(self) -> bool:
        return stat.S_ISDIR(self.status.st_mode)

    @property
    def is_file(self) -> bool:
        return stat.S_ISREG(self.status.st_mode)

    @property
    def is_link(self) -> bool:
        return stat.S_ISLNK(self.status.st_mode)

    def open(self) -> int:
        """A descriptor for reading a plain file."""
        return os.open(self.name, _FILE, dir_fd=self.parent)


def walk(folder: Path) -> Iterator[Found]:
    """All that is below a folder, in the order of names, a folder before what is in it; links are not
    followed. TooDeep after MOST_DEPTH folders, and for one that is closed.
    """
    open_: list[tuple[int, str, list[str]]] = []

    def enter(name: str | Path, path: str, parent: int | None) -> None:
        try:
            descriptor = os.open(name, _FOLDER, dir_fd=parent)
        except FileNotFoundError:
            return
        except OSError:
            raise TooDeep("there is a folder that is closed to others") from None
        open_.append((descriptor, path, sorted(_names(descriptor), reverse=True)))

    try:
        enter(folder, "", None)
        while open_:
            parent, path, names = open_[-1]
            if not names:
                os.close(open_.pop()[0])
                continue
            name = names.pop()
            with contextlib.suppress(FileNotFoundError):
                found = Found(path + name, os.lstat(name, dir_fd=parent), parent, name)
                yield found
                if found.is_folder:
                    if len(open_) > MOST_DEPTH:
                        raise TooDeep(f"folders are nested more than {MOST_DEPTH} deep")
                    enter(name, found.path + "/", parent)
    finally:
        for descriptor, _, _ in open_:
            os.close(descriptor)


def _names(folder: int) -> list[str]:
    """What is in a folder, by its descriptor."""
    with os.scandir(folder) as entries:
        return [entry.name for entry in entries]


def copy(folder: Path, into: Path) -> None:
    """Copy folders, plain files and links into the empty folder `into`, open to every reader. Nothing else
    is copied, no file shares anything with its copy, and what was done to one is not seen in the other.
    """
    for found in walk(folder):
        target = into / found.path
        if found.is_folder:
            target.mkdir()
            target.chmod(0o755)
        elif found.is_link:
            target.symlink_to(os.readlink(found.name, dir_fd=found.parent))
        elif found.is_file:
            with os.fdopen(found.open(), "rb") as source, target.open("xb") as file:
                shutil.copyfileobj(source, file, 1 << 20)
            target.chmod(0o755 if found.status.st_mode & 0o100 else 0o644)


def remove(folder: Path) -> None:
    """Remove a folder with all that is in it, as far as this process may. One folder is open at a time: the
    way up is "..", and ends where somebody has moved a folder meanwhile.
    """
    with contextlib.suppress(OSError):
        at = os.open(folder, _FOLDER)
        way = [_Entered("", _identity(at), _names(at))]
        try:
            while way:
                if not way[-1].left:
                    done = way.pop()
                    if way:
                        at = _moved(at, "..")
                        if _identity(at) != way[-1].identity:
                            return
                        with contextlib.suppress(OSError):
                            os.rmdir(done.name, dir_fd=at)
                    continue
                name = way[-1].left.pop()
                with contextlib.suppress(OSError):
                    if not stat.S_ISDIR(os.lstat(name, dir_fd=at).st_mode):
                        os.unlink(name, dir_fd=at)
                        continue
                    with contextlib.suppress(PermissionError):
                        os.chmod(name, 0o700, dir_fd=at)
                    at = _moved(at, name)
                    way.append(_Entered(name, _identity(at), _names(at)))
        finally:
            os.close(at)
        folder.rmdir()


@dataclass(frozen=True)
class _Entered:
    """A folder on the way to the one that is open."""

    name: str
    identity: tuple[int, int]
    left: list[str]
    """What of it was not removed yet."""


def _identity(folder: int) -> tuple[int, int]:
    found = os.fstat(folder)
    return found.st_dev, found.st_ino


def _moved(at: int, name: str) -> int:
    """The folder of that name, in place of the one that is open."""
    entered = os.open(name, _FOLDER, dir_fd=at)
    os.close(at)
    return entered


@contextlib.contextmanager
def temporary(prefix: str, parent: Path | None = None, mode: int = 0o711) -> Iterator[Path]:
    """A new folder, removed at the end whatever is in it."""
    place = Path(tempfile.mkdtemp(prefix=prefix, dir=parent))
    try:
        place.chmod(mode)
        yield place
    finally:
        remove(place)
