"""Rough metals: microfacets are Mitsuba's, go on in the directions that their density says, the same either
way round, and reflect as much as the formula does by quadrature.

Numbers come from the functions of roughconductor.h themselves (sampling.c). Seeds are fixed; all statistical
checks of this file together would raise a false alarm for one choice of seeds in 10⁴ (sampling.py).
"""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest
from building import ROOT
from floors import Sampled, above, evaluated, mitsubas, polar
from sampling import LEVEL, Array, Driver, chi_squared, directions, uniforms

from raycheck.scene.materials import METALS, Material
from raycheck.truth.closed_forms.rough import directional_albedo, microfacets

ALPHAS = (0.02, 0.15, 0.5, 1.0, 3.0)
each_alpha = pytest.mark.parametrize("alpha", ALPHAS)
GOLD = json.loads(METALS.read_text(encoding="utf-8"))["Au"]


def rough(alpha: float, metal: str = "Au", tint: str = "1") -> str:
    return (
        '<bsdf type="roughconductor"><string name="distribution" value="ggx"/>'
        f'<float name="alpha" value="{alpha}"/>'
        f'<string name="material" value="{metal}"/><rgb name="specular_reflectance" value="{tint}"/></bsdf>'
    )


@each_alpha
@pytest.mark.parametrize("metal", ["Au", "none"])
def test_eval_and_pdf_are_mitsubas(driver: Driver, alpha: float, metal: str) -> None:
    """To the digits of its single precision."""
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    tint = {"type": "rgb", "value": [0.9, 0.5, 1.0]}
    theirs = mi.load_dict(
        {
            "type": "roughconductor", "distribution": "ggx", "alpha": alpha, "material": metal,
            "specular_reflectance": tint,
        }
    )  # fmt: skip
    wo, wi = above(400, 1), above(400, 2)
    wi[:, ::2] = Sampled(driver, rough(alpha), wo, uniforms(400, 3)).wi[:, ::2]  # some where it is bright
    up = (wi[2] > 1e-3) & (wo[2] > 1e-3)
    wo, wi = wo[:, up], wi[:, up]
    f, pdf, _ = evaluated(driver, rough(alpha, metal, "0.9 0.5 1"), wo, wi)
    found, density = [], []
    at, context = mi.SurfaceInteraction3f(), mi.BSDFContext()
    for o, i in zip(wo.T, wi.T, strict=True):
        at.wi = mi.Vector3f(*o)
        found.append(theirs.eval(context, at, mi.Vector3f(*i)))
        density.append(theirs.pdf(context, at, mi.Vector3f(*i)))
    tolerance = 2e-5 if alpha >= 0.1 else 2e-3
    np.testing.assert_allclose(f * wi[2], np.array(found).T, rtol=tolerance)
    np.testing.assert_allclose(pdf, density, rtol=tolerance)


ROUGH_UV = '<float name="alpha_u" value="{}"/><float name="alpha_v" value="{}"/>'
PAIRS = ((0.05, 0.4), (0.6, 0.15), (1.0, 2.5))
each_pair = pytest.mark.parametrize("pair", PAIRS, ids=str)


def anisotropic(pair: tuple[float, float], metal: str = "Au") -> str:
    return (
        '<bsdf type="roughconductor"><string name="distribution" value="ggx"/>'
        f'{ROUGH_UV.format(*pair)}<string name="material" value="{metal}"/></bsdf>'
    )


def gold(pair: tuple[float, float]) -> Material:
    return Material("roughconductor", np.ones(3), np.array(GOLD["eta"]), np.array(GOLD["k"]), alpha=pair)


