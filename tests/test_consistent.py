"""A bias that shrinks with a parameter: its limit is judged, and its order said. Seeds are fixed."""

import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from raycheck.base.errors import NotFound
from raycheck.judging import consistent
from raycheck.judging import verify as verify_module
from raycheck.judging.cases import Case
from raycheck.judging.consistent import Sweep
from raycheck.judging.settings import Settings
from raycheck.scene.variants import variant
from raycheck.stats.tiles import Tile, whole
from raycheck.stats.verdict import Expected, Limits, Outcome

REGIONS = [whole(16, 16), *(Tile(r, c, 8, 8) for r in (0, 8) for c in (0, 8))]
SWEEP = Sweep.parse("radius=0.4,0.2,0.1,0.05")


def expected(variance=0.0):
    full = [np.broadcast_to(x, (5, 3)).astype(float) for x in (1.0, variance, 0.0, 0.0)]
    return Expected(full[0], full[1], 64, full[2], full[3])


def residuals(limit=0.0, size=0.5, order=2.0, deviation=0.01, seed=0, h=None):
    """(N, 64, 5, 3): every tile has a bias of its own size."""
    rng = np.random.default_rng(seed)
    h = SWEEP.h if h is None else h
    tiles = np.array([0.5, 1.0, 1.5, 1.0])
    bias = limit + size * np.multiply.outer(h**order, tiles)
    made = bias[:, None, :, None] + deviation * rng.standard_normal((len(h), 64, 4, 3))
    return np.concatenate([made.mean(axis=2, keepdims=True), made], axis=2)


def judged(of=SWEEP, reference=None, **more):
    made = residuals(h=of.h, **more)
    return consistent.judge(of, made, REGIONS, reference or expected(), Settings())


class TestLimit:
    @pytest.mark.parametrize("order", [1.0, 2.0])
    def test_a_bias_that_vanishes_passes_and_its_order_is_said(self, order):
        outcome, said, figures = judged(order=order)
        assert outcome is Outcome.PASS
        assert figures["order"] == pytest.approx(order, abs=0.15)
        found = re.search(r"the bias falls like radius\^[\d.]+ \(order ([\d.]+) … ([\d.]+)\)", said)
        assert float(found[1]) <= order + 1e-6 and float(found[2]) >= order - 0.06
        assert abs(figures["bias"]) < 0.01 and figures["bias_low"] < 0 < figures["bias_high"]

    def test_the_finest_value_alone_would_fail(self):
        """So that the fit is what passes it."""
        finest = residuals(size=5.0)[-1].mean(axis=0)[0]
        assert np.all(finest > 0.01)
        assert judged(size=5.0)[0] is Outcome.PASS

    def test_a_limit_that_is_off_fails(self):
        outcome, said, figures = judged(limit=0.02, deviation=0.003)
        assert outcome is Outcome.FAIL
        assert figures["bias"] == pytest.approx(0.02, abs=0.004)
        assert "in the limit" in said and "+2" in said

    def test_noise_is_inconclusive(self):
        outcome, said, _ = judged(deviation=0.3)
        assert outcome is Outcome.INCONCLUSIVE and "times the samples, or finer values, would decide" in said

    def test_another_law_is_said(self):
        h = SWEEP.h
        made = residuals(size=0.0) + (0.3 * np.sin(20 * h))[:, None, None, None]
        outcome, said, _ = consistent.judge(SWEEP, made, REGIONS, expected(), Settings())
        assert outcome is Outcome.INCONCLUSIVE and "does not follow one power of radius" in said

    def test_no_bias_at_all(self):
        outcome, said, _ = judged(size=0.0, deviation=0.003)
        assert outcome is Outcome.PASS and "no bias that changes with radius is seen" in said

    def test_rising_values_are_counts(self):
        outcome, said, _ = judged(of=Sweep.parse("photons=100,1000,10000,100000"), size=10.0, order=1.0)
        assert outcome is Outcome.PASS and "falls like 1/photons^" in said

    def test_the_references_error_stays_in_the_limit(self):
        assert judged(limit=0.02, deviation=0.003, reference=expected(0.02**2))[0] is Outcome.INCONCLUSIVE

    def test_no_wrong_fail_and_no_wrong_pass(self):
        """Right ones never fail; limits off by 1.5 % never pass."""
        for seed in range(60):
            order = (1.0, 1.5, 2.0)[seed % 3]
            assert judged(seed=seed, order=order)[0] is not Outcome.FAIL
            assert judged(seed=seed, order=order, limit=0.015)[0] is not Outcome.PASS

    def test_the_level_decides(self):
        made = residuals(limit=0.0018, deviation=0.004, seed=3)
        outcomes = [
            consistent.judge(
                SWEEP, made, REGIONS, expected(), Settings(alpha=alpha, limits=Limits(1e-4, 1e-4))
            )[0]
            for alpha in (1e-12, 0.05)
        ]
        assert outcomes == [Outcome.INCONCLUSIVE, Outcome.FAIL]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("radius", "PARAM=v1,v2,v3,v4 is wanted"),
        ("=1,2,4,8", "PARAM=v1,v2,v3,v4 is wanted"),
        ("radius=1,2,x,8", "'x' is no number"),
        ("radius=4,2,1", "at least 4 values"),
        ("radius=4,2,1,-1", "above 0"),
        ("radius=8,4,2,1.5", "the same factor"),
        ("radius=1,1,1,1", "the same factor"),
        ("radius=nan,1,1,1", "at least 4"),
    ],
)
def test_wrong_values_are_told(text, told):
    with pytest.raises(NotFound, match=told):
        Sweep.parse(text)


