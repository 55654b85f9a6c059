"""How much is rendered for a verdict: numbers of images and samples, and budgets."""

import math
import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field

from raycheck.base.arrays import Array
from raycheck.base.seeds import make_seeds
from raycheck.judging.cases import Case
from raycheck.judging.plan import Goals
from raycheck.stats.verdict import ALPHA, Limits
from raycheck.truth.expected import Truth

BATCHES = 32
"""Images of each of the two judged sets."""
PILOT_IMAGES = 8
PILOT_SPP = 16
PICTURES = 2 * BATCHES
TIMED_NEAR, TIMING_STEP, TIMING_SEEDS = 2, 8, 5
"""A plan for more than twice the samples that were timed is timed again nearer to it, by at most 8 times as
many: a short render's time says little of a long one's. So many seeds are for times: the last for the
probe's.
"""
QUICK_SECONDS = 90.0
"""Budget of a quick run over everything, and what no single case may exceed."""
QUICK_CASE_SECONDS = 20.0
THOROUGH_IMAGE = 0.0027
"""Detectable bias of the image that a thorough case plans for, so that chance leaves it below 0.3 %."""
FINE_SECONDS, THOROUGH_SECONDS = 8.0, 300.0
"""A thorough case takes up to the second to see a bias of 0.3 % of the image, and up to the first to see
smaller ones and 1 % of most tiles.
"""
MOST_SPP = 1 << 16


OnImages = Callable[[str, str, Truth, int, Array], None]
"""Hears of pictures: scene, technique, truth, samples per pixel (1 where the renderer chooses), and the
pictures (B, H, W, 3).
"""


@dataclass(frozen=True)
class Settings:
    thorough: bool = False
    seed: int = 0
    look: int = 0
    """0, or 1 for a second look, which takes seeds of its own."""
    spp: int | None = None
    jobs: int = 2
    timeout: float = 60.0
    case_seconds: float = QUICK_CASE_SECONDS
    """What a quick case may take, after its survey."""
    ends: float = math.inf
    """When by the clock the last picture must be there."""
    budget: float = math.inf
    """The seconds of the run, to be named where they were over."""
    times: bool = True
    """Whether pictures may be rendered for their time alone, where `spp` says how many samples there are."""
    clock: Callable[[], float] = time.perf_counter
    limits: Limits = Limits()
    detect: float | None = None
    """Relative bias of the image to be noticed, however long it takes."""
    alpha: float = ALPHA
    """Chance of a wrong FAIL of each case, however often it is looked at."""
    repeated: bool = False
    """Looked at until it is decided, see judging.repeated."""
    earlier: Mapping[str, Case] = field(default_factory=dict)
    """Verdicts that stand, by fingerprint."""
    on_images: OnImages | None = None

    def wishes(self, truth: Truth, unbounded: bool) -> list[tuple[Goals, float]]:
        """Detectable biases to reach and the seconds that they are worth, the best first; of samples without
        bound only what a PASS needs.
        """
        if self.detect is not None:
            return [(Goals(self.detect), math.inf)]
        most = THOROUGH_SECONDS if self.thorough else self.case_seconds
        if unbounded:
            return [(Goals(coarsest=max(truth.shape)), most)]
        if not self.thorough:
            return [(Goals(image=0.003), most), (Goals(), most)]
        fine = [
            (Goals(image, tile_p90=0.01, fineness=0.8, coarsest=16), FINE_SECONDS)
            for image in (0.001, THOROUGH_IMAGE)
        ]
        coarse = [(Goals(THOROUGH_IMAGE, coarsest=16), most), (Goals(coarsest=16), most)]
        return [*fine[0 if truth.closed_form else 1 :], *coarse]


def case_seeds(label: str, name: str, seed: int, taken: Collection[int] = ()) -> list[int]:
    """The seeds of a case: one, the pilot's, the judged sets', and those of renders that measure time."""
    return make_seeds(f"{label}/{name}/{seed}", 1 + PILOT_IMAGES + 2 * BATCHES + TIMING_SEEDS, taken)
