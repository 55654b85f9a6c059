"""What an image is judged against: Mitsuba's reference, outranked by a closed form where there is one."""

import functools
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from raycheck.base.arrays import Array
from raycheck.stats.tiles import SMALLEST, Tile, quad_tree, region_means, region_variances, whole
from raycheck.stats.verdict import Expected
from raycheck.truth.references import Reference


@dataclass(frozen=True)
class Truth:
    """Pixel means and their variance, and how skewed and noisy a single sample is."""

    mean: Array
    """(H, W, 3) means of the pixels."""
    variance: Array
    """(H, W, 3) variance of `mean`, 0 where a closed form stands."""
    sample_variance: Array
    """(H, W, 3) variance of one sample per pixel as the reference's renderer takes it."""
    skewness: Mapping[int, Array]
    """Tile size → (rows, cols, 3) skewness of one-sample tile means, NaN where nothing varies."""
    batches: int
    closed_form: bool
    """At least nine pixels in ten have a closed form."""

    @property
    def shape(self) -> tuple[int, int]:
        return self.mean.shape[0], self.mean.shape[1]

    @functools.cached_property
    def digest(self) -> str:
        """A digest of what an image is judged against."""
        arrays = (self.mean, self.variance, self.sample_variance)
        return hashlib.blake2b(b"".join(a.tobytes() for a in arrays), digest_size=16).hexdigest()

    @property
    def varies(self) -> bool:
        return bool(np.any(self.sample_variance > 0))

    def regions(
        self, spp: float, skewness: Mapping[int, Array] | None = None, smallest: int = SMALLEST
    ) -> list[Tile]:
        """The whole image, then its tiles for batches of `spp` samples."""
        height, width = self.shape
        return [whole(height, width), *quad_tree(height, width, skewness or self.skewness, spp, smallest)]

    def expected(self, regions: list[Tile], spp: float, quantum: Array | None = None) -> Expected:
        """The reference over `regions`, for batches as noisy as `spp` of the reference's own samples."""
        mean = region_means(self.mean, regions)
        return Expected(
            mean=mean,
            variance=region_variances(self.variance, regions),
            batches=self.batches,
            batch_variance=region_variances(self.sample_variance, regions) / spp,
            quantum=np.zeros_like(mean) if quantum is None else region_means(quantum, regions),
        )


def truth_of(reference: Reference) -> Truth:
    variance = np.asarray(reference.variance_of_mean, dtype=np.float64)
    mean = np.asarray(reference.mean, dtype=np.float64)
    exact = np.full(mean.shape, np.nan) if reference.closed_form is None else reference.closed_form
    closed = np.isfinite(exact)
    return Truth(
        mean=np.where(closed, exact, mean), variance=np.where(closed, 0.0, variance),
        sample_variance=variance * reference.batches * reference.spp_per_batch, skewness=reference.skewness,
        batches=reference.batches, closed_form=bool(closed.mean() >= 0.9),
    )  # fmt: skip
