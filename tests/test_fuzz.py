"""A few seconds of what `make fuzz` does for hours: broken scenes and meshes under the sanitizers."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest
from building import ROOT

SECONDS = 2
SEEDS = [ROOT / "tests/malformed", ROOT / "tests/meshes", ROOT / "scenes"]


@pytest.fixture(scope="module")
def fuzzers(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fuzz")
    subprocess.run(["make", "-C", ROOT, f"BUILD={folder}", "fuzzers"], check=True, capture_output=True)
    return folder / "fuzz"


@pytest.mark.parametrize("name", ["scene", "ply", "obj", "serialized"])
def test_reader(fuzzers: Path, tmp_path: Path, name: str) -> None:
    """No input makes it crash, hang, leak or compute what C does not define."""
    seeds = [ROOT / "tests/fuzz" / name, *SEEDS]
    command = [fuzzers / name, f"-max_total_time={SECONDS}", "-seed=1", "-timeout=10", "-close_fd_mask=1"]
    done = subprocess.run(
        [*command, "-print_final_stats=1", f"-artifact_prefix={tmp_path}/", tmp_path, *seeds],
        capture_output=True, text=True, errors="replace", check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-4000:]
    executed = int(re.search(r"number_of_executed_units: (\d+)", done.stderr).group(1))
    assert executed > sum(len(list(folder.rglob("*.*"))) for folder in seeds)
