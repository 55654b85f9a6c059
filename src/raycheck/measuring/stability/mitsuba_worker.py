"""Mitsuba's scalar_rgb for the stiff cases, in a process of its own: jobs as JSON lines in, pixels out.

    python -m raycheck.measuring.stability.mitsuba_worker < jobs

A job {"scene": …, "settings": {…}, "spp": …, "seed": …} is answered by {"pixels": [[…]]}, channel green, or
by {"error": …} where Mitsuba refuses the scene.
"""

import json
import sys

from raycheck.renderers.mitsuba_scene import load_scene


def main() -> None:
    import mitsuba as mi
    import numpy as np

    mi.set_variant("scalar_rgb")
    mi.set_log_level(mi.LogLevel.Error)
    print(json.dumps({"version": mi.__version__}), flush=True)
    for line in sys.stdin:
        job = json.loads(line)
        try:
            scene = load_scene(job["scene"], job["settings"])
            image = np.array(mi.render(scene, spp=job["spp"], seed=job["seed"]))[..., 1]
            answer = {"pixels": image.astype(float).tolist()}
        except RuntimeError as error:
            answer = {"error": str(error).strip().splitlines()[-1].strip()}
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
