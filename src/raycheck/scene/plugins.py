"""What an element of a scene file says, by the tables that oneray reads it by (plugins.json, made by
scripts/make_plugins.py): properties, their kinds, ranges and defaults.

Whatever an element says must be asked for: a property that has no meaning there, or one that nobody asks
for, is an error that names its line, and so nothing that a scene says is passed over in silence.
"""

import functools
import json
import math
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.errors import ReferenceError_
from raycheck.scene.document import Element, place

TABLES = Path(__file__).with_name("plugins.json")

LARGEST = 1e300
CIE = Path(__file__).with_name("cie.json")
_TRIPLES = ("colour", "emission", "reflectance", "vector")
INSTEAD = ("texture", "ref")
"""Elements that may stand for a colour."""
ANY = "*"
"""A field that stands for all others: those change no picture's mean."""
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


def fail(element: Element, message: str) -> NoReturn:
    """One line."""
    raise ReferenceError_(re.sub(r"[\x00-\x1f\x7f]", " ", f"{place(element)}: {message}"))


def described(element: Element) -> str:
    """For a message: <bsdf type="diffuse">."""
    kind = f' type="{element.get("type")}"' if "type" in element.attrib else ""
    return f"<{element.tag}{kind}>"


@functools.cache
def _tables() -> dict[str, Any]:
    found: dict[str, Any] = json.loads(TABLES.read_text(encoding="utf-8"))
    return found


def check_attributes(root: Element) -> None:
    """ReferenceError_ for an attribute that an element cannot have, or lacks.
    Of an element that is not known at all its parent says what it takes.
    """
    for element in root.iter():
        known = _tables()["attributes"].get(element.tag)
        if known is None:
            continue
        for name in element.attrib:
            if name not in (*known["needed"], *known["others"]):
                listed = ", ".join((*known["needed"], *known["others"]))
                fail(element, f'<{element.tag}> has no attribute "{name}" ({listed})')
        for name in known["needed"]:
            if name not in element.attrib:
                fail(element, f'<{element.tag}> lacks the attribute "{name}"')
        if "value" in element.attrib and element.attrib.keys() & {"x", "y", "z"}:
            fail(element, f'<{element.tag}> has both "value" and "x", "y", "z": write one or the other')


def children(element: Element, allowed: Iterable[str]) -> list[Element]:
    """Those of a container of elements that has no properties."""
    for child in element:
        if child.tag not in allowed:
            listed = ", ".join(f"<{tag}>" for tag in allowed) or "none"
            fail(child, f"<{child.tag}> is not supported in {described(element)} ({listed})")
    return list(element)


def only(element: Element, *tags: str) -> Element | None:
    """The only child with one of these tags, or None."""
    found = [child for child in element if child.tag in tags]
    if len(found) > 1:
        fail(found[1], f"a second <{found[1].tag}> in {described(element)}")
    return found[0] if found else None


