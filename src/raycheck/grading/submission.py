"""What is handed in: a folder or an archive, and its small manifest raycheck.toml.

Nothing of it is run here. Archives are unpacked by name and content alone: plain files and folders below one
place, within limits of number and size; links, devices and names that lead elsewhere are refused.
"""

import io
import os
import shutil
import stat
import tarfile
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path, PurePosixPath
from typing import IO, Any

from raycheck.base.errors import NotFound
from raycheck.renderers.manifest import MANIFEST, Manifest, read_manifest

PICTURES = "pictures"
"""The folder of pictures that are handed in, with one of its own for each task."""
MOST_FILES = 5000
TOO_MANY = f"more than {MOST_FILES} files"
MOST_BYTES = 200 << 20
TOO_LARGE = f"it unpacks to more than {MOST_BYTES >> 20} MB"
ARCHIVES = (".zip", ".tar", ".tar.gz", ".tgz", ".tar.bz2", ".tar.xz")


class SubmissionError(Exception):
    """A submission that cannot be graded at all: one plain sentence for the student."""

    def __init__(self, text: str) -> None:
        super().__init__(text.encode(errors="replace").decode())  # names in an archive may be no text


@dataclass(frozen=True)
class Submission:
    """A submission that was unpacked."""

    folder: Path
    manifest: Manifest = field(default_factory=Manifest)
    """Where it says nothing of a build or a command the assignment does."""
    has_manifest: bool = False

    @property
    def pictures_alone(self) -> bool:
        """Nothing is to be built or run."""
        return not self.has_manifest and (self.folder / PICTURES).is_dir()

    def pictures(self, task: str) -> list[Path]:
        """The pictures that are handed in for a task, in the order of their names."""
        folder = self.folder / PICTURES / task
        return sorted(p for p in folder.glob("*") if p.suffix.lower() in (".exr", ".pfm") and p.is_file())


def is_archive(path: Path) -> bool:
    return path.is_file() and path.name.lower().endswith(ARCHIVES)


@dataclass(frozen=True)
class Handed:
    """What was handed in, to be opened elsewhere: a file's name and bytes."""

    name: str
    data: bytes
    problem: str = ""
    """Why it cannot be opened at all."""


def pack(path: Path) -> Handed:
    """An archive as it is, a folder as a tar of its files; nothing else is looked at."""
    try:
        if path.is_dir():
            return Handed("folder.tar", _tar(path))
        if path.stat().st_size > MOST_BYTES:
            raise SubmissionError(f"it has more than {MOST_BYTES >> 20} MB")
        return Handed(path.name, path.read_bytes())
    except SubmissionError as error:
        return Handed(path.name, b"", str(error))
    except OSError as error:
        return Handed(path.name, b"", f"it cannot be unpacked: {error}")


def _tar(folder: Path) -> bytes:
    whole, total = io.BytesIO(), 0
    with tarfile.open(fileobj=whole, mode="w") as archive:
        for count, entry in enumerate(_in_folder(folder), 1):
            total += entry.size
            if total > MOST_BYTES:
                raise SubmissionError(TOO_LARGE)
            if count > MOST_FILES:
                raise SubmissionError(TOO_MANY)
            info = tarfile.TarInfo(entry.name)
            info.size, info.mode = entry.size, 0o755 if entry.executable else 0o644
            archive.addfile(info, entry.open)
    return whole.getvalue()


def may_have_pictures(path: Path, task: str) -> bool:
    """Whether it may hold pictures, by the names of its files; also where only unpacking would tell."""
    inside = f"{PICTURES}/{task}/"
    try:
        if path.is_dir():
            return any(path.glob(f"**/{inside}*"))
        if zipfile.is_zipfile(path):
            with zipfile.ZipFile(path) as archive:
                return any(inside in name for name in archive.namelist())
        return tarfile.is_tarfile(path)
    except Exception:  # whatever a hostile archive makes its readers raise: who opens it says so
        return False


def open_submission(path: Path, into: Path) -> Submission:
    """Copy or unpack into the empty folder `into`, and read the manifest; or SubmissionError."""
    try:
        _unpack(path, into)
    except SubmissionError:
        raise
    except Exception as error:  # whatever a hostile archive makes its readers raise
        raise SubmissionError(f"it cannot be unpacked: {error}") from None
    return _manifest(_root(into))