@each_pair
def test_anisotropic_eval_pdf_and_sample_are_mitsubas(driver: Driver, pair: tuple[float, float]) -> None:
    """On a floor, whose frame is the world's; a sampled direction has the weight that Mitsuba gives it."""
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    theirs = mi.load_string(
        f'<scene version="3.0.0"><shape type="rectangle">{anisotropic(pair)}</shape></scene>'
    )
    theirs = theirs.shapes()[0].bsdf()
    wo, wi = above(400, 1), above(400, 2)
    sampled = Sampled(driver, anisotropic(pair), wo, uniforms(400, 3))
    wi[:, ::2] = sampled.wi[:, ::2]
    up = (wi[2] > 1e-3) & (wo[2] > 1e-3)
    wo, wi, factor = wo[:, up], wi[:, up], sampled.factor[:, up]
    f, pdf, _ = evaluated(driver, anisotropic(pair), wo, wi)
    found, density = [], []
    at, context = mi.SurfaceInteraction3f(), mi.BSDFContext()
    for o, i in zip(wo.T, wi.T, strict=True):
        at.wi = mi.Vector3f(*o)
        found.append(theirs.eval(context, at, mi.Vector3f(*i)))
        density.append(theirs.pdf(context, at, mi.Vector3f(*i)))
    np.testing.assert_allclose(f * wi[2], np.array(found).T, rtol=5e-5)
    np.testing.assert_allclose(pdf, density, rtol=5e-5)
    kept = np.flatnonzero(up) % 2 == 0
    assert kept.any()
    np.testing.assert_allclose(factor[:, kept], (np.array(found).T / np.array(density))[:, kept], rtol=2e-4)


BOARD = (
    '<texture type="checkerboard" name="{}"><rgb name="color0" value="0.9, 0.2, 0.4"/>'
    '<float name="color1" value="{}"/></texture>'
)


@pytest.mark.parametrize("kind", ["roughconductor", "roughdielectric"])
@pytest.mark.parametrize("names", [("alpha",), ("alpha_u",), ("alpha_u", "alpha_v")], ids="-".join)
@pytest.mark.parametrize("value", [0.3, 0.0])
def test_a_texture_may_stand_for_the_roughness_as_in_mitsuba(
    driver: Driver, kind: str, names: tuple[str, ...], value: float
) -> None:
    """A checkerboard's colours are the other way round than as a reflectance's; 0 is the floor."""
    boards = "".join(BOARD.format(name, value + i / 4) for i, name in enumerate(names))
    rest = '<float name="alpha_v" value="0.2"/>' if names == ("alpha_u",) else ""
    said = f'<bsdf type="{kind}"><string name="distribution" value="ggx"/>{boards}{rest}</bsdf>'
    wo, wi = above(200, 1), above(200, 2)
    wi[:, ::2] = Sampled(driver, said, wo, uniforms(200, 3, 4)).wi[:, ::2]
    f, pdf, _ = evaluated(driver, said, wo, wi)
    theirs = mitsubas(said, wo, wi)  # at u = v = 0
    tame = (np.abs(wi[2]) > 1e-2) & (wo[2] > 1e-2)
    assert pdf[tame].max() > 0.1
    for mine, other in ((f * np.abs(wi[2]), theirs[0]), (pdf, theirs[1])):
        wrong = (np.abs(mine - other) / (other + 1e-3))[..., tame]
        assert np.quantile(wrong, 0.9) < (1e-4 if value else 3e-3), np.quantile(wrong, [0.5, 0.9])


TURNED = '<rotate x="0.6" y="0.8" angle="40"/>'
PLACES = {
    "rectangle": TURNED,
    "sheared": '<matrix value="1 0.7 0 0  0.2 0.8 0 0  0.3 0.1 1 0  0 0 0 1"/>',
    "disk": '<scale x="2" y="1"/><rotate z="1" angle="20"/>',
    "cube": TURNED,
    "sphere": TURNED,
}


