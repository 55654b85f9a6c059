"""The jail: student code is hostile by assumption.

With bubblewrap the program sees /usr, its own folder read-only, the scene, a temporary file system of limited
size and one folder for its picture; no network, no other process, no capabilities, no way to more name
spaces, and a filter forbids system calls that no renderer needs. Where name spaces are blocked, as in most
containers, confine.py does it with Landlock and a longer filter, or as root, where the kernel has no
Landlock, with another user and the filter alone. As root
the user is changed before, so that limits on processes hold. Limits of one process are rlimits; the memory of
all together and the size of what they write are watched, and the jail is killed beyond. Nothing is read
before every process of the jail is dead.
"""

import contextlib
import functools
import json
import math
import os
import re
import select
import shutil
import signal
import socket
import stat
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import ClassVar

from raycheck import pools
from raycheck.grading import confine
from raycheck.grading.assignment import Limits
from raycheck.renderers import NotFound

FIRST_USER = 61184
"""User ids that no distribution hands out (systemd leaves 61184–65519 to such uses)."""
USERS = 4000
GRADING = os.getpid() * 61 % USERS
"""Where this grading begins in them, so that two at the same time hardly share any."""
KEPT_BYTES = 4000
"""Of what a program says on standard error."""
WATCH_SECONDS = 0.05
MOST_OUTPUT_FILES = 1000
MOST_BUILD_FILES = 50_000
BUILD_BYTES = 1 << 30
"""What the folder of a submission may hold after its build."""
ENVIRONMENT = {"PATH": "/usr/local/bin:/usr/bin:/bin", "LANG": "C.UTF-8"}
READABLE = ("/usr", "/bin", "/sbin", "/lib", "/lib32", "/lib64")
SETTINGS = ("/etc/alternatives", "/etc/ld.so.cache", "/etc/ld.so.conf", "/etc/ld.so.conf.d")
MACHINE = (
    "/dev/urandom", "/dev/random", "/proc/cpuinfo", "/proc/meminfo", "/proc/stat", "/sys/devices/system/cpu",
)  # fmt: skip
SHARED = ("/tmp", "/var/tmp", "/dev/shm")
"""Where every user may write."""
END_SECONDS = 10.0
"""For a supervisor to end what it looks after."""


class Tier(StrEnum):
    """How programs are jailed."""

    BUBBLEWRAP = "bubblewrap"
    LANDLOCK = "landlock"
    USER = "user"
    """Another user and the filter of system calls alone."""
    NONE = "none"


@dataclass(frozen=True)
class Finished:
    """How a program ended."""

    status: int
    """Exit status, or minus the signal."""
    seconds: float
    said: str
    """The end of its standard error."""
    killed: str = ""
    """Why it was ended, a sentence."""
    late: bool = False
    """Because its time was over."""

    @property
    def problem(self) -> str:
        """What went wrong, in a sentence; empty if nothing did."""
        lines = [line.strip()[:300] for line in self.said.splitlines() if line.strip()]
        said = "; it said: " + " | ".join(lines[-3:]) if lines else ""
        if self.killed:
            return self.killed + said
        if self.status < 0 or self.status > 128:
            number = -self.status if self.status < 0 else self.status - 128
            return f"ended by signal {_signal_name(number)}{said}"
        return f"exit status {self.status}{said}" if self.status else ""


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return str(number)


