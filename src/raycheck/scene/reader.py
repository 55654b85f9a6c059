"""What a scene file says, in double precision: all of it, or ReferenceError_ with the line that has no
meaning here (plugins.py).

Defaults and parameters are put in first, so that every number is the one that a renderer parses too.
"""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from raycheck.base.arrays import Array
from raycheck.scene import document
from raycheck.scene.document import Element
from raycheck.scene.materials import Material, read_material
from raycheck.scene.pictures import read_picture
from raycheck.scene.plugins import Said, check_attributes, children, described, fail, only, uniform_scale
from raycheck.scene.textures import Texture, read_texture


@dataclass(frozen=True)
class Shape:
    """A rectangle, disk, cube, sphere or cylinder: the unit shape placed by `to_world` (4, 4); radiance (3,).

    The unit cylinder is the wall of radius 1 from z = 0 to 1. A mesh (`ply`, `obj`, `serialized`) is named by
    its kind and its file: no closed form judges by it.
    """

    kind: str
    to_world: Array
    flipped: bool
    material: Material
    radiance: Array
    mesh: Path | None = None
    face_normals: bool = False
    shape_index: int = 0
    """Of the meshes of a serialized file."""

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
class Filter:
    """What a pixel's film is weighed by around its middle, along x and along y: `box`, `tent` or `gaussian`,
    which is exp(-x²/2σ²) - exp(-8); sizes in pixels. A border of pixels around the picture counts, too.
    """

    kind: str = "box"
    radius: float = 0.5
    border: int = 0

    @property
    def is_pixel(self) -> bool:
        """The mean over a pixel's own square, which Mitsuba takes any filter of this radius for."""
        return self.radius == 0.5


@dataclass(frozen=True)
class Camera:
    """A pinhole: `to_world` (4, 4) with the view along +z and the image's right along −x, as in Mitsuba.

    `tan_x` is the tangent of half the horizontal field of view; without perspective half the image's width,
    in camera space.
    """

    to_world: Array
    tan_x: float
    width: int
    height: int
    near_clip: float = 0.01
    """With `far_clip`, depths along the view between which the camera sees."""
    far_clip: float = 1e4
    edge: tuple[float, float] = (1.0, 1.0)
    """Of the image's left and upper edge, in halves of the image to the left of and above the view's axis."""

    filter: Filter = Filter()
    aperture_radius: float = 0.0
    """Of a lens about the origin, all of whose points see one picture in the plane of focus."""
    focus_distance: float = 0.0
    """Of that plane, along the view."""
    parallel: bool = False
    """Without perspective: all rays go along the view, and `to_world` may stretch the image."""

    @property
    def is_pinhole(self) -> bool:
        return not (self.parallel or self.aperture_radius)

    @property
    def origin(self) -> Array:
        return self.to_world[:3, 3]

    def directions(self, x: Array, y: Array) -> Array:
        """Unit vectors (…, 3) through film positions x, y (…) in pixels from the top left corner."""
        ways = self.ways(x, y)
        return np.asarray(ways / np.linalg.norm(ways, axis=-1, keepdims=True))

    def ways(self, x: Array, y: Array) -> Array:
        """The same on one plane, at distance 1 in camera space: those between are interpolated."""
        left, up = self._place(x, y)
        if self.parallel:
            left, up = np.zeros_like(left), np.zeros_like(up)
        local = np.stack([left, up, np.ones_like(left)], axis=-1)
        return np.asarray(local @ self.to_world[:3, :3].T)

    def starts(self, x: Array, y: Array) -> Array:
        """Points (…, 3) on the near plane without perspective, where the rays of x, y (…) start."""
        local = np.stack([*self._place(x, y), np.full_like(x, self.near_clip)], axis=-1)
        return np.asarray(local @ self.to_world[:3, :3].T + self.origin)

    def _place(self, x: Array, y: Array) -> tuple[Array, Array]:
        """To the left and up in camera space, at distance 1."""
        left = (self.edge[0] - 2 * x / self.width) * self.tan_x
        return left, (self.edge[1] - 2 * y / self.height) * self.tan_x * self.height / self.width

    def film(self, points: Array) -> tuple[Array, Array]:
        """Film positions (x, y) of points (…, 3) in pixels; NaN for points behind the camera."""
        local = (points - self.origin) @ np.linalg.inv(self.to_world[:3, :3]).T
        depth = np.where(local[..., 2] > 1e-9, local[..., 2], np.nan)
        x = (self.edge[0] - local[..., 0] / depth / self.tan_x) * self.width / 2
        y = (self.edge[1] - local[..., 1] / depth / self.tan_x * self.width / self.height) * self.height / 2
        return x, y


