"""What makes images: a command, a Python callable, or files that are already there."""

import contextlib
import os
import shlex
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from raycheck.base.errors import ImageError, NotFound, RenderError, RenderTimeout
from raycheck.base.images import load_image
from raycheck.renderers.renderer import Rendering


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


class TakesPlaceholders:
    """What a command takes, by its words."""

    words: Sequence[str]

    def takes(self, *placeholders: str) -> bool:
        """Any of them?"""
        return any(placeholder in word for word in self.words for placeholder in placeholders)

    @property
    def takes_spp(self) -> bool:
        return self.takes("{spp}")

    @property
    def takes_seed(self) -> bool:
        return self.takes("{seed}")


@dataclass(frozen=True)
class Command(TakesPlaceholders):
    """A program that writes {output}, and where it can takes {scene}, {spp} and {seed}.

    Placeholders are replaced after splitting, so that paths with spaces stay one argument.
    """

    words: tuple[str, ...]

    @classmethod
    def parse(cls, command: str) -> "Command":
        words = tuple(split_command(command))
        if not words:
            raise NotFound("the renderer command is empty")
        found = cls(words)
        if not found.takes("{output}"):
            raise NotFound("the renderer command has no {output}: say where it writes its image")
        return found

    @property
    def takes_scene(self) -> bool:
        return self.takes("{scene}")

    def arguments(self, scene: Path, output: Path, spp: int, seed: int) -> list[str]:
        """The words of one run."""
        values = {"{output}": str(output), "{scene}": str(scene), "{spp}": str(spp), "{seed}": str(seed)}
        return [_fill(word, values) for word in self.words]

    def render(self, scene: Path, spp: int, seed: int, timeout: float) -> Rendering:
        with tempfile.TemporaryDirectory(prefix="raycheck-", ignore_cleanup_errors=True) as folder:
            output = Path(folder) / "image.exr"
            words = self.arguments(scene, output, spp, seed)
            started = time.perf_counter()
            _run(words, Path(folder) / "messages.txt", timeout)
            seconds = time.perf_counter() - started
            try:
                return Rendering(load_image(_written(Path(folder), output)), seconds)
            except ImageError as error:
                raise RenderError(str(error).replace(folder + os.sep, "")) from None


def _fill(word: str, values: dict[str, str]) -> str:
    for placeholder, value in values.items():
        word = word.replace(placeholder, value)
    return word


def _written(folder: Path, output: Path) -> Path:
    """The image: {output}, or the one file whose name starts with it ("{output}.pfm")."""
    if output.is_file():
        return output
    others = sorted(p for p in folder.iterdir() if p.name.startswith(output.name) and p.is_file())
    if len(others) == 1:
        return others[0]
    messages = folder / "messages.txt"
    raise RenderError("exit status 0, but {output} was not written" + _last_lines(messages))


def _run(words: Sequence[str], messages: Path, timeout: float) -> None:
    with messages.open("wb") as file:
        try:
            process = subprocess.Popen(
                words, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=file,
                start_new_session=os.name == "posix",
            )  # fmt: skip
        except OSError as error:
            raise NotFound(f"{words[0]}: cannot be started: {error.strerror or error}") from None
        late = threading.Event()

        def end() -> None:
            late.set()
            _kill(process)

        timer = threading.Timer(timeout, end)  # wait(timeout) polls: up to 50 ms more for each short render
        timer.start()
        try:
            status = process.wait()
        except BaseException:
            _kill(process)
            raise
        finally:
            timer.cancel()
    if late.is_set():
        raise RenderTimeout(f"no image after {timeout:.0f} s{_last_lines(messages)}")
    if status < 0:
        raise RenderError(f"ended by signal {_signal_name(-status)}{_last_lines(messages)}")
    if status:
        raise RenderError(f"exit status {status}{_last_lines(messages)}")


def _kill(process: subprocess.Popen) -> None:
    """End a renderer and whatever it started."""
    if process.poll() is not None:
        return
    with contextlib.suppress(ProcessLookupError):  # it may end just now
        if os.name == "posix":
            os.killpg(process.pid, signal.SIGKILL)  # it leads a group of its own
        else:
            process.kill()


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return str(number)


def _last_lines(messages: Path, count: int = 3) -> str:
    """The last lines on standard error, as the end of a sentence."""
    with messages.open("rb") as file:
        file.seek(max(0, messages.stat().st_size - 4000))
        lines = [line for line in file.read().decode(errors="replace").splitlines() if line.strip()]
    return "; it said: " + " | ".join(line.strip()[:300] for line in lines[-count:]) if lines else ""
