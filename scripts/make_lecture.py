"""Make the lecture's pages: docs/lecture, where a section each is text, into one file that renders live.

    python scripts/make_lecture.py [-o build/lecture]

It leaves index.html, which needs no network and no server; figures/NAME.svg, the drawings for slides; and
solved.html, for teachers: the assignment's tasks with the functions that the handout lacks. oneray is
compiled to WebAssembly with the mistakes of the sections to be switched on (lecture_switches.py); it, the
scenes and Mitsuba's pictures of them are in the page, packed. The C that a section shows is taken from the
sources.

A section is docs/lecture/NAME.html: between two lines +++ TOML that says what it renders, then HTML, a
template whose $…$ and $$…$$ are LaTeX, which becomes MathML. `Section` says what the TOML may have.
"""

from __future__ import annotations

import argparse
import base64
import gzip
import html
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
import latex2mathml.converter
import numpy as np
from lecture_switches import copy_with_switches
from markupsafe import Markup

from raycheck.base.errors import NotFound, PlainError, RenderError
from raycheck.base.files import made_folder, write_whole
from raycheck.calibration import mutants
from raycheck.grading import c_functions
from raycheck.scene.techniques import technique
from raycheck.scene.variants import variant
from raycheck.truth.expected import truth_of
from raycheck.truth.references import load_reference

ROOT = Path(__file__).resolve().parents[1]
TEXTS = ROOT / "docs/lecture"
SOURCES = ROOT / "src/oneray"
ASSETS = ROOT / "src/raycheck/templates"
TOOLS = ("clang-19", "wasm-ld-19")
PACKAGES = "clang-19 lld-19 wasi-libc libclang-rt-19-dev-wasm32"


@dataclass(frozen=True)
class Section:
    """One technique."""

    name: str
    """Its file's, L10."""
    about: dict[str, Any]
    """`title`; `claim`, a sentence; `ways`, tables of a `name`, a `technique` or `options`, and what
    differs from the section: `scene`, `settings` (-D) and `reference`; `shown`, which of them are A and B
    at first, from 0; `scene`; `spp`; `code`, "file function" each; `mistakes`, names of tests/mutants, with
    the way that shows each behind a colon; `check`, commands. Without ways the page shows the converged
    picture, and says `recorded`.
    """
    text: str

    @property
    def ways(self) -> list[dict[str, Any]]:
        """What can be rendered, as the page's script takes it."""
        found = []
        for way in self.about.get("ways", []):
            scene = way.get("scene", self.about["scene"])
            options = [*technique(way["technique"]).options] if "technique" in way else []
            options += way.get("options", "").split() + [f"-D{one}" for one in way.get("settings", [])]
            reference = way.get("reference", scene)
            found.append({"name": way["name"], "scene": scene, "options": options, "reference": reference})
        return found

    @property
    def mistakes(self) -> list[tuple[str, int]]:
        """Names, and the way that shows each."""
        pairs = (one.partition(":") for one in self.about.get("mistakes", []))
        return [(name, int(way or len(self.ways) - 1)) for name, _, way in pairs]


def read_section(path: Path) -> Section:
    _, about, text = path.read_text(encoding="utf-8").split("+++\n", 2)
    return Section(path.stem, tomllib.loads(about), text)


def order(name: str) -> tuple[int, int]:
    """The lecture's techniques, then what is beyond it."""
    return (name[0] != "L", int(name[1:]) if name[0] in "LP" else 99)


def read_sections() -> list[Section]:
    """All, in their order."""
    found = (read_section(path) for path in TEXTS.glob("[A-Z][0-9]*.html"))
    return sorted(found, key=lambda one: order(one.name))


def mistakes_of(sections: list[Section]) -> list[str]:
    """Mistake number 1 is the first."""
    return list(dict.fromkeys(name for one in sections for name, _ in one.mistakes))


