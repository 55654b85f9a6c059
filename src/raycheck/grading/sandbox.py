"""The jail: student code is hostile by assumption.

With bubblewrap the program sees /usr, its own folder read-only, the scene, a temporary file system of limited
size and one folder for its picture; no network, no other process, no capabilities, no way to more name
spaces. As root the user is changed before, so that limits on processes hold. Limits of one process are
rlimits; the memory of all together and the size of what they write are watched, and the jail is killed
beyond. Nothing is read before every process of the jail is dead.
"""

import contextlib
import json
import os
import re
import select
import shutil
import signal
import subprocess
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

from raycheck.grading.assignment import Limits
from raycheck.renderers import NotFound

FIRST_USER = 61184
"""User ids that no distribution hands out (systemd leaves 61184–65519 to such uses)."""
USERS = 4000
KEPT_BYTES = 4000
"""Of what a program says on standard error."""
WATCH_SECONDS = 0.05
MOST_OUTPUT_FILES = 1000


class Tier(StrEnum):
    """How programs are jailed."""

    BUBBLEWRAP = "bubblewrap"
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
    """Where a submission's commands run. `slot` keeps jails that run at the same time apart."""

    tier: Tier
    limits: Limits
    slot: int = 0

    @property
    def user(self) -> int | None:
        """Another user's id where this one is root."""
        return FIRST_USER + self.slot % USERS if os.name == "posix" and os.geteuid() == 0 else None

    def describe(self) -> str:
        if self.tier is Tier.NONE:
            return "no sandbox: the programs ran with the rights of whoever graded"
        user = "as another user" if self.user is not None else "with the grader's user id, unprivileged"
        return (
            f"bubblewrap ({user}): no network, own name spaces, read-only /usr, {self.limits.memory_mb} MB, "
            f"{self.limits.processes} processes"
        )

    def run(
        self, words: Sequence[str], *, seconds: float, folder: Path, writable: bool,
        readable: Mapping[Path, str] | None = None, output: Path | None = None,
    ) -> Finished:  # fmt: skip
        """Run a command in /submission (`folder`), with `readable` seen under other names and /out writable.

        NotFound where the jail itself cannot be made.
        """
        if self.tier is Tier.NONE:
            places = {"/submission": str(folder), "/out": str(output or folder)}
            places |= {inside: str(outside) for outside, inside in (readable or {}).items()}
            return _watch(self, [_outside(w, places) for w in words], seconds, output, cwd=folder)
        for place in (folder, output):
            if place is not None and self.user is not None and (writable or place is output):
                _give(place, self.user)
        command = _bubblewrap(self.limits, folder, writable, readable or {}, output)
        if self.user is not None:  # by a program: Popen's own way would copy this process's page tables
            ids = ("--reuid", str(self.user), "--regid", str(self.user), "--clear-groups")
            command = ["/usr/bin/setpriv", *ids, "--", *command]
        return _watch(self, [*command, *_limits(self.limits, seconds), *words], seconds, output, info=True)


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
    for name, value in (("PATH", "/usr/local/bin:/usr/bin:/bin"), ("HOME", "/tmp"), ("LANG", "C.UTF-8")):
        words += ["--setenv", name, value]
    words += ["--ro-bind", "/usr", "/usr"]
    for name in ("bin", "sbin", "lib", "lib32", "lib64"):
        if Path("/", name).is_symlink():
            words += ["--symlink", str(Path("/", name).readlink()), f"/{name}"]
        elif Path("/", name).is_dir():
            words += ["--ro-bind", f"/{name}", f"/{name}"]
    for name in ("/etc/alternatives", "/etc/ld.so.cache", "/etc/ld.so.conf", "/etc/ld.so.conf.d"):
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
    return [*words, "--remount-ro", "/", "--chdir", "/submission", "--info-fd", "{info}", "--"]


def _limits(limits: Limits, seconds: float) -> list[str]:
    return [
        "/usr/bin/prlimit", f"--as={limits.memory_mb << 20}", f"--nproc={limits.processes}",
        f"--fsize={limits.output_mb << 20}", f"--cpu={int(seconds * 4) + 2}", "--core=0", "--nofile=256",
        "--",
    ]  # fmt: skip


