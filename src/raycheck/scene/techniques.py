"""The only table of technique names: what each is in the lecture, oneray's options for it, and when it
applies.
"""

from collections.abc import Callable
from dataclasses import dataclass

from raycheck.base.errors import NotFound
from raycheck.base.text import nearest
from raycheck.scene.content import SceneContent


@dataclass(frozen=True)
class Need:
    """What a scene must have for a technique to differ from others, or to work."""

    met: Callable[[SceneContent], bool]
    otherwise: str
    """Why the technique is left out where it is not met."""


@dataclass(frozen=True)
class Technique:
    """One way to estimate the same image."""

    name: str
    lecture: tuple[str, ...]
    """Ids of the lecture's techniques that it uses."""
    options: tuple[str, ...]
    """oneray's options, all of them stated, so that defaults may change."""
    summary: str
    needs: tuple[Need, ...]

    def why_not(self, content: SceneContent) -> str | None:
        """Why it is left out of a scene; None where it applies."""
        return next((need.otherwise for need in self.needs if not need.met(content)), None)

    @property
    def independent(self) -> bool:
        """The samples of a pixel are independent: the variance of n is that of one over n, and a picture has
        standard errors.
        """
        return "sobol" not in self.options


def _options(
    estimator: str, hemisphere: str = "cosine", choice: str = "power", points: str = "area",
    mis: str = "power", mis_pdf: str = "bsdf", roulette: str = "survival", sampler: str = "independent",
    normals: str = "visible",
) -> tuple[str, ...]:  # fmt: skip
    options = ["--estimator", estimator, "--hemisphere", hemisphere, "--normals", normals]
    if estimator != "walk":
        options += ["--light-choice", choice]
    if choice == "resampled":
        options += ["--candidates", "4"]
    if estimator in ("nee", "mis", "bidirectional"):
        options += ["--light-points", points]
    if estimator in ("mis", "bidirectional"):
        options += ["--mis", mis]
    if estimator == "mis":
        options += ["--mis-pdf", mis_pdf]
    return (*options, "--roulette", roulette, "--fresnel", "exact", "--sampler", sampler)


_LIT = Need(lambda c: c.lights > 0, "there is no light")
_MET = Need(lambda c: c.delta_lights == 0, "no random ray hits a point light, spot or sun")
_MANY = Need(lambda c: c.has_choice, "there is only one light to choose")
_CANDIDATES = Need(lambda c: c.has_choice or c.has_area_light, "a point light alone is one candidate")
_WEIGHED = Need(lambda c: c.has_area_light, "no random ray hits a light, so there is nothing to weigh")
_SPHERES = Need(lambda c: c.sphere_lights > 0, "there is no sphere light")
_ANGULAR = Need(lambda c: c.sphere_lights + c.flat_lights > 0, "no light is a sphere or rectangle")
_ROULETTE = Need(lambda c: c.has_roulette, "no path is long enough for roulette")
_CAP = Need(lambda c: c.max_depth != -1, "without roulette paths would not end")
_INDIRECT = Need(lambda c: c.has_indirect, "there is direct light only")
_ROUGH = Need(lambda c: c.rough, "nothing has microfacets")
_SHOWN = Need(lambda c: not c.hide_emitters, "light paths cannot hide emitters from the eye")
_EVEN = Need(lambda c: not c.bumps, "light paths know no bumps")
_BOUNCES = Need(lambda c: c.has_choice or c.has_indirect, "there is one light, and direct light only")

_WALK = (_LIT, _MET)
_CAPPED = (_ROULETTE, _CAP)
_TRACED = (_LIT, _SHOWN, _EVEN)
"""Where a scene has mirrors or glass, whether they are in view is found out by trying (`verify`)."""

_NEE = ("L1", "L2", "L3", "L4", "L9", "L10", "L11", "L12", "L14")
_MIS = ("L3", "L4", "L9", "L10", "L13", "L14")


