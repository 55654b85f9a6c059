"""Each sample follows its density, each density is one over the Jacobian of its map and has the integral 1:
directions, points of lights, the choice of a light, light paths, and the camera.

Numbers come from the functions of the tracer's headers themselves (sampling.c); what they ought to be, from
charts.py and closed forms. Seeds are fixed; all statistical checks of this file together would raise a false
alarm for one choice of seeds in 10⁴.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import mpmath
import numpy as np
import pytest
from building import ROOT
from charts import Ball, Cone, Flat, sphere_cone, turn
from mpmath import mp, mpf
from numpy.typing import ArrayLike
from sampling import (
    CHECKS,
    LEVEL,
    Array,
    Driver,
    cell,
    chi_squared,
    column,
    directions,
    jacobian,
    mean_p,
    nodes,
    uniforms,
)

SAMPLES = 100_000
checks = 0


def plausible(p: float) -> bool:
    """One of the statistical checks that share the false-alarm rate."""
    global checks
    checks += 1
    assert checks <= CHECKS, "more checks than the false-alarm rate was shared among"
    return p > LEVEL


# ---- lanes/sample.h

# name: least z, greatest z, column of the entry `densities`, extent
MAPS = {
    "hemisphere_uniform": (0.0, 1.0, 0, 1.0),
    "hemisphere_cosine": (0.0, 1.0, 1, 1.0),
    "sphere": (-1.0, 1.0, 2, 1.0),
    "cone-2": (-1.0, 1.0, 3, 2.0),
    "cone-0.5": (0.5, 1.0, 3, 0.5),
    "cone-1e-3": (0.999, 1.0, 3, 1e-3),
    "cone-1e-12": (None, 1.0, 3, 1e-12),
    "cone-1e-30": (None, 1.0, 3, 1e-30),
}


def across(name: str, d: Array) -> Array:
    """Directions (3, n) by 1 - z, in shares of all that the map may give, and azimuth."""
    least, greatest, _, extent = MAPS[name]
    width = greatest - least if least is not None else extent
    rr = d[0] ** 2 + d[1] ** 2
    x = np.where(d[2] > 0, rr / (1 + np.abs(d[2])), 1 - d[2])
    return np.stack([x / width, turn(d[1], d[0])])


def map_p(driver: Driver, name: str, density: int) -> float:
    """p-value of "the map's directions have this density", by 32 × 16 bins of 1 - z and azimuth."""
    shape, extent = (32, 16), MAPS[name][3]
    d = driver(name.split("-")[0], uniforms(SAMPLES, 1), extent)
    places, weights, bins = nodes(shape, 4)
    width = MAPS[name][1] - MAPS[name][0] if MAPS[name][0] is not None else extent
    pdf = driver("densities", 1 - places[0] * width, extent)[density]
    expected = np.bincount(bins, pdf * weights * 2 * np.pi * width)
    np.testing.assert_allclose(expected.sum(), 1, rtol=1e-12, err_msg="the integral of the density")
    counts = np.bincount(cell(across(name, d[:3]), shape), minlength=expected.size)
    return chi_squared(counts, SAMPLES * expected)


@pytest.mark.parametrize("name", MAPS)
def test_directions_follow_their_density(driver: Driver, name: str) -> None:
    assert plausible(map_p(driver, name, MAPS[name][2]))


def test_the_wrong_density_is_noticed(driver: Driver) -> None:
    """The uniform hemisphere does not pass for the cosine-weighted one, nor the other way round."""
    assert map_p(driver, "hemisphere_uniform", 1) < LEVEL
    assert map_p(driver, "hemisphere_cosine", 0) < LEVEL


AREAS = {
    "square": Flat("rectangle", (0, 0, 0), (1, 0, 0), (0, 1, 0)),
    "disk": Flat("disk", (0, 0, 0), (1, 0, 0), (0, 1, 0)),
    "triangle": Flat("triangle", (-1 / 3, -1 / 3, 0), (1, 0, 0), (0, 1, 0)),
}


@pytest.mark.parametrize("name", AREAS)
def test_points_fill_their_shape_evenly(driver: Driver, name: str) -> None:
    chart, shape = AREAS[name], (20, 20)
    counts = np.bincount(cell(chart.of_points(driver(name, uniforms(SAMPLES, 2))[:3]), shape), minlength=400)
    assert plausible(chi_squared(counts, np.full(400, SAMPLES / 400)))


@pytest.mark.parametrize("name", [*MAPS, *AREAS])
def test_the_density_is_one_over_the_jacobian(driver: Driver, name: str) -> None:
    entry, extent = name.split("-")[0], MAPS.get(name, (0, 0, 0, 1.0))[3]
    places = uniforms(2000, 3, low=0.02, high=0.98)
    pdf = driver(entry, places, extent)[3]
    size = jacobian(lambda at: driver(entry, at, extent)[:3], places)
    np.testing.assert_allclose(pdf * size, 1, rtol=2e-7)


@pytest.mark.parametrize("extent", [2.0, 1.0, 1e-3, 1e-8, 1e-16, 1e-30, 1e-100])
def test_cones_keep_their_digits_however_narrow(driver: Driver, extent: float) -> None:
    """sin²θ = x (2 - x) with x = u extent, to the last digits, and a unit vector."""
    u, v = uniforms(2000, 4)
    d = driver("cone", u, v, extent)
    x = u * extent
    np.testing.assert_allclose(d[0] ** 2 + d[1] ** 2, x * (2 - x), rtol=2e-15)
    np.testing.assert_allclose(np.linalg.norm(d[:3], axis=0), 1, rtol=1e-15)
    np.testing.assert_allclose(d[3] * 2 * np.pi * extent, 1, rtol=1e-15)


# ---- emitters/area.h: one light and a point that it shines on

FLOOR = '<shape type="disk"><transform name="to_world"><translate z="-1000"/></transform></shape>'
EMITTER = '<emitter type="area"><rgb name="radiance" value="1"/></emitter>'


def shape(kind: str, transform: str = "", properties: str = "") -> str:
    """An area light of radiance 1, apart from a surface far below for it to shine on."""
    place = f'<transform name="to_world">{transform}</transform>'
    return f'{FLOOR}<shape type="{kind}">{place}{properties}{EMITTER}</shape>'


def ball(x: float, y: float, z: float, radius: float, more: str = "") -> str:
    center = f'<point name="center" x="{x}" y="{y}" z="{z}"/><float name="radius" value="{radius!r}"/>'
    return shape("sphere", "", center + more)


INWARDS = '<boolean name="flip_normals" value="true"/>'
SKY = FLOOR + '<emitter type="constant"><rgb name="radiance" value="1"/></emitter>'
PANEL = shape("rectangle", '<scale x="0.6" y="0.9"/><rotate x="1" angle="180"/><translate x="0.2" z="2"/>')
PANEL_CHART = Flat("rectangle", (0.2, 0, 2), (0.6, 0, 0), (0, -0.9, 0))
MATRIX = '<matrix value="0.5 {} 0 0.3  0.1 -0.6 0 -0.2  0 0.2 -1 1.5  0 0 0 1"/>'
# Columns x and y of these matrices at a right angle, and not.
SQUARE, SHEARED = MATRIX.format("0.12"), MATRIX.format("0.3")


def tilted(kind: str, slant: float) -> Flat:
    return Flat(kind, (0.3, -0.2, 1.5), (0.5, 0.1, 0), (slant, -0.6, 0.2))


# Two triangles, of which the second is looked at.
PANE = shape("obj", "", f'<string name="filename" value="{ROOT}/tests/meshes/pane.obj"/>')
PANES = [
    Flat("triangle", (0.8, -0.7, 1.6), (-1.4, 0.4, 0.4), (-1.3, 1.6, 0.2)),
    Flat("triangle", (0.8, -0.7, 1.6), (-1.3, 1.6, 0.2), (-0.1, 1.2, -0.1)),
]
CUBE = shape("cube", '<scale value="0.4"/><translate x="0.1" y="0.2" z="1.5"/>')


@dataclass(frozen=True)
class Case:
    """A light, how points of it are sampled, the eye that it is sampled for, and what that sees of it."""

    name: str
    scene: str
    points: str
    chart: Flat | Ball | Cone
    normal: ArrayLike = (0, 0, 1)
    eye: ArrayLike = (0, 0, 0)
    wasted: float = 0.0
    """The chance of a point whose front is not seen."""
    light: int = 0
    order: int = 6
    """Gauss–Legendre nodes per bin and axis."""
    on_light: bool = False
    jacobian: float = 1e-6
    """Relative error of the finite differences."""

    def receiver(self, driver: Driver, scene: int) -> list[ArrayLike]:
        slot = driver.light_slot(scene, self.light) if self.on_light else -1
        return [column(self.eye), column(self.normal) / np.linalg.norm(self.normal), slot]

    def sample(self, driver: Driver, scene: int, places: Array) -> Array:
        """(wi, distance, weight, 1/pdf_w, slot), (9, n)."""
        return driver("light_sample", *self.receiver(driver, scene), self.light, places, scene=scene)

    def hit(self, driver: Driver, scene: int, to: Array) -> Array:
        """(light, distance, cosine, 1/pdf_w), (4, n): what multiple importance sampling weighs a hit by."""
        if isinstance(self.chart, Cone) and self.scene == SKY:
            return np.broadcast_to(np.array([[0.0], [0.0], [1.0], [4 * np.pi]]), (4, to.shape[1]))
        return driver("light_hit", *self.receiver(driver, scene), to, scene=scene)


def sphere_case(name: str, points: str, center: ArrayLike, radius: float, **more) -> Case:
    """A sphere light about `center`, seen from the origin outside it."""
    s = radius / np.linalg.norm(center)
    chart = sphere_cone(center, radius) if points == "cone" else Ball(center, radius)
    wasted = {"area": (1 + s) / 2, "facing": s, "cone": 0.0}[points]
    return Case(name, ball(*center, radius), points, chart, wasted=wasted, **more)


def inner_case(name: str, points: str, **more) -> Case:
    """A sphere light that shines inwards, from within."""
    inside = Ball((0.1, -0.2, 0.3), 2, more.get("eye", (0, 0, 0)))
    return Case(name, ball(0.1, -0.2, 0.3, 2, INWARDS), points, inside, **more)


CASES = [
    Case("rectangle-by-area", PANEL, "area", PANEL_CHART),
    Case("rectangle-by-solid-angle", PANEL, "cone", PANEL_CHART),
    Case(
        "rectangle-from-near",
        PANEL,
        "cone",
        Flat("rectangle", (0.2, 0, 2), (0.6, 0, 0), (0, -0.9, 0), (0.5, 0.2, 1.8)),
        eye=(0.5, 0.2, 1.8),
        order=16,
    ),
    Case(
        "rectangle-from-beside",
        PANEL,
        "cone",
        Flat("rectangle", (0.2, 0, 2), (0.6, 0, 0), (0, -0.9, 0), (-1, 0.8, 1.7)),
        eye=(-1, 0.8, 1.7),
        normal=(1, -0.3, 0.1),
        order=12,
    ),
    Case(
        "rectangle-from-afar",
        PANEL,
        "cone",
        Flat("rectangle", (0.2, 0, 2), (0.6, 0, 0), (0, -0.9, 0), (3, -4, -5)),
        eye=(3, -4, -5),
        normal=(-1, 1, 2),
    ),
    Case("tilted-rectangle-by-area", shape("rectangle", SQUARE), "area", tilted("rectangle", 0.12)),
    Case("tilted-rectangle-by-solid-angle", shape("rectangle", SQUARE), "cone", tilted("rectangle", 0.12)),
    Case("sheared-rectangle", shape("rectangle", SHEARED), "cone", tilted("rectangle", 0.3)),
    Case("disk", shape("disk", SQUARE), "cone", tilted("disk", 0.12)),
    Case(
        "cube-face",
        CUBE,
        "cone",
        Flat("rectangle", (0.1, 0.2, 1.1), (0.4, 0, 0), (0, 0.4, 0)),
        light=5,
    ),
    Case("triangle", PANE, "cone", PANES[1], light=1, order=24),
    sphere_case("sphere-by-area", "area", (0.6, -0.8, 2), 0.9),
    sphere_case("sphere-facing", "facing", (0.6, -0.8, 2), 0.9),
    sphere_case("sphere-by-cone", "cone", (0.6, -0.8, 2), 0.9),
    sphere_case("sphere-from-near-facing", "facing", (0, 0, 1.3), 1.0, order=12, jacobian=1e-5),
    sphere_case("sphere-nearly-touched-by-cone", "cone", (0, 0, 1 + 1e-9), 1.0, jacobian=1e-5),
    sphere_case("small-sphere-by-cone", "cone", (3, 4, 12), 0.013, jacobian=1e-5),
    inner_case("inside-sphere-by-area", "area"),
    inner_case("inside-sphere-facing", "facing"),
    inner_case("inside-sphere-by-cone", "cone", eye=(0.5, 0.9, -0.4), normal=(1, 2, 2)),
    inner_case("on-the-wall-of-a-sphere", "cone", eye=(0.1, -0.2, -1.7), on_light=True),
    Case("sky", SKY, "cone", Cone((0, 0, 1), 2)),
]

each_light = pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
BINS = (16, 16)


def light_p(driver: Driver, case: Case, told: Case) -> float:
    """p-value of "the directions sampled in `case` have the density that hits in `told` are weighed by"."""
    places, weights, bins = nodes(BINS, case.order)
    to, size = case.chart.directions(places)
    with driver.scene(told.scene, points=told.points) as scene:
        light, _, _, inverse = told.hit(driver, scene, to)
    assert (light == told.light).all(), "a direction of the chart that does not meet the light"
    expected = np.bincount(bins, weights * size / inverse)
    with driver.scene(case.scene, points=case.points) as scene:
        sampled = case.sample(driver, scene, uniforms(SAMPLES, 5))
    seen = sampled[7] > 0
    counts = np.bincount(cell(case.chart.places(sampled[:3, seen]), BINS), minlength=expected.size)
    np.testing.assert_allclose(expected.sum() + told.wasted, 1, rtol=1e-6, err_msg="the density's integral")
    return chi_squared(np.append(counts, np.sum(~seen)), SAMPLES * np.append(expected, told.wasted))


@each_light
def test_light_points_follow_the_density_that_hits_are_weighed_by(driver: Driver, case: Case) -> None:
    """Where samples of the light lie, in directions, is what inverse_pdf_w_hit says; nothing is missing."""
    assert plausible(light_p(driver, case, case))


def test_the_density_of_another_technique_is_noticed(driver: Driver) -> None:
    """Negative controls: points by area do not pass for points by solid angle, nor the other way round, nor
    the far half of a sphere's wall for the near."""
    by_name = {case.name: case for case in CASES}
    for name, points in (
        ("rectangle-by-area", "cone"),
        ("tilted-rectangle-by-solid-angle", "area"),
        ("rectangle-from-beside", "area"),
    ):
        case = by_name[name]
        assert light_p(driver, case, replace(case, points=points)) < LEVEL
    inside = by_name["inside-sphere-by-area"]
    mirrored = replace(inside, eye=(0.2, -0.4, 0.6), chart=replace(inside.chart, eye=(0.2, -0.4, 0.6)))
    assert light_p(driver, inside, mirrored) < LEVEL