@dataclass(frozen=True)
class Jail:
    """Where a submission's commands run. A `slot` of its own keeps jails that run at the same time apart."""

    tier: Tier
    limits: Limits
    slot: int = GRADING
    ends: float = math.inf
    """When all must be over, by time.perf_counter."""

    @property
    def user(self) -> int | None:
        """Another user's id where this one is root."""
        return FIRST_USER + self.slot % USERS if os.name == "posix" and os.geteuid() == 0 else None

    def left(self) -> float:
        """Seconds of the whole grading."""
        return self.ends - time.perf_counter()

    def within(self, seconds: float) -> "Jail":
        """With no more time for a task than that."""
        shorter = replace(self.limits, task_seconds=min(self.limits.task_seconds, seconds))
        return replace(self, limits=shorter)

    def describe(self) -> str:
        if self.tier is Tier.NONE:
            return "no sandbox: the programs ran with the rights of whoever graded"
        user = "as another user" if self.user is not None else "with the grader's user id, unprivileged"
        what = {
            Tier.BUBBLEWRAP: f"bubblewrap ({user}): no network, own name spaces, read-only /usr",
            Tier.LANDLOCK: f"Landlock and seccomp ({user}): no network, no files but /usr and its own",
            Tier.USER: "seccomp alone, as another user: no network, but all files that every user may read",
        }
        return f"{what[self.tier]}, {self.limits.memory_mb} MB, {self.limits.processes} processes"

    def run(
        self, words: Sequence[str], *, seconds: float, folder: Path, writable: bool,
        readable: Mapping[Path, str] | None = None, output: Path | None = None,
    ) -> Finished:  # fmt: skip
        """Run a command in /submission (`folder`), with `readable` seen under other names and /out writable.

        NotFound where the jail itself cannot be made.
        """
        seconds = max(min(seconds, self.left()), 0.01)
        if self.tier is Tier.NONE:
            inside = _inside(words, folder, readable or {}, output)
            sizes = _sizes(self.limits, folder, writable, output)
            return _watch(self, lambda _: _popen(inside, cwd=folder), seconds, sizes, info=False)
        for place in (folder, output):
            if place is not None and self.user is not None and (writable or place is output):
                _give(place, self.user)
        sizes = _sizes(self.limits, folder, writable, output)
        if self.tier is not Tier.BUBBLEWRAP:
            inside = _inside(words, folder, readable or {}, output)
            return self._confined(inside, seconds, folder, writable, readable or {}, output, sizes)
        command = ["/usr/bin/choom", "-n", "1000", "--"]  # where memory is short the jail goes first
        if self.user is not None:  # by a program: Popen's own way would copy this process's page tables
            ids = ("--reuid", str(self.user), "--regid", str(self.user), "--clear-groups")
            command += ["/usr/bin/setpriv", *ids, "--"]
        command += _bubblewrap(self.limits, folder, writable, readable or {}, output)
        command += [*_prlimit(self.limits, seconds), *words]
        with os.fdopen(os.memfd_create("filter"), "r+b") as file:
            file.write(_filter())
            file.seek(0)
            start = partial(_popen, command, filter_=file.fileno())
            return _watch(self, lambda info: start(info=info), seconds, sizes)

    def _confined(
        self, words: list[str], seconds: float, folder: Path, writable: bool, readable: Mapping[Path, str],
        output: Path | None, sizes: "list[Size]",
    ) -> Finished:  # fmt: skip
        with tempfile.TemporaryDirectory(prefix="raycheck-tmp-", ignore_cleanup_errors=True) as place:
            if self.user is not None:
                os.chown(place, self.user, self.user)
            own = [place, *([str(output)] if output else ()), *([str(folder)] if writable else ())]
            rules = confine.Rules(
                self.user, self.tier is Tier.LANDLOCK,
                [*READABLE, *SETTINGS, *MACHINE, *self.limits.readable, *map(str, (folder, *readable))],
                own, writable, _rlimits(self.limits, seconds), self.limits.processes,
                {**ENVIRONMENT, "HOME": place, "TMPDIR": place}, str(folder),
            )  # fmt: skip
            sizes = [*sizes, Size(Path(place), self.limits.output_mb << 20, MOST_OUTPUT_FILES)]
            done = _watch(self, lambda info: Confined(rules, words, info), seconds, sizes)
        if self.tier is Tier.USER:
            _remove_shared(self.user)
        return done


@dataclass(frozen=True)
class Size:
    """How much a folder may hold."""

    folder: Path
    most_bytes: int
    most_files: int


