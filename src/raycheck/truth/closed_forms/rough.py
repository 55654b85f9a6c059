"""Rough metals: GGX microfacets by quadrature.

Walter et al., Microfacet Models for Refraction through Rough Surfaces, EGSR 2007; Smith's G as a product of
two G1, which is what Mitsuba has.
"""

import math

import numpy as np

from raycheck.base.arrays import Array, Indices
from raycheck.scene.reader import Material, Scene
from raycheck.truth.closed_forms.mirrors import reflectance_of
from raycheck.truth.closed_forms.pixel_quadrature import Radiance
from raycheck.truth.closed_forms.solids import Plate, nearest

DIRECTIONS = 96
"""Nodes in θ and in half of φ of the hemisphere: an albedo to 1e-12 from α = 0.15 on."""
COSINES = 12
"""Nodes of the polynomial in cosθo by which an albedo is looked up, to 1e-13 over a plate."""
LAMP = (20, 5)
"""Nodes along a lamp's longer side and across: to 1e-9 of what the scene's plates reflect."""
AT_ONCE = 20_000


def microfacets(material: Material, wo: Array, wi: Array, n: Array) -> Array:
    """f_r cosθi (N, 3) = F D G1(wo) G1(wi)/(4 cosθo), sr⁻¹; 0 from below. Unit vectors (N, 3).

    D = 1/(π α² cos⁴θ_m (1 + tan²θ_m/α²)²) and G1 = 2/(1 + √(1 + α² tan²θ)).
    """
    h = wo + wi
    h /= np.linalg.norm(h, axis=-1, keepdims=True)
    c_o, c_i, c_h, c_d = (np.einsum("ij,ij->i", a, b) for a, b in ((wo, n), (wi, n), (h, n), (wo, h)))
    squared = material.alpha**2

    def tan_squared(c: Array) -> Array:
        return (1 - c * c) / (c * c)

    def g1(c: Array) -> Array:
        return np.asarray(2 / (1 + np.sqrt(1 + squared * tan_squared(c))))

    with np.errstate(divide="ignore", invalid="ignore"):
        d = 1 / (math.pi * squared * c_h**4 * (1 + tan_squared(c_h) / squared) ** 2)
        f = d * g1(c_o) * g1(c_i) / (4 * c_o)
    return np.where((c_o > 0) & (c_i > 0), f, 0.0)[:, None] * reflectance_of(material, c_d)


def directional_albedo(material: Material, cosine: float, directions: int = DIRECTIONS) -> Array:
    """∫ f_r cosθi dω (3,), over the hemisphere, at this cosine of the viewer's angle."""
    nodes, weights = np.polynomial.legendre.leggauss(directions)
    theta, phi = np.meshgrid((nodes + 1) * math.pi / 4, (nodes + 1) * math.pi / 2, indexing="ij")
    weight = np.outer(weights * math.pi / 4, weights * math.pi / 2) * 2 * np.sin(theta)  # either side of wo
    wi = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    wo = np.broadcast_to([math.sqrt(1 - cosine**2), 0.0, cosine], (wi.size // 3, 3))
    f = microfacets(material, wo, wi.reshape(-1, 3), np.broadcast_to([0.0, 0, 1], wo.shape))
    return np.asarray(weight.ravel() @ f)


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

    def radiance(o: Array, d: Array) -> tuple[Indices, Array, Array]:
        index, distance = nearest(scene, o, d)
        value = np.zeros_like(d)
        value[index < 0] = scene.sky
        for i, shape in enumerate(scene.shapes):
            here = np.flatnonzero((index == i) & (d @ Plate(shape).normal < 0))
            value[here] = shape.radiance
            for part in np.array_split(here, len(here) // AT_ONCE + 1) if i in plates else ():
                p = o[part] + distance[part, None] * d[part]
                value[part] += _reflected(scene, plates[i], lamps, p, -d[part])
        return index, distance, value

    return radiance


def _reflected(scene: Scene, plate: Plate, lamps: list[Plate], p: Array, wo: Array) -> Array:
    """Radiance (N, 3) from points p (N, 3) of a plate."""
    material = plate.shape.material
    n = np.broadcast_to(plate.normal, p.shape)
    total = scene.sky * _albedos(material, wo @ plate.normal)
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
            total += (lamp.shape.radiance - scene.sky) * angle[:, None] * microfacets(material, wo, wi, n)
    return np.asarray(total)


def _albedos(material: Material, cosine: Array) -> Array:
    """Directional albedos (N, 3), by the polynomial through those at Chebyshev's nodes."""
    if not len(cosine):
        return np.zeros((0, 3))
    low, high = float(cosine.min()), float(cosine.max())
    middle, half = (low + high) / 2, max((high - low) / 2, 1e-9)
    nodes = np.cos((np.arange(COSINES) + 0.5) * math.pi / COSINES)
    values = [directional_albedo(material, middle + half * node) for node in nodes]
    fit = np.polynomial.chebyshev.chebfit(nodes, np.array(values), COSINES - 1)
    found = np.polynomial.chebyshev.chebval((cosine - middle) / half, fit)
    return np.asarray(found, dtype=np.float64).T
