"""A cube of glass, and a plate of mixed material."""

import math
from dataclasses import replace

import numpy as np

from raycheck.base.arrays import Array, Indices
from raycheck.scene.reader import Scene
from raycheck.truth.closed_forms.mirrors import MANY_BOUNCES
from raycheck.truth.closed_forms.pixel_quadrature import Radiance
from raycheck.truth.closed_forms.solids import Plate, film_line_of, nearest, seen, visible_solid_angle


def glass_pane(scene: Scene) -> Radiance | None:
    """(1 − R₀) Σ (1 − Rₘ) R₁ … Rₘ₋₁ L(where hit m lets light out), depth 2 + m, through a cube of glass.

    A ray that has entered meets faces one after the other; at each a part 1 − R leaves, and sees only black
    lamps, the rest goes on inside: a chain that is summed to the end, total reflection included. Between
    parallel faces all R are equal. Source: Fresnel's formulas, e.g. Born & Wolf, Principles of Optics, 1.5.
    """
    glass = [i for i, shape in enumerate(scene.shapes) if shape.material.kind == "dielectric"]
    if len(glass) != 6 or not scene.only_shapes_shine or scene.max_depth == 0:
        return None
    box = replace(scene, shapes=tuple(scene.shapes[i] for i in glass))
    lamps = replace(scene, shapes=tuple(s for s in scene.shapes if s.emits))
    ratio = float(box.shapes[0].material.eta[0])
    hits = scene.max_depth - 2 if scene.max_depth > 0 else MANY_BOUNCES

    @np.errstate(invalid="ignore", divide="ignore")  # a ray through an edge of the cube may miss its faces
    def radiance(o: Array, d: Array) -> tuple[Indices, Array, Array]:
        index, distance, value = seen(scene, o, d, _dark)
        here = np.flatnonzero(np.isin(index, glass))
        value[here] = 0.0
        p, way, code = o[here] + distance[here, None] * d[here], d[here], index[here]
        part = np.ones(len(here))
        face, ratio_here = code - glass[0], 1 / ratio
        for hit in range(hits + 1):
            n = np.array([Plate(s).normal for s in box.shapes])[face]
            n = n if hit == 0 else -n
            cosine = -np.einsum("ij,ij->i", way, n)
            beyond = np.sqrt(np.maximum(1 - ratio_here**2 * (1 - cosine**2), 0))
            r = _glass_reflectance(cosine, beyond, ratio_here)
            bent = ratio_here * (way + cosine[:, None] * n) - beyond[:, None] * n
            if hit == 0:
                part, way, ratio_here = 1 - r, bent, ratio
            else:
                found, _, dim = seen(lamps, p, bent, _dark)
                value[here] += (part * (1 - r))[:, None] * dim
                code = code * 64 + face * 8 + found + 1 if hit < 6 else code
                part, way = part * r, way + 2 * cosine[:, None] * n
            if hit < hits and len(here):
                face, t = nearest(box, p, way)
                p = p + t[:, None] * way
        index[here] = len(scene.shapes) * (1 + code)
        return index, distance, value

    return radiance


def _dark(p: Array, n: Array) -> Array:
    return np.zeros_like(p)


def _glass_reflectance(cosine: Array, beyond: Array, ratio: float) -> Array:
    """Fresnel's reflectance (N,) for unpolarised light; `ratio` is the index here over that beyond."""
    s = (ratio * cosine - beyond) / (ratio * cosine + beyond)
    p = (ratio * beyond - cosine) / (ratio * beyond + cosine)
    return np.where(beyond > 0, (s**2 + p**2) / 2, 1.0)


def mixed_material(scene: Scene) -> Radiance | None:
    """(1 − m − g) ρ/π Σ L F(lamp) + (m r + g R) L(mirrored) + g (1 − R) L(refracted)/n², depth ≥ 2.

    m and g are the shares of mirror and glass. Radiance that leaves a medium of index n is spread over n²
    times the solid angle. The lamps reflect nothing, so that no path is longer. What is seen is told apart by
    lines on the film alone (`mixed_material_lines`), and what is refracted falls on one lamp that fills the
    view.
    """
    plate_index = next((i for i, s in enumerate(scene.shapes) if s.material.kind == "blendbsdf"), None)
    if plate_index is None or len(scene.point_lights) or 0 <= scene.max_depth < 2:
        return None
    shape = scene.shapes[plate_index]
    diffuse, specular = shape.material.parts
    mirror, glass = specular.parts
    share_m, share_g = (shape.material.weight * w for w in (1 - specular.weight, specular.weight))
    plate, lamps = Plate(shape), [Plate(s) for s in scene.shapes if s.emits]
    ratio = float(glass.eta[0])

    def lit(o: Array, d: Array) -> Array:
        return seen(scene, o, d, _dark)[2]

    def radiance(o: Array, d: Array) -> tuple[Indices, Array, Array]:
        index, distance, value = seen(scene, o, d, _dark)
        here = np.flatnonzero(index == plate_index)
        way, p = d[here], o[here] + distance[here, None] * d[here]
        n = np.broadcast_to(plate.normal, p.shape)
        cosine = -(way @ plate.normal)
        inner = np.sqrt(1 - (1 - cosine**2) / ratio**2)
        r = _glass_reflectance(cosine, inner, 1 / ratio)[:, None]
        turned = way + 2 * cosine[:, None] * n
        bent = (way + cosine[:, None] * n) / ratio - inner[:, None] * n
        irradiance = np.zeros_like(p)
        for lamp in lamps if len(p) else ():
            irradiance += visible_solid_angle(p, n, lamp, [])[:, None] * lamp.shape.radiance
        value[here] = (1 - shape.material.weight) * diffuse.reflectance / math.pi * irradiance
        value[here] += (share_m * mirror.reflectance + share_g * r) * lit(p, turned)
        value[here] += share_g * (1 - r) * lit(p, bent) / ratio**2
        return np.zeros_like(index), distance, value

    return radiance


def mixed_material_lines(scene: Scene) -> Array:
    """Lines (K, 3) on the film along the sides of all rectangles, and of their images in the plate."""
    plate = next(Plate(s) for s in scene.shapes if s.material.kind == "blendbsdf")
    lines = []
    for corners in (Plate(shape).corners for shape in scene.shapes):
        for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            lines.append(film_line_of(scene.camera, a, b))
            lines.append(film_line_of(scene.camera, plate.reflect(a), plate.reflect(b)))
    return np.unique(np.round([line / np.abs(line[:2]).max() for line in lines], 10), axis=0)
