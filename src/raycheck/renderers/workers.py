"""Work in Python apart from this process: each thread has a helper, a process that serves it piece by piece
and that may die alone. Python's own pools of processes are not for the workers of Dask, which may have no
such children, and one process that is killed ends all of a pool.

python -m raycheck.renderers.workers answers (work, piece, fork) on standard input, pickled, with a result or
an error.
"""

import contextlib
import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Iterator
from functools import partial
from typing import Any

from raycheck.base.errors import NotFound, RenderError
from raycheck.base.processes import ended, running
from raycheck.renderers.pools import Pieces, Pool, Work

_here = threading.local()
READY = b"ready"


class Helper:
    """Ends with the thread to which it belongs."""

    def __init__(self) -> None:
        # -P: no module is taken from the folder that raycheck was started in
        words = [sys.executable, "-P", "-m", "raycheck.renderers.workers"]
        self.process = subprocess.Popen(
            words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=os.name == "posix"
        )
        assert self.process.stdin and self.process.stdout
        self.asked, self.answers = self.process.stdin, self.process.stdout
        running.add(self.process)
        if self.answers.read(len(READY)) != READY:
            status = self.process.wait()
            if status < 0:
                raise ended("the process", status)
            raise NotFound(f"{' '.join(words)} does not start: exit status {status}")

    def ask(self, *what: Any) -> Any:
        """The answer; Lost if the helper is killed over it."""
        try:
            pickle.dump(what, self.asked)
            self.asked.flush()
            return pickle.load(self.answers)
        except (OSError, EOFError, pickle.UnpicklingError):
            self.process.kill()  # nothing if it has ended
            raise ended("the process", self.process.wait()) from None

    def __del__(self) -> None:
        with contextlib.suppress(OSError):  # what was left to be sent to one that has ended
            self.asked.close()
        self.answers.close()
        self.process.wait()


def by_helper(work: Work, *piece: Any, fork: bool = False) -> bytes:
    """work(*piece) by this thread's helper, or, with `fork`, by a process that the helper forks for it."""
    helper = getattr(_here, "helper", None)
    if helper is None or helper.process.poll() is not None:
        helper = _here.helper = Helper()
    answer = helper.ask(work, piece, fork)
    if isinstance(answer, Exception):
        raise answer
    result: bytes = answer
    return result


def run(pool: Pool | None, work: Work, pieces: Pieces) -> Iterator[tuple[int, bytes]]:
    """Do the work by the helpers of a pool; without one in this process, one piece after another."""
    if pool is None:
        return ((index, work(*pieces[index])) for index in range(len(pieces)))
    return pool.run(partial(by_helper, work), pieces)


def _answer(work: Work, piece: tuple[Any, ...]) -> Any:
    try:
        return work(*piece)
    except Exception as error:
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:  # one that only its own process can hold
            return RenderError(f"{type(error).__name__}: {error}")
        return error


def _forked(work: Work, piece: tuple[Any, ...]) -> Any:
    with os.fdopen(os.memfd_create("answer"), "r+b") as file:  # disks may be full
        pid = os.fork()
        if pid == 0:
            try:
                pickle.dump(_answer(work, piece), file)
                file.flush()
            finally:
                os._exit(0)
        status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        file.seek(0)
        try:
            return pickle.load(file)
        except (EOFError, pickle.UnpicklingError):
            return ended("the process", status)


def _serve() -> None:
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what libraries print is no answer
    answers.write(READY)
    answers.flush()
    while True:
        try:
            work, piece, fork = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        answer = (_forked if fork else _answer)(work, piece)
        try:
            pickle.dump(answer, answers)
            answers.flush()
        except BrokenPipeError:  # whoever asked has been killed
            os._exit(1)


if __name__ == "__main__":
    _serve()
