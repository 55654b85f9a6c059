"""What a scene file says, in double precision: all of it, or ReferenceError_ with the line that has no
meaning here (plugins.py).

Defaults and parameters are put in first, so that every number is the one that a renderer parses too.
"""

import functools
import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from raycheck.base.arrays import Array
from raycheck.scene import document
from raycheck.scene.document import Element
from raycheck.scene.plugins import Said, check_attributes, children, described, fail, only, uniform_scale

METALS = Path(__file__).with_name("metals.json")


@dataclass(frozen=True)
class Material:
    """`kind` is Mitsuba's type; reflectance (3,) diffuse or specular.

    `eta` and `k` (3,): complex index of a conductor, `k` −1 for a perfect mirror; `eta` of a dielectric is
    its inner index over the outer one, and `transmittance` (3,) what of the refracted light goes on. `alpha`
    is the roughness of a rough conductor. A blend has two `parts` and the `weight` of the second. A
    `two_sided` one looks the same from behind, where others are black.
    """

    kind: str
    reflectance: Array
    eta: Array = field(default_factory=lambda: np.zeros(3))
    k: Array = field(default_factory=lambda: np.full(3, -1.0))
    weight: float = 0.0
    parts: tuple["Material", ...] = ()
    two_sided: bool = False
    alpha: float = 0.0
    transmittance: Array = field(default_factory=lambda: np.ones(3))


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
    near_clip: float = 0.01
    """With `far_clip`, depths along the view between which the camera sees."""
    far_clip: float = 1e4

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
    """Read a scene file with `parameters` for its defaults; ReferenceError_ for what has no meaning here."""
    root = document.read(path, parameters).resolved()
    _check_root(root)
    materials = _Materials(root)
    integrator, sensor = only(root, "integrator"), only(root, "sensor")
    if integrator is None:
        fail(root, '<scene> needs an <integrator type="path"> with its max_depth')
    if sensor is None:
        fail(root, '<scene> needs a <sensor type="perspective">')
    with Said(integrator) as said:
        max_depth, roulette_depth = said.integer("max_depth"), said.integer("rr_depth")
        hide_emitters = said.flag("hide_emitters")
    if max_depth == 0:
        fail(integrator, '"max_depth" 0 is a black image: -1 is without limit, 1 emission only')
    emitters = [_emitter(e) for e in root.findall("emitter")]
    skies = [sky for sky in emitters if isinstance(sky, np.ndarray)]
    for another in root.findall("./emitter[@type='constant']")[1:]:
        fail(another, f"a second {described(another)}")
    shapes = []
    for element in root.findall("shape"):
        shape = _shape(element, materials, path.parent)
        if hide_emitters and shape is not None and only(element, "emitter") is not None and not shape.emits:
            fail(element, "a hidden emitter of radiance 0 is not supported by raycheck")
        shapes += [shape] if shape is not None else []
    materials.check_others()
    return Scene(
        camera=_camera(sensor),
        max_depth=max_depth,
        shapes=tuple(shapes),
        point_lights=tuple(e for e in emitters if isinstance(e, PointLight)),
        suns=tuple(e for e in emitters if isinstance(e, Sun)),
        spots=tuple(e for e in emitters if isinstance(e, Spot)),
        sky=sum(skies, np.zeros(3)),
        roulette_depth=roulette_depth,
        hide_emitters=hide_emitters,
    )


def _check_root(root: Element) -> None:
    if root.tag != "scene":
        fail(root, f'the outermost element must be <scene version="3.0.0">, not <{root.tag}>')
    check_attributes(root)
    if not re.fullmatch(r"3\.\d{1,4}\.\d{1,4}", root.attrib["version"]):
        fail(root, f'scene version "{root.attrib["version"]}" is not supported (3.0.0, or another 3.x.y)')
    names: set[str] = set()
    for element in children(root, ("default", "integrator", "sensor", "bsdf", "shape", "emitter")):
        if element.tag != "default":
            continue
        children(element, ())
        name = element.attrib["name"]
        if not re.fullmatch(r"\w+", name, re.ASCII) or name in names:
            wrong = "is given twice" if name in names else "has more than letters, digits and _ in its name"
            fail(element, f'the default "{name}" {wrong}')
        names.add(name)


