"""Microfacets ever smoother, seen ever more along the surface, between media ever more alike; a sky with one
bright pixel.

Walter et al., Microfacet Models for Refraction through Rough Surfaces, EGSR 2007: a parallel light from where
a facet aside of the normal sends it to the viewer.
"""

import math
from collections.abc import Sequence

import mpmath
from mpmath import mp, mpf

from raycheck.measuring.stability.case import DIGITS, Case, Parsed, Settings, Truth, decades, one
from raycheck.measuring.stability.formulas import lambert, same

ROUGHNESS = 1e-4
"""The least α, oneray's and Mitsuba's."""
PRINCIPLED_ROUGHNESS = 1e-3
"""And that of `principled`, whose α is the square of its roughness."""
PIXELS_PER_TURN, ROWS, SUN_ROW = 16, 9, 2
"""The sky of bright-pixel.xml: its size, and where it is bright (scripts/make_stiff.py)."""
TO_LIGHT = ("light_x", "light_y", "light_z")
Vector = list[mpf]


def _unit(v: Vector) -> Vector:
    return [x / mpmath.norm(v) for x in v]


def _dot(a: Vector, b: Vector) -> mpf:
    return sum(x * y for x, y in zip(a, b, strict=True))


def _ggx(cosine: mpf, alpha: mpf) -> mpf:
    """D, sr⁻¹, of a facet."""
    return alpha**2 / (mp.pi * ((alpha**2 - 1) * cosine**2 + 1) ** 2)


def _smith(cosine: mpf, alpha: mpf) -> mpf:
    """G1 of a direction."""
    return 2 / (1 + mpmath.sqrt(1 + alpha**2 * (1 - cosine**2) / cosine**2))


def _directions(p: Parsed) -> tuple[Vector, Vector]:
    """To the viewer and to the light, in the floor's frame, whose normal is z."""
    return _unit([p(name) for name in ("eye_x", "eye_y", "eye_z")]), _unit([-p(name) for name in TO_LIGHT])


def _reflected(p: Parsed, alpha: mpf) -> Truth:
    """E cosθi f_r = E D G/(4 cosθo) of a facet that reflects all."""
    wo, wi = _directions(p)
    h = _unit([o + i for o, i in zip(wo, wi, strict=True)])
    masked = _smith(wo[2], alpha) * _smith(wi[2], alpha)
    return same(p("irradiance") * _ggx(h[2], alpha) * masked / (4 * wo[2]))


def _conductor(p: Parsed) -> Truth:
    return _reflected(p, max(p("alpha"), p.number(ROUGHNESS)))


def _principled(p: Parsed) -> Truth:
    return _reflected(p, max(p("roughness") ** 2, p.number(PRINCIPLED_ROUGHNESS)))


def _refracted(p: Parsed) -> Truth:
    """E |cosθi| f_t: light from below, where the index is η, to a viewer above."""
    wo, wi = _directions(p)
    eta, alpha = p("eta"), p("alpha")
    h = _unit([-(o + eta * i) for o, i in zip(wo, wi, strict=True)])
    o, i = abs(_dot(wo, h)), abs(_dot(wi, h))
    s, q = (o - eta * i) / (o + eta * i), (eta * o - i) / (eta * o + i)
    fresnel = (s * s + q * q) / 2
    spread = o * i * (1 - fresnel) * _ggx(h[2], alpha) / (_dot(wo, h) + eta * _dot(wi, h)) ** 2
    return same(p("irradiance") * spread * _smith(wo[2], alpha) * _smith(-wi[2], alpha) / wo[2])


