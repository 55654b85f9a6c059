"""Textures of a blend's weight and a mask's opacity: at each place it is the blend of that number."""

from __future__ import annotations

import numpy as np
import pytest
from floors import floor
from sampling import Array, Driver, directions, uniforms

ROUGH = (
    '<bsdf type="roughconductor"><string name="distribution" value="ggx"/>'
    '<float name="alpha" value="0.4"/></bsdf>'
)
RED = '<bsdf type="diffuse"><rgb name="reflectance" value="0.8, 0.2, 0.1"/></bsdf>'
GREY = '<bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf>'
COAT = (
    '<bsdf type="plastic"><boolean name="nonlinear" value="true"/>'
    '<rgb name="diffuse_reflectance" value="0.8, 0.25, 0.15"/></bsdf>'
)
MIRROR = '<bsdf type="conductor"/>'


def share(name: str, pair: tuple[float, float] | float, scale: float = 1) -> str:
    """A number, or a board's two colours by turns."""
    if not isinstance(pair, tuple):
        return f'<float name="{name}" value="{pair}"/>'
    rgb = (f'<rgb name="color{i}" value="{one}, {one}, {one}"/>' for i, one in enumerate(pair))
    to_uv = f'<transform name="to_uv"><scale x="{scale}" y="{scale}"/></transform>'
    return f'<texture type="checkerboard" name="{name}">{"".join(rgb)}{to_uv}</texture>'


def blend(weight: str, first: str, second: str) -> str:
    return f'<bsdf type="blendbsdf">{weight}{first}{second}</bsdf>'


def mask(opacity: str, inner: str) -> str:
    return f'<bsdf type="mask">{opacity}{inner}</bsdf>'


def cases(pair: tuple[float, float] | float, other: tuple[float, float] | float) -> dict[str, str]:
    weight, second = share("weight", pair), share("weight", other, 3)
    return {
        "two finite": blend(weight, RED, ROUGH),
        "two of one kind": blend(weight, RED, GREY),
        "under a coat": blend(weight, COAT, RED),
        "finite and mirror": blend(weight, MIRROR, RED),
        "mask": mask(share("opacity", pair), ROUGH),
        "twosided in a mask": mask(share("opacity", pair), f'<bsdf type="twosided">{RED}</bsdf>'),
        "two textures": blend(weight, blend(second, ROUGH, RED), blend(second, COAT, MIRROR)),
        "a number outside": blend(share("weight", 0.3), GREY, blend(weight, ROUGH, MIRROR)),
        "a number inside": mask(
            share("opacity", pair), blend(share("weight", 0.3), COAT, blend(weight, RED, GREY))
        ),
    }


def differs(at: Array) -> Array:
    """Where u and v are in different halves of their unit: there a share has color0."""
    return ((at - np.floor(at)) > 0.5).sum(axis=0) == 1


PAIRS = ((0.25, 0.75), (0.0, 1.0))


@pytest.mark.parametrize("hemisphere", ["cosine", "uniform"])
@pytest.mark.parametrize("pair", PAIRS, ids=str)
@pytest.mark.parametrize("name", cases(0, 0))
def test_at_each_place_it_is_the_blend_of_that_number(
    driver: Driver, wide: list[Driver], name: str, pair: tuple[float, float], hemisphere: str
) -> None:
    """What it makes of light from anywhere, its density, and where the path goes on with which part."""
    n, other = 2000, (0.9, 0.2)
    at = np.vstack([uniforms(n, 1, 2, low=-1), np.zeros(n)])
    wo, wi = directions(n, 2), directions(n, 3)
    u = uniforms(n, 4, 4)
    uv = (at[:2] + 1) / 2
    which = (~differs(uv)).astype(int), (~differs(3 * uv)).astype(int)
    technique = {"hemisphere": hemisphere}
    for one in (driver, wide[0]) if pair[0] else (driver,):
        with one.scene(floor(cases(pair, other)[name]), **technique) as scene:
            found = (
                one("evaluate", at + wo, -wo, wi, scene=scene),
                one("scatter", at + wo, -wo, u, scene=scene),
            )
        for i in (0, 1):
            for j in (0, 1):
                here = (which[0] == i) & (which[1] == j)
                plain = cases(pair[i], other[j])[name]
                lit = (wo[2, here] > 0) | ('"mask"' in plain)
                with one.scene(floor(plain), **technique) as scene:
                    o, d = (at + wo)[:, here], -wo[:, here]
                    value = one("evaluate", o, d, wi[:, here], scene=scene)
                    gone = one("scatter", o, d, u[:, here], scene=scene)
                if (gone[7] > 0)[lit].all():  # there is no finite part left to evaluate
                    value = np.where(lit, 0, value)
                same = (wo * wi)[2, here] > 0  # light from behind is asked of glass alone
                np.testing.assert_allclose(
                    found[0][:4, here][:, same], value[:4, same], rtol=1e-9, atol=1e-14
                )
                mean = [(s[3:6] * s[8])[:, lit] for s in (found[1][:, here], gone)]
                assert all(np.isfinite(m).all() for m in mean)
                if lit.any() and name in ("mask", "two of one kind", "two finite", "finite and mirror"):
                    np.testing.assert_allclose(
                        mean[0].mean(axis=1), mean[1].mean(axis=1), rtol=0.2, atol=0.02
                    )


@pytest.mark.parametrize("name", cases(0, 0))
def test_the_sampled_are_what_the_density_says(driver: Driver, name: str) -> None:
    """f cosθ over the pdf of those that no delta sent; deltas as often as their share."""
    n = 4000
    at, wo = np.vstack([uniforms(n, 1, 2, low=-1), np.zeros(n)]), directions(n, 2)
    wo[2] = np.abs(wo[2])
    with driver.scene(floor(cases((0.25, 0.75), (0.9, 0.2))[name])) as scene:
        s = driver("scatter", at + wo, -wo, uniforms(n, 5, 4), scene=scene)
        f = driver("evaluate", at + wo, -wo, s[:3], scene=scene)
    kept = (s[7] == 0) & (s[6] > 0) & (s[2] > 0)
    assert kept.any()
    np.testing.assert_allclose(s[6, kept], f[3, kept], rtol=1e-9)
    np.testing.assert_allclose(s[3:6, kept], f[:3, kept] * s[2, kept] / f[3, kept], rtol=1e-9)


@pytest.mark.parametrize("name", ["two finite", "mask", "two textures"])
def test_eval_and_pdf_are_mitsubas(driver: Driver, name: str) -> None:
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    n = 200
    at, wo, wi = np.vstack([uniforms(n, 1, 2, low=-1), np.zeros(n)]), directions(n, 2), directions(n, 3)
    wo[2], wi[2] = np.abs(wo[2]), np.abs(wi[2])
    body = floor(cases((0.25, 0.75), (0.9, 0.2))[name])
    with driver.scene(body) as scene:
        found = driver("evaluate", at + wo, -wo, wi, scene=scene)
    bsdf = mi.load_string(f'<scene version="3.0.0">{body}</scene>').shapes()[0].bsdf()
    si, context = mi.SurfaceInteraction3f(), mi.BSDFContext()
    for k in range(n):
        si.wi, si.uv = mi.Vector3f(*wo[:, k]), mi.Point2f(*((at[:2, k] + 1) / 2))
        theirs = np.array(bsdf.eval(context, si, mi.Vector3f(*wi[:, k])))
        np.testing.assert_allclose(found[:3, k] * wi[2, k], theirs, rtol=2e-4)
        np.testing.assert_allclose(found[3, k], bsdf.pdf(context, si, mi.Vector3f(*wi[:, k])), rtol=2e-4)
