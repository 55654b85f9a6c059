"""Renders a check in a process of its own, by the renderer's own interface, and judges it."""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.errors import NotFound, RenderError
from raycheck.base.machine import raycheck_version
from raycheck.measuring.audit import judging
from raycheck.measuring.audit.check import Check
from raycheck.measuring.audit.results import Record
from raycheck.renderers.oneray import oneray_command, oneray_path

TIMEOUT = 1800.0
WORKERS = Path(__file__).parent / "workers"


@dataclass(frozen=True)
class Renderer:
    """A renderer under audit, and how one gets it."""

    title: str
    package: str = ""
    """At PyPI, into a Python environment of its own; empty for one that this Python has."""


RENDERERS: Mapping[str, Renderer] = {
    "mitsuba": Renderer("Mitsuba"),
    "cycles": Renderer("Blender Cycles", "bpy==5.0.1"),
    "luxcore": Renderer("LuxCore", "pyluxcore==2.11.2 numpy"),
    "raysect": Renderer("Raysect", "raysect==0.9.1"),
    "oneray": Renderer("oneray"),
}


def environments() -> Path:
    """Where the Python environments of other renderers are, outside the checkout."""
    return Path(os.environ.get("RAYCHECK_AUDIT", Path.home() / ".cache/raycheck-audit"))


def python_of(renderer: str) -> str:
    """The Python that has a renderer; NotFound, with what would get it, if there is none."""
    package = RENDERERS[renderer].package
    if not package:
        return sys.executable
    found = environments() / renderer / "bin/python"
    if not found.is_file():
        raise NotFound(
            f"{RENDERERS[renderer].title} is not in {found.parent.parent}: python scripts/audit.py setup "
            f"{renderer}"
        )
    return str(found)


def set_up(renderer: str, package: str = "") -> None:
    """Make the Python environment of a renderer, with this package instead of the usual one if named."""
    package = package or RENDERERS[renderer].package
    if not package:
        return
    folder = environments() / renderer
    if not (folder / "bin/python").is_file():
        subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True)
    install = [str(folder / "bin/python"), "-m", "pip", "install", "--quiet", *package.split()]
    if subprocess.run(install).returncode:
        raise NotFound(f"{package} cannot be installed into {folder}: see above")


def _oneray(check: Check, seeds: range) -> tuple[str, Array]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.xml"
        path.write_text(check.scene, encoding="utf-8")
        words = check.settings.get("options", "").split()
        command = oneray_command(oneray_path(), words)
        pictures = [command.render(path, check.samples, seed, TIMEOUT).image.pixels for seed in seeds]
    return raycheck_version(), np.array(pictures)


def _worker(check: Check, seeds: range) -> tuple[str, Array]:
    job = {
        "scene": check.scene,
        "settings": dict(check.settings),
        "samples": check.samples,
        "seeds": list(seeds),
    }
    name = f"{check.renderer}_pictures.py"
    command = [python_of(check.renderer), str(WORKERS / name)]
    with tempfile.TemporaryDirectory() as folder:
        try:
            done = subprocess.run(
                command, input=json.dumps(job), capture_output=True, text=True, timeout=TIMEOUT, cwd=folder
            )
        except subprocess.TimeoutExpired:
            raise RenderError(f"{check.id}: no pictures in {TIMEOUT:.0f} s") from None
    line = done.stdout.strip().rpartition("\n")[2]
    try:
        answer: dict[str, Any] = json.loads(line)
        return answer["version"], np.array(answer["pictures"], dtype=np.float64)
    except (ValueError, KeyError, TypeError):
        last = (done.stderr.strip() or done.stdout.strip() or "nothing said").splitlines()[-1][:200]
        raise RenderError(f"{check.id}: {RENDERERS[check.renderer].title} gave no pictures: {last}") from None


def run(check: Check, render: Callable[[Check, range], tuple[str, Array]] | None = None) -> Record:
    """Render and judge one check; RenderError or NotFound where there is no picture."""
    render = render or (_oneray if check.renderer == "oneray" else _worker)
    version, pictures = render(check, range(check.batches))
    try:
        found = judging.values(check.names, check.expected(), check.measure(pictures))
    except ValueError as error:
        raise RenderError(f"{check.id}: {error}") from None
    return Record(
        id=check.id, renderer=RENDERERS[check.renderer].title, version=version, says=check.says,
        verdict=str(judging.verdict(check, found)), values=found, why=check.why,
        command=f"python scripts/audit.py run {check.id}", scene=check.scene, settings=dict(check.settings),
        samples=check.samples, batches=check.batches, within=check.within, documented=check.documented,
        act=check.act, report=check.report,
    )  # fmt: skip
