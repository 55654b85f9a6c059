"""The statistics by hand: batches of two values have moments that are known, so every level, interval and
detectable bias of a verdict is known too.
"""

import numpy as np
import pytest
from numpy.random import default_rng
from scipy import stats

from raycheck.stats import statistics as st
from raycheck.stats import verdict
from raycheck.stats.tiles import Tile, grid, place, quad_tree
from raycheck.stats.verdict import Expected, Limits, Outcome, judge

B = 32
FREEDOM, FREEDOM_OF_BOTH = 0.8 * (B - 1), 0.8 * (2 * B - 1)
SIGNS = np.where(np.arange(B) % 2, 1.0, -1.0)
UNIT = SIGNS * np.sqrt((B - 1) / B)
"""(B,) of mean 0, deviation 1 and no skewness."""
SPIKE = np.where(np.arange(B) == 0, 1.0, 0.0)
ALPHA = 1e-5


def moments(bias, spread=1.0, count=B, skewness=0.0, freedom=FREEDOM, shared=0.0):
    """Of one region."""
    numbers = (np.array([float(x)]) for x in (bias, spread, skewness, skewness, freedom, shared))
    return st.Moments(count, *numbers)


# ---- moments, tests, intervals ----


def test_moments():
    """1, 2, 3, 6: variance 14/3, third moment 9/2; beside it a reference of variance 1/2, from 11 batches."""
    found = st.moments(np.array([[1.0], [2.0], [3.0], [6.0]]), np.array([0.5]), reference_batches=11)
    assert found.bias == 3
    assert found.spread**2 == pytest.approx(20 / 3)
    assert found.standard_error == pytest.approx(np.sqrt(20 / 3 / 4))
    assert found.skewness == pytest.approx(4.5 / (20 / 3) ** 1.5)
    assert found.own_skewness == pytest.approx(4.5 / (14 / 3) ** 1.5)
    assert found.shared == pytest.approx(2 / (20 / 3))
    welch = (20 / 3) ** 2 / ((14 / 3) ** 2 / (0.8 * 3) + 2**2 / 10)
    assert found.freedom == pytest.approx(welch)


def test_batches_that_agree_where_light_should_vary_are_not_exact():
    found = st.moments(np.ones((4, 1)), np.zeros(1), assumed_variance=9.0)
    assert found.spread == 3 and not found.exact
    assert st.moments(np.ones((4, 1)), np.zeros(1)).exact


@pytest.mark.parametrize("skewness", [-0.8, 0.4])
def test_hall_is_a_cube(skewness):
    """t/√B − γ/6B = ((1 + γs/3)³ − 1)/γ."""
    s = np.linspace(-1, 2, 7)
    cube = ((1 + skewness * s / 3) ** 3 - 1) / skewness
    np.testing.assert_allclose(st.hall_t(s, skewness, B) / np.sqrt(B) - skewness / (6 * B), cube)
    np.testing.assert_allclose(st.hall_inverse(st.hall_t(s, skewness, B), skewness, B), s, atol=1e-12)


def test_a_bias_as_large_as_allowed_is_even_odds():
    allowance = np.array([0.25])
    assert st.one_sided_p(moments(0.25), allowance)[0] == pytest.approx(0.5)
    assert st.one_sided_p(moments(-0.25), allowance)[1] == pytest.approx(0.5)


def test_what_does_not_vary_is_compared():
    for bias, allowance, bright, dark in ((0, 0, 1, 1), (0.5, 1, 1, 1), (2, 1, 0, 1), (-2, 1, 1, 0)):
        found = st.one_sided_p(moments(bias, spread=0.0), np.array([float(allowance)]))
        assert (found[0][0], found[1][0]) == (bright, dark)


def test_two_sets_have_to_agree():
    """p = 2 max(p₁, p₂)^(2/(1 + ρ)), ρ the larger share of the reference."""
    strong, weak = (moments(t / np.sqrt(B)) for t in (6.0, 4.0))
    assert st.two_set_p(strong, weak, np.zeros(1)) == pytest.approx(2 * stats.t.sf(4, FREEDOM) ** 2)
    opposite = moments(-6.0 / np.sqrt(B))
    assert st.two_set_p(strong, opposite, np.zeros(1)) == st.two_set_p(opposite, strong, np.zeros(1)) == 1
    noisy = moments(4.0 / np.sqrt(B), shared=0.5)
    assert st.two_set_p(strong, noisy, np.zeros(1)) == pytest.approx(2 * stats.t.sf(4, FREEDOM) ** (2 / 1.5))


