"""raycheck measured: correct renderers do not FAIL, and the bias that it prints is the one that it notices.

A sample; `raycheck calibrate` measures more, and references/calibration.json keeps what it found.
"""

import json
import sys
from collections import Counter
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from raycheck.calibration import (
    gradings,
    kills,
    lines,
    many_looks,
    mutants,
    naming,
    nulls,
    rivals,
    signatures,
    trials,
)  # fmt: skip
from raycheck.grading.assignment import read_assignment
from raycheck.grading.jail.sandbox import Tier
from raycheck.grading.judge import Grader
from raycheck.judging import mistakes
from raycheck.stats.tiles import grid, region_means

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def sets(tmp_path_factory) -> list[dict]:
    """Two sets of seven configurations: 112 verdicts of correct renders with seeds that nothing else has."""
    file = tmp_path_factory.mktemp("nulls") / "nulls.jsonl"
    chosen = [one for one in nulls.CONFIGURATIONS if one.by not in ("mitsuba", "light")][:7]
    for _ in nulls.measure_nulls(file, 2, chosen):
        pass
    return nulls.read_lines(file)


def test_no_false_alarm(sets):
    verdicts = Counter(outcome for one in sets for outcome in [*one["outcomes"], one["whole"]])
    assert sum(verdicts.values()) == 14 * 9
    assert verdicts["FAIL"] == 0
    assert verdicts["PASS"] > 20  # and not by never deciding


def test_p_values_are_even(sets):
    """A hundredth of them is below 0.01: of 3,000 tiles' 30, ±5.5."""
    count: Counter = Counter()
    for one in sets:
        count.update(one["p"])
    assert count["tile of"] > 2000
    assert 0.5 < count["tile 0.01"] / count["tile of"] / 0.01 < 1.5


def test_detectable_biases_are_detected(sets):
    """Half of the printed bias is hardly ever noticed by its own test, twice as much always."""
    for name in ("image", "tile"):
        half, _, twice = np.mean([one["noticed"][name] for one in sets], axis=0)
        assert half < 0.3
        assert twice > 0.9


def test_an_interrupted_run_goes_on(tmp_path):
    file = tmp_path / "nulls.jsonl"
    one = nulls.CONFIGURATIONS[0]
    [first] = nulls.measure_nulls(file, 1, [one])
    assert list(nulls.measure_nulls(file, 1, [one])) == []
    file.write_text(file.read_text() + '{"configuration": "cut o')
    assert nulls.read_lines(file)[0]["outcomes"] == first.outcomes
    assert nulls.summary(file)["verdicts"] == 8
    lines.append_lines(file, [asdict(first)])
    assert len(nulls.read_lines(file)) == 2  # what was cut off is gone


@pytest.fixture(scope="module")
def looks(tmp_path_factory) -> dict:
    """Five looks at one set of four configurations, and their summary."""
    file = tmp_path_factory.mktemp("looks") / "looks.jsonl"
    chosen = [one for one in nulls.CONFIGURATIONS if one.by not in ("mitsuba", "light")][:4]
    assert len(list(many_looks.measure(file, 1, chosen))) == 4
    assert list(many_looks.measure(file, 1, chosen)) == []  # it goes on where it was
    return many_looks.summary(file)


def test_no_false_alarm_in_five_looks(looks):
    assert looks["verdicts"] == 4 * 8
    assert looks["false_alarms"] == looks["false_alarms_whole"] == 0
    assert looks["largest_evidence"] < 1000 < looks["needed_evidence"]
    passed = list(looks["passed_after"].values())
    assert passed == sorted(passed) and passed[-1] > passed[0]


def test_e_is_at_most_one_on_average(looks):
    """Of 40 sets of images of four scenes, on which p-values of single tiles are even."""
    assert 0.2 < looks["mean_e"]["image"] < 1.2 and 0.2 < looks["mean_e"]["tile"] < 1.0
    assert 0.5 < looks["p_values"]["tile"]["0.01"] / 0.01 < 1.5


def test_more_looks_notice_less(looks):
    """Together far less than each by itself."""
    power = looks["power"]
    errors = {n: power[n]["standard_errors"] for n in ("1", "2", "5")}
    assert errors["1"]["together"] > errors["2"]["together"] > errors["5"]["together"]
    assert errors["5"]["apart"] > 1.5 * errors["5"]["together"]
    for n in errors:
        half, _, twice = power[n]["image"]["together"]
        assert half <= 0.5 and twice == 1.0


