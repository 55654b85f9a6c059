"""In every scene, what one technique samples is weighed by the densities of the others: no
reference is needed.

Points of lights, as the first surface that a camera ray meets sees them, are sampled by going on from
there, and by choosing a light and a point of it, in several ways. Where p and q are the densities that the
samples of two ways follow,

    E over p's samples of q/(p + q) = ∫ p q/(p + q) dω = E over q's samples of p/(p + q),

sums over all lights included. Both are bounded, so that the central limit holds however near a lamp is.
Another technique's density, a part of a light that is never sampled, or a chance that is not the one of
choosing makes them differ.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from building import ROOT
from sampling import Array, Driver, uniforms
from scipy import stats

SKIES = {"environment", "open-sky", "textured-room"}
UNSEEN = SKIES | {"point-light", "sun-and-spot", "metal", "glass-pane", "mirror-corridor"}
"""There no ray comes to a light from what the camera sees, but by a mirror, glass or out of the scene."""
TURNED = {"bump"}
"""There light is sampled that the surface sees, but not the bump on it, which no material sends any to."""
SCENES = [file for file in sorted((ROOT / "scenes").glob("*.xml")) if file.stem not in UNSEEN | TURNED]
BY_LIGHT = (("uniform", "area"), ("power", "facing"), ("contribution", "cone"))
"""How a light is chosen, and how a point of it."""
SAMPLES = 10_000
FALSE_ALARMS = 1e-4
"""Of all pairs in all scenes together, of one choice of seeds."""
LEVEL = -np.expm1(np.log1p(-FALSE_ALARMS) / (len(SCENES) * 10))
ROUNDING = 1e-9


@dataclass(frozen=True)
class Receivers:
    """Surfaces that camera rays meet, no mirrors and no glass."""

    ray: Array
    """(6, n)"""
    at: Array
    """(7, n) point, normal, slot"""

    @classmethod
    def of(cls, driver: Driver, scene: int) -> Receivers:
        """SAMPLES of them, the same more than once if need be."""
        ray = driver("film_ray", 32 * uniforms(SAMPLES, 1), scene=scene)[:6]
        at = driver("receiver", ray, scene=scene)
        assert at[7].any(), "all is mirror or glass"
        chosen = np.resize(np.flatnonzero(at[7]), SAMPLES)
        return cls(ray[:, chosen], at[:7, chosen])


@dataclass(frozen=True)
class Seen:
    """Lights and the directions to them; a light below 0 is none."""

    light: Array
    wi: Array


@dataclass(frozen=True)
class Way:
    """A way to sample lights, and the density that it is said to have."""

    driver: Driver
    scene: int
    receivers: Receivers

    def __call__(self, entry: str, *columns: Array) -> Array:
        return self.driver(entry, *columns, scene=self.scene)

    def met(self, wi: Array) -> Array:
        """(light, distance, cosine, 1/pdf_w) of what is met; light -1: none, or below the horizon."""
        found = self("light_hit", self.receivers.at, wi)
        found[0, (self.receivers.at[3:6] * wi).sum(axis=0) <= 0] = -1
        return found


class Bounce(Way):
    """By the material."""

    def sample(self, seed: int) -> Seen:
        out = self("scatter", self.receivers.ray, uniforms(SAMPLES, seed, rows=4))
        return Seen(np.where(out[7] > 0, -1, self.met(out[:3])[0]), out[:3])

    def pdf(self, seen: Seen) -> Array:
        return np.asarray(self("evaluate", self.receivers.ray, seen.wi)[3])


class ByLight(Way):
    """One of the lights, and a point of it that nothing hides."""

    def sample(self, seed: int) -> Seen:
        u = uniforms(SAMPLES, seed, rows=4)
        light = self("choose", self.receivers.at, u[:2])[0]
        out = self("light_sample", self.receivers.at, light, u[2:])
        return Seen(np.where((self.met(out[:3])[0] == light) & (out[7] > 0), light, -1), out[:3])

    def pdf(self, seen: Seen) -> Array:
        choice = self("choice_of", self.receivers.at, np.maximum(seen.light, 0))[0]
        return np.asarray(1 / (choice * self.met(seen.wi)[3]))


@dataclass(frozen=True)
class Told:
    """A way whose density is said to be another's."""

    sampled: ByLight
    told: ByLight

    def sample(self, seed: int) -> Seen:
        return self.sampled.sample(seed)

    def pdf(self, seen: Seen) -> Array:
        return self.told.pdf(seen)


