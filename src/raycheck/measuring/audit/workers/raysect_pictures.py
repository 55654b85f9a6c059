"""Raysect: the scene is a program that leaves `sight`, an observer of one pixel, and `pipeline`."""

import json
import sys
from importlib.metadata import version
from typing import Any


def main() -> None:
    job = json.load(sys.stdin)
    from raysect.core.math.random import seed as set_seed
    from raysect.core.workflow import SerialEngine

    names: dict[str, Any] = {}
    exec(job["scene"], names)
    sight, pipeline = names["sight"], names["pipeline"]
    sight.render_engine = SerialEngine()
    sight.quiet = True
    sight.pixel_samples = job["samples"]
    pictures = []
    for seed in job["seeds"]:
        set_seed(seed)
        sight.observe()
        pictures.append([[[float(pipeline.value.mean)]]])
    print("\n" + json.dumps({"version": version("raysect"), "pictures": pictures}))


if __name__ == "__main__":
    main()