def with_mathml(text: str) -> str:
    """With formulas as MathML. One on lines of its own may wrap where its LaTeX has a \\quad or \\qquad."""

    def mathml(latex: str, display: str) -> str:
        return with_plain_powers(latex2mathml.converter.convert(latex, display=display))

    def shown(found: re.Match[str]) -> str:
        if found[1] is None:
            return mathml(found[2], "inline")
        parts = (part for part in re.split(r"\\q?quad(?![a-z])", found[1]) if part.strip())
        whole = "".join(mathml(part, "block") for part in parts)
        return f'<div class="formula" tabindex="0">{whole}</div>'

    return re.sub(r"\$\$(.+?)\$\$|\$([^$\n]+)\$", shown, text, flags=re.DOTALL)


_RAISED = re.compile(r"<msup>((?:(?!</?msup>).)*?)<mn>([2-5])</mn></msup>")


def with_plain_powers(math: str) -> str:
    """Powers as characters: where a system has no font for mathematics, browsers raise them too far."""

    def raised(found: re.Match[str]) -> str:
        power = "²³⁴⁵"[int(found[2]) - 2]
        return f'<mrow>{found[1]}<mo lspace="0" rspace="0">{power}</mo></mrow>'

    return _RAISED.sub(raised, math)


def code_of(place: str) -> dict[str, Any]:
    """A function with the comment above it: where it is, and its lines."""
    file, name = place.split()
    path = SOURCES / file
    text = path.read_text(encoding="utf-8")
    found = [one for one in c_functions.functions(path, text) if one.name == name]
    if len(found) != 1:
        raise NotFound(f"{path}: {len(found)} functions are called {name}")
    lines = text.splitlines()
    last = text.count("\n", 0, found[0].end - 1)
    first = found[0].line - 1
    while (above := lines[first - 1]).strip() and not above.startswith(("}", "#")) and "*/" not in above:
        first -= 1
    if lines[first - 1].rstrip().endswith("*/"):
        first -= 1
        while "/*" not in lines[first]:
            first -= 1
    shown = coloured(lines[first : last + 1])
    return {"file": f"src/oneray/{file}", "name": name, "line": first + 1, "html": shown}


def solution(name: str) -> dict[str, Any]:
    """A function that the handout lacks."""
    return code_of(f"{c_functions.find(SOURCES, name).path.relative_to(SOURCES).as_posix()} {name}")


def coloured(lines: list[str]) -> Markup:
    """C with its comments apart."""
    text = html.escape("\n".join(lines), quote=False)
    return Markup(re.sub(r"/\*.*?\*/", lambda found: f"<i>{found[0]}</i>", text, flags=re.DOTALL))


def packed(data: bytes) -> str:
    return base64.b64encode(gzip.compress(data, 9, mtime=0)).decode()


def reference(label: str) -> dict[str, Any]:
    """The converged picture, in closed form where there is one: base64 of halves, rows from the top."""
    name, _, parameter = label.partition("@")
    given = dict([parameter.split("=")]) if parameter else {}
    mean = truth_of(load_reference(variant(name, given))).mean
    halves = np.clip(mean, 0, 65504).astype("<f2")
    height, width = halves.shape[:2]
    return {"width": width, "height": height, "data": base64.b64encode(halves.tobytes()).decode()}


def lacking() -> str:
    """What the compilation wants and this machine has not."""
    missing = [tool for tool in TOOLS if not shutil.which(tool)]
    missing += ["wasi-libc"] * (not Path("/usr/include/wasm32-wasi").is_dir())
    return ", ".join(missing)


