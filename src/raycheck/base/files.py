"""Files that are written as a whole or not at all, and folders in which one process at a time works."""

import contextlib
import tempfile
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Gives a path to write to, which takes the place of `path` at the end; or nothing is left of it."""
    with tempfile.TemporaryDirectory(dir=path.absolute().parent, prefix=".writing-") as scratch:
        partial = Path(scratch) / path.name
        yield partial
        partial.replace(path)


def write_whole(path: Path, text: str) -> None:
    """Write a text as a whole or not at all."""
    with whole(path) as partial:
        partial.write_text(text, encoding="utf-8")


@contextlib.contextmanager
def one_process(folder: Path) -> Iterator[None]:
    """A folder that one process at a time has, of all on this machine that ask for it; not on Windows."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "lock").open("w") as lock:
        with contextlib.suppress(ImportError):
            import fcntl

            fcntl.flock(lock, fcntl.LOCK_EX)
        yield
