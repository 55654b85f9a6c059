"""The jail, what is in it, and what crosses its border."""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from gradings import need, written

from raycheck.base.errors import RenderError
from raycheck.base.images import write_exr, write_pfm
from raycheck.grading import attacks
from raycheck.grading.jail import cgroups, folders, sandbox
from raycheck.grading.jail.limits import Limits
from raycheck.grading.jail.pixels import Decoder, take_picture
from raycheck.grading.jail.sandbox import Jail, Tier


def test_only_a_plain_file_of_the_right_size_crosses_the_border(tmp_path, decoder: Decoder) -> None:
    out, private = tmp_path / "out", tmp_path / "private"
    out.mkdir()
    private.mkdir()
    picture = out / "image.exr"

    def refused(words: str) -> None:
        with pytest.raises(RenderError, match=words):
            take_picture(out, private, 1 << 20, (4, 4), decoder)
        picture.rmdir() if picture.is_dir() else picture.unlink(missing_ok=True)

    refused("was not written")
    picture.symlink_to("/etc/passwd")
    refused("a link")
    os.mkfifo(picture)
    refused("a pipe")
    picture.mkdir()
    refused("a pipe, device or folder")
    write_pfm(picture, np.ones((4, 4, 3)))
    (out / "other").hardlink_to(picture)
    refused("2 hard links")
    with picture.open("wb") as file:
        file.truncate(1 << 30)
    refused("at most 1048576 are read")
    write_pfm(picture, np.ones((4, 8, 3)))
    refused("8×4 pixels, the scene asks for 4×4")
    write_exr(picture, dict.fromkeys("RGB", np.ones((8, 4))))
    refused("4×8 pixels, the scene asks for 4×4")
    write_exr(picture, dict.fromkeys("RGB", np.full((4, 4), 0.5)))
    assert (take_picture(out, private, 1 << 20, (4, 4), decoder).pixels == 0.5).all()


def test_a_decoder_that_did_not_survive_is_replaced(tmp_path, decoder: Decoder) -> None:
    picture = tmp_path / "picture.exr"
    write_exr(picture, dict.fromkeys("RGB", np.full((4, 4), 0.5)))
    decoder.read(picture, (4, 4))
    first = decoder.apart.process.pid
    decoder.read(picture, (4, 4))
    assert decoder.apart.process.pid == first
    os.kill(first, signal.SIGKILL)
    with pytest.raises(RenderError, match="decoding it crashed"):
        decoder.read(picture, (4, 4))
    assert (decoder.read(picture, (4, 4)).pixels == 0.5).all()


TIERS = [tier for tier in Tier if tier is not Tier.NONE]


@pytest.mark.parametrize("tier", TIERS)
def test_a_jail_has_neither_network_nor_files_nor_time_nor_memory_beyond_its_limits(tmp_path, tier) -> None:
    need(tier)
    tmp_path.chmod(0o755)
    for folder in tmp_path.parents:
        if folder.owner() == Path.home().owner() and folder != Path("/tmp"):
            folder.chmod(folder.stat().st_mode | 0o011)
    folder, output = tmp_path / "submission", tmp_path / "out"
    folder.mkdir()
    output.mkdir()
    jail = Jail(tier, Limits(memory_mb=200, processes=16, output_mb=4))

    def run(script: str) -> sandbox.Finished:
        return jail.run(["/bin/sh", "-c", script], seconds=2, folder=folder, writable=False, output=output)

    def problem(script: str) -> str:
        return run(script).problem

    assert problem("exit 0") == ""
    secret = written(tmp_path / "secret", "a secret")
    secret.chmod(0o600 if tier is Tier.USER else 0o644)
    assert problem(f"cat {secret}").startswith("exit status 1")
    assert problem("echo x >/submission/x").startswith("exit status 2")
    assert problem("(setsid sleep 100 &) ; exit 0") == "" and not alive("sleep 100", jail.user)
    big, hanging = (run(script) for script in ("head -c 8000000 /dev/zero > /out/big", "while :; do :; done"))
    assert "SIGXFSZ" in big.problem and not big.late
    assert hanging.problem.startswith("not finished after 2 s") and hanging.late
    (output / "big").unlink()
    swollen = run("tail /dev/zero")
    assert swollen.problem and not swollen.late
    shared = run(f"/usr/bin/python3 -c '{SHARED_MEMORY}'")
    assert "more than 200 MB of memory" in shared.problem and not shared.late
    assert "Cannot fork" in problem("for i in $(seq 40); do sleep 2 & done; wait")
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"/dev/tcp/127.0.0.1/{server.getsockname()[1]}"
        subprocess.run(["bash", "-c", f"exec 3<>{address}"], check=True)
        assert "not implemented" in problem(f"bash -c 'exec 3<>{address}'")  # by the filter of all jails
    if jail.user is not None:  # not even dead ones that nobody has waited for
        assert jail.user not in owners()


