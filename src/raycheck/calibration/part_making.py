"""Templates: what each light, path length and surface of a scene adds to the image of a correct renderer.

oneray renders the scene once for each light, with the other emitters taken away (a light without power might
be chosen, or not be), and each of a few path lengths, from the same seeds, so that the difference of two
lengths is what the longer paths add. Which surface a pixel shows is the emission, at path length 1, of a copy
of the scene in which that surface alone shines, to both sides. All at `FINER` times the scene's resolution,
so that few pixels show two surfaces; a scene with a filter of its own at its own, where that is what it is.
"""

import copy
import json
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.files import whole, write_whole
from raycheck.base.seeds import make_seeds
from raycheck.judging.agenda import standard_technique
from raycheck.judging.parts import Parts, folder, manifest
from raycheck.renderers.oneray import oneray_command, oneray_path
from raycheck.scene import document, variants
from raycheck.scene.content import read_content
from raycheck.scene.document import Element
from raycheck.scene.variants import Variant
from raycheck.stats.tiles import SMALLEST, grid, region_means
from raycheck.truth import provenance, references

METHOD = 1
"""Version of how templates are made, see truth.provenance."""
FINER = 4
SPP, SEEDS = 16, 8
MASK_SPP = 16
TIMEOUT = 600.0
MOST_LIGHTS = 16
"""More are not told apart."""
LENGTHS = {1: "emission", 2: "direct", 3: "two bounces", 0: "more bounces"}
"""Path lengths that are told apart, in Mitsuba's counting, and what they add; 0 is the scene's own depth."""
NOTHING = 1e-4
"""Share of the image below which a path length or surface is left out."""
LONGEST_NAME = 3
"""Words of a comment above a shape that still name it. One that lists words names as many shapes."""


@dataclass(frozen=True)
class Surface:
    """Shapes that go by one name."""

    name: str
    shapes: tuple[int, ...]
    """Their numbers in the file."""


def parse(of: Variant) -> Element:
    """The scene with its comments, paths of mesh files absolute, parameters as defaults."""
    return of.document(comments=True).moved(lambda mesh: str(mesh.resolve()))


def emitters(root: Element) -> list[tuple[Element, Element]]:
    """(parent, emitter), in the order of the file."""
    parents = {child: parent for parent in root.iter() for child in parent}
    return [(parents[emitter], emitter) for emitter in root.iter("emitter")]


def light_names(root: Element) -> list[str]:
    """What people call the lights: "the sky" where there is one, else by the number in the file."""
    kinds = [emitter.get("type", "") for _, emitter in emitters(root)]
    if len(kinds) > MOST_LIGHTS:
        return ["the lights"]
    if len(kinds) == 1:
        return ["the light"]
    own = {"constant": "the sky", "directional": "the sun", "spot": "the spot", "point": "the point light"}
    return [
        own[kind] if kind in own and kinds.count(kind) == 1 else f"light {number} of {len(kinds)}"
        for number, kind in enumerate(kinds, 1)
    ]


def surfaces(root: Element) -> list[Surface]:
    """The surfaces, named as the lamp, by id, the comment above, the material's id, or the kind of shape."""
    named: dict[str, list[int]] = {}
    lamp = "the lamp" if len(root.findall("./shape/emitter")) == 1 else "the lamps"
    above: list[str] = []
    number = 0
    for child in root:
        if not isinstance(child.tag, str):  # a comment
            above = _names_in(child.text or "")
        elif child.tag != "shape":
            above = []
        else:
            material = child.find("ref")
            names = [
                lamp if child.find("emitter") is not None else "",
                child.get("id", ""),
                above.pop(0) if above else "",
                material.get("id", "") if material is not None else "",
                f"the {child.get('type')}",
            ]
            named.setdefault(next(name for name in names if name), []).append(number)
            number += 1
    return [Surface(name, tuple(numbers)) for name, numbers in named.items()]


def _names_in(comment: str) -> list[str]:
    """The names that a comment gives to the shapes below it, such as "floor" or "wall: red, yellow, blue"."""
    first, *others = [words.strip() for words in comment.partition(":")[2 * (":" in comment)].split(",")]
    if len(first.split()) > LONGEST_NAME:
        return []
    return [first, *(other for other in others if len(other.split()) == 1)]


def with_length(root: Element, length: int) -> Element:
    """A copy that ends paths at this length; 0 leaves the scene's own."""
    found = copy.deepcopy(root)
    depth = found.find("./integrator/integer[@name='max_depth']")
    if length and depth is not None:
        depth.set("value", str(length))
    return found


def with_light(root: Element, index: int | None) -> Element:
    """A copy with one light alone; None keeps all."""
    found = copy.deepcopy(root)
    for number, (parent, emitter) in enumerate(emitters(found)):
        if index is not None and number != index:
            parent.remove(emitter)
    return found