class _Materials:
    """The materials of a scene; one that several shapes refer to is one and the same."""

    def __init__(self, root: Element):
        self._by_id: dict[str, Element] = {}
        self._read: dict[Element, Material | None] = {}
        self._others = root.findall("bsdf")
        for element in root.iter():
            name = element.get("id")
            if name is None or element.tag == "ref":
                continue
            if not name:
                fail(element, f"the id of <{element.tag}> is empty")
            if name in self._by_id:
                fail(element, f'the id "{name}" is already that of another element')
            self._by_id[name] = element

    def of(self, element: Element) -> Material:
        """The material of a <bsdf>, or of the one that a <ref> means."""
        bsdf = element
        if element.tag == "ref":
            children(element, ())
            name = element.attrib["id"]
            if name not in self._by_id:
                fail(element, f'<ref id="{name}"/>: nothing has this id')
            bsdf = self._by_id[name]
            if bsdf.tag != "bsdf":
                fail(element, f'<ref id="{name}"/>: that is a <{bsdf.tag}>, and no <bsdf>')
        if bsdf not in self._read:
            self._read[bsdf] = None
            self._read[bsdf] = self._material(bsdf)
        found = self._read[bsdf]
        if found is None:
            fail(element, "the bsdf contains itself")
        return found

    def check_others(self) -> None:
        """Those that no shape uses."""
        for element in self._others:
            self.of(element)

    def _material(self, element: Element) -> Material:
        kind = element.attrib["type"]
        holds = ("bsdf", "ref") if kind in ("blendbsdf", "twosided") else ()
        with Said(element, holds) as said:
            parts = [self.of(e) for e in element if e.tag in holds]
            if kind == "twosided":
                return _two_sided(element, parts)
            if kind == "blendbsdf":
                if len(parts) != 2 or said.given("weight") is None:
                    fail(element, '<bsdf type="blendbsdf"> needs two bsdfs and the "weight" of the second')
                return Material(kind, np.zeros(3), weight=said.number("weight"), parts=tuple(parts))
            if kind == "diffuse":
                return Material(kind, said.triple("reflectance"))
            if kind == "dielectric":
                return _dielectric(said)
            tint, metal = said.triple("specular_reflectance"), _metal(said)
            if kind == "conductor":
                return Material(kind, tint, *metal)
            if kind == "roughconductor":
                return Material(kind, tint, *metal, alpha=_roughness(said))
            fail(element, f"{described(element)} is not supported by raycheck")


def _two_sided(element: Element, parts: list[Material]) -> Material:
    if not 0 < len(parts) < 3:
        fail(element, '<bsdf type="twosided"> needs a bsdf inside (one for both sides, or two)')
    if any(_has_back(part) for part in parts):
        held = "twosided, dielectric"
        fail(element, f'<bsdf type="twosided"> cannot hold a bsdf that has a back side ({held})')
    if len(parts) == 2 and parts[0] is not parts[1]:
        fail(element, '<bsdf type="twosided"> with two bsdfs is not supported by raycheck: only with one')
    return replace(parts[0], two_sided=True)


def _has_back(material: Material) -> bool:
    return material.two_sided or material.kind == "dielectric" or any(map(_has_back, material.parts))


def _dielectric(said: Said) -> Material:
    if said.given("int_ior") is None or said.given("ext_ior") is None:
        fail(said.element, '<bsdf type="dielectric"> needs both int_ior and ext_ior (as <float>, or by name)')
    ratio = np.full(3, said.number("int_ior") / said.number("ext_ior"))
    colours = said.triple("specular_reflectance"), said.triple("specular_transmittance")
    return Material("dielectric", colours[0], ratio, transmittance=colours[1])