@each_light
def test_a_sample_and_a_hit_agree_on_the_density(driver: Driver, case: Case) -> None:
    """The two sides of multiple importance sampling: the same 1/pdf_w for the same direction, and the light
    is where the sample said. A ray that grazes a sphere keeps fewer digits of its cosine: cosθ² of them."""
    with driver.scene(case.scene, points=case.points) as scene:
        sampled = case.sample(driver, scene, uniforms(20_000, 6))
        seen = sampled[7] > 0
        to, distance, inverse = sampled[:3, seen], sampled[3, seen], sampled[7, seen]
        light, reached, cosine, weighed = case.hit(driver, scene, to)
    np.testing.assert_allclose(np.linalg.norm(to, axis=0), 1, rtol=1e-15)
    met = light == case.light
    clear = cosine > 1e-3
    assert met[clear].all()
    assert met.mean() > 0.999
    error = np.abs(weighed / inverse - 1)
    assert (error[met] * np.minimum(cosine[met] ** 2 * 1e3, 1) < 1e-10).all()
    if case.scene != SKY:
        error = np.abs(reached - distance) * cosine
        assert (error < 1e-8 * distance + 1e-14)[met].all()


@each_light
def test_a_lights_density_is_one_over_the_jacobian(driver: Driver, case: Case) -> None:
    places = uniforms(1000, 7, low=0.03, high=0.97)
    with driver.scene(case.scene, points=case.points) as scene:
        inverse = case.sample(driver, scene, places)[7]
        size = jacobian(lambda at: case.sample(driver, scene, at)[:3], places)
    seen = inverse > 0
    assert seen.any()
    np.testing.assert_allclose(size[seen], inverse[seen], rtol=case.jacobian)


