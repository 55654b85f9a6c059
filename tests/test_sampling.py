"""Each sample follows its density, each density is one over the Jacobian of its map and has the integral 1:
directions, points of lights, the choice of a light, light paths, and the camera.

Numbers come from the functions of the tracer's headers themselves (sampling.c); what they ought to be, from
charts.py and closed forms. Seeds are fixed; all statistical checks of this file together would raise a false
alarm for one choice of seeds in 10⁴.
"""

from __future__ import annotations


from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from building import ROOT
from charts import Ball, Cone, Flat, sphere_cone, turn
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


@pytest.fixture(scope="module")
def driver(tmp_path_factory: pytest.TempPathFactory) -> Driver:
    """Double precision, one lane."""
    return Driver(tmp_path_factory.mktemp("sampling"))


# ---- sample.h

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
    d = driver(name.split("-")[0], 4, uniforms(SAMPLES, 1), extent)
    places, weights, bins = nodes(shape, 4)
    width = MAPS[name][1] - MAPS[name][0] if MAPS[name][0] is not None else extent
    pdf = driver("densities", 4, 1 - places[0] * width, extent)[density]
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


@pytest.mark.parametrize(("name", "kind"), [("square", "rectangle"), ("disk", "disk")])
def test_points_fill_the_square_and_the_disk_evenly(driver: Driver, name: str, kind: str) -> None:
    chart, shape = Flat(kind, (0, 0, 0), (1, 0, 0), (0, 1, 0)), (20, 20)
    counts = np.bincount(cell(chart.of_points(driver(name, 4, uniforms(SAMPLES, 2))[:3]), shape), minlength=400)
    assert plausible(chi_squared(counts, np.full(400, SAMPLES / 400)))


@pytest.mark.parametrize("name", [*MAPS, "square", "disk"])
def test_the_density_is_one_over_the_jacobian(driver: Driver, name: str) -> None:
    entry, extent = name.split("-")[0], MAPS.get(name, (0, 0, 0, 1.0))[3]
    places = uniforms(2000, 3, low=0.02, high=0.98)
    pdf = driver(entry, 4, places, extent)[3]
    size = jacobian(lambda at: driver(entry, 4, at, extent)[:3], places)
    np.testing.assert_allclose(pdf * size, 1, rtol=2e-7)


@pytest.mark.parametrize("extent", [2.0, 1.0, 1e-3, 1e-8, 1e-16, 1e-30, 1e-100])
def test_cones_keep_their_digits_however_narrow(driver: Driver, extent: float) -> None:
    """sin²θ = x (2 - x) with x = u extent, to the last digits, and a unit vector."""
    u, v = uniforms(2000, 4)
    d = driver("cone", 4, u, v, extent)
    x = u * extent
    np.testing.assert_allclose(d[0] ** 2 + d[1] ** 2, x * (2 - x), rtol=2e-15)
    np.testing.assert_allclose(np.linalg.norm(d[:3], axis=0), 1, rtol=1e-15)
    np.testing.assert_allclose(d[3] * 2 * np.pi * extent, 1, rtol=1e-15)


# ---- light.h: one light and a point that it shines on

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
        return driver("light_sample", 9, *self.receiver(driver, scene), self.light, places, scene=scene)

    def hit(self, driver: Driver, scene: int, to: Array) -> Array:
        """(light, distance, cosine, 1/pdf_w), (4, n): what multiple importance sampling weighs a hit by."""
        if isinstance(self.chart, Cone) and self.scene == SKY:
            return np.broadcast_to(np.array([[0.0], [0.0], [1.0], [4 * np.pi]]), (4, to.shape[1]))
        return driver("light_hit", 4, *self.receiver(driver, scene), to, scene=scene)


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
    sphere_case("sphere-by-area", "area", (0.6, -0.8, 2), 0.9),
    sphere_case("sphere-facing", "facing", (0.6, -0.8, 2), 0.9),
    sphere_case("sphere-by-cone", "cone", (0.6, -0.8, 2), 0.9),
    sphere_case("sphere-nearly-touched-facing", "facing", (0, 0, 1.02), 1.0, order=40),
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
    """Negative controls: facing samples do not pass for the cone's, nor area's for the solid angle's."""
    by_name = {case.name: case for case in CASES}
    for name, other in (
        ("rectangle-by-area", "rectangle-by-solid-angle"),
        ("tilted-rectangle-by-solid-angle", "tilted-rectangle-by-area"),
        ("inside-sphere-by-area", "sky"),
    ):
        assert light_p(driver, by_name[name], replace(by_name[name], points=by_name[other].points)
                       if other != "sky" else by_name["sky"]) < LEVEL


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
        assert (np.abs(reached / distance - 1)[met & clear] < 1e-8).all()


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
    assert found == pytest.approx(truth, rel=2e-4)


def polygon_irradiance(corners: Array, normal: Array) -> float:
    """Lambert's formula: ½ Σ angle of each edge × cosine of its plane's normal; corners (3, k) from the eye."""
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
    corners = np.stack([triangle.center, np.add(triangle.center, triangle.x), np.add(triangle.center, triangle.y)])
    assert irradiance(triangle) == pytest.approx(polygon_irradiance(corners.T, up), rel=1e-9)
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


def test_a_light_among_others_is_sampled_as_it_is_alone(driver: Driver) -> None:
    """Bit by bit: its tables are looked up, nothing else changes."""
    other = '<emitter type="point"><rgb name="intensity" value="1"/></emitter>'
    for case in CASES:
        with driver.scene(case.scene, points=case.points) as scene:
            alone = case.sample(driver, scene, uniforms(500, 9))
        with driver.scene(case.scene + other, points=case.points) as scene:
            np.testing.assert_array_equal(case.sample(driver, scene, uniforms(500, 9)), alone, case.name)
