"""Rough plastics, and Beckmann's microfacets in them, in metals and in glass: f_r is Mitsuba's, paths go on
in the directions that the density says, and what they carry adds up to f_r's integral.

Numbers come from the functions of the materials themselves (sampling.c). Seeds are fixed.
"""

from __future__ import annotations

import resource
import subprocess
from pathlib import Path

import numpy as np
import pytest
from floors import Sampled, above, evaluated, mitsubas, polar
from sampling import SCENE, Array, Driver, directions, uniforms

ALPHAS = (0.05, 0.15, 0.5, 1.0)
each_alpha = pytest.mark.parametrize("alpha", ALPHAS)
each_way = pytest.mark.parametrize("way", [{}, {"normals": "all"}, {"hemisphere": "uniform"}], ids=str)
TINTS = '<rgb name="specular_reflectance" value="0.9, 0.6, 1"/>'
SINGLE = '<float name="alpha" value="{}"/>'
PAIR = '<float name="alpha_u" value="{}"/><float name="alpha_v" value="0.4"/>'
ENDS = '<string name="distribution" value="{}"/></bsdf>'
METAL = f'<bsdf type="roughconductor">{TINTS}<string name="material" value="Au"/>'
GLASS = f'<bsdf type="roughdielectric">{TINTS}<rgb name="specular_transmittance" value="0.2, 1, 0.7"/>'
PLASTIC = (
    f'<bsdf type="roughplastic">{TINTS}<rgb name="diffuse_reflectance" value="0.8, 0.5, 0.1"/>'
    '<boolean name="nonlinear" value="{}"/>'
)
KINDS = {
    "metal": METAL + SINGLE + ENDS,
    "brushed-metal": METAL + PAIR + ENDS,
    "glass": GLASS + SINGLE + ENDS,
    "brushed-glass": GLASS + PAIR + ENDS,
    "plastic": PLASTIC.format("false") + SINGLE + ENDS,
    "nonlinear-plastic": PLASTIC.format("true") + SINGLE + ENDS,
}
CASES = [
    (name, which)
    for name in KINDS
    for which in ("ggx", "beckmann")
    if which == "beckmann" or "plastic" in name  # of GGX the others have files of their own
]
each_case = pytest.mark.parametrize(("name", "which"), CASES)


def ways(name: str, count: int, seed: int) -> Array:
    return directions(count, seed) if "glass" in name else above(count, seed)


@each_alpha
@each_case
def test_eval_is_mitsubas(driver: Driver, name: str, which: str, alpha: float) -> None:
    """But for its single precision, and of plastic its other rule for the table's integrals."""
    bsdf = KINDS[name].format(alpha, which)
    wo, wi = above(400, 1), ways(name, 400, 2)
    wi[:, ::2] = Sampled(driver, bsdf, wo, uniforms(400, 3)).wi[:, ::2]  # some where it is bright
    far = ((np.abs(wi[2]) if "glass" in name else wi[2]) > 0.02) & (wo[2] > 0.02)
    wo, wi = wo[:, far], wi[:, far]
    f, pdf, _ = evaluated(driver, bsdf, wo, wi)
    found, density = mitsubas(bsdf, wo, wi)
    tolerance = (2e-5 if alpha >= 0.1 else 2e-4) if "plastic" not in name else 2e-3
    np.testing.assert_allclose(f * np.abs(wi[2]), found, rtol=tolerance, atol=1e-9)
    if which == "ggx":
        np.testing.assert_allclose(pdf, density, rtol=2.5 * tolerance, atol=1e-9)  # 1 − T of the table


@pytest.mark.sample(32)
@each_way
@each_alpha
@each_case
def test_factor_is_brdf_times_cosine_over_density(
    driver: Driver, wide: list[Driver], name: str, which: str, alpha: float, way: dict[str, str]
) -> None:
    bsdf = KINDS[name].format(alpha, which)
    wo = above(3000, 8)
    s = Sampled(driver, bsdf, wo, uniforms(3000, 9, 3), **way)
    kept = s.factor.any(axis=0)
    f, pdf, factor = evaluated(driver, bsdf, wo[:, kept], s.wi[:, kept], **way)
    crossed = s.compression[kept]  # of radiance, which factors are without
    np.testing.assert_allclose(s.pdf[kept], pdf, rtol=1e-9)
    np.testing.assert_allclose(s.factor[:, kept], factor, rtol=1e-9)
    np.testing.assert_allclose(factor, f * np.abs(s.wi[2, kept]) / pdf / crossed, rtol=1e-8, atol=1e-12)
    if not way:
        assert s.factor.max() < 3  # as much as Beckmann's can be of GGX's, and less
    two = Sampled(wide[0], bsdf, wo, uniforms(3000, 9, 3), **way)
    np.testing.assert_array_equal(s.wi, two.wi)
    np.testing.assert_array_equal(s.factor, two.factor)


