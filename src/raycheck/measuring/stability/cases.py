"""The stiff cases: which parameter of which scene is swept, what the picture ought to be, how far it should
hold.

Closed forms are evaluated with mpmath at 60 digits from the numbers of the scene as a program parses them:
rounded to double for oneray, to single for Mitsuba's scalar_rgb. Radiances, W·sr⁻¹·m⁻², are scaled with what
is swept, so that the picture stays within what single floats hold.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import mpmath
import numpy as np
from mpmath import mp, mpf
from numpy.typing import NDArray

from raycheck.base import data
from raycheck.scene import document

Array = NDArray[np.float64]
Settings = Mapping[str, str]

DIGITS = 60


class Parsed:
    """The `<default>`s of a scene with some replaced, as numbers rounded the way a program parses them."""

    def __init__(self, scene: Path, settings: Settings, single: bool = False):
        said = document.read(scene, settings)
        self.root, self.texts = said.root, said.defaults
        self.single = single

    def __call__(self, name: str) -> mpf:
        return self.number(self.texts[name])

    def number(self, text: str | float) -> mpf:
        """A number of the file, exactly as it is after rounding."""
        value = float(self.texts[text[1:]] if isinstance(text, str) and text.startswith("$") else text)
        with np.errstate(over="ignore", under="ignore"):
            return mpf(float(np.float32(value)) if self.single else value)

    def numbers(self, name: str) -> list[mpf]:
        return [self.number(word) for word in self.texts[name].replace(",", " ").split()]


@dataclass(frozen=True)
class Truth:
    """The value that the picture ought to have, and the one that its error is relative to."""

    value: mpf
    unit: mpf


@dataclass(frozen=True)
class Case:
    """A sweep. `settings` gives the renders for a value of the swept parameter; the worst of them counts."""

    name: str
    title: str
    parameter: str
    values: tuple[float, ...]
    """From ordinary to extreme, beyond the goal."""
    goal: float
    within: float
    """Relative error that is allowed beyond noise."""
    settings: Callable[[float], Sequence[Settings]]
    truth: Callable[[Parsed], Truth]
    wrong: str
    instead: str
    scene: str = ""
    samples: Callable[[float], int] = field(default=lambda value: 1 << 16)
    """Samples of a whole picture."""
    quick: tuple[float, ...] = ()
    """The values of the coarse sweep; by default the first, the goal and one between."""
    measure: str = "mean"
    """`mean`: of the pixels; `spread`: relative standard deviation of a sample, which `within` bounds, of an
    unbiased mean; `bounces`: share of pixels that show the right number of mirrors."""
    most_mitsuba: int = 1 << 16
    """Samples of a picture that Mitsuba is given at most: its scalar variant is slow."""
    options: tuple[str, ...] = ()
    """Of oneray, beyond its defaults."""

    @property
    def path(self) -> Path:
        return data.scenes_dir() / "stiff" / f"{self.scene or self.name}.xml"

    @property
    def coarse(self) -> tuple[float, ...]:
        if self.quick:
            return self.quick
        last = self.values.index(self.goal)
        return tuple(dict.fromkeys((self.values[0], self.values[last // 2], self.goal)))


def decades(first: int, last: int, step: int = 1) -> tuple[float, ...]:
    """10^first … 10^last, correctly rounded."""
    step = step if last > first else -step
    return tuple(float(f"1e{n}") for n in range(first, last + (1 if step > 0 else -1), step))


# ---- Closed forms.


def cone_irradiance(sine: mpf, cosine: mpf) -> mpf:
    """E/L, sr: ∫ max(0, cosθ) dω over a cone with sinα = `sine` whose axis has this cosine to the normal.

    About the axis, the ring at the angle t spans the azimuths where a + b cosψ > 0, a = cosφ cos t,
    b = sinφ sin t.
    """
    with mp.workdps(DIGITS):
        alpha, phi = mpmath.asin(sine), mpmath.acos(cosine)
        if phi + alpha <= mp.pi / 2:
            return mp.pi * sine**2 * cosine

        def ring(t: mpf) -> mpf:
            a, b = cosine * mpmath.cos(t), mpmath.sin(phi) * mpmath.sin(t)
            if a >= b:
                return 2 * mp.pi * a * mpmath.sin(t)
            if a <= -b:
                return mpf(0)
            psi = mpmath.acos(-a / b)
            return 2 * (a * psi + b * mpmath.sin(psi)) * mpmath.sin(t)

        edge = abs(mp.pi / 2 - phi)
        first = [mpf(0), edge] if cosine > 0 else [edge]
        return mpmath.quad(ring, [*(t for t in first if t < alpha), alpha]) if edge < alpha else mpf(0)


def rectangle_irradiance(x0: mpf, x1: mpf, y0: mpf, y1: mpf, height: mpf) -> mpf:
    """E/L, sr, from a rectangle parallel to the receiver: Lambert's formula, corner by corner."""
    with mp.workdps(DIGITS):

        def corner(x: mpf, y: mpf) -> mpf:
            a, b = mpmath.sqrt(x * x + height**2), mpmath.sqrt(y * y + height**2)
            return (x / a * mpmath.atan(y / a) + y / b * mpmath.atan(x / b)) / 2

        return corner(x1, y1) - corner(x0, y1) - corner(x1, y0) + corner(x0, y0)


