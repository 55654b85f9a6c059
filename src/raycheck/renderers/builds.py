"""Which raycheck and which oneray: what several machines do must not depend on which of them does it."""

import functools
import hashlib
import platform
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from raycheck.base import data
from raycheck.base.data import PACKAGE
from raycheck.base.errors import NotFound
from raycheck.renderers.bundle import PROGRAM
from raycheck.renderers.oneray import oneray_path


@dataclass(frozen=True)
class Build:
    """Hashes; an empty one of what does not matter."""

    raycheck: str = ""
    oneray: str = ""


def require(wanted: Build) -> None:
    """NotFound where this machine's are others."""
    if wanted.raycheck and raycheck_hash() != wanted.raycheck:
        _refuse("raycheck", PACKAGE)
    if wanted.oneray and oneray_hash() != wanted.oneray:
        _refuse("oneray", oneray_path())


def _refuse(what: str, path: Path) -> NoReturn:
    raise NotFound(f"{path} on {platform.node()} is another build of {what}: install the same everywhere")


def oneray_hash() -> str:
    """The hash of the program, also where it is started by a bundle's script."""
    oneray = oneray_path()
    inside = oneray.with_name(PROGRAM)
    return hashlib.sha256((inside if inside.is_file() else oneray).read_bytes()).hexdigest()


@functools.cache
def raycheck_hash() -> str:
    """The hash of raycheck's sources, its scenes, and the list of its references."""
    whole = hashlib.sha256()
    for path in _files():
        content = path.read_bytes()
        whole.update(f"{path.name} {len(content)} ".encode() + content)
    return whole.hexdigest()


def _files() -> Iterator[Path]:
    installed = ("scenes", "references", "__pycache__")  # a wheel has the first two in the package
    for path in sorted(PACKAGE.rglob("*")):
        if path.is_file() and not set(path.relative_to(PACKAGE).parts) & set(installed):
            yield path
    yield from sorted(path for path in data.scenes_dir().rglob("*") if path.is_file())
    yield data.references_dir() / "manifest.json"
