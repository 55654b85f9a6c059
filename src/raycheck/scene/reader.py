"""What a scene file says, in double precision: just enough of Mitsuba's XML for closed forms.

Defaults and parameters are put in first, so that every number is the one that a renderer parses too.
Whatever a closed form cannot judge by (unknown elements) is left out here; it is the renderers that check a
scene for mistakes.
"""

import functools
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.errors import ReferenceError_
from raycheck.scene import document
from raycheck.scene.document import Element

METALS = Path(__file__).with_name("metals.json")


@dataclass(frozen=True)
class Material:
    """`kind` is Mitsuba's type; reflectance (3,) diffuse or specular.

    `eta` and `k` (3,): complex index of a conductor, `k` −1 for a perfect mirror; `eta` of a dielectric is
    its inner index over the outer one. `alpha` is the roughness of a rough conductor. A blend has two `parts`
    and the `weight` of the second. A `two_sided` one looks the same from behind, where others are black.
    """

    kind: str
    reflectance: Array
    eta: Array = field(default_factory=lambda: np.zeros(3))
    k: Array = field(default_factory=lambda: np.full(3, -1.0))
    weight: float = 0.0
    parts: tuple["Material", ...] = ()
    two_sided: bool = False
    alpha: float = 0.0


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
    materials = _Materials({e.attrib["id"]: e for e in root.iter("bsdf") if "id" in e.attrib})
    integrator, sensor = root.find("integrator"), root.find("sensor")
    if integrator is None or sensor is None:
        raise ReferenceError_(f"{path}: no {'integrator' if integrator is None else 'sensor'}")
    return Scene(
        camera=_camera(sensor),
        max_depth=int(_value(integrator, "max_depth", "-1")),
        shapes=tuple(_shape(e, materials, path.parent) for e in root.findall("shape")),
        point_lights=tuple(_point_light(e) for e in _emitters(root, "point")),
        suns=tuple(_sun(e) for e in _emitters(root, "directional")),
        spots=tuple(_spot(e) for e in _emitters(root, "spot")),
        sky=sum((_rgb(e, "radiance", 1.0) for e in _emitters(root, "constant")), np.zeros(3)),
        roulette_depth=int(_value(integrator, "rr_depth", "5")),
        hide_emitters=_value(integrator, "hide_emitters", "false") == "true",
    )


def _emitters(root: Element, kind: str) -> list[Element]:
    return [e for e in root.findall("emitter") if e.attrib["type"] == kind]


def _named(element: Element, name: str) -> Element | None:
    return next((e for e in element if e.attrib.get("name") == name), None)


def _value(element: Element, name: str, default: str) -> str:
    child = _named(element, name)
    return default if child is None else child.attrib["value"]


def _numbers(text: str) -> Array:
    return np.array([float(word) for word in text.replace(",", " ").split()])


def _xyz(element: Element, default: float = 0.0) -> Array:
    if "value" in element.attrib:
        values = _numbers(element.attrib["value"])
        return np.broadcast_to(values, 3).copy()
    return np.array([float(element.attrib.get(axis, default)) for axis in "xyz"])


def _rgb(element: Element, name: str, default: float) -> Array:
    child = _named(element, name)
    values = np.array([default]) if child is None else _numbers(child.attrib["value"])
    return np.broadcast_to(values, 3).copy()


def _transform(element: Element, name: str = "to_world") -> Array:
    """The (4, 4) matrix of a `<transform>`: its operations in order, the first applied first."""
    matrix = np.eye(4)
    transform = _named(element, name)
    for step in transform if transform is not None else ():
        matrix = _step(step) @ matrix
    return matrix


def _step(step: Element) -> Array:
    matrix = np.eye(4)
    if step.tag == "translate":
        matrix[:3, 3] = _xyz(step)
    elif step.tag == "scale":
        matrix[:3, :3] = np.diag(_xyz(step, 1.0))
    elif step.tag == "rotate":
        matrix[:3, :3] = _rotation(_xyz(step), math.radians(float(step.attrib["angle"])))
    elif step.tag == "matrix":
        values = _numbers(step.attrib["value"])
        size = 4 if values.size == 16 else 3
        matrix[:size, :size] = values.reshape(size, size)
    elif step.tag == "lookat":
        origin, target, up = (_numbers(step.attrib[key]) for key in ("origin", "target", "up"))
        forward = (target - origin) / np.linalg.norm(target - origin)
        left = np.cross(up, forward)
        left /= np.linalg.norm(left)
        matrix[:3, :] = np.stack([left, np.cross(forward, left), forward, origin], axis=1)
    else:
        raise ValueError(f"<{step.tag}> in a transform")
    return matrix


