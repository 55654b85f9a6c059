"""A scene as text, as a C++ header or as a Rust module, for a renderer whose scenes are in its source."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from raycheck.base.errors import ReferenceError_
from raycheck.scene.materials import ALPHAS, SHARES, TEXTURED, all_fields

Row = Mapping[str, Any]

VECTOR, NUMBER, INTEGER, FLAG, THREE, NAME = "vector", "number", "integer", "flag", "three", "name"
_SAID = {
    "colour": VECTOR, "three": THREE, "number": NUMBER, "boolean": FLAG, **dict.fromkeys(TEXTURED, VECTOR),
    **dict.fromkeys((*SHARES, *ALPHAS), NUMBER),
}  # fmt: skip


def _kind(said: Row) -> str:
    """Of a field, by what the schema says of it."""
    if "const" in said:
        return NAME
    return _SAID[said["type"] if "type" in said else said["$ref"].rpartition("/")[2]]


_SURFACE = {"material": INTEGER, "radiance": VECTOR}
TABLES: dict[str, tuple[str, dict[str, str]]] = {
    "Material": (
        "materials",
        {
            "type": NAME, "two_sided": FLAG, **{f: _kind(said) for f, said in all_fields().items()},
            "first": INTEGER, "second": INTEGER,
        },
    ),
    "Parallelogram": (
        "parallelograms",
        {
            "corner": VECTOR, "edge_u": VECTOR, "edge_v": VECTOR, "normal": VECTOR, "uv": THREE, **_SURFACE,
        },
    ),
    "Disk": (
        "disks", {"center": VECTOR, "axis_u": VECTOR, "axis_v": VECTOR, "normal": VECTOR, **_SURFACE}
    ),
    "Cylinder": (
        "cylinders", {"p0": VECTOR, "p1": VECTOR, "radius": NUMBER, "inward": FLAG, "axes": THREE, **_SURFACE}
    ),
    "Sphere": ("spheres", {"center": VECTOR, "radius": NUMBER, "inward": FLAG, "axes": THREE, **_SURFACE}),
    "Triangle": (
        "triangles",
        {"vertices": THREE, "normal": VECTOR, "smooth": FLAG, "vertex_normals": THREE, **_SURFACE},
    ),
    "PointLight": ("point_lights", {"position": VECTOR, "intensity": VECTOR}),
    "Sun": ("suns", {"direction": VECTOR, "irradiance": VECTOR}),
    "SpotLight": (
        "spot_lights",
        {
            "position": VECTOR, "axis": VECTOR, "intensity": VECTOR,
            "cutoff_radians": NUMBER, "beam_radians": NUMBER,
        },
    ),
}  # fmt: skip
"""Structures: the name of their array, and their fields."""
_TYPES = {"PointLight": "point light", "Sun": "sun", "SpotLight": "spot light"}
_EMPTY = {VECTOR: [0.0, 0.0, 0.0], NUMBER: 0.0, INTEGER: -1, FLAG: False, NAME: "", THREE: [[0.0] * 3] * 3}


def rows(data: Mapping[str, Any]) -> dict[str, list[Row]]:
    """The scene's tables, by structure; those that it has no use for are empty."""
    result: dict[str, list[Row]] = {"Material": [*_flat_materials(data["materials"])]}
    for structure in TABLES:
        kind = _TYPES.get(structure, structure.lower())
        of_kind = [one for one in (*data["primitives"], *data["lights"]) if one["type"] == kind]
        result.setdefault(structure, [{**one, "smooth": "vertex_normals" in one} for one in of_kind])
    return result


def _flat_materials(materials: Sequence[Row]) -> list[dict[str, Any]]:
    """Parts of blends follow the scene's materials; a blend names them by index."""
    flat = [dict(one) for one in materials]
    for one in flat:  # grows as it goes
        if "parts" in one:
            one["first"], one["second"] = len(flat), len(flat) + 1
            flat += [dict(part) for part in one.pop("parts")]
        if isinstance(one.get("eta"), float):
            one["eta"] = [one["eta"]] * 3
    return flat


@dataclass(frozen=True)
class Language:
    """How its constants look."""

    comment: str
    types: Mapping[str, str]
    flags: tuple[str, str]
    bracket: tuple[str, str]
    struct: Callable[[str, Sequence[tuple[str, str]]], str]
    constant: Callable[[str, str, str], str]
    """The declaration of a constant by name, kind and value."""
    array: Callable[[str, str, Sequence[str]], str]
    record: Callable[[str, Sequence[tuple[str, str]]], str]

    def value(self, value: Any, kind: str) -> str:
        if kind == NAME:
            return f'"{value}"'
        if kind == FLAG:
            return self.flags[bool(value)]
        if kind == INTEGER:
            return str(int(value))
        if kind == NUMBER:
            return repr(float(value))
        inner = VECTOR if kind == THREE else NUMBER
        left, right = self.bracket
        return left + ", ".join(self.value(v, inner) for v in value) + right


