"""Sobol' points: where they lie, that each is uniform and that blocks are uncorrelated; then that pictures
keep their mean and lose their noise.

Numbers come from the tracer's own sampler.h (sampling.c). Seeds are fixed; all statistical checks of this
file together would raise a false alarm for less than one choice of seeds in 10⁴ (`LEVEL` of sampling.py is
for 160 checks; here are 97).
"""

from __future__ import annotations

import subprocess
from itertools import combinations, product
from pathlib import Path

import numpy as np
import pytest
from building import ROOT
from numpy.typing import ArrayLike
from sampling import LEVEL, Array, Driver, cell, chi_squared
from scipy import stats

from raycheck.base.images import load_image

CAMERA, VERTEX, CHOICE = 0, 1, 2
SOBOL = ("--sampler", "sobol")


def numbers(
    driver: Driver, seed: ArrayLike, pixel: ArrayLike, sample: ArrayLike, vertex: ArrayLike = 0,
    dimension: ArrayLike = CAMERA,
) -> Array:  # fmt: skip
    """The four numbers of a block, (4, n)."""
    index = np.atleast_1d(np.asarray(sample, dtype=np.int64))
    return driver("numbers", seed, pixel, index & 0xFFFFFFFF, index >> 32, vertex, dimension, 1)


def places(count: int, key: int) -> list[tuple[int, int, int, int]]:
    """Random (seed, pixel, vertex, dimension), the first of them all zeros."""
    random = np.random.default_rng(key)
    rows = [random.integers(0, n, count) for n in (2**31, 2**24, 60, 3)]
    return [(0, 0, 0, 0), *(tuple(int(x) for x in row) for row in zip(*rows, strict=True))]


def per_cell(u: Array, levels: tuple[int, ...]) -> Array:
    """How many points lie in each elementary interval, dimension d being cut into 2^levels[d]."""
    shape = tuple(2**level for level in levels)
    return np.bincount(cell(u[: len(levels)], shape), minlength=int(np.prod(shape)))


@pytest.mark.parametrize(("seed", "pixel", "vertex", "dimension"), places(40, 1))
def test_every_interval_has_its_point(
    driver: Driver, seed: int, pixel: int, vertex: int, dimension: int
) -> None:
    """Of any 2^k samples from a multiple of 2^k on, in each dimension one in each of 2^k intervals."""
    for k in (0, 1, 2, 5, 8, 11):
        for first in (0, 2**k, 5 * 2**k, 2**32 - 2**k, 2**32, 2**45 + 2**k):
            u = numbers(driver, seed, pixel, first + np.arange(2**k), vertex, dimension)
            assert u.min() > 0 and u.max() < 1
            for row in u:
                assert (per_cell(row[None], (k,)) == 1).all()


@pytest.mark.parametrize(("seed", "pixel", "vertex", "dimension"), places(20, 2))
def test_the_first_two_dimensions_are_a_0_2_sequence(
    driver: Driver, seed: int, pixel: int, vertex: int, dimension: int
) -> None:
    """One of 2^k points in every elementary interval of area 2^-k, whatever its shape."""
    for k, first in product((1, 4, 7, 10), (0, 3)):
        u = numbers(driver, seed, pixel, (first << k) + np.arange(2**k), vertex, dimension)
        for across in range(k + 1):
            assert (per_cell(u, (across, k - across)) == 1).all()


@pytest.mark.parametrize(("seed", "pixel", "vertex", "dimension"), places(4, 3))
def test_four_dimensions_are_balanced(
    driver: Driver, seed: int, pixel: int, vertex: int, dimension: int
) -> None:
    """A (3, 4)-sequence, 3 being the degrees of the polynomials less one each: of 2^8 points eight in every
    elementary interval of volume 2^-5; in dimensions 2, 3 two of them in 2^-7.
    """
    u = numbers(driver, seed, pixel, 256 + np.arange(256), vertex, dimension)
    for levels in product(range(6), repeat=4):
        if sum(levels) == 5:
            assert (per_cell(u, levels) == 8).all()
    for across in range(8):
        assert (per_cell(u[1:3], (across, 7 - across)) == 2).all()


def test_independent_numbers_are_not_balanced(driver: Driver) -> None:
    """The checks above can fail: those of the other sampler do."""
    index = np.arange(256)
    u = driver("numbers", 1, 2, index, 0, 0, CAMERA, 0)
    assert (per_cell(u[:1], (8,)) != 1).any()


