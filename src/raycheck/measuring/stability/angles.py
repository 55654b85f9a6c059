"""Lights near the horizon, far away, or tiny."""

import math

import mpmath
from mpmath import mp, mpf

from raycheck.measuring.stability.case import DIGITS, EXACT, Case, Parsed, Settings, Truth, decades, one
from raycheck.measuring.stability.formulas import (
    lambert,
    point_light,
    rectangle_irradiance,
    same,
    sphere_light,
)


def _grazing(p: Parsed) -> Truth:
    m = p.numbers("matrix")
    a, b, origin = ([m[4 * row + column] for row in range(3)] for column in (0, 1, 3))
    normal = [a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3] for i in range(3)]
    way = [p(axis) - o for axis, o in zip("xyz", origin, strict=True)]
    height = sum(n * w for n, w in zip(normal, way, strict=True)) / mpmath.norm(normal)
    return same(point_light(p, p("intensity"), height, mpmath.norm(way)))


def _distant_point(p: Parsed) -> Truth:
    return same(point_light(p, p("intensity"), p("z"), mpmath.sqrt(p("x") ** 2 + p("z") ** 2)))


def _disk(p: Parsed) -> Truth:
    return same(p.number(0.5) * p("radiance") * p("radius") ** 2 / (1 + p("radius") ** 2))


def _square(p: Parsed) -> Truth:
    h = p("half")
    return same(lambert(p) * p("radiance") * rectangle_irradiance(-h, h, -h, h, mpf(1)))


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


CASES = (
    Case(
        "grazing", "Light just above a plane", "cosθ", decades(-1, -15), 1e-12, 1e-2,
        _grazing_at, _grazing,
        wrong="The cosine of a light near the horizon is a difference of products of about 1: in single "
        "precision 6e-8 of them stay, and so much of a cosine of 1e-6 is wrong.",
        instead="Points are put onto their plane, and vectors between points are taken before anything is "
        "multiplied, in double.",
    ),
    Case(
        "distant-sphere", "Distant sphere light", "distance",
        (*decades(1, 20), *decades(30, 150, 10)), 1e100, EXACT,
        lambda d: one(x=0.6 * d, z=0.8 * d, radius=0.01 * d),
        lambda p: sphere_light(p, p("x"), p("z"), p("radius")),
        wrong="d² overflows single floats at 1.8e19.",
        instead="Double: d² up to 1e300. --precision auto takes it where a scene reaches beyond 1e6.",
    ),
    Case(
        "distant-point", "Distant point light", "distance",
        (*decades(1, 20), *decades(30, 150, 10)), 1e100, EXACT,
        lambda d: one(x=0.6 * d, z=0.8 * d, intensity=d * d), _distant_point,
        wrong="The light's intensity grows as d², and so does what it is divided by: both overflow single "
        "floats at 1.8e19.",
        instead="Double, which --precision auto takes where a scene reaches beyond 1e6.",
    ),
    Case(
        "tiny-disk", "Tiny disk light", "r/d", (*decades(-1, -12), *decades(-20, -150, 10)), 1e-100, EXACT,
        lambda r: one(radius=r, radiance=1 / r**2), _disk,
        wrong="The density of a point on the light, d²/(A cosθ), is squared in the power heuristic and "
        "overflows.",
        instead="Densities of lights are kept as 1/p, and the weight is 1/(1 + (p_b/p_l)²): the ratio first. "
        "What underflows then is a weight that is 1 anyway.",
    ),
    Case(
        "tiny-rectangle", "Tiny rectangle light", "side/2d",
        (*decades(-1, -12), *decades(-20, -150, 10)), 1e-100, EXACT,
        lambda r: one(half=r, radiance=1 / r**2), _square,
        wrong="The inverse of the matrix that takes the unit square to a light that small overflows, and its "
        "solid angle, a sum of angles less 2π, is rounding alone.",
        instead="The inverse has columns of its own scale, and a light that fills next to nothing is sampled "
        "by its area.",
    ),
)  # fmt: skip
