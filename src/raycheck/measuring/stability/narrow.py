"""Narrow cones of light and of view."""

import math
from collections.abc import Sequence

import mpmath
import numpy as np
from mpmath import mp, mpf

from raycheck.base import data
from raycheck.measuring.stability.case import Case, Parsed, Settings, Truth, decades, one
from raycheck.measuring.stability.formulas import lambert, same


def _spot(p: Parsed) -> Truth:
    theta, cutoff, beam = mpmath.atan(p("x")), p("cutoff") * mp.pi / 180, p("beam") * mp.pi / 180
    falloff = (cutoff - theta) / (cutoff - beam)
    return same(lambert(p) * p("intensity") * mpmath.cos(theta) ** 4 * falloff / mpmath.cos(theta))


def _spot_at(cutoff: float) -> list[Settings]:
    x = math.tan(math.radians(0.875 * cutoff))
    fov = math.degrees(1e-4 * x)
    return one(cutoff=cutoff, beam=0.75 * cutoff, x=x, eye=f"{x!r}, 0, 0.5", fov=fov)


def ball_targets(count: int = 12) -> list[str]:
    """Vertices and middles of edges of the mesh that mesh-seams.xml looks at from within."""
    lines = (
        (data.scenes_dir() / "meshes" / "coarse-ball.ply").read_text().split("end_header\n")[1].splitlines()
    )
    vertices = [np.array([float(word) for word in line.split()[:3]]) for line in lines[:42]]
    edges = {
        tuple(sorted(pair)) for line in lines[42:] for pair in _edges([int(w) for w in line.split()[1:]])
    }
    places = [*vertices[::4], *((vertices[a] + vertices[b]) / 2 for a, b in sorted(edges)[::11])]
    return [", ".join(repr(float(x)) for x in place) for place in places][: 2 * count]


def _edges(corners: Sequence[int]) -> list[tuple[int, int]]:
    return [(corners[k], corners[(k + 1) % 3]) for k in range(3)]


def _seams(fov: float) -> list[Settings]:
    return [one(target=target, fov=fov)[0] for target in ball_targets()]


def _sliver(width: float) -> list[Settings]:
    return one(width=width, fov=math.degrees(2 * math.atan(min(15 * width, 0.4))))


CASES = (
    Case(
        "narrow-spot", "Narrow spot", "cutoff angle, degrees", (20.0, *decades(0, -10)), 1e-6, 1e-2,
        _spot_at, _spot,
        wrong="Whether a direction is within the cone is decided by its cosine, which near the axis is 1 − "
        "θ²/2: below 0.03° single floats do not tell cutoff and beam apart.",
        instead="θ = atan2(|a × d|, a · d), and the falloff is linear in θ.",
    ),
    Case(
        "mesh-seams", "Rays aimed at vertices and edges", "field of view, degrees",
        decades(0, -14), 1e-14, 0.0,
        _seams, lambda p: Truth(mpf(0), mpf(1)),
        samples=lambda value: 1 << 12, most_mitsuba=1 << 12, quick=(1e-2, 1e-14),
        wrong="A ray at the edge of two triangles may be outside both by rounding: 12 % of rays aimed at "
        "edges, 24 % at vertices go through.",
        instead="Edge functions of the triangle sheared along the ray (Woop et al. 2013): both sides of an "
        "edge compute the same rounded number, and 0 counts as inside.",
    ),
    Case(
        "slivers", "Slivers", "width", decades(-1, -14), 1e-12, 0.0,
        _sliver, lambda p: Truth(mpf(0), mpf(1)), samples=lambda value: 1 << 16, most_mitsuba=1 << 16,
        wrong="Rays near the edges of thin triangles slip between them: in strips of width 1e-6, 2.4 % of "
        "all rays.",
        instead="The same edge functions as for seams. A sliver's normal is the cross product of edges "
        "scaled to 1, so that nothing underflows.",
    ),
)  # fmt: skip
