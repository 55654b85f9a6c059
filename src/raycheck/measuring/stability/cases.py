"""The stiff cases: which parameter of which scene is swept, what the picture ought to be, how far it should
hold. Each module has those of one subject, with their closed forms and settings.
"""

from raycheck.measuring.stability import (
    angles,
    bounces,
    choices,
    facets,
    gaps,
    narrow,
    places,
    scales,
    spheres,
    sums,
)
from raycheck.measuring.stability.case import Case

CASES: tuple[Case, ...] = (
    *spheres.CASES, *gaps.CASES, *places.CASES, *scales.CASES, *angles.CASES, *sums.CASES,
    *bounces.CASES, *narrow.CASES, *choices.CASES, *facets.CASES,
)  # fmt: skip