class Said:
    """An element of a plugin that oneray knows, and what it says; `nested`: the elements that it may hold.

    To be used in `with`: on leaving, what nobody has asked for is an error.
    """

    def __init__(self, element: Element, nested: Iterable[str] = ()):
        self.element = element
        self.type = element.get("type", "")
        plugins = [one for one in _tables()["plugins"] if one["element"] == element.tag]
        table = next((one for one in plugins if self.type in one["types"]), None)
        if table is None:
            listed = ", ".join(name for one in plugins for name in one["types"])
            fail(element, f"{described(element)} is not supported ({listed})")
        self._fields: dict[str, dict[str, Any]] = {field["name"]: field for field in table["fields"]}
        self._given: dict[str, Element] = {}
        self._asked = {name for name, field in self._fields.items() if field["one_value"]}
        for child in element:
            if child.tag not in nested or self.is_share(child):
                self._add(child)
        for name in self._asked:
            self._value(name)

    def is_share(self, child: Element) -> bool:
        """Does it, among elements that hold others, stand for a number: a texture, or a <ref> to one?"""
        kind = self._fields.get(child.get("name", ""), {}).get("kind")
        return child.tag in INSTEAD and kind == "share"

    def _add(self, child: Element) -> None:
        elements = _tables()["elements"]
        name = child.get("name")
        listed = ", ".join(self._fields) or "none"
        known = {tag for tags in elements.values() for tag in tags}.difference(INSTEAD)
        if child.tag not in known.union(*(elements[field["kind"]] for field in self._fields.values())):
            fail(child, f"<{child.tag}> is not supported in {described(self.element)} ({listed})")
        if name is None:
            where = f"{described(child)} in {described(self.element)}"
            fail(child, f'{where} lacks the attribute "name": which property it is ({listed})')
        if name not in self._fields and ANY in self._fields and child.tag in elements["anything"]:
            return
        if name not in self._fields:
            fail(child, f'{described(self.element)} has no property "{name}" ({listed})')
        kind = self._fields[name]["kind"]
        if name in self._given:
            fail(child, f'"{name}" is given twice')
        if child.tag not in elements[kind]:
            wanted = " or ".join(f"<{tag}>" for tag in elements[kind])
            fail(child, f'"{name}" must be given as {wanted}, not as <{child.tag}>')
        if len(child) and kind != "transform" and child.tag not in INSTEAD and "type" not in child.attrib:
            fail(child[0], f"<{child[0].tag}> cannot stand in <{child.tag}>")
        self._given[name] = child

    def __enter__(self) -> "Said":
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        for name, child in self._given.items():
            if kind is None and name not in self._asked:
                fail(child, f'the "{name}" of {described(self.element)} is not supported by raycheck')

    def given(self, name: str) -> Element | None:
        """Where the file says it; that does not count as asking what it says."""
        return self._given.get(name)

    def ignore(self, name: str) -> None:
        """It may say that: nothing that is asked for depends on it."""
        self._asked.add(name)

    def number(self, name: str) -> float:
        return float(self._ask(name, "float", "ior", "share"))

    def integer(self, name: str) -> int:
        return int(self._ask(name, "integer"))

    def flag(self, name: str) -> bool:
        return bool(self._ask(name, "boolean"))

    def word(self, name: str) -> str:
        return str(self._ask(name, "word", "string", "file"))

    def triple(self, name: str) -> Array:
        """(3,) colour, point or vector."""
        return np.asarray(self._ask(name, *_TRIPLES), dtype=np.float64)

    def texture(self, name: str) -> Element | None:
        """The <texture> or <ref> that stands for a colour or a share, if one does."""
        assert self._fields[name]["kind"] in ("reflectance", "share")
        element = self.given(name)
        if element is None or element.tag not in INSTEAD:
            return None
        self._asked.add(name)
        return element

    def transform(self, name: str) -> Array:
        """(4, 4)"""
        return np.asarray(self._ask(name, "transform"), dtype=np.float64)

    def _ask(self, name: str, *kinds: str) -> Any:
        assert self._fields[name]["kind"] in kinds
        self._asked.add(name)
        if (element := self.given(name)) is not None and element.tag in INSTEAD:
            where = f'"{name}" of {described(self.element)}'
            fail(element, f"a texture for the {where} is not supported by raycheck")
        return self._value(name)

    def _value(self, name: str) -> Any:
        field, element = self._fields[name], self._given.get(name)
        kind = field["kind"]
        if element is None and field["default"] is None:
            tag = _tables()["elements"][kind][0]
            fail(self.element, f'{described(self.element)} needs <{tag} name="{name}" value="..."/>')
        if kind == "transform":
            return np.eye(4) if element is None else transform(element)
        if element is None and not field["default"]:
            return np.zeros(3) if kind in _TRIPLES else "" if kind == "string" else 0
        at = self.element if element is None else element
        if kind == "vector" and element is not None:
            return xyz(element)
        by_colour = kind == "share" and at.tag in ("rgb", "spectrum")
        kind = "reflectance" if by_colour else kind
        typed = element is not None and (element.tag == "blackbody" or "type" in element.attrib)
        if element is not None and (typed or (element.tag == "spectrum" and "value" not in element.attrib)):
            value = _lamp(element, kind)
        else:
            text = field["default"] if element is None else element.attrib["value"]
            value = _parsed(at, kind, text, field)
        if by_colour:
            value = (value[0] + value[1] + value[2]) / 3
        if field["range"] and kind != "word":
            for one in np.atleast_1d(value):
                _check_range(at, field, float(one))
        return value


