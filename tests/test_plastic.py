"""Plastics and thin panes: what a coat or a pane mirrors and lets through is Mitsuba's, goes on in the
directions that its density says, is the same either way round, and adds up to what the formula does.

Numbers come from the functions of plastic.h and thindielectric.h themselves (sampling.c). Seeds are fixed.
"""

from __future__ import annotations

import numpy as np
import pytest
from floors import Sampled, above, evaluated, mitsubas, polar
from sampling import Array, Driver, directions, uniforms

from raycheck.scene.coats import diffuse_fresnel

COLOUR, TINT = np.array([0.8, 0.5, 0.1]), np.array([0.9, 0.6, 1.0])
IORS = (1.49, 0.7)
each_ior = pytest.mark.parametrize("ior", IORS)
each_kind = pytest.mark.parametrize("nonlinear", [False, True], ids=["linear", "nonlinear"])


def plastic(ior: float = 1.49, nonlinear: bool = False, colour: Array = COLOUR, tint: Array = TINT) -> str:
    return (
        f'<bsdf type="plastic"><float name="int_ior" value="{ior}"/><float name="ext_ior" value="1"/>'
        f'<boolean name="nonlinear" value="{str(nonlinear).lower()}"/>'
        f'<rgb name="diffuse_reflectance" value="{", ".join(map(str, colour))}"/>'
        f'<rgb name="specular_reflectance" value="{", ".join(map(str, tint))}"/></bsdf>'
    )


def thin(ior: float) -> str:
    return (
        f'<bsdf type="thindielectric"><float name="int_ior" value="{ior}"/><float name="ext_ior" value="1"/>'
        '<rgb name="specular_reflectance" value="0.9, 0.5, 1"/>'
        '<rgb name="specular_transmittance" value="0.2, 1, 0.7"/></bsdf>'
    )


def fresnel(cosine: Array, ior: float) -> Array:
    """Reflectance, as the halves' sum of squares of amplitudes."""
    beyond = np.sqrt(np.maximum(1 - (1 - cosine**2) / ior**2, 0))
    s, p = (
        (cosine - ior * beyond) / (cosine + ior * beyond),
        (ior * cosine - beyond) / (ior * cosine + beyond),
    )
    return (s * s + p * p) / 2


def base(ior: float, nonlinear: bool) -> Array:
    return COLOUR / (1 - diffuse_fresnel(ior) * (COLOUR if nonlinear else 1)) / ior**2


@each_ior
@each_kind
def test_eval_and_pdf_are_mitsubas(driver: Driver, ior: float, nonlinear: bool) -> None:
    """Where its single precision has the digits of 1 − F: neither grazing nor next to total reflection."""
    wo, wi = above(500, 1), above(500, 2)
    lower = np.minimum(wo[2], wi[2])
    up = (lower > 0.05) & (np.abs(1 - (1 - lower**2) / ior**2) > 0.05)
    f, pdf, _ = evaluated(driver, plastic(ior, nonlinear), wo, wi)
    found, density = mitsubas(plastic(ior, nonlinear), wo, wi)
    np.testing.assert_allclose((f * wi[2])[:, up], found[:, up], rtol=3e-6)
    np.testing.assert_allclose(pdf[up], density[up], rtol=3e-6)


@each_ior
@each_kind
def test_eval_is_the_formula_and_the_same_either_way_round(
    driver: Driver, ior: float, nonlinear: bool
) -> None:
    wo, wi = above(2000, 3), above(2000, 4)
    there, back = (evaluated(driver, plastic(ior, nonlinear), a, b)[0] for a, b in ((wo, wi), (wi, wo)))
    inward, outward = (1 - fresnel(w[2], ior) for w in (wi, wo))
    np.testing.assert_allclose(
        there, base(ior, nonlinear)[:, None] / np.pi * inward * outward, rtol=1e-9, atol=1e-15
    )
    np.testing.assert_allclose(there, back, rtol=1e-12)


def test_a_texture_weighs_lobes_by_its_mean_as_mitsuba_does(driver: Driver) -> None:
    board = (
        '<bsdf type="plastic"><texture name="diffuse_reflectance" type="checkerboard">'
        '<rgb name="color0" value="0.9, 0.8, 0.1"/><rgb name="color1" value="0.05, 0.1, 0.6"/></texture>'
        '<texture name="specular_reflectance" type="checkerboard"><rgb name="color0" value="0.2"/>'
        '<rgb name="color1" value="0.5"/></texture></bsdf>'
    )
    wo, wi = above(200, 1), above(200, 2)
    _, pdf, _ = evaluated(driver, board, wo, wi)
    np.testing.assert_allclose(pdf, mitsubas(board, wo, wi)[1], rtol=3e-6)


