"""The jail: student code is hostile by assumption.

With bubblewrap the program sees /usr, its own folder read-only, the scene, a temporary file system of limited
size and one folder for its picture; no network, no other process, no capabilities, no way to more name
spaces, and a filter forbids system calls that no renderer needs. Where name spaces are blocked, as in most
containers, confine.py does it with Landlock and a longer filter, or as root, where the kernel has no
Landlock, with another user and the filter alone. As root the user is changed before, so that limits on
processes hold. Limits of one process are rlimits; those of all together are watched (watch.py) and control
groups' (cgroups.py) where these can be made. Nothing is read before every process of the jail is dead.
"""

import contextlib
import errno
import functools
import math
import os
import re
import shutil
import stat
import subprocess
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from raycheck.base.errors import NotFound
from raycheck.grading.jail import cgroups, confine, folders
from raycheck.grading.jail.cgroups import Group
from raycheck.grading.jail.confined import Confined
from raycheck.grading.jail.limits import Limits
from raycheck.grading.jail.tiers import Tier as Tier
from raycheck.grading.jail.watch import Bounds, Finished, Size, watch

FIRST_USER = 61184
"""User ids that no distribution hands out (systemd leaves 61184–65519 to such uses)."""
USERS = 4000
GRADING = os.getpid() * 61 % USERS
"""Where this grading begins in them, so that two at the same time hardly share any."""
MOST_OUTPUT_ENTRIES = 1000
MOST_BUILD_ENTRIES = 20_000
BUILD_BYTES = 1 << 30
"""What the folder of a submission may hold after its build."""
BUILD_ROOM = 256 << 20
"""What a build may write into temporary files, and into one file: compilers keep more than pictures take."""
LEAST_ROOM = 1 << 20
"""Bytes that are free on a disk that is not full."""
ENVIRONMENT = {"PATH": "/usr/local/bin:/usr/bin:/bin", "LANG": "C.UTF-8"}
ENTER = """\
echo 1000 >/proc/self/oom_score_adj
while [ "$1" != -- ]; do echo 0 >"$1" || exit 125; shift; done
shift
exec "$@"
"""
"""Become the first to go where memory is short, a member of the control groups, and then the command."""
WALL = 20.0
"""Times its limit that a program may take by the clock: others may keep the machine busy."""
OWN_PROCESSES = 3
"""How many processes the jail itself needs."""
READABLE = ("/usr", "/bin", "/sbin", "/lib", "/lib32", "/lib64")
SETTINGS = (
    "/etc/alternatives", "/etc/ld.so.cache", "/etc/ld.so.conf", "/etc/ld.so.conf.d", "/etc/ssl/openssl.cnf",
    *sorted(map(str, Path("/etc").glob("java*"))),
)  # fmt: skip
"""What of the machine's settings compilers and languages read."""
MACHINE = (
    "/dev/urandom", "/dev/random", "/proc/cpuinfo", "/proc/meminfo", "/proc/stat", "/sys/devices/system/cpu",
)  # fmt: skip
SHARED = ("/tmp", "/var/tmp", "/dev/shm")
"""Where every user may write."""