@each_light
def test_a_light_gives_its_irradiance(driver: Driver, case: Case) -> None:
    """∫ over (u, v) of cosθ/pdf_w = ∫ cosθ dω over what is seen above the horizon, and the weight that next
    event estimation multiplies by is that 1/pdf_w times the radiance."""
    normal = column(case.normal) / np.linalg.norm(case.normal)
    places = (np.indices((400, 400)).reshape(2, -1) + 0.5) / 400
    with driver.scene(case.scene, points=case.points) as scene:
        sampled = case.sample(driver, scene, places)
    np.testing.assert_array_equal(sampled[4:7], np.tile(sampled[7], (3, 1)))
    found = np.mean(sampled[7] * np.maximum((normal * sampled[:3]).sum(axis=0), 0))
    at, weights, _ = nodes((64, 64), case.order)
    to, size = case.chart.directions(at)
    truth = (weights * size * np.maximum((normal * to).sum(axis=0), 0)).sum()
    assert found == pytest.approx(truth, rel=1e-3)


def polygon_irradiance(corners: Array, normal: Array) -> float:
    """Lambert's formula: ½ Σ angle of each edge × cosine of its plane's normal; corners (3, k) as seen."""
    corners = corners / np.linalg.norm(corners, axis=0)
    across = np.cross(corners, np.roll(corners, -1, axis=1), axis=0)
    sine = np.linalg.norm(across, axis=0)
    angle = np.arctan2(sine, (corners * np.roll(corners, -1, axis=1)).sum(axis=0))
    return abs((angle / sine * (normal * across).sum(axis=0)).sum()) / 2


