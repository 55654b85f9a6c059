"""What is handed in: a folder or an archive, and its small manifest raycheck.toml.

Nothing of it is run here. Archives are unpacked by name and content alone: plain files and folders below one
place, within limits of number, depth, names and size; links, devices and names that lead elsewhere are
refused. They are opened by a process apart, within limits of time and memory.
"""

import bz2 as bz2  # what the process that unpacks cannot find any more
import codecs
import errno
import gzip as gzip
import io
import lzma as lzma
import os
import stat
import tarfile
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path, PurePosixPath
from typing import IO, Any

from raycheck.base.errors import NotFound
from raycheck.base.text import plain, quoted, shown
from raycheck.grading.jail import folders
from raycheck.grading.jail.apart import Apart, Broken
from raycheck.renderers.manifest import MANIFEST, Manifest, read_manifest

PICTURES = "pictures"
"""The folder of pictures that are handed in, with one of its own for each task."""
MOST_ENTRIES = 5000
TOO_MANY = f"more than {MOST_ENTRIES} files and folders"
MOST_DEPTH = 40
MOST_NAME, MOST_PATH = 200, 1000
"""Bytes of a name, and of all names down to it."""
MOST_BYTES = 200 << 20
TOO_LARGE = f"it unpacks to more than {MOST_BYTES >> 20} MB"
NO_FILE = f"{MANIFEST} is a folder: a text file is wanted"
MOST_SAID = 1000
NO = "no"
FULL_DISK = b"\0"
"""How the process that unpacks says that the machine is at fault, before the error's number."""
UNPACK_SECONDS = 20.0
"""Time of a processor."""
UNPACK_MEMORY = 1 << 30
ARCHIVES = (".zip", ".tar", ".tar.gz", ".tgz", ".tar.bz2", ".tar.xz")


class SubmissionError(Exception):
    """A submission that cannot be graded at all: one plain sentence for the student."""

    def __init__(self, text: str) -> None:
        super().__init__(plain(text))  # names in an archive may be no text, or more than text


NOT_READ = (".rar", ".7z", ".gz", ".xz", ".bz2", ".zst")


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
    return path.is_file() and not path.is_symlink() and path.name.lower().endswith(ARCHIVES)


def _check_kind(path: Path) -> None:
    """A folder or a plain file: a link may lead to another's work, and a pipe or device may never end."""
    if path.is_symlink():
        raise SubmissionError(f"{quoted(path.name)} is a link: hand in the file itself")
    if not (path.is_dir() or path.is_file()):
        raise SubmissionError(f"{quoted(path.name)} is neither a folder nor a plain file")


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
        _check_kind(path)
        if path.is_dir():
            return Handed("folder.tar", _tar(path))
        if path.stat().st_size > MOST_BYTES:
            raise SubmissionError(f"it has more than {MOST_BYTES >> 20} MB")
        return Handed(path.name, path.read_bytes())
    except SubmissionError as error:
        return Handed(path.name, b"", str(error))
    except OSError as error:
        return Handed(path.name, b"", f"it cannot be read: {shown(str(error), 200)}")


def _tar(folder: Path) -> bytes:
    whole, total, seen = io.BytesIO(), 0, _Seen()
    with tarfile.open(fileobj=whole, mode="w") as archive:
        for entry in _in_folder(folder):
            seen.add(entry.name)
            if entry.open is None:
                continue
            total += entry.size
            if total > MOST_BYTES:
                raise SubmissionError(TOO_LARGE)
            info = tarfile.TarInfo(entry.name)
            info.size, info.mode = entry.size, 0o755 if entry.executable else 0o644
            archive.addfile(info, entry.open)
    return whole.getvalue()


def may_have_pictures(path: Path, task: str) -> bool:
    """Whether it may hold pictures, by the names of its files; also where only unpacking would tell."""
    inside = f"/{PICTURES}/{task}/"
    try:
        _check_kind(path)
        if path.is_dir():
            return any(inside in f"/{found.path}" for found in folders.walk(path))
        if path.name.lower().endswith(".zip"):
            with folders.temporary("raycheck-look-") as place:
                return _apart(path, place, None, partial(_names_it, inside)) != NO
        return is_archive(path)
    except (SubmissionError, folders.TooDeep, OSError):  # who opens it says so
        return False


