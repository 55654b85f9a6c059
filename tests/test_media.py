# ruff: noqa: E501
"""Participating media: what is scattered, absorbed and let through, against closed forms, quadrature and Mitsuba's volpath;
and boundaries that are no vertices.
"""

from __future__ import annotations

import subprocess
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest
from building import ROOT, kernels
from sampling import LEVEL, Array, Driver, chi_squared, uniforms

from raycheck.base.images import load_image
from raycheck.calibration import mutants

SKY = '<emitter type="constant"/>'
NULL = '<bsdf type="null"/>'
SIGMAS = 5
"""How many standard errors a mean may be off: of the about 100 that are looked at here one in 20,000 runs is."""


def number(name: str, value: object) -> str:
    return f'<{"rgb" if "," in str(value) else "float"} name="{name}" value="{value}"/>'


def medium(sigma: object, albedo: object = 0.75, g: float | None = None, name: str = "interior") -> str:
    phase = '<phase type="isotropic"/>' if g is None else f'<phase type="hg">{number("g", g)}</phase>'
    side = f' name="{name}"' if name else ""
    extinction = number("scale", sigma) if "," not in str(sigma) else number("sigma_t", sigma)
    return f'<medium type="homogeneous"{side}>{extinction}{number("albedo", albedo)}{phase}</medium>'


def body(kind: str, inside: str, to_world: str = "", bsdf: str = NULL) -> str:
    return f'<shape type="{kind}"><transform name="to_world">{to_world}</transform>{bsdf}{inside}</shape>'


def scene(
    content: str, integrator: str = "volpath", depth: int = -1, rr: int = 5, fov: float = 40, size: int = 4,
    origin: str = "0 0 -4", target: str = "0 0 0", eye: str = "",
) -> str:  # fmt: skip
    return f"""<scene version="3.0.0">
<integrator type="{integrator}"><integer name="max_depth" value="{depth}"/><integer name="rr_depth" value="{rr}"/></integrator>
<sensor type="perspective"><float name="fov" value="{fov}"/>
<transform name="to_world"><lookat origin="{origin}" target="{target}" up="0 1 0"/></transform>
<film type="hdrfilm"><integer name="width" value="{size}"/><integer name="height" value="{size}"/>
<rfilter type="box"/></film>{eye}</sensor>
{content}
</scene>"""


def run(oneray: Path, folder: Path, text: str, *options: str) -> subprocess.CompletedProcess[str]:
    (folder / "scene.xml").write_text(text)
    command = [oneray, folder / "scene.xml", "-o", folder / "out.exr", "--seed", "3", *options]
    return subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False, timeout=300)


def render(oneray: Path, folder: Path, text: str, *options: str, spp: int = 1000) -> tuple[Array, Array]:
    """Pixels and standard errors, (height, width, 3)."""
    done = run(oneray, folder, text, "--spp", str(spp), "--quiet", *options)
    assert done.returncode == 0, done.stderr
    image = load_image(folder / "out.exr")
    assert image.stderr is not None
    return image.pixels.astype(float), image.stderr.astype(float)


def mean(oneray: Path, folder: Path, text: str, *options: str, spp: int = 1000) -> tuple[Array, Array]:
    """Of the whole picture, by channel: the mean and its standard error."""
    pixels, error = render(oneray, folder, text, *options, spp=spp)
    return pixels.mean((0, 1)), np.sqrt((error**2).sum((0, 1))) / pixels[..., 0].size


def agree(a: tuple[Array, Array], b: tuple[Array, Array], most: float) -> None:
    """Within their errors, which are at most so much of the mean."""
    error = np.hypot(a[1], b[1])
    assert np.all(error <= most * np.abs(b[0])), error / b[0]
    assert np.all(np.abs(a[0] - b[0]) <= SIGMAS * error + 1e-6 * np.abs(b[0])), (a, b, (a[0] - b[0]) / error)


def exactly(value: object) -> tuple[Array, Array]:
    return np.broadcast_to(np.asarray(value, float), (3,)), np.zeros(3)


