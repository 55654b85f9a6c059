"""Rough glass: what its microfacets reflect and refract is Mitsuba's, goes on in the directions that its
density says, is the same either way round but for η², and adds up to no more than all of it.

Numbers come from the functions of roughdielectric.h themselves (sampling.c). Seeds are fixed; all statistical
checks of this file together would raise a false alarm for one choice of seeds in 10⁴ (sampling.py).
"""

from __future__ import annotations

import numpy as np
import pytest
from floors import Sampled, evaluated, mitsubas
from sampling import LEVEL, Array, Driver, cell, chi_squared, directions, nodes, uniforms

ALPHAS = ((0.1, 0.1), (0.5, 0.5), (1.0, 1.0), (0.15, 0.6))
each_alpha = pytest.mark.parametrize("alpha", ALPHAS, ids=str)
each_ior = pytest.mark.parametrize("ior", [1.5, 0.6])
each_side = pytest.mark.parametrize("side", [1, -1], ids=["outside", "inside"])
each_hemisphere = pytest.mark.parametrize("hemisphere", ["cosine", "uniform"])


def glass(alpha: tuple[float, float], ior: float = 1.5, tints: tuple[str, str] = ("1", "1")) -> str:
    return (
        '<bsdf type="roughdielectric"><string name="distribution" value="ggx"/>'
        f'<float name="alpha_u" value="{alpha[0]}"/><float name="alpha_v" value="{alpha[1]}"/>'
        f'<float name="int_ior" value="{ior}"/><float name="ext_ior" value="1"/>'
        f'<rgb name="specular_reflectance" value="{tints[0]}"/>'
        f'<rgb name="specular_transmittance" value="{tints[1]}"/></bsdf>'
    )


def on_side(n: int, seed: int, side: int) -> Array:
    d = directions(n, seed)
    d *= side * np.sign(d[2])
    return d[:, np.abs(d[2]) > 0.02]


@each_side
@each_ior
@each_alpha
def test_eval_and_pdf_are_mitsubas(driver: Driver, alpha: tuple[float, float], ior: float, side: int) -> None:
    """Of directions all around, and of such as are sampled, to the digits of its single precision."""
    bsdf = glass(alpha, ior, ("0.9, 0.5, 1", "0.2, 1, 0.7"))
    wo = on_side(400, 1, side)
    wi = directions(wo.shape[1], 2)
    wi[:, ::2] = Sampled(driver, bsdf, wo, uniforms(wo.shape[1], 3, 4)).wi[:, ::2]
    f, pdf, _ = evaluated(driver, bsdf, wo, wi)
    found, density = mitsubas(bsdf, wo, wi)
    none = density == 0
    assert (pdf[none] == 0).all() and (f[:, none] == 0).all() and none.mean() < 0.6
    for mine, theirs in ((f * np.abs(wi[2]), found), (pdf, density)):
        error = np.abs(mine / np.where(theirs == 0, 1, theirs) - 1)[..., ~none]
        assert np.quantile(error, 0.5) < 3e-6 and np.quantile(error, 0.97) < 1e-4, np.quantile(
            error, [0.5, 0.97, 1]
        )


