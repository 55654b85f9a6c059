"""The principled material: what each of its lobes reflects and transmits is Mitsuba's, goes on in the
directions that its density says, and is the same either way round but for η².

Numbers come from the functions of principled.h themselves (sampling.c). Seeds are fixed; all statistical
checks of this file together would raise a false alarm for one choice of seeds in 10⁴ (sampling.py).
"""

from __future__ import annotations

import numpy as np
import pytest
from floors import Sampled, evaluated, mitsubas
from sampling import LEVEL, Array, Driver, cell, chi_squared, directions, nodes, uniforms

COLOUR = '<rgb name="base_color" value="0.8, 0.5, 0.1"/>'
SETS = {
    "as it is": {},
    "metal": {"metallic": 1, "roughness": 0.4, "specular": 0.3},
    "brushed metal": {"metallic": 0.7, "roughness": 0.5, "anisotropic": 0.9, "spec_tint": 0.8},
    "tinted": {"spec_tint": 0.9, "roughness": 0.7, "specular": 1},
    "cloth": {"sheen": 1, "sheen_tint": 0.6, "roughness": 1, "metallic": 0.2},
    "flat": {"flatness": 0.8, "roughness": 0.9, "eta": 0.7},
    "coated": {"clearcoat": 1, "clearcoat_gloss": 0.3, "metallic": 0.5, "eta": 1.8},
    "glass": {"spec_trans": 1, "roughness": 0.5, "eta": 1.5},
    "denser outside": {"spec_trans": 0.8, "roughness": 0.6, "eta": 0.6, "spec_tint": 0.5, "metallic": 0.1},
    "all": {
        "metallic": 0.3, "roughness": 0.6, "anisotropic": 0.5, "spec_trans": 0.4, "spec_tint": 0.7,
        "sheen": 0.5, "sheen_tint": 0.4, "flatness": 0.6, "clearcoat": 0.8, "clearcoat_gloss": 0.6,
        "eta": 1.4, "main_specular_sampling_rate": 0.7, "clearcoat_sampling_rate": 2,
        "diffuse_reflectance_sampling_rate": 0.4,
    },
    "of no index": {"specular": 0, "metallic": 0.5},
    "glass of no index": {"specular": 0, "spec_trans": 0.5},
}  # fmt: skip
GLASS = [name for name, said in SETS.items() if "spec_trans" in said]
each_set = pytest.mark.parametrize("name", SETS)
each_side = pytest.mark.parametrize("side", [1, -1], ids=["outside", "inside"])
each_hemisphere = pytest.mark.parametrize("hemisphere", ["cosine", "uniform"])


def principled(said: dict[str, float], colour: str = COLOUR) -> str:
    numbers = "".join(f'<float name="{name}" value="{value}"/>' for name, value in said.items())
    return f'<bsdf type="principled">{colour}{numbers}</bsdf>'


def random_set(seed: int) -> dict[str, float]:
    """Any values of all of its numbers."""
    draw = np.random.default_rng(seed)
    names = [name for name in SETS["all"] if not name.endswith("rate")]
    said = {name: round(float(draw.random()), 4) for name in names}
    said["roughness"] = round(float(draw.uniform(0.15, 1)), 4)
    said["clearcoat_gloss"] *= 0.8  # above, Mitsuba's single precision has few digits
    said["eta"] = round(float(draw.choice([draw.uniform(0.5, 0.9), draw.uniform(1.1, 2.5)])), 4)
    return said


def on_side(n: int, seed: int, side: int) -> Array:
    d = directions(n, seed)
    d *= side * np.sign(d[2])
    return d[:, np.abs(d[2]) > 0.02]


def both(driver: Driver, bsdf: str, side: int, seed: int, n: int = 300) -> tuple[Array, Array]:
    """Directions of the viewer on a side, and to the light all around, half of them such as are sampled."""
    wo = on_side(n, seed, side)
    wi = directions(wo.shape[1], seed + 1)
    sampled = Sampled(driver, bsdf, wo, uniforms(wo.shape[1], seed + 2, 4)).wi
    wi[:, ::2] = sampled[:, ::2]
    return wo, wi