def compile_program(folder: Path, names: list[str]) -> Path:
    """oneray.wasm with switches for these mistakes."""
    if what := lacking():
        raise NotFound(f"{what}: not there; the lecture's pages want: apt-get install {PACKAGES}")
    known = {one.name: one for one in mutants.catalogue()}
    copy_with_switches(ROOT, folder, [known[name] for name in names])
    clean = {k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MAKELEVEL", "MFLAGS")}
    words = ["make", "-s", "BUILD=build", "WARN=", "build/wasm/oneray.wasm"]
    if subprocess.run(words, cwd=folder, check=False, env=clean).returncode:
        raise RenderError(f"{folder}: oneray with mistakes to switch on does not compile")
    return folder / "build/wasm/oneray.wasm"


def figure_file(drawing: str, style: str) -> str:
    """A drawing by itself, with its style."""
    defs = (TEXTS / "defs.svg").read_text(encoding="utf-8")
    return drawing.replace("<svg ", '<svg xmlns="http://www.w3.org/2000/svg" ', 1).replace(
        ">", f"><style>{style}</style>{defs}", 1
    )


def make(folder: Path) -> Path:
    sections = read_sections()
    catalogue = {one.name: one for one in mutants.catalogue()}
    names = mistakes_of(sections)
    program = compile_program(folder / "source", names)
    ways = [way for one in sections for way in one.ways]
    scenes = {f"{way['scene']}.xml" for way in ways} | {"lecture.xml"}
    pictures = {way["reference"] for way in ways} | {one.about["scene"] for one in sections if not one.ways}
    data = {
        "scenes": {s: (ROOT / "scenes" / s).read_text(encoding="utf-8") for s in sorted(scenes)},
        "references": {r: reference(r) for r in sorted(pictures)},
    }
    templates = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEXTS), autoescape=True, trim_blocks=True, lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )  # fmt: skip
    tasks = tomllib.loads((ROOT / "docs/lecture12.toml").read_text(encoding="utf-8"))["task"]
    shown = []
    for one in sections:
        body = templates.from_string(with_mathml(one.text)).render(name=one.name)
        drawing = re.search(r"<svg .*?</svg>", body, re.DOTALL)
        shown.append({
            "name": one.name, "about": one.about, "body": Markup(body),
            "figure": drawing[0] if drawing else "",
            "code": [code_of(place) for place in one.about.get("code", [])],
            "mistakes": [
                {"number": names.index(n) + 1, "way": way, "says": catalogue[n].mistake, "name": n,
                 "symptom": catalogue[n].symptom, "harmless": catalogue[n].equivalent or ""}
                for n, way in one.mistakes
            ],
            "ways": one.ways, "tasks": [task for task in tasks if task["lecture"] == one.name],
            "first": one.about.get("shown", [0, len(one.ways) - 1]),
        })  # fmt: skip
    drawn = (TEXTS / "figures.css").read_text(encoding="utf-8")
    for one in shown:
        if one["figure"]:
            drawings = made_folder(folder / "figures")
            write_whole(drawings / f"{one['name']}.svg", figure_file(one["figure"], drawn))
    page = templates.get_template("page.html").render(
        sections=shown, program=packed(program.read_bytes()), data=packed(json.dumps(data).encode()),
        defs=Markup((TEXTS / "defs.svg").read_text(encoding="utf-8")),
        style=Markup(drawn + (TEXTS / "lecture.css").read_text(encoding="utf-8")),
        plot_style=_asset("uplot/uPlot.min.css"), plot=_asset("uplot/uPlot.iife.min.js"),
        runner=Markup((ROOT / "src/wasm/oneray.js").read_text(encoding="utf-8")),
        worker=Markup((TEXTS / "worker.js").read_text(encoding="utf-8")),
        script=Markup((TEXTS / "lecture.js").read_text(encoding="utf-8")),
    )  # fmt: skip
    write_whole(folder / "index.html", page)
    solved = [{"task": t, "code": [solution(name) for name in t.get("functions", [])]} for t in tasks]
    style = Markup((TEXTS / "lecture.css").read_text(encoding="utf-8"))
    handout = templates.get_template("solved.html").render(tasks=solved, style=style)
    write_whole(folder / "solved.html", handout)
    return folder / "index.html"


def _asset(name: str) -> Markup:
    return Markup((ASSETS / name).read_text(encoding="utf-8"))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "build/lecture")
    folder = parser.parse_args().output.resolve()
    try:
        page = make(folder)
    except PlainError as error:
        sys.exit(f"make_lecture: {error}")
    print(f"{page}: {page.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
