"""What may be said of a wrong picture whose parts and mistakes are made up."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest

from raycheck.base.errors import ReferenceError_
from raycheck.base.images import encode_srgb
from raycheck.judging import candidates, conventions, explanations, fitting, looks, mistakes, parts, sentences
from raycheck.judging.conventions import ENCODINGS, pictures
from raycheck.judging.explanations import Explanation, Factor
from raycheck.judging.looks import Look, look
from raycheck.judging.mistakes import Mistake, Signatures
from raycheck.judging.parts import Hypothesis, Parts
from raycheck.judging.tile_errors import TileErrors
from raycheck.stats.tiles import grid, region_means
from raycheck.truth.expected import Truth

HEIGHT, WIDTH = 64, 48
TILES = len(grid(HEIGHT, WIDTH))
NOISE = 0.01
"""Of a pixel of one image."""
IMAGES = 32
Told = Callable[..., Explanation]


def reference(seed: int = 3) -> np.ndarray:
    """In every channel and direction something else, from .2 to .9, and a dark box with sharp edges."""
    row, column = np.indices((HEIGHT, WIDTH)) / [[[HEIGHT]], [[WIDTH]]]
    fields = np.stack([row, column**2, row * column], axis=-1)
    picture = 0.2 + 0.4 * fields + 0.3 * row[..., None] ** 3
    picture[20:33, 13:32] = 0.02
    return picture


def enlarge(tiles: np.ndarray) -> np.ndarray:
    """(T, 3) as an image."""
    image = np.zeros((HEIGHT, WIDTH, 3))
    for tile, value in zip(grid(HEIGHT, WIDTH), tiles, strict=True):
        image[tile.window] = value
    return image


def area(first: int, last: int, value: float = 0.5) -> np.ndarray:
    """(T, 3) of some tiles, a little different in each."""
    image = np.zeros((TILES, 3))
    image[first:last] = value * (1 + 0.2 * np.sin(np.arange(first, last)))[:, None]
    return image


def seen(image: np.ndarray, noise: float | np.ndarray = NOISE, seed: int = 1, scene: str = "a") -> Look:
    truth = Truth(
        reference(), np.zeros((HEIGHT, WIDTH, 3)), np.full((HEIGHT, WIDTH, 3), NOISE**2), {}, 64, False
    )
    rng = np.random.default_rng(seed)
    return look(scene, image + noise * rng.standard_normal((IMAGES, *image.shape)), truth)


@pytest.fixture
def explain(monkeypatch: pytest.MonkeyPatch) -> Told:
    """What is said of an image, where parts are (light, length, surface) → (T, 3), mistakes name → (T, 3)."""

    def said(
        image: np.ndarray, of: Mapping[tuple[str, str, str], np.ndarray] | None = None,
        signatures: Mapping[str, np.ndarray] | None = None, noise: float | np.ndarray = NOISE, seed: int = 1,
    ) -> Explanation:  # fmt: skip
        known = None
        if of:
            names = [list(dict.fromkeys(key[i] for key in of)) for i in range(3)]
            light = np.zeros((*map(len, names), TILES, 3))
            for key, value in of.items():
                light[tuple(names[i].index(key[i]) for i in range(3))] = value
            known = Parts(*names, light, 0 * light)
        monkeypatch.setattr(parts, "load", lambda scene: known)
        _catalogue(monkeypatch, {"a": signatures or {}})
        return explanations.explain([seen(image, noise, seed)])

    return said


def _catalogue(monkeypatch: pytest.MonkeyPatch, of: Mapping[str, Mapping[str, np.ndarray]]) -> None:
    """Scenes, and the signatures of all mistakes in each."""
    names = list(dict.fromkeys(name for scene in of.values() for name in scene))

    def load(scene: str) -> Signatures:
        if scene not in of:
            raise ReferenceError_(f"there are no signatures for {scene}")
        image = np.array(list(of[scene].values())).reshape(-1, TILES, 3)
        return Signatures(list(of[scene]), image, np.full_like(image, 1e-10))

    monkeypatch.setattr(mistakes, "load", load)
    monkeypatch.setattr(mistakes, "complete_scenes", lambda: list(of))
    monkeypatch.setattr(mistakes, "catalogue", lambda: {n: Mistake(n, "L10", n, "") for n in names})


def named(found: Explanation) -> list[str]:
    return [mistake.name for mistake in found.mistakes]


def parts_of(found: Explanation) -> list[str]:
    return [" ".join(filter(None, (h.light, h.length, h.surface))) for h in found.parts]


TWO = {
    ("A", "direct", "floor"): area(0, 15), ("A", "two bounces", "floor"): area(15, 22),
    ("B", "direct", "wall"): area(22, 37), ("B", "two bounces", "wall"): area(37, 44),
}  # fmt: skip


# ---- conventions ----


@pytest.mark.parametrize("wrong", dict(pictures(reference())), ids=lambda convention: convention.words[:40])
def test_each_convention_is_said(explain: Told, wrong) -> None:
    """Of one that filters the noise would hide a tenth: less of it."""
    found = explain(dict(pictures(reference()))[wrong], noise=2e-4)
    assert found.convention is not None and found.convention.words == wrong.words


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda x: np.flip(x, 0), "upside down"),
        (lambda x: np.flip(x, 1), "left and right swapped"),
        (lambda x: np.rot90(x, 2), "turned by 180°"),
        (lambda x: np.stack([x[..., 2], x[..., 1], x[..., 0]], axis=-1), "red and blue are swapped"),
        (lambda x: np.concatenate([x[:1], (x[1:] + x[:-1]) / 2]), "half a pixel further down ("),
    ],
)
def test_conventions_are_what_their_words_say(explain: Told, made, words: str) -> None:
    found = explain(made(reference()), noise=2e-4)
    assert found.convention is not None and words in found.convention.words


@pytest.mark.parametrize("encode", [encode_srgb, lambda x: x ** (1 / 2.2), lambda x: x / (1 + x)])
def test_encodings_are_said(explain: Told, encode) -> None:
    found = explain(encode(reference()), TWO, noise=1e-3)
    assert found.convention is not None and "linear radiance is needed" in found.convention.words


@pytest.mark.parametrize("factor", [0.02, 0.5, 0.97, 1.03, 2.0, np.pi, 20.0, 30.0, 217.0, 1000.0])
def test_a_factor_is_a_factor(explain: Told, factor: float) -> None:
    """And nothing else, however large."""
    found = explain(factor * reference(), TWO, noise=NOISE * factor)
    assert found.convention == conventions.FACTOR
    assert found.factors[0].low < factor < found.factors[0].high


def test_a_turned_image_may_have_a_factor_too(explain: Told) -> None:
    said = sentences.explanation(explain(np.pi * reference()[::-1], noise=NOISE * 3))
    assert said.startswith("the image is upside down") and said.endswith("a factor of π")


def test_channels_may_have_factors_of_their_own(explain: Told) -> None:
    """It is not said that everything is off by one that suits none of them."""
    said = sentences.explanation(explain(reference() * [1.33, 1.0, 0.75], TWO))
    assert "too bright in red, right in green, " in said and "too dark in blue, as by another white" in said


# ---- parts ----


@pytest.mark.parametrize("bias", [-1.0, -0.3, 1.0])
def test_a_wrong_part_is_said(explain: Told, bias: float) -> None:
    found = explain(reference() + bias * enlarge(area(0, 22)), TWO)
    assert parts_of(found) == ["A"] and found.factors[0].low < 1 + bias < found.factors[0].high


def test_intervals_hold(explain: Told, monkeypatch: pytest.MonkeyPatch) -> None:
    """At 99 %: fewer than 27 of 30 would be by chance once in a hundred thousand times. Where a template is
    known exactly half of one is 2.576 standard deviations, which 18 images tell to 17 %.
    """
    wrong = reference() - 0.3 * enlarge(area(0, 22))
    said = [explain(wrong, TWO, seed=seed) for seed in range(30)]
    named = [one.factors[0] for one in said if parts_of(one) == ["A"]]
    assert sum(factor.low < 0.7 < factor.high for factor in named) >= 27
    monkeypatch.setattr(parts, "INEXACT", 1e-9)
    exact = [one.factors[0] for seed in range(30) if parts_of(one := explain(wrong, TWO, seed=seed)) == ["A"]]
    deviation = np.std([factor.value for factor in exact], ddof=1)
    assert 2.0 < np.mean([factor.high - factor.low for factor in exact]) / 2 / deviation < 3.4


def test_two_wrong_lights_are_not_said_as_one(explain: Told) -> None:
    wrong = reference() - 0.3 * enlarge(area(0, 22)) + 0.4 * enlarge(area(22, 44))
    found = explain(wrong, TWO)
    assert parts_of(found) == ["A", "B"]
    assert [round(factor.value, 1) for factor in found.factors] == [0.7, 1.4]


def test_a_surface_of_another_colour_has_a_factor_for_each_channel(explain: Told) -> None:
    found = explain(reference() + enlarge(area(22, 44)) * [0.5, 0.0, -0.5], TWO)
    assert parts_of(found) == ["B"] and [round(f.value, 1) for f in found.factors] == [1.5, 1.0, 0.5]


def test_a_part_has_no_less_light_than_none(explain: Told) -> None:
    """Twice as much missing as there is is something else."""
    assert parts_of(explain(reference() - 0.5 * enlarge(area(0, 22)), TWO)) == ["A"]
    bright = reference() + 1.0
    assert not explain(bright - 2 * enlarge(area(0, 22)) - 1.0, {k: 0.4 * v for k, v in TWO.items()})


def test_parts_that_can_stand_in_for_each_other_are_not_said(explain: Told) -> None:
    """Two lamps whose light differs in two tiles of 17, seen through noise and without."""
    of = {("A", "direct", "floor"): area(0, 15), ("B", "direct", "floor"): area(0, 14) + area(15, 17)}
    wrong = reference() - 0.3 * enlarge(area(0, 15))
    assert parts_of(explain(wrong, of)) == ["A"]
    assert not explain(wrong, of, noise=3.0)


def test_what_one_noisy_tile_would_tell_apart_is_not_said(explain: Told) -> None:
    """Two mistakes that differ in green alone, in a tile whose green nobody knows: neither of them."""
    one, other = area(5, 30), area(5, 30)
    other[20, 1] = 0.0
    noisy = np.full((HEIGHT, WIDTH, 3), NOISE)
    at = grid(HEIGHT, WIDTH)[20].window
    noisy[(*at, 1)] = 48.0
    wrong = reference() + enlarge(one)
    assert named(explain(wrong, signatures={"one": one, "other": other})) == ["one"]
    assert not explain(wrong, signatures={"one": one, "other": other}, noise=noisy)


def test_a_dim_light_s_factor_has_to_be_known_too(explain: Told) -> None:
    """Light A is half and B double, so dim that this is known to a quarter: nothing is said of either."""
    dim = 1.5e-3
    of = {("A", "direct", "floor"): area(0, 22), ("B", "direct", "wall"): area(22, 44, dim)}
    wrong = reference() - 0.5 * enlarge(area(0, 22)) + enlarge(area(22, 44, dim))
    assert not explain(wrong, of)
    assert parts_of(explain(wrong, of, noise=NOISE / 30)) == ["A", "B"]


def test_a_right_part_is_not_blamed_for_another(explain: Told) -> None:
    """Later bounces have no one factor; what is left of them, the direct light could make up for."""
    ramp = np.linspace(-1, 1, TILES)[:, None]
    whole = area(0, TILES)
    of = {
        ("A", "direct", "floor"): whole,
        ("A", "two bounces", "floor"): 0.3 * whole * (1 + 0.8 * ramp),
        ("A", "more bounces", "floor"): 0.3 * whole * (1 - 0.8 * ramp**2),
    }
    lost = 0.1 * of["A", "two bounces", "floor"]
    lost += 0.3 * of["A", "more bounces", "floor"] * (1 - 0.15 * ramp**2)
    said = sentences.explanation(explain(reference() - enlarge(lost), of))
    assert "more bounces is" in said and "direct" not in said


def test_what_is_left_is_not_missing() -> None:
    """An interval that reaches 0 is said as that."""
    assert said_of(0.08, 0.1, "", "direct").startswith("the direct light is 92 % ± 10")
    assert said_of(0.01, 0.02, "", "direct").startswith("the direct light is missing")


def test_what_no_part_explains_is_not_said(explain: Told) -> None:
    """Half of a light, and a chessboard."""
    assert not explain(reference() - 0.3 * enlarge(area(0, 11)), TWO)
    signs = np.where(np.arange(TILES) % 2, 0.1, -0.1)[:, None] * np.ones(3)
    assert not explain(reference() + enlarge(signs), TWO)


def test_a_smooth_error_is_no_part(explain: Told) -> None:
    """A picture that darkens towards its rim: nothing has a name for that, not even what is nearly so."""
    row = np.linspace(-1, 1, HEIGHT)[:, None, None]
    assert not explain(reference() * (1 - 0.2 * row**2), TWO, {"bright": -0.2 * area(0, 44)})
    whole = [region_means(x, grid(HEIGHT, WIDTH)) for x in (reference(), reference() * row**2)]
    signs = np.where(np.arange(TILES) % 2, 1.0, -1.0)[:, None]
    nearly = -0.2 * whole[1] * (1 + 0.04 * signs)
    assert not explain(reference() - 0.2 * reference() * row**2, signatures={"rim": nearly})
    assert named(explain(reference() + enlarge(nearly), signatures={"rim": nearly})) == ["rim"]


def test_nothing_is_said_where_noise_hides_the_rest(explain: Told) -> None:
    assert explain(reference() - 0.05 * enlarge(area(0, 22)), TWO)
    assert not explain(reference() - 0.05 * enlarge(area(0, 22)), TWO, noise=100 * NOISE)


def test_nothing_is_said_of_a_right_picture(explain: Told) -> None:
    for seed in range(20):
        assert not explain(reference(), TWO, {"a": area(0, 30)}, seed=seed)


# ---- mistakes ----


def test_a_mistake_is_said_at_its_own_strength_alone(explain: Told) -> None:
    """Within a tenth by its interval."""
    for strength, said in ((1.0, True), (1.05, True), (0.5, False), (1.2, False), (-1.0, False)):
        found = explain(reference() + strength * enlarge(area(5, 30)), signatures={"a": area(5, 30)})
        assert (named(found) == ["a"]) == said


def test_the_more_likely_mistake_is_said(explain: Told) -> None:
    of = {"b": area(5, 34), "a": area(5, 30), "c": area(10, 35)}
    assert named(explain(reference() + enlarge(area(5, 30)), signatures=of)) == ["a"]


def test_the_order_decides_nothing(explain: Told) -> None:
    of = {"a": area(5, 30), "b": area(5, 30, 0.499), "c": area(20, 40)}
    told = [sorted(named(explain(reference() + enlarge(area(5, 30)), signatures=dict(order))))
            for order in (of.items(), reversed(of.items()))]  # fmt: skip
    assert told == [["a", "b"], ["a", "b"]], "what looks alike is said together"


def test_a_mistake_that_leaves_a_tenth_is_not_said(explain: Told) -> None:
    """It accounts for 98 % of the squared error, or it is another one."""
    rest = np.where(np.arange(TILES) % 2, 1.0, -1.0)[:, None] * np.ones(3) * 0.5
    for size, said in ((0.02, True), (0.3, False)):
        wrong = enlarge(area(0, TILES) + size * rest)
        assert bool(named(explain(reference() + wrong, signatures={"a": area(0, TILES)}))) == said


def test_what_leaves_more_than_noise_is_not_said(explain: Told) -> None:
    """It may account for 98 % of the squared error and be another one: a factor that varies over the picture,
    and beside a part of the light a mistake that is only much like it.
    """
    signs = np.where(np.arange(TILES) % 2, 1.0, -1.0)[:, None] * np.ones(3)
    for size, said in ((0.0, True), (0.11, False)):
        assert bool(explain(reference() - 0.3 * enlarge(area(0, 22) * (1 + size * signs)), TWO)) == said
    like = {"like": -0.3 * area(0, 22) * (1 + 0.12 * signs), "same": -0.3 * area(0, 22)}
    found = explain(reference() - 0.3 * enlarge(area(0, 22)), TWO, like)
    assert parts_of(found) == ["A"] and named(found) == ["same"]


def test_a_mistake_leaves_the_light_that_is_there(explain: Told) -> None:
    """An eighth of a light is not a quarter of it, though what is missing is nearly the same."""
    dim = {"quarter": -0.75 * area(0, 22), "half": -0.5 * area(0, 22)}
    for left, said in ((0.25, ["quarter"]), (0.2, []), (0.5, ["half"])):
        found = explain(reference() - (1 - left) * enlarge(area(0, 22)), TWO, dim)
        assert parts_of(found) == ["A"] and named(found) == said


def test_each_channel_has_to_be_explained(explain: Told) -> None:
    wrong = enlarge(area(5, 30) * [1.0, 1.0, 0.6])
    assert not explain(reference() + wrong, signatures={"a": area(5, 30)})


def test_two_mistakes_at_once_are_parts_at_most(explain: Told) -> None:
    of = {"a": area(5, 30), "b": area(20, 40)}
    assert not named(explain(reference() + enlarge(of["a"] + of["b"]), TWO, of))


def test_a_scene_that_comes_out_right_rules_mistakes_out(
    explain: Told, monkeypatch: pytest.MonkeyPatch
) -> None:
    twins = {"a": area(5, 30), "b": area(5, 30)}
    assert named(explain(reference() + enlarge(area(5, 30)), signatures=twins)) == [
        "a", "b",
    ]  # fmt: skip
    _catalogue(monkeypatch, {"a": {"a": area(5, 30), "b": area(5, 30)}, "second": {"b": area(10, 20)}})
    right = seen(reference(), seed=2, scene="second")
    wrong = seen(reference() + enlarge(area(5, 30)))
    assert named(explanations.explain([wrong, right])) == ["a"]
    assert mistakes.telling_scene(["a", "b"]) == "second"
    assert "b" in named(
        explanations.explain([wrong, seen(reference() + enlarge(area(10, 20)), 0.01, 2, "second")])
    )


def test_over_several_scenes_the_unknown_has_a_place(explain: Told, monkeypatch: pytest.MonkeyPatch) -> None:
    """A part of one scene explains it better than the mistake, another picture; then the same one."""
    mistake, part = area(5, 30), area(5, 30)
    part[20:26] *= 1.3
    light = Parts(
        ["A", "B"],
        ["direct"],
        ["floor"],
        np.stack([part, area(32, 40)])[:, None, None],
        np.zeros((2, 1, 1, TILES, 3)),
    )
    _catalogue(monkeypatch, {"a": {"m": mistake}, "second": {"other": area(10, 20)}})
    monkeypatch.setattr(parts, "load", lambda scene: light if scene == "a" else None)
    right = seen(reference(), seed=2, scene="second")
    assert not explanations.explain([seen(reference() + enlarge(part)), right])
    assert named(explanations.explain([seen(reference() + enlarge(mistake)), right])) == ["m"]
    light.image[0, 0, 0] = mistake
    assert named(explanations.explain([seen(reference() + enlarge(mistake)), right])) == ["m"]


def test_what_is_left_out_is_not_said(explain: Told, monkeypatch: pytest.MonkeyPatch) -> None:
    _catalogue(monkeypatch, {"a": {"a": area(5, 30)}})
    monkeypatch.setattr(parts, "load", lambda scene: None)
    wrong = seen(reference() + enlarge(area(5, 30)))
    assert named(explanations.explain([wrong])) == ["a"]
    assert not explanations.explain([wrong], without=["a"])


def test_the_second_set_has_to_confirm(explain: Told, monkeypatch: pytest.MonkeyPatch) -> None:
    """Images that are wrong in their first half alone."""
    _catalogue(monkeypatch, {"a": {"a": area(5, 30)}})
    monkeypatch.setattr(parts, "load", lambda scene: None)
    wrong, right = seen(reference() + enlarge(area(5, 30))), seen(reference())
    mixed = Look("a", wrong.truth, (wrong.sets[0], right.sets[1]), {})
    assert named(explanations.explain([wrong])) == ["a"]
    assert not explanations.explain([mixed])


# ---- the fit ----


def test_a_fit_is_generalised_least_squares() -> None:
    """One value per tile, correlated channels: c = TᵀV⁻¹D / TᵀV⁻¹T, and its deviation."""
    rng = np.random.default_rng(0)
    template, error = rng.standard_normal((2, 5, 3))
    noise = np.broadcast_to(0.1 * np.eye(3) + 0.05, (5, 3, 3))
    found = fitting.fit(error, noise, fitting.stack(template[None, None], inexact=0.0))
    inverse = np.linalg.inv(noise[0])
    information = np.einsum("ti,ij,tj->", template, inverse, template)
    value = np.einsum("ti,ij,tj->", template, inverse, error) / information
    assert found.strengths[0, 0] == pytest.approx(value)
    assert found.deviations[0, 0] == pytest.approx(information**-0.5)
    rest = error - value * template
    chi = np.einsum("ti,ij,tj->", rest, inverse, rest)
    expected = -(chi + 5 * np.linalg.slogdet(noise[0])[1] + np.log(15)) / 2
    assert found.likelihood[0] == pytest.approx(expected)


def test_each_free_strength_costs() -> None:
    """Schwarz: half of ln n."""
    rng = np.random.default_rng(0)
    templates, error = rng.standard_normal((2, 5, 3)), rng.standard_normal((5, 3))
    noise = np.broadcast_to(np.eye(3), (5, 3, 3))
    found = fitting.fit(error, noise, fitting.stack(templates[None], inexact=0.0))
    values, rest = np.linalg.lstsq(templates.reshape(2, -1).T, error.ravel(), rcond=None)[:2]
    assert found.strengths[0] == pytest.approx(values)
    assert found.likelihood[0] == pytest.approx(-(rest[0] + 2 * np.log(15)) / 2)


def test_decoded_likelihoods_are_brought_back() -> None:
    """Values that are twice as large have deviations twice as large: ln 2 for each."""
    look = seen(reference())
    twice = tuple(replace(one, variance=4 * one.variance) for one in look.sets)
    assert looks._stretch(look.sets, twice) == pytest.approx(TILES * 3 * np.log(2))


def test_what_is_accounted_for_has_to_be_known() -> None:
    """All of the error, to 1 % and to 3 % of its square."""
    ones = np.ones((TILES, 3))
    for share, said in ((0.01, True), (0.03, False)):
        variance = share * TILES / np.sqrt(2 * TILES)
        one = TileErrors("a", ones, variance * ones, np.broadcast_to(np.eye(3), (TILES, 3, 3)), ones)
        look = Look("a", seen(reference()).truth, (one, one), {})
        fits = fitting.fit(one.error, one.noise_blocks(), fitting.stack(ones[None, None]))
        group = candidates.Group([None], fitting.stack(ones[None, None]))
        standing = explanations.Standing(None, 0.0, group, 0, replace(fits, explained=ones[None]))
        assert explanations._accounts([look], standing) == said


def test_a_template_s_own_noise_and_inexactness_widen_the_interval() -> None:
    template, noise = np.ones((1, 1, 10, 3)), 1e-8 * np.broadcast_to(np.eye(3), (10, 3, 3))
    inexact = fitting.fit(np.ones((10, 3)), noise, fitting.stack(template, inexact=0.01))
    assert inexact.deviations[0, 0] == pytest.approx(0.01 / np.sqrt(30), rel=0.01)
    noisy = fitting.fit(
        np.ones((10, 3)), noise, fitting.stack(template, np.full((1, 1, 10, 3), 0.04), inexact=0.0)
    )
    assert noisy.deviations[0, 0] == pytest.approx(0.2 / np.sqrt(30), rel=0.01)


# ---- words ----


def said_of(value: float, half: float, *of: str) -> str:
    factor = Factor(value, value - half, value + half)
    return sentences.explanation(Explanation(parts=(Hypothesis(*of),), factors=(factor,)))


def test_parts_in_words() -> None:
    assert said_of(2.0, 0.1, "light 2 of 8", "", "floor") == (
        "light 2 of 8 on “floor” is 2.0 ± 0.1 times as bright as it should be; everything else agrees"
    )
    assert said_of(0.0, 0.01, "", "two bounces").startswith(
        "the light after two bounces is missing; everything"
    )
    assert said_of(0.5, 0.01, "", "", "the lamp").startswith("the lamp is 50 % ± 1.00 % too dark; everything")
    assert said_of(1.5, 0.01, "", "direct").startswith("the direct light is 50 % ± 1.00 % too bright; every")


def test_the_part_that_is_furthest_off_comes_first() -> None:
    values = {"A": 1.1, "B": 0.5, "C": 1.3, "D": 1.0}
    found = Explanation(
        parts=tuple(Hypothesis(name) for name in values),
        factors=tuple(Factor(value, value - 0.01, value + 0.01) for value in values.values()),
    )
    said = sentences.explanation(found)
    assert [part[0] for part in said.split("; ")[:3]] == ["B", "C", "A"] and "D is" not in said


def factor_in_words(value: float, half: float, lights: int = 1) -> str:
    factor = Factor(value, value - half, value + half)
    return sentences.explanation(Explanation(conventions.FACTOR, factors=(factor,)), lights)


def test_factors_in_words() -> None:
    assert (
        factor_in_words(2.0, 0.001)
        == "everything is 2.0000 ± 0.0010 times as bright as it should be, a factor of 2"
    )
    assert factor_in_words(3.1, 0.05).endswith("3.10 ± 0.05 times as bright as it should be, a factor of π")
    assert "a factor of" not in factor_in_words(3.1, 0.2), "a wide interval holds many numbers"
    assert factor_in_words(3.0, 0.01, lights=3).endswith("a factor of 3, the number of lights")
    assert factor_in_words(0.5, 0.001) == "everything is 50 % ± 0.10 % too dark, a factor of 1/2"
    assert factor_in_words(1.19, 0.001) == "everything is 19.0 % ± 0.100 % too bright"


def test_values_above_1_can_be_decoded_unless_they_were_cut_there() -> None:
    """By a curve that goes on there."""
    for encoding in ENCODINGS:
        mapped = "x / (1 + x)" in encoding.convention.words
        assert encoding.decodes(np.array([0.2, 0.9])) and not encoding.decodes(np.array([0.2, 1.0]))
        assert encoding.decodes(np.array([0.2, 2.3])) != mapped
