"""A wrong light, path length or surface is found, with its factor; nothing is said that leaves a rest."""

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

import raycheck
from raycheck.base import data
from raycheck.calibration import part_making
from raycheck.judging import parts, sentences
from raycheck.judging.parts import Explanation, Factor, Hypothesis
from raycheck.judging.tile_errors import errors_of_means
from raycheck.scene import variants
from raycheck.stats.tiles import grid, region_means, region_variances
from raycheck.truth import references
from raycheck.truth.expected import truth_of

SCENE = "many-lights"
BATCHES = 64
SAMPLES = BATCHES * 256
"""Of a pixel, all images together."""


@pytest.fixture(scope="module")
def truth():
    return truth_of(references.load_reference(SCENE))


def template(hypothesis: Hypothesis) -> np.ndarray:
    return next(image for one, image, _ in parts.hypotheses(parts.load(SCENE)) if one == hypothesis)


def found(truth, error, seed=1, samples=SAMPLES):
    """TileErrors of tiles that are off by `error` (T, 3), as noisy as the reference's renderer."""
    tiles = grid(*truth.shape)
    variance = region_variances(truth.sample_variance, tiles) * BATCHES / samples
    noise = np.random.default_rng(seed).standard_normal((BATCHES, *variance.shape)) * np.sqrt(variance)
    return errors_of_means(SCENE, region_means(truth.mean, tiles) + error + noise, truth)


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


@pytest.mark.parametrize("hypothesis", [
    Hypothesis("light 2 of 8", "", "floor"), Hypothesis("light 5 of 8", "direct"),
    Hypothesis("", "emission"), Hypothesis("", "", "back wall"),
])  # fmt: skip
@pytest.mark.parametrize("bias", [1.0, -0.3, -1.0])
def test_a_wrong_part_is_told(truth, hypothesis, bias):
    told = parts.explain(found(truth, bias * template(hypothesis)))
    assert [one.of for one in told.factors] == [hypothesis] and told.other is None
    assert told.factors[0].low < bias < told.factors[0].high


def test_intervals_hold(truth):
    """At 99 %: fewer than 35 of 40 would be by chance once in ten million times."""
    part = Hypothesis("light 2 of 8", "", "floor")
    error = 0.5 * template(part)
    told = [parts.explain(found(truth, error, seed)) for seed in range(40)]
    named = [one.factors[0] for one in told if one and one.factors[0].of == part]
    assert len(named) > 36
    assert sum(one.low < 0.5 < one.high for one in named) >= 35
    assert max(one.high - one.low for one in named) < 0.1


def test_each_light_may_have_a_factor(truth):
    """As where N stands for 1/p_i."""
    factors = (0.4, -0.5, 0.6, 0.3, -0.4, 0.5, -0.6, 0.7)
    biases = {f"light {n} of 8": bias for n, bias in enumerate(factors, 1)}
    error = sum(bias * template(Hypothesis(light, "direct")) for light, bias in biases.items())
    told = parts.explain(found(truth, error))
    assert {one.of.light: round(one.bias, 1) for one in told.factors} == biases
    assert "5 more of the lights are off too; everything else agrees" in sentences.explanation(told)


def test_what_no_part_explains_is_not_told(truth):
    """A chessboard of tiles, half of a light's shadow, noise alone."""
    signs = np.where(np.indices((8, 8)).sum(axis=0) % 2, 0.3, -0.3).reshape(-1, 1)
    mean = region_means(truth.mean, grid(*truth.shape))
    assert parts.explain(found(truth, signs * mean)) is None
    light = template(Hypothesis("light 2 of 8", "direct")).copy()
    light[: len(light) // 2] = 0
    assert parts.explain(found(truth, light)) is None
    assert parts.explain(found(truth, 0 * mean)) is None


def test_nothing_is_claimed_where_noise_hides_the_rest(truth):
    """A tenth of the direct light, seen with a ten-thousandth of the samples, could be something else too."""
    error = -0.1 * template(Hypothesis("", "direct"))
    assert parts.explain(found(truth, error)) is not None
    assert parts.explain(found(truth, error, samples=SAMPLES / 10_000)) is None


def test_nothing_is_known_of_other_scenes(truth):
    assert parts.load("nowhere") is None
    one = found(truth, 0.5 * template(Hypothesis("", "direct")))
    assert parts.explain(one) is not None
    assert parts.explain(type(one)(**{**one.__dict__, "scene": "/home/me/many-lights.xml"})) is None


def test_parts_in_words():
    def said(bias, half, *of, other=None):
        factor = Factor(Hypothesis(*of), bias, bias - half, bias + half)
        return sentences.explanation(Explanation([factor], other))

    assert said(1.0, 0.1, "light 2 of 8", "", "floor") == (
        "light 2 of 8 on “floor” is 2.0 ± 0.1 times as bright as it should be; everything else agrees"
    )
    assert said(-1, 0.01, "", "two bounces").startswith("the light after two bounces is missing; everything")
    assert said(-0.5, 0.01, "", "", "the lamp").startswith("the lamp is 50 % ± 1.00 % too dark; everything")
    assert said(0.5, 0.01).endswith("; all of it by the same factor")
    assert "either the direct light or “floor”, which look alike here, is" in said(
        0.5, 0.01, "", "direct", other=Hypothesis(surface="floor")
    )


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
