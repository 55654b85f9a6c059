"""Gradings and calibrations that are split: the same results by any pool, whatever is lost on the way."""

from __future__ import annotations

import contextlib
import json
import os
import platform
import signal
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from building import ROOT
from cluster import running
from typer.testing import CliRunner

from raycheck.base.errors import Lost, NotFound
from raycheck.calibration import checkout, gradings, kills, mutants, nulls
from raycheck.calibration.checkout import Checkout
from raycheck.commands.app import app
from raycheck.grading import course, hidden, noise, one_submission
from raycheck.grading.assignment import read_assignment
from raycheck.grading.jail.sandbox import Tier
from raycheck.grading.judge import Grader
from raycheck.grading.submission import Handed
from raycheck.renderers import pools
from raycheck.renderers.bundle import bundle_oneray
from raycheck.scene import variants
from raycheck.stats import spread
from raycheck.truth.making import Goal

TASKS = """\
name = "split"
delta = 0.05
[[task]]
id = "L1"
scenes = ["point-light"]
points = 4
spp = 4
hidden = 1
technique = "nee"
noise_points = 1
"""
linux = pytest.mark.skipif(sys.platform != "linux", reason="grading needs Linux")


@pytest.fixture(autouse=True)
def this_oneray(oneray: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ONERAY", str(oneray))


class Class:
    """Submissions that call oneray, of which "slow" waits the first time that it is built and leaves the
    process id of its shell in the file "waits", and "kills" kills whatever grades it.
    """

    def __init__(self, folder: Path, oneray: Path) -> None:
        self.folder = folder
        (folder / "a.toml").write_text(TASKS, encoding="utf-8")
        (folder / "wait.sh").write_text(
            f"mkdir {folder}/once 2>/dev/null || exit 0\necho $$ > {folder}/new && mv {folder}/new "
            f"{folder}/waits\nexec sleep 100\n"
        )
        right = f"{oneray} {{scene}} -o {{output}} --spp {{spp}} --seed {{seed}} --quiet"
        self.hand_in("slow", f"sh {folder}/wait.sh", right)
        self.hand_in("kills", f"echo >> {folder}/killed; kill -9 $PPID", right)
        self.hand_in("shown-only", "", right.replace("{scene}", f"{ROOT}/scenes/point-light.xml"))

    def hand_in(self, student: str, build: str, run: str) -> None:
        folder = self.folder / "class" / student
        folder.mkdir(parents=True)
        (folder / "raycheck.toml").write_text(f'build = "{build}"\nrun = "{run}"\n', encoding="utf-8")

    @property
    def kills(self) -> int:
        return len((self.folder / "killed").read_text().splitlines())

    def grade(self, out: str, *options: str) -> dict[str, dict]:
        """Results by student, without the seconds."""
        words = ["grade", "--assignment", str(self.folder / "a.toml"), "--class", str(self.folder / "class")]
        words += ["--no-sandbox", "--out", str(self.folder / out), *options]
        done = CliRunner().invoke(app, words)
        assert done.exit_code == 3, done.output  # points are open
        found = {}
        for path in (self.folder / out).glob("students/*/result.json"):
            result = json.loads(path.read_text(encoding="utf-8"), object_hook=untimed)
            found[result["student"]] = result
        return found


def untimed(values: dict) -> dict:
    return {key: value for key, value in values.items() if key != "seconds"}


@pytest.fixture(scope="module")
def some_class(tmp_path_factory: pytest.TempPathFactory, oneray: Path) -> Class:
    with pytest.MonkeyPatch.context() as patch:
        goal = Goal(small_batches=128, min_batches=16, most_seconds=1.0)
        patch.setattr(hidden, "GOAL", goal)
        patch.setenv("ONERAY", str(oneray))
        made = Class(tmp_path_factory.mktemp("split"), oneray)
        Grader.prepare(read_assignment(made.folder / "a.toml"), Tier.NONE)
    return made


@pytest.fixture(scope="module")
def by_one(some_class: Class) -> dict[str, dict]:
    (some_class.folder / "once").mkdir()
    return some_class.grade("one", "--jobs", "1")


class Nobody:
    """A pool that loses every piece."""

    def __init__(self) -> None:
        self.students: list[str] = []

    def run(
        self, work: pools.Work, pieces: pools.Pieces, on_lost: pools.OnLost | None = None
    ) -> Iterator[tuple[int, bytes]]:
        for index, (_, _, student, *_) in enumerate(pieces):
            self.students.append(student)
            yield index, on_lost(index, Lost("nobody is there"))


@linux
def test_a_killed_process_loses_its_own_submission_alone(some_class: Class, by_one: dict[str, dict]) -> None:
    """The killed one's points are open; a second run keeps the others' results."""
    assert {student: (one["total"], one["pending"]) for student, one in by_one.items()} == {
        "slow": (5, 0), "shown-only": (0, 5), "kills": (0, 5),
    }  # fmt: skip
    assert "SIGKILL" in by_one["kills"]["problem"] and some_class.kills >= pools.ATTEMPTS
    assert by_one["slow"]["tasks"][0]["scenes"][1]["hidden"]
    grader = Grader.prepare(read_assignment(some_class.folder / "a.toml"), Tier.NONE)
    found, asked = course.entries(some_class.folder / "class", []), Nobody()
    course.grade_class(grader, found, some_class.folder / "one", asked, lambda _: None)
    assert asked.students == ["kills"]


@linux
def test_a_cluster_that_loses_a_worker_grades_the_same(some_class: Class, by_one: dict[str, dict]) -> None:
    """A worker is killed while it grades; another grades its submission."""
    folder = some_class.folder
    (folder / "once").rmdir()
    killed: list[int] = []
    kills_before = some_class.kills

    def kill_the_worker() -> None:
        while not (folder / "waits").exists():
            time.sleep(0.05)
        killed.extend(above(int((folder / "waits").read_text())))
        os.kill(killed[-1], signal.SIGKILL)

    threading.Thread(target=kill_the_worker, daemon=True).start()
    try:
        with running(folder, workers=2) as address:
            assert some_class.grade("many", "--dask", address) == by_one
        assert killed and some_class.kills == kills_before + pools.ATTEMPTS
    finally:
        for pid in killed[:-1]:  # what the worker has started
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)