def _roughness(said: Said) -> float:
    if said.given("distribution") is None:  # Mitsuba's default is beckmann
        fail(said.element, f'{described(said.element)}: write <string name="distribution" value="ggx"/>')
    along, across = said.given("alpha_u") is not None, said.given("alpha_v") is not None
    if along != across or (along and said.given("alpha") is not None):
        fail(said.element, f"{described(said.element)}: write alpha, or both alpha_u and alpha_v")
    if said.number("alpha_u") != said.number("alpha_v"):
        fail(said.element, "a roughness that depends on the direction is not supported by raycheck")
    return max(said.number("alpha_u" if along else "alpha"), 1e-4)


@functools.cache
def _metals() -> dict[str, dict[str, list[float]]]:
    """Mitsuba's indices of refraction, by name (scripts/make_metals.py)."""
    found: dict[str, dict[str, list[float]]] = json.loads(METALS.read_text(encoding="utf-8"))
    return found


def _metal(said: Said) -> tuple[Array, Array]:
    """η and k (3,) of a conductor, by name or as they stand."""
    index = [said.given(name) is not None for name in ("eta", "k")]
    if index[0] != index[1] or (index[0] and said.given("material") is not None):
        fail(said.element, f'{described(said.element)}: write "eta" and "k", or "material"')
    if index[0]:
        return said.triple("eta"), said.triple("k")
    name = said.word("material") or "none"
    if name == "none":
        return np.zeros(3), np.full(3, -1.0)
    if name not in _metals():
        fail(said.element, f'{described(said.element)}: no metal is called "{name}"')
    return np.array(_metals()[name]["eta"]), np.array(_metals()[name]["k"])


def _shape(element: Element, materials: _Materials, folder: Path) -> Shape | None:
    """None for a sphere without size."""
    light, bsdf = only(element, "emitter"), only(element, "bsdf", "ref")
    mesh, face_normals = None, False
    with Said(element, ("bsdf", "ref", "emitter")) as said:
        to_world, flipped = said.transform("to_world"), said.flag("flip_normals")
        if said.type == "sphere":
            to_world, flipped = _sphere(said, to_world, flipped)
        elif said.type in ("ply", "obj"):
            mesh, face_normals = folder / said.word("filename"), said.flag("face_normals")
            said.ignore("flip_tex_coords")
        elif said.type not in ("rectangle", "disk", "cube"):
            fail(element, f"{described(element)} is not supported by raycheck")
    if bsdf is not None:
        material = materials.of(bsdf)
    else:  # a lamp is black then
        material = Material("diffuse", np.full(3, 0.5 if light is None else 0.0))
    radiance = np.zeros(3) if light is None else _area_light(light)
    if not to_world[:3, :3].any():
        return None
    return Shape(said.type, to_world, flipped, material, radiance, mesh, face_normals)


def _sphere(said: Said, to_world: Array, flipped: bool) -> tuple[Array, bool]:
    """Its matrix with center and radius; a mirrored one is turned inside out."""
    if not uniform_scale(to_world, 1e-4):
        fail(said.element, '"to_world" of a sphere must not shear or scale by axis')
    radius = said.number("radius")
    local = np.diag([radius, radius, radius, 1.0])
    local[:3, 3] = said.triple("center")
    return to_world @ local, flipped != bool(np.linalg.det(to_world[:3, :3]) < 0)


def _area_light(element: Element) -> Array:
    if element.attrib["type"] != "area":
        fail(element, f"{described(element)} cannot stand in a <shape>: only area does")
    with Said(element) as said:
        return said.triple("radiance")


