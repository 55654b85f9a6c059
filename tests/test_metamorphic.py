"""What must hold between pictures, whatever the picture is: no reference is needed to see it broken.

The statistical relations compare two pictures with seeds of their own, over the whole image and its
quarters, by their standard errors: 15 numbers, each beyond 5.5 once in 26 million for a normal
distribution, so that all of this file gives a false alarm once in some thousand changes of the seeds.
"""

from __future__ import annotations

import subprocess
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from raycheck.base.images import Image, load_image
from raycheck.scene import variants
from raycheck.scene.content import read_content
from raycheck.scene.techniques import applicable, technique

SCENES = variants.scene_names()
LIGHT = ("radiance", "intensity", "irradiance")
BEYOND = 5.5


def render(oneray: Path, scene: Path, target: Path, *options: object) -> Image:
    subprocess.run([oneray, scene, "-o", target, *map(str, options)], check=True)
    return load_image(target)


def emissions(root: ElementTree.Element) -> Iterator[ElementTree.Element]:
    """The elements that say how much light an emitter gives, one of each emitter."""
    for emitter in root.iter("emitter"):
        yield from (child for child in emitter if child.get("name") in LIGHT)


def settings(root: ElementTree.Element) -> dict[str, str]:
    return {f"${d.get('name')}": d.get("value", "") for d in root.iter("default")}


def scale_light(root: ElementTree.Element, factor: float, only: int | None = None) -> None:
    """Multiplies the emission of light number `only`, or of all."""
    values = settings(root)
    for index, element in enumerate(emissions(root)):
        if only is None or index == only:
            text = values.get(element.get("value", ""), element.get("value", ""))
            numbers = [float(word) * factor for word in text.replace(",", " ").split()]
            element.set("value", ", ".join(map(repr, numbers)))


def write(root: ElementTree.Element, scene: Path, target: Path) -> Path:
    """The scene as a file, its meshes by their full paths."""
    for string in root.iter("string"):
        if string.get("name") == "filename":
            string.set("value", str((scene.parent / string.get("value", "")).resolve()))
    ElementTree.ElementTree(root).write(target)
    return target


