"""scripts/public_scenes.py: what it says of a folder of scene files that others have written."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]

SENSOR = """<integrator type="path"/><sensor type="perspective"><float name="fov" value="50"/>
<transform name="to_world"><lookat origin="0 0 4" target="0 0 0" up="0 1 0"/></transform>
<film type="ldrfilm" id="film"><integer name="width" value="400"/><integer name="height" value="300"/></film>
</sensor>"""
BALL = '<shape type="sphere"><bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf></shape>'
SKY = '<emitter type="constant"><rgb name="radiance" value="1"/></emitter>'
WRONG = {
    "materials": '<shape type="sphere">\n<bsdf type="velvet"/></shape>',
    "textures": '<shape type="disk">\n<bsdf type="diffuse">'
    '<texture type="wood" name="reflectance"/></bsdf></shape>',
    "environment": '<emitter type="sunsky"/>',
    "media": '<medium type="heterogeneous" id="fog"/>'
    '<shape type="cube"><ref id="fog" name="interior"/></shape>',
    "missing files": '<shape type="obj"><string name="filename" value="gone.obj"/></shape>',
    "other plugins": '<shape type="teapot"/>',
    "other": '<shape type="sphere"><float name="mass" value="1"/></shape>',
}
PLUGINS = [
    '<shape type="shapegroup" id="group"/>\n<shape type="disk"><ref id="group"/></shape>',
    '<shape type="disk"><sensor type="irradiancemeter"/></shape>',
    '<shape type="sphere"><subsurface type="dipole"/></shape>',
    '<emitter type="projector"/>',
]


def run(folder: Path, files: dict[str, str], *options: str, **environment: str) -> tuple[int, list, str]:
    """Its exit status, its results in their order, and what it prints."""
    for name, body in files.items():
        path = folder / "someone+scenes" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f'<scene version="3.0.0">{SENSOR}{body}</scene>', encoding="utf-8")
    lines = "".join(f"someone/scenes\t{name}\n" for name in files)
    (folder / "list.tsv").write_text(lines, encoding="utf-8")
    result = folder / "result.json"
    command = [
        sys.executable,
        ROOT / "scripts/public_scenes.py",
        folder / "list.tsv",
        folder,
        "--json",
        result,
    ]
    done = subprocess.run(
        [*map(str, command), *options], capture_output=True, text=True, env={**os.environ, **environment},
        check=False,
    )  # fmt: skip
    assert result.exists(), done.stderr
    return done.returncode, json.loads(result.read_text(encoding="utf-8"))["files"], done.stdout


@pytest.mark.usefixtures("oneray")
def test_errors_by_kind(tmp_path: Path) -> None:
    files = {f"{kind}.xml": BALL + SKY + more for kind, more in {"none": "", **WRONG}.items()}
    status, found, printed = run(tmp_path, files, "--check")
    assert status == 0
    assert [list(one["errors"]) for one in found] == [[], *([kind] for kind in WRONG)]
    assert [len(one["other"]) for one in found] == [0] * len(WRONG) + [1]
    assert [one["warnings"] for one in found] == [1] * len(found)
    for row in ("files | 8", "rendered as they are | 1", "missing files alone | 5", "plugins alone | 6"):
        assert f"| {row} |" in printed.replace(
            "with errors, but of materials, textures, environment, media and ", ""
        ).replace("with errors, but of these and other ", "")


@pytest.mark.usefixtures("oneray")
def test_plugins_that_do_not_exist_here(tmp_path: Path) -> None:
    _, found, _ = run(tmp_path, {f"{k}.xml": BALL + SKY + one for k, one in enumerate(PLUGINS)}, "--check")
    assert [list(one["errors"]) for one in found] == [["other plugins"]] * len(PLUGINS)


def test_pictures_are_judged_against_mitsuba(oneray: Path, tmp_path: Path) -> None:
    """What is decided is kept; a renderer with a sky of another radiance differs."""
    pytest.importorskip("mitsuba")
    status, [found], printed = run(tmp_path, {"a.xml": BALL + SKY})
    assert (status, found["verdict"], found["errors"]) == (0, "PASS", {}), printed
    assert 0 < found["detectable"] <= 0.01 and found["size"] == [24, 24]
    brighter = tmp_path / "brighter"
    change = 's/"radiance" value="1"/"radiance" value="1.05"/'
    brighter.write_text(f'#!/bin/sh\n[ "$2" = --check ] || sed -i \'{change}\' "$1"\nexec {oneray} "$@"\n')
    brighter.chmod(0o755)
    status, [kept], _ = run(tmp_path, {"a.xml": BALL + SKY}, ONERAY=str(brighter))
    assert (status, kept) == (0, found)
    (tmp_path / "result.json").unlink()
    status, [found], _ = run(tmp_path, {"a.xml": BALL + SKY}, ONERAY=str(brighter))
    assert (status, found["verdict"]) == (1, "FAIL")
    sheet = (
        '<shape type="disk"><transform name="to_world"><translate z="2"/></transform>'
        '<bsdf type="diffuse"><rgb name="reflectance" value="{}"/></bsdf></shape>'
    )
    either = BALL + SKY + sheet.format(0.1) + sheet.format(0.9)
    status, [found], _ = run(tmp_path, {"b.xml": either}, ONERAY=str(brighter))
    assert (status, found["verdict"]) == (0, "ILL-POSED")