def test_points_are_those_of_joe_and_kuo(driver: Driver) -> None:
    """Neither scramble nor order changes how many pairs of points first differ at which digits, in all four
    dimensions together. The direction numbers here follow the recurrence in whole numbers m_k that Joe and
    Kuo print.
    """
    bits, polynomials = 10, [(1, 0, [1]), (2, 1, [1, 3]), (3, 1, [1, 3, 1])]
    columns = [[1 << (bits - 1 - k) for k in range(bits)]]
    for degree, a, m in polynomials:
        m = list(m)
        for k in range(degree, bits):
            new = m[k - degree] ^ (m[k - degree] << degree)
            for i in range(1, degree):
                new ^= (a >> (degree - 1 - i) & 1) * (m[k - i] << i)
            m.append(new)
        columns.append([m[k] << (bits - 1 - k) for k in range(bits)])
    places = np.arange(2**bits)
    plain = np.zeros((4, 2**bits), dtype=np.int64)
    for d, k in product(range(4), range(bits)):
        plain[d] ^= np.where(places >> k & 1, columns[d][k], 0)
    u = (numbers(driver, 11, 12, places, 3, CHOICE) * 2**bits).astype(np.int64)
    ours = np.frexp(u[:, :, None] ^ u[:, None])[1].reshape(4, -1)
    theirs = np.frexp(plain[:, :, None] ^ plain[:, None])[1].reshape(4, -1)
    assert (_counts(ours) == _counts(theirs)).all()


def _counts(levels: Array) -> Array:
    """How many pairs of points first differ at these digits, in all four dimensions together."""
    return np.bincount(np.ravel_multi_index(tuple(levels), (11,) * 4), minlength=11**4)


SEEDS = np.arange(40_000)


@pytest.mark.parametrize("sample", [0, 1, 6, 63, 2**32 + 5])
def test_each_point_is_uniform_over_the_seeds(driver: Driver, sample: int) -> None:
    """All four numbers, and the pairs of them that a path uses as one: 16 × 16 bins."""
    u = numbers(driver, SEEDS, 7, np.full(SEEDS.size, sample), 2, CHOICE)
    for row in u:
        counts = np.bincount(cell(row[None], (256,)), minlength=256)
        assert chi_squared(counts, np.full(256, SEEDS.size / 256)) > LEVEL
    for a, b in ((0, 1), (1, 2), (0, 3)):
        counts = np.bincount(cell(u[[a, b]], (16, 16)), minlength=256)
        assert chi_squared(counts, np.full(256, SEEDS.size / 256)) > LEVEL


@pytest.mark.parametrize(("i", "j"), [(0, 1), (0, 2), (2, 3), (5, 9), (3, 60), (17, 21)])
def test_two_points_differ_as_owen_wants(driver: Driver, i: int, j: int) -> None:
    """What follows the first different digit of two points of a block is independent: 8 × 8 bins. The
    variance depends on this law of pairs alone.
    """
    a, b = (numbers(driver, SEEDS, 99, np.full(SEEDS.size, index), 1, VERTEX) for index in (i, j))
    for one, other in zip(a, b, strict=True):
        digit = np.frexp((one * 2**32).astype(np.int64) ^ (other * 2**32).astype(np.int64))[1]
        scale = 2.0 ** (33 - digit)
        rest = np.stack([one * scale % 1, other * scale % 1])[:, digit > 12]
        assert rest.shape[1] > 0.99 * SEEDS.size
        counts = np.bincount(cell(rest, (8, 8)), minlength=64)
        assert chi_squared(counts, np.full(64, rest.shape[1] / 64)) > LEVEL


BLOCKS = [(5, 0, CAMERA), (5, 0, VERTEX), (5, 0, CHOICE), (5, 1, VERTEX), (6, 0, VERTEX)]


def shuffled_spread(count: int) -> float:
    """Variance of Σ (u - ½)(v - ½) over `count` samples, u and v of different blocks, against that of
    independent numbers.

    Of two samples whose indices differ in bit h and below, bit l < h is the lowest to differ in a block with
    probability 2^-(l + 1), and l = h with 2^-h; numbers that first differ in digit l + 1 have the correlation
    1 - 1.75 · 4^-l. Neighbours 2m, 2m + 1 are thus opposite in every block, the price of a sequence that is
    balanced at each 2^k; others hardly know of each other.
    """
    spread = 1.0
    for h in range(count.bit_length() - 1):
        levels = np.arange(h + 1)
        chances = np.append(2.0 ** -(levels[:-1] + 1), 2.0**-h)
        spread += 2**h * float(chances @ (1 - 1.75 * 4.0**-levels)) ** 2
    return spread


