"""The two renderers that are swept: oneray, and Mitsuba in a process that may crash."""

import json
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Protocol

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.errors import RenderError
from raycheck.measuring.stability.case import Case, Settings
from raycheck.renderers.oneray import oneray_command, oneray_path

TIMEOUT = 600.0


class Renders(Protocol):
    """A renderer: pixels (H, W) of one channel; RenderError where there is no picture."""

    single: bool
    name: str

    def render(self, case: Case, settings: Settings, spp: int, seed: int) -> Array: ...


class Oneray:
    """oneray with its defaults, the precision by `auto`."""

    single = False
    name = "oneray"

    def __init__(self) -> None:
        self._path = oneray_path()

    def render(self, case: Case, settings: Settings, spp: int, seed: int) -> Array:
        command = oneray_command(self._path, case.options, settings)
        return np.asarray(command.render(case.path, spp, seed, TIMEOUT).image.pixels)[..., 1]


class Mitsuba:
    """Mitsuba's scalar_rgb in a process that is started anew where it crashes."""

    single = True

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None
        self.name = f"Mitsuba {self._start()['version']}"

    def _start(self) -> dict[str, Any]:
        command = [sys.executable, "-m", "raycheck.measuring.stability.mitsuba_worker"]
        pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        self._process = subprocess.Popen(command, text=True, stderr=subprocess.DEVNULL, **pipes)
        return self._answer()

    def _answer(self) -> dict[str, Any]:
        assert self._process and self._process.stdout
        line = self._process.stdout.readline()
        if not line:
            self.close()
            raise RenderError("Mitsuba crashed, or took too long")
        result: dict[str, Any] = json.loads(line)
        return result

    def render(self, case: Case, settings: Settings, spp: int, seed: int) -> Array:
        if self._process is None:
            self._start()
        assert self._process and self._process.stdin
        job = {"scene": str(case.path), "settings": dict(settings), "spp": spp, "seed": seed}
        self._process.stdin.write(json.dumps(job) + "\n")
        self._process.stdin.flush()
        timer = threading.Timer(TIMEOUT, self._process.kill)
        timer.start()
        try:
            answer = self._answer()
        finally:
            timer.cancel()
        if "error" in answer:
            raise RenderError(answer["error"].replace(f"{case.path.parent}/", ""))
        return np.array(answer["pixels"], dtype=np.float64)

    def close(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None


@contextmanager
def mitsuba() -> Iterator[Mitsuba | None]:
    """Mitsuba where it is installed."""
    try:
        found = Mitsuba()
    except RenderError:
        yield None
        return
    try:
        yield found
    finally:
        found.close()