ESTIMATORS = {
    "walk": ("--estimator", "walk"),
    "nee": ("--estimator", "nee"),
    "mis": (),
    "mis-balance": ("--mis", "balance", "--mis-pdf", "survival"),
    "mis-survival": ("--mis-pdf", "survival"),
}

# ---- The functions.


def test_logarithm(driver: Driver, wide: list[Driver]) -> None:
    x = np.concatenate([2.0 ** -np.arange(60), uniforms(20_000, 1)[0], 1 - 2.0 ** -np.arange(2, 30)])
    x = np.concatenate([x, [np.sqrt(0.5), np.nextafter(np.sqrt(0.5), 0)]])
    np.testing.assert_allclose(driver("logarithm", x)[0], np.log(x), rtol=4e-16, atol=0)
    single = x.astype(np.float32).astype(float)
    single = single[single < 1]
    np.testing.assert_allclose(wide[1]("logarithm", single)[0], np.log(single), rtol=3e-7, atol=0)


G = (-0.99, -0.5, -1e-9, 0.0, 0.3, 0.9, 0.99)


def cumulative(g: float, c: Array) -> Array:
    """The chance that the cosine is below c: the integral of 2π times the phase function."""
    if abs(g) < 1e-6:
        return (1 + c) / 2
    return (1 - g * g) / (2 * g) * (1 / np.sqrt(1 + g * g - 2 * g * c) - 1 / (1 + g))


@pytest.mark.parametrize("g", G)
def test_phase_function(driver: Driver, wide: list[Driver], g: float) -> None:
    """Directions are distributed by the formula, which is the density that is told of them."""
    n, d = 200_000, np.array([0.48, -0.6, 0.64])
    u = uniforms(n, 5, 2)
    for one in (driver, *wide):
        x, y, z, pdf = one("phase", g, d[:, None], u)
        c = d @ (x, y, z)
        np.testing.assert_allclose(x * x + y * y + z * z, 1, rtol=0, atol=2e-6)
        edges = np.linspace(0, 1, 41)
        found = np.histogram(np.clip(cumulative(g, np.clip(c, -1, 1)), 0, 1), edges)[0]
        assert chi_squared(found, np.full(40, n / 40)) > LEVEL
        assert np.allclose(one("phase_pdf", g, d[:, None], np.array([x, y, z]))[0], pdf, rtol=1e-4)
        assert abs(c.mean() - g) < SIGMAS / np.sqrt(n)
    x, y, z, pdf = driver("phase", g, d[:, None], u)
    c = d @ (x, y, z)
    expected = (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * c) ** 1.5)
    np.testing.assert_allclose(pdf, expected, rtol=1e-9)


# ---- Closed forms.


@pytest.mark.parametrize("kind", ["sphere", "cube"])
@pytest.mark.parametrize(("sigma", "g"), [(2, None), (10, 0.5), (1000, 0.99), (3, -0.99), (1e-12, None)])
def test_furnace(oneray: Path, tmp_path: Path, kind: str, sigma: float, g: float | None) -> None:
    """What absorbs nothing is not seen before a sky of 1: each walk brings 1."""
    text = scene(body(kind, medium(sigma, 1, g)) + SKY)
    pixels, _ = render(oneray, tmp_path, text, "--estimator", "walk", "--roulette", "survival", spp=50)
    assert np.all(np.abs(pixels - 1) < 1e-6)
    peaked = abs(g or 0) > 0.9  # no sample of the sky finds the peak
    for estimator in ("mis", "mis-balance") if peaked or sigma > 10 else ESTIMATORS:
        found = mean(oneray, tmp_path, text, *ESTIMATORS[estimator], spp=4000 if sigma < 100 else 500)
        agree(found, exactly(1), 0.05 if peaked else 8e-3)


