"""Numbers for people."""

import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np


def percent(value: float) -> str:
    """Two or three digits: "12 %", "0.31 %", "0.004 %"."""
    size = abs(value) * 100
    if not math.isfinite(size):
        return "∞ %"
    digits = 0 if size >= 20 else 1 if size >= 2 else 2 if size >= 0.1 else 3
    return f"{size:.{digits}f} %"


def signed(value: float) -> str:
    return ("+" if value >= 0 else "−") + percent(value)


def one_line(text: str) -> str:
    """Control characters, and bytes of a file's name that are no text, as escapes."""
    return re.sub(r"[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]", lambda found: repr(found[0])[1:-1], text)


def last_words(said: str) -> str:
    """The last three lines of what a program said, as the end of a sentence; empty if it said nothing."""
    lines = [line.strip()[:300] for line in said.splitlines() if line.strip()]
    return "; it said: " + " | ".join(lines[-3:]) if lines else ""


def duration(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.1f} s" if seconds < 10 else f"{seconds:.0f} s"
    if seconds < 5400:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"


def number(value: float) -> str:
    """Three digits: "0.0123", "1.00", "45.6", "1,230"."""
    if value == 0 or not np.isfinite(value):
        return "0" if value == 0 else "∞"
    decimals = int(max(0, 2 - np.floor(np.log10(abs(value)) + 1e-12)))
    if value >= 1000:
        return f"{float(f'{value:.3g}'):,.0f}"
    return f"{value:.{min(decimals, 8)}f}"


def rounded(value: object) -> object:
    """Every number in dictionaries and lists to four digits."""
    if isinstance(value, float):
        return float(f"{value:.4g}")
    if isinstance(value, dict):
        return {key: rounded(v) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(v) for v in value]
    return value


def scenes_json(header: Mapping[str, object], key: str, scenes: Iterable[Mapping[str, Any]]) -> str:
    """A header, and scenes, each with its figures and under `key` a row a line: a new measurement is a
    readable difference. All numbers have four digits.
    """
    listed = []
    for scene in scenes:
        head, rows = {k: v for k, v in scene.items() if k != key}, scene[key]
        text, *lines = (json.dumps(rounded(x), ensure_ascii=False, allow_nan=False) for x in (head, *rows))
        listed.append(f'{text[:-1]}, "{key}": [\n   ' + ",\n   ".join(lines) + "]}")
    top = json.dumps(dict(header), indent=1, ensure_ascii=False).removesuffix("\n}")
    return f'{top},\n "scenes": [\n  ' + ",\n  ".join(listed) + "\n ]\n}\n"
