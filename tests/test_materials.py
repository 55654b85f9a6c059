"""Materials reflect no more light than they get and the same either way round, and go on in the directions
that their density says; glass follows Snell and Fresnel.

Numbers come from the functions of material.h themselves (sampling.c). Seeds are fixed; all statistical checks
of this file together would raise a false alarm for one choice of seeds in 10⁴ (sampling.py).
"""

from __future__ import annotations

from decimal import Decimal, localcontext

import numpy as np
import pytest
from charts import Cone
from sampling import LEVEL, Array, Driver, cell, chi_squared, column, directions, jacobian, uniforms


def diffuse(r: float, g: float, b: float) -> str:
    return f'<bsdf type="diffuse"><rgb name="reflectance" value="{r}, {g}, {b}"/></bsdf>'


def mirror(r: float, g: float, b: float) -> str:
    none = '<string name="material" value="none"/>'
    colour = f'<rgb name="specular_reflectance" value="{r}, {g}, {b}"/>'
    return f'<bsdf type="conductor">{none}{colour}</bsdf>'


def blend(weight: float, first: str, second: str) -> str:
    return f'<bsdf type="blendbsdf"><float name="weight" value="{weight}"/>{first}{second}</bsdf>'


def twosided(bsdf: str) -> str:
    return f'<bsdf type="twosided">{bsdf}</bsdf>'


GLASS = (
    '<bsdf type="dielectric"><float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/>'
    '<rgb name="specular_reflectance" value="0.9, 1, 0.8"/>'
    '<rgb name="specular_transmittance" value="0.7, 0.9, 1"/></bsdf>'
)
GOLD_ETA, GOLD_K = np.array([0.14, 0.37, 1.44]), np.array([3.98, 2.38, 1.6])
GOLD = (
    '<bsdf type="conductor"><rgb name="eta" value="0.14, 0.37, 1.44"/><rgb name="k" value="3.98, 2.38, 1.6"/>'
    '<rgb name="specular_reflectance" value="1, 0.9, 0.8"/></bsdf>'
)
MIXED = blend(0.3, diffuse(0.8, 0.3, 0.2), blend(0.25, mirror(0.9, 0.8, 0.7), diffuse(0.1, 0.6, 0.5)))
# name: bsdf, and its parts in the order of the rows: (share, reflectance), None where it depends on the angle
MATERIALS = {
    "diffuse": (twosided(diffuse(0.7, 0.2, 1.0)), [(1.0, (0.7, 0.2, 1.0))]),
    "mirror": (twosided(mirror(0.9, 1.0, 0.3)), [(1.0, (0.9, 1.0, 0.3))]),
    "gold": (twosided(GOLD), [(1.0, None)]),
    "glass": (GLASS, [(1.0, None)]),
    "mixed": (
        twosided(MIXED),
        [(0.775, np.dot([0.7, 0.075], [[0.8, 0.3, 0.2], [0.1, 0.6, 0.5]]) / 0.775), (0.225, (0.9, 0.8, 0.7))],
    ),
    "mirrors": (
        twosided(blend(0.4, mirror(0.9, 0.8, 0.7), blend(0.5, mirror(0.3, 0.2, 0.1), GOLD))),
        [(0.6, (0.9, 0.8, 0.7)), (0.2, (0.3, 0.2, 0.1)), (0.2, None)],
    ),
    "everything": (
        blend(0.5, blend(0.6, GLASS, diffuse(0.9, 0.9, 0.9)), blend(0.1, MIXED, mirror(1, 1, 1))),
        [
            (0.64875, np.dot([0.3, 0.315, 0.03375], [[0.9] * 3, [0.8, 0.3, 0.2], [0.1, 0.6, 0.5]]) / 0.64875),
            (0.2, None),
            (0.10125, (0.9, 0.8, 0.7)),
            (0.05, (1, 1, 1)),
        ],
    ),
}
NORMAL = column((np.sin(np.radians(30)), 0, np.cos(np.radians(30))))  # of the squares below
PLACE = '<scale value="0.5"/><rotate y="1" angle="30"/><translate x="{}"/>'
BODY = "".join(
    f'<shape type="rectangle"><transform name="to_world">{PLACE.format(4 * i)}</transform>{bsdf}</shape>'
    for i, (bsdf, _) in enumerate(MATERIALS.values())
)
each = pytest.mark.parametrize("name", MATERIALS)
each_hemisphere = pytest.mark.parametrize("hemisphere", ["uniform", "cosine"])


