"""What a specialised instance leaves out is not executed: instructions counted by valgrind, which no load of
the machine disturbs."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from building import kernels

MOST = 0.8
"""Of the generic kernel's instructions, in the Cornell box at depth 8."""


def instructions(oneray: Path, scene: Path, folder: Path, kernel: str, spp: int) -> int:
    """Instructions of a render at 4 lanes in double, a width that valgrind knows."""
    render = [oneray, scene, "--precision", "double", "--lanes", "4", "--kernel", kernel, "--spp", str(spp)]
    command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={folder / 'out'}"]
    done = subprocess.run(
        [*command, *render, "--quiet", "-o", folder / "out.exr"], capture_output=True, text=True, check=True
    )
    found = re.search(r"Collected : (\d+)", done.stderr)
    assert found, done.stderr
    return int(found.group(1))


def test_the_specialised_kernel_executes_fewer_instructions(oneray: Path, scene, tmp_path: Path) -> None:
    if ("double", 4) not in kernels(oneray) or not shutil.which("valgrind"):
        pytest.skip("no kernel of 4 lanes, or no valgrind, here")
    cost = {
        kernel: instructions(oneray, scene("cornell-box"), tmp_path, kernel, 9)
        - instructions(oneray, scene("cornell-box"), tmp_path, kernel, 1)
        for kernel in ("auto", "generic")
    }
    assert cost["auto"] <= MOST * cost["generic"]
