"""A wrong light, path length or surface is found, with its factor; nothing is said that leaves a rest."""

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

import raycheck
from raycheck.base import data
from raycheck.calibration import part_making
from raycheck.judging import parts
from raycheck.judging.parts import Hypothesis
from raycheck.scene import variants
from raycheck.stats.tiles import grid, region_means, region_variances
from raycheck.truth import references
from raycheck.truth.expected import truth_of

SCENE = "many-lights"


@pytest.fixture(scope="module")
def truth():
    return truth_of(references.load_reference(SCENE))


def template(hypothesis: Hypothesis) -> np.ndarray:
    return next(image for one, image, _ in parts.hypotheses(parts.load(SCENE)) if one == hypothesis)


@pytest.mark.parametrize("scene", variants.scene_names())
def test_parts_sum_to_the_reference(scene):
    """Those of every scene, and they belong to it as it is."""
    of = parts.load(scene)
    assert of is not None, f"{scene}: raycheck calibrate parts {scene}"
    if scene == "mixed-material":  # where its comment says that Mitsuba is no judge
        pixels, variance = references.load_reference(scene).best()
    else:
        pixels, variance = np.split(references.read_exr(data.references_dir() / f"{scene}.exr"), 2, 2)
    tiles = grid(*pixels.shape[:2])
    mean = region_means(pixels, tiles)
    within = 0.01 * np.maximum(mean, mean.mean() / 10)
    allowed = within**2 + region_variances(variance, tiles)
    assert np.mean((of.image.sum(axis=(0, 1, 2)) - mean) ** 2 / allowed) < 1
    assert of.image.sum() == pytest.approx(mean.sum(), rel=5e-3)


def test_nothing_is_known_of_other_scenes():
    assert parts.load("nowhere") is None and parts.load("/home/me/many-lights.xml") is None


def test_verify_says_it(truth):
    """In the sentence of a FAIL: a renderer whose second light has half of its power."""
    error = np.zeros_like(truth.mean)
    wrong = -0.5 * template(Hypothesis("light 2 of 8", "direct"))
    for tile, value in zip(grid(*truth.shape), wrong, strict=True):
        error[tile.window] = value

    def render(path, spp, seed):
        noise = np.random.default_rng(seed).standard_normal(truth.mean.shape)
        return truth.mean + error + noise * np.sqrt(truth.sample_variance / spp)

    case = raycheck.verify(render, SCENE, spp=256, jobs=1).cases[0]
    assert case.verdict is raycheck.Outcome.FAIL
    assert case.reason.startswith("the direct light of light 2 of 8 is 50 % ±")
    assert "too dark; everything else agrees (correct renderers" in case.reason


SMALL = """
<scene version="3.0.0">
    <integrator type="path"><integer name="max_depth" value="6"/></integrator>
    <!-- walls: red, green, shiny like a new car -->
    <shape type="rectangle"><ref id="paint"/></shape>
    <shape type="rectangle"><ref id="paint"/></shape>
    <shape type="sphere" id="ball"/>
    <shape type="rectangle"><ref id="paint"/></shape>
    <!-- this one shines down -->
    <shape type="rectangle"><emitter type="area"><rgb name="radiance" value="2"/></emitter></shape>
    <emitter type="constant"/>
</scene>"""


@pytest.fixture
def small():
    parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    return ElementTree.fromstring(SMALL, parser)


def test_surfaces_and_lights_have_names(small):
    assert {one.name: one.shapes for one in part_making.surfaces(small)} == {
        "red": (0,), "green": (1,), "ball": (2,), "paint": (3,), "the lamp": (4,),
    }  # fmt: skip
    assert part_making.light_names(small) == ["light 1 of 2", "the sky"]


def test_one_light_alone_is_left(small):
    """The others' emitters are gone, their shapes are not."""
    for index, kind in enumerate(("area", "constant")):
        lit = part_making.with_light(small, index)
        assert [emitter.get("type") for _, emitter in part_making.emitters(lit)] == [kind]
        assert len(lit.findall("shape")) == 5
    assert len(part_making.emitters(small)) == 2


def test_one_surface_alone_shines(small):
    shown = part_making.showing(small, part_making.Surface("ball", (2,)), flipped=True)
    [(parent, emitter)] = part_making.emitters(shown)
    assert parent.get("id") == "ball" and emitter.find("rgb").get("value") == "1"
    assert parent.find("boolean").get("value") == "true"
    assert shown.find("integrator/integer").get("value") == "1"