def agree(driver: Driver, bsdf: str, side: int, seed: int) -> None:
    wo, wi = both(driver, bsdf, side, seed)
    f, pdf, _ = evaluated(driver, bsdf, wo, wi)
    found, density = mitsubas(bsdf, wo, wi)
    if side < 0 and "spec_trans" not in bsdf:
        assert (f == 0).all() and (found == 0).all()  # and no direction is ever asked of it there
        return
    for mine, theirs in ((f * np.abs(wi[2]), found), (pdf, density)):
        none = theirs == 0
        assert (mine[none] == 0).all()
        error = np.abs(mine / np.where(none, 1, theirs) - 1)[~none]
        if error.size:
            assert np.quantile(error, 0.5) < 3e-6 and np.quantile(error, 0.97) < 1e-4, np.quantile(
                error, [0.5, 0.97, 1]
            )


@each_side
@each_set
def test_eval_and_pdf_are_mitsubas(driver: Driver, name: str, side: int) -> None:
    """Of directions all around, and of such as are sampled, to the digits of its single precision."""
    agree(driver, principled(SETS[name]), side, 1)


@pytest.mark.parametrize("seed", range(12))
def test_eval_and_pdf_of_any_numbers_are_mitsubas(driver: Driver, seed: int) -> None:
    for side in (1, -1):
        agree(driver, principled(random_set(seed)), side, 10 * seed + 5)


def sides_of(name: str) -> tuple[int, ...]:
    return (1, -1) if name in GLASS else (1,)


@each_hemisphere
@each_set
def test_the_factor_is_bsdf_times_cosine_over_density(
    driver: Driver, wide: list[Driver], name: str, hemisphere: str
) -> None:
    """Less η², which is apart."""
    bsdf = principled(SETS[name])
    for side in sides_of(name):
        wo = on_side(3000, 4, side)
        u = uniforms(wo.shape[1], 5, 4)
        s = Sampled(driver, bsdf, wo, u, hemisphere=hemisphere)
        f, pdf, factor = evaluated(driver, bsdf, wo, s.wi, hemisphere=hemisphere)
        kept = s.pdf > 0
        reflects = (wo[2] * s.wi[2] > 0)[kept]
        assert (s.factor[:, ~kept] == 0).all() and kept.mean() > 0.4
        assert (name in GLASS) == (not reflects.all())
        np.testing.assert_allclose(s.pdf[kept], pdf[kept], rtol=1e-12)
        np.testing.assert_allclose(s.factor[:, kept], factor[:, kept], rtol=1e-12)
        np.testing.assert_array_equal(s.compression[kept][reflects], 1)
        whole = (f * np.abs(s.wi[2]) / pdf / s.compression)[:, kept]
        np.testing.assert_allclose(s.factor[:, kept], whole, rtol=1e-9)
        two = Sampled(wide[0], bsdf, wo, u, hemisphere=hemisphere)
        np.testing.assert_array_equal(s.factor, two.factor)


LAMP = (
    '<shape type="rectangle"><transform name="to_world"><translate z="50"/></transform><emitter type="area"/>'
)


@each_set
def test_it_is_the_same_either_way_round_but_for_the_index(driver: Driver, name: str) -> None:
    """f(wo, wi) η_i² = f(wi, wo) η_o²; of flux, which light tracing carries, the other way round."""
    bsdf = principled(SETS[name])
    wo = on_side(3000, 6, 1)
    wi = Sampled(driver, bsdf, wo, uniforms(wo.shape[1], 7, 4)).wi
    wi, wo = wi[:, np.isfinite(wi[0])], wo[:, np.isfinite(wi[0])]
    specular = SETS[name].get("specular", 0.5) or 1e-3
    index = np.where(wi[2] < 0, SETS[name].get("eta", 2 / (1 - np.sqrt(0.08 * specular)) - 1), 1)
    there, back = (evaluated(driver, bsdf, a, b)[0] for a, b in ((wo, wi), (wi, wo)))
    front = (wi[2] > 0) | (name in GLASS)
    np.testing.assert_allclose((there * index**2)[:, front], back[:, front], rtol=1e-7, atol=1e-12)
    flux = evaluated(driver, bsdf + "</shape>" + LAMP, wo, wi, estimator="light")[0]
    np.testing.assert_allclose(flux, there * index**2, rtol=1e-12)


