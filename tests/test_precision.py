"""--precision auto: single where it is certainly enough, by the rules of src/oneray/scene/precision.c.

That single is enough is shown with the same samples in both precisions: their paths are the same but for
rounding, so that the difference has little of their noise.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from batches import diffuse, floor, glow, sky, square, world
from building import ROOT
from test_meshes import ball, write_ply

from raycheck.base.images import load_image
from raycheck.measuring.stability import precisions

SCENES = sorted((ROOT / "scenes").glob("*.xml"))
ADDED = 1e-5
"""What single may add to the picture's mean, relative."""
SIGMAS = 4.5
"""In standard errors; 30 scenes together raise a false alarm once in 5000 choices of the seeds."""


def chosen(oneray: Path, scene: Path, *options: str) -> tuple[str, str]:
    """The precision that auto takes, and why."""
    command = [oneray, scene, "--spp", "1", "--quiet", "--stats", "-", *options]
    stats = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    return stats["precision"], stats["precision_chosen_for"]


def pixels(oneray: Path, scene: Path, target: Path, precision: str, seed: int) -> np.ndarray:
    command = [oneray, scene, "--precision", precision, "--spp", "64", "--seed", str(seed), "--quiet"]
    subprocess.run([*command, "-o", target], check=True)
    return np.asarray(load_image(target).pixels)


@pytest.mark.sample(20)
@pytest.mark.parametrize("scene", SCENES, ids=lambda path: path.stem)
def test_single_adds_no_bias_where_it_is_chosen(oneray: Path, tmp_path: Path, scene: Path) -> None:
    if chosen(oneray, scene)[0] == "double":
        pytest.skip("double is chosen")
    means, differences = [], []
    for seed in range(8):
        double, single = (
            pixels(oneray, scene, tmp_path / "out.exr", name, seed) for name in ("double", "single")
        )
        means.append(double.mean())
        differences.append((single - double).mean())
    error = np.std(differences, ddof=1) / np.sqrt(len(differences)) / np.mean(means)
    assert abs(np.mean(differences) / np.mean(means)) <= ADDED + SIGMAS * error
    assert error < 10 * ADDED


def test_most_canonical_scenes_are_ordinary(oneray: Path) -> None:
    assert sum(chosen(oneray, scene)[0] == "single" for scene in SCENES) >= 24


def sphere(x: float, y: float, z: float, radius: float, inside: str) -> str:
    return (
        f'<shape type="sphere"><point name="center" x="{x}" y="{y}" z="{z}"/>'
        f'<float name="radius" value="{radius}"/>{inside}</shape>'
    )


FLOOR = floor(diffuse(0.5))
STIFF = {
    "tiny lamp": (FLOOR + square(0, 1, 1e-5, glow(3)), "a shape of"),
    "sphere light close to the floor": (FLOOR + sphere(0, 0, 0.5001, 0.5, glow(3)), "a gap"),
    "occluder just below the lamp": (FLOOR + square(0, 1, 0.5, glow(3)) + square(0, 1 - 1e-6, 0.5), "a gap"),
    "far light": (FLOOR + sphere(0, 0, 1e8, 1e6, glow(3)), "reaches out"),
    "dim light": (FLOOR + square(0, 1, 0.5, glow(1e-30)), "a light of"),
    "bright light": (FLOOR + square(0, 1, 0.5, glow(1e30)), "a light of"),
}


@pytest.mark.parametrize("name", STIFF)
def test_what_is_stiff_is_left_to_double(oneray: Path, tmp_path: Path, name: str) -> None:
    shapes, rule = STIFF[name]
    scene = tmp_path / "scene.xml"
    scene.write_text(world(shapes), encoding="utf-8")
    assert chosen(oneray, scene)[0] == "double"
    assert rule in chosen(oneray, scene)[1]


def test_an_ordinary_room_is_single(oneray: Path, tmp_path: Path) -> None:
    scene = tmp_path / "scene.xml"
    scene.write_text(world(FLOOR + square(0, 1, 0.5, glow(3))), encoding="utf-8")
    assert chosen(oneray, scene)[0] == "single"