@pytest.mark.parametrize("flip", ["", '<boolean name="flip_normals" value="true"/>'])
@pytest.mark.parametrize("name", PLACES)
def test_roughness_lies_along_mitsubas_tangents(
    driver: Driver, wide: list[Driver], name: str, flip: str
) -> None:
    """f_r where rays meet the shape, for a direction around the normal there, on either side."""
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    kind = "rectangle" if name == "sheared" else name
    place = f'<transform name="to_world">{PLACES[name]}</transform>'
    bsdf = f'<bsdf type="twosided">{anisotropic((0.2, 0.9))}</bsdf>'
    body = f'<shape type="{kind}">{place}{flip}{bsdf}</shape>'
    scene = mi.load_string(f'<scene version="3.0.0">{body}</scene>')
    to, d = 0.9 * uniforms(300, 21, 3, low=-0.6, high=0.6), directions(300, 22)
    o, wi = (to - 6 * d).astype(np.float32).astype(float), directions(300, 23)
    theirs, way, met = np.zeros((3, 300)), np.zeros((3, 300)), np.zeros(300, dtype=bool)
    for k in range(300):
        si = scene.ray_intersect(mi.Ray3f(o[:, k], d[:, k]), mi.RayFlags.All, True)
        if si.is_valid() and abs(si.wi.z) > 0.05:
            local = si.to_local(mi.Vector3f(*wi[:, k]))
            local.z = np.copysign(local.z, si.wi.z)
            way[:, k] = si.to_world(local)
            theirs[:, k] = np.array(si.bsdf().eval(mi.BSDFContext(), si, local)) / abs(local.z)
            met[k] = True
    assert met.mean() > 0.3
    for one in (driver, *wide):
        with one.scene(body) as opened:
            f = one("evaluate", o, d, way, scene=opened)[:3]
        good = np.isclose(f, theirs, rtol=2e-2, atol=1e-4).all(axis=0)[met]
        assert good.mean() > 0.98


@each_pair
def test_anisotropic_eval_is_the_formula(driver: Driver, pair: tuple[float, float]) -> None:
    wo, wi = above(2000, 4), above(2000, 5)
    f, _, _ = evaluated(driver, anisotropic(pair), wo, wi)
    frame = [np.broadcast_to(axis, (2000, 3)) for axis in np.eye(3)]
    np.testing.assert_allclose((f * wi[2]).T, microfacets(gold(pair), wo.T, wi.T, *frame), rtol=1e-9)
    there = evaluated(driver, anisotropic(pair), wi, wo)[0]
    np.testing.assert_allclose(there, f, rtol=1e-12)


@pytest.mark.parametrize("hemisphere", ["cosine", "uniform"])
@each_pair
def test_an_anisotropic_factor_is_brdf_times_cosine_over_density(
    driver: Driver, wide: list[Driver], pair: tuple[float, float], hemisphere: str
) -> None:
    wo = above(5000, 8)
    s = Sampled(driver, anisotropic(pair), wo, uniforms(5000, 9), hemisphere=hemisphere)
    up = s.wi[2] > 0
    f, pdf, factor = evaluated(driver, anisotropic(pair), wo[:, up], s.wi[:, up], hemisphere=hemisphere)
    np.testing.assert_allclose(s.factor[:, up], f * s.wi[2, up] / pdf, rtol=1e-11)
    np.testing.assert_allclose(s.factor[:, up], factor, rtol=1e-11)
    np.testing.assert_allclose(s.pdf[up], pdf, rtol=1e-11)
    assert hemisphere == "uniform" or (s.factor <= 1).all()
    two = Sampled(wide[0], anisotropic(pair), wo, uniforms(5000, 9), hemisphere=hemisphere)
    np.testing.assert_array_equal(s.factor, two.factor)
    np.testing.assert_array_equal(s.wi, two.wi)


