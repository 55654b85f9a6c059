"""Mistakes that nobody tuned for: what is said of them, and whether it is true.

Half are made by a renderer of its own, tests/unseen/renderer.cpp, the others are changes of oneray,
tests/unseen/changes.py; both were written without a look at the catalogue. `judge` has each verified by the one
scene that shows it; tests/unseen/truth.json says, for each sentence that names something, whether it is so.
"""

import difflib
import hashlib
import importlib.util
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from raycheck.base.data import ROOT
from raycheck.base.errors import CannotRender, PatchError
from raycheck.base.files import write_whole
from raycheck.calibration import mutants
from raycheck.calibration.lines import append_lines, read_lines
from raycheck.calibration.mutants import Mutant
from raycheck.judging.verify import verify
from raycheck.scene import export, variants
from raycheck.scene.techniques import technique

FOLDER = ROOT / "tests/unseen"
WORK = ROOT / "build/unseen"
SECONDS = 4.0
"""What the samples of a case may take."""


@dataclass(frozen=True)
class Unseen:
    """A mistake, or a convention, and what is true of its pictures."""

    name: str
    source: str
    """"renderer" or "oneray"."""
    scene: str
    words: str
    truth: str
    technique: str = ""
    patch: str = ""
    """Of oneray's sources."""

    @property
    def half(self) -> str:
        """Thresholds may be chosen by the even half; figures are those of the odd one."""
        return "odd" if hashlib.sha256(self.name.encode()).digest()[0] % 2 else "even"


def every() -> list[Unseen]:
    """All of them, in an order that has nothing to do with what they are."""
    found = [*_of_renderer(), *_of_oneray()]
    return sorted(found, key=lambda one: hashlib.sha256(one.name.encode()).hexdigest())


def _of_renderer() -> Iterator[Unseen]:
    done = subprocess.run([renderer(), "--list"], capture_output=True, text=True, check=True)
    for line in done.stdout.splitlines():
        name, scenes, words, truth = line.split("\t")
        yield Unseen(name, "renderer", scenes.split()[0], words, truth)


def _of_oneray() -> Iterator[Unseen]:
    spec = importlib.util.spec_from_file_location("unseen_changes", FOLDER / "changes.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    for change in module.CHANGES:
        path = f"{mutants.SOURCES}/{change.file}"
        text = (ROOT / path).read_text(encoding="utf-8")
        if text.count(change.old) != 1:
            raise PatchError(f"{change.name}: {path} has its text {text.count(change.old)} times, not once")
        lines = [t.splitlines(keepends=True) for t in (text, text.replace(change.old, change.new))]
        patch = "".join(difflib.unified_diff(*lines, f"a/{path}", f"b/{path}"))
        yield Unseen(
            change.name, "oneray", change.scene, change.words, change.truth, change.technique, f"\n{patch}"
        )


def renderer() -> str:
    """The renderer, compiled where its source has changed."""
    source = FOLDER / "renderer.cpp"
    program = WORK / f"renderer-{hashlib.sha256(source.read_bytes()).hexdigest()[:16]}"
    if not program.is_file():
        WORK.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=WORK) as folder:
            made = Path(folder) / "renderer"
            command = ["c++", "-std=c++17", "-O2", "-o", str(made), str(source)]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode:
                raise PatchError(f"{source}: cannot be built: {done.stderr[-800:]}")
            made.replace(program)
    return str(program)


def command(one: Unseen) -> str:
    """How `verify` runs the renderer that makes this mistake."""
    rest = "--spp {spp} --seed {seed} -o {output}"
    if one.source == "renderer":
        file = WORK / f"{one.scene}.json"
        write_whole(file, export.to_json(export.export(variants.variant(one.scene))))
        return f"{renderer()} {file} --mistake {one.name} {rest}"
    WORK.mkdir(parents=True, exist_ok=True)
    patch = WORK / f"unseen-{one.name}.patch"
    write_whole(patch, one.patch)
    mutant = Mutant(f"unseen-{one.name}", patch, "", one.words, "", one.scene, one.technique)
    options = [*technique(one.technique).options, *mutants.OPTIONS, "--quiet"]
    return f"{mutants.program(mutant)} {{scene}} {' '.join(options)} {rest}"


def judge(one: Unseen) -> dict[str, Any]:
    """Verdict and sentence by the scene that shows it."""
    found = {"name": one.name, "half": one.half, "source": one.source, "scene": one.scene}
    try:
        [case] = verify(command(one), [one.scene], seconds=SECONDS).cases
    except CannotRender as error:
        return {**found, "verdict": "none", "said": str(error)}
    return {**found, "verdict": case.verdict.value, "said": case.reason}


def measure(file: Path, wanted: Sequence[Unseen]) -> Iterator[dict[str, Any]]:
    """What `file` has is kept, the others are added to it as they come."""
    done = {line["name"] for line in read_lines(file)}
    for one in wanted:
        if one.name not in done:
            found = judge(one)
            append_lines(file, [found])
            yield found
