"""The time of a run, by a simulated clock: start-up, pace and the machine's load are drawn, nothing is waited
for.
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from simulated import Simulated, truth_at

import raycheck
from raycheck.base.errors import CannotRender, NotFound
from raycheck.base.text import duration, times
from raycheck.judging import plan as planning
from raycheck.scene.variants import variant
from raycheck.stats.verdict import Limits, Outcome

HERE = Path(__file__).parent
SCENE = "area-light"
SCENES = ("area-light", "furnace", "point-light", "spherical-light", "hidden-light", "touching-light")


def judged(renderer: Simulated, scenes=SCENE, **options) -> raycheck.Verification:
    return raycheck.verify(renderer, scenes, clock=renderer.clock, jobs=1, **options)


def drawn(number: int) -> Simulated:
    """A renderer and a machine, drawn evenly in the logarithm: starts of 5 ms to 1 s, samples of 0.1 to 20
    ms, a machine up to 8 times slower than it could be, by a quarter more or less from picture to picture.
    """
    rng = np.random.default_rng(number)
    start, sample, load = np.exp(rng.uniform(np.log([5e-3, 1e-4, 1]), np.log([1, 2e-2, 8])))
    return Simulated(start, sample, load=load, swing=0.25, cold=rng.uniform(0, 2), noise=rng.uniform(0.5, 4))


def seconds_of(number: int) -> float:
    """What a run of `drawn(number)` may take."""
    return 30 + 100 * np.random.default_rng(number).random()


def test_what_would_decide_does_and_half_of_it_does_not() -> None:
    """The estimate of samples is within a factor 2 of what decides, and so is that of seconds."""
    undecided = 0
    for number in range(20):
        try:
            [case] = judged(drawn(number), seconds=seconds_of(number)).cases
        except NotFound:
            continue
        if case.verdict is not Outcome.INCONCLUSIVE or not case.spp:
            continue
        undecided += 1
        samples, taken = case.spp * case.more_samples, {}
        for share in (0.5, 1.0):
            one = drawn(number)
            [again] = judged(one, spp=round(share * samples), seed=7).cases
            taken[share] = again.verdict, one.now
        assert taken[0.5][0] is Outcome.INCONCLUSIVE, (number, case.reason)
        assert taken[1.0][0] is Outcome.PASS, (number, case.reason)
        assert case.more_seconds / 2 < taken[1.0][1] < 2 * case.more_seconds, (number, case.reason, taken)
    assert undecided >= 6


def test_the_seconds_that_are_said_decide() -> None:
    """Nearly always when they are given to --seconds, and without much to spare."""
    decided, shares = [], []
    for number in range(20):
        try:
            [case] = judged(drawn(number), seconds=seconds_of(number)).cases
        except NotFound:
            continue
        if case.verdict is Outcome.INCONCLUSIVE and case.spp:
            one = drawn(number)
            [again] = judged(one, seconds=case.more_seconds, seed=7).cases
            decided.append(again.verdict is Outcome.PASS)
            shares.append(one.now / case.more_seconds)
    assert len(decided) >= 6 and sum(decided) >= len(decided) - 1, decided
    assert np.median(shares) > 0.6, shares


def test_the_seconds_that_are_said_after_looks_decide() -> None:
    """Given to --until, all that a run takes is in them, and that samples come in looks."""
    for noise in (20.0, 60.0):
        [case] = judged(Simulated(start=0.2, sample=2e-3, noise=noise), until=1e-3).cases
        assert case.verdict is Outcome.INCONCLUSIVE
        one, longer = (Simulated(start=0.2, sample=2e-3, noise=noise) for _ in range(2))
        [again] = judged(one, until=case.more_seconds).cases
        assert again.verdict is Outcome.PASS and again.looks > 1
        assert case.more_seconds / 2 < one.now < 0.95 * case.more_seconds, "something is in reserve"
        [short] = judged(longer, until=case.more_seconds / 3).cases
        assert short.verdict is Outcome.INCONCLUSIVE


def test_the_more_regions_chance_may_take_too_far_the_more_samples_are_said(monkeypatch) -> None:
    truth = truth_at(variant(SCENE).path)
    even = np.full_like(truth.sample_variance, 0.2 * truth.mean.mean() ** 2)
    pilot = planning.Pilot(even, {size: np.zeros_like(t) for size, t in truth.skewness.items()}, 1.0)
    needed = planning.more_needed(pilot, truth, 32, Limits(), 1)
    whole = planning._unlucky
    noise = np.abs(np.random.default_rng(1).standard_t(50, (4000, 64)))
    said = whole(np.full((64, 3), 3.0), 50)
    assert said == pytest.approx((noise > 3.0).any(axis=1).mean(), rel=0.25)

    def of_the_worst(luck, freedom):
        return whole(luck[[luck.min(axis=1).argmin()]], freedom)

    monkeypatch.setattr(planning, "_unlucky", of_the_worst)
    assert needed > 1.2 * planning.more_needed(pilot, truth, 32, Limits(), 1) > 1.2


def test_seconds_hold() -> None:
    """No run takes longer than it may; nearly all that is announced is judged, and what is not is said."""
    runs = ended = announced = 0
    for number in range(24):
        one, seconds, plans = drawn(100 + number), 4 * seconds_of(number), []
        try:
            result = judged(one, SCENES, seconds=seconds, on_plan=plans.append)
        except NotFound as error:
            assert one.now < 0.2 * seconds and "--seconds" in str(error), (one, str(error))
            continue
        assert one.now <= seconds, one
        [plan] = plans
        runs += 1
        announced += len(plan.fits)
        ended += sum("run were over" in case.reason for case in result.cases)
        assert {case.scene for case in result.cases} | set(result.header["left_out"]) == set(SCENES)
    assert runs >= 12
    assert ended <= 0.1 * announced


def test_a_slow_start_gets_the_samples_that_cost_nothing() -> None:
    one = Simulated(start=0.4, sample=4e-4)
    [case] = judged(one, seconds=60).cases
    assert case.verdict is Outcome.PASS and case.spp >= 24
    assert one.now < 1.4 * 73 * one.start
    noisy = Simulated(start=0.4, sample=4e-4, noise=60.0)
    [case] = judged(noisy, seconds=50).cases
    assert case.spp >= 110
    assert noisy.now < 1.6 * 73 * noisy.start


def test_a_start_that_leaves_no_time_gets_them_too() -> None:
    """Also where times from picture to picture differ by more than samples take."""
    slow = Simulated(start=2.0, sample=4e-4)
    [case] = judged(slow).cases
    assert case.verdict is Outcome.PASS and case.spp >= 24
    for seed in range(4):
        one = Simulated(start=0.5, sample=4e-4, noise=20.0, swing=0.25)
        [case] = judged(one, seconds=75, seed=seed).cases
        assert case.spp >= 64, (seed, case.spp)


def test_a_slow_pace_gets_a_few_samples_at_least() -> None:
    [case] = judged(Simulated(start=0.01, sample=0.5)).cases
    assert case.verdict is not Outcome.FAIL and case.spp >= 4


def test_what_would_decide_weighs_the_start() -> None:
    """110 times the samples are not 110 times as long."""
    one = Simulated(start=0.4, sample=1e-4, noise=400.0)
    [case] = judged(one, spp=8).cases
    assert case.more_samples > 40
    longer = 64 * one.seconds(8 * case.more_samples)
    assert case.more_seconds == pytest.approx(longer, rel=0.3)
    assert case.more_seconds < 0.1 * case.more_samples * 64 * one.seconds(8)


def test_a_loaded_machine_judges_fewer_cases_of_as_many_samples() -> None:
    def run(load: float) -> tuple[list[raycheck.Case], float]:
        one = Simulated(start=0.03, sample=2e-3, load=load, swing=0.1)
        return judged(one, SCENES).cases, one.now

    (quiet, _), (loaded, spent) = run(1.0), run(12.0)
    assert len(quiet) == len(SCENES) > len(loaded) > 0
    assert all(case.spp >= 4 or case.verdict is Outcome.PASS for case in loaded)
    assert spent <= 90


def test_one_case_is_judged_whatever_it_takes_where_nobody_set_the_seconds() -> None:
    one, plans = Simulated(start=3.0, sample=0.01), []
    [case] = judged(one, SCENES, on_plan=lambda plan: plans.append(str(plan))).cases
    assert case.verdict is not Outcome.FAIL and one.now > 90
    assert "takes about 5 minutes, longer than the usual 90 s" in plans[0]
    with pytest.raises(NotFound, match="--seconds 90 is not enough for a verdict: area-light takes"):
        judged(Simulated(start=3.0, sample=0.01), SCENES, seconds=90)


def test_what_fits_is_told_first() -> None:
    plans, told = [], []
    one = Simulated(start=0.5, sample=1e-3)
    result = judged(
        one, SCENES, seconds=110, on_plan=lambda plan: plans.append(str(plan)),
        on_case=lambda case, total: told.append((case.scene, len(plans))),
    )  # fmt: skip
    [plan] = plans
    assert plan.startswith("110 s are enough for 2 of 6 cases: area-light, furnace. --seconds ")
    assert told[0] == ("area-light", 1)
    assert set(result.header["left_out"]) == set(SCENES[2:])
    assert "not enough for all" in result.header["left_out"]["touching-light"]


def test_what_is_decided_already_counts_among_what_fits() -> None:
    class Flat(Simulated):
        def render(self, scene, spp, seed, timeout):
            if scene.stem == "furnace":
                raise CannotRender("unsupported: balls")
            return super().render(scene, spp, seed, timeout)

    plans, one = [], Flat(start=0.5, sample=1e-3)
    scenes = ["furnace", "area-light", "point-light", "checkerboard"]
    judged(one, scenes, seconds=110, on_plan=lambda plan: plans.append(str(plan)))
    told = "110 s are enough for 3 of 4 cases: area-light, point-light, and 1 decided already. --seconds "
    assert plans[0].startswith(told)


def test_a_run_too_small_for_all_climbs_the_ladder() -> None:
    one, plans = Simulated(start=0.5, sample=1e-3), []
    result = judged(one, (), seconds=170, on_plan=plans.append)
    assert plans[0].fits == ["point-light", "area-light", "checkerboard"]
    assert [case.scene for case in result.cases][:3] == plans[0].fits


def test_what_shows_a_bias_is_planned_and_its_time_is_told_first() -> None:
    """By the pilot of the verdict, which is rendered once."""
    one, told = Simulated(start=0.1, sample=2e-3), []
    result = judged(one, SCENES[:2], detect=0.002, on_samples=lambda plans: told.extend((one.now, plans)))
    before, plans = told
    for case, plan in zip(result.cases, plans, strict=True):
        assert case.spp == plan.spp and case.mde_image < 0.0021
        assert plan.seconds == pytest.approx(64 * one.seconds(plan.spp), rel=0.1)
    assert one.now == pytest.approx(before + sum(plan.seconds for plan in plans), rel=0.1)
    assert one.pictures.count(16) == 2 * 8


def test_a_milder_level_needs_fewer_samples() -> None:
    """Of the same detectable bias."""
    spp = {}
    for level in (1e-6, 0.05):
        [case] = judged(Simulated(start=0.1, sample=2e-3), detect=0.002, level=level).cases
        spp[level] = case.spp
        assert case.mde_image < 0.0021
    assert spp[0.05] < 0.7 * spp[1e-6]


@pytest.mark.parametrize("how", [{"until": 5.0}, {"detect": 0.01}, {"spp": 1}])
def test_what_is_not_supported_is_skip_however_one_looks(how: dict[str, float]) -> None:
    def render(scene, spp, seed):
        raise NotImplementedError("lamps")

    [case] = raycheck.verify(render, SCENE, **how).cases
    assert (case.verdict, case.reason) == (Outcome.SKIP, "unsupported: lamps")


@pytest.mark.parametrize(
    ("value", "said"),
    [(1.2, "1.2"), (1.234, "1.2"), (4.0, "4"), (9.96, "10"), (23.4, "23"), (110.3, "110"), (1287, "1,300")],
)
def test_times_are_no_powers_of_ten(value: float, said: str) -> None:
    assert times(value) == said


@pytest.mark.parametrize(
    ("seconds", "said"),
    [(1.54, "1.5 s"), (59, "59 s"), (240, "4 minutes"), (39000, "11 hours"), (8e6, "93 days")],
)
def test_durations(seconds: float, said: str) -> None:
    assert duration(seconds) == said


def test_rows_and_json_come_as_they_are_decided(tmp_path: Path, oneray: Path) -> None:
    """Also into a pipe."""
    program = f'"{sys.executable}" "{HERE / "partial_renderer.py"}"'
    renderer, found = program + " {json} {scene} {output} {spp} {seed}", tmp_path / "found.json"
    words = ["verify", "furnace", "area-light", "--spp", "1", "--renderer", renderer, "--json", found]
    process = subprocess.Popen([sys.executable, "-m", "raycheck", *words], stdout=subprocess.PIPE, text=True)
    assert process.stdout
    header, first = process.stdout.readline(), process.stdout.readline()
    running = process.poll() is None
    rest = process.stdout.read()
    process.wait()
    assert header.split()[:3] == ["scene", "technique", "verdict"]
    assert first.split()[:3] == ["furnace", "renderer", "SKIP"]
    assert running and rest.startswith("area-light")
    cases = json.loads(found.read_text(encoding="utf-8"))["cases"]
    assert cases[0]["verdict"] == "SKIP" and len(cases) == 2
