"""The tests and intervals keep the error rates that they state. Seeds are fixed, so nothing here is flaky."""

import numpy as np
import pytest
from numpy.random import default_rng

from raycheck.stats import statistics as st
from raycheck.stats.tiles import Tile, quad_tree, region_means, region_variances, whole
from raycheck.stats.verdict import ALPHA, Expected, Outcome, judge

B = 32


def batches(rng, skewness, *shape):
    """Batches of mean 0 and deviation 1 with this skewness: (B, *shape), gamma distributed."""
    if skewness == 0:
        return rng.standard_normal((B, *shape))
    k = 4 / skewness**2
    return np.sign(skewness) * (rng.gamma(k, 1, (B, *shape)) - k) / np.sqrt(k)


def expected(mean, variance=0.0, quantum=0.0, batch_variance=0.0):
    mean = np.asarray(mean, dtype=np.float64)
    full = [np.full_like(mean, value) for value in (variance, batch_variance, quantum)]
    return Expected(mean, full[0], 64, full[1], full[2])


class TestHall:
    def test_rises_everywhere(self):
        """Johnson's form returns to 0 far out and lets gross darkening pass; Hall's must not."""
        s = np.linspace(-50, 50, 20_001)
        for skewness in (-3.0, -0.4, 0.0, 0.4, 3.0):
            assert np.all(np.diff(st.hall_t(s, np.full_like(s, skewness), B)) >= 0)

    def test_inverse(self):
        s = np.linspace(-4, 4, 81)
        for skewness in (-1.5, -0.3, 1e-9, 0.3, 1.5):
            t = st.hall_t(s, np.full_like(s, skewness), B)
            np.testing.assert_allclose(st.hall_inverse(t, skewness, B), s, atol=1e-6)

    @pytest.mark.parametrize("skewness", [0.0, 0.2, 0.4, -0.4])
    def test_false_alarms(self, skewness):
        """At the skewness that tiles may have, two-sided levels of 1e-2 and 1e-3 and the 1.4e-4 that a set of
        tiles uses are exceeded at most 1.35 times too often (400,000 nulls: ±6 % at 1e-3 and ±13 % at
        1.4e-4, 1 σ).
        """
        rng = default_rng(1)
        p = []
        for _ in range(4):
            found = st.moments(batches(rng, skewness, 50_000), np.zeros(50_000))
            bright, dark = st.one_sided_p(found, np.zeros(50_000))
            p.append(2 * np.minimum(bright, dark))
        p = np.concatenate(p)
        for level in (1e-2, 1e-3, 1.4e-4):
            assert np.mean(p <= level) / level < 1.35
        assert np.mean(p <= 1e-2) / 1e-2 > 0.8  # and not by never alarming

    def test_intervals_cover(self):
        """A 99 % interval misses the truth in 1 % of cases, at skewness 0.4 too."""
        rng = default_rng(2)
        found = st.moments(0.3 + batches(rng, 0.4, 100_000), np.zeros(100_000))
        low, high = st.interval(found, 0.005)
        assert np.mean((low > 0.3) | (high < 0.3)) == pytest.approx(0.01, rel=0.15)


class TestTwoSets:
    def test_reference_noise_is_shared(self):
        """With the reference's error as large as the batches' own, two sets agree far too often by chance
        unless the exponent allows for it.
        """
        rng = default_rng(3)
        n = 100_000
        reference = rng.standard_normal(n) / np.sqrt(B)
        one = st.moments(batches(rng, 0, n) - reference, np.full(n, 1 / B))
        two = st.moments(batches(rng, 0, n) - reference, np.full(n, 1 / B))
        p = st.two_set_p(one, two, np.zeros(n))
        assert one.shared.mean() == pytest.approx(0.5, abs=0.02)
        for level in (1e-2, 1e-3):
            assert np.mean(p <= level) / level < 1.3

    def test_both_must_agree(self):
        p = st.combine(np.array([1e-8, 1e-4]), np.array([0.5, 1e-4]), np.zeros(2))
        np.testing.assert_allclose(p, [0.25, 1e-8])

    def test_power_at_the_detectable_bias(self):
        """A bias as large as the printed minimal detectable one is found 9 times in 10."""
        rng = default_rng(4)
        n = 20_000
        level = 0.4 * ALPHA / 3
        allowance = np.full(n, 5e-4)
        one, two = (st.moments(batches(rng, 0.2, n), np.zeros(n)) for _ in range(2))
        bias = st.detectable_bias(one, two, level, allowance).mean()
        one, two = (st.moments(bias + batches(rng, 0.2, n), np.zeros(n)) for _ in range(2))
        power = np.mean(st.two_set_p(one, two, allowance) <= level)
        assert 0.85 < power < 0.95

    def test_below_the_allowance_never_fails(self):
        rng = default_rng(5)
        allowance = np.full(20_000, 0.5)
        one, two = (st.moments(0.5 + batches(rng, 0, 20_000), np.zeros(20_000)) for _ in range(2))
        assert np.mean(st.two_set_p(one, two, allowance) <= 1e-3) < 2e-3


