"""What makes images: a command, a Python callable, or files that are already there."""

import os
import re
import shlex
import subprocess
import tempfile
import threading
import time
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from raycheck.base.errors import CannotRender, ImageError, NotFound, RenderError, RenderTimeout
from raycheck.base.images import load_image
from raycheck.base.processes import end, signal_name, windows_lines
from raycheck.base.statuses import Status
from raycheck.base.text import last_words, nearest, refusal
from raycheck.renderers.renderer import Rendering, repeat


def split_command(command: str, windows: bool = os.name == "nt") -> list[str]:
    """Split like a shell does, with quotes; on Windows a backslash is part of a path and escapes nothing."""
    lexer = shlex.shlex(command, posix=True, punctuation_chars=False)
    lexer.whitespace_split = True
    lexer.commenters = ""
    if windows:
        lexer.escape = ""
    try:
        return list(lexer)
    except ValueError as error:
        raise NotFound(f"the renderer command cannot be split: {error} in {command!r}") from None


def refuse_unknown(words: Iterable[str], known: Collection[str], where: str) -> None:
    """NotFound where a word has a {name} that is not known; ${name} is the shell's."""
    for word in words:
        for name in re.findall(r"(?<!\$)\{(\w+)\}", word):
            if name not in known:
                listed = " ".join(f"{{{one}}}" for one in known)
                raise NotFound(f"{where} has {{{name}}}{nearest(name, known)}; there are {listed}")


class TakesPlaceholders:
    """What a command takes, by its words."""

    words: Sequence[str]

    def takes(self, *placeholders: str) -> bool:
        """Whether the words hold any of them."""
        return any(placeholder in word for word in self.words for placeholder in placeholders)

    def filled(self, values: Mapping[str, str]) -> list[str]:
        """The words, with values for the placeholders."""
        found = list(self.words)
        for placeholder, value in values.items():
            found = [word.replace(placeholder, value) for word in found]
        return found

    @property
    def takes_spp(self) -> bool:
        return self.takes("{spp}")

    @property
    def takes_seed(self) -> bool:
        return self.takes("{seed}")


PLACEHOLDERS = ("output", "scene", "json", "name", "spp", "seed")


@dataclass(frozen=True)
class Command(TakesPlaceholders):
    """A program that writes {output}, and where it can takes {scene} or {json}, {spp} and {seed}.

    Placeholders are replaced after splitting, so that paths with spaces stay one argument.
    """

    words: tuple[str, ...]
    folder: Path | None = None
    """Where it runs; here by default."""
    json: Path | None = None
    """The scene as JSON, for the one scene that it renders."""

    @classmethod
    def parse(cls, command: str, folder: Path | None = None) -> "Command":
        words = tuple(split_command(command))
        if not words:
            raise NotFound("the renderer command is empty")
        found = cls(words, folder)
        refuse_unknown(words, PLACEHOLDERS, "the renderer command")
        if not found.takes("{output}"):
            raise NotFound("the renderer command has no {output}: say where it writes its image")
        return found

    @property
    def takes_scene(self) -> bool:
        return self.takes("{scene}", "{json}", "{name}")

    def arguments(self, scene: Path, output: Path, spp: int, seed: int) -> list[str]:
        """The words of one run."""
        values = {
            "{output}": str(output), "{scene}": str(scene), "{json}": str(self.json or ""),
            "{name}": scene.stem, "{spp}": str(spp), "{seed}": str(seed),
        }  # fmt: skip
        return self.filled(values)

    def render(self, scene: Path, spp: int, seed: int, timeout: float) -> Rendering:
        with tempfile.TemporaryDirectory(prefix="raycheck-", ignore_cleanup_errors=True) as folder:
            output = Path(folder) / "image.exr"
            words = self.arguments(scene, output, spp, seed)
            started = time.perf_counter()
            try:
                _run(words, Path(folder) / "messages.txt", timeout, self.folder)
                seconds = time.perf_counter() - started
                return Rendering(load_image(_written(Path(folder), output)), seconds)
            except (RenderTimeout, CannotRender):
                raise
            except (ImageError, RenderError) as error:
                again = shlex.join(self.arguments(scene, Path(output.name), spp, seed))
                again = f"cd {shlex.quote(str(self.folder))} && {again}" if self.folder else again
                kind = RenderError if isinstance(error, ImageError) else type(error)
                said = str(error).replace(folder + os.sep, "")
                raise kind(said + repeat(spp, seed, again)) from None


def _written(folder: Path, output: Path) -> Path:
    """The image: {output}, or the one file whose name starts with it ("{output}.pfm")."""
    if output.is_file():
        return output
    others = sorted(p for p in folder.iterdir() if p.name.startswith(output.name) and p.is_file())
    if len(others) == 1:
        return others[0]
    messages = folder / "messages.txt"
    raise RenderError("exit status 0, but {output} was not written" + _last_lines(messages))


def _run(words: Sequence[str], messages: Path, timeout: float, folder: Path | None = None) -> None:
    with messages.open("wb") as file:
        try:
            process = subprocess.Popen(
                words, stdin=subprocess.DEVNULL, stdout=file, stderr=subprocess.STDOUT,
                start_new_session=os.name == "posix", cwd=folder,
            )  # fmt: skip
        except OSError as error:
            why = f"{error.strerror or error}{windows_lines(words)}"
            raise NotFound(f"{words[0]}: cannot be started: {why}") from None
        late = threading.Event()

        def end_late() -> None:
            late.set()
            end(process)

        timer = threading.Timer(
            timeout, end_late
        )  # wait(timeout) polls: up to 50 ms more for each short render
        timer.start()
        try:
            status = process.wait()
        except BaseException:
            end(process)
            raise
        finally:
            timer.cancel()
    if late.is_set():
        raise RenderTimeout(f"no image after {timeout:.0f} s{_last_lines(messages)}")
    with messages.open(encoding="utf-8", errors="replace") as lines:
        refused = refusal(lines)
    if refused or status == Status.CANNOT:
        raise CannotRender(refused or unexplained(_last_lines(messages)))
    if status < 0:
        raise RenderError(f"ended by signal {signal_name(-status)}{_last_lines(messages)}")
    if status:
        raise RenderError(f"exit status {status}{_last_lines(messages)}{windows_lines(words)}")


def unexplained(said: str) -> str:
    """What is said of a renderer that refuses a scene by its exit status alone."""
    return f"the renderer does not support the scene (exit status {Status.CANNOT:d}){said}"


def _last_lines(messages: Path) -> str:
    """The last lines that it said, as the end of a sentence."""
    with messages.open("rb") as file:
        file.seek(max(0, messages.stat().st_size - 4000))
        return last_words(file.read().decode(errors="replace"))