@dataclass(frozen=True)
class SkyMap:
    """An environment as a picture, linear between its pixels: pixel (i, j) of `radiance` (H, W, 3) is
    (i + ½)/W of a turn from −z towards x, and j/(H − 1) of a half turn from y, of `axes` (3, 3), a row each.
    """

    radiance: Array
    axes: Array


@dataclass(frozen=True)
class Scene:
    camera: Camera
    max_depth: int
    shapes: tuple[Shape, ...]
    point_lights: tuple[PointLight, ...] = ()
    suns: tuple[Sun, ...] = ()
    spots: tuple[Spot, ...] = ()
    sky: Array = field(default_factory=lambda: np.zeros(3))
    """(3,) radiance of what is beyond all shapes, if that is no picture."""
    sky_map: SkyMap | None = None
    roulette_depth: int = 5
    hide_emitters: bool = False

    @property
    def only_shapes_shine(self) -> bool:
        other = self.point_lights or self.suns or self.spots or self.sky.any() or self.sky_map is not None
        return not other


PARTS = ("emitter", "film", "rfilter", "sampler")
"""Elements that a <ref> may stand for in a shape, sensor or film, besides materials."""


def read_scene(path: Path, parameters: Mapping[str, str] | None = None) -> Scene:
    """Read a scene file with `parameters` for its defaults; ReferenceError_ for what has no meaning here."""
    said = document.read(path, parameters)
    root = said.resolved()
    _check_root(root)
    _place_parts(root)
    materials = _Materials(root, said.file)
    max_depth, roulette_depth, hide_emitters = _integrator(only(root, "integrator"))
    pane = root.find(".//bsdf[@type='thindielectric']") if hide_emitters else None
    if pane is not None:  # Mitsuba shows a light straight behind it at some depths
        fail(pane, f'{described(pane)} is not supported with "hide_emitters" true')
    sensor = document.sensor(root)
    if sensor is None:
        fail(root, '<scene> needs a <sensor type="perspective">')
    emitters = [_emitter(e, said.file) for e in root.findall("emitter")]
    skies = [sky for sky in emitters if isinstance(sky, np.ndarray)]
    around = [e for e in root.findall("emitter") if e.get("type") in ("constant", "envmap")]
    for another in around[1:]:
        fail(another, f"a second {described(around[0])}")
    shapes = []
    for element in root.findall("shape"):
        shape = _shape(element, materials, said.file)
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
        sky_map=next((e for e in emitters if isinstance(e, SkyMap)), None),
        roulette_depth=roulette_depth,
        hide_emitters=hide_emitters,
    )


def _integrator(element: Element | None) -> tuple[int, int, bool]:
    """max_depth, rr_depth and hide_emitters; without an integrator those of `path`."""
    if element is None:
        return -1, 5, False
    inner = document.integrator(element)
    if inner is None:
        fail(element, f'{described(element)} needs an <integrator type="path"> inside')
    while element is not inner:
        with Said(element, ("integrator",)):
            inside = only(element, "integrator")
            assert inside is not None
            element = inside
    with Said(inner) as said:
        if said.type in ("direct_projective", "direct_reparam"):
            return 2, 5, said.flag("hide_emitters")
        if said.type == "direct":
            both = said.given("emitter_samples") is not None or said.given("bsdf_samples") is not None
            if said.given("shading_samples") is not None and both:
                fail(inner, '"shading_samples" is "emitter_samples" and "bsdf_samples": write it or these')
            return 2, 5, said.flag("hide_emitters")
        max_depth, roulette_depth = said.integer("max_depth"), said.integer("rr_depth")
        hide_emitters = said.flag("hide_emitters")
        said.ignore("strict_normals")
    if max_depth == 0:
        fail(inner, '"max_depth" 0 is a black image: -1 is without limit, 1 emission only')
    return max_depth, roulette_depth, hide_emitters


