"""Sphere lights, from afar to the very surface."""

import math

import mpmath
from mpmath import mp

from raycheck.measuring.stability.case import EXACT, GAPS, Case, Parsed, Truth, decades, one
from raycheck.measuring.stability.formulas import cone_irradiance, lambert, same, sphere_light


def _touching(p: Parsed) -> Truth:
    tilt = mpmath.cos(p("tilt") * mp.pi / 180)
    return same(lambert(p) * p("radiance") * cone_irradiance(1 / (1 + p("gap")), tilt))


def _inner(p: Parsed) -> Truth:
    return same(p("radiance") * sum(p("reflectance") ** k for k in range(1, int(p("depth")))))


CASES = (
    Case(
        "small-sphere-light", "Small sphere light", "r/d", decades(-1, -18), 1e-15, EXACT,
        lambda s: one(radius=s, radiance=1 / s**2),
        lambda p: sphere_light(p, p.number(0.6), p.number(0.8), p("radius")),
        wrong="The cone that a sphere fills is 2π(1 − cosθ) wide. For the sun 1 − cosθ is 1e-5, and in "
        "single precision a cosine is known to 6e-8: below r/d ≈ 2e-4 nothing is left but rounding, "
        "and the light turns black or several times too bright.",
        instead="1 − cosθ is computed itself, as s²/(1 + √((1−s)(1+s))), and so is the cosine of a sample: "
        "with x = u (1 − cosθ) its sine is √(x(2−x)). The density comes from the very same number, "
        "so that what rounding is left cancels. A sphere that shines outwards is never taken to hide "
        "its own near side.",
    ),
    Case(
        "touching-sphere", "Patch nearly touching a sphere light", "gap/r", GAPS, 1e-12, 1e-2,
        lambda g: one(gap=g, half=g / 10, camera=-g / 2, near=g / 100), _touching,
        wrong="The distance to the sphere, −b − √(b² − c), is a small difference of large numbers, and an "
        "offset of the ray's origin by a fixed epsilon starts the ray inside.",
        instead="Along a sampled direction the distance is (d−r)(d+r)/(d cosθ + √(r² − d² sin²θ)), where "
        "nothing cancels. No ray is moved: it knows which surface it starts from.",
    ),
    Case(
        "inner-wall", "Patch near the inner wall of a glowing sphere", "gap/r", GAPS, 1e-12, 1e-3,
        lambda g: one(gap=g, half=math.sqrt(g) / 100, fov=math.degrees(math.sqrt(g) / 500)), _inner,
        samples=lambda value: 1 << 18, most_mitsuba=1 << 18,
        wrong="Sampling a sphere light asks whether the point is inside or outside, and so does the density "
        "of a ray that hits it. Where rounding lets the two answer differently, the weights do not add "
        "up to 1.",
        instead="One function, view_sphere, decides; sampling and density share its answer. A point of the "
        "sphere itself is inside.",
    ),
)  # fmt: skip
