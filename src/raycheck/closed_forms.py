"""Exact images of the scenes whose light can be written down.

Each formula is evaluated in double precision from the numbers in the scene file and averaged over each
pixel's square on the film, which is what a box filter does. Pixels that hold an edge (two surfaces, or a
light's rim), or where a formula does not hold, are NaN. Where finite, the values are accurate to 1e-9 of
a pixel and outrank every rendered reference.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from raycheck.pixel_quadrature import Radiance, pixel_means
from raycheck.scene_reader import Camera, Scene, Shape, read_scene

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

EDGE_POINTS = 6000
"""Points along an edge; far denser than pixels."""


def evaluate(name: str, path: Path, parameters: Mapping[str, str]) -> Array | None:
    """Exact pixel means (H, W, 3) of the canonical scene `name`, W·sr⁻¹·m⁻²; None if it has no closed form.

    Raises ValueError for a parameter that the scene does not have.
    """
    scene = read_scene(path, parameters)
    form = FORMS.get(name)
    radiance = form(scene) if form else None
    return None if radiance is None else pixel_means(scene.camera, radiance, edges(scene), kinks(scene))


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


def spherical_light(scene: Scene) -> Radiance | None:
    """L = ρ Lₑ (R/d)² cosθ on a floor, all of a black glowing ball above it, at every depth ≥ 2.

    Source: the irradiance of a ball of uniform radiance, all of it above the horizon, is that of a point: its
    flux 4π²R²Lₑ over 4πd² (Gauss), times the cosine; e.g. Pharr, Jakob & Humphreys, Physically Based
    Rendering.
    """
    lights = [shape for shape in scene.shapes if shape.emits]
    if len(lights) != 1 or lights[0].kind != "sphere" or lights[0].material.reflectance.any():
        return None
    if len(scene.shapes) != 2 or scene.point_lights or 0 <= scene.max_depth < 2:
        return None
    ball = Ball(lights[0])

    def irradiance(p: Array, n: Array) -> Array:
        to_ball = ball.center - p
        d = np.linalg.norm(to_ball, axis=-1)
        height = np.einsum("ij,ij->i", to_ball, n)
        factor = np.where(height >= ball.radius, math.pi * (ball.radius / d) ** 2 * height / d, np.nan)
        return factor[:, None] * ball.shape.radiance

    return lambda o, d: seen(scene, o, d, irradiance)


def rectangle_lights(scene: Scene) -> Radiance | None:
    """L = Lₑ + ρ/π Σ Lₑ (F(light) − F(light ∩ shadow)) for black rectangle lights and depth 1 or 2.

    F is Lambert's formula (`projected_solid_angle`). A rectangle parallel to a light throws a shadow on the
    light's plane, seen from p, that is a rectangle again: its corners scaled about p by the ratio of the
    two planes' distances.
    """
    if (
        scene.point_lights
        or scene.max_depth not in (1, 2)
        or any(s.kind != "rectangle" for s in scene.shapes)
    ):
        return None
    plates = [Plate(shape) for shape in scene.shapes]
    lights = [plate for plate in plates if plate.shape.emits]
    if any(light.shape.material.reflectance.any() for light in lights):
        return None

    def irradiance(p: Array, n: Array) -> Array:
        if scene.max_depth == 1:
            return np.zeros_like(p)
        parts = [visible_solid_angle(p, n, light, plates)[:, None] * light.shape.radiance for light in lights]
        return np.sum(parts, axis=0)

    return lambda o, d: seen(scene, o, d, irradiance)


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
    plates = [Plate(shape) for shape in scene.shapes]
    reflectance = mirror.shape.material.reflectance
    image_corners = mirror.reflect(lamp.corners)

    def irradiance(p: Array, n: Array, depth: int) -> Array:
        total = np.zeros_like(p)
        if depth >= 2:
            total += visible_solid_angle(p, n, lamp, plates)[:, None] * lamp.shape.radiance
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
    """A ball (radius a, emission E, reflectance β) amid a closed sphere (radius R, reflectance ρ).

    At depth n: W₁ = 0, B₁ = E, Wₙ = ρ (f Bₙ₋₁ + (1−f) Wₙ₋₁), Bₙ = E + β Wₙ₋₁ with f = (a/R)².
    Source: by symmetry each surface has one radiance. The ball covers the fraction f of the wall's
    cosine-weighted hemisphere (the formula of `spherical_light` over π), the wall the rest; the convex ball
    sees only wall. Reciprocity of form factors: 4πR² · f = 4πa² · 1. Unlimited depth is the fixed point.
    """
    if len(scene.shapes) != 2 or any(shape.kind != "sphere" for shape in scene.shapes) or scene.point_lights:
        return None
    inner, outer = sorted((0, 1), key=lambda i: Ball(scene.shapes[i]).radius)
    ball, wall = Ball(scene.shapes[inner]), Ball(scene.shapes[outer])
    if wall.shape.emits or not wall.shape.flipped or ball.shape.flipped or (ball.center != wall.center).any():
        return None
    f = (ball.radius / wall.radius) ** 2
    rho, beta, emission = (
        wall.shape.material.reflectance,
        ball.shape.material.reflectance,
        ball.shape.radiance,
    )
    if scene.max_depth < 0:
        wall_radiance = rho * f * emission / (1 - rho * (1 - f + f * beta))
        ball_radiance = emission + beta * wall_radiance
    else:
        wall_radiance = ball_radiance = np.zeros(3)
        for _ in range(scene.max_depth):
            wall_radiance, ball_radiance = (
                rho * (f * ball_radiance + (1 - f) * wall_radiance),
                emission + beta * wall_radiance,
            )

    def radiance(o: Array, d: Array) -> tuple[Indices, Array, Array]:
        index, distance = nearest(scene, o, d)
        value = np.where((index == inner)[:, None], ball_radiance, wall_radiance)
        return index, distance, value

    return radiance


FORMS: dict[str, Callable[[Scene], Radiance | None]] = {
    "point-light": point_light,
    "spherical-light": spherical_light,
    "area-light": rectangle_lights,
    "occluded-lights": rectangle_lights,
    "touching-light": rectangle_lights,
    "many-lights": rectangle_lights,
    "mirror-light": mirror_light,
    "furnace": furnace,
}


# ---- shapes ----


@dataclass(frozen=True)
class Ball:
    shape: Shape

    @property
    def center(self) -> Array:
        return self.shape.to_world[:3, 3]

    @property
    def radius(self) -> float:
        return float(np.linalg.norm(self.shape.to_world[:3, 0]))

    def hit(self, o: Array, d: Array) -> Array:
        """Distances (N,) to the first hit beyond 1e-7, inf if there is none."""
        to_origin = o - self.center
        b = np.einsum("ij,ij->i", to_origin, d)
        rest = self.radius**2 - np.sum((to_origin - b[:, None] * d) ** 2, axis=-1)
        root = np.sqrt(np.maximum(rest, 0))
        near, far = -b - root, -b + root
        t = np.where(near > 1e-7, near, np.where(far > 1e-7, far, np.inf))
        return np.where(rest >= 0, t, np.inf)

    def normals(self, p: Array) -> Array:
        outward = (p - self.center) / self.radius
        return -outward if self.shape.flipped else outward

    def outline(self, eye: Array) -> Array:
        """Points (N, 3) of the silhouette as seen from outside; none from inside."""
        axis = self.center - eye
        d = float(np.linalg.norm(axis))
        if d <= self.radius:
            return np.zeros((0, 3))
        axis /= d
        u = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        u /= np.linalg.norm(u)
        v = np.cross(axis, u)
        angle = np.linspace(0, 2 * math.pi, EDGE_POINTS, endpoint=False)[:, None]
        sine = self.radius / d
        rim = self.radius * math.sqrt(1 - sine**2)
        return self.center - self.radius * sine * axis + rim * (np.cos(angle) * u + np.sin(angle) * v)


@dataclass(frozen=True)
class Plate:
    """A rectangle: the unit one [−1, 1]² with normal +z, placed by `to_world`."""

    shape: Shape

    @property
    def origin(self) -> Array:
        return self.shape.to_world[:3, 3]

    @property
    def axes(self) -> Array:
        """Half edges (2, 3)."""
        return self.shape.to_world[:3, :2].T

    @property
    def normal(self) -> Array:
        outward = np.linalg.inv(self.shape.to_world[:3, :3])[2]
        outward = outward / np.linalg.norm(outward)
        return -outward if self.shape.flipped else outward

    @property
    def corners(self) -> Array:
        """Corners (4, 3) in order around the rectangle."""
        return self.at(np.array([-1.0, 1, 1, -1]), np.array([-1.0, -1, 1, 1]))

    def at(self, x: Array, y: Array) -> Array:
        """Points (…, 3) at local coordinates x, y (…)."""
        return self.origin + x[..., None] * self.axes[0] + y[..., None] * self.axes[1]

    def local(self, points: Array) -> tuple[Array, Array]:
        """Local coordinates x, y of points (…, 3), which are 1 in size at the rectangle's edges."""
        inverse = np.linalg.inv(self.shape.to_world)
        px, py, pz = points[..., 0], points[..., 1], points[..., 2]
        x, y = (px * row[0] + py * row[1] + pz * row[2] + row[3] for row in inverse[:2])
        return x, y

    def hit(self, o: Array, d: Array) -> Array:
        """Distances (N,) to the hit beyond 1e-7, inf if there is none."""
        with np.errstate(divide="ignore", invalid="ignore"):
            t = ((self.origin - o) @ self.normal) / (d @ self.normal)
            x, y = self.local(o + t[:, None] * d)
            good = (t > 1e-7) & (np.abs(x) <= 1) & (np.abs(y) <= 1)
        return np.where(good, t, np.inf)

    def normals(self, p: Array) -> Array:
        return np.broadcast_to(self.normal, p.shape)

    def outline(self, eye: Array) -> Array:
        corners = self.corners
        t = np.linspace(0, 1, EDGE_POINTS // 4, endpoint=False)[:, None]
        return np.concatenate(
            [a + t * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
        )

    def reflect(self, points: Array) -> Array:
        """Mirror images of points (…, 3) in the rectangle's plane."""
        return points - 2 * ((points - self.origin) @ self.normal)[..., None] * self.normal

    def is_window(self, p: Array, targets: Array) -> NDArray[np.bool_]:
        """Whether all segments from points (N, 3) to targets (K, 3) pass through the rectangle."""
        side = (p - self.origin) @ self.normal
        inside = np.ones(len(p), dtype=bool)
        for target in targets:
            beyond = float((target - self.origin) @ self.normal)
            t = side / (side - beyond)
            x, y = self.local(p + t[:, None] * (target - p))
            inside &= (side > 0) & (beyond < 0) & (np.abs(x) <= 1) & (np.abs(y) <= 1)
        return inside


def solid(shape: Shape) -> Ball | Plate:
    if shape.kind == "sphere":
        return Ball(shape)
    if shape.kind == "rectangle":
        return Plate(shape)
    raise ValueError(f"closed forms know no {shape.kind}")


def nearest(scene: Scene, o: Array, d: Array) -> tuple[Indices, Array]:
    """Index of the first shape that each ray hits (−1: none) and the distance to it."""
    distances = np.stack([solid(shape).hit(o, d) for shape in scene.shapes])
    index = np.argmin(distances, axis=0)
    distance = np.take_along_axis(distances, index[None], axis=0)[0]
    return np.where(np.isfinite(distance), index, -1), distance


def seen(
    scene: Scene, o: Array, d: Array, irradiance: Callable[[Array, Array], Array]
) -> tuple[Indices, Array, Array]:
    """What rays see at their first hit: emission and ρ/π · irradiance(p, n), both from the front only."""
    index, distance = nearest(scene, o, d)
    value = np.zeros_like(d)
    for i, shape in enumerate(scene.shapes):
        here = np.flatnonzero(index == i)
        p = o[here] + distance[here, None] * d[here]
        n = solid(shape).normals(p)
        front = np.einsum("ij,ij->i", n, d[here]) < 0
        here, p, n = here[front], p[front], n[front]
        value[here] = shape.radiance
        if shape.material.kind == "diffuse" and shape.material.reflectance.any() and len(here):
            value[here] += shape.material.reflectance / math.pi * irradiance(p, n)
    return index, distance, value


# ---- Lambert's formula ----


def projected_solid_angle(p: Array, n: Array, corners: Array) -> Array:
    """∫ cosθ dω over a polygon, seen from points p with normals n (N, 3 each): |½ Σ γᵢ n·Γᵢ|, sr.

    `corners` (K, 3) or (N, K, 3) go around it. γᵢ is the angle between the directions to two neighbouring
    corners and Γᵢ the unit normal of their plane. Exact where the whole polygon is above the horizon; NaN
    where the horizon cuts it, 0 where it is all below.
    Source: Lambert, Photometria (1760); Arvo, Analytic Methods for Simulated Light Transport (1995), eq. 2.4.
    """
    to_corner = corners - p[:, None, :]
    height = np.einsum("nki,ni->nk", to_corner, n)
    v = to_corner / np.linalg.norm(to_corner, axis=-1, keepdims=True)
    w = np.roll(v, -1, axis=1)
    cross = np.cross(v, w)
    sine = np.linalg.norm(cross, axis=-1)
    angle = np.arctan2(sine, np.einsum("nki,nki->nk", v, w))
    ratio = np.where(sine > 1e-14, angle / np.maximum(sine, 1e-300), 1.0)  # γ/sinγ → 1
    total = np.abs(np.sum(ratio * np.einsum("nki,ni->nk", cross, n), axis=1)) / 2
    slack = 1e-12 * np.linalg.norm(to_corner, axis=-1).max(axis=1)
    above, below = height.min(axis=1) >= -slack, height.max(axis=1) <= slack
    return np.where(below, 0.0, np.where(above, total, np.nan))


def visible_solid_angle(p: Array, n: Array, light: Plate, plates: Sequence[Plate]) -> Array:
    """Projected solid angle (N,) of a light's front less what other rectangles hide; NaN where unknown."""
    facing = (p - light.origin) @ light.normal
    total = projected_solid_angle(p, n, light.corners)
    shadows: list[Array] = []
    for plate in plates:
        if plate.shape is light.shape:
            continue
        parallel = np.abs(plate.normal @ light.normal) > 1 - 1e-12
        if parallel:
            before = (plate.origin - light.origin) @ light.normal > 1e-9
            shadow = _shadow(p, light, plate) if before else None
            if shadow is not None:
                shadows.append(shadow)
        else:  # it hides nothing if the light and p are on one side of it
            sides = (light.corners - plate.origin) @ plate.normal
            own = (p - plate.origin) @ plate.normal
            free = (sides.min() >= -1e-9) & (own >= -1e-9) | (sides.max() <= 1e-9) & (own <= 1e-9)
            total = np.where(free, total, np.nan)
    hidden = [projected_solid_angle(p, n, light.at(*_outline(shadow))) for shadow in shadows]
    for i, first in enumerate(shadows):  # two shadows that meet on the light would be counted twice
        for second in shadows[i + 1 :]:
            low, high = np.maximum(first[0], second[0]), np.minimum(first[1], second[1])
            total = np.where((low < high).all(axis=0), np.nan, total)
    return np.where(facing > 0, total - np.sum(hidden, axis=0) if hidden else total, 0.0)


def _shadow(p: Array, light: Plate, plate: Plate) -> Array | None:
    """Bounds (2, 2, N), [low/high][x/y] in the light's local frame, of what a parallel plate hides of it."""
    to_light = (light.origin - p) @ light.normal
    to_plate = (plate.origin - p) @ light.normal
    between = (to_plate * np.sign(to_light) > 1e-9) & (np.abs(to_plate) < np.abs(to_light) - 1e-9)
    if not between.any():
        return None
    scale = np.where(between, to_light, 1.0) / np.where(between, to_plate, 1.0)
    cast = p[:, None, :] + scale[:, None, None] * (plate.corners - p[:, None, :])
    x, y = light.local(cast)
    low, high = np.stack([x.min(axis=1), y.min(axis=1)]), np.stack([x.max(axis=1), y.max(axis=1)])
    aligned = np.abs(light.axes @ plate.axes.T) < 1e-9
    if not (aligned[0, 0] and aligned[1, 1]) and not (aligned[0, 1] and aligned[1, 0]):
        low = high = np.full_like(low, np.nan)  # turned against the light: not a rectangle along its edges
    low, high = np.clip(low, -1, 1), np.clip(high, -1, 1)
    return np.stack([np.where(between, low, -1.0), np.where(between, high, -1.0)])


def _outline(bounds: Array) -> tuple[Array, Array]:
    """Local coordinates x, y (N, 4) of a rectangle's corners."""
    (x0, y0), (x1, y1) = bounds
    return np.stack([x0, x1, x1, x0], axis=1), np.stack([y0, y0, y1, y1], axis=1)


# ---- where the picture is not smooth ----


def edges(scene: Scene) -> Array:
    """Points (N, 3) along all that can part two surfaces in the picture, directly or in a mirror."""
    solids = [solid(shape) for shape in scene.shapes]
    points = [body.outline(scene.camera.origin) for body in solids]
    for mirror in _mirrors(scene):
        eye = mirror.reflect(scene.camera.origin)
        points += [mirror.reflect(body.outline(eye)) for body in solids]
    return np.concatenate(points)


def kinks(scene: Scene) -> Array:
    """Lines (K, 3), a·x + b·y + c = 0 in film pixels, at the rims of light and of parallel plates' shadows.

    On a flat surface these are straight: its cut with the plane of a light, or with the plane through an edge
    of a light and the parallel edge of a plate.
    """
    plates = [Plate(shape) for shape in scene.shapes if shape.kind == "rectangle"]
    lights = [plate for plate in plates if plate.shape.emits]
    planes = [(light.normal, light.origin) for light in lights]
    visible = _visible_points(scene)
    for light in lights:
        for plate in plates:
            before = (plate.origin - light.origin) @ light.normal > 1e-9
            behind = ((visible - plate.origin) @ light.normal > 1e-9).any()
            if abs(light.normal @ plate.normal) > 1 - 1e-12 and before and behind:
                planes += _shadow_planes(light, plate)
    surfaces = [(plate.normal, plate.origin) for plate in plates]
    cuts = [(surface, plane) for surface in surfaces for plane in planes]
    for mirror in _mirrors(scene):
        images = [
            tuple(
                (mirror.reflect(point + normal) - mirror.reflect(point), mirror.reflect(point))
                for normal, point in cut
            )
            for cut in cuts
        ]
        cuts = cuts + images + [(surface, plane) for surface, _ in cuts for _, plane in images]
    lines = [_film_line(scene.camera, *surface, *plane) for surface, plane in cuts]
    kept = [np.round(line / scale, 10) for line in lines if (scale := np.abs(line[:2]).max()) > 1e-12]
    return np.unique(np.array(kept), axis=0) if kept else np.zeros((0, 3))


def _visible_points(scene: Scene) -> Array:
    """Points (N, 3) of the surfaces that the camera sees, one for each pixel or so."""
    camera = scene.camera
    x, y = (
        grid.ravel() for grid in np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    )
    d = camera.directions(x, y)
    index, distance = nearest(scene, np.broadcast_to(camera.origin, d.shape), d)
    return camera.origin + distance[index >= 0, None] * d[index >= 0]


def _mirrors(scene: Scene) -> list["Plate"]:
    return [Plate(s) for s in scene.shapes if s.material.kind == "conductor" and s.kind == "rectangle"]


def _shadow_planes(light: "Plate", plate: "Plate") -> list[tuple[Array, Array]]:
    """Planes (normal, point) through an edge of the light and a parallel edge of the plate."""
    planes = []
    for a, b in zip(light.corners, np.roll(light.corners, -1, axis=0), strict=True):
        for c, d in zip(plate.corners, np.roll(plate.corners, -1, axis=0), strict=True):
            along = (b - a) / np.linalg.norm(b - a)
            if abs(along @ (d - c)) > (1 - 1e-12) * np.linalg.norm(d - c):
                normal = np.cross(along, c - a)
                planes.append((normal / np.linalg.norm(normal), a))
    return planes


def _film_line(camera: Camera, n1: Array, p1: Array, n2: Array, p2: Array) -> Array:
    """The cut of two planes as a line (a, b, c) on the film; zeros if they do not cut."""
    eye = camera.origin
    if np.linalg.norm(np.cross(n1, n2)) < 1e-9:
        return np.zeros(3)
    normal = n2 * ((eye - p1) @ n1) - n1 * ((eye - p2) @ n2)  # the plane of this line that holds the eye
    x, y, z = camera.to_world[:3, :3].T @ normal
    t, width, height = camera.tan_x, camera.width, camera.height
    return np.array([-2 * x * t / width, -2 * y * t / width, x * t + y * t * height / width + z])