TECHNIQUES: tuple[Technique, ...] = (
    Technique("walk-uniform", ("L7", "L8", "L14", "L19"), _options("walk", "uniform"),
        "random walk, directions uniform over the hemisphere", _WALK),
    Technique("walk-cosine", ("L7", "L9", "L14", "L15", "L16", "L19"), _options("walk"),
        "random walk, directions by the cosine", _WALK),
    Technique("walk-no-roulette", ("L7", "L9", "L19"), _options("walk", roulette="none"),
        "random walk that only the depth cap ends", (*_WALK, *_CAPPED)),
    Technique("nee-uniform-hemisphere", ("L2", "L3", "L8", "L10", "L11", "L12", "L14"),
        _options("nee", "uniform"),
        "next event estimation, indirect light uniform over the hemisphere", (_LIT, _INDIRECT)),
    Technique("nee-uniform-choice", ("L3", "L4", "L6", "L9", "L10", "L11", "L12", "L14"),
        _options("nee", choice="uniform"),
        "next event estimation, one of N lights with probability 1/N (situation 1: nothing is known)",
        (_MANY,)),
    Technique("nee", _NEE, _options("nee"),
        "next event estimation, one light with a probability by its power, a point uniform on its area",
        (_LIT,)),
    Technique("nee-contribution", (*_NEE, "L6"), _options("nee", choice="contribution"),
        "one light with a probability by power, distance and cosines, 0 where it cannot contribute",
        (_MANY,)),
    Technique("nee-learned", (*_NEE, "L6", "L18"), _options("nee", choice="learned"),
        "one light by contribution and by what a pre-pass saw of occlusion (situation 2)", (_MANY,)),
    Technique("nee-facing", (*_NEE, "L5"), _options("nee", points="facing"),
        "points on the half of a sphere light that faces the receiver", (_SPHERES,)),
    Technique("nee-cone", (*_NEE, "L5"), _options("nee", points="cone"),
        "directions in the cone that a sphere light fills, or in the solid angle of a rectangle",
        (_ANGULAR,)),
    Technique("nee-no-roulette", ("L3", "L10", "L11", "L12", "L19"), _options("nee", roulette="none"),
        "next event estimation, paths that only the depth cap ends", (_LIT, *_CAPPED)),
    Technique("mis-balance", _MIS, _options("mis", mis="balance"),
        "light and hemisphere samples weighted by the balance heuristic", (_WEIGHED,)),
    Technique("mis-power", _MIS, _options("mis"),
        "light and hemisphere samples weighted by the power heuristic", (_LIT,)),
    Technique("mis-uniform-hemisphere", ("L3", "L8", "L10", "L13", "L14"), _options("mis", "uniform"),
        "power heuristic with directions uniform over the hemisphere", (_WEIGHED,)),
    Technique("mis-all-normals", (*_MIS, "P1"), _options("mis", normals="all"),
        "power heuristic, microfacets in proportion to their area, whether the viewer sees them or not",
        (_LIT, _ROUGH)),
    Technique("mis-uniform-choice", ("L3", "L4", "L13", "L14"), _options("mis", choice="uniform"),
        "power heuristic, one of N lights with probability 1/N", (_WEIGHED, _MANY)),
    Technique("mis-contribution", (*_MIS, "L6"), _options("mis", choice="contribution"),
        "power heuristic, one light by what it may contribute", (_MANY, _ANGULAR)),
    Technique("mis-facing", (*_MIS, "L5"), _options("mis", points="facing"),
        "power heuristic, points on the facing half of a sphere light", (_SPHERES,)),
    Technique("mis-cone", (*_MIS, "L5"), _options("mis", points="cone"),
        "power heuristic, directions in the cone or solid angle of a light", (_MANY, _ANGULAR)),
    Technique("mis-no-roulette", ("L13", "L19"), _options("mis", roulette="none"),
        "power heuristic, paths that only the depth cap ends", (_WEIGHED, *_CAPPED)),
    Technique("mis-survival", _MIS, _options("mis", mis_pdf="survival"),
        "power heuristic with the chance of surviving roulette in the density of the walk",
        (_WEIGHED, _ROULETTE)),
    Technique("mis-default", (*_MIS, "L5", "L6"), _options("mis", choice="contribution", points="cone"),
        "oneray's defaults: power heuristic, one light by contribution, in its cone or solid angle",
        (Need(lambda c: _MANY.met(c) or _ANGULAR.met(c), "it is the same as mis-power here"),)),
    Technique("mis-learned", (*_MIS, "L5", "L6", "L18"), _options("mis", choice="learned", points="cone"),
        "the same with what a pre-pass saw of occlusion", (_WEIGHED, _MANY)),
    Technique("mis-sobol", (*_MIS, "L5", "L6"),
        _options("mis", choice="contribution", points="cone", sampler="sobol"),
        "oneray's defaults with Owen-scrambled Sobol' points instead of independent numbers", (_LIT,)),
    Technique("light", ("L4", "L12", "L17"), _options("light"),
        "light tracing: paths from the lights, each vertex joined to the eye", _TRACED),
    Technique("light-uniform-choice", ("L4", "L8", "L17"), _options("light", "uniform", choice="uniform"),
        "light tracing, lights with probability 1/N, bounces uniform over the hemisphere",
        (*_TRACED, _BOUNCES)),
)  # fmt: skip

_BOTH = ("L4", "L9", "L10", "L13", "L14", "L17", "T1")

ON_REQUEST: tuple[Technique, ...] = (
    Technique("bidirectional", (*_BOTH, "L5", "L6"),
        _options("bidirectional", choice="contribution", points="cone"),
        "bidirectional paths: every vertex from a light joined to every one from the eye, power heuristic",
        _TRACED),
    Technique("bidirectional-balance", _BOTH, _options("bidirectional", mis="balance"),
        "the same by the balance heuristic, one light by its power, a point uniform on its area", _TRACED),
    Technique("nee-resampled", (*_NEE, "L5", "L6", "T4"), _options("nee", choice="resampled", points="cone"),
        "one of four points on lights, chosen by contribution, by the light that it would bring",
        (_LIT, _CANDIDATES)),
    Technique("mis-resampled", (*_MIS, "L5", "L6", "T4"), _options("mis", choice="resampled", points="cone"),
        "the same, weighed against the hemisphere by the density of the four", (_LIT, _CANDIDATES)),
)  # fmt: skip
"""Those that are used where they are named: no run over all techniques takes them."""

BASELINE = "walk-cosine"
"""The plain random walk: prices are relative to it."""
BEST = "mis-default"
"""The technique with which pictures are made."""


def technique(name: str) -> Technique:
    """The technique of that name; NotFound with the names there are."""
    for candidate in (*TECHNIQUES, *ON_REQUEST):
        if candidate.name == name:
            return candidate
    names = [known.name for known in (*TECHNIQUES, *ON_REQUEST)]
    raise NotFound(f"no technique {name!r}{nearest(name, names)}; there are {', '.join(names)}")


def applicable(content: SceneContent) -> list[Technique]:
    return [t for t in TECHNIQUES if t.why_not(content) is None]


def left_out(content: SceneContent) -> dict[str, list[str]]:
    """The techniques that do not apply, by the reason."""
    found: dict[str, list[str]] = {}
    for one in TECHNIQUES:
        why = one.why_not(content)
        if why is not None:
            found.setdefault(why, []).append(one.name)
    return found


FALLBACK = "nee"
"""What prices are relative to where the baseline does not apply."""