def _cpp_field(name: str, kind: str) -> str:
    shape = {VECTOR: "[3]", THREE: "[3][3]"}.get(kind, "")
    return f"{CPP.types[kind]} {name}{shape}"


CPP = Language(
    comment="//",
    types={
        VECTOR: "double", THREE: "double", NUMBER: "double", INTEGER: "int", FLAG: "bool",
        NAME: "const char *",
    },
    flags=("false", "true"),
    bracket=("{", "}"),
    struct=lambda name, fields: f"struct {name} {{ " + " ".join(f"{_cpp_field(*f)};" for f in fields) + " };",
    constant=lambda name, kind, value: f"constexpr {_cpp_field(name, kind)} = {value};",
    array=lambda name, of, values: f"const std::vector<{of}> {name} = {{"
    + "".join(f"\n    {value}," for value in values)
    + ("\n};" if values else "};"),
    record=lambda name, fields: "{" + ", ".join(value for _, value in fields) + "}",
)  # fmt: skip
RUST: Language = Language(
    comment="//",
    types={
        VECTOR: "[f64; 3]", THREE: "[[f64; 3]; 3]", NUMBER: "f64", INTEGER: "i32", FLAG: "bool",
        NAME: "&'static str",
    },
    flags=("false", "true"),
    bracket=("[", "]"),
    struct=lambda name, fields: f"pub struct {name} {{ "
    + " ".join(f"pub {_rust_name(f)}: {RUST.types[kind]}," for f, kind in fields)
    + " }",
    constant=lambda name, kind, value: f"pub const {name.upper()}: {RUST.types[kind]} = {value};",
    array=lambda name, of, values: f"pub static {name.upper()}: &[{of}] = &["
    + "".join(f"\n    {value}," for value in values)
    + ("\n];" if values else "];"),
    record=lambda name, fields: f"{name} {{ "
    + ", ".join(f"{_rust_name(f)}: {value}" for f, value in fields)
    + " }",
)  # fmt: skip


def _rust_name(name: str) -> str:
    return "kind" if name == "type" else name  # a keyword


_CORNERS = ("top_left", "top_right", "bottom_left", "bottom_right")
_SAID_OF_SCENE = {
    "scene", "needs", "max_depth", "roulette_depth", "hide_emitters", "camera", "materials", "primitives",
    "lights", "sky",
}  # fmt: skip
_SAID_OF_CAMERA = {
    "width", "height", "origin", *_CORNERS, "near_clip", "far_clip", "direction", "lens", "filter",
}  # fmt: skip

_TABLES = ("bitmap", "rough plastic")
"""What has more numbers than people would type in."""


def _check(data: Mapping[str, Any]) -> None:
    """ReferenceError_ where the data have more than constants and words say."""
    more = [name for name in data if name not in _SAID_OF_SCENE]
    more += [f"camera's {name}" for name in data["camera"] if name not in _SAID_OF_CAMERA]
    more += [word for word in data["needs"] if word in _TABLES]
    for name in more:
        what = name.replace("_", " ")
        raise ReferenceError_(f"scene {data['scene']}: its {what} can only be written --as json")


def source(data: Mapping[str, Any], language: Language) -> str:
    """Constants of the scene in that language; ReferenceError_ if that cannot say all of it."""
    _check(data)
    heads = [
        f"{language.comment} Scene {data['scene']}: {', '.join(data['needs'])}.",
        f"{language.comment} Directions to the image's corners are interpolated, then normalised.",
        f"{language.comment} Colours are linear. max_depth: 1 emission only, 2 direct light, -1 no limit.",
    ]
    camera = data["camera"]
    constants = [
        language.constant(name, INTEGER, str(value))
        for name, value in (
            ("width", camera["width"]), ("height", camera["height"]),
            ("max_depth", data["max_depth"]), ("roulette_depth", data["roulette_depth"]),
        )
    ] + [
        language.constant(name, VECTOR, language.value(value, VECTOR))
        for name, value in (
            *((n, camera[n]) for n in ("origin", *_CORNERS)),
            ("sky", data["sky"]),
        )
    ] + [
        language.constant(name, kind, language.value(value, kind))
        for name, (kind, value) in _more(camera).items()
    ] + [
        language.constant("near_clip", NUMBER, language.value(camera["near_clip"], NUMBER)),
        language.constant("far_clip", NUMBER, language.value(camera["far_clip"], NUMBER)),
        language.constant("hide_emitters", FLAG, language.value(data["hide_emitters"], FLAG)),
    ]  # fmt: skip
    blocks = []
    for structure, table in rows(data).items():
        array, fields = TABLES[structure]
        records = [
            language.record(
                structure,
                [(f, language.value(row.get(f, _EMPTY[kind]), kind)) for f, kind in fields.items()],
            )
            for row in table
        ]
        blocks += [
            "",
            language.struct(structure, list(fields.items())),
            language.array(array, structure, records),
        ]
    if language is CPP:
        heads += ["#pragma once", "#include <vector>", "", "namespace scene {"]
        blocks += ["", "} // namespace scene"]
    return "\n".join([*heads, "", *constants, *blocks]) + "\n"


