"""Mistakes that nobody tuned for: what is said of them, and whether it is true.

Half are made by a renderer of its own, tests/unseen/renderer.cpp, the others are changes of oneray,
tests/unseen/changes.py; both were written without a look at the catalogue. Each is verified by the one
scene that shows it. tests/unseen/labels.json says which of them a part of the light, a convention or the
catalogue covers, and which sentences are so; one that nobody has looked at counts as false.
"""

import difflib
import hashlib
import importlib.util
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scipy import stats

from raycheck.base.data import ROOT
from raycheck.base.errors import PatchError
from raycheck.base.files import write_whole
from raycheck.calibration import mutants
from raycheck.calibration.lines import append_lines, read_lines
from raycheck.calibration.mutants import Mutant
from raycheck.judging import sentences
from raycheck.judging.verify import verify
from raycheck.scene import export, variants
from raycheck.scene.techniques import technique
from raycheck.truth import provenance

FOLDER = ROOT / "tests/unseen"
WORK = ROOT / "build/unseen"
METHOD = 1
"""Version of how they are judged, see truth.provenance."""
CONFIDENCE = 0.95
"""Of Clopper's and Pearson's interval of the share of false sentences."""
SPP = {"renderer": 8, "oneray": 32}
"""Samples per pixel of each image, whatever the machine is busy with; oneray renders as many in less time."""


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
        old, new = (t.splitlines(keepends=True) for t in (text, text.replace(change.old, change.new)))
        patch = "".join(difflib.unified_diff(old, new, f"a/{path}", f"b/{path}"))
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
    WORK.mkdir(parents=True, exist_ok=True)
    rest = "--spp {spp} --seed {seed} -o {output}"
    if one.source == "renderer":
        file = WORK / f"{one.scene}.json"
        write_whole(file, export.to_json(export.export(variants.variant(one.scene))))
        return f"{renderer()} {file} --mistake {one.name} {rest}"
    patch = WORK / f"unseen-{one.name}.patch"
    write_whole(patch, one.patch)
    mutant = Mutant(f"unseen-{one.name}", patch, "", one.words, "", one.scene, one.technique)
    options = [*technique(one.technique).options, *mutants.OPTIONS, "--quiet"]
    return f"{mutants.program(mutant)} {{scene}} {' '.join(options)} {rest}"


def digest(one: Unseen) -> str:
    """Of what makes the pictures, what they are judged by, and the method."""
    made = (FOLDER / "renderer.cpp").read_text(encoding="utf-8")
    if one.patch:  # what it changes, wherever that stands in its file
        made = "".join(line for line in one.patch.splitlines(keepends=True) if line[:1] in "+-")
    rest = f"{provenance.digest(METHOD, rests_on(one))} {one.scene} {one.technique}"
    return hashlib.sha256(f"{made}{rest}".encode()).hexdigest()[:16]


def rests_on(one: Unseen) -> list[str]:
    """The pictures that it is compared with or changes."""
    own = [f"{one.scene} {one.technique} double"] if one.technique else []
    return [f"reference {one.scene}", *own]


def judge(one: Unseen, spp: int | None = None) -> dict[str, Any]:
    """Verdict and sentence by the scene that shows it, by images of `spp` samples per pixel or as of SPP."""
    [case] = verify(command(one), [one.scene], spp=spp or SPP[one.source]).cases
    return {
        "name": one.name, "half": one.half, "source": one.source, "scene": one.scene,
        "verdict": case.verdict.value, "said": case.reason, "digest": digest(one),
    }  # fmt: skip


def measure(file: Path, wanted: Sequence[Unseen]) -> Iterator[dict[str, Any]]:
    """What `file` has of the same pictures is kept, the others are added to it as they come."""
    done = {(line["name"], line["digest"]) for line in read_lines(file)}
    for one in wanted:
        if (one.name, digest(one)) not in done:
            found = judge(one)
            append_lines(file, [found])
            yield found


def named(said: str) -> str:
    """What a FAIL's sentence names, its figures left out; empty where it names nothing."""
    return re.sub(r"\d+(\.\d+)?", "#", sentences.by_what(said))


def summary(file: Path, wanted: Sequence[Unseen]) -> dict[str, object]:
    """Every case, and counts for the half that nothing was tuned by, and for the other."""
    lines = {line["name"]: line for line in read_lines(file)}
    labels = json.loads((FOLDER / "labels.json").read_text(encoding="utf-8"))
    judged = [one for one in wanted if one.name in lines and lines[one.name]["digest"] == digest(one)]
    rows = [_row(one, lines[one.name], labels.get(one.name, {})) for one in judged]
    pictures = {picture for one in judged for picture in rests_on(one)}
    return {
        "provenance": provenance.provenance(METHOD, pictures),
        **{source: sum(row["source"] == source for row in rows) for source in ("renderer", "oneray")},
        **{half: _counts([row for row in rows if row["half"] == half]) for half in ("odd", "even")},
        "rows": rows,
    }


def _row(one: Unseen, line: dict[str, Any], label: dict[str, Any]) -> dict[str, Any]:
    """`true` is None where nothing is named, and False where nobody has looked at what is."""
    told = named(line["said"]) if line["verdict"] == "FAIL" else ""
    return {
        "name": one.name, "half": one.half, "source": one.source, "scene": one.scene,
        "verdict": line["verdict"], "said": line["said"], "covered": label.get("covered", False),
        "true": told in label.get("true", []) if told else None,
    }  # fmt: skip


def _counts(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    fails = [row for row in rows if row["verdict"] == "FAIL"]
    names = [row for row in fails if row["true"] is not None]
    false = [row["name"] for row in names if not row["true"]]
    covered = [row for row in fails if row["covered"]]
    low, high = stats.binomtest(len(false), max(len(names), 1)).proportion_ci(CONFIDENCE, "exact")
    return {
        "of": len(rows), "failed": len(fails), "named": len(names), "false": false,
        "false_rate": [round(float(low), 5), round(float(high), 5)], "confidence": CONFIDENCE,
        "covered": len(covered), "covered_named": sum(bool(row["true"]) for row in covered),
    }  # fmt: skip