def test_the_charts_give_the_closed_forms() -> None:
    """What the tests above compare with: Lambert's polygon, π (R/d)² cosθ, π r²/(r² + h²), 4π, π."""
    at, weights, _ = nodes((32, 32), 6)
    up = column((0, 0, 1))

    def irradiance(chart: Flat | Ball | Cone) -> float:
        to, size = chart.directions(at)
        return float((weights * size * np.maximum((up * to).sum(axis=0), 0)).sum())

    sides = np.array([[1, 1, -1, -1], [1, -1, -1, 1]])
    for flat in (PANEL_CHART, tilted("rectangle", 0.12), tilted("rectangle", 0.3)):
        corners = column(flat.center) + column(flat.x) * sides[0] + column(flat.y) * sides[1]
        assert irradiance(flat) == pytest.approx(polygon_irradiance(corners, up), rel=1e-9)
    triangle = Flat("triangle", (0.3, -0.2, 1.5), (1, 0.2, 0), (0.3, -1, 0.4))
    corners = np.stack(
        [triangle.center, np.add(triangle.center, triangle.x), np.add(triangle.center, triangle.y)]
    )
    assert irradiance(triangle) == pytest.approx(polygon_irradiance(corners.T, up), rel=1e-5)
    disk = Flat("disk", (0, 0, 2), (0.7, 0, 0), (0, 0.7, 0))
    assert irradiance(disk) == pytest.approx(np.pi * 0.49 / (0.49 + 4), rel=1e-9)
    center, d = (0.6, -0.8, 2), np.sqrt(5)
    for chart in (Ball(center, 0.9), sphere_cone(center, 0.9)):
        assert irradiance(chart) == pytest.approx(np.pi * 0.81 / d**2 * 2 / d, rel=1e-9)
    assert irradiance(Cone((0, 0, 1), 2)) == pytest.approx(np.pi, rel=1e-4)
    assert irradiance(Ball((0.1, -0.2, 0.3), 2)) == pytest.approx(np.pi, rel=1e-4)
    assert Cone((0, 0, 1), 2).directions(at)[1] @ weights == pytest.approx(4 * np.pi, rel=1e-12)


@pytest.mark.parametrize("s", [0.9, 0.1, 4.65e-3, 1e-5, 1e-8, 1e-15])
def test_a_sphere_fills_its_solid_angle_however_far(driver: Driver, s: float) -> None:
    """2π (1 - cosθmax) = 2π s²/(1 + √(1 - s²)), s = R/d, to the last digits."""
    case = sphere_case("sphere", "cone", (0, 0, 4.0), 4 * s)
    with driver.scene(case.scene) as scene:
        inverse = case.sample(driver, scene, uniforms(100, 8))[7]
    np.testing.assert_allclose(inverse, 2 * np.pi * s**2 / (1 + np.sqrt((1 - s) * (1 + s))), rtol=4e-15)


@pytest.mark.parametrize("rise", [0.45, 0.1, 1e-3, 1e-6, 1e-10])
@pytest.mark.parametrize("size", [0.5, 1e-6])
def test_of_a_setting_sphere_only_what_is_above_the_horizon_is_sampled(
    driver: Driver, rise: float, size: float
) -> None:
    """A sphere s = R/d whose center is so deep that a share `rise` of s stays above: every direction goes up,
    two thirds or more meet the sphere, their solid angle is what is above, and the density of the same
    direction is the same when it is hit.
    """
    sine = size * (1 - rise)
    center = np.array([np.sqrt((1 - sine) * (1 + sine)), 0, -sine])
    case = sphere_case("sets", "cone", center, size)
    with driver.scene(case.scene) as scene:
        sampled = case.sample(driver, scene, uniforms(SAMPLES, 36))
        meets = sampled[7] > 0
        hit = case.hit(driver, scene, sampled[:3])
    assert (sampled[2] > 0).all()
    assert 0.66 < meets.mean() < 0.8
    if size > 1e-3:  # of a smaller one, hits of its very edge are lost to rounding
        light, _, _, inverse = hit[:, meets]
        assert (light == 0).mean() > 0.999
        np.testing.assert_allclose(inverse[light == 0], sampled[7][meets][light == 0], rtol=1e-14)
    assert mean_p(sampled[7], solid_angle_above(sine, size)) > LEVEL / CHECKS


def solid_angle_above(depth: float, size: float) -> float:
    """∫ 2φ(z) dz over the heights z above the horizon of a cone of sine `size`, its axis at the sine `depth`
    below: cosφ = (cosα + z sinβ)/(√(1 - z²) cosβ), with 60 digits.
    """
    with mp.workdps(60):
        s, b = mpf(size), mpf(depth)
        alpha, beta = mpmath.asin(s), mpmath.asin(b)

        def width(z: mpf) -> mpf:
            cosine = (mpmath.cos(alpha) + z * b) / (mpmath.sqrt(1 - z * z) * mpmath.cos(beta))
            return 2 * mpmath.acos(min(cosine, mpf(1)))

        return float(mpmath.quad(width, [0, mpmath.sin(alpha - beta)]))


def test_the_wall_of_a_sphere_sees_all_of_it_however_its_points_are_rounded(driver: Driver) -> None:
    """From a point of the wall, 1/pdf_w = 4πR² cosθ/d² with cosθ = d/2R: 2πR/d. Rounding puts many such
    points outside the sphere; which surface they lie on says what they are."""
    center, radius = column((0.1, -0.2, 0.3)), 2.0
    eye = center + radius * directions(5000, 34)
    assert (np.linalg.norm(eye - center, axis=0) > radius).any()
    case = inner_case("wall", "cone")
    with driver.scene(case.scene, points=case.points) as scene:
        for slot, every in ((driver.light_slot(scene, 0), True), (-1, False)):
            ways = [eye, center - eye, slot, 0, uniforms(5000, 35)]
            sampled = driver("light_sample", *ways, scene=scene)
            right = np.isclose(sampled[7] * sampled[3], 2 * np.pi * radius, rtol=1e-6)
            assert right.all() == every  # without the slot, the check fails


def rectangle_solid_angle(eye: Array, low: Array, high: Array) -> Array:
    """Of rectangles low … high (2, n) in the plane z = 0 from eyes (3, n): Σ ± atan(x y / (z d)) of the
    corners, in extended precision."""
    eye = np.asarray(eye, dtype=np.longdouble)
    x, y, z = (low[0] - eye[0], high[0] - eye[0]), (low[1] - eye[1], high[1] - eye[1]), np.abs(eye[2])
    corner = [[np.arctan2(a * b, z * np.sqrt(a**2 + b**2 + z**2)) for b in y] for a in x]
    return (corner[0][0] - corner[0][1] - corner[1][0] + corner[1][1]).astype(np.float64)


LYING = shape("rectangle", '<scale x="0.6" y="0.9"/>')
LOW, HIGH = np.array([[-0.6], [-0.9]]), np.array([[0.6], [0.9]])