def same(value: mpf) -> Truth:
    return Truth(value, abs(value))


def lambert(p: Parsed, albedo: float = 0.5) -> mpf:
    """BRDF of a diffuse surface, sr⁻¹."""
    return p.number(albedo) / mp.pi


def _sphere(p: Parsed, x: mpf, z: mpf, radius: mpf) -> Truth:
    """A sphere light at (x, 0, z), all of it above a floor at the origin."""
    d = mpmath.sqrt(x * x + z * z)
    return same(lambert(p) * p("radiance") * mp.pi * (radius / d) ** 2 * z / d)


def _point(p: Parsed, intensity: mpf, height: mpf, distance: mpf) -> mpf:
    return lambert(p) * intensity * height / distance**3


def _touching(p: Parsed) -> Truth:
    tilt = mpmath.cos(p("tilt") * mp.pi / 180)
    return same(lambert(p) * p("radiance") * cone_irradiance(1 / (1 + p("gap")), tilt))


def _inner(p: Parsed) -> Truth:
    return same(p("radiance") * sum(p("reflectance") ** k for k in range(1, int(p("depth")))))


def _lamp_around(p: Parsed, x: float, y: float) -> mpf:
    """Radiance of a floor 1 below a lamp of half side 1/4, seen (x, y) off its middle."""
    x, y, half = p.number(x), p.number(y), p.number(0.25)
    return lambert(p) * p("radiance") * rectangle_irradiance(x - half, x + half, y - half, y + half, mpf(1))


def _dark(p: Parsed) -> Truth:
    """Nothing, against what there would be without the plate."""
    return Truth(mpf(0), _lamp_around(p, 0.1, 0.05))


def _contact_light(p: Parsed) -> Truth:
    x, h = p("middle"), p("gap")
    return same(lambert(p) * p("radiance") * rectangle_irradiance(x - 1, x + 1, mpf(-1), mpf(1), h))


def _slab(p: Parsed) -> Truth:
    r = ((p("ior") - 1) / (p("ior") + 1)) ** 2
    return same(p("radiance") * (1 - r) / (1 + r))


def _lamps(p: Parsed) -> Truth:
    """scale.xml and offset.xml: of two lamps the one that is seen."""
    quarter = mpf(1) / 4
    return same(lambert(p) * 16 * rectangle_irradiance(-3 * quarter, -quarter, -quarter, quarter, mpf(1)))


def _furnace(p: Parsed) -> Truth:
    return same(p("radiance") * sum(p("reflectance") ** k for k in range(int(p("depth")))))


def _grazing(p: Parsed) -> Truth:
    m = p.numbers("matrix")
    a, b, origin = ([m[4 * row + column] for row in range(3)] for column in (0, 1, 3))
    normal = [a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3] for i in range(3)]
    way = [p(axis) - o for axis, o in zip("xyz", origin, strict=True)]
    height = sum(n * w for n, w in zip(normal, way, strict=True)) / mpmath.norm(normal)
    return same(_point(p, p("intensity"), height, mpmath.norm(way)))


def _distant_point(p: Parsed) -> Truth:
    return same(_point(p, p("intensity"), p("z"), mpmath.sqrt(p("x") ** 2 + p("z") ** 2)))


