"""Surfaces that nearly touch."""

from mpmath import mpf

from raycheck.measuring.stability.case import GAPS, Case, Parsed, Settings, Truth, one
from raycheck.measuring.stability.formulas import lambert, rectangle_irradiance, same


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


def _gap(gap: float) -> list[Settings]:
    return one(gap=gap, camera=gap / 2, near=gap / 100)


CASES = (
    Case(
        "contact-shadow", "Contact shadow", "gap", GAPS, 1e-12, 1e-2,
        _gap, _dark,
        wrong="To keep a ray from hitting the surface that it leaves, its origin is moved by an epsilon. An "
        "occluder closer than that is jumped over: light leaks under it.",
        instead="The ray leaves out the surface that it starts from, by its number. Points lie on their "
        "planes to the last digit, and there is no epsilon.",
    ),
    Case(
        "contact-light", "Light in contact", "gap", GAPS, 1e-12, 1e-2,
        lambda g: [{**_gap(g)[0], "middle": repr(1 - g)}], _contact_light,
        wrong="The same epsilon lets the ray start behind the light, and 1/d² has no bound for points "
        "uniform on it.",
        instead="No epsilon, and a near rectangle is sampled uniformly in its solid angle (Ureña et al. "
        "2013).",
    ),
    Case(
        "occluder-below-light", "Occluder just below a light", "gap/d", GAPS, 1e-12, 1e-2,
        lambda g: one(gap=g), _dark,
        wrong="Shadow rays are cut short by a share of their length, so as not to hit the light itself. What "
        "is in the last thousandth then hides nothing.",
        instead="The ray goes all the way, and leaves out the primitive that it ends on, by its number.",
    ),
    Case(
        "thin-slab", "Thin slab of glass", "thickness", GAPS, 1e-12, 1e-2,
        lambda t: one(half=t / 2), _slab, samples=lambda value: 1 << 18, most_mitsuba=1 << 17,
        wrong="A refracted ray that starts an epsilon further is already beyond a thin slab: reflections "
        "within it are lost.",
        instead="Within a solid the ray can only meet the far side, and it knows the face that it starts "
        "from.",
    ),
)  # fmt: skip
