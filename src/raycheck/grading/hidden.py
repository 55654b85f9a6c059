"""Variants: the task's scene from another place and in other light: no stored picture passes. Hidden ones no
student sees; of a pool each student gets one to hand in pictures of.

The camera is turned about what it looks at, raised and its view widened; colours of lights and reflectances
are scaled, point lights moved, long paths made shorter, bodies and lamps smaller, along each edge by a factor
of its own, and moved within where they were: more than could be interpolated from stored pictures. Where it
all goes to is decided by the secret. The reference is oneray's, made once and kept with the scene.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.errors import ReferenceError_
from raycheck.base.files import one_process
from raycheck.base.machine import cores
from raycheck.grading.keys import Keys
from raycheck.renderers.oneray import oneray_command, oneray_path
from raycheck.scene import document, variants
from raycheck.scene.techniques import BEST, technique
from raycheck.scene.variants import Variant
from raycheck.truth import making, references

LEAST_TURN, MOST_TURN = math.radians(6), math.radians(16)
MOST_RISE = math.radians(6)
NARROWEST, WIDEST = 0.85, 1.1
"""Factors of the field of view."""
DIMMEST, BRIGHTEST = 0.7, 1.4
"""Factors of each channel of a light, …"""
DARKEST, LIGHTEST, WHITEST = 0.7, 1.15, 0.95
"""… and of a reflectance, which stays below the last or where it was."""
SMALLEST = 0.7
"""Factor of the size of bodies and lamps."""
MOST_SHIFT = 0.12
"""Of a point light along each axis, over its distance from the origin."""
LONG = 4
"""Segments of a limit of the path's length that is varied."""
SIMILAR = 0.3
"""The mean of a variant may not fall below this share of the original's: nothing is to be seen then."""
GOAL = making.Goal(
    image=0.02, tile=0.1, checked_tile=0.1, spp_per_batch=64, most_seconds=60.0
)  # fmt: skip
"""Standard errors of a reference over the assignment's delta: hardly a verdict is wider for them."""
TRIES = 8
LOOK_SPP = 64


def hidden_variants(of: Variant, count: int, keys: Keys, folder: Path, delta: float) -> list[Variant]:
    """`count` variants with their references, in `folder`; made where they are missing, stale or too coarse
    for `delta`.
    """
    made = [
        _scene_file(of, f"{of.label}/{index}", f"hidden{index + 1}", keys, folder) for index in range(count)
    ]
    return [_with_reference(one, delta) for one in made]


def pool_index(of: Variant, student: str, count: int, keys: Keys) -> int:
    """The number of a student's variant in the pool: HMAC(secret, student) modulo `count`."""
    return keys.number(f"{of.label}/pool/{student}", hidden=True) % count


def pool_variant(of: Variant, index: int, keys: Keys, folder: Path) -> Variant:
    """One of the pool, made where it is missing; without a reference."""
    with one_process(folder):
        return _scene_file(of, f"{of.label}/pool {index}", f"pool{index + 1}", keys, folder)


def with_reference(made: Variant, delta: float) -> Variant:
    """The same, its reference made where it is missing, by one process at a time."""
    with one_process(made.path.parent):
        return _with_reference(made, delta)


def _scene_file(of: Variant, purpose: str, name: str, keys: Keys, folder: Path) -> Variant:
    """The first variation that shows enough light; one that has a reference has been looked at."""
    path = folder / f"{of.label.replace('=', '-').replace('@', '-')}-{name}.xml"
    texts = [vary(of, f"{purpose}/{attempt}", keys) for attempt in range(TRIES)]
    if path.is_file() and path.read_text(encoding="utf-8") in texts:
        made = variants.variant(path)
        if references.is_fresh(made):
            return made
    least = SIMILAR * references.load_reference(of).mean.mean()
    for text in texts:
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            _copy_meshes(of, folder)
            path.write_text(text, encoding="utf-8")
        made = variants.variant(path)
        if look_at(made).mean() > least:
            return made
    raise ReferenceError_(f"{of.label}: no variant shows enough light")


def look_at(of: Variant) -> Array:
    """A picture (H, W, 3) with some noise, in no time."""
    command = oneray_command(oneray_path(), technique(BEST).options, of.parameters)
    return command.render(of.path, LOOK_SPP, 0, 600.0).image.pixels


def _with_reference(made: Variant, delta: float) -> Variant:
    goal = replace(GOAL, image=GOAL.image * delta, tile=GOAL.tile * delta)
    if not (references.is_fresh(made) and references.require(made).get("image_goal", 1.0) <= goal.image):
        renderer = making.OnerayBatches(made, cores())
        plan = making.make_plan(renderer, goal)
        making.make_reference(made, renderer, plan, goal)
    return made


def _copy_meshes(of: Variant, folder: Path) -> None:
    for name in of.document().names():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes((of.path.parent / name).read_bytes())


def vary(of: Variant, purpose: str, keys: Keys) -> str:
    """The scene file of a variant."""
    root, said = of.document().root, of.document().resolved()
    both = list(zip(root.iter(), said.iter(), strict=True))
    chosen = _Chosen(purpose, keys)
    _vary_camera(both, chosen)
    _vary_depth(root, said, chosen)
    within = {id(rgb) for _, light in both if light.tag == "emitter" for rgb in light.iter("rgb")}
    for number, (element, values) in enumerate(both):
        name = values.get("name", "")
        if element.tag == "rgb" and id(values) in within:
            _scale_colour(element, values, chosen, f"light {number}", (DIMMEST, BRIGHTEST), math.inf)
        elif element.tag == "rgb" and name.endswith("reflectance"):
            _scale_colour(element, values, chosen, f"reflectance {number}", (DARKEST, LIGHTEST), WHITEST)
        elif element.tag == "point" and name == "position":
            place = _numbers(values.get("value", ""))
            shift = [chosen.between(-MOST_SHIFT, MOST_SHIFT, f"place {number}/{axis}") for axis in "xyz"]
            element.set("value", _written(place + np.linalg.norm(place) * np.array(shift)))
        elif element.tag == "shape" and _may_shrink(values):
            _shrink_and_move(element, values, chosen, str(number))
    return document.text(root)