def test_furnace_of_colours(oneray: Path, tmp_path: Path) -> None:
    """One channel's flights serve all three, which are 3 together in each sample: none weighs more."""
    text = scene(
        body("sphere", medium(".02,.2,1", "1", 0.3).replace("</medium>", number("scale", 5) + "</medium>"))
        + SKY
    )
    pixels, _ = render(oneray, tmp_path, text, "--estimator", "walk", spp=4000)
    assert np.allclose(pixels.sum(2), 3, atol=1e-5)
    for estimator in ("walk", "nee", "mis", "mis-balance"):
        agree(mean(oneray, tmp_path, text, *ESTIMATORS[estimator], spp=10_000), exactly(1), 0.02)


@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize("estimator", ["walk", "nee", "mis"])
def test_beer(oneray: Path, tmp_path: Path, precision: str, estimator: str) -> None:
    """What an absorber of thickness 2 lets through of a sky, by channel."""
    text = scene(body("sphere", medium(".2,.5,1", 0)) + SKY, fov=0.01)
    options = (*ESTIMATORS[estimator], "--precision", precision)
    agree(mean(oneray, tmp_path, text, *options, spp=40_000), exactly(np.exp([-0.4, -1, -2])), 0.01)


SLAB = '<scale x="9" y="9" z="{}"/><translate z="{}"/>'
LAMP = '<emitter type="point"><point name="position" x="0" y="0" z="-5"/>{}</emitter>'
FLOOR = body(
    "rectangle",
    "",
    '<scale value="5"/><rotate x="1" angle="180"/><translate z="1"/>',
    '<bsdf type="diffuse"/>',
)


@pytest.mark.parametrize("estimator", ["nee", "mis"])
def test_shadow_rays_pass_boundaries(oneray: Path, tmp_path: Path, estimator: str) -> None:
    """A wall lit by a lamp in a point through nothing, an absorber, an empty body and another absorber: I ρ/πd² e^(-Σσt),
    exactly, in every sample, since the eye sees the wall from beside the lamp through the same.
    """
    colour = np.array([0.1, 0.4, 0.9])
    slabs = (
        body("cube", medium(".1,.4,.9", 0), SLAB.format(0.5, -2))
        + body("cube", "", SLAB.format(0.25, -1))
        + body("cube", medium(2, 0), SLAB.format(0.125, 0))
    )
    content = slabs + FLOOR + LAMP.format(number("intensity", 7))
    text = scene(content, depth=2, fov=0.001, origin="0 0 -5", target="0 0 1", size=1)
    through = np.exp(-colour - 0.5)
    expected = 7 * 0.5 / np.pi / 36 * through
    found, error = mean(oneray, tmp_path, text, *ESTIMATORS[estimator], spp=100_000)
    agree((found / through, error / through), exactly(expected), 0.03)
    seen = scene(FLOOR + slabs + LAMP.format(number("intensity", 7)), depth=2, fov=0.001, origin="0 0 .9",
                 target="0 0 1", size=1)  # fmt: skip
    pixels, _ = render(oneray, tmp_path, seen, *ESTIMATORS[estimator], spp=64)
    np.testing.assert_allclose(pixels[0, 0], expected, rtol=2e-5)


def airlight(sigma: float, albedo: float, g: float, centre: Array, radius: float, depth: float) -> float:
    """What a ray from 0 along z, up to `depth`, gathers by one scattering of a sphere of radiance 1."""
    t, weight = np.polynomial.legendre.leggauss(400)
    t, weight = (t + 1) * depth / 2, weight * depth / 2
    u, share = np.polynomial.legendre.leggauss(60)
    total = 0.0
    for at, w in zip(t, weight, strict=True):
        to = centre - np.array([0, 0, at])
        d = np.linalg.norm(to)
        axis = to / d
        least = np.sqrt(1 - (radius / d) ** 2)
        cosine = least + (1 - least) * (u + 1) / 2
        turn = np.arange(64) * 2 * np.pi / 64
        side = np.cross(axis, [1.0, 0, 0])
        side /= np.linalg.norm(side)
        up = np.cross(side, axis)
        sine = np.sqrt(1 - cosine**2)
        z = cosine[:, None] * axis[2] + sine[:, None] * (np.cos(turn) * side[2] + np.sin(turn) * up[2])
        way = d * cosine - np.sqrt(np.maximum(radius**2 - (d * sine) ** 2, 0))
        phase = (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * z) ** 1.5)
        inner = (phase.mean(1) * np.exp(-sigma * way) * share).sum() * (1 - least) / 2 * 2 * np.pi
        total += w * sigma * albedo * np.exp(-sigma * at) * inner
    return total