@pytest.mark.parametrize(
    ("settings", "material", "rule"),
    [
        ({"fov": 0.001}, diffuse(0.5), "a pixel of"),
        ({"depth": -1}, diffuse(0.98), "paths of more than"),
        ({}, diffuse(0.9999), "a reflectance within"),
        ({"eye": "0, 0, 1e7"}, diffuse(0.5), "reaches out"),
    ],
)
def test_sensor_depth_and_materials_count_too(
    oneray: Path, tmp_path: Path, settings: dict, material: str, rule: str
) -> None:
    scene = tmp_path / "scene.xml"
    scene.write_text(world(floor(material) + square(0, 1, 0.5, glow(3)), **settings), encoding="utf-8")
    precision, reason = chosen(oneray, scene)
    assert precision == "double"
    assert rule in reason


def test_a_scene_away_from_the_origin_is_double(oneray: Path, tmp_path: Path) -> None:
    text = world(square(1e4, 1e4, 0.5, glow(3)) + square(1e4, 1e4 + 5, 20), eye="1e4, 0, 1e4")
    scene = tmp_path / "scene.xml"
    scene.write_text(text, encoding="utf-8")
    assert chosen(oneray, scene)[0] == "double"


# ---- Surfaces close to each other.


@pytest.mark.parametrize("index", range(0, precisions.COUNT, 3))
def test_auto_and_double_show_the_same(oneray: Path, monkeypatch: pytest.MonkeyPatch, index: int) -> None:
    """A third of the scenes of scripts/precisions.py."""
    monkeypatch.setenv("ONERAY", str(oneray))
    [pair] = precisions.run([index])
    assert pair.holds, pair


def test_the_kept_comparison_is_of_these_scenes_and_agrees() -> None:
    pairs, _ = precisions.read(ROOT / "references/precisions.json")
    made = [precisions.scene(index) for index in range(precisions.COUNT)]
    assert [(one.scene, one.gap, one.reach) for one in pairs] == [(m.kind, m.gap, m.reach) for m in made]
    assert all(one.holds for one in pairs)
    assert 10 <= sum(one.precision == "single" for one in pairs) <= 30


def test_the_scenes_need_double(oneray: Path, tmp_path: Path) -> None:
    """In single precision disks so close are taken for one another."""
    made = precisions.scene(17, draw=1)
    scene = write(tmp_path, made.text, made.meshes)
    single, double = (
        pixels(oneray, scene, tmp_path / "o.exr", name, 0).mean() for name in ("single", "double")
    )
    assert abs(single / double - 1) > 10 * precisions.ALLOWED


def write(folder: Path, text: str, files: Mapping[str, str] | None = None) -> Path:
    for name, content in (files or {}).items():
        (folder / name).write_text(content, encoding="utf-8")
    scene = folder / "scene.xml"
    scene.write_text(text, encoding="utf-8")
    return scene


def test_sheets_of_meshes_come_out_as_in_double(oneray: Path, tmp_path: Path) -> None:
    """Two sheets 2e-5 apart in a scene that reaches out to 1000."""
    scene = ROOT / "tests/precision/sheets-of-meshes.xml"
    assert chosen(oneray, scene) == ("double", "a gap between the shapes of lines 6 and 6")
    auto, double = (pixels(oneray, scene, tmp_path / "o.exr", name, 1) for name in ("auto", "double"))
    assert (auto == double).all()


def test_a_box_on_the_floor_is_no_gap(oneray: Path) -> None:
    """Mitsuba's own Cornell box, whose rounded matrices put its small box 4e-8 into the floor."""
    assert chosen(oneray, ROOT / "tests/precision/cornell-box-of-mitsuba.xml")[0] == "single"


def placed(kind: str, steps: str, more: str) -> str:
    return f'<shape type="{kind}"><transform name="to_world">{steps}</transform>{more}</shape>\n'


def matte(reflectance: float) -> str:
    return f'<bsdf type="twosided">{diffuse(reflectance)}</bsdf>'


