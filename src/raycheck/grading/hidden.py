"""Variants: the task's scene from another place and in other light: no stored picture passes. Hidden ones no
student sees; of a pool each student gets one to hand in pictures of.

The camera is turned about what it looks at and each light's colour is scaled; where both go to is decided by
the secret. The reference is oneray's, made once and kept with the scene.
"""

import math
from dataclasses import replace
from pathlib import Path

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
DIMMEST, BRIGHTEST = 0.7, 1.4
"""Factors of each channel of a light."""
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
    for step, values in zip(*(r.findall("./sensor/transform/lookat") for r in (root, said)), strict=True):
        origin, target, up = (
            np.array([float(word) for word in values.get(key, "").replace(",", " ").split()])
            for key in ("origin", "target", "up")
        )
        turn = LEAST_TURN + (MOST_TURN - LEAST_TURN) * keys.fraction(f"{purpose}/turn")
        side = 1 if keys.fraction(f"{purpose}/side") < 0.5 else -1
        moved = target + _turned(origin - target, up, side * turn)
        step.set("origin", ", ".join(f"{x:.6g}" for x in moved))
    for number, emitters in enumerate(zip(root.iter("emitter"), said.iter("emitter"), strict=True)):
        for colour, values in zip(*(e.findall("rgb") for e in emitters), strict=True):
            light = np.array([float(word) for word in values.get("value", "").replace(",", " ").split()])
            scales = [
                DIMMEST + (BRIGHTEST - DIMMEST) * keys.fraction(f"{purpose}/light {number}/{c}")
                for c in range(3)
            ]
            scaled = np.broadcast_to(light, 3) * scales
            colour.set("value", ", ".join(f"{x:.6g}" for x in scaled))
    return document.text(root)


def _turned(vector: Array, axis: Array, angle: float) -> Array:
    """The vector turned about an axis, by Rodrigues' formula."""
    k = axis / np.linalg.norm(axis)
    return (
        vector * math.cos(angle)
        + np.cross(k, vector) * math.sin(angle)
        + k * (k @ vector) * (1 - math.cos(angle))
    )
