"""Many rectangle lights over a floor, by an interpolant of their sum."""

from collections.abc import Callable

import numpy as np

from raycheck.base.arrays import Array
from raycheck.scene.reader import Scene
from raycheck.truth.closed_forms.pixel_quadrature import Radiance
from raycheck.truth.closed_forms.solids import Plate, in_view, seen


def lamp_grid(scene: Scene) -> Radiance | None:
    """L = ρ/π Σ Lₑ F(lamp) on a floor under rectangles parallel to it, at every depth ≥ 2; no lamp in view.

    F = Σ ± G(x, y) over the corners, at x, y from the point and height h, since the integral of h²/(π d⁴) is
    G = ½ (x/√(h²+x²) arctan(y/√(h²+x²)) + y/√(h²+y²) arctan(x/√(h²+y²))): Lambert's formula for a rectangle
    parallel to the surface, e.g. Howell, A Catalog of Radiation Heat Transfer Configuration Factors, B-4.
    """
    floors = [shape for shape in scene.shapes if not shape.emits]
    lamps = [Plate(shape) for shape in scene.shapes if shape.emits]
    shown = in_view(scene)
    if len(floors) != 1 or shown.shapes != tuple(floors) or 0 <= scene.max_depth < 2:
        return None
    center = np.array([lamp.origin for lamp in lamps])
    half = np.array([np.abs(lamp.axes).sum(axis=0) for lamp in lamps])
    light = np.array([lamp.shape.radiance for lamp in lamps])
    level = Plate(floors[0]).origin[2]
    if any(abs(lamp.normal[2] + 1) > 1e-12 for lamp in lamps) or half[:, 2].any():
        return None

    def corner(x: Array, y: Array, h: Array) -> Array:
        a, b = np.sqrt(h**2 + x**2), np.sqrt(h**2 + y**2)
        return (x / a * np.arctan(y / a) + y / b * np.arctan(x / b)) / 2

    def exact(px: Array, py: Array) -> Array:
        total = np.zeros((len(px), 3))
        for part in np.array_split(np.arange(len(px)), max(1, len(px) // 64)):
            x, y = center[:, 0] - px[part, None], center[:, 1] - py[part, None]
            h = np.broadcast_to(center[:, 2] - level, x.shape)
            for sx, sy in ((1, 1), (-1, 1), (1, -1), (-1, -1)):
                total[part] += sx * sy * corner(x + sx * half[:, 0], y + sy * half[:, 1], h) @ light
        return total

    corners = scene.camera.directions(*(np.array([[0.0, 1, 0, 1], [0, 0, 1, 1]]) * scene.camera.width))
    reach = scene.camera.origin - corners * ((scene.camera.origin[2] - level) / corners[:, 2:])
    if (corners[:, 2] >= 0).any() or scene.camera.width != scene.camera.height:
        return None
    interpolant = _interpolant(exact, reach[:, :2].min(axis=0), reach[:, :2].max(axis=0))
    return lambda o, d: seen(shown, o, d, lambda p, n: interpolant(p[:, 0], p[:, 1]))


def _interpolant(
    function: Callable[[Array, Array], Array], low: Array, high: Array, degree: int = 72
) -> Callable[[Array, Array], Array]:
    """A polynomial through a smooth function (N,), (N,) → (N, 3) at Chebyshev's points of a rectangle.

    With the nearest singularity at distance h from a side of length 2a its error goes as
    ((h + √(h² + a²))/a)^−degree, e.g. Trefethen, Approximation Theory and Approximation Practice, chapter 8.
    """
    chebyshev = np.polynomial.chebyshev
    nodes = chebyshev.chebpts1(degree)
    x, y = (grid.ravel() for grid in np.meshgrid(nodes, nodes, indexing="ij"))
    middle, half = (low + high) / 2, (high - low) / 2
    inverse = np.linalg.inv(chebyshev.chebvander(nodes, degree - 1))
    values = function(middle[0] + half[0] * x, middle[1] + half[1] * y).reshape(degree, degree, 3)
    coefficients = np.einsum("im,jn,mnc->ijc", inverse, inverse, values, optimize=True)

    def evaluate_at(x: Array, y: Array) -> Array:
        rows = chebyshev.chebvander((x - middle[0]) / half[0], degree - 1)
        columns = chebyshev.chebvander((y - middle[1]) / half[1], degree - 1)
        return np.stack([np.sum((rows @ coefficients[..., c]) * columns, axis=1) for c in range(3)], axis=-1)

    return evaluate_at
