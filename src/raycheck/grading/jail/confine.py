"""Runs commands in jails that need no name spaces: confine.py SOCKET

A small process that outlives the jails, since starting Python costs more than most pictures. It forks a
supervisor for each command, which adopts every process that the command leaves behind and ends them all, when
the command ends or at SIGTERM; the supervisor's end is the end of all. It needs the standard library alone.
Sources: Linux's Documentation/userspace-api/landlock.rst and seccomp_filter.rst, and seccomp_rule_add(3).
"""

import contextlib
import ctypes
import errno
import json
import os
import resource
import signal
import socket
import stat
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

PR_SET_PDEATHSIG, PR_SET_CHILD_SUBREAPER, PR_SET_NO_NEW_PRIVS = 1, 36, 38
CREATE_RULESET, ADD_RULE, RESTRICT_SELF = 444, 445, 446
"""System calls of Landlock, the same on every architecture."""

# Rights of Landlock, bits in the order of linux/landlock.h.
EXECUTE, WRITE_FILE, READ_FILE, READ_DIR = (1 << bit for bit in range(4))
MAKE_DEVICES = 1 << 6 | 1 << 11
TRUNCATE, IOCTL_DEV = 1 << 14, 1 << 15
RIGHTS = (13, 14, 15, 15, 16)
"""How many rights there are at ABI 1, 2, …"""
READING = EXECUTE | READ_FILE | READ_DIR
ON_FILES = EXECUTE | WRITE_FILE | READ_FILE | TRUNCATE | IOCTL_DEV
TRUNCATE_ABI, NETWORK_ABI, SCOPE_ABI = 3, 4, 6
"""The first that can forbid truncate(2), TCP, and signals to processes outside."""

