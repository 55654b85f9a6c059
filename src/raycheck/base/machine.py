"""This machine and this raycheck, as a result names them."""

import datetime
import os
import platform
from pathlib import Path


def raycheck_version() -> str:
    from importlib.metadata import PackageNotFoundError, version  # takes a tenth of a command's start

    try:
        return version("raycheck")
    except PackageNotFoundError:
        return "not installed"


def machine() -> str:
    """The processor, its cores and the system, on a line."""
    name = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.is_file():
        models = [
            x.split(":", 1)[1].strip() for x in info.read_text().splitlines() if x.startswith("model name")
        ]
        name = models[0] if models else name
    system = f"{platform.system()} {platform.machine()}, Python {platform.python_version()}"
    return f"{name}, {os.cpu_count()} cores, {system}"


def cores() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def today() -> str:
    """The day, by UTC: "2026-01-31"."""
    return datetime.datetime.now(datetime.UTC).date().isoformat()