@pytest.mark.parametrize(("sigma", "g"), [(0.2, 0.0), (0.2, 0.8), (1.0, -0.6), (1.0, 0.0), (0.01, 0.0)])
@pytest.mark.parametrize("estimator", ["walk", "nee", "mis", "mis-balance", "mis-survival"])
def test_airlight(oneray: Path, tmp_path: Path, sigma: float, g: float, estimator: str) -> None:
    """The glow of fog before a black wall around a small sphere light beside the view."""
    lamp = (
        '<shape type="sphere"><point name="center" x="0" y="1.5" z="3"/><float name="radius" value=".4"/>'
        f'<emitter type="area">{number("radiance", 1)}</emitter></shape>'
    )
    black = f'<bsdf type="diffuse">{number("reflectance", 0)}</bsdf>'
    wall = body("rectangle", "", '<scale value="9"/><rotate y="1" angle="180"/><translate z="6"/>', black)
    text = scene(
        lamp + wall, depth=2, fov=0.001, origin="0 0 0", target="0 0 1", eye=medium(sigma, 0.8, g, ""), size=1
    )
    expected = airlight(sigma, 0.8, g, np.array([0, 1.5, 3]), 0.4, 6)
    few = estimator == "walk" or sigma < 0.1
    spp = 800_000 if few else 100_000
    found = mean(oneray, tmp_path, text, *ESTIMATORS[estimator], "--roulette", "survival", spp=spp)
    agree(found, exactly(expected), 0.08 if few else 0.02)


def h_function(albedo: float, mu: float) -> float:
    """Chandrasekhar's H for isotropic scattering: 1/H(μ) = √(1-ϖ) + ϖ/2 ∫ x H(x)/(x + μ) dx."""
    x, w = np.polynomial.legendre.leggauss(200)
    x, w = (x + 1) / 2, w / 2
    h = np.ones_like(x)
    for _ in range(300):
        h = 1 / (np.sqrt(1 - albedo) + albedo / 2 * (w * x * h / (x + x[:, None])).sum(1))
    return float(1 / (np.sqrt(1 - albedo) + albedo / 2 * (w * x * h / (x + mu)).sum()))


@pytest.mark.parametrize(("albedo", "sigma"), [(0.5, 1e3), (0.9, 1e3), (0.99, 1e4), (0.5, 1e6)])
@pytest.mark.parametrize("estimator", ["walk", "mis", "mis-survival"])
def test_half_space(oneray: Path, tmp_path: Path, albedo: float, sigma: float, estimator: str) -> None:
    """A half space that scatters isotropically under a sky of 1 shows 1 - H(μ) √(1-ϖ) (Chandrasekhar, Radiative Transfer,
    1950): a cube of very many mean free paths, seen straight on and at an angle.
    """
    for mu in (1.0, 0.5):
        origin = f"0 {4 * np.sqrt(1 - mu * mu):.15g} {-1 - 4 * mu:.15g}"
        wide = '<scale x="1" y="1" z="1"/>'
        text = scene(
            body("cube", medium(sigma, albedo), wide) + SKY, fov=0.01, origin=origin, target="0 0 -1", size=1
        )
        expected = 1 - h_function(albedo, mu) * np.sqrt(1 - albedo)
        agree(mean(oneray, tmp_path, text, *ESTIMATORS[estimator], spp=40_000), exactly(expected), 0.02)


# ---- One integral, many ways.

