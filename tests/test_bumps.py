"""Bumps and normal maps: what a surface under them makes of light is Mitsuba's, on all shapes and sides."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from sampling import Array, Driver, directions, uniforms

mi = pytest.importorskip("mitsuba")


@pytest.fixture(autouse=True)
def scalar() -> None:
    """Other files of tests have other variants."""
    mi.set_variant("scalar_rgb")


RED = '<bsdf type="diffuse"><rgb name="reflectance" value="0.8, 0.2, 0.1"/></bsdf>'
GGX = '<bsdf type="roughconductor"><string name="distribution" value="ggx"/>{}</bsdf>'
ROUGH = GGX.format('<float name="alpha" value="0.4"/>')
BRUSHED = GGX.format('<float name="alpha_u" value="0.2"/><float name="alpha_v" value="0.7"/>')
GLASS = (
    '<bsdf type="roughdielectric"><string name="distribution" value="ggx"/><float name="alpha" value="0.4"/>'
    '<float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/></bsdf>'
)
TURN = '<rotate z="1" angle="30"/><scale x="2" y="0.7"/><translate x="0.3"/>'


def picture(folder: Path) -> Path:
    """9 × 7 pixels of any colour: heights, or normals that lean by up to 45° or so."""
    values = np.random.default_rng(4).uniform(0.2, 0.8, (7, 9, 3))
    values[..., 2] = np.random.default_rng(5).uniform(0.75, 1, (7, 9))
    path = folder / "any.exr"
    mi.Bitmap(values.astype(np.float32)).write(str(path))
    return path


def bump(kind: str, path: Path, inner: str, more: str = "", of_texture: str = "") -> str:
    texture = (
        f'<texture type="bitmap" name="normalmap"><string name="filename" value="{path}"/>'
        f'<boolean name="raw" value="true"/>{of_texture}</texture>'
    )
    return f'<bsdf type="{kind}">{texture}{inner}{more}</bsdf>'


def twosided(inner: str) -> str:
    return f'<bsdf type="twosided">{inner}</bsdf>'


SHAPES = {
    "plate": '<shape type="rectangle"><transform name="to_world"><scale x="2" y="1.3"/>'
    '<rotate x="1" y="0" z="0" angle="35"/></transform>{}</shape>',
    "ball": '<shape type="sphere">{}</shape>',
    "tube": '<shape type="cylinder"><transform name="to_world"><translate z="-0.5"/></transform>{}</shape>',
    "turned plate": '<shape type="rectangle"><boolean name="flip_normals" value="true"/>{}</shape>',
}
STRONG = '<float name="scale" value="0.3"/>'
WRAPPED = {
    "as it is": "",
    "moved": f'<transform name="to_uv">{TURN}</transform>',
    "clamped": f'<string name="wrap_mode" value="clamp"/><transform name="to_uv">{TURN}</transform>',
    "nearest": '<string name="filter_type" value="nearest"/>',
}


def rays(n: int, seed: int) -> tuple[Array, Array]:
    """From all around to near the middle."""
    o = directions(n, seed) * 3
    d = uniforms(n, seed + 1, 3, low=-0.8, high=0.8) - o
    return o, d / np.linalg.norm(d, axis=0)


def compare(driver: Driver, body: str, n: int = 250) -> None:
    o, d = rays(n, 3)
    wi = directions(n, 5)
    scene = mi.load_string(f'<scene version="3.0.0">{body}</scene>')
    with driver.scene(body) as mine:
        found = driver("evaluate", o, d, wi, scene=mine)
        normal = driver("scatter", o, d, uniforms(n, 6, 4), scene=mine)[9:12]
    met, errors, dark = 0, [], 0
    for k in range(n):
        si = scene.ray_intersect(mi.Ray3f(mi.Point3f(*o[:, k]), mi.Vector3f(*d[:, k])))
        if not si.is_valid():
            continue
        met += 1
        there = si.to_local(mi.Vector3f(*wi[:, k]))
        context, bsdf = mi.BSDFContext(), si.bsdf()
        theirs = np.array([*bsdf.eval(context, si, there), bsdf.pdf(context, si, there)])
        if "roughdielectric" not in body and normal[:, k] @ wi[:, k] <= 0:
            assert (theirs[:3] == 0).all()  # that is not asked of it
            continue
        ours = np.array([*(found[:3, k] * abs(there.z)), found[3, k]])
        dark += not theirs[:3].any()
        if not theirs[:3].any():
            assert (ours[:3] == 0).all()
            continue
        errors.append(np.abs(ours / theirs - 1).max())
    assert met > 0.3 * n and len(errors) > 0.1 * n, (met, len(errors), dark)
    assert np.quantile(errors, 0.5) < 1e-5 and np.quantile(errors, 0.96) < 1e-3, np.quantile(
        errors, [0.5, 0.96, 1]
    )


@pytest.mark.parametrize("kind", ["bumpmap", "normalmap"])
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("inner", [RED, GLASS, twosided(ROUGH)], ids=["diffuse", "glass", "twosided"])
def test_eval_and_pdf_are_mitsubas(driver: Driver, tmp_path: Path, kind: str, shape: str, inner: str) -> None:
    more = STRONG if kind == "bumpmap" else ""
    compare(driver, SHAPES[shape].format(bump(kind, picture(tmp_path), inner, more)))


@pytest.mark.parametrize("kind", ["bumpmap", "normalmap"])
@pytest.mark.parametrize("wrap", WRAPPED)
def test_wherever_the_picture_lies(driver: Driver, tmp_path: Path, kind: str, wrap: str) -> None:
    more = STRONG if kind == "bumpmap" else ""
    body = bump(kind, picture(tmp_path), RED, more, WRAPPED[wrap])
    compare(driver, SHAPES["plate"].format(twosided(body)))


@pytest.mark.parametrize("kind", ["bumpmap", "normalmap"])
def test_without_shadows_and_around_blends(driver: Driver, tmp_path: Path, kind: str) -> None:
    plain = '<boolean name="use_shadowing_function" value="false"/>'
    blend = f'<bsdf type="blendbsdf"><float name="weight" value="0.3"/>{RED}{ROUGH}</bsdf>'
    body = bump(kind, picture(tmp_path), blend, plain + (STRONG if kind == "bumpmap" else ""))
    for shape in ("ball", "plate"):
        compare(driver, SHAPES[shape].format(twosided(body)))
        compare(driver, SHAPES[shape].format(body))


def test_grooves_turn_with_a_normal_map(driver: Driver, tmp_path: Path) -> None:
    for shape in SHAPES.values():
        compare(driver, shape.format(twosided(bump("normalmap", picture(tmp_path), BRUSHED))))


@pytest.mark.parametrize("kind", ["bumpmap", "normalmap"])
@pytest.mark.parametrize("inner", [RED, GLASS, ROUGH], ids=["diffuse", "glass", "rough"])
def test_the_factor_is_f_times_cosine_over_the_density(
    driver: Driver, wide: list[Driver], tmp_path: Path, kind: str, inner: str
) -> None:
    """The path goes on by what the material does, less η², which is apart."""
    n = 3000
    o, d = rays(n, 7)
    u = uniforms(n, 8, 4)
    more = STRONG if kind == "bumpmap" else ""
    body = SHAPES["ball"].format(bump(kind, picture(tmp_path), inner, more))
    with driver.scene(body) as scene:
        s = driver("scatter", o, d, u, scene=scene)
    kept = (s[6] > 0) & (s[20] > 0) & (s[3:6].max(axis=0) > 0)
    assert kept.mean() > 0.2
    cosine = np.abs((s[9:12] * s[:3]).sum(axis=0))
    np.testing.assert_allclose(s[15, kept], s[6, kept], rtol=1e-9)
    np.testing.assert_allclose((s[12:15] * cosine / s[6] / s[8])[:, kept], s[3:6, kept], rtol=1e-8)
    with wide[0].scene(body) as scene:
        np.testing.assert_array_equal(wide[0]("scatter", o, d, u, scene=scene)[3:6], s[3:6])


def test_a_flat_picture_changes_nothing(driver: Driver, tmp_path: Path) -> None:
    flat = tmp_path / "flat.exr"
    mi.Bitmap(np.full((4, 4, 3), [0.5, 0.5, 1], np.float32)).write(str(flat))
    o, d = rays(500, 9)
    wi = directions(500, 10)
    for kind in ("bumpmap", "normalmap"):
        found = []
        for bsdf in (bump(kind, flat, ROUGH), ROUGH):
            with driver.scene(SHAPES["ball"].format(bsdf)) as scene:
                out = driver("evaluate", o, d, wi, scene=scene)
                n = driver("scatter", o, d, uniforms(500, 6, 4), scene=scene)[9:12]
            found.append(np.where((n * wi).sum(axis=0) > 0, out[:4], 0))
        np.testing.assert_allclose(found[0], found[1], rtol=1e-9, atol=1e-12)
