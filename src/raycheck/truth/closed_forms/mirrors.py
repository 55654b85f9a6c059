"""Plane mirrors by the method of images, and metals by Fresnel's formula."""

from functools import partial
from typing import Protocol

import numpy as np

from raycheck.base.arrays import Array, Indices
from raycheck.scene.materials import Material
from raycheck.scene.reader import Scene
from raycheck.truth.closed_forms.pixel_quadrature import Radiance
from raycheck.truth.closed_forms.solids import Plate, projected_solid_angle, seen, solid, visible_solid_angle

MANY_IMAGES = 40
"""Images of a lamp in facing mirrors, to each side, that count where depth has no limit."""
MANY_BOUNCES = 64


class Lit(Protocol):
    """Irradiance (N, 3) at points p with normals n (N, 3), by paths with so many segments left."""

    def __call__(self, p: Array, n: Array, left: int) -> Array: ...


def mirror_corridor(scene: Scene) -> Radiance | None:
    """L = ρ/π · Lₑ Σ r^|k| F(image k of the lamp) on a floor between mirrors, × r for each one before it.

    The method of images: the eye's rays are followed through the mirrors; what they find is lit by the lamp's
    images, mirrored first left or first right. Exact since the mirrors are vertical and the floor flat, so
    that no mirror shows the floor any light of the floor, and since they are larger than all that they show.
    A path by way of |k| mirrors has |k| segments more.
    """
    mirrors = [Plate(s) for s in scene.shapes if s.material.kind == "conductor"]
    lamps = [Plate(s) for s in scene.shapes if s.emits]
    if len(mirrors) != 2 or len(lamps) != 1 or not scene.only_shapes_shine:
        return None
    lamp, tint = lamps[0], mirrors[0].shape.material.reflectance
    images = [[lamp.corners], [lamp.corners]]
    for first in (0, 1):
        for k in range(MANY_IMAGES):  # image k + 1 of one side is image k of the other in the mirror there
            corners = lamp.corners
            for step in range(k + 1):
                corners = mirrors[(first + k - step) % 2].reflect(corners)
            images[first].append(corners)
    depth = scene.max_depth if scene.max_depth >= 0 else MANY_BOUNCES

    def irradiance(p: Array, n: Array, left: int) -> Array:
        total = np.zeros_like(p)
        for k in range(min(left - 1, MANY_IMAGES + 1)):
            for corners in (images[0][k], images[1][k])[: 1 if k == 0 else 2]:
                total += projected_solid_angle(p, n, corners)[:, None] * tint**k * lamp.shape.radiance
        return total

    return lambda o, d: _through_mirrors(scene, o, d, depth, irradiance)


def _through_mirrors(
    scene: Scene, o: Array, d: Array, depth: int, irradiance: Lit
) -> tuple[Indices, Array, Array]:
    """What rays see by way of mirrors; `irradiance` is told how many segments are left, its own included.

    The index differs for each sequence of surfaces.
    """
    way, start, alive = d.copy(), o.copy(), np.arange(len(d))
    index, distance = np.full(len(d), -1, dtype=np.intp), np.full(len(d), np.inf)
    travelled, factor, value = np.zeros(len(d)), np.ones_like(d), np.zeros_like(d)
    count = len(scene.shapes) + 1
    for used in range(depth):
        left = depth - used
        found, t, dim = seen(scene, start[alive], way[alive], partial(irradiance, left=left))
        value[alive] += factor[alive] * np.where((found >= 0)[:, None], dim, scene.sky)
        index[alive] = index[alive] * count + found + 1
        travelled[alive] += t
        distance[alive] = travelled[alive]
        hit = found >= 0
        alive, found, t = alive[hit], found[hit], t[hit]
        start[alive] += t[:, None] * way[alive]
        go = np.zeros(len(alive), dtype=bool)
        for i, shape in enumerate(scene.shapes):
            if shape.material.kind != "conductor":
                continue
            here = alive[found == i]
            n = solid(shape).normals(start[here])
            cosine = -np.einsum("ij,ij->i", way[here], n)
            factor[here] *= reflectance_of(shape.material, cosine)
            way[here] += 2 * cosine[:, None] * n
            go[found == i] = cosine > 0
        alive = alive[go]
        if not len(alive):
            break
    return index, distance, value


