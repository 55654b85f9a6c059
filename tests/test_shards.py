"""Renders that are split: the same bits however they are split, whatever is lost on the way."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from building import ROOT
from cluster import running
from typer.testing import CliRunner

from raycheck.base.errors import Lost
from raycheck.base.processes import run_process
from raycheck.commands.app import app
from raycheck.renderers import pools, shards

BOX = ROOT / "scenes/cornell-box.xml"
SPP = 70
SIZE = ("--width", "24")


@pytest.fixture(autouse=True)
def this_oneray(oneray: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ONERAY", str(oneray))


def pixels(path: Path) -> np.ndarray:
    return oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT)


@pytest.fixture(scope="module")
def whole(oneray: Path, tmp_path_factory: pytest.TempPathFactory) -> np.ndarray:
    """The picture by one process, with its standard errors."""
    path = tmp_path_factory.mktemp("whole") / "whole.exr"
    subprocess.run([oneray, BOX, "--spp", str(SPP), *SIZE, "--seed", "5", "-o", path], check=True)
    return pixels(path)


def work() -> shards.Work:
    return shards.Work(BOX, {}, SIZE, seed=5)


@pytest.mark.parametrize("jobs", [1, 2, 5])
def test_the_bits_of_one_run(whole: np.ndarray, tmp_path: Path, jobs: int) -> None:
    assert shards.render(work(), SPP, tmp_path / "a.exr", pools.Here(jobs), tmp_path / "shards") == 35
    np.testing.assert_array_equal(pixels(tmp_path / "a.exr"), whole)


def test_ranges_make_up_all_samples() -> None:
    """Without gap or overlap, in powers of two, as many as are useful."""
    for spp in (1, 2, 31, 32, 63, 64, 100, 1000, 12345):
        parts = shards.ranges(spp)
        assert [first for first, _ in parts] == [
            sum(count for _, count in parts[:i]) for i in range(len(parts))
        ]
        assert sum(count for _, count in parts) == spp
        assert all(count & (count - 1) == 0 for _, count in parts[:-1])
        assert len(parts) == spp if spp < 64 else 32 <= len(parts) <= 64


def test_command(whole: np.ndarray, tmp_path: Path) -> None:
    """What is there already is not rendered again; what it was rendered with decides what is there."""
    command = ["render", str(BOX), "-o", str(tmp_path / "a.exr"), "--spp", str(SPP), "--jobs", "2"]
    command += ["--shards", str(tmp_path / "shards")]

    def run(*options: str) -> str:
        done = CliRunner().invoke(app, [*command, *options, "--", *SIZE])
        assert done.exit_code == 0, done.output
        return done.output

    assert "in 35 parts," in run("--seed", "5")
    np.testing.assert_array_equal(pixels(tmp_path / "a.exr"), whole)
    parts = sorted((tmp_path / "shards").iterdir())
    parts[0].unlink()
    parts[-1].unlink()
    assert "in 35 parts (33 were there)" in run("--seed", "5")
    np.testing.assert_array_equal(pixels(tmp_path / "a.exr"), whole)
    assert "in 35 parts," in run("--seed", "6")
    command[-2:] = []
    (tmp_path / "a.exr.shards").mkdir()
    (tmp_path / "a.exr.shards/mine").touch()
    assert "in 35 parts," in run("--seed", "5")
    assert [path.name for path in (tmp_path / "a.exr.shards").iterdir()] == ["mine"]
    assert "in 35 parts," in run("--seed", "5", "--technique", "nee")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["no-such-scene", "-o", "a.exr"], "no-such-scene"),
        ([str(BOX), "-o", "a.jpg"], "an .exr, .pfm or .png"),
        ([str(BOX), "-o", "a.exr", "--exposure", "1"], "--exposure is of a .png"),
        ([str(BOX), "-o", "a.exr", "--technique", "best"], "best"),
        ([str(BOX), "-o", "a.exr", "--jobs", "1", "--dask", "tcp://localhost:1"], "give one of them"),
        ([str(BOX), "-o", "a.exr", "--jobs", "1", "--", "--time", "3"], "do not go with it"),
    ],
)
def test_refused(words: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["render", *words[:3], "--spp", "4", *words[3:]])
    assert done.exit_code == 2
    assert message in done.output
    assert list(tmp_path.iterdir()) == []


def test_a_killed_process_is_done_again(
    whole: np.ndarray, oneray: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two renders are killed: the same samples are rendered again. One that always is ends the run."""
    script = tmp_path / "oneray"
    script.write_text(
        f"#!/bin/sh\nif [ $1 != merge ] && {{ mkdir {tmp_path}/one || mkdir {tmp_path}/two; }} 2>/dev/null\n"
        f'then kill -9 $$; fi\nexec {oneray} "$@"\n'
    )
    script.chmod(0o755)
    monkeypatch.setenv("ONERAY", str(script))
    assert shards.render(work(), SPP, tmp_path / "a.exr", pools.Here(2), tmp_path / "shards") == 35
    assert (tmp_path / "two").is_dir()
    np.testing.assert_array_equal(pixels(tmp_path / "a.exr"), whole)
    script.write_text("#!/bin/sh\nkill -9 $$\n")
    with pytest.raises(Lost, match="SIGKILL"):
        shards.render(work(), SPP, tmp_path / "b.exr", pools.Here(2), tmp_path / "shards")
    assert not (tmp_path / "b.exr").exists()