def _more(camera: Mapping[str, Any]) -> dict[str, tuple[str, Any]]:
    """What a camera has that is no pinhole, or whose pixels are no squares: kinds and values, by name."""
    lens, weights = camera.get("lens"), camera.get("filter")
    found: dict[str, tuple[str, Any]] = {}
    if "direction" in camera:
        found["direction"] = VECTOR, camera["direction"]
    if lens:
        found |= {f"lens_{name}": (VECTOR, lens[name]) for name in ("axis_u", "axis_v", "view")}
        found["focus_distance"] = NUMBER, lens["focus_distance"]
    if weights:
        found |= {"filter_kind": (NAME, weights["kind"]), "filter_radius": (NUMBER, weights["radius"])}
        found["filter_border"] = INTEGER, weights["border"]
    return found


def text(data: Mapping[str, Any]) -> str:
    """The scene as numbers and words that people can type in; ReferenceError_ if those cannot say all of
    it.
    """
    _check(data)
    camera = data["camera"]
    lines = [
        f"scene {data['scene']}",
        f"needs: {', '.join(data['needs'])}",
        f"depth: {data['max_depth']} (1 emission only, 2 direct light, -1 no limit); "
        f"roulette may begin at {data['roulette_depth']}",
        f"image: {camera['width']} × {camera['height']}, {_filter(camera)}; "
        + (
            "ways from the origin to its outer corners, to be interpolated: where rays start"
            if "direction" in camera
            else "directions to its outer corners, to be interpolated and then normalised"
        )
        + ":",
    ]
    lines += [f"  {name.replace('_', ' '):13}{_words(camera[name])}" for name in ("origin", *_CORNERS)]
    lines += [
        f"  {name.replace('_', ' '):15}{_words(value)}"
        for name, (_, value) in _more(camera).items()
        if not name.startswith("filter")
    ]
    clips = " to ".join(_words(camera[name]) for name in ("near_clip", "far_clip"))
    lines.append(f"the camera sees what is {clips} deep along the view")
    lines += ["the camera does not see shapes that shine, nor the sky"] if data["hide_emitters"] else []
    lines += [f"sky: {_words(data['sky'])} W/(sr m²)"] if any(data["sky"]) else []
    for index, material in enumerate(data["materials"]):
        lines.append(f"material {index}: {_described(material)}")
    for one in (*data["primitives"], *data["lights"]):
        lines.append(_described(one))
    return "\n".join(lines) + "\n"


def _filter(camera: Mapping[str, Any]) -> str:
    weights = camera.get("filter", {"kind": "box", "radius": 0.5, "border": 0})
    size = f" of radius {weights['radius']:g}" if "filter" in camera else ""
    return f"{weights['kind']} filter{size}" + (f", border {weights['border']}" if weights["border"] else "")


def _words(value: Any) -> str:
    if isinstance(value, list) and value and isinstance(value[0], list):
        return "; ".join(_words(v) for v in value)
    if isinstance(value, list):
        return " ".join(f"{v:.9g}" for v in np.asarray(value, dtype=float) + 0.0)
    return f"{value:.9g}" if isinstance(value, float) else str(value).lower()


def _described(one: Mapping[str, Any]) -> str:
    parts = [
        f"{name.replace('_', ' ')} {_words(value)}"
        for name, value in one.items()
        if name not in ("type", "parts")
        and value is not False
        and not (name == "radiance" and not any(value))
    ]
    parts += [f"({_described(part)})" for part in one.get("parts", ())]
    return f"{one['type']}: " + ", ".join(parts)
