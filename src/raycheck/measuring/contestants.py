"""Renderers that race: a command for each picture, or Mitsuba in a process that stays.

Time is the renderer's process time: what the processor spent on it, on all its threads, while everything is
pinned to one core.
"""

import contextlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.errors import NotFound, RenderError, RenderTimeout
from raycheck.judging.agenda import oneray_agenda, write_variant
from raycheck.renderers import commands
from raycheck.renderers.oneray import oneray_path
from raycheck.renderers.renderer import Renderer
from raycheck.scene.techniques import technique
from raycheck.scene.variants import Variant
from raycheck.truth import mitsuba

MITSUBA = {"mitsuba llvm": "llvm_ad_rgb", "mitsuba scalar": "scalar_rgb"}
TIMEOUT = 300.0
"""Seconds that one picture may take."""


@dataclass(frozen=True)
class Shot:
    """A picture and what it took."""

    image: Array
    """(H, W, 3) linear radiance."""
    seconds: float
    """Process time that it took."""


class Contestant(Protocol):
    """Renders one scene; raises RenderError."""

    name: str
    about: str

    @property
    def command(self) -> str:
        """The command that reproduces a picture, with {spp} and {seed}."""

    def open(self) -> dict[str, float]:
        """Get ready; seconds that this took, by what took them."""

    def render(self, spp: int, seed: int) -> Shot: ...
    def close(self) -> None: ...


@dataclass
class Process:
    """A process for each picture; what it needs to start is told apart by its pictures of few samples."""

    name: str
    about: str
    renderer: Renderer
    scene: Path
    shown: str
    identity: str = ""
    """What else the pictures depend on, such as the program's own hash."""

    @property
    def command(self) -> str:
        return self.shown

    def open(self) -> dict[str, float]:
        return {}

    def render(self, spp: int, seed: int) -> Shot:
        before = _spent()
        made = self.renderer.render(self.scene, spp, seed, TIMEOUT)
        return Shot(made.image.pixels, max(_spent() - before, 1e-6))

    def close(self) -> None:
        """Ends nothing: each picture has a process of its own."""


def _spent() -> float:
    """Processor seconds of this thread and of all ended child processes; by the clock where the system does
    not say.
    """
    try:
        import resource
    except ImportError:  # Windows
        return time.perf_counter()
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return children.ru_utime + children.ru_stime


@dataclass
class Mitsuba:
    """A Mitsuba variant, one thread, in a process that stays: start-up, loading and compiling are apart."""

    name: str
    about: str
    variant: str
    of: Variant
    identity: str = ""
    _process: subprocess.Popen[str] | None = field(default=None, init=False)
    _scratch: Path = field(default=Path(), init=False)
    _known: set[int] = field(default_factory=set, init=False)
    _compiled: float = field(default=0.0, init=False)

    @property
    def command(self) -> str:
        settings = "".join(f", {k}={v!r}" for k, v in sorted(self.of.parameters.items()))
        loaded = f"mi.load_file('{_shown_path(self.of)}'{settings})"
        return (
            f"python -c \"import mitsuba as mi; mi.set_variant('{self.variant}'); "
            f"mi.Bitmap(mi.render({loaded}, spp={{spp}}, seed={{seed}})).write('out.exr')\""
        )

    def open(self) -> dict[str, float]:
        self._scratch = Path(tempfile.mkdtemp(prefix="raycheck-"))
        with (self._scratch / "errors").open("w") as errors:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "raycheck.renderers.mitsuba_worker", self.variant],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, text=True, bufsize=1,
                env=dict(os.environ, PYTHONPATH=os.pathsep.join(sys.path)),
            )  # fmt: skip
        started = self._answer()["import"]
        loaded = self._ask({"load": str(self.of.path), "parameters": dict(self.of.parameters)})["process"]
        first = self._render(1, 1)
        compiling = max(0.0, first.seconds - self._render(1, 2).seconds)
        return {"import": started, "load": loaded, "compile": compiling}

    def render(self, spp: int, seed: int) -> Shot:
        if spp not in self._known:  # kernels are compiled for each number of samples
            self._render(spp, 1)
            self._known.add(spp)
        return self._render(spp, seed)

    def _render(self, spp: int, seed: int) -> Shot:
        picture = self._scratch / "image.npy"
        answer = self._ask({"render": spp, "seed": seed, "save": str(picture)})
        if answer["spp"] != spp:
            raise RenderError(f"{answer['spp']} samples per pixel where {spp} were asked for")
        return Shot(np.load(picture).astype(np.float64), answer["process"])

    def close(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            shutil.rmtree(self._scratch, ignore_errors=True)
        self._process = None

    def _ask(self, order: Mapping[str, object]) -> dict[str, Any]:
        assert self._process is not None and self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(order) + "\n")
        except OSError:
            self._fail()
        return self._answer()

    def _answer(self) -> dict[str, Any]:
        process = self._process
        assert process is not None and process.stdout is not None
        late = threading.Event()

        def end() -> None:
            late.set()
            process.kill()

        timer = threading.Timer(TIMEOUT, end)
        timer.start()
        try:
            line = process.stdout.readline()
        finally:
            timer.cancel()
        if late.is_set():
            self.close()
            raise RenderTimeout(f"no picture after {TIMEOUT:.0f} s")
        if not line:
            self._fail()
        result: dict[str, Any] = json.loads(line)
        return result

    def _fail(self) -> None:
        assert self._process is not None
        status = self._process.wait()
        said = (self._scratch / "errors").read_text(encoding="utf-8", errors="replace").strip().splitlines()
        self.close()
        raise RenderError(said[-1][:200] if said else f"exit status {status}")