GLASS = '<bsdf type="dielectric"><float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/></bsdf>'
GROUND = placed("rectangle", '<scale value="3"/>', diffuse(0.5))
BOX = '<rotate z="1" angle="20"/><scale value="0.5"/><translate z="{}"/>'
LAMP = placed(
    "rectangle", '<rotate x="1" angle="180"/><scale value="0.5"/><translate z="5"/>', diffuse(0) + glow(3)
)
MADE = {
    "a box of another colour on the floor": (
        GROUND + placed("cube", BOX.format(0.5 + 1e-9), diffuse(0.2)),
        "single",
    ),
    "a box a little above it": (GROUND + placed("cube", BOX.format(0.5 + 1e-5), diffuse(0.2)), "double"),
    "a box on a table whose other side is seen": (
        GROUND
        + placed("rectangle", '<translate z="1"/>', matte(0.5))
        + placed("cube", BOX.format(1.5 + 1e-9), matte(0.2)),
        "double",
    ),
    "a box of glass on the floor": (GROUND + placed("cube", BOX.format(0.5 + 1e-9), GLASS), "double"),
    "a box that shines on the floor": (GROUND + placed("cube", BOX.format(0.5 + 1e-9), glow(1)), "double"),
    "a lamp in the box on the floor": (
        GROUND
        + placed("cube", BOX.format(0.5 + 1e-9), matte(0.2))
        + '<emitter type="point"><point name="position" x="0" y="0" z="0.5"/></emitter>',
        "double",
    ),
    "a box on a box": (
        GROUND
        + placed("cube", BOX.format(0.5), diffuse(0.2))
        + placed("cube", BOX.format(1.5 + 1e-9), diffuse(0.3)),
        "single",
    ),
    "two sheets of the same stuff": (
        GROUND + placed("rectangle", '<translate z="1e-9"/>', diffuse(0.5)),
        "double",
    ),
    "tiles beside each other": (
        placed("rectangle", '<translate x="1"/>', diffuse(0.5))
        + placed("rectangle", '<translate x="-1" z="1e-8"/>', diffuse(0.5)),
        "single",
    ),
    "two spheres, one just within the other": (
        GROUND + sphere(0, 0, 1, 0.5, matte(0.5)) + sphere(0, 0, 1, 0.50001, matte(0.2)),
        "double",
    ),
    "two spheres, one well within the other": (
        GROUND + sphere(0, 0, 1, 0.5, matte(0.5)) + sphere(0, 0, 1, 0.8, matte(0.2)),
        "single",
    ),
    "a sphere light within a sphere": (
        GROUND + sphere(0, 0, 2, 0.5, glow(1)) + sphere(0, 0, 2, 0.9, GLASS),
        "single",
    ),
    "a sphere light just within a sphere": (
        GROUND + sphere(0, 0, 2, 0.5, glow(1)) + sphere(0, 0, 2, 0.5005, GLASS),
        "double",
    ),
}


@pytest.mark.parametrize("name", MADE)
def test_what_is_in_one_place_is_single_where_it_does_not_matter_which_a_ray_meets(
    oneray: Path, tmp_path: Path, name: str
) -> None:
    body, wanted = MADE[name]
    scene = write(tmp_path, world(body + LAMP, eye="4, 0, 2.5", fov=40))
    found = chosen(oneray, scene)
    assert found[0] == wanted, found
    assert wanted == "single" or "gap" in found[1] or "plane" in found[1]


