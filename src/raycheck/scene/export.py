"""What a renderer without an XML parser needs of a scene: every primitive in world space, as numbers.

The JSON has a schema, `scene.schema.json`. Rectangles, and the six faces of a cube, are parallelograms p =
corner + s edge_u + t edge_v with 0 ≤ s, t ≤ 1; meshes are triangles. A primitive shines along `normal` only,
and reflects there only unless its material is `two_sided`; a sphere's normal points outwards unless `inward`.
Where its material depends on (u, v), a parallelogram has them at its corner and the ends of its edges, linear
in between, and a sphere its axes x, y, z: u is the angle around z from x in turns, v that from +z in half
turns. Of a disk u is the distance from the center in radii, v the angle from axis_u to axis_v in turns. A
cylinder's wall is open at both ends; its normal points outwards unless `inward`, u is the angle around the
way from p0 to p1 in turns, from axis x on towards y, v is 0 at p0 and 1 at p1. Radiance is in W·sr⁻¹·m⁻², a
point light's intensity in W/sr, a sun's irradiance in W/m². Camera rays meet what is between `near_clip` and
`far_clip` deep along the view. Pixel (i, j) of a `sky_map`, W × H pixels and linear in between, is seen (i +
½)/W of a turn from −z towards x and j/(H − 1) of a half turn from y, of its `axes`. Without a `filter` a
pixel is the mean over its own square. With a `lens`, rays start at the origin + s axis_u + t axis_v, s² + t²
≤ 1, uniform by area, and go to where that from the origin is `focus_distance` deep; depths are along `view`.
With a `direction` rays are in parallel: they start at the origin + what is interpolated between the corners,
and end at `far_clip`.
"""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raycheck.base.arrays import Array
from raycheck.base.errors import ReferenceError_
from raycheck.scene.materials import Material, told
from raycheck.scene.meshes import read_mesh
from raycheck.scene.reader import Camera, Scene, Shape, read_scene
from raycheck.scene.variants import Variant

SCHEMA = Path(__file__).with_name("scene.schema.json")

_FACES = [
    np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]]), np.array([[0, 0, -1], [-1, 0, 0], [0, 1, 0]]),
    np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1]]), np.array([[-1, 0, 0], [0, -1, 0], [0, 0, 1]]),
    np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]]), np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]]),
]  # fmt: skip
"""Of the cube −1…1: middle (also the normal), half an edge u, half an edge v."""


_CUBE_UV = [
    np.array(axes, dtype=float)
    for axes in (
        ((0, 1, 0), (1, 0, 0)), ((0, -1, 0), (1, 0, 0)), ((0, 1, 0), (0, 0, -1)), ((0, 1, 0), (0, 0, 1)),
        ((-1, 0, 0), (0, 0, -1)), ((0, 0, 1), (1, 0, 0)),
    )
]  # fmt: skip
"""Where u and v grow on these faces, Mitsuba's."""


def export(of: Variant) -> dict[str, Any]:
    """The scene as plain data that the schema describes; ReferenceError_ where it, or a mesh, says something
    that the data could not.
    """
    scene = read_scene(of.path, of.parameters)
    materials: list[Material] = []
    primitives: list[dict[str, Any]] = []
    for shape in scene.shapes:
        index = next((i for i, one in enumerate(materials) if one is shape.material), len(materials))
        if index == len(materials):
            materials.append(shape.material)
        for one in _primitives(shape):
            primitives.append({**one, "material": index, "radiance": _numbers(shape.radiance)})
    data = {
        "scene": of.label, "max_depth": scene.max_depth, "roulette_depth": scene.roulette_depth,
        "hide_emitters": scene.hide_emitters, "camera": _camera(scene.camera),
        "materials": [told(one) for one in materials], "primitives": primitives,
        "lights": _lights(scene), "sky": _numbers(scene.sky),
    }  # fmt: skip
    if scene.sky_map is not None:
        around = scene.sky_map
        data["sky_map"] = {"pixels": _numbers(around.radiance), "axes": _numbers(around.axes)}
    return {**data, "needs": needs(data)}


def to_json(data: dict[str, Any]) -> str:
    """One line for each material and primitive."""
    lines = []
    for key, value in data.items():
        if key in ("materials", "primitives", "lights") and value:
            rows = ",\n  ".join(json.dumps(row, ensure_ascii=False) for row in value)
            lines.append(f' "{key}": [\n  {rows}\n ]')
        else:
            lines.append(f' "{key}": {json.dumps(value, ensure_ascii=False)}')
    return "{\n" + ",\n".join(lines) + "\n}\n"


