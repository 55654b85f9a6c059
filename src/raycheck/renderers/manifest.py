"""raycheck.toml, what a renderer says of itself: its command, what it supports, and its limits.

One schema for `raycheck verify`, which runs the command as it is, and for submissions, which run in a jail.
"""

import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from raycheck.base.errors import NotFound
from raycheck.base.text import nearest, shown
from raycheck.renderers.commands import Command
from raycheck.scene.support import Support

MANIFEST = "raycheck.toml"
MOST_BYTES = 1 << 16


@dataclass(frozen=True)
class OwnLimits:
    """What a renderer wants no more of than this, whoever runs it."""

    picture_seconds: float | None = None
    """How long one picture may take."""
    jobs: int | None = None
    """Pictures at a time."""


@dataclass(frozen=True)
class Manifest:
    command: str = ""
    build: str | None = None
    """Empty: nothing is to be built; None: it is not said."""
    needs: Support | None = None
    """What of scenes it supports; None: all."""
    limits: OwnLimits = field(default_factory=OwnLimits)


KEYS = ("command", "needs", "limits", "build")
OLDER = "run"
"""The command's name in files of earlier versions."""


def read_manifest(path: Path) -> Manifest:
    """NotFound, by the file's name alone, with the key and what would be right."""
    try:
        if path.stat().st_size > MOST_BYTES:
            raise NotFound(f"{MANIFEST} has more than {MOST_BYTES >> 10} kB")
        return _manifest(tomllib.loads(path.read_text(encoding="utf-8-sig")))
    except OSError as error:
        raise NotFound(f"{path}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise NotFound(f"{MANIFEST} is not TOML: {str(error)[:200]}") from None
    except (ValueError, RecursionError):  # what tomllib and repr leave to Python
        raise NotFound(f"{MANIFEST}: a number has too many digits, or lists and tables are nested") from None


def _manifest(found: dict[str, Any]) -> Manifest:
    if OLDER in found:
        if "command" in found:
            raise NotFound(f"{MANIFEST}: command and {OLDER}, its older name: give one of them")
        found["command"] = found.pop(OLDER)
    for key, value in found.items():
        if key not in KEYS:
            raise NotFound(f"{MANIFEST}: {shown(key)}{nearest(key, KEYS)}; there are {', '.join(KEYS)}")
        if key in ("command", "build") and not isinstance(value, str):
            raise NotFound(f"{MANIFEST}: {key} is {shown(value)}, a string is wanted")
        if isinstance(value, str) and "\0" in value:
            raise NotFound(f"{MANIFEST}: a command with a NUL byte")
    needs = _needs(found["needs"]) if "needs" in found else None
    limits = _limits(found.get("limits", {}))
    return Manifest(found.get("command", ""), found.get("build"), needs, limits)


def _needs(value: Any) -> Support:
    if not (isinstance(value, list) and all(isinstance(word, str) for word in value)):
        wanted = 'a list such as ["rectangle", "sphere"] is wanted'
        raise NotFound(f"{MANIFEST}: needs is {shown(value)}, {wanted}")
    return Support.of(value, f"{MANIFEST}: needs")


def _limits(table: Any) -> OwnLimits:
    if not isinstance(table, Mapping):
        raise NotFound(f"{MANIFEST}: limits is {shown(table)}, a table [limits] is wanted")
    known = [one.name for one in fields(OwnLimits)]
    for key, value in table.items():
        where = f"{MANIFEST}: [limits]: {key[:40]}"
        if key not in known:
            raise NotFound(f"{where}{nearest(key, known)}; there are {', '.join(known)}")
        wanted = (int,) if key == "jobs" else (int, float)
        if isinstance(value, bool) or not isinstance(value, wanted) or not 0 < value < float("inf"):
            kind = "a whole number" if key == "jobs" else "a number"
            raise NotFound(f"{where} is {shown(value)}, {kind} above 0 is wanted")
    return OwnLimits(**table)


def manifest_of(renderer: str | Path) -> Path | None:
    """The manifest that stands for a renderer: the file, or that of a folder; None where it is a command."""
    path = Path(renderer)
    if str(renderer) and os.path.isdir(renderer):  # noqa: PTH112  Path.is_dir raises at names too long
        path = path / MANIFEST
        if not path.is_file():
            raise NotFound(f"{renderer}: a folder without a {MANIFEST}")
    if path.name != MANIFEST:
        return None
    if not path.is_file():
        raise NotFound(f"{path}: there is no such file")
    return path.resolve()


def manifest_for(renderer: object) -> Manifest:
    """What a renderer says of itself: nothing, where it is no folder with a manifest."""
    path = manifest_of(renderer) if isinstance(renderer, str | Path) else None
    return read_manifest(path) if path else Manifest()


def written_command(renderer: str | Path) -> tuple[str, Path | None]:
    """The command of a manifest as it is written, and the folder that it runs in; or one that is given."""
    path = manifest_of(renderer)
    if path is None:
        return str(renderer), None
    command = read_manifest(path).command
    if not command:
        raise NotFound(f'{path}: there is no command: write command = "… {{output}}"')
    return command, path.parent


def command_of(renderer: str | Path) -> Command:
    """That command, taken apart."""
    return Command.parse(*written_command(renderer))