def _sizes(limits: Limits, folder: Path, writable: bool, output: Path | None) -> list[Size]:
    sizes = [Size(output, limits.output_mb << 20, MOST_OUTPUT_FILES)] if output else []
    return [*sizes, Size(folder, BUILD_BYTES, MOST_BUILD_FILES)] if writable else sizes


def _remove_shared(user: int | None) -> None:
    """What a user left where all may write: nothing stays for the next picture."""
    waiting = list(map(Path, SHARED))
    while waiting:
        with contextlib.suppress(OSError):
            for path in waiting.pop().iterdir():
                found = path.lstat()
                folder = stat.S_ISDIR(found.st_mode)
                if found.st_uid == user:
                    shutil.rmtree(path, ignore_errors=True) if folder else path.unlink()
                elif folder and found.st_mode & stat.S_IWOTH:
                    waiting.append(path)


def _inside(
    words: Sequence[str], folder: Path, readable: Mapping[Path, str], output: Path | None
) -> list[str]:
    """A command for the jail where there is no mount name space to hold its folders."""
    places = {"/submission": str(folder), "/out": str(output or folder)}
    places |= {inside: str(outside) for outside, inside in readable.items()}
    return [_outside(word, places) for word in words]


def _outside(word: str, places: Mapping[str, str]) -> str:
    """A word of a command with the jail's folders as they are outside."""
    names = "|".join(map(re.escape, places))
    return re.sub(rf"(?<![\w.])({names})(?=/|$)", lambda found: places[found[0]], word)


def _give(place: Path, user: int) -> None:
    for path in (place, *place.rglob("*")):
        os.chown(path, user, user, follow_symlinks=False)


def _bubblewrap(
    limits: Limits, folder: Path, writable: bool, readable: Mapping[Path, str], output: Path | None
) -> list[str]:
    words = ["bwrap", "--unshare-all", "--unshare-user", "--disable-userns", "--cap-drop", "ALL"]
    words += ["--new-session", "--die-with-parent", "--clearenv", "--hostname", "jail"]
    for name, value in {**ENVIRONMENT, "HOME": "/tmp"}.items():
        words += ["--setenv", name, value]
    words += ["--ro-bind", "/usr", "/usr"]
    for name in READABLE[1:]:
        if Path(name).is_symlink():
            words += ["--symlink", str(Path(name).readlink()), name]
        elif Path(name).is_dir():
            words += ["--ro-bind", name, name]
    for name in SETTINGS:
        words += ["--ro-bind-try", name, name]
    for place in limits.readable:
        words += ["--ro-bind", place, place]
    words += ["--proc", "/proc", "--dev", "/dev", "--size", str(limits.output_mb << 20), "--tmpfs", "/tmp"]
    words += ["--size", str(limits.output_mb << 20), "--tmpfs", "/dev/shm"]
    words += ["--bind" if writable else "--ro-bind", str(folder), "/submission"]
    for outside, inside in readable.items():
        words += ["--ro-bind", str(outside), inside]
    if output is not None:
        words += ["--bind", str(output), "/out"]
    words += ["--remount-ro", "/", "--chdir", "/submission"]
    return [*words, "--seccomp", "{filter}", "--info-fd", "{info}", "--"]


@functools.lru_cache(maxsize=1)
def _filter() -> bytes:
    """Of system calls; NotFound where the library that makes it is missing."""
    try:
        return confine.Filter().program()
    except OSError as error:
        raise NotFound(f"no filter of system calls (Debian's package libseccomp2): {error}") from None


def _rlimits(limits: Limits, seconds: float) -> dict[str, int]:
    """Of each process."""
    return {
        "RLIMIT_AS": limits.memory_mb << 20, "RLIMIT_FSIZE": limits.output_mb << 20,
        "RLIMIT_CPU": int(seconds * max(4, os.cpu_count() or 1)) + 2, "RLIMIT_CORE": 0, "RLIMIT_NOFILE": 256,
    }  # fmt: skip


