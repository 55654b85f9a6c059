"""Looking again and again: what is wrong is found, and the level holds however often one looks.

Simulations have fixed seeds.
"""

import itertools
import json
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy import integrate
from simulated import Simulated

import raycheck
from raycheck.base.errors import NotFound
from raycheck.judging import sentences
from raycheck.judging import verify as verify_module
from raycheck.judging.settings import BATCHES, PILOT_IMAGES
from raycheck.stats import evidence as ev
from raycheck.stats import statistics as st
from raycheck.stats import verdict
from raycheck.stats.evidence import Evidence
from raycheck.stats.tiles import Tile, means_of_sums, quad_tree, region_means, tile_sums, whole
from raycheck.stats.verdict import ALPHA, Expected, Limits, Outcome
from raycheck.truth import references
from raycheck.truth.expected import truth_of

SIZE = 16
REGIONS = [whole(SIZE, SIZE), *(Tile(r, c, 8, 8) for r in (0, 8) for c in (0, 8))]
WIDE = Limits(image=1e-6, tile=1e-6)
"""Nothing passes."""


def expected(variance=0.0, regions=REGIONS):
    full = [np.broadcast_to(x, (len(regions), 3)).astype(float) for x in (1.0, variance, 0.0, 0.0)]
    return Expected(full[0], full[1], 64, full[2], full[3])


def sets(count, bias=0.0, deviation=0.02, seed=0):
    """Residuals (B, 5, 3) of independent tiles and of the image that they make."""
    rng = np.random.default_rng(seed)
    tiles = bias + deviation * rng.standard_normal((count, BATCHES, 4, 3))
    return np.concatenate([tiles.mean(axis=2, keepdims=True), tiles], axis=2)


