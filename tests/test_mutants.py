"""Copies of oneray with one mistake each: raycheck must see every one.

`mutants/NAME.patch` is a patch of the sources under a header: the lecture's technique, the mistake in a
student's words, the symptom, and the scene and technique that show it. It is applied to a copy; the sources
hold no trace of it.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from building import ROOT, build

PATCHES = sorted((ROOT / "tests/mutants").glob("*.patch"))
HEADERS = ("Technique", "Mistake", "Symptom", "Shows")


def header(patch: Path) -> dict[str, str]:
    """The lines above the patch, by name."""
    lines = patch.read_text().split("\n---")[0].splitlines()
    return dict(line.split(": ", 1) for line in lines if ": " in line)


def broken_copy(patch: Path, folder: Path) -> Path:
    """The sources with the patch applied, built as one generic kernel."""
    shutil.copytree(ROOT / "src/oneray", folder / "src/oneray")
    shutil.copy(ROOT / "Makefile", folder)
    subprocess.run(["patch", "-p1", "--fuzz=0", "-i", patch], cwd=folder, check=True, capture_output=True)
    return build(folder / "build", folder, KERNELS="generic", KERNEL_LIST="double:2:0", CFLAGS="-O1")


def verdict(oneray: Path, scene: str, technique: str, folder: Path) -> dict:
    """The case that raycheck makes of this program."""
    command = [sys.executable, "-m", "raycheck", "verify", scene, "--technique", technique, "--spp", "16"]
    environment = os.environ | {"ONERAY": str(oneray)}
    done = subprocess.run(
        [*command, "--json", folder / "out.json"],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode in (0, 1, 3), done.stderr
    (case,) = json.loads((folder / "out.json").read_text())["cases"]
    assert (case["verdict"] == "FAIL") == (done.returncode == 1)
    return case


def test_the_catalogue() -> None:
    """At least the six mistakes that the harness was built for, each with its header."""
    assert len(PATCHES) >= 6
    for patch in PATCHES:
        assert tuple(header(patch)) == HEADERS, patch.name
        assert all(header(patch).values())


@pytest.mark.parametrize("patch", PATCHES, ids=lambda path: path.stem)
def test_is_seen(patch: Path, tmp_path: Path) -> None:
    """The broken copy FAILs where its header says. (The sources as they are do not: see `make test`.)"""
    scene, technique = header(patch)["Shows"].split()
    case = verdict(broken_copy(patch, tmp_path / "copy"), scene, technique, tmp_path)
    assert case["verdict"] == "FAIL", case["reason"]
