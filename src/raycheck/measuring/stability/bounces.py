"""Paths that hardly end."""

from raycheck.measuring.stability.case import Case, Settings, decades, one
from raycheck.measuring.stability.formulas import same


def _corridor(count: float) -> list[Settings]:
    slopes = (0.5, 0.75, 1.25, 2.0)
    kept = 1 - 5 / max(
        count, 100.0
    )  # so that each count shows, and the light of all of them is within floats
    return [
        one(length=count / s, slope=s, depth=int(count) + 10, far=10 * count, reflectance=kept)[0]
        for s in slopes
    ]


CASES = (
    Case(
        "white-furnace", "Furnace that hardly absorbs, with roulette", "1 − ρ", decades(-1, -5), 1e-5, 1e-2,
        lambda x: one(reflectance=1 - x, radiance=x),
        lambda p: same(p("radiance") / (1 - p("reflectance"))),
        quick=(1e-1, 1e-2), most_mitsuba=1 << 17, options=("--estimator", "walk"),
        wrong="Survival is often capped at 0.95 “so that paths end”. Where walls reflect more than that, "
        "each bounce multiplies by albedo/0.95: the second moment grows without end, and the mean is "
        "carried by paths that are never drawn.",
        instead="A path survives with min(1, throughput), without a cap. The limit of 10⁷ vertices is an "
        "error, not a cut.",
    ),
    Case(
        "corridor", "Light down a corridor of mirrors", "reflections",
        (10.0, 100.0, 1000.0, 1e4, 1e5), 1e4, 1e-2,
        _corridor, lambda p: same(p("radiance")), samples=lambda value: 256, measure="bounces",
        wrong="A ray between mirrors starts off its mirror by rounding, or by the epsilon that was to help: "
        "one in some thousand rays meets the same mirror twice or slips behind it.",
        instead="The hit is put onto the mirror's plane, and the mirror that the ray leaves is left out.",
    ),
)  # fmt: skip