@pytest.mark.sample(8)
@pytest.mark.parametrize("cosine", [1.0, 0.6, 0.1])
@each_case
def test_sampled_directions_carry_the_integral_of_eval(
    driver: Driver, name: str, which: str, cosine: float
) -> None:
    """∫ f_r |cosθ| dω by a grid of directions, and by one of the numbers that directions are sampled by."""
    bsdf = KINDS[name].format(0.4, which)
    n = 700
    u = (np.indices((n, n)).reshape(2, -1) + 0.5) / n
    z = 2 * u[0] - 1 if "glass" in name else u[0]
    ring, turn = np.sqrt(1 - z * z), 2 * np.pi * u[1]
    f, _, _ = evaluated(driver, bsdf, polar(cosine), np.stack([ring * np.cos(turn), ring * np.sin(turn), z]))
    area = 4 * np.pi if "glass" in name else 2 * np.pi
    expected = (f * np.abs(z)).mean(axis=1) * area
    third = uniforms(n * n, 5, 1)
    for normals in ("visible", "all"):
        s = Sampled(driver, bsdf, polar(cosine), np.vstack([u, third]), normals=normals)
        error = (s.factor * s.compression).std(axis=1) / n if normals == "all" else 0
        found = (s.factor * s.compression).mean(axis=1)
        assert (np.abs(found - expected) < 4e-3 * expected + 4 * error).all(), normals


@pytest.mark.sample(10)
@pytest.mark.parametrize("name", [name for name in KINDS if "brushed" not in name])
@pytest.mark.parametrize("alpha", [0.0, 1e-4, 0.01, 10.0, 1000.0])
def test_there_is_a_finite_number_everywhere(
    driver: Driver, wide: list[Driver], name: str, alpha: float
) -> None:
    cosine = np.concatenate([10.0 ** np.linspace(-12, -3, 500), np.linspace(1e-3, 1, 500)])
    wo = np.stack([np.sqrt((1 - cosine) * (1 + cosine)), np.zeros(1000), cosine])
    u = uniforms(1000, 13, 4)
    u[:, :100] = 1e-9
    for which in ("ggx", "beckmann"):
        with driver.scene(f'<shape type="rectangle">{KINDS[name].format(alpha, which)}</shape>') as scene:
            out = driver("scatter", wo, -wo, u, scene=scene)
        assert np.isfinite(out[:7]).all() and (out[3:6] >= 0).all() and (out[3:6] < 4).all()
        for one in wide:
            with one.scene(f'<shape type="rectangle">{KINDS[name].format(alpha, which)}</shape>') as scene:
                assert np.isfinite(one("scatter", wo, -wo, u, scene=scene)[:7]).all()


@pytest.mark.parametrize("which", ["ggx", "beckmann"])
def test_a_rough_plastic_that_is_nearly_smooth_reflects_as_plastic_does(driver: Driver, which: str) -> None:
    """Its base, away from grazing angles, where the table is linear and the smooth one's Fresnel is not."""
    rest = (
        '<rgb name="diffuse_reflectance" value="0.8, 0.5, 0.1"/><rgb name="specular_reflectance" value="0"/>'
    )
    rough = f'<bsdf type="roughplastic">{rest}{SINGLE.format(1e-4)}{ENDS.format(which)}'
    wo, wi = above(500, 1), above(500, 2)
    far = np.minimum(wo[2], wi[2]) > 0.3
    one, other = (
        evaluated(driver, bsdf, wo[:, far], wi[:, far])[0]
        for bsdf in (rough, f'<bsdf type="plastic">{rest}</bsdf>')
    )
    ratio = one / other
    np.testing.assert_allclose(ratio, np.median(ratio), rtol=2e-3)
    assert 0.97 < np.median(ratio) < 1  # the table's sum for light within is 1/64 of it short, as Mitsuba's


def test_a_hundred_rough_plastics_are_read_at_once(oneray: Path, tmp_path: Path) -> None:
    """In 0.2 s of a core: the sines of a table are taken once, and not for each of its entries."""
    bsdfs = (KINDS["plastic"].format(0.1 + k / 200, "ggx") for k in range(100))
    balls = "".join(f'<shape type="sphere">{bsdf}</shape>' for bsdf in bsdfs)
    file = tmp_path / "many.xml"
    file.write_text(SCENE.format(balls + '<emitter type="constant"/>'))
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([oneray, file, "--check"], check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert after.ru_utime - before.ru_utime < 2
