"""The one table of textures: how a scene file says each, and how it is told to others (materials.py)."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from raycheck.base.arrays import Array
from raycheck.scene.document import Element
from raycheck.scene.pictures import read_picture
from raycheck.scene.plugins import Said, described, fail

LUMINANCE = np.array([0.212671, 0.715160, 0.072169])
Row = dict[str, Any]
# What the schema says of fields.
COLOUR, THREE, NUMBER = {"$ref": "#/$defs/colour"}, {"$ref": "#/$defs/three"}, {"type": "number"}
PIXELS: Row = {
    "type": "array", "items": {"type": "array", "items": COLOUR},
    "description": "Rows from the top, where v is 0; the first pixel's middle is half a pixel from its edges",
}  # fmt: skip


@dataclass(frozen=True)
class Texture:
    """`kind` is Mitsuba's type. `to_uv` (4, 4) acts on the surface's (u, v) first. A checkerboard has two
    `colours` (2, 3), by turns in fields half a unit wide; a bitmap `colours` (height, width, 3), a `filter`
    between them and a way to `wrap`, by Mitsuba's names.
    """

    kind: str
    colours: Array
    to_uv: Array
    filter: str = ""
    wrap: str = ""


@dataclass(frozen=True)
class TextureKind:
    """A kind of texture."""

    read: Callable[[Said, Callable[[str], Path]], Texture]
    """The function says where a file is that the scene calls so."""
    told: Callable[[Texture], Row]
    fields: Mapping[str, Row]


def _checkerboard(said: Said, _: Callable[[str], Path]) -> Texture:
    colours = np.stack([said.triple("color0"), said.triple("color1")])
    return Texture("checkerboard", colours, said.transform("to_uv"))


def _told_checkerboard(one: Texture) -> Row:
    return {"color0": one.colours[0].tolist(), "color1": one.colours[1].tolist(), "to_uv": _told_matrix(one)}


def _told_matrix(one: Texture) -> Row:
    rows: Row = np.vstack([one.to_uv[:2, [0, 1, 3]], [0.0, 0, 1]]).tolist()
    return rows


def _bitmap(said: Said, file: Callable[[str], Path]) -> Texture:
    colours = read_picture(file(said.word("filename")), said.flag("raw"))
    if not ((colours >= 0) & (colours <= 1)).all():
        fail(said.element, f"{described(said.element)}: reflectances are in [0,1], and its picture is not")
    between = "nearest" if said.word("filter_type") == "nearest" else "bilinear"  # Mitsuba 0: trilinear
    return Texture("bitmap", colours, said.transform("to_uv"), between, said.word("wrap_mode"))


def _told_bitmap(one: Texture) -> Row:
    return {
        "pixels": one.colours.tolist(), "filter": one.filter, "wrap": one.wrap, "to_uv": _told_matrix(one)
    }  # fmt: skip


TEXTURES: dict[str, TextureKind] = {
    "checkerboard": TextureKind(
        _checkerboard, _told_checkerboard,
        {
            "color0": {**COLOUR, "description": "Where u and v are in the same half of their unit"},
            "color1": {**COLOUR, "description": "Elsewhere"},
            "to_uv": {**THREE, "description": "Matrix that makes of (u, v, 1) the place on the board"},
        },
    ),
    "bitmap": TextureKind(
        _bitmap, _told_bitmap,
        {
            "pixels": PIXELS, "filter": {"enum": ["bilinear", "nearest"]},
            "wrap": {"enum": ["repeat", "mirror", "clamp"], "description": "Outside of (0, 0) to (1, 1)"},
            "to_uv": {**THREE, "description": "Matrix that makes of (u, v, 1) the place on the picture"},
        },
    ),
}  # fmt: skip
"""By Mitsuba's name."""


def read_texture(element: Element, file: Callable[[str], Path]) -> Texture:
    """Of a <texture>; `file` says where one is that the scene calls so."""
    kind = TEXTURES.get(element.attrib["type"])
    with Said(element) as said:
        if kind is None:
            fail(element, f"{described(element)} is not supported by raycheck")
        return kind.read(said, file)


def of_share(one: Texture) -> Texture:
    """As a number has it, in all channels: a picture's luminance; of a checkerboard, as in Mitsuba 3.9.1, the
    means over the channels, and its colours the other way round.
    """
    board = one.kind == "checkerboard"
    grey = one.colours.mean(axis=-1)[::-1] if board else one.colours @ LUMINANCE
    return replace(one, colours=np.repeat(grey[..., None], 3, axis=-1))


def told_texture(name: str, texture: Texture | None) -> Row:
    if texture is None:
        return {}
    row = {"texture": texture.kind, **TEXTURES[texture.kind].told(texture)}
    return {_prefix(name) + key: said for key, said in row.items()}


def _prefix(name: str) -> str:
    return "" if name == "reflectance" else f"{name}_"


def instead(name: str) -> list[Row]:
    """The fields of a texture in the place of a colour, by kind of texture."""
    return [
        {_prefix(name) + key: said for key, said in {"texture": {"const": kind}, **of.fields}.items()}
        for kind, of in TEXTURES.items()
    ]
