"""What the properties of a scene's element say, in double precision, once all $names have their values."""

import math

import numpy as np

from raycheck.base.arrays import Array
from raycheck.scene.document import Element


def named(element: Element, name: str) -> Element | None:
    """The child with this name."""
    return next((e for e in element if e.attrib.get("name") == name), None)


def value(element: Element, name: str, default: str) -> str:
    """What the child with this name says, as text."""
    child = named(element, name)
    return default if child is None else child.attrib["value"]


def numbers(text: str) -> Array:
    """(N,), with spaces or commas between."""
    return np.array([float(word) for word in text.replace(",", " ").split()])


def xyz(element: Element, default: float = 0.0) -> Array:
    """(3,) of an element with value="x y z", or with x, y and z apart."""
    if "value" in element.attrib:
        values = numbers(element.attrib["value"])
        return np.broadcast_to(values, 3).copy()
    return np.array([float(element.attrib.get(axis, default)) for axis in "xyz"])


def rgb(element: Element, name: str, default: float) -> Array:
    """(3,) of a colour or of a number."""
    child = named(element, name)
    values = np.array([default]) if child is None else numbers(child.attrib["value"])
    return np.broadcast_to(values, 3).copy()


def transform(element: Element, name: str = "to_world") -> Array:
    """The (4, 4) matrix of a `<transform>`: its operations in order, the first applied first."""
    matrix = np.eye(4)
    transform = named(element, name)
    for step in transform if transform is not None else ():
        matrix = _step(step) @ matrix
    return matrix


def _step(step: Element) -> Array:
    matrix = np.eye(4)
    if step.tag == "translate":
        matrix[:3, 3] = xyz(step)
    elif step.tag == "scale":
        matrix[:3, :3] = np.diag(xyz(step, 1.0))
    elif step.tag == "rotate":
        matrix[:3, :3] = _rotation(xyz(step), math.radians(float(step.attrib["angle"])))
    elif step.tag == "matrix":
        values = numbers(step.attrib["value"])
        size = 4 if values.size == 16 else 3
        matrix[:size, :size] = values.reshape(size, size)
    elif step.tag == "lookat":
        origin, target, up = (numbers(step.attrib[key]) for key in ("origin", "target", "up"))
        forward = (target - origin) / np.linalg.norm(target - origin)
        left = np.cross(up, forward)
        left /= np.linalg.norm(left)
        matrix[:3, :] = np.stack([left, np.cross(forward, left), forward, origin], axis=1)
    else:
        raise ValueError(f"<{step.tag}> in a transform")
    return matrix


def _rotation(axis: Array, angle: float) -> Array:
    """Rodrigues' formula."""
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * (cross @ cross))
