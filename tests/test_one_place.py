"""Surfaces in one place are met in an order, by whatever way light is looked for: one surface where they face
alike, a solid left before the next is entered, a lamp in front of the ceiling that it is flush with."""

from __future__ import annotations

import json
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from batches import diffuse, floor, glow, sky, square, world
from building import ROOT
from numpy.typing import NDArray
from sampling import Driver, directions, uniforms
from scipy.spatial.transform import Rotation

from raycheck.base.images import Image, load_image
from raycheck.measuring.stability import places, sweeps
from raycheck.measuring.stability.renderers import Oneray

PRECISIONS = ("double", "single")
TURN = '<rotate x="0.6" y="0.8" angle="37"/>'
BOTH = f'<bsdf type="twosided">{diffuse(0.5)}</bsdf>'
GLASS = '<bsdf type="dielectric"><float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/></bsdf>'


def run(oneray: Path, folder: Path, text: str, *options: object) -> subprocess.CompletedProcess[str]:
    scene = folder / "scene.xml"
    scene.write_text(text, encoding="utf-8")
    command = [oneray, scene, "-o", folder / "out.exr", "--quiet", *map(str, options)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)


def rendered(oneray: Path, folder: Path, text: str, *options: object) -> Image:
    run(oneray, folder, text, *options)
    return load_image(folder / "out.exr")


def shape(kind: str, way: str, *what: str) -> str:
    """Of this type, placed this way before all is turned."""
    return f'<shape type="{kind}"><transform name="to_world">{way}{TURN}</transform>{"".join(what)}</shape>'


def view(
    body: str, eye: str, target: str = "0, 0, 0", depth: int = 2, fov: float = 30, size: int = 16
) -> str:
    """What a camera shows that is turned like the shapes."""
    text = world(body, fov=fov, depth=depth, size=size)
    start, end = text.index("<lookat"), text.index("</transform>")
    look = f'<lookat origin="{eye}" target="{target}" up="0, 1, 0.1"/>{TURN}'
    return text[:start] + look + text[end:]


def same_light(a: Image, b: Image) -> bool:
    """Two independent pictures, by their means: within four standard errors and a thousandth."""
    noise = np.hypot(np.linalg.norm(a.stderr), np.linalg.norm(b.stderr)) / a.pixels.size
    return bool(abs(a.pixels.mean() - b.pixels.mean()) < 4 * noise + 1e-3 * b.pixels.mean())


def write_mesh(path: Path, faces: str) -> str:
    corners = "v -1.08 -1.6 2.48\nv 2.74 -1.6 1.32\nv 1.7 0.2 -2.08\nv -2.12 0.2 -0.92\n"
    path.write_text(corners + faces)
    return (
        f'<shape type="obj"><string name="filename" value="{path.name}"/>'
        '<boolean name="face_normals" value="true"/>{}</shape>'
    )


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("size", [2, 3])
def test_two_rectangles_are_one(oneray: Path, tmp_path: Path, precision: str, size: int) -> None:
    """To the last bit the picture of either alone."""
    tilt = '<rotate x="1" angle="-30"/>'
    sheet = shape("rectangle", f'<scale value="{{}}"/>{tilt}', diffuse(0.5))
    options = ("--precision", precision, "--spp", 64)
    eye = "0, 0, 4"
    alone = rendered(oneray, tmp_path, view(sheet.format(2) + sky(), eye, fov=10), *options)
    both = rendered(
        oneray, tmp_path, view(sheet.format(2) + sheet.format(size) + sky(), eye, fov=10), *options
    )
    assert alone.pixels.mean() == pytest.approx(0.5, rel=5e-3)
    assert (both.pixels == alone.pixels).all()


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize(
    "faces", ["f 1 2 3\nf 1 3 4\nf 1 2 3\nf 1 3 4\n", "f 1 2 3\nf 1 3 4\nf 2 3 4\nf 2 4 1\n",
              "f 3 2 1\nf 4 3 1\nf 1 2 3\nf 1 3 4\n"],
)  # fmt: skip
def test_a_mesh_that_is_there_twice_is_one(oneray: Path, tmp_path: Path, precision: str, faces: str) -> None:
    """The same faces again, cut along the other diagonal, or facing the other way."""
    once = write_mesh(tmp_path / "once.obj", "f 1 2 3\nf 1 3 4\n").format(diffuse(0.5))
    twice = write_mesh(tmp_path / "twice.obj", faces).format(diffuse(0.5))
    options = ("--precision", precision, "--spp", 64)
    alone = rendered(oneray, tmp_path, world(once + sky(), eye="0, 0, 4", fov=30), *options)
    both = rendered(oneray, tmp_path, world(twice + sky(), eye="0, 0, 4", fov=30), *options)
    np.testing.assert_allclose(both.pixels, alone.pixels, rtol=1e-4, atol=1e-6)