@pytest.mark.parametrize("hemisphere", ["cosine", "uniform"])
@each_ior
@each_kind
def test_the_factor_is_brdf_times_cosine_over_density(
    driver: Driver, wide: list[Driver], ior: float, nonlinear: bool, hemisphere: str
) -> None:
    """Of what is no delta; of the mirrored, the coat's reflectance over its chance."""
    wo, u = above(5000, 5), uniforms(5000, 6)
    bsdf = plastic(ior, nonlinear)
    s = Sampled(driver, bsdf, wo, u, hemisphere=hemisphere)
    rest = ~s.delta
    assert 0.05 < rest.mean() < 0.999
    f, pdf, factor = evaluated(driver, bsdf, wo[:, rest], s.wi[:, rest], hemisphere=hemisphere)
    np.testing.assert_allclose(s.pdf[rest], pdf, rtol=1e-12)
    np.testing.assert_allclose(s.factor[:, rest], factor, rtol=1e-12)
    np.testing.assert_allclose(factor, f * s.wi[2, rest] / pdf, rtol=1e-11)
    mirrored = wo * [[-1], [-1], [1]]
    np.testing.assert_allclose(s.wi[:, ~rest], mirrored[:, ~rest], rtol=1e-12, atol=1e-15)
    flat = evaluated(driver, bsdf, wo, wo, hemisphere="uniform")[1] * 2 * np.pi  # what is left to the base
    expected = TINT[:, None] * fresnel(wo[2], ior) / (1 - flat)
    np.testing.assert_allclose(s.factor[:, ~rest], expected[:, ~rest], rtol=1e-8)
    other = Sampled(wide[0], bsdf, wo, u, hemisphere=hemisphere)
    np.testing.assert_array_equal(s.factor, other.factor)


@pytest.mark.parametrize("hemisphere", ["cosine", "uniform"])
@pytest.mark.parametrize("cosine", [1.0, 0.6, 0.1])
@each_kind
@each_ior
def test_a_furnace_shows_the_directional_albedo(
    driver: Driver, ior: float, nonlinear: bool, cosine: float, hemisphere: str
) -> None:
    """F + (1 − F) base ∫ (1 − F) 2c dc, by Gauss–Legendre."""
    u = (np.indices((5000, 20)).reshape(2, -1) + 0.5) / np.array([[5000], [20]])
    found = Sampled(driver, plastic(ior, nonlinear), polar(cosine), u, hemisphere=hemisphere).factor.mean(
        axis=1
    )
    x, w = np.polynomial.legendre.leggauss(200)
    c = (x + 1) / 2
    through = (1 - fresnel(c, ior)) @ (w * c)
    f = fresnel(np.array(cosine), ior)
    np.testing.assert_allclose(found, TINT * f + (1 - f) * base(ior, nonlinear) * through, rtol=4e-3)


def test_white_plastic_keeps_all_light_to_the_error_of_the_fit(driver: Driver) -> None:
    """Weak furnace: over all directions that light comes from, evenly."""
    one = np.ones(3)
    wo, u = above(100_000, 7), uniforms(100_000, 8)
    wo[:2] *= np.sqrt((1 - (u[0])) / (wo[0] ** 2 + wo[1] ** 2))
    wo[2] = np.sqrt(u[0])  # by the cosine
    found = Sampled(driver, plastic(1.49, False, one, one), wo, uniforms(100_000, 9)).factor.mean()
    assert found == pytest.approx(1, abs=3e-3)


@pytest.mark.parametrize("colours", [(0, 1), (1, 0), (0, 0)], ids=["coat", "base", "black"])
def test_what_is_black_is_never_chosen(driver: Driver, colours: tuple[int, int]) -> None:
    """Alone, and beside a surface that is black all over."""
    bsdf = plastic(1.5, False, colours[0] * np.ones(3), colours[1] * np.ones(3))
    wo = above(2000, 10)
    s = Sampled(driver, bsdf, wo, uniforms(2000, 11))
    assert np.isfinite(s.factor).all() and np.isfinite(s.pdf).all()
    assert s.delta.all() == (colours != (1, 0)) and (~s.delta).all() == (colours == (1, 0))
    assert (s.factor.max() > 0) == any(colours)