@pytest.mark.parametrize(("least", "error"), [(0.1, 1e-11), (1e-3, 1e-7), (1e-12, 1e-4)])
def test_a_rectangle_fills_its_solid_angle_however_near(driver: Driver, least: float, error: float) -> None:
    """Of all that see more than 1e-4 sr of it: those far from its plane to the last digits, those that see it
    edge-on with fewer."""
    n = 50_000
    height = np.exp(uniforms(n, 30, 1, np.log(least), np.log(0.5)))
    eye = np.vstack([uniforms(n, 31, 2, -1.2, 1.2), height])
    with driver.scene(LYING, points="cone") as scene:
        inverse = driver("light_sample", eye, column((0, 0, -1)), -1, 0, uniforms(n, 32), scene=scene)[7]
    truth = rectangle_solid_angle(eye, LOW, HIGH)
    large = truth > 1.01e-4
    assert large.sum() > 0.3 * n
    np.testing.assert_allclose(inverse[large], truth[large], rtol=error)


@pytest.mark.parametrize("eye", [(0, 0, 1e-9), (0.3, 0, 0.05), (0.45, -0.9, 1e-3), (0.61, 0.1, 1e-3)])
def test_points_of_a_rectangle_in_contact_follow_the_solid_angle(driver: Driver, eye: ArrayLike) -> None:
    """Each part of it gets its share of the solid angle, closed forms both."""
    edges = [np.linspace(low, high, 9) for low, high in zip(LOW[:, 0], HIGH[:, 0], strict=True)]
    low = np.stack(np.meshgrid(edges[0][:-1], edges[1][:-1], indexing="ij")).reshape(2, -1)
    high = np.stack(np.meshgrid(edges[0][1:], edges[1][1:], indexing="ij")).reshape(2, -1)
    expected = rectangle_solid_angle(column(eye), low, high)
    with driver.scene(LYING, points="cone") as scene:
        way = [column(eye), column((0, 0, -1)), -1]
        sampled = driver("light_sample", *way, 0, uniforms(SAMPLES, 33), scene=scene)
    points = column(eye) + sampled[:3] * sampled[3]
    np.testing.assert_allclose(points[2], 0, atol=1e-15)
    assert (np.abs(points[:2]) <= HIGH + 1e-12).all()
    counts = np.bincount(cell((points[:2] - LOW) / (HIGH - LOW), (8, 8)), minlength=64)
    assert plausible(chi_squared(counts, SAMPLES * expected / expected.sum()))


def test_a_light_among_others_is_sampled_as_it_is_alone(driver: Driver) -> None:
    """Bit by bit: its tables are looked up, nothing else changes."""
    other = '<emitter type="point"><rgb name="intensity" value="1"/></emitter>'
    for case in CASES:
        with driver.scene(case.scene, points=case.points) as scene:
            alone = case.sample(driver, scene, uniforms(500, 9))
        with driver.scene(case.scene + other, points=case.points) as scene:
            np.testing.assert_array_equal(case.sample(driver, scene, uniforms(500, 9)), alone, case.name)


# ---- emitters/choice.h


def lamps(seed: int, lattice: bool) -> str:
    """Forty lights of every kind; on a lattice their places and turns are such that much is exactly 0."""
    rng = np.random.default_rng(seed)

    def place(low: float, high: float) -> list[float]:
        at = rng.uniform(low, high, 3)
        return (np.round(at * 2) / 2 if lattice else at).tolist()

    def one(kind: str) -> str:
        x, y, z = place(-4, 4)
        at = f'<point name="position" x="{x}" y="{y}" z="{z}"/>'
        colour = f'<rgb name="{{}}" value="{10 ** rng.uniform(-3, 3)!r}"/>'
        if kind == "point":
            return f'<emitter type="point">{at}{colour.format("intensity")}</emitter>'
        a, b, c = place(-1, 1)
        look = f'<lookat origin="{x}, {y}, {z}" target="{x + a}, {y + b}, {z + c + 0.25}" up="0.1, 0.3, 1"/>'
        if kind == "spot":
            transform = f'<transform name="to_world">{look}</transform>'
            return f'<emitter type="spot">{transform}{colour.format("intensity")}</emitter>'
        if kind == "directional":
            way = f'<vector name="direction" x="{a}" y="{b}" z="{c - 0.25}"/>'
            return f'<emitter type="directional">{way}{colour.format("irradiance")}</emitter>'
        light = f'<emitter type="area">{colour.format("radiance")}</emitter>'
        size = 2.0 ** rng.integers(-3, 2)
        if kind == "sphere":
            inwards = f'<boolean name="flip_normals" value="{str(bool(rng.integers(2))).lower()}"/>'
            center = at.replace("position", "center")
            return (
                f'<shape type="sphere">{center}<float name="radius" value="{size}"/>{inwards}{light}</shape>'
            )
        transform = f'<scale x="{size}" y="{size * rng.uniform(0.2, 1)}"/>'
        if lattice:
            transform += f'<rotate {"xyz"[rng.integers(3)]}="1" angle="{90 * rng.integers(4)}"/>'
            transform += f'<translate x="{x}" y="{y}" z="{z}"/>'
        else:
            transform += look
        return f'<shape type="{kind}"><transform name="to_world">{transform}</transform>{light}</shape>'

    kinds = ["rectangle"] * 12 + ["disk"] * 8 + ["sphere"] * 8 + ["point"] * 5 + ["spot"] * 5
    far = ["directional"] if seed % 2 else []
    sky = '<emitter type="constant"><rgb name="radiance" value="0.1"/></emitter>' if seed % 4 == 1 else ""
    return FLOOR + "".join(one(kind) for kind in [*kinds, *far]) + sky


def receivers(n: int, seed: int, lattice: bool) -> Array:
    """(p, n, slot), (7, n), on nothing; on a lattice, p and n too."""
    p, normal = uniforms(n, seed, 3, -5, 5), directions(n, seed + 1)
    if lattice:
        p = np.round(p * 2) / 2
        axis = np.argmax(np.abs(normal), axis=0)
        normal = np.eye(3)[axis].T * np.sign(np.take_along_axis(normal, axis[None], 0))
    return np.vstack([p, normal, np.full(n, -1)])


def probabilities(driver: Driver, scene: int, at: Array) -> Array:
    """p_i of each light by receiver, (lights, n), as hits are weighed by it."""
    lights = np.arange(driver.light_count(scene))
    every = np.repeat(at, lights.size, axis=1)
    inverse = driver("choice_of", every, np.tile(lights, at.shape[1]), scene=scene)
    return 1 / inverse.reshape(at.shape[1], lights.size).T


