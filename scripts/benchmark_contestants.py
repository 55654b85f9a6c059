"""The renderers that scripts/benchmark.py compares: how each is started, and what one render gives."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from raycheck.base.images import load_image
from raycheck.renderers import mitsuba_worker

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "build" / "benchmark"
WORKER = Path(mitsuba_worker.__file__)
SAMPLERS = ("independent", "stratified", "multijitter", "orthogonal", "ldsampler")
MOST_SPP = 4096
"""Mitsuba's film adds samples in single precision and drifts beyond."""


class Failed(Exception):
    """A contestant cannot render; the message is one line."""


@dataclass(frozen=True)
class Render:
    """One render."""

    image: NDArray[np.float64]
    """(H, W, 3)."""
    spp: int
    """Samples per pixel, as the renderer rounded them."""
    seconds: float
    """For the render alone."""
    build: float
    """Before the first sample, seconds: reading the scene and building trees. For Mitsuba the loading."""
    rays: int | None
    """With shadow rays; None where the renderer does not count."""
    memory: int
    """Peak of its process so far, bytes."""
    kernel: str
    """What ran it."""

    @property
    def paths(self) -> int:
        return self.image.shape[0] * self.image.shape[1] * self.spp


class Contestant(Protocol):
    """Something that renders a scene file."""

    name: str

    def open(self, scene: Path) -> None: ...
    def render(self, spp: int, seed: int) -> Render: ...
    def close(self) -> None: ...


def _reason(stderr: str, status: int) -> str:
    lines = [line.strip() for line in stderr.splitlines() if line.strip()]
    return lines[-1][:200] if lines else f"exit status {status}"


@dataclass
class Oneray:
    """oneray with options, a process for each render."""

    name: str
    options: tuple[str, ...] = ()
    timeout: float = 120.0
    scene: Path = field(default=Path(), init=False)

    def open(self, scene: Path) -> None:
        self.scene = scene

    def close(self) -> None:
        """Nothing stays open."""

    def render(self, spp: int, seed: int) -> Render:
        with tempfile.TemporaryDirectory() as folder:
            picture = Path(folder) / "out.exr"
            words = [str(ROOT / "build/oneray"), str(self.scene), "-o", str(picture), "--spp", str(spp)]
            words += ["--seed", str(seed), "--stats", "-", "--quiet", *self.options]
            # A process's peak begins with that of whoever starts it, so a small shell stands between.
            try:
                done = subprocess.run(["/bin/sh", "-c", '"$@"; exit $?', "sh", *words], capture_output=True,
                                      text=True, timeout=self.timeout)  # fmt: skip
            except subprocess.TimeoutExpired:
                raise Failed(f"no picture after {self.timeout:g} s") from None
            if done.returncode != 0:
                raise Failed(_reason(done.stderr, done.returncode))
            stats = json.loads(done.stdout)
            took = stats["seconds"]
            return Render(load_image(picture).pixels, spp, took["render"], took["load"] + took["build"],
                          stats["rays"] + stats["shadow_rays"], stats["peak_memory_bytes"],
                          f"{stats['kernel']}, {stats['precision']}, {stats['lanes']} lanes")  # fmt: skip