def _sky(p: Parsed) -> Truth:
    """ρ/π ∫ L cosθ dω of the sky that is bilinear in longitude and latitude: each pixel has a tent of
    weights, of which one row's is the same all around.
    """
    step = mp.pi / (ROWS - 1)

    def weight(row: int) -> mpf:
        """∫ of its tent, to all sides, cosθ sinθ dθ above the horizon, which is a row."""

        def tent(t: mpf) -> mpf:
            return (1 - abs(t / step - row)) * mpmath.sin(t) * mpmath.cos(t)

        ends = [step * min(max(k, 0), (ROWS - 1) // 2) for k in (row - 1, row, row + 1)]
        return 2 * mp.pi / PIXELS_PER_TURN * (mpmath.quad(tent, ends[:2]) + mpmath.quad(tent, ends[1:]))

    weights = [weight(row) for row in range(ROWS)]
    dark = 3 * sum(weights[SUN_ROW - 1 : SUN_ROW + 2])
    sun = mpf(2) ** int(p.texts["sky"].split("-")[1].split(".")[0])
    light = PIXELS_PER_TURN * sum(weights) - dark + sun * weights[SUN_ROW]
    return same(lambert(p) * p("scale") * light)


def _towards(wo: Vector, h: Vector, eta: mpf | None = None) -> Vector:
    """Where light comes from that a facet h reflects to wo, or refracts from a medium of index η."""
    o = _dot(wo, h)
    if eta is None:
        return [2 * o * a - b for a, b in zip(h, wo, strict=True)]
    beyond = mpmath.sqrt(1 - (1 - o * o) / eta**2)
    return [a * (o / eta - beyond) - b / eta for a, b in zip(h, wo, strict=True)]


def _seen(
    eye: Sequence[float], slope: float, fov: float, index: float | None = None, **rest: object
) -> list[Settings]:
    """By a facet of this slope, turned aside of the plane of the viewer; from a medium of `index` below."""
    with mp.workdps(DIGITS):
        wo = _unit([mpf(x) for x in eye])
        h = _unit([mpf(slope) * mpf("0.28"), mpf(slope) * mpf("0.96"), mpf(1)])
        wi = _towards(wo, h, None if index is None else mpf(index))
        light = {name: float(-x) for name, x in zip(TO_LIGHT, wi, strict=True)}
    return one(eye_x=eye[0], eye_y=eye[1], eye_z=eye[2], fov=fov, **light, **rest)


def _smooth(alpha: float) -> list[Settings]:
    steep = max(alpha, ROUGHNESS)
    return _seen((0.6, 0.0, 0.8), 0.7 * steep, 1e-6 * steep, alpha=alpha, irradiance=steep**2)


def _smooth_principled(roughness: float) -> list[Settings]:
    steep = max(roughness**2, PRINCIPLED_ROUGHNESS)
    return _seen((0.6, 0.0, 0.8), 0.7 * steep, 1e-6 * steep, roughness=roughness, irradiance=steep**2)


def _grazing(cosine: float) -> list[Settings]:
    return _seen((1.0, 0.0, cosine), 1.0, 1e-4 * cosine, alpha=0.5, irradiance=1.0)


def _alike(difference: float) -> list[Settings]:
    eta = 1 + difference
    return _seen(
        (0.6, 0.0, 0.8), 0.2, 1e-4 * difference, eta, eta=eta, alpha=0.3, irradiance=difference**2
    )


def _bright(sun: float) -> list[Settings]:
    return one(sky=f"pictures/sun-{int(math.log2(sun))}.hdr", scale=1 / sun)


CASES = (
    Case(
        "smooth-metal", "Ever smoother metal", "α", (1.0, 0.1, 0.01, 1e-3, 3e-4, 1e-4, 1e-5), 1e-4, 1e-4,
        _smooth, _conductor, scene="rough-highlight",
        wrong="A facet's slope from the cosine of a unit half vector, √(1 − cos²), keeps no digits where "
        "slopes are 1e-4: 1 − cos² is 1e-8.",
        instead="The half vector's parts along the normal and across, which is sampled and weighed without "
        "being normalised. Below 1e-4 α is 1e-4, as in Mitsuba.",
    ),
    Case(
        "smooth-principled", "Ever smoother principled metal", "roughness",
        (1.0, 0.3, 0.1, 0.05, 0.03, 0.01, 1e-3), 0.01, 1e-4,
        _smooth_principled, _principled, scene="principled-highlight",
        wrong="α is the square of the roughness: 0.01 would be an α of 1e-4.",
        instead="The same microfacets. Below 1e-3 α is 1e-3, as in Mitsuba.",
    ),
    Case(
        "grazing-view", "Rough metal seen along its surface", "cosθ", decades(0, -15), 1e-12, 1e-4,
        _grazing, _conductor, scene="rough-highlight",
        wrong="D G/(4 cosθo cosθi) is 0/0 where cosθo goes to 0, and G1 by tanθ overflows.",
        instead="2 cosθ/G1 = cosθ + √(cos²θ + α² sin²θ), which is α there.",
    ),
    Case(
        "media-alike", "Rough glass in a medium of nearly its index", "η − 1", decades(0, -12), 1e-10, 1e-4,
        _alike, _refracted, scene="rough-boundary",
        wrong="The half vector η_o wo + η_i wi is a difference that goes to 0 with η − 1: single floats have "
        "no digit of it from 1e-6 on, and its length to the fourth is divided by.",
        instead="Double, which --precision auto takes where an index is within 1e-3 of 1.",
    ),
    Case(
        "bright-pixel", "One bright pixel of a sky beside black ones", "its radiance",
        tuple(2.0**k for k in (0, 10, 20, 30, 40)), 2.0**40, 1e-2,
        _bright, _sky,
        wrong="A density that is constant in each pixel is 0 in the black ones, where what is between them "
        "and the bright one is not.",
        instead="Directions by the very function that is looked up, bilinear between pixels, times sinθ.",
    ),
)  # fmt: skip