@pytest.mark.parametrize("name", ["as it is", "brushed metal", "coated", "glass", "denser outside", "all"])
def test_directions_follow_their_density(driver: Driver, name: str) -> None:
    """χ² over the sphere, z and φ; the lost are a bin of their own, and all together are 1."""
    n, shape, bsdf = 40_000, (16, 12), principled(SETS[name])

    def place(w: Array) -> Array:
        return np.stack([(w[2] + 1) / 2, np.arctan2(w[1], w[0]) / (2 * np.pi) + 0.5])

    at, weights, which = nodes(shape, 24)
    z, phi = 2 * at[0] - 1, 2 * np.pi * (at[1] - 0.5)
    r = np.sqrt(1 - z * z)
    wi = np.stack([r * np.cos(phi), r * np.sin(phi), z])
    for side in sides_of(name):
        wo = np.array([[0.5], [0.3], [side * np.sqrt(1 - 0.34)]])
        s = Sampled(driver, bsdf, wo, uniforms(n, 10, 4))
        kept = s.pdf > 0
        np.testing.assert_allclose(np.linalg.norm(s.wi[:, kept], axis=0), 1, rtol=1e-12)
        counts = np.bincount(cell(place(s.wi[:, kept]), shape), minlength=shape[0] * shape[1])
        pdf = evaluated(driver, bsdf, wo, wi)[1]
        expected = n * np.bincount(which, 4 * np.pi * weights * pdf, minlength=shape[0] * shape[1])
        lost = n - expected.sum()
        assert -1e-3 * n < lost < 0.5 * n
        counts, expected = np.append(counts, n - kept.sum()), np.append(expected, max(lost, 0))
        assert chi_squared(counts, expected) > LEVEL
        wrong = expected * (1 + 0.06 * (-1) ** np.arange(expected.size))
        assert chi_squared(counts, wrong * (n / wrong.sum())) < LEVEL  # it can fail


@pytest.mark.parametrize("name", [one for one in SETS if one != "glass of no index"])
def test_what_is_sampled_adds_up_to_the_formula(driver: Driver, name: str) -> None:
    """∫ f cosθ dω less η² by quadrature of f, and the mean of the factors; not where light goes nearly
    straight on.
    """
    at, weights, _ = nodes((40, 24), 16)
    z, phi = 2 * at[0] - 1, 2 * np.pi * (at[1] - 0.5)
    wi = np.stack([np.sqrt(1 - z * z) * np.cos(phi), np.sqrt(1 - z * z) * np.sin(phi), z])
    bsdf = principled(SETS[name])
    for side in sides_of(name):
        wo = np.array([[0.4], [-0.2], [side * np.sqrt(1 - 0.2)]])
        s = Sampled(driver, bsdf, wo, uniforms(100_000, 11, 4))
        f = evaluated(driver, bsdf, wo, wi)[0]
        through = s.compression[s.compression != 1]
        f = f / np.where(wi[2] * side > 0, 1, through[0] if through.size else 1)
        albedo = 4 * np.pi * (weights * f * np.abs(z)).sum(axis=1)
        for hemisphere, error in (("cosine", 0.01), ("uniform", 0.05)):
            found = Sampled(driver, bsdf, wo, uniforms(100_000, 11, 4), hemisphere=hemisphere).factor
            np.testing.assert_allclose(found.mean(axis=1), albedo, rtol=error)


