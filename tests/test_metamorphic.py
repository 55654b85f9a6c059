"""What must hold between pictures, whatever the picture is: no reference is needed to see it broken. Scaled
light and mirrors are tried in every scene that there is, those of the tests and the stiff ones among them.

The statistical relations compare two pictures with seeds of their own, over the whole image and its
quarters, by their standard errors: 15 numbers, each beyond 5.5 once in 26 million for a normal
distribution, so that all of this file gives a false alarm once in some thousand changes of the seeds.
"""

from __future__ import annotations

import re
import subprocess
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from building import ROOT

from raycheck.base.images import Image, load_image
from raycheck.scene import variants
from raycheck.scene.content import read_content
from raycheck.scene.techniques import applicable, technique

SCENES = variants.scene_names()
EVERY = {
    **{name: variants.variant(name).path for name in SCENES},
    **{
        f"{folder}/{path.stem}": path
        for folder in ("scenes/stiff", "tests", "tests/odd", "tests/precision")
        for path in sorted((ROOT / folder).glob("*.xml"))
    },
}
"""All scenes: the canonical ones by their names, others by their places."""
EMISSION = {
    "area": "radiance", "constant": "radiance", "point": "intensity", "spot": "intensity",
    "directional": "irradiance", "envmap": "scale",
}  # fmt: skip
BEYOND = 5.5
BLACK = {
    *(f"scenes/stiff/{name}" for name in ("contact-shadow", "occluder-below-light", "mesh-seams", "slivers")),
    *(f"tests/odd/hidden-twice-{name}" for name in ("cube", "disk", "rectangle", "sphere")),
    "scenes/stiff/setting-sphere",
    "tests/odd/no-shapes-point",
    "tests/odd/nothing",
}
"""Scenes whose picture is, or whose few samples may be."""


def render(oneray: Path, scene: Path, target: Path, *options: object) -> Image:
    subprocess.run([oneray, scene, "-o", target, *map(str, options)], check=True)
    return load_image(target)


def parsed(scene: Path) -> ElementTree.Element:
    """The scene with its parameters replaced by their defaults."""
    root = ElementTree.parse(scene).getroot()
    defaults = list(root.iter("default"))
    values = {d.get("name", ""): d.get("value", "") for d in defaults}
    for element in defaults:
        root.remove(element)
    for element in root.iter():
        for name, text in element.items():
            element.set(name, re.sub(r"\$(\w+)", lambda found: values[found[1]], text))
    return root


def emissions(root: ElementTree.Element) -> Iterator[ElementTree.Element]:
    """The elements that say how much light an emitter gives, one of each emitter."""
    for emitter in root.iter("emitter"):
        name = EMISSION[emitter.get("type", "")]
        said = next((child for child in emitter if child.get("name") == name), None)
        tag = "float" if name == "scale" else "rgb"
        yield ElementTree.SubElement(emitter, tag, name=name, value="1") if said is None else said


def scale_light(root: ElementTree.Element, factor: float, only: int | None = None) -> None:
    """Multiplies the emission of light number `only`, or of all."""
    for index, element in enumerate(emissions(root)):
        if only is None or index == only:
            numbers = [float(word) * factor for word in element.get("value", "").replace(",", " ").split()]
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
    windows = [
        (slice(None), slice(None)),
        *((y, x) for y in halves[0] for x in halves[1] if min(a.pixels.shape[:2]) > 1),
    ]
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


@pytest.mark.sample(60)
@pytest.mark.parametrize(("precision", "power"), [("double", -20), ("single", 13)])
@pytest.mark.parametrize("name", EVERY)
def test_light_times_a_power_of_two_is_the_picture_times_that(
    oneray: Path, tmp_path: Path, name: str, precision: str, power: int
) -> None:
    """To the last bit: it changes no rounding, and nothing that a path does depends on it."""
    root = parsed(EVERY[name])
    plain = write(root, EVERY[name], tmp_path / "plain.xml")
    scale_light(root, 2.0**power)
    scaled = write(root, EVERY[name], tmp_path / "scaled.xml")
    for one in techniques(plain):
        options = ("--spp", 4, "--width", 24, "--precision", precision, *technique(one).options)
        once = render(oneray, plain, tmp_path / "a.exr", *options)
        times = render(oneray, scaled, tmp_path / "b.exr", *options)
        assert (times.pixels == 2.0**power * once.pixels).all(), one
        assert once.pixels.max() > 0 or name in BLACK or one == "walk-cosine"


