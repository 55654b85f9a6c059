"""The one table of materials and textures: how a scene file says each, and how it is told to others.

By it the reader reads, `export` writes, its schema (`scripts/make_schema.py`) and `code` know the fields. A
new kind of material is a function that reads it, one that tells it, and a row of MATERIALS; so with textures.
"""

import functools
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.errors import ReferenceError_
from raycheck.scene.document import Element
from raycheck.scene.properties import named, rgb, transform, value

METALS = Path(__file__).with_name("metals.json")
Row = dict[str, Any]


@dataclass(frozen=True)
class Texture:
    """`kind` is Mitsuba's type. A checkerboard has two `colours` (2, 3), by turns in fields half a unit wide
    of the (u, v) that `to_uv` (4, 4) makes of the surface's.
    """

    kind: str
    colours: Array
    to_uv: Array


@dataclass(frozen=True)
class Material:
    """`kind` is Mitsuba's type; reflectance (3,) diffuse or specular, NaN where it is a `texture`.

    `eta` and `k` (3,): complex index of a conductor, `k` −1 for a perfect mirror; `eta` of a dielectric is
    its inner index over the outer one. `alpha` is the roughness of a rough conductor along dp/du and across.
    A blend has two `parts` and the `weight` of the second. A `two_sided` one looks the same from behind,
    where others are black.
    """

    kind: str
    reflectance: Array
    eta: Array = field(default_factory=lambda: np.zeros(3))
    k: Array = field(default_factory=lambda: np.full(3, -1.0))
    weight: float = 0.0
    parts: tuple["Material", ...] = ()
    two_sided: bool = False
    alpha: tuple[float, float] = (0.0, 0.0)
    texture: Texture | None = None

    @property
    def is_mirror(self) -> bool:
        """A conductor that reflects all."""
        return bool((self.k < 0).all())

    @property
    def wants_uv(self) -> bool:
        """It, or a part of it, depends on the texture coordinates of its surface."""
        own = self.texture is not None or self.alpha[0] != self.alpha[1]
        return own or any(part.wants_uv for part in self.parts)


@dataclass(frozen=True)
class Source:
    """An element, and what else of its scene it may need."""

    element: Element
    inner: Callable[[Element], Material]
    """The material of a <bsdf> or <ref> in it."""
    by_id: Mapping[str, Element]

    def number(self, name: str, default: float) -> float:
        return float(value(self.element, name, str(default)))

    def reflectance(self, name: str, default: float) -> Row:
        """A colour, or a texture instead, as fields of a Material."""
        child = named(self.element, name)
        if child is not None and child.tag == "ref":
            child = self.by_id.get(child.get("id", ""))
            if child is None or child.tag != "texture":
                raise ReferenceError_(f'<ref name="{name}"/>: nothing that has this id is a texture')
        if child is None or child.tag != "texture":
            return {"reflectance": rgb(self.element, name, default)}
        kind = child.get("type", "")
        if kind not in TEXTURES:
            raise ReferenceError_(f'<texture type="{kind}"> is not known ({", ".join(TEXTURES)})')
        return {"reflectance": np.full(3, np.nan), "texture": TEXTURES[kind].read(child)}

    def metal(self) -> tuple[Array, Array]:
        """η and k (3,) of a conductor, by name or as they stand."""
        name = value(self.element, "material", "none")
        if name == "none":
            return rgb(self.element, "eta", 0.0), rgb(self.element, "k", -1.0)
        if name not in _metals():
            raise ReferenceError_(f'<bsdf type="{self.element.attrib["type"]}">: no metal is called "{name}"')
        return np.array(_metals()[name]["eta"]), np.array(_metals()[name]["k"])


@functools.cache
def _metals() -> dict[str, dict[str, list[float]]]:
    """Mitsuba's indices of refraction, by name (scripts/make_metals.py)."""
    found: dict[str, dict[str, list[float]]] = json.loads(METALS.read_text(encoding="utf-8"))
    return found


