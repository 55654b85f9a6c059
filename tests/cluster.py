"""A Dask cluster on this machine, of processes that tests may kill."""

from __future__ import annotations

import contextlib
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def running(folder: Path, workers: int) -> Iterator[str]:
    """A scheduler and its workers, in this environment, with logs in `folder`; the address."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    started: list[subprocess.Popen[bytes]] = []

    def start(*words: str) -> None:
        command = [sys.executable, "-m", "dask", *words]
        with (folder / f"{len(started)}.log").open("wb") as log:
            started.append(subprocess.Popen(command, cwd=folder, stdout=log, stderr=log))

    try:
        start("scheduler", "--host", address, "--no-dashboard")
        while "Scheduler at" not in (folder / "0.log").read_text():
            assert started[0].poll() is None, (folder / "0.log").read_text()
            time.sleep(0.1)
        for _ in range(workers):
            start("worker", address, "--no-nanny", "--nthreads", "1", "--no-dashboard")
        yield address
    finally:
        for process in started:
            process.kill()
            process.wait()
