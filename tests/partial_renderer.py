"""A renderer of a student who got as far as flat surfaces: oneray behind a start-up of its own.

    python partial_renderer.py SCENE.json SCENE.xml OUTPUT SPP SEED [start=SECONDS] [by=line|status|stdout]

It knows triangles and parallelograms (two triangles each) alone. Of anything else it says so, by a line
"unsupported: …" on standard error (`by=line`) or standard output, or by exit status 77.
"""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

FLAT = {"triangle", "parallelogram"}


def main(scene: str, xml: str, output: str, spp: str, seed: str, *options: str) -> int:
    chosen = dict(option.split("=") for option in options)
    time.sleep(float(chosen.get("start", 0)))
    shapes = {primitive["type"] for primitive in json.loads(Path(scene).read_text())["primitives"]}
    if shapes - FLAT:
        how, what = chosen.get("by", "line"), ", ".join(sorted(shapes - FLAT))
        said = "" if how == "status" else "unsupported: "
        print(f"{said}I have no {what}", file=sys.stdout if how == "stdout" else sys.stderr)
        return 77 if how == "status" else 1
    oneray = os.environ.get("ONERAY") or str(Path(__file__).parents[1] / "build/oneray")
    return subprocess.call([oneray, xml, "-o", output, "--spp", spp, "--seed", seed, "--quiet"])


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