SHARED_MEMORY = """\
import mmap
kept = []
for _ in range(999):
    kept.append(mmap.mmap(-1, 1 << 24))
    kept[-1].write(bytes(1 << 24))
"""
"""A program that takes memory which no limit of a single process counts."""


def owners() -> set[int]:
    """Users of all processes, the dead ones included."""
    found = set()
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            found.add(process.stat().st_uid)
    return found


def alive(command: str, user: int | None) -> bool:
    """Does a process of that user run the command? None: of anybody."""
    words = command.replace(" ", "\0").encode() + b"\0"
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if process.joinpath("cmdline").read_bytes() == words and process.stat().st_uid == (
                os.getuid() if user is None else user
            ):
                return True
        except OSError:
            continue
    return False


def test_control_groups_limit_all_processes_together() -> None:
    if sys.platform != "linux" or not cgroups.places():
        pytest.skip("no control group may be made here")
    limited = {name for place in cgroups.places() for name in place.controllers}
    with cgroups.Group(cgroups.places(), 64 << 20, 8) as group:
        door = "; ".join(f"echo 0 >{door}" for door in group.doors)
        forks = f"{door}; for i in $(seq 20); do sleep 1 & done; wait"
        done = subprocess.run(["sh", "-c", forks], capture_output=True, text=True)
        assert ("Cannot fork" in done.stderr) == ("pids" in limited)
        assert not group.swelled
        subprocess.run(["sh", "-c", f"{door}; ulimit -v 1000000; exec tail /dev/zero"], check=False)
        assert group.swelled == ("memory" in limited)
        folders = list(group.folders)
    assert folders and not any(folder.exists() for folder in folders)


PEAKS = ("memory.max_usage_in_bytes", "memory.peak")


@pytest.mark.parametrize("tier", [Tier.BUBBLEWRAP, Tier.LANDLOCK])
def test_a_jail_is_in_its_control_groups(monkeypatch, tier) -> None:
    need(tier)
    with cgroups.Group(cgroups.places(), 1 << 30, 9) as group:
        files = [folder / name for folder in group.folders for name in PEAKS]
        if not any(file.exists() for file in files):
            pytest.skip("no control group may be made here that says how much memory it had")
    peaks = []

    class Spied(cgroups.Group):
        def __exit__(self, *what: object) -> None:
            for name in PEAKS:
                files = [folder / name for folder in self.folders]
                peaks.extend(int(file.read_text()) for file in files if file.exists())
            super().__exit__(*what)

    monkeypatch.setattr(sandbox, "Group", Spied)
    jail = Jail(tier, Limits(memory_mb=100))
    assert not jail.run(["/usr/bin/true"], seconds=5, folder=Path("/usr"), writable=False).problem
    swollen = jail.run(["tail", "/dev/zero"], seconds=5, folder=Path("/usr"), writable=False)
    assert swollen.problem and len(peaks) == 2 and 0 < peaks[0] < 20 << 20 < peaks[1]


def test_the_new_hierarchy_is_used_where_it_is_ours_alone(tmp_path, monkeypatch) -> None:
    """The grader moves out of the way of the groups that it makes; nothing is touched elsewhere."""
    base = tmp_path / "scope"
    base.mkdir()
    members = [([], base)]
    monkeypatch.setattr(cgroups, "_memberships", lambda: members)
    monkeypatch.setattr(cgroups, "_works", lambda place: True)
    places = cgroups.places.__wrapped__
    written(base / "cgroup.type", "domain\n")
    written(base / "cgroup.controllers", "cpu memory pids\n")
    written(base / "cgroup.procs", "")
    assert places() == () and not (base / cgroups.OURS).exists()
    monkeypatch.setattr(cgroups, "_is_ours", lambda folder: folder == base)
    assert places() == (cgroups.Place(base, ("memory", "pids", "cpu"), 2),)
    assert (base / "cgroup.subtree_control").read_text() == "+memory +pids +cpu"
    members[:] = [([], base / cgroups.OURS)]
    monkeypatch.setattr(cgroups, "_is_ours", lambda folder: False)  # its parent was, when it moved
    assert [place.folder for place in places()] == [base]
    members[:] = [([], base)]
    monkeypatch.setattr(cgroups, "_is_ours", lambda folder: True)
    written(base / "cgroup.procs", "0\n")  # of another name space: it cannot be moved
    assert places() == () and (base / cgroups.OURS / "cgroup.procs").read_text() == "0"