def test_faces_that_are_there_thousands_of_times_are_one(oneray: Path, tmp_path: Path) -> None:
    """All pairs of them are more than is looked at: equal ones are found all the same, and a line says so."""
    faces = "f 1 2 3\nf 1 3 4\n"
    once = write_mesh(tmp_path / "once.obj", faces).format(diffuse(0.5))
    often = write_mesh(tmp_path / "often.obj", 5000 * faces).format(diffuse(0.5))
    scene = [world(mesh + sky(), eye="0, 0, 4", fov=30) for mesh in (once, often)]
    alone = rendered(oneray, tmp_path, scene[0], "--spp", 64)
    done = run(oneray, tmp_path, scene[1], "--spp", 64, "--stats", "-")
    np.testing.assert_allclose(load_image(tmp_path / "out.exr").pixels, alone.pixels, rtol=1e-4, atol=1e-6)
    assert "close to thousands of others each" in json.loads(done.stdout)["precision_chosen_for"]
    assert done.stderr.count("\n") == 1 and "may not have been noticed" in done.stderr


@pytest.mark.parametrize("kind", ["sphere", "cube"])
@pytest.mark.parametrize("bsdf", [diffuse(0.5), GLASS], ids=["grey", "glass"])
def test_a_solid_that_is_there_twice_is_one(oneray: Path, tmp_path: Path, kind: str, bsdf: str) -> None:
    solid = shape(kind, "", bsdf)
    under = shape("rectangle", '<scale value="9"/><translate z="-2"/>', diffuse(0.5))
    for precision in PRECISIONS:
        options = ("--precision", precision, "--spp", 256)
        scene = [view(body + under + sky(), "1, 2, 6", depth=8) for body in (solid, solid + solid)]
        assert same_light(*(rendered(oneray, tmp_path, text, *options) for text in scene))


@pytest.mark.parametrize("precision", PRECISIONS)
def test_boxes_with_tops_in_one_plane_are_one_box(oneray: Path, tmp_path: Path, precision: str) -> None:
    box = shape("cube", '<scale x="{}" y="0.5" z="0.5"/><translate x="{}" y="1"/>', diffuse(0.8))
    options = ("--precision", precision, "--spp", 256)
    scene = [
        view(body + sky(), "0, 4, 3", "0, 0.8, 0.3", depth=3)
        for body in (box.format(0.8, 0), box.format(0.5, 0.3) + box.format(0.5, -0.3))
    ]
    assert same_light(*(rendered(oneray, tmp_path, text, *options) for text in scene))


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("kind", ["rectangle", "disk"])
def test_a_floor_hides_what_stands_on_it(oneray: Path, tmp_path: Path, precision: str, kind: str) -> None:
    """From below one sees the black back of the floor, and nothing of the box, though something else is there
    below, which is lit; from above as if the box hovered a little.
    """
    ground = shape(kind, '<scale value="4"/>', diffuse(0.5))
    thing = shape("sphere", '<scale value="0.1"/><translate x="3" z="-3"/>', diffuse(0.5))
    box = shape("cube", '<translate z="1"/><scale value="0.5"/><translate z="{}"/>', diffuse(0.5))
    options = ("--precision", precision, "--spp", 64)
    below = view(ground + thing + box.format(0) + sky(), "0.3, 0.2, -4")
    assert (rendered(oneray, tmp_path, below, *options).pixels == 0).all()
    above = [view(ground + thing + box.format(h) + sky(), "1, 2, 4", depth=4) for h in (0, 1e-3)]
    assert same_light(*(rendered(oneray, tmp_path, text, *options) for text in above))


def flush(lamp: float, order: int, ceiling: str = diffuse(0.5)) -> str:
    """A room's floor, its ceiling and a lamp in that, whose height is given."""
    under = shape("rectangle", '<scale value="2"/><rotate x="1" angle="-90"/>', diffuse(0.5))
    over = shape("rectangle", '<scale value="2"/><rotate x="1" angle="90"/><translate y="2.3"/>', ceiling)
    light = shape(
        "rectangle", f'<scale value="0.4"/><rotate x="1" angle="90"/><translate y="{lamp}"/>',
        diffuse(0.5), glow(5),
    )  # fmt: skip
    return under + (over + light if order else light + over)


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("estimator", ["walk", "nee", "mis", "light"])
@pytest.mark.parametrize("order", [0, 1])
def test_a_lamp_shines_in_the_ceiling(
    oneray: Path, tmp_path: Path, precision: str, estimator: str, order: int
) -> None:
    """As one a little below it does, whichever stands first in the file, and however light is looked for."""
    options = ("--precision", precision, "--spp", 1024)
    eye = "0, 0.3, 3.5"
    a_little_below = view(flush(2.2999, 0), eye, "0, 1.2, 0", depth=3)
    below = rendered(oneray, tmp_path, a_little_below, *options, "--seed", 1)
    text = view(flush(2.3, order), eye, "0, 1.2, 0", depth=3)
    assert same_light(rendered(oneray, tmp_path, text, *options, "--estimator", estimator), below)


