"""Means of an exact radiance over the pixels of a picture: what the box filter of a renderer converges to."""

from collections.abc import Callable

import numpy as np

from raycheck.base.arrays import Array, Flags, Indices
from raycheck.scene.reader import Camera

Radiance = Callable[[Array, Array], tuple[Indices, Array, Array]]
"""Origins and unit directions (N, 3 each) → what is seen (N,; −1 nothing), how far (N,), radiance (N, 3)."""

TOLERANCE = 3e-7
"""How far the two rules may differ, relative to a pixel's mean or to a hundredth of the picture's mean; the
finer one, which is used, is off by less than 1e-10 then (measured against a tolerance of 3e-10)."""
FINEST = 6
"""Pieces of a pixel are divided at most this often."""


def pixel_means(
    camera: Camera, radiance: Radiance, edge_points: Array, kinks: Array, border: int = 1
) -> Array:
    """Means (H, W, 3) over the pixels' squares; NaN where there is an edge or the radiance is NaN.

    `edge_points` (N, 3) lie, far denser than pixels, on all edges. `kinks` (K, 3) are lines a·x + b·y + c = 0
    on the film, in pixels, across which the radiance is not smooth. Pixels are cut along them into pieces, in
    each of which Gauss–Legendre rules of 2×2 and 4×4 points have to agree, else it is divided in four. Edges
    that `edge_points` miss (in bent mirrors, say) are found where what is seen differs along a pixel's
    border, at `border` steps a side.
    """
    good = ~_pixels_with_edges(camera, radiance, edge_points, border)
    pixel, pieces = _pieces(camera, np.flatnonzero(good), kinks)
    total = np.zeros((camera.height * camera.width, 3))
    first = np.full(camera.height * camera.width, -2, dtype=np.intp)
    allowed = None
    for level in range(FINEST + 1):
        rough, _, _ = _integrals(camera, radiance, pieces, 2)
        fine, low, high = _integrals(camera, radiance, pieces, 4)
        if allowed is None:
            first[pixel] = low
            whole = np.zeros_like(total)
            np.add.at(whole, pixel, np.nan_to_num(np.abs(fine)))
            allowed = TOLERANCE * np.maximum(whole.max(axis=1), whole.mean() / 100)
        total[pixel[(low != high) | (low != first[pixel])]] = np.nan  # an edge after all
        error = np.abs(fine - rough).max(axis=1)
        divide = (error > allowed[pixel] * 2.0**-level) & np.isfinite(total[pixel, 0])
        if level == FINEST:
            fine[divide] = np.nan
            divide[:] = False
        np.add.at(total, pixel[~divide], fine[~divide])
        if not divide.any():
            break
        pixel, pieces = np.repeat(pixel[divide], 4), _quarters(pieces[divide])
    total[~good] = np.nan
    return total.reshape(camera.height, camera.width, 3)