def test_what_killed_graders_left_is_swept(tmp_path) -> None:
    dead = subprocess.Popen(["true"])
    dead.wait()
    for pid in (dead.pid, os.getpid()):
        (tmp_path / f"{cgroups.OURS}-{pid}-7").mkdir()
    cgroups._sweep(tmp_path)
    assert [left.name for left in tmp_path.iterdir()] == [f"{cgroups.OURS}-{os.getpid()}-7"]


@pytest.mark.parametrize("tier", [Tier.BUBBLEWRAP, Tier.LANDLOCK])
def test_a_jail_that_is_ended_while_it_is_made_is_dead(tmp_path, tier) -> None:
    need(tier)
    jail = Jail(tier, Limits())
    for number in range(40):
        started = time.perf_counter()
        done = jail.run(["sleep", "61"], seconds=0.005 + 0.0005 * number, folder=Path("/usr"), writable=False)
        assert done.late and time.perf_counter() - started < 30 and not alive("sleep 61", jail.user)


@pytest.mark.skipif(sys.platform != "linux", reason="grading needs Linux")
def test_without_a_jail_the_same_commands_find_the_same_folders(tmp_path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "task").mkdir()
    written(tmp_path / "task/scene.json", "a scene")
    script = written(tmp_path / "outside.sh", 'cp "$1" "$2"')
    done = Jail(Tier.NONE, Limits()).run(
        ["sh", "./outside.sh", "/task/scene.json", "/out/image.exr"], seconds=5, folder=script.parent,
        writable=False, readable={tmp_path / "task": "/task"}, output=tmp_path / "out",
    )  # fmt: skip
    assert not done.problem and (tmp_path / "out/image.exr").read_text(encoding="utf-8") == "a scene"


@pytest.mark.sample(1)
@pytest.mark.parametrize("tier", [Tier.BUBBLEWRAP, Tier.LANDLOCK])
def test_attacks_get_no_points_and_disturb_nobody(tmp_path, tier) -> None:
    need(tier)
    tmp_path.chmod(0o755)
    chosen = (
        "symlink", "hard-link", "fake-results", "background", "exr-bomb", "kills-grader", "hard-coded",
        "copied-picture-made-noisy", "memory-bomb-of-many", "png", "nested", "nested-closed", "nested-build",
        "many-folders", "nameless-files", "imitates", "shared-memory",
    )  # fmt: skip
    some = [one for one in attacks.read_attacks() if one.name in chosen]
    assert len(some) == len(chosen)
    for one in attacks.survive(some, tmp_path, tier, lambda _: None):
        assert not one.problem, f"{one.name}: {one.problem}"


BUSY = """\
import os, time
ends = time.monotonic() + 4
for _ in range({others}):
    if os.fork() == 0:
        while time.monotonic() < ends: pass
        os._exit(0)
while time.monotonic() < ends: pass
for _ in range({others}): os.wait()
used = os.times()
print("used", used.user + used.system + used.children_user + used.children_system)
"""


@pytest.mark.parametrize("tier", TIERS)
def test_many_processes_of_a_jail_get_no_more_of_a_processor_than_one_of_another(tier: Tier) -> None:
    """Where control groups share it; both run on one core, and what others take of that they both lack."""
    need(tier)
    if not any("cpu" in place.controllers for place in cgroups.places()):
        pytest.skip("no control groups that share processors can be made here")
    used = {}

    def run(others: int) -> None:
        with folders.temporary("raycheck-test-") as place:
            (folder := place / "submission").mkdir()
            jail = Jail(tier, Limits(processes=40), sandbox.GRADING + others)
            words = ["/usr/bin/taskset", "-c", str(max(os.sched_getaffinity(0))), "/usr/bin/python3", "-S"]
            words += ["-c", BUSY.format(others=others)]
            done = jail.run(words, seconds=60, folder=folder, writable=True)
            used[others] = float(done.said.split("used ")[-1])

    both = [threading.Thread(target=run, args=(others,)) for others in (0, 14)]
    for one in both:
        one.start()
    for one in both:
        one.join()
    assert used[14] < 1.3 * used[0], used
