"""Mitsuba as a renderer: python mitsuba_renderer.py SCENE OUTPUT SPP SEED [max_depth=N] [factor=X]

With another depth or a factor it is broken on purpose.
"""

import re
import sys
from pathlib import Path

import mitsuba
import numpy as np

mitsuba.set_variant("scalar_rgb")


def render(scene: Path | str, spp: int, seed: int, breaks: dict[str, str]) -> np.ndarray:
    text = Path(scene).read_text(encoding="utf-8")
    if "max_depth" in breaks:
        text = re.sub(r'(name="depth" value=)"\d+"', rf'\1"{breaks["max_depth"]}"', text)
    image = mitsuba.render(mitsuba.load_string(text), spp=spp, seed=seed)
    return np.array(image) * float(breaks.get("factor", 1))


if __name__ == "__main__":
    scene, output, spp, seed, *breaks = sys.argv[1:]
    pixels = render(scene, int(spp), int(seed), dict(b.split("=") for b in breaks))
    mitsuba.Bitmap(pixels.astype(np.float32)).write(output)