def _parsed(at: Element, kind: str, text: str, field: dict[str, Any]) -> Any:
    """The value of a property that one text gives; `at` is the property, or for a default its element."""
    if kind in ("string", "file"):
        return text
    if kind == "word":
        if text not in field["range"].split(", "):
            fail(at, f'"{field["name"]}" = "{text}" is not supported ({field["range"]})')
        return text
    if kind == "boolean":
        if text.lower() not in ("true", "false"):
            fail(at, f'"{text}" is not a boolean (true or false)')
        return text.lower() == "true"
    if kind == "integer" or at.tag == "integer":
        return _integer(at, text)
    if kind == "ior" and at.tag == "string":
        mediums = _tables()["mediums"]
        if text not in mediums:
            fail(at, f'no medium is called "{text}" ({", ".join(mediums)})')
        return mediums[text]
    if at.tag == "spectrum" and kind in _TRIPLES:
        return _spectrum(at, text, kind)
    if kind in _TRIPLES:
        return _triple(at, "value", text, at.tag != "float")
    return _number(at, text.strip(" "))


def _check_range(at: Element, field: dict[str, Any], value: float) -> None:
    low, high = (float(end) for end in field["range"][1:-1].split(","))
    above = value > low if field["range"][0] == "(" else value >= low
    below = value < high if field["range"][-1] == ")" else value <= high
    if not (above and below):
        fail(at, f'"{field["name"]}" must be in {field["range"]}, not {value:.9g}')


def _number(at: Element, text: str) -> float:
    if not _NUMBER.fullmatch(text):
        fail(at, f'"{text}" is not a number')
    if not abs(float(text)) <= LARGEST:
        fail(at, f"{text} is too large: {LARGEST:g} is the largest number")
    return float(text)


def _integer(at: Element, text: str) -> int:
    if not re.fullmatch(r"-?\d+", text.strip(" ")):
        fail(at, f'"{text}" is not an integer')
    if abs(int(text)) >= 2**31:
        fail(at, f'"{text}" is beyond the range of integers (32 bits)')
    return int(text)


def _triple(at: Element, name: str, text: str, three: bool = True, one: bool = True) -> Array:
    """(3,) of a text with one number or three, as far as they will do."""
    words = re.split(r"[ ,]+", text.strip(" ,"))
    if len(words) not in {3 * three, 1 * one} or not words[0]:
        wanted = "one or three numbers are" if one and three else "three numbers are" if three else "one is"
        fail(at, f'<{at.tag} {name}="{text}">: {wanted} wanted')
    return np.broadcast_to([_number(at, word) for word in words], 3).copy()


