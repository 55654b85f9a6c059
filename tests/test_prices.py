"""What techniques cost: from standard errors to prices, and the command that prints them."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from raycheck.base.text import number
from raycheck.judging.agenda import oneray_agenda
from raycheck.measuring import price_tables, prices
from raycheck.measuring.prices import Measurement
from raycheck.scene.variants import variant
from raycheck.stats.spread import Spread

ROOT = Path(__file__).resolve().parents[1]


def raycheck(*words: object) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(
        [sys.executable, "-m", "raycheck", "techniques", *map(str, words)], capture_output=True, text=True
    )
    assert "Traceback" not in done.stderr
    return done


def measured(variance: float, seconds: float) -> Measurement:
    return Measurement(np.full((4, 4), variance), seconds, 0.0)


def test_variance_of_a_sample_from_the_error_of_the_mean() -> None:
    stderr = np.array([[[0.1, 0.2, 0.3]]])
    assert prices.sample_variance(stderr, 100) == pytest.approx(100 * (0.01 + 0.04 + 0.09) / 3)


def test_variance_from_two_pictures() -> None:
    """On average that of the mean, times the samples: what standard errors say of independent samples."""
    generator = np.random.default_rng(3)
    one, other = 0.5 + 0.1 * generator.standard_normal((2, 100, 100, 3))
    assert prices.pair_variance(one, other, 64).mean() == pytest.approx(64 * 0.01, rel=0.05)


def test_sobol_points_are_priced_by_two_pictures(oneray: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Direct light: variance times samples falls with the samples, where that of independent ones stays. The
    pictures have 4096 pixels, so that the ratios are known to a few percent.
    """
    monkeypatch.setenv("ONERAY", str(oneray))
    agenda = oneray_agenda([variant("cornell-box@depth=2")], ("mis-default", "mis-sobol"))
    chance, sobol = ([prices.measure(task, n, 5).variance.mean() for n in (16, 64)] for task in agenda.tasks)
    assert chance[1] == pytest.approx(chance[0], rel=0.15)
    assert sobol[1] < 0.7 * sobol[0] and sobol[1] < chance[1] / 10
    spp = prices.samples_for(agenda.tasks[1], 0.1, 6)
    assert spp >= prices.LEAST_SPP and spp & (spp - 1) == 0


def test_efficiency_is_one_over_variance_times_time() -> None:
    """Half the variance in thrice the time is worth two thirds; a slow round is slow for both."""
    own = [measured(1, 3), measured(1, 6), measured(1.1, 3)]
    baseline = [measured(2, 1), measured(2, 2), measured(2, 1)]
    found = prices.price("nee", 16, own, baseline)
    assert found.relative_time == Spread(3, 3, 3)
    assert found.relative_variance.median == pytest.approx(0.5)
    assert found.efficiency.median == pytest.approx(2 / 3)
    assert found.efficiency.low == pytest.approx(2 / 3.3)


def test_what_does_not_vary_has_no_price() -> None:
    """A technique without variance is beyond comparison, and a baseline without is no yardstick."""
    nothing, something = [measured(0, 1)] * 3, [measured(1, 1)] * 3
    perfect = prices.price("walk-cosine", 16, nothing, something)
    assert perfect.efficiency is None
    assert price_tables.row(perfect)[2:] == ("0", "", "1.00", "∞")
    worse = prices.price("nee", 16, something, nothing)
    assert worse.relative_variance is None
    assert price_tables.row(worse)[2:] == ("∞", "", "1.00", "0")
    assert prices.most_efficient_first([worse, perfect]) == [perfect, worse]


def test_relative_error_of_a_variance() -> None:
    """Its average over many trials is how much the variances really scatter."""
    generator = np.random.default_rng(7)
    trials = generator.chisquare(15, size=(400, 3, 8, 8)) / 15
    estimates = [prices.relative_error(trial) for trial in trials]
    assert np.mean(estimates) == pytest.approx(trials.mean(axis=(1, 2, 3)).std(), rel=0.1)


def test_numbers_and_ids() -> None:
    assert [number(x) for x in (0.01234, 1, 45.6, 999.7, 12345)] == [
        "0.0123", "1.00", "45.6", "1000", "12,300",
    ]  # fmt: skip
    assert price_tables.lecture_ids(("L9", "L1", "L2", "L3", "L13", "L14", "L14")) == "L1–3 L9 L13 L14"


def test_the_command(oneray: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The baseline is 1 by definition; what the scene says to be unbounded is marked; delta lights have
    another baseline.
    """
    monkeypatch.setenv("ONERAY", str(oneray))
    file = tmp_path / "prices.json"
    done = raycheck("touching-light", "point-light", "glass-ball", "--spp", 8, "--json", file)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""  # no progress bar in a pipe
    assert all(len(line) <= 140 for line in done.stdout.splitlines() if "left out" not in line)
    assert "touching-light, 3 rounds, against walk-cosine" in done.stdout
    assert "point-light, 3 rounds, against nee" in done.stdout
    assert "nee *" in done.stdout and "may be infinite" in done.stdout
    assert "light is left out: pixel" in done.stdout
    assert "mis-sobol: the variance of 8 samples, times 8; more have less." in done.stdout
    found = prices.read(file)
    assert [one.scene for one in found] == ["touching-light", "point-light", "glass-ball"]
    for one in found:
        baseline = next(p for p in one.prices if p.technique == one.baseline)
        assert baseline.efficiency == Spread(1, 1, 1)
        assert all(p.spp == 8 and p.variance_error > 0 for p in one.prices)
    header = json.loads(file.read_text())
    assert header["command"].startswith("raycheck techniques touching-light")
    assert header["machine"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nowhere"], "raycheck: no scene 'nowhere'; there are"),
        (["furnace", "-Dalbedo=1"], "raycheck: furnace has no parameter albedo"),
        (["furnace", "-Ddepth"], "raycheck: -Ddepth: -Dname=value is wanted"),
        (["--json", "/no/such/folder/x.json"], "raycheck: /no/such/folder/x.json"),
    ],
)
def test_what_cannot_run_says_so_in_a_line(words: list[str], message: str) -> None:
    done = raycheck(*words)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith(message)
    assert done.stderr.count("\n") == 1
