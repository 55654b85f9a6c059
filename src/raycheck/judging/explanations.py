"""Which explanation of wrong pictures may be said? All of them compete, in one place, by one measure.

Who competes is in `candidates`, how likely each is in `fitting`. The likeliest of K candidates has to
lead by ln(49 K), which makes it 98 % sure if all were equally likely before. It is chosen on the first set of
images; the second, which had no part in the choice, has to confirm the lead, a strength that is within 10 %
of what it is by nature, by a 99 % interval, and 98 % of the squared error of each channel of each scene.

What is as likely as the best must be the same picture, or nothing is said. All of it is said together, and
with it all mistakes that are the same picture, likely or not, since others make them a little differently.
"""

import functools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from raycheck.base.arrays import Array
from raycheck.judging import candidates, fitting
from raycheck.judging.candidates import USUAL, Group, Subject
from raycheck.judging.conventions import Convention
from raycheck.judging.fitting import Fits
from raycheck.judging.looks import Look
from raycheck.judging.mistakes import Mistake
from raycheck.judging.parts import Hypothesis

CERTAINTY = 0.99
"""Confidence of the interval of a strength."""
SHARE = 0.98
"""Share of the squared error that an explanation has to account for…"""
SHARE_ERROR = 0.02
"""…and the standard error within which that must be known, in the channel where it is known best."""
LITTLE = 0.05
"""Squared error of a channel, relative to the worst of all, below which its share is taken of this."""
SURELY = 0.98
"""How sure the best must be, if all were equally likely before."""
REFUTED = 5.0
"""Standard deviations by which χ² may exceed its mean with what is said: what is left then is no noise."""
SHARP = 0.1
"""Half of the interval of a free factor over its size, beyond which it is too little known to be said."""
LEAK = 0.05
"""What the factor of a part may vary by over the picture: a mistake may change a later bounce the more."""