def _names_it(inside: str, file: IO[bytes], name: str, folder: Path) -> None:
    with zipfile.ZipFile(file) as archive:
        if not any(inside in f"/{one}" for one in archive.namelist()):
            raise SubmissionError(NO)


def open_submission(path: Path, into: Path, user: int | None = None) -> Submission:
    """Copy or unpack into the empty folder `into`, and read the manifest; or SubmissionError. As root an
    archive is unpacked as `user`.
    """
    try:
        _check_kind(path)
        if path.is_dir():
            _take(_in_folder(path), into)
        elif problem := _apart(path, into, user, _unpack):
            raise SubmissionError(problem)
    except OSError as error:
        _check_machine(error)
        raise SubmissionError(f"it cannot be read: {shown(str(error), 200)}") from None
    return _manifest(_root(into))


FULL = {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO, errno.ENFILE}
"""What is wrong with the machine on which a submission is opened, and never with the submission."""


def _check_machine(error: OSError) -> None:
    if error.errno in FULL:
        raise error


def _no_archive(name: str) -> SubmissionError:
    if name.lower().endswith(NOT_READ):
        return SubmissionError(f"{quoted(name)} is an archive that is not read here: hand in a zip or tar")
    return SubmissionError(f"{quoted(name)} is neither a folder nor an archive (zip, tar)")


def _apart(
    path: Path, into: Path, user: int | None, work: Callable[[IO[bytes], str, Path], None]
) -> str:  # fmt: skip
    """What is wrong with an archive, by the SubmissionError of `work`, which a process apart does: it may
    fail alone, whatever the archive makes its readers do.
    """
    codecs.lookup("cp437")  # zip's, which is not found any more after that
    with path.open("rb") as file:
        if user is not None:
            os.chown(into, user, user)

        def answer(name: bytes, folder: Path) -> bytes:
            try:
                work(file, os.fsdecode(name), folder)
            except SubmissionError as error:
                said = str(error)
            except MemoryError:
                said = f"to unpack it takes too much: more than {UNPACK_MEMORY >> 20} MB of memory"
            except Exception as error:
                if isinstance(error, OSError) and error.errno in FULL:
                    return b"%s%d" % (FULL_DISK, error.errno)
                said = f"it cannot be unpacked: {shown(str(error), 200)}"
            else:
                return b""
            return said.encode(errors="replace")[:MOST_SAID]

        try:
            with Apart(
                answer, into, user, seconds=UNPACK_SECONDS, memory=UNPACK_MEMORY, file_bytes=MOST_BYTES,
                kept=(file.fileno(),),
            ) as apart:  # fmt: skip
                said = apart.ask(os.fsencode(path.name), MOST_SAID)
        except Broken as why:
            return f"to unpack it takes too much: it {why}"
    if said.startswith(FULL_DISK):
        number = int(said.removeprefix(FULL_DISK))
        raise OSError(number, os.strerror(number), str(into))
    return said.decode(errors="replace")


def _unpack(file: IO[bytes], name: str, into: Path) -> None:
    if zipfile.is_zipfile(file):
        with zipfile.ZipFile(file) as archive:
            _take(_in_zip(archive), into)
        return
    file.seek(0)
    try:
        tar = tarfile.open(fileobj=file)  # noqa: SIM115
    except tarfile.ReadError:
        raise _no_archive(name) from None
    with tar:
        _take(_in_tar(tar), into)


@dataclass(frozen=True)
class _Entry:
    name: str
    size: int = 0
    executable: bool = False
    open: IO[bytes] | None = None
    """None of a folder."""


def _in_folder(path: Path) -> Iterator[_Entry]:
    try:
        for found in folders.walk(path):
            if found.is_link:
                raise SubmissionError(f"{quoted(found.path)} is a link: hand in the file itself")
            if found.is_folder:
                yield _Entry(found.path)
            elif not found.is_file:
                raise SubmissionError(f"{quoted(found.path)} is not a plain file")
            else:
                with os.fdopen(found.open(), "rb") as opened:
                    executable = bool(found.status.st_mode & 0o100)
                    yield _Entry(found.path, found.status.st_size, executable, opened)
    except folders.TooDeep as error:
        raise SubmissionError(str(error)) from None


