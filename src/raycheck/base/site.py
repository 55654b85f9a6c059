"""Pages for a browser, of templates/report: a folder of them, each of which loads what it shows when it is
opened, or all of them in one file. Either needs no network: scripts and data are files beside the pages, as a
browser lets no page read others' files from a disk but as scripts.

    index.html  pages/NAME.html  assets/  data/NAME.js  pictures/NAME.png
"""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

from raycheck.base import pictures
from raycheck.base.data import PACKAGE
from raycheck.base.files import write_whole
from raycheck.base.images import write_png
from raycheck.base.text import duration, number, percent, rounded, signed

TEMPLATES = PACKAGE / "templates"
INDEX = "index"
SCRIPTS = ("uplot/uPlot.iife.min.js", "report/plots.js", "report/viewer.js")
"""Of the pages that have data."""
COMMON = "report/report.js"
"""Of all."""


def environment(folder: Path = TEMPLATES) -> jinja2.Environment:
    """Templates whose values are escaped."""
    loader = jinja2.FileSystemLoader(folder)
    made = jinja2.Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True)
    made.globals |= {"percent": percent, "signed": signed, "duration": duration, "number": number}
    made.globals |= {"range": int(pictures.RANGE)}
    return made


def asset(name: str) -> Markup:
    """The text of a script or style sheet."""
    return Markup((TEMPLATES / name).read_text(encoding="utf-8"))


def script(name: str, value: object) -> Markup:
    """A script that gives pages the data `value` under a name; nothing in it can end a <script>."""
    text = json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return Markup(f"(window.raycheck = window.raycheck || {{}})[{json.dumps(name)}] = {text};\n").replace(
        "</", "<\\/"
    )


@dataclass
class Site:
    """Where pages go."""

    folder: Path
    single: bool = False
    bodies: list[tuple[str, Markup]] = field(default_factory=list)
    """Of a single page so far, with their names."""
    scripts: list[Markup] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        self.templates = environment(TEMPLATES / "report")

    def _write(self, name: str, text: str) -> Path:
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, text)
        return path

    def picture(self, name: str, pixels: pictures.Bytes) -> str:
        """An 8-bit picture (H, W, 3): where it is below the folder, or itself."""
        if self.single:
            return pictures.data_uri(pixels)
        path = self.folder / "pictures" / f"{name}.png"
        path.parent.mkdir(exist_ok=True)
        write_png(path, pixels)
        return f"pictures/{path.name}"

    def data(self, name: str, value: object) -> None:
        """What the scripts of the page of this name show."""
        text = script(name, rounded(value))
        if self.single:
            self.scripts.append(text)
        else:
            self._write(f"data/{name}.js", text)

    def page(self, name: str, title: str, template: str, data: bool = False, **what: Any) -> Path:
        """Write a page, or keep it for the single one; with `data`, those of its name are there."""
        up = "" if self.single or name == INDEX else "../"

        def link(to: str, anchor: str = "") -> str:
            if self.single:
                return f"#{to}.{anchor}" if anchor else f"#{to}"
            path = "index.html" if to == INDEX else f"pages/{to}.html"
            return f"{up}{path}" + (f"#{to}.{anchor}" if anchor else "")

        def at(place: str) -> str:
            return place if place.startswith("data:") else f"{up}{place}"

        own = {
            "name": name, "title": title, "link": link, "at": at, "single": self.single,
            "h": 2 if self.single and name != INDEX else 1,
        }  # fmt: skip
        body = Markup(self.templates.get_template(template).render(own | what))
        if self.single:
            self.bodies.append((name, body))
            return self.folder / "index.html"
        code = [f"{up}assets/{Path(one).name}" for one in (*SCRIPTS[: 3 * data], COMMON)]
        own |= {"scripts": [*([f"{up}data/{name}.js"] if data else []), *code]}
        own |= {"style": f"{up}assets/report.css", "bodies": [(name, body)]}
        text = self.templates.get_template("page.html").render(own | what)
        return self._write("index.html" if name == INDEX else f"pages/{name}.html", text)

    def finish(self, title: str) -> Path:
        """Write what all pages share; the page to open."""
        style = asset("report/report.css") + asset("uplot/uPlot.min.css")
        code = [asset(name) for name in (*SCRIPTS, COMMON)]
        if not self.single:
            self._write("assets/report.css", style)
            for name, text in zip((*SCRIPTS, COMMON), code, strict=True):
                self._write(f"assets/{Path(name).name}", text)
            self._write("assets/uPlot-LICENSE.txt", asset("uplot/LICENSE"))
            return self.folder / "index.html"
        code = [*self.scripts, *code]
        page = self.templates.get_template("page.html").render(
            name=INDEX, title=title, single=True, bodies=self.bodies, inline_style=style, inline=code,
            link=lambda to, anchor="": f"#{to}",
        )  # fmt: skip
        return self._write("index.html", page)
