"""Which mistake makes an image like this? Images, or a renderer, against the catalogue of mistakes."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from raycheck.base import data, pictures
from raycheck.base.arrays import Array
from raycheck.base.errors import ImageError, NotFound, RenderError
from raycheck.base.images import load_image, write_png
from raycheck.base.seeds import make_seeds
from raycheck.base.text import percent
from raycheck.judging import checks, mistakes, sentences
from raycheck.judging.agenda import renderer_agenda, supported
from raycheck.judging.explanations import Explanation, explain
from raycheck.judging.looks import Look, look
from raycheck.renderers.manifest import manifest_for
from raycheck.renderers.renderer import Renderer
from raycheck.scene import lecture, variants
from raycheck.scene.content import read_content
from raycheck.scene.variants import Variant
from raycheck.stats.tiles import grid, region_means
from raycheck.truth import references
from raycheck.truth.expected import Truth, truth_of

SPP, IMAGES = 16, 8
MOST_SCENES = 3
"""Scenes of which is said what part of the light is wrong, those furthest off."""
MAP_SCALE = 6
"""Pixels of the error map for each of the image's."""


@dataclass
class Inspection:
    """What was looked at, and what it shows."""

    looks: list[Look] = field(default_factory=list)
    plain: str | None = None
    """What a plain check says at once: nothing more is fitted then."""
    notes: list[str] = field(default_factory=list)
    worst: tuple[Array, Truth] | None = None
    """Images and truth of the scene that differs most, for the error map."""

    def look(self, scene: str, images: Array, truth: Truth, lights: int) -> None:
        """Take in the images (B, H, W, 3) of a scene."""
        clamped = checks.clamped(images, truth.mean, truth.variance)
        if clamped and not self.plain:
            self.plain = f"{scene}: {clamped}"
        self.looks.append(look(scene, images, truth, lights))
        if self.looks[-1].size >= max(other.size for other in self.looks):
            self.worst = images, truth


def of_files(files: list[Path], scenes: list[str] | None) -> Inspection:
    try:
        loaded = [load_image(file) for file in files]
    except ImageError as error:
        raise NotFound(str(error)) from None
    shapes = {image.pixels.shape for image in loaded}
    if len(shapes) > 1:
        raise NotFound(f"the images have different sizes: {', '.join(map(str, sorted(shapes)))}")
    pixels = np.stack([image.pixels for image in loaded])
    found = Inspection()
    name = scenes[0] if scenes else guess_scene(pixels.mean(axis=0))
    if not scenes:
        found.notes.append(f"taken for a picture of {name} (--scene NAME says otherwise)")
    truth = truth_of(references.load_reference(name))
    problems = [checks.size_problem(i, *truth.shape) or checks.number_problem(i) for i in loaded]
    found.plain = next((f"{file}: {p}" for file, p in zip(files, problems, strict=True) if p), None)
    if not found.plain:
        found.look(name, pixels, truth, read_content(variants.scene_path(name)).lights)
    return found


def guess_scene(image: Array) -> str:
    """The scene whose reference the image is most like, by the correlation of the tiles' logarithms."""
    best, likeness = "", -np.inf
    usable = np.nan_to_num(np.clip(image, 0, 1e30))
    for name in mistakes.scenes():
        mean = references.read_exr(data.references_dir() / f"{name}.exr")[..., :3]
        if mean.shape != image.shape:
            continue
        tiles = grid(*mean.shape[:2])
        logs = [np.log(region_means(one, tiles) + 1e-2 * mean.mean()).ravel() for one in (usable, mean)]
        alike = float(np.corrcoef(*logs)[0, 1])
        if alike > likeness:
            best, likeness = name, alike
    if not best:
        height, width = image.shape[:2]
        raise NotFound(f"no scene with signatures is {width}×{height}; --scene NAME says which it is")
    return best


