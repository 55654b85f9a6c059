"""raycheck scene: what it prints is the scene that oneray renders, or one line says why there is none.

Each export is rendered by tracer.py, which knows of the scene what the JSON says and nothing else, and
compared with oneray's picture: the image and its quarters, in each channel. They differ where a mean is more
than 6 standard errors off, which in some 1500 comparisons happens by chance once in 300,000 runs; seeds are
fixed.
"""

import ast
import copy
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from malformed_meshes import MALFORMED as MALFORMED_MESHES
from malformed_meshes import shape as shape_of
from tracer import Tracer

from raycheck.base.errors import ReferenceError_
from raycheck.base.images import Image, load_image
from raycheck.scene import code, export, materials, plugins, textures, variants
from raycheck.scene.reader import read_scene

ROOT = Path(__file__).resolve().parents[1]
FILES = [
    *sorted((ROOT / "scenes").glob("*.xml")),
    *sorted((ROOT / "scenes/stiff").glob("*.xml")),
    *(path for path in sorted((ROOT / "tests/odd").glob("*.xml")) if path.stem != "textures"),
    ROOT / "tests/everything.xml",
]
"""All but one that has a texture on a mesh; without that it is among those below."""
SCHEMA = jsonschema.Draft202012Validator(json.loads(export.SCHEMA.read_text(encoding="utf-8")))


@pytest.mark.parametrize("of", variants.ladder(), ids=lambda of: of.label)
def test_every_scene_fits_the_schema(of: variants.Variant) -> None:
    SCHEMA.validate(json.loads(export.to_json(export.export(of))))


def test_the_schema_is_that_of_the_table_of_materials(tmp_path: Path) -> None:
    subprocess.run([sys.executable, ROOT / "scripts/make_schema.py", tmp_path / "schema"], check=True)
    assert (tmp_path / "schema").read_text(encoding="utf-8") == export.SCHEMA.read_text(encoding="utf-8")


def test_the_table_has_all_kinds_that_oneray_has() -> None:
    known = {"bsdf": materials.MATERIALS, "texture": textures.TEXTURES}
    for tag, table in known.items():
        plugins_of = [one for one in plugins._tables()["plugins"] if one["element"] == tag]
        assert sorted(table) == sorted(name for one in plugins_of for name in one["types"])


def test_coordinates_of_textures_are_those_of_the_picture() -> None:
    """The numbers of shapes give the colours that Mitsuba sees along rays from the eye."""
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    data = export.export(variants.variant("textured-room"))
    scene = mi.load_file(str(ROOT / "scenes/textured-room.xml"))
    tracer, seen = Tracer(data, seed=1), set()
    o, d, _ = tracer._camera(np.random.default_rng(1).random((400, 2)))
    which, t = tracer.shapes.meet(o, d, np.full(len(o), -1))
    met = which >= 0
    o, d, which, t = o[met], d[met], which[met], t[met]
    uv, _ = tracer.shapes.coordinates(which, o + t[:, None] * d)
    for k in range(len(which)):
        index = tracer.shapes.material[which[k]]
        material = data["materials"][index]
        place = (np.array(material["to_uv"]) @ [*uv[k], 1])[:2]
        if material["type"] == "diffuse" and (np.abs(place * 2 - np.round(place * 2)) > 1e-2).all():
            u, v = place % 1 > 0.5
            si = scene.ray_intersect(mi.Ray3f(o[k], d[k]))
            found = np.array(si.bsdf().eval_diffuse_reflectance(si))
            np.testing.assert_allclose(found, material["color1" if u != v else "color0"], atol=1e-5)
            seen.add((index, u != v))
    assert len(seen) == 10  # both colours of floor, wall, screen, cube and ball


@pytest.mark.parametrize("name", variants.scene_names())
def test_rays_between_the_corners_are_the_camera_s(name: str) -> None:
    """By all four corners, or by three: they are on one plane, also where the view's axis is aside."""
    of = variants.variant(name)
    camera = read_scene(of.path).camera
    data = export.export(of)["camera"]
    corner, right, below, last = (
        np.array(data[k]) for k in ("top_left", "top_right", "bottom_left", "bottom_right")
    )
    assert last == pytest.approx(right + below - corner, abs=1e-12)
    for x, y in ((0.0, 0.0), (13.0, 30.5), (camera.width, camera.height)):
        way = corner + (right - corner) * x / camera.width + (below - corner) * y / camera.height
        if camera.parallel:
            start = camera.starts(np.array(float(x)), np.array(float(y)))
            assert way + data["origin"] == pytest.approx(start, abs=1e-12)
        else:
            expected = camera.directions(np.array(x), np.array(y))
            assert way / np.linalg.norm(way) == pytest.approx(expected, abs=1e-12)


def test_six_faces_of_a_cube_look_outwards() -> None:
    data = export.export(variants.variant("cornell-box"))
    block = [p for p in data["primitives"] if p["type"] == "parallelogram"][5:11]
    middles = [np.array(p["corner"]) + (np.array(p["edge_u"]) + np.array(p["edge_v"])) / 2 for p in block]
    for face, middle in zip(block, middles, strict=True):
        assert np.dot(face["normal"], middle - np.mean(middles, axis=0)) > 0
        assert np.cross(face["edge_u"], face["edge_v"]) @ np.array(face["normal"]) > 0


