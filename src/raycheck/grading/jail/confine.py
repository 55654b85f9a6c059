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
NOT_EQUAL, MASKED_EQUAL = 1, 7
CLONE_NEWUSER = 0x10000000
FORBIDDEN = (
    "socket", "io_uring_setup", "io_uring_enter", "io_uring_register",
    "ptrace", "process_vm_readv", "process_vm_writev", "process_madvise", "pidfd_getfd", "kcmp",
    "bpf", "perf_event_open", "userfaultfd", "keyctl", "add_key", "request_key",
    "shmget", "msgget", "semget", "mq_open", "mq_unlink",
    "unshare", "setns", "mount", "umount2", "pivot_root", "chroot", "open_by_handle_at", "name_to_handle_at",
    "fsopen", "fsconfig", "fsmount", "move_mount", "open_tree",
)  # fmt: skip
"""Ways to the network, to other processes, to memory that outlives the jail, and to parts of the kernel that
a renderer never needs. No socket at all: one to a service of the user's could start programs outside."""
ON_OTHERS = ("prlimit64", "setpriority", "sched_setaffinity", "sched_setscheduler", "sched_setparam")
"""Allowed on the caller itself; which argument names the process: `_OTHERS_ARGUMENT`."""
_OTHERS_ARGUMENT = {"setpriority": 1}
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


def open_ruleset(rules: Rules) -> int:
    """A descriptor of what the rules allow of the file system; nothing of TCP and of others' processes."""
    abi = landlock_abi()
    known = (1 << RIGHTS[min(abi, len(RIGHTS)) - 1]) - 1
    whole = _Ruleset(known, 0b11, 0b11)
    size = 24 if abi >= SCOPE_ABI else 16 if abi >= NETWORK_ABI else 8
    ruleset = _checked(libc.syscall(CREATE_RULESET, ctypes.byref(whole), size, 0), "landlock_create_ruleset")
    devices = dict.fromkeys(("/dev/null", "/dev/zero", "/dev/full"), known)
    rights = dict.fromkeys(rules.readable, READING) | devices
    rights |= dict.fromkeys(rules.writable, known & ~MAKE_DEVICES & ~IOCTL_DEV)
    for name, allowed in rights.items():
        with contextlib.suppress(FileNotFoundError):
            place = os.open(name, os.O_PATH | os.O_CLOEXEC)
            if not stat.S_ISDIR(os.fstat(place).st_mode):
                allowed &= ON_FILES
            rule = _Beneath(allowed & known, place)
            _checked(libc.syscall(ADD_RULE, ruleset, 1, ctypes.byref(rule), 0), f"landlock_add_rule {name}")
            os.close(place)
    return ruleset


class _Compare(ctypes.Structure):
    _fields_ = [
        ("argument", ctypes.c_uint),
        ("operation", ctypes.c_int),
        ("a", ctypes.c_uint64),
        ("b", ctypes.c_uint64),
    ]


class Filter:
    """A filter of system calls, in the making: all are allowed but those that are forbidden."""

    def __init__(self) -> None:
        self.library = ctypes.CDLL("libseccomp.so.2")
        self.library.seccomp_init.restype = ctypes.c_void_p
        self.context = ctypes.c_void_p(self.library.seccomp_init(ctypes.c_uint32(ALLOW)))
        for name in FORBIDDEN:
            self.forbid(name, errno.EACCES)
        for name in ON_OTHERS:
            self.forbid(name, when=_Compare(_OTHERS_ARGUMENT.get(name, 0), NOT_EQUAL, 0, 0))
        self.forbid("clone", when=_Compare(0, MASKED_EQUAL, CLONE_NEWUSER, CLONE_NEWUSER))
        self.forbid("clone3", errno.ENOSYS)  # its flags are out of sight; the C library goes on with clone

    def forbid(self, name: str, answer: int = errno.EPERM, when: _Compare | None = None) -> None:
        """Answer a call, `when` that holds, with that error and nothing else; 0 is success."""
        number = self.library.seccomp_syscall_resolve_name(name.encode())
        if number == -1:  # a name that this library does not know, its kernel hardly does
            return
        action, count = ctypes.c_uint32(ERRNO | answer), 0 if when is None else 1
        added = self.library.seccomp_rule_add_array(
            self.context, action, number, count, ctypes.byref(when) if when else None
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


def load_filter(rules: Rules) -> None:
    """Forbid what the name spaces of a stronger jail would keep from this one, and the rest."""
    forbidden = Filter()
    abi = landlock_abi() if rules.landlock else 0
    if rules.user is None and abi < SCOPE_ABI:
        for name in SIGNALS:
            forbidden.forbid(name)
    if rules.user is None and abi < TRUNCATE_ABI:
        forbidden.forbid("truncate")
    if not rules.building:
        for name in ATTRIBUTES:
            forbidden.forbid(name, 0)
    forbidden.load()


def become(rules: Rules, words: list[str], info: int) -> None:
    """The command, confined; returns only by an exception. `info` gets a line once the jail stands."""
    os.setsid()
    for door in rules.doors:
        Path(door).write_text("0")
    Path("/proc/self/oom_score_adj").write_text("1000")  # where memory is short the command goes first
    ruleset = open_ruleset(rules) if rules.landlock else None
    limits = {**rules.limits, "RLIMIT_NPROC": rules.processes + (0 if rules.user is not None else _tasks())}
    for name, value in limits.items():
        kind = getattr(resource, name)
        most = resource.getrlimit(kind)[1]
        value = value if most == resource.RLIM_INFINITY else min(value, most)
        resource.setrlimit(kind, (value, value))
    if rules.user is not None:
        os.setgroups([])
        os.setresgid(rules.user, rules.user, rules.user)
        os.setresuid(rules.user, rules.user, rules.user)
    os.chdir(rules.folder)
    _checked(libc.prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0), "no_new_privs")
    _checked(libc.prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0), "signal at the supervisor's end")
    if ruleset is not None:
        _checked(libc.syscall(RESTRICT_SELF, ruleset, 0), "landlock_restrict_self")
        os.close(ruleset)
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
        os.write(status, str(supervise(Rules(**asked["rules"]), asked["words"], info)).encode())
    finally:
        os._exit(0)


if __name__ == "__main__":
    serve(socket.socket(fileno=int(sys.argv[1])))