Ways = Bounce | ByLight | Told


def shares(p: Ways, q: Ways, seed: int) -> Array:
    """q/(p + q) of p's samples."""
    seen = p.sample(seed)
    lit = seen.light >= 0
    with np.errstate(divide="ignore", invalid="ignore"):
        own, other = p.pdf(seen), q.pdf(seen)
    assert (own[lit] > 0).all(), "a sample that its own density says cannot be"
    assert (other[lit] > 0).all(), "what one technique samples has no chance in the other"
    return np.where(lit, other / np.where(lit, own + other, 1), 0)


def p_value(p: Ways, q: Ways, seed: int) -> tuple[float, bool]:
    """Of "both shares have the same mean", and whether anything is seen."""
    one, other = shares(p, q, seed), shares(q, p, seed + 1)
    difference, error = one.mean() - other.mean(), np.sqrt((one.var() + other.var()) / SAMPLES)
    seen = bool(one.any() or other.any())
    if error < ROUNDING:  # the same density: ½ each
        return float(abs(difference) < ROUNDING), seen
    return float(2 * stats.norm.sf(abs(difference) / error)), seen


@contextmanager
def ways(
    driver: Driver, file: Path, by_light: Sequence[tuple[str, str]]
) -> Iterator[tuple[list[Bounce], list[ByLight]]]:
    with ExitStack() as opened:

        def scene(hemisphere: str = "cosine", choice: str = "uniform", points: str = "area") -> int:
            way = driver.scene(file, hemisphere=hemisphere, choice=choice, points=points)
            return opened.enter_context(way)

        bounces = [scene(hemisphere=hemisphere) for hemisphere in ("uniform", "cosine")]
        receivers = Receivers.of(driver, bounces[0])
        lights = [scene(choice=choice, points=points) for choice, points in by_light]
        yield [Bounce(driver, s, receivers) for s in bounces], [ByLight(driver, s, receivers) for s in lights]


@pytest.mark.parametrize("file", SCENES, ids=lambda file: file.stem)
def test_techniques_agree_on_what_they_see_of_lights(driver: Driver, file: Path) -> None:
    with ways(driver, file, BY_LIGHT) as (bounces, lights):
        all_ways: list[Ways] = [*bounces, *lights]
        pairs = itertools.combinations(all_ways, 2)
        found = [p_value(p, q, 10 + 2 * number) for number, (p, q) in enumerate(pairs)]
    assert any(seen for _, seen in found)
    assert min(p for p, _ in found) > LEVEL


@pytest.mark.parametrize(
    ("name", "points", "told"),
    [
        ("touching-light", ("uniform", "cone"), ("uniform", "area")),
        ("many-lights", ("power", "area"), ("uniform", "area")),
        ("many-lights", ("contribution", "area"), ("power", "area")),
        ("spherical-light", ("power", "cone"), ("power", "facing")),
        ("mesh-light", ("contribution", "area"), ("uniform", "area")),
    ],
)
def test_another_techniques_density_is_noticed(
    driver: Driver, name: str, points: tuple[str, str], told: tuple[str, str]
) -> None:
    with ways(driver, ROOT / f"scenes/{name}.xml", [points, told]) as (_, (one, other)):
        assert p_value(Told(one, other), one, 10)[0] < LEVEL