LIGHT = (
    '<shape type="sphere"><point name="center" x=".3" y="2.6" z="-.3"/><float name="radius" value=".6"/>'
    '<emitter type="area"><float name="radiance" value="30"/></emitter></shape>'
)
SECOND = (
    '<shape type="rectangle"><transform name="to_world"><scale value=".5"/><rotate y="1" angle="90"/>'
    '<translate x="-2.5"/></transform><emitter type="area"><rgb name="radiance" value="20,5,1"/></emitter></shape>'
)
GROUND = body(
    "rectangle",
    "",
    '<scale value="4"/><rotate x="1" angle="-90"/><translate y="-1.3"/>',
    '<bsdf type="diffuse"/>',
)
INNER = body(
    "cube", medium(1, ".9,.9,.5", -0.4) + medium(0.5, ".9,.5,.8", 0.2, "exterior"),
    '<scale value=".4"/><rotate y="1" angle="30"/>',
)  # fmt: skip
MASK = '<bsdf type="mask"><float name="opacity" value=".3"/><bsdf type="twosided"><bsdf type="diffuse"/></bsdf></bsdf>'
ROOMS = {
    "nested": (body("sphere", medium(0.5, ".9,.5,.8", 0.2)) + INNER + LIGHT + GROUND, ""),
    "fog": (LIGHT + SECOND + GROUND, medium(0.3, 0.8, 0.5, "")),
    "milk in glass": (body("sphere", medium(2, ".9,.7,.3", 0.3), "", '<bsdf type="dielectric"/>') + SKY + GROUND, ""),
    "rough boundary": (
        body("sphere", medium(1, 0.9), "", '<bsdf type="roughdielectric"><float name="alpha" value=".3"/></bsdf>')
        + SKY + GROUND, "",
    ),
    "masks and panes": (
        body("rectangle", "", '<translate z="-1.2"/>', MASK)
        + body("rectangle", "", '<rotate x="1" angle="30"/><translate z="-1"/>', '<bsdf type="thindielectric"/>')
        + LIGHT + SECOND + GROUND, "",
    ),
    "mesh": (body("sphere", medium(1, 0.9, 0.7)) + body("sphere", "", '<translate x="1.8"/>', MASK) + LIGHT
             + '<emitter type="point"><point name="position" x="-2" y="12" z="-9"/>'
             '<float name="intensity" value="100"/></emitter>' + GROUND, ""),
}  # fmt: skip


@pytest.mark.parametrize("room", ROOMS)
@pytest.mark.parametrize("depth", [3, -1])
def test_mitsubas_volpath(oneray: Path, tmp_path: Path, room: str, depth: int) -> None:
    """Grey extinction, so that Mitsuba's channels are right one by one."""
    content, eye = ROOMS[room]
    text = scene(content, depth=depth, eye=eye)
    mi.set_variant("scalar_rgb")
    loaded = mi.load_string(text)
    renders = [np.asarray(mi.render(loaded, spp=1500, seed=k), float).mean((0, 1)) for k in range(6)]
    theirs = np.mean(renders, 0), np.std(renders, 0, ddof=1) / np.sqrt(6)
    ours = mean(oneray, tmp_path, text, spp=10_000)
    agree(ours, theirs, 0.03)


COLOURED = body(
    "sphere", medium(".1,.4,1", ".9,.99,.8", 0.4).replace("</medium>", number("scale", 3) + "</medium>")
)


@pytest.mark.parametrize("room", [*ROOMS, "coloured"])
@pytest.mark.parametrize("roulette", [1, 100])
def test_estimators_have_one_mean(oneray: Path, tmp_path: Path, room: str, roulette: int) -> None:
    content, eye = ROOMS.get(room, (COLOURED + LIGHT + SECOND + GROUND, ""))
    ways = [
        way
        for way in ("walk", "nee", "mis-balance", "mis-survival")
        if "point" not in content or way != "walk"
    ]
    if '"point"' in content:
        ways.remove("walk") if "walk" in ways else None
    text = scene(content, rr=roulette, depth=30, eye=eye)
    whole = mean(oneray, tmp_path, text, spp=8000)
    for way in ways:
        agree(mean(oneray, tmp_path, text, *ESTIMATORS[way], spp=8000), whole, 0.05)