@pytest.mark.parametrize("hemisphere", ["cosine", "uniform"])
def test_a_blend_has_its_share_of_each_lobe(driver: Driver, hemisphere: str) -> None:
    lambert = '<bsdf type="diffuse"><rgb name="reflectance" value="0.4"/></bsdf>'
    wo, n = polar(0.3), 200_000
    for nonlinear in (False, True):
        one = plastic(1.49, nonlinear)
        blend = f'<bsdf type="blendbsdf"><float name="weight" value="0.25"/>{one}{lambert}</bsdf>'
        s = Sampled(driver, blend, wo, uniforms(n, 11, 4), hemisphere=hemisphere)
        rest = ~s.delta
        two = [evaluated(driver, part, wo, s.wi[:, rest], hemisphere=hemisphere) for part in (one, lambert)]
        f, pdf = (0.75 * two[0][k] + 0.25 * two[1][k] for k in range(2))
        np.testing.assert_allclose(s.pdf[rest], pdf, rtol=1e-11)
        np.testing.assert_allclose(s.factor[:, rest], f * s.wi[2, rest] / pdf, rtol=1e-11)
        alone = Sampled(driver, one, wo, uniforms(n, 12), hemisphere=hemisphere).factor.mean(axis=1)
        np.testing.assert_allclose(s.factor.mean(axis=1), 0.75 * alone + 0.1, rtol=0.02)


@pytest.mark.parametrize("ior", [1.5, 1.0005, 3.8, 0.5])
def test_there_is_a_finite_number_everywhere(driver: Driver, wide: list[Driver], ior: float) -> None:
    cosine = np.concatenate([10.0 ** np.linspace(-12, -3, 500), np.linspace(1e-3, 1, 500)])
    wo = np.stack([np.sqrt((1 - cosine) * (1 + cosine)), 0 * cosine, cosine])
    u = uniforms(1000, 13)
    u[:, :100] = np.array([[1e-9], [1e-9]])
    for one in (driver, *wide):
        for bsdf in (plastic(ior), thin(ior)):
            s = Sampled(one, bsdf, wo, u)
            assert np.isfinite(s.wi).all() and np.isfinite(s.pdf).all()
            assert np.isfinite(s.factor).all() and (s.factor >= 0).all()
        assert all(np.isfinite(a).all() for a in evaluated(one, plastic(ior), wo, wo))


@pytest.mark.parametrize("ior", [2.4, 0.8])
def test_a_thin_pane_lets_straight_through_what_it_does_not_mirror(driver: Driver, ior: float) -> None:
    """R = F + (1 − F)² F (1 + F² + …) = 2F/(1 + F), from either side; never radiance gained."""
    n = 40_000
    for way in (1, -1):
        wo = directions(200, 14)
        wo *= way * np.sign(wo[2])
        u = np.vstack([(np.arange(n) + 0.5) / n, np.full(n, 0.5)])
        for one in wo.T[:5, :, None]:
            s = Sampled(driver, thin(ior), one, u)
            mirrors = s.wi[2] * one[2] > 0
            f = fresnel(np.abs(one[2]), ior)
            assert mirrors.mean() == pytest.approx(float((2 * f / (1 + f))[0]), abs=1 / n)
            assert s.delta.all() and (s.compression == 1).all()
            turned = np.where(mirrors, one * [[-1], [-1], [1]], -one)
            np.testing.assert_allclose(s.wi, turned, atol=1e-14)
            tint = np.where(mirrors, [[0.9], [0.5], [1]], [[0.2], [1], [0.7]])
            np.testing.assert_allclose(s.factor, tint, rtol=1e-15)


def test_its_weights_are_mitsubas(driver: Driver) -> None:
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    theirs = mi.load_string(f'<scene version="3.0.0"><shape type="rectangle">{thin(1.5)}</shape></scene>')
    at = mi.SurfaceInteraction3f()
    wo, u = above(500, 15), uniforms(500, 16)
    s = Sampled(driver, thin(1.5), wo, u)
    for k in range(500):
        at.wi = mi.Vector3f(*wo[:, k])
        sample, weight = theirs.shapes()[0].bsdf().sample(mi.BSDFContext(), at, u[0, k], [0.5, 0.5])
        np.testing.assert_allclose(np.array(sample.wo), s.wi[:, k], atol=3e-6)
        np.testing.assert_allclose(np.array(weight), s.factor[:, k], rtol=3e-6)
