"""Correct renderers at which one looks many times over, until something FAILs; and biases injected into them.

The configurations, parts and samples are those of `nulls`; of each set there are LOOKS looks, twice 32 images
each. A part FAILs if any of its looks does, as `raycheck verify --until` would end there.
"""

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.seeds import make_seeds
from raycheck.calibration import checkout
from raycheck.calibration.checkout import Checkout
from raycheck.calibration.lines import read_lines
from raycheck.calibration.nulls import (
    CONFIGURATIONS,
    SPP,
    STRENGTHS,
    Configuration,
    Render,
    measure_missing,
    p_values,
    parts_of,
    ready,
)
from raycheck.judging.plan import measure_pilot
from raycheck.judging.settings import BATCHES, PILOT_IMAGES
from raycheck.renderers.pools import Pool
from raycheck.stats import evidence as ev
from raycheck.stats import statistics as st
from raycheck.stats import verdict
from raycheck.stats.evidence import Evidence
from raycheck.stats.tiles import SMALLEST, Tile, in_squares, means_of_sums, tile_sums
from raycheck.stats.verdict import ALPHA, SHARE_IMAGE, SHARE_TILES, Expected, Outcome
from raycheck.truth import provenance
from raycheck.truth.expected import Truth

METHOD = 2
"""Version of how correct renderers are looked at, see truth.provenance."""
LOOKS = 5
POWERS = (1, 2, LOOKS)
"""Numbers of looks at which the power is counted."""
LEVELS = (1e-2, 1e-3, 1e-4)
NORMAL = 1e6
"""Degrees of freedom of normal noise."""


@dataclass(frozen=True)
class Looks:
    """What LOOKS looks say of one image or part."""

    outcomes: list[Outcome]
    """After each look."""
    largest: float
    """The largest evidence at any later look."""
    e: dict[str, list[float]]
    """Sum and number of e by "image" and "tile", as verdicts use it: the reference may be off."""
    p: Counter[str]
    """As nulls.Judged has it: two-sided p of single sets, with the reference's noise, without allowance."""
    noticed: "dict[str, list[Noticed]]"
    """Of the "image" and a "tile", after each of POWERS looks."""


@dataclass(frozen=True)
class Noticed:
    """Whether a bias of each of STRENGTHS, in what is printed as detectable, was noticed."""

    together: list[bool]
    """By all looks."""
    apart: list[bool]
    """Were each judged by itself."""


def judge_looks(sums: Array, pilot_images: Array, truth: Truth, biased: bool) -> Looks:
    """Judge the sums (LOOKS, 64, rows, cols, 3) of images over the smallest squares, and 8 of a pilot; also
    `biased`.
    """
    pilot = measure_pilot(pilot_images, SPP, truth)
    regions = truth.regions(SPP, pilot.skewness)
    expected = truth.expected(regions, SPP / max(pilot.noise, 1.0))
    residuals = means_of_sums(sums, regions) - expected.mean
    sets = [half for look in residuals for half in (look[:BATCHES], look[BATCHES:])]
    own = [verdict.own_moments(one, expected) for one in sets]
    won = [verdict.gain(one, expected) for one in own]

    found = verdict.judge(sets[0], sets[1], expected, alpha=ALPHA / 2)
    seen, outcomes, largest = Evidence.none(*truth.shape), [found.outcome], 0.0
    for number, one in enumerate(won, 1):
        seen = seen.after(one, regions)
        if number % 2 == 0 and number > 2:
            found = verdict.judge_looks(own[:number], np.ones(number), seen, regions, expected)
            outcomes.append(found.outcome)
            largest = max(largest, float(np.exp(seen.log_value)))
    p: Counter[str] = Counter()
    for one, other in zip(sets[0::2], sets[1::2], strict=True):
        p.update(p_values(one, other, expected, LEVELS))
    noticed = _injected(sets, regions, expected) if biased else {}
    return Looks(outcomes, largest, _sums_of_e(own, won), p, noticed)


def _sums_of_e(own: Sequence[st.Moments], won: Sequence[Array]) -> dict[str, list[float]]:
    """Sum and number of e by family; the two directions of a region and channel are averaged."""
    sums = {"image": [0.0, 0], "tile": [0.0, 0]}
    for one, gained in zip(own, won, strict=True):
        e = np.exp(gained).mean(axis=0)
        for family, of in (("image", slice(0, 1)), ("tile", slice(1, None))):
            varies = ~one.exact[of]
            sums[family][0] += float(e[of][varies].sum())
            sums[family][1] += int(varies.sum())
    return sums