def _check_root(root: Element) -> None:
    if root.tag != "scene":
        fail(root, f'the outermost element must be <scene version="3.0.0">, not <{root.tag}>')
    check_attributes(root)
    if not re.fullmatch(r"[0-3]\.\d{1,4}\.\d{1,4}", root.attrib["version"]):
        version = root.attrib["version"]
        fail(root, f'scene version "{version}" is not supported (3.0.0, or another of 0.x.y to 3.x.y)')
    parts = ("integrator", "sensor", *PARTS, "bsdf", "texture", "shape", "ref")
    for element in children(root, ("default", "path", "alias", *parts)):
        if element.tag != "default":
            continue
        children(element, ())
        name = element.attrib["name"]
        if not re.fullmatch(r"\w+", name, re.ASCII):
            fail(element, f'the default "{name}" has more than letters, digits and _ in its name')


def _place_parts(root: Element) -> None:
    """Put what sensors, films and shapes refer to in the place of the <ref>, but for materials; what stands
    in the scene for that alone goes.
    """
    known = {element.get("id"): element for element in root.iter() if element.tag in PARTS}
    for alias in root.findall("alias"):
        if alias.get("id") in known:
            known[alias.get("as")] = known[alias.get("id")]
    for parent in (e for tag in ("sensor", "film", "shape") for e in list(root.iter(tag))):
        for at, child in enumerate(parent):
            if child.tag == "ref" and child.get("id") in known:
                children(child, ())
                parent[at] = known[child.get("id")]
    lamps = [element for element in root.iterfind("shape/emitter") if "id" in element.attrib]
    if len(lamps) > len(set(lamps)):
        fail(lamps[0], f'the emitter "{lamps[0].get("id")}" is that of two shapes, and each needs its own')
    for element in list(root):
        unplaced = element.tag == "emitter" and element.get("type") == "area" and "id" in element.attrib
        if unplaced:
            _area_light(element)
        if unplaced or element.tag in PARTS[1:]:
            root.remove(element)


class _Materials:
    """The materials and textures of a scene; a material that several shapes refer to is one and the same."""

    def __init__(self, root: Element, file: Callable[[str], Path]):
        self._file = file
        self._by_id: dict[str, Element] = {}
        self._read: dict[Element, Material | None] = {}
        self._others = [*root.findall("bsdf"), *root.findall("texture")]
        for element in root.iter():
            name = element.get("id")
            if name is None or element.tag in ("ref", "alias"):
                continue
            if not name:
                fail(element, f"the id of <{element.tag}> is empty")
            if name in self._by_id:
                fail(element, f'the id "{name}" is already that of another element')
            self._by_id[name] = element
        for alias in root.findall("alias"):
            if alias.attrib["id"] not in self._by_id or alias.attrib["as"] in ("", *self._by_id):
                names = f'id="{alias.attrib["id"]}" as="{alias.attrib["as"]}"'
                fail(alias, f"<alias {names}/>: the former must be the id of an element, the latter of none")
            self._by_id[alias.attrib["as"]] = self._by_id[alias.attrib["id"]]
        for ref in root.findall("ref"):
            if self._by_id.get(ref.attrib["id"], root).tag not in ("sensor", "bsdf", "texture"):
                fail(ref, f'<ref id="{ref.attrib["id"]}"/>: no <sensor>, <bsdf> or <texture> has this id')

    def of(self, element: Element) -> Material:
        """The material of a <bsdf>, or of the one that a <ref> means."""
        bsdf = self._meant(element, "bsdf")
        if bsdf not in self._read:
            self._read[bsdf] = None
            self._read[bsdf] = read_material(bsdf, self.of, self.texture, self._is_texture)
        found = self._read[bsdf]
        if found is None:
            fail(element, "the bsdf contains itself")
        return found

    def texture(self, element: Element) -> Texture:
        """That of a <texture>, or of the one that a <ref> means."""
        return read_texture(self._meant(element, "texture"), self._file)

    def _is_texture(self, element: Element) -> bool:
        meant = self._by_id.get(element.attrib.get("id", "")) if element.tag == "ref" else element
        return meant is not None and meant.tag == "texture"

    def check_others(self) -> None:
        """Those that no shape uses."""
        for element in self._others:
            if element.tag == "bsdf":
                self.of(element)
            else:
                self.texture(element)

    def _meant(self, element: Element, tag: str) -> Element:
        """What a <ref> means, which must be of this tag; what is none means itself."""
        if element.tag != "ref":
            return element
        children(element, ())
        name = element.attrib["id"]
        if name not in self._by_id:
            fail(element, f'<ref id="{name}"/>: nothing has this id')
        if self._by_id[name].tag != tag:
            fail(element, f'<ref id="{name}"/>: that is a <{self._by_id[name].tag}>, and no <{tag}>')
        return self._by_id[name]