def test_holm():
    np.testing.assert_allclose(st.holm(np.array([0.01, 0.04, 0.03, 0.005])), [0.03, 0.06, 0.06, 0.02])
    assert st.holm(np.array([])).size == 0


def test_an_interval_misses_on_each_side():
    low, high = st.interval(moments(1.0, spread=2.0), 0.01)
    half = stats.t.isf(0.01, FREEDOM) * 2 / np.sqrt(B)
    assert (low[0], high[0]) == pytest.approx((1 - half, 1 + half))


def test_the_detectable_bias():
    """Both sets must reach √(level/2), each with the root of nine tenths."""
    one, two = moments(0, spread=1.0, freedom=20), moments(0, spread=3.0, freedom=10)
    found = st.detectable_bias(one, two, 1e-6, np.array([0.1]))
    error = np.sqrt((1 + 9) / 2 / B)
    critical, power = stats.t.isf(np.sqrt(0.5e-6), 10), stats.t.ppf(np.sqrt(0.9), 10)
    assert found == pytest.approx(0.1 + (critical + power) * error)


# ---- the omnibus ----


def white(count, tiles):
    """Batches whose tiles are independent, of mean 0 and deviation 1, all to the last digit."""
    raw = default_rng(1).standard_normal((count, tiles))
    return np.linalg.qr(raw - raw.mean(axis=0))[0] * np.sqrt(count - 1)


@pytest.mark.parametrize("of_reference", [0.0, 1.0])
@pytest.mark.parametrize("allowance", [0.0, 0.5])
def test_the_omnibus_of_many_batches_is_chi_squared(of_reference, allowance):
    """With a reference as noisy as the batches' mean, and without; biases of 1.25 deviations and what is
    allowed.
    """
    count, tiles = 1000, 40
    variance = (1 + of_reference) / count
    size = 1.25 * np.sqrt(variance) + allowance / np.sqrt(count)
    bias = size * np.where(np.arange(tiles) % 2, 1, -1)
    p, share = st.omnibus(
        white(count, tiles) + bias, np.full(tiles, of_reference / count), np.ones(tiles),
        np.full(tiles, allowance / np.sqrt(count)),
    )  # fmt: skip
    assert p == pytest.approx(stats.chi2.sf(1.25**2 * tiles, tiles), rel=0.1)
    assert share == pytest.approx(of_reference / (1 + of_reference))


def test_the_omnibus_of_few_batches_knows_its_noise_from_all_tiles():
    """Of 40 tiles and 8 batches: F with 40 and 280 degrees."""
    bias = 1.5 / np.sqrt(8) * np.where(np.arange(40) % 2, 1, -1)
    residuals = default_rng(2).standard_normal((8, 40))
    residuals = (residuals - residuals.mean(axis=0)) / residuals.std(axis=0, ddof=1) + bias
    p, _ = st.omnibus(residuals, np.zeros(40), np.ones(40), np.zeros(40))
    assert p == pytest.approx(stats.f.sf(1.5**2, 40, 280), rel=0.7)


def test_the_omnibus_is_silent_where_few_causes_rule():
    for tiles, silent in ((19, True), (30, False)):
        p, _ = st.omnibus(white(500, tiles) + 1.0, np.zeros(tiles), np.ones(tiles), np.zeros(tiles))
        assert (p == 1) == silent


def test_traces_are_unbiased():
    """Of the covariance diag(1, …, 10): 385 and 3025; 3000 sets of 16 batches, errors of 1 and 2 %."""
    rng, root = default_rng(3), np.sqrt(np.arange(1, 11))
    sets = rng.standard_normal((3000, 16, 10)) * root
    traces = np.mean([st._traces(one - one.mean(axis=0)) for one in sets], axis=0)
    assert traces == pytest.approx([385, 3025], rel=0.03)


# ---- tiles ----


