"""Plastics and thin panes that see nothing but lamps and the sky: Fresnel's formulas and quadrature."""

import math
from dataclasses import replace

import numpy as np

from raycheck.base.arrays import Array, Indices
from raycheck.scene.coats import diffuse_fresnel
from raycheck.scene.materials import Material
from raycheck.scene.reader import Scene
from raycheck.truth.closed_forms.pixel_quadrature import Radiance
from raycheck.truth.closed_forms.solids import Plate, nearest

LAMP = 24
"""Nodes along a lamp and across: to 1e-12 of what the scene's plates reflect."""
KINDS = ("plastic", "thindielectric")


def fresnel(cosine: Array, eta: float) -> Array:
    """Reflectance (N,) of a boundary to eta times the index, as half the sum of the squares of amplitudes."""
    beyond = np.sqrt(np.maximum(1 - (1 - cosine**2) / eta**2, 0))
    s = (cosine - eta * beyond) / (cosine + eta * beyond)
    p = (eta * cosine - beyond) / (eta * cosine + beyond)
    return np.asarray((s * s + p * p) / 2)


def plastic(scene: Scene) -> Radiance | None:
    """L = F L(mirror) + (1 − F) d/(π η² (1 − r)) ∫ (1 − F(θi)) L cosθi dω of plastic, with F of θo, d its
    diffuse reflectance, r that of the coat from inside, times d where it is nonlinear;
    L = 2F/(1 + F) L(mirror) + (1 − F)/(1 + F) L(behind) of a pane. At any depth.

    None where plates are not in one plane, or a lamp is before plastic but not wholly so, or turned away.
    """
    if any(s.kind != "rectangle" for s in scene.shapes) or 0 <= scene.max_depth < 2 or scene.point_lights:
        return None
    lamps = [Plate(s) for s in scene.shapes if s.emits]
    plates = {i: Plate(s) for i, s in enumerate(scene.shapes) if s.material.kind in KINDS}
    if len(lamps) + len(plates) != len(scene.shapes) or not plates:
        return None
    if any(a.shape.material.kind != "diffuse" or a.shape.material.reflectance.any() for a in lamps):
        return None
    if any(plate.shape.material.textures for plate in plates.values()):
        return None
    first = next(iter(plates.values()))
    for plate in plates.values():
        if np.abs((plate.corners - first.origin) @ first.normal).max() > 1e-12:
            return None
        for lamp in lamps:
            height = (lamp.corners - plate.origin) @ plate.normal
            faces = ((plate.corners - lamp.origin) @ lamp.normal).min() > 0
            if not (faces and (height.min() > 0 or height.max() < 0)):
                return None
    around = replace(scene, shapes=tuple(lamp.shape for lamp in lamps))

    def found(o: Array, d: Array) -> tuple[Indices, Array]:
        """Which lamp is met, and the radiance (N, 3) that comes from it or the sky against d."""
        index, _ = nearest(around, o, d)
        value = np.tile(scene.sky, (len(d), 1))
        for i, lamp in enumerate(lamps):
            front = d @ lamp.normal < 0
            value[index == i] = np.where(front[index == i, None], lamp.shape.radiance, 0.0)
        return index, value

    def radiance(o: Array, d: Array) -> tuple[Indices, Array, Array]:
        index, distance = nearest(scene, o, d)
        value = found(o, d)[1]
        code = np.zeros(len(d), dtype=np.intp)
        for i, plate in plates.items():
            here = np.flatnonzero(index == i)
            p = o[here] + distance[here, None] * d[here]
            mirrored, behind = (
                found(p, way)
                for way in (d[here] - 2 * (d[here] @ plate.normal)[:, None] * plate.normal, d[here])
            )
            value[here] = _leaves(scene, plate, lamps, p, d[here], mirrored[1], behind[1])
            code[here] = 1 + (mirrored[0] + 1) * (len(lamps) + 1)
            code[here] += behind[0] + 1 if plate.shape.material.kind == "thindielectric" else 0
        return np.where(index < 0, index, index + len(scene.shapes) * code), distance, value

    return radiance


def _leaves(
    scene: Scene, plate: Plate, lamps: list[Plate], p: Array, d: Array, mirrored: Array, behind: Array
) -> Array:
    """Radiance (N, 3) from points p of a plate against d, by what is in the mirror and behind."""
    material, along = plate.shape.material, d @ plate.normal
    eta = float(material.eta[0])
    f = fresnel(np.abs(along), eta)[:, None]
    if material.kind == "thindielectric":
        return np.asarray(
            (2 * f * material.reflectance * mirrored + (1 - f) * material.transmittance * behind) / (1 + f)
        )
    inner = diffuse_fresnel(eta) * (material.reflectance if material.nonlinear else 1)
    base = material.reflectance / (math.pi * eta**2 * (1 - inner))
    value = f * material.specular * mirrored + (1 - f) * base * _let_in(scene, plate, lamps, p, material)
    return np.where(along[:, None] < 0, value, 0.0)


def _let_in(scene: Scene, plate: Plate, lamps: list[Plate], p: Array, material: Material) -> Array:
    """∫ (1 − F(θi)) L cosθi dω (N, 3): the sky, and each lamp for the sky."""
    eta, (x, w) = float(material.eta[0]), np.polynomial.legendre.leggauss(200)
    c = (x + 1) / 2
    total = np.tile(scene.sky * math.pi * float((1 - fresnel(c, eta)) @ (w * c)), (len(p), 1))
    nodes, weights = np.polynomial.legendre.leggauss(LAMP)
    for lamp in lamps:
        if ((lamp.corners - plate.origin) @ plate.normal).max() < 0:
            continue
        size = float(np.linalg.norm(np.cross(*lamp.axes)))
        x, y = (grid.ravel() for grid in np.meshgrid(nodes, nodes))
        area = np.outer(weights, weights).ravel() * size
        share = np.zeros(len(p))
        for place, piece in zip(lamp.at(x, y), area, strict=True):
            to_lamp = place - p
            far = np.linalg.norm(to_lamp, axis=1)
            cosine, at_lamp = to_lamp @ plate.normal / far, -(to_lamp @ lamp.normal) / far
            share += piece * (1 - fresnel(cosine, eta)) * cosine * at_lamp / far**2
        total += share[:, None] * (lamp.shape.radiance - scene.sky)
    return total