def test_a_body_may_be_cut_in_two(oneray: Path, tmp_path: Path) -> None:
    """A boundary with the same on both sides changes nothing, nor does one within the other that has none of its own."""
    whole = scene(body("cube", medium(1, ".9,.9,.5", 0.6)) + LIGHT + GROUND)
    half = '<scale x="1" y="1" z=".5"/><translate z="{}"/>'
    cut = "".join(body("cube", medium(1, ".9,.9,.5", 0.6), half.format(z)) for z in (-0.5, 0.5))
    empty = body("sphere", "", '<scale value=".7"/>')
    one = mean(oneray, tmp_path, whole, spp=20_000)
    agree(mean(oneray, tmp_path, scene(cut + LIGHT + GROUND), spp=20_000), one, 0.01)
    more = body("cube", medium(1, ".9,.9,.5", 0.6)) + empty
    agree(mean(oneray, tmp_path, scene(more + LIGHT + GROUND), spp=20_000), one, 0.01)


def test_walls_block_what_is_behind_them(oneray: Path, tmp_path: Path) -> None:
    """A flat shape that all others are on one side of blocks nothing between two of them, but there is fog behind it."""
    wall = body("rectangle", "", '<rotate y="1" angle="90"/>', '<bsdf type="diffuse"/>')
    far = '<shape type="sphere"><point name="center" x="{}" y="3" z="0"/><float name="radius" value=".1"/>{}</shape>'
    lamp = far.format(-2, '<emitter type="area"><float name="radiance" value="50"/></emitter>').replace(
        'y="3"', 'y="0"'
    )
    eye, black = medium(0.5, 0.8, None, ""), f'<bsdf type="diffuse">{number("reflectance", 0)}</bsdf>'
    at = {"origin": "-1 0 -3", "target": "1 0 1", "fov": 20}
    edge = mean(oneray, tmp_path, scene(wall + lamp, depth=3, eye=eye, **at), spp=40_000)
    within = mean(
        oneray, tmp_path, scene(wall + lamp + far.format(9, black), depth=3, eye=eye, **at), spp=40_000
    )
    agree(edge, within, 0.02)


# ---- Boundaries.


def test_null_boundaries_are_no_vertices(oneray: Path, tmp_path: Path) -> None:
    """To volpath; to path they are, and block rays to lights."""
    bodies = body("sphere", "") + body("cube", "", '<scale value=".3"/>')
    found, _ = render(oneray, tmp_path, scene(bodies + SKY, depth=1), spp=4)
    assert np.all(found == 1)
    found, _ = render(oneray, tmp_path, scene(bodies + SKY, "path", depth=1, fov=1), spp=4)
    assert np.all(found == 0)
    lit = FLOOR + body("cube", "", SLAB.format(0.5, -2)) + LAMP.format("")
    at = {"origin": "0 0 0", "target": "0 0 1"}
    assert np.all(render(oneray, tmp_path, scene(lit, depth=2, **at), spp=4)[0] > 0)
    assert np.all(render(oneray, tmp_path, scene(lit, "path", depth=2, **at), spp=4)[0] == 0)
    pixels, _ = render(oneray, tmp_path, scene(lit, depth=2, **at), "--estimator", "nee", spp=4)
    bare, _ = render(
        oneray, tmp_path, scene(FLOOR + LAMP.format(""), depth=2, **at), "--estimator", "nee", spp=4
    )
    np.testing.assert_allclose(pixels, bare, rtol=1e-6)


def test_path_sees_no_media(oneray: Path, tmp_path: Path) -> None:
    """As Mitsuba's: each picture the same bits as without, and one line says so."""
    content, bare = (body("sphere", inside) + LIGHT + GROUND for inside in (medium(1), ""))
    with_it = run(oneray, tmp_path, scene(content, "path", depth=9), "--spp", "9")
    pixels = load_image(tmp_path / "out.exr").pixels
    assert with_it.stderr.count('is left out: <integrator type="path"> sees none, as in Mitsuba') == 1
    without, _ = render(oneray, tmp_path, scene(bare, "path", depth=9), spp=9)
    assert np.array_equal(pixels, without)