def _disk(p: Parsed) -> Truth:
    return same(p.number(0.5) * p("radiance") * p("radius") ** 2 / (1 + p("radius") ** 2))


def _square(p: Parsed) -> Truth:
    h = p("half")
    return same(lambert(p) * p("radiance") * rectangle_irradiance(-h, h, -h, h, mpf(1)))


def _spot(p: Parsed) -> Truth:
    theta, cutoff, beam = mpmath.atan(p("x")), p("cutoff") * mp.pi / 180, p("beam") * mp.pi / 180
    falloff = (cutoff - theta) / (cutoff - beam)
    return same(lambert(p) * p("intensity") * mpmath.cos(theta) ** 4 * falloff / mpmath.cos(theta))


def _setting(p: Parsed) -> Truth:
    d = mpmath.sqrt(p("x") ** 2 + p("z") ** 2)
    return same(lambert(p) * p("radiance") * cone_irradiance(p.number(0.5) / d, p("z") / d))


def _decades(p: Parsed) -> Truth:
    """Point lights at z = 1 over the origin: all, or the last alone."""
    lights = []
    for emitter in p.root.iter("emitter"):
        [point], [intensity] = emitter.iter("point"), emitter.iter("rgb")
        x, y, z = (p.number(point.get(axis, "0")) for axis in "xyz")
        lights.append(_point(p, p.number(intensity.get("value", "")), z, mpmath.sqrt(x * x + y * y + z * z)))
    return same(lights[-1] if p("plate") > 0 else sum(lights))


# ---- Settings by the value that is swept.


def one(**settings: object) -> list[Settings]:
    return [{name: value if isinstance(value, str) else repr(value) for name, value in settings.items()}]


def _gap(gap: float) -> list[Settings]:
    return one(gap=gap, camera=gap / 2, near=gap / 100)


def _scale(k: float) -> list[Settings]:
    return one(scale=k, camera=-0.25 * k, height=0.5 * k, near=0.001 * k, far=10 * k)


def _furnace_scale(k: float) -> list[Settings]:
    return one(radius=k, near=0.001 * k, far=10 * k, target=f"{0.6 * k!r}, {0.48 * k!r}, {0.64 * k!r}")


def _offset(at: float) -> list[Settings]:
    return one(offset=at, eye=f"{at - 0.25!r}, {at!r}, {at + 0.5!r}", target=f"{at!r}, {at!r}, {at!r}")


def _grazing_at(cosine: float) -> list[Settings]:
    """The light 0.6 along the first side of the plane, 0.2 along the second, and `height` above."""
    height = cosine * math.sqrt(0.4)
    with mp.workdps(DIGITS):
        sides = (
            (mpf("0.8"), 0, mpf("0.6")),
            (mpf("0.36"), mpf("0.8"), mpf("-0.48")),
            (mpf("-0.48"), mpf("0.6"), mpf("0.64")),
        )
        place = [
            float(mpf(o) + mpf("0.6") * a + mpf("0.2") * b + mpf(height) * n)
            for o, (a, b, n) in zip(("0.1", "0.2", "0.3"), sides, strict=True)
        ]
    return one(x=place[0], y=place[1], z=place[2], intensity=1 / cosine)


def _spot_at(cutoff: float) -> list[Settings]:
    x = math.tan(math.radians(0.875 * cutoff))
    fov = math.degrees(1e-4 * x)
    return one(cutoff=cutoff, beam=0.75 * cutoff, x=x, eye=f"{x!r}, 0, 0.5", fov=fov)


def _setting_at(rise: float) -> list[Settings]:
    """The light's middle at the cosine rise - 1/2, so bright that the floor shows about 1."""
    z = rise - 0.5
    with mp.workdps(DIGITS):
        irradiance = cone_irradiance(mpf("0.5"), mpf(z))
    return one(x=math.sqrt((1 - z) * (1 + z)), z=z, radiance=float(2 * mp.pi / irradiance))


def _corridor(count: float) -> list[Settings]:
    slopes = (0.5, 0.75, 1.25, 2.0)
    kept = 1 - 5 / max(
        count, 100.0
    )  # so that each count shows, and the light of all of them is within floats
    return [
        one(length=count / s, slope=s, depth=int(count) + 10, far=10 * count, reflectance=kept)[0]
        for s in slopes
    ]


