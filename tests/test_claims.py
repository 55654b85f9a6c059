"""What the lecture says of each technique's variance, as statements about one sample X.

Theory predicts most of them as a number: a second moment E[X²], which sums over the ways that light takes
where a variance does not, or a ratio of two. Each is held against a confidence interval of 99.99 %, by
Student's t from independent renders of fixed seeds; the widest intervals of numbers are a few per cent, and
wrong predictions that are near at hand must lie outside. About 100 intervals: of all choices of seeds one in
100 would give a false alarm.

Most scenes are seen through a camera that shows a single point, so that pixels have no variance of their own.
Units are metres and W·sr⁻¹·m⁻².
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from batches import Array, Batches, Oneray, ball, diffuse, floor, glow, interval, ratio, sky, square, world

from raycheck.scene import variants
from raycheck.scene.content import read_content
from raycheck.scene.techniques import applicable, technique

WALK = "--estimator walk --hemisphere cosine"
NEE_AREA = "--estimator nee --light-choice power --light-points area"
NEE_FACING = "--estimator nee --light-choice power --light-points facing"
NEE_CONE = "--estimator nee --light-choice power --light-points cone"
MIS = "--estimator mis --light-choice power --light-points area --mis"

ALBEDO = 0.5
FLOOR = floor(diffuse(ALBEDO))


@pytest.fixture
def render(oneray: Path, tmp_path: Path) -> Callable[..., Batches]:
    """render(scene, options, spp) is a set of independent renders."""
    return Oneray(oneray, tmp_path).batches


# --- A ball of radius R straight above a point, D away (L5).

RADIUS, DISTANCE = 0.8, 1.0
BALL = world(FLOOR + ball(0, DISTANCE, RADIUS, 1), eye="0.9, 0, 0.2", up="0, 0, 1")


def facing_second_moment() -> float:
    """E[X²] of a point uniform on the facing half: u, the cosine of its angle at the centre, is uniform in
    0 … 1; X = ρ L/π · 2πR² cosθ cosθ_light / d², 0 where the point looks away.
    """
    nodes, weights = np.polynomial.legendre.leggauss(200)
    u = RADIUS / DISTANCE + (1 - RADIUS / DISTANCE) * (nodes + 1) / 2
    squared = DISTANCE**2 + RADIUS**2 - 2 * DISTANCE * RADIUS * u
    cosines = (DISTANCE - RADIUS * u) * (DISTANCE * u - RADIUS) / squared
    x = ALBEDO * 2 * RADIUS**2 * cosines / squared
    return float((weights * x**2).sum() / 2 * (1 - RADIUS / DISTANCE))


def test_the_facing_half_of_a_ball_halves_the_second_moment(render) -> None:
    """L5. Twice the density where light comes from: X is halved there and met twice as often."""
    scene = world(FLOOR + ball(0.7, 1.5, 0.6, 1), fov=40)
    whole, half = render(scene, NEE_AREA), render(scene, NEE_FACING)
    found = ratio(whole.second, half.second)
    assert 2 in found
    assert found.width < 0.1
    assert 1 in ratio(whole.mean, half.mean)


def test_facing_second_moment(render) -> None:
    """L5. That of the facing half by quadrature, and twice that for the whole sphere."""
    predicted = facing_second_moment()
    for options, factor in ((NEE_FACING, 1), (NEE_AREA, 2)):
        found = interval(render(BALL, options, 1024).second)
        assert factor * predicted in found
        assert 1.1 * factor * predicted not in found


def test_cone_second_moment(render) -> None:
    """L5. In the cone X = ρ L/π · 2π(1-c) cosθ with cosθ uniform in c … 1, c = cosθmax. So E[X] = ρ L (1-c²),
    E[X²] = (2ρL(1-c))² (1-c³)/(3(1-c)), and the variance is E[X]² ((1-c)/(1+c))²/3.
    """
    c = np.sqrt(1 - (RADIUS / DISTANCE) ** 2)
    found = render(BALL, NEE_CONE)
    assert ALBEDO * (1 - c**2) in interval(found.mean)
    assert (2 * ALBEDO * (1 - c)) ** 2 * (1 - c**3) / (3 * (1 - c)) in interval(found.second)
    relative = ratio(found.variance, found.squared_mean)
    assert ((1 - c) / (1 + c)) ** 2 / 3 in relative
    assert ((1 - c) / (1 + c)) ** 2 / 3 * 1.03 not in relative


def test_cone_beats_facing(render) -> None:
    """L5. By the variances that theory has for both."""
    c = np.sqrt(1 - (RADIUS / DISTANCE) ** 2)
    mean = ALBEDO * (1 - c**2)
    predicted = (facing_second_moment() / mean**2 - 1) / (((1 - c) / (1 + c)) ** 2 / 3)
    found = ratio(render(BALL, NEE_FACING, 1024).variance, render(BALL, NEE_CONE, 1024).variance)
    assert predicted > 10
    assert predicted in found
    assert 1.05 * predicted not in found


# --- One of N lights with one ray (L4, L6).


def lamps(*radiances: float | str, height: float = 2) -> str:
    """Up to three square lamps over a floor, side by side, of different size."""
    places = ((-0.5, 0.3), (0.5, 0.3), (1.6, 0.15))
    each = zip(places, radiances, strict=False)
    return "".join(square(x, height, half, glow(radiance)) for (x, half), radiance in each)


def test_knowing_that_a_light_is_occluded_halves_the_second_moment(render) -> None:
    """L6. Two equal lights, one of them hidden. Situation 1: each with p = 1/2, E[X²] = M₁/(1/2). Situation
    2: the free one with p = 1, E[X²] = M₁. What is learned (L18) comes close to that: E[X²] = M₁/p₁ with p₁
    next to 1, since the hidden one keeps a chance of 0.1 % or so.
    """
    around = FLOOR + square(0.5, 0.75, 0.4)
    hidden, known = (world(around + lamps(1, second, height=0.8), fov=30) for second in (1, 0))
    nothing_known = render(hidden, "--estimator nee --light-points area --light-choice uniform")
    all_known = render(known, NEE_AREA)
    learned = render(hidden, "--estimator nee --light-points area --light-choice learned")
    found = ratio(nothing_known.second, all_known.second)
    assert 2 in found
    assert found.width < 0.1
    assert ratio(learned.second, all_known.second).high < 1.01
    assert ratio(learned.variance, all_known.variance).high < 1.1
    assert ratio(nothing_known.variance, all_known.variance).low > 2
    for other in (nothing_known, learned):
        assert 1 in ratio(other.mean, all_known.mean)


@pytest.mark.parametrize("choice", ["uniform", "power"])
def test_second_moments_of_lights_add_over_their_probabilities(render, choice: str) -> None:
    """L4. E[X²] = Σ Mᵢ/pᵢ, Mᵢ being that of light i alone: whatever the pᵢ, and colours beside. Another pᵢ
    predicts another sum.
    """
    colours = [(8.0, 1.0, 3.0), (1.0, 2.0, 0.5), (20.0, 10.0, 40.0)]
    text = ["{}, {}, {}".format(*colour) for colour in colours]
    alone = [
        render(world(FLOOR + lamps(*(c if i == k else 0 for i, c in enumerate(text))), fov=30), NEE_AREA)
        for k in range(3)
    ]
    power = np.array([sum(colour) * half**2 for colour, half in zip(colours, (0.3, 0.3, 0.15), strict=True)])
    probabilities = {"uniform": np.full(3, 1 / 3), "power": power / power.sum()}
    options = f"--estimator nee --light-points area --light-choice {choice}"
    together = render(world(FLOOR + lamps(*text), fov=30), options)
    for name, p in probabilities.items():
        predicted = sum(one.second / p_i for one, p_i in zip(alone, p, strict=True))
        assert (1 in ratio(together.second, predicted)) is (name == choice)


@pytest.mark.parametrize(
    ("name", "spp", "width", "times"),
    [("many-lights", 8, 0.1, (1, 1)), ("thousand-lights", 64, 0.2, (10, 25))],
)
def test_choosing_by_contribution_beats_chance(
    render, scene, name: str, spp: int, width: float, times: tuple[float, float]
) -> None:
    """L6, L18. With many lights, near ones and far ones, and some behind others. Of a thousand, by
    contribution (half of it by chance) at least 10 times, learned at least 25 times. (Of a thousand lights
    chosen by chance so few samples matter that their own mean says little.)
    """
    by_chance, by_contribution, learned = (
        render(scene(name), f"--estimator nee --light-points area --light-choice {choice}", spp, 6)
        for choice in ("uniform", "contribution", "learned")
    )
    for better, least in zip((by_contribution, learned), times, strict=True):
        assert ratio(by_chance.variance, better.variance).low > least
    same = ratio(learned.mean, by_contribution.mean)
    assert 1 in same
    assert same.width < width


# --- One ray over the hemisphere (L7, L8, L9).


def test_the_cosine_leaves_nothing_to_chance_under_an_even_sky(render) -> None:
    """L8, L9. Uniform: X = 2ρL cosθ with cosθ uniform in 0 … 1, variance E[X]²/3. By the cosine: X = ρL."""
    scene = world(FLOOR + sky())
    uniform, cosine = (render(scene, f"--estimator walk --hemisphere {h}") for h in ("uniform", "cosine"))
    found = ratio(uniform.variance, uniform.squared_mean)
    assert 1 / 3 in found
    assert 0.34 not in found
    assert ALBEDO in interval(uniform.mean)
    assert np.allclose(cosine.mean, ALBEDO, rtol=1e-6)
    assert cosine.variance.max() < 1e-12


def test_the_walk_meets_the_light_or_nothing(render) -> None:
    """L7. With one bounce X is ρL or 0, so E[X²] = ρL E[X], in any picture without a lamp and not just on
    average.
    """
    found = render(world(FLOOR + square(0, 1.5, 0.8, glow(3)), fov=40), WALK, batches=2)
    assert np.allclose(found.second, 3 * ALBEDO * found.mean, rtol=1e-5)
    assert not np.allclose(found.second, 2.97 * ALBEDO * found.mean, rtol=1e-5)


# --- A square lamp straight above a point: next event estimation and the walk (L10), both (L13).


class Lamp:
    """Theory of one sample at the point below a square of half side a at height h, with ρ and L = 1.

    Directions to the lamp have the densities p_l = d²/(A cosθ_light) by area and p_b = cosθ/π by the walk,
    and X = g/p with g = ρ L cosθ/π.
    """

    def __init__(self, half: float, height: float) -> None:
        nodes, weights = np.polynomial.legendre.leggauss(100)
        x, y = np.meshgrid(half * nodes, half * nodes)
        distance = np.sqrt(x**2 + y**2 + height**2)
        cosine, area = height / distance, 4 * half**2
        self.dw = half**2 * np.outer(weights, weights) * cosine / distance**2
        self.g = ALBEDO * cosine / np.pi
        self.by_area = distance**2 / (area * cosine)
        self.by_walk = cosine / np.pi
        self.mean = float((self.g * self.dw).sum())
        self.scene = world(FLOOR + square(0, height, half, glow(1)), eye="0.01, 0, 0.5")

    def second(self, pdf: Array | float) -> float:
        """E[X²] with directions of that density."""
        return float((self.g**2 / pdf * self.dw).sum())

    @property
    def solid_angle(self) -> float:
        return float(self.dw.sum())

    def mis_variance(self, exponent: int) -> float:
        """One sample of each: V = Σ ∫ (w g)²/p dω - (∫ w g dω)², w = p^β / Σ p^β."""
        pdfs = (self.by_area, self.by_walk)
        total = sum(p**exponent for p in pdfs)
        shares = [p**exponent / total * self.g for p in pdfs]
        seconds = sum((s**2 / p * self.dw).sum() for s, p in zip(shares, pdfs, strict=True))
        return float(seconds - sum((s * self.dw).sum() ** 2 for s in shares))


FAR, NEAR = Lamp(half=0.2, height=2), Lamp(half=1, height=0.6)


@pytest.mark.parametrize("lamp", [FAR, NEAR], ids=["far", "near"])
@pytest.mark.parametrize("options", [WALK, NEE_AREA, NEE_CONE, f"{MIS} balance", f"{MIS} power"])
def test_all_ways_have_the_same_mean(render, lamp: Lamp, options: str) -> None:
    """The whole lecture: the same on average. Direct and indirect light do not overlap (L10), and weights sum
    to 1 (L13).
    """
    found = interval(render(lamp.scene, options).mean)
    assert lamp.mean in found
    assert 1.2 * lamp.mean not in found


def test_next_event_estimation_beats_the_walk_at_a_far_lamp(render) -> None:
    """L10. The walk has E[X²] = ρL E[X]; an explicit ray to a far lamp always brings about E[X], so E[X²] is
    nearly E[X]²: the ratio is nearly ρL/E[X].
    """
    walk, nee = render(FAR.scene, WALK, 1024), render(FAR.scene, NEE_AREA)
    predicted = ALBEDO * FAR.mean / FAR.second(FAR.by_area)
    assert predicted == pytest.approx(ALBEDO / FAR.mean, rel=0.02)
    assert predicted > 50
    found = ratio(walk.second, nee.second)
    assert predicted in found
    assert 1.15 * predicted not in found


def test_the_walk_beats_next_event_estimation_at_a_near_lamp(render) -> None:
    """L9, L10. Points on a near lamp vary much in distance and cosines; neither technique is always best."""
    walk, nee = render(NEAR.scene, WALK), render(NEAR.scene, NEE_AREA)
    found = ratio(nee.variance, walk.variance)
    area, both = NEAR.second(NEAR.by_area) - NEAR.mean**2, ALBEDO * NEAR.mean - NEAR.mean**2
    assert area / both in found
    assert found.low > 1


def test_solid_angle_beats_area_at_a_near_lamp(render) -> None:
    """L5 beyond the sphere: uniform by solid angle, X = ρ L/π · Ω cosθ."""
    predicted = NEAR.second(NEAR.by_area) / NEAR.second(1 / NEAR.solid_angle)
    area, angle = render(NEAR.scene, NEE_AREA), render(NEAR.scene, NEE_CONE)
    found = ratio(area.second, angle.second)
    assert predicted in found
    assert 1.05 * predicted not in found
    assert ratio(angle.variance, area.variance).high < 1


@pytest.mark.parametrize(("heuristic", "exponent"), [("balance", 1), ("power", 2)])
@pytest.mark.parametrize("lamp", [FAR, NEAR], ids=["far", "near"])
def test_variance_of_multiple_importance_sampling(render, lamp: Lamp, heuristic: str, exponent: int) -> None:
    """L13. By quadrature of the lecture's weights; the other exponent's lies outside where they differ."""
    found = interval(render(lamp.scene, f"{MIS} {heuristic}", 512).variance)
    assert lamp.mis_variance(exponent) in found
    other = lamp.mis_variance(3 - exponent)
    assert abs(other / lamp.mis_variance(exponent) - 1) < 0.02 or other not in found


def at_depth_two() -> list[str]:
    """Scenes in which one light can be found both ways."""
    wanted = {technique(name) for name in ("walk-cosine", "nee", "mis-balance", "mis-power")}

    def possible(name: str) -> bool:
        return wanted <= set(applicable(read_content(variants.scene_path(name), {"depth": "2"})))

    return [name for name in variants.scene_names() if possible(name)]


@pytest.mark.sample(20)
@pytest.mark.parametrize("name", at_depth_two())
def test_multiple_importance_sampling_is_never_much_worse(render, scene, name: str) -> None:
    """L13. One sample of each of two techniques, so with n = 1 in Veach's theorem 9.2,
    V_balance ≤ V + (1/min n - 1/Σn) μ² = V + μ²/2, V being either technique's alone.

    Why: V_balance = S - Σ μᵢ², S = Σ ∫ (w g)²/p. The balance heuristic makes S least, so S ≤ V + μ², and two
    parts that sum to μ have Σ μᵢ² ≥ μ²/2. The power heuristic's S is at most 9/8 as large: with t the ratio
    of the densities, (1+t³)(1+t)/(1+t²)² = (1+s)(1-s/2) where s = 2t/(1+t²), most at s = 1/2. So
    V_power ≤ 9/8 V + 5/8 μ². Both are linear: they hold for sums over pixels. For μ² stands the square of a
    pixel's mean, which is less than the mean of squares: a little stricter than the theorem. Techniques whose
    variance may be infinite bound nothing and are left out.
    """

    def all_of(key: str) -> Batches:
        return render(scene(name), [*technique(key).options, "-Ddepth=2"], 32, 8)

    unbounded = read_content(scene(name)).unbounded
    balance, power = all_of("mis-balance"), all_of("mis-power")
    for alone in [all_of(key) for key in ("walk-cosine", "nee") if key not in unbounded]:
        squared_mean = alone.squared_mean_of_all
        assert interval(balance.variance - alone.variance).high < squared_mean / 2
        assert interval(power.variance - 9 / 8 * alone.variance).high < 5 / 8 * squared_mean


def test_the_bound_is_not_empty(render) -> None:
    """L13. The walk alone is much worse than next event estimation at a far lamp, and breaks such a bound."""
    walk, nee = render(FAR.scene, WALK), render(FAR.scene, NEE_AREA)
    assert interval(walk.variance - nee.variance - nee.squared_mean / 2).low > 0


def test_all_weights_have_the_same_mean(render, scene) -> None:
    """L13. Balance, power, and with the chance of survival in the walk's density, over eight bounces."""
    names = ("mis-balance", "mis-power", "mis-survival", "nee")
    found = {name: render(scene("cornell-box"), technique(name).options, 8) for name in names}
    for name in names[1:]:
        compared = ratio(found[name].mean, found["mis-balance"].mean)
        assert 1 in compared
        assert compared.width < 0.03