def _injected(sets: Sequence[Array], regions: list[Tile], expected: Expected) -> dict[str, list[Noticed]]:
    """By family, after each of POWERS looks: whether the printed detectable bias of the worst channel, of
    the image and of the tile than which nine tenths are no less sensitive, is noticed by its own test.
    """
    noticed: dict[str, list[Noticed]] = {"image": [], "tile": []}
    scale = np.where(expected.yardstick > 0, expected.yardstick, 1.0)
    for looks in POWERS:
        mde = _detectable(sets[: 2 * looks], regions, expected)
        by_tile = (mde[1:] / scale[1:]).max(axis=1)
        tile = 1 + int(np.argsort(by_tile)[int(np.ceil(0.9 * len(by_tile))) - 1]) if len(by_tile) else 0
        for family, region in (("image", 0), ("tile", tile)):
            at = region, int(np.argmax(mde[region] / scale[region]))
            biased = [[one + strength * mde for one in sets[: 2 * looks]] for strength in STRENGTHS]
            noticed[family].append(
                Noticed(
                    [_notices(one, at, regions, expected) for one in biased],
                    [_notices_apart(one, at, expected) for one in biased],
                )
            )
    return noticed


def _detectable(sets: Sequence[Array], regions: list[Tile], expected: Expected) -> Array:
    """(R, 3) what is printed as detectable after these looks."""
    if len(sets) == 2:
        one, two = (_moments(residuals, expected) for residuals in sets)
        return st.detectable_bias(one, two, _levels(expected) / 2, expected.allowance)
    own = [verdict.own_moments(one, expected) for one in sets]
    none = Evidence.none(*_size(regions))
    return verdict.detectable_by_looks(own, np.ones(len(own)), none, regions, expected)


def _moments(residuals: Array, expected: Expected) -> st.Moments:
    return st.moments(residuals, expected.variance, expected.batches, expected.batch_variance)


def _size(regions: Sequence[Tile]) -> tuple[int, int]:
    return regions[0].height, regions[0].width


def _levels(expected: Expected) -> Array:
    """(R, 3) two-sided level of each test over the two sets of a look."""
    shape = expected.mean.shape
    level = np.full(shape, SHARE_TILES * ALPHA / max(shape[1] * (shape[0] - 1), 1))
    level[0] = SHARE_IMAGE * ALPHA / shape[1]
    return level


def _notices(sets: Sequence[Array], at: tuple[int, int], regions: list[Tile], expected: Expected) -> bool:
    """Whether the test of this region and channel FAILs at any of these looks."""
    first, second = (_moments(one, expected) for one in sets[:2])
    p = st.two_set_p(first, second, expected.allowance)
    won = [verdict.gain(verdict.own_moments(one, expected), expected)[:, *at] for one in sets]
    products = np.cumsum(won, axis=0)[3::2]
    threshold = Evidence.none(*_size(regions)).thresholds(regions, ALPHA / 2)[at[0]]
    return bool(p[at] <= _levels(expected)[at] / 2 or np.any(products >= threshold))