def needs(data: dict[str, Any]) -> list[str]:
    """What a renderer must support to render it."""
    words = sorted({p["type"] for p in data["primitives"]} | {light["type"] for light in data["lights"]})
    words += sorted({kind for m in data["materials"] for kind in _kinds(m)})
    if any(any(p["radiance"]) for p in data["primitives"]):
        words.append("area light")
    if any(data["sky"]):
        words.append("sky")
    if "sky_map" in data:
        words.append("environment map")
    words += [word for name, word in CAMERA_WORDS.items() if name in data["camera"]]
    depth = data["max_depth"]
    words.append("bounces without limit" if depth == -1 else f"paths of {depth} segments")
    return words


CAMERA_WORDS = {"filter": "reconstruction filter", "lens": "thin lens", "direction": "orthographic camera"}
"""What a camera needs that has it."""


def _kinds(material: dict[str, Any]) -> set[str]:
    inner = set().union(*(_kinds(part) for part in material.get("parts", ())))
    textures = {value for name, value in material.items() if name.endswith("texture")}
    return inner | textures | {material["type"]} | ({"two-sided"} if material["two_sided"] else set())


def _numbers(values: Array) -> list[Any]:
    result: list[Any] = np.asarray(values, dtype=np.float64).tolist()
    return result


def _camera(camera: Camera) -> dict[str, Any]:
    """Origin, and directions to the image's corners, on one plane, so that those between are interpolated: of
    length 1, or of mean length 1 where the view's axis is not in the middle. Without perspective the ways
    from the origin to the corners, where rays start.
    """
    x, y = np.array([0.0, camera.width, 0, camera.width]), np.array([0.0, 0, camera.height, camera.height])
    ways, origin, near, far = camera.ways(x, y), camera.origin, camera.near_clip, camera.far_clip
    ways = ways / np.linalg.norm(ways, axis=-1).mean()
    view = _unit(camera.to_world[:3, 2])
    more: dict[str, Any] = {}
    if camera.parallel:
        origin = camera.starts(x, y).mean(axis=0)
        ways, near, far = camera.starts(x, y) - origin, 0.0, far - near
        more = {"direction": view}
    elif not camera.is_pinhole:
        axes = (
            camera.to_world[:3, :2] / np.linalg.norm(camera.to_world[:3, :2], axis=0) * camera.aperture_radius
        )
        more = {
            "lens": {
                "axis_u": _numbers(axes[:, 0]), "axis_v": _numbers(axes[:, 1]),
                "focus_distance": camera.focus_distance, "view": view,
            }
        }  # fmt: skip
    names = ("top_left", "top_right", "bottom_left", "bottom_right")
    return {
        "width": camera.width,
        "height": camera.height,
        "origin": _numbers(origin),
        **{name: _numbers(way) for name, way in zip(names, ways, strict=True)},
        "near_clip": near,
        "far_clip": far,
        **more,
        **({} if camera.filter.is_pixel else {"filter": asdict(camera.filter)}),
    }


def _lights(scene: Scene) -> list[dict[str, Any]]:
    points = [
        {"type": "point light", "position": _numbers(p.position), "intensity": _numbers(p.intensity)}
        for p in scene.point_lights
    ]
    suns = [
        {"type": "sun", "direction": _numbers(s.direction), "irradiance": _numbers(s.irradiance)}
        for s in scene.suns
    ]
    spots = [
        {
            "type": "spot light", "position": _numbers(s.position), "axis": _numbers(s.axis),
            "intensity": _numbers(s.intensity), "cutoff_radians": s.cutoff, "beam_radians": s.beam,
        }
        for s in scene.spots
    ]  # fmt: skip
    return points + suns + spots