class Scattered:
    """What a square of this material does with rays from wo (3, n), given u (4, n)."""

    def __init__(self, driver: Driver, name: str, wo: Array, u: Array, **technique) -> None:
        at = column((4 * list(MATERIALS).index(name), 0, 0))
        with driver.scene(BODY, **technique) as scene:
            out = driver("scatter", at + wo, -wo, u, scene=scene)
        assert (out[20] == 1).all()
        self.wi, self.factor, self.pdf = out[:3], out[3:6], out[6]
        self.specular, self.compression, self.normal = out[7] == 1, out[8], out[9:12]
        self.brdf, self.pdf_w, self.factor_diffuse, self.row = out[12:15], out[15], out[16:19], out[19]
        self.cos_o, self.cos_i = (self.normal * wo).sum(axis=0), (self.normal * self.wi).sum(axis=0)


def viewers(n: int, seed: int, side: int = 1) -> Array:
    """Directions on one side of the squares."""
    d = directions(n, seed)
    return d * np.sign((NORMAL * d).sum(axis=0)) * side


# ---- diffuse, and the diffuse part of a blend


@each_hemisphere
@pytest.mark.parametrize("side", [1, -1], ids=["front", "back"])
@pytest.mark.parametrize("name", ["diffuse", "mixed"])
def test_diffuse_directions_follow_their_density(
    driver: Driver, name: str, side: int, hemisphere: str
) -> None:
    """cosθ/π or 1/2π about the normal on the viewer's side, times the share of the diffuse part."""
    u = uniforms(100_000, 1, 4)
    s = Scattered(driver, name, viewers(1, 2, side), u, hemisphere=hemisphere)
    share, part = MATERIALS[name][1][0][0], ~s.specular
    np.testing.assert_allclose(s.normal[:, :1], NORMAL * side, rtol=1e-14)
    shape = s.cos_i / np.pi if hemisphere == "cosine" else np.full(u.shape[1], 0.5 / np.pi)
    np.testing.assert_allclose(s.pdf[part], share * shape[part], rtol=1e-12)
    np.testing.assert_allclose(s.pdf_w[part], s.pdf[part], rtol=1e-12)
    z, angle = Cone((NORMAL * side).ravel(), 2).places(s.wi[:, part])
    height = 1 - 2 * z
    assert (height > 0).all()
    even = height**2 if hemisphere == "cosine" else height
    counts = np.bincount(cell(np.stack([even, angle]), (20, 20)), minlength=400)
    assert chi_squared(counts, np.full(400, part.sum() / 400)) > LEVEL
    wrong = height if hemisphere == "cosine" else height**2
    counts = np.bincount(cell(np.stack([wrong, angle]), (20, 20)), minlength=400)
    assert chi_squared(counts, np.full(400, part.sum() / 400)) < LEVEL  # the check can fail


@each_hemisphere
@pytest.mark.parametrize("name", ["diffuse", "mixed", "everything"])
def test_the_factor_is_brdf_times_cosine_over_density(driver: Driver, name: str, hemisphere: str) -> None:
    u = uniforms(20_000, 3, 4)
    s = Scattered(driver, name, viewers(20_000, 4), u, hemisphere=hemisphere)
    part = ~s.specular
    expected = s.brdf * s.cos_i / s.pdf_w
    np.testing.assert_allclose(s.factor[:, part], expected[:, part], rtol=1e-12)
    np.testing.assert_allclose(s.factor_diffuse[:, part], expected[:, part], rtol=1e-12)
    share, reflectance = MATERIALS[name][1][0]
    np.testing.assert_allclose(
        s.brdf, np.broadcast_to(column(reflectance) * share / np.pi, s.brdf.shape), rtol=1e-14
    )


@pytest.mark.parametrize("name", ["diffuse", "mixed", "everything"])
def test_diffuse_reflection_is_the_same_either_way_round(driver: Driver, name: str) -> None:
    """f_r(wi, wo) = f_r(wo, wi)."""
    u, wo = uniforms(2000, 5, 4), viewers(2000, 6)
    there = Scattered(driver, name, wo, u)
    up = ~there.specular & (there.cos_i > 1e-3)
    back = Scattered(driver, name, there.wi[:, up], u[:, up])
    np.testing.assert_array_equal(back.brdf, there.brdf[:, up])


