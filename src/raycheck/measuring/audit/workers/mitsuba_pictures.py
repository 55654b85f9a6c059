"""Mitsuba: the scene is its XML; settings may name the variant."""

import json
import sys


def main() -> None:
    job = json.load(sys.stdin)
    import mitsuba as mi
    import numpy as np

    mi.set_variant(job["settings"].get("variant", "scalar_rgb"))
    mi.set_log_level(mi.LogLevel.Error)
    scene = mi.load_string(job["scene"])
    pictures = [
        np.array(mi.render(scene, spp=job["samples"], seed=seed)).astype(float).tolist()
        for seed in job["seeds"]
    ]
    print("\n" + json.dumps({"version": mi.__version__, "pictures": pictures}))


if __name__ == "__main__":
    main()
