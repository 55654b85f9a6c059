"""oneray as the program of a student whose renderer is slower: the pictures are real, the clock is simulated.

Nothing is jailed: the program is ours. One process renders all pictures of a scene.
"""

import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from raycheck.base.errors import RenderError, RenderLate
from raycheck.base.images import Image
from raycheck.calibration.mutants import OPTIONS
from raycheck.grading.jail.limits import Limits
from raycheck.grading.program import Taken
from raycheck.renderers.renderer import Rendering
from raycheck.scene.techniques import technique
from raycheck.scene.variants import Variant
from raycheck.truth import references

START_SECONDS = 0.03
"""What a picture takes beyond its paths: a jail, a process, a file."""


@dataclass
class Simulated(Taken):
    """A renderer as raycheck.verify takes it; a context, in which the process lives."""

    program: Path
    """A program of `mutants.program`, beside which is many-seeds."""
    technique: str
    of: Variant
    given: Limits
    paths_per_second: float
    takes_scene: bool = True
    reads_scene: bool = True
    takes_spp: bool = True
    takes_seed: bool = True

    def __enter__(self) -> "Simulated":
        entry = references.require(self.of)
        self.shape = (entry["height"], entry["width"], 3)
        settings = [f"-D{name}={value}" for name, value in self.of.parameters.items()]
        words = [str(self.program.with_name("many-seeds")), str(self.of.path), "-o", "none.exr", "--quiet",
                 *technique(self.technique).options, *OPTIONS, *settings]  # fmt: skip
        self.process: Any = subprocess.Popen(
            ["stdbuf", "-o0", *words], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.communicate()

    @property
    def limits(self) -> Limits:
        return self.given

    def seconds(self, spp: int) -> float:
        """That a picture takes the student's program."""
        return float(START_SECONDS + spp * self.shape[0] * self.shape[1] / self.paths_per_second)

    def render(self, scene: Path, spp: int, seed: int, timeout: float) -> Rendering:
        """`scene` is of no interest: the process has read it."""
        del scene
        self.check_time()
        seconds = self.seconds(spp)
        if seconds > timeout:
            raise RenderLate(f"no picture (seed {seed}): not finished after {timeout:.0f} s")
        count = int(np.prod(self.shape))
        try:
            self.process.stdin.write(f"{spp} {seed}\n".encode())
            self.process.stdin.flush()
            data: bytes = self.process.stdout.read(4 * count)
        except BrokenPipeError:
            data = b""
        if len(data) < 4 * count:
            raise RenderError(self.process.stderr.read().decode(errors="replace").strip() or "no picture")
        pixels = np.frombuffer(data, dtype=np.float32).astype(np.float64).reshape(self.shape)
        self.take(spp, seconds, pixels)
        return Rendering(Image(pixels), seconds)