def learn(driver: Driver, scene: int, choice: str) -> None:
    if choice == "learned":
        driver.learn_anything(scene, (-4, -3, -4), (4, 4, 2), 7)


each_choice = pytest.mark.parametrize("choice", ["uniform", "power", "contribution", "learned"])


@each_choice
def test_lights_are_chosen_as_often_as_their_probability_says(driver: Driver, choice: str) -> None:
    """From several points; and what a hit is weighed by is, to the last bit, what the choice reported."""
    u, v = uniforms(SAMPLES, 10)
    with driver.scene(lamps(1, False), choice=choice) as scene:
        learn(driver, scene, choice)
        for at in receivers(5, 11, False).T:
            light, inverse = driver("choose", at[:, None], u, v, scene=scene)
            p = probabilities(driver, scene, at[:, None])[:, 0]
            np.testing.assert_array_equal(driver("choice_of", at[:, None], light, scene=scene)[0], inverse)
            counts = np.bincount(light.astype(int), minlength=p.size)
            assert plausible(chi_squared(counts, SAMPLES * p / p.sum()))


def test_another_points_probabilities_are_noticed(driver: Driver) -> None:
    """Negative control: the choice at one point does not pass for that at another nearby."""
    u, v = uniforms(SAMPLES, 10)
    at = receivers(1, 11, False)
    beside = at + np.array([[0.7], [0.7], [0], [0], [0], [0], [0]])
    with driver.scene(lamps(1, False), choice="contribution") as scene:
        light, _ = driver("choose", at, u, v, scene=scene)
        p = probabilities(driver, scene, beside)[:, 0]
    assert chi_squared(np.bincount(light.astype(int), minlength=p.size), SAMPLES * p) < LEVEL


@each_choice
@pytest.mark.parametrize("lattice", [False, True], ids=["anywhere", "lattice"])
def test_the_probabilities_of_all_lights_sum_to_one(driver: Driver, choice: str, lattice: bool) -> None:
    for seed in range(4):
        with driver.scene(lamps(seed, lattice), choice=choice) as scene:
            learn(driver, scene, choice)
            p = probabilities(driver, scene, receivers(500, seed, lattice))
        assert (p >= 0).all()
        np.testing.assert_allclose(p.sum(axis=0), 1, rtol=1e-12)


def shining(driver: Driver, scene: int, at: Array, places: int = 64) -> Array:
    """Does any of these points of each light reach the receiver's upper side? (lights, n)."""
    lights, n = driver.light_count(scene), at.shape[1]
    reaches = np.zeros((lights, n), dtype=bool)
    uv = np.tile(uniforms(places, 12), n)
    every = np.repeat(at, places, axis=1)
    for light in range(lights):
        sampled = driver("light_sample", every, light, uv, scene=scene)
        above = (every[3:6] * sampled[:3]).sum(axis=0) > 0
        reaches[light] = (above & (sampled[4:7].max(axis=0) > 0)).reshape(n, places).any(axis=1)
    return reaches


@pytest.mark.parametrize("choice", ["contribution", "learned"])
@pytest.mark.parametrize("lattice", [False, True], ids=["anywhere", "lattice"])
def test_a_light_has_no_chance_only_where_it_gives_nothing(
    driver: Driver, choice: str, lattice: bool
) -> None:
    """p_i = 0 is for lights below the horizon or seen from behind; and it does occur."""
    none = 0
    for seed in range(3):
        with driver.scene(lamps(seed, lattice), choice=choice) as scene:
            learn(driver, scene, choice)
            at = receivers(200, seed + 20, lattice)
            p, reaches = probabilities(driver, scene, at), shining(driver, scene, at)
        assert (p[reaches] > 0).all()
        none += np.sum(p == 0)
    assert none > 1000


@pytest.mark.parametrize("choice", ["contribution", "learned"])
def test_of_two_lights_the_one_below_the_horizon_is_never_chosen(driver: Driver, choice: str) -> None:
    """The lecture's second situation: 100 % for the other, ×1."""
    flip = '<rotate x="1" angle="180"/>'
    two = shape("disk", f'{flip}<translate z="3"/>') + shape("disk", '<translate z="-3"/>').removeprefix(
        FLOOR
    )
    at = np.array([[0, 0], [0, 0], [0, 0], [0, 0], [0, 0], [1, -1], [-1, -1]])
    with driver.scene(two, choice=choice) as scene:
        learn(driver, scene, choice)
        np.testing.assert_array_equal(probabilities(driver, scene, at), [[1, 0], [0, 1]])


def test_a_light_without_a_chance_would_be_noticed(driver: Driver) -> None:
    """Negative control: probabilities for the other side of the surface leave out lights that do reach."""
    with driver.scene(lamps(0, False), choice="contribution") as scene:
        at = receivers(100, 20, False)
        below = at * np.array([1, 1, 1, -1, -1, -1, 1])[:, None]
        assert (probabilities(driver, scene, below)[shining(driver, scene, at)] == 0).any()


# ---- estimators/light.h

GROUND = (
    '<shape type="rectangle"><transform name="to_world"><scale x="3" y="4"/></transform></shape>'
    '<emitter type="{}">{}</emitter>'
)
SPOT = GROUND.format(
    "spot",
    '<transform name="to_world"><lookat origin="1, 2, 3" target="0, 0, 0" up="0, 0, 1"/></transform>'
    '<rgb name="intensity" value="2"/><float name="cutoff_angle" value="40"/>'
    '<float name="beam_width" value="25"/>',
)
SUN = GROUND.format(
    "directional", '<vector name="direction" x="1" y="2" z="-3"/><rgb name="irradiance" value="2"/>'
)
SPOT_AXIS, SUN_WAY = -column((1, 2, 3)) / np.sqrt(14), column((1, 2, -3)) / np.sqrt(14)


def spot_flux(cutoff: float, beam: float, intensity: float) -> float:
    """∫ I falloff dω = 2π I (1 - (sin c - sin b)/(c - b)) for a falloff linear in the angle."""
    return 2 * np.pi * intensity * (1 - (np.sin(cutoff) - np.sin(beam)) / (cutoff - beam))


def emitted(driver: Driver, body: str, samples: int = SAMPLES) -> tuple[Array, Array, Array]:
    """Origins, directions and fluxes of light paths, (3, n) each."""
    with driver.scene(body, estimator="light", choice="power") as scene:
        out = driver("emit", np.arange(samples), scene=scene)
    np.testing.assert_allclose(np.linalg.norm(out[3:6], axis=0), 1, rtol=1e-14)
    return out[:3], out[3:6], out[7:]