@dataclass(frozen=True)
class _Chosen:
    """What the secret decides."""

    purpose: str
    keys: Keys

    def between(self, low: float, high: float, what: str) -> float:
        return low + (high - low) * self.keys.fraction(f"{self.purpose}/{what}")

    def side(self, what: str) -> int:
        return 1 if self.keys.fraction(f"{self.purpose}/{what}") < 0.5 else -1


def _vary_camera(both: Sequence[tuple[Element, Element]], chosen: _Chosen) -> None:
    """Turn it about what it looks at, raise or lower it, and widen or narrow what it sees."""
    for element, values in both:
        if element.tag == "lookat":
            origin, target, up = (_numbers(values.get(key, "")) for key in ("origin", "target", "up"))
            turn = chosen.side("side") * chosen.between(LEAST_TURN, MOST_TURN, "turn")
            sight = _turned(origin - target, up, turn)
            across = np.cross(sight, up)
            if np.linalg.norm(across) > 0:
                sight = _turned(sight, across, chosen.between(-MOST_RISE, MOST_RISE, "rise"))
            element.set("origin", _written(target + sight))
        elif element.tag == "float" and values.get("name") == "fov":
            scale = chosen.between(NARROWEST, WIDEST, "fov")
            element.set("value", f"{float(values.get('value', '')) * scale:.6g}")


def _vary_depth(root: Element, said: Element, chosen: _Chosen) -> None:
    """A long limit becomes a shorter one; those of one bounce or two are the task itself."""
    for element, values in zip(root.iter("integer"), said.iter("integer"), strict=True):
        depth = int(values.get("value", "0"))
        if values.get("name") == "max_depth" and depth >= LONG:
            element.set("value", str(int(chosen.between((depth + 1) // 2, depth, "depth"))))


def _scale_colour(
    element: Element, values: Element, chosen: _Chosen, what: str, scales: tuple[float, float], most: float
) -> None:  # fmt: skip
    colour = np.broadcast_to(_numbers(values.get("value", "")), 3)
    scaled = [x * chosen.between(*scales, f"{what}/{c}") for c, x in enumerate(colour)]
    element.set("value", _written(np.minimum(scaled, np.maximum(colour, most))))


def _may_shrink(shape: Element) -> bool:
    """Lamps and bodies, which stand free where they stood. Walls stay, and what is around all."""
    inward = any(flag.get("name") == "flip_normals" for flag in shape.findall("boolean"))
    kind, lamp = shape.get("type"), shape.find("emitter") is not None
    return not inward and (kind in ("cube", "sphere") or (lamp and kind in ("rectangle", "disk")))


def _shrink_and_move(element: Element, values: Element, chosen: _Chosen, what: str) -> None:
    """In its own space, so that it stays within its old surface, and a flat one in its plane: nothing meets
    it that did not. Squares become rectangles and cubes boxes; what is round stays so.
    """
    kind = element.get("type")
    scale = [chosen.between(SMALLEST, 1.0, f"size {what}{axis}") for axis in ("", "/y", "/z")]
    room = math.sqrt({"sphere": 1 / 3, "disk": 1 / 2}.get(kind or "", 1.0))
    if room < 1:
        scale = scale[:1] * 3
    flat = kind in ("rectangle", "disk")
    move = [
        0.0 if flat and axis == "z" else room * (1 - s) * chosen.between(-1, 1, f"move {what}/{axis}")
        for s, axis in zip(scale, "xyz", strict=True)
    ]
    if kind == "sphere" and (radius := _named(values, "radius")) is not None:
        size, said = float(radius.get("value", "")), _named(values, "center")
        centre = np.zeros(3) if said is None else _point(said)
        for name in ("radius", "center"):
            if (old := _named(element, name)) is not None:
                element.remove(old)
        element.insert(0, Element("float", {"name": "radius", "value": f"{size * scale[0]:.6g}"}))
        moved = _written(centre + size * np.array(move))
        element.insert(0, Element("point", {"name": "center", "value": moved}))
    elif (transform := element.find("transform")) is not None:
        transform.insert(0, Element("translate", dict(zip("xyz", (f"{x:.6g}" for x in move), strict=True))))
        transform.insert(0, Element("scale", dict(zip("xyz", (f"{s:.6g}" for s in scale), strict=True))))


def _named(shape: Element, name: str) -> Element | None:
    """A property of a shape."""
    return next((one for one in shape if one.get("name") == name), None)


def _point(said: Element) -> Array:
    if text := said.get("value"):
        return np.broadcast_to(_numbers(text), 3)
    return np.array([float(said.get(axis, "0")) for axis in "xyz"])


def _numbers(text: str) -> Array:
    return np.array([float(word) for word in text.replace(",", " ").split()])


def _written(values: Array) -> str:
    return ", ".join(f"{x:.6g}" for x in values)


def _turned(vector: Array, axis: Array, angle: float) -> Array:
    """The vector turned about an axis, by Rodrigues' formula."""
    k = axis / np.linalg.norm(axis)
    return (
        vector * math.cos(angle)
        + np.cross(k, vector) * math.sin(angle)
        + k * (k @ vector) * (1 - math.cos(angle))
    )
