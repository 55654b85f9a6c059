"""The audit of renderers: its closed forms, its judge, and what was found."""

from __future__ import annotations

import dataclasses
import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy import integrate

from raycheck.base.errors import NotFound, RenderError
from raycheck.measuring.audit import forms, judging, luxcore, results, running, tables
from raycheck.measuring.audit.check import ALLOWED, BUDGET, LEVEL, Check
from raycheck.measuring.audit.checks import CHECKS, false_alarms, named

ROOT = Path(__file__).resolve().parents[1]
KEPT = ROOT / "references/audit.json"
COUNT = 100_000
"""Photons of the walk."""
BY_ID = {check.id: check for check in CHECKS}

# ---- Closed forms, each by another way.


def test_the_lamp_by_quadrature() -> None:
    """∫ cos θ cos θ′ / (π d²) dA over the lamp; above the corner of the view, too."""

    def kernel(y: float, x: float, at: float = 0.0) -> float:
        return float(1 / (math.pi * (1 + (x - at) ** 2 + y**2) ** 2))

    whole = integrate.dblquad(kernel, -0.5, 0.5, -0.5, 0.5)[0]
    assert forms.square_above(1, 1) == pytest.approx(whole, rel=1e-9)
    assert forms.square_above(2, 2) == forms.square_above(1, 1)
    assert forms.over_square(1e-4) == pytest.approx(whole, rel=1e-7)
    aside = integrate.dblquad(lambda y, x: kernel(y, x, 0.1), -0.5, 0.5, -0.5, 0.5)[0]
    assert aside < forms.over_square(0.05) < whole


@pytest.mark.parametrize("albedo", [0.3, 0.9, 0.99])
def test_the_half_space_keeps_its_moment(albedo: float) -> None:
    """∫₀¹ H dμ = 2 (1 − √(1−ϖ)) / ϖ; and H by his other equation, 1/H = 1 − ϖ μ/2 ∫ H/(μ+t) dt."""
    moment = integrate.quad(lambda mu: forms.h_function(albedo, mu), 0, 1, epsabs=1e-9)[0]
    assert moment == pytest.approx(2 * (1 - math.sqrt(1 - albedo)) / albedo, rel=1e-6)
    inner = integrate.quad(lambda t: forms.h_function(albedo, t) / (1 + t), 0, 1, epsabs=1e-9)[0]
    assert 1 / forms.h_function(albedo, 1.0) == pytest.approx(1 - albedo / 2 * inner, rel=1e-6)


def test_the_half_space_by_a_walk() -> None:
    """A random walk of its own, 10⁵ photons with weights, within 5 standard errors."""
    rng = np.random.default_rng(5)
    depth, mu, weight = np.zeros(COUNT), np.full(COUNT, -1.0), np.ones(COUNT)
    out = np.zeros(COUNT)
    inside = np.ones(COUNT, dtype=bool)
    for _ in range(120):
        depth[inside] += np.log1p(-rng.random(inside.sum())) * mu[inside]  # down where μ < 0
        left = inside & (depth < 0)
        out[left] = weight[left]
        inside &= ~left
        weight[inside] *= 0.9
        mu[inside] = rng.uniform(-1, 1, inside.sum())
    error = out.std() / math.sqrt(COUNT)
    assert abs(out.mean() - forms.half_space(0.9)) < 5 * error < 1e-2


def test_the_rough_mirror() -> None:
    """1 − ln 2 at α = 1; nothing lost by a smooth one; half an hour of arithmetic at α = .5: .6878."""
    assert forms.rough_mirror(1.0) == pytest.approx(1 - math.log(2), rel=1e-10)
    assert forms.rough_mirror(1e-3) == pytest.approx(1, abs=1e-4)
    # Half vectors in proportion to D cos θ, with weight G₁.
    u = (np.arange(200_000) + 0.5) / 200_000
    theta = np.arctan(0.5 * np.sqrt(u / (1 - u)))
    g = np.where(theta < np.pi / 4, 2 / (1 + np.sqrt(1 + 0.25 * np.tan(2 * theta) ** 2)), 0)
    assert forms.rough_mirror(0.5) == pytest.approx(g.mean(), rel=1e-4)


@pytest.mark.parametrize("offset", [-2.5, -1.25, -0.3, 0.0, 0.25, 1.9, 3.0])
def test_the_step_by_quadrature(offset: float) -> None:
    def bell(x: float) -> float:
        return max(0.0, math.exp(-2 * x * x) - math.exp(-8)) if abs(x) < 2 else 0.0

    part = integrate.quad(bell, -2, max(-2, min(offset, 2)), epsabs=1e-12)[0]
    whole = integrate.quad(bell, -2, 2, epsabs=1e-12)[0]
    assert forms.filtered_step(offset) == pytest.approx(part / whole, abs=1e-9)