def _emitter(element: Element) -> "PointLight | Sun | Spot | Array":
    """One that is no shape's; the radiance (3,) of a constant one."""
    with Said(element) as said:
        if said.type == "constant":
            return said.triple("radiance")
        if said.type == "point":
            position, moved = said.triple("position"), said.transform("to_world")[:3, 3]
            return PointLight(_one_of(said, "position", position, moved), said.triple("intensity"))
        if said.type == "directional":
            given, axis = said.triple("direction"), said.transform("to_world")[:3, 2]
            way = _one_of(said, "direction", given, axis)
            if not 0 < np.linalg.norm(way) < math.inf:
                fail(element, '"direction" must not be of zero or overflowing length')
            if said.given("to_world") is not None and not abs(np.linalg.norm(way) - 1) <= 1e-5:
                fail(element, '"to_world" of a directional emitter must not scale')
            return Sun(way / np.linalg.norm(way), said.triple("irradiance"))
        if said.type == "spot":
            return _spot(said)
    where = "must stand in a <shape>, which is what shines" if said.type == "area" else "is not supported"
    fail(element, f"{described(element)} {where}")


def _one_of(said: Said, name: str, value: Array, by_matrix: Array) -> Array:
    """A place or way that the file gives by `name` or by "to_world"."""
    if said.given("to_world") is None:
        return value
    if said.given(name) is not None:
        fail(said.element, f'{described(said.element)} has "{name}" and "to_world": write one or the other')
    return by_matrix


def _spot(said: Said) -> Spot:
    to_world, cutoff = said.transform("to_world"), said.number("cutoff_angle")
    beam = said.number("beam_width") if said.given("beam_width") is not None else 0.75 * cutoff
    if said.given("beam_width") is not None and beam > cutoff:
        fail(said.element, f'"beam_width" is {beam:g}, more than "cutoff_angle", {cutoff:g}')
    if not uniform_scale(to_world, 1e-3):
        fail(said.element, '"to_world" of a spot must not shear or scale by axis: its cone is round')
    axis = to_world[:3, 2] / np.linalg.norm(to_world[:3, 2])
    intensity = said.triple("intensity")
    return Spot(to_world[:3, 3], axis, intensity, math.radians(cutoff), math.radians(beam))


def _camera(sensor: Element) -> Camera:
    film = only(sensor, "film")
    if film is None:
        fail(sensor, '<sensor> needs a <film type="hdrfilm"> with <rfilter type="box"/>')
    width, height = _film(film)
    with Said(sensor, ("film", "sampler")) as said:  # no sampler changes the mean of a picture
        if said.given("fov") is None:
            fail(sensor, '<sensor> needs a field of view: <float name="fov" value="40"/>, in degrees')
        half, axis = math.tan(math.radians(said.number("fov")) / 2), said.word("fov_axis")
        to_world = said.transform("to_world")
        near, far = said.number("near_clip"), said.number("far_clip")
    if not abs(uniform_scale(to_world, 1e-3) - 1) <= 1e-3:
        fail(sensor, '"to_world" of a sensor must not scale or shear')
    if near >= far:
        fail(sensor, f'"near_clip" is {near:g} and must be less than "far_clip", {far:g}')
    if axis in ("smaller", "larger"):
        axis = "x" if (width <= height) == (axis == "smaller") else "y"
    if axis == "y":
        half *= width / height
    elif axis == "diagonal":
        half *= width / math.hypot(width, height)
    return Camera(to_world, half, width, height, near, far)


def _film(film: Element) -> tuple[int, int]:
    """Width and height of a film whose pixels are means over their own squares."""
    rfilter = only(film, "rfilter")
    if rfilter is None:
        fail(film, '<film> needs <rfilter type="box"/> (Mitsuba\'s default, gaussian, is not supported)')
    with Said(rfilter):
        pass
    with Said(film, ("rfilter",)) as said:
        width, height = said.integer("width"), said.integer("height")
    if width * height > 2**28:
        fail(film, f"{width} x {height} pixels are more than 2^28")
    return width, height
