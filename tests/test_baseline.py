"""A renderer yesterday against itself today: what changed is said, and no more."""

import re
import sys
from dataclasses import replace

import numpy as np
import pytest

import raycheck
from raycheck.judging import baseline
from raycheck.judging.cases import Verification
from raycheck.truth import references
from raycheck.truth.expected import truth_of

SCENE = "point-light"


@pytest.fixture(scope="module")
def truth():
    return truth_of(references.load_reference(SCENE)).mean


def noisy(mean, noise=1.0, stir=0):
    def render(scene, spp, seed):
        k = spp / noise**2
        return mean * np.random.default_rng([seed, stir]).gamma(k, 1 / k, (*mean.shape[:2], 1))

    return render


def run(render, **more):
    found = raycheck.verify(render, SCENE, **{"spp": 32} | more)
    return Verification([replace(case, sample_seconds=0.01) for case in found.cases], found.header)


@pytest.fixture(scope="module")
def before(truth):
    return run(noisy(truth))


def said(before, now):
    return "\n".join(baseline.lines(before, now))


def test_the_same_program_is_the_same(before, truth):
    assert re.search(r"0 changed, 1 not \(1 with the same pictures\)\.$", said(before, run(noisy(truth))))


def test_other_samples_of_the_same_mean_are_no_change(before, truth):
    for stir in range(1, 6):
        told = said(before, run(noisy(truth, stir=stir)))
        assert re.search(r"0 changed, 1 not \(1 within 0\.\d+ %\)\.$", told)


def test_a_change_that_is_no_fail(truth):
    """Both days pass, and differ by more than a tenth of what a PASS allows."""
    before, after = run(noisy(truth), spp=128), run(noisy(0.9988 * truth, stir=2), spp=128)
    [change] = baseline.changes(before, after)
    assert change.verdicts == ("PASS", "PASS") and change.changed
    assert change.difference == pytest.approx(-0.0012, abs=change.half)
    told = r"point-light, renderer: 0\.\d+ % ± 0\.\d+ % darker in (red|green|blue)\."
    assert re.search(told, said(before, after))
    assert "brighter" in said(after, before)


def test_noise_and_its_error(before, truth):
    [change] = baseline.changes(before, run(noisy(truth, noise=1.3, stir=1)))
    assert change.noise == pytest.approx(1.69, rel=0.1) and change.noisier and not change.changed
    assert "times the variance of a sample" in change.sentence
    [change] = baseline.changes(before, run(noisy(truth, stir=1), spp=8))
    assert change.noise == pytest.approx(1.0, rel=0.1) and not change.noisier, "of a sample, not of an image"


def test_speed(before):
    slower = Verification([replace(before.cases[0], sample_seconds=0.03)], before.header)
    assert "3.00 times the time of a sample" in said(before, slower)
    assert "0 changed, 1 not (1 with the same pictures); 1 at another speed." in said(before, slower)
    assert "times the time" not in said(
        before, Verification([replace(before.cases[0], sample_seconds=0.011)], before.header)
    )
    elsewhere = Verification(slower.cases, before.header | {"machine": "another"})
    assert "times the time" not in said(before, elsewhere) and "another machine" in said(before, elsewhere)


def test_verdicts_and_cases_that_come_and_go(before, truth):
    wrong = run(noisy(1.1 * truth, stir=1))
    assert "was PASS, is FAIL" in said(before, wrong)
    other = Verification([replace(before.cases[0], scene="furnace")], before.header)
    told = said(before, other)
    assert "Only in the baseline: point-light, renderer." in told
    assert "Not in the baseline: furnace, renderer." in told


def test_a_baseline_without_means(before):
    old = Verification([replace(before.cases[0], means=None, errors=None, fingerprint="")], before.header)
    assert "1 of which no means were kept" in said(old, before)


def test_chance_of_a_change_that_is_none(before):
    """Of runs of 25 cases one in a thousand has any; here none of 40."""
    case = before.cases[0]
    rng, wrong = np.random.default_rng(0), 0
    for _ in range(40):

        def draw():
            return Verification([
                replace(case, scene=str(i), fingerprint="", means=tuple(rng.normal(0, case.errors)))
                for i in range(25)
            ], before.header)  # fmt: skip

        wrong += any(one.changed for one in baseline.changes(draw(), draw()))
    assert wrong == 0


def test_the_command(tmp_path):
    import subprocess

    def verify(*words):
        command = f"{sys.executable} tests/pfm_renderer.py {{output}} {{spp}} {{seed}}"
        done = subprocess.run(
            [sys.executable, "-m", "raycheck", "verify", SCENE, "--renderer", command, "--spp", "1", *words],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        return done.returncode, done.stdout, done.stderr

    file = tmp_path / "yesterday.json"
    assert verify("--json", str(file))[0] == 0
    status, out, _ = verify("--baseline", str(file))
    assert status == 0 and "0 changed, 1 not (1 with the same pictures)" in out
    status, out, said = verify("--baseline", str(tmp_path / "none.json"))
    assert (status, out) == (2, "") and len(said.splitlines()) == 1 and "none.json" in said
    (tmp_path / "text.json").write_text("hello")
    status, out, said = verify("--baseline", str(tmp_path / "text.json"))
    assert (status, out) == (2, "") and "not a result of raycheck verify --json" in said
