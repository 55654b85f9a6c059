"""False alarms: correct renderers judged again and again with fresh seeds; and biases injected into them.

A set is 8 pilot images and twice 32 judged ones. It gives a verdict on the whole image and one on each
of eight parts, whose pixels are independent of each other: those on the parts are what is counted.
"""

import functools
import json
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.seeds import make_seeds
from raycheck.calibration import checkout, mutants, rivals, trials
from raycheck.calibration.checkout import Checkout
from raycheck.calibration.lines import append_lines, read_lines
from raycheck.judging.settings import BATCHES, PILOT_IMAGES
from raycheck.renderers import workers
from raycheck.renderers.pools import Pool
from raycheck.scene import variants
from raycheck.stats import statistics as st
from raycheck.stats.tiles import Tile
from raycheck.stats.verdict import Expected, Outcome, judge
from raycheck.truth import provenance
from raycheck.truth.expected import Truth

METHOD = 1
"""Version of how correct renderers are judged, see truth.provenance."""
SPP = 4
LEVELS = (1e-2, 1e-3)
STRENGTHS = (0.5, 1.0, 2.0)
"""Injected biases, in minimal detectable ones."""


@dataclass(frozen=True)
class Configuration:
    """A correct renderer and a scene."""

    scene: str
    by: str
    """A technique of oneray, or "mitsuba"."""
    why: str

    @property
    def label(self) -> str:
        return f"{self.scene}/{self.by}"

    @property
    def rests_on(self) -> list[str]:
        """What is judged, and by what; Mitsuba's own pictures are renewed with its references."""
        own = [] if self.by == "mitsuba" else [f"{self.scene} {self.by} double"]
        return [*own, f"reference {self.scene}"]

    @property
    def digest(self) -> str:
        return provenance.digest(METHOD, self.rests_on)


CONFIGURATIONS = (
    Configuration("point-light", "nee", "closed form, hardly any noise"),
    Configuration("area-light", "mis-power", "closed form, soft shadow"),
    Configuration("many-lights", "nee-contribution", "closed form, light choice"),
    Configuration("furnace", "walk-cosine", "closed form, random walk and roulette"),
    Configuration("cornell-box", "mis-power", "Mitsuba's reference"),
    Configuration("caustic", "mis-power", "fireflies"),
    Configuration("spherical-light", "mis-sobol", "Sobol' points"),
    Configuration("glass-ball", "mis-power", "glass, skewed samples"),
    Configuration("area-light", "light", "light tracing: pixels share paths"),
    Configuration("cornell-box", "mitsuba", "Mitsuba judged by its own references"),
)

Render = Callable[[list[int]], Array]
"""A function from n seeds to images (n, H, W, 3)."""


def oneray_render(configuration: Configuration) -> Render:
    program = trials.Program(mutants.program(None), configuration.by)
    return lambda seeds: program.images(configuration.scene, [(SPP, seed) for seed in seeds])


def mitsuba_render(configuration: Configuration) -> Render:
    import mitsuba

    mitsuba.set_variant("scalar_rgb")
    scene = mitsuba.load_file(str(variants.scene_path(configuration.scene)))
    render: Any = mitsuba.render
    return lambda seeds: np.stack(
        [np.array(render(scene, spp=SPP, seed=seed), dtype=np.float64) for seed in seeds]
    )


PARTS = (4, 2)
"""Rows and columns of parts; those of an image of 32×32 pixels hold two tiles each, of 64×64 eight."""


