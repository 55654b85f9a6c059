"""The student's starting point: oneray without the bodies of the functions that the tasks name."""

import re
import shlex
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

from raycheck.base.data import ROOT
from raycheck.base.errors import NotFound
from raycheck.grading.assignment import Assignment, Task
from raycheck.grading.c_functions import Function, find
from raycheck.scene import document
from raycheck.scene.techniques import technique

SOURCES = Path("src/oneray")
MANIFEST = """\
build = "make"
command = "sh render.sh {task} {scene} {spp} {seed} {output}"
"""
HEADER = """\
# make     builds build/oneray, with one kernel at this machine's width
KERNELS ?= generic
LANES   ?= native
"""
WARNINGS = "-Wall -Wextra -Wno-unused -Wno-unused-parameter"
FIRST, LAST = "\nBUILD   ?=", "\nPREFIX ?="
"""Where the part of the Makefile that builds oneray begins and ends."""


def write_handout(assignment: Assignment, target: Path) -> list[Function]:
    """The folder `target`, whole or not at all; the functions that are left to the student, in the order of
    the tasks. NotFound where a function is not there once, or the sources are not there.
    """
    if not (ROOT / "Makefile").is_file():
        raise NotFound(f"{ROOT}: there are no sources of oneray; handout needs a checkout of them")
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise NotFound(f"{target} is there already: name a new folder")
    if not any(task.functions for task in assignment.tasks):
        raise NotFound(f"{assignment.path}: no task names functions to leave to the student")
    if not target.absolute().parent.is_dir():
        raise NotFound(f"{target}: there is no folder {target.absolute().parent}")
    with tempfile.TemporaryDirectory(prefix=f".{target.name}-", dir=target.absolute().parent) as place:
        work = Path(place) / "handout"
        shutil.copytree(ROOT / SOURCES, work / SOURCES)
        left = [_leave_out(work / SOURCES, name, tasks) for name, tasks in _named(assignment).items()]
        (work / "Makefile").write_text(_makefile(), encoding="utf-8", newline="\n")
        (work / "raycheck.toml").write_text(MANIFEST, encoding="utf-8", newline="\n")
        (work / "render.sh").write_text(_script(assignment.tasks), encoding="utf-8", newline="\n")
        (work / "README.md").write_text(_readme(assignment, left), encoding="utf-8", newline="\n")
        _copy_scenes(assignment, work / "scenes")
        if target.exists():
            target.rmdir()
        work.replace(target)
    return left


def _named(assignment: Assignment) -> dict[str, list[str]]:
    """Ids of the tasks that need a function, by its name."""
    found: dict[str, list[str]] = {}
    for task in assignment.tasks:
        for name in task.functions:
            found.setdefault(name, []).append(task.id)
    return found


def _leave_out(sources: Path, name: str, tasks: Sequence[str]) -> Function:
    function = find(sources, name)
    text = function.path.read_text(encoding="utf-8")
    why = f"not implemented: {name}, for {', '.join(tasks)}"
    literal = re.sub(r'([\\"])', r"\\\1", why).replace("%", "%%")
    text = f'{text[: function.begin]}{{\n    die("{literal}");\n}}{text[function.end :]}'
    function.path.write_text(_including(text, "message.h"), encoding="utf-8", newline="\n")
    return function


def _including(text: str, header: str) -> str:
    """The source with `header` among what is included."""
    line = f'#include "{header}"'
    if line in text:
        return text
    places = [*re.finditer(r'^#include ".*\n', text, re.MULTILINE)]
    places = places or [*re.finditer(r"^#define \w+_H\n", text, re.MULTILINE)]
    at = places[-1].end() if places else 0
    return f"{text[:at]}{line}\n{text[at:]}"


def _makefile() -> str:
    """The part of oneray's that builds it. Half-written functions leave parameters and functions unused, and
    no warning is an error.
    """
    whole = (ROOT / "Makefile").read_text(encoding="utf-8")
    first, last = whole.find(FIRST), whole.find(LAST)
    if not 0 < first < last:
        raise NotFound(f"{ROOT / 'Makefile'}: the part that builds oneray is not found in it")
    part = re.sub(r"^(WARN\s*:=).*$", rf"\1 {WARNINGS}", whole[first:last], count=1, flags=re.MULTILINE)
    phony = ".PHONY: all FORCE"
    return HEADER + re.sub(r"^\.PHONY:.*$", phony, part, count=1, flags=re.MULTILINE).rstrip() + "\n"


def _script(tasks: Sequence[Task]) -> str:
    """Each task is rendered with the technique that it is about."""
    cases = [
        f"{shlex.quote(task.id)}) options={shlex.quote(' '.join(technique(task.technique).options))} ;;"
        for task in tasks
        if task.technique
    ]
    return "\n".join((
        "#!/bin/sh", "# render.sh TASK SCENE SPP SEED OUTPUT: oneray with the task's technique.",
        "case $1 in", *cases, "*) options= ;;", "esac",
        'exec build/oneray "$2" --spp "$3" --seed "$4" -o "$5" --quiet $options', "",
    ))  # fmt: skip


def _copy_scenes(assignment: Assignment, folder: Path) -> None:
    """Those that students may see, with their meshes."""
    folder.mkdir()
    for of in {assignment.path_of(scene) for task in assignment.tasks for scene in task.scenes}:
        shutil.copy(of, folder)
        for mesh in document.read(of).names():
            (folder / mesh).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(of.parent / mesh, folder / mesh)


def _readme(assignment: Assignment, left: Sequence[Function]) -> str:
    place = {f.name: f.path.as_posix().rpartition(f"/{SOURCES}/")[2] for f in left}
    rows, seen = [], set()
    for task in assignment.tasks:
        new = [name for name in task.functions if name not in seen]
        older = [name for name in task.functions if name in seen]
        seen.update(new)
        places = ", ".join(f"`{n}` ({SOURCES / place[n]})" for n in new)
        places = places or ("" if older else "done already")
        needs = ", ".join(f"`{n}`" for n in older)
        rows.append(f"| {task.id} | {task.title} | {places} | {needs} | {', '.join(task.scenes)} |")
    table = "\n".join(("| task | | to write | needs besides | scenes |", "|---|---|---|---|---|", *rows))
    return f"""\
# {assignment.title or assignment.name}

This is oneray, a path tracer, without the bodies of some functions: each says `not implemented` and ends the
program. The comment above a function says what it is to do, and the formula. It builds with a C compiler,
make, pkg-config and the libraries expat, zlib, OpenEXR, libpng and stb.

    make
    sh render.sh {shlex.quote(assignment.tasks[0].id)} {_example(assignment)} 64 1 image.exr

{table}

oneray takes several paths along at a time: a `Real` has a number for each of them, a `Mask` a yes or no, and
`select(mask, a, b)` is what `mask ? a : b` is for one ({SOURCES / "lanes/lane.h"}). Hand in this folder
without `build`.
"""


def _example(assignment: Assignment) -> str:
    return f"scenes/{assignment.path_of(assignment.tasks[0].scenes[0]).name}"