# What the schema says of fields.
COLOUR, THREE, NUMBER = {"$ref": "#/$defs/colour"}, {"$ref": "#/$defs/three"}, {"type": "number"}
REFLECTANCE: dict[str, Row] = {"reflectance": COLOUR}
METAL: dict[str, Row] = {**REFLECTANCE, "eta": COLOUR, "k": COLOUR}


def _roughness(what: str) -> Row:
    meaning = f"Roughness of GGX microfacets with Smith's separable G{what}"
    return {**NUMBER, "exclusiveMinimum": 0, "description": meaning}


PARTS = {"type": "array", "items": {"$ref": "#/$defs/material"}, "minItems": 2, "maxItems": 2}


@dataclass(frozen=True)
class Kind:
    """A kind of material."""

    read: Callable[[Source], Material]
    told: Callable[[Material], Row]
    """As plain data, with its type."""
    fields: Mapping[str, Mapping[str, Row]]
    """What the schema says of the fields that this has, by type."""


@dataclass(frozen=True)
class TextureKind:
    """A kind of texture."""

    read: Callable[[Element], Texture]
    told: Callable[[Texture], Row]
    fields: Mapping[str, Row]


def _checkerboard(element: Element) -> Texture:
    colours = np.stack([rgb(element, "color0", 0.4), rgb(element, "color1", 0.2)])
    return Texture("checkerboard", colours, transform(element, "to_uv"))


def _told_checkerboard(one: Texture) -> Row:
    rows = np.vstack([one.to_uv[:2, [0, 1, 3]], [0.0, 0, 1]])
    return {"color0": one.colours[0].tolist(), "color1": one.colours[1].tolist(), "to_uv": rows.tolist()}


TEXTURES: dict[str, TextureKind] = {
    "checkerboard": TextureKind(
        _checkerboard, _told_checkerboard,
        {
            "color0": {**COLOUR, "description": "Where u and v are in the same half of their unit"},
            "color1": {**COLOUR, "description": "Elsewhere"},
            "to_uv": {**THREE, "description": "Matrix that makes of (u, v, 1) the place on the board"},
        },
    ),
}  # fmt: skip
"""By Mitsuba's name."""


def _diffuse(of: Source) -> Material:
    return Material("diffuse", **of.reflectance("reflectance", 0.5))


def _conductor(of: Source) -> Material:
    eta, k = of.metal()
    return Material("conductor", **of.reflectance("specular_reflectance", 1.0), eta=eta, k=k)


def _told_metal(one: Material) -> Row:
    return {**_told_reflectance(one), "eta": one.eta.tolist(), "k": one.k.tolist()}


def _told_conductor(one: Material) -> Row:
    if one.is_mirror:
        return {"type": "mirror", **_told_reflectance(one)}
    return {"type": "conductor", **_told_metal(one)}


def _roughconductor(of: Source) -> Material:
    u, v = (max(of.number(name, of.number("alpha", 0.1)), 1e-4) for name in ("alpha_u", "alpha_v"))
    return replace(_conductor(of), kind="roughconductor", alpha=(u, v))


def _told_roughconductor(one: Material) -> Row:
    whole = replace(one, k=np.ones(3)) if one.is_mirror else one  # k 1 reflects all then, as η is 0
    u, v = one.alpha
    if u == v:
        return {"type": "rough conductor", **_told_metal(whole), "alpha": u}
    return {"type": "anisotropic conductor", **_told_metal(whole), "alpha_u": u, "alpha_v": v}


def _dielectric(of: Source) -> Material:
    ratio = of.number("int_ior", 1.5046) / of.number("ext_ior", 1.000277)
    return Material("dielectric", **of.reflectance("specular_reflectance", 1.0), eta=np.full(3, ratio))


def _blend(of: Source) -> Material:
    return Material(
        "blendbsdf",
        np.zeros(3),
        weight=of.number("weight", 0.5),
        parts=tuple(map(of.inner, _inside(of.element))),
    )