# --- Russian roulette (L14).

GREY = 0.75


def furnace(depth: int) -> str:
    """A closed grey sphere that glows with L = 1 all over, from inside; roulette from the first bounce."""
    body = f"""<shape type="sphere"><float name="radius" value="2"/>
    <boolean name="flip_normals" value="true"/>{diffuse(GREY)}{glow(1)}</shape>"""
    return world(body, depth=depth, rr_depth=1)


def test_roulette_lets_a_path_live_as_long_as_light_does(render) -> None:
    """L14. With survival a, the albedo, the throughput stays 1, X = L N, and the number of rays N has
    P(N > n) = aⁿ: mean 1/(1-a), variance a/(1-a)². The rays are counted as well.
    """
    found = render(furnace(-1), WALK)
    rays = interval(found.rays)
    assert 1 / (1 - GREY) in rays
    assert 1 / (1 - GREY) in interval(found.mean)
    assert GREY / (1 - GREY) ** 2 in interval(found.variance)
    for wrong in (GREY / (1 - GREY), 1.01 / (1 - GREY)):
        assert wrong not in rays


def test_roulette_pays_in_variance_for_shorter_paths(render) -> None:
    """L14, L19. Six rays at most: without roulette always six and X = L Σ aⁿ for certain; with it the same on
    average from fewer rays.
    """
    scene, total = furnace(6), (1 - GREY**6) / (1 - GREY)
    without, with_roulette = (render(scene, f"{WALK} --roulette {r}") for r in ("none", "survival"))
    assert np.allclose(without.mean, total, rtol=1e-6)
    assert without.variance.max() < 1e-10
    assert (without.rays == 6).all()
    assert total in interval(with_roulette.mean)
    assert total in interval(with_roulette.rays)
    assert 1.01 * total not in interval(with_roulette.mean)