def test_who_looks_up_sees_the_lamp(oneray: Path, tmp_path: Path) -> None:
    for order in (0, 1):
        for ceiling in (diffuse(0.5), BOTH):
            text = view(flush(2.3, order, ceiling), "0, 0.5, 0.1", "0, 2.3, 0", depth=1, fov=5)
            assert (rendered(oneray, tmp_path, text, "--spp", 16).pixels == 5).all()


@pytest.mark.parametrize("kind", ["rectangle", "cube"])
def test_a_box_that_shines_is_let_into_the_ceiling(oneray: Path, tmp_path: Path, kind: str) -> None:
    """One sees it from below, and where it stands on a floor nothing of it from below that."""
    box = shape("cube", '<translate z="1"/><scale value="0.5"/>', diffuse(0), glow(5))
    for turned, seen in (('<rotate x="1" angle="180"/>', 5), ("", 0)):
        way = '<scale value="4"/>' + turned if kind == "rectangle" else f'<translate z="-1"/>{turned}'
        plate = shape(kind, way, BOTH)
        if kind == "cube" and turned:
            plate = shape("cube", '<translate z="1"/>', diffuse(0.5))
        for body in (box + plate, plate + box):
            look = rendered(oneray, tmp_path, view(body, "0.1, 0.2, -5", depth=1, fov=2), "--spp", 16)
            assert (look.pixels == seen).all()


def test_a_lamp_on_a_table_and_one_face_down(oneray: Path, tmp_path: Path) -> None:
    """A lamp on a box shines; one that lies on its face lights nothing, and what lies on one hides it."""
    box = shape("cube", '<translate z="-1"/>', diffuse(0.5))
    lamp = shape("rectangle", '<scale value="0.5"/>{}', diffuse(0), glow(5))
    for estimator in ("walk", "mis", "light"):
        options = ("--spp", 256, "--estimator", estimator)
        face_up, face_down = lamp.format(""), lamp.format('<rotate x="1" angle="180"/>')
        shines = rendered(oneray, tmp_path, view(box + face_up, "2, 1, 5"), *options)
        assert shines.pixels.max() == 5
        dark = rendered(oneray, tmp_path, view(box + face_down, "2, 1, 5", depth=4), *options)
        assert (dark.pixels == 0).all()
        lid = shape("cube", '<translate z="1"/>', diffuse(0.5))
        hidden = rendered(oneray, tmp_path, view(lid + face_up, "2, 1, 5", depth=4), *options)
        assert (hidden.pixels == 0).all()


@pytest.mark.parametrize("precision", PRECISIONS)
def test_glass_stands_on_a_floor(oneray: Path, tmp_path: Path, precision: str) -> None:
    """As if it hovered: below it there is air, however little."""
    ground = shape("rectangle", '<scale value="4"/>', diffuse(0.5))
    block = shape("cube", '<translate z="1"/><scale value="0.5"/><translate z="{}"/>', GLASS)
    options = ("--precision", precision, "--spp", 1024)
    scene = [view(ground + block.format(h) + sky(), "1, 2, 4", depth=12) for h in (0, 1e-4)]
    assert same_light(*(rendered(oneray, tmp_path, text, *options) for text in scene))


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("case", places.CASES, ids=lambda case: case.name)
def test_the_sweeps_hold_in_either_precision(
    oneray: Path, monkeypatch: pytest.MonkeyPatch, case: sweeps.Case, precision: str
) -> None:
    monkeypatch.setenv("ONERAY", str(oneray))
    curve = sweeps.sweep(
        replace(case, options=("--precision", precision)), Oneray(), (*case.values[::2], 0.1)
    )
    assert curve.first_bad is None


@pytest.mark.parametrize("name", ["one-place", "many-in-one-place"])
def test_estimators_agree_where_much_is_in_one_place(oneray: Path, tmp_path: Path, name: str) -> None:
    found = []
    for estimator in ("walk", "nee", "mis", *(["light"] if "many" in name else [])):
        command = [oneray, ROOT / f"tests/odd/{name}.xml", "-o", tmp_path / "out.exr", "--spp", "2048"]
        subprocess.run([*command, "--quiet", "--estimator", estimator], check=True, capture_output=True)
        found.append(load_image(tmp_path / "out.exr"))
    assert all(same_light(image, found[0]) for image in found)