def _primitives(shape: Shape) -> list[dict[str, Any]]:
    linear, place = shape.to_world[:3, :3], shape.to_world[:3, 3]
    sign = -1.0 if shape.flipped else 1.0
    if shape.kind == "sphere":
        radius = float(np.linalg.norm(linear[:, 0]))
        return [
            {
                "type": "sphere", "center": _numbers(place), "radius": radius, "inward": shape.flipped,
                **({"axes": _numbers(linear.T / radius)} if shape.material.wants_uv else {}),
            }
        ]  # fmt: skip
    if shape.kind == "cylinder":
        radius = float(np.linalg.norm(linear[:, 0]))
        return [
            {
                "type": "cylinder", "p0": _numbers(place), "p1": _numbers(place + linear[:, 2]),
                "radius": radius,
                "inward": shape.flipped,
                **({"axes": [_unit(axis) for axis in linear.T]} if shape.material.wants_uv else {}),
            }
        ]  # fmt: skip
    normals = np.asarray(np.linalg.inv(linear).T, dtype=np.float64)
    if shape.kind == "disk":
        axes = {"center": _numbers(place), "axis_u": _numbers(linear[:, 0]), "axis_v": _numbers(linear[:, 1])}
        return [{"type": "disk", **axes, "normal": _unit(sign * normals[:, 2])}]
    if shape.kind in ("rectangle", "cube"):
        faces = _FACES if shape.kind == "cube" else [_FACES[0] * [[0], [1], [1]]]
        uv = _CUBE_UV if shape.kind == "cube" else [np.eye(3)]
        return [
            {
                "type": "parallelogram",
                "corner": _numbers(place + linear @ (middle - u - v)),
                "edge_u": _numbers(2 * linear @ u),
                "edge_v": _numbers(2 * linear @ v),
                "normal": _unit(sign * normals @ np.cross(u, v)),
                **({"uv": _corners_uv(u, v, middle, along)} if shape.material.wants_uv else {}),
            }
            for (middle, u, v), along in zip(faces, uv, strict=True)
        ]
    return _triangles(shape, sign)


def _corners_uv(u: Array, v: Array, middle: Array, along: Array) -> list[Any]:
    """(u, v, 0) at the corner of a face of the unit shape and the ends of its edges: 0.5 in its middle."""
    places = np.stack([-u - v, u - v, v - u]) + middle
    return _numbers(np.hstack([places @ along[:2].T / 2 + 0.5, np.zeros((3, 1))]))


def _unit(vector: Array) -> list[float]:
    return _numbers(vector / np.linalg.norm(vector))


def _triangles(shape: Shape, sign: float) -> list[dict[str, Any]]:
    """Those that have an area. Vertex normals that the file lacks are the mean of the triangles', each by its
    angle (Thürmer & Wüthrich, Computing Vertex Normals from Polygonal Facets, JGT 3(1), 1998); where
    they point to the other side of a triangle, as after a mirroring, it is turned.
    """
    if shape.mesh is None:
        raise ReferenceError_(f"<shape type={shape.kind!r}> cannot be written as primitives")
    mesh = read_mesh(shape.mesh, shape.kind, shape.shape_index)
    linear, place = shape.to_world[:3, :3], shape.to_world[:3, 3]
    corners = (mesh.vertices @ linear.T + place)[mesh.faces]
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    some = flat.any(axis=1)
    if not some.any():
        raise ReferenceError_(f"{shape.mesh}: none of the {len(flat)} triangles has an area")
    faces, corners = mesh.faces[some], corners[some]
    flat = sign * flat[some] / np.linalg.norm(flat[some], axis=1, keepdims=True)
    smooth = None
    if not shape.face_normals:
        if mesh.normals is None:
            smooth = _mean_normals(len(mesh.vertices), faces, corners, flat)
        else:
            smooth = sign * _normalised(mesh.normals) @ np.linalg.inv(linear)
        smooth = _normalised(smooth)[faces]
        if not np.isfinite(smooth).all():
            raise ReferenceError_(f"{shape.mesh}: a vertex has a normal that is no number")
        flat *= np.where((smooth * flat[:, None]).sum(axis=(1, 2)) < 0, -1.0, 1.0)[:, None]
    rows = [
        {"type": "triangle", "vertices": _numbers(three), "normal": _numbers(normal)}
        for three, normal in zip(corners, flat, strict=True)
    ]
    if smooth is not None:
        for row, normals in zip(rows, smooth, strict=True):
            row["vertex_normals"] = _numbers(normals)
    return rows


def _mean_normals(count: int, faces: NDArray[np.int64], corners: Array, flat: Array) -> Array:
    """(count, 3), not of unit length."""
    result = np.zeros((count, 3))
    for k in range(3):
        a, b = (corners[:, (k + step) % 3] - corners[:, k] for step in (1, 2))
        angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1))
        np.add.at(result, faces[:, k], angle[:, None] * flat)
    return result


def _normalised(vectors: Array) -> Array:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(lengths > 0, lengths, 1.0))
