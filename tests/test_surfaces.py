"""Surfaces have the texture coordinates and tangents that Mitsuba gives them, and the two belong together."""

from __future__ import annotations

import itertools
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest
from sampling import SCENE, Array, Driver, directions, uniforms
from test_meshes import ball

RAYS = 1000
DELTA = 1e-6

TRANSFORMS = {
    "here": "",
    "turned": '<rotate x="0.48" y="-0.6" z="0.64" angle="70"/><scale value="0.7"/><translate x="1" y="-2"/>',
    "mirrored": '<scale x="-1.5" y="1.5" z="1.5"/><rotate x="0.6" y="0.8" angle="130"/><translate z="1"/>',
}
STRETCHED = '<scale x="2" y="0.5" z="1.5"/><rotate y="0.8" z="0.6" angle="40"/><translate x="-1" y="0.3"/>'
ALONG = {
    "quarter": '<scale x="2" y="0.5"/><rotate x="1" angle="90"/><translate x="-1" y="0.3"/>',
    "matrix": '<matrix value="0 -2 0 1  0 0 1 2  -0.5 0 0 3  0 0 0 1"/>',
    "half": '<rotate z="1" angle="180"/><scale x="1" y="-3" z="2"/>',
}
FLIPPED = '<boolean name="flip_normals" value="true"/>'
FACES = '<boolean name="face_normals" value="true"/>'
BALL = '<point name="center" x="0.3" y="-0.2" z="0.1"/><float name="radius" value="1.3"/>'

# name: type, what stands inside besides to_world, transforms by name
SHAPES = {
    "rectangle": ("rectangle", "", {**TRANSFORMS, **ALONG, "stretched": STRETCHED}),
    "disk": ("disk", "", {**TRANSFORMS, "stretched": STRETCHED}),
    "cube": ("cube", "", {**TRANSFORMS, **ALONG, "stretched": STRETCHED}),
    "sphere": ("sphere", BALL, TRANSFORMS),
}
MESHES = [
    *itertools.product(("plain.ply", "u.ply", "s.ply", "plain.obj", "vt.obj"), ("", FACES)),
    ("normals.obj", ""),
    ("u.ply", '<boolean name="flip_tex_coords" value="true"/>'),
    ("vt.obj", '<boolean name="flip_tex_coords" value="false"/>'),
]
for mesh, inside in MESHES:
    name = " ".join([mesh, *(word for word in ("face_normals", "flip_tex_coords") if word in inside)])
    ways = {**TRANSFORMS, "stretched": STRETCHED}
    SHAPES[name] = (mesh[-3:], f'<string name="filename" value="{{folder}}/{mesh}"/>{inside}', ways)
