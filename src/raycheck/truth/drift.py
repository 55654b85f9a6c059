"""What another version of Mitsuba changes: new batches of a scene against the reference that one made of it.

Their seeds are those that follow the reference's, so that no sample is in both, whatever the versions. They
are judged like anybody's images, but by the reference alone: that a closed form outranks it is no matter
here.
"""

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from raycheck.base.errors import NotFound
from raycheck.base.seeds import FIRST_REFERENCE_SEED, MOST_REFERENCE_SEEDS
from raycheck.scene.variants import Variant
from raycheck.stats.tiles import Tile, region_means
from raycheck.stats.verdict import Judgement, judge
from raycheck.truth import references
from raycheck.truth.expected import truth_of
from raycheck.truth.making import Batches

BATCHES = 64
"""In two sets, which must agree on a difference."""
MOST_SPP = 256


@dataclass(frozen=True)
class Drift:
    """New batches against a reference."""

    label: str
    before: str
    """Who made the reference, for people."""
    now: str
    """Who made the new batches."""
    spp: int
    """Samples per pixel of each."""
    judgement: Judgement
    regions: list[Tile]

    @property
    def same_version(self) -> bool:
        return self.before == self.now


def require(of: Variant) -> None:
    """ReferenceError_ without a fresh reference, NotFound where it is not Mitsuba's."""
    entry = references.require(of)
    if "mitsuba_version" not in entry:
        raise NotFound(f"{of.label}: its reference is not Mitsuba's, but {entry['renderer']}'s")


def measure(of: Variant, renderer: Batches, seconds: float) -> Drift:
    """Render for about `seconds`, and judge; errors as of `require`."""
    require(of)
    reference = replace(references.load_reference(of), closed_form=None)
    first = unused(reference.entry)
    spp = _affordable(renderer, first, seconds)
    truth = truth_of(reference)
    regions = truth.regions(spp)
    images = renderer.batches(first, BATCHES, spp)
    residuals = np.stack([region_means(image - truth.mean, regions) for image in images])
    judgement = judge(residuals[: BATCHES // 2], residuals[BATCHES // 2 :], truth.expected(regions, spp))
    now = f"Mitsuba {renderer.made_by['mitsuba_version']}"
    return Drift(of.label, reference.made_by, now, spp, judgement, regions)


def unused(entry: Mapping[str, object]) -> int:
    """The first batch whose seed no sample of the reference has."""
    seeds = entry["seeds"]
    assert isinstance(seeds, list)
    first = int(seeds[0]) + int(seeds[1]) - FIRST_REFERENCE_SEED
    if first + BATCHES > MOST_REFERENCE_SEEDS:
        raise NotFound(f"the reference has used all {MOST_REFERENCE_SEEDS} seeds")
    return first


def _affordable(renderer: Batches, first: int, seconds: float) -> int:
    """Samples per pixel of a batch, a power of two, so that all of them take about `seconds`."""
    few = 16
    next(renderer.batches(first, 1, few))
    start = time.perf_counter()
    next(renderer.batches(first, 1, few))
    each = (time.perf_counter() - start) / few
    return 1 << math.floor(math.log2(min(max(seconds / BATCHES / each, 4), MOST_SPP)))