class TestRivals:
    """The other rules do what their authors' do."""

    def images(self, factor=1.0, spp=16):
        truth = trials.load_truth("area-light")
        rng = np.random.default_rng(1)
        noise = rng.standard_normal((64, *truth.mean.shape)) * np.sqrt(truth.sample_variance / spp)
        return factor * truth.mean + noise, truth

    def test_right(self):
        images, truth = self.images()
        assert rivals.judge(images, 16, truth) == {
            "mitsuba": False, "nori": False, "idiff": False, "welch": False,
        }  # fmt: skip

    def test_uniform_bias(self):
        """Mitsuba's per-pixel test is blind to 2 % that the mean of the image shows at once."""
        found = rivals.judge(self.images(1.02)[0], 16, self.images()[1])
        assert found["nori"] and found["welch"] and not found["mitsuba"]

    def test_mitsuba_allows_a_quarter_of_a_percent(self):
        images, truth = self.images()
        images[:, 3, 4] += 100.0
        assert not rivals.mitsuba_z(images, 16, truth)
        images[:, 30:34] += 100.0
        assert rivals.mitsuba_z(images, 16, truth)


def test_effect_is_told_in_detectable_biases(tmp_path):
    """Of a mixture it is in proportion, and what is far below 1 is not killed."""
    mutant = mutants.read(mutants.FOLDER / "brdf-2pi.patch")
    [found] = kills.measure_kills(tmp_path / "kills.jsonl", [mutant])
    assert list(kills.measure_kills(tmp_path / "kills.jsonl", [mutant])) == []
    assert found[0].effect > 50 and found[0].rejected["raycheck"]
    for one in found[1:]:
        assert one.effect == pytest.approx(one.strength * found[0].effect)
        assert one.rejected["raycheck"] or one.effect < 2
        assert not one.rejected["raycheck"] or one.effect > 0.3


def test_what_looks_the_same_in_all_that_is_seen_is_no_wrong_name(tmp_path):
    """All points of a ball, weighed as its facing half: in the two scenes whose lamp is a ball, twice the
    reflected light, whatever mistakes double it elsewhere.
    """
    mutant = mutants.read(mutants.FOLDER / "sphere-half-not-halved.patch")
    rng = np.random.default_rng(0)
    for pair in signatures.pairs([mutant]):
        of = mistakes.load(pair.scene)
        if mutant.name in of.names:
            truth = trials.load_truth(pair.scene)
            right = region_means(truth.mean, grid(*truth.shape))
            right = right * (1 + 1e-3 * rng.standard_normal((signatures.SEEDS, *right.shape)))
            broken = right + of.error[list(of.names).index(mutant.name)]
            np.savez(signatures.means_file(tmp_path, pair), broken=broken, right=right)
    found = naming.summary(tmp_path, [mutant])["all scenes"]
    assert found["catalogued"]["named"] == 1
    assert found["orphans"] == {"of": 1, "wrong": {}}
    others = set(naming.twins(mutant.name, ["spherical-light", "furnace"]))
    assert "emission-twice" in others - set(naming.twins(mutant.name, signatures.COMPLETE))


def test_the_committed_result():
    """What the README shows is of this catalogue."""
    found = json.loads((ROOT / "references/calibration.json").read_text(encoding="utf-8"))
    assert found["nulls"]["false_alarms"] == found["nulls"]["false_alarms_whole"] == 0
    assert found["mutants"]["not_equivalent"] >= 60
    assert found["mutants"]["killed"]["raycheck"] / found["mutants"]["not_equivalent"] >= 0.95
    assert found["mutants"]["equivalent_rejected"]["raycheck"] == 0
    assert len(found["nulls"]["configurations"]) >= 8
    looks = found["looks"]
    assert looks["verdicts"] >= 3200 and looks["looks"] >= 5
    assert looks["false_alarms"] == looks["false_alarms_whole"] == 0
    assert max(looks["mean_e"].values()) <= 1
    for level, most in (("0.01", 1.2), ("0.001", 1.5), ("0.0001", 2.0)):
        assert looks["p_values"]["tile"][level] <= most * float(level)
    for looked in ("2", "5"):
        for family in ("image", "tile"):
            assert looks["power"][looked][family]["together"][1] >= 0.85


GRADED = """\
name = "graded"
[[task]]
id = "L1"
scenes = ["point-light"]
points = 1
[[task]]
id = "L4"
scenes = ["many-lights"]
points = 1
technique = "nee-uniform-choice"
"""


@pytest.mark.skipif(sys.platform != "linux", reason="grading needs Linux")
def test_an_honest_program_is_not_failed(tmp_path):
    (tmp_path / "a.toml").write_text(GRADED, encoding="utf-8")
    asked = gradings.quick(read_assignment(tmp_path / "a.toml"))
    grader, file = Grader.prepare(asked, Tier.NONE), tmp_path / "gradings.jsonl"
    assert [found.reasons for found in gradings.measure(file, grader, 4)] == [[]] * 4
    assert list(gradings.measure(file, grader, 4)) == []  # it goes on where it was
    summary = gradings.summary(file, asked)
    assert summary["gradings"] == 4 and summary["verdicts"] == 8 and summary["false_failures"] == 0
    assert summary["rate_below"] == pytest.approx(1 - 0.05 ** (1 / 4), rel=1e-2)
    broken = file.read_text(encoding="utf-8").replace("PASS", "FAIL", 1)
    file.write_text(broken, encoding="utf-8")
    assert gradings.summary(file, asked)["false_failures"] == 1