def looked(residuals, of=None, limits=WIDE, after=None):
    """The judgements after looks 2, 3, … or those named, and the evidence in all."""
    of = of or expected()
    own = [verdict.own_moments(one, of) for one in residuals]
    seen, found = Evidence.none(SIZE, SIZE), []
    for number, one in enumerate(own, 1):
        seen = seen.after(verdict.gain(one, of), REGIONS)
        if number % 2 == 0 and number > 2 and (after is None or number // 2 in after):
            found.append(verdict.judge_looks(own[:number], np.ones(number), seen, REGIONS, of, limits))
    return found, seen


class TestEvidence:
    def test_e_has_a_mean_of_one_and_falls(self):
        """So that it is an e-value of every p-value that is at least uniform."""
        parts = [integrate.quad(lambda p: np.exp(ev.log_e(p)), *ends)[0] for ends in ((0, 1e-4), (1e-4, 1))]
        assert sum(parts) == pytest.approx(1, abs=1e-6)
        p = np.logspace(-8, 0, 200)
        assert np.all(np.diff(ev.log_e(p)) <= 0)
        assert ev.log_e(1e-12) == ev.log_e(1e-4) > ev.log_e(2e-4)

    def test_chance_that_it_ever_reaches_twenty(self):
        """Ville: at most a twentieth, over forty looks of which each could be the last."""
        p = np.random.default_rng(3).random((2000, 80, 3, 5))
        products = np.cumsum(ev.log_e(np.stack([p, 1 - p], axis=-2)), axis=1)
        value = (
            np.exp(products[..., 0]).mean(axis=(2, 3)) / 2
            + np.exp(products[..., 1:]).mean(axis=(2, 3, 4)) / 2
        )
        assert 0.002 < np.mean(value.max(axis=1) >= 20) < 0.05
        won = ev.log_e(np.stack([p, 1 - p], axis=-2)[0, :3]).transpose(0, 2, 3, 1)
        seen = Evidence.none(SIZE, SIZE)
        for one in won.transpose(0, 1, 2, 3):
            seen = seen.after(one, REGIONS)
        assert seen.log_value == pytest.approx(np.log(value[0, 2]))

    def test_a_divided_tile_leaves_its_evidence_to_its_parts(self):
        won = np.zeros((2, 2, 3))
        won[0, 1, 1] = 3.0
        coarse = Evidence.none(SIZE, SIZE).after(won, [whole(SIZE, SIZE), Tile(0, 0, 16, 16)])
        shares = coarse.shares(REGIONS)
        assert coarse.log_value == pytest.approx(np.log(0.5 + 0.5 * (5 + np.exp(3)) / 6))
        assert np.exp(shares[1:, 1]).sum() == pytest.approx(0.5 * np.exp(3) / 6)
        fine = coarse.after(np.zeros((2, 5, 3)), REGIONS)
        assert fine.log_value == pytest.approx(coarse.log_value)

    def test_the_shares_are_the_whole(self):
        _, seen = looked(sets(6, bias=0.004))
        assert np.exp(seen.shares(REGIONS)).sum() <= np.exp(seen.log_value)
        region, channel = 3, 1
        single = Evidence.none(SIZE, SIZE)
        won = np.full((2, 5, 3), -50.0)
        won[0, region, channel] = seen.thresholds(REGIONS, 1e-3)[region]
        assert single.after(won, REGIONS).log_value == pytest.approx(-np.log(1e-3))

    def test_skewed_batches_win_nothing(self):
        found = verdict.own_moments(sets(1, bias=0.1)[0], expected())
        skewed = np.zeros((5, 3), dtype=bool)
        skewed[2] = True
        won = ev.gain(found, verdict.null_bias(expected()), skewed)
        assert np.all(won[0, 2] == 0) and np.all(won[1, 2] < 0) and np.all(won[0, 0] > 3)


class TestPooled:
    def test_of_equal_sets_is_of_all_their_batches(self):
        one = np.random.default_rng(1).gamma(2.0, 1.0, (BATCHES, 5, 3))
        together = st.pooled([st.moments(one, np.zeros((5, 3)))] * 4, np.ones(4), np.full((5, 3), 1e-3), 64)
        plain = st.moments(np.concatenate([one] * 4), np.full((5, 3), 1e-3), 64)
        for name in ("bias", "standard_error", "skewness", "own_skewness", "freedom", "shared"):
            assert getattr(together, name) == pytest.approx(getattr(plain, name), rel=0.05), name
        assert together.count == plain.count

    def test_larger_sets_weigh_more(self):
        rng = np.random.default_rng(2)
        own = [st.moments(rng.normal(0, s, (BATCHES, 5, 3)), np.zeros((5, 3))) for s in (1.0, 0.5)]
        together = st.pooled(own, np.array([1.0, 4.0]), np.zeros((5, 3)), 64)
        assert together.bias == pytest.approx(0.2 * own[0].bias + 0.8 * own[1].bias)
        assert together.standard_error == pytest.approx(1 / np.sqrt(5 * BATCHES), rel=0.3)

    def test_means_of_regions_from_sums_of_squares(self):
        images = np.random.default_rng(0).random((3, 20, 30, 3))
        regions = [
            whole(20, 30),
            *quad_tree(20, 30, {8: np.full((3, 4, 3), 9.0) * [[[1], [0], [0], [0]]]}, 1),
        ]
        assert len({(r.height, r.width) for r in regions}) > 3
        sums, _ = tile_sums(images, 8)
        assert means_of_sums(sums, regions) == pytest.approx(region_means(images, regions))


class TestVerdicts:
    def test_a_bias_that_no_look_shows_is_found_by_many(self):
        """1.8 standard errors of a set's image mean."""
        bias = 5e-4 + 1.8 * 0.02 / 2 / np.sqrt(BATCHES)
        residuals = sets(24, bias, seed=5)
        apart = [verdict.judge(*residuals[i : i + 2], expected(), WIDE) for i in range(0, 24, 2)]
        assert all(one.outcome is not Outcome.FAIL for one in apart)
        found, seen = looked(residuals)
        assert found[0].outcome is not Outcome.FAIL and found[-1].outcome is Outcome.FAIL
        assert (
            found[-1].p_omnibus == pytest.approx(np.exp(-seen.log_value)) and found[-1].p_omnibus <= ALPHA / 2
        )
        first = next(one for one in found if one.outcome is Outcome.FAIL)
        assert first.bias == pytest.approx(bias, rel=0.5) and first.bias_low < bias < first.bias_high

    def test_what_conventions_cause_never_fails(self):
        found, _ = looked(sets(60, bias=4.5e-4, deviation=1e-4), after=(2, 30))
        assert {one.outcome for one in found} == {Outcome.INCONCLUSIVE}
        assert looked(sets(60, bias=6e-4, deviation=1e-4), after=[30])[0][-1].outcome is Outcome.FAIL

    def test_a_half_of_alpha_is_left(self):
        _, seen = looked(sets(8))
        for times, fails in ((0.99, False), (1.01, True)):
            given = replace(seen, image=np.full((2, 3), np.log(4 * times / ALPHA)), cells=seen.cells - 100)
            own = [verdict.own_moments(one, expected()) for one in sets(8)]
            found = verdict.judge_looks(own, np.ones(8), given, REGIONS, expected(), WIDE)
            assert (found.outcome is Outcome.FAIL) == fails

    def test_the_references_error_is_no_evidence(self, monkeypatch):
        """It is the same in all looks: four of its standard errors are not found in a hundred."""
        of = expected(variance=1e-3**2)
        last = [50]

        def end(bias):
            return looked(sets(100, bias=bias, deviation=0.01), of, after=last)[0][0]

        found = end(4e-3)
        assert found.outcome is Outcome.INCONCLUSIVE
        assert found.within_reference[0] == pytest.approx(4e-3, rel=0.15)
        words = sentences.may_be_the_reference(found)
        told = r"; a bias of 0.[34][0-9] % is no noise, but within (5.6|6.1) standard errors of the reference"
        assert re.fullmatch(told, words)
        assert sentences.may_be_the_reference(end(0.0)) == ""
        for within, begins in (
            (None, "no bias: "),
            ((4e-3, 5.6), "no bias beyond the reference's own error: "),
        ):
            passed = replace(found, outcome=Outcome.PASS, within_reference=within)
            assert sentences.reason(passed, REGIONS, None).startswith(begins)
        assert end(7e-3).outcome is Outcome.FAIL
        monkeypatch.setattr(ev, "REFERENCE_CHANCE", 0.3)
        assert end(4e-3).outcome is Outcome.FAIL

    def test_tiles_share_the_chance_that_the_reference_is_off(self, monkeypatch):
        """However many looks find it: what its means are off in their own standard errors is Student's t."""
        monkeypatch.setattr(ev, "REFERENCE_CHANCE", 0.02)
        batches, tiles = 32, 256
        errors = ev.reference_errors(tiles, batches)
        assert np.all(errors[1:] > errors[0] + 1)
        off = np.abs(np.random.default_rng(4).standard_t(batches - 1, (4000, 1 + tiles, 3)))
        beyond = (off > errors[:, None]).any(axis=2)
        assert 0.012 < beyond[:, 0].mean() < 0.028
        assert 0.012 < beyond[:, 1:].any(axis=1).mean() < 0.028
        each = (off > errors[0])[:, 1:].any(axis=(1, 2))
        assert each.mean() > 0.9, "were each tile allowed what the image is"

    def test_a_reference_that_is_off_in_one_of_many_tiles_never_fails(self, monkeypatch):
        """A hundred looks show 5.9 standard errors of it, as one in some thousands has in a tile."""
        of, off = expected(variance=1e-3**2), np.zeros((5, 3))
        off[2] = 5.9e-3
        monkeypatch.setattr(verdict, "_reference_errors", lambda _: np.full((5, 1), 5.0))
        residuals = sets(200, deviation=1e-3, seed=1) + off
        assert looked(residuals, of, after=[100])[0][0].outcome is Outcome.FAIL
        monkeypatch.undo()
        assert looked(residuals, of, after=[100])[0][0].outcome is Outcome.INCONCLUSIVE

    def test_a_reference_that_is_too_noisy_is_said(self):
        of = expected(variance=0.01**2)
        found = looked(sets(40, deviation=0.01), of, Limits(0.01, 0.02), [20])[0][-1]
        assert found.outcome is Outcome.INCONCLUSIVE and np.isinf(found.more_samples)
        told = sentences.reason(found, REGIONS, lambda more: 10.0 * more)
        assert "no more samples would decide, but a reference with less noise" in told

    def test_samples_that_would_decide_do(self):
        limits = Limits(image=0.003, tile=0.01)
        found = looked(sets(4, deviation=0.03), limits=limits)[0][-1]
        assert found.outcome is Outcome.INCONCLUSIVE and 1.5 < found.more_samples < 30
        more = 2 * int(2 * found.more_samples)
        assert (
            looked(sets(more, deviation=0.03), limits=limits, after=[more // 2])[0][-1].outcome
            is Outcome.PASS
        )

    @pytest.mark.parametrize("looks", [2, 5])
    def test_a_pass_spends_a_share_of_its_chance(self, looks):
        """1/2 + 1/6 + 1/12 + … = 1."""
        assert sum(verdict.spent(k) for k in range(1, 1000)) == pytest.approx(1, abs=2e-3)
        residuals = sets(2 * looks)
        found = looked(residuals, after=[looks])[0][-1]
        own = [verdict.own_moments(one, expected()) for one in residuals]
        both = st.pooled(own, np.ones(2 * looks), np.zeros((5, 3)), 64)
        low, high = st.interval(both, 0.01 / (looks * (looks + 1)) / 2 / 15)
        assert found.bias_low == pytest.approx(low[0, found.channel])
        assert found.bias_high == pytest.approx(high[0, found.channel])

    def test_no_wrong_fail_in_many_looks(self):
        for seed in range(20):
            found, _ = looked(sets(20, seed=seed, bias=5e-4 * (-1) ** seed))
            assert all(one.outcome is not Outcome.FAIL for one in found)


class TestPower:
    def test_in_standard_errors_of_a_set(self):
        """One test at the level of a case, normal noise: all looks together, and each by itself."""
        normal = 1e6

        def together(looks):
            return ev.detection_factor((1.0,) * (2 * looks), normal, float(np.log(4 / ALPHA)), ALPHA / 2)

        assert [together(n) for n in (1, 2, 5)] == pytest.approx([4.59, 3.39, 2.10], abs=0.06)
        apart = [ev.detection_factor_apart(n, normal, ALPHA) for n in (1, 2, 5)]
        assert apart == pytest.approx([4.48, 3.89, 3.36], abs=0.06)

    @pytest.mark.parametrize("sizes", [(1.0,) * 10, (1.0, 1.0, 1.0, 1.0, 4.0, 4.0)])
    def test_the_detectable_bias_is_detected(self, sizes):
        """Nine times in ten, by its own test: here in one channel of the image."""
        sizes, of = np.array(sizes), expected()
        noticed = 0
        for seed in range(200):
            residuals = sets(len(sizes), seed=seed) / np.sqrt(sizes)[:, None, None, None]
            own = [verdict.own_moments(one, of) for one in residuals]
            bias = verdict.detectable_by_looks(own, sizes, Evidence.none(SIZE, SIZE), REGIONS, of)
            moved = [verdict.own_moments(one + bias, of) for one in residuals]
            won = np.cumsum([verdict.gain(one, of)[0, 0, 1] for one in moved], axis=0)[3::2]
            first = st.two_set_p(moved[0], moved[1], of.allowance)[0, 1] <= 0.4 * ALPHA / 2 / 3
            noticed += first or bool((won >= np.log(2 / ALPHA * 12)).any())
        assert 0.83 <= noticed / 200 <= 0.97


SCENE = "point-light"


@pytest.fixture(scope="module")
def truth():
    return truth_of(references.load_reference(SCENE)).mean


def noisy(mean, noise=4.0, seeds=None):
    def render(scene, spp, seed):
        if seeds is not None:
            seeds.append((seed, spp))
        k = spp / noise**2
        return mean * np.random.default_rng(seed).gamma(k, 1 / k, (*mean.shape[:2], 1))

    return render


def until(render, seconds=60.0, **more):
    """By a clock that is a millisecond further each time that it is looked at."""
    ticks = itertools.count()
    clock = lambda: 1e-3 * next(ticks)  # noqa: E731
    [case] = raycheck.verify(render, SCENE, until=seconds, clock=clock, **more).cases
    return case


def simulated(start=0.0, sample=10 / 64 / 16, noise=1e3):
    """Too noisy to be decided; a look of 16 samples takes ten seconds, all before the first one and a bit."""
    return Simulated(start, sample, noise=noise)


def looked_at(renderer, seconds, **more):
    found = raycheck.verify(renderer, "area-light", until=seconds, clock=renderer.clock, jobs=1, **more)
    return found.cases[0]


class TestRun:
    def test_more_looks_pass_what_one_leaves_open(self, truth):
        case = until(noisy(truth))
        assert case.verdict is Outcome.PASS and case.looks > 1
        assert case.images == case.looks * 2 * BATCHES
        assert f"(after {case.looks} looks)" in case.reason

    def test_more_looks_find_a_bias_that_one_does_not(self, truth):
        assert until(noisy(1.004 * truth), seconds=1e-9).verdict is Outcome.INCONCLUSIVE
        case = until(noisy(1.004 * truth), limits=Limits(0.001, 0.005))
        assert case.verdict is Outcome.FAIL and case.looks > 1
        assert case.bias == pytest.approx(0.004, abs=0.002)
        assert "0.4" in case.reason and "too bright" in case.reason

    def test_the_time_ends_it(self):
        """A look that would end later is not begun: look 5 has three halves of look 4's samples."""
        spent = {
            seconds: looked_at(simulated(), seconds).looks for seconds in (5, 21, 22, 40, 46, 47, 68, 69)
        }
        assert spent == {5: 1, 21: 1, 22: 2, 40: 3, 46: 3, 47: 4, 68: 4, 69: 5}

    def test_a_start_is_no_longer_for_more_samples(self):
        """Five looks of ten seconds and a bit, though the fifth has three halves of the fourth's samples."""
        case = looked_at(simulated(start=10 / 64, sample=1e-5), 53)
        assert case.looks == 5
        assert case.more_samples > 10
        assert case.more_seconds < 0.1 * case.more_samples * 50

    def test_the_same_program_shows_the_same(self, truth):
        """A rerun repeats the seeds, a longer one goes on from there; nothing is rendered twice."""
        made = []
        for seconds in (1e-9, 1e-9, 60.0):
            made.append([])
            until(noisy(truth, seeds=made[-1]), seconds)
        once, again, longer = made
        assert once == again == longer[: len(once)] and len(longer) > len(once)
        seeds = [seed for seed, _ in longer]
        assert len(set(seeds)) == len(seeds)
        assert len(once) == 1 + PILOT_IMAGES + 2 * BATCHES

    def test_looks_take_half_as_many_again_as_all_before(self):
        one = simulated(sample=10 / 64 / 4)
        looked_at(one, 106, spp=4)
        assert one.pictures[1 + PILOT_IMAGES :: 2 * BATCHES] == [4, 4, 4, 6, 9, 13]

    def test_a_decided_case_need_not_be_judged_again(self, truth):
        made = []
        decided = until(noisy(truth))
        again = until(noisy(truth, seeds=made), earlier=[decided])
        assert len(made) == 1 and replace(again, seconds=decided.seconds) == decided
        made.clear()
        until(noisy(truth, seeds=made), earlier=[replace(decided, verdict=Outcome.INCONCLUSIVE)])
        assert len(made) > 1
        quick = raycheck.verify(noisy(truth), SCENE, earlier=[decided]).cases[0]
        assert quick.fingerprint != decided.fingerprint, "a plain run judges anew"

    def test_a_renderer_without_samples_or_that_breaks(self, truth):
        def broken(scene, spp, seed):
            raise ValueError("no lamp")

        case = until(broken)
        assert case.verdict is Outcome.FAIL and "no lamp" in case.reason

    def test_cases_in_order(self, truth):
        found = raycheck.verify(noisy(truth, noise=1.0), [SCENE, f"{SCENE}@depth=-1"], until=20.0)
        assert [case.scene for case in found.cases] == [SCENE, f"{SCENE}@depth=-1"]
        assert found.header["until"] == 20.0


class TestLevel:
    def test_is_shared_by_the_cases(self):
        assert verify_module.level_of_case(None, 40) == ALPHA
        assert verify_module.level_of_case(1e-3, 40) == pytest.approx(2.5e-5)
        with pytest.raises(NotFound, match=r"--level 1e-06 for 40 cases is 2.5e-08 each.*fewer scenes"):
            verify_module.level_of_case(1e-6, 40)

    def test_decides_what_fails(self, truth):
        """A bias of half of what is noticed at 1e-5."""
        right = raycheck.verify(noisy(truth, 10.0), SCENE, spp=16).cases[0]
        render = noisy((1 + right.mde_image / 2) * truth, 10.0)
        strict, mild = (raycheck.verify(render, SCENE, spp=16, level=x) for x in (1e-6, 0.05))
        assert strict.cases[0].verdict is not Outcome.FAIL and mild.cases[0].verdict is Outcome.FAIL
        assert mild.header["alpha"] == 0.05
        assert strict.cases[0].fingerprint != mild.cases[0].fingerprint


def command(*words):
    done = subprocess.run(
        [sys.executable, "-m", "raycheck", "verify", *words], capture_output=True, text=True, check=False
    )
    return done.returncode, done.stdout, done.stderr


RENDERER = f"{sys.executable} tests/pfm_renderer.py {{output}} {{spp}} {{seed}}"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--until", "5", "--thorough"], "--until says how long the run may take"),
        (["--until", "5", "--seconds", "5"], "--until says how long the run may take"),
        (["--until", "0"], "'--until'"),
        (["--until", "soon"], "'--until'"),
        (["--level", "2"], "'--level'"),
        (["--level", "1e-6"], "name fewer scenes"),
        (["--images", "x*.pfm", "--until", "5"], "goes with neither --until, --detect nor --level"),
        (["--images", "x*.pfm", "--level", "0.01"], "goes with neither --until, --detect nor --level"),
    ],
)
def test_wrong_words_are_one_line(words, told):
    scene = [] if words == ["--level", "1e-6"] else [SCENE]
    status, out, said = (
        command(*scene, "--renderer", "render {scene} {output}", *words)
        if "--images" not in words
        else command(*scene, *words)
    )
    assert status == 2 and not out
    assert len(said.splitlines()) == 1 and told in said


def test_the_chance_of_a_wrong_fail_is_printed(tmp_path):
    file = tmp_path / "verdicts.json"
    words = ("--renderer", RENDERER, "--spp", "1", "--until", "20", "--json", str(file))
    status, out, said = command(SCENE, *words)
    assert (status, said) == (0, "")
    assert "Chance of a wrong FAIL in such a run: at most 1e-05 (1 case × 1e-05)." in out
    assert json.loads(file.read_text())["until"] == 20
    _, out, _ = command(SCENE, "--renderer", RENDERER, "--spp", "1", "--level", "0.01")
    assert re.search(r"at most 0\.01 \(1 case × 0\.01\)", out)