def test_the_command_takes_each_value():
    assert SWEEP.commands("r {radius} {output}")[1] == "r 0.2 {output}"
    with pytest.raises(NotFound, match=r"has no \{radius\}"):
        SWEEP.commands("r {output}")


def test_rounded_values_are_geometric():
    assert Sweep.parse("r=0.333,0.111,0.037,0.0123").h[0] == 0.333


@pytest.mark.parametrize(
    "words",
    [
        ["--consistent", "r=8,4,2,1"],
        ["--consistent", "r=8,4,2,1", "--renderer", "x {r} {output}", "--until", "9"],
        ["--consistent", "r=8,4", "--renderer", "x {r} {output}"],
    ],
)
def test_wrong_words_are_one_line(words):
    done = subprocess.run(
        [sys.executable, "-m", "raycheck", "verify", "point-light", *words],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2 and not done.stdout
    assert len(done.stderr.splitlines()) == 1 and "--consistent" in done.stderr


def test_a_fail_says_that_a_bias_may_be_meant():
    fail = Case("s", "renderer", Outcome.FAIL, "the image as a whole is 3 % too dark (odds)", bias=0.03)
    assert "--consistent PARAM=v1,v2,v3,v4 judges its limit" in verify_module.may_shrink(fail).reason
    others = [replace(fail, bias=0.5), replace(fail, bias=None), replace(fail, verdict=Outcome.PASS)]
    known = (
        "the direct light is missing; everything else agrees",
        f"{fail.reason}; it looks like this mistake: “x”",
    )
    for other in (*others, *(replace(fail, reason=reason) for reason in known)):
        assert verify_module.may_shrink(other) == other
    once = verify_module.may_shrink(fail)
    assert verify_module.may_shrink(once) == once, "a verdict of an earlier run"


def test_the_command_may_be_a_manifests(tmp_path):
    """With the scene as JSON, which each value gets."""
    command = 'command = "./mine {json} {radius} {output}"'
    (tmp_path / "raycheck.toml").write_text(command)
    agendas = verify_module._sweep_agendas(
        SWEEP, str(tmp_path), [variant("furnace")], tmp_path, explicit=True
    )
    renderers = [agenda.tasks[0].renderer for agenda in agendas]
    assert [one.words[2] for one in renderers] == ["0.4", "0.2", "0.1", "0.05"]
    assert {one.folder for one in renderers} == {tmp_path}
    assert all(one.json.is_file() for one in renderers)