@pytest.mark.parametrize(
    ("skewness", "spp", "merged"), [(0.39, 1, False), (0.41, 1, True), (-0.41, 1, True), (0.79, 4, False),
                                    (0.81, 4, True), (np.nan, 1, False)],
)  # fmt: skip
def test_a_tile_stands_alone_up_to_a_skewness_of_four_tenths(skewness, spp, merged):
    """Of a batch, whose samples lessen it by their root; one channel is enough."""
    tables = {8: np.zeros((2, 2, 3)), 16: np.zeros((1, 1, 3))}
    tables[8][1, 0, 2] = skewness
    assert len(quad_tree(16, 16, tables, spp)) == (1 if merged else 4)


def test_tiles_end_at_the_rim():
    assert grid(12, 20) == [
        Tile(0, 0, 8, 8), Tile(0, 8, 8, 8), Tile(0, 16, 8, 4),
        Tile(8, 0, 4, 8), Tile(8, 8, 4, 8), Tile(8, 16, 4, 4),
    ]  # fmt: skip
    assert sorted(quad_tree(12, 20, {}, 1), key=lambda t: (t.row, t.column)) == grid(12, 20)


@pytest.mark.parametrize(
    ("tile", "words"),
    [
        (Tile(0, 0, 8, 8), "rows 0–7, columns 0–7 from the top left (upper left)"),
        (Tile(24, 56, 8, 8), "rows 24–31, columns 56–63 from the top left (lower right)"),
        (Tile(8, 16, 16, 32), "rows 8–23, columns 16–47 from the top left (middle)"),
        (Tile(0, 16, 8, 8), "rows 0–7, columns 16–23 from the top left (upper left)"),
    ],
)
def test_a_tile_has_a_place_in_words(tile, words):
    assert place(tile, 32, 64) == words


# ---- the verdict ----

TILES = 5
VALUES = 3 * (1 + TILES)


def expected(mean=1.0, variance=0.0, quantum=0.0, tiles=TILES):
    full = [np.broadcast_to(x, (1 + tiles, 3)).astype(float) for x in (mean, variance, 0.0, quantum)]
    return Expected(full[0], full[1], 64, full[2], full[3])


def sets(bias=0.0, deviation=1e-6, tiles=TILES, pattern=UNIT):
    """Two sets of batches, of this bias and deviation to the last digit; all regions vary together."""
    bias, deviation = (np.broadcast_to(x, (1 + tiles, 3)) for x in (bias, deviation))
    one = bias + deviation * pattern[:, None, None]
    return one, one.copy()


def region(number, inside, elsewhere=0.0, tiles=TILES):
    """(R, 3): a value in all channels of one region."""
    values = np.full((1 + tiles, 3), float(elsewhere))
    values[number] = inside
    return values


def bias_of_p(p, deviation):
    """The bias whose p-value from two sets that agree is p, 0.05 % being allowed."""
    return 5e-4 + stats.t.isf(np.sqrt(p / 2), FREEDOM) * deviation / np.sqrt(B)


@pytest.mark.parametrize(("times", "fails"), [(0.9, True), (1.1, False)])
@pytest.mark.parametrize(("number", "level"), [(0, 0.4 * ALPHA / 3), (3, 0.4 * ALPHA / (3 * TILES))])
def test_the_image_and_the_tiles_fail_at_their_share_of_alpha(number, level, times, fails):
    """Four tenths of 1e-5 each, over the channels, and over the tiles' channels."""
    bias = np.zeros((1 + TILES, 3))
    bias[number, 1] = bias_of_p(times * level, 0.01)
    found = judge(*sets(bias, region(number, 0.01, 1e-6)), expected())
    assert (found.outcome is Outcome.FAIL) == fails
    assert (found.p_tile if number else found.p_image) == pytest.approx(times * 0.4 * ALPHA)
    assert [(f.region, f.channel) for f in found.findings] == [(number, 1)] * fails


