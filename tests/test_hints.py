"""Nothing ends black, or short of its goal, without a word: one warning, what is amiss and what to do."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from batches import diffuse, floor, glow, sky, square, world
from building import ROOT
from test_meshes import ball, write_ply

from raycheck.base.images import load_image

FLOOR = floor(diffuse(0.5))
LAMP = square(0, 1, 0.5, glow(3))
TURNED = LAMP.replace("<emitter", '<boolean name="flip_normals" value="true"/><emitter')
AWAY = '<lookat origin="0, 0, 1" target="0, 0, 2" up="0, 1, 0"/>'


def run(oneray: Path, folder: Path, text: str, *options: object) -> subprocess.CompletedProcess[str]:
    scene = folder / "scene.xml"
    scene.write_text(text, encoding="utf-8")
    command = [oneray, scene, "-o", folder / "out.exr", "--quiet", *map(str, options)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)


def ply(more: str, name: str = "mesh.ply") -> str:
    return f'<shape type="ply"><string name="filename" value="{name}"/>{more}</shape>'


def turned_over(more: str) -> str:
    return ply('<boolean name="flip_normals" value="true"/>' + more)


BLACK = {
    "no light": (FLOOR, {}, "the scene has no light, the picture is black: an <emitter> is wanted"),
    "a mesh from behind": (
        turned_over(diffuse(0.5)) + LAMP,
        {"eye": "4, 0, 0", "fov": 20},
        "from the camera this shape shows its back alone, which is black: put its bsdf into <bsdf "
        'type="twosided">, or set flip_normals',
    ),
    "a floor from behind": (
        FLOOR + '<emitter type="point"><point name="position" x="0" y="0" z="-1"/></emitter>',
        {"eye": "0, 0, -2"},
        "what is seen, or lit, shows its back, which is black: put its bsdf",
    ),
    "a lamp that is turned over": (
        FLOOR + TURNED,
        {},
        "the lamps shine to their other side: set their flip_normals",
    ),
    "direct light of a lamp behind glass": (
        FLOOR
        + LAMP
        + square(0, 0.5, 40, "").replace(
            diffuse(0),
            '<bsdf type="dielectric"><float name="int_ior" value="1.5"/>'
            '<float name="ext_ior" value="1.5"/></bsdf>',
        ),
        {"depth": 2, "eye": "0, 0, 0.4"},
        "no path is long enough for light: give it a larger max_depth",
    ),
    "a lid on the lamp": (
        FLOOR + LAMP + square(0, 0.9, 40),
        {"eye": "0, 0, 0.5"},
        "no light comes to what is seen: is something in its way? If not, take more samples",
    ),
}


@pytest.mark.parametrize("name", BLACK)
def test_a_black_picture_says_why(oneray: Path, tmp_path: Path, name: str) -> None:
    write_ply(tmp_path / "mesh.ply", *ball(6))
    body, settings, why = BLACK[name]
    done = run(oneray, tmp_path, world(body, **settings), "--spp", 16)
    assert load_image(tmp_path / "out.exr").pixels.max() == 0
    assert done.stderr.count("\n") == 1, done.stderr
    assert done.stderr.startswith(f"oneray: warning: {tmp_path}/scene.xml:")
    assert why in done.stderr


def test_nothing_in_view(oneray: Path, tmp_path: Path) -> None:
    text = world(FLOOR + LAMP, fov=20)
    text = text.replace('<lookat origin="0, 0, 1" target="0, 0, 0" up="0, 1, 0"/>', AWAY)
    assert AWAY in text
    done = run(oneray, tmp_path, text.replace('z="1"/></transform>', 'z="0.5"/></transform>'), "--spp", 16)
    assert done.stderr.count("\n") == 1
    assert "nothing is in view: see the sensor's to_world, near_clip and far_clip" in done.stderr


def test_hidden_lights_alone(oneray: Path, tmp_path: Path) -> None:
    text = world(LAMP, eye="0, 0, -1", fov=20, depth=1)
    hidden = text.replace("</integrator>", '<boolean name="hide_emitters" value="true"/></integrator>')
    done = run(oneray, tmp_path, hidden, "--spp", 16)
    assert "the lights alone would be seen, and hide_emitters hides them" in done.stderr
    assert run(oneray, tmp_path, text, "--spp", 16).stderr == ""


def test_too_few_samples(oneray: Path, tmp_path: Path) -> None:
    """The random walk hits a small lamp once in forty times."""
    text = world(FLOOR + square(0, 1, 0.15, glow(3)), size=2)
    done = run(oneray, tmp_path, text, "--spp", 1, "--estimator", "walk")
    why = "light comes to it too rarely: take more samples, or another --estimator"
    assert f"the picture is black after 1 samples per pixel: {why}" in done.stderr


@pytest.mark.parametrize("shape", ["mesh", "cube", "sphere"])
def test_a_body_from_behind_in_a_picture_that_is_not_black(oneray: Path, tmp_path: Path, shape: str) -> None:
    """Where its front shows, or it is two-sided, or shines, there is nothing to say."""
    write_ply(tmp_path / "mesh.ply", *ball(6))

    def said(more: str, **settings: object) -> int:
        body = turned_over(more) if shape == "mesh" else ply("").replace("ply", shape)
        if shape != "mesh":
            body = f'<shape type="{shape}"><boolean name="flip_normals" value="true"/>{more}</shape>'
        done = run(oneray, tmp_path, world(body + sky(), **settings), "--spp", 1)
        return done.stderr.count("shows its back alone")

    outside = {"eye": "0, 0, 5", "fov": 60}
    assert said(diffuse(0.5), **outside) == 1
    assert said(f'<bsdf type="twosided">{diffuse(0.5)}</bsdf>', **outside) == 0
    assert said(diffuse(0.5) + glow(1), **outside) == 0
    assert said(diffuse(0.5), eye="0, 0, 0.1", fov=60) == 0


def test_a_body_out_of_view_is_none_of_it(oneray: Path, tmp_path: Path) -> None:
    for x, count in ((0, 1), (30, 0)):
        body = (
            f'<shape type="cube"><transform name="to_world"><translate x="{x}"/></transform>'
            f'<boolean name="flip_normals" value="true"/>{diffuse(0.5)}</shape>'
        )
        done = run(oneray, tmp_path, world(body + sky(), eye="0, 0, 5", fov=20), "--spp", 1)
        assert done.stderr.count("shows its back alone") == count


def test_screens_may_show_their_backs(oneray: Path, tmp_path: Path) -> None:
    assert (
        run(
            oneray,
            tmp_path,
            world(square(0, 0, 1).replace(diffuse(0), diffuse(0.5)) + sky(), fov=120),
            "--spp",
            1,
        ).stderr
        == ""
    )


def test_normals_that_cancel(oneray: Path, tmp_path: Path) -> None:
    """Both windings on shared vertices; the picture is that of the faces' own normals."""
    (tmp_path / "both.obj").write_bytes((ROOT / "tests/meshes/both-windings.obj").read_bytes())
    mesh = f'<shape type="obj"><string name="filename" value="both.obj"/>{{}}{diffuse(0.5)}</shape>'
    scene = world(mesh + sky(), eye="0, 4, 4", fov=30)
    done = run(oneray, tmp_path, scene.format(""), "--spp", 16)
    assert done.stderr == (
        f"oneray: warning: {tmp_path}/both.obj: at 4 of 4 vertices the faces look both ways, so that their "
        "normals cancel: set face_normals, or give each side vertices of its own\n"
    )
    computed = load_image(tmp_path / "out.exr").pixels
    flat = run(oneray, tmp_path, scene.format('<boolean name="face_normals" value="true"/>'), "--spp", 16)
    assert flat.stderr == ""
    np.testing.assert_array_equal(computed, load_image(tmp_path / "out.exr").pixels)


