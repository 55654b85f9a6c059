"""The only table of technique names: what each is in the lecture, oneray's options for it, and when it
applies.
"""

import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

DELTA_LIGHTS = frozenset({"point", "spot", "directional"})
"""Emitters that no random ray can hit."""


@dataclass(frozen=True)
class SceneContent:
    """What decides whether a technique applies to a scene."""

    lights: int
    delta_lights: int
    max_depth: int
    """Mitsuba's meaning: 1 emission only, 2 direct light, −1 no limit."""
    rr_depth: int

    @property
    def has_indirect(self) -> bool:
        return self.max_depth == -1 or self.max_depth > 2

    @property
    def has_area_light(self) -> bool:
        return self.lights > self.delta_lights

    @property
    def has_roulette(self) -> bool:
        return self.max_depth == -1 or self.rr_depth < self.max_depth


def read_content(scene: Path, parameters: Mapping[str, str] | None = None) -> SceneContent:
    """What techniques need to know of a scene file; `parameters` replace its `<default>` values."""
    root = ET.parse(scene).getroot()
    values = {d.get("name", ""): d.get("value", "") for d in root.iter("default")} | dict(parameters or {})

    def integer(name: str, default: int) -> int:
        element = root.find(f"./integrator/integer[@name='{name}']")
        text = element.get("value", "") if element is not None else str(default)
        for key in sorted(values, key=len, reverse=True):
            text = text.replace(f"${key}", values[key])
        return int(text)

    kinds = [emitter.get("type", "") for emitter in root.iter("emitter")]
    return SceneContent(
        lights=len(kinds),
        delta_lights=sum(kind in DELTA_LIGHTS for kind in kinds),
        max_depth=integer("max_depth", -1),
        rr_depth=integer("rr_depth", 5),
    )


@dataclass(frozen=True)
class Technique:
    """One way to estimate the same image."""

    name: str
    lecture: tuple[str, ...]
    """Ids of the lecture's techniques that it uses."""
    options: tuple[str, ...]
    """oneray's options, all of them stated, so that defaults may change."""
    summary: str
    applies: Callable[[SceneContent], bool]


def _options(
    estimator: str,
    hemisphere: str = "cosine",
    choice: str = "power",
    mis: str = "power",
    roulette: str = "survival",
) -> tuple[str, ...]:
    options = ["--estimator", estimator, "--hemisphere", hemisphere]
    if estimator != "walk":
        options += ["--light-choice", choice, "--light-points", "area"]
    if estimator == "mis":
        options += ["--mis", mis]
    return (*options, "--roulette", roulette)


def _walk(content: SceneContent) -> bool:
    return content.lights > 0 and content.delta_lights == 0


def _lit(content: SceneContent) -> bool:
    return content.lights > 0


def _many(content: SceneContent) -> bool:
    return content.lights > 1


def _capped(content: SceneContent) -> bool:
    """Roulette would act, and without it paths still end."""
    return content.has_roulette and content.max_depth != -1


TECHNIQUES: tuple[Technique, ...] = (
    Technique(
        "walk-uniform",
        ("L7", "L8", "L14", "L19"),
        _options("walk", "uniform"),
        "random walk, directions uniform over the hemisphere",
        _walk,
    ),
    Technique(
        "walk-cosine",
        ("L7", "L9", "L14", "L19"),
        _options("walk"),
        "random walk, directions by the cosine",
        _walk,
    ),
    Technique(
        "walk-no-roulette",
        ("L7", "L9", "L19"),
        _options("walk", roulette="none"),
        "random walk that only the depth cap ends",
        lambda c: _walk(c) and _capped(c),
    ),
    Technique(
        "nee-uniform-hemisphere",
        ("L2", "L3", "L8", "L10", "L11", "L12", "L14"),
        _options("nee", "uniform"),
        "next event estimation, indirect light uniform over the hemisphere",
        lambda c: _lit(c) and c.has_indirect,
    ),
    Technique(
        "nee-uniform-choice",
        ("L3", "L4", "L9", "L10", "L11", "L12", "L14"),
        _options("nee", choice="uniform"),
        "next event estimation, one of N lights with probability 1/N",
        _many,
    ),
    Technique(
        "nee",
        ("L1", "L2", "L3", "L4", "L9", "L10", "L11", "L12", "L14"),
        _options("nee"),
        "next event estimation, one light with a probability by its power",
        _lit,
    ),
    Technique(
        "nee-no-roulette",
        ("L3", "L10", "L11", "L12", "L19"),
        _options("nee", roulette="none"),
        "next event estimation, paths that only the depth cap ends",
        lambda c: _lit(c) and _capped(c),
    ),
    Technique(
        "mis-balance",
        ("L3", "L4", "L9", "L10", "L13", "L14"),
        _options("mis", mis="balance"),
        "light and hemisphere samples weighted by the balance heuristic",
        lambda c: c.has_area_light,
    ),
    Technique(
        "mis-power",
        ("L3", "L4", "L9", "L10", "L13", "L14"),
        _options("mis"),
        "light and hemisphere samples weighted by the power heuristic",
        _lit,
    ),
    Technique(
        "mis-uniform-hemisphere",
        ("L3", "L8", "L10", "L13", "L14"),
        _options("mis", "uniform"),
        "power heuristic with directions uniform over the hemisphere",
        lambda c: c.has_area_light,
    ),
    Technique(
        "mis-uniform-choice",
        ("L3", "L4", "L13", "L14"),
        _options("mis", choice="uniform"),
        "power heuristic, one of N lights with probability 1/N",
        lambda c: c.has_area_light and _many(c),
    ),
    Technique(
        "mis-no-roulette",
        ("L13", "L19"),
        _options("mis", roulette="none"),
        "power heuristic, paths that only the depth cap ends",
        lambda c: c.has_area_light and _capped(c),
    ),
)

BEST = "mis-power"
"""The technique that pictures are made with."""


def technique(name: str) -> Technique:
    """The technique of that name; KeyError with the names there are."""
    for candidate in TECHNIQUES:
        if candidate.name == name:
            return candidate
    raise KeyError(f"no technique {name!r}; there are {', '.join(t.name for t in TECHNIQUES)}")


def applicable(content: SceneContent) -> list[Technique]:
    return [t for t in TECHNIQUES if t.applies(content)]
