"""A program that was started in a jail: how long it runs, how much memory all its processes take and how much
they write is looked at; beyond its bounds it is ended with all of them.
"""

import contextlib
import functools
import json
import os
import select
import signal
import stat
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
UNLINKED_BYTES, UNLINKED_TIMES = 16 << 20, 2
"""What it may hold in files without a name, and how many times what its folders may hold."""
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
    used: float = 0.0
    """Seconds of a processor, and those in which it wanted none: what its limit counts."""

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
    """Time of a processor, and time in which it wants none."""
    wall: float
    """Time by the clock."""
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
    def most_unlinked(self) -> int:
        """How much it may hold in files that have no name any more."""
        return UNLINKED_BYTES + UNLINKED_TIMES * sum(size.most_bytes for size in self.sizes)

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
    first, used, before = None, _Used(started), _children()
    try:
        if told and isinstance(process, subprocess.Popen):
            first = _First(json.loads(told)["child-pid"])
        killed, late = _wait(process, bounds, started, used)
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
    if not killed and process.returncode and bounds.group and bounds.group.swelled:
        killed = bounds.swollen
    whole = process.used if isinstance(process, Confined) else _children() - before
    used.busy = max(used.busy, whole)
    return Finished(process.wait(), spent, _text(said), killed, late, used.seconds)


def _children() -> float:
    """Seconds of a processor of all children that were waited for."""
    found = os.times()
    return found.children_user + found.children_system


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


class _Used:
    """Seconds that a program has used: the time of a processor that all its processes took together, and the
    time in which none of them wanted one. While others keep the machine busy nothing is counted.
    """

    def __init__(self, started: float) -> None:
        self.busy, self.idle, self.looked = 0.0, 0.0, started

    def look(self, root: int) -> None:
        """At a process and all below it."""
        now, (busy, wants) = time.perf_counter(), _processor(root)
        if not wants and busy <= self.busy:
            self.idle += now - self.looked
        self.busy, self.looked = max(self.busy, busy), now

    @property
    def seconds(self) -> float:
        return self.busy + self.idle


def _processor(root: int) -> tuple[float, bool]:
    """Seconds of a processor of a process, all below it and those that they have waited for; whether one of
    them wants more, or waits for a disk.
    """
    ticks, wants = 0, False
    for pid in tree(root):
        with contextlib.suppress(OSError, ValueError, IndexError):
            ticks += sum(map(int, _stat(Path(f"/proc/{pid}/stat"))[11:15]))
            threads = Path(f"/proc/{pid}/task").iterdir()
            wants = wants or any(_stat(thread / "stat")[0] in "RD" for thread in threads)
    return ticks / os.sysconf("SC_CLK_TCK"), wants


def _stat(file: Path) -> list[str]:
    """The fields behind the name, which may hold anything."""
    return file.read_text(errors="replace").rpartition(")")[2].split()


def _unlinked(root: int) -> int:
    """Bytes on disk of files without a name that a process and all below it hold open or in memory."""
    sizes: dict[tuple[int, int], int] = {}
    for pid in tree(root):
        with contextlib.suppress(OSError):
            for descriptor in Path(f"/proc/{pid}/fd").iterdir():
                with contextlib.suppress(OSError):
                    found = descriptor.stat()
                    if stat.S_ISREG(found.st_mode) and not found.st_nlink:
                        sizes[found.st_dev, found.st_ino] = found.st_blocks * 512
    return sum(sizes.values())


def _wait(process: Process, bounds: Bounds, started: float, used: _Used) -> tuple[str, bool]:
    """Why it was ended, empty if it ended by itself; whether its time was over."""
    while True:
        left, wall = bounds.seconds - used.seconds, bounds.wall - (time.perf_counter() - started)
        if _ends(process, max(min(left, wall, WATCH_SECONDS), 0.001)):
            return "", False
        used.look(process.pid)
        reason = ""
        if late := used.seconds >= bounds.seconds:
            reason = f"not finished after {bounds.seconds:.0f} s, the limit of the assignment"
        elif late := wall <= 0:
            reason = f"not finished after {bounds.wall:.0f} s, of which it worked {used.seconds:.0f} s"
        elif _memory(process.pid) > bounds.memory_mb << 20:
            reason = bounds.swollen
        elif _unlinked(process.pid) > bounds.most_unlinked:
            reason = f"more than {bounds.most_unlinked >> 20} MB written into files without a name"
        else:
            reason = bounds.overfull
        if reason:
            _kill(process)
            return reason, late


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