def _unpack(path: Path, into: Path) -> None:
    if path.is_dir():
        _take(_in_folder(path), into)
    elif path.is_file() and zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as archive:
            _take(_in_zip(archive), into)
    elif path.is_file() and tarfile.is_tarfile(path):
        with tarfile.open(path) as archive:
            _take(_in_tar(archive), into)
    else:
        raise SubmissionError(f"{path.name} is neither a folder nor an archive (zip, tar)")


@dataclass(frozen=True)
class _Entry:
    name: str
    size: int
    executable: bool
    open: IO[bytes]


def _in_folder(path: Path) -> Iterator[_Entry]:
    for where, folders, files in os.walk(path):
        folder = Path(where)
        for name in (*folders, *files):
            if (folder / name).is_symlink():
                raise SubmissionError(
                    f"{(folder / name).relative_to(path)} is a link: hand in the file itself"
                )
        for name in sorted(files):
            file = folder / name
            found = file.lstat()
            if not stat.S_ISREG(found.st_mode):
                raise SubmissionError(f"{file.relative_to(path)} is not a plain file")
            with file.open("rb") as opened:
                relative = file.relative_to(path).as_posix()
                yield _Entry(relative, found.st_size, bool(found.st_mode & 0o100), opened)


def _in_zip(archive: zipfile.ZipFile) -> Iterator[_Entry]:
    for info in archive.infolist():
        mode = info.external_attr >> 16
        if stat.S_ISLNK(mode):
            raise SubmissionError(f"{info.filename} is a link: hand in the file itself")
        if not info.is_dir():
            with _reading(partial(archive.open, info), info.filename) as opened:
                yield _Entry(info.filename, info.file_size, bool(mode & 0o100), opened)


def _in_tar(archive: tarfile.TarFile) -> Iterator[_Entry]:
    for info in archive:
        if not info.isdir() and not info.isfile():
            raise SubmissionError(f"{info.name} is a link or a device: hand in plain files")
        if info.isfile():
            with _reading(partial(archive.extractfile, info), info.name) as opened:
                yield _Entry(info.name, info.size, bool(info.mode & 0o100), opened)


def _reading(opener: Callable[[], Any], name: str) -> IO[bytes]:
    try:
        opened: IO[bytes] = opener()
        return opened
    except Exception as error:
        raise SubmissionError(f"{name} cannot be unpacked: {error}") from None


def _take(entries: Iterator[_Entry], into: Path) -> None:
    count = total = 0
    for entry in entries:
        count += 1
        total += _copy(entry, into / _safe(entry.name), MOST_BYTES - total)
        if count > MOST_FILES:
            raise SubmissionError(TOO_MANY)
    if not count:
        raise SubmissionError("it holds no files")


def _copy(entry: _Entry, target: Path, room: int) -> int:
    """Bytes written: counted as they come, whatever the archive says of the size."""
    target.parent.mkdir(parents=True, exist_ok=True)
    written = 0
    with target.open("xb") as file:
        while block := entry.open.read(1 << 20):
            written += len(block)
            if written > room:
                raise SubmissionError(TOO_LARGE)
            file.write(block)
    target.chmod(0o755 if entry.executable else 0o644)
    return written


def _safe(name: str) -> PurePosixPath:
    """The name below the folder; SubmissionError if it leads elsewhere."""
    path = PurePosixPath(name.replace("\\", "/"))
    bad = path.is_absolute() or ".." in path.parts or ":" in name or "\0" in name or not path.parts
    if bad or any(len(part) > 200 for part in path.parts):
        raise SubmissionError(f"the name {name!r} leads out of the submission or is none")
    return path


def _root(folder: Path) -> Path:
    """Archives often hold one folder that holds all the rest."""
    while not (folder / MANIFEST).is_file():
        inside = [p for p in folder.iterdir() if p.name not in ("__MACOSX", ".DS_Store")]
        if len(inside) != 1 or not inside[0].is_dir() or inside[0].name == PICTURES:
            return folder
        folder = inside[0]
    return folder


def _manifest(folder: Path) -> Submission:
    path = folder / MANIFEST
    if not path.is_file():
        return Submission(folder)
    try:
        return Submission(folder, read_manifest(path), has_manifest=True)
    except NotFound as error:
        raise SubmissionError(str(error)) from None


def remove(folder: Path) -> None:
    """A folder that a hostile program may have filled."""
    shutil.rmtree(folder, ignore_errors=True)
