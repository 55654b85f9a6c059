"""Point lights, and rectangle and ball lights over rectangles."""

import numpy as np

from raycheck.base.arrays import Array
from raycheck.scene.reader import Scene, Shape
from raycheck.truth.closed_forms.pixel_quadrature import Radiance
from raycheck.truth.closed_forms.solids import (
    Plate,
    ball_solid_angle,
    is_free,
    seen,
    solid,
    visible_solid_angle,
)


def point_light(scene: Scene) -> Radiance | None:
    """L = ρ/π · I cosθ / d² on a floor under one point light, at every depth ≥ 2: a plane never sees itself.

    Source: definition of intensity (W/sr); a patch at distance d catches cosθ/d² steradians of it.
    """
    if len(scene.point_lights) != 1 or len(scene.shapes) != 1 or 0 <= scene.max_depth < 2:
        return None
    light = scene.point_lights[0]

    def irradiance(p: Array, n: Array) -> Array:
        to_light = light.position - p
        d = np.linalg.norm(to_light, axis=-1)
        cosine = np.maximum(0, np.einsum("ij,ij->i", to_light, n) / d)
        return np.asarray((cosine / d**2)[:, None] * light.intensity)

    return lambda o, d: seen(scene, o, d, irradiance)


def flat_and_round_lights(scene: Scene) -> Radiance | None:
    """L = Lₑ + ρ/π Σ Lₑ F for black rectangle and ball lights over rectangles, at depth 1 and 2.

    F is the projected solid angle of what is above the horizon: Lambert's formula for rectangles, and for
    meshes that fill one, less the shadows of others (a rectangle parallel to a light throws one that is a
    rectangle again: its corners scaled about p by the ratio of the two planes' distances), and
    `ball_solid_angle` for balls, which for a ball all above the horizon is that of a point with its flux,
    4π²R²Lₑ over 4πd² (Gauss), times the cosine.
    Deeper too where no surface sees another.
    """
    lights = [shape for shape in scene.shapes if shape.emits]
    rest = [shape for shape in scene.shapes if not shape.emits]
    kinds = {s.kind for s in lights} <= {"rectangle", "sphere"} and {s.kind for s in rest} == {"rectangle"}
    if not kinds or not scene.only_shapes_shine or any(s.material.kind != "diffuse" for s in scene.shapes):
        return None
    if any(light.material.reflectance.any() for light in lights) or scene.max_depth == 0:
        return None
    if scene.max_depth not in (1, 2) and not _convex([Plate(shape) for shape in rest]):
        return None

    def irradiance(p: Array, n: Array) -> Array:
        total = np.zeros_like(p)
        for light in lights if scene.max_depth != 1 else ():
            total += _solid_angle(p, n, light, scene.shapes)[:, None] * light.radiance
        return total

    return lambda o, d: seen(scene, o, d, irradiance)


def _convex(plates: list[Plate]) -> bool:
    """Whether all rectangles are behind, or in, the planes of all others, so that none sees another."""
    if any(plate.shape.material.two_sided for plate in plates):
        return False
    return all(((b.corners - a.origin) @ a.normal <= 1e-4).all() for a in plates for b in plates)


def _solid_angle(p: Array, n: Array, light: Shape, shapes: tuple[Shape, ...]) -> Array:
    body = solid(light)
    if isinstance(body, Plate):
        return visible_solid_angle(p, n, body, shapes)
    total = ball_solid_angle(p, n, body)
    for other in shapes:
        if other is not light:
            total = np.where(is_free(p, n, light, other), total, np.nan)
    return total