# ---- energy


def reflectance_of(name: str, part: int, cosine: float) -> Array:
    """What all of a part's light together is, at this cosine: closed forms."""
    _, reflectance = MATERIALS[name][1][part]
    if reflectance is not None:
        return np.array(reflectance)
    if name == "glass" or (name == "everything" and part == 1):
        r = 1 - exact_fresnel(cosine, 1 / 1.5)[1]
        return r * np.array([0.9, 1, 0.8]) + (1 - r) * np.array([0.7, 0.9, 1])
    return complex_fresnel(np.full(3, cosine), GOLD_ETA, GOLD_K) * [1, 0.9, 0.8]


@each
@each_hemisphere
@pytest.mark.parametrize("cosine", [1.0, 0.6, 1e-3])
def test_no_material_gives_more_light_than_it_gets(
    driver: Driver, name: str, hemisphere: str, cosine: float
) -> None:
    """A white furnace: the mean of the factor is Σ share · reflectance, at most 1."""
    sine = np.sqrt((1 - cosine) * (1 + cosine))
    wo = NORMAL * cosine + column((0, 1, 0)) * sine
    first, part = ((np.indices((500, 1000)).reshape(2, -1).T + 0.5) / [500, 1000]).T
    u = np.stack([first, np.full(first.size, 0.3), np.full(first.size, 0.5), part])
    found = Scattered(driver, name, wo, u, hemisphere=hemisphere).factor.mean(axis=1)
    parts = MATERIALS[name][1]
    truth = sum(share * reflectance_of(name, k, cosine) for k, (share, _) in enumerate(parts))
    np.testing.assert_allclose(found, truth, atol=3e-3)
    assert (found <= 1 + 1e-12).all()


@each
def test_each_part_of_a_blend_is_taken_as_often_as_its_share(driver: Driver, name: str) -> None:
    n, parts = 100_000, MATERIALS[name][1]
    u = np.vstack([np.full((3, n), 0.4), (np.arange(n) + 0.5) / n])
    s = Scattered(driver, name, viewers(1, 7), u)
    rows, counts = np.unique(s.row, return_counts=True)
    np.testing.assert_allclose(counts / n, [share for share, _ in parts], atol=3 / n)
    assert rows.size == len(parts)
    first_is_diffuse = name in ("diffuse", "mixed", "everything")
    np.testing.assert_array_equal(s.specular, (s.row != rows[0]) | (not first_is_diffuse))


# ---- mirrors and metals


@pytest.mark.parametrize("name", ["mirror", "gold", "mirrors"])
def test_a_mirror_reflects_about_the_normal(driver: Driver, name: str) -> None:
    for side in (1, -1):
        wo = viewers(5000, 8, side)
        s = Scattered(driver, name, wo, uniforms(5000, 9, 4))
        np.testing.assert_allclose(s.wi, 2 * NORMAL * (NORMAL * wo).sum(axis=0) - wo, atol=4e-16)
        assert s.specular.all()
        assert (s.factor >= 0).all()
        assert (s.factor <= 1).all()


def test_a_metal_reflects_by_fresnel_in_each_channel(driver: Driver) -> None:
    s = Scattered(driver, "gold", viewers(5000, 10), uniforms(5000, 11, 4))
    truth = complex_fresnel(s.cos_o, GOLD_ETA[:, None], GOLD_K[:, None]) * column([1, 0.9, 0.8])
    np.testing.assert_allclose(s.factor, truth, rtol=1e-12)


def complex_fresnel(c: Array, eta: Array, k: Array) -> Array:
    """Reflectance of a conductor for unpolarised light, by complex numbers of extended precision."""
    c, n = (
        np.asarray(c, dtype=np.longdouble),
        np.asarray(eta, np.longdouble) + 1j * np.asarray(k, np.longdouble),
    )
    beyond = np.sqrt(n * n - (1 - c) * (1 + c))
    s, p = (c - beyond) / (c + beyond), (n * n * c - beyond) / (n * n * c + beyond)
    return ((np.abs(s) ** 2 + np.abs(p) ** 2) / 2).astype(np.float64)