def _prlimit(limits: Limits, seconds: float) -> list[str]:
    each = {**_rlimits(limits, seconds), "RLIMIT_NPROC": limits.processes}
    options = [f"--{name.removeprefix('RLIMIT_').lower()}={value}" for name, value in each.items()]
    return ["/usr/bin/prlimit", *options, "--"]


def _popen(
    words: Sequence[str], *, cwd: Path | None = None, info: int = -1, filter_: int = -1
) -> subprocess.Popen:
    """A command, "{info}" and "{filter}" being descriptors; NotFound where there is no such program."""
    given = {"{info}": str(info), "{filter}": str(filter_)}
    try:
        return subprocess.Popen(
            [given.get(word, word) for word in words], cwd=cwd, start_new_session=True,
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
            pass_fds=[descriptor for descriptor in (info, filter_) if descriptor >= 0],
        )  # fmt: skip
    except OSError as error:
        raise NotFound(f"{words[0]}: {error.strerror}") from None


class Confined:
    """A command in the jail of confine.py, to be used like a Popen."""

    servers: ClassVar[dict[int, socket.socket]] = {}
    """By process: one that was forked has none of its own yet."""
    lock: ClassVar[threading.Lock] = threading.Lock()

    def __init__(self, rules: confine.Rules, words: Sequence[str], info: int) -> None:
        errors, theirs = os.pipe()
        self.status, status = os.pipe()
        self.stderr, self.returncode = os.fdopen(errors, "rb"), None
        try:
            with self.lock:
                server = self._server()
                message = json.dumps({"rules": asdict(rules), "words": words}).encode()
                socket.send_fds(server, [message], [theirs, info, status])
                self.pid = int(server.recv(64))
        finally:
            os.close(theirs)
            os.close(status)

    def _server(self) -> socket.socket:
        if os.getpid() not in self.servers:
            ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            command = [sys.executable, "-I", "-S", confine.__file__, str(theirs.fileno())]
            subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, pass_fds=(theirs.fileno(),)
            )
            theirs.close()
            self.servers[os.getpid()] = ours
        return self.servers[os.getpid()]

    def wait(self, timeout: float | None = None) -> int:
        if self.returncode is None:
            if not select.select([self.status], [], [], timeout)[0]:
                raise subprocess.TimeoutExpired("confine.py", timeout or 0.0)
            with os.fdopen(self.status, "rb") as pipe:
                self.returncode = int(pipe.read() or -signal.SIGKILL)
        return self.returncode

    def poll(self) -> int | None:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.wait(0.0)
        return self.returncode

    def terminate(self) -> None:
        """Its supervisor ends all that it left."""
        if self.poll() is None:
            os.kill(self.pid, signal.SIGTERM)

    def kill(self) -> None:
        if self.poll() is None:
            os.kill(self.pid, signal.SIGKILL)


Process = subprocess.Popen | Confined


def _watch(
    jail: Jail, start: Callable[[int], Process], seconds: float, sizes: Sequence[Size], *, info: bool = True
) -> Finished:
    """Start, wait, kill beyond the limits; returns when every process of the jail is dead. With `info`, the
    jail must tell that it stands, by the descriptor that `start` gets.
    """
    reading, writing = os.pipe()
    started = time.perf_counter()
    try:
        process = start(writing)
    except NotFound as error:
        os.close(reading)
        if info:
            raise
        return Finished(127, 0.0, str(error))
    finally:
        os.close(writing)
    said = bytearray()
    drain = threading.Thread(target=_drain, args=(process.stderr, said), daemon=True)
    drain.start()
    with os.fdopen(reading, "rb") as pipe:
        told = pipe.read()
    init = _init_of_jail(told) if told and isinstance(process, subprocess.Popen) else None
    try:
        killed = _wait(jail, process, seconds, started, sizes)
        if init is not None:
            select.select([init], [], [], 10.0)
    finally:
        if process.poll() is None:
            _kill(process)
        if init is not None:
            os.close(init)
    spent = time.perf_counter() - started
    drain.join(1.0)
    if info and not told:
        last = " ".join(_text(said).split()) or "it said nothing"
        raise NotFound(f"the sandbox {jail.tier} cannot be made: {last}")
    return Finished(process.returncode, spent, _text(said), killed, late=bool(killed) and spent >= seconds)


