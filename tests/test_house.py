"""raycheck's packages: imports go one way."""

from __future__ import annotations

import ast
import importlib
import re
import subprocess
import sys
from pathlib import Path

import pytest

import raycheck.judging
from raycheck.base import data

ROOT = Path(__file__).resolve().parents[1] / "src/raycheck"
LAYERS = (
    "base", "stats", "scene", "renderers", "truth", "judging", "measuring", "grading", "calibration",
    "commands",
)  # fmt: skip
"""From the ground up: a package imports from itself and from those before it."""


def modules() -> dict[str, Path]:
    """By dotted name below raycheck; a package has the name of its folder."""
    files = {path: path.relative_to(ROOT).with_suffix("").parts for path in ROOT.rglob("*.py")}
    return {".".join(parts).removesuffix("__init__").strip("."): path for path, parts in files.items()}


MODULES = modules()


def imports(name: str) -> set[str]:
    """The modules of raycheck that a module imports anywhere in it, or starts as a process."""
    found = set()
    for node in ast.walk(ast.parse(MODULES[name].read_text(encoding="utf-8"))):
        words = []
        if isinstance(node, ast.Import):
            words = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name}: a relative import"
            words = [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Constant) and str(node.value).startswith("raycheck."):
            words = [str(node.value)]
        for word in words:
            top, _, path = word.partition(".")
            if top == "raycheck":
                found.add(path if path in MODULES else path.rpartition(".")[0])
    return found & set(MODULES) - {""}


def test_every_module_but_the_command_line_is_in_a_package() -> None:
    top = {name.partition(".")[0] for name in MODULES} - {""}
    assert top == {*LAYERS, "cli", "__main__"}


@pytest.mark.parametrize("name", sorted(MODULES))
def test_nothing_imports_from_above(name: str) -> None:
    package = name.partition(".")[0]
    if package not in LAYERS:
        return  # the public names, and the command line, stand on top of all
    allowed = LAYERS[: LAYERS.index(package) + 1]
    wrong = {other for other in imports(name) if other.partition(".")[0] not in allowed}
    assert not wrong, f"{name} imports {', '.join(sorted(wrong))}"


def test_no_modules_import_each_other_in_a_circle() -> None:
    left = {name: imports(name) - {name} for name in MODULES}
    while True:
        free = {name for name, needs in left.items() if not needs & set(left)}
        if not free:
            break
        left = {name: needs for name, needs in left.items() if name not in free}
    assert not left


@pytest.mark.parametrize(
    ("command", "unwanted"),
    [
        ("scene", ("raycheck.judging", "raycheck.truth", "raycheck.grading", "mitsuba", "scipy", "mpmath")),
        ("render", ("raycheck.judging", "raycheck.grading", "mitsuba", "scipy", "mpmath", "jinja2")),
        ("verify", ("raycheck.measuring", "raycheck.grading", "mitsuba", "mpmath", "jinja2", "trimesh")),
        ("compare", ("raycheck.measuring", "raycheck.grading", "mitsuba", "mpmath", "jinja2")),
        ("grade", ("raycheck.measuring", "mitsuba", "mpmath", "distributed")),
    ],
)
def test_a_command_imports_what_it_needs_alone(command: str, unwanted: tuple[str, ...]) -> None:
    program = f"import sys, raycheck.commands.app, raycheck.commands.{command}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert not set(unwanted) & set(done.stdout.split())


def way_of_a_picture() -> list[tuple[str, str]]:
    """(module, name) of each step that the docstring of the package judging lists."""
    steps = re.findall(r"^ ?\d+ (\S+)\.(\w+) ", raycheck.judging.__doc__ or "", re.MULTILINE)
    assert len(steps) == 15
    return steps


def test_a_picture_goes_down_from_verify_to_its_sentence() -> None:
    """Each step is there, and is called by a step before it: one reads the list and the code side by side."""
    above = ""
    for module, name in way_of_a_picture():
        assert hasattr(importlib.import_module(f"raycheck.{module}"), name), (module, name)
        if above:
            assert re.search(rf"\b{name}\(", above), f"no step calls {name}"
        above += MODULES[module].read_text(encoding="utf-8").replace("run_verification(", "verify(")


def test_every_module_of_judging_is_in_its_docstring() -> None:
    said = raycheck.judging.__doc__ or ""
    names = {name.removeprefix("judging.") for name in MODULES if name.startswith("judging.")}
    assert [name for name in names if not re.search(rf"^{name} |judging\.{name}\.", said, re.MULTILINE)] == []


def test_scenes_and_references_of_a_checkout_are_at_its_top() -> None:
    top = ROOT.parents[1]
    assert (top, ROOT) == (data.ROOT, data.PACKAGE)
    assert (data.scenes_dir(), data.references_dir()) == (top / "scenes", top / "references")


@pytest.mark.parametrize("package", [name for name, path in MODULES.items() if path.name == "__init__.py"])
def test_a_package_says_what_comes_in_and_what_goes_out(package: str) -> None:
    found = ast.get_docstring(ast.parse(MODULES[package].read_text(encoding="utf-8")))
    assert found and len(found.splitlines()) > 4, package
    assert len(found.splitlines()) < 60