def test_triangles_have_the_mesh_s_normals_where_they_are_smooth() -> None:
    data = export.export(variants.variant("smooth-mesh"))
    smooth = [p for p in data["primitives"] if "vertex_normals" in p]
    flat = [p for p in data["primitives"] if p["type"] == "triangle" and "vertex_normals" not in p]
    assert smooth and flat
    for p in smooth:
        assert np.linalg.norm(p["vertex_normals"], axis=1) == pytest.approx(1.0)
        assert (np.array(p["vertex_normals"]) @ np.array(p["normal"]) > 0.5).all()


def test_normals_that_a_mesh_lacks_are_made_where_it_stands(tmp_path: Path) -> None:
    """Of a mesh that is squeezed and mirrored those of the mesh whose vertices are so."""
    from trimesh import Trimesh, load

    lump = load(ROOT / "tests/meshes/lump.ply", process=False)
    matrix = np.diag([-0.4, 1.0, 0.3])
    squeezed = Trimesh(lump.vertices @ matrix, lump.faces, process=False)
    squeezed.export(tmp_path / "squeezed.ply", encoding="ascii", vertex_normal=False)
    files = {
        ROOT / "tests/meshes/lump.ply": "-0.4 0 0 0 1 0 0 0 0.3",
        tmp_path / "squeezed.ply": "1 0 0 0 1 0 0 0 1",
    }
    exports = []
    for name, numbers in files.items():
        placed = f'<transform name="to_world"><matrix value="{numbers}"/></transform>'
        shape = f'<shape type="ply"><string name="filename" value="{name}"/>{placed}</shape>'
        (tmp_path / "mesh.xml").write_text(BASE.replace("<!-- here -->", shape), encoding="utf-8")
        exports.append(export.export(variants.Variant(tmp_path / "mesh.xml"))["primitives"][2:])
    assert len(exports[0]) == len(lump.faces)
    for one, other in zip(*exports, strict=True):
        for name in ("vertices", "normal", "vertex_normals"):
            assert np.ravel(one[name]) == pytest.approx(np.ravel(other[name]), abs=1e-5)


def test_such_normals_go_by_angles(tmp_path: Path) -> None:
    """A cube's corners are all alike, however its sides are cut into triangles."""
    corners = "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1))
    sides = ("1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4")
    (tmp_path / "cube.obj").write_text(corners + "".join(f"f {side}\n" for side in sides), encoding="utf-8")
    shape = '<shape type="obj"><string name="filename" value="cube.obj"/></shape>'
    (tmp_path / "mesh.xml").write_text(BASE.replace("<!-- here -->", shape), encoding="utf-8")
    faces = export.export(variants.Variant(tmp_path / "mesh.xml"))["primitives"][2:]
    assert len(faces) == 12
    for face in faces:
        outwards = (2 * np.array(face["vertices"]) - 1) / np.sqrt(3)
        assert np.array(face["vertex_normals"]) == pytest.approx(outwards)


# ---- what is exported is what oneray renders


def picture_of(oneray: Path, scene: Path, folder: Path) -> Image:
    out = folder / "oneray.exr"
    subprocess.run([oneray, scene, "-o", out, "--spp", "64", "--quiet"], check=True, capture_output=True)
    return load_image(out)


