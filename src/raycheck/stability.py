"""How far a renderer holds in stiff cases: sweeps over decades against closed forms.

A point fails where its error is beyond what the case allows by more than 5 standard errors, where two
standard errors are more than what is allowed, so that nothing is shown, where the picture is not finite, or
where there is none. `scenes/stiff` has the scenes, stability_cases.py the cases.
"""

import json
import math
import re
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from mpmath import mp
from numpy.typing import NDArray

from raycheck.base.errors import NotFound, RenderError
from raycheck.base.text import percent
from raycheck.renderers.oneray import oneray_command, oneray_path
from raycheck.stability_cases import CASES, DIGITS, Case, Parsed, Settings, Truth

Array = NDArray[np.float64]

SIGMAS = 5.0
MITSUBA_WITHIN = 1e-2
"""What Mitsuba is allowed at least, since it has single floats."""
RESOLVED = 1e-3
"""Two standard errors need not be less than this, whatever a case allows."""
PIXELS = 256
TIMEOUT = 600.0


@dataclass(frozen=True)
class Point:
    """A value of the swept parameter.

    Attributes:
        expected, found: the closed form and the pixels' mean, W·sr⁻¹·m⁻²; for measures other than `mean` what
            is allowed, and the share or spread.
        error: relative; of a spread, the spread itself.
        noise: standard error of it.
    """

    x: float
    expected: float
    found: float | None
    error: float | None
    noise: float
    holds: bool
    reason: str = ""


@dataclass(frozen=True)
class Curve:
    """What a renderer did in a case."""

    renderer: str
    within: float
    points: list[Point]

    @property
    def last_good(self) -> float | None:
        """The last value up to which all hold."""
        good = [point.x for point in self.points[: self._failing]]
        return good[-1] if good else None

    @property
    def first_bad(self) -> Point | None:
        return self.points[self._failing] if self._failing < len(self.points) else None

    @property
    def _failing(self) -> int:
        return next((k for k, point in enumerate(self.points) if not point.holds), len(self.points))


@dataclass(frozen=True)
class Result:
    case: str
    title: str
    parameter: str
    goal: float
    curves: list[Curve]

    def holds(self) -> bool:
        """Does the first renderer reach the goal, with every value up to it?"""
        reached = self.curves[0].points
        order = -1 if reached[0].x > self.goal else 1
        return all(point.holds for point in reached if order * point.x <= order * self.goal)


class Renders(Protocol):
    """A renderer: pixels (H, W) of one channel; RenderError where there is no picture."""

    single: bool
    name: str

    def render(self, case: Case, settings: Settings, spp: int, seed: int) -> Array: ...


class Oneray:
    """oneray with its defaults, the precision by `auto`."""

    single = False
    name = "oneray"

    def __init__(self) -> None:
        self._path = oneray_path()

    def render(self, case: Case, settings: Settings, spp: int, seed: int) -> Array:
        command = oneray_command(self._path, case.options, settings)
        return np.asarray(command.render(case.path, spp, seed, TIMEOUT).image.pixels)[..., 1]