def oneray_contestants(scene: Variant, named: Sequence[str] = ()) -> tuple[list[Process], dict[str, str]]:
    """oneray with every technique that applies, or those named; and why others, that would, are left out."""
    agenda = oneray_agenda([scene], named)
    program = oneray_path()
    found = []
    for task in agenda.tasks:
        one = technique(task.technique)
        shown = oneray_line(scene, one.options)
        found.append(Process(one.name, one.summary, task.renderer, task.path, shown, _hash(program)))
    return found, {case.removeprefix(f"{scene.label}, "): why for case, why in agenda.left_out.items()}


def _shown_path(scene: Variant) -> str:
    return f"scenes/{scene.path.name}" if scene.canonical else str(scene.path)


def oneray_line(scene: Variant, options: Sequence[str]) -> str:
    """The command that renders a scene with oneray, as a reader would type it, with {spp} and {seed}."""
    settings = [f"-D{k}={v}" for k, v in sorted(scene.parameters.items())]
    words = ["oneray", _shown_path(scene), "-o", f"{scene.name}.exr", "--spp", "{spp}", "--seed", "{seed}"]
    return " ".join([*words, *settings, *options])


def _hash(program: Path) -> str:
    stat = program.stat()
    return f"{program}:{stat.st_size}:{stat.st_mtime_ns}"


def mitsuba_contestants(scene: Variant) -> list[Mitsuba]:
    """Mitsuba's two variants with one thread, or only the scalar one where no LLVM library works."""
    best = mitsuba.choose_variant()
    return [
        Mitsuba(name, f"Mitsuba's path integrator, {variant}, one thread", variant, scene)
        for name, variant in MITSUBA.items()
        if variant == "scalar_rgb" or best == variant
    ]


def named_commands(options: Sequence[str]) -> dict[str, str]:
    """["mine=./mine …"] as {"mine": "./mine …"}; NotFound for anything else."""
    found: dict[str, str] = {}
    for option in options:
        name, equals, command = option.partition("=")
        if not equals or not name.strip() or "{" in name:
            raise NotFound(f'--renderer {option}: NAME="COMMAND" is wanted')
        if name.strip() in found:
            raise NotFound(f"--renderer {name.strip()}: named twice")
        parsed = commands.Command.parse(command)
        for placeholder in ("spp", "seed"):
            if f"{{{placeholder}}}" not in command:
                raise NotFound(f"--renderer {name.strip()}: the command has no {{{placeholder}}}")
        if not shutil.which(parsed.words[0]):
            raise NotFound(f"--renderer {name.strip()}: {parsed.words[0]}: there is no such program")
        found[name.strip()] = command
    return found


def command_contestant(name: str, command: str, scene: Variant, folder: Path) -> Process:
    """Another renderer; a scene with other parameters is written into `folder` first."""
    path = write_variant(scene, folder) if scene.parameters else scene.path
    parsed = commands.Command.parse(command)
    return Process(name, command, parsed, path, command, command)


@contextlib.contextmanager
def pinned(core: int | None = None) -> Iterator[int | None]:
    """Pin this thread, and with it every renderer that it starts, to one core: by default the last of those
    allowed, since the first serves interrupts. None where the system cannot.
    """
    if not hasattr(os, "sched_setaffinity"):
        yield None
        return
    before = os.sched_getaffinity(0)
    chosen = max(before) if core is None else core
    if chosen not in before:
        raise NotFound(f"--core {chosen}: allowed are {', '.join(map(str, sorted(before)))}")
    os.sched_setaffinity(0, {chosen})
    try:
        yield chosen
    finally:
        os.sched_setaffinity(0, before)
