"""A command in the jail of confine.py, which runs as a server beside this process."""

import contextlib
import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Sequence
from dataclasses import asdict
from typing import ClassVar

from raycheck.grading.jail import confine


class Confined:
    """A running command, to be used like a Popen."""

    servers: ClassVar[dict[int, socket.socket]] = {}
    """Servers by process: one that was forked has none of its own yet."""
    lock: ClassVar[threading.Lock] = threading.Lock()

    def __init__(self, rules: confine.Rules, words: Sequence[str], info: int) -> None:
        ours, theirs = os.pipe()
        self.status, status = os.pipe()
        self.stdout = os.fdopen(ours, "rb")
        """What it says, on standard error too."""
        self.returncode: int | None = None
        self.used = 0.0
        """Seconds of a processor, when it has ended."""
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
                code, _, used = (pipe.read() or str(-signal.SIGKILL).encode()).partition(b" ")
            self.returncode, self.used = int(code), float(used or 0)
        return self.returncode

    def poll(self) -> int | None:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.wait(0.0)
        return self.returncode

    def terminate(self) -> None:
        """Have its supervisor end it and all that it left."""
        if self.poll() is None:
            os.kill(self.pid, signal.SIGTERM)

    def kill(self) -> None:
        if self.poll() is None:
            os.kill(self.pid, signal.SIGKILL)