@pytest.mark.parametrize(
    ("eta", "k", "error"),
    [(0.14, 3.98, 3e-15), (1.44, 1.6, 1e-15), (0.05, 20.0, 2e-14), (3.0, 0.5, 1e-15), (1.5, 0.0, 4e-15)],
)
def test_fresnel_of_conductors(driver: Driver, eta: float, k: float, error: float) -> None:
    """Against complex numbers, from grazing to normal; with k = 0 the dielectric's."""
    c = np.concatenate([10.0 ** np.linspace(-12, 0, 200), np.linspace(0.01, 1, 200)])
    found = driver("conductor", c, eta, k)[0]
    np.testing.assert_allclose(found, complex_fresnel(c, eta, k), rtol=error)
    assert found[199] == pytest.approx(((eta - 1) ** 2 + k**2) / ((eta + 1) ** 2 + k**2), rel=1e-14)
    if k == 0:
        np.testing.assert_allclose(found, 1 - driver("dielectric", c, 1 / eta)[1], rtol=error, atol=4e-16)


def test_fresnel_of_conductors_is_no_nan_and_at_most_one(driver: Driver) -> None:
    eta, k, c = (a.ravel() for a in np.meshgrid([1e-6, 0.1, 1, 1 + 1e-9, 1000], [0, 1e-9, 1, 1000], COSINES))
    found = driver("conductor", c, eta, k)[0]
    assert ((found >= 0) & (found <= 1 + 1e-15)).all()


# ---- glass

COSINES = np.array([0, 5e-324, 1e-300, 1e-20, 1e-16, 1e-9, 1e-7, 1e-3, 0.5, 1 - 1e-16, 1])


def exact_fresnel(c: float, ratio: float) -> tuple[float, float]:
    """Cosine beyond and transmittance, worked out with 60 digits from the numbers as they are."""
    with localcontext() as context:
        context.prec = 60
        c, ratio = Decimal(float(c)), Decimal(float(ratio))
        square = 1 - ratio**2 * (1 - c**2)
        if square <= 0:
            return 0.0, 0.0
        beyond = square.sqrt()
        s, p = (ratio * c - beyond) / (ratio * c + beyond), (ratio * beyond - c) / (ratio * beyond + c)
        return float(beyond), float(1 - (s * s + p * p) / 2)


def exact(c: Array, ratio: float) -> Array:
    """Cosines beyond and transmittances, (2, n)."""
    return np.array([exact_fresnel(each, ratio) for each in c]).T


@pytest.mark.parametrize("ratio", [1 / 1.5, 1 / 1.33, 1 / 2.4, 1 / 1.0001, 1 / (1 + 1e-7), 1e-3])
def test_fresnel_from_the_outside_is_exact(driver: Driver, ratio: float) -> None:
    """To the last digits of what goes through, from cos 1e-15 to 1: 1 - reflectance has none left there."""
    c = 10.0 ** np.linspace(-15, 0, 400)
    beyond, transmittance = exact(c, ratio)
    found = driver("dielectric", c, ratio)
    np.testing.assert_allclose(found[0], beyond, rtol=5e-16)
    np.testing.assert_allclose(found[1], transmittance, rtol=2e-15)


@pytest.mark.parametrize("ratio", [1.5, 1.33, 2.4, 1.0001])
def test_fresnel_near_total_reflection(driver: Driver, ratio: float) -> None:
    """From the inside, a share δ above the critical cosine, what goes through: 1e-15/δ of it down to 1e-12;
    below it, down to the last digits, nothing."""
    critical = np.sqrt((ratio - 1) * (ratio + 1)) / ratio
    delta = 10.0 ** np.linspace(-12, 0, 300)
    c = np.minimum(critical * (1 + delta), 1)
    found, truth = driver("dielectric", c, ratio)[1], exact(c, ratio)[1]
    assert (np.abs(found / truth - 1) <= 1e-15 / delta + 3e-15).all()
    c = critical * (1 - 10.0 ** np.linspace(-11, 0, 200))
    np.testing.assert_array_equal(driver("dielectric", c, ratio), 0)


