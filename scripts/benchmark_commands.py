"""What raycheck's commands cost before they do anything: to say a version, a help, or what is wrong."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile

from benchmark_measure import spread

from raycheck.commands.app import COMMANDS

WORDS = (
    ("--version",), ("--help",), *((command, "--help") for command in COMMANDS),
    ("verify", "nowhere"), ("verify", "point-light", "--technique", "nowhere"), ("grade",), ("nowhere",),
)  # fmt: skip


def measure_commands(rounds: int) -> list[dict]:
    """The processor seconds of each, of the process and what it starts, over the rounds; not of the first
    time, when Python compiles what it keeps.
    """
    seconds: dict[tuple[str, ...], list[float]] = {words: [] for words in WORDS}
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    with tempfile.TemporaryDirectory() as kept:
        environment["PYTHONPYCACHEPREFIX"] = kept
        for measured in (False, *(True for _ in range(rounds))):
            for words, found in seconds.items():
                before, command = _spent(), [sys.executable, "-m", "raycheck", *words]
                subprocess.run(command, capture_output=True, check=False, env=environment)
                found += [_spent() - before] * measured
    return [{"words": " ".join(words), "seconds": spread(found)} for words, found in seconds.items()]


def _spent() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