@pytest.mark.parametrize("skewness", [0.0, 0.4])
@pytest.mark.parametrize("correlation", [0.0, 0.1, 0.6])
def test_omnibus_false_alarms(skewness, correlation):
    """The scaled F keeps its level for independent tiles; correlated ones, which no renderer with pixels of
    their own samples has, cost up to a factor 1.5 at 1e-2 or make it give up (3000 nulls).
    """
    rng = default_rng(6)
    p = np.empty(3000)
    for i in range(len(p)):
        own, common = batches(rng, skewness, 60), batches(rng, skewness, 1)
        residuals = np.sqrt(1 - correlation) * own + np.sqrt(correlation) * common
        p[i] = st.omnibus(residuals, np.zeros(60), np.ones(60), np.zeros(60))[0]
    assert np.mean(p <= 1e-2) / 1e-2 < (1.3 if correlation == 0 else 1.8)
    assert np.mean(p <= 1e-3) / 1e-3 < (2.0 if correlation == 0 else 5.0)
    assert correlation > 0 or np.mean(p <= 1e-2) / 1e-2 > 0.7


class TestJudge:
    """Controls: what has to be found is found, what is right passes, and noise is called noise."""

    def sets(self, seed, bias=0.0, deviation=0.01, skewness=0.3, tiles=64):
        """Residuals of two sets of a grey image of radiance 1, tiles independent; `bias` is per region."""
        rng = default_rng(seed)
        result = []
        for _ in range(2):
            tile = batches(rng, skewness, tiles, 1) * deviation
            tile = tile + np.broadcast_to(bias, (tiles, 3))
            result.append(np.concatenate([tile.mean(axis=1, keepdims=True), tile], axis=1))
        return result

    def test_right_passes(self):
        found = judge(*self.sets(1), expected(np.ones((65, 3))))
        assert found.outcome is Outcome.PASS
        assert abs(found.bias) < 1e-3
        assert found.bias_low < found.bias < found.bias_high
        assert found.mde_image < found.mde_tile_p90 < 0.02

    def test_false_alarms(self):
        """500 correct renders: no FAIL, and hardly ever so much as a doubt."""
        outcomes = [judge(*self.sets(seed), expected(np.ones((65, 3)))).outcome for seed in range(500)]
        assert outcomes.count(Outcome.FAIL) == 0
        assert outcomes.count(Outcome.INCONCLUSIVE) <= 5

    def test_bright_image_fails(self):
        found = judge(*self.sets(1, bias=0.03), expected(np.ones((65, 3))))
        assert found.outcome is Outcome.FAIL
        assert found.bias == pytest.approx(0.03, abs=0.002)
        assert found.findings[0].region == 0

    def test_one_tile_fails(self):
        bias = np.zeros((64, 3))
        bias[20, 1] = -0.05
        found = judge(*self.sets(1, bias), expected(np.ones((65, 3))))
        assert found.outcome is Outcome.FAIL
        assert (found.findings[0].region, found.findings[0].channel) == (21, 1)
        assert found.tile_differences == 1

    def test_small_differences_everywhere_fail_together(self):
        """Alternating +0.4 % and −0.4 % leaves the mean alone and no tile is sure, but all of them together
        are.
        """
        bias = 0.005 * np.where(np.arange(64) % 2, 1.0, -1.0)[:, None]
        found = judge(*self.sets(3, bias, deviation=0.0125), expected(np.ones((65, 3))))
        assert found.p_omnibus < 1e-6
        assert found.outcome is Outcome.FAIL

    def test_noise_is_inconclusive(self):
        found = judge(*self.sets(1, deviation=0.2), expected(np.ones((65, 3))))
        assert found.outcome is Outcome.INCONCLUSIVE
        assert 4 < found.more_samples < 40
        again = judge(*self.sets(2, deviation=0.2 / np.sqrt(found.more_samples)), expected(np.ones((65, 3))))
        assert again.outcome is Outcome.PASS

    def test_a_bias_below_convention_passes(self):
        found = judge(*self.sets(1, bias=4e-4, deviation=1e-4), expected(np.ones((65, 3))))
        assert found.outcome is Outcome.PASS

    def test_heavy_tails_never_fail(self):
        """Rare samples that carry most of the light: the estimate is right, a normal interval is not."""
        for seed in range(100):
            rng = default_rng(seed)
            sets = []
            for _ in range(2):
                tile = 50.0 * (rng.random((B, 64, 1)) < 0.02) - np.ones(3)
                sets.append(np.concatenate([tile.mean(axis=1, keepdims=True), tile], axis=1))
            found = judge(*sets, expected(np.ones((65, 3)), batch_variance=49.0))
            assert found.outcome is Outcome.INCONCLUSIVE

    def test_zero_variance_is_compared_exactly(self):
        same = np.zeros((B, 5, 3))
        assert judge(same, same, expected(np.ones((5, 3)))).outcome is Outcome.PASS
        off = same.copy()
        off[:, 2, 0] = 2e-5
        assert judge(off, off, expected(np.ones((5, 3)))).outcome is Outcome.FAIL
        assert judge(off / 4, off / 4, expected(np.ones((5, 3)))).outcome is Outcome.PASS

    def test_always_black_where_light_varies_fails(self):
        """No variance seen is no proof of none, but a thousand samples' worth of it missing is."""
        missing = np.full((B, 5, 3), -1.0)
        few, many = (expected(np.ones((5, 3)), batch_variance=v) for v in (10.0, 0.01))
        assert judge(missing, missing, few).outcome is Outcome.INCONCLUSIVE
        assert judge(missing, missing, many).outcome is Outcome.FAIL

    def test_quantised_input_widens_the_limits(self):
        residuals = self.sets(1, bias=-0.003, deviation=0.001)
        assert judge(*residuals, expected(np.ones((65, 3)))).outcome is Outcome.FAIL
        assert judge(*residuals, expected(np.ones((65, 3)), quantum=1 / 256)).outcome is Outcome.PASS

    def test_power_of_the_whole_verdict(self):
        """Injected at the printed minimal detectable bias of the image mean, FAIL in about 9 of 10."""
        mde = np.mean([judge(*self.sets(s), expected(np.ones((65, 3)))).mde_image for s in range(20)])
        grey = [judge(*self.sets(s, bias=mde), expected(np.ones((65, 3)))) for s in range(400)]
        assert 0.85 < np.mean([g.p_image <= 0.4 * ALPHA for g in grey]) < 0.95