@pytest.mark.parametrize("ratio", [1 / 1.5, 1 / 2.4, 1.0001, 1.5, 2.4])
def test_fresnel_in_closed_form(driver: Driver, ratio: float) -> None:
    """((n-1)/(n+1))² at normal incidence; no p-polarised light at Brewster's angle, tanθ = n: there
    R = ((n² - 1)/(n² + 1))²/2; nothing through at grazing incidence."""
    n = 1 / ratio
    brewster = 1 / np.sqrt(1 + n**2)
    found = 1 - driver("dielectric", np.array([1, brewster, 0, 1e-12]), ratio)[1]
    assert found[0] == pytest.approx(((n - 1) / (n + 1)) ** 2, rel=1e-11)
    assert found[1] == pytest.approx(((n**2 - 1) / (n**2 + 1)) ** 2 / 2, rel=1e-11)
    assert found[2] == 1
    assert found[3] == pytest.approx(1, abs=1e-9)


def test_no_boundary_reflects_between_equal_indices(driver: Driver) -> None:
    c = COSINES[COSINES > 1e-150]  # the square of a smaller cosine is 0
    found = driver("dielectric", c, 1.0)
    np.testing.assert_array_equal(found[0], c)
    np.testing.assert_array_equal(found[1], 1)


def test_fresnel_is_no_nan_and_at_most_one(driver: Driver) -> None:
    """At grazing incidence and around the critical angle, by single steps of the last digit."""
    for ratio in (1e-3, 1 / 1.5, np.nextafter(1, 0), 1.0, np.nextafter(1, 2), 1.0001, 1.5, 2.4, 1000.0):
        critical = np.sqrt(max(1 - 1 / ratio**2, 0))
        steps = critical + np.arange(-20, 21) * np.spacing(critical)
        found = driver("dielectric", np.clip(np.concatenate([COSINES, steps]), 0, 1), ratio)
        assert ((found >= 0) & (found <= 1 + 4e-16)).all(), ratio


def test_fresnel_is_the_same_from_both_sides(driver: Driver) -> None:
    """T(c, η) = T(c', 1/η) for the cosine c' of the refracted ray: the reciprocity of glass."""
    c = uniforms(5000, 12, 1)
    for ratio in (1 / 1.5, 1 / 2.4):
        beyond, there, _ = driver("dielectric", c, ratio)
        again, back, _ = driver("dielectric", beyond, 1 / ratio)
        np.testing.assert_allclose(1 - back, 1 - there, rtol=1e-10)
        np.testing.assert_allclose(again, c[0], atol=1e-13 / c[0].min())


def test_schlick_is_an_approximation(driver: Driver) -> None:
    """Exact at normal incidence and in total reflection. For n = 1.5, from either side, it is too bright by
    up to 0.0357, at cos 0.088 on the side of the smaller index, and too dark by up to 0.0196."""
    c = np.linspace(0, 1, 20_001)
    for ratio in (1 / 1.5, 1.5):
        beyond, truth, schlick = driver("dielectric", c, ratio)
        truth, schlick = 1 - truth, 1 - schlick
        assert schlick[-1] == pytest.approx(truth[-1], rel=1e-14)
        assert ((schlick == 1) == (truth == 1)).all()
        excess = schlick - truth
        assert 0.0356 < excess.max() < 0.0358
        assert -0.0197 < excess.min() < -0.0196
        assert np.where(ratio > 1, beyond, c)[excess.argmax()] == pytest.approx(0.088, abs=0.001)


@pytest.mark.parametrize("side", [1, -1], ids=["into", "out"])
def test_glass_refracts_by_snell(driver: Driver, side: int) -> None:
    """In the plane of wo and the normal, η_o sinθ_o = η_i sinθ_i, a unit vector; or it reflects."""
    wo, ratio = viewers(20_000, 13, side), 1 / 1.5 if side > 0 else 1.5
    u = uniforms(20_000, 14, 4)
    s = Scattered(driver, "glass", wo, u)
    through = s.cos_i < 0
    np.testing.assert_allclose(np.linalg.norm(s.wi, axis=0), 1, rtol=4e-15)
    tangents = s.wi - s.normal * s.cos_i, wo - s.normal * s.cos_o
    np.testing.assert_allclose(tangents[0][:, through], -ratio * tangents[1][:, through], atol=2e-15)
    mirrored = 2 * s.normal * s.cos_o - wo
    np.testing.assert_allclose(s.wi[:, ~through], mirrored[:, ~through], atol=1e-15)
    total = s.cos_o < np.sqrt(max(1 - 1 / ratio**2, 0))
    assert not through[total].any()
    assert total.any() == (side < 0)