def test_each_piece_once(tmp_path: Path) -> None:
    """Every result comes once, the lost ones after another attempt, and an error ends the run."""
    attempts = [0] * 30
    lock = threading.Lock()

    def piece(index: int) -> bytes:
        with lock:
            attempts[index] += 1
        if index % 3 == 0 and attempts[index] < pools.ATTEMPTS:
            raise Lost("gone")
        return str(index).encode()

    results = list(pools.Here(4).run(piece, [(i,) for i in range(30)]))
    assert sorted(results) == sorted((i, str(i).encode()) for i in range(30))
    assert attempts == [pools.ATTEMPTS if i % 3 == 0 else 1 for i in range(30)]


def test_interrupt_ends_the_renders(oneray: Path, tmp_path: Path) -> None:
    """Ctrl-C in the middle: no wait for renders that take hours, no process left."""
    command = [
        sys.executable,
        "-m",
        "raycheck",
        "render",
        BOX,
        "-o",
        "a.exr",
        "--spp",
        "100000000",
        "--jobs",
        "2",
    ]
    process = subprocess.Popen(
        command, cwd=tmp_path, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip

    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and len(renders := threads_children(process.pid)) < 2:
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    assert "interrupted" in process.communicate(timeout=20)[1]
    assert process.returncode == 130
    assert not any(Path(f"/proc/{child}").exists() for child in renders)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform != "linux", reason="by /proc")
def test_the_end_of_a_pool_is_the_end_of_all_that_it_started(tmp_path: Path) -> None:
    """Also of processes of processes that lead sessions of their own, as jails do."""
    file = tmp_path / "sleeps"

    def piece(index: int) -> bytes:
        if index == 0:
            while not file.exists() or not file.read_text():
                time.sleep(0.01)
            return b"other is there"
        run_process(["sh", "-c", f"setsid sleep 100 & echo $! > {file}; wait"])
        return b"never"

    results = pools.Here(2).run(piece, [(0,), (1,)])
    assert next(results) == (0, b"other is there")
    assert sleeping(int(file.read_text()))
    closing = threading.Thread(target=results.close)
    closing.start()
    deadline = time.monotonic() + 20
    while time.monotonic() < deadline and sleeping(int(file.read_text())):
        time.sleep(0.01)
    assert not sleeping(int(file.read_text()))
    closing.join()


def sleeping(pid: int) -> bool:
    """Is the process alive, and not just not waited for?"""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except FileNotFoundError:
        return False


def threads_children(pid: int) -> list[str]:
    """The processes that any thread of the process has started."""
    tasks = Path(f"/proc/{pid}/task").glob("*/children")
    return [child for task in tasks for child in task.read_text().split()]


def test_other_bytes_for_the_same_shard(tmp_path: Path) -> None:
    """A shard is written once: the same again is nothing new, another is an error with both names."""
    store, shard = shards.Store(tmp_path), shards.Shard(0, 4, "key")
    store.put(shard, b"film")
    store.put(shard, b"film")
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"film"]
    with pytest.raises(shards.Conflict) as error:
        store.put(shard, b"fil?")
    assert sorted(path.read_bytes() for path in tmp_path.iterdir()) == [b"fil?", b"film"]
    assert all(str(path) in str(error.value) for path in tmp_path.iterdir())


def test_another_build_of_oneray(oneray: Path) -> None:
    """A worker whose oneray is not that of the key refuses."""
    with pytest.raises(shards.NotFound, match="another build"):
        shards.render_shard(work().files(), BOX.name, (), 0, 1, "0" * 64)


@pytest.fixture
def cluster(tmp_path: Path, oneray: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """A scheduler and three workers, each a process; its address. The first render of all hangs, and leaves
    its worker's process id in the file "victim" and its own in "hanging".
    """
    script = tmp_path / "oneray"
    script.write_text(
        f"#!/bin/sh\nif [ $1 != merge ] && mkdir {tmp_path}/first 2>/dev/null\n"
        f"then echo $$ > {tmp_path}/hanging; echo $PPID > {tmp_path}/victim; exec sleep 100; fi\n"
        f'exec {oneray} "$@"\n'
    )
    script.chmod(0o755)
    monkeypatch.setenv("ONERAY", str(script))
    with running(tmp_path, workers=3) as address:
        yield address
    if (tmp_path / "hanging").exists():
        os.kill(int((tmp_path / "hanging").read_text()), signal.SIGKILL)


def test_dask_cluster_that_loses_a_worker(whole: np.ndarray, tmp_path: Path, cluster: str) -> None:
    """A real cluster of four processes; a worker is killed as it renders: another renders its samples."""
    killed: list[int] = []

    def on_shard(done: int, total: int) -> None:
        if not killed:
            killed.append(int((tmp_path / "victim").read_text()))
            os.kill(killed[0], signal.SIGKILL)

    pool = pools.Dask(cluster)
    assert shards.render(work(), SPP, tmp_path / "a.exr", pool, tmp_path / "shards", on_shard=on_shard) == 35
    assert killed
    np.testing.assert_array_equal(pixels(tmp_path / "a.exr"), whole)
