"""Who competes to explain wrong pictures: conventions, parts of the light, catalogued mistakes.

Beside them stand rivals that say nothing: right pictures, a factor for each part and channel, a smooth
field of factors. So the unknown has a place.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.errors import ReferenceError_
from raycheck.judging import conventions, mistakes, parts
from raycheck.judging.conventions import ENCODINGS, FACTOR, WHITE, Convention, Encoding
from raycheck.judging.fitting import Stack, stack
from raycheck.judging.looks import Look
from raycheck.judging.mistakes import Mistake
from raycheck.judging.parts import Hypothesis, Part
from raycheck.stats.tiles import grid, region_means

USUAL = 0.1
"""How far the strength of an explanation may be from what it is by nature."""
LEFT = 0.07
"""What a mistake may be off relative to the light that it leaves…"""
LEAST_LEFT = 0.02
"""…but no less than that of what it does, where it leaves none."""
SIMILAR = 0.05
"""What a mistake may be off in a tile, relative to its signature: others make it a little differently."""
DEGREE = 3
"""Of the smooth field, in each direction of the image."""

Subject = Convention | Mistake | tuple[Hypothesis, ...] | None
"""What a candidate says; None says nothing."""


@dataclass(frozen=True)
class Group:
    """Candidates of one shape."""

    subjects: Sequence[Subject]
    of: Stack
    usual: float | None = None
    """The strength by nature."""
    within: Sequence[float] = ()
    """How far from it mistakes may be to be just what is seen."""
    offset: float = 0.0
    """Of a factor over the strength of its direction."""
    encoding: Encoding | None = None
    """The values are decoded first."""


def groups(looks: Sequence[Look], without: Sequence[str]) -> Iterator[Group]:
    yield right(looks)
    yield from _conventions(looks)
    yield from _mistakes(looks, without)
    if len(looks) == 1:
        yield from of_one_scene(looks[0])


def right(looks: Sequence[Look]) -> Group:
    tiles = sum(len(look.sets[0].error) for look in looks)
    return Group([None], stack(np.zeros((1, 0, tiles, 3))))


def _conventions(looks: Sequence[Look]) -> Iterator[Group]:
    by_look = [dict(conventions.pictures(look.truth.mean)) for look in looks]
    tiles = [grid(*look.truth.shape) for look in looks]
    common = [c for c in by_look[0] if all(c in others for others in by_look)]
    truth = np.concatenate([region_means(look.truth.mean, t) for look, t in zip(looks, tiles, strict=True)])
    shown = {
        c: np.concatenate([region_means(of[c], t) for of, t in zip(by_look, tiles, strict=True)])
        for c in common
    }
    changed = np.stack([shown[c] - truth for c in common])
    yield Group(common, stack(changed[:, None], low=1 - USUAL, high=1 + USUAL), usual=1.0)
    turned = [c for c in common if c.words in conventions.TURNS]
    scaled = [FACTOR, *(Convention(c.words, factors=1) for c in turned)]
    directions = np.stack([truth, *(shown[c] for c in turned)])[:, None]
    base = np.broadcast_to(-truth, (len(scaled), *truth.shape))
    yield Group(scaled, stack(directions, base=base, low=0.0))
    yield Group([WHITE], stack(_by_channel(truth[None]), base=-truth[None], low=0.0))
    for encoding in ENCODINGS:
        if all(encoding in look.decoded for look in looks):
            yield Group([encoding.convention], stack(np.zeros((1, 0, *truth.shape))), encoding=encoding)


def _mistakes(looks: Sequence[Look], without: Sequence[str]) -> Iterator[Group]:
    """None where nothing is known of a scene."""
    try:
        found = list(mistakes.signatures_in([look.scene for look in looks]))
    except ReferenceError_:
        return
    known = [one for one in found if one.of.name not in without]
    if known:
        errors, variance = (
            np.stack(x)[:, None] for x in ([s.error for s in known], [s.variance for s in known])
        )
        of = stack(errors, variance, low=1 - USUAL, high=1 + USUAL, inexact=SIMILAR)
        yield Group([one.of for one in known], of, usual=1.0, within=_within(looks, errors[:, 0]))


def _within(looks: Sequence[Look], errors: Array) -> list[float]:
    """How far from 1 the strength of mistakes (M, T, 3) may be: by USUAL of what they do, and by LEFT of the
    light that they leave. A quarter of a light is not an eighth of it.
    """
    of_tiles = [region_means(look.truth.mean, grid(*look.truth.shape)) for look in looks]
    truth, scale = np.concatenate(of_tiles), np.concatenate([look.sets[0].scale for look in looks])
    there = (errors / scale) ** 2
    left = np.minimum(((truth + errors) / scale) ** 2, (USUAL / LEFT) ** 2 * there)
    share = np.sqrt(left.sum(axis=(1, 2)) / np.maximum(there.sum(axis=(1, 2)), 1e-300))
    return [max(LEFT * one, LEAST_LEFT) for one in share.tolist()]


def of_one_scene(look: Look) -> Iterator[Group]:
    """Parts of the light with another factor, for all channels or for each, and families of parts; then the
    rivals that say nothing.
    """
    truth = region_means(look.truth.mean, grid(*look.truth.shape))
    of = parts.load(look.scene)
    if of is not None and of.image.shape[3] == len(truth):
        found = [part for part in parts.hypotheses(of) if part.of.says]
        names = [(part.of,) for part in found]
        images, variance = _templates(found)
        yield Group(names, _free(images[:, None], variance[:, None]), offset=1.0)
        yield Group(names, _free(_by_channel(images), _by_channel(variance)), offset=1.0)
        for family in parts.families(of, found):
            images, variance = _templates(family)
            yield Group([tuple(p.of for p in family)], _free(images[None], variance[None]), offset=1.0)
            yield Group([None], _free(*(np.concatenate(_by_channel(x))[None] for x in (images, variance))))
    yield Group([None], stack(_smooth(look, truth)[None]))


def _templates(found: Sequence[Part]) -> tuple[Array, Array]:
    """(M, T, 3) each."""
    return np.stack([part.image for part in found]), np.stack([part.variance for part in found])


def _free(images: Array, variance: Array) -> Stack:
    """Parts with any factor, down to none."""
    return stack(images, variance, low=-1.0, inexact=parts.INEXACT)


def _by_channel(images: Array) -> Array:
    """(M, 3, T, 3) of (M, T, 3): each channel alone."""
    return np.asarray(np.einsum("mti,ki->mkti", images, np.eye(3)))


def _smooth(look: Look, truth: Array) -> Array:
    """(k, T, 3) the picture times each polynomial of the place, in each channel."""
    height, width = look.truth.shape
    tiles = grid(height, width)
    y = np.array([2 * (t.row + t.height / 2) / height - 1 for t in tiles])
    x = np.array([2 * (t.column + t.width / 2) / width - 1 for t in tiles])
    terms = [x**i * y**j for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i)]
    fields = np.stack([term[:, None] * truth for term in terms])
    return np.concatenate(_by_channel(fields), axis=0)