def test_defaults_are_mitsubas(oneray: Path, tmp_path: Path) -> None:
    plain = (
        body("sphere", '<medium name="interior" type="homogeneous"><phase type="hg"/></medium>')
        + LIGHT
        + GROUND
    )
    spelt = body("sphere", medium(1, 0.75, 0.8)) + LIGHT + GROUND
    assert np.array_equal(*(render(oneray, tmp_path, scene(one), spp=9)[0] for one in (plain, spelt)))
    named = spelt.replace("<medium", '<medium id="fog"').split("</medium>")[0].split("<medium")[1]
    shared = f"<medium{named}</medium>".replace(' name="interior"', "", 1)
    by_ref = shared + body("sphere", '<ref name="interior" id="fog"/>') + LIGHT + GROUND
    assert np.array_equal(*(render(oneray, tmp_path, scene(one), spp=9)[0] for one in (spelt, by_ref)))
    mi.set_variant("scalar_rgb")
    theirs = mi.load_string(scene(plain)).shapes()[0].interior_medium()
    said = {
        name: float(value)
        for name, value in mi.traverse(theirs)
        if name in ("scale", "albedo.value.value", "sigma_t.value.value", "phase_function.g")
    }
    assert sorted(said.values()) == pytest.approx([0.75, 0.8, 1, 1]), said


# ---- The same bits, and what is refused.


@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize("room", [*ROOMS, "coloured"])
def test_lanes(oneray: Path, tmp_path: Path, room: str, precision: str) -> None:
    content, eye = ROOMS.get(room, (COLOURED + LIGHT + SECOND + GROUND, ""))
    (tmp_path / "scene.xml").write_text(scene(content, eye=eye, depth=20, size=8))
    films = {}
    for name, lanes in kernels(oneray):
        if name == precision:
            options = ["--samples", "0:7", "--film", tmp_path / "film", "--precision", precision]
            command = [oneray, tmp_path / "scene.xml", *options, "--lanes", lanes, "--quiet"]
            done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
            assert done.returncode == 0, done.stderr
            films[lanes] = (tmp_path / "film").read_bytes()
    assert len(set(films.values())) == 1, sorted(films)


def test_precision(oneray: Path, tmp_path: Path) -> None:
    """Dense and very thin media want double precision."""

    def chosen(sigma: float, albedo: float = 0.5) -> str:
        done = run(oneray, tmp_path, scene(LIGHT + GROUND, depth=9, eye=medium(sigma, albedo, None, "")), "--spp", "1",
                   "--stats", "-")  # fmt: skip
        assert done.returncode == 0, done.stderr
        return "double" if '"double"' in done.stdout else "single"

    assert [chosen(s) for s in (1e6, 1, 1e-12)] == ["double", "single", "double"]
    assert chosen(1, 0.9999) == "double"


REFUSED = {
    "heterogeneous": (body("sphere", '<medium name="interior" type="heterogeneous"/>'), "heterogeneous"),
    "which side": (body("sphere", medium(1, name="")), 'needs name="interior" or name="exterior"'),
    "twice": (body("sphere", medium(1) + medium(2)), "a second medium of the interior"),
    "g": (body("sphere", medium(1, 0.5, 1.0)), '"g" must be in (-1,1), not 1'),
    "albedo": (body("sphere", medium(1, 1.5)), '"albedo" must be in [0,1], not 1.5'),
    "sigma_t": (body("sphere", medium("-1,1,1")), '"sigma_t" must be in [0,inf), not -1'),
    "product": (
        body("sphere", medium(1e-150)),
        "sigma_t times scale is 1e-150: it must be 0 or in [1e-100,1e100]",
    ),
    "phase": (
        body("sphere", medium(1).replace("isotropic", "blendphase")),
        "is not supported (isotropic, hg)",
    ),
    "property": (
        body("sphere", medium(1).replace("sigma_t", "sigma").replace("scale", "sigma_s")),
        '"sigma_s"',
    ),
    "ref": (
        body("sphere", '<ref id="m" name="interior"/>') + '<texture type="checkerboard" id="m"/>',
        "can be referred to",
    ),
}


