"""Results as lines of JSON, each written as it comes: an interrupted run goes on from what is there."""

import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any


def read_lines(file: Path) -> list[dict[str, Any]]:
    """None if there is no file. A last line that was cut off is left out."""
    if not file.is_file():
        return []
    lines = file.read_text(encoding="utf-8").split("\n")
    return [json.loads(line) for line in lines[:-1]]


def append_lines(file: Path, values: Iterable[Mapping[str, Any]]) -> None:
    """Add lines to a file, in place of a last one that was cut off."""
    there = file.read_bytes() if file.is_file() else b""
    if not there.endswith(b"\n") and there:
        os.truncate(file, there.rfind(b"\n") + 1)
    with file.open("a", encoding="utf-8") as lines:
        lines.writelines(json.dumps(one) + "\n" for one in values)
        lines.flush()
        os.fsync(lines.fileno())