class TestTiles:
    def test_merges_where_samples_are_skewed(self):
        tame = {8: np.zeros((4, 4, 3)), 16: np.zeros((2, 2, 3)), 32: np.zeros((1, 1, 3))}
        assert len(quad_tree(32, 32, tame, 1)) == 16
        tame[8][0, 1, 2] = 1.0
        assert Tile(0, 0, 16, 16) in quad_tree(32, 32, tame, 1)
        assert len(quad_tree(32, 32, tame, 1)) == 13
        assert len(quad_tree(32, 32, tame, 9)) == 16  # nine samples make it tame
        tame[16][0, 0, 0] = 1.0
        assert quad_tree(32, 32, tame, 1) == [Tile(0, 0, 32, 32)]

    def test_covers_any_size_once(self):
        hits = np.zeros((20, 37), dtype=int)
        for tile in quad_tree(20, 37, {}, 1):
            hits[tile.window] += 1
        assert np.all(hits == 1)

    def test_means_and_variances(self):
        rng = default_rng(7)
        image = rng.random((16, 16, 3))
        tiles = quad_tree(16, 16, {}, 1)
        np.testing.assert_allclose(region_means(image, tiles)[3], image[8:, 8:].mean(axis=(0, 1)))
        np.testing.assert_allclose(region_variances(image, tiles)[0], image[:8, :8].sum(axis=(0, 1)) / 64**2)


@pytest.mark.parametrize("regions", [
    [whole(21, 30), *quad_tree(21, 30, {}, 1.0)], [Tile(3, 4, 5, 6)], [Tile(0, 0, 8, 8), Tile(4, 20, 9, 10)],
])  # fmt: skip
def test_region_means_are_those_of_the_regions_pixels(regions):
    """Whole, tiles cut off at the rim, apart and across each other's edges; of one image and of many."""
    images = default_rng(5).random((2, 21, 30, 3)).astype(np.float32)
    wanted = [images[:, t.row : t.row + t.height, t.column : t.column + t.width] for t in regions]
    means = np.stack([pixels.mean(axis=(1, 2), dtype=float) for pixels in wanted], axis=1)
    np.testing.assert_allclose(region_means(images, regions), means, rtol=1e-12)
    np.testing.assert_allclose(region_means(images[1], regions), means[1], rtol=1e-12)
