"""The files that a renderer is, and waiting until they change."""

import contextlib
import hashlib
import os
import shutil
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from raycheck.base.errors import NotFound
from raycheck.renderers.commands import Command

PAUSE = 0.3
"""Seconds between two looks: what was written is whole when it is the same in two of them."""


def program_files(command: Command) -> list[Path]:
    """The words of a command that name files, or the program that its first word finds on the PATH; NotFound
    where there is neither.
    """
    folder = command.folder or Path()
    found = [folder / word for word in command.words if os.path.isfile(folder / word)]  # noqa: PTH113
    if not found:
        program = shutil.which(command.words[0])
        if not program:
            raise NotFound(f"{command.words[0]}: there is no such program (--watch FILE names what it is)")
        found = [Path(program)]
    return found


@dataclass(frozen=True)
class Watched:
    """Files that are looked at again and again."""

    paths: Sequence[Path]

    def __post_init__(self) -> None:
        for path in self.paths:
            if not path.is_file():
                raise NotFound(f"{path}: there is no such file to watch")

    def __str__(self) -> str:
        return ", ".join(map(str, self.paths))

    def digest(self) -> str | None:
        """Of what is in the files; None while one is missing, or cannot be read."""
        whole = hashlib.blake2b(digest_size=16)
        try:
            for path in self.paths:
                data = path.read_bytes()
                whole.update(f"{len(data)} ".encode() + data)
        except OSError:
            return None
        return whole.hexdigest()

    def until_other(self, than: str) -> str:
        """Waits until the files are others than those of a digest, and whole; their digest."""
        stamps: list[tuple[int, int]] = []
        last: str | None = than
        while True:
            time.sleep(PAUSE)
            now = self._stamps()
            if now == stamps and last == than:
                continue  # nobody wrote: nothing is read
            stamps, before, last = now, last, self.digest()
            if last and last == before != than:
                return last

    def _stamps(self) -> list[tuple[int, int]]:
        """They change whenever a file is written."""
        found = []
        for path in self.paths:
            with contextlib.suppress(OSError):
                told = path.stat()
                found.append((told.st_mtime_ns, told.st_size))
        return found
