"""Radiances and numbers of samples that sums must bear."""

from raycheck.measuring.stability.case import EXACT, Case, decades, one
from raycheck.measuring.stability.formulas import same

CASES = (
    Case(
        "radiance-low", "Dim light", "radiance of the picture", decades(0, -44), 1e-37, 1e-2,
        lambda out: one(radiance=2 * out), lambda p: same(p.number(0.5) * p("radiance")),
        scene="radiance", samples=lambda value: 1 << 18, most_mitsuba=1 << 17,
        wrong="Radiances below 1e-38 lose digits as single floats, and products with them are 0.",
        instead="Sums in double; --precision auto renders in double what is dimmer than 1e-12. The picture's "
        "single floats end at 1e-45.",
    ),
    Case(
        "radiance-high", "Bright light", "radiance of the picture", (*decades(0, 38), 3e38), 1e38, 1e-2,
        lambda out: one(radiance=2 * out), lambda p: same(p.number(0.5) * p("radiance")),
        scene="radiance", samples=lambda value: 1 << 18, most_mitsuba=1 << 17,
        wrong="A sum of samples overflows long before their mean does.",
        instead="Sums in double. A mean beyond 3.4e38, which no picture of single floats can hold, is an "
        "error.",
    ),
    Case(
        "many-samples", "Many samples in one pixel", "samples",
        tuple(2.0**k for k in range(10, 27, 2)), 2.0**26, EXACT,
        lambda n: one(), lambda p: same(p("radiance")),
        samples=lambda value: int(value), quick=(2.0**10, 2.0**20), most_mitsuba=1 << 24,
        wrong="A single float that has counted to 2²⁴ no longer grows by adding 1: the mean of equal samples "
        "drifts, 1 % at 2²⁰, 15 % at 2²⁴.",
        instead="Sums in double, in a fixed binary tree over the samples' index.",
    ),
)  # fmt: skip