ALLOW, ERRNO = 0x7FFF0000, 0x00050000
NOT_EQUAL, EQUAL, MASKED_EQUAL = 1, 4, 7
NEW_SPACES = 0x7E020000
"""Flags of clone(2) for name spaces of its own: CLONE_NEWNS, CLONE_NEWCGROUP, …, CLONE_NEWNET."""
ALLOWED = (
    # files
    "read", "write", "pread64", "pwrite64", "readv", "writev", "preadv", "pwritev", "lseek", "_llseek",
    "open", "openat", "creat", "close", "close_range", "dup", "dup2", "dup3", "pipe", "pipe2",
    "fcntl", "fcntl64", "flock", "ioctl", "umask", "sendfile", "sendfile64", "splice", "tee",
    "copy_file_range", "stat", "stat64", "fstat", "fstat64", "lstat", "lstat64", "newfstatat",
    "fstatat64", "statx", "statfs", "statfs64", "fstatfs", "fstatfs64", "access", "faccessat", "faccessat2",
    "readlink", "readlinkat", "getxattr", "lgetxattr", "fgetxattr", "listxattr", "llistxattr", "flistxattr",
    "getdents", "getdents64", "getcwd", "chdir", "fchdir", "mkdir", "mkdirat", "rmdir", "mknod", "mknodat",
    "unlink", "unlinkat", "rename", "renameat", "renameat2", "link", "linkat", "symlink", "symlinkat",
    "truncate", "truncate64", "ftruncate", "ftruncate64", "fallocate", "fsync", "fdatasync",
    # memory
    "brk", "mmap", "mmap2", "munmap", "mremap", "mprotect", "madvise", "msync", "mlock", "mlock2", "munlock",
    "mlockall", "munlockall", "mbind", "get_mempolicy", "set_mempolicy", "membarrier", "mseal",
    "pkey_alloc", "pkey_free", "pkey_mprotect",
    # processes and threads
    "fork", "vfork", "execve", "execveat", "exit", "exit_group", "wait4", "waitid", "waitpid",
    "getpid", "getppid", "gettid", "getpgid", "getpgrp", "setpgid", "getsid", "setsid",
    "getuid", "geteuid", "getgid", "getegid", "getresuid", "getresgid", "getgroups",
    "setuid", "setgid", "setreuid", "setregid", "setresuid", "setresgid", "setfsuid", "setfsgid",
    "setuid32", "setgid32", "setreuid32", "setregid32", "setresuid32", "setresgid32",
    "setfsuid32", "setfsgid32", "getuid32", "geteuid32", "getgid32", "getegid32", "getresuid32",
    "getresgid32", "getgroups32",
    "set_tid_address", "set_robust_list", "rseq", "prctl", "arch_prctl", "set_thread_area", "get_thread_area",
    "futex", "futex_time64", "futex_waitv", "futex_wait", "futex_wake", "futex_requeue",
    "sched_yield", "sched_getaffinity", "sched_getparam", "sched_getscheduler", "sched_getattr",
    "sched_get_priority_max", "sched_get_priority_min", "sched_rr_get_interval", "getpriority",
    "getrlimit", "ugetrlimit", "setrlimit", "getrusage", "times", "sysinfo", "uname", "getcpu", "capget",
    "getrandom", "riscv_hwprobe", "cacheflush", "riscv_flush_icache",
    # signals
    "rt_sigaction", "rt_sigprocmask", "rt_sigpending", "rt_sigsuspend", "rt_sigtimedwait", "rt_sigreturn",
    "sigaction", "sigprocmask", "sigpending", "sigsuspend", "sigreturn", "sigaltstack",
    "signalfd", "signalfd4", "pause", "alarm", "restart_syscall", "pidfd_open",
    # time and events
    "clock_gettime", "clock_gettime64", "clock_getres", "clock_getres_time64", "gettimeofday", "time",
    "nanosleep", "clock_nanosleep", "clock_nanosleep_time64", "getitimer", "setitimer",
    "timer_create", "timer_settime", "timer_gettime", "timer_getoverrun", "timer_delete",
    "timerfd_create", "timerfd_settime", "timerfd_gettime",
    "poll", "ppoll", "ppoll_time64", "select", "_newselect", "pselect6", "pselect6_time64",
    "epoll_create", "epoll_create1", "epoll_ctl", "epoll_wait", "epoll_pwait", "epoll_pwait2",
    "eventfd", "eventfd2",
    # a pair of sockets that belong together, and to nobody else
    "socketpair", "recvfrom", "recvmsg", "shutdown", "getsockopt", "setsockopt", "getsockname", "getpeername",
)  # fmt: skip
"""System calls of renderers, compilers and the languages that students write in. All others are answered as a
kernel does that does not have them, so that libraries go on without: ways to the network, to other
processes, to memory that outlives the jail or that nobody counts, to what the machine has read before, and
to parts of the kernel that a renderer never needs. Sockets are among them: one to a service of the user's
could start programs outside.
"""
ON_ITSELF = ("prlimit64", "sched_setaffinity", "sched_setscheduler", "sched_setparam")
"""Allowed on the caller alone."""
ADVICE = ("fadvise64", "fadvise64_64")
"""Not taken, which changes nothing that a program can see."""
SIGNALS = ("kill", "tkill", "tgkill", "rt_sigqueueinfo", "rt_tgsigqueueinfo", "pidfd_send_signal")
MOST_MESSAGE = 1 << 17
ATTRIBUTES = (
    "chmod", "fchmod", "fchmodat", "fchmodat2", "chown", "fchown", "lchown", "fchownat",
    "utime", "utimes", "utimensat", "futimesat",
    "setxattr", "lsetxattr", "fsetxattr", "removexattr", "lremovexattr", "fremovexattr",
)  # fmt: skip
"""System calls that change attributes of files, which Landlock leaves alone: a program that only makes
pictures changes none, and is told that it did.
"""