def test_roulette_in_a_room(render, scene) -> None:
    """L14. The same mean, more variance of a sample, fewer rays."""
    without, roulette = (
        render(scene("cornell-box"), technique(name).options, 8) for name in ("nee-no-roulette", "nee")
    )
    assert 1 in ratio(roulette.mean, without.mean)
    assert ratio(roulette.variance, without.variance).low > 1
    assert ratio(roulette.rays, without.rays).high < 0.9


# --- Glass, mixed materials, light tracing (L15, L16, L17).


def fresnel(degrees: float, ratio_of_indices: float) -> tuple[float, float]:
    """Reflectance at an angle to the normal, exact and Schlick's, of a boundary; the ratio of the indices is
    that here over that beyond.
    """
    c = np.cos(np.radians(degrees))
    beyond = np.sqrt(1 - ratio_of_indices**2 * (1 - c**2))
    s = (ratio_of_indices * c - beyond) / (ratio_of_indices * c + beyond)
    p = (ratio_of_indices * beyond - c) / (ratio_of_indices * beyond + c)
    at_right_angle = ((ratio_of_indices - 1) / (ratio_of_indices + 1)) ** 2
    x = 1 - (beyond if ratio_of_indices > 1 else c)
    return (s**2 + p**2) / 2, at_right_angle + (1 - at_right_angle) * x**5