def reflectance_of(material: Material, cosine: Array) -> Array:
    """Fresnel's reflectance (N, 3) of a conductor for unpolarised light, times its specular reflectance.

    Complex Fresnel coefficients: with n = η + i k and n cosθ' = √(n² − sin²θ), ½ (|r_s|² + |r_p|²).
    """
    if material.k[0] < 0:
        return np.broadcast_to(material.reflectance, (len(cosine), 3))
    n = material.eta + 1j * material.k
    c = np.clip(cosine, 0, 1)[:, None]
    inside = np.sqrt(n**2 - (1 - c**2))
    s, p = (c - inside) / (c + inside), (n**2 * c - inside) / (n**2 * c + inside)
    return np.asarray(material.reflectance * (np.abs(s) ** 2 + np.abs(p) ** 2) / 2)


def metal(scene: Scene) -> Radiance | None:
    """Sky times Fresnel's reflectance of each metal on the way: nothing is chosen at random."""
    if any(shape.emits or shape.material.kind != "conductor" for shape in scene.shapes):
        return None
    depth = scene.max_depth if scene.max_depth >= 0 else MANY_BOUNCES
    return lambda o, d: _through_mirrors(scene, o, d, depth, lambda p, n, left: np.zeros_like(p))


def mirror_light(scene: Scene) -> Radiance | None:
    """L = ρ/π · Lₑ (F(lamp) + r F(image of the lamp)) on a floor; r L(image room) in the mirror.

    The method of images: a plane mirror is a window, dimmed by its reflectance r, through which a mirrored
    room is seen. Where the lamp's image is only partly inside the window the result is NaN. Up to depth 3:
    beyond it the floor sees itself in the mirror.
    """
    mirrors = [i for i, shape in enumerate(scene.shapes) if shape.material.kind == "conductor"]
    lights = [i for i, shape in enumerate(scene.shapes) if shape.emits]
    if len(mirrors) != 1 or len(lights) != 1 or len(scene.shapes) != 3 or scene.point_lights:
        return None
    if not 1 <= scene.max_depth <= 3 or any(s.kind != "rectangle" for s in scene.shapes):
        return None
    mirror, lamp = Plate(scene.shapes[mirrors[0]]), Plate(scene.shapes[lights[0]])
    if lamp.shape.material.reflectance.any():
        return None
    reflectance = mirror.shape.material.reflectance
    image_corners = mirror.reflect(lamp.corners)

    def irradiance(p: Array, n: Array, depth: int) -> Array:
        total = np.zeros_like(p)
        if depth >= 2:
            total += visible_solid_angle(p, n, lamp, scene.shapes)[:, None] * lamp.shape.radiance
        if depth >= 3:
            inside = mirror.is_window(p, image_corners)
            lit = np.einsum("ij,j->i", mirror.reflect(p) - lamp.origin, lamp.normal) > 0
            image = np.where(lit, projected_solid_angle(p, n, image_corners), 0.0)
            total += np.where(inside, image, np.nan)[:, None] * reflectance * lamp.shape.radiance
        return total

    def radiance(o: Array, d: Array) -> tuple[Indices, Array, Array]:
        index, distance, value = seen(scene, o, d, lambda p, n: irradiance(p, n, scene.max_depth))
        there = (index == mirrors[0]) & (d @ mirror.normal < 0)
        if scene.max_depth >= 2 and there.any():
            p = o[there] + distance[there, None] * d[there]
            turned = d[there] - 2 * (d[there] @ mirror.normal)[:, None] * mirror.normal
            again, further, dim = seen(
                scene, p + 1e-9 * mirror.normal, turned, lambda p, n: irradiance(p, n, scene.max_depth - 1)
            )
            index[there] = again + len(scene.shapes)
            distance[there] += further
            value[there] = reflectance * dim
        return index, distance, value

    return radiance
