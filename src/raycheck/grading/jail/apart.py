"""What reads bytes of strangers: a process forked from this one that gives up its privileges and may crash,
swell or be taken over alone. It gets bytes and answers with bytes, of which nothing is executed.

Where it may, it sees one folder alone: as root by chroot, else by Landlock. As root it becomes another
user. Its system calls are those of reading, computing and writing into that folder; it has no way to the
network, to other processes or to another program.
"""

import contextlib
import multiprocessing
import os
import resource
import signal
from collections.abc import Callable, Collection
from multiprocessing.connection import Connection
from multiprocessing.context import ForkProcess
from pathlib import Path

from raycheck.grading.jail import confine

Work = Callable[[bytes, Path], bytes]
"""What is asked, and the folder as the process sees it; the answer."""
WALL = 10.0
"""Times the processor time that a question may take: others may keep the machine busy."""
CALLS = (
    "read", "pread64", "readv", "write", "pwrite64", "writev", "close", "lseek", "_llseek", "open", "openat",
    "fstat", "fstat64", "stat", "stat64", "lstat", "lstat64", "fstatat64", "newfstatat", "statx", "fcntl",
    "fcntl64", "ftruncate", "getdents64", "mkdir", "mkdirat", "chmod", "fchmod", "fchmodat", "umask",
    "mmap", "mmap2", "munmap", "mremap", "mprotect", "madvise", "brk", "futex", "poll", "ppoll",
    "select", "pselect6", "_newselect", "rt_sigaction", "rt_sigprocmask", "rt_sigreturn", "sigaltstack",
    "sched_yield", "clock_gettime", "clock_nanosleep", "nanosleep", "gettimeofday", "time", "getrandom",
    "getpid", "gettid", "getuid", "geteuid", "getgid", "getegid", "getcwd", "getrusage",
    "exit", "exit_group", "rseq", "restart_syscall", "sched_getaffinity",
)  # fmt: skip


class Broken(Exception):
    """The process gave no answer: why, in words that end "it …"."""


class Apart:
    """A process that does some work, started when it is first asked and anew after a question that it did not
    survive; a context.
    """

    def __init__(
        self, work: Work, folder: Path, user: int | None, *, seconds: float, memory: int, file_bytes: int = 0,
        kept: Collection[int] = (),
    ) -> None:  # fmt: skip
        """`folder` is all that it sees, where that can be; `seconds` of its processor a question may take,
        `memory` is what it may take beyond what it starts with, and files that it writes have no more than
        `file_bytes`. Of the descriptors that are open here it keeps those of `kept` alone.
        """
        self.work, self.folder, self.user = work, folder, user
        self.seconds, self.memory, self.file_bytes, self.kept = seconds, memory, file_bytes, kept
        self.process: ForkProcess | None = None
        self.pipe: Connection | None = None

    def __enter__(self) -> "Apart":
        return self

    def __exit__(self, *_: object) -> None:
        if self.process is not None and self.pipe is not None:
            self.pipe.close()
            self.process.kill()
            self.process.join()
        self.process = self.pipe = None

    def ask(self, what: bytes, most: int) -> bytes:
        """The answer, of no more than `most` bytes; Broken where there is none."""
        if self.process is None or self.pipe is None:
            context = multiprocessing.get_context("fork")
            self.pipe, theirs = context.Pipe()
            self.process = context.Process(target=self._serve, args=(theirs, self.pipe), daemon=True)
            self.process.start()
            theirs.close()
        try:
            self.pipe.send_bytes(what)
            if self.pipe.poll(WALL * self.seconds):
                return self.pipe.recv_bytes(most)
            why = f"took more than {WALL * self.seconds:.0f} s"
        except (EOFError, OSError):
            self.process.kill()  # nothing if it has ended
            self.process.join()
            late = self.process.exitcode == -int(signal.SIGXCPU)
            why = f"took more than {self.seconds:.0f} s" if late else "crashed"
        self.__exit__()
        raise Broken(why)

    def _serve(self, pipe: Connection, other_end: Connection) -> None:
        other_end.close()  # else this process would never see that its owner has ended
        _close_all({pipe.fileno(), *self.kept})
        folder = self._give_up()
        with contextlib.suppress(EOFError):
            while True:
                what = pipe.recv_bytes()
                used = resource.getrusage(resource.RUSAGE_SELF)
                until = int(used.ru_utime + used.ru_stime + self.seconds) + 1
                resource.setrlimit(resource.RLIMIT_CPU, (until, resource.RLIM_INFINITY))
                pipe.send_bytes(self.work(what, folder))
        os._exit(0)

    def _give_up(self) -> Path:
        """Give up all privileges; the folder by its name from then on."""
        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        limits = {
            resource.RLIMIT_AS: used + self.memory, resource.RLIMIT_FSIZE: self.file_bytes,
            resource.RLIMIT_CORE: 0,
        }  # fmt: skip
        for kind, value in limits.items():
            resource.setrlimit(kind, (value, value))
        calls, folder, chrooted = _filter(), self.folder, False
        if os.geteuid() == 0:
            with contextlib.suppress(PermissionError):  # in a container that forbids it
                os.chroot(folder)
                os.chdir("/")
                folder, chrooted = Path("/"), True
        ruleset = None
        if not chrooted and confine.landlock_abi():
            ruleset = confine.open_ruleset([str(folder)], [str(folder)] if self.file_bytes else [])
        confine.become_user(self.user)
        confine.libc.prctl(confine.PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0)
        confine.libc.prctl(confine.PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
        if ruleset is not None:
            confine.restrict_self(ruleset)
        if calls:
            calls.load()
        return folder


def _filter() -> confine.Filter | None:
    """None where the library is missing, without which there is no jail either."""
    try:
        made = confine.Filter(CALLS)
        made.allow_on_itself("prlimit64")
        return made
    except OSError:
        return None


def _close_all(kept: Collection[int]) -> None:
    """Close what is open but for these; what is said goes nowhere."""
    nowhere = os.open("/dev/null", os.O_RDWR)
    for standard in (0, 1, 2):
        os.dup2(nowhere, standard)
    for number in [int(place.name) for place in Path("/proc/self/fd").iterdir()]:
        if number > 2 and number not in kept:
            with contextlib.suppress(OSError):
                os.close(number)
