"""What a run of verify judges: cases of a scene and a technique, and which were left out and why."""

import re
import shutil
import subprocess
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from numpy.typing import ArrayLike

from raycheck.base.errors import NotFound, ReferenceError_
from raycheck.renderers import commands, manifest
from raycheck.renderers.callables import Function
from raycheck.renderers.oneray import oneray_command, oneray_path
from raycheck.renderers.renderer import Renderer
from raycheck.scene import document, export
from raycheck.scene.content import SceneContent, read_content
from raycheck.scene.support import Support
from raycheck.scene.techniques import BEST, ON_REQUEST, TECHNIQUES, Technique, applicable, technique
from raycheck.scene.variants import Variant, ladder
from raycheck.truth import references

COVER = 2
"""A quick run over all scenes judges each technique on so many of them, and each scene at least once."""
PROBE_SPP = 16


@dataclass(frozen=True)
class Task:
    """One case to be judged."""

    of: Variant
    technique: str
    renderer: Renderer
    path: Path
    """The scene file that the renderer gets."""

    @property
    def label(self) -> str:
        return self.of.label

    @property
    def name(self) -> str:
        """The case: "scene, technique", or the scene alone of another renderer."""
        return self.label if self.technique == "renderer" else f"{self.label}, {self.technique}"

    @property
    def content(self) -> SceneContent:
        return read_content(self.of.path, self.of.parameters)

    @property
    def unbounded(self) -> bool:
        """Marked in the scene as having samples without bound; another renderer's may be of any kind."""
        marked = self.content.unbounded
        return self.technique in marked or (self.technique == "renderer" and bool(marked))

    @property
    def swept(self) -> bool:
        """It is a command of which nothing is known, and may have a parameter that --consistent sweeps."""
        return self.technique == "renderer" and isinstance(self.renderer, commands.Command)

    @property
    def independent(self) -> bool:
        """The samples of a pixel are independent of each other; another renderer's are taken to be."""
        return self.technique == "renderer" or technique(self.technique).independent


@dataclass
class Agenda:
    """The cases of a run."""

    tasks: list[Task] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)
    """Why a case, "scene, technique", is not judged where the technique would apply."""


def oneray_agenda(
    scenes: Sequence[Variant], techniques: Sequence[str], *, cover: bool = False, variants: bool = False
) -> Agenda:
    """oneray with every technique that applies, or with those named.

    `cover` picks a few cases that take every technique and every scene in. `variants` adds the scenes' other
    depths, with oneray's default technique.
    """
    oneray = oneray_path()
    named = {technique(name).name for name in techniques}
    chosen = [one for one in (*TECHNIQUES, *ON_REQUEST) if one.name in named]
    _require_rendered(oneray, scenes)
    agenda = Agenda()
    pairs = []
    found = False
    for of in scenes:
        content = read_content(of.path, of.parameters)
        for one in chosen or applicable(content):
            if one.why_not(content):
                continue
            found = True
            refusal = _refusal(oneray, one, of) if "L17" in one.lecture else None
            if refusal:
                agenda.left_out[f"{of.label}, {one.name}"] = refusal
            else:
                pairs.append((of, one))
    if not found:
        raise NotFound(f"{', '.join(techniques)} applies to none of {_names(scenes)}")
    if not pairs:
        raise NotFound(nothing_left(agenda.left_out))
    if cover:
        pairs = _cover(pairs)
    if variants:
        for of in (of for of in ladder() if of.parameters):
            if references.is_fresh(of):
                pairs.append((of, standard_technique(of)))
            else:
                agenda.left_out[of.label] = f"there is no fresh reference; make it with: {of.renew_command}"
    for of, one in pairs:
        command = oneray_command(oneray, one.options, of.parameters)
        agenda.tasks.append(Task(of, one.name, command, of.path))
    return agenda


def _require_rendered(oneray: Path, scenes: Sequence[Variant]) -> None:
    """NotFound, once for a scene whatever is asked of it, with what oneray says where it renders no pixel."""
    refused = []
    for of in scenes:
        if of.canonical and not of.parameters:
            continue
        command = oneray_command(oneray, ("--crop", "0,0,1,1"), of.parameters)
        with tempfile.TemporaryDirectory(prefix="raycheck-") as folder:
            words = command.arguments(of.path, Path(folder) / "out.exr", 1, 1)
            done = subprocess.run(
                words, capture_output=True, text=True, errors="surrogateescape", check=False
            )
        if done.returncode == 2:
            lines = [line for line in done.stderr.splitlines() if not line.startswith("oneray: warning: ")]
            refused.append(f"oneray cannot render {of.label}: {'; '.join(lines)}")
    if refused:
        raise NotFound("; ".join(refused))


