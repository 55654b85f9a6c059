"""From batches to intervals and a verdict: pure functions.

A value's interval misses the truth with probability LEVEL, by Hall's t on all batches. A deviation is claimed
where the interval lies beyond ALLOWED, and both halves of the batches say so by themselves, by Student's t,
each at √LEVEL: what one strange batch does is no finding. The probability of any false claim, of a deviation
or of health, in the whole audit is at most LEVEL times the number of values.
"""

from collections.abc import Sequence
from dataclasses import replace
from enum import StrEnum

import numpy as np

from raycheck.base.arrays import Array
from raycheck.measuring.audit.check import ALLOWED, LEVEL, Check
from raycheck.measuring.audit.results import Value
from raycheck.stats.statistics import interval, moments, two_set_p


class Verdict(StrEnum):
    FINDING = "finding"
    DOCUMENTED = "documented approximation"
    HEALTH = "health"
    UNDECIDED = "undecided"


def values(names: Sequence[str], expected: Sequence[float], batches: Array) -> list[Value]:
    """Measured values of batches (B, V), B even, with their intervals; ValueError for what is no number."""
    batches = np.asarray(batches, dtype=np.float64)
    truth = np.asarray(expected, dtype=np.float64)
    if batches.ndim != 2 or batches.shape[1] != len(names) or len(truth) != len(names):
        raise ValueError(f"values {batches.shape} and {len(truth)} expected ones for {len(names)} names")
    if not np.isfinite(batches).all():
        raise ValueError("the picture has values that are not finite")
    nothing = np.zeros(truth.shape)
    residuals = batches / truth - 1
    found = moments(residuals, nothing)
    low, high = interval(found, LEVEL / 2)
    half = len(batches) // 2
    halves = (residuals[:half], residuals[half:])
    both = [replace(moments(part, nothing), skewness=nothing) for part in halves]
    p = two_set_p(both[0], both[1], np.full(truth.shape, ALLOWED))
    return [
        Value(
            name, float(t), float(t * (1 + b)), float(t * (1 + lo)), float(t * (1 + hi)),
            bool(q <= LEVEL and (lo > ALLOWED or hi < -ALLOWED)),
        )
        for name, t, b, lo, hi, q in zip(names, truth, found.bias, low, high, p, strict=True)
    ]  # fmt: skip


def verdict(check: Check, found: Sequence[Value]) -> Verdict:
    """Of all values: one that deviates decides; health wants every interval within the check's bound."""
    if any(value.deviates for value in found):
        return Verdict.DOCUMENTED if check.documented else Verdict.FINDING
    ends = [abs(x / value.expected - 1) for value in found for x in (value.low, value.high)]
    return Verdict.HEALTH if max(ends) <= check.within else Verdict.UNDECIDED
