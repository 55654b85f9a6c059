"""A submission's program as a renderer: every picture from a jail of its own."""

import math
import shutil
import threading
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from raycheck.base.arrays import Array
from raycheck.base.errors import CannotRender, NotFound, RenderError, RenderLate, RenderTimeout
from raycheck.base.processes import windows_lines
from raycheck.base.text import last_words
from raycheck.grading.jail import folders
from raycheck.grading.jail.limits import Limits
from raycheck.grading.jail.pixels import Decoder, take_picture
from raycheck.grading.jail.sandbox import Jail
from raycheck.renderers.commands import TakesPlaceholders, refuse_unknown, split_command
from raycheck.renderers.renderer import Renderer, Rendering
from raycheck.scene import document, export
from raycheck.scene.reader import read_scene
from raycheck.scene.variants import Variant

KEPT = 256
"""Pictures that are kept to be looked at together, so that long gradings need no more memory."""
OVER = "the time for the whole grading was over"


def write_scene(of: Variant, name: str, folder: Path) -> tuple[int, int]:
    """scene.xml with its meshes, and scene.json, as a program in the jail sees them; height and width.

    `name` is what the scene is called there: a hidden variant has the name of what it varies.
    """
    folder.mkdir(parents=True, exist_ok=True)

    def beside(mesh: Path) -> str:
        shutil.copyfile(mesh, folder / mesh.name)
        return mesh.name

    document.write(of.document().moved(beside), folder / "scene.xml")
    data = {**export.export(of), "scene": name}
    (folder / "scene.json").write_text(export.to_json(data), encoding="utf-8")
    camera = read_scene(of.path, of.parameters).camera
    return camera.height, camera.width


@dataclass
class Taken:
    """The pictures of a program that were taken, and the time that they took."""

    pictures: dict[int, list[Array]] = field(default_factory=dict, kw_only=True)
    """The first KEPT of the pictures taken so far, by samples per pixel."""
    taken: Counter[int] = field(default_factory=Counter, kw_only=True)
    """How many were taken, by samples per pixel."""
    times: dict[int, float] = field(default_factory=dict, kw_only=True)
    """Seconds that they took together, by samples per pixel."""
    lost: float = field(default=0.0, kw_only=True)
    """Seconds of pictures that came too late."""
    lock: threading.Lock = field(default_factory=threading.Lock, kw_only=True)

    @property
    def limits(self) -> Limits:
        """The limits of the assignment."""
        raise NotImplementedError

    @property
    def spent(self) -> float:
        """Seconds of all pictures."""
        return sum(self.times.values()) + self.lost

    def has_time(self, spp: int, more: int, pictures: int) -> bool:
        """Whether so many pictures of `more` samples would keep the limits, at the mean pace of those of
        `spp`.
        """
        each = self.times.get(spp, 0.0) / max(self.taken[spp], 1) * more / spp
        limits = self.limits
        return each < limits.picture_seconds and self.spent + each * pictures < limits.task_seconds

    def check_time(self) -> None:
        """RenderTimeout where the task's time is over."""
        limit = self.limits.task_seconds
        if self.spent > limit:
            done = f"after {self.taken.total()} pictures"
            raise RenderTimeout(f"the {limit:.0f} s of the task were over {done}")

    def take(self, spp: int, seconds: float, pixels: Array) -> None:
        with self.lock:
            self.times[spp] = self.times.get(spp, 0.0) + seconds
            self.taken[spp] += 1
            kept = self.pictures.setdefault(spp, [])
            if len(kept) < KEPT:
                kept.append(pixels)


class Tried(Renderer, Protocol):
    """A program whose pictures are judged: a submission's, or one that stands for a student's."""

    pictures: dict[int, list[Array]]

    @property
    def limits(self) -> Limits: ...
    @property
    def spent(self) -> float: ...
    def has_time(self, spp: int, more: int, pictures: int) -> bool: ...


PLACEHOLDERS = ("output", "scene", "json", "name", "task", "spp", "seed")


@dataclass
class Program(Taken, TakesPlaceholders):
    """The run command on one scene; a renderer as raycheck.verify takes it."""

    jail: Jail
    folder: Path
    """The submission's, read-only to it."""
    command: str
    scene: Path
    """Folder that `write_scene` filled."""
    name: str
    size: tuple[int, int]
    """Height and width of the picture."""
    task: str
    scratch: Path
    decoder: Decoder
    refresh: Callable[[], None] = lambda: None
    """Makes the submission's folder anew before each picture."""

    def __post_init__(self) -> None:
        try:
            self.words = split_command(self.command)
            refuse_unknown(self.words, PLACEHOLDERS, "the run command")
        except NotFound as error:
            raise RenderError(str(error)) from None
        if not self.takes("{output}"):
            raise RenderError("the run command has no {output}: say where the picture is to be written")

    @property
    def takes_scene(self) -> bool:
        return True  # each scene has a Program of its own

    @property
    def reads_scene(self) -> bool:
        """It renders scenes that are not in its source."""
        return self.takes("{scene}", "{json}")

    @property
    def limits(self) -> Limits:
        return self.jail.limits

    def render(self, scene: Path, spp: int, seed: int, timeout: float) -> Rendering:
        """`scene` is of no interest: the program gets its own copy. A late picture is made once more where
        others were in time: another program may have kept the machine busy.
        """
        del scene
        seconds = min(self.limits.picture_seconds, timeout)
        self.check_time()
        try:
            return self._render(spp, seed, seconds)
        except RenderLate:
            self.lost += seconds
            if not self.pictures:
                raise
        self.check_time()
        return self._render(spp, seed, seconds)

    def _render(self, spp: int, seed: int, seconds: float) -> Rendering:
        limits = self.limits
        values = {
            "{output}": "/out/image.exr", "{scene}": "/task/scene.xml", "{json}": "/task/scene.json",
            "{name}": self.name, "{task}": self.task, "{spp}": str(spp), "{seed}": str(seed),
        }  # fmt: skip
        words = self.filled(values)
        with folders.temporary("picture-", self.scratch) as place:
            output, private = place / "out", place / "private"
            output.mkdir()
            private.mkdir(mode=0o700)
            started, worked = time.perf_counter(), time.process_time()
            self.refresh()
            done = self.jail.run(
                words, seconds=seconds, folder=self.folder, writable=False,
                readable={self.scene: "/task"}, output=output,
            )  # fmt: skip
            if done.problem and done.late and self.jail.left() <= 0:
                raise RenderTimeout(OVER)
            if done.refused:
                raise CannotRender(done.refused)
            if done.problem:
                kind = RenderLate if done.late else RenderError
                raise kind(f"no picture (seed {seed}): {done.problem}{windows_lines(words, self.folder)}")
            image = take_picture(
                output, private, limits.output_mb << 20, self.size, self.decoder, last_words(done.said)
            )
            if math.isfinite(self.jail.ends):  # by the clock, and so is the share of each scene
                spent = time.perf_counter() - started
            else:
                spent = done.used + time.process_time() - worked
        self.take(spp, spent, image.pixels)
        return Rendering(image, done.seconds)


def build(jail: Jail, folder: Path, command: str) -> str:
    """Build a submission in the jail; what went wrong in a sentence, or nothing."""
    if not command:
        return ""
    words = ["/bin/sh", "-c", command]
    done = jail.run(words, seconds=jail.limits.build_seconds, folder=folder, writable=True)
    if not done.problem:
        return ""
    return f"the build failed: {done.problem}{windows_lines(command.split(), folder)}"
