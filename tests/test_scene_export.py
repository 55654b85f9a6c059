"""raycheck scene: what it prints is the scene."""

import json
import subprocess
import sys
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from building import ROOT

from raycheck.scene import code, export, variants
from raycheck.scene.reader import read_scene

SCHEMA = jsonschema.Draft202012Validator(json.loads(export.SCHEMA.read_text(encoding="utf-8")))


@pytest.mark.parametrize("of", variants.ladder(), ids=lambda of: of.label)
def test_every_scene_fits_the_schema(of: variants.Variant) -> None:
    SCHEMA.validate(json.loads(export.to_json(export.export(of))))


def test_the_schema_is_that_of_the_table_of_materials(tmp_path: Path) -> None:
    subprocess.run([sys.executable, ROOT / "scripts/make_schema.py", tmp_path / "schema"], check=True)
    assert (tmp_path / "schema").read_text(encoding="utf-8") == export.SCHEMA.read_text(encoding="utf-8")


def test_coordinates_of_textures_are_those_of_the_picture() -> None:
    """The numbers of balls and parallelograms give the colours that Mitsuba sees along rays from the eye."""
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    data = export.export(variants.variant("textured-room"))
    scene = mi.load_file(str(ROOT / "scenes/textured-room.xml"))
    camera, seen = data["camera"], set()
    left, right, below = (np.array(camera[k]) for k in ("top_left", "top_right", "bottom_left"))
    for x, y in np.random.default_rng(1).random((400, 2)):
        way = left + (right - left) * x + (below - left) * y
        si = scene.ray_intersect(mi.Ray3f(camera["origin"], way / np.linalg.norm(way)))
        here = [one for one in data["primitives"] if si.is_valid() and on(one, np.array(si.p))]
        for one in here[:1]:
            material = data["materials"][one["material"]]
            place = (np.array(material["to_uv"]) @ [*coordinates(one, np.array(si.p)), 1])[:2]
            if (np.abs(place * 2 - np.round(place * 2)) > 1e-2).all():  # not at an edge
                u, v = place % 1 > 0.5
                found = np.array(si.bsdf().eval_diffuse_reflectance(si))
                np.testing.assert_allclose(found, material["color1" if u != v else "color0"], atol=1e-5)
                seen.add((one["material"], u != v))
    assert len(seen) == 10  # both colours of floor, wall, screen, cube and ball


def on(one: dict, p: np.ndarray) -> bool:
    """Does the point lie on the primitive?"""
    if one["type"] == "sphere":
        return abs(np.linalg.norm(p - one["center"]) - one["radius"]) < 1e-4
    if one["type"] != "parallelogram":
        return False
    s, t, off = parts(one, p)
    return abs(off) < 1e-4 and -1e-4 < s < 1 + 1e-4 and -1e-4 < t < 1 + 1e-4


def parts(one: dict, p: np.ndarray) -> np.ndarray:
    axes = np.stack([one["edge_u"], one["edge_v"], one["normal"]], axis=1)
    return np.linalg.solve(axes, p - one["corner"])


def coordinates(one: dict, p: np.ndarray) -> np.ndarray:
    """(u, v) by the primitive's numbers."""
    if one["type"] == "sphere":
        x, y, z = np.array(one["axes"]) @ (p - one["center"]) / one["radius"]
        return np.array([np.arctan2(y, x) / (2 * np.pi) % 1, np.arccos(np.clip(z, -1, 1)) / np.pi])
    s, t, _ = parts(one, p)
    corner, u, v = np.array(one["uv"])[:, :2]
    return corner + s * (u - corner) + t * (v - corner)


def test_rays_between_the_corners_are_the_camera_s() -> None:
    of = variants.variant("lecture")
    camera = read_scene(of.path).camera
    data = export.export(of)["camera"]
    corner, right, below = (np.array(data[k]) for k in ("top_left", "top_right", "bottom_left"))
    for x, y in ((0.0, 0.0), (13.0, 40.5), (camera.width, camera.height)):
        way = corner + (right - corner) * x / camera.width + (below - corner) * y / camera.height
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


def test_the_header_compiles_and_has_every_primitive(tmp_path) -> None:
    data = export.export(variants.variant("mixed-material"))
    (tmp_path / "scene.hpp").write_text(code.source(data, code.CPP), encoding="utf-8")
    program = """
        #include <cstdio>
        #include "scene.hpp"
        using namespace scene;
        int main()
        { std::printf("%zu %zu %d", materials.size(), parallelograms.size(), materials[0].second); }
    """
    (tmp_path / "main.cpp").write_text(program, encoding="utf-8")
    compiler = ["c++", "-std=c++17", "-Wall", "-Werror"]
    subprocess.run([*compiler, "main.cpp", "-o", "main"], cwd=tmp_path, check=True)
    said = subprocess.run(["./main"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    assert said == "6 5 3"