@pytest.mark.parametrize(("times", "fails"), [(0.9, True), (1.1, False)])
def test_the_omnibus_fails_at_the_rest_of_alpha(monkeypatch, times, fails):
    monkeypatch.setattr(verdict, "_omnibus", lambda *of: times * 0.2 * ALPHA)
    assert (judge(*sets(), expected()).outcome is Outcome.FAIL) == fails
    assert sum((verdict.SHARE_IMAGE, verdict.SHARE_TILES, verdict.SHARE_OMNIBUS)) == pytest.approx(1)


@pytest.mark.parametrize(("bias", "fails"), [(4.9e-4, False), (5.1e-4, True), (-5.1e-4, True), (5e-3, True)])
def test_half_a_thousandth_never_fails_and_more_does_however_small(bias, fails):
    """Though it lies within the limits of a PASS."""
    assert judge(*sets(bias), expected()).outcome is (Outcome.FAIL if fails else Outcome.PASS)


def error_of_both(deviation):
    return deviation * np.sqrt(2 * (B - 1) / (2 * B - 1)) / np.sqrt(2 * B)


@pytest.mark.parametrize(("times", "outcome"), [(0.99, Outcome.PASS), (1.01, Outcome.INCONCLUSIVE)])
@pytest.mark.parametrize(("number", "limit"), [(0, 0.01), (2, 0.05), (4, 0.05 * 0.1)])
def test_a_pass_needs_all_intervals_at_99_percent_within_the_limits(number, limit, times, outcome):
    """1 % of the image, 5 % of a tile or of a tenth of the image, as of tile 4, which is dark."""
    half_of_one = stats.t.isf(0.005 / VALUES, FREEDOM_OF_BOTH) * error_of_both(1.0)
    deviation = region(number, times * limit / half_of_one, 1e-6)
    found = judge(*sets(0.0, deviation), expected(region(4, 0.02, 1.0)))
    assert found.outcome is outcome
    assert {f.region for f in found.undecided} == ({number} if times > 1 else set())


def test_an_interval_that_a_limit_cuts_is_undecided():
    half_of_one = stats.t.isf(0.005 / VALUES, FREEDOM_OF_BOTH) * error_of_both(1.0)
    found = judge(*sets(region(0, 0.0045), region(0, 0.006 / half_of_one, 1e-6)), expected())
    assert found.outcome is Outcome.INCONCLUSIVE
    assert (found.bias_low, found.bias_high) == pytest.approx((-0.0015, 0.0105), abs=1e-5)


def test_what_is_known_least_comes_first():
    deviation = np.full((1 + TILES, 3), 0.3) * np.arange(1, 2 + TILES)[:, None]
    found = judge(*sets(0.0, deviation), expected())
    assert [f.region for f in found.undecided[::3]] == [5, 4, 3, 2, 1, 0]


def detectable(deviation, tests):
    level = 0.4 * ALPHA / tests
    needed = stats.t.isf(np.sqrt(level / 2), FREEDOM) + stats.t.ppf(np.sqrt(0.9), FREEDOM)
    return 5e-4 + needed * deviation / np.sqrt(B)


def test_detectable_biases_are_of_the_worst_channel_and_of_all_tests():
    """90 % of 21 tiles: the nineteenth."""
    deviation = np.linspace(1e-3, 21e-3, 21)[:, None] * np.array([0.5, 1.0, 0.25])
    deviation = np.concatenate([[[2e-3, 1e-3, 3e-3]], deviation])
    found = judge(*sets(0.0, deviation, 21), expected(tiles=21))
    assert found.mde_image == pytest.approx(detectable(3e-3, 3), rel=1e-6)
    assert found.mde_tile_p90 == pytest.approx(detectable(19e-3, 63), rel=1e-6)
    assert found.mde_tile_max == pytest.approx(detectable(21e-3, 63), rel=1e-6)


def test_the_channel_that_differs_most_surely_is_shown():
    found = judge(*sets(np.array([-0.003, 0.001, 0.002]), 1e-3), expected())
    assert found.channel == 0 and found.bias == pytest.approx(-0.003)


def test_the_image_comes_before_its_tiles():
    bias = region(3, 0.2, 0.01)
    found = judge(*sets(bias, 1e-3), expected())
    assert [f.region for f in found.findings[:4]] == [0, 0, 0, 3]
    assert found.tile_differences == TILES