def boundary(degrees: float, here: float, beyond: float) -> str:
    """Glass with an even sky on this side and black below."""
    glass = f"""<bsdf type="dielectric"><float name="int_ior" value="{beyond}"/>
    <float name="ext_ior" value="{here}"/></bsdf>"""
    x, z = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
    pane = f'<shape type="rectangle">{glass}</shape>'
    return world(pane + floor(diffuse(0), z=-1) + sky(), eye=f"{x}, 0, {z}")


@pytest.mark.parametrize(
    ("degrees", "here", "beyond"), [(60, 1.0, 1.5), (80, 1.0, 1.5), (38, 1.5, 1.0), (45, 1.0, 2.4)]
)
def test_schlick_is_biased_by_the_predicted_amount(
    render, degrees: float, here: float, beyond: float
) -> None:
    """L15. What reflects shows the sky: E[X] = R(θ) L. Each formula gives its own, and not the other's."""
    exact, schlick = fresnel(degrees, here / beyond)
    scene = boundary(degrees, here, beyond)
    for formula, right, wrong in (("exact", exact, schlick), ("schlick", schlick, exact)):
        found = interval(render(scene, f"{WALK} --fresnel {formula}", 1024).mean)
        assert right in found
        assert wrong not in found


def test_one_of_reflection_and_refraction(render) -> None:
    """L15. X is L with the chance R, else 0: variance R (1-R) L². In total reflection nothing is left to
    chance.
    """
    r, _ = fresnel(60, 1 / 1.5)
    assert r * (1 - r) in interval(render(boundary(60, 1.0, 1.5), WALK).variance)
    total = render(boundary(50, 1.5, 1.0), WALK, batches=2)
    assert np.allclose(total.mean, 1, rtol=1e-6)
    assert total.variance.max() < 1e-12


