"""Processes that this one starts: run one to its end, and end one with all that it started."""

import contextlib
import os
import signal
import subprocess
import weakref
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Protocol

from raycheck.base.errors import Lost, RenderError

running: "weakref.WeakSet[subprocess.Popen[Any]]" = weakref.WeakSet()
"""The processes that threads of this one wait for, to be ended with it."""


def tree(root: int) -> Iterator[int]:
    """A process and all below it, by Linux's /proc."""
    waiting = [root]
    while waiting:
        yield (pid := waiting.pop())
        with contextlib.suppress(OSError, ValueError):
            for thread in Path(f"/proc/{pid}/task").iterdir():
                waiting += map(int, (thread / "children").read_text().split())


SHELLS = frozenset({"sh", "bash", "dash", "ksh", "zsh"})


def windows_lines(words: Sequence[str], folder: Path = Path()) -> str:
    """The end of a sentence about a command that failed in a folder, where the script or the Makefile that it
    runs has line ends that a shell takes for letters; else nothing.
    """
    program, script = words[0], next((word for word in words[1:] if not word.startswith("-")), "")
    is_shell, is_make = Path(program).name in SHELLS, Path(program).name == "make"
    name = script if is_shell else "Makefile" if is_make else program
    with contextlib.suppress(OSError, ValueError), (folder / name).open("rb") as file:
        head = file.read(1 << 16)
        if b"\r\n" in head and (is_shell or is_make or head.startswith(b"#!")):
            return f"; {name} has the line ends of Windows (CRLF): save it with those of Unix (LF)"
    return ""


class Process(Protocol):
    """What ending a process takes; subprocess.Popen is one."""

    @property
    def pid(self) -> int: ...
    def poll(self) -> int | None: ...
    def kill(self) -> None: ...


def end(process: Process) -> None:
    """End a process with all that it started: its group where it leads one, and by Linux's /proc what is
    below it in sessions of its own. Nothing is done about one that has ended already.
    """
    if process.poll() is not None:
        return
    below = list(tree(process.pid))[1:]
    with contextlib.suppress(OSError):  # it may end just now
        if os.name == "posix" and os.getpgid(process.pid) == process.pid:
            os.killpg(process.pid, signal.SIGKILL)
    for pid in below:
        with contextlib.suppress(OSError):
            os.kill(pid, signal.SIGKILL)
    process.kill()


def signal_name(number: int) -> str:
    """SIGSEGV for 11; the number for one that has no name."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return str(number)


def run_process(words: Sequence[str], hide: str = "") -> None:
    """Run a program. Lost if a signal ends it; if it fails, RenderError with its last line without `hide`."""
    process = subprocess.Popen(
        words, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        start_new_session=os.name == "posix",
    )  # fmt: skip
    running.add(process)
    try:
        said = process.communicate()[1].decode(errors="replace").strip()
    finally:
        running.discard(process)
    if process.returncode < 0:
        raise ended(words[0], process.returncode)
    if process.returncode:
        last = said.splitlines()[-1] if said else f"exit status {process.returncode}"
        raise RenderError(last.replace(hide, "") if hide else last)


def ended(name: str, status: int) -> Lost:
    """What to raise where a process ended without a result, with this exit status or minus the signal."""
    how = signal_name(-status) if status < 0 else f"exit status {status}"
    return Lost(f"{name} was ended by {how}")
