"""manifest.json of a folder of references: how each of them was made."""

import functools
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from raycheck.base import data


def read_manifest(folder: Path | None = None) -> dict[str, Any]:
    """manifest.json of a folder of references (the package's by default), empty if there is none yet."""
    path = (folder or data.references_dir()) / "manifest.json"
    if not path.is_file():
        return {}
    found = path.stat()
    return dict(_parsed(path, (found.st_mtime_ns, found.st_size, found.st_ino)))


@functools.lru_cache(maxsize=8)
def _parsed(path: Path, version: tuple[int, ...]) -> dict[str, Any]:
    """A manifest of that time, size and number: thousands of lines that each scene asks for."""
    del version
    result: dict[str, Any] = json.loads(path.read_text())
    return result


def dump_manifest(manifest: Mapping[str, Any]) -> str:
    """JSON with one line for each table of skewness, so that a changed reference is a small difference."""
    tables = {
        f"@{label}/{size}@": table
        for label, entry in manifest.items()
        for size, table in entry.get("skewness", {}).items()
    }
    slim = {
        label: {**entry, "skewness": {size: f"@{label}/{size}@" for size in entry.get("skewness", {})}}
        for label, entry in manifest.items()
    }
    text = json.dumps(slim, indent=2, ensure_ascii=False)
    for mark, table in tables.items():
        text = text.replace(json.dumps(mark, ensure_ascii=False), json.dumps(table, separators=(",", ":")))
    return text + "\n"