def test_oren_nayar_by_its_formula() -> None:
    assert luxcore.oren_nayar(0) == 1
    assert luxcore.oren_nayar(20) == pytest.approx(1 - 0.060923484 / 0.4518469679, rel=1e-8)


# ---- The judge: a planted bias is found, and what is right is not.

FAIR = Check("x", "mitsuba", "", "", 1, lambda: (1.0,), "")


def judged(bias: float, seed: int = 0, noise: float = 3e-3, check: Check = FAIR) -> str:
    rng = np.random.default_rng(seed)
    batches = (1 + bias) * rng.gamma(1 / noise**2, noise**2, (32, 1))
    return judging.verdict(check, judging.values(("radiance",), (1.0,), batches))


def test_a_planted_bias_is_found_and_health_is_said_of_what_is_right() -> None:
    assert {judged(0.01, seed) for seed in range(20)} == {"finding"}
    assert {judged(-0.01, seed) for seed in range(20)} == {"finding"}
    assert {judged(0.0, seed, noise=1e-3) for seed in range(20)} == {"health"}


def test_what_convention_may_cause_is_no_finding() -> None:
    assert judged(0.9 * ALLOWED, noise=1e-6) == "health"
    assert judged(1.1 * ALLOWED, noise=1e-6) == "finding"


def test_too_much_noise_is_undecided() -> None:
    assert judged(0.0, noise=0.05) == "undecided"
    assert judged(0.004, noise=0.01) == "undecided"


def test_a_documented_approximation_is_called_that() -> None:
    said = dataclasses.replace(FAIR, documented="in the manual")
    assert judged(0.01, check=said) == "documented approximation"
    assert judged(0.0, noise=1e-3, check=said) == "health"


def test_one_half_alone_finds_nothing() -> None:
    """The first half of the batches is off, the second not for sure: no claim, though the interval is off."""
    batches = 1 + np.r_[np.full(16, 0.05), np.tile([-0.005, 0.025], 8)]
    [value] = judging.values(("radiance",), (1.0,), batches[:, None])
    assert value.low > 1 + ALLOWED and not value.deviates


def test_fair_renderers_raise_no_alarm() -> None:
    """30,000 fair values, skewed as small samples are: at 1e-5 each, more than 4 have probability 2e-5."""
    rng = np.random.default_rng(3)
    batches = rng.gamma(50, 1 / 50, (32, 30_000))
    names = ("radiance",) * 30_000
    assert sum(v.deviates for v in judging.values(names, np.ones(30_000), batches)) <= 4


def test_an_interval_misses_as_seldom_as_it_says() -> None:
    """At its own level of 1e-5, 20,000 of them: more than 3 misses have probability 6e-5."""
    batches = np.random.default_rng(4).gamma(200, 1 / 200, (32, 20_000))
    found = judging.values(("radiance",) * 20_000, np.ones(20_000), batches)
    assert sum(not v.low <= 1 <= v.high for v in found) <= 3


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_a_picture_of_no_numbers_is_no_record(wrong: float) -> None:
    with pytest.raises(RenderError, match="x: the picture has values that are not finite"):
        running.run(FAIR, lambda check, seeds: ("1", np.full((len(seeds), 8, 8, 3), wrong)))


def test_a_run_has_all_that_one_needs() -> None:
    """A renderer that is 2 % too bright, by the whole way from pictures to a record."""
    rng = np.random.default_rng(0)
    record = running.run(BY_ID["mitsuba-matte"], lambda check, seeds: (
        "3.9.1", 0.6 * 1.02 * rng.gamma(100, 0.01, (len(seeds), 8, 8, 3))
    ))  # fmt: skip
    assert record.verdict == "finding"
    [value] = record.values
    assert value.low < 0.612 < value.high and value.expected == 0.6
    assert record.command == "python scripts/audit.py run mitsuba-matte"


# ---- The checks, and what was found.


def test_the_budget_of_false_alarms() -> None:
    assert LEVEL == 1e-5 and BUDGET == 1e-3
    assert false_alarms() == pytest.approx(LEVEL * sum(len(check.expected()) for check in CHECKS))
    assert false_alarms() <= BUDGET * (1 + 1e-9)


@pytest.mark.parametrize("check", CHECKS, ids=lambda one: one.id)
def test_a_check_is_complete(check: Check) -> None:
    assert check.id.startswith(f"{check.renderer}-") and check.renderer in running.RENDERERS
    assert len(check.names) == len(check.expected()) and min(check.expected()) > 0
    assert check.says and check.why and "\n" not in check.says + check.why + check.act
    assert check.batches >= 16 and check.batches % 2 == 0
    assert check.scene.strip() and "/home" not in check.scene