def off(data: dict[str, Any], picture: Image) -> float:
    """How many standard errors the export is off, in the worst of the image and its quarters.

    An error is never taken for less than half of what it were at the image's own spread: a quarter may have
    missed what is rarely met.
    """
    height, width = picture.pixels.shape[:2]
    things = len(data["primitives"]) + len(data["lights"])
    film, values = Tracer(data, seed=1).render(128**2 if things < 100 else 64**2)
    quarter = np.add.outer(2 * (2 * np.arange(height) // height), 2 * np.arange(width) // width)
    of_path = quarter[(film[:, 1] * height).astype(int), (film[:, 0] * width).astype(int)]
    assert picture.stderr is not None
    worst = 0.0
    for part in (-1, 0, 1, 2, 3):
        pixels, paths = (quarter == part, of_path == part) if part >= 0 else (quarter >= 0, of_path >= 0)
        count = pixels.sum()
        if not count:
            continue
        expected = picture.pixels[pixels].mean(axis=0)
        variance = (picture.stderr[pixels] ** 2).sum(axis=0) / count**2
        variance += np.maximum(values[paths].var(axis=0), values.var(axis=0) / 4) / paths.sum()
        difference = np.abs(values[paths].mean(axis=0) - expected)
        exact = difference <= 1e-6 * expected
        worst = max(worst, float(np.where(exact, 0, difference / np.sqrt(variance + 1e-300)).max()))
    return worst


IN_ONE_PLACE = {"one-place", "many-in-one-place"}
"""Scenes of tests/odd whose surfaces lie in one place: which is met first is not in the data."""
BY_CHANCE = ROOT / "scenes/stiff/rough-boundary.xml"
"""Its light comes from one direction, through rough glass, which the tests' tracer passes by chance alone."""


@pytest.mark.sample(40)
@pytest.mark.parametrize(
    "scene",
    [
        file
        for file in FILES
        if (file.parent.name != "odd" or file.stem not in IN_ONE_PLACE) and file != BY_CHANCE
    ],
    ids=lambda path: path.stem,
)
def test_every_scene_is_exported_as_oneray_renders_it(oneray: Path, scene: Path, tmp_path: Path) -> None:
    data = json.loads(export.to_json(export.export(variants.Variant(scene))))
    SCHEMA.validate(data)
    assert off(data, picture_of(oneray, scene, tmp_path)) < 6


BASE = """\
<scene version="3.0.0">
    <integrator type="path"><integer name="max_depth" value="4"/></integrator>
    <sensor type="perspective">
        <float name="fov" value="40"/>
        <transform name="to_world"><lookat origin="0, 1, 6" target="0, 0, 0" up="0, 1, 0"/></transform>
        <film type="hdrfilm">
            <integer name="width" value="16"/><integer name="height" value="16"/><rfilter type="box"/>
        </film>
    </sensor>
    <bsdf type="diffuse" id="red"><rgb name="reflectance" value="0.9, 0.1, 0.1"/></bsdf>
    <shape type="rectangle">
        <transform name="to_world"><scale value="4"/><rotate x="1" angle="270"/><translate y="-1"/>
        </transform></shape>
    <emitter type="constant"><rgb name="radiance" value="0.5, 0.6, 0.9"/></emitter>
    <shape type="sphere">
        <point name="center" x="2" y="3" z="2"/><float name="radius" value="0.5"/>
        <emitter type="area"><rgb name="radiance" value="12, 10, 8"/></emitter>
    </shape>
    <!-- here -->
</scene>
"""
CAMERA = '<lookat origin="0, 1, 6" target="0, 0, 0" up="0, 1, 0"/>'
LUMP = f'<string name="filename" value="{ROOT}/tests/meshes/lump.ply"/>'
SQUEEZED = '<transform name="to_world"><scale x="-0.4" z="0.3"/><rotate x="1" angle="40"/></transform>'


def with_ball(bsdf: str) -> str:
    return BASE.replace("<!-- here -->", f'<shape type="sphere">{bsdf}</shape>')


def with_panes(bsdf: str) -> str:
    """Rectangles that show one side each."""
    panes = (
        '<shape type="rectangle"><transform name="to_world"><scale value="0.9"/>'
        f'<rotate y="1" angle="{angle}"/><translate x="{x}"/></transform>{bsdf}</shape>'
        for angle, x in ((30, -1.2), (150, 1.2))
    )
    return BASE.replace("<!-- here -->", "".join(panes))


BOARD = (
    '<texture type="checkerboard" {}><rgb name="color0" value="0.9, 0.8, 0.1"/>'
    '<rgb name="color1" value="0.05, 0.1, 0.6"/><transform name="to_uv"><scale x="0.5"/>'
    '<translate x="-4" y="7"/></transform></texture>'
)


RENDERED = {
    "metal-by-name": with_ball('<bsdf type="conductor"><string name="material" value="Cu"/></bsdf>'),
    "tinted-glass": with_ball(
        '<bsdf type="dielectric"><string name="int_ior" value="bk7"/><string name="ext_ior" value="air"/>'
        '<rgb name="specular_transmittance" value="1, .5, .2"/>'
        '<rgb name="specular_reflectance" value=".2, .9, .9"/></bsdf>'
    ),
    "rough": with_ball(
        '<bsdf type="roughconductor"><string name="distribution" value="ggx"/>'
        '<float name="alpha_u" value=".4"/><float name="alpha_v" value=".4"/>'
        '<boolean name="sample_visible" value="false"/></bsdf>'
    ),
    "thin-pane": with_panes(
        '<bsdf type="thindielectric"><float name="int_ior" value="2.4"/>'
        '<rgb name="specular_transmittance" value="1, .5, .2"/>'
        '<rgb name="specular_reflectance" value=".2, .9, .9"/></bsdf>'
    ),
    "rough-glass": with_ball(
        '<bsdf type="roughdielectric"><string name="distribution" value="ggx"/>'
        '<float name="alpha" value=".3"/>'
        '<rgb name="specular_transmittance" value="1, .7, .5"/></bsdf>'
    ),
    "anisotropic-rough-glass": with_panes(
        '<bsdf type="roughdielectric"><string name="distribution" value="ggx"/>'
        '<float name="alpha_u" value=".1"/><float name="alpha_v" value=".6"/></bsdf>'
    ),
    "beckmanns-metal": with_ball(
        '<bsdf type="roughconductor"><float name="alpha" value=".5"/>'
        '<string name="material" value="Cu"/></bsdf>'
    ),
    "brushed-metal-of-beckmann": with_panes(
        '<bsdf type="roughconductor"><float name="alpha_u" value=".2"/>'
        '<float name="alpha_v" value=".7"/></bsdf>'
    ),
    "beckmanns-glass": with_ball('<bsdf type="roughdielectric"><float name="alpha" value=".4"/></bsdf>'),
    "a-board-of-roughnesses": with_panes(
        '<bsdf type="roughconductor"><string name="distribution" value="ggx"/><texture name="alpha" '
        'type="checkerboard"><float name="color0" value=".1"/><float name="color1" value=".7"/>'
        "</texture></bsdf>"
    ),
    "a-board-of-roughnesses-along": with_panes(
        '<bsdf type="roughdielectric"><float name="alpha_v" value=".3"/><texture name="alpha_u" '
        'type="checkerboard"><float name="color0" value="0"/><float name="color1" value=".8"/>'
        "</texture></bsdf>"
    ),
    "rough-plastic": with_ball(
        '<bsdf type="roughplastic"><float name="alpha" value=".3"/><rgb name="diffuse_reflectance" '
        'value=".9, .3, .1"/><boolean name="nonlinear" value="true"/></bsdf>'
    ),
    "rough-plastic-of-ggx": with_panes(
        '<bsdf type="roughplastic"><string name="distribution" value="ggx"/><float name="int_ior" '
        'value="1.9"/><rgb name="specular_reflectance" value=".4, 1, .7"/></bsdf>'
    ),
    "plastic": with_ball(
        '<bsdf type="plastic"><rgb name="diffuse_reflectance" value=".9, .3, .1"/>'
        '<rgb name="specular_reflectance" value=".5, 1, 1"/></bsdf>'
    ),
    "nonlinear-plastic-with-a-board": with_panes(
        '<bsdf type="plastic"><string name="int_ior" value="diamond"/>'
        '<boolean name="nonlinear" value="true"/>'
        '<ref name="diffuse_reflectance" id="board"/><ref name="specular_reflectance" id="board"/></bsdf>'
    ).replace("<shape", BOARD.format('id="board"') + "<shape", 1),
    "a-lamp-is-black": BASE.replace('value="0.5, 0.6, 0.9"', 'value="4, 4, 9"').replace(
        'x="2" y="3" z="2"', 'x="0.5" y="1" z="3"'
    ),
    "blend-by-reference": with_ball(
        '<bsdf type="blendbsdf"><float name="weight" value=".3"/><ref id="red"/><bsdf type="diffuse"/></bsdf>'
    ),
    "one-sided": with_panes('<ref id="red"/>'),
    "two-sided-by-reference": with_panes('<bsdf type="twosided"><ref id="red"/></bsdf>'),
    "blend-of-which-one-is-two-sided": with_panes(
        '<bsdf type="blendbsdf"><float name="weight" value=".6"/><ref id="red"/>'
        '<bsdf type="twosided"><bsdf type="diffuse"/></bsdf></bsdf>'
    ),
    "two-sided-blend": with_panes(
        '<bsdf type="twosided"><bsdf type="blendbsdf"><float name="weight" value=".6"/><ref id="red"/>'
        '<bsdf type="conductor"/></bsdf></bsdf>'
    ),
    "blend-with-glass": with_panes(
        '<bsdf type="blendbsdf"><float name="weight" value=".6"/><ref id="red"/><bsdf type="dielectric">'
        '<float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/></bsdf></bsdf>'
    ),
    "no-up": with_ball("").replace(CAMERA, '<lookat origin="3, 1, 5" target="0, 0, 0"/>'),
    "numbers-with-a-default": with_ball('<bsdf type="diffuse"><rgb name="reflectance" value="$b"/></bsdf>')
    .replace("<sensor", '<default name="a" value=".1"/><default name="b" value="$a, .9 $a"/><sensor'),
    "clipped": with_ball("").replace(
        '<float name="fov"', '<float name="near_clip" value="5.5"/><float name="far_clip" value="7"/>'
        '<float name="fov"'
    ),
    "by-the-diagonal": with_ball("").replace(
        '<float name="fov"', '<string name="fov_axis" value="diagonal"/><float name="fov"'
    ).replace('name="width" value="16"', 'name="width" value="8"'),
    "hidden-emitters": with_ball("").replace(
        '<integer name="max_depth"', '<boolean name="hide_emitters" value="TRUE"/><integer name="max_depth"'
    ),
    "a-mirrored-ball-is-inside-out": with_ball('<transform name="to_world"><scale x="-1"/></transform>'),
    "a-ball-of-no-size": BASE.replace(
        "<!-- here -->", '<shape type="sphere"><float name="radius" value="0"/></shape>'
    ),
    "mirrored-disk": BASE.replace(
        "<!-- here -->", '<shape type="disk"><transform name="to_world"><scale x="-1" y=".5" z="-1"/>'
        '<translate z="1"/></transform><boolean name="flip_normals" value="true"/>'
        '<emitter type="area"/></shape>'
    ),
    "squeezed-smooth-mesh": BASE.replace("<!-- here -->", f'<shape type="ply">{LUMP}{SQUEEZED}</shape>'),
    "squeezed-mirror-mesh": BASE.replace(
        "<!-- here -->", f'<shape type="ply">{LUMP}{SQUEEZED}<bsdf type="conductor"/></shape>'
    ),
    "squeezed-faces": BASE.replace(
        "<!-- here -->", f'<shape type="ply">{LUMP}{SQUEEZED}<boolean name="face_normals" value="true"/>'
        '</shape>'
    ),
    "a-light-in-a-point-of-a-matrix": with_ball("").replace(
        '<emitter type="constant"',
        '<emitter type="point"><transform name="to_world"><translate x="3" z="3"/></transform>'
        '<rgb name="intensity" value="9, 1, 1"/></emitter><emitter type="constant"'
    ),
    "a-spot-and-a-sun-of-a-matrix": with_ball("").replace(
        '<emitter type="constant"',
        '<emitter type="spot"><transform name="to_world"><lookat origin="0, 4, 4" target="0, 0, 0"/>'
        '</transform><float name="cutoff_angle" value="12"/><float name="intensity" value="90"/></emitter>'
        '<emitter type="directional"><transform name="to_world"><rotate x="1" angle="50"/></transform>'
        '<rgb name="irradiance" value="0, 3, 0"/></emitter><emitter type="constant"'
    ),
}  # fmt: skip
"""Scenes that say something that no file above says."""

BRUSHED = (
    '<bsdf type="twosided"><bsdf type="roughconductor"><string name="distribution" value="ggx"/>'
    '<float name="alpha_u" value="0.1"/><float name="alpha_v" value="0.8"/></bsdf></bsdf>'
)


def with_pane(kind: str, bsdf: str) -> str:
    """One that fills the picture, in the sun."""
    placed = '<transform name="to_world"><scale value="1.7"/><translate z="0.5"/></transform>'
    shape = f'<shape type="{kind}">{placed}{bsdf}</shape>'
    sun = '<emitter type="directional"><vector name="direction" x="-0.3" y="-1" z="-1"/></emitter>'
    return BASE.replace("<!-- here -->", sun + shape)


MESH = re.compile(r'    <shape type="ply">.*?</shape>\n', re.S)
PICTURES = ROOT / "scenes/pictures"
TILES = (
    f'<texture type="bitmap" {{}}><string name="filename" value="{PICTURES}/tiles.png"/>'
    '<transform name="to_uv"><scale x="1.3" y="-0.7"/><translate x="0.4"/></transform>{}</texture>'
)
HOLED = '<bsdf type="mask"><float name="opacity" value="0.3"/><bsdf type="twosided">{}</bsdf></bsdf>'


def drawn(words: str) -> str:
    texture = TILES.format('name="reflectance"', words)
    return f'<bsdf type="diffuse">{texture}</bsdf>'


RENDERED |= {
    "picture-on-a-pane": with_pane("rectangle", drawn('<boolean name="raw" value="true"/>')),
    "picture-mirrored-on-a-disk": with_pane("disk", drawn('<string name="wrap_mode" value="mirror"/>')),
    "pixels-on-a-ball": with_ball(drawn('<string name="filter_type" value="nearest"/>')),
    "a-mask-over-a-picture": with_ball(HOLED.format(drawn('<string name="wrap_mode" value="clamp"/>'))),
    "null": with_ball('<bsdf type="null"/>'),
    "sky-of-a-picture": with_ball("").replace(
        '<emitter type="constant"><rgb name="radiance" value="0.5, 0.6, 0.9"/></emitter>',
        f'<emitter type="envmap"><string name="filename" value="{PICTURES}/sky.exr"/><float name="scale" '
        'value="0.01"/><transform name="to_world"><scale z="-1"/><rotate x="1" angle="70"/></transform>'
        '</emitter>'
    ),
    "textures-but-on-no-mesh": MESH.sub("", (ROOT / "tests/odd/textures.xml").read_text(encoding="utf-8")),
    "textured-pane": with_pane(
        "rectangle", f'<bsdf type="diffuse">{BOARD}</bsdf>'.format('name="reflectance"')
    ),
    "textured-glass": with_panes(
        '<bsdf type="dielectric"><float name="int_ior" value="2"/><float name="ext_ior" value="1"/>'
        '<ref name="specular_transmittance" id="board"/><ref name="specular_reflectance" id="board"/></bsdf>'
    ).replace("<shape", BOARD.format('id="board"') + "<shape", 1),
    **{f"brushed-{kind}": with_pane(kind, BRUSHED) for kind in ("rectangle", "disk", "sphere", "cube")},
}  # fmt: skip
"""With coordinates on the surface."""


@pytest.mark.parametrize("name", RENDERED)
def test_so_is_whatever_else_a_scene_may_say(oneray: Path, name: str, tmp_path: Path) -> None:
    scene = tmp_path / f"{name}.xml"
    scene.write_text(RENDERED[name], encoding="utf-8")
    data = json.loads(export.to_json(export.export(variants.Variant(scene))))
    SCHEMA.validate(data)
    assert off(data, picture_of(oneray, scene, tmp_path)) < 6


def _grey(data: dict[str, Any]) -> None:
    for material in data["materials"]:
        material.update({"type": "diffuse", "reflectance": [0.5] * 3})


def _without_lamp(data: dict[str, Any]) -> None:
    lamp = next(p for p in data["primitives"] if any(p["radiance"]))
    lamp["radiance"] = [0.0] * 3


def _turned(data: dict[str, Any]) -> None:
    for corner in ("top_left", "top_right", "bottom_left", "bottom_right"):
        data["camera"][corner][0] += 0.05


def _one_sided(data: dict[str, Any]) -> None:
    for material in data["materials"]:
        material["two_sided"] = False


def _direct_light_alone(data: dict[str, Any]) -> None:
    data["max_depth"] = 2


def _opaque(data: dict[str, Any]) -> None:
    for material in data["materials"]:
        if material["type"] == "dielectric":
            material["transmittance"] = [0.9] * 3


def _coordinates_exchanged(data: dict[str, Any]) -> None:
    for one in data["primitives"]:
        if "uv" in one:
            one["uv"] = [[v, u, 0] for u, v, _ in one["uv"]]
        if "axes" in one:
            one["axes"] = one["axes"][::-1]


def _colours_exchanged(data: dict[str, Any]) -> None:
    for material in data["materials"]:
        for prefix in ("", "transmittance_"):
            if f"{prefix}texture" in material:
                first, second = material[f"{prefix}color0"], material[f"{prefix}color1"]
                material.update({f"{prefix}color0": second, f"{prefix}color1": first})


def _brushed_across(data: dict[str, Any]) -> None:
    for material in data["materials"]:
        if "alpha_u" in material:
            material.update(alpha_u=material["alpha_v"], alpha_v=material["alpha_u"])


@pytest.mark.parametrize(
    ("scene", "wrong"),
    [
        ("cornell-box", _grey), ("cornell-box", _without_lamp), ("cornell-box", _turned),
        ("cornell-box", _direct_light_alone), ("glass-ball", _opaque), ("metal", _grey),
        ("rough-metal", _grey),
        ("sphere-light-near", _without_lamp), ("two-sided-by-reference", _one_sided),
        ("textured-pane", _coordinates_exchanged), ("textured-pane", _colours_exchanged),
        ("textured-glass", _colours_exchanged), ("brushed-metal", _brushed_across),
        ("brushed-rectangle", _coordinates_exchanged), ("brushed-rectangle", _brushed_across),
        ("brushed-sphere", _coordinates_exchanged), ("brushed-sphere", _brushed_across),
        ("brushed-disk", _brushed_across), ("brushed-cube", _brushed_across),
    ],
)  # fmt: skip
def test_a_wrong_export_is_noticed(
    oneray: Path, scene: str, wrong: Callable[[dict[str, Any]], None], tmp_path: Path
) -> None:
    path = ROOT / f"scenes/{scene}.xml"
    if scene in RENDERED:
        path = tmp_path / f"{scene}.xml"
        path.write_text(RENDERED[scene], encoding="utf-8")
    data = copy.deepcopy(export.export(variants.Variant(path)))
    wrong(data)
    assert off(data, picture_of(oneray, path, tmp_path)) > 6


# ---- or refused


def refused(path: Path) -> str:
    with pytest.raises(ReferenceError_) as told:
        export.export(variants.Variant(path))
    message = str(told.value)
    assert "\n" not in message
    return message


SENSOR = '<float name="fov" value="40"/>'


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        (with_panes('<bsdf type="twosided"><ref id="red"/><bsdf type="diffuse"/></bsdf>'), 19,
         "with two bsdfs is not supported by raycheck"),
        (with_ball('<bsdf type="pplastic"/>'), 19, '<bsdf type="pplastic"> is not supported'),
        (with_ball('<medium name="interior" type="homogeneous"/>'), 19, "<medium> is not supported in"),
        (with_ball('<bsdf type="roughplastic"><float name="alpha_u" value=".3"/></bsdf>'), 19,
         "is rough alike in all directions"),
        (with_ball('<bsdf type="roughplastic"><texture name="alpha" type="checkerboard"/></bsdf>'), 19,
         "alpha must be a number, as in Mitsuba"),
        (with_ball('<bsdf type="diffuse"><spectrum name="reflectance" value="400:.1"/></bsdf>'), 19,
         "<spectrum> needs pairs"),
        (with_ball('<bsdf type="diffuse"><texture name="reflectance" type="wood"/></bsdf>'), 19,
         '<texture type="wood"> is not supported (checkerboard, bitmap)'),
        (with_ball('<bsdf type="diffuse"><texture name="reflectance" type="checkerboard">'
         '<float name="offset" value="1"/></texture></bsdf>'), 19, 'no property "offset"'),
        (with_ball(f'<bsdf type="diffuse">{BOARD}</bsdf>'.format('name="reflectance"'))
         .replace('<shape type="sphere"><bsdf', f'<shape type="ply">{LUMP}<bsdf'), 19,
         'texture coordinates of <shape type="ply"> are not supported by raycheck'),
        (BASE.replace('<emitter type="constant">', '<emitter type="envmap">'), 14, "envmap"),
        (BASE.replace("sphere", "bsplinecurve"), 15, "bsplinecurve"),
        (BASE.replace("perspective", "thinlens"), 3, "thinlens"),
        (BASE.replace(SENSOR, f'{SENSOR}<float name="principal_point_offset_x" value="200"/>'), 4,
         '"principal_point_offset_x" must be in [-100,100]'),
        (BASE.replace("<rfilter", '<integer name="crop_width" value="4000"/><rfilter'), 6, "the crop window"),
        (BASE.replace("box", "mitchell"), 7, "mitchell"),
        (BASE.replace("<rfilter", '<string name="pixel_format" value="bgr"/><rfilter'), 7, "bgr"),
        (BASE.replace('type="path"', 'type="aov"'), 2, "aov"),
        (BASE.replace("<!-- here -->", '<shape type="rectangle"><emitter type="area">'
         '<float name="radiance" value="0"/></emitter></shape>')
         .replace("<integer", '<boolean name="hide_emitters" value="true"/><integer'), 19,
         "a hidden emitter of radiance 0"),
    ],
)  # fmt: skip
def test_what_cannot_be_exported_is_refused_with_its_line(
    tmp_path: Path, text: str, line: int, message: str
) -> None:
    path = tmp_path / "theirs.xml"
    path.write_text(text, encoding="utf-8")
    told = refused(path)
    assert told.startswith(f"{path}:{line}: ") and message in told