def _shape(element: Element, materials: _Materials, file: Callable[[str], Path]) -> Shape | None:
    """None for a sphere or cylinder without size."""
    light, bsdf = only(element, "emitter"), only(element, "bsdf", "ref")
    mesh, face_normals, index = None, False, 0
    with Said(element, ("bsdf", "ref", "emitter")) as said:
        to_world, flipped = said.transform("to_world"), said.flag("flip_normals")
        if said.type == "sphere":
            to_world, flipped = _sphere(said, to_world, flipped)
        elif said.type == "cylinder":
            to_world = _cylinder(said, to_world)
        elif said.type in ("ply", "obj", "serialized"):
            mesh, face_normals = file(said.word("filename")), said.flag("face_normals")
            if said.type == "serialized":
                index = said.integer("shape_index")
            else:
                said.ignore("flip_tex_coords")
        elif said.type not in ("rectangle", "disk", "cube"):
            fail(element, f"{described(element)} is not supported by raycheck")
    if bsdf is not None:
        material = materials.of(bsdf)
    else:  # a lamp is black then
        material = Material("diffuse", np.full(3, 0.5 if light is None else 0.0))
    if mesh is not None and material.wants_uv:
        fail(element, f"texture coordinates of {described(element)} are not supported by raycheck")
    radiance = np.zeros(3) if light is None else _area_light(light)
    if not to_world[:3, :3].any():
        return None
    return Shape(said.type, to_world, flipped, material, radiance, mesh, face_normals, index)


def _sphere(said: Said, to_world: Array, flipped: bool) -> tuple[Array, bool]:
    """Its matrix with center and radius; a mirrored one is turned inside out."""
    if not uniform_scale(to_world, 1e-4):
        fail(said.element, '"to_world" of a sphere must not shear or scale by axis')
    radius = said.number("radius")
    local = np.diag([radius, radius, radius, 1.0])
    local[:3, 3] = said.triple("center")
    return to_world @ local, flipped != bool(np.linalg.det(to_world[:3, :3]) < 0)


def _cylinder(said: Said, to_world: Array) -> Array:
    """The matrix of the unit cylinder, with the axes across p0 … p1 that Mitsuba takes: Duff et al., JCGT
    6(1), 2017; zeros where it has no size.
    """
    start, radius = said.triple("p0"), said.number("radius")
    end = said.triple("p1") if said.given("p1") is not None else np.array([0.0, 0.0, 1.0])
    height = float(np.linalg.norm(end - start))
    if not radius or not height:
        return np.zeros((4, 4))
    x, y, z = n = (end - start) / height
    sign = 1.0 if z >= 0 else -1.0
    a = -1 / (sign + z)
    s = np.array([1 + sign * x * x * a, sign * x * y * a, -sign * x])
    t = np.array([x * y * a, sign + y * y * a, -y])
    stand = np.eye(4)
    stand[:3] = np.stack([radius * s, radius * t, height * n, start], axis=1)
    placed = np.asarray(to_world @ stand)
    lengths = np.linalg.norm(placed[:3, :3], axis=0)
    cosines = (placed[:3, :3] / lengths).T @ (placed[:3, :3] / lengths) - np.eye(3)
    if np.abs(cosines).max() > 1e-4 or abs(lengths[0] / lengths[1] - 1) > 1e-4:
        wrong = "must not shear it or scale it unevenly across its axis"
        fail(said.element, f'"to_world" of a cylinder {wrong}')
    return placed


def _area_light(element: Element) -> Array:
    if element.attrib["type"] != "area":
        fail(element, f"{described(element)} cannot stand in a <shape>: only area does")
    with Said(element) as said:
        return said.triple("radiance")


def _emitter(element: Element, file: Callable[[str], Path]) -> "PointLight | Sun | Spot | SkyMap | Array":
    """One that is no shape's; the radiance (3,) of a constant one."""
    with Said(element) as said:
        if said.type == "envmap":
            return _sky_map(said, file)
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