def parts_of(truth: Truth) -> list[tuple[Tile, Truth]]:
    """The image's parts as images of their own."""
    height, width = truth.shape[0] // PARTS[0], truth.shape[1] // PARTS[1]
    parts = []
    for row, column in np.ndindex(PARTS):
        tile = Tile(row * height, column * width, height, width)
        rows, columns = tile.window
        skewness = {
            size: table[rows.start // size : rows.stop // size, columns.start // size : columns.stop // size]
            for size, table in truth.skewness.items()
            if size <= min(height, width)
        }
        arrays = {name: getattr(truth, name)[tile.window] for name in ("mean", "variance", "sample_variance")}
        parts.append((tile, replace(truth, skewness=skewness, **arrays)))
    return parts


@dataclass(frozen=True)
class Judged:
    """One verdict on a correct renderer."""

    outcome: Outcome
    p: Counter[str]
    """How many p-values of "image", "tile" and "omnibus" were below each level, and how many there were:
    those of single sets, two-sided, without any allowance.
    """
    noticed: dict[str, list[bool]]
    """Whether a bias of each of STRENGTHS was noticed in "image", "tile" and "verdict"."""


def judge_null(images: Array, pilot_images: Array, truth: Truth) -> Judged:
    """What `raycheck verify` says of 64 images at SPP samples, and what it would say if they were biased."""
    sets = trials.judge_images(images, pilot_images, truth, SPP, SPP)
    outcome = Outcome.FAIL if sets.fails else sets.found.outcome
    return Judged(outcome, p_values(sets.first, sets.second, sets.expected), _injected(sets))


def p_values(
    first: Array, second: Array, expected: Expected, levels: Sequence[float] = LEVELS
) -> Counter[str]:
    """As in Judged."""
    counts: Counter[str] = Counter()
    zero = np.zeros_like(expected.mean)
    one, two = (st.moments(r, expected.variance, expected.batches) for r in (first, second))
    for residuals, own, other in ((first, one, two), (second, two, one)):
        p = np.minimum(1.0, 2 * np.minimum(*st.one_sided_p(own, zero)))
        varies = ~own.exact & (np.ptp(residuals, axis=0) > 0)
        families = {"image": p[0][varies[0]], "tile": p[1:][varies[1:]]}
        usable = ~own.exact[1:] & ~other.exact[1:]
        weights = np.where(usable, 1 / np.where(usable, other.spread[1:], 1.0) ** 2, 0.0)
        if len(expected.mean) > 2:
            together, _ = st.omnibus(residuals[:, 1:], expected.variance[1:], weights, zero[1:])
            families["omnibus"] = np.array([together] if together < 1 else [])
        for family, values in families.items():
            counts[f"{family} of"] += len(values)
            for level in levels:
                counts[f"{family} {level:g}"] += int((values <= level).sum())
    return counts


def _injected(sets: trials.Sets) -> dict[str, list[bool]]:
    """Whether multiples of the worst detectable bias are noticed, added to the image in its channel, and
    likewise to the tile than which nine tenths are no less sensitive.
    """
    noticed: dict[str, list[bool]] = {"image": [], "tile": [], "verdict": []}
    scale = np.where(sets.expected.yardstick > 0, sets.expected.yardstick, 1.0)
    mde = sets.detectable()
    worst = int(np.argmax(mde[0] / scale[0]))
    by_tile = (mde[1:] / scale[1:]).max(axis=1)
    tile = 1 + int(np.argsort(by_tile)[int(np.ceil(0.9 * len(by_tile))) - 1]) if len(by_tile) else 0
    channel = int(np.argmax(mde[tile] / scale[tile]))
    for strength in STRENGTHS:
        noticed["image"].append(_notices(sets, (0, worst), strength * mde))
        noticed["tile"].append(_notices(sets, (tile, channel), strength * mde))
        everywhere = strength * sets.found.mde_image * scale
        verdict = judge(sets.first + everywhere, sets.second + everywhere, sets.expected)
        noticed["verdict"].append(verdict.outcome is Outcome.FAIL)
    return noticed


def _notices(sets: trials.Sets, at: tuple[int, int], bias: Array) -> bool:
    """Whether the one test of this region and channel FAILs with this bias."""
    noise = (sets.expected.variance, sets.expected.batches, sets.expected.batch_variance)
    one, two = (st.moments(residuals + bias, *noise) for residuals in (sets.first, sets.second))
    p = st.two_set_p(one, two, sets.expected.allowance)
    return bool(p[at] <= sets.levels()[at])


@dataclass(frozen=True)
class Set:
    """What one set of images gave, ready to be kept as a line of JSON."""

    configuration: str
    index: int
    outcomes: list[str]
    """The verdicts on the parts."""
    whole: str
    p: dict[str, int]
    noticed: dict[str, list[bool]]
    """As in Judged, by the whole image."""
    rivals: dict[str, bool]
    digest: str
    """Digest of the pictures and the method: what has it need not be judged again."""


def judge_set(configuration: Configuration, index: int, render: Render, truth: Truth) -> Set:
    seeds = make_seeds(f"null/{configuration.label}/{index}", PILOT_IMAGES + 2 * BATCHES)
    images = render(seeds)
    pilot, images = images[:PILOT_IMAGES], images[PILOT_IMAGES:]
    whole = judge_null(images, pilot, truth)
    outcomes, p = [], Counter({k: n for k, n in whole.p.items() if not k.startswith("tile")})
    for tile, part in parts_of(truth):
        window = (slice(None), *tile.window)
        found = judge_null(images[window], pilot[window], part)
        outcomes.append(found.outcome.value)
        p.update({k: n for k, n in found.p.items() if k.startswith("tile")})
    judged = rivals.judge(images, SPP, truth)
    return Set(
        configuration.label, index, outcomes, whole.outcome.value, dict(p), whole.noticed, judged,
        configuration.digest,
    )  # fmt: skip


def one_set(configuration: Configuration, index: int, build: Checkout) -> bytes:
    """`judge_set` as JSON: a piece of `measure_nulls`."""
    checkout.require(build)
    found = judge_set(configuration, index, *ready(configuration))
    return json.dumps(asdict(found)).encode()


@functools.lru_cache(maxsize=len(CONFIGURATIONS))
def ready(configuration: Configuration) -> tuple[Render, Truth]:
    make = mitsuba_render if configuration.by == "mitsuba" else oneray_render
    return make(configuration), trials.load_truth(configuration.scene)


def measure_nulls(
    file: Path, sets: int, configurations: Sequence[Configuration] = CONFIGURATIONS, pool: Pool | None = None
) -> Iterator[Set]:
    """`sets` sets of each configuration; what `file` has of the same pictures is kept, new ones are added to
    it as they come.
    """
    for found in measure_missing(one_set, file, _current(file), sets, configurations, pool):
        yield Set(**found)


def measure_missing(
    one_set: Callable[..., bytes], file: Path, kept: Iterable[Mapping[str, Any]], sets: int,
    configurations: Sequence[Configuration], pool: Pool | None,
) -> Iterator[dict[str, Any]]:  # fmt: skip
    """The sets that are not among the `kept` lines, each added to the file as it comes."""
    done = {(line["configuration"], line["index"]) for line in kept}
    build = checkout.of_checkout()
    pieces = [
        (one, index, build)
        for index in range(sets)
        for one in configurations
        if (one.label, index) not in done
    ]
    for _, data in workers.run(pool, one_set, pieces):
        found = json.loads(data)
        append_lines(file, [found])
        yield found


def _current(file: Path) -> list[dict[str, Any]]:
    """The lines of the file that are of the pictures and the method of today."""
    digests = {one.label: one.digest for one in CONFIGURATIONS}
    return [line for line in read_lines(file) if line["digest"] == digests.get(line["configuration"])]


def summary(file: Path) -> dict[str, object]:
    """False alarms, p-values and powers of all sets in the file."""
    sets = sorted(_current(file), key=lambda line: (line["configuration"], line["index"]))
    p: Counter[str] = Counter()
    for line in sets:
        p.update(line["p"])
    table = {}
    for label in sorted({line["configuration"] for line in sets}):
        mine = [line for line in sets if line["configuration"] == label]
        table[label] = dict(Counter(outcome for line in mine for outcome in line["outcomes"]))
    shares = {
        family: {
            f"{level:g}": round(p[f"{family} {level:g}"] / p[f"{family} of"], 6) for level in LEVELS
        } | {"of": p[f"{family} of"]}
        for family in ("image", "tile", "omnibus")
        if p[f"{family} of"]
    }  # fmt: skip
    rests = {name for one in CONFIGURATIONS if one.label in table for name in one.rests_on}
    origin = {"provenance": provenance.provenance(METHOD, rests)}
    power = {
        name: [round(float(np.mean([line["noticed"][name][k] for line in sets])), 4) for k in range(3)]
        for name in ("image", "tile", "verdict")
    } if sets else {}  # fmt: skip
    alarms = {rule: sum(line["rivals"][rule] for line in sets) for rule in rivals.RULES}
    return {
        **origin,
        "verdicts": sum(len(line["outcomes"]) for line in sets),
        "false_alarms": sum(line["outcomes"].count("FAIL") for line in sets),
        "sets": len(sets),
        "false_alarms_whole": sum(line["whole"] == "FAIL" for line in sets),
        "rival_false_alarms": alarms,
        "configurations": table,
        "p_values": shares,
        "power": {**origin, "strengths": list(STRENGTHS), **power},
    }
