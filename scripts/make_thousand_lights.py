#!/usr/bin/env python3
"""Writes scenes/thousand-lights.xml: a hall with a thousand lamps.

    python scripts/make_thousand_lights.py [OUTPUT]

A grid of 40 × 25 lamps, each a small square that shines down; hue follows the place and power a generator
of its own, so that the file is the same byte for byte on every machine.
"""

import math
import sys
from collections.abc import Iterator
from pathlib import Path

from scene_text import sensor

COLUMNS, ROWS = 40, 25
SPACING, HEIGHT, HALF_SIDE = 0.25, 0.5, 0.035
RADIANCE = 7.0

HEAD = (
    """<!--
    A thousand lights with one ray (L4), and how to choose among them (L6, L18).

    A low hall with a thousand lamps of different colour and power, made by
    scripts/make_thousand_lights.py. At each floor point the few lamps overhead matter and the other
    hundreds do not: a choice by 1/N or by power nearly always takes one that is far away; a choice by
    what a light can contribute, or a learned one, does not.

    Expected: nothing hides a lamp, so the floor shows
        ρ/π · Σ L_i F(lamp i),
    F being the projected solid angle by Lambert's formula.
-->
<scene version="3.0.0">
    <default name="depth" value="2"/>

    <integrator type="path">
        <integer name="max_depth" value="$depth"/>
        <integer name="rr_depth" value="5"/>
    </integrator>

"""
    + sensor("70", "0, 1.2, 0.48", "0, 1.62, 0", 32)
    + """
    <bsdf type="diffuse" id="floor">
        <rgb name="reflectance" value="0.8"/>
    </bsdf>

    <bsdf type="diffuse" id="black">
        <rgb name="reflectance" value="0"/>
    </bsdf>

    <shape type="rectangle">
        <transform name="to_world">
            <scale x="8" y="8" z="1"/>
        </transform>
        <ref id="floor"/>
    </shape>

    <!-- the lamps, one a line: all shine down -->
"""
)

LAMP = """\
    <shape type="rectangle"><transform name="to_world">\
<matrix value="{half} 0 0 {x:g} 0 -{half} 0 {y:g} 0 0 -1 {z:g} 0 0 0 1"/></transform><ref id="black"/>\
<emitter type="area"><rgb name="radiance" value="{r:.2f} {g:.2f} {b:.2f}"/></emitter></shape>
"""


def uniform() -> Iterator[float]:
    """Numbers in [0, 1): a linear congruential generator, Numerical Recipes' constants."""
    state = 12
    while True:
        state = (1664525 * state + 1013904223) % 2**32
        yield state / 2**32


def scene() -> str:
    random = uniform()
    lamps = []
    for row in range(ROWS):
        for column in range(COLUMNS):
            x, y = (column - (COLUMNS - 1) / 2) * SPACING, row * SPACING
            power = RADIANCE * 12.0 ** (next(random) - 0.5)
            turn = 2.4 * x + 1.6 * math.sin(1.9 * y)
            red, green, blue = (power * (0.62 + 0.38 * math.cos(turn + k)) for k in (0.0, 2.1, 4.2))
            lamps.append(LAMP.format(half=HALF_SIDE, x=x, y=y, z=HEIGHT, r=red, g=green, b=blue))
    return HEAD + "".join(lamps) + "</scene>\n"


if __name__ == "__main__":
    default = Path(__file__).resolve().parent.parent / "scenes" / "thousand-lights.xml"
    (Path(sys.argv[1]) if len(sys.argv) > 1 else default).write_text(scene(), encoding="utf-8", newline="\n")