def above(pid: int) -> list[int]:
    """The process and those that it comes from, up to the Dask worker."""
    found = [pid]
    while b"dask" not in Path(f"/proc/{found[-1]}/cmdline").read_bytes().split(b"\0"):
        status = Path(f"/proc/{found[-1]}/stat").read_text().rpartition(")")[2].split()
        found.append(int(status[1]))
    return found


@linux
def test_the_noise_of_oneray_is_measured_once(some_class: Class, tmp_path, monkeypatch) -> None:
    """What it depends on decides; a bundle of the same oneray, as in a package, is the same."""
    private = some_class.folder / "a.private"
    assert len(json.loads((private / noise.KEPT).read_text(encoding="utf-8"))) == 2  # shown and hidden
    of = variants.variant("point-light")
    monkeypatch.setattr(noise, "IMAGES", spread.GROUPS + 1)
    found = [noise.of_oneray(of, 4, "nee", tmp_path)]
    monkeypatch.setenv("ONERAY", str(bundle_oneray(tmp_path / "bundle")))
    monkeypatch.setattr(noise, "oneray_command", None)
    found.append(noise.of_oneray(of, 4, "nee", tmp_path))
    assert found[0] == found[1]
    for other in ((of, 5, "nee"), (of, 4, "mis-power"), (variants.variant("area-light"), 4, "nee")):
        with pytest.raises(TypeError):  # it would be measured
            noise.of_oneray(*other, tmp_path)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (Checkout(raycheck="0" * 64), "another build of raycheck"),
        (Checkout(oneray="0" * 64), "another build of oneray"),
        (Checkout(sources="oneray-0"), "other sources of oneray"),
    ],
)
def test_machines_that_differ_are_refused(build: Checkout, message: str) -> None:
    """By every kind of piece, before it does anything; grading needs no sources."""
    for work in (
        lambda: one_submission.grade(b"", Handed("a.zip", b""), "a", 0, Tier.NONE, build),
        lambda: nulls.one_set(nulls.CONFIGURATIONS[0], 0, build),
        lambda: kills.one_mutant("brdf-2pi", "", build),
        lambda: gradings.one_grading(b"", 0, "", build),
    )[bool(build.sources) :]:
        with pytest.raises(NotFound, match=message):
            work()


def test_another_patch_is_refused() -> None:
    with pytest.raises(NotFound, match=r"brdf-2pi\.patch on .* is another patch"):
        kills.one_mutant("brdf-2pi", "brdf-2pi-0", checkout.of_checkout())


def test_a_machine_without_a_checkout_says_so(tmp_path, monkeypatch) -> None:
    wanted = checkout.of_checkout()
    monkeypatch.setattr(mutants, "ROOT", tmp_path)
    mutants._digest.cache_clear()
    with pytest.raises(NotFound, match=f"{platform.node()}: .* needs a checkout"):
        checkout.require(wanted)
    monkeypatch.undo()
    checkout.require(wanted)


@pytest.mark.parametrize("command", ["grade --assignment a.toml", "calibrate nulls"])
def test_jobs_and_a_cluster_are_one_too_many(command: str, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.toml").write_text(TASKS, encoding="utf-8")
    words = [*command.split(), "--jobs", "2", "--dask", "tcp://localhost:1"]
    words += ["--class", "."] if "grade" in words else ["--work", "work", "--json", "a.json"]
    (tmp_path / "student").mkdir()
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 2 and "give one of them" in done.output


def test_nulls_and_gradings_are_the_same_by_two_processes(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(TASKS.partition("hidden")[0], encoding="utf-8")
    asked = gradings.quick(read_assignment(tmp_path / "a.toml"))
    found = []
    grader = Grader.prepare(asked, Tier.NONE)
    for pool in (None, pools.Here(2)):
        sets, honest = tmp_path / f"{len(found)}-nulls.jsonl", tmp_path / f"{len(found)}-gradings.jsonl"
        assert len(list(nulls.measure_nulls(sets, 2, nulls.CONFIGURATIONS[3:4], pool))) == 2
        assert len(list(gradings.measure(honest, grader, 2, pool))) == 2
        found.append((nulls.summary(sets), gradings.summary(honest, asked)))
    assert json.dumps(found[0]) == json.dumps(found[1])
    for file, summary in (
        (sets, nulls.summary), (honest, lambda path: gradings.summary(path, asked)),
    ):  # fmt: skip
        first, second = file.read_text(encoding="utf-8").splitlines()
        second = second.replace("PASS", "FAIL").replace('"reasons": []', '"reasons": ["x"]')
        texts = []
        for lines in ((first, second), (second, first)):
            file.write_text("\n".join((*lines, "")), encoding="utf-8")
            texts.append(json.dumps(summary(file)))
        assert texts[0] == texts[1] and "FAIL" in texts[0]
