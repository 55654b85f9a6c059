"""Stiff cases: every row of `raycheck stability`, coarsely; --precision auto takes double for them."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import mpmath
import numpy as np
import pytest
from mpmath import mp, mpf
from numpy.typing import NDArray
from typer.testing import CliRunner

from raycheck.base.errors import RenderError
from raycheck.commands.app import app
from raycheck.measuring.stability import places, plots, sweeps
from raycheck.measuring.stability.case import Case, Parsed
from raycheck.measuring.stability.cases import CASES
from raycheck.measuring.stability.formulas import cone_irradiance, rectangle_irradiance
from raycheck.measuring.stability.renderers import Oneray
from raycheck.measuring.stability.results import Curve, Point, Result, read, to_json

CASE = {case.name: case for case in CASES}
ORDINARY = {
    "touching-sphere": 1e-1,
    "inner-wall": 1e-1,
    "thin-slab": 1e-2,
    "scale-small": 1e-6,
    "scale-large": 1e5,
    "scale-furnace": 1e-5,
    "offset": 10,
    "distant-sphere": 1e5,
    "distant-point": 1e5,
    "radiance-low": 1e-12,
    "radiance-high": 1e11,
    "white-furnace": 1e-1,
    "mesh-seams": 1e-2,
    "dim-one-seen": 1e3,
    "all-seen": 1e3,
    "setting-sphere": 1,
    "narrow-spot": 1e3,
    "corridor": 1,
    "smooth-principled": 0.1,
}
"""Up to here single precision may be taken; elsewhere up to 1e-3."""


@pytest.fixture(autouse=True)
def program(oneray: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ONERAY", str(oneray))


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_each_case_holds(case: Case) -> None:
    curve = sweeps.sweep(case, Oneray(), case.coarse)
    assert curve.first_bad is None
    assert case.goal in case.coarse or case.quick


def precision(oneray: Path, case: Case, x: float) -> str:
    settings = [f"-D{name}={value}" for name, value in case.settings(x)[0].items()]
    command = [oneray, case.path, "--spp", "1", "--quiet", "--stats", "-", *settings]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)["precision"]


STIFF = [
    case for case in CASES if case.name not in ("many-samples", "bright-pixel") and case not in places.CASES
]


@pytest.mark.parametrize("case", STIFF, ids=lambda case: case.name)
def test_auto_takes_double_for_what_is_stiff(oneray: Path, case: Case) -> None:
    """At the goal, and at the first value that is not ordinary. Sums are in double in either precision, a
    pixel may be as bright, and surfaces in one place are right in either (test_one_place.py). The furnace's
    goal takes long to render: a value before it.
    """
    limit = ORDINARY.get(case.name, 1e-3)
    sign = 1 if case.values[-1] > case.values[0] else -1
    first = next(x for x in case.values if sign * x > sign * limit)
    last = 1e-4 if case.name == "white-furnace" else case.goal
    assert {precision(oneray, case, x) for x in (first, last)} == {"double"}


def test_a_plain_scene_of_the_same_kind_is_single(oneray: Path) -> None:
    """The rule does not take double for everything: each of these scenes at the mild end of its sweep."""
    names = (
        "small-sphere-light",
        "contact-shadow",
        "thin-slab",
        "offset",
        "slivers",
        "tiny-disk",
        "all-seen",
    )
    assert {precision(oneray, CASE[name], CASE[name].values[0]) for name in names} == {"single"}


# ---- The harness itself: what it must notice.


class Wrong:
    """Renders every picture as the closed form times `factor`."""

    single = False
    name = "wrong"

    def __init__(self, factor: float):
        self.factor = factor

    def render(self, case: Case, settings: dict, spp: int, seed: int) -> NDArray[np.float64]:
        if self.factor < 0:
            raise RenderError("no picture")
        with mp.workdps(60):
            return np.full((16, 16), self.factor * float(case.truth(Parsed(case.path, settings)).value))


@pytest.mark.parametrize(
    ("factor", "holds"),
    [(1.0, True), (1.009, True), (1.02, False), (0.0, False), (np.nan, False), (-1.0, False)],
)
def test_the_sweep_sees_what_is_wrong(factor: float, holds: bool) -> None:
    curve = sweeps.sweep(CASE["thin-slab"], Wrong(factor), (1e-1, 1e-2))
    assert [point.holds for point in curve.points] == [holds, holds]


def test_a_leak_is_seen() -> None:
    class Leak(Wrong):
        def render(self, case: Case, settings: dict, spp: int, seed: int) -> NDArray[np.float64]:
            return np.full((16, 16), 0.02 * float(case.truth(Parsed(case.path, settings)).unit))

    assert not sweeps.sweep(CASE["contact-shadow"], Leak(1), (1e-1,)).points[0].holds


@pytest.mark.parametrize(("spread", "reason"), [(0.05, ""), (0.2, "noise")])
def test_what_noise_hides_does_not_hold(spread: float, reason: str) -> None:
    """A right mean whose two standard errors are 0.6 %, and 2.5 %, where 1 % is allowed."""

    class Noisy(Wrong):
        def render(self, case: Case, settings: dict, spp: int, seed: int) -> NDArray[np.float64]:
            signs = np.where(np.arange(256) % 2, 1.0, -1.0).reshape(16, 16)
            return super().render(case, settings, spp, seed) * (1 + spread * signs)

    point = sweeps.sweep(CASE["thin-slab"], Noisy(1.0), (1e-1,)).points[0]
    assert (point.holds, point.reason) == (not reason, reason)


def test_after_three_failures_a_sweep_ends() -> None:
    curve = sweeps.sweep(CASE["thin-slab"], Wrong(2.0), CASE["thin-slab"].values)
    assert len(curve.points) == 3
    assert curve.last_good is None


def test_closed_forms_by_other_ways() -> None:
    """A cone straight up: π s²; a wide rectangle: π, its corner: a quarter."""
    assert float(cone_irradiance(mpf("0.5"), mpf(1))) == pytest.approx(np.pi / 4, rel=1e-15)
    theta = np.arcsin(0.5)  # on the horizon: α - sinα cosα
    assert float(cone_irradiance(mpf("0.5"), mpf(0))) == pytest.approx(
        theta - np.sin(theta) * np.cos(theta), rel=1e-14
    )
    assert float(cone_irradiance(mpf(1), mpf("0.5"))) == pytest.approx(np.pi * 0.75, rel=1e-14)
    big = mpf(10) ** 9
    assert float(rectangle_irradiance(-big, big, -big, big, mpf(1))) == pytest.approx(np.pi, rel=1e-8)
    assert float(rectangle_irradiance(mpf(0), big, mpf(0), big, mpf(1))) == pytest.approx(np.pi / 4, rel=1e-8)


def test_an_upright_rectangle_by_another_way() -> None:
    """∫∫ cosθ cosθ_lamp/r² over the rectangle: z/r on the floor, y/r at the lamp."""
    width, y = mpf("0.75"), mpf("0.5")
    by_parts = mpmath.quad(lambda x, z: z * y / (x * x + y * y + z * z) ** 2, [0, width], [0, 1])
    assert float(places.upright_irradiance(width, y)) == pytest.approx(float(by_parts), rel=1e-12)


def test_numbers_are_those_that_a_program_parses() -> None:
    path = CASE["small-sphere-light"].path
    assert Parsed(path, {"radius": "0.1"})("radius") == mpf(0.1)
    assert Parsed(path, {"radius": "0.1"}, single=True)("radius") == mpf(float(np.float32(0.1)))
    assert mpmath.isinf(Parsed(path, {"radius": "1e100"}, single=True)("radius"))


def result() -> Result:
    points = [Point(1e-1, 0.5, 0.5, 0.0, 1e-5, True), Point(1e-2, 0.5, None, None, 0.0, False, "no picture")]
    return Result("thin-slab", "Thin slab of glass", "thickness", 1e-12, [Curve("oneray", 1e-2, points)])


def test_a_result_is_read_back_as_it_was_written(tmp_path: Path) -> None:
    file = tmp_path / "stability.json"
    file.write_text(to_json([result()], {"machine": "a machine", "command": "raycheck stability"}))
    found, header = read(file)
    assert found == [result()]
    assert header["command"] == "raycheck stability"
    assert not result().holds()
    shown = plots.section(file)
    assert shown["rows"] == [("thin-slab", "thickness", "1.00 %", "1e-12", "0.1", "0.01, no picture")]
    assert [plot.names for plot in shown["cases"][0].plots] == [
        ["closed form", "oneray"],
        ["allowed", "oneray"],
    ]


def test_what_is_no_case_or_no_result_is_one_line(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["stability", "no-such-case"])
    assert done.exit_code == 2
    assert "no stiff case 'no-such-case'; there are: small-sphere-light" in done.output
    broken = tmp_path / "broken.json"
    broken.write_text("{}")
    with pytest.raises(Exception, match=r"no result of raycheck stability --json"):
        read(broken)