def differences(a: Image, b: Image) -> np.ndarray:
    """(regions, 3) difference of the means of the image and of its quarters, in standard errors; what varies
    in neither picture may differ by 1e-5 of its value.
    """
    height, width = a.pixels.shape[:2]
    halves = [(slice(0, n // 2), slice(n // 2, n)) for n in (height, width)]
    windows = [(slice(None), slice(None)), *((y, x) for y in halves[0] for x in halves[1])]
    result = []
    for window in windows:
        means = [image.pixels[window].mean(axis=(0, 1)) for image in (a, b)]
        pixels = a.pixels[window][..., 0].size
        squares = sum((image.stderr[window] ** 2).sum(axis=(0, 1)) for image in (a, b)) / pixels**2
        floor = 1e-6 * np.abs(means[0]) + 1e-30
        result.append((means[0] - means[1]) / np.sqrt(squares + floor**2))
    return np.array(result)


def techniques(scene: Path) -> list[str]:
    """Some of those that apply: one of each estimator, and the most elaborate."""
    wanted = (
        "walk-cosine",
        "nee",
        "nee-contribution",
        "mis-balance",
        "mis-default",
        "mis-survival",
        "mis-learned",
    )
    return [one.name for one in applicable(read_content(scene)) if one.name in wanted]


@pytest.mark.parametrize("name", SCENES)
def test_twice_the_light_is_twice_the_picture(oneray: Path, scene, tmp_path: Path, name: str) -> None:
    """To the last bit: a power of two changes no rounding, and nothing that a path does depends on it."""
    file = scene(name)
    root = ElementTree.parse(file).getroot()
    scale_light(root, 2.0)
    doubled = write(root, file, tmp_path / "doubled.xml")
    for one in techniques(file):
        options = ("--spp", 4, *technique(one).options)
        once = render(oneray, file, tmp_path / "a.exr", *options)
        twice = render(oneray, doubled, tmp_path / "b.exr", *options)
        assert once.pixels.max() > 0
        assert (twice.pixels == 2 * once.pixels).all(), one


@pytest.mark.parametrize("name", SCENES)
def test_all_techniques_have_the_same_mean(oneray: Path, scene, tmp_path: Path, name: str) -> None:
    """Next event estimation on and off, weighed or not, by whatever light and point."""
    first, *others = techniques(scene(name))
    one = render(
        oneray, scene(name), tmp_path / "a.exr", "--spp", 256, "--seed", 1, *technique(first).options
    )
    for seed, other in enumerate(others, 2):
        options = ("--spp", 64, "--seed", seed, *technique(other).options)
        found = differences(one, render(oneray, scene(name), tmp_path / "b.exr", *options))
        assert np.abs(found).max() < BEYOND, f"{first}, {other}: {found}"


@pytest.mark.parametrize("name", SCENES)
def test_the_picture_of_all_lights_is_the_sum_of_those_of_each(
    oneray: Path, scene, tmp_path: Path, name: str
) -> None:
    """Light is linear. Of many lights the first is set against the rest."""
    file = scene(name)
    root = ElementTree.parse(file).getroot()
    count = len(list(emissions(root)))
    if count < 2:
        pytest.skip("one light")
    pictures = []
    for part in ([0], list(range(1, count)), []):
        root = ElementTree.parse(file).getroot()
        for index in part:
            scale_light(root, 0.0, index)
        some = write(root, file, tmp_path / "some.xml")
        pictures.append(render(oneray, some, tmp_path / "a.exr", "--spp", 256, "--seed", len(pictures) + 5))
    rest, first, both = pictures
    total = Image(first.pixels + rest.pixels, stderr=np.hypot(first.stderr, rest.stderr))
    assert np.abs(differences(total, both)).max() < BEYOND


def turns_inside_out(shape: ElementTree.Element, folder: Path) -> bool:
    """Does mirroring exchange the sides? It does in Mitsuba where they go by the order of corners, or of
    the axes; not where a file says which way its normals point.
    """
    if shape.get("type") not in ("ply", "obj"):
        return shape.get("type") == "sphere"
    name, faces = shape.find("string[@name='filename']"), shape.find("boolean[@name='face_normals']")
    text = (folder / name.get("value", "")).read_text()
    return (faces is not None and faces.get("value") == "true") or not ("\nvn " in text or " nx\n" in text)


def mirror(root: ElementTree.Element, folder: Path) -> None:
    """Everything on the other side of x = 0; the camera too, which then sees left and right swapped."""
    flip = {"x": "-1", "y": "1", "z": "1"}
    for shape in root.iter("shape"):
        transform = shape.find("transform")
        if transform is None:
            transform = ElementTree.SubElement(shape, "transform", name="to_world")
        ElementTree.SubElement(transform, "scale", flip)
        if turns_inside_out(shape, folder):
            flipped = shape.find("boolean[@name='flip_normals']")
            if flipped is None:
                flipped = ElementTree.SubElement(shape, "boolean", name="flip_normals", value="false")
            flipped.set("value", "false" if flipped.get("value") == "true" else "true")
    for emitter in root.iter("emitter"):
        for vector in (*emitter.findall("point"), *emitter.findall("vector")):
            set_x(vector, "value")
        for transform in emitter.findall("transform"):
            ElementTree.SubElement(transform, "scale", flip)
    for lookat in root.iterfind("./sensor/transform/lookat"):
        for name in ("origin", "target", "up"):
            set_x(lookat, name)


def set_x(element: ElementTree.Element, attribute: str) -> None:
    if element.get(attribute) is None:
        element.set("x", repr(-float(element.get("x", "0"))))
        return
    x, y, z = map(float, element.get(attribute, "").replace(",", " ").split())
    element.set(attribute, f"{-x!r}, {y!r}, {z!r}")


@pytest.mark.parametrize("name", SCENES)
def test_a_mirrored_scene_is_a_mirrored_picture(oneray: Path, scene, tmp_path: Path, name: str) -> None:
    file = scene(name)
    root = ElementTree.parse(file).getroot()
    mirror(root, file.parent)
    other = write(root, file, tmp_path / "mirrored.xml")
    one = render(oneray, file, tmp_path / "a.exr", "--spp", 256, "--seed", 3)
    two = render(oneray, other, tmp_path / "b.exr", "--spp", 256, "--seed", 4)
    back = Image(two.pixels[:, ::-1], stderr=two.stderr[:, ::-1])
    assert np.abs(differences(one, back)).max() < BEYOND


def test_the_relations_can_fail(oneray: Path, scene, tmp_path: Path) -> None:
    """A picture that is 2 % too bright, or turned round, is seen."""
    one = render(oneray, scene("occluded-lights"), tmp_path / "a.exr", "--spp", 256, "--seed", 3)
    two = render(oneray, scene("occluded-lights"), tmp_path / "b.exr", "--spp", 256, "--seed", 4)
    assert np.abs(differences(one, Image(1.02 * two.pixels, stderr=two.stderr))).max() > BEYOND
    assert np.abs(differences(one, Image(two.pixels[:, ::-1], stderr=two.stderr[:, ::-1]))).max() > BEYOND