def of_renderer(renderer: str, scenes: list[str] | None) -> Inspection:
    wanted = [variants.variant(name) for name in scenes or mistakes.complete_scenes()]
    wanted, _ = supported(wanted, manifest_for(renderer).needs)
    found = Inspection()
    with tempfile.TemporaryDirectory(prefix="raycheck-") as folder:
        for task in renderer_agenda(renderer, wanted, Path(folder), explicit=bool(scenes)).tasks:
            reference = references.load_reference(task.of)
            try:
                images = _render(task.renderer, task.of, truth_of(reference))
            except RenderError as error:
                found.notes.append(f"{task.label}: left out: {error}")
                continue
            found.look(task.label, images, truth_of(reference), task.content.lights)
    if not found.looks:
        raise NotFound("; ".join(found.notes))
    return found


def _render(renderer: Renderer, of: Variant, truth: Truth) -> Array:
    made = []
    for seed in make_seeds(f"diagnose/{of.label}", IMAGES):
        image = renderer.render(of.path, SPP, seed, 60.0).image
        problem = checks.size_problem(image, *truth.shape) or checks.number_problem(image)
        if problem:
            raise RenderError(problem)
        made.append(image.pixels)
    return np.stack(made)


def report(found: Inspection) -> tuple[str, bool]:
    """What to print, and whether something is wrong."""
    lines = list(found.notes)
    if found.plain:
        return "\n".join([*lines, sentence(found.plain)]), True
    differing = [one for one in found.looks if one.differs]
    if not differing:
        seen = "; ".join(f"{one.scene}: {percent(one.detectable)}" for one in found.looks)
        told = "No difference beyond noise. Of the whole image so much would have been seen"
        return "\n".join(
            [*lines, f"{told} ({seen}). raycheck verify takes more samples, and sees less."]
        ), False
    together = explain(found.looks)
    whole = sentences.explanation(together, found.looks[0].lights)
    lines += [sentence(whole)] if whole else wrong_parts(differing)
    if together.convention and not together.mistakes:
        return "\n".join(lines), True
    return "\n".join([*lines, *guesses(together)]), True


def sentence(text: str) -> str:
    return text[:1].upper() + text[1:] + "."


def wrong_parts(looks: Sequence[Look]) -> list[str]:
    """Says which part of the light is wrong, in the scenes that are furthest off."""
    worst = sorted(looks, key=lambda one: -one.size)[:MOST_SCENES]
    told = [(one.scene, sentences.explanation(explain([one]), one.lights)) for one in worst]
    return [f"{scene}: {sentence(words)}" for scene, words in told if words]


def guesses(told: Explanation) -> list[str]:
    """The mistakes that explain all of it in words, or those that come nearest."""
    if told.mistakes:
        lines = [_heading(told)]
        for number, mistake in enumerate(told.mistakes, 1):
            argument = lecture.argument(mistake.technique)
            lines += [f"{number}. “{mistake.mistake}”", f"   {mistake.technique}: {argument}."]
        scene = mistakes.telling_scene([mistake.name for mistake in told.mistakes])
        return [*lines, f"{sentence(f'{scene} tells them apart')}"] if scene else lines
    lines = ["No known mistake explains all of this."]
    near = [one for one in told.nearest if one.share > WORTH_SAYING]
    if near:
        lines += ["Part of it would be explained by:"]
        lines += [f"- “{one.mistake.mistake}” ({percent(one.share)} of the squared error)" for one in near]
    return lines


def _heading(told: Explanation) -> str:
    several = len(told.mistakes) > 1
    if told.convention or told.parts:
        return f"{'Each of these mistakes' if several else 'This mistake'} {sentences.CAN_DO_THAT}:"
    return "It looks like one of these mistakes:" if several else "It looks like this mistake:"


WORTH_SAYING = 0.5
"""Share of the squared error from which a mistake that does not explain all of it is told."""


def write_map(path: Path, images: Array, truth: Truth) -> None:
    """Signed error in standard errors, blue too dark, red too bright, enlarged."""
    mean = images.mean(axis=0)
    own = images.var(axis=0, ddof=1) / len(images) if len(images) > 1 else truth.sample_variance
    colours = pictures.error_map(mean, truth.mean, np.sqrt(own + truth.variance))
    write_png(path, np.kron(colours, np.ones((MAP_SCALE, MAP_SCALE, 1), dtype=np.uint8)))