@each_hemisphere
def test_parts_of_a_blend_add_up(driver: Driver, hemisphere: str) -> None:
    """Of three: each one's albedo, η² included, by its share."""
    parts = [principled(SETS[name]) for name in ("all", "glass", "cloth")]
    inner = f'<bsdf type="blendbsdf"><float name="weight" value="0.5"/>{parts[1]}{parts[2]}</bsdf>'
    blend = f'<bsdf type="blendbsdf"><float name="weight" value="0.6"/>{parts[0]}{inner}</bsdf>'
    wo, wi, n = np.array([[0.6], [0.0], [0.8]]), directions(500, 3), 200_000
    whole = evaluated(driver, blend, wo, wi, hemisphere=hemisphere)
    each = [evaluated(driver, one, wo, wi, hemisphere=hemisphere) for one in parts]
    for mine, theirs in ((whole[0], [e[0] for e in each]), (whole[1], [e[1] for e in each])):
        expected = sum(share * one for share, one in zip((0.4, 0.3, 0.3), theirs, strict=True))
        np.testing.assert_allclose(mine, expected, rtol=1e-9, atol=1e-15)
    s = Sampled(driver, blend, wo, uniforms(n, 12, 4), hemisphere=hemisphere)
    alone = [Sampled(driver, one, wo, uniforms(n, 13, 4), hemisphere=hemisphere) for one in parts]
    means = [(one.factor * one.compression).mean(axis=1) for one in alone]
    expected = sum(share * mean for share, mean in zip((0.4, 0.3, 0.3), means, strict=True))
    np.testing.assert_allclose((s.factor * s.compression).mean(axis=1), expected, rtol=0.02)


SHARES = ("roughness", "anisotropic", "metallic", "spec_trans", "spec_tint", "sheen", "sheen_tint",
          "flatness", "clearcoat")  # fmt: skip


@pytest.mark.parametrize("name", SHARES)
def test_a_texture_may_stand_for_a_number_as_in_mitsuba(driver: Driver, name: str) -> None:
    """A checkerboard's mean over channels, its colours the other way round than as a reflectance's."""
    said = {**SETS["all"]}
    value = said.pop(name)
    board = (
        f'<texture type="checkerboard" name="{name}"><rgb name="color0" value="0.9, 0.2, 0.4"/>'
        f'<float name="color1" value="{value}"/></texture>'
    )
    wo, wi = both(driver, principled(SETS["all"]), 1, 3)
    textured = principled(said, COLOUR + board)
    f, pdf, _ = evaluated(driver, textured, wo, wi)
    found, density = mitsubas(textured, wo, wi)  # at u = v = 0
    for mine, theirs in ((f * np.abs(wi[2]), found), (pdf, density)):
        np.testing.assert_allclose(np.quantile(np.abs(mine - theirs) / (theirs + 1e-3), 0.97), 0, atol=1e-4)


@pytest.mark.parametrize("colour", ['<rgb {} value="0.9, 0.2, 0.1"/>', '<spectrum {} value="0.4"/>'])
@pytest.mark.parametrize("name", SHARES)
def test_a_colour_that_stands_for_a_number_is_its_mean(driver: Driver, name: str, colour: str) -> None:
    said = {one: value for one, value in SETS["all"].items() if one != name}
    coloured = principled(said, COLOUR + colour.format(f'name="{name}"'))
    agree(driver, coloured, 1, 3)
    wo, wi = on_side(300, 3, 1), directions(300, 4)[:, : on_side(300, 3, 1).shape[1]]
    for mine, number in zip(
        evaluated(driver, coloured, wo, wi),
        evaluated(driver, principled({**said, name: 0.4}), wo, wi),
        strict=True,
    ):
        np.testing.assert_allclose(mine, number, rtol=1e-12)


@pytest.mark.parametrize("roughness", [0, 1e-3, 1])
def test_there_is_a_finite_number_everywhere(driver: Driver, wide: list[Driver], roughness: float) -> None:
    cosine = np.concatenate([10.0 ** np.linspace(-12, -3, 300), np.linspace(1e-3, 1, 300)])
    u = uniforms(600, 13, 4)
    u[:, :100] = 1e-9
    for name in SETS:
        bsdf = principled({**SETS[name], "roughness": roughness})
        for side in sides_of(name):
            wo = np.stack([np.sqrt((1 - cosine) * (1 + cosine)), 0 * cosine, side * cosine])
            for one in (driver, *wide):
                s = Sampled(one, bsdf, wo, u)
                assert np.isfinite(s.wi).all() and np.isfinite(s.pdf).all()
                assert ((s.factor >= 0) & (s.factor < 1e6)).all()
                for wi in (wo, -wo, wo * [[-1], [-1], [1]], np.array([[0.0], [0], [1]]) + 0 * wo):
                    assert all(np.isfinite(a).all() for a in evaluated(one, bsdf, wo, wi))
