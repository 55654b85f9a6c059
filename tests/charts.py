"""What a point sees of a light, worked out apart from the tracer: a chart takes the unit square to the
directions in which the light is seen. A new shape of light is one more chart.

Each has `directions(places)`, places (2, n) to unit vectors (3, n) and the solid angle per area of the square
(n,), and its inverse `places(directions)`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from sampling import Array, column


def frame(axis: Array) -> tuple[Array, Array]:
    """Two unit vectors (3, 1) that complete the unit vector (3, 1)."""
    helper = column([1, 0, 0] if abs(axis[0, 0]) < 0.7 else [0, 1, 0])
    s = np.cross(axis, helper, axis=0)
    s /= np.linalg.norm(s)
    return s, np.cross(axis, s, axis=0)


def turn(y: Array, x: Array) -> Array:
    """The angle of (x, y) in turns, [0, 1)."""
    return np.arctan2(y, x) / (2 * np.pi) % 1


@dataclass(frozen=True)
class Flat:
    """A rectangle center ± x ± y, a disk about it with the half axes x and y, or the triangle of the corners
    center, center + x, center + y, as seen from `eye`.
    """

    kind: str
    center: ArrayLike
    x: ArrayLike
    y: ArrayLike
    eye: ArrayLike = (0, 0, 0)

    def across(self, places: Array) -> tuple[Array, Array, float]:
        """Coordinates along x and y, and the area in units of |x × y|."""
        a, b = places
        if self.kind == "rectangle":
            return 2 * a - 1, 2 * b - 1, 4
        if self.kind == "disk":
            return np.sqrt(a) * np.cos(2 * np.pi * b), np.sqrt(a) * np.sin(2 * np.pi * b), np.pi
        return np.sqrt(a) * (1 - b), np.sqrt(a) * b, 0.5

    def along(self, x: Array, y: Array) -> Array:
        """The inverse of `across`."""
        if self.kind == "rectangle":
            return np.stack([(x + 1) / 2, (y + 1) / 2])
        if self.kind == "disk":
            return np.stack([x**2 + y**2, turn(y, x)])
        return np.stack([(x + y) ** 2, y / (x + y)])

    def of_points(self, points: Array) -> Array:
        """Where on the square the points (3, n) of the light are."""
        x, y = column(self.x), column(self.y)
        n = np.cross(x, y, axis=0)
        q = points - column(self.center)
        across = [(np.cross(q, y, axis=0) * n).sum(axis=0), (np.cross(x, q, axis=0) * n).sum(axis=0)]
        return self.along(*(np.array(across) / (n**2).sum()))

    def directions(self, places: Array) -> tuple[Array, Array]:
        x, y, area = self.across(places)
        n = np.cross(column(self.x), column(self.y), axis=0)
        to = column(self.center) + column(self.x) * x + column(self.y) * y - column(self.eye)
        distance = np.linalg.norm(to, axis=0)
        return to / distance, area * np.abs((n * to).sum(axis=0)) / distance**3

    def places(self, directions: Array) -> Array:
        n = np.cross(column(self.x), column(self.y), axis=0)
        away = ((column(self.center) - column(self.eye)) * n).sum()
        return self.of_points(column(self.eye) + directions * away / (directions * n).sum(axis=0))


@dataclass(frozen=True)
class Ball:
    """The visible part of a sphere, all of it from inside: even steps of its area."""

    center: ArrayLike
    radius: float
    eye: ArrayLike = (0, 0, 0)

    @property
    def view(self) -> tuple[Array, float, float]:
        """The unit vector from the center to the eye, their distance, and the least z that is seen."""
        away = column(self.eye) - column(self.center)
        d = float(np.linalg.norm(away))
        return away / d, d, self.radius / d if d > self.radius else -1.0

    def directions(self, places: Array) -> tuple[Array, Array]:
        axis, d, least = self.view
        s, t = frame(axis)
        z = least + (1 - least) * places[0]
        r, angle = np.sqrt((1 - z) * (1 + z)), 2 * np.pi * places[1]
        normal = axis * z + s * (r * np.cos(angle)) + t * (r * np.sin(angle))
        to = normal * self.radius - axis * d
        distance = np.linalg.norm(to, axis=0)
        cosine = np.abs((normal * to).sum(axis=0)) / distance
        return to / distance, 2 * np.pi * self.radius**2 * (1 - least) * cosine / distance**2

    def places(self, directions: Array) -> Array:
        axis, d, least = self.view
        s, t = frame(axis)
        b = -d * (axis * directions).sum(axis=0)
        root = np.sqrt(np.maximum(self.radius**2 - d**2 + b**2, 0))
        to = directions * (b - root if d > self.radius else b + root)
        normal = (axis * d + to) / self.radius
        z = (axis * normal).sum(axis=0)
        return np.stack([(z - least) / (1 - least), turn((t * normal).sum(axis=0), (s * normal).sum(axis=0))])


@dataclass(frozen=True)
class Cone:
    """The directions within 1 - cosθ <= extent of an axis: even steps of solid angle. With extent 2, all."""

    axis: ArrayLike
    extent: float

    def directions(self, places: Array) -> tuple[Array, Array]:
        axis = column(self.axis) / np.linalg.norm(self.axis)
        s, t = frame(axis)
        x, angle = places[0] * self.extent, 2 * np.pi * places[1]
        r = np.sqrt(x * (2 - x))
        to = axis * (1 - x) + s * (r * np.cos(angle)) + t * (r * np.sin(angle))
        return to, np.full(x.shape, 2 * np.pi * self.extent)

    def places(self, directions: Array) -> Array:
        axis = column(self.axis) / np.linalg.norm(self.axis)
        s, t = ((side * directions).sum(axis=0) for side in frame(axis))
        z, rr = (axis * directions).sum(axis=0), s**2 + t**2
        x = np.where(z > 0, rr / (1 + np.abs(z)), 1 - z)  # 1 - cosθ without cancellation
        return np.stack([x / self.extent, turn(t, s)])


def sphere_cone(center: ArrayLike, radius: float, eye: ArrayLike = (0, 0, 0)) -> Cone:
    """The cone that a sphere fills: sinθmax = R/d."""
    to = np.subtract(center, eye)
    s = radius / np.linalg.norm(to)
    return Cone(to, s**2 / (1 + np.sqrt((1 - s) * (1 + s))))