@dataclass(frozen=True)
class Rules:
    user: int | None
    """The user whose rights the command has; the supervisor's own where that is not root."""
    landlock: bool
    readable: list[str]
    writable: list[str]
    building: bool
    """A build may set permission bits."""
    limits: dict[str, int]
    """Limits of the process by the name of their RLIMIT_…"""
    processes: int
    environment: dict[str, str]
    folder: str
    """Where the command starts."""
    doors: list[str]
    """Files through which the command enters its control groups."""


libc = ctypes.CDLL(None, use_errno=True)


def _checked(result: int, what: str) -> int:
    if result < 0:
        number = ctypes.get_errno()
        raise OSError(number, f"{what}: {os.strerror(number)}")
    return result


def landlock_abi() -> int:
    """The version that this kernel has; 0 where it has no Landlock or does not use it."""
    return int(max(libc.syscall(CREATE_RULESET, None, 0, 1), 0))


class _Ruleset(ctypes.Structure):
    _fields_ = [("fs", ctypes.c_uint64), ("net", ctypes.c_uint64), ("scoped", ctypes.c_uint64)]


class _Beneath(ctypes.Structure):
    _pack_ = 1
    _fields_ = [("allowed", ctypes.c_uint64), ("parent", ctypes.c_int32)]


def open_ruleset(readable: Sequence[str], writable: Sequence[str]) -> int:
    """A descriptor of what is allowed of the file system; nothing of TCP and of others' processes."""
    abi = landlock_abi()
    known = (1 << RIGHTS[min(abi, len(RIGHTS)) - 1]) - 1
    whole = _Ruleset(known, 0b11, 0b11)
    size = 24 if abi >= SCOPE_ABI else 16 if abi >= NETWORK_ABI else 8
    ruleset = _checked(libc.syscall(CREATE_RULESET, ctypes.byref(whole), size, 0), "landlock_create_ruleset")
    devices = dict.fromkeys(("/dev/null", "/dev/zero", "/dev/full"), known)
    rights = dict.fromkeys(readable, READING) | devices
    rights |= dict.fromkeys(writable, known & ~MAKE_DEVICES & ~IOCTL_DEV)
    for name, allowed in rights.items():
        with contextlib.suppress(FileNotFoundError):
            place = os.open(name, os.O_PATH | os.O_CLOEXEC)
            if not stat.S_ISDIR(os.fstat(place).st_mode):
                allowed &= ON_FILES
            rule = _Beneath(allowed & known, place)
            _checked(libc.syscall(ADD_RULE, ruleset, 1, ctypes.byref(rule), 0), f"landlock_add_rule {name}")
            os.close(place)
    return ruleset


def restrict_self(ruleset: int) -> None:
    """Have no rights but those of the ruleset, for ever."""
    _checked(libc.syscall(RESTRICT_SELF, ruleset, 0), "landlock_restrict_self")
    os.close(ruleset)


class _Compare(ctypes.Structure):
    _fields_ = [
        ("argument", ctypes.c_uint),
        ("operation", ctypes.c_int),
        ("a", ctypes.c_uint64),
        ("b", ctypes.c_uint64),
    ]