@dataclass
class Mitsuba:
    """A Mitsuba variant and sampler in a process of its own, one thread."""

    name: str
    variant: str
    sampler: str = "independent"
    cold: bool = False
    """Without kernels that earlier processes compiled."""
    started: float = field(default=0.0, init=False)
    load_seconds: float = field(default=0.0, init=False)
    _process: subprocess.Popen[str] | None = field(default=None, init=False)
    _scratch: Path = field(default=Path(), init=False)

    def open(self, scene: Path) -> None:
        """Loads the scene, in the process that is there or a new one."""
        if self._process is None:
            self._start()
        file = scene
        if self.sampler != "independent":
            file = scene.with_name(f"{scene.stem}@{self.sampler}.xml")
            text = scene.read_text(encoding="utf-8")
            file.write_text(text.replace('type="independent"', f'type="{self.sampler}"'), encoding="utf-8")
        self.load_seconds = self._ask({"load": str(file)})["seconds"]

    def render(self, spp: int, seed: int) -> Render:
        picture = self._scratch / "image.npy"
        answer = self._ask({"render": spp, "seed": seed, "save": str(picture)})
        image = np.load(picture).astype(np.float64)
        return Render(image, answer["spp"], answer["seconds"], self.load_seconds, None,
                      answer["memory"], f"{self.variant}, {self.sampler}")  # fmt: skip

    def close(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            shutil.rmtree(self._scratch, ignore_errors=True)
        self._process = None

    def _start(self) -> None:
        self._scratch = Path(tempfile.mkdtemp())
        home = self._scratch if self.cold else FOLDER / "kernels"
        home.mkdir(parents=True, exist_ok=True)
        with (self._scratch / "errors").open("w") as errors:
            self._process = subprocess.Popen(
                [sys.executable, str(WORKER), self.variant],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, text=True, bufsize=1,
                env=dict(os.environ, HOME=str(home)),
            )  # fmt: skip
        self.started = self._answer()["import"]

    def _ask(self, order: dict[str, object]) -> dict:
        assert self._process is not None and self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(order) + "\n")
        except OSError:
            self._fail()
        return self._answer()

    def _answer(self) -> dict:
        assert self._process is not None and self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            self._fail()
        return json.loads(line)

    def _fail(self) -> None:
        assert self._process is not None
        status = self._process.wait()
        reason = _reason((self._scratch / "errors").read_text(encoding="utf-8", errors="replace"), status)
        self.close()
        raise Failed(reason)


def oneray_help() -> str:
    """What this build of oneray offers."""
    return subprocess.run([str(ROOT / "build/oneray"), "--help"], capture_output=True, text=True).stdout


def oneray_contestants(offer: str, options: tuple[str, ...], choices: tuple[str, ...]) -> list[Contestant]:
    """The precisions, then what `offer`, the text of --help, has beyond them."""

    def one(name: str, *words: str) -> Oneray:
        return Oneray(f"oneray {name}", (*words, *options))

    def line(option: str) -> str:
        return next((x for x in offer.splitlines() if x.strip().startswith(option)), "")

    double, single = ("--precision", "double"), ("--precision", "single")
    found = [one("double", *double), one("single", *single)]
    if "auto" in line("--precision"):
        found.append(one("auto", "--precision", "auto"))
    if line("--sampler") and "sobol" in offer:
        found += [one("double sobol", *double, "--sampler", "sobol"),
                  one("single sobol", *single, "--sampler", "sobol")]  # fmt: skip
    for choice in choices:
        found += [one(f"double {choice}", *double, "--light-choice", choice),
                  one(f"single {choice}", *single, "--light-choice", choice)]  # fmt: skip
    return list(found)


def spp_for(contestant: Contestant, seconds: float, square: bool = False) -> int:
    """Samples per pixel that take about so long; longer, up to eight times, where a render costs much before
    its first sample, so that this is a fifth of it. What compiles is rendered once before it is timed.
    """

    def timed(spp: int) -> float:
        contestant.render(spp, 1)
        return contestant.render(spp, 2).seconds

    spp, once = 1, timed(1)
    took = once
    while took < seconds / 4 + once and spp < MOST_SPP:
        spp = min(MOST_SPP, max(4 * spp, min(64 * spp, int(spp * seconds / took / 2))))
        took = timed(spp)
    each = max(took - once, 1e-9) / max(1, spp - 1)
    fixed = max(0.0, once - each)
    wanted = min(MOST_SPP, max(1, round(min(max(seconds, 4 * fixed), 8 * seconds) / each)))
    return max(1, round(wanted**0.5)) ** 2 if square else wanted


def startup_oneray(contestant: Oneray) -> float:
    """Seconds from the start of the process to the picture of one sample per pixel."""
    start = time.perf_counter()
    contestant.render(1, 1)
    return time.perf_counter() - start


def startup_mitsuba(variant: str, scene: Path, cold: bool) -> dict[str, float]:
    """The same, with its parts; `cold` compiles all, else kernels come from the cache on disk."""
    one = Mitsuba("start-up", variant, cold=cold)
    start = time.perf_counter()
    try:
        one.open(scene)
        first = one.render(1, 1).seconds
        total = time.perf_counter() - start
        again = one.render(1, 2).seconds
    finally:
        one.close()
    compiling = max(0.0, first - again)
    return {"total": total, "import": one.started, "load": one.load_seconds, "compile": compiling}