@dataclass(frozen=True)
class Jail:
    """The place where a submission's commands run. A `slot` of its own keeps jails that run at the same time
    apart.
    """

    tier: Tier
    limits: Limits
    slot: int = GRADING
    ends: float = math.inf
    """When all must be over, by time.perf_counter."""

    @property
    def user(self) -> int | None:
        """Another user's id where this one is root and there are others, which a name space may lack."""
        user = FIRST_USER + self.slot % USERS
        return user if os.name == "posix" and os.geteuid() == 0 and _is_mapped(user) else None

    def left(self) -> float:
        """Seconds of the whole grading."""
        return self.ends - time.perf_counter()

    def within(self, seconds: float, picture_seconds: float | None = None) -> "Jail":
        """The same jail with no more time than that for a task, and for a picture."""
        limits = self.limits
        shorter = replace(
            limits, task_seconds=min(limits.task_seconds, seconds),
            picture_seconds=min(limits.picture_seconds, picture_seconds or math.inf),
        )  # fmt: skip
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

        NotFound where the jail itself cannot be made; OSError where it failed and a disk is full, which may
        be why.
        """
        done = self._run(Command(words, folder, writable, readable or {}, output), seconds)
        if place := output or (folder if writable else None):
            free = os.statvfs(place)
            if done.problem and free.f_bavail * free.f_frsize < LEAST_ROOM:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(place))
        return done

    def _run(self, command: "Command", seconds: float) -> Finished:
        writable, output, folder = command.writable, command.output, command.folder
        limits, wall = self.limits, max(min(WALL * seconds, self.left()), 0.01)
        bounds = Bounds(seconds, wall, limits.memory_mb, command.sizes(limits))
        if self.tier is Tier.NONE:
            return watch(lambda _: _popen(command.outside, cwd=folder), bounds)
        for place in (folder, output):
            if place is not None and self.user is not None and (writable or place is output):
                _give(place, self.user)
        jailed = self._wrapped if self.tier is Tier.BUBBLEWRAP else self._confined
        group = Group(cgroups.places(), limits.memory_mb << 20, limits.processes + OWN_PROCESSES)
        with contextlib.ExitStack() as made:
            try:
                made.enter_context(group)
            except OSError as error:
                raise NotFound(f"the sandbox {self.tier} cannot be made: control group: {error}") from None
            return jailed(command, replace(bounds, group=group))

    def _wrapped(self, command: "Command", bounds: Bounds) -> Finished:
        words = ["/bin/sh", "-c", ENTER, "enter", *bounds.doors, "--"]
        if self.user is not None:  # by a program: Popen's own way would copy this process's page tables
            ids = ("--reuid", str(self.user), "--regid", str(self.user), "--clear-groups")
            words += ["/usr/bin/setpriv", *ids, "--"]
        words += _bubblewrap(self.limits, command) + _prlimit(command, self.limits, bounds.seconds)
        words += command.words
        with os.fdopen(os.memfd_create("filter"), "r+b") as file:
            file.write(_filter())
            file.seek(0)
            given = {"filter": file.fileno()}
            return watch(lambda info: _popen(words, {**given, "info": info}), bounds, self.tier)

    def _confined(self, command: "Command", bounds: Bounds) -> Finished:
        with folders.temporary("raycheck-tmp-", mode=0o700) as place:
            if self.user is not None:
                os.chown(place, self.user, self.user)
            seen = [*READABLE, *SETTINGS, *MACHINE, *self.limits.readable]
            seen += map(str, (command.folder, *command.readable))
            own = [str(place), *(str(size.folder) for size in bounds.sizes)]
            rules = confine.Rules(
                self.user, self.tier is Tier.LANDLOCK, seen, own, command.writable,
                _rlimits(command, self.limits, bounds.seconds), self.limits.processes,
                {**ENVIRONMENT, "HOME": str(place), "TMPDIR": str(place)}, str(command.folder), bounds.doors,
            )  # fmt: skip
            most = MOST_BUILD_ENTRIES if command.writable else MOST_OUTPUT_ENTRIES
            temporary = Size(place, command.room(self.limits), most)
            bounds = replace(bounds, sizes=[*bounds.sizes, temporary])
            done = watch(lambda info: Confined(rules, command.outside, info), bounds, self.tier)
        if self.tier is Tier.USER:
            _remove_shared(self.user)
        return done


@dataclass(frozen=True)
class Command:
    """What is run, and what it sees of the files outside."""

    words: Sequence[str]
    folder: Path
    """The submission's folder outside the jail."""
    writable: bool
    """Whether the command may write into that folder."""
    readable: Mapping[Path, str]
    """Other files by the names that they have inside."""
    output: Path | None
    """The folder outside the jail that the command sees as /out."""

    @property
    def outside(self) -> list[str]:
        """The words for a jail without a mount name space to hold its folders."""
        places = {"/submission": str(self.folder), "/out": str(self.output or self.folder)}
        places |= {inside: str(outside) for outside, inside in self.readable.items()}
        names = re.compile(rf"(?<![\w.])({'|'.join(map(re.escape, places))})(?=/|$)")
        return [names.sub(lambda found: places[found[0]], word) for word in self.words]

    def room(self, limits: Limits) -> int:
        """Bytes of a file, and of all that is temporary."""
        return max(limits.output_mb << 20, BUILD_ROOM if self.writable else 0)

    def sizes(self, limits: Limits) -> list[Size]:
        """How large each folder that it may write to may become."""
        sizes = [Size(self.output, limits.output_mb << 20, MOST_OUTPUT_ENTRIES)] if self.output else []
        return [*sizes, Size(self.folder, BUILD_BYTES, MOST_BUILD_ENTRIES)] if self.writable else sizes


