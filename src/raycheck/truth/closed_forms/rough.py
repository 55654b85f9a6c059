"""Rough metals: GGX microfacets by quadrature.

Walter et al., Microfacet Models for Refraction through Rough Surfaces, EGSR 2007; Smith's G as a product of
two G1, which is what Mitsuba has.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from raycheck.base.arrays import Array, Indices
from raycheck.scene.materials import Material
from raycheck.scene.reader import Scene
from raycheck.truth.closed_forms.mirrors import reflectance_of
from raycheck.truth.closed_forms.pixel_quadrature import Radiance
from raycheck.truth.closed_forms.solids import Plate, nearest

DIRECTIONS = 96
"""Nodes in θ and in half of φ of the hemisphere: an albedo to 1e-12 from α = 0.15 on."""
NODES = 14
"""Of the polynomial in wo's parts along and across a plate by which an albedo is looked up, each way."""
LAMP = (20, 5)
"""Nodes along a lamp's longer side and across: to 1e-9 of what the scene's plates reflect."""
AT_ONCE = 20_000


def microfacets(material: Material, wo: Array, wi: Array, s: Array, t: Array, n: Array) -> Array:
    """f_r cosθi (N, 3) = F D G1(wo) G1(wi)/(4 cosθo), sr⁻¹; 0 from below. All are unit vectors (N, 3).

    D = 1/(π α_u α_v cos⁴θ_m (1 + (x²/α_u² + y²/α_v²)/z²)²) of the half vector (x, y, z) in the frame, and
    G1 = 2/(1 + √(1 + (α_u² x² + α_v² y²)/z²)) of a direction.
    """
    u, v = material.alpha
    h = wo + wi
    h /= np.linalg.norm(h, axis=-1, keepdims=True)
    c_o, c_i, c_h, c_d = (np.einsum("ij,ij->i", a, b) for a, b in ((wo, n), (wi, n), (h, n), (wo, h)))

    def slope_squared(w: Array, c: Array, u: float, v: float) -> Array:
        """Of w along s times u, and along t times v."""
        x, y = (np.einsum("ij,ij->i", w, axis) for axis in (s, t))
        return np.asarray(((u * x) ** 2 + (v * y) ** 2) / (c * c))

    def g1(w: Array, c: Array) -> Array:
        return np.asarray(2 / (1 + np.sqrt(1 + slope_squared(w, c, u, v))))

    with np.errstate(divide="ignore", invalid="ignore"):
        d = 1 / (math.pi * u * v * c_h**4 * (1 + slope_squared(h, c_h, 1 / u, 1 / v)) ** 2)
        f = d * g1(wo, c_o) * g1(wi, c_i) / (4 * c_o)
    return np.where((c_o > 0) & (c_i > 0), f, 0.0)[:, None] * reflectance_of(material, c_d)