CASES = [(name, way, flip) for name, (_, _, ways) in SHAPES.items() for way in ways for flip in (False, True)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Meshes: one bumpy ball, with random texture coordinates and without."""
    target = tmp_path_factory.mktemp("meshes")
    points, faces = ball(4)
    uv = uniforms(len(points), 3, low=-1, high=2).T.astype(np.float32)
    for name, (u, v) in {"plain": ("", ""), "u": ("u", "v"), "s": ("s", "t")}.items():
        head = f"ply\nformat ascii 1.0\nelement vertex {len(points)}\n"
        head += "".join(f"property float {c}\n" for c in (*"xyz", u, v) if c)
        head += f"element face {len(faces)}\nproperty list uchar int vertex_index\nend_header\n"
        rows = np.hstack([points, uv]) if u else points
        text = "".join(" ".join(map(repr, map(float, row))) + "\n" for row in rows)
        (target / f"{name}.ply").write_text(head + text + "".join("3 {} {} {}\n".format(*f) for f in faces))
    positions = "".join("v {!r} {!r} {!r}\n".format(*map(float, p)) for p in points)
    normals = "".join("vn {!r} {!r} {!r}\n".format(*map(float, p / np.linalg.norm(p))) for p in points)
    textures = "".join("vt {!r} {!r}\n".format(*map(float, t)) for t in uv)
    for name, (more, corner) in {
        "plain": ("", "{0}"),
        "vt": (textures, "{0}/{0}"),
        "normals": (normals, "{0}//{0}"),
    }.items():
        text = "".join("f " + " ".join(corner.format(k + 1) for k in f) + "\n" for f in faces)
        (target / f"{name}.obj").write_text(positions + more + text)
    return target


@pytest.fixture(scope="module")
def drivers(driver: Driver, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Driver]:
    target = tmp_path_factory.mktemp("drivers")
    rest = {f"{p} {n}": Driver(target, p, n) for p, n in (("double", 4), ("single", 1), ("single", 4))}
    return {"double 1": driver, **rest}


def shape(folder: Path, name: str, way: str, flip: bool = False) -> str:
    kind, inside, ways = SHAPES[name]
    place = f'<transform name="to_world">{ways[way]}</transform>' if ways[way] else ""
    inside = inside.format(folder=folder)
    return f'<shape type="{kind}">{inside}{place}{FLIPPED if flip else ""}</shape>'


def rays(body: str, seed: int) -> Array:
    """(o, d), (6, RAYS), from around a shape to points in its box, in single precision."""
    box = mi.load_string(SCENE.format(body)).bbox()
    low, high = np.array(box.min)[:, None], np.array(box.max)[:, None]
    to = low + (high - low) * uniforms(RAYS, seed, 3)
    origin = (to + 3 * np.linalg.norm(high - low) * directions(RAYS, seed + 1)).astype(np.float32)
    way = to - origin
    return np.vstack([origin, way / np.linalg.norm(way, axis=0)])


def ask(driver: Driver, body: str, way: Array) -> Array:
    with driver.scene(body, uv=True) as scene:
        return driver("frame", way, scene=scene)


def by_mitsuba(body: str, way: Array) -> Array:
    """The same twelve rows, of scalar_rgb."""
    scene = mi.load_string(SCENE.format(body))
    out = np.zeros((12, way.shape[1]))
    for i, (o, d) in enumerate(zip(way[:3].T, way[3:].T, strict=True)):
        si = scene.ray_intersect(mi.Ray3f(o, d), mi.RayFlags.All, True)
        if si.is_valid():
            out[:, i] = np.concatenate([[1], si.p, si.uv, si.dp_du, si.dp_dv])
    return out


def near(ours: Array, theirs: Array, tolerance: float) -> float:
    """The share of the columns whose (u, v) and tangents agree, these by their lengths."""
    error = np.abs(ours[4:6] - theirs[4:6])
    good = (error <= tolerance * (1 + np.abs(theirs[4:6]))).all(axis=0)
    for k in (6, 9):
        length = np.linalg.norm(theirs[k : k + 3], axis=0)
        good &= np.linalg.norm(ours[k : k + 3] - theirs[k : k + 3], axis=0) <= tolerance * (1 + length)
    return float(good.mean())


@pytest.fixture(autouse=True, scope="module")
def _mitsuba() -> None:
    mi.set_variant("scalar_rgb")
    mi.set_log_level(mi.LogLevel.Error)


@pytest.mark.parametrize(("name", "way", "flip"), CASES)
def test_frames_are_mitsubas(
    drivers: dict[str, Driver], folder: Path, name: str, way: str, flip: bool
) -> None:
    """By all precisions and lanes. Mitsuba's is single: a few rays near an edge, a pole or the seam of an
    angle differ, and where the texture is squeezed into a sliver."""
    body = shape(folder, name, way, flip)
    along = rays(body, 7)
    theirs = by_mitsuba(body, along)
    for label, one in drivers.items():
        ours = ask(one, body, along)
        both = (ours[0] > 0) & (theirs[0] > 0)
        assert (ours[0] == theirs[0]).mean() > 0.99 and both.mean() > 0.15, label
        assert near(ours[:, both], theirs[:, both], 1e-3) > 0.985, label


@pytest.mark.parametrize(("name", "way", "flip"), CASES)
def test_a_step_along_the_tangents_is_a_step_of_the_coordinates(
    driver: Driver, folder: Path, name: str, way: str, flip: bool
) -> None:
    """At p + δ dp/du + ε dp/dv there is (u + δ, v + ε), but for what lies beyond an edge or at a seam."""
    body = shape(folder, name, way, flip)
    first = rays(body, 11)
    here = ask(driver, body, first)
    first, here = first[:, here[0] > 0], here[:, here[0] > 0]
    size = np.maximum(np.linalg.norm(here[6:9], axis=0), np.linalg.norm(here[9:12], axis=0))
    step = DELTA / np.maximum(size, 1) * uniforms(here.shape[1], 13, low=-1)
    to = here[1:4] + step[0] * here[6:9] + step[1] * here[9:12]
    moved = ask(driver, body, np.vstack([to - 0.01 * first[3:], first[3:]]))
    error = np.abs(moved[4:6] - here[4:6] - step).max(axis=0)
    assert (error <= 1e-3 * np.abs(step).max(axis=0) + 1e-11).mean() > 0.985


@pytest.mark.parametrize("precision", ["double", "single"])
def test_lanes_agree(drivers: dict[str, Driver], folder: Path, precision: str) -> None:
    """To the bit, where one scene has shapes of all kinds."""
    body = "".join(
        shape(folder, name, "turned").replace('x="1" y="-2"', f'x="{3 * i}" y="0"')
        for i, name in enumerate(("rectangle", "disk", "cube", "sphere", "plain.ply", "vt.obj"))
    )
    body += shape(folder, "rectangle", "quarter")
    along = rays(body, 17)
    one, four = (ask(drivers[f"{precision} {n}"], body, along) for n in (1, 4))
    assert len(np.unique(one[6, one[0] > 0])) > 20
    np.testing.assert_array_equal(four[:, one[0] > 0], one[:, one[0] > 0])
    theirs = by_mitsuba(body, along)
    both = (one[0] > 0) & (theirs[0] > 0)
    assert both.any() and near(one[:, both], theirs[:, both], 1e-3) > 0.985


def test_poles_and_middles_are_mitsubas(drivers: dict[str, Driver]) -> None:
    for kind, z in itertools.product(("sphere", "disk"), (1, -1)):
        body = f'<shape type="{kind}"/>'
        along = np.array([[0, 0, 3 * z, 0, 0, -z]], dtype=float).T
        for one in drivers.values():
            np.testing.assert_allclose(ask(one, body, along), by_mitsuba(body, along), atol=1e-6)


TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0.5\n"
FRAME = np.array([[0.2, 0.3, 5, 0, 0, -1]]).T


@pytest.mark.parametrize("flip", ["", FLIPPED])
def test_a_texture_without_area_has_mitsubas_tangents(
    drivers: dict[str, Driver], tmp_path: Path, flip: str
) -> None:
    (tmp_path / "a.obj").write_text(f"{TRIANGLE}vt 0.5 0.25\nf 1/1 2/1 3/1\n")
    body = f'<shape type="obj"><string name="filename" value="{tmp_path}/a.obj"/>{flip}</shape>'
    for one in drivers.values():
        np.testing.assert_allclose(ask(one, body, FRAME), by_mitsuba(body, FRAME), atol=1e-5)


@pytest.mark.parametrize(
    ("text", "without"),
    [
        ("f 1 2 3\n", 0),
        ("vt 0 0\nf 1 2 3\n", 0),
        ("vt x\nvt 1\nf 1 2 3\n", 0),
        ("vt 0 0\nvt 1 0\nvt 0 1 0.5 # w\nf 1/1 2/2 3/3\n", 0),
        ("vt 0 0\nvt 1 0\nf 1/1 2/2 3\n", 1),
        ("vt 0 0\nvt 1\nvt nan 1\nf 1/1 2/2 3/3\n", 2),
        ("vt\nvt 0x1 1\nvt 1e99 1\nf 1/1 2/2 3/3\n", 3),
    ],
)
def test_what_lacks_texture_coordinates(driver: Driver, tmp_path: Path, text: str, without: int) -> None:
    """It is counted for those who want them; to others no vt is an error."""
    (tmp_path / "a.obj").write_text(TRIANGLE + text)
    body = f'<shape type="obj"><string name="filename" value="{tmp_path}/a.obj"/></shape>'
    (tmp_path / "a.xml").write_text(SCENE.format(body))
    assert driver.mesh_without_uv(tmp_path / "a.xml") == without
    if without or "vt x" in text or "/" not in text:
        np.testing.assert_allclose(ask(driver, body, FRAME)[4:6, 0], (0.2, 0.3), atol=1e-12)


@pytest.mark.parametrize(
    ("names", "row", "uv"),
    [
        ("u v s t", "{u} {v} 7 7", True),
        ("s t u v", "7 7 {u} {v}", True),
        ("s t texture_u texture_v", "7 7 {u} {v}", True),
        ("t s", "{v} {u}", True),
        ("u t", "{u} {v}", False),
        ("u s v", "{u} 7 {v}", True),
    ],
)
def test_names_of_texture_coordinates_in_ply(
    driver: Driver, tmp_path: Path, names: str, row: str, uv: bool
) -> None:
    numbers = [(0.1, 0.2), (0.9, 0.3), (0.2, 1.8)]
    text = "ply\nformat ascii 1.0\nelement vertex 3\n"
    text += "".join(f"property float {name}\n" for name in ("x", "y", "z", *names.split()))
    text += "element face 1\nproperty list uchar int vertex_index\nend_header\n"
    corners = zip(("0 0 0", "1 0 0", "0 1 0.5"), numbers, strict=True)
    text += "".join(f"{p} {row.format(u=u, v=v)}\n" for p, (u, v) in corners)
    (tmp_path / "a.ply").write_text(text + "3 0 1 2\n")
    body = f'<shape type="ply"><string name="filename" value="{tmp_path}/a.ply"/></shape>'
    ours, theirs = ask(driver, body, FRAME), by_mitsuba(body, FRAME)
    np.testing.assert_allclose(ours, theirs, atol=1e-5)
    assert (abs(ours[4, 0] - 0.2) > 0.01) == uv