def blend(weight: float, first: str, second: str) -> str:
    """A floor of both materials, the second with that weight, under an even sky."""
    mixed = f'<bsdf type="blendbsdf"><float name="weight" value="{weight}"/>{first}{second}</bsdf>'
    return world(floor(mixed) + sky(), eye="0.3, 0, 1")


MIRROR = """<bsdf type="conductor"><string name="material" value="none"/>
    <rgb name="specular_reflectance" value="0.9"/></bsdf>"""


def test_one_part_of_a_mixed_material(render) -> None:
    """L16. X is one part's reflectance, with the chance of its share: the mean is that of the mixture, the
    variance w (1-w) (ρ₁-ρ₂)². Parts that are both diffuse are one diffuse, without a choice.
    """
    found = render(blend(0.3, diffuse(0.2), MIRROR), WALK)
    assert 0.7 * 0.2 + 0.3 * 0.9 in interval(found.mean)
    assert 0.3 * 0.2 + 0.7 * 0.9 not in interval(found.mean)
    assert 0.3 * 0.7 * (0.9 - 0.2) ** 2 in interval(found.variance)
    joined = render(blend(0.3, diffuse(0.2), diffuse(0.9)), WALK, batches=2)
    assert np.allclose(joined.mean, 0.7 * 0.2 + 0.3 * 0.9, rtol=1e-6)
    assert joined.variance.max() < 1e-12


def test_light_sampled_for_a_mixed_material(render) -> None:
    """L11, L16. Next event estimation serves the diffuse part alone, the walk the mirror: none is missing."""
    scene = blend(0.3, diffuse(0.2), MIRROR)
    for estimator in ("nee", "mis"):
        found = interval(render(scene, f"--estimator {estimator}").mean)
        assert 0.7 * 0.2 + 0.3 * 0.9 in found
        assert 0.7 * 0.2 not in found
        assert 0.3 * 0.9 not in found


def test_tracing_from_the_light_shows_the_same_room(render, scene) -> None:
    """L17. Image and quarters."""
    light, nee = (render(scene("cornell-box"), technique(name).options, 16) for name in ("light", "nee"))
    halves = (slice(None, 32), slice(32, None))
    for rows, columns in [(slice(None), slice(None)), *((a, b) for a in halves for b in halves)]:
        found = ratio(*(b.pixels[:, rows, columns].mean(axis=(1, 2, 3)) for b in (light, nee)))
        assert 1 in found
        assert found.width < 0.05
