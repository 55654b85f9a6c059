"""Scenes of any size, and far from the origin."""

from mpmath import mpf

from raycheck.measuring.stability.case import Case, Parsed, Settings, Truth, decades, one
from raycheck.measuring.stability.formulas import lambert, rectangle_irradiance, same


def _lamps(p: Parsed) -> Truth:
    """scale.xml and offset.xml: of two lamps the one that is seen."""
    quarter = mpf(1) / 4
    return same(lambert(p) * 16 * rectangle_irradiance(-3 * quarter, -quarter, -quarter, quarter, mpf(1)))


def _furnace(p: Parsed) -> Truth:
    return same(p("radiance") * sum(p("reflectance") ** k for k in range(int(p("depth")))))


def _scale(k: float) -> list[Settings]:
    return one(scale=k, camera=-0.25 * k, height=0.5 * k, near=0.001 * k, far=10 * k)


def _furnace_scale(k: float) -> list[Settings]:
    return one(radius=k, near=0.001 * k, far=10 * k, target=f"{0.6 * k!r}, {0.48 * k!r}, {0.64 * k!r}")


def _offset(at: float) -> list[Settings]:
    return one(offset=at, eye=f"{at - 0.25!r}, {at!r}, {at + 0.5!r}", target=f"{at!r}, {at!r}, {at!r}")


CASES = (
    Case(
        "scale-small", "Whole-scene scale, small", "scale", decades(0, -18), 1e-12, 1e-2,
        _scale, _lamps, scene="scale", samples=lambda value: 1 << 20, most_mitsuba=1 << 20,
        wrong="Epsilons of the kind 1e-4 (1 + |p|) are a share of the scene only while it is about 1 large.",
        instead="Nothing is compared with an absolute length.",
    ),
    Case(
        "scale-large", "Whole-scene scale, large", "scale", decades(0, 18), 1e12, 1e-2,
        _scale, _lamps, scene="scale", samples=lambda value: 1 << 20, most_mitsuba=1 << 20,
        wrong="An absolute epsilon does no harm here, but squares of lengths overflow in single precision "
        "from 1e19 on.",
        instead="Nothing is compared with an absolute length, and lengths are in double.",
    ),
    Case(
        "scale-furnace", "Furnace of any size", "radius", decades(0, -18), 1e-12, 1e-2,
        _furnace_scale, _furnace,
        wrong="In a furnace of radius 1e-4 a step of 1e-5 at each bounce leaves the sphere, or misses near "
        "walls.",
        instead="A ray leaves out the surface that it starts from by its number; there is no step.",
    ),
    Case(
        "offset", "Far from the origin", "offset", decades(0, 15), 1e7, 1e-2,
        _offset, _lamps, samples=lambda value: 1 << 20, most_mitsuba=1 << 20,
        wrong="Single floats at 1e4 are 1e-3 apart: a gap of 1/64 is a few steps wide, and epsilons grow "
        "with |p|.",
        instead="Geometry in double: at 1e7 numbers are 2e-9 apart. --precision auto takes double where a "
        "scene is further from the origin than 16 times its size.",
    ),
)  # fmt: skip