@pytest.mark.parametrize(("one", "other"), list(combinations(BLOCKS, 2)))
def test_blocks_are_uncorrelated(driver: Driver, one: tuple, other: tuple) -> None:
    """Over the seeds the products of two blocks' numbers have the mean 0, and their sum over 16 samples the
    variance that independent orders give: 1.6 times that of independent numbers. One order would give 9.
    """
    seeds, index = np.repeat(SEEDS[:10_000], 16), np.tile(np.arange(16), 10_000)
    u, v = (
        numbers(driver, seeds, pixel, index, vertex, dimension).reshape(4, -1, 16) - 0.5
        for pixel, vertex, dimension in (one, other)
    )
    sums = np.array([(u[d] * v[e]).sum(axis=1) for d, e in product(range(4), repeat=2)])
    z = sums.mean(axis=1) / sums.std(axis=1, ddof=1) * np.sqrt(sums.shape[1])
    assert 2 * stats.norm.sf(np.abs(z).max()) * z.size > LEVEL
    spread = sums.var(axis=1) / (16 / 144) / shuffled_spread(16)
    error = np.sqrt(((sums**4).mean(axis=1) / sums.var(axis=1) ** 2 - 1) / sums.shape[1])
    assert 2 * stats.norm.sf(np.abs((spread - 1) / error).max()) * z.size > LEVEL


# ---- pictures


def pictures(
    oneray: Path, folder: Path, scene: str, options: tuple[str, ...], spp: int, seeds: range
) -> Array:
    """(seeds, height, width, 3)"""
    made, output = [], folder / "out.exr"
    for seed in seeds:
        command = [oneray, ROOT / f"scenes/{scene}.xml", "-o", output, "--spp", spp, "--seed", seed, *options]
        subprocess.run([str(word) for word in command], check=True)
        made.append(load_image(output).pixels)
    return np.array(made)


CASES = {
    "cornell-box": (),
    "cornell-box walk": ("--estimator", "walk", "--hemisphere", "uniform"),
    "cornell-box light": ("--estimator", "light"),
    "cornell-box single": ("--precision", "single"),
    "many-lights": ("--light-choice", "learned"),
    "glass-pane": (),
    "mixed-material": ("--roulette", "survival"),
    "open-sky": ("--mis", "balance"),
    "mesh-room": (),
}


@pytest.mark.parametrize("case", CASES)
def test_the_mean_is_that_of_independent_samples(oneray: Path, tmp_path: Path, case: str) -> None:
    """Image means and means of 4 × 4 tiles, 20 seeds of each sampler; 7 samples per pixel are no power of
    two. Welch's t with a bound shared among tiles and channels; tiles that do not vary are equal.
    """
    scene, options = case.split()[0], CASES[case]
    one = pictures(oneray, tmp_path, scene, options, 7, range(20))
    other = pictures(oneray, tmp_path, scene, (*options, *SOBOL), 7, range(20, 40))
    for cut in (1, 4):
        a, b = (_tiles(images, cut) for images in (one, other))
        varies = a.std(axis=0) > 1e-6 * a.mean()
        p = stats.ttest_ind(a[:, varies], b[:, varies], axis=0, equal_var=False).pvalue
        assert p.min() * p.size > LEVEL
        np.testing.assert_allclose(a[:, ~varies], b[:, ~varies], rtol=1e-5)


def _tiles(images: Array, cut: int) -> Array:
    """(seeds, cut · cut · 3) means of tiles."""
    count, height, width, _ = images.shape
    images = images[:, : height // cut * cut, : width // cut * cut]
    tiles = images.reshape(count, cut, height // cut, cut, width // cut, 3)
    return tiles.mean(axis=(2, 4)).reshape(count, -1)


def gain(one: Array, other: Array) -> float:
    """The variance over the seeds of one against the other's, mean over pixels and channels."""
    return float(one.var(axis=0, ddof=1).mean() / other.var(axis=0, ddof=1).mean())


@pytest.mark.parametrize(
    ("scene", "options", "spp", "least"),
    [("cornell-box", ("-Ddepth=2",), 64, 15), ("cornell-box", (), 64, 6), ("many-lights", (), 64, 12)],
)
def test_less_noise(oneray: Path, tmp_path: Path, scene: str, options: tuple, spp: int, least: float) -> None:
    """The variance over eight seeds is so many times lower; measured: 28, 11 and 25. Pixels being many, the
    estimates scatter by a few percent.
    """
    one = pictures(oneray, tmp_path, scene, options, spp, range(8))
    other = pictures(oneray, tmp_path, scene, (*options, *SOBOL), spp, range(8))
    assert gain(one, other) > least


def test_more_samples_pay_more(oneray: Path, tmp_path: Path) -> None:
    """Direct light: four times the samples leave less than a sixth of the variance, where chance leaves a
    quarter.
    """
    few, many = (
        pictures(oneray, tmp_path, "cornell-box", ("-Ddepth=2", *SOBOL), spp, range(8)) for spp in (16, 64)
    )
    assert gain(few, many) > 6