@pytest.mark.parametrize("path", sorted((ROOT / "tests/malformed").glob("*.xml")), ids=lambda path: path.stem)
def test_what_oneray_refuses_is_not_exported(path: Path) -> None:
    """Without a sampler it is the same scene."""
    if path.stem.startswith("sampl"):
        export.export(variants.Variant(path))
    else:
        refused(path)


@pytest.mark.parametrize("name", MALFORMED_MESHES)
def test_no_mesh_ends_in_a_traceback(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(MALFORMED_MESHES[name][0])
    scene = tmp_path / "mesh.xml"
    shape = f"{shape_of(name)}</shape>"
    scene.write_text(BASE.replace("<!-- here -->", shape), encoding="utf-8")
    try:
        data = export.to_json(export.export(variants.Variant(scene)))
    except ReferenceError_ as told:
        assert str(tmp_path / name) in str(told)
    else:
        SCHEMA.validate(json.loads(data, parse_constant=pytest.fail))


def test_a_byte_order_mark_hides_no_vertex(tmp_path: Path) -> None:
    (tmp_path / "flag.obj").write_text(
        "\ufeffv 0 0 0\nv 1 0 0\nv 0 1 0\nv 7 7 7\nf 1 2 3\n", encoding="utf-8"
    )
    scene = tmp_path / "mesh.xml"
    shape = '<shape type="obj"><string name="filename" value="flag.obj"/></shape>'
    scene.write_text(BASE.replace("<!-- here -->", shape), encoding="utf-8")
    *_, triangle = export.export(variants.Variant(scene))["primitives"]
    assert triangle["vertices"] == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


def test_the_command_says_so_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "theirs.xml"
    path.write_text(BASE.replace("perspective", "thinlens"), encoding="utf-8")
    command = [sys.executable, "-m", "raycheck", "scene", str(path), "--as", "json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "") and done.stderr.count("\n") == 1
    assert done.stderr.startswith(f"raycheck: {path}:3: ")


def test_a_property_that_the_reader_does_not_ask_for_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that oneray learns, say."""
    tables = copy.deepcopy(plugins._tables())
    [diffuse] = [one for one in tables["plugins"] if one["types"] == ["diffuse"]]
    new = {"name": "gloss", "kind": "float", "range": None, "default": "0", "one_value": False}
    diffuse["fields"].append(new)
    monkeypatch.setattr(plugins, "_tables", lambda: tables)
    element = plugins.Element("bsdf", {"type": "diffuse"})
    element.append(plugins.Element("float", {"name": "gloss", "value": "1"}))
    message = '"gloss" of <bsdf type="diffuse"> is not supported by raycheck'
    with pytest.raises(ReferenceError_, match=message):
        materials.read_material(element, pytest.fail, pytest.fail, pytest.fail)
    element[0].set("name", "reflectance")
    assert materials.read_material(
        element, pytest.fail, pytest.fail, pytest.fail
    ).reflectance == pytest.approx(1)


def test_raycheck_reads_by_oneray_s_own_tables(tmp_path: Path) -> None:
    """Renewed by scripts/make_plugins.py."""
    command = [sys.executable, ROOT / "scripts/make_plugins.py", tmp_path / "plugins.json"]
    environment = {k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MAKELEVEL", "MFLAGS")}
    subprocess.run(command, check=True, env=environment)
    kept = ROOT / "src/raycheck/scene/plugins.json"
    assert (tmp_path / "plugins.json").read_text(encoding="utf-8") == kept.read_text(encoding="utf-8")


# ---- the same as code, and as text

SPOKEN = [ROOT / "tests/everything.xml", ROOT / "scenes/mixed-material.xml", ROOT / "scenes/smooth-mesh.xml",
          ROOT / "scenes/rough-metal.xml", ROOT / "scenes/mesh-light.xml", ROOT / "scenes/textured-room.xml",
          ROOT / "scenes/brushed-metal.xml"]  # fmt: skip
ARRAYS = {"parallelogram": "parallelograms", "disk": "disks", "sphere": "spheres", "triangle": "triangles",
          "point light": "point_lights", "sun": "suns", "spot light": "spot_lights"}  # fmt: skip


def same(row: dict[str, Any], record: dict[str, Any], materials: list[dict[str, Any]]) -> None:
    """A record says all that the row of the JSON says."""
    for name, value in row.items():
        if name == "parts":
            for part, where in zip(value, (record["first"], record["second"]), strict=True):
                same(part, materials[where], materials)
        elif name == "eta" and isinstance(value, float):
            assert record[name] == [value] * 3
        elif name == "type" and name not in record:
            assert record["kind"] == value
        elif name != "type" or "type" in record:
            assert record[name] == value, name


def check_tables(data: dict[str, Any], tables: dict[str, Any]) -> None:
    """Tables of a program's source, by name, hold the scene."""
    camera = {name: value for name, value in data["camera"].items()}
    plain = {name: data[name] for name in ("max_depth", "roulette_depth", "hide_emitters", "sky")}
    for name, value in {**camera, **plain}.items():
        assert tables[name] == value, name
    materials = tables["materials"]
    for row, record in zip(data["materials"], materials, strict=False):
        same(row, record, materials)
    for kind, array in ARRAYS.items():
        rows = [dict(p) for p in (*data["primitives"], *data["lights"]) if p["type"] == kind]
        for row, record in zip(rows, tables[array], strict=True):
            row.pop("type")
            assert record.get("smooth", "vertex_normals" in row) is ("vertex_normals" in row)
            same(row, record, materials)


def printed_by_cpp(header: str, folder: Path) -> dict[str, Any]:
    """What a program that has the header prints of it: its structures are those that it declares."""
    structs = {name: re.findall(r"([\w ]+\*?) ?\b(\w+)((?:\[3\])*);", body)
               for name, body in re.findall(r"struct (\w+) \{(.*?)\};", header)}  # fmt: skip
    lines = []
    for kind, name, shape in re.findall(r"constexpr (\w+) (\w+)((?:\[3\])*) =", header):
        del kind
        lines.append(f'std::printf("\\"{name}\\": "); print({name}); std::printf(",\\n");')
        assert shape in ("", "[3]")
    for struct, name in re.findall(r"const std::vector<(\w+)> (\w+)", header):
        members = "".join(
            f'std::printf("\\"{field}\\": "); print(x.{field}); std::printf(", ");'
            for _, field, _ in structs[struct]
        )
        lines.append(f'std::printf("\\"{name}\\": [");')
        lines.append(f'for (const auto &x : {name}) {{ std::printf("{{"); {members} std::printf("}},"); }}')
        lines.append('std::printf("],\\n");')
    program = f"""
        #include <cstdio>
        #include "scene.hpp"
        using namespace scene;
        static void print(double x) {{ std::printf("%.17g", x); }}
        static void print(int x) {{ std::printf("%d", x); }}
        static void print(bool x) {{ std::printf(x ? "True" : "False"); }}
        static void print(const char *x) {{ std::printf("\\"%s\\"", x); }}
        template <typename T> static void print(const T (&x)[3])
        {{ std::printf("["); for (const T &one : x) {{ print(one); std::printf(", "); }} std::printf("]"); }}
        int main() {{ {" ".join(lines)} }}
    """
    (folder / "scene.hpp").write_text(header, encoding="utf-8")
    (folder / "main.cpp").write_text(program, encoding="utf-8")
    compiler = ["c++", "-std=c++17", "-Wall", "-Werror", "-Wno-unused-function"]
    subprocess.run([*compiler, "main.cpp", "-o", "main"], cwd=folder, check=True)
    said = subprocess.run(["./main"], cwd=folder, check=True, capture_output=True, text=True).stdout
    return dict(ast.literal_eval(f"{{{said}}}"))


def read_rust(module: str) -> dict[str, Any]:
    """Its constants."""
    found = {}
    for name, value in re.findall(r"^pub (?:const|static) (\w+): [^=]+ = (.*?);$", module, re.M | re.S):
        plain = re.sub(r"\b[A-Z]\w+ \{", "{", value.lstrip("&"))
        plain = re.sub(r"(\w+): ", r'"\1": ', plain).replace("true", "True").replace("false", "False")
        found[name.lower()] = ast.literal_eval(plain)
    return found


@pytest.mark.parametrize("path", SPOKEN, ids=lambda path: path.stem)
def test_cpp_and_rust_say_what_the_json_says(path: Path, tmp_path: Path) -> None:
    data = export.export(variants.Variant(path))
    check_tables(data, printed_by_cpp(code.source(data, code.CPP), tmp_path))
    check_tables(data, read_rust(code.source(data, code.RUST)))


def said_of(row: dict[str, Any]) -> list[tuple[str, list[float]]]:
    """Names and numbers of what the JSON says of a row, but what is not so."""
    told = []
    for name, value in row.items():
        if name not in ("type", "parts") and value is not False and (name != "radiance" or any(value)):
            numbers = [] if value is True else np.ravel(value).tolist()
            told.append((name.replace("_", " "), numbers))
    return told + [one for part in row.get("parts", ()) for one in said_of(part)]


@pytest.mark.parametrize("path", SPOKEN, ids=lambda path: path.stem)
def test_the_text_says_what_the_json_says(path: Path) -> None:
    data = export.export(variants.Variant(path))
    lines = code.text(data).splitlines()
    rows = [(f"material {i}: {m['type']}", m) for i, m in enumerate(data["materials"])]
    rows += [(one["type"], one) for one in (*data["primitives"], *data["lights"])]
    for line, (head, row) in zip(lines[-len(rows) :], rows, strict=True):
        assert line.startswith(f"{head}: ")
        words = line.partition(f"{head}: ")[2]
        spoken = re.findall(r"([a-z][a-z\d ]*?) (true\b|checkerboard\b|[-+\d.e; ]+)", words)
        expected = said_of(row)
        assert [name for name, _ in spoken] == [name for name, _ in expected], line
        for (_, words), (_, numbers) in zip(spoken, expected, strict=True):
            if numbers == ["checkerboard"]:
                assert words == "checkerboard"
                continue
            found = [float(word) for word in re.findall(r"[-+\d.e]+", words.replace("true", ""))]
            assert found == pytest.approx(numbers, rel=1e-8, abs=1e-300)
    camera = data["camera"]
    told = "\n".join(lines[: -len(rows)])
    for name in ("origin", "top_left", "top_right", "bottom_left", "bottom_right"):
        [words] = re.findall(rf"  {name.replace('_', ' ')} +(.*)", told)
        assert [float(word) for word in words.split()] == pytest.approx(camera[name], rel=1e-8, abs=1e-300)
    assert f"image: {camera['width']} × {camera['height']}" in told
    assert f"depth: {data['max_depth']} " in told and f"at {data['roulette_depth']}" in told
    assert f"{camera['near_clip']:.9g} to {camera['far_clip']:.9g} deep" in told
    assert ("does not see" in told) is data["hide_emitters"]


@pytest.mark.parametrize("form", ["cpp", "rust", "text"])
@pytest.mark.parametrize("name, what", [("sky-of-a-picture", "sky map"), ("picture-on-a-pane", "bitmap")])
def test_what_constants_and_words_do_not_say_is_refused(
    form: str, name: str, what: str, tmp_path: Path
) -> None:
    """Pictures, which the JSON has; nothing is left out without a word."""
    (tmp_path / "s.xml").write_text(RENDERED[name], encoding="utf-8")
    export.export(variants.Variant(tmp_path / "s.xml"))
    command = [sys.executable, "-m", "raycheck", "scene", str(tmp_path / "s.xml"), "--as", form]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"raycheck: scene s: its {what} can only be written --as json\n"


def test_so_is_what_nobody_thought_of() -> None:
    data = export.export(variants.variant("point-light"))
    code.text(data)
    for more in ({**data, "fog": 1}, {**data, "camera": {**data["camera"], "shutter": 1}}):
        for write in (code.text, lambda d: code.source(d, code.CPP)):
            with pytest.raises(ReferenceError_, match="can only be written --as json"):
                write(more)