def _watch(
    jail: Jail, words: list[str], seconds: float, output: Path | None, *, cwd: Path | None = None,
    info: bool = False,
) -> Finished:  # fmt: skip
    """Start, wait, kill beyond the limits; returns when every process of the jail is dead."""
    reading, writing = os.pipe()
    words = [str(writing) if word == "{info}" else word for word in words]
    started = time.perf_counter()
    try:
        process = subprocess.Popen(
            words, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, cwd=cwd,
            pass_fds=(writing,), start_new_session=True,
        )  # fmt: skip
    except OSError as error:
        os.close(reading)
        os.close(writing)
        if info:
            raise NotFound(f"{words[0]} cannot be started: {error.strerror}") from None
        return Finished(127, 0.0, f"{words[0]}: {error.strerror}")
    os.close(writing)
    said = bytearray()
    drain = threading.Thread(target=_drain, args=(process.stderr, said), daemon=True)
    drain.start()
    init = _init_of_jail(reading) if info else None
    try:
        killed = _wait(jail, process, seconds, started, output)
        if init is not None:
            select.select([init], [], [], 10.0)
    finally:
        if process.poll() is None:
            _kill(process)
        if init is not None:
            os.close(init)
    spent = time.perf_counter() - started
    drain.join(1.0)
    if info and init is None:
        raise NotFound(f"the sandbox cannot be made: {_text(said) or 'bubblewrap said nothing'}")
    return Finished(process.returncode, spent, _text(said), killed)


def _text(said: bytearray) -> str:
    return bytes(said).decode(errors="replace")


def _drain(pipe, said: bytearray) -> None:
    """Keep the end of what comes, however much it is."""
    while block := pipe.read1(1 << 16):
        said.extend(block)
        del said[:-KEPT_BYTES]


def _init_of_jail(reading: int) -> int | None:
    """A descriptor of the jail's first process, whose end is the end of all; None if there is no jail."""
    with os.fdopen(reading, "rb") as pipe:
        text = pipe.read()
    try:
        return os.pidfd_open(json.loads(text)["child-pid"])
    except (ValueError, KeyError):
        return None
    except ProcessLookupError:
        return os.open(os.devnull, os.O_RDONLY)  # always ready: it has ended already


def _wait(jail: Jail, process: subprocess.Popen, seconds: float, started: float, output: Path | None) -> str:
    limits = jail.limits
    while True:
        left = seconds - (time.perf_counter() - started)
        try:
            process.wait(max(min(left, WATCH_SECONDS), 0.001))
            return ""
        except subprocess.TimeoutExpired:
            pass
        reason = ""
        if left <= 0:
            reason = f"not finished after {seconds:.0f} s, the limit of the assignment"
        elif _memory(process.pid) > limits.memory_mb << 20:
            reason = f"more than {limits.memory_mb} MB of memory, the limit of the assignment"
        elif output is not None and _written(output) > limits.output_mb << 20:
            reason = f"more than {limits.output_mb} MB written, the limit of the assignment"
        if reason:
            _kill(process)
            return reason


def _kill(process: subprocess.Popen) -> None:
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    process.kill()
    process.wait()


def _memory(root: int) -> int:
    """Bytes resident of a process and all below it."""
    total, waiting = 0, [root]
    page = os.sysconf("SC_PAGE_SIZE")
    while waiting:
        pid = waiting.pop()
        with contextlib.suppress(OSError, ValueError, IndexError):
            total += int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * page
            for thread in Path(f"/proc/{pid}/task").iterdir():
                waiting += map(int, (thread / "children").read_text().split())
    return total


def _written(folder: Path) -> int:
    """Bytes on disk below a folder; more than can be if it holds too many files."""
    total = count = 0
    for where, _, names in os.walk(folder):
        for name in names:
            count += 1
            if count > MOST_OUTPUT_FILES:
                return 1 << 62
            with contextlib.suppress(OSError):
                total += os.lstat(Path(where) / name).st_blocks * 512
    return total


def best_tier() -> Tier:
    """The strongest that works here."""
    return Tier.BUBBLEWRAP if not why_not_bubblewrap() else Tier.NONE


def why_not_bubblewrap() -> str:
    """Empty where it works."""
    if shutil.which("bwrap") is None:
        return "bubblewrap is not installed (Debian's package bubblewrap)"
    try:
        done = Jail(Tier.BUBBLEWRAP, Limits()).run(
            ["/usr/bin/true"], seconds=10, folder=Path("/usr"), writable=False
        )
    except NotFound as error:
        return str(error)
    return done.problem


@dataclass
class Slots:
    """Numbers of jails in use."""

    taken: set[int] = field(default_factory=set)
    lock: threading.Lock = field(default_factory=threading.Lock)

    @contextlib.contextmanager
    def one(self):
        with self.lock:
            slot = next(n for n in range(USERS) if n not in self.taken)
            self.taken.add(slot)
        try:
            yield slot
        finally:
            with self.lock:
                self.taken.discard(slot)
