"""Grading where a disk is full: no student pays for it, and nothing private is left half written."""

import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from disks import on_a_full_disk
from gradings import written
from test_hostile import TASKS, place

from raycheck.base.errors import NotFound
from raycheck.base.statuses import Status
from raycheck.grading.keys import read_keys
from raycheck.grading.results import StudentResult

__all__ = ["place"]


def graded(place: Path, what: str, size: str) -> subprocess.CompletedProcess[str]:
    """A class of one, whose build copies 400 kB, where the results ("out") or all that is temporary ("tmp")
    are on a disk of that size.
    """
    (place / "class/one").mkdir(parents=True)
    written(place / "class/one/raycheck.toml", 'build = "cp big copy"\ncommand = "cat copy {output}"')
    (place / "class/one/big").write_bytes(bytes(400_000))
    (disk := place / "disk").mkdir()
    (temporary := place / "tmp").mkdir()
    words = [sys.executable, "-m", "raycheck", "grade", "--no-sandbox", "--class", place / "class"]
    words += ["--assignment", written(place / "a.toml", TASKS), "--jobs", "1"]
    words += ["--out", (disk if what == "out" else place) / "o"]
    done = on_a_full_disk(disk, ["env", f"TMPDIR={disk if what == 'tmp' else temporary}", *words], size)
    assert "Traceback" not in done.stderr, done.stderr
    return done


@pytest.mark.parametrize("size", ["40k", "500k", "1200k"])
def test_a_full_disk_costs_no_student_points(place: Path, size: str) -> None:
    """While the grader unpacks what it needs, while it opens the submission, and while that is built."""
    done = graded(place, "tmp", size)
    assert done.returncode == Status.INCONCLUSIVE, done.stdout
    [file] = (place / "o/students").glob("*/result.json")
    found = StudentResult.read(file)
    assert found.pending == found.most and not found.total, found.problem
    assert "No space left on device" in found.problem


def test_a_full_disk_where_results_go_is_one_line(place: Path) -> None:
    done = graded(place, "out", "8k")
    *_, line, left = done.stderr.splitlines()
    assert done.returncode == Status.COULD_NOT_RUN and line.endswith(": No space left on device")
    assert left == "o"


def test_no_secret_is_kept_that_a_full_disk_cut_short(place: Path) -> None:
    """It would be empty, and every hidden scene to be guessed."""
    (disk := place / "disk").mkdir()
    code = f"from raycheck.grading.keys import *; read_keys(Path({str(disk / 'a.toml')!r}), 'a')"
    fill, make = f"head -c 100k /dev/zero >{disk}/big", f"{sys.executable} -c {shlex.quote(code)}"
    words = f"{fill}; {make}; ls {disk}/a.private >&2"
    said = on_a_full_disk(disk, ["sh", "-c", words], "8k").stderr
    assert "No space left on device" in said and "secret" not in said.splitlines()
    (place / "b.private").mkdir()
    for text in ("", "abc", "g" * 64):
        written(place / "b.private/secret", text)
        with pytest.raises(NotFound, match="put back the secret"):
            read_keys(place / "b.toml", "b")
