"""Disks that are full."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest


def on_a_full_disk(
    folder: Path, words: Sequence[object], size: str = "64k"
) -> subprocess.CompletedProcess[str]:
    """Runs a command for which `folder` is an empty file system of that size, in a name space of its own.
    What is left in the folder is said on standard error behind what the command says.
    """
    mounted = ["unshare", "-rm", "sh", "-c", f'mount -t tmpfs -o size={size} none "$0" || exit 125; "$@"; '
               'status=$?; ls -A "$0" >&2; exit $status', folder]  # fmt: skip
    done = subprocess.run([*map(str, mounted), *map(str, words)], capture_output=True, text=True)
    if done.returncode == 125 or "unshare failed" in done.stderr:
        pytest.skip(f"no file systems can be mounted here: {done.stderr}")
    return done