def directional_albedo(material: Material, viewer: Array, directions: int = DIRECTIONS) -> Array:
    """∫ f_r cosθi dω (3,), over the hemisphere, for a unit vector (3,) to the viewer in the frame."""
    nodes, weights = np.polynomial.legendre.leggauss(directions)
    turn = math.atan2(viewer[1], viewer[0])  # half a turn to either side of it
    theta = (nodes + 1) * math.pi / 4
    phi = turn + math.pi / 2 * np.concatenate([nodes - 1, nodes + 1])
    theta, phi = np.meshgrid(theta, phi, indexing="ij")
    weight = np.outer(weights * math.pi / 4, np.tile(weights, 2) * math.pi / 2) * np.sin(theta)
    wi = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    wo = np.broadcast_to(viewer, (wi.size // 3, 3))
    frame = [np.broadcast_to(axis, wo.shape) for axis in np.eye(3)]
    return np.asarray(weight.ravel() @ microfacets(material, wo, wi.reshape(-1, 3), *frame))


def rough_metal(scene: Scene) -> Radiance | None:
    """L = Lₛ E(θo) + ∫ (Lₑ − Lₛ) f_r cosθi dω over the lamps, of plates that see no other, at any depth.

    E is the directional albedo. None where a plate has another in front of it or is not wholly before a lamp.
    """
    if any(s.kind != "rectangle" for s in scene.shapes) or 0 <= scene.max_depth < 2 or scene.point_lights:
        return None
    lamps = [Plate(s) for s in scene.shapes if s.emits]
    plates = {i: Plate(s) for i, s in enumerate(scene.shapes) if s.material.kind == "roughconductor"}
    if len(lamps) + len(plates) != len(scene.shapes) or any(
        a.shape.material.reflectance.any() for a in lamps
    ):
        return None
    for plate in plates.values():
        for other in plates.values():
            if other is not plate and ((other.corners - plate.origin) @ plate.normal).max() > 1e-12:
                return None
        for lamp in lamps:
            before = ((plate.corners - lamp.origin) @ lamp.normal).min() > 0
            if not before or ((lamp.corners - plate.origin) @ plate.normal).min() <= 0:
                return None

    rough = {i: _rough_plate(plate, scene.camera.origin) for i, plate in plates.items()}

    def radiance(o: Array, d: Array) -> tuple[Indices, Array, Array]:
        index, distance = nearest(scene, o, d)
        value = np.zeros_like(d)
        value[index < 0] = scene.sky
        for i, shape in enumerate(scene.shapes):
            here = np.flatnonzero((index == i) & (d @ Plate(shape).normal < 0))
            value[here] = shape.radiance
            for part in np.array_split(here, len(here) // AT_ONCE + 1) if i in plates else ():
                p = o[part] + distance[part, None] * d[part]
                value[part] += _reflected(scene, rough[i], lamps, p, -d[part])
        return index, distance, value

    return radiance


@dataclass(frozen=True)
class _Rough:
    """A plate, with its directional albedo for all directions that the eye is seen in from it."""

    plate: Plate
    frame: Array
    """(3, 3): unit vectors along its first axis, across, and its normal."""
    albedo: Callable[[Array], Array]
    """(N, 3) of directions (N, 3) in the frame."""


def _rough_plate(plate: Plate, eye: Array) -> _Rough:
    tangent = plate.axes[0] / np.linalg.norm(plate.axes[0])
    frame = np.stack([tangent, np.cross(plate.normal, tangent), plate.normal])
    x, y = (grid.ravel() for grid in np.meshgrid(*[np.linspace(-1, 1, 33)] * 2))
    to_eye = eye - plate.at(x, y)
    to_eye /= np.linalg.norm(to_eye, axis=1, keepdims=True)
    return _Rough(plate, frame, _albedos(plate.shape.material, to_eye @ frame.T))


def _reflected(scene: Scene, one: _Rough, lamps: list[Plate], p: Array, wo: Array) -> Array:
    """Radiance (N, 3) from points p (N, 3) of a plate."""
    material = one.plate.shape.material
    axes = [np.broadcast_to(axis, p.shape) for axis in one.frame]
    total = scene.sky * one.albedo(wo @ one.frame.T)
    for lamp in lamps:
        sides = np.linalg.norm(lamp.axes, axis=1)
        counts = LAMP if sides[0] >= sides[1] else LAMP[::-1]
        (x, along), (y, across) = (np.polynomial.legendre.leggauss(count) for count in counts)
        size = float(np.linalg.norm(np.cross(*lamp.axes)))
        for place, weight in zip(
            lamp.at(*(grid.ravel() for grid in np.meshgrid(x, y, indexing="ij"))),
            np.outer(along, across).ravel() * size, strict=True,
        ):  # fmt: skip
            to_lamp = place - p
            far = np.linalg.norm(to_lamp, axis=1)
            wi = to_lamp / far[:, None]
            angle = -(wi @ lamp.normal) * weight / far**2
            total += (lamp.shape.radiance - scene.sky) * angle[:, None] * microfacets(material, wo, wi, *axes)
    return np.asarray(total)


def _albedos(material: Material, among: Array) -> Callable[[Array], Array]:
    """Directional albedos (N, 3) of directions (N, 3) in the frame that are between those `among` (M, 3), by
    the polynomial in their parts along the plate through those at Chebyshev's nodes.
    """
    chebyshev = np.polynomial.chebyshev
    low, high = among[:, :2].min(axis=0), among[:, :2].max(axis=0)
    middle, half = (low + high) / 2, 0.51 * (high - low)
    nodes = np.cos((np.arange(NODES) + 0.5) * math.pi / NODES)
    values = np.empty((NODES, NODES, 3))
    for i, j in np.ndindex(NODES, NODES):
        x, y = middle + half * nodes[[i, j]]
        values[i, j] = directional_albedo(material, np.array([x, y, math.sqrt(1 - x * x - y * y)]))
    inverse = np.linalg.inv(chebyshev.chebvander(nodes, NODES - 1))
    fit = np.einsum("ai,bj,ijc->abc", inverse, inverse, values)

    def albedos(wo: Array) -> Array:
        x, y = ((wo[:, :2] - middle) / half).T
        return np.asarray(chebyshev.chebval2d(x, y, fit), dtype=np.float64).T

    return albedos