def _is_mapped(user: int) -> bool:
    """Whether that user's id exists in this process's name space."""
    try:
        lines = Path("/proc/self/uid_map").read_text().splitlines()
    except OSError:  # a kernel without name spaces
        return True
    ranges = [tuple(map(int, line.split())) for line in lines]
    return any(first <= user < first + count for first, _, count in ranges)


def _remove_shared(user: int | None) -> None:
    """What a user left where all may write: nothing stays for the next picture."""
    waiting = list(map(Path, SHARED))
    while waiting:
        with contextlib.suppress(OSError):
            for path in waiting.pop().iterdir():
                found = path.lstat()
                folder = stat.S_ISDIR(found.st_mode)
                if found.st_uid == user:
                    folders.remove(path) if folder else path.unlink()
                elif folder and found.st_mode & stat.S_IWOTH:
                    waiting.append(path)


def _give(place: Path, user: int) -> None:
    os.chown(place, user, user)
    for found in folders.walk(place):
        os.chown(found.name, user, user, dir_fd=found.parent, follow_symlinks=False)


def _bubblewrap(limits: Limits, command: Command) -> list[str]:
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
    room = str(command.room(limits))
    words += ["--proc", "/proc", "--dev", "/dev", "--size", room, "--tmpfs", "/tmp"]
    words += ["--size", room, "--tmpfs", "/dev/shm"]
    words += ["--bind" if command.writable else "--ro-bind", str(command.folder), "/submission"]
    for outside, inside in command.readable.items():
        words += ["--ro-bind", str(outside), inside]
    if command.output is not None:
        words += ["--bind", str(command.output), "/out"]
    words += ["--remount-ro", "/", "--chdir", "/submission"]
    return [*words, "--seccomp", "{filter}", "--info-fd", "{info}", "--"]


@functools.lru_cache(maxsize=1)
def _filter() -> bytes:
    """The filter of system calls; NotFound where the library that makes it is missing."""
    try:
        return confine.jail_filter().program()
    except OSError as error:
        raise NotFound(f"no filter of system calls (Debian's package libseccomp2): {error}") from None


def _rlimits(command: Command, limits: Limits, seconds: float) -> dict[str, int]:
    """The limits of each process: of memory that it may write to, since Java, Go and JavaScript reserve far
    more addresses than they ever use.
    """
    return {
        "RLIMIT_DATA": limits.memory_mb << 20, "RLIMIT_FSIZE": command.room(limits),
        "RLIMIT_CPU": int(seconds * max(4, os.cpu_count() or 1)) + 2, "RLIMIT_CORE": 0, "RLIMIT_NOFILE": 256,
    }  # fmt: skip


def _prlimit(command: Command, limits: Limits, seconds: float) -> list[str]:
    each = {**_rlimits(command, limits, seconds), "RLIMIT_NPROC": limits.processes}
    options = [f"--{name.removeprefix('RLIMIT_').lower()}={value}" for name, value in each.items()]
    return ["/usr/bin/prlimit", *options, "--"]


def _popen(
    words: Sequence[str], given: Mapping[str, int] | None = None, *, cwd: Path | None = None
) -> subprocess.Popen[bytes]:
    """A command with the descriptors `given`, which "{name}" stands for; NotFound where there is no such
    program.
    """
    numbers = {f"{{{name}}}": str(descriptor) for name, descriptor in (given or {}).items()}
    try:
        return subprocess.Popen(
            [numbers.get(word, word) for word in words], cwd=cwd, start_new_session=True,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            pass_fds=list((given or {}).values()),
        )  # fmt: skip
    except OSError as error:
        raise NotFound(f"{words[0]}: {error.strerror}") from None


def why_not(tier: Tier) -> str:
    """Empty where it works."""
    if tier is Tier.BUBBLEWRAP and shutil.which("bwrap") is None:
        return "bubblewrap is not installed (Debian's package bubblewrap)"
    if tier is Tier.LANDLOCK and not confine.landlock_abi():
        return "the kernel has no Landlock, or the container forbids it"
    if tier is Tier.USER and Jail(tier, Limits()).user is None:
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