def _text(said: bytearray) -> str:
    return bytes(said).decode(errors="replace")


def _drain(pipe, said: bytearray) -> None:
    """Keep the end of what comes, however much it is."""
    while block := pipe.read1(1 << 16):
        said.extend(block)
        del said[:-KEPT_BYTES]


def _init_of_jail(told: bytes) -> int:
    """A descriptor of the jail's first process, whose end is the end of all."""
    try:
        return os.pidfd_open(json.loads(told)["child-pid"])
    except ProcessLookupError:
        return os.open(os.devnull, os.O_RDONLY)  # always ready: it has ended already


def _wait(jail: Jail, process: Process, seconds: float, started: float, sizes: Sequence[Size]) -> str:
    limits = jail.limits
    while True:
        left = seconds - (time.perf_counter() - started)
        if _ends(process, max(min(left, WATCH_SECONDS), 0.001)):
            return ""
        reason = ""
        if left <= 0:
            reason = f"not finished after {seconds:.0f} s, the limit of the assignment"
        elif _memory(process.pid) > limits.memory_mb << 20:
            reason = f"more than {limits.memory_mb} MB of memory, the limit of the assignment"
        else:
            full = next((s for s in sizes if _written(s) > s.most_bytes), None)
            reason = f"more than {full.most_bytes >> 20} MB written, which is the limit" if full else ""
        if reason:
            _kill(process)
            return reason


def _ends(process: Process, seconds: float) -> bool:
    """Does it within that time? By its descriptor: Popen.wait looks again only after up to 50 ms."""
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
            return
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    process.kill()
    process.wait()


def _memory(root: int) -> int:
    """Bytes resident of a process and all below it."""
    total, page = 0, os.sysconf("SC_PAGE_SIZE")
    for pid in pools.tree(root):
        with contextlib.suppress(OSError, ValueError, IndexError):
            total += int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * page
    return total


def _written(size: Size) -> int:
    """Bytes on disk below a folder; more than can be if it holds too many files."""
    total = count = 0
    for where, _, names in os.walk(size.folder):
        for name in names:
            count += 1
            if count > size.most_files:
                return 1 << 62
            with contextlib.suppress(OSError):
                total += os.lstat(Path(where) / name).st_blocks * 512
    return total


def why_not(tier: Tier) -> str:
    """Empty where it works."""
    if tier is Tier.BUBBLEWRAP and shutil.which("bwrap") is None:
        return "bubblewrap is not installed (Debian's package bubblewrap)"
    if tier is Tier.LANDLOCK and not confine.landlock_abi():
        return "the kernel has no Landlock, or the container forbids it"
    if tier is Tier.USER and os.geteuid() != 0:
        return "only root may become another user"
    try:
        done = Jail(tier, Limits()).run(["/usr/bin/true"], seconds=10, folder=Path("/usr"), writable=False)
    except NotFound as error:
        return str(error)
    return done.problem


def best_tier() -> Tier:
    """The strongest that works here; NotFound with what each lacks where none does."""
    problems = {}
    for tier in (Tier.BUBBLEWRAP, Tier.LANDLOCK, Tier.USER):
        problems[tier] = why_not(tier)
        if not problems[tier]:
            return tier
    lacks = "; ".join(f"{tier}: {problem}" for tier, problem in problems.items())
    raise NotFound(f"there is no sandbox: {lacks}; --no-sandbox runs submissions with your own rights")
