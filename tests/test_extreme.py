"""Input that is extreme but legal is rendered right, or refused with a reason."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest
from batches import diffuse, floor, glow, sky, square, world
from building import ROOT

from raycheck.base.images import Image, load_image

FLOOR = floor(diffuse(0.5))


def run(oneray: Path, folder: Path, text: str, *options: object) -> subprocess.CompletedProcess[str]:
    scene = folder / "scene.xml"
    scene.write_text(text, encoding="utf-8")
    command = [oneray, scene, "-o", folder / "out.exr", "--quiet", *map(str, options)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


def rendered(oneray: Path, folder: Path, text: str, *options: object) -> Image:
    done = run(oneray, folder, text, *options)
    assert done.returncode == 0, done.stderr
    return load_image(folder / "out.exr")


def refused(oneray: Path, folder: Path, text: str, *options: object) -> str:
    """The one line of a refusal, which leaves no picture."""
    done = run(oneray, folder, text, *options)
    assert done.returncode == 2
    assert not (folder / "out.exr").exists()
    assert done.stderr.count("\n") == 1
    return done.stderr


def point(intensity: float, z: float = 1) -> str:
    return (
        f'<emitter type="point"><point name="position" x="0" y="0" z="{z}"/>'
        f'<rgb name="intensity" value="{intensity}"/></emitter>'
    )


def ball(z: float, radius: float, more: str) -> str:
    return (
        f'<shape type="sphere"><point name="center" x="0" y="0" z="{z}"/>'
        f'<float name="radius" value="{radius}"/>{more}</shape>'
    )


# ---- Lights that give nothing.


def test_a_light_of_no_power_is_left_out_and_said_once(oneray: Path, tmp_path: Path) -> None:
    """It takes no samples from the others: the picture is the same to the last bit."""
    lamp = square(0, 1, 0.5, glow(3))
    alone = rendered(oneray, tmp_path, world(FLOOR + lamp), "--spp", 16)
    for more in (point(0), square(3, 1, 0.5, glow(0)), ball(5, 1, glow(0)), sky(0)):
        done = run(oneray, tmp_path, world(FLOOR + lamp + more), "--spp", 16)
        assert done.returncode == 0
        assert done.stderr.count("this light has no power and is left out") == 1
        found = load_image(tmp_path / "out.exr")
        assert (found.pixels == alone.pixels).all()


def test_a_light_of_no_size_is_left_out_and_said_once(oneray: Path, tmp_path: Path) -> None:
    lamp = square(0, 1, 0.5, glow(3))
    alone = rendered(oneray, tmp_path, world(FLOOR + lamp), "--spp", 16)
    done = run(oneray, tmp_path, world(FLOOR + lamp + ball(2, 0, glow(3))), "--spp", 16)
    assert done.stderr.count("this sphere has no size and is left out") == 1
    assert (load_image(tmp_path / "out.exr").pixels == alone.pixels).all()


def test_only_lights_of_no_power_are_darkness(oneray: Path, tmp_path: Path) -> None:
    for estimator in ("walk", "nee", "mis", "light"):
        image = rendered(
            oneray, tmp_path, world(FLOOR + square(0, 1, 0.5, glow(0))), "--estimator", estimator
        )
        assert (image.pixels == 0).all()


# ---- Numbers at their ends.


@pytest.mark.parametrize("radiance", [1e-36, 1e-20, 1e20, 1e36])
def test_radiance_from_1e_minus_36_to_1e36(oneray: Path, tmp_path: Path, radiance: float) -> None:
    """A lamp seen itself, and as the floor shows it: in proportion, whatever it is."""
    scene = world(FLOOR + square(0, 1, 0.5, glow("{}")), eye="0.8, 0, 0.5")
    one = rendered(oneray, tmp_path, scene.format(1), "--precision", "double", "--spp", 64)
    found = rendered(oneray, tmp_path, scene.format(radiance), "--spp", 64)
    np.testing.assert_allclose(found.pixels / radiance, one.pixels, rtol=1e-6)


@pytest.mark.parametrize(("width", "height"), [(1, 1), (1, 10_000), (10_000, 1)])
def test_images_as_slim_as_they_come(oneray: Path, tmp_path: Path, width: int, height: int) -> None:
    text = world(FLOOR + sky(2)).replace('name="width" value="8"', f'name="width" value="{width}"')
    text = text.replace('name="height" value="8"', f'name="height" value="{height}"').replace(
        "0.01", "0.0001"
    )
    image = rendered(oneray, tmp_path, text, "--spp", 16)
    assert image.pixels.shape == (height, width, 3)
    assert image.pixels.mean() == pytest.approx(1, rel=0.05 if width == height else 0.01)


@pytest.mark.parametrize("fov", [1e-3, 179.9])
def test_fields_of_view_at_their_ends(oneray: Path, tmp_path: Path, fov: float) -> None:
    """A uniform sky all around."""
    image = rendered(oneray, tmp_path, world(sky(2), fov=fov, depth=1), "--spp", 4)
    assert (image.pixels == 2).all()


def test_ten_thousand_vertices(oneray: Path, tmp_path: Path) -> None:
    """A closed furnace of albedo 1 - 1e-4 that paths are followed in without roulette: L (1 - ρᵏ)/(1 - ρ)."""
    wall = '<boolean name="flip_normals" value="true"/>' + diffuse(0.9999) + glow(1e-4)
    text = world(f'<shape type="sphere">{wall}</shape>', eye="0.1, 0, 0", depth=10_000)
    image = rendered(oneray, tmp_path, text, "--spp", 1, "--roulette", "none", "--estimator", "walk")
    np.testing.assert_allclose(image.pixels, 1 - 0.9999**10_000, rtol=1e-6)


def test_ten_thousand_lights(oneray: Path, tmp_path: Path) -> None:
    """As one of ten thousand times the power."""
    lights = "".join(point(1e-4) for _ in range(10_000))
    many = rendered(oneray, tmp_path, world(FLOOR + lights), "--spp", 4)
    one = rendered(oneray, tmp_path, world(FLOOR + point(1)), "--spp", 4)
    assert many.pixels.mean() == pytest.approx(one.pixels.mean(), rel=1e-4)


def test_lengths_and_numbers_that_no_double_can_square_are_refused(oneray: Path, tmp_path: Path) -> None:
    far = refused(oneray, tmp_path, world(FLOOR + ball(1e160, 1, glow(1))))
    assert "scene.xml:19: this reaches out to 1e+160: 1e+150 is the longest length" in far
    assert "is the largest number" in refused(oneray, tmp_path, world(FLOOR + point("1e301")))


def test_single_precision_refuses_what_it_cannot_hold(oneray: Path, tmp_path: Path) -> None:
    bright = refused(oneray, tmp_path, world(FLOOR + point(1e200)), "--precision", "single")
    assert "--precision single: a light of 1e+200, beyond 1e+36 (auto takes double)" in bright
    far = refused(oneray, tmp_path, world(FLOOR + ball(1e16, 1, glow(1))), "--precision", "single")
    assert "--precision single: the scene reaches out to 1e+16" in far


def test_a_picture_beyond_its_floats_is_refused(oneray: Path, tmp_path: Path) -> None:
    line = refused(oneray, tmp_path, world(FLOOR + point(1e45)))
    assert "pixel (0, 0): the radiance is beyond 3.40282e+38, the largest float of a picture" in line


def test_an_overflow_is_located(oneray: Path, tmp_path: Path) -> None:
    """Scene, pixel, sample and vertex: a light too close to the floor, as the second vertex of every path;
    and, by way of a mirror, as the third.
    """
    line = refused(oneray, tmp_path, world(FLOOR + point(1e300, 1e-10), fov=1e-9), "--spp", 4)
    assert "scene.xml: pixel (0, 0), sample 0, vertex 2: radiance overflows double precision" in line
    mirror = floor('<bsdf type="conductor"><string name="material" value="none"/></bsdf>')
    text = world(
        mirror + square(0, 2, 1, "").replace(diffuse(0), diffuse(0.5)) + point(1e300, 2 - 1e-10),
        fov=1e-9,
        depth=9,
    )
    line = refused(oneray, tmp_path, text, "--spp", 4)
    assert "scene.xml: pixel (0, 0), sample 0, vertex 3: radiance overflows double precision" in line


# ---- Trees and meshes: every length times a power of two changes no bit.


@pytest.mark.parametrize("mesh", [False, True], ids=["many shapes", "mesh"])
@pytest.mark.parametrize("power", [-330, -100, -40, 40, 150, 330])
def test_another_size_is_the_same_picture(oneray: Path, tmp_path: Path, mesh: bool, power: int) -> None:
    text = sized(1.0, mesh)
    one = rendered(oneray, tmp_path, text, "--spp", 4, "--precision", "double")
    other = rendered(oneray, tmp_path, sized(2.0**power, mesh), "--spp", 4, "--precision", "double")
    assert one.pixels.mean() > 0.1
    assert (one.pixels == other.pixels).all()


def sized(k: float, mesh: bool) -> str:
    """A floor, a lamp, and forty balls or one of triangles, k times as large."""

    def placed(kind: str, steps: str, more: str) -> str:
        steps = f'<transform name="to_world">{steps}<scale value="{k!r}"/></transform>'
        return f'<shape type="{kind}">{steps}{more}</shape>'

    file = f'<string name="filename" value="{ROOT / "scenes/meshes/coarse-ball.ply"}"/>'
    small = '<scale value="0.05"/><translate x="{}" y="0.3" z="0.06"/>'
    things = [placed("sphere", small.format(i / 10 - 2), diffuse(0.5)) for i in range(0 if mesh else 40)]
    if mesh:
        things = [placed("ply", '<scale value="0.2"/><translate y="0.1" z="0.3"/>', file + diffuse(0.5))]
    ground = placed("rectangle", '<scale x="100" y="100" z="1"/>', diffuse(0.5))
    lamp = placed(
        "rectangle", '<scale x="0.5" y="0.5" z="1"/><rotate x="1" angle="180"/><translate z="1"/>', glow(3)
    )
    eye = f"0, {-2 * k!r}, {0.9 * k!r}"
    text = world("".join([*things, ground, lamp]), eye=eye, fov=60, size=16, depth=4)
    clip = f'<float name="near_clip" value="{1e-3 * k!r}"/><float name="far_clip" value="{1e3 * k!r}"/>'
    return text.replace('<float name="fov"', clip + '<float name="fov"')


MATERIALS = {
    "rough metal": '<bsdf type="roughconductor"><string name="material" value="Cu"/>{}</bsdf>',
    "rough plastic": '<bsdf type="roughplastic">{}</bsdf>',
    "rough glass": '<bsdf type="roughdielectric">{}</bsdf>',
    "metal": '<bsdf type="conductor"><string name="material" value="Cu"/></bsdf>',
    "plastic": '<bsdf type="plastic"/>',
    "principled": '<bsdf type="principled"><float name="clearcoat" value="1"/>'
    '<float name="metallic" value="0.4"/></bsdf>',
}


@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize("distribution", ["beckmann", "ggx"])
@pytest.mark.parametrize("material", MATERIALS)
def test_looking_along_the_normal(
    oneray: Path, tmp_path: Path, material: str, distribution: str, precision: str
) -> None:
    """From the middle of a ball each cosine is 1, or by rounding more."""
    facets = f'<string name="distribution" value="{distribution}"/><float name="alpha" value="0.3"/>'
    middle = '<point name="center" x="0.3" y="0.2" z="-0.1"/>'
    bsdf = MATERIALS[material].format(facets)
    text = f"""<scene version="3.0.0">
    <integrator type="path"><integer name="max_depth" value="3"/></integrator>
    <sensor type="perspective"><float name="fov" value="70"/><transform name="to_world">
    <lookat origin="0.3, 0.2, -0.1" target="1.3, 0.5, 0.2" up="0, 0, 1"/></transform>
    <film type="hdrfilm"><integer name="width" value="32"/><integer name="height" value="32"/>
    <rfilter type="box"/></film></sensor>
    <shape type="sphere">{middle}<float name="radius" value="1"/><boolean name="flip_normals" value="true"/>
    {bsdf}</shape>
    <shape type="sphere"><point name="center" x="0.1" y="-0.2" z="0.3"/><float name="radius" value="0.1"/>
    <emitter type="area"><rgb name="radiance" value="5"/></emitter></shape></scene>"""
    image = rendered(oneray, tmp_path, text, "--spp", 16, "--precision", precision)
    assert np.isfinite(image.pixels).all()