@pytest.mark.sample(24)
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
    root = parsed(file)
    count = len(list(emissions(root)))
    if count < 2:
        pytest.skip("one light")
    pictures = []
    for part in ([0], list(range(1, count)), []):
        root = parsed(file)
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
    text = (folder / name.get("value", "")).read_bytes().decode("latin-1")
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
        if emitter.get("type") == "envmap" and emitter.find("transform") is None:
            ElementTree.SubElement(emitter, "transform", name="to_world")
        for transform in emitter.findall("transform"):
            ElementTree.SubElement(transform, "scale", flip)
    sizes = {one.get("name"): one for one in root.iterfind("./sensor/film/integer")}
    if "crop_offset_x" in sizes:
        width, left, crop = (int(sizes[n].get("value", "")) for n in ("width", "crop_offset_x", "crop_width"))
        sizes["crop_offset_x"].set("value", str(width - left - crop))
    for aside in root.iterfind("./sensor/float[@name='principal_point_offset_x']"):
        aside.set("value", repr(-float(aside.get("value", ""))))
    for lookat in root.iterfind("./sensor/transform/lookat"):
        for name in ("origin", "target", "up"):
            set_x(lookat, name)
    for turn in root.iterfind("./sensor/transform/rotate"):  # an axis is mirrored the other way
        for axis in "yz":
            turn.set(axis, repr(-float(turn.get(axis, "0"))))
    for move in root.iterfind("./sensor/transform/translate"):
        set_x(move, "value")
    for matrix in root.iterfind("./sensor/transform/matrix"):
        numbers = np.array([float(word) for word in matrix.get("value", "").replace(",", " ").split()])
        signs = np.outer([-1, 1, 1, 1], [-1, 1, 1, 1])
        matrix.set("value", " ".join(map(repr, (signs * numbers.reshape(4, 4)).ravel().tolist())))


def set_x(element: ElementTree.Element, attribute: str) -> None:
    if element.get(attribute) is None:
        element.set("x", repr(-float(element.get("x", "0"))))
        return
    x, y, z = map(float, element.get(attribute, "").replace(",", " ").split())
    element.set(attribute, f"{-x!r}, {y!r}, {z!r}")


def without_normal_maps(root: ElementTree.Element) -> None:
    """Their materials alone: what such a picture calls left is left in a mirror too."""
    for parent in list(root.iter()):
        for index, child in enumerate(list(parent)):
            if child.get("type") == "normalmap":
                inner = child.find("bsdf")
                assert inner is not None
                inner.attrib.update({key: value for key, value in child.attrib.items() if key != "type"})
                parent[index] = inner


@pytest.mark.sample(40)
@pytest.mark.parametrize("name", EVERY)
def test_a_mirrored_scene_is_a_mirrored_picture(oneray: Path, tmp_path: Path, name: str) -> None:
    root = parsed(EVERY[name])
    without_normal_maps(root)
    plain = write(root, EVERY[name], tmp_path / "plain.xml")
    mirror(root, EVERY[name].parent)
    other = write(root, EVERY[name], tmp_path / "mirrored.xml")
    one = render(oneray, plain, tmp_path / "a.exr", "--spp", 256, "--seed", 3)
    two = render(oneray, other, tmp_path / "b.exr", "--spp", 256, "--seed", 4)
    back = Image(two.pixels[:, ::-1], stderr=two.stderr[:, ::-1])
    assert np.abs(differences(one, back)).max() < BEYOND


def test_the_relations_can_fail(oneray: Path, scene, tmp_path: Path) -> None:
    """A picture that is 2 % too bright, or turned round, is seen."""
    one = render(oneray, scene("occluded-lights"), tmp_path / "a.exr", "--spp", 256, "--seed", 3)
    two = render(oneray, scene("occluded-lights"), tmp_path / "b.exr", "--spp", 256, "--seed", 4)
    assert np.abs(differences(one, Image(1.02 * two.pixels, stderr=two.stderr))).max() > BEYOND
    assert np.abs(differences(one, Image(two.pixels[:, ::-1], stderr=two.stderr[:, ::-1]))).max() > BEYOND