@pytest.mark.sample(5)
@pytest.mark.parametrize("wo", [(0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (0.0, 0.6, 0.8), (0.7, -0.5, 0.1)], ids=str)
@each_pair
def test_an_anisotropic_furnace_shows_the_directional_albedo(
    driver: Driver, pair: tuple[float, float], wo: tuple[float, float, float]
) -> None:
    u = (np.indices((1000, 1000)).reshape(2, -1) + 0.5) / 1000
    way = np.array(wo)[:, None] / np.linalg.norm(wo)
    found = Sampled(driver, anisotropic(pair), way, u).factor.mean(axis=1)
    np.testing.assert_allclose(found, directional_albedo(gold(pair), way[:, 0]), rtol=1e-3)


def test_one_roughness_both_ways_is_the_isotropic_one(driver: Driver) -> None:
    """To the bit alone; beside an anisotropic one, to rounding."""
    wo, wi, u = above(500, 4), above(500, 5), uniforms(500, 6)
    same, one = anisotropic((0.3, 0.3)), rough(0.3)
    np.testing.assert_array_equal(evaluated(driver, same, wo, wi)[0], evaluated(driver, one, wo, wi)[0])
    np.testing.assert_array_equal(Sampled(driver, same, wo, u).pdf, Sampled(driver, one, wo, u).pdf)
    beside = f'{anisotropic((0.1, 0.3))}<transform name="to_world"><translate z="-9"/></transform></shape>'
    both = f'{one}</shape><shape type="rectangle">{beside}'.removesuffix("</shape>")
    np.testing.assert_allclose(
        evaluated(driver, both, wo, wi)[0], evaluated(driver, one, wo, wi)[0], rtol=1e-11
    )


@pytest.mark.parametrize("pair", [(0, 1), (1e-4, 1000), (0.01, 1), (1000, 1e-4)], ids=str)
def test_there_is_a_finite_number_everywhere_of_anisotropic_ones(
    driver: Driver, wide: list[Driver], pair: tuple[float, float]
) -> None:
    """Where the surface has no tangent as well: in the middle of a disk, at the pole of a ball."""
    cosine = np.concatenate([10.0 ** np.linspace(-12, -3, 500), np.linspace(1e-3, 1, 500)])
    for turn in (0.0, 0.3, np.pi / 2):
        sine = np.sqrt((1 - cosine) * (1 + cosine))
        wo = np.stack([sine * np.cos(turn), sine * np.sin(turn), cosine])
        u = uniforms(1000, 13)
        u[:, :100] = np.array([[1e-9], [1e-9]])
        for one in (driver, *wide):
            for shape in ("rectangle", "disk"):
                bsdf = anisotropic(pair)
                with one.scene(f'<shape type="{shape}">{bsdf}</shape>') as scene:
                    out = one("scatter", wo, -wo, np.vstack([u, u]), scene=scene)
                assert np.isfinite(out[:7]).all() and np.isfinite(out[12:19]).all()
                assert ((out[3:6] >= 0) & (out[3:6] <= 1 + 1e-5)).all()


@each_alpha
def test_eval_is_the_formula(driver: Driver, alpha: float) -> None:
    """As the closed form has it, in other words."""
    tinted = Material(
        "roughconductor",
        np.array([1, 0.9, 0.8]),
        np.array(GOLD["eta"]),
        np.array(GOLD["k"]),
        alpha=(alpha, alpha),
    )
    wo, wi = above(2000, 4), above(2000, 5)
    f, _, _ = evaluated(driver, rough(alpha, "Au", "1 0.9 0.8"), wo, wi)
    frame = [np.broadcast_to(axis, (2000, 3)) for axis in np.eye(3)]
    np.testing.assert_allclose((f * wi[2]).T, microfacets(tinted, wo.T, wi.T, *frame), rtol=1e-9)


@each_alpha
def test_it_is_the_same_either_way_round(driver: Driver, alpha: float) -> None:
    wo, wi = above(2000, 6), above(2000, 7)
    there, back = (evaluated(driver, rough(alpha), a, b)[0] for a, b in ((wo, wi), (wi, wo)))
    np.testing.assert_allclose(there, back, rtol=1e-12)


@pytest.mark.parametrize("hemisphere", ["cosine", "uniform"])
@each_alpha
def test_the_factor_is_brdf_times_cosine_over_density(driver: Driver, alpha: float, hemisphere: str) -> None:
    wo = above(5000, 8)
    s = Sampled(driver, rough(alpha), wo, uniforms(5000, 9), hemisphere=hemisphere)
    up = s.wi[2] > 0
    assert (s.factor[:, ~up] == 0).all()
    f, pdf, factor = evaluated(driver, rough(alpha), wo[:, up], s.wi[:, up], hemisphere=hemisphere)
    np.testing.assert_allclose(s.pdf[up], pdf, rtol=1e-12)
    np.testing.assert_allclose(s.factor[:, up], factor, rtol=1e-12)
    np.testing.assert_allclose(factor, f * s.wi[2, up] / pdf, rtol=1e-12)
    assert hemisphere == "uniform" or (s.factor <= 1).all()


@pytest.mark.parametrize("cosine", [1.0, 0.7, 0.15])
@pytest.mark.parametrize("alpha", [0.15, 0.5, 1.0])
def test_directions_follow_their_density(driver: Driver, alpha: float, cosine: float) -> None:
    """χ² over half vectors, tanθ_h = α √(s/(1 − s)), in bins of √(1 − s) and φ; what reflects to below the
    surface is a bin of its own, and no small one: all together are 1.
    """
    n, shape, order = 100_000, (12, 12), 48
    wo = polar(cosine)
    wi = Sampled(driver, rough(alpha), wo, uniforms(n, 10)).wi
    np.testing.assert_allclose(np.linalg.norm(wi, axis=0), 1, rtol=1e-12)
    up = wi[2] > 0
    h = (wo + wi)[:, up]
    slope = (h[0] ** 2 + h[1] ** 2) / (h[2] * alpha) ** 2
    places = np.stack([1 - 1 / np.sqrt(1 + slope), np.arctan2(h[1], h[0]) / (2 * np.pi) + 0.5])
    which = np.minimum((places * np.array(shape)[:, None]).astype(int), np.array(shape)[:, None] - 1)
    counts = np.bincount(which[0] * shape[1] + which[1], minlength=shape[0] * shape[1])

    x, w = np.polynomial.legendre.leggauss(order)
    lines = [((np.arange(k)[:, None] + (x + 1) / 2) / k).ravel() for k in shape]
    weights = [np.tile(w / 2 / k, k) for k in shape]
    t, turn = (grid.ravel() for grid in np.meshgrid(*lines, indexing="ij"))
    s = 1 - (1 - t) ** 2
    tangent, phi = alpha * np.sqrt(s / (1 - s)), 2 * np.pi * (turn - 0.5)
    c = 1 / np.sqrt(1 + tangent**2)
    m = np.stack([tangent * c * np.cos(phi), tangent * c * np.sin(phi), c])
    dot = (wo * m).sum(axis=0)
    there = 2 * dot * m - wo
    # dω_i = 4 (wo·m) dω_m, dω_m = c³ tanθ dtanθ dφ, 2 tanθ dtanθ = α² ds/(1 − s)², ds = 2 (1 − t) dt
    size = 4 * np.abs(dot) * c**3 * alpha**2 / (1 - t) ** 3 * 2 * np.pi
    _, pdf, _ = evaluated(driver, rough(alpha), np.broadcast_to(wo, there.shape), there)
    size *= (dot > 0) * np.outer(*weights).ravel()
    mass = np.where(there[2] > 0, pdf * size, 0)
    below = np.where(there[2] > 0, 0, visible(alpha, wo, m) * size)
    assert mass.sum() + below.sum() == pytest.approx(1, abs=1e-3)
    cells = np.arange(shape[0] * shape[1]).reshape(shape).repeat(order, axis=0).repeat(order, axis=1).ravel()
    expected = n * np.bincount(cells, mass, minlength=shape[0] * shape[1])
    lost = n - expected.sum()
    assert chi_squared(np.append(counts, n - up.sum()), np.append(expected, lost)) > LEVEL
    if lost > 1000:
        wrong = expected * n / expected.sum()
        assert chi_squared(np.append(counts, n - up.sum()), np.append(wrong, 1e-9)) < LEVEL  # it can fail


@pytest.mark.parametrize("cosine", [1.0, 0.5, 0.02])
@pytest.mark.parametrize("pair", [(0.15, 0.15), (0.5, 0.5), (1.0, 1.0), *PAIRS], ids=str)
def test_visible_mirrors_are_all_there_is_to_see(
    driver: Driver, pair: tuple[float, float], cosine: float
) -> None:
    """Weak furnace: ∫ D G1(θo)/(4 cosθo) dω is 1 over all directions, those below the surface as well."""
    x, w = np.polynomial.legendre.leggauss(400)
    t, turn = (grid.ravel() for grid in np.meshgrid((x + 1) / 2, np.pi * (x + 1), indexing="ij"))
    weight = np.outer(w / 2, np.pi * w).ravel()
    tangent = np.sqrt(1 / (1 - t) ** 2 - 1)  # of a slope shrunk by α; tanθ dtanθ = dt/(1 − t)³
    m = np.stack([pair[0] * tangent * np.cos(turn), pair[1] * tangent * np.sin(turn), np.ones_like(t)])
    m /= np.linalg.norm(m, axis=0)
    wo = np.array([[0.8], [0.6], [0]]) * np.sqrt(1 - cosine**2) + [[0], [0], [cosine]]
    seen = (wo * m).sum(axis=0)
    there, size = 2 * seen * m - wo, 4 * np.abs(seen) * m[2] ** 3 * pair[0] * pair[1] / (1 - t) ** 3
    _, pdf, _ = evaluated(driver, anisotropic(pair), np.broadcast_to(wo, there.shape), there)
    mass = (pdf * size * weight)[seen > 0]
    assert mass.sum() == pytest.approx(1, abs=2e-3)
    lost = mass[there[2, seen > 0] < 0].sum()
    assert lost > (0.15 if pair == (0.5, 0.5) and cosine == 1 else 1e-6)


def visible(alpha: float, wo: Array, m: Array) -> Array:
    """D G1(θo) / (4 cosθo), sr⁻¹, of directions below the surface as well."""
    d = alpha**2 / (np.pi * (m[2] ** 2 * (alpha**2 - 1) + 1) ** 2)
    g1 = 2 / (1 + np.sqrt(1 + alpha**2 * (1 - wo[2] ** 2) / wo[2] ** 2))
    return d * g1 / (4 * wo[2])


@pytest.mark.parametrize(("alpha", "albedo"), [(0.5, 0.6878485151), (1.0, 1 - np.log(2))])
def test_a_white_one_reflects_along_its_normal_as_much_as_the_formula(alpha: float, albedo: float) -> None:
    white = Material("roughconductor", np.ones(3), alpha=(alpha, alpha))
    np.testing.assert_allclose(directional_albedo(white, np.array([0.0, 0, 1])), albedo, rtol=1e-10)


@pytest.mark.sample(8)
@pytest.mark.parametrize("hemisphere", ["cosine", "uniform"])
@pytest.mark.parametrize("cosine", [1.0, 0.6, 0.2])
@pytest.mark.parametrize("alpha", [0.15, 0.5, 1.0])
def test_a_furnace_shows_the_directional_albedo(
    driver: Driver, alpha: float, cosine: float, hemisphere: str
) -> None:
    """The mean of f_r cosθ/pdf over an even grid of random numbers."""
    u = (np.indices((1000, 1000)).reshape(2, -1) + 0.5) / 1000
    found = Sampled(driver, rough(alpha), polar(cosine), u, hemisphere=hemisphere).factor.mean(axis=1)
    np.testing.assert_allclose(
        found, directional_albedo(gold((alpha, alpha)), polar(cosine)[:, 0]), rtol=3e-4
    )


@pytest.mark.parametrize("hemisphere", ["cosine", "uniform"])
def test_a_blend_evaluates_its_finite_parts_together(driver: Driver, hemisphere: str) -> None:
    """A quarter of it Lambert's. What one part sends below the surface is lost, whatever the other does."""
    lambert = '<bsdf type="diffuse"><rgb name="reflectance" value="0.8"/></bsdf>'
    blend = f'<bsdf type="blendbsdf"><float name="weight" value="0.25"/>{rough(0.5)}{lambert}</bsdf>'
    wo, n = polar(0.4), 200_000
    s = Sampled(driver, blend, wo, uniforms(n, 11, 4), hemisphere=hemisphere)
    up = s.wi[2] > 0
    assert (s.factor[:, ~up] == 0).all()
    assert hemisphere == "uniform" or (~up).any()
    two = [evaluated(driver, one, wo, s.wi[:, up], hemisphere=hemisphere) for one in (rough(0.5), lambert)]
    f, pdf = (0.75 * two[0][k] + 0.25 * two[1][k] for k in range(2))
    np.testing.assert_allclose(s.pdf[up], pdf, rtol=1e-11)
    np.testing.assert_allclose(s.factor[:, up], f * s.wi[2, up] / pdf, rtol=1e-11)
    albedo = directional_albedo(gold((0.5, 0.5)), wo[:, 0])
    np.testing.assert_allclose(s.factor.mean(axis=1), 0.75 * albedo + 0.2, rtol=0.02)


def test_it_is_black_from_behind_unless_it_is_twosided(driver: Driver) -> None:
    wo = np.array([[0.6], [0.0], [-0.8]])
    assert (Sampled(driver, rough(0.5), wo, uniforms(100, 12)).factor == 0).all()
    there = Sampled(driver, f'<bsdf type="twosided">{rough(0.5)}</bsdf>', wo, uniforms(100, 12))
    assert (there.factor[:, there.wi[2] < 0] > 0).all()


@pytest.mark.parametrize("alpha", [0, 1e-4, 0.01, 1, 1000])
def test_there_is_a_finite_number_everywhere(driver: Driver, wide: list[Driver], alpha: float) -> None:
    """At grazing angles, along the normal, opposite to the viewer; no factor above 1. In both precisions."""
    cosine = np.concatenate([10.0 ** np.linspace(-12, -3, 500), np.linspace(1e-3, 1, 500)])
    wo = np.stack([np.sqrt((1 - cosine) * (1 + cosine)), 0 * cosine, cosine])
    u = uniforms(1000, 13)
    u[:, :100] = np.array([[1e-9], [1e-9]])
    u[:, -100:] = np.array([[1 - 1e-7], [0.5]])
    for one in (driver, *wide):
        s = Sampled(one, rough(alpha), wo, u)
        assert np.isfinite(s.wi).all() and np.isfinite(s.pdf).all()
        assert ((s.factor >= 0) & (s.factor <= 1 + 1e-5)).all()
        for wi in (wo, wo * [[-1], [-1], [1]], np.array([[0.0], [0], [1]]) + 0 * wo):
            assert all(np.isfinite(a).all() for a in evaluated(one, rough(alpha), wo, wi))


def test_a_roughness_below_mitsubas_floor_is_the_floor(driver: Driver) -> None:
    wo, u = above(100, 14), uniforms(100, 15)
    one, other = (Sampled(driver, rough(alpha), wo, u) for alpha in (1e-6, 1e-4))
    np.testing.assert_array_equal(one.pdf, other.pdf)


def test_lanes_give_the_same_bits(driver: Driver, wide: list[Driver]) -> None:
    wo, u = above(2001, 16), uniforms(2001, 17)
    one, two = (Sampled(d, rough(0.3), wo, u) for d in (driver, wide[0]))
    for a, b in ((one.wi, two.wi), (one.factor, two.factor), (one.pdf, two.pdf)):
        np.testing.assert_array_equal(a, b)


def test_metals_are_those_that_mitsuba_has(tmp_path) -> None:
    pytest.importorskip("mitsuba")
    for name in ("src/oneray/materials", "src/raycheck/scene"):
        (tmp_path / name).mkdir(parents=True)
    subprocess.run(
        [sys.executable, ROOT / "scripts/make_metals.py", tmp_path], check=True, capture_output=True
    )
    for name in ("src/oneray/materials/metals.h", "src/raycheck/scene/metals.json"):
        assert (tmp_path / name).read_bytes() == (ROOT / name).read_bytes()
