"""Where independent pieces of work run: processes on this machine, or the workers of a Dask cluster.

A piece is the arguments of a function that gives the same bytes wherever and however often it runs. A piece
that is lost with its worker (`Lost`, or Dask's KilledWorker) is done again, `ATTEMPTS` times at most; any
other error ends the whole run.
"""

import os
import signal
import subprocess
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from typing import Any, Protocol

from raycheck.renderers import NotFound, RenderError

ATTEMPTS = 4


def cores() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Lost(RenderError):
    """A piece whose process was killed: what it would have given is not known."""


Work = Callable[..., bytes]
Pieces = Sequence[tuple[Any, ...]]


_running: set[subprocess.Popen[bytes]] = set()
"""The processes of this one, to be ended with it."""


def run_process(words: Sequence[str], hide: str = "") -> None:
    """Run a program. Lost if a signal ends it; if it fails, RenderError with its last line without `hide`."""
    process = subprocess.Popen(
        words, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        start_new_session=os.name == "posix",
    )  # fmt: skip
    _running.add(process)
    try:
        said = process.communicate()[1].decode(errors="replace").strip()
    finally:
        _running.discard(process)
    if process.returncode < 0:
        raise Lost(f"{words[0]} was ended by {signal.Signals(-process.returncode).name}")
    if process.returncode:
        last = said.splitlines()[-1] if said else f"exit status {process.returncode}"
        raise RenderError(last.replace(hide, "") if hide else last)


class Pool(Protocol):
    def run(self, work: Work, pieces: Pieces) -> Iterator[tuple[int, bytes]]:
        """work(*piece) for each piece, exactly once each: index and result, in whatever order they come."""
        ...


@dataclass(frozen=True)
class Here:
    """`jobs` pieces at a time on this machine. The work is a process that a thread waits for."""

    jobs: int

    def run(self, work: Work, pieces: Pieces) -> Iterator[tuple[int, bytes]]:
        running: dict[Future[bytes], int] = {}
        with ThreadPoolExecutor(self.jobs) as threads:
            try:
                yield from self._run(threads, running, work, pieces)
            except BaseException:  # also Ctrl-C: the threads' processes end, those that start just now too
                threads.shutdown(wait=False, cancel_futures=True)
                ending = threading.Thread(target=threads.shutdown)
                ending.start()
                while ending.is_alive():
                    for process in list(_running):
                        process.kill()
                    ending.join(0.05)
                raise

    def _run(
        self, threads: Executor, running: dict[Future[bytes], int], work: Work, pieces: Pieces
    ) -> Iterator[tuple[int, bytes]]:
        left = list(enumerate(pieces))[::-1]
        attempts = [0] * len(pieces)
        while left or running:
            while left and len(running) < self.jobs:
                index, piece = left.pop()
                attempts[index] += 1
                running[threads.submit(work, *piece)] = index
            for done in wait(running, return_when=FIRST_COMPLETED).done:
                index = running.pop(done)
                try:
                    yield index, done.result()
                except Lost:
                    if attempts[index] == ATTEMPTS:
                        raise
                    left.append((index, pieces[index]))


@dataclass(frozen=True)
class Dask:
    """The workers of the cluster whose scheduler has this address, such as tcp://192.168.0.7:8786."""

    address: str

    def run(self, work: Work, pieces: Pieces) -> Iterator[tuple[int, bytes]]:
        try:
            from distributed import Client, KilledWorker, as_completed
        except ImportError:
            raise NotFound("--dask needs Dask: pip install 'raycheck[dask]'") from None
        try:
            client = Client(self.address, timeout=20)
        except (OSError, ValueError, TimeoutError) as error:
            raise NotFound(f"--dask {self.address}: no scheduler answers there ({error})") from None
        with client:
            index_of: dict[str, int] = {}
            attempts = [0] * len(pieces)

            def submit(index: int) -> Any:
                attempts[index] += 1
                future = client.submit(work, *pieces[index], pure=False)
                index_of[future.key] = index
                return future

            results = as_completed([submit(index) for index in range(len(pieces))])
            for future in results:
                index = index_of.pop(future.key)
                try:
                    result = future.result()
                except (KilledWorker, Lost) as error:
                    if attempts[index] == ATTEMPTS:
                        raise Lost(f"lost with its worker {ATTEMPTS} times: {error}") from None
                    results.add(submit(index))
                    continue
                except (NotFound, RenderError):
                    raise
                except Exception as error:  # the cluster's own: whatever it is, it is the user's to know
                    reason = " ".join(str(error).split())
                    raise RenderError(f"the cluster at {self.address}: {reason}") from None
                yield index, result