def showing(root: Element, surface: Surface, flipped: bool) -> Element:
    """A copy in which a surface alone shines, with radiance 1, to one of its sides."""
    found = with_length(root, 1)
    hidden = found.find("./integrator/boolean[@name='hide_emitters']")
    unseen = hidden is not None and hidden.get("value") == "true"
    if hidden is not None:
        hidden.set("value", "false")
    shapes = found.findall("shape")
    lamps = [shape for shape in shapes if shape.find("emitter") is not None]
    for parent, emitter in emitters(found):
        parent.remove(emitter)
    for number in surface.shapes:
        shape = shapes[number]
        for child in [c for c in shape if c.tag in ("bsdf", "ref")]:
            shape.remove(child)
        flip = shape.find("./boolean[@name='flip_normals']")
        turned = (flip is not None and flip.get("value") == "true") != flipped
        if flip is not None:
            shape.remove(flip)
        if turned:
            ElementTree.SubElement(shape, "boolean", name="flip_normals", value="true")
        light = ElementTree.SubElement(shape, "emitter", type="area")
        ElementTree.SubElement(light, "rgb", name="radiance", value="1")
    for lamp in lamps if unseen else ():
        found.remove(lamp)
    return found


def finer(of: Variant) -> int:
    """How many times the scene's resolution."""
    return 1 if read_content(of.path).filtered else FINER


class _Maker:
    """Renders copies of a scene with oneray, at the finer resolution."""

    def __init__(self, of: Variant, folder: Path) -> None:
        entry = references.require(of)
        self.of, self.folder = of, folder
        self.finer = finer(of)
        self.shape = entry["height"] * self.finer, entry["width"] * self.finer
        size = ("--height", str(self.shape[0]), "--width", str(self.shape[1]))
        self.command = oneray_command(oneray_path(), size)

    def render(self, root: Element, spp: int, seed: int) -> Array:
        """`spp` of the finer resolution."""
        path = self.folder / "scene.xml"
        document.write(root, path)
        return self.command.render(path, spp * (FINER // self.finer) ** 2, seed, TIMEOUT).image.pixels

    def mask(self, root: Element, surface: Surface) -> Array:
        """(H, W) share of each pixel that shows the surface."""
        seed = make_seeds("parts/mask", 1)[0]  # the same for all, whose sum is then 1
        sides = [self.render(showing(root, surface, flipped), MASK_SPP, seed) for flipped in (False, True)]
        return np.clip(sum(side[..., 0] for side in sides), 0, 1)


def make(of: Variant) -> Parts:
    """Render all of one scene's."""
    root = parse(of)
    content = surfaces(root)
    lights = light_names(root)
    depth = read_content(of.path, of.parameters).max_depth
    lengths = [n for n in LENGTHS if n == 0 or depth < 0 or n < depth]
    with tempfile.TemporaryDirectory(prefix="raycheck-") as scratch:
        maker = _Maker(of, Path(scratch))
        masks = [maker.mask(root, surface) for surface in content]
        rest = np.clip(1 - sum(masks), 0, 1)
        tiles = grid(*maker.shape, SMALLEST * maker.finer)
        seeds = make_seeds(f"parts/{of.label}", SEEDS)
        parts = np.zeros((SEEDS, len(lights), len(lengths), len(masks) + 1, len(tiles), 3))
        for light in range(len(lights)):
            lit = with_light(root, light if len(lights) > 1 else None)
            for batch, seed in enumerate(seeds):
                shorter = np.zeros(())
                for index, length in enumerate(lengths):
                    image = maker.render(with_length(lit, length), SPP, seed)
                    shown = np.stack([mask[..., None] * (image - shorter) for mask in [*masks, rest]])
                    parts[batch, light, index] = region_means(shown, tiles)
                    shorter = image
    names = [*(surface.name for surface in content), "the background"]
    last = {2: "direct", 3: "two bounces"}.get(depth, "more bounces") if depth > 0 else "more bounces"
    told = [LENGTHS[n] if n else last for n in lengths]
    return _without_empty(Parts(lights, told, names, parts.mean(axis=0), _variance(parts)))


def _variance(parts: Array) -> Array:
    return np.asarray(parts.var(axis=0, ddof=1) / len(parts))


def _without_empty(found: Parts) -> Parts:
    """Path lengths and surfaces that show nothing are left out."""
    least = NOTHING * found.image.sum()
    lengths = np.flatnonzero(found.image.sum(axis=(0, 2, 3, 4)) > least).tolist()
    shown = np.flatnonzero(found.image.sum(axis=(0, 1, 3, 4)) > least).tolist()
    at = np.ix_(list(range(len(found.lights))), lengths, shown)
    return Parts(
        found.lights, [found.lengths[i] for i in lengths], [found.surfaces[i] for i in shown],
        found.image[at], found.variance[at],
    )  # fmt: skip


def write(scenes: Sequence[str]) -> Iterator[str]:
    """Make those of some scenes, and keep the others'; the manifest is written after each."""
    target = folder()
    target.mkdir(parents=True, exist_ok=True)
    listing = dict(manifest()) if (target / "manifest.json").is_file() else {}
    for scene in scenes:
        of = variants.variant(scene)
        found = make(of)
        with whole(target / f"{scene}.npz") as partial:
            np.savez_compressed(
                partial,
                image=found.image.astype(np.float32), deviation=np.sqrt(found.variance).astype(np.float32),
            )  # fmt: skip
        listing[scene] = {
            "hash": variants.scene_hash(of.path), "lights": list(found.lights),
            "lengths": list(found.lengths), "surfaces": list(found.surfaces), "spp": SPP * SEEDS * FINER**2,
            "provenance": provenance.provenance(METHOD, [f"{scene} {standard_technique(of).name} auto"]),
        }  # fmt: skip
        text = json.dumps(dict(sorted(listing.items())), indent=1, ensure_ascii=False) + "\n"
        write_whole(target / "manifest.json", text)
        yield scene
