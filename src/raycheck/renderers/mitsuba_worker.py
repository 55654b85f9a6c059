"""Mitsuba in a process of its own: commands as lines of JSON in, answers out.

    python -m raycheck.renderers.mitsuba_worker VARIANT

{"load": FILE, "parameters": {"name": "value"}}, the parameters optional, and {"render": SPP, "seed": SEED,
"save": FILE.npy or null}. One thread renders. Answers have `seconds` by the clock and `process`, those of the
processor. A crash ends this process alone, and its peak memory is Mitsuba's and Python's, nothing else's.
"""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path
from typing import Any

from raycheck.renderers.mitsuba_scene import load_scene


def peak_memory() -> int:
    """Bytes; this process's own (ru_maxrss begins with the parent's), 0 where the system does not say."""
    status = Path("/proc/self/status")
    lines = status.read_text().splitlines() if status.is_file() else []
    return next((int(x.split()[1]) * 1024 for x in lines if x.startswith("VmHWM")), 0)


def main() -> None:
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # Mitsuba's own messages stay out of the answers
    start = time.perf_counter()
    import drjit as dr
    import mitsuba as mi
    import numpy as np

    dr.set_thread_count(1)
    mi.set_variant(sys.argv[1])
    mi.set_log_level(mi.LogLevel.Error)
    print(json.dumps({"import": time.perf_counter() - start, "version": mi.__version__}), file=answers)
    scene: Any = None
    for line in sys.stdin:
        order = json.loads(line)
        start, process = time.perf_counter(), time.process_time()
        if "load" in order:
            scene = load_scene(order["load"], order.get("parameters", {}))
            spent = time.process_time() - process
            width, height = scene.sensors()[0].film().size()
            answer = {"seconds": time.perf_counter() - start, "width": int(width), "height": int(height)}
        else:
            image = np.array(mi.render(scene, spp=order["render"], seed=order["seed"]))
            answer = {"seconds": time.perf_counter() - start}
            spent = time.process_time() - process
            answer["spp"] = scene.sensors()[0].sampler().sample_count()
            if order["save"]:
                np.save(order["save"], image)
        answer |= {"process": spent, "memory": peak_memory()}
        print(json.dumps(answer), file=answers)


if __name__ == "__main__":
    main()