@each_hemisphere
@each_side
@each_alpha
def test_the_factor_is_bsdf_times_cosine_over_density(
    driver: Driver, wide: list[Driver], alpha: tuple[float, float], side: int, hemisphere: str
) -> None:
    """Less η², which is apart; G1, which is at most 1."""
    wo = on_side(3000, 4, side)
    u = uniforms(wo.shape[1], 5, 4)
    s = Sampled(driver, glass(alpha), wo, u, hemisphere=hemisphere)
    f, pdf, factor = evaluated(driver, glass(alpha), wo, s.wi, hemisphere=hemisphere)
    kept = s.pdf > 0
    reflects = wo[2] * s.wi[2] > 0
    assert (s.factor[:, ~kept] == 0).all() and kept.mean() > 0.4
    eta = 1.5 if side > 0 else 1 / 1.5
    np.testing.assert_allclose(s.compression[kept], np.where(reflects, 1, eta**-2)[kept], rtol=1e-12)
    np.testing.assert_allclose(s.pdf[kept], pdf[kept], rtol=1e-12)
    np.testing.assert_allclose(s.factor[:, kept], factor[:, kept], rtol=1e-12)
    whole = (f * np.abs(s.wi[2]) / pdf / s.compression)[:, kept]
    np.testing.assert_allclose(s.factor[:, kept], whole, rtol=1e-9)
    assert hemisphere == "uniform" or (s.factor <= 1 + 1e-12).all()
    two = Sampled(wide[0], glass(alpha), wo, u, hemisphere=hemisphere)
    np.testing.assert_array_equal(s.factor, two.factor)


@each_alpha
def test_it_is_the_same_either_way_round_but_for_the_index(
    driver: Driver, alpha: tuple[float, float]
) -> None:
    """f(wo, wi) η_i² = f(wi, wo) η_o²; of flux, which light tracing carries, the other way round."""
    wo, n = on_side(3000, 6, 1), 3000
    wi = Sampled(driver, glass(alpha), wo, uniforms(wo.shape[1], 7, 4)).wi
    index = np.where(wi[2] < 0, 1.5, 1)
    there, back = (evaluated(driver, glass(alpha), a, b)[0] for a, b in ((wo, wi), (wi, wo)))
    assert 0 < (wi[2] < 0).mean() < 1 and n
    np.testing.assert_allclose(there * index**2, back, rtol=1e-7, atol=1e-12)
    with_lamp = glass(alpha) + "</shape>" + LAMP
    flux = evaluated(driver, with_lamp, wo, wi, estimator="light")[0]
    np.testing.assert_allclose(flux, there * index**2, rtol=1e-12)


LAMP = (
    '<shape type="rectangle"><transform name="to_world"><translate z="50"/></transform><emitter type="area"/>'
)


@each_side
@pytest.mark.parametrize("alpha", ALPHAS[1:], ids=str)
def test_directions_follow_their_density(driver: Driver, alpha: tuple[float, float], side: int) -> None:
    """χ² over the sphere, z and φ; the lost are a bin of their own, and all together are 1."""
    n, shape = 40_000, (16, 12)
    wo = np.array([[0.5], [0.3], [side * np.sqrt(1 - 0.34)]])
    s = Sampled(driver, glass(alpha), wo, uniforms(n, 10, 4))
    np.testing.assert_allclose(np.linalg.norm(s.wi, axis=0), 1, rtol=1e-12)
    kept = s.pdf > 0

    def place(w: Array) -> Array:
        return np.stack([(w[2] + 1) / 2, np.arctan2(w[1], w[0]) / (2 * np.pi) + 0.5])

    counts = np.bincount(cell(place(s.wi[:, kept]), shape), minlength=shape[0] * shape[1])
    at, weights, which = nodes(shape, 24)
    z, phi = 2 * at[0] - 1, 2 * np.pi * (at[1] - 0.5)
    r = np.sqrt(1 - z * z)
    wi = np.stack([r * np.cos(phi), r * np.sin(phi), z])
    pdf = evaluated(driver, glass(alpha), wo, wi)[1]
    expected = n * np.bincount(which, 4 * np.pi * weights * pdf, minlength=shape[0] * shape[1])
    lost = n - expected.sum()
    assert 0 <= lost < 0.5 * n
    assert chi_squared(np.append(counts, n - kept.sum()), np.append(expected, lost)) > LEVEL
    wrong = np.append(expected * 1.06, n - expected.sum() * 1.06)
    assert chi_squared(np.append(counts, n - kept.sum()), wrong) < LEVEL  # it can fail


