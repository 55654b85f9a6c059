"""How oneray's sources lie: includes go one way, from what knows much to what knows little."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

from building import ROOT

SOURCES = ROOT / "src/oneray"

LAYERS = (
    {"message", "text", "version", "rounded", "vectors", "kinds", "technique"},
    {"fields", "traits"},
    {"lanes"},
    {"images"},
    {"textures"},
    {"meshes"},
    {"trees"},
    {"shapes"},
    {"materials"},
    {"emitters"},
    {"media"},
    {"filters"},
    {"sensors"},
    {"scene"},
    {"prepare"},
    {"estimators"},
    {"kernel"},
    {"film"},
    {"options"},
    {"render"},
    {"darkness"},
    {"stats"},
    {"main"},
)
"""Folders, and files that lie in none, from the bottom up. A folder includes itself and what is below it."""


def room(path: str) -> str:
    """The folder of a source, or its own name: "kinds/shapes.h", a list of the folder's files, is its."""
    parts = path.removeprefix("kinds/").split("/")
    return parts[0].split(".")[0]


def level(name: str) -> int:
    return next(i for i, layer in enumerate(LAYERS) if name in layer)


def includes(path: Path) -> list[str]:
    return re.findall(r'^#include "(\S+)"', path.read_text(encoding="utf-8"), re.MULTILINE)


def test_includes_go_one_way() -> None:
    wrong = []
    for path in sorted(SOURCES.rglob("*.[ch]")):
        name = path.relative_to(SOURCES).as_posix()
        wrong += [
            f"{name} includes {other}" for other in includes(path) if level(room(other)) > level(room(name))
        ]
    assert not wrong, "\n".join(wrong)


def test_no_header_includes_itself_by_others() -> None:
    """Within a folder, too, there is a first and a last."""
    graph = {
        path.relative_to(SOURCES).as_posix(): [n for n in includes(path) if not n.startswith("kinds/")]
        for path in SOURCES.rglob("*.h")
    }
    done: set[str] = set()

    def visit(name: str, way: tuple[str, ...]) -> None:
        assert name not in way, " includes ".join((*way, name))
        if name not in done:
            for other in graph[name]:
                visit(other, (*way, name))
            done.add(name)

    for name in graph:
        visit(name, ())


def test_every_folder_is_in_a_layer() -> None:
    found = {path.name for path in SOURCES.iterdir() if path.is_dir()}
    assert found <= set().union(*LAYERS)
    assert all(below.isdisjoint(above) for below, above in pairwise(LAYERS))
