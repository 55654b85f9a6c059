"""Surfaces in one place: gaps of a million units in the last place, down to none."""

from itertools import product

import mpmath
from mpmath import mpf

from raycheck.measuring.stability.case import Case, Parsed, Settings, Truth, decades, one
from raycheck.measuring.stability.formulas import lambert, same

ULP = 2.0**-52
"""Of the places of the surfaces, which are between 1 and 2."""
GAPS = decades(6, -1)
"""In that unit: 0.1 of it is none."""
ANGLES = (0.0, 37.0)
"""Degrees, that the scene is turned by: surfaces along the axes, and tilted."""


def _sheets(gap: float) -> list[Settings]:
    kinds = (("rectangle", "disk"), ("disk", "rectangle"))
    places = {f"{name}_at": -k * gap * ULP for k, name in enumerate(("second", "third", "fourth"), 1)}
    return [
        one(first=first, second=second, angle=angle, **places)[0]
        for (first, second), angle in product(kinds, ANGLES)
    ]


def _slabs(gap: float) -> list[Settings]:
    return [one(lower_at=gap * ULP, upper_at=0.25 + 2 * gap * ULP, angle=angle)[0] for angle in ANGLES]


def _two_slabs(p: Parsed) -> Truth:
    r = ((p("ior") - 1) / (p("ior") + 1)) ** 2
    return same(p("radiance") * (1 - r) / (1 + 3 * r))


def _beside_ball(p: Parsed) -> Truth:
    height = p("height")
    return same(p.number(0.5) * p("radiance") * (1 - height / mpmath.sqrt(height**2 + mpf(0.25)) ** 3))


def upright_irradiance(width: mpf, distance: mpf) -> mpf:
    """E/L, sr, from a rectangle of height 1 that stands on the receiver's plane, a corner straight ahead."""
    slant = mpmath.sqrt(1 + distance**2)
    return (mpmath.atan(width / distance) - distance / slant * mpmath.atan(width / slant)) / 2


def _before_lamp(p: Parsed) -> Truth:
    seen = upright_irradiance(mpf(0.25), mpf(0.5)) + upright_irradiance(mpf(0.75), mpf(0.5))
    return same(lambert(p) * p("radiance") * seen)


PARAMETER = "gap, 2⁻⁵²"
CASES = (
    Case(
        "one-place", "Sheets in one place", PARAMETER, GAPS, 0.1, 1e-2,
        _sheets, lambda p: same(p.number(0.5) * p("radiance")),
        wrong="A ray leaves out the surface that it starts from, but not another in the same place: whether "
        "that one is above or below is up to rounding, and half of the light is lost.",
        instead="Surfaces that rounding cannot tell apart lie in layers, each with a number. What a ray "
        "meets first, what it meets where it starts and what hides its end are decided by these.",
    ),
    Case(
        "glass-in-contact", "Glass on glass on a lamp", PARAMETER, GAPS, 0.1, 1e-2,
        _slabs, _two_slabs, samples=lambda value: 1 << 18, most_mitsuba=1 << 17,
        wrong="Whoever skips all that is close to a ray's start skips the next boundary as well: light does "
        "not enter the second slab where it leaves the first.",
        instead="By the order of the layers a ray leaves one solid before it enters the next.",
    ),
    Case(
        "ball-on-floor", "Ball on a floor", PARAMETER, GAPS, 0.1, 1e-2,
        lambda g: [one(height=1 + g * ULP, angle=angle)[0] for angle in ANGLES], _beside_ball,
        samples=lambda value: 1 << 18, most_mitsuba=1 << 17,
        wrong="An offset of the rays' origins as large as the gap lets light through below the ball.",
        instead="No ray is moved, and the two touch in a point, which is nothing.",
    ),
    Case(
        "lamp-in-corner", "Lamp in a corner", PARAMETER, GAPS, 0.1, 1e-2,
        lambda g: [one(wall_at=-g * ULP, angle=angle)[0] for angle in ANGLES], _before_lamp,
        wrong="The wall behind the lamp hides it, or it the wall, as rounding has it, and differently for "
        "rays that are sent to the lamp and rays that hit it.",
        instead="Of two surfaces in one place that face the same way the lamp is in front, for every ray.",
    ),
)  # fmt: skip