def test_rounding_of_exact_scenes():
    """1e-5 of the pixel, 1e-7 of the image, and the step of the file's numbers."""
    for mean, bias, quantum, outcome in (
        (1.0, 1.0e-5, 0.0, Outcome.PASS), (1.0, 1.1e-5, 0.0, Outcome.FAIL), (0.0, 0.9e-7, 0.0, Outcome.PASS),
        (0.0, 1.1e-7, 0.0, Outcome.FAIL), (1.0, 9e-4, 1e-3, Outcome.PASS), (1.0, 1.2e-3, 1e-3, Outcome.FAIL),
    ):  # fmt: skip
        found = judge(*sets(region(2, bias), 0.0), expected(region(2, mean, 1.0), quantum=quantum))
        assert found.outcome is outcome


def test_rounding_of_noisy_scenes():
    for bias, outcome in ((1.4e-3, Outcome.PASS), (1.6e-3, Outcome.FAIL)):
        assert judge(*sets(region(2, bias)), expected(quantum=1e-3)).outcome is outcome
    wide = judge(*sets(region(0, 0.0105)), expected(quantum=0.0104))
    assert wide.outcome is Outcome.PASS  # the limit of 1 % is widened too


def test_heavy_is_three_standard_errors_beyond_what_tiles_may_have():
    """A skewness of 32 batches has 0.4145."""
    for own, heavy in ((0.4 + 2.9 * 0.4145, False), (0.4 + 3.1 * 0.4145, True), (-0.4 - 3.1 * 0.4145, True)):
        assert verdict._heavy(moments(0.0, skewness=own)) == heavy


def test_heavy_tails_neither_fail_nor_are_many_of_them_passed():
    """In one set is enough; two regions and a fiftieth may be heavy by chance."""
    normal = sets(region(2, 0.01, 0.0), 1e-5)
    spiked = sets(region(2, 0.01, 0.0), 1e-5, pattern=SPIKE)
    assert judge(*normal, expected()).outcome is Outcome.FAIL
    for which in (0, 1):
        mixed = [one.copy() for one in normal]
        mixed[which][:, 2] = spiked[which][:, 2]
        found = judge(*mixed, expected())
        assert found.outcome is Outcome.PASS and found.heavy_tailed == 1
    found = judge(*sets(0.0, 1e-5, pattern=SPIKE), expected())
    assert found.outcome is Outcome.INCONCLUSIVE and found.heavy_tailed == 1 + TILES
    assert found.more_samples == 4


def test_the_omnibus_weighs_each_set_by_the_noise_of_the_other(monkeypatch):
    """Without tiles of heavy tails; the exponent is of the larger share of the reference."""
    seen, told = [], [(1e-6, 0.25), (1e-5, 0.5)]

    def omnibus(residuals, reference_variance, weights, allowance):
        seen.append(weights)
        return told[len(seen) - 1]

    monkeypatch.setattr(st, "omnibus", omnibus)
    first, second = sets(0.0, 0.1)[0], sets(0.0, 0.2)[0]
    first[:, 4] = 0.1 * SPIKE[:, None]
    found = judge(first, second, expected(), Limits())
    np.testing.assert_allclose(seen[0][[0, 3]], [[1 / 0.2**2] * 3, [0] * 3])
    np.testing.assert_allclose(seen[1][[0, 3]], [[1 / 0.1**2] * 3, [0] * 3])
    assert found.p_omnibus == pytest.approx(1e-5 ** (2 / 1.5))


def test_the_samples_that_would_decide():
    """An interval and 2.5 standard errors within 1 %; or, of a bias of four, what makes it FAIL."""
    deviation = region(0, 0.1, 1e-6)
    error = error_of_both(0.1)
    found = judge(*sets(0.0, deviation), expected())
    half = stats.t.isf(0.005 / VALUES, FREEDOM_OF_BOTH) * error
    assert found.more_samples == pytest.approx(((half + 2.5 * error) / 0.01) ** 2)
    found = judge(*sets(region(0, 5e-4 + 4 * error), deviation), expected())
    needed = detectable(0.1, 3) - 5e-4
    assert found.outcome is Outcome.INCONCLUSIVE
    assert found.more_samples == pytest.approx((needed / (4 * error)) ** 2)
