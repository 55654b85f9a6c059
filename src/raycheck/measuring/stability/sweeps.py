"""How far a renderer holds in stiff cases: sweeps over decades against closed forms.

A point fails where its error is beyond what the case allows by more than 5 standard errors, where two
standard errors are more than what is allowed, so that nothing is shown, where the picture is not finite, or
where there is none. `scenes/stiff` has the scenes, cases.py the cases.
"""

import math
from collections.abc import Callable, Sequence
from contextlib import nullcontext

import numpy as np
from mpmath import mp

from raycheck.base.arrays import Array
from raycheck.base.errors import NotFound, RenderError
from raycheck.measuring.stability.case import DIGITS, Case, Parsed, Settings, Truth
from raycheck.measuring.stability.cases import CASES
from raycheck.measuring.stability.renderers import Oneray, Renders, mitsuba
from raycheck.measuring.stability.results import Curve, Point, Result
from raycheck.measuring.step import Step
from raycheck.truth.provenance import provenance

METHOD = 1
"""Version of how cases are swept, see truth.provenance."""
SIGMAS = 5.0
MITSUBA_WITHIN = 1e-2
"""What Mitsuba is allowed at least, since it has single floats."""
RESOLVED = 1e-3
"""Two standard errors need not be less than this, whatever a case allows."""
PIXELS = 256


def measure(
    case: Case, pixels: Array, truth: Truth, spp: int, settings: Settings
) -> tuple[float, float, float]:
    """(found, error, noise) of a picture, see Point."""
    mean = float(pixels.mean())
    noise = float(pixels.std(ddof=1)) / math.sqrt(pixels.size) if pixels.size > 1 else 0.0
    unit = float(truth.unit)
    if case.measure == "bounces":
        right = _right_bounces(pixels, settings)
        return right, right - 1.0, 0.0
    if case.measure == "spread":
        spread = float(pixels.std(ddof=1)) * math.sqrt(spp) / float(truth.value)
        bias = abs(mean - float(truth.value))
        return (
            spread,
            spread if bias <= SIGMAS * noise or mean == 0 else math.inf,
            spread / math.sqrt(2 * pixels.size),
        )
    with mp.workdps(DIGITS):
        return mean, float((mp.mpf(mean) - truth.value) / truth.unit), noise / unit


def _right_bounces(pixels: Array, settings: Settings) -> float:
    """The share of pixels of one sample whose radiance ρᵏ L is that of the right k."""
    wanted = round(float(settings["length"]) * float(settings["slope"]))
    with np.errstate(divide="ignore"):
        return float((np.rint(np.log(pixels) / math.log(float(settings["reflectance"]))) == wanted).mean())


def run_point(case: Case, x: float, renderer: Renders, within: float, seed: int) -> Point:
    """The worst of the renders of a value."""
    samples = case.samples(x) if isinstance(renderer, Oneray) else min(case.samples(x), case.most_mitsuba)
    points = []
    for settings in case.settings(x):
        with mp.workdps(DIGITS):
            truth = case.truth(Parsed(case.path, settings, renderer.single))
            if renderer.single and not (mp.isfinite(truth.value) and truth.value >= 0 and truth.unit > 0):
                truth = case.truth(Parsed(case.path, settings))
        points.append(_render_point(case, x, settings, truth, renderer, within, samples, seed))
    return min(points, key=lambda point: (point.holds, -_size(point)))


def _size(point: Point) -> float:
    return math.inf if point.error is None else abs(point.error)


def _render_point(
    case: Case, x: float, settings: Settings, truth: Truth, renderer: Renders, within: float, samples: int,
    seed: int,
) -> Point:  # fmt: skip
    expected = float(truth.value) if case.measure == "mean" else 1.0 if case.measure == "bounces" else within
    spp = samples if case.name == "many-samples" else max(1, samples // PIXELS)
    try:
        pixels = renderer.render(case, settings, spp, seed)
    except RenderError as failure:
        return Point(x, expected, None, None, 0.0, False, str(failure))
    if not np.isfinite(pixels).all():
        return Point(x, expected, None, None, 0.0, False, "not finite")
    found, error, noise = measure(case, pixels, truth, spp, settings)
    beyond = abs(error) > within and (
        case.measure == "spread" or abs(error) - within > SIGMAS * noise or within == 0
    )
    black = case.measure != "bounces" and found == 0 and truth.value != 0
    hidden = case.measure == "mean" and within > 0 and 2 * noise > max(within, RESOLVED)
    reason = "black" if black else "noise" if hidden and not beyond else ""
    return Point(x, expected, found, error, noise, not (beyond or reason), reason)


def allowed(case: Case, renderer: Renders) -> float:
    """The error that a case allows; single floats get 1 % where doubles get less, unless it is none."""
    single = renderer.single and case.measure == "mean" and case.within > 0
    return max(case.within, MITSUBA_WITHIN) if single else case.within


def sweep(case: Case, renderer: Renders, values: Sequence[float], seed: int = 0) -> Curve:
    """All values; after three failures in a row the rest is left out."""
    within = allowed(case, renderer)
    points: list[Point] = []
    for x in values:
        points.append(run_point(case, x, renderer, within, seed))
        if len(points) >= 3 and not any(point.holds for point in points[-3:]):
            break
    return Curve(renderer.name, within, points)


def cases_named(names: Sequence[str]) -> list[Case]:
    """All, or those of these names; NotFound with the names that there are."""
    known = {case.name: case for case in CASES}
    for name in names:
        if name not in known:
            raise NotFound(f"no stiff case {name!r}; there are: {', '.join(known)}")
    return [known[name] for name in names] or list(CASES)


def rests_on(case: Case) -> list[str]:
    """The pictures of its scene as it stands, by the two estimators of which oneray's default is one."""
    ways = [(name, precision) for name in ("nee", "mis-default") for precision in ("double", "single")]
    return [f"stiff/{case.path.stem} {name} {precision}" for name, precision in ways]


def run(
    cases: Sequence[Case],
    quick: bool = False,
    seed: int = 0,
    on_case: Callable[[Step, int], None] | None = None,
) -> list[Result]:
    """Sweep the cases with oneray, and with Mitsuba where it is installed; `quick`: few values, oneray."""
    results = []
    with nullcontext() if quick else mitsuba() as other:
        renderers: list[Renders] = [Oneray(), *([other] if other else [])]
        for case in cases:
            curves = []
            for renderer in renderers:
                curves.append(sweep(case, renderer, case.coarse if quick else case.values, seed))
                if on_case:
                    on_case(Step(case.name, renderer.name), len(cases) * len(renderers))
            rests = provenance(METHOD, rests_on(case))
            results.append(Result(case.name, case.title, case.parameter, case.goal, curves, rests))
    return results