def _dimming(plate: float) -> Callable[[float], list[Settings]]:
    def settings(most: float) -> list[Settings]:
        return one(plate=plate, **{f"i{g}": float(most ** (1 - g / 24)) for g in range(25)})

    return settings


def ball_targets(count: int = 12) -> list[str]:
    """Vertices and middles of edges of the mesh that mesh-seams.xml looks at from within."""
    lines = (
        (data.scenes_dir() / "meshes" / "coarse-ball.ply").read_text().split("end_header\n")[1].splitlines()
    )
    vertices = [np.array([float(word) for word in line.split()[:3]]) for line in lines[:42]]
    edges = {
        tuple(sorted(pair)) for line in lines[42:] for pair in _edges([int(w) for w in line.split()[1:]])
    }
    places = [*vertices[::4], *((vertices[a] + vertices[b]) / 2 for a, b in sorted(edges)[::11])]
    return [", ".join(repr(float(x)) for x in place) for place in places][: 2 * count]


def _edges(corners: Sequence[int]) -> list[tuple[int, int]]:
    return [(corners[k], corners[(k + 1) % 3]) for k in range(3)]


def _seams(fov: float) -> list[Settings]:
    return [one(target=target, fov=fov)[0] for target in ball_targets()]


def _sliver(width: float) -> list[Settings]:
    return one(width=width, fov=math.degrees(2 * math.atan(min(15 * width, 0.4))))


EXACT = 1e-6
"""Where the estimator has next to no variance, and a picture of single floats holds 6e-8."""
GAPS = decades(-1, -15)

