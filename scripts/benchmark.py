"""Paths per second of oneray and of Mitsuba 3 on the same scene file, interleaved, on one pinned core.

    python scripts/benchmark.py [SCENE ...] [--rounds 5] [--core 0] [--json FILE]

Each round runs every contestant once, in turn, so that a machine whose speed drifts is slow for all.
Rendering is timed without start-up: oneray's own figure, and for Mitsuba the render call after one that
compiled its kernel. Printed are minimum, median and maximum over the rounds, of the paths per second and of
each contestant's ratio to Mitsuba llvm in the same round.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BASELINE = "mitsuba llvm"


@dataclass
class Contestant:
    """A renderer: `run()` renders once and returns paths per second."""

    name: str
    run: Callable[[], float]
    rates: list[float] = field(default_factory=list)


def oneray(scene: Path, precision: str, spp: int) -> Contestant:
    """oneray with its defaults; seconds as it states them for the render alone."""
    command = [
        str(ROOT / "build/oneray"),
        str(scene),
        "--spp",
        str(spp),
        "--precision",
        precision,
        "--stats",
        "-",
        "--quiet",
    ]

    def run() -> float:
        stats = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        return stats["paths"] / stats["seconds"]["render"]

    return Contestant(f"oneray {precision}", run)


def mitsuba(scene: Path, variant: str, spp: int) -> Contestant:
    """Mitsuba with one thread in this process; the first render, which compiles, is not counted."""
    import drjit as dr
    import mitsuba as mi
    import numpy as np

    dr.set_thread_count(1)
    mi.set_variant(variant)
    loaded = mi.load_file(str(scene))
    width, height = loaded.sensors()[0].film().size()
    np.array(mi.render(loaded, spp=spp, seed=0))

    def run() -> float:
        run.seed += 1
        start = time.perf_counter()
        np.array(mi.render(loaded, spp=spp, seed=run.seed))
        return float(width * height * spp) / (time.perf_counter() - start)

    run.seed = 0
    return Contestant(BASELINE if "llvm" in variant else "mitsuba scalar", run)


def spread(values: list[float], scale: float = 1.0) -> dict[str, float]:
    """Minimum, median and maximum."""
    return {
        "min": min(values) / scale,
        "median": statistics.median(values) / scale,
        "max": max(values) / scale,
    }


def measure(scene: Path, rounds: int, spp: int) -> dict[str, dict[str, dict[str, float]]]:
    """Runs the rounds; by contestant its Mpaths/s and its ratio to the baseline in the same round."""
    contestants = [
        mitsuba(scene, "llvm_ad_rgb", spp),
        oneray(scene, "double", 2 * spp),
        oneray(scene, "single", 4 * spp),
    ]
    for _ in range(rounds):
        for contestant in contestants:
            contestant.rates.append(contestant.run())
    baseline = contestants[0].rates
    return {
        c.name: {
            "Mpaths/s": spread(c.rates, 1e6),
            "ratio": spread([a / b for a, b in zip(c.rates, baseline, strict=True)]),
        }
        for c in contestants
    }


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenes", nargs="*", type=Path, default=[ROOT / "scenes/cornell-box.xml"])
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--spp", type=int, default=256, help="samples per pixel of Mitsuba's renders")
    parser.add_argument("--core", type=int, default=0, help="the core that everything is pinned to")
    parser.add_argument("--json", type=Path, help="write the figures here as well")
    arguments = parser.parse_args()
    if arguments.rounds < 1 or arguments.spp < 1:
        parser.error("--rounds and --spp are at least 1")
    os.sched_setaffinity(0, {arguments.core})
    os.environ.setdefault("DRJIT_LIBLLVM_PATH", "libLLVM.so.19.1")
    results = {}
    for scene in arguments.scenes:
        if not scene.is_file():
            parser.error(f"{scene}: no such scene")
        results[scene.stem] = measure(scene, arguments.rounds, arguments.spp)
        print(f"{scene.stem}: {arguments.rounds} rounds on core {arguments.core}, min / median / max")
        for name, figures in results[scene.stem].items():
            columns = (
                " / ".join(f"{v:6.2f}" for v in figures[key].values()) for key in ("Mpaths/s", "ratio")
            )
            print(f"  {name:<15} {{}} Mpaths/s   {{}} x {BASELINE}".format(*columns))
    if arguments.json:
        arguments.json.write_text(json.dumps(results, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
