"""What of the light is worth a sample."""

import math
from collections.abc import Callable

import mpmath
from mpmath import mp, mpf

from raycheck.measuring.stability.case import DIGITS, Case, Parsed, Settings, Truth, decades, one
from raycheck.measuring.stability.formulas import cone_irradiance, lambert, point_light, same


def _setting(p: Parsed) -> Truth:
    d = mpmath.sqrt(p("x") ** 2 + p("z") ** 2)
    return same(lambert(p) * p("radiance") * cone_irradiance(p.number(0.5) / d, p("z") / d))


def _decades(p: Parsed) -> Truth:
    """Point lights at z = 1 over the origin: all, or the last alone."""
    lights = []
    for emitter in p.root.iter("emitter"):
        [point], [intensity] = emitter.iter("point"), emitter.iter("rgb")
        x, y, z = (p.number(point.get(axis, "0")) for axis in "xyz")
        lights.append(
            point_light(p, p.number(intensity.get("value", "")), z, mpmath.sqrt(x * x + y * y + z * z))
        )
    return same(lights[-1] if p("plate") > 0 else sum(lights))


def _setting_at(rise: float) -> list[Settings]:
    """The light's middle at the cosine rise - 1/2, so bright that the floor shows about 1."""
    z = rise - 0.5
    with mp.workdps(DIGITS):
        irradiance = cone_irradiance(mpf("0.5"), mpf(z))
    return one(x=math.sqrt((1 - z) * (1 + z)), z=z, radiance=float(2 * mp.pi / irradiance))


def _dimming(plate: float) -> Callable[[float], list[Settings]]:
    def settings(most: float) -> list[Settings]:
        return one(plate=plate, **{f"i{g}": float(most ** (1 - g / 24)) for g in range(25)})

    return settings


CASES = (
    Case(
        "dim-one-seen", "A thousand lights, the dimmest alone is seen", "brightest over dimmest",
        decades(0, 24, 3), 1e24, 45.0,
        _dimming(0.5), _decades,
        scene="decades", samples=lambda value: 1 << 19, measure="spread", most_mitsuba=1 << 18,
        quick=(1.0, 1e24),
        wrong="Choosing lights by their power takes the dimmest with a probability of 1e-24: the picture is "
        "black, without bias and without use.",
        instead="Half of the choices of `contribution` are uniform over the lights that can contribute, so "
        "that no light is drawn less than half as often as by chance: the relative standard "
        "deviation of a sample stays below √(2N − 1) = 44.7.",
    ),
    Case(
        "all-seen", "A thousand lights over decades, all seen", "brightest over dimmest",
        decades(0, 24, 3), 1e24, 1.0,
        _dimming(-1.0), _decades, scene="decades", measure="spread", most_mitsuba=1 << 18,
        quick=(1.0, 1e24),
        wrong="A uniform choice mostly takes lights that are too dim to matter: the relative standard "
        "deviation is that of the lights' powers.",
        instead="The choice goes by power, distance and cosines.",
    ),
    Case(
        "setting-sphere", "Sphere light, nearly set", "cosθ + r/d", decades(-1, -14), 1e-6, 10.0,
        _setting_at, _setting, measure="spread", samples=lambda value: 1 << 18, most_mitsuba=1 << 18,
        wrong="Of the cone that the sphere fills only a sliver is above the horizon, and nearly all samples "
        "are below.",
        instead="Where its middle is below the horizon, the light is sampled in the smallest block of "
        "elevation and azimuth that holds what is above: two thirds of it or more are the light.",
    ),
)  # fmt: skip