def _sky_map(said: Said, file: Callable[[str], Path]) -> SkyMap:
    to_world, path = said.transform("to_world"), file(said.word("filename"))
    if not abs(uniform_scale(to_world, 1e-3) - 1) <= 1e-3:
        fail(said.element, '"to_world" of an environment may only turn or mirror it')
    pixels = said.number("scale") * read_picture(path, raw=False)
    if min(pixels.shape[:2]) < 2 or not (pixels >= 0).all():
        fail(said.element, f"{path}: an environment has 2 x 2 pixels or more, and none is negative")
    axes = to_world[:3, :3].T / np.linalg.norm(to_world[:3, :3], axis=0)[:, None]
    return SkyMap(pixels, axes)


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
    size, start, width, height, weights = _film(only(sensor, "film"))
    lens = focus = 0.0
    moved = [0.0, 0.0]
    with Said(sensor, ("film", "sampler")) as said:  # no sampler changes the mean of a picture
        parallel = said.type == "orthographic"
        half, axis = (1.0, "x") if parallel else _field_of_view(said)
        to_world = said.transform("to_world")
        near, far = said.number("near_clip"), said.number("far_clip")
        if said.type == "perspective":
            moved = [said.number(f"principal_point_offset_{axis}") for axis in "xy"]
        if said.type == "thinlens":
            lens = said.number("aperture_radius")
            focus = said.number("focus_distance") if said.given("focus_distance") is not None else far
    if not parallel and not abs(uniform_scale(to_world, 1e-3) - 1) <= 1e-3:
        fail(sensor, '"to_world" of a sensor must not scale or shear')
    if near >= far:
        fail(sensor, f'"near_clip" is {near:g} and must be less than "far_clip", {far:g}')
    if axis in ("smaller", "larger"):
        axis = "x" if (size[0] <= size[1]) == (axis == "smaller") else "y"
    if axis == "y":
        half *= size[0] / size[1]
    elif axis == "diagonal":
        half *= size[0] / math.hypot(*size)
    shares = width / size[0], height / size[1]
    left, upper = (
        (1 - 2 * (at / whole + by)) / share
        for at, whole, by, share in zip(start, size, moved, shares, strict=True)
    )
    half *= shares[0]
    return Camera(
        to_world, half, width, height, near, far, (left, upper), weights, lens, focus, parallel
    )  # fmt: skip


def _field_of_view(said: Said) -> tuple[float, str]:
    """The tangent of half of it, and the axis of the film that it is along."""
    length = said.given("focal_length")
    if said.given("fov") is not None:
        if length is not None:
            fail(length, '<sensor> has "fov" and "focal_length": write one or the other')
        return math.tan(math.radians(said.number("fov")) / 2), said.word("fov_axis")
    if said.given("fov_axis") is not None:
        fail(said.element, '"fov_axis" goes with "fov", in degrees, which is not given')
    text = said.word("focal_length").removesuffix("mm")
    try:
        millimetres = float(text)
    except ValueError:
        millimetres = 0.0
    if not 1e-6 < millimetres < 1e6:
        fail(said.element, f'"focal_length" = "{text}" is not a number of millimetres, as "50mm" is')
    return math.hypot(36, 24) / (2 * millimetres), "diagonal"


def _film(film: Element | None) -> tuple[tuple[int, int], tuple[int, int], int, int, Filter]:
    """(width, height) of the film, (x, y) where the picture begins in it, the picture's width and height, and
    its filter; without a film Mitsuba's.
    """
    if film is None:
        return (768, 576), (0, 0), 768, 576, Filter("gaussian", 2.0)
    kind, radius = _filter(only(film, "rfilter"))
    with Said(film, ("rfilter",)) as said:
        size = said.integer("width"), said.integer("height")
        x, y = said.integer("crop_offset_x"), said.integer("crop_offset_y")
        width, height = said.integer("crop_width") or size[0], said.integer("crop_height") or size[1]
        border = max(0, math.ceil(radius - 0.5)) if said.flag("sample_border") else 0
    if x + width > size[0] or y + height > size[1]:
        fail(film, f"the crop window, {width} x {height} from ({x}, {y}) on, is not within the film")
    if width * height > 2**28:
        fail(film, f"{width} x {height} pixels are more than 2^28")
    return size, (x, y), width, height, Filter(kind, radius, border)


def _filter(rfilter: Element | None) -> tuple[str, float]:
    """Its kind and radius; Mitsuba's default where there is none."""
    if rfilter is None:
        return "gaussian", 2.0
    with Said(rfilter) as said:
        return said.type, 4 * said.number("stddev") if said.type == "gaussian" else said.number("radius")
