"""A program that was started in a jail: how long it runs, how much memory all its processes take and how much
they write is looked at; beyond its bounds it is ended with all of them.
"""

import contextlib
import functools
import json
import os
import select
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from raycheck.base.errors import NotFound
from raycheck.base.processes import end, signal_name, tree
from raycheck.base.statuses import Status
from raycheck.base.text import last_words, plain, quoted, refusal
from raycheck.grading.jail import confine, folders
from raycheck.grading.jail.cgroups import Group
from raycheck.grading.jail.confined import Confined
from raycheck.renderers.commands import unexplained

KEPT_BYTES = 4000
"""How much is kept of what a program says."""
WATCH_SECONDS = 0.05
END_SECONDS = 10.0
"""How long a supervisor may take to end what it looks after."""
Process = subprocess.Popen[bytes] | Confined


@dataclass(frozen=True)
class Finished:
    """How a program ended."""

    status: int
    """Exit status, or minus the signal."""
    seconds: float
    said: str
    """The end of what it said on standard output and standard error."""
    killed: str = ""
    """Why it was ended, a sentence."""
    late: bool = False
    """Because its time was over."""

    @property
    def refused(self) -> str:
        """Why it does not support the scene, as it says; empty if it did not refuse."""
        if self.killed or self.status < 0:
            return ""
        cannot = unexplained(last_words(self.said)) if self.status == Status.CANNOT else ""
        said = refusal(self.said.splitlines())
        return f"it says {quoted(said)}" if said else cannot

    @property
    def problem(self) -> str:
        """What went wrong, in a sentence; empty if nothing did."""
        said = last_words(self.said)
        if self.killed:
            return self.killed + said
        if self.status < 0 or self.status > 128:
            number = -self.status if self.status < 0 else self.status - 128
            return f"ended by signal {signal_name(number)}{said}"
        return f"exit status {self.status}{said}" if self.status else ""


@dataclass(frozen=True)
class Size:
    """How much a folder may hold."""

    folder: Path
    most_bytes: int
    most_entries: int
    """Files and folders."""

    @property
    def problem(self) -> str:
        """How it holds more than it may, in a sentence without its end; empty if it does not."""
        total = count = 0
        try:
            for found in folders.walk(self.folder):
                count += 1
                total += max(found.status.st_blocks * 512, found.status.st_size)
                if count > self.most_entries:
                    return f"more than {self.most_entries} files and folders written, which is the limit"
                if total > self.most_bytes:
                    return f"more than {self.most_bytes >> 20} MB written, which is the limit"
        except folders.TooDeep as error:
            return str(error)
        return ""


@dataclass(frozen=True)
class Bounds:
    """What all processes of a program may take together."""

    seconds: float
    memory_mb: int
    sizes: Sequence[Size]
    group: Group | None = None
    """The control group of all processes."""

    @property
    def doors(self) -> list[str]:
        """Files by which a process joins the group."""
        return self.group.doors if self.group else []

    @property
    def overfull(self) -> str:
        """How a folder holds more than it may; empty if none does."""
        return next((problem for size in self.sizes if (problem := size.problem)), "")

    @property
    def swollen(self) -> str:
        """What is said of too much memory."""
        return f"more than {self.memory_mb} MB of memory, the limit of the assignment"