def _rotation(axis: Array, angle: float) -> Array:
    """A rotation about an axis, by Rodrigues' formula."""
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * (cross @ cross))


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
        if name not in self.by_id:
            raise ReferenceError_(f'<ref id="{name}"/>: nothing has this id')
        if name not in self.read:
            self.read[name] = self._material(self.by_id[name])
        return self.read[name]

    def _material(self, element: Element) -> Material:
        kind = element.attrib["type"]
        if kind in ("conductor", "roughconductor"):
            tint, alpha = _rgb(element, "specular_reflectance", 1.0), 0.0
            if kind == "roughconductor":
                alpha = max(float(_value(element, "alpha", _value(element, "alpha_u", "0.1"))), 1e-4)
            return Material(kind, tint, *_metal(element), alpha=alpha)
        if kind == "dielectric":
            inner, outer = _value(element, "int_ior", "1.5046"), _value(element, "ext_ior", "1.000277")
            ratio = float(inner) / float(outer)
            return Material(kind, _rgb(element, "specular_reflectance", 1.0), np.full(3, ratio))
        parts = tuple(self.of(e) for e in element if e.tag in ("bsdf", "ref"))
        if kind == "blendbsdf":
            return Material(kind, np.zeros(3), weight=float(_value(element, "weight", "0.5")), parts=parts)
        if kind == "twosided" and parts:
            return replace(parts[0], two_sided=True)
        if kind == "twosided":
            raise ReferenceError_('a <bsdf type="twosided"> without a <bsdf> in it')
        return Material(kind, _rgb(element, "reflectance", 0.5))


@functools.cache
def _metals() -> dict[str, dict[str, list[float]]]:
    """Mitsuba's indices of refraction, by name (scripts/make_metals.py)."""
    found: dict[str, dict[str, list[float]]] = json.loads(METALS.read_text(encoding="utf-8"))
    return found


def _metal(element: Element) -> tuple[Array, Array]:
    """η and k (3,) of a conductor, by name or as they stand."""
    name = _value(element, "material", "none")
    if name == "none":
        return _rgb(element, "eta", 0.0), _rgb(element, "k", -1.0)
    if name not in _metals():
        raise ReferenceError_(f'<bsdf type="{element.attrib["type"]}">: no metal is called "{name}"')
    return np.array(_metals()[name]["eta"]), np.array(_metals()[name]["k"])


def _shape(element: Element, materials: _Materials, folder: Path) -> Shape:
    to_world = _transform(element)
    if element.attrib["type"] == "sphere":
        center = _named(element, "center")
        radius = float(_value(element, "radius", "1"))
        local = np.diag([radius, radius, radius, 1.0])
        local[:3, 3] = np.zeros(3) if center is None else _xyz(center)
        to_world = to_world @ local
    light = element.find("emitter")
    bsdf = next((child for child in element if child.tag in ("bsdf", "ref")), None)
    if bsdf is not None:
        material = materials.of(bsdf)
    else:  # a lamp is black then
        material = Material("diffuse", np.full(3, 0.5 if light is None else 0.0))
    return Shape(
        kind=element.attrib["type"],
        to_world=to_world,
        flipped=_value(element, "flip_normals", "false") == "true",
        material=material,
        radiance=np.zeros(3) if light is None else _rgb(light, "radiance", 1.0),
        mesh=folder / _value(element, "filename", "") if element.attrib["type"] in ("ply", "obj") else None,
        face_normals=_value(element, "face_normals", "false") == "true",
    )


def _point_light(element: Element) -> PointLight:
    position = _named(element, "position")
    origin = _transform(element)[:3, 3] if position is None else _xyz(position)
    return PointLight(origin, _rgb(element, "intensity", 1.0))


def _sun(element: Element) -> Sun:
    direction = _named(element, "direction")
    way = _transform(element)[:3, 2] if direction is None else _xyz(direction)
    return Sun(way / np.linalg.norm(way), _rgb(element, "irradiance", 1.0))


def _spot(element: Element) -> Spot:
    to_world = _transform(element)
    cutoff = float(_value(element, "cutoff_angle", "20"))
    beam = float(_value(element, "beam_width", str(0.75 * cutoff)))
    axis = to_world[:3, 2] / np.linalg.norm(to_world[:3, 2])
    intensity = _rgb(element, "intensity", 1.0)
    return Spot(to_world[:3, 3], axis, intensity, math.radians(cutoff), math.radians(beam))


def _camera(sensor: Element) -> Camera:
    film = sensor.find("film")
    if film is None:
        raise ValueError("no film")
    width, height = int(_value(film, "width", "768")), int(_value(film, "height", "576"))
    half = math.tan(math.radians(float(_value(sensor, "fov", "0"))) / 2)
    axis = _value(sensor, "fov_axis", "x")
    if axis in ("smaller", "larger"):
        axis = "x" if (width <= height) == (axis == "smaller") else "y"
    if axis == "y":
        half *= width / height
    elif axis == "diagonal":
        half *= width / math.hypot(width, height)
    return Camera(_transform(sensor), half, width, height)
