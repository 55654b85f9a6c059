"""What is shown of a scene that was judged: its figures, and pictures for the pages."""

import math

import numpy as np

from raycheck.base import pictures
from raycheck.base.arrays import Array
from raycheck.grading.results import SceneResult
from raycheck.judging.cases import Case
from raycheck.judging.verdict_pages import share_of
from raycheck.scene.variants import Variant
from raycheck.stats.verdict import Outcome
from raycheck.truth import references
from raycheck.truth.expected import truth_of

OPTION = "; --timeout SECONDS allows more"
"""What verify advises, and no student can do."""


def scene_result(name: str, hidden: bool, case: Case, looks: int, size: tuple[int, int]) -> SceneResult:
    """The verdict as plain data; `size` is the height and width of the picture."""
    figures = (case.bias, case.bias_low, case.bias_high, case.mde_image, case.more_samples)
    bias, low, high, mde, more = map(_finite, figures)
    reason = case.reason.removesuffix(OPTION)
    tile = share_of(case.tile, *size) if case.verdict is not Outcome.PASS else None
    return SceneResult(
        name, hidden, case.verdict, reason, bias, low, high, mde, more, case.spp, looks, tile=tile
    )  # fmt: skip


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def pictures_of(made: list[Array], of: Variant, secret: bool) -> list[dict[str, str]]:
    """The mean of what was rendered, the reference where it is no secret, and where they differ."""
    if not made:
        return []
    truth = truth_of(references.load_reference(of))
    images = np.stack(made)
    mean = images.mean(axis=0)
    factor = pictures.exposure(truth.mean)
    shown = [(mean, f"your mean of {len(made)} pictures")]
    if not secret:
        shown.append((truth.mean, "what it should be"))
    own = images.var(axis=0, ddof=1) / len(images) if len(images) > 1 else truth.sample_variance
    result = [{"uri": pictures.data_uri(pictures.display(p, factor)), "caption": c} for p, c in shown]
    map_ = pictures.error_map(mean, truth.mean, np.sqrt(own + truth.variance))
    return [*result, {"uri": pictures.data_uri(map_), "caption": "where: blue is too dark, red too bright"}]