def test_a_mesh_without_area_is_left_out(oneray: Path, tmp_path: Path) -> None:
    """And its light: the picture is the same to the last bit."""
    points, _ = ball(6)
    write_ply(tmp_path / "mesh.ply", points, np.array([[0, 1, 1], [2, 2, 2]]))
    run(oneray, tmp_path, world(FLOOR + LAMP), "--spp", 16)
    alone = load_image(tmp_path / "out.exr").pixels
    for more in (ply(diffuse(0.5)), ply(glow(5))):
        done = run(oneray, tmp_path, world(FLOOR + more + LAMP), "--spp", 16)
        assert done.stderr.count("\n") == 1
        assert done.stderr.endswith("none of this mesh's triangles has an area: it is left out\n")
        assert f"{tmp_path}/scene.xml:" in done.stderr
        np.testing.assert_array_equal(load_image(tmp_path / "out.exr").pixels, alone)


BUDGETS = {
    "time": (("--time", 0.3), "--time ended with "),
    "samples": (("--spp", 20), "--spp ended with 20 samples per pixel and an error of "),
    "one sample": (
        ("--spp", 1),
        "--spp ended with one sample per pixel, whose error is not known: --error 1e-06",
    ),
}


@pytest.mark.parametrize("name", BUDGETS)
def test_an_error_that_is_not_reached(oneray: Path, tmp_path: Path, name: str) -> None:
    options, said = BUDGETS[name]
    done = run(oneray, tmp_path, world(FLOOR + LAMP), "--error", 1e-6, *options)
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith(f"oneray: warning: {said}")
    assert ("--error 1e-06 takes about " in done.stderr) == (name != "one sample")


def test_the_samples_that_it_takes(oneray: Path, tmp_path: Path) -> None:
    """As many as were foretold, by the law of the square root."""
    done = run(oneray, tmp_path, world(FLOOR + LAMP, size=32), "--error", 0.01, "--spp", 64)
    foretold = float(done.stderr.rpartition(" ")[2])
    found = run(oneray, tmp_path, world(FLOOR + LAMP, size=32), "--error", 0.01, "--stats", "-")
    assert found.stderr == ""
    assert foretold == pytest.approx(json.loads(found.stdout)["spp"], rel=0.15)


def test_a_goal_that_is_reached_is_not_spoken_of(oneray: Path, tmp_path: Path) -> None:
    assert run(oneray, tmp_path, world(FLOOR + LAMP), "--error", 0.5, "--spp", 64).stderr == ""


def test_merged_films_of_a_black_picture(oneray: Path, tmp_path: Path) -> None:
    """Parts are silent, of which one may be black by chance."""
    scene = tmp_path / "scene.xml"
    scene.write_text(world(FLOOR + TURNED), encoding="utf-8")
    for first in (0, 8):
        words = ["--samples", f"{first}:8", "--film", tmp_path / f"{first}.film", "--quiet"]
        done = subprocess.run([oneray, scene, *words], check=True, capture_output=True, text=True)
        assert done.stderr == ""
    films = [tmp_path / "0.film", tmp_path / "8.film"]
    command = [oneray, "merge", *films, "-o", tmp_path / "out.exr"]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    assert done.stderr.count("the picture is black: rendering its scene in one run says why") == 1
