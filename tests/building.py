"""Building oneray in other ways than the one under build/: other compilers, sanitizers, broken copies."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def build(target: Path, source: Path = ROOT, goal: str = "all", **variables: str) -> Path:
    """Runs `make` in `source` into the folder `target`; returns the program. Warnings are errors. The goal
    `kinds` is the headers alone that the build writes.
    """
    given = {"BUILD": str(target), "WERROR": "1", **variables}
    settings = [f"{name}={value}" for name, value in given.items()]
    environment = {k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MAKELEVEL", "MFLAGS")}
    done = subprocess.run(
        ["make", "-C", str(source), *settings, goal],
        capture_output=True,
        text=True,
        env=environment,
        check=False,
    )
    assert done.returncode == 0, f"make {' '.join(settings)}:\n{done.stderr[-3000:]}"
    return target / "oneray"


def kernels(oneray: Path) -> list[tuple[str, int]]:
    """The kernels that the program has and this processor runs: (precision, lanes)."""
    text = subprocess.run([oneray, "--help"], check=True, capture_output=True, text=True).stdout
    line = next(line for line in text.splitlines() if line.startswith("kernels that run here:"))
    found = re.findall(r"(double|single) x ([\d, ]+)", line)
    return [(precision, int(lanes)) for precision, widths in found for lanes in widths.split(", ")]


def cpu_seconds(pid: int) -> float:
    """The processor time that a running process has had, which a busy machine does not lengthen."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return sum(map(int, fields[11:13])) / os.sysconf("SC_CLK_TCK")
