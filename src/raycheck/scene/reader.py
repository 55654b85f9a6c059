"""What a scene file says, in double precision: just enough of Mitsuba's XML for closed forms.

Defaults and parameters are put in first, so that every number is the one that a renderer parses too.
Whatever a closed form cannot judge by (unknown elements) is left out here; it is the renderers that check a
scene for mistakes.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.errors import ReferenceError_
from raycheck.scene import document, materials
from raycheck.scene.document import Element
from raycheck.scene.materials import Material
from raycheck.scene.properties import named, rgb, transform, value, xyz


@dataclass(frozen=True)
class Shape:
    """A rectangle, disk, cube or sphere: the unit shape placed by `to_world` (4, 4); radiance (3,).

    A mesh (`ply`, `obj`) is named by its kind and its file: no closed form judges by it.
    """

    kind: str
    to_world: Array
    flipped: bool
    material: Material
    radiance: Array
    mesh: Path | None = None
    face_normals: bool = False

    @property
    def emits(self) -> bool:
        return bool(self.radiance.any())


@dataclass(frozen=True)
class PointLight:
    """Position (3,) and intensity (3,) in W/sr."""

    position: Array
    intensity: Array


@dataclass(frozen=True)
class Sun:
    """Unit vector (3,) of the way that its light goes, and irradiance (3,) across it in W/m²."""

    direction: Array
    irradiance: Array


@dataclass(frozen=True)
class Spot:
    """Position and unit vector (3,) of its axis, intensity (3,) in W/sr, angles in radians."""

    position: Array
    axis: Array
    intensity: Array
    cutoff: float
    beam: float


@dataclass(frozen=True)
class Camera:
    """A pinhole: `to_world` (4, 4) with the view along +z and the image's right along −x, as in Mitsuba.

    `tan_x` is the tangent of half the horizontal field of view.
    """

    to_world: Array
    tan_x: float
    width: int
    height: int

    @property
    def origin(self) -> Array:
        return self.to_world[:3, 3]

    def directions(self, x: Array, y: Array) -> Array:
        """Unit vectors (…, 3) through film positions x, y (…) in pixels from the top left corner."""
        right = (1 - 2 * x / self.width) * self.tan_x
        up = (1 - 2 * y / self.height) * self.tan_x * self.height / self.width
        local = np.stack([right, up, np.ones_like(right)], axis=-1)
        world = local @ self.to_world[:3, :3].T
        return np.asarray(world / np.linalg.norm(world, axis=-1, keepdims=True))

    def film(self, points: Array) -> tuple[Array, Array]:
        """Film positions (x, y) of points (…, 3) in pixels; NaN for points behind the camera."""
        local = (points - self.origin) @ np.linalg.inv(self.to_world[:3, :3]).T
        depth = np.where(local[..., 2] > 1e-9, local[..., 2], np.nan)
        x = (1 - local[..., 0] / depth / self.tan_x) * self.width / 2
        y = (1 - local[..., 1] / depth / self.tan_x * self.width / self.height) * self.height / 2
        return x, y


@dataclass(frozen=True)
class Scene:
    camera: Camera
    max_depth: int
    shapes: tuple[Shape, ...]
    point_lights: tuple[PointLight, ...] = ()
    suns: tuple[Sun, ...] = ()
    spots: tuple[Spot, ...] = ()
    sky: Array = field(default_factory=lambda: np.zeros(3))
    """(3,) radiance of what is beyond all shapes."""
    roulette_depth: int = 5
    hide_emitters: bool = False

    @property
    def only_shapes_shine(self) -> bool:
        return not (self.point_lights or self.suns or self.spots or self.sky.any())


def read_scene(path: Path, parameters: Mapping[str, str] | None = None) -> Scene:
    """Read a scene file with `parameters` for its defaults; ReferenceError_ where it says too little."""
    root = document.read(path, parameters).resolved()
    of_scene = _Materials(
        {e.attrib["id"]: e for e in root.iter() if e.tag in ("bsdf", "texture") and "id" in e.attrib}
    )
    integrator, sensor = root.find("integrator"), root.find("sensor")
    if integrator is None or sensor is None:
        raise ReferenceError_(f"{path}: no {'integrator' if integrator is None else 'sensor'}")
    return Scene(
        camera=_camera(sensor),
        max_depth=int(value(integrator, "max_depth", "-1")),
        shapes=tuple(_shape(e, of_scene, path.parent) for e in root.findall("shape")),
        point_lights=tuple(_point_light(e) for e in _emitters(root, "point")),
        suns=tuple(_sun(e) for e in _emitters(root, "directional")),
        spots=tuple(_spot(e) for e in _emitters(root, "spot")),
        sky=sum((rgb(e, "radiance", 1.0) for e in _emitters(root, "constant")), np.zeros(3)),
        roulette_depth=int(value(integrator, "rr_depth", "5")),
        hide_emitters=value(integrator, "hide_emitters", "false") == "true",
    )


def _emitters(root: Element, kind: str) -> list[Element]:
    return [e for e in root.findall("emitter") if e.attrib["type"] == kind]


@dataclass
class _Materials:
    """The materials of a scene; one that several shapes refer to is one and the same."""

    by_id: Mapping[str, Element]
    read: dict[str, Material] = field(default_factory=dict)

    def of(self, element: Element) -> Material:
        """The material of a <bsdf>, or of the one that a <ref> means."""
        if element.tag == "bsdf":
            return self._material(element)
        name = element.get("id", "")
        if name not in self.by_id or self.by_id[name].tag != "bsdf":
            raise ReferenceError_(f'<ref id="{name}"/>: nothing has this id')
        if name not in self.read:
            self.read[name] = self._material(self.by_id[name])
        return self.read[name]

    def _material(self, element: Element) -> Material:
        """Of a <bsdf>, with the textures in it that are named elsewhere."""
        return materials.material(element, self.of, self.by_id)


def _shape(element: Element, of_scene: _Materials, folder: Path) -> Shape:
    to_world = transform(element)
    if element.attrib["type"] == "sphere":
        center = named(element, "center")
        radius = float(value(element, "radius", "1"))
        local = np.diag([radius, radius, radius, 1.0])
        local[:3, 3] = np.zeros(3) if center is None else xyz(center)
        to_world = to_world @ local
    light = element.find("emitter")
    bsdf = next((child for child in element if child.tag in ("bsdf", "ref")), None)
    if bsdf is not None:
        material = of_scene.of(bsdf)
    else:  # a lamp is black then
        material = Material("diffuse", np.full(3, 0.5 if light is None else 0.0))
    return Shape(
        kind=element.attrib["type"],
        to_world=to_world,
        flipped=value(element, "flip_normals", "false") == "true",
        material=material,
        radiance=np.zeros(3) if light is None else rgb(light, "radiance", 1.0),
        mesh=folder / value(element, "filename", "") if element.attrib["type"] in ("ply", "obj") else None,
        face_normals=value(element, "face_normals", "false") == "true",
    )


def _point_light(element: Element) -> PointLight:
    position = named(element, "position")
    origin = transform(element)[:3, 3] if position is None else xyz(position)
    return PointLight(origin, rgb(element, "intensity", 1.0))


def _sun(element: Element) -> Sun:
    direction = named(element, "direction")
    way = transform(element)[:3, 2] if direction is None else xyz(direction)
    return Sun(way / np.linalg.norm(way), rgb(element, "irradiance", 1.0))


def _spot(element: Element) -> Spot:
    to_world = transform(element)
    cutoff = float(value(element, "cutoff_angle", "20"))
    beam = float(value(element, "beam_width", str(0.75 * cutoff)))
    axis = to_world[:3, 2] / np.linalg.norm(to_world[:3, 2])
    intensity = rgb(element, "intensity", 1.0)
    return Spot(to_world[:3, 3], axis, intensity, math.radians(cutoff), math.radians(beam))


def _camera(sensor: Element) -> Camera:
    film = sensor.find("film")
    if film is None:
        raise ValueError("no film")
    width, height = int(value(film, "width", "768")), int(value(film, "height", "576"))
    half = math.tan(math.radians(float(value(sensor, "fov", "0"))) / 2)
    axis = value(sensor, "fov_axis", "x")
    if axis in ("smaller", "larger"):
        axis = "x" if (width <= height) == (axis == "smaller") else "y"
    if axis == "y":
        half *= width / height
    elif axis == "diagonal":
        half *= width / math.hypot(width, height)
    return Camera(transform(sensor), half, width, height)