def renderer_agenda(
    renderer: str | Path | Callable[[Path, int, int], ArrayLike] | Renderer,
    scenes: Sequence[Variant], folder: Path, *, explicit: bool,
) -> Agenda:  # fmt: skip
    """Another renderer on each scene: a command, a folder with a raycheck.toml, a callable. A scene with
    other parameters is written into `folder` as a file whose defaults they are, and every scene once as JSON
    where the command takes {json}. `explicit`: the user named the scenes.
    """
    chosen: Renderer
    if isinstance(renderer, str | Path):
        chosen = manifest.command_of(renderer)
    else:
        chosen = renderer if isinstance(renderer, Renderer) else Function(renderer)
    if not chosen.takes_scene and (len(scenes) != 1 or not explicit):
        raise NotFound("the renderer command has no {scene}: name the one SCENE that it renders")
    agenda = Agenda()
    for index, of in enumerate(scenes):
        own = chosen
        if isinstance(chosen, commands.Command) and chosen.takes("{json}"):
            told = folder / str(index) / f"{_file_name(of)}.json"
            try:
                text = export.to_json(export.export(of))
            except ReferenceError_ as error:
                agenda.left_out[of.label] = f"{NO_JSON}: {error}"
                continue
            told.parent.mkdir()
            told.write_text(text, encoding="utf-8")
            own = replace(chosen, json=told)
        path = write_variant(of, folder) if of.parameters else of.path
        agenda.tasks.append(Task(of, "renderer", own, path))
    if not agenda.tasks:
        raise NotFound(nothing_left(agenda.left_out))
    return agenda


NO_JSON = "it cannot be written as JSON"


def supported(scenes: Sequence[Variant], supports: Support | None) -> tuple[list[Variant], dict[str, str]]:
    """The scenes that need no more than a renderer supports, and of the others why not, by label; NotFound if
    these are all.
    """
    if supports is None:
        return list(scenes), {}
    chosen, left_out = [], {}
    for of in scenes:
        try:
            lacks = supports.lacks(export.export(of)["needs"])
        except ReferenceError_ as error:
            left_out[of.label] = f"{NO_JSON}, which says what it needs: {error}"
            continue
        if lacks:
            left_out[of.label] = f"needs {' and '.join(lacks)}"
        else:
            chosen.append(of)
    if not chosen:
        raise NotFound(f"no scene is left: {nothing_left(left_out)}")
    return chosen, left_out


def nothing_left(left_out: Mapping[str, str]) -> str:
    """Why nothing is judged, in one line."""
    return "; ".join(f"{case}: {why}" for case, why in left_out.items())


def write_variant(of: Variant, folder: Path) -> Path:
    """The scene as a file of its own: parameters as defaults, paths of mesh files absolute."""
    path = folder / f"{_file_name(of)}.xml"
    document.write(of.document().moved(lambda mesh: str(mesh.resolve())), path)
    return path


def _file_name(of: Variant) -> str:
    return re.sub(r"[^-@=,.+A-Za-z0-9_]", "_", of.label)


def kept_scene(task: Task, said: str) -> str:
    """A scene file that was written for this run is kept where a sentence names it, which then names the
    copy: its command can be repeated.
    """
    written = [] if task.path == task.of.path else [task.path]
    if isinstance(task.renderer, commands.Command) and task.renderer.json:
        written.append(task.renderer.json)
    for path in (path for path in written if str(path) in said):
        copy = Path(tempfile.mkdtemp(prefix="raycheck-scene-")) / path.name
        shutil.copy(path, copy)
        said = said.replace(str(path), str(copy))
    return said


def _names(scenes: Sequence[Variant]) -> str:
    return ", ".join(of.label for of in scenes)


def standard_technique(of: Variant) -> Technique:
    """oneray's default technique for the scene, by the name that says all that it does there."""
    possible = {one.name: one for one in applicable(read_content(of.path, of.parameters))}
    return next(possible[name] for name in (BEST, "mis-power", "nee") if name in possible)


def _cover(pairs: list[tuple[Variant, Technique]]) -> list[tuple[Variant, Technique]]:
    """Choose each technique on `COVER` scenes, those with the fewest cases, and each scene at least once."""
    by_technique: dict[str, list[Variant]] = {}
    for of, one in pairs:
        by_technique.setdefault(one.name, []).append(of)
    taken: set[tuple[str, str]] = set()
    load: Counter[str] = Counter()
    for name, scenes in sorted(by_technique.items(), key=lambda item: len(item[1])):
        for of in sorted(scenes, key=lambda of: (load[of.label], of.label))[:COVER]:
            taken.add((of.label, name))
            load[of.label] += 1
    for of, one in pairs:
        if not load[of.label]:
            taken.add((of.label, one.name))
            load[of.label] += 1
    return [(of, one) for of, one in pairs if (of.label, one.name) in taken]


def _refusal(oneray: Path, one: Technique, of: Variant) -> str | None:
    """Why light tracing cannot render the scene, in oneray's words; None if it can."""
    if not read_content(of.path, of.parameters).specular:
        return None
    command = oneray_command(oneray, one.options, of.parameters)
    with tempfile.TemporaryDirectory(prefix="raycheck-") as folder:
        words = command.arguments(of.path, Path(folder) / "out.exr", PROBE_SPP, 1)
        done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode == 2 and "mirror or glass" in done.stderr:
        return done.stderr.strip().splitlines()[-1].removeprefix(f"oneray: {of.path}: ")
    return None