def far_disk(o: Array, d: Array) -> tuple[Array, Array, float]:
    """Where far light comes through the disk across its direction: share of its area within, the vector from
    its center, and its radius R, which is that of a ball around the ground."""
    radius = -float((o[:, 0] * d[:, 0]).sum())
    assert radius >= 5
    np.testing.assert_allclose((o * d).sum(axis=0), -radius, rtol=1e-12)
    across = o + d * radius
    return (across**2).sum(axis=0) / radius**2, across, radius


def about(axis: Array, d: Array) -> Array:
    """Cosine to the axis (3, 1) or (3, n), and azimuth in turns."""
    if axis.shape[1] == 1:
        return np.stack([(axis * d).sum(axis=0), Cone(axis.ravel(), 2).places(d)[1]])
    helper = np.where(np.abs(axis[:1]) < 0.7, column([1, 0, 0]), column([0, 1, 0]))
    s = np.cross(axis, helper, axis=0)
    t = np.cross(axis, s, axis=0)
    return np.stack([(axis * d).sum(axis=0), turn((t * d).sum(axis=0), (s * d).sum(axis=0))])


def even_p(places: Array, shape: tuple[int, ...]) -> float:
    """p-value of "these places fill [0,1]^k evenly and independently"."""
    assert ((places > -1e-9) & (places < 1 + 1e-9)).all()
    bins = int(np.prod(shape))
    return chi_squared(
        np.bincount(cell(places, shape), minlength=bins), np.full(bins, places.shape[1] / bins)
    )


def test_a_point_light_shines_evenly_all_around(driver: Driver) -> None:
    body = GROUND.format(
        "point", '<point name="position" x="1" y="2" z="3"/><rgb name="intensity" value="2"/>'
    )
    o, d, flux = emitted(driver, body)
    np.testing.assert_array_equal(o, np.broadcast_to(column((1, 2, 3)), o.shape))
    np.testing.assert_allclose(flux, 4 * np.pi * 2, rtol=1e-14)
    z, angle = about(column((0, 0, 1)), d)
    assert plausible(even_p(np.stack([(1 - z) / 2, angle]), (20, 20)))


def test_a_spot_shines_within_its_cone(driver: Driver) -> None:
    """Evenly by solid angle, with flux that falls off linearly in the angle; its mean is the whole flux."""
    o, d, flux = emitted(driver, SPOT)
    cutoff, beam = np.radians(40), np.radians(25)
    z, angle = about(SPOT_AXIS, d)
    np.testing.assert_allclose(o, np.broadcast_to(column((1, 2, 3)), o.shape), rtol=1e-14)
    assert plausible(even_p(np.stack([(1 - z) / (1 - np.cos(cutoff)), angle]), (20, 20)))
    falloff = np.clip((cutoff - np.arccos(z)) / (cutoff - beam), 0, 1)
    np.testing.assert_allclose(flux[0], 4 * np.pi * (1 - np.cos(cutoff)) * falloff, atol=1e-12)
    assert plausible(mean_p(flux[0], spot_flux(cutoff, beam, 2)))


EMITTERS = {
    "rectangle": (shape("rectangle", SQUARE), tilted("rectangle", 0.12)),
    "sheared-rectangle": (shape("rectangle", SHEARED), tilted("rectangle", 0.3)),
    "disk": (shape("disk", SQUARE), tilted("disk", 0.12)),
}


@pytest.mark.parametrize("name", EMITTERS)
def test_a_flat_light_shines_by_the_cosine_from_everywhere(driver: Driver, name: str) -> None:
    """Points even over the area, directions cosine-weighted (cos² even) and independent of them; flux πLA."""
    body, chart = EMITTERS[name]
    o, d, flux = emitted(driver, body)
    across = np.cross(column(chart.x), column(chart.y), axis=0)
    size = np.linalg.norm(across)
    normal = across / size * np.sign((across * d).sum())
    z, angle = about(normal, d)
    assert (z > 0).all()
    assert plausible(even_p(np.vstack([chart.of_points(o), z**2, angle]), (6, 6, 5, 5)))
    area = size * {"rectangle": 4, "disk": np.pi}[chart.kind]
    np.testing.assert_allclose(flux, np.pi * area, rtol=1e-13)


def test_a_mesh_shines_by_the_cosine_from_everywhere(driver: Driver) -> None:
    """Its triangles by their areas, each of them evenly; flux πL ΣA."""
    with driver.scene(PANE, estimator="light", choice="power") as scene:
        out = driver("emit", np.arange(SAMPLES), scene=scene)
        slots = [driver.light_slot(scene, light) for light in range(driver.light_count(scene))]
    across = [np.cross(pane.x, pane.y) for pane in PANES]
    areas = np.linalg.norm(across, axis=1) / 2
    counts = np.array([np.sum(out[6] == slot) for slot in slots])
    assert plausible(chi_squared(counts, SAMPLES * areas / areas.sum()))
    for slot, pane, normal in zip(slots, PANES, across, strict=True):
        o, d = out[:3, out[6] == slot], out[3:6, out[6] == slot]
        z, angle = about(column(normal) / np.linalg.norm(normal), d)
        assert (z > 0).all()
        assert plausible(even_p(np.vstack([pane.of_points(o), z**2, angle]), (5, 5, 4, 4)))
    np.testing.assert_allclose(out[7:], np.pi * areas.sum(), rtol=1e-13)


@pytest.mark.parametrize("inwards", [False, True], ids=["outwards", "inwards"])
def test_a_sphere_shines_by_the_cosine_from_everywhere(driver: Driver, inwards: bool) -> None:
    o, d, flux = emitted(driver, ball(0.1, -0.2, 0.3, 2, INWARDS if inwards else ""))
    outward = (o - column((0.1, -0.2, 0.3))) / 2
    np.testing.assert_allclose(np.linalg.norm(outward, axis=0), 1, rtol=1e-14)
    place = about(column((0, 0, 1)), outward)
    z, angle = about(-outward if inwards else outward, d)
    assert plausible(even_p(np.stack([(1 - place[0]) / 2, place[1], z**2, angle]), (6, 6, 5, 5)))
    np.testing.assert_allclose(flux, np.pi * 16 * np.pi, rtol=1e-13)