def _pieces(camera: Camera, pixels: Indices, kinks: Array) -> tuple[Indices, Array]:
    """Convex quadrilaterals (N, 4, 2), in film pixels, that make up the given pixels; and their pixels (N,).

    None is crossed by a kink. A triangle is a quadrilateral whose last corner is its first.
    """
    corner = np.stack([pixels % camera.width, pixels // camera.width], axis=-1).astype(float)
    squares = corner[:, None, :] + np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    side = squares @ kinks[:, :2].T + kinks[:, 2]
    crossed = (side.min(axis=1) < -1e-12) & (side.max(axis=1) > 1e-12)
    whole = ~crossed.any(axis=1)
    owners, pieces = [pixels[whole]], [squares[whole]]
    for pixel, square, lines in zip(pixels[~whole], squares[~whole], crossed[~whole], strict=True):
        polygons = [square]
        for line in kinks[lines]:
            polygons = [part for polygon in polygons for part in _cut(polygon, line)]
        for polygon in polygons:
            for k in range(1, len(polygon) - 1, 2):
                last = k + 2 if k + 2 < len(polygon) else 0
                owners.append(np.array([pixel]))
                pieces.append(polygon[None, [0, k, k + 1, last]])
    return np.concatenate(owners), np.concatenate(pieces)


def _cut(polygon: Array, line: Array) -> list[Array]:
    """The one or two parts (K, 2) of a convex polygon on the two sides of a line."""
    side = polygon @ line[:2] + line[2]
    parts: tuple[list[Array], list[Array]] = ([], [])
    for k in range(len(polygon)):
        a, b = side[k - 1], side[k]
        if a * b < 0:
            middle = polygon[k - 1] + a / (a - b) * (polygon[k] - polygon[k - 1])
            parts[0].append(middle)
            parts[1].append(middle)
        if b >= 0:
            parts[0].append(polygon[k])
        if b <= 0:
            parts[1].append(polygon[k])
    return [np.array(part) for part in parts if len(part) > 2]


def _quarters(pieces: Array) -> Array:
    """Four quadrilaterals (4N, 4, 2) in place of each."""
    a, b, c, d = (pieces[:, k] for k in range(4))
    ab, bc, cd, da, middle = (a + b) / 2, (b + c) / 2, (c + d) / 2, (d + a) / 2, (a + b + c + d) / 4
    parts = [(a, ab, middle, da), (ab, b, bc, middle), (middle, bc, c, cd), (da, middle, cd, d)]
    return np.stack([np.stack(part, axis=1) for part in parts], axis=1).reshape(-1, 4, 2)


def _integrals(
    camera: Camera, radiance: Radiance, pieces: Array, order: int
) -> tuple[Array, Indices, Indices]:
    """Integrals (N, 3) over quadrilaterals, and the smallest and largest index of what is seen in each.

    The unit square is mapped bilinearly: (1−u)(1−v) a + u (1−v) b + u v c + (1−u) v d.
    """
    nodes, weights = np.polynomial.legendre.leggauss(order)
    u, v = (grid.ravel() for grid in np.meshgrid((nodes + 1) / 2, (nodes + 1) / 2))
    weight = np.outer(weights, weights).ravel() / 4
    film = np.einsum("kq,nkc->nqc", np.stack([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v]), pieces)
    along_u = np.einsum("kq,nkc->nqc", np.stack([v - 1, 1 - v, v, -v]), pieces)
    along_v = np.einsum("kq,nkc->nqc", np.stack([u - 1, -u, u, 1 - u]), pieces)
    area = np.abs(along_u[..., 0] * along_v[..., 1] - along_u[..., 1] * along_v[..., 0])
    d = camera.directions(film[..., 0], film[..., 1]).reshape(-1, 3)
    index, _, value = radiance(np.broadcast_to(camera.origin, d.shape), d)
    index = index.reshape(len(pieces), -1)
    integral = np.einsum("nqc,nq->nc", value.reshape(len(pieces), -1, 3), weight * area)
    return integral, index.min(axis=1), index.max(axis=1)


def _pixels_with_edges(camera: Camera, radiance: Radiance, points: Array, border: int) -> Flags:
    """Which pixels (H·W,) hold an edge that is not hidden, or see different things along their border."""
    width, height = camera.width, camera.height
    marked = np.zeros((height, width), dtype=bool)
    x, y = camera.film(points)
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    x, y = x[inside].astype(int), y[inside].astype(int)
    d = points[inside] - camera.origin
    length = np.linalg.norm(d, axis=1)
    if len(d):
        _, distance, _ = radiance(np.broadcast_to(camera.origin, d.shape), d / length[:, None])
        visible = distance >= length * (1 - 1e-6)
        marked[y[visible], x[visible]] = True

    def differs(x: Array, y: Array) -> Flags:
        """Whether neighbours along the last axis of (lines, steps + 1) differ, for each pixel's side."""
        d = camera.directions(x.ravel(), y.ravel())
        index, _, _ = radiance(np.broadcast_to(camera.origin, d.shape), d)
        change = np.diff(index.reshape(x.shape), axis=1) != 0
        return np.asarray(change.reshape(len(x), -1, border).any(axis=2))

    along_x, along_y = (np.linspace(0, n, n * border + 1) for n in (width, height))
    rows = differs(*np.meshgrid(along_x, np.arange(height + 1.0)))
    columns = differs(*np.meshgrid(np.arange(width + 1.0), along_y, indexing="ij"))
    marked |= rows[:-1] | rows[1:] | columns[:-1].T | columns[1:].T
    return marked.ravel()
