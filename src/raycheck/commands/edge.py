"""Where raycheck meets the system: whatever happens, a line that says so and one of the exit statuses."""

import contextlib
import errno
import os
import shlex
import signal
import sys
import tempfile
import traceback
from collections.abc import Callable
from typing import NoReturn

from raycheck.base.errors import PlainError
from raycheck.base.statuses import Status
from raycheck.base.text import one_line

MACHINES = {
    errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EACCES, errno.EPERM, errno.EIO, errno.ENOMEM,
    errno.EMFILE, errno.ENFILE, errno.ENAMETOOLONG, errno.EISDIR, errno.ENOTDIR,
}  # fmt: skip
"""What is wrong with the machine, or with a path that was given, and no bug."""


def status_of(program: Callable[[], int | None]) -> int:
    """Runs the program, and says on standard error how it ended where its user has to know."""
    with contextlib.suppress(ValueError):  # not by another thread than the main one
        signal.signal(signal.SIGTERM, _interrupt)
    try:
        status = program()
        if sys.stdout is not None:
            sys.stdout.flush()
        return Status.DONE if status is None else status
    except PlainError as error:
        return _says(str(error), Status.COULD_NOT_RUN)
    except KeyboardInterrupt:
        return _says("interrupted", Status.INTERRUPTED)
    except BrokenPipeError:
        return _unwritten(Status.UNREAD)
    except MemoryError:
        return _says("out of memory", Status.COULD_NOT_RUN)
    except OSError as error:
        if error.errno not in MACHINES:
            return _bug(error)
        where = "" if error.filename is None else f"{os.fsdecode(error.filename)}: "
        _says(f"{where}{error.strerror}", Status.COULD_NOT_RUN)
        return _unwritten(Status.COULD_NOT_RUN)
    except ModuleNotFoundError as error:
        if (error.name or "raycheck").startswith("raycheck"):
            return _bug(error)
        return _says(f"the Python package {error.name} is missing", Status.COULD_NOT_RUN)
    except Exception as error:
        return _bug(error)


def _interrupt(*_: object) -> NoReturn:
    """At SIGTERM: end as at Ctrl-C, so that nothing is left behind."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    raise KeyboardInterrupt


def command_line() -> str:
    """The one that was typed, for whoever reads its result."""
    return shlex.join(["raycheck", *sys.argv[1:]])


def _says(line: str, status: Status) -> Status:
    with contextlib.suppress(OSError, ValueError):
        print(f"raycheck: {one_line(line)}", file=sys.stderr, flush=True)
    return status


def _unwritten(status: Status) -> Status:
    """What standard output could not take is forgotten, so that Python does not try again at its end."""
    try:
        sys.stdout.flush()
    except (OSError, ValueError):
        with contextlib.suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return status


def _bug(error: Exception) -> Status:
    """One line; the traceback goes into a file of its own."""
    from raycheck.base.machine import machine, raycheck_version

    whole = "".join(traceback.format_exception(error))
    what = f"{type(error).__name__}: {error}".splitlines()[0]
    try:
        with tempfile.NamedTemporaryFile(
            "w", prefix="raycheck-bug-", suffix=".txt", delete=False, encoding="utf-8", errors="replace"
        ) as file:
            file.write(f"{command_line()}\nraycheck {raycheck_version()}; {machine()}\n\n{whole}")
        where = f"the command and the traceback are in {file.name}"
    except OSError as failed:
        frame = traceback.extract_tb(error.__traceback__)[-1]
        where = f"at {frame.filename}:{frame.lineno}; the traceback cannot be written: {failed.strerror}"
    return _says(f"a bug, please report it: {what} ({where})", Status.BUG)