@pytest.mark.parametrize("schlick", [False, True], ids=["exact", "schlick"])
@pytest.mark.parametrize("side", [1, -1], ids=["into", "out"])
def test_glass_reflects_or_refracts(driver: Driver, side: int, schlick: bool) -> None:
    """R + T = 1: it reflects exactly where u is below R, else refracts, each by its own colour."""
    wo, ratio = viewers(20_000, 15, side), 1 / 1.5 if side > 0 else 1.5
    cosine = np.abs((NORMAL * wo).sum(axis=0))
    reflectance = 1 - driver("dielectric", cosine, ratio)[2 if schlick else 1]
    for shift, reflects in ((-1e-9, True), (1e-9, False)):
        first = reflectance + shift
        within = (first > 0) & (first < 1)
        u = np.vstack([first[within], np.full((3, within.sum()), 0.5)])
        s = Scattered(driver, "glass", wo[:, within], u, schlick=schlick)
        assert ((s.cos_i > 0) == reflects).all()
        colour = column((0.9, 1, 0.8) if reflects else (0.7, 0.9, 1))
        np.testing.assert_array_equal(s.factor, np.broadcast_to(colour, s.factor.shape))


@pytest.mark.parametrize("side", [1, -1], ids=["into", "out"])
def test_radiance_is_compressed_as_solid_angles_are(driver: Driver, side: int) -> None:
    """L/η² is kept: radiance gains (η_o/η_i)² = cosθ_i dω_i / (cosθ_o dω_o), by finite differences; and
    nothing where the light is reflected."""
    wo_of = Cone((NORMAL * side).ravel(), 2)
    places = uniforms(5000, 16, low=0.02, high=0.1 if side < 0 else 0.45)
    u = np.full((4, 1), 1 - 1e-12)

    def refracted(at: Array) -> Array:
        return Scattered(driver, "glass", wo_of.directions(at)[0], u).wi

    wo, size = wo_of.directions(places)
    s = Scattered(driver, "glass", wo, u)
    assert (s.cos_i < 0).all()
    compression = -s.cos_i * jacobian(refracted, places) / (s.cos_o * size)
    np.testing.assert_allclose(s.compression, compression, rtol=1e-6)
    np.testing.assert_allclose(s.compression, 1.5 ** (-2 * side), rtol=1e-15)
    back = Scattered(driver, "glass", s.wi, u)
    np.testing.assert_allclose(back.compression * s.compression, 1, rtol=1e-15)
    np.testing.assert_allclose(back.wi, wo, atol=1e-14)
    reflected = Scattered(driver, "glass", wo, np.full((4, 1), 1e-12))
    assert (reflected.compression == 1).all()


@pytest.mark.parametrize("name", ["glass", "everything", "mirrors"])
def test_grazing_rays_give_directions_all_the_same(driver: Driver, name: str) -> None:
    """No NaN, no more than one, and a unit vector, with the viewer in the surface but for the last digits."""
    cosine = 10.0 ** np.linspace(-12, -3, 2000)
    for side in (1, -1):
        wo = side * NORMAL * cosine + column((0, 1, 0)) * np.sqrt((1 - cosine) * (1 + cosine))
        s = Scattered(driver, name, wo, uniforms(2000, 17, 4))
        np.testing.assert_allclose(np.linalg.norm(s.wi, axis=0), 1, rtol=1e-12)
        assert ((s.factor >= 0) & (s.factor <= 1.5)).all()


# ---- lanes and precision


@each
def test_lanes_and_single_precision_scatter_the_same(driver: Driver, wide: list[Driver], name: str) -> None:
    """The same bits from two lanes; in single precision the same but where it takes another branch."""
    wo = viewers(1999, 18)
    wo = wo[:, np.abs((NORMAL * wo).sum(axis=0)) > 0.05]
    u = uniforms(wo.shape[1], 19, 4)
    one, double, single = (Scattered(made, name, wo, u) for made in (driver, *wide))
    for field in ("wi", "factor", "pdf", "specular", "compression", "row"):
        np.testing.assert_array_equal(getattr(double, field), getattr(one, field))
        near = np.isclose(getattr(single, field), getattr(one, field), rtol=1e-5, atol=1e-5)
        assert near.mean() > 0.995, field