def watch(start: Callable[[int], Process], bounds: Bounds, jail: str = "") -> Finished:
    """Start, wait, end beyond the bounds; returns when every process is dead. A `jail` must tell that it
    stands, by the descriptor that `start` gets, or NotFound.
    """
    _adopt_orphans(os.getpid())
    reading, writing = os.pipe()
    started = time.perf_counter()
    try:
        process = start(writing)
    except NotFound as error:
        os.close(reading)
        if jail:
            raise
        return Finished(127, 0.0, str(error))
    finally:
        os.close(writing)
    said = bytearray()
    drain = threading.Thread(target=_drain, args=(process.stdout, said), daemon=True)
    drain.start()
    with os.fdopen(reading, "rb") as pipe:
        told = pipe.read()
    first = None
    try:
        if told and isinstance(process, subprocess.Popen):
            first = _First(json.loads(told)["child-pid"])
        killed = _wait(process, bounds, started)
    finally:
        if process.poll() is None:
            _kill(process)
        if first:
            first.end()
    spent = time.perf_counter() - started
    drain.join(1.0)
    if jail and not told:
        last = plain(" ".join(_text(said).split())) or "it said nothing"
        raise NotFound(f"the sandbox {jail} cannot be made: {last}")
    killed = killed or bounds.overfull  # it may have ended between two looks
    late = bool(killed) and spent >= bounds.seconds
    if not killed and process.returncode and bounds.group and bounds.group.swelled:
        killed = bounds.swollen
    return Finished(process.wait(), spent, _text(said), killed, late)


def _text(said: bytearray) -> str:
    return bytes(said).decode(errors="replace")


def _drain(pipe: Any, said: bytearray) -> None:
    """Keep the end of what comes, however much it is."""
    while block := pipe.read1(1 << 16):
        said.extend(block)
        del said[:-KEPT_BYTES]


class _First:
    """A jail's first process, with which all others end. Its parent does not wait for it: this process does,
    since in a container there may be nobody else, and what is dead still counts against limits.
    """

    def __init__(self, pid: int) -> None:
        self.pid = pid
        try:
            self.handle: int | None = os.pidfd_open(pid)
        except ProcessLookupError:
            self.handle = None

    def end(self) -> None:
        """End it once its parent is dead; if that was killed early, this would not know."""
        if self.handle is None:
            return
        with contextlib.suppress(ProcessLookupError):
            signal.pidfd_send_signal(self.handle, signal.SIGKILL)
        dead = select.select([self.handle], [], [], END_SECONDS)[0]
        os.close(self.handle)
        if not dead:
            raise NotFound(f"process {self.pid} of a jail cannot be ended")
        with contextlib.suppress(ChildProcessError):
            os.waitpid(self.pid, 0)


@functools.cache
def _adopt_orphans(pid: int) -> None:
    """Make this process, whose id is given, the parent of what its children leave behind: of jails' first
    processes, and without a jail of whatever a program leaves.
    """
    confine.libc.prctl(confine.PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def _wait(process: Process, bounds: Bounds, started: float) -> str:
    """Why it was ended; empty if it ended by itself."""
    while True:
        left = bounds.seconds - (time.perf_counter() - started)
        if _ends(process, max(min(left, WATCH_SECONDS), 0.001)):
            return ""
        reason = ""
        if left <= 0:
            reason = f"not finished after {bounds.seconds:.0f} s, the limit of the assignment"
        elif _memory(process.pid) > bounds.memory_mb << 20:
            reason = bounds.swollen
        else:
            reason = bounds.overfull
        if reason:
            _kill(process)
            return reason


def _ends(process: Process, seconds: float) -> bool:
    """Whether it ends within that time, by its descriptor: Popen.wait looks only after up to 50 ms."""
    if isinstance(process, subprocess.Popen) and process.poll() is None:
        ended = os.pidfd_open(process.pid)
        try:
            if not select.select([ended], [], [], seconds)[0]:
                return False
        finally:
            os.close(ended)
    try:
        process.wait(END_SECONDS if isinstance(process, subprocess.Popen) else seconds)
    except subprocess.TimeoutExpired:
        return False
    return True


def _kill(process: Process) -> None:
    if isinstance(process, Confined):
        process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(END_SECONDS)
    end(process)
    process.wait()


def _memory(root: int) -> int:
    """Bytes resident of a process and all below it."""
    total, page = 0, os.sysconf("SC_PAGE_SIZE")
    for pid in tree(root):
        with contextlib.suppress(OSError, ValueError, IndexError):
            total += int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * page
    return total