class Filter:
    """A filter of system calls, in the making: what is not allowed is answered as if the kernel had no such
    call.
    """

    def __init__(self, allowed: Iterable[str]) -> None:
        self.library = ctypes.CDLL("libseccomp.so.2")
        self.library.seccomp_init.restype = ctypes.c_void_p
        missing = ctypes.c_uint32(ERRNO | errno.ENOSYS)
        self.context = ctypes.c_void_p(self.library.seccomp_init(missing))
        for name in allowed:
            self.allow(name)

    def allow(self, name: str, *when: _Compare) -> None:
        """Let a call pass where all of these hold."""
        self._add(ALLOW, name, when)

    def allow_on_itself(self, name: str) -> None:
        """Let a call pass where the process that its first argument names is 0, the caller."""
        self.allow(name, _Compare(0, EQUAL, 0, 0))
        self.answer(name, errno.EPERM, _Compare(0, NOT_EQUAL, 0, 0))

    def answer(self, name: str, number: int, *when: _Compare) -> None:
        """Answer a call, where all of these hold, with that error and nothing else; 0 is success."""
        self._add(ERRNO | number, name, when)

    def _add(self, action: int, name: str, when: Sequence[_Compare]) -> None:
        number = self.library.seccomp_syscall_resolve_name(name.encode())
        if number == -1:  # a name that this library does not know
            return
        compared = (_Compare * len(when))(*when)
        added = self.library.seccomp_rule_add_array(
            self.context, ctypes.c_uint32(action), number, len(when), compared
        )
        if added and number >= 0:  # below 0: this architecture has no such call
            raise OSError(-added, f"no filter for {name}: {os.strerror(-added)}")

    def load(self) -> None:
        """Let it hold for the whole life of this process and all that it starts."""
        result = self.library.seccomp_load(self.context)
        if result:
            raise OSError(-result, f"seccomp_load: {os.strerror(-result)}")

    def program(self) -> bytes:
        """The filter as the kernel takes it."""
        with os.fdopen(os.memfd_create("filter"), "r+b") as file:
            result = self.library.seccomp_export_bpf(self.context, file.fileno())
            if result:
                raise OSError(-result, f"seccomp_export_bpf: {os.strerror(-result)}")
            file.seek(0)
            return file.read()


def jail_filter(signals: bool = True, attributes: bool = True, truncate: bool = True) -> Filter:
    """The filter of every jail. Without `signals`, none are sent; without `attributes`, those of files stay
    as they are; without `truncate`, only files that are open are cut short.
    """
    made = Filter(name for name in ALLOWED if truncate or name != "truncate")
    for name in SIGNALS:
        made.allow(name) if signals else made.answer(name, errno.EPERM)
    for name in ATTRIBUTES:
        made.allow(name) if attributes else made.answer(name, 0)
    for name in ADVICE:
        made.answer(name, 0)
    for name in ON_ITSELF:
        made.allow_on_itself(name)
    made.allow("setpriority", _Compare(0, EQUAL, 0, 0), _Compare(1, EQUAL, 0, 0))  # PRIO_PROCESS, itself
    made.allow("sendto", _Compare(4, EQUAL, 0, 0))  # no address: to the other of a pair
    made.allow("personality", _Compare(0, EQUAL, 0xFFFFFFFF, 0))  # which it has
    made.allow("clone", _Compare(0, MASKED_EQUAL, NEW_SPACES, 0))
    return made


def load_filter(rules: Rules) -> None:
    """Forbid what the name spaces of a stronger jail would keep from this one, and the rest."""
    abi = landlock_abi() if rules.landlock else 0
    jail_filter(
        signals=rules.user is not None or abi >= SCOPE_ABI, attributes=rules.building,
        truncate=rules.user is not None or abi >= TRUNCATE_ABI,
    ).load()  # fmt: skip


def become_user(user: int | None) -> None:
    """Have the rights of that user alone, for ever."""
    if user is not None:
        os.setgroups([])
        os.setresgid(user, user, user)
        os.setresuid(user, user, user)


def become(rules: Rules, words: list[str], info: int) -> None:
    """The command, confined; returns only by an exception. `info` gets a line once the jail stands."""
    os.setsid()
    for door in rules.doors:
        Path(door).write_text("0")
    Path("/proc/self/oom_score_adj").write_text("1000")  # where memory is short the command goes first
    ruleset = open_ruleset(rules.readable, rules.writable) if rules.landlock else None
    limits = {**rules.limits, "RLIMIT_NPROC": rules.processes + (0 if rules.user is not None else _tasks())}
    for name, value in limits.items():
        kind = getattr(resource, name)
        most = resource.getrlimit(kind)[1]
        value = value if most == resource.RLIM_INFINITY else min(value, most)
        resource.setrlimit(kind, (value, value))
    become_user(rules.user)
    os.chdir(rules.folder)
    _checked(libc.prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0), "no_new_privs")
    _checked(libc.prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0), "signal at the supervisor's end")
    if ruleset is not None:
        restrict_self(ruleset)
    load_filter(rules)
    os.write(info, b"confined")
    for number in (signal.SIGPIPE, signal.SIGXFSZ):  # Python ignores them
        signal.signal(number, signal.SIG_DFL)
    os.execvpe(words[0], words, rules.environment)