def _in_zip(archive: zipfile.ZipFile) -> Iterator[_Entry]:
    for info in archive.infolist():
        mode = info.external_attr >> 16
        if stat.S_ISLNK(mode):
            raise SubmissionError(f"{quoted(info.filename)} is a link: hand in the file itself")
        if info.is_dir():
            yield _Entry(info.filename)
            continue
        with _reading(partial(archive.open, info), info.filename) as opened:
            yield _Entry(info.filename, info.file_size, bool(mode & 0o100), opened)


def _in_tar(archive: tarfile.TarFile) -> Iterator[_Entry]:
    for info in archive:
        if not info.isdir() and not info.isfile():
            raise SubmissionError(f"{quoted(info.name)} is a link or a device: hand in plain files")
        if info.isdir():
            yield _Entry(info.name)
            continue
        with _reading(partial(archive.extractfile, info), info.name) as opened:
            yield _Entry(info.name, info.size, bool(info.mode & 0o100), opened)


def _reading(opener: Callable[[], Any], name: str) -> IO[bytes]:
    try:
        opened: IO[bytes] = opener()
        return opened
    except Exception as error:
        raise SubmissionError(f"{quoted(name)} cannot be unpacked: {shown(str(error), 200)}") from None


class _Seen:
    """The names of a submission's files and folders, those between included, within the limits."""

    def __init__(self) -> None:
        self.names: set[PurePosixPath] = set()

    def add(self, name: str) -> PurePosixPath:
        """The name below the folder; SubmissionError if it leads elsewhere, or is one too many."""
        path = PurePosixPath(name.replace("\\", "/"))
        if path.is_absolute() or ".." in path.parts or ":" in name or "\0" in name:
            raise SubmissionError(f"the name {shown(name)} leads out of the submission or is none")
        if len(path.parts) > MOST_DEPTH:
            raise SubmissionError(f"folders are nested more than {MOST_DEPTH} deep")
        if any(len(os.fsencode(one)) > MOST_NAME for one in path.parts) or len(os.fsencode(path)) > MOST_PATH:
            raise SubmissionError(f"the name {shown(name)} is longer than {MOST_NAME} bytes")
        self.names |= {path, *path.parents}
        if len(self.names) > MOST_ENTRIES:
            raise SubmissionError(TOO_MANY)
        return path


def _take(entries: Iterator[_Entry], into: Path) -> None:
    files = total = 0
    seen = _Seen()
    for entry in entries:
        path = seen.add(entry.name)
        if entry.open is None:
            if path.name == MANIFEST:
                raise SubmissionError(NO_FILE)
            continue
        if not path.parts:
            raise SubmissionError("a file in it has no name")
        files += 1
        total += _copy(entry.open, entry.executable, into / path, MOST_BYTES - total)
    if not files:
        raise SubmissionError("it holds no files")


def _copy(source: IO[bytes], executable: bool, target: Path, room: int) -> int:
    """Bytes written: counted as they come, whatever the archive says of the size."""
    target.parent.mkdir(parents=True, exist_ok=True)
    written = 0
    with target.open("xb") as file:
        while block := source.read(1 << 20):
            written += len(block)
            if written > room:
                raise SubmissionError(TOO_LARGE)
            file.write(block)
    target.chmod(0o755 if executable else 0o644)
    return written


def _root(folder: Path) -> Path:
    """Archives often hold one folder that holds all the rest."""
    while not (folder / MANIFEST).exists():
        inside = [p for p in folder.iterdir() if p.name not in ("__MACOSX", ".DS_Store")]
        if len(inside) != 1 or not inside[0].is_dir() or inside[0].name == PICTURES:
            return folder
        folder = inside[0]
    return folder


def _manifest(folder: Path) -> Submission:
    path = folder / MANIFEST
    if path.is_dir():
        raise SubmissionError(NO_FILE)
    if not path.exists():
        return Submission(folder)
    try:
        return Submission(folder, read_manifest(path), has_manifest=True)
    except NotFound as error:
        raise SubmissionError(str(error)) from None
