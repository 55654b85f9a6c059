"""The sky, the sun and a spot over rectangles."""

import math

import numpy as np

from raycheck.base.arrays import Array, Flags, Indices
from raycheck.scene.reader import Scene, Spot
from raycheck.truth.closed_forms.pixel_quadrature import Radiance
from raycheck.truth.closed_forms.solids import Plate, above_horizon, nearest, seen, solid


def open_sky(scene: Scene) -> Radiance | None:
    """L = ρ/π · Lₛ (π − Σ F) on a floor and a convex block on it under a uniform sky, at depth 2.

    F is the projected solid angle, above the horizon, of each rectangle whose front is seen from the point:
    of a convex block the fronts hide all that the block hides, and do not hide each other.
    """
    if scene.max_depth != 2 or not scene.sky.any() or any(s.kind != "rectangle" for s in scene.shapes):
        return None
    plates = [Plate(shape) for shape in scene.shapes]

    def irradiance(p: Array, n: Array) -> Array:
        open_part = np.full(len(p), math.pi)
        for plate in plates:
            front = (p - plate.origin) @ plate.normal > 1e-12
            open_part -= np.where(front, above_horizon(p, n, plate.corners), 0.0)
        return open_part[:, None] * scene.sky

    def radiance(o: Array, d: Array) -> tuple[Indices, Array, Array]:
        index, distance, value = seen(scene, o, d, irradiance)
        value[index < 0] = scene.sky
        return index, distance, value

    return radiance


def sun_and_spot(scene: Scene) -> Radiance | None:
    """L = ρ/π (E cosθ + I s cosθ/d²) where the sun and the spot are seen, at depth 2.

    s is the spot's falloff as Mitsuba has it: 1 up to the beam width, from there down to 0 at the cutoff in
    proportion to the angle.
    """
    if scene.max_depth != 2 or scene.point_lights or scene.sky.any():
        return None

    def reaches(p: Array, way: Array, far: Array) -> Flags:
        return nearest(scene, p, way)[1] > far

    def radiance(o: Array, d: Array) -> tuple[Indices, Array, Array]:
        lights_seen = np.zeros(len(d), dtype=np.intp)
        index, distance = nearest(scene, o, d)
        value = np.zeros_like(d)
        for i, shape in enumerate(scene.shapes):
            here = np.flatnonzero(index == i)
            p = o[here] + distance[here, None] * d[here]
            n = solid(shape).normals(p)
            total = np.zeros_like(p)
            for k, sun in enumerate(scene.suns):
                cosine = np.maximum(-(n @ sun.direction), 0)
                free = reaches(p, np.broadcast_to(-sun.direction, p.shape), np.full(len(p), 1e9))
                total += np.where(free, cosine, 0.0)[:, None] * sun.irradiance
                lights_seen[here] += free.astype(np.intp) << k
            for k, spot in enumerate(scene.spots, len(scene.suns)):
                to_light = spot.position - p
                far = np.linalg.norm(to_light, axis=1)
                way = to_light / far[:, None]
                free = reaches(p, way, far)
                cosine = np.maximum(np.einsum("ij,ij->i", way, n), 0)
                total += (np.where(free, cosine, 0.0) * _falloff(spot, way) / far**2)[
                    :, None
                ] * spot.intensity
                lights_seen[here] += free.astype(np.intp) << k
            value[here] = shape.material.reflectance / math.pi * total
        return np.where(index < 0, -1, index + len(scene.shapes) * lights_seen), distance, value

    return radiance


def _falloff(spot: Spot, way: Array) -> Array:
    angle = np.arccos(np.clip(-way @ spot.axis, -1, 1))
    return np.clip((spot.cutoff - angle) / (spot.cutoff - spot.beam), 0, 1)