def _lamp(at: Element, kind: str) -> Array:
    """(3,) sRGB of <spectrum type="…">, or of Mitsuba 0's <blackbody>."""
    scale = 1.0
    if at.tag == "blackbody":
        scale = _number(at, at.get("scale", "1").strip(" "))
        kelvin = _number(at, at.attrib["temperature"].strip(" ").removesuffix("K").removesuffix("k"))
    elif "type" not in at.attrib:
        fail(at, '<spectrum> lacks the attribute "value"')
    elif "value" in at.attrib:
        fail(at, f'{described(at)} has "type" and "value": write one or the other')
    else:
        with Said(at) as said:
            if said.type != "blackbody":
                return np.full(3, said.number("scale" if said.type == "d65" else "value"))
            kelvin = said.number("temperature")
    if kind != "emission":
        fail(at, f"{described(at)} is light, and no reflectance")
    if not 1 <= kelvin <= 1e6:
        fail(at, f'"temperature" must be in [1,1e6], not {kelvin:g}')
    tables = json.loads(CIE.read_text(encoding="utf-8"))
    first, last = tables["first"], tables["last"]
    wavelengths = first + (np.arange(_STEPS) + 0.5) * (last - first) / _STEPS
    c, h, k, metres = 2.99792458e8, 6.62607015e-34, 1.380649e-23, wavelengths * 1e-9
    light = 2e-9 * h * c**2 / (metres**5 * np.expm1(h * c / (metres * k * kelvin)))
    grid = np.linspace(first, last, len(tables["d65"]))
    xyz = [(np.interp(wavelengths, grid, one) * light).sum() for one in tables["xyz"]]
    rgb = _RGB_OF_XYZ @ xyz * scale * (last - first) * tables["y_normalization"] / _STEPS
    return np.asarray(np.clip(rgb, 0, None), dtype=np.float64)


_RGB_OF_XYZ = np.array(
    [[3.240479, -1.537150, -0.498535], [-0.969256, 1.875991, 0.041556], [0.055648, -0.204043, 1.057311]]
)
_STEPS = 1000
"""Mitsuba's, over the wavelengths of the tables."""


def _spectrum(at: Element, text: str, kind: str) -> Array:
    """(3,) sRGB of "wavelength:value, …" in nm, or of one value for all, as Mitsuba's rgb variants have it:
    of light, or of a surface or medium in the light of D65.
    """
    if ":" not in text and len(re.split(r"[ ,]+", text.strip(" ,"))) == 3:
        return _triple(at, "value", text)  # linear sRGB, as in Mitsuba 0
    if ":" not in text:
        return np.full(3, _number(at, text.strip(" "))) * (
            _RGB_OF_XYZ.sum(axis=1) if kind == "emission" else 1
        )
    pairs = [word.split(":", 1) for word in re.split(r"[ ,]+", text.strip(" ,"))]
    if len(pairs) < 2 or any(len(pair) < 2 for pair in pairs):
        fail(at, "<spectrum> needs pairs wavelength:value, two at least, or one number")
    given, values = np.array([[_number(at, word) for word in pair] for pair in pairs]).T
    if (np.diff(given) <= 0).any():
        fail(at, "<spectrum>: wavelengths must increase")
    tables = json.loads(CIE.read_text(encoding="utf-8"))
    first, last = tables["first"], tables["last"]
    wavelengths = np.linspace(first, last, _STEPS)
    grid = np.linspace(first, last, len(tables["d65"]))
    within = (wavelengths >= given[0]) & (wavelengths <= given[-1])
    seen = np.interp(wavelengths, given, values) * within
    if kind != "emission":
        seen *= np.interp(wavelengths, grid, tables["d65"])
    xyz = [(np.interp(wavelengths, grid, one) * seen).sum() for one in tables["xyz"]]
    rgb = _RGB_OF_XYZ @ xyz * (last - first) * tables["y_normalization"] / _STEPS
    return np.asarray(np.clip(rgb, 0, 1 if kind == "reflectance" else None), dtype=np.float64)


def xyz(element: Element, otherwise: float | None = None) -> Array:
    """(3,) of value="x y z", or of x, y and z apart; `otherwise`: what may be left out."""
    if "value" in element.attrib:
        return _triple(element, "value", element.attrib["value"])
    for axis in "xyz":
        if axis not in element.attrib and otherwise is None:
            fail(element, f'<{element.tag}> lacks the attribute "{axis}" (or write value="x y z")')
    return np.array([_number(element, element.get(axis, str(otherwise)).strip(" ")) for axis in "xyz"])


# ---- transforms