@pytest.mark.parametrize(("precision", "lanes"), [("double", 1), ("single", 4)])
def test_what_sees_is_seen(tmp_path: Path, precision: str, lanes: int) -> None:
    """V(p, q) = V(q, p), for points of surfaces that share their places with others, but for those in one
    plane, which no light joins.
    """
    driver = Driver(tmp_path, precision, lanes)
    for name in ("one-place", "many-in-one-place"):
        with driver.scene(ROOT / f"tests/odd/{name}.xml") as scene:
            met, there, back, cosine = driver("visibility", pairs(30000), scene=scene)
        joined = (met > 0) & (cosine > 1e-6)
        assert joined.mean() > 0.2
        assert 0.1 < there[joined].mean() < 0.9
        assert (there == back)[joined].all()


def pairs(count: int) -> NDArray[np.float64]:
    """Two rays in a column, in any direction from where the scenes' room is empty."""
    turn = Rotation.from_rotvec(np.radians(37) * np.array([0.6, 0.8, 0]))
    starts = [
        turn.apply((uniforms(count, seed, rows=3, low=-1) * [[2.5], [0.2], [2.5]] + [[0], [1.8], [0]]).T).T
        for seed in (1, 2)
    ]
    return np.vstack([starts[0], directions(count, 3), starts[1], directions(count, 4)])


# ---- What is said of it.


def test_an_order_that_the_file_does_not_say_is_a_warning(oneray: Path, tmp_path: Path) -> None:
    """With both lines, where the picture depends on it; else not a word."""
    lines = {
        "differ": (shape("rectangle", "", diffuse(0.5)), shape("disk", "", diffuse(0.4))),
        "lamp": (shape("rectangle", "", diffuse(0.5)), shape("disk", "", diffuse(0.5), glow(1))),
        "alike": (shape("rectangle", "", diffuse(0.5)), shape("disk", "", diffuse(0.5))),
        "apart": (shape("rectangle", "", diffuse(0.5)), shape("disk", '<translate z="1e-9"/>', diffuse(0.4))),
        "opposite": (shape("rectangle", "", diffuse(0.5)), shape("cube", '<translate z="1"/>', diffuse(0.4))),
        "beside": (
            shape("rectangle", "", diffuse(0.5)),
            shape("rectangle", '<translate x="2"/>', diffuse(0.4)),
        ),
    }
    for name, pair in lines.items():
        done = run(
            oneray, tmp_path, view("\n".join(pair) + sky(), "0, 0, 5"), "--precision", "double", "--spp", 1
        )
        said = {
            "differ": "19: this surface and that of line 20",
            "lamp": "20: this surface and that of line 19",
        }
        if name in said:
            assert f"scene.xml:{said[name]} are in one place, face the same way and differ" in done.stderr
        assert done.stderr.count("\n") == (name in said), name


def test_what_stands_on_a_floor_costs_nothing(oneray: Path, tmp_path: Path) -> None:
    """No ray gets between a floor and a box that stands on it, nor between boxes: where nothing is below, no
    layers are wanted, and a kernel's instance serves the scene.
    """
    box = '<shape type="cube"><transform name="to_world"><translate x="{}" z="{}"/></transform>{}</shape>'
    body = floor(diffuse(0.5)) + box.format(0, 1, diffuse(0.5)) + box.format(0.5, 3, diffuse(0.4))
    lamp = square(4, 6, 0.5, glow(1))
    done = run(oneray, tmp_path, world(body + lamp, eye="9, 5, 6"), "--spp", 1, "--stats", "-")
    assert json.loads(done.stdout)["kernel"] == "room" and not done.stderr


def test_no_guess_is_spoken_of_where_the_numbers_say_which_is_in_front(oneray: Path, tmp_path: Path) -> None:
    """Sheets 1e-9 apart at a distance of 1: in one place in single precision, and in order in the file."""

    def said(height: float) -> str:
        sheets = "".join(
            shape("rectangle", f'<scale value="2"/><translate z="{z}"/>', diffuse(grey))
            for z, grey in ((0.0, 0.5), (height, 0.2))
        )
        return run(
            oneray, tmp_path, view(sheets + sky(), "0, 0, 4"), "--precision", "single", "--spp", 1
        ).stderr

    assert "in one place" in said(0.0)
    assert "in one place" not in said(1e-9)
