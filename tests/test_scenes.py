"""The canonical scenes: each says what it is for, states what defaults leave open, and is in the ladder."""

import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

from raycheck.scene.content import read_content
from raycheck.scene.variants import scene_names
from raycheck.truth.closed_forms.forms import FORMS

ROOT = Path(__file__).resolve().parents[1]
SCENES = sorted((ROOT / "scenes").glob("*.xml"))
ROW = re.compile(r"^\| `([a-z-]+)` \|(.*)\|$", re.MULTILINE)
LADDER = {
    name: [cell.strip() for cell in cells.split("|")]
    for name, cells in ROW.findall((ROOT / "scenes" / "README.md").read_text(encoding="utf-8"))
}
"""Scene → cells: adds, lecture, needs, depth, closed form, unbounded."""

each_scene = pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)


def comment(path: Path) -> str:
    found = re.match(r"<!--\n(.*?)-->\n<scene", path.read_text(encoding="utf-8"), re.DOTALL)
    assert found, f"{path.name} does not begin with a comment"
    return found.group(1)


def test_the_ladder_names_every_scene_and_no_other() -> None:
    """In the order in which all commands take them."""
    assert list(LADDER) == scene_names() and set(LADDER) == {path.stem for path in SCENES}
    assert len(SCENES) >= 23
    assert next(iter(LADDER)) == "point-light"


@each_scene
def test_the_comment_says_technique_and_answer(path: Path) -> None:
    text = comment(path)
    assert re.search(r"\bL\d+\b", text)
    assert ("Expected" in text) == (path.stem in FORMS)
    assert ("the reference is the judge" in text) or path.stem in FORMS


@each_scene
def test_the_ladder_says_what_the_scene_says(path: Path) -> None:
    _, lecture, _, depth, closed, unbounded = LADDER[path.stem]
    assert (closed == "yes") == (path.stem in FORMS)
    assert int(depth.replace("−", "-")) == read_content(path).max_depth
    assert set(unbounded.split()) == read_content(path).unbounded
    ids = {int(n) for n in re.findall(r"\bL(\d+)\b", comment(path))}
    for span in re.findall(r"L(\d+) to L(\d+)", comment(path)):
        ids |= set(range(int(span[0]), int(span[1]) + 1))
    listed = {int(n) for n in re.findall(r"L(\d+)", lecture)}
    for first, last in re.findall(r"L(\d+)–L(\d+)", lecture):
        listed |= set(range(int(first), int(last) + 1))
    assert listed == ids


@each_scene
def test_what_defaults_leave_open_is_stated(path: Path) -> None:
    root = ElementTree.parse(path).getroot()
    defaults = {e.attrib["name"] for e in root.iter("default")}
    assert "depth" in defaults

    def value(where: str, name: str) -> str:
        element = root.find(f"{where}/*[@name='{name}']")
        assert element is not None, f"{path.name}: {name} is not stated"
        return element.attrib["value"]

    assert value("integrator", "max_depth") == "$depth"
    assert int(value("integrator", "rr_depth")) > 0
    sensor = root.find("sensor")
    assert sensor is not None
    if sensor.attrib["type"] != "orthographic":
        assert value("sensor", "fov_axis") in ("x", "y", "diagonal", "smaller", "larger")
    assert value("sensor/film", "component_format") == "float32"
    assert value("sensor/film", "pixel_format") == "rgb"
    kind = "gaussian" if path.stem == "filter" else "box"
    assert root.find(f"sensor/film/rfilter[@type='{kind}']") is not None
    assert root.find("sensor/sampler[@type='independent']") is not None
    part = "crop_" if root.find("sensor/film/*[@name='crop_width']") is not None else ""
    assert all(int(value("sensor/film", part + side)) <= 64 for side in ("width", "height"))
    for glass in root.iterfind(".//bsdf[@type='dielectric']"):
        numbers = {e.attrib["name"]: float(e.attrib["value"]) for e in glass.findall("float")}
        assert {"int_ior", "ext_ior"} <= set(numbers)
    for shape in root.findall("shape"):
        assert shape.find("ref") is not None, f"{path.name}: a shape without a material"


def test_enough_scenes_need_only_triangles() -> None:
    """A rectangle is two triangles; at least two of these are lit by rectangles at depth 2."""
    flat = [
        path
        for path in SCENES
        if {s.attrib["type"] for s in ElementTree.parse(path).getroot().iter("shape")}
        <= {"rectangle", "ply", "obj"}
        and read_content(path).lights > read_content(path).delta_lights
    ]
    assert len(flat) >= 4
    assert sum(read_content(path).max_depth == 2 for path in flat) >= 2


@pytest.mark.parametrize(
    ("script", "names"),
    [
        ("make_thousand_lights.py", ["thousand-lights.xml"]),
        (
            "make_meshes.py",
            [f"meshes/{mesh}" for mesh in ("lamp.ply", "coarse-ball.ply", "strip.ply", "ring.obj")],
        ),
        ("make_stiff.py", ["stiff/decades.xml", "stiff/meshes/strips.ply", "stiff/pictures/sun-40.hdr"]),
    ],
)
def test_generated_files_are_what_their_script_writes(script: str, names: list[str], tmp_path: Path) -> None:
    target = tmp_path if len(names) > 1 else tmp_path / names[0]
    subprocess.run([sys.executable, ROOT / "scripts" / script, target], check=True)
    for name in names:
        (written,) = tmp_path.rglob(Path(name).name)
        assert written.read_bytes() == (ROOT / "scenes" / name).read_bytes()
        assert (ROOT / "scenes" / name).stat().st_size < (50_000 if "mesh" in name else 250_000)