@dataclass(frozen=True)
class Factor:
    """What is there over what should be, with its 99 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Near:
    """A mistake, and what it accounts for."""

    mistake: Mistake
    share: float
    """Of the squared error, in the channel and scene where that is least; less than 0 where it adds to it."""


@dataclass(frozen=True)
class Explanation:
    """What accounts for all of the error. Everything here is the same picture in the scenes looked at."""

    convention: Convention | None = None
    parts: tuple[Hypothesis, ...] = ()
    """The part of the light that is wrong, or several of one kind."""
    factors: tuple[Factor, ...] = ()
    """Of the convention or of each part; of one alone three, if each channel has its own."""
    mistakes: tuple[Mistake, ...] = ()
    nearest: tuple[Near, ...] = ()
    """The likeliest three mistakes, whether or not one may be said."""

    def __bool__(self) -> bool:
        return bool(self.convention or self.parts or self.mistakes)


NOTHING = Explanation()


@dataclass(frozen=True)
class Standing:
    """A candidate after a round."""

    subject: Subject
    likelihood: float
    group: Group
    index: int
    fits: Fits

    @property
    def explained(self) -> Array:
        """(T, 3), of all scenes."""
        return np.asarray(self.fits.explained[self.index])

    def factors(self) -> tuple[Factor, ...]:
        """By the noise, and what several parts may take from each other."""
        values = self.fits.strengths[self.index] + self.group.offset
        half = self._half() + self._leak()
        return tuple(Factor(v, v - h, v + h) for v, h in zip(values.tolist(), half.tolist(), strict=True))

    def _half(self) -> Array:
        return np.asarray(-special.ndtri((1 - CERTAINTY) / 2) * self.fits.deviations[self.index])

    def _leak(self) -> Array | float:
        """Each of several parts may be off by as much as the others would add to it, if LEAK of what is said
        of them were something else.
        """
        if not isinstance(self.subject, tuple) or len(self.subject) == 1:
            return 0.0
        strengths = np.abs(self.fits.strengths[self.index])
        images = self.group.of.directions[self.index].reshape(len(strengths), -1)
        overlap = images @ images.T
        shared = overlap / np.maximum(np.diag(overlap), 1e-300)[:, None] - np.eye(len(strengths))
        return np.asarray(LEAK * shared @ strengths)

    def fits_well(self) -> bool:
        """Whether what it leaves is no more than noise, and what it may be off by nature."""
        return bool(self.fits.misfit[self.index] <= REFUTED)

    def just_that(self) -> bool:
        """Whether a mistake leaves just the light that is there; other candidates need not."""
        off = np.abs(self.fits.strengths[self.index] - 1)
        return not self.group.within or bool(np.all(off <= self.group.within[self.index]))

    def sharp(self) -> bool:
        """Whether its strengths are what they are by nature, or else known well enough to be said."""
        strengths, half, usual = self.fits.strengths[self.index], self._half(), self.group.usual
        if usual is not None:
            return bool(np.all(np.abs(strengths - usual) <= USUAL - half))
        most = np.abs(strengths + self.group.offset - 1).max(initial=0.0)
        return bool(np.all(half <= SHARP * most))


def explain(looks: Sequence[Look], without: Sequence[str] = ()) -> Explanation:
    """What may be said of pictures of a scene, or of several scenes by one renderer; `without` are mistakes
    that are left out of the catalogue. Parts of the light are told of one scene alone.
    """
    groups = list(candidates.groups(looks, without))
    first, second = _round(looks, groups, 0), _round(looks, groups, 1)
    lead = math.log(SURELY / (1 - SURELY) * len(first))
    nearest = _nearest(looks, second)
    best = max(first, key=lambda s: s.likelihood)
    near = [n for n, s in enumerate(first) if s.likelihood > best.likelihood - lead]
    rest = [s.likelihood for n, s in enumerate(second) if n not in near]
    confirmed = max(second[n].likelihood for n in near) > max(rest, default=-math.inf) + lead
    same = [second[n] for n in near if _same(looks, best, first[n])]
    if not confirmed or len(same) < len(near):
        return Explanation(nearest=nearest)
    alike = [
        second[n] for n, s in enumerate(first) if isinstance(s.subject, Mistake) and _same(looks, best, s)
    ]
    sayable = [s for s in (*same, *alike) if s.subject is not None]
    found = [s for s in sayable if s.sharp() and s.fits_well() and _accounts(looks, s)]
    exact = [s for s in found if s.just_that()]
    if all(isinstance(s.subject, Mistake) for s in found) and exact:
        exact = found  # what no picture here tells from the one that it is, is said with it
    return replace(_said(exact), nearest=nearest)


def _nearest(looks: Sequence[Look], standings: Sequence[Standing]) -> tuple[Near, ...]:
    known = [(s.subject, s) for s in standings if isinstance(s.subject, Mistake)]
    known.sort(key=lambda pair: -pair[1].likelihood)
    return tuple(Near(mistake, float(_share(looks, s)[0].min())) for mistake, s in known[:3])


def _same(looks: Sequence[Look], one: Standing, other: Standing) -> bool:
    """Whether two candidates are the same picture in all scenes."""
    squares = []
    for look, at in _windows(looks):
        a, b = (s.explained[at] / look.sets[0].scale for s in (one, other))
        squares.append((((a - b) ** 2).sum(axis=0), np.maximum((a**2).sum(axis=0), (b**2).sum(axis=0))))
    rest, there = _floored(squares)
    return bool(np.all(rest <= (1 - SHARE) * there))


def _accounts(looks: Sequence[Look], of: Standing) -> bool:
    """Whether it accounts for the error in each scene and channel of the second set."""
    share, error = _share(looks, of)
    return bool(error.min() <= SHARE_ERROR and np.all(share + 2 * error >= SHARE))


def _share(looks: Sequence[Look], of: Standing) -> tuple[Array, Array]:
    """(scenes × 3,) share of the squared error of the second set that is accounted for, less what is noise,
    relative to the larger of what is there and what is explained; and the standard error of that.
    """
    squares, spread = [], []
    for look, at in _windows(looks):
        raw = look.sets[1]
        left = look.decoded[of.group.encoding][0][1] if of.group.encoding else raw
        explained, square = of.explained[at], 1 / raw.scale**2
        noise = (left.variance * square).sum(axis=0)
        rest = ((left.error - explained) ** 2 * square).sum(axis=0) - noise
        there = ((raw.error**2 - raw.variance) * square).sum(axis=0)
        squares.append((rest, np.maximum(there, (explained**2 * square).sum(axis=0))))
        spread.append(np.sqrt(2 * ((left.variance * square) ** 2).sum(axis=0)))
    rest, there = _floored(squares)
    return 1 - rest / there, np.concatenate(spread) / there


def _floored(squares: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    """What is left and what is there, of all scenes and channels; never less than LITTLE of the most."""
    rest, there = (np.concatenate([pair[i] for pair in squares]) for i in (0, 1))
    return rest, np.maximum(there, max(LITTLE * there.max(), 1e-300))


def _windows(looks: Sequence[Look]) -> Iterator[tuple[Look, slice]]:
    """Each scene and where its tiles stand among those of all."""
    start = 0
    for look in looks:
        count = len(look.sets[0].error)
        yield look, slice(start, start + count)
        start += count


def _said(same: list[Standing]) -> Explanation:
    """Of what is the same picture a convention, or the part that says least, and all mistakes."""
    named = tuple(dict.fromkeys(s.subject for s in same if isinstance(s.subject, Mistake)))
    whole = [(s.subject, s) for s in same if isinstance(s.subject, Convention)]
    of_parts = [(s.subject, s) for s in same if isinstance(s.subject, tuple)]
    if whole:
        return Explanation(whole[0][0], factors=whole[0][1].factors(), mistakes=named)
    if not of_parts:
        return Explanation(mistakes=named)
    subject, standing = min(of_parts, key=lambda p: (len(p[1].factors()), sum(h.says for h in p[0])))
    return Explanation(parts=subject, factors=standing.factors(), mistakes=named)


def _round(looks: Sequence[Look], groups: Sequence[Group], number: int) -> list[Standing]:
    """All candidates by the first or the second set of images, in the same order."""
    found = []
    for group in groups:
        code = group.encoding
        seen = [(look.decoded[code][0] if code else look.sets)[number] for look in looks]
        fits = fitting.fit(
            np.concatenate([one.error for one in seen]),
            np.concatenate([one.noise_blocks() for one in seen]), group.of,
        )  # fmt: skip
        shift = sum(look.decoded[code][1] for look in looks) if code else 0.0
        for index, subject in enumerate(group.subjects):
            likelihood = float(fits.likelihood[index]) + shift
            found.append(Standing(subject, likelihood, group, index, fits))
    return found + ([_unknown(looks, number)] if len(looks) > 1 else [])


def _unknown(looks: Sequence[Look], number: int) -> Standing:
    """In each of several scenes whatever explains that scene best: parts of the light, or nothing sayable."""
    alone = [_best_alone(look, number) for look in looks]
    whole = np.concatenate([one.explained for one in alone])[None]
    nothing = np.zeros((1, 0))
    fits = Fits(nothing, nothing, np.zeros(1), whole, np.zeros(1))
    return Standing(None, sum(one.likelihood for one in alone), alone[0].group, 0, fits)


@functools.lru_cache(maxsize=1024)
def _best_alone(look: Look, number: int) -> Standing:
    """What explains one scene best."""
    of_one = [candidates.right([look]), *candidates.of_one_scene(look)]
    return max(_round([look], of_one, number), key=lambda s: s.likelihood)