ROUND = '<string name="filename" value="ball.ply"/>'
AMONG_TRIANGLES = {
    "a ball of triangles": (20, placed("ply", '<translate z="2"/>', ROUND + diffuse(0.5)), "single", ""),
    "one of many": (200, placed("ply", '<translate z="2"/>', ROUND + diffuse(0.5)), "single", ""),
    "one around another": (
        20,
        placed("ply", '<translate z="2"/>', ROUND + diffuse(0.5))
        + placed("ply", '<scale value="1.00001"/><translate z="2"/>', ROUND + diffuse(0.2)),
        "double",
        "a gap",
    ),
    "one of many around another": (
        200,
        placed("ply", '<translate z="2"/>', ROUND + diffuse(0.5))
        + placed("ply", '<scale value="1.00001"/><translate z="2"/>', ROUND + diffuse(0.2)),
        "double",
        "a gap",
    ),
    "a sphere just around it": (
        20,
        placed("ply", '<translate z="2"/>', ROUND + diffuse(0.5)) + sphere(0, 0, 2, 1.0001, matte(0.5)),
        "double",
        "a gap",
    ),
    "a sphere light near it": (
        20,
        placed("ply", '<translate z="2"/>', ROUND + diffuse(0.5)) + sphere(0, 0, 3.3, 0.3001, glow(1)),
        "double",
        "a gap",
    ),
    "a sphere light in it": (
        20,
        placed("ply", '<translate z="2"/>', ROUND + matte(0.5)) + sphere(0, 0, 2, 0.3, glow(1)),
        "single",
        "",
    ),
    "a point light on it": (
        3,
        placed("ply", '<translate z="2"/>', ROUND + diffuse(0.5))
        + '<emitter type="point"><point name="position" x="0" y="0" z="3.00001"/></emitter>',
        "double",
        "a light in the plane of line",
    ),
    "a point light above it": (
        20,
        placed("ply", '<translate z="2"/>', ROUND + diffuse(0.5))
        + '<emitter type="point"><point name="position" x="0" y="0" z="3.5"/></emitter>',
        "single",
        "",
    ),
    "a sheet through it": (
        20,
        placed("ply", '<translate z="2"/>', ROUND + diffuse(0.5))
        + placed("rectangle", '<rotate x="1" angle="30"/><translate z="2"/>', matte(0.3)),
        "single",
        "",
    ),
}


@pytest.mark.parametrize("name", AMONG_TRIANGLES)
def test_triangles_count_too(oneray: Path, tmp_path: Path, name: str) -> None:
    rings, body, wanted, rule = AMONG_TRIANGLES[name]
    write_ply(tmp_path / "ball.ply", *ball(rings))
    scene = write(tmp_path, world(GROUND + body + LAMP, eye="6, 0, 3", fov=40))
    found = chosen(oneray, scene)
    assert found[0] == wanted, found
    assert rule in found[1]


@pytest.mark.parametrize("apart", [1e-6, 1e-2])
def test_a_small_sheet_of_a_large_mesh_is_seen(oneray: Path, tmp_path: Path, apart: float) -> None:
    """Two triangles of 80 000, a tenth of the mesh's size, that the camera sees close by."""
    points, faces = ball(200)
    first = len(points)
    corners = np.array([(x, y) for y in (-0.1, 0.1) for x in (-0.1, 0.1)])
    sheets = np.vstack(
        [np.column_stack([corners * size, np.full(4, z)]) for size, z in ((1, 2.0), (0.5, 2 + apart))]
    )
    quads = [
        (first + k + a, first + k + b, first + k + c) for k in (0, 4) for a, b, c in ((0, 1, 3), (0, 3, 2))
    ]
    write_ply(tmp_path / "ball.ply", np.vstack([points, sheets]), np.vstack([faces, quads]))
    body = f'<shape type="ply">{ROUND}<boolean name="face_normals" value="true"/>{matte(0.5)}</shape>' + sky()
    text = world(body, eye="0, 0, 2.5", fov=10)
    assert chosen(oneray, write(tmp_path, text))[0] == ("double" if apart < 1e-3 else "single")


def test_sheets_of_one_material_that_face_alike_may_be_exchanged(oneray: Path, tmp_path: Path) -> None:
    """A millionth apart in a scene that reaches out to 100; of two materials it matters which a ray meets."""
    same = '<ref id="matte"/>'
    one = '<bsdf type="diffuse" id="matte"/>' + floor(same) + floor(same, 1e-6)
    other = floor(diffuse(0.5)) + floor(diffuse(0.2), 1e-6)
    found = [chosen(oneray, write(tmp_path, world(body + sky())))[0] for body in (one, other)]
    assert found == ["single", "double"]
