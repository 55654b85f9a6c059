"""Solids of a scene as closed forms see them: where rays hit, what hides what, Lambert's formula, edges."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from raycheck.base.arrays import Array, Flags, Indices
from raycheck.scene.meshes import read_mesh
from raycheck.scene.reader import Camera, Scene, Shape

EDGE_POINTS = 6000
"""Points along an edge; far denser than pixels."""


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
        result: Array = (
            self.center - self.radius * sine * axis + rim * (np.cos(angle) * u + np.sin(angle) * v)
        )
        return result


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
        return np.asarray(-outward if self.shape.flipped else outward)

    @property
    def corners(self) -> Array:
        """Corners (4, 3) in order around the rectangle."""
        return self.at(np.array([-1.0, 1, 1, -1]), np.array([-1.0, -1, 1, 1]))

    def at(self, x: Array, y: Array) -> Array:
        """Points (…, 3) at local coordinates x, y (…)."""
        return np.asarray(self.origin + x[..., None] * self.axes[0] + y[..., None] * self.axes[1])

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

    def is_window(self, p: Array, targets: Array) -> Flags:
        """Whether all segments from points (N, 3) to targets (K, 3) pass through the rectangle."""
        side = (p - self.origin) @ self.normal
        inside = np.ones(len(p), dtype=bool)
        for target in targets:
            beyond = float((target - self.origin) @ self.normal)
            t = side / (side - beyond)
            x, y = self.local(p + t[:, None] * (target - p))
            inside &= (side > 0) & (beyond < 0) & (np.abs(x) <= 1) & (np.abs(y) <= 1)
        return inside


CUBE_FACES = tuple(
    np.array([[*u, 0], [*v, 0], [*n, 0], [*n, 1]], dtype=float).T
    for u, v, n in (
        ((0, 1, 0), (0, 0, 1), (1, 0, 0)),
        ((0, 0, 1), (0, 1, 0), (-1, 0, 0)),
        ((0, 0, 1), (1, 0, 0), (0, 1, 0)),
        ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
        ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
        ((0, 1, 0), (1, 0, 0), (0, 0, -1)),
    )
)
"""Matrices (4, 4) that place the unit rectangle on the faces of the cube [−1, 1]³, normals outwards."""


def with_faces(scene: Scene) -> Scene:
    """The scene with rectangles in place of each cube, and of each mesh that fills one."""
    shapes: list[Shape] = []
    for shape in scene.shapes:
        faces = CUBE_FACES if shape.kind == "cube" else _filled(shape)
        shapes += [replace(shape, kind="rectangle", to_world=shape.to_world @ face) for face in faces]
        shapes += [] if faces else [shape]
    return replace(scene, shapes=tuple(shapes))


def _filled(shape: Shape) -> tuple[Array, ...]:
    """The matrix (4, 4) that places the unit rectangle where the triangles of a mesh are, if in its own space
    all lie at z = 0, counterclockwise, and have the area of the box around them.
    """
    if shape.mesh is None or np.linalg.det(shape.to_world[:3, :3]) < 0:
        return ()
    mesh = read_mesh(shape.mesh, shape.kind)
    corners = mesh.vertices[mesh.faces]
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
    area = float(np.prod((high - low)[:2]))
    if corners[..., 2].any() or (doubled < 0).any() or abs(doubled.sum() / 2 - area) > 1e-12 * area:
        return ()
    place = np.diag([*(high - low)[:2] / 2, 1.0, 1.0])
    place[:3, 3] = (low + high) / 2
    return (place,)


def in_view(scene: Scene) -> Scene:
    """The scene without the rectangles that the camera cannot see since all corners are beside its view."""
    camera = scene.camera
    up, right = camera.tan_x * camera.height / camera.width, camera.tan_x
    (left, upper), far = camera.edge, 2.0
    sides = np.array(
        [
            [-1, 0, left * right], [1, 0, (far - left) * right],
            [0, -1, upper * up], [0, 1, (far - upper) * up], [0, 0, 1],
        ]
    )  # fmt: skip

    def may_show(shape: Shape) -> bool:
        if shape.kind != "rectangle":
            return True
        local = (Plate(shape).corners - camera.origin) @ np.linalg.inv(camera.to_world[:3, :3]).T
        return not (local @ sides.T < 0).all(axis=0).any()

    return replace(scene, shapes=tuple(shape for shape in scene.shapes if may_show(shape)))


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
    """What rays see at their first hit: emission, from the front only, and ρ/π · irradiance(p, n), with n to
    the eye, from behind too where the material is two-sided.
    """
    index, distance = nearest(scene, o, d)
    value = np.zeros_like(d)
    for i, shape in enumerate(scene.shapes):
        here = np.flatnonzero(index == i)
        p = o[here] + distance[here, None] * d[here]
        n = solid(shape).normals(p)
        front = np.einsum("ij,ij->i", n, d[here]) < 0
        value[here[front]] = shape.radiance
        if shape.material.kind != "diffuse" or not shape.material.reflectance.any():
            continue
        for side, sign in ((front, 1), (~front, -1))[: 1 + shape.material.two_sided]:
            if side.any():
                value[here[side]] += (
                    shape.material.reflectance / math.pi * irradiance(p[side], sign * n[side])
                )
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


def clip(corners: Array, origin: Array, normal: Array) -> Array:
    """The part (K', 3) of a convex polygon (K, 3) in front of a plane; without corners if there is none."""
    height = (corners - origin) @ normal
    kept: list[Array] = []
    for k in range(len(corners)):
        a, b = height[k - 1], height[k]
        if a * b < 0:
            kept.append(corners[k - 1] + a / (a - b) * (corners[k] - corners[k - 1]))
        if b >= 0:
            kept.append(corners[k])
    return np.array(kept) if len(kept) > 2 else np.zeros((0, 3))


def above_horizon(p: Array, n: Array, corners: Array) -> Array:
    """Projected solid angle (N,) of the part of a polygon (K, 3) above the horizon of a flat surface.

    All points p (N, 3) lie on one plane with one normal n (N, 3), which is then everybody's horizon.
    """
    part = clip(corners, p[0], n[0])
    return projected_solid_angle(p, n, part) if len(part) else np.zeros(len(p))


def ball_solid_angle(p: Array, n: Array, ball: Ball) -> Array:
    """∫ cosθ dω (N,) over a ball seen from points p with normals n (N, 3), cut off at the horizon, sr.

    π sin²σ cosθ where all of it is above, else, with x = cotσ and y = −x cotθ,
    sin²σ (cosθ arccos y − x sinθ √(1 − y²)) + arctan(sinθ √(1 − y²) / x).
    Source: Snyder, Area Light Sources for Real-Time Graphics (1996); Lagarde & de Rousiers, Moving Frostbite
    to PBR (2014), listing 7.
    """
    to_ball = ball.center - p
    d = np.linalg.norm(to_ball, axis=-1)
    cosine = np.einsum("ij,ij->i", to_ball, n) / d
    sine = np.sqrt(np.maximum(1 - cosine**2, 1e-300))
    sine_ball = ball.radius / d
    x = np.sqrt(np.maximum(1 / sine_ball**2 - 1, 1e-300))
    y = np.clip(-x * cosine / sine, -1, 1)
    root = sine * np.sqrt(1 - y**2)
    cut = sine_ball**2 * (cosine * np.arccos(y) - x * root) + np.arctan(root / x)
    whole = math.pi * sine_ball**2 * cosine
    return np.where(cosine >= sine_ball, whole, np.where(cosine <= -sine_ball, 0.0, cut))


def is_free(p: Array, n: Array, light: Shape, other: Shape) -> Flags:
    """Points (N,) from which `other` surely hides nothing of a light; False where that is not known.

    Since it is below the horizon, or behind a one-sided flat light, or light and point are on one side of it,
    or the cones that the two fill do not meet.
    """
    apart = _cones_apart(p, light, other)
    if isinstance(body := solid(other), Ball):
        return apart
    below = (np.einsum("nki,ni->nk", body.corners - p[:, None, :], n) <= 1e-9).all(axis=1)
    lamp = solid(light)
    if isinstance(lamp, Plate):
        behind = bool(((body.corners - lamp.origin) @ lamp.normal <= 1e-9).all())
        heights = (lamp.corners - body.origin) @ body.normal
        low, high = heights.min(), heights.max()
    else:
        behind = False
        middle = float((lamp.center - body.origin) @ body.normal)
        low, high = middle - lamp.radius, middle + lamp.radius
    own = (p - body.origin) @ body.normal
    one_side = (low >= -1e-9) & (own >= -1e-9) | (high <= 1e-9) & (own <= 1e-9)
    return np.asarray(below | behind | one_side | apart)


def _cones_apart(p: Array, one: Shape, other: Shape) -> Flags:
    """Whether the cones from p (N, 3) around two shapes have no direction in common."""
    axes, angles = [], []
    for shape in (one, other):
        body = solid(shape)
        center = body.center if isinstance(body, Ball) else body.origin
        radius = body.radius if isinstance(body, Ball) else float(np.linalg.norm(body.corners[0] - center))
        to_center = center - p
        d = np.linalg.norm(to_center, axis=1)
        axes.append(to_center / d[:, None])
        angles.append(np.where(d > radius, np.arcsin(np.minimum(radius / d, 1)), math.pi))
    between = np.arccos(np.clip(np.einsum("ij,ij->i", *axes), -1, 1))
    return np.asarray(between > angles[0] + angles[1])


def visible_solid_angle(p: Array, n: Array, light: Plate, others: Sequence[Shape]) -> Array:
    """Projected solid angle (N,) of a light's front less what other shapes hide; NaN where unknown.

    The points p (N, 3) lie on one plane with the normal n (N, 3).
    """
    if not len(p):
        return np.zeros(0)
    facing = (p - light.origin) @ light.normal
    total = above_horizon(p, n, light.corners)
    shadows: list[Array] = []
    for other in others:
        if other is light.shape:
            continue
        free = is_free(p, n, light.shape, other)
        if free.all():
            continue
        body = solid(other)
        if isinstance(body, Plate) and np.abs(body.normal @ light.normal) > 1 - 1e-12:
            shadow = _shadow(p, light, body)
            if shadow is not None:
                shadows.append(shadow)
        else:
            total = np.where(free, total, np.nan)
    return np.where(facing > 0, total - _union(p, n, light, shadows), 0.0)


def _union(p: Array, n: Array, light: Plate, shadows: Sequence[Array]) -> Array:
    """Projected solid angle (N,) of rectangles (2, 2, N) on a light together: each less what is counted.

    |∪ Sᵢ| = Σ |Sᵢ| − |Sᵢ ∩ ∪ⱼ Sⱼ|, j < i.
    """
    total = np.zeros(len(p))
    for i, own in enumerate(shadows):
        common = []
        for before in shadows[:i]:
            low, high = np.maximum(own[0], before[0]), np.minimum(own[1], before[1])
            overlap = (low < high).all(axis=0)
            if overlap.any():
                common.append(np.stack([np.where(overlap, low, -1.0), np.where(overlap, high, -1.0)]))
        total += projected_solid_angle(p, n, light.at(*_outline(own))) - _union(p, n, light, common)
    return total


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
    if scene.sky.any():
        planes += [(plate.normal, plate.origin) for plate in plates]
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
            (
                (mirror.reflect(p + n) - mirror.reflect(p), mirror.reflect(p)),
                (mirror.reflect(q + m) - mirror.reflect(q), mirror.reflect(q)),
            )
            for (n, p), (m, q) in cuts
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


def _mirrors(scene: Scene) -> list[Plate]:
    return [Plate(s) for s in scene.shapes if s.material.kind == "conductor" and s.kind == "rectangle"]


def _shadow_planes(light: Plate, plate: Plate) -> list[tuple[Array, Array]]:
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
    return _film_line_of_plane(camera, normal)


def film_line_of(camera: Camera, a: Array, b: Array) -> Array:
    """The line (a, b, c) on the film through the pictures of two points (3,)."""
    return _film_line_of_plane(camera, np.cross(a - camera.origin, b - camera.origin))


def _film_line_of_plane(camera: Camera, normal: Array) -> Array:
    """The picture of the plane through the eye with this normal."""
    x, y, z = camera.to_world[:3, :3].T @ normal
    t, width, height = camera.tan_x, camera.width, camera.height
    left, upper = camera.edge
    return np.array(
        [-2 * x * t / width, -2 * y * t / width, x * t * left + y * t * upper * height / width + z]
    )