class Mitsuba:
    """Mitsuba's scalar_rgb in a process that is started anew where it crashes."""

    single = True

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None
        self.name = f"Mitsuba {self._start()['version']}"

    def _start(self) -> dict[str, Any]:
        command = [sys.executable, "-m", "raycheck.stability_mitsuba"]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
        self._process = subprocess.Popen(command, text=True, **pipes)
        return self._answer()

    def _answer(self) -> dict[str, Any]:
        line = self._process.stdout.readline()
        if not line:
            self.close()
            raise RenderError("Mitsuba crashed, or took too long")
        return json.loads(line)

    def render(self, case: Case, settings: Settings, spp: int, seed: int) -> Array:
        if self._process is None:
            self._start()
        job = {"scene": str(case.path), "settings": dict(settings), "spp": spp, "seed": seed}
        self._process.stdin.write(json.dumps(job) + "\n")
        self._process.stdin.flush()
        timer = threading.Timer(TIMEOUT, self._process.kill)
        timer.start()
        try:
            answer = self._answer()
        finally:
            timer.cancel()
        if "error" in answer:
            raise RenderError(answer["error"].replace(f"{case.path.parent}/", ""))
        return np.array(answer["pixels"], dtype=np.float64)

    def close(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None


@contextmanager
def mitsuba() -> Iterator[Mitsuba | None]:
    """Mitsuba where it is installed."""
    try:
        found = Mitsuba()
    except RenderError:
        yield None
        return
    try:
        yield found
    finally:
        found.close()


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
    worst: Point | None = None
    for settings in case.settings(x):
        with mp.workdps(DIGITS):
            truth = case.truth(Parsed(case.path, settings, renderer.single))
            if renderer.single and not (mp.isfinite(truth.value) and truth.value >= 0 and truth.unit > 0):
                truth = case.truth(Parsed(case.path, settings))
        point = _render_point(case, x, settings, truth, renderer, within, samples, seed)
        if worst is None or (point.holds, -_size(point)) < (worst.holds, -_size(worst)):
            worst = point
    return worst


def _size(point: Point) -> float:
    return math.inf if point.error is None else abs(point.error)


def _render_point(
    case: Case,
    x: float,
    settings: Settings,
    truth: Truth,
    renderer: Renders,
    within: float,
    samples: int,
    seed: int,
) -> Point:
    expected = float(truth.value) if case.measure == "mean" else 1.0 if case.measure == "bounces" else within
    spp = samples if case.name == "many-samples" else max(1, samples // PIXELS)
    try:
        pixels = renderer.render(case, settings, spp, seed)
    except RenderError as error:
        return Point(x, expected, None, None, 0.0, False, str(error))
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


@dataclass(frozen=True)
class Step:
    """For a progress bar: what was done."""

    scene: str
    technique: str


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
            results.append(Result(case.name, case.title, case.parameter, case.goal, curves))
    return results


def to_json(results: Sequence[Result], header: dict[str, Any]) -> str:
    """What `read` reads; one point a line."""
    found = [asdict(result) for result in results]
    marks = {}
    for result in found:
        for curve in result["curves"]:
            for k, point in enumerate(curve["points"]):
                mark = f"@{len(marks)}@"
                marks[mark] = json.dumps(point, ensure_ascii=False)
                curve["points"][k] = mark
    text = json.dumps(header | {"cases": found}, indent=1, ensure_ascii=False)
    return re.sub(r'"(@\d+@)"', lambda match: marks[match.group(1)], text) + "\n"


def read(path: Path) -> tuple[list[Result], dict[str, Any]]:
    """A result of `raycheck stability --json`, and its header; NotFound if it is none."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        results = [
            Result(**{**result, "curves": [
                Curve(c["renderer"], c["within"], [Point(**point) for point in c["points"]])
                for c in result["curves"]
            ]})
            for result in found.pop("cases")
        ]  # fmt: skip
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise NotFound(f"{path}: no result of raycheck stability --json ({error})") from None
    return results, found


COLUMNS = ("case", "swept", "allowed", "goal", "oneray holds to", "fails at", "Mitsuba holds to", "fails at")


def value(x: float) -> str:
    """1e-12, 0.1, 20; powers of two as such."""
    exponent = math.log2(x)
    if x > 4 and exponent == int(exponent) and exponent >= 10:
        return f"2^{int(exponent)}"
    return f"{x:g}"


def error_text(point: Point) -> str:
    """What is wrong there."""
    if point.reason == "noise":
        return f"noise ± {percent(2 * point.noise)}"
    if point.reason:
        return point.reason if point.reason in ("black", "not finite") else "no picture"
    if point.found == 0 and point.expected != 0:
        return "black"
    size = abs(point.error or 0.0)
    return f"off by {size:.3g} times" if size >= 10 else f"off by {percent(size)}"


def row(result: Result) -> tuple[str, ...]:
    """The cells of a case's line."""
    case = cases_named([result.case])[0]
    limit = (
        f"spread {case.within:g}"
        if case.measure == "spread"
        else f"{case.within:.0e}"
        if case.within < 1e-4
        else percent(case.within)
    )
    limit = limit if case.within else "none"
    cells = [result.case, result.parameter, limit, value(result.goal)]
    for curve in result.curves:
        bad = curve.first_bad
        cells.append("–" if curve.last_good is None else value(curve.last_good))
        cells.append("–" if bad is None else f"{value(bad.x)}, {_how(case, bad)}")
    return tuple(cells)


def _how(case: Case, point: Point) -> str:
    if case.measure == "spread" and point.found and math.isfinite(point.error):
        return f"spread {point.found:.3g}"
    return error_text(point)


def markdown(results: Sequence[Result]) -> str:
    """The README's table."""
    lines: list[Sequence[str]] = [COLUMNS, ["---"] * len(COLUMNS)]
    lines += [[*cells, *[""] * (len(COLUMNS) - len(cells))] for cells in map(row, results)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)