def transform(element: Element) -> Array:
    """The (4, 4) matrix of a <transform>: its operations in order, the first applied first."""
    matrix = np.eye(4)
    for step in element:
        if len(step):
            fail(step[0], f"<{step[0].tag}> cannot stand in <{step.tag}>")
        matrix = _step(step) @ matrix
    lengths = float(np.prod(np.linalg.norm(matrix[:3, :3], axis=0)))
    with np.errstate(all="ignore"):
        flat = not abs(_determinant(matrix)) > 1e-10 * lengths
    if flat or not 2.2250738585072014e-308 <= lengths < math.inf:
        fail(element, "the transform is singular: it makes things flat, or has no inverse in floating point")
    return matrix


def uniform_scale(matrix: Array, tolerance: float) -> float:
    """The factor of a (4, 4) matrix that scales by one; 0 if it shears, or scales by axis."""
    scale = abs(_determinant(matrix)) ** (1 / 3)
    products = matrix[:3, :3].T @ matrix[:3, :3] / scale**2
    return scale if np.all(np.abs(products - np.eye(3)) <= tolerance) else 0.0


def _determinant(matrix: Array) -> float:
    first, second, third = matrix[:3, :3].T
    return float(first @ np.cross(second, third))


def _step(step: Element) -> Array:
    matrix = np.eye(4)
    if step.tag == "translate":
        matrix[:3, 3] = xyz(step, 0.0)
    elif step.tag == "scale":
        matrix[:3, :3] = np.diag(xyz(step, 1.0))
    elif step.tag == "rotate":
        matrix[:3, :3] = _rotation(step)
    elif step.tag == "lookat":
        matrix[:3] = _lookat(step)
    elif step.tag == "matrix":
        numbers = re.split(r"[ ,]+", step.attrib["value"].strip(" ,"))
        if len(numbers) not in (9, 16):
            fail(step, f"<matrix>: 16 numbers are wanted, or 9, not {len(numbers)}")
        side = 4 if len(numbers) == 16 else 3
        matrix[:side, :side] = np.reshape([_number(step, word) for word in numbers], (side, side))
        if np.any(matrix[3] != (0, 0, 0, 1)):
            fail(step, "<matrix>: the last row must be 0 0 0 1")
    else:
        known = "translate, rotate, scale, lookat, matrix"
        fail(step, f"<{step.tag}> is not supported in <transform> ({known})")
    return matrix


def _rotation(step: Element) -> Array:
    """Rodrigues' formula; quarter turns are exact. As in Mitsuba, an axis of any length stays as it is."""
    axis, degrees = xyz(step, 0.0), _number(step, step.attrib["angle"].strip(" "))
    size = float(np.linalg.norm(axis))
    if size == 0:
        fail(step, '<rotate> needs an axis: x, y and z, or value="x y z"')
    cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    if math.fmod(degrees, 90) == 0:
        cosine, sine = round(cosine), round(sine)
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(cosine * np.eye(3) + sine * cross + (1 - cosine) * np.outer(axis, axis))


def _lookat(step: Element) -> Array:
    """(3, 4): left, up, forward and origin."""
    origin, target, up = (
        _triple(step, key, step.attrib.get(key, "0 0 0"), one=False) for key in ("origin", "target", "up")
    )
    with np.errstate(all="ignore"):
        z = (target - origin) / np.linalg.norm(target - origin)
        if not up.any():  # as Mitsuba: the first axis of Duff et al., JCGT 6(1), 2017
            sign = math.copysign(1.0, z[2] + 0.0)
            a = -1 / (sign + z[2])
            up = np.array([1 + sign * z[0] ** 2 * a, sign * z[0] * z[1] * a, -sign * z[0]])
        left = np.cross(up, z)
        left /= np.linalg.norm(left)
    if not np.isfinite([*z, *left]).all():
        fail(step, '<lookat>: the target is the origin, or "up" points along the view')
    return np.stack([left, np.cross(z, left), z, origin], axis=1)
