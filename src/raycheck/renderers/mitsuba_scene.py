"""A scene file, loaded by Mitsuba in this process."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any


def load_scene(path: Path | str, parameters: Mapping[str, str]) -> Any:
    """Mitsuba's scene; RuntimeError, Mitsuba's own, where it cannot load it.

    Two threads load it, whatever number renders: a pool of one, as on a machine with one core, waits for
    itself, and for ever, where an OpenEXR file is read (Mitsuba 3.9.1).
    """
    import drjit as dr
    import mitsuba as mi

    threads = dr.thread_count()
    dr.set_thread_count(max(threads, 2))
    try:
        return mi.load_file(str(path), **dict[str, Any](parameters))
    finally:
        dr.set_thread_count(threads)