def _notices_apart(sets: Sequence[Array], at: tuple[int, int], expected: Expected) -> bool:
    """Whether it would, were each look judged by itself, at its share of the level."""
    level = _levels(expected)[at] / (len(sets) // 2)
    return any(
        st.two_set_p(_moments(one, expected), _moments(two, expected), expected.allowance)[at] <= level
        for one, two in zip(sets[0::2], sets[1::2], strict=True)
    )


@dataclass(frozen=True)
class Set:
    """What one set of looks gave, ready to be kept as a line of JSON."""

    configuration: str
    index: int
    outcomes: list[list[str]]
    """Of each part, after each look."""
    whole: list[str]
    largest: list[float]
    """The largest evidence of each part, and of the whole."""
    e: dict[str, list[float]]
    p: dict[str, int]
    noticed: dict[str, list[Noticed]]
    """As in Looks, by the whole image."""
    digest: str
    """Digest of the pictures and the method: what has it need not be judged again."""


def digest(configuration: Configuration) -> str:
    return provenance.digest(METHOD, configuration.rests_on)


def render_looks(configuration: Configuration, index: int, render: Render) -> tuple[Array, Array]:
    """The pilot's images (8, H, W, 3), and the sums of the looks' over the smallest squares."""
    key = f"looks/{configuration.label}/{index}"
    pilot = render(make_seeds(f"{key}/pilot", PILOT_IMAGES))
    seeds = [make_seeds(f"{key}/{look}", 2 * BATCHES) for look in range(LOOKS)]
    return pilot, np.stack([tile_sums(render(of_look), SMALLEST)[0] for of_look in seeds])


def judge_set(configuration: Configuration, index: int, pilot: Array, sums: Array, truth: Truth) -> Set:
    whole = judge_looks(sums, pilot, truth, biased=True)
    parts = [
        judge_looks(sums[:, :, *in_squares(tile).window], pilot[:, *tile.window], part, biased=False)
        for tile, part in parts_of(truth)
    ]
    e = {family: list(np.sum([one.e[family] for one in parts], axis=0)) for family in ("image", "tile")}
    return Set(
        configuration.label, index, [_names(one.outcomes) for one in parts], _names(whole.outcomes),
        [one.largest for one in (*parts, whole)], e, dict(whole.p), whole.noticed, digest(configuration),
    )  # fmt: skip


def _names(outcomes: Sequence[Outcome]) -> list[str]:
    return [outcome.value for outcome in outcomes]


def one_set(configuration: Configuration, index: int, build: Checkout) -> bytes:
    """`judge_set` as JSON: a piece of `measure`."""
    checkout.require(build)
    render, truth = ready(configuration)
    pilot, sums = render_looks(configuration, index, render)
    return json.dumps(asdict(judge_set(configuration, index, pilot, sums, truth))).encode()


def measure(
    file: Path, sets: int, configurations: Sequence[Configuration] = CONFIGURATIONS, pool: Pool | None = None
) -> Iterator[dict[str, Any]]:
    """`sets` sets of each configuration; what `file` has of the same pictures is kept, new ones are added to
    it as they come.
    """
    yield from measure_missing(one_set, file, _current(file), sets, configurations, pool)


def _current(file: Path) -> list[dict[str, Any]]:
    """The lines of the file that are of the pictures and the method of today."""
    digests = {one.label: digest(one) for one in CONFIGURATIONS}
    return [line for line in read_lines(file) if line["digest"] == digests.get(line["configuration"])]


def summary(file: Path) -> dict[str, object]:
    """False alarms, means of e, p-values and powers of all sets in the file."""
    lines = sorted(_current(file), key=lambda line: (line["configuration"], line["index"]))
    parts = [outcomes for line in lines for outcomes in line["outcomes"]]
    p: Counter[str] = Counter()
    for line in lines:
        p.update(line["p"])
    families = ("image", "tile")
    e = {family: np.sum([line["e"][family] for line in lines], axis=0) for family in families}
    rests = {name for one in CONFIGURATIONS for line in lines if line["configuration"] == one.label
             for name in one.rests_on}  # fmt: skip
    return {
        "provenance": provenance.provenance(METHOD, rests),
        "looks": LOOKS,
        "verdicts": len(parts),
        "false_alarms": sum("FAIL" in outcomes for outcomes in parts),
        "sets": len(lines),
        "false_alarms_whole": sum("FAIL" in line["whole"] for line in lines),
        "passed_after": {
            str(look): sum(outcomes[look - 1] == "PASS" for outcomes in parts) for look in range(1, LOOKS + 1)
        },
        "mean_e": {family: round(float(e[family][0] / e[family][1]), 4) for family in families},
        "largest_evidence": round(max(x for line in lines for x in line["largest"]), 2),
        "needed_evidence": 2 / ALPHA,
        "p_values": {
            family: {f"{level:g}": round(p[f"{family} {level:g}"] / p[f"{family} of"], 6) for level in LEVELS}
            | {"of": p[f"{family} of"]}
            for family in families
        },
        "power": {
            str(looks): {"standard_errors": _standard_errors(looks)}
            | {
                family: {
                    rule: [
                        round(float(np.mean([line["noticed"][family][k][rule][s] for line in lines])), 4)
                        for s in range(len(STRENGTHS))
                    ]
                    for rule in ("together", "apart")
                }
                for family in families
            }
            for k, looks in enumerate(POWERS)
        } | {"strengths": list(STRENGTHS)},
    }  # fmt: skip


def _standard_errors(looks: int) -> dict[str, float]:
    """The bias that one test notices with 90 % power at the level of a case, in standard errors of one set:
    all looks together, and each by itself.
    """
    sizes = (1.0,) * (2 * looks)
    together = ev.detection_factor(sizes, NORMAL, float(np.log(4 / ALPHA)), ALPHA / 2)
    apart = ev.detection_factor_apart(looks, NORMAL, ALPHA)
    return {"together": round(together, 2), "apart": round(apart, 2)}