def _told_blend(one: Material) -> Row:
    return {"type": "blend", "weight_of_second": one.weight, "parts": [told(part) for part in one.parts]}


def _twosided(of: Source) -> Material:
    parts = [of.inner(element) for element in _inside(of.element)]
    if not parts:
        raise ReferenceError_('a <bsdf type="twosided"> without a <bsdf> in it')
    return replace(parts[0], two_sided=True)


def _inside(element: Element) -> list[Element]:
    return [child for child in element if child.tag in ("bsdf", "ref")]


MATERIALS: dict[str, Kind] = {
    "diffuse": Kind(
        _diffuse, lambda one: {"type": "diffuse", **_told_reflectance(one)}, {"diffuse": REFLECTANCE}
    ),
    "conductor": Kind(_conductor, _told_conductor, {"mirror": REFLECTANCE, "conductor": METAL}),
    "roughconductor": Kind(
        _roughconductor, _told_roughconductor,
        {
            "rough conductor": {**METAL, "alpha": _roughness("")},
            "anisotropic conductor": {
                **METAL, "alpha_u": _roughness(" where u grows"), "alpha_v": _roughness(" across that"),
            },
        },
    ),
    "dielectric": Kind(
        _dielectric, lambda one: {"type": "dielectric", "eta": float(one.eta[0])},
        {"dielectric": {"eta": {**NUMBER, "description": "Index inside over index outside"}}},
    ),
    "blendbsdf": Kind(_blend, _told_blend, {"blend": {"weight_of_second": NUMBER, "parts": PARTS}}),
    "twosided": Kind(_twosided, lambda one: told(one), {}),
}  # fmt: skip
"""By Mitsuba's name."""


def material(
    element: Element, inner: Callable[[Element], Material], by_id: Mapping[str, Element]
) -> Material:
    """Of a <bsdf>; `inner` is that of one inside. One of no known kind has its name and a reflectance."""
    of, kind = Source(element, inner, by_id), element.get("type", "")
    return MATERIALS[kind].read(of) if kind in MATERIALS else replace(_diffuse(of), kind=kind)


def told(one: Material) -> Row:
    """As plain data, which the schema describes."""
    kind = MATERIALS.get(one.kind)
    row = kind.told(one) if kind else {"type": one.kind, **_told_reflectance(one)}
    return {"type": row.pop("type"), "two_sided": one.two_sided, **row}


def _told_reflectance(one: Material) -> Row:
    if one.texture is None:
        return {"reflectance": one.reflectance.tolist()}
    return {"texture": one.texture.kind, **TEXTURES[one.texture.kind].told(one.texture)}


def schema() -> tuple[list[Row], list[Row]]:
    """What a reflectance as plain data may be, one of these; and what a material may be."""
    colour: Row = {"required": ["reflectance"], "properties": {"reflectance": COLOUR}}
    textures: list[Row] = [
        {"required": ["texture", *kind.fields], "properties": {"texture": {"const": name}, **kind.fields}}
        for name, kind in TEXTURES.items()
    ]
    kinds = [_described(name, fields) for kind in MATERIALS.values() for name, fields in kind.fields.items()]
    return [colour, *textures], kinds


def _described(name: str, fields: Mapping[str, Row]) -> Row:
    own = {field: said for field, said in fields.items() if field not in REFLECTANCE}
    row: Row = {"required": [*own], "properties": {"type": {"const": name}, **own}}
    return row | ({"$ref": "#/$defs/reflectance"} if own.keys() != fields.keys() else {})


def all_fields() -> dict[str, Row]:
    """What the schema says of the fields that materials may have, in their order, without a blend's parts."""
    kinds = [fields for kind in MATERIALS.values() for fields in kind.fields.values()]
    textures = [{"texture": {"type": "string"}}, *(kind.fields for kind in TEXTURES.values())]
    found: dict[str, Row] = {}
    for fields in (*kinds, *textures):
        for name, said in fields.items():
            found.setdefault(name, said)
    return {name: said for name, said in found.items() if said is not PARTS}