@pytest.mark.parametrize("what", REFUSED)
def test_refused(oneray: Path, tmp_path: Path, what: str) -> None:
    content, words = REFUSED[what]
    done = run(oneray, tmp_path, scene(content + SKY))
    assert done.returncode == 2 and not (tmp_path / "out.exr").exists()
    [line] = done.stderr.splitlines()
    assert words in line and "scene.xml:" in line


@pytest.mark.parametrize(
    "options",
    [
        ("--estimator", "light"),
        ("--estimator", "bidirectional"),
        ("--estimator", "photons"),
        ("--light-choice", "learned"),
        ("--light-choice", "resampled"),
    ],
)
def test_refused_techniques(oneray: Path, tmp_path: Path, options: tuple[str, str]) -> None:
    done = run(oneray, tmp_path, scene(body("sphere", medium(1)) + LIGHT, depth=9), *options)
    assert done.returncode == 2
    [line] = done.stderr.splitlines()
    assert "media" in line and " ".join(options) in line
    plain = run(oneray, tmp_path, scene(body("sphere", "", "", MASK) + LIGHT, depth=9), *options)
    assert (plain.returncode == 2) == (options != ("--light-choice", "learned"))


def test_an_integrator_of_which_it_is_not_known(oneray: Path, tmp_path: Path) -> None:
    done = run(oneray, tmp_path, scene(body("sphere", medium(1)) + LIGHT, "bdpt", depth=9))
    assert done.returncode == 2
    assert '<medium> is not supported with <integrator type="bdpt">: write volpath' in done.stderr


# ---- Mistakes.

MISTAKES = {mutant.name: mutant for mutant in mutants.catalogue(ROOT / "tests/mutants_media")}
LIT_BY_A_BALL = (
    '<shape type="sphere"><point name="center" x="0" y="1.5" z="3"/><float name="radius" value=".4"/>'
    f'<emitter type="area">{number("radiance", 1)}</emitter></shape>'
)
SHOWN = {
    "sky-in-a-ball": scene(body("sphere", medium(2, 0.8)) + SKY),
    "half-space": scene(body("cube", medium(1e3, 0.5)) + SKY, fov=0.01),
    "airlight": scene(LIT_BY_A_BALL, depth=2, fov=1, origin="0 0 0", target="0 0 1", eye=medium(0.5, 0.8, 0.8, "")),
    "beer": scene(body("sphere", medium(0.5, 0)) + SKY, fov=0.01),
    "two-slabs": scene(FLOOR + body("cube", medium(0.5, 0), SLAB.format(0.5, -2)) + LAMP.format(""), depth=2, fov=0.01,
                       origin="0 0 0", target="0 0 1"),
    "depth": scene(FLOOR + body("cube", "", SLAB.format(0.5, -2)) + LAMP.format(""), depth=2, fov=1),
}  # fmt: skip
WAYS = {"nee": ("--estimator", "nee"), "walk-cosine": ("--estimator", "walk"), "mis-default": ()}


@pytest.mark.sample(2)
@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_seen(oneray: Path, tmp_path: Path, name: str) -> None:
    mutant = MISTAKES[name]
    text, way = SHOWN[mutant.scene], (*WAYS[mutant.shows], "--precision", "double")
    right = mean(oneray, tmp_path, text, *way, spp=4000)
    wrong = mean(mutants.program(mutant), tmp_path, text, *way, spp=4000)
    assert np.all(np.abs(wrong[0] - right[0]) > 8 * np.hypot(right[1], wrong[1]) + 1e-3 * right[0]), (
        right,
        wrong,
    )
    with pytest.raises(AssertionError):
        agree(wrong, right, 0.05)