@each_side
@pytest.mark.parametrize("alpha", ALPHAS[1:], ids=str)
def test_what_is_sampled_adds_up_to_the_formula_and_to_no_more_than_all(
    driver: Driver, alpha: tuple[float, float], side: int
) -> None:
    """Weak furnace: ∫ f cosθ dω less η² by quadrature of f, and the mean of the factors."""
    wo = np.array([[0.4], [-0.2], [side * np.sqrt(1 - 0.2)]])
    at, weights, _ = nodes((40, 24), 16)
    z, phi = 2 * at[0] - 1, 2 * np.pi * (at[1] - 0.5)
    wi = np.stack([np.sqrt(1 - z * z) * np.cos(phi), np.sqrt(1 - z * z) * np.sin(phi), z])
    f = evaluated(driver, glass(alpha), wo, wi)[0]
    eta = 1.5 if side > 0 else 1 / 1.5
    f = f * np.where(wi[2] * side > 0, 1, eta**2)
    albedo = 4 * np.pi * (weights * f * np.abs(z)).sum(axis=1)
    for hemisphere, error in (("cosine", 3e-3), ("uniform", 0.04)):
        found = Sampled(driver, glass(alpha), wo, uniforms(100_000, 11, 4), hemisphere=hemisphere).factor
        np.testing.assert_allclose(found.mean(axis=1), albedo, rtol=error)
    assert (albedo < 1).all() and (albedo > 0.4).all()


@each_hemisphere
def test_a_blend_loses_what_a_part_sends_to_the_wrong_side(driver: Driver, hemisphere: str) -> None:
    """Of two rough glasses and a metal: each one's albedo, η² included, by its share."""
    metal = (
        '<bsdf type="roughconductor"><string name="distribution" value="ggx"/>'
        '<float name="alpha" value="1"/></bsdf>'
    )
    parts = (glass((1.0, 1.0)), glass((0.3, 0.3), 2.4), metal)
    inner = f'<bsdf type="blendbsdf"><float name="weight" value="0.5"/>{parts[1]}{parts[2]}</bsdf>'
    blend = f'<bsdf type="blendbsdf"><float name="weight" value="0.6"/>{parts[0]}{inner}</bsdf>'
    wo, n = np.array([[0.8], [0.0], [0.6]]), 200_000
    s = Sampled(driver, blend, wo, uniforms(n, 12, 4), hemisphere=hemisphere)
    alone = [Sampled(driver, one, wo, uniforms(n, 13, 4), hemisphere=hemisphere) for one in parts]
    expected = sum(
        share * (one.factor * one.compression).mean(axis=1)
        for share, one in zip((0.4, 0.3, 0.3), alone, strict=True)
    )
    np.testing.assert_allclose((s.factor * s.compression).mean(axis=1), expected, rtol=0.015)


@pytest.mark.parametrize("alpha", [(0, 0), (1e-4, 1), (1000, 1000)], ids=str)
def test_there_is_a_finite_number_everywhere(
    driver: Driver, wide: list[Driver], alpha: tuple[float, float]
) -> None:
    cosine = np.concatenate([10.0 ** np.linspace(-12, -3, 300), np.linspace(1e-3, 1, 300)])
    u = uniforms(600, 13, 4)
    u[:, :100] = 1e-9
    for side in (1, -1):
        wo = np.stack([np.sqrt((1 - cosine) * (1 + cosine)), 0 * cosine, side * cosine])
        for one in (driver, *wide):
            s = Sampled(one, glass(alpha), wo, u)
            assert np.isfinite(s.wi).all() and np.isfinite(s.pdf).all()
            assert ((s.factor >= 0) & (s.factor <= 1 + 1e-5)).all()
            for wi in (wo, -wo, wo * [[-1], [-1], [1]], np.array([[0.0], [0], [1]]) + 0 * wo):
                assert all(np.isfinite(a).all() for a in evaluated(one, glass(alpha), wo, wi))