def test_the_sun_shines_on_the_scenes_ball(driver: Driver) -> None:
    """From a disk across its direction that just covers the ball; flux E π R²."""
    o, d, flux = emitted(driver, SUN)
    np.testing.assert_allclose(d, np.broadcast_to(SUN_WAY, d.shape), rtol=1e-14)
    within, across, radius = far_disk(o, d)
    assert plausible(even_p(np.stack([within, about(SUN_WAY, across)[1]]), (20, 20)))
    np.testing.assert_allclose(flux, 2 * np.pi * radius**2, rtol=1e-13)


def test_the_sky_shines_on_the_scenes_ball(driver: Driver) -> None:
    """From every direction alike, through a disk across it; flux 4π L π R²."""
    o, d, flux = emitted(driver, GROUND.format("constant", '<rgb name="radiance" value="2"/>'))
    within, across, radius = far_disk(o, d)
    z, angle = about(column((0, 0, 1)), d)
    assert plausible(even_p(np.stack([(1 - z) / 2, angle, within, about(d, across)[1]]), (6, 6, 5, 5)))
    np.testing.assert_allclose(flux, 2 * 4 * np.pi**2 * radius**2, rtol=1e-13)


def test_many_lights_give_the_sum_of_their_fluxes(driver: Driver) -> None:
    """One light chosen and divided by its p_i: the mean flux is Σ Φ_i; here a spot, a sphere and a cube."""
    sphere = ball(1, 2, 3, 0.5).removeprefix(FLOOR)
    cube = CUBE.removeprefix(FLOOR)
    _, _, flux = emitted(driver, SPOT + sphere + cube)
    spot = spot_flux(np.radians(40), np.radians(25), 2)
    truth = spot + np.pi * np.pi + np.pi * 6 * 0.64
    assert plausible(mean_p(flux[0], truth))
    assert mean_p(flux[0], truth + 0.03 * spot) < LEVEL  # the check can fail


# ---- sensors/perspective.h

EVERYTHING = ROOT / "tests/everything.xml"
WIDTH, HEIGHT = 19, 11


def test_the_eye_sees_a_point_of_a_ray_where_the_ray_left_the_film(driver: Driver) -> None:
    film = uniforms(2000, 13) * [[WIDTH], [HEIGHT]]
    far = 10 ** uniforms(2000, 14, 1, -1, 3)
    with driver.scene(EVERYTHING) as scene:
        ray = driver("film_ray", film, scene=scene)
        eye = driver("eye", ray[:3] + ray[3:6] * far, scene=scene)
    assert (eye[0] == 1).all()
    np.testing.assert_allclose(eye[6:8], film, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(eye[1:4], -ray[3:6], atol=1e-12)
    np.testing.assert_allclose(eye[5], far[0], rtol=1e-12)


def test_the_eyes_weight_is_the_jacobian_of_film_to_solid_angle(driver: Driver) -> None:
    """1/(d² N dω/dA), A in pixels, N of them."""
    film = uniforms(2000, 15) * [[WIDTH], [HEIGHT]]
    with driver.scene(EVERYTHING) as scene:
        ray = driver("film_ray", film, scene=scene)
        size = jacobian(lambda at: driver("film_ray", at, scene=scene)[3:6], film, 1e-4)
        eye = driver("eye", ray[:3] + ray[3:6] * 2.5, scene=scene)
    np.testing.assert_allclose(eye[8] * eye[4] ** 2 * WIDTH * HEIGHT * size, 1, rtol=1e-8)


def test_the_eye_sees_nothing_beside_the_film_or_beyond_its_planes(driver: Driver) -> None:
    inside = uniforms(500, 16) * [[WIDTH], [HEIGHT]]
    outside = [(-1, 5), (WIDTH + 1, 5), (5, -1), (5, HEIGHT + 1), (-40, 90)]
    with driver.scene(EVERYTHING) as scene:
        for film, times, seen in [
            *((np.array([[x], [y]]), 0.5, 0) for x, y in outside),
            (inside, -0.01, 0),
            (inside, -2.0, 0),
            (inside, 1.001, 0),
            (inside, 1e-6, 1),
            (inside, 0.999, 1),
        ]:
            ray = driver("film_ray", film, scene=scene)
            shift = ray[6] * times if times > 0 else times
            eye = driver("eye", ray[:3] + ray[3:6] * shift, scene=scene)
            assert (eye[0] == seen).all(), (film[:, 0], times)


# ---- lanes and precision


def agree(driver: Driver, wide: list[Driver], ask, tolerance: float) -> None:
    """What `ask` gets: the same bits from two lanes, nearly the same in single precision but for a few places
    where it takes another branch."""
    one, (double, single) = ask(driver), wide
    np.testing.assert_array_equal(ask(double), one)
    other = ask(single)
    size = np.maximum(np.abs(one), np.sqrt(np.mean(one**2, axis=1, keepdims=True)))
    near = np.abs(other - one) <= tolerance * np.maximum(size, 1e-300)
    assert near.mean() > 0.998


@pytest.mark.parametrize("name", [*MAPS, "disk", "triangle"])
def test_lanes_and_single_precision_give_the_same_directions(
    driver: Driver, wide: list[Driver], name: str
) -> None:
    extent = MAPS.get(name, (0, 0, 0, 1.0))[3]
    places = (np.indices((32, 31)).reshape(2, -1) + 0.5) / 32  # 992: a last block that is not full
    agree(driver, wide, lambda d: d(name.split("-")[0], places[:, :991], extent)[:3], 2e-6)


def test_lanes_and_single_precision_give_the_same_samples_of_lights(
    driver: Driver, wide: list[Driver]
) -> None:
    at = receivers(2001, 17, False) * np.array([0.4, 0.4, 0.1, 1, 1, 1, 1])[:, None] + [
        [0],
        [0],
        [1],
        *[[0]] * 4,
    ]
    uv = uniforms(2001, 18)
    for choice in ("power", "contribution"):
        for points in ("area", "facing", "cone"):

            def ask(d: Driver, choice: str = choice, points: str = points) -> Array:
                with d.scene(EVERYTHING, choice=choice, points=points) as scene:
                    lights = np.arange(2001) % d.light_count(scene)
                    chosen = d("choice_of", at, lights, scene=scene)
                    sampled = d("light_sample", at, lights, uv, scene=scene)
                near = (sampled[3] < 1e30) & np.isfinite(chosen[0])
                return np.vstack([sampled[:3], sampled[7], np.where(near, 1 / chosen, 0)])

            agree(driver, wide, ask, 2e-3)
