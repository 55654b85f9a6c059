"""How good are the times that INCONCLUSIVE says would decide, on a busy machine?

    python scripts/benchmark_estimates.py [--load 8] [--cases 6] [--core N] [--json FILE]

A renderer with a start-up, a pace and a noise that are drawn is judged, on one core, with few samples; then
again, with fresh seeds, in as many seconds as were said to decide, and once with as many samples. Meanwhile
half of `--load` busy processes share its core, which is what a load of so many is to each of two cores. Of
each case: the time said, whether it decided, and how long the samples took over it. The figures go into FILE,
by default references/estimates.json; exit status 1 where one is not within a factor 4. With `--load 0` the
load is that of the machine's other users.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import raycheck
from raycheck.base import data
from raycheck.base.arrays import Array
from raycheck.base.errors import NotFound
from raycheck.base.files import write_whole
from raycheck.base.machine import machine
from raycheck.stats.verdict import Outcome
from raycheck.truth import references
from raycheck.truth.expected import truth_of

SCENE = "point-light"
WITHIN = 4.0
"""The factor within which an estimate on a busy machine is right."""


def busy() -> None:
    """Work for ever."""
    while True:
        pass


def measure(number: int) -> dict[str, Any]:
    """A case of a renderer that is drawn: the estimate, and what came of it."""
    rng = np.random.default_rng(number)
    start, sample = np.exp(rng.uniform(np.log([5e-3, 1e-4]), np.log([3e-2, 1e-3])))
    noise, mean = rng.uniform(1.5, 3), truth_of(references.load_reference(SCENE)).mean

    def render(scene: Path, spp: int, seed: int) -> Array:
        begun = time.thread_time()
        k = spp / noise**2
        image = mean * np.random.default_rng(seed).gamma(k, 1 / k, (*mean.shape[:2], 1))
        while time.thread_time() - begun < start + sample * spp:
            pass
        return image

    [first] = raycheck.verify(render, SCENE, spp=2).cases
    told = {"start": round(start, 4), "sample": round(sample, 6), "said": first.more_seconds}
    if first.more_seconds is None:
        return {**told, "verdict": first.verdict, "decided": None}
    verdict, decided = seen(render, first.more_seconds)
    begun = time.perf_counter()
    raycheck.verify(render, SCENE, seed=2, spp=math.ceil(2 * (first.more_samples or 1.0)))
    took = time.perf_counter() - begun
    return {**told, "verdict": verdict, "decided": decided, "took": took, "off": took / first.more_seconds}


def seen(render: Callable[[Path, int, int], Array], seconds: float) -> tuple[str, bool]:
    """The verdict of a run of so many seconds, and whether it is one."""
    try:
        [case] = raycheck.verify(render, SCENE, seed=1, seconds=seconds).cases
    except NotFound as error:
        return str(error), False
    return case.verdict, case.verdict is not Outcome.INCONCLUSIVE


def main() -> int:
    parser = argparse.ArgumentParser(prog="benchmark_estimates", description=__doc__)
    parser.add_argument("--load", type=int, default=8)
    parser.add_argument("--cases", type=int, default=6)
    parser.add_argument("--core", type=int, default=min(os.sched_getaffinity(0)))
    parser.add_argument("--json", type=Path, default=data.references_dir() / "estimates.json")
    given = parser.parse_args()
    os.sched_setaffinity(0, {given.core})
    others = [multiprocessing.Process(target=busy, daemon=True) for _ in range(given.load // 2)]
    for one in others:
        one.start()
    found, before = [], os.getloadavg()[0]
    for number in range(given.cases):
        found.append(measure(number))
        print(found[-1], flush=True)
    for one in others:
        one.terminate()
    open_ones = [one for one in found if one["decided"] is not None]
    within = sum(1 / WITHIN <= one["off"] <= WITHIN for one in open_ones)
    result = {
        "load": given.load, "load_average": [round(x, 1) for x in (before, os.getloadavg()[0])],
        "machine": machine(), "cases": found, "undecided_at_first": len(open_ones),
        "decided_in_time": sum(one["decided"] for one in open_ones), "within_four": within,
    }  # fmt: skip
    write_whole(given.json, json.dumps(result, indent=1) + "\n")
    print(f"{result['decided_in_time']} of {len(open_ones)} decided, {within} within {WITHIN:g} times")
    return 0 if within == len(open_ones) else 1


if __name__ == "__main__":
    sys.exit(main())