def test_ids_are_unique() -> None:
    assert len(BY_ID) == len(CHECKS)


def kept() -> list[results.Record]:
    return results.read(KEPT)[0]


@pytest.mark.parametrize("record", kept(), ids=lambda one: one.id)
def test_a_record_is_of_its_check(record: results.Record) -> None:
    """What is committed was measured with the scene, the value and the verdict's rule that are here."""
    check = BY_ID[record.id]
    assert (record.scene, record.samples, record.batches) == (check.scene, check.samples, check.batches)
    assert (record.settings, record.says, record.why) == (dict(check.settings), check.says, check.why)
    assert (record.documented, record.act, record.report) == (check.documented, check.act, check.report)
    assert [value.expected for value in record.values] == pytest.approx(list(check.expected()), rel=1e-9)
    assert record.verdict == judging.verdict(check, record.values)
    assert record.version
    if record.verdict == "finding":
        assert record.act and record.report
    for value in record.values:
        assert value.low <= value.measured <= value.high
        assert not value.deviates or not value.low <= value.expected <= value.high


def test_the_audit_is_over_five_renderers() -> None:
    """In the order of the checks, none undecided, each renderer with something that is right."""
    records = kept()
    ids = [one.id for one in records]
    assert ids == [check.id for check in CHECKS if check.id in ids]
    assert "undecided" not in {one.verdict for one in records}
    titles = {renderer.title for renderer in running.RENDERERS.values()}
    assert {one.renderer for one in records} == titles and len(titles) == 5 and len(records) >= 12
    assert {one.renderer for one in records if one.verdict == "health"} == titles
    assert results.read(KEPT)[1]["budget"] == BUDGET


def test_what_a_new_version_changed() -> None:
    [old] = [one for one in kept() if one.id == "mitsuba-blend-of-mirror"]
    assert results.changed(old, old) == ""
    assert results.changed(None, old) == f"new: {old.verdict}"
    right = [dataclasses.replace(v, measured=v.expected, low=v.expected, high=v.expected) for v in old.values]
    new = dataclasses.replace(old, version="9.9", verdict="health", values=right)
    said = results.changed(old, new)
    assert "Mitsuba 3.9.1 is now 9.9" in said and "finding is now health" in said and "red: " in said


def test_a_file_is_read_as_it_was_written(tmp_path: Path) -> None:
    records, header = results.read(KEPT)
    assert results.to_json(records, header) == KEPT.read_text(encoding="utf-8")
    (tmp_path / "x.json").write_text("{}", encoding="utf-8")
    with pytest.raises(NotFound, match=r"x\.json: no result of scripts/audit\.py --json"):
        results.read(tmp_path / "x.json")


def test_the_table_has_each_record_once() -> None:
    records = kept()
    text = tables.findings(records) + tables.health(records)
    for one in records:
        assert (f"### {one.id}\n" in text) + (f"| `{one.id}` |" in text) == 1


# ---- The command.


def audit(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, ROOT / "scripts/audit.py", *words], capture_output=True, text=True, timeout=120
    )


def test_what_is_not_there_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAYCHECK_AUDIT", str(tmp_path))
    done = audit("run", "cycles")
    assert done.returncode == 3
    assert done.stderr == (
        f"audit: Blender Cycles is not in {tmp_path}/cycles: python scripts/audit.py setup cycles\n"
    )
    assert audit("run", "mitsuba-mat").stderr.startswith(
        "audit: no check or renderer mitsuba-mat; did you mean mitsuba-matte?"
    )
    assert audit("setup", "arnold").returncode == 2
    assert [one.id for one in named(["raysect"])] == [c.id for c in CHECKS if c.renderer == "raysect"]


def test_two_renderers_by_the_command(tmp_path: Path, oneray: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The blend of a mirror: wrong in Mitsuba, right in oneray; against what is kept, nothing changed."""
    monkeypatch.setenv("ONERAY", str(oneray))
    file = tmp_path / "found.json"
    words = ("mitsuba-blend-of-mirror", "oneray-within-a-ball-lamp")
    done = audit("run", *words, "--json", str(file), "--against", str(KEPT))
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.splitlines()[-1] == "nothing changed"
    found = json.loads(file.read_text(encoding="utf-8"))
    assert [one["verdict"] for one in found["records"]] == ["finding", "health"]


def test_a_renderer_that_gives_no_picture_says_why() -> None:
    """Its own last line."""
    broken = dataclasses.replace(FAIR, scene="<scene")
    with pytest.raises(RenderError, match="x: Mitsuba gave no pictures: "):
        running.run(broken)