def _tasks() -> int:
    """The threads of this user, all of which count against a limit of processes."""
    count = 0
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if process.stat().st_uid == os.getuid():
                count += len(list((process / "task").iterdir()))
    return count


def descendants(root: int) -> list[int]:
    """Process ids of all below it."""
    found, waiting = [], [root]
    while waiting:
        with contextlib.suppress(OSError):
            for thread in Path(f"/proc/{waiting.pop()}/task").iterdir():
                waiting += (children := list(map(int, (thread / "children").read_text().split())))
                found += children
    return found


def end_all() -> None:
    """Kill and reap whatever is left. What is stopped or may start nothing more cannot outrun this."""
    while True:
        left = descendants(os.getpid())
        for pid in left:
            with contextlib.suppress(OSError):
                os.kill(pid, signal.SIGSTOP)
                resource.prlimit(pid, resource.RLIMIT_NPROC, (0, 0))
        for pid in left:
            with contextlib.suppress(OSError):
                os.kill(pid, signal.SIGKILL)
        try:
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
        except ChildProcessError:
            return


class _Ended(Exception):
    """Raised where the supervisor is told to end, by SIGTERM."""


def _end(*_: object) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    raise _Ended


def supervise(rules: Rules, words: list[str], info: int) -> int:
    """Exit status of the command, 128 + the signal that ended it."""
    _checked(libc.prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0), "subreaper")
    _checked(libc.prctl(PR_SET_PDEATHSIG, signal.SIGTERM, 0, 0, 0), "signal at the server's end")
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
    child = os.fork()
    if child == 0:
        _become_or_say(rules, words, info)
    os.close(info)
    status = int(signal.SIGTERM)
    try:
        signal.signal(signal.SIGTERM, _end)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
        while child != (found := os.waitpid(-1, 0))[0]:  # orphans of the command come here, too
            pass
        status = found[1]
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
    except _Ended:
        pass
    end_all()
    code = os.waitstatus_to_exitcode(status)
    return code if code >= 0 else 128 - code


def _become_or_say(rules: Rules, words: list[str], info: int) -> None:
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
    try:
        become(rules, words, info)
    except OSError as error:
        os.write(2, f"{words[0]}: {error.strerror}\n".encode())
    os._exit(127)


def serve(channel: socket.socket) -> None:
    """A jail for each message of rules and words, with the descriptors of what it says, of what tells
    that it stands, and of its exit status; answers with the supervisor's process id.
    """
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for supervisors
    while True:
        message, descriptors, _, _ = socket.recv_fds(channel, MOST_MESSAGE, 3)
        if not message:
            return
        supervisor = os.fork()
        if supervisor == 0:
            channel.close()
            _supervise_and_report(message, *descriptors)
        for descriptor in descriptors:
            os.close(descriptor)
        channel.send(str(supervisor).encode())


def _supervise_and_report(message: bytes, said: int, info: int, status: int) -> None:
    try:
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        os.setsid()
        for standard in (1, 2):
            os.dup2(said, standard)
        for descriptor in (said, info, status):
            os.set_inheritable(descriptor, False)
        asked = json.loads(message)
        code = supervise(Rules(**asked["rules"]), asked["words"], info)
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        os.write(status, f"{code} {used.ru_utime + used.ru_stime}".encode())
    finally:
        os._exit(0)


if __name__ == "__main__":
    serve(socket.socket(fileno=int(sys.argv[1])))
