"""Where independent pieces of work run: processes on this machine, or the workers of a Dask cluster.

A piece is the arguments of a function that gives the same bytes wherever and however often it runs. A piece
that is lost with its worker (`Lost`, or Dask's KilledWorker) is done again, `ATTEMPTS` times at most; then it
ends the run, or `on_lost` says what stands in its place. Any other error ends the whole run.
"""

import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from typing import Any, Protocol

from raycheck.base.errors import Lost, NotFound, RenderError
from raycheck.base.machine import cores
from raycheck.base.processes import end, running

ATTEMPTS = 4

Work = Callable[..., bytes]
Pieces = Sequence[tuple[Any, ...]]
"""Each is asked for when its turn comes: a sequence may make them then."""
OnLost = Callable[[int, Lost], bytes]
"""What stands in the place of a piece of that index."""


class Pool(Protocol):
    def run(self, work: Work, pieces: Pieces, on_lost: OnLost | None = None) -> Iterator[tuple[int, bytes]]:
        """work(*piece) for each piece, exactly once each: index and result, in whatever order they come."""
        ...


def chosen(jobs: int | None, dask: str | None) -> "Pool":
    """The pool that the options --jobs and --dask ask for; a process a core by default."""
    if dask and jobs:
        raise NotFound("--jobs and --dask: give one of them; a cluster has its own processes")
    return Dask(dask) if dask else Here(jobs or cores())


@dataclass(frozen=True)
class Here:
    """`jobs` pieces at a time on this machine. The work is a process that a thread waits for."""

    jobs: int

    def run(self, work: Work, pieces: Pieces, on_lost: OnLost | None = None) -> Iterator[tuple[int, bytes]]:
        with ThreadPoolExecutor(self.jobs) as threads:
            try:
                yield from self._run(threads, work, pieces, on_lost)
            except BaseException:  # also Ctrl-C: the threads' processes end, those that start just now too
                threads.shutdown(wait=False, cancel_futures=True)
                ending = threading.Thread(target=threads.shutdown)
                ending.start()
                while ending.is_alive():
                    for process in list(running):
                        end(process)
                    ending.join(0.05)
                raise

    def _run(
        self, threads: Executor, work: Work, pieces: Pieces, on_lost: OnLost | None
    ) -> Iterator[tuple[int, bytes]]:
        index_of: dict[Future[bytes], int] = {}
        left = list(range(len(pieces)))[::-1]
        attempts = [0] * len(pieces)
        while left or index_of:
            while left and len(index_of) < self.jobs:
                index = left.pop()
                attempts[index] += 1
                index_of[threads.submit(work, *pieces[index])] = index
            for done in wait(index_of, return_when=FIRST_COMPLETED).done:
                index = index_of.pop(done)
                try:
                    result = done.result()
                except Lost as error:
                    if attempts[index] < ATTEMPTS:
                        left.append(index)
                        continue
                    if not on_lost:
                        raise
                    result = on_lost(index, error)
                yield index, result


@dataclass(frozen=True)
class Dask:
    """The workers of the cluster whose scheduler has this address, such as tcp://192.168.0.7:8786."""

    address: str

    def run(self, work: Work, pieces: Pieces, on_lost: OnLost | None = None) -> Iterator[tuple[int, bytes]]:
        try:
            from distributed import Client
        except ImportError:
            raise NotFound("--dask needs Dask: pip install 'raycheck[dask]'") from None
        try:
            client = Client(self.address, timeout=20)
        except (OSError, ValueError, TimeoutError) as error:
            raise NotFound(f"--dask {self.address}: no scheduler answers there ({error})") from None
        with client:
            yield from self._run(client, work, pieces, on_lost)

    def _run(
        self, client: Any, work: Work, pieces: Pieces, on_lost: OnLost | None
    ) -> Iterator[tuple[int, bytes]]:
        from distributed import as_completed

        index_of: dict[str, int] = {}
        left = list(range(len(pieces)))[::-1]
        attempts = [0] * len(pieces)
        results = as_completed()

        def submit() -> None:
            """Two pieces for each thread of the workers that there are: none waits, and few are kept."""
            most = 2 * max(1, sum(client.nthreads().values()))
            while left and len(index_of) < most:
                index = left.pop()
                attempts[index] += 1
                future = client.submit(work, *pieces[index], pure=False)
                index_of[future.key] = index
                results.add(future)

        submit()
        for future in results:
            index = index_of.pop(future.key)
            try:
                result = self._result(future)
            except Lost as error:
                if attempts[index] < ATTEMPTS:
                    left.append(index)
                    submit()
                    continue
                if not on_lost:
                    raise Lost(f"lost with its worker {ATTEMPTS} times: {error}") from None
                result = on_lost(index, error)
            submit()
            yield index, result

    def _result(self, future: Any) -> bytes:
        from distributed import KilledWorker

        try:
            result: bytes = future.result()
            return result
        except KilledWorker as error:
            raise Lost(str(error)) from None
        except (NotFound, RenderError):
            raise
        except Exception as error:  # the cluster's own: whatever it is, it is the user's to know
            reason = " ".join(str(error).split())
            raise RenderError(f"the cluster at {self.address}: {reason}") from None
