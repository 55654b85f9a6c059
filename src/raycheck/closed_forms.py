"""Exact images of the scenes whose light can be written down.

Each formula is evaluated in double precision from the numbers in the scene file and averaged over each
pixel's square on the film, which is what a box filter does. Pixels that hold an edge (two surfaces, or a
light's rim), or where a formula does not hold, are NaN. Where finite, the values are accurate to 1e-9 of
a pixel and outrank every rendered reference.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from raycheck.pixel_quadrature import Radiance, pixel_means
from raycheck.scene.reader import Material, Scene, Shape, Spot, read_scene
from raycheck.solids import (
    Ball,
    Plate,
    above_horizon,
    ball_solid_angle,
    edges,
    film_line_of,
    in_view,
    is_free,
    kinks,
    nearest,
    projected_solid_angle,
    seen,
    solid,
    visible_solid_angle,
    with_faces,
)

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

MANY_IMAGES = 40
"""Images of a lamp in facing mirrors, to each side, that count where depth has no limit."""
MANY_BOUNCES = 64


def evaluate(name: str, path: Path, parameters: Mapping[str, str]) -> Array | None:
    """Exact pixel means (H, W, 3) of the canonical scene `name`, W·sr⁻¹·m⁻²; None if it has no closed form.

    Raises ValueError for a parameter that the scene does not have.
    """
    scene = with_faces(read_scene(path, parameters))
    form = FORMS.get(name)
    radiance = form(scene) if form else None
    if radiance is None:
        return None
    camera, border = scene.camera, BORDERS.get(name, 1)
    if form is mixed_material:
        return pixel_means(camera, radiance, np.zeros((0, 3)), mixed_material_lines(scene))
    if form is lamp_grid:
        return pixel_means(camera, radiance, edges(in_view(scene)), np.zeros((0, 3)))
    return pixel_means(camera, radiance, edges(scene), kinks(scene), border)


# ---- formulas: one function for each scene; None where depth or content are not what it is about ----


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
        return (cosine / d**2)[:, None] * light.intensity

    return lambda o, d: seen(scene, o, d, irradiance)


def flat_and_round_lights(scene: Scene) -> Radiance | None:
    """L = Lₑ + ρ/π Σ Lₑ F for black rectangle and ball lights over rectangles, at depth 1 and 2.

    F is the projected solid angle of what is above the horizon: Lambert's formula for rectangles, less the
    shadows of others (a rectangle parallel to a light throws one that is a rectangle again: its corners
    scaled about p by the ratio of the two planes' distances), and `ball_solid_angle` for balls, which for a
    ball all above the horizon is that of a point with its flux, 4π²R²Lₑ over 4πd² (Gauss), times the cosine.
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

    def reaches(p: Array, way: Array, far: Array) -> NDArray[np.bool_]:
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
    scene: Scene, o: Array, d: Array, depth: int, irradiance: Callable[[Array, Array, int], Array]
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
        found, t, dim = seen(scene, start[alive], way[alive], lambda p, n, left=left: irradiance(p, n, left))
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
    return material.reflectance * (np.abs(s) ** 2 + np.abs(p) ** 2) / 2


def metal(scene: Scene) -> Radiance | None:
    """Sky times Fresnel's reflectance of each metal on the way: nothing is chosen at random."""
    if any(shape.emits or shape.material.kind != "conductor" for shape in scene.shapes):
        return None
    depth = scene.max_depth if scene.max_depth >= 0 else MANY_BOUNCES
    return lambda o, d: _through_mirrors(scene, o, d, depth, lambda p, n, left: np.zeros_like(p))


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
        p, way, part, code = o[here] + distance[here, None] * d[here], d[here], 1.0, index[here]
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


def furnace(scene: Scene) -> Radiance | None:
    """A ball (radius a, emission E, reflectance β) in a closed sphere (radius R, emission D, reflectance ρ).

    At depth n, from 0: Wₙ = D + ρ (f Bₙ₋₁ + (1−f) Wₙ₋₁), Bₙ = E + β Wₙ₋₁ with f = (a/R)².
    Source: by symmetry each surface has one radiance. The ball covers the fraction f of the wall's
    cosine-weighted hemisphere (the formula of `spherical_light` over π), the wall the rest; the convex ball
    sees only wall. Reciprocity of form factors: 4πR² · f = 4πa² · 1. Unlimited depth is the fixed point.
    """
    if len(scene.shapes) != 2 or any(shape.kind != "sphere" for shape in scene.shapes) or scene.point_lights:
        return None
    inner, outer = sorted((0, 1), key=lambda i: Ball(scene.shapes[i]).radius)
    ball, wall = Ball(scene.shapes[inner]), Ball(scene.shapes[outer])
    if not wall.shape.flipped or ball.shape.flipped or (ball.center != wall.center).any():
        return None
    f = (ball.radius / wall.radius) ** 2
    rho, beta = wall.shape.material.reflectance, ball.shape.material.reflectance
    glow, emission = wall.shape.radiance, ball.shape.radiance
    if scene.max_depth < 0:
        wall_radiance = (glow + rho * f * emission) / (1 - rho * (1 - f + f * beta))
        ball_radiance = emission + beta * wall_radiance
    else:
        wall_radiance = ball_radiance = np.zeros(3)
        for _ in range(scene.max_depth):
            wall_radiance, ball_radiance = (
                glow + rho * (f * ball_radiance + (1 - f) * wall_radiance),
                emission + beta * wall_radiance,
            )

    def radiance(o: Array, d: Array) -> tuple[Indices, Array, Array]:
        index, distance = nearest(scene, o, d)
        value = np.where((index == inner)[:, None], ball_radiance, wall_radiance)
        return index, distance, value

    return radiance


FORMS: dict[str, Callable[[Scene], Radiance | None]] = {
    "point-light": point_light,
    "area-light": flat_and_round_lights,
    "spherical-light": flat_and_round_lights,
    "sphere-light-near": flat_and_round_lights,
    "sphere-light-far": flat_and_round_lights,
    "light-below-horizon": flat_and_round_lights,
    "occluded-lights": flat_and_round_lights,
    "hidden-light": flat_and_round_lights,
    "checkerboard": flat_and_round_lights,
    "touching-light": flat_and_round_lights,
    "many-lights": flat_and_round_lights,
    "thousand-lights": lamp_grid,
    "sun-and-spot": sun_and_spot,
    "open-sky": open_sky,
    "inside-light": furnace,
    "furnace": furnace,
    "mirror-light": mirror_light,
    "mirror-corridor": mirror_corridor,
    "metal": metal,
    "glass-pane": glass_pane,
    "mixed-material": mixed_material,
}

BORDERS = {"mirror-corridor": 64, "glass-pane": 64, "metal": 64, "sun-and-spot": 64}
"""Scenes with edges that only looking finds: steps along a pixel's side."""