CASES: tuple[Case, ...] = (
    Case(
        "small-sphere-light",
        "Small sphere light",
        "r/d",
        decades(-1, -18),
        1e-15,
        EXACT,
        lambda s: one(radius=s, radiance=1 / s**2),
        lambda p: _sphere(p, p.number(0.6), p.number(0.8), p("radius")),
        wrong="The cone that a sphere fills is 2π(1 − cosθ) wide. For the sun 1 − cosθ is 1e-5, and in "
        "single precision a cosine is known to 6e-8: below r/d ≈ 2e-4 nothing is left but rounding, "
        "and the light turns black or several times too bright.",
        instead="1 − cosθ is computed itself, as s²/(1 + √((1−s)(1+s))), and so is the cosine of a sample: "
        "with x = u (1 − cosθ) its sine is √(x(2−x)). The density comes from the very same number, "
        "so that what rounding is left cancels. A sphere that shines outwards is never taken to "
        "hide its own near side.",
    ),
    Case(
        "touching-sphere",
        "Patch nearly touching a sphere light",
        "gap/r",
        GAPS,
        1e-12,
        1e-2,
        lambda g: one(gap=g, half=g / 10, camera=-g / 2, near=g / 100),
        _touching,
        wrong="The distance to the sphere, −b − √(b² − c), is a small difference of large numbers, and an "
        "offset of the ray's origin by a fixed epsilon starts the ray inside.",
        instead="Along a sampled direction the distance is (d−r)(d+r)/(d cosθ + √(r² − d² sin²θ)), where "
        "nothing cancels. No ray is moved: it knows which surface it starts from.",
    ),
    Case(
        "inner-wall",
        "Patch near the inner wall of a glowing sphere",
        "gap/r",
        GAPS,
        1e-12,
        1e-3,
        lambda g: one(gap=g, half=math.sqrt(g) / 100, fov=math.degrees(math.sqrt(g) / 500)),
        _inner,
        samples=lambda value: 1 << 18,
        most_mitsuba=1 << 18,
        wrong="Sampling a sphere light asks whether the point is inside or outside, and so does the "
        "density of a ray that hits it. Where rounding lets the two answer differently, the weights "
        "do not add up to 1.",
        instead="One function, view_sphere, decides; sampling and density share its answer. A point of the "
        "sphere itself is inside.",
    ),
    Case(
        "contact-shadow",
        "Contact shadow",
        "gap",
        GAPS,
        1e-12,
        1e-2,
        _gap,
        _dark,
        wrong="To keep a ray from hitting the surface that it leaves, its origin is moved by an epsilon. "
        "An occluder closer than that is jumped over: light leaks under it.",
        instead="The ray leaves out the surface that it starts from, by its number. Points lie on their "
        "planes to the last digit, and there is no epsilon.",
    ),
    Case(
        "contact-light",
        "Light in contact",
        "gap",
        GAPS,
        1e-12,
        1e-2,
        lambda g: [{**_gap(g)[0], "middle": repr(1 - g)}],
        _contact_light,
        wrong="The same epsilon lets the ray start behind the light, and 1/d² has no bound for points "
        "uniform on it.",
        instead="No epsilon, and a near rectangle is sampled uniformly in its solid angle (Ureña et al. "
        "2013).",
    ),
    Case(
        "occluder-below-light",
        "Occluder just below a light",
        "gap/d",
        GAPS,
        1e-12,
        1e-2,
        lambda g: one(gap=g),
        _dark,
        wrong="Shadow rays are cut short by a share of their length, so as not to hit the light itself. "
        "What is in the last thousandth then hides nothing.",
        instead="The ray goes all the way, and leaves out the primitive that it ends on, by its number.",
    ),
    Case(
        "thin-slab",
        "Thin slab of glass",
        "thickness",
        GAPS,
        1e-12,
        1e-2,
        lambda t: one(half=t / 2),
        _slab,
        samples=lambda value: 1 << 18,
        most_mitsuba=1 << 17,
        wrong="A refracted ray that starts an epsilon further is already beyond a thin slab: reflections "
        "within it are lost.",
        instead="Within a solid the ray can only meet the far side, and it knows the face that it starts "
        "from.",
    ),
    Case(
        "scale-small",
        "Whole-scene scale, small",
        "scale",
        decades(0, -18),
        1e-12,
        1e-2,
        _scale,
        _lamps,
        scene="scale",
        samples=lambda value: 1 << 20,
        most_mitsuba=1 << 20,
        wrong="Epsilons of the kind 1e-4 (1 + |p|) are a share of the scene only while it is about 1 large.",
        instead="Nothing is compared with an absolute length.",
    ),
    Case(
        "scale-large",
        "Whole-scene scale, large",
        "scale",
        decades(0, 18),
        1e12,
        1e-2,
        _scale,
        _lamps,
        scene="scale",
        samples=lambda value: 1 << 20,
        most_mitsuba=1 << 20,
        wrong="An absolute epsilon does no harm here, but squares of lengths overflow in single precision "
        "from 1e19 on.",
        instead="Nothing is compared with an absolute length, and lengths are in double.",
    ),
    Case(
        "scale-furnace",
        "Furnace of any size",
        "radius",
        decades(0, -18),
        1e-12,
        1e-2,
        _furnace_scale,
        _furnace,
        wrong="In a furnace of radius 1e-4 a step of 1e-5 at each bounce leaves the sphere, or misses "
        "near walls.",
        instead="A ray leaves out the surface that it starts from by its number; there is no step.",
    ),
    Case(
        "offset",
        "Far from the origin",
        "offset",
        decades(0, 15),
        1e7,
        1e-2,
        _offset,
        _lamps,
        samples=lambda value: 1 << 20,
        most_mitsuba=1 << 20,
        wrong="Single floats at 1e4 are 1e-3 apart: a gap of 1/64 is a few steps wide, and epsilons grow "
        "with |p|.",
        instead="Geometry in double: at 1e7 numbers are 2e-9 apart. --precision auto takes double where a "
        "scene is further from the origin than 16 times its size.",
    ),
    Case(
        "grazing",
        "Light just above a plane",
        "cosθ",
        decades(-1, -15),
        1e-12,
        1e-2,
        _grazing_at,
        _grazing,
        wrong="The cosine of a light near the horizon is a difference of products of about 1: in single "
        "precision 6e-8 of them stay, and so much of a cosine of 1e-6 is wrong.",
        instead="Points are put onto their plane, and vectors between points are taken before anything is "
        "multiplied, in double.",
    ),
    Case(
        "distant-sphere",
        "Distant sphere light",
        "distance",
        (*decades(1, 20), *decades(30, 150, 10)),
        1e100,
        EXACT,
        lambda d: one(x=0.6 * d, z=0.8 * d, radius=0.01 * d),
        lambda p: _sphere(p, p("x"), p("z"), p("radius")),
        wrong="d² overflows single floats at 1.8e19.",
        instead="Double: d² up to 1e300. --precision auto takes it where a scene reaches beyond 1e6.",
    ),
    Case(
        "distant-point",
        "Distant point light",
        "distance",
        (*decades(1, 20), *decades(30, 150, 10)),
        1e100,
        EXACT,
        lambda d: one(x=0.6 * d, z=0.8 * d, intensity=d * d),
        _distant_point,
        wrong="The light's intensity grows as d², and so does what it is divided by: both overflow single "
        "floats at 1.8e19.",
        instead="Double, which --precision auto takes where a scene reaches beyond 1e6.",
    ),
    Case(
        "tiny-disk",
        "Tiny disk light",
        "r/d",
        (*decades(-1, -12), *decades(-20, -150, 10)),
        1e-100,
        EXACT,
        lambda r: one(radius=r, radiance=1 / r**2),
        _disk,
        wrong="The density of a point on the light, d²/(A cosθ), is squared in the power heuristic and "
        "overflows.",
        instead="Densities of lights are kept as 1/p, and the weight is 1/(1 + (p_b/p_l)²): the ratio "
        "first. What underflows then is a weight that is 1 anyway.",
    ),
    Case(
        "tiny-rectangle",
        "Tiny rectangle light",
        "side/2d",
        (*decades(-1, -12), *decades(-20, -150, 10)),
        1e-100,
        EXACT,
        lambda r: one(half=r, radiance=1 / r**2),
        _square,
        wrong="The inverse of the matrix that takes the unit square to a light that small overflows, and "
        "its solid angle, a sum of angles less 2π, is rounding alone.",
        instead="The inverse has columns of its own scale, and a light that fills next to nothing is "
        "sampled by its area.",
    ),
    Case(
        "radiance-low",
        "Dim light",
        "radiance of the picture",
        decades(0, -44),
        1e-37,
        1e-2,
        lambda out: one(radiance=2 * out),
        lambda p: same(p.number(0.5) * p("radiance")),
        scene="radiance",
        samples=lambda value: 1 << 18,
        most_mitsuba=1 << 17,
        wrong="Radiances below 1e-38 lose digits as single floats, and products with them are 0.",
        instead="Sums in double; --precision auto renders in double what is dimmer than 1e-12. The "
        "picture's single floats end at 1e-45.",
    ),
    Case(
        "radiance-high",
        "Bright light",
        "radiance of the picture",
        (*decades(0, 38), 3e38),
        1e38,
        1e-2,
        lambda out: one(radiance=2 * out),
        lambda p: same(p.number(0.5) * p("radiance")),
        scene="radiance",
        samples=lambda value: 1 << 18,
        most_mitsuba=1 << 17,
        wrong="A sum of samples overflows long before their mean does.",
        instead="Sums in double. A mean beyond 3.4e38, which no picture of single floats can hold, is an "
        "error.",
    ),
    Case(
        "many-samples",
        "Many samples in one pixel",
        "samples",
        tuple(2.0**k for k in range(10, 27, 2)),
        2.0**26,
        EXACT,
        lambda n: one(),
        lambda p: same(p("radiance")),
        samples=lambda value: int(value),
        quick=(2.0**10, 2.0**20),
        most_mitsuba=1 << 24,
        wrong="A single float that has counted to 2²⁴ no longer grows by adding 1: the mean of equal "
        "samples drifts, 1 % at 2²⁰, 15 % at 2²⁴.",
        instead="Sums in double, in a fixed binary tree over the samples' index.",
    ),
    Case(
        "white-furnace",
        "Furnace that hardly absorbs, with roulette",
        "1 − ρ",
        decades(-1, -5),
        1e-5,
        1e-2,
        lambda x: one(reflectance=1 - x, radiance=x),
        lambda p: same(p("radiance") / (1 - p("reflectance"))),
        quick=(1e-1, 1e-2),
        most_mitsuba=1 << 17,
        options=("--estimator", "walk"),
        wrong="Survival is often capped at 0.95 “so that paths end”. Where walls reflect more than that, "
        "each bounce multiplies by albedo/0.95: the second moment grows without end, and the mean "
        "is carried by paths that are never drawn.",
        instead="A path survives with min(1, throughput), without a cap. The limit of 10⁷ vertices is an "
        "error, not a cut.",
    ),
    Case(
        "corridor",
        "Light down a corridor of mirrors",
        "reflections",
        (10.0, 100.0, 1000.0, 1e4, 1e5),
        1e4,
        1e-2,
        _corridor,
        lambda p: same(p("radiance")),
        samples=lambda value: 256,
        measure="bounces",
        wrong="A ray between mirrors starts off its mirror by rounding, or by the epsilon that was to "
        "help: one in some thousand rays meets the same mirror twice or slips behind it.",
        instead="The hit is put onto the mirror's plane, and the mirror that the ray leaves is left out.",
    ),
    Case(
        "narrow-spot",
        "Narrow spot",
        "cutoff angle, degrees",
        (20.0, *decades(0, -10)),
        1e-6,
        1e-2,
        _spot_at,
        _spot,
        wrong="Whether a direction is within the cone is decided by its cosine, which near the axis is 1 "
        "− θ²/2: below 0.03° single floats do not tell cutoff and beam apart.",
        instead="θ = atan2(|a × d|, a · d), and the falloff is linear in θ.",
    ),
    Case(
        "mesh-seams",
        "Rays aimed at vertices and edges",
        "field of view, degrees",
        decades(0, -14),
        1e-14,
        0.0,
        _seams,
        lambda p: Truth(mpf(0), mpf(1)),
        samples=lambda value: 1 << 12,
        most_mitsuba=1 << 12,
        quick=(1e-2, 1e-14),
        wrong="A ray at the edge of two triangles may be outside both by rounding: 12 % of rays aimed at "
        "edges, 24 % at vertices go through.",
        instead="Edge functions of the triangle sheared along the ray (Woop et al. 2013): both sides of an "
        "edge compute the same rounded number, and 0 counts as inside.",
    ),
    Case(
        "slivers",
        "Slivers",
        "width",
        decades(-1, -14),
        1e-12,
        0.0,
        _sliver,
        lambda p: Truth(mpf(0), mpf(1)),
        samples=lambda value: 1 << 16,
        most_mitsuba=1 << 16,
        wrong="Rays near the edges of thin triangles slip between them: in strips of width 1e-6, 2.4 % of "
        "all rays.",
        instead="The same edge functions as for seams. A sliver's normal is the cross product of edges "
        "scaled to 1, so that nothing underflows.",
    ),
    Case(
        "dim-one-seen",
        "A thousand lights, the dimmest alone is seen",
        "brightest over dimmest",
        decades(0, 24, 3),
        1e24,
        45.0,
        _dimming(0.5),
        _decades,
        scene="decades",
        samples=lambda value: 1 << 19,
        measure="spread",
        most_mitsuba=1 << 18,
        quick=(1.0, 1e24),
        wrong="Choosing lights by their power takes the dimmest with a probability of 1e-24: the picture "
        "is black, without bias and without use.",
        instead="Half of the choices of `contribution` are uniform over the lights that can contribute, so "
        "that no light is drawn less than half as often as by chance: the relative standard "
        "deviation of a sample stays below √(2N − 1) = 44.7.",
    ),
    Case(
        "all-seen",
        "A thousand lights over decades, all seen",
        "brightest over dimmest",
        decades(0, 24, 3),
        1e24,
        1.0,
        _dimming(-1.0),
        _decades,
        scene="decades",
        measure="spread",
        most_mitsuba=1 << 18,
        quick=(1.0, 1e24),
        wrong="A uniform choice mostly takes lights that are too dim to matter: the relative standard "
        "deviation is that of the lights' powers.",
        instead="The choice goes by power, distance and cosines.",
    ),
    Case(
        "setting-sphere",
        "Sphere light, nearly set",
        "cosθ + r/d",
        decades(-1, -14),
        1e-6,
        10.0,
        _setting_at,
        _setting,
        measure="spread",
        samples=lambda value: 1 << 18,
        most_mitsuba=1 << 18,
        wrong="Of the cone that the sphere fills only a sliver is above the horizon, and nearly all "
        "samples are below.",
        instead="Where its middle is below the horizon, the light is sampled in the smallest block of "
        "elevation and azimuth that holds what is above: two thirds of it or more are the light.",
    ),
)


def named(name: str) -> Case | None:
    return next((case for case in CASES if case.name == name), None)
