"""Compare two images by the standard errors that they carry."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from scipy import special

from raycheck.base.arrays import Array
from raycheck.base.errors import NotFound
from raycheck.base.images import Image, load_image
from raycheck.base.text import percent, signed
from raycheck.judging import checks, sentences
from raycheck.judging.explanations import explain
from raycheck.judging.looks import look
from raycheck.stats.tiles import SMALLEST, Tile, place, region_means, region_variances, whole
from raycheck.stats.verdict import ALPHA, CONFIDENCE, SYSTEMATIC, Limits, Outcome
from raycheck.truth.expected import Truth

TAME_ERROR = 0.05
"""Tiles grow until their standard error is at most this share of their mean, since then no few samples rule
them.
"""


@dataclass(frozen=True)
class Comparison:
    """How B differs from A; figures are relative to A."""

    first: str
    second: str
    verdict: Outcome
    reason: str
    bias: float | None = None
    bias_low: float | None = None
    bias_high: float | None = None
    mde_image: float | None = None
    mde_tile_p90: float | None = None
    tiles: int = 0

    @property
    def exit_status(self) -> int:
        return {Outcome.FAIL: 1, Outcome.INCONCLUSIVE: 3, Outcome.PASS: 0}[self.verdict]

    def to_json(self) -> str:
        return json.dumps(asdict(self), indent=1, ensure_ascii=False) + "\n"


def compare(first: Path | str, second: Path | str, limits: Limits = Limits()) -> Comparison:
    """Do two images show the same mean? Each needs channels stderr.R/G/B (NotFound without); ImageError if
    unreadable.
    """
    first, second = Path(first), Path(second)
    a, b = load_image(first), load_image(second)
    for path, image in ((first, a), (second, b)):
        if image.stderr is None and "--sampler sobol" in str(image.attributes.get("oneray")):
            hint = "raycheck verify goes by those"
            raise NotFound(f"{path}: made with --sampler sobol, whose noise only other seeds show; {hint}")
        if image.stderr is None:
            raise NotFound(f"{path}: no channels stderr.R, stderr.G, stderr.B, so its noise is not known")
    height, width = a.pixels.shape[:2]
    for path, image in ((first, a), (second, b)):
        problem = checks.number_problem(image) or checks.size_problem(image, height, width, a.window)
        if problem:
            return Comparison(str(first), str(second), Outcome.FAIL, f"{path}: {problem}")
    return _judge(str(first), str(second), a, b, limits)


def _judge(first: str, second: str, a: Image, b: Image, limits: Limits) -> Comparison:
    difference = b.pixels - a.pixels
    assert a.stderr is not None and b.stderr is not None
    variance = a.stderr**2 + b.stderr**2
    if not np.all(np.isfinite(variance)):
        reason = "the standard errors are not all finite (at least 2 samples per pixel are needed)"
        return Comparison(first, second, Outcome.INCONCLUSIVE, reason)
    height, width = difference.shape[:2]
    regions = [whole(height, width), *_tiles(np.abs(a.pixels) + np.abs(b.pixels), variance)]
    bias = region_means(difference, regions)
    error = np.sqrt(region_variances(variance, regions))
    reference = np.abs(region_means(a.pixels, regions))
    yardstick = np.concatenate([reference[:1], np.maximum(reference, reference[0] / 10)[1:]])
    scale = np.where(yardstick > 0, yardstick, reference[0].max() or 1.0)
    quantum = region_means(a.quantum + b.quantum, regions)
    allowance = (
        np.where(error > 0, SYSTEMATIC * reference, 1e-5 * reference + 1e-7 * reference[0].max()) + quantum
    )

    beyond = np.abs(bias) - allowance
    z = np.where(error > 0, beyond / np.where(error > 0, error, 1.0), np.where(beyond > 0, np.inf, -np.inf))
    p = 2 * special.ndtr(-z) * z.size  # Bonferroni over all regions and channels
    half = -special.ndtri((1 - CONFIDENCE) / 2 / z.size) * error
    limit = np.full(scale.shape, limits.tile) * scale + quantum
    limit[0] = limits.image * scale[0] + quantum[0]
    inside = np.where(error > 0, np.abs(bias) + half <= limit, beyond <= 0)
    factor = -special.ndtri(ALPHA / 2 / z.size) - special.ndtri(0.1)
    detectable = (allowance + factor * error) / scale

    worst = np.unravel_index(int(np.argmax(z)), z.shape)
    amount = f"{signed(bias[worst] / scale[worst])} ± {percent(half[worst] / scale[worst])}"
    where = _place(regions[worst[0]], height, width)
    if p.min() <= ALPHA:
        outcome = Outcome.FAIL
        known = Truth(a.pixels, a.stderr**2, b.stderr**2, {}, 2, closed_form=False)
        explained = explain([look("", b.pixels[None], known)])
        reason = f"{sentences.explanation(explained)}: " if explained.convention else ""
        chance = sentences.odds(float(p.min()), "two renders of the same mean")
        reason += f"{where} differs by {amount} in {sentences.CHANNELS[worst[1]]} ({chance})"
    elif inside.all():
        outcome = Outcome.PASS
        seen = percent(float(detectable[0].max()))
        reason = f"the same: a difference of {seen} of the image would have been noticed"
    else:
        outcome = Outcome.INCONCLUSIVE
        wide = np.unravel_index(int(np.argmax(np.where(inside, 0, half / scale))), half.shape)
        more = float(np.max(np.where(inside, 1.0, ((half + 2.5 * error) / limit) ** 2)))
        reason = (
            f"too noisy to say: {_place(regions[wide[0]], height, width)} may differ by "
            f"{percent(half[wide] / scale[wide])}; about {more:.2g} times the samples would decide"
        )
    channel = int(np.argmax(z[0]))
    return Comparison(
        first, second, outcome, reason,
        bias=float(bias[0, channel] / scale[0, channel]),
        bias_low=float((bias - half)[0, channel] / scale[0, channel]),
        bias_high=float((bias + half)[0, channel] / scale[0, channel]),
        mde_image=float(detectable[0].max()),
        mde_tile_p90=float(np.quantile(detectable[1:].max(axis=1), 0.9, method="higher")),
        tiles=len(regions) - 1,
    )  # fmt: skip


def _place(region: Tile, height: int, width: int) -> str:
    return (
        "the image mean" if region == whole(height, width) else f"the tile at {place(region, height, width)}"
    )


def _tiles(size: Array, variance: Array) -> list[Tile]:
    """Quad-tree tiles, as small as 8×8, whose standard error is tame or zero."""
    height, width = size.shape[:2]
    root = SMALLEST
    while root < max(height, width):
        root *= 2

    def divide(side: int, row: int, column: int) -> tuple[list[Tile], bool]:
        if row >= height or column >= width:
            return [], True
        tile = Tile(row, column, min(side, height - row), min(side, width - column))
        if side > SMALLEST:
            half = side // 2
            parts = [divide(half, row + dr, column + dc) for dr in (0, half) for dc in (0, half)]
            if all(tame for _, tame in parts):
                return [t for tiles, _ in parts for t in tiles], True
        mean = region_means(size, [tile])[0] / 2
        error = np.sqrt(region_variances(variance, [tile])[0])
        return [tile], bool(np.all(error <= TAME_ERROR * mean))

    return divide(root, 0, 0)[0]
