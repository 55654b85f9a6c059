#!/usr/bin/env python3
"""Writes what is too long to write by hand of scenes/stiff: decades.xml, a thousand lights over many decades,
meshes/strips.ply, parallel strips of triangles, and pictures/sun-K.hdr, skies with one bright pixel of 2^K.

    python scripts/make_stiff.py [FOLDER]

No formula is evaluated that machines round differently: the files are the same byte for byte everywhere.
"""

import sys
from pathlib import Path

from scene_text import sensor

STRIPS = 64
SUNS = (0, 10, 20, 30, 40)
GROUPS, LIGHTS = 25, 40
"""Lights of a group are of one intensity; the last light of the last group is the one that may be seen."""

HEAD = (
    """<!--
    A thousand point lights over 24 decades of intensity, in 25 groups; a plate hides all but the dimmest, or,
    lowered, none. Made by scripts/make_stiff.py.

    Expected: ρ/π · Σ I cosθ/d² over the lights that are seen.
-->
<scene version="3.0.0">
    <default name="plate" value="0.5"/>
{defaults}
    <integrator type="path">
        <integer name="max_depth" value="2"/>
        <integer name="rr_depth" value="5"/>
    </integrator>

"""
    + sensor("0.01", "-0.5, 0, 0.4", "0, 0, 0", 16)
    + """
    <!-- floor -->
    <shape type="rectangle">
        <transform name="to_world">
            <scale x="0.25" y="0.25" z="1"/>
        </transform>
        <bsdf type="diffuse">
            <rgb name="reflectance" value="0.5"/>
        </bsdf>
    </shape>

    <!-- plate: x from 0.05 to 2.05 -->
    <shape type="rectangle">
        <transform name="to_world">
            <scale x="1" y="2" z="1"/>
            <translate x="1.05" z="$plate"/>
        </transform>
        <bsdf type="diffuse">
            <rgb name="reflectance" value="0"/>
        </bsdf>
    </shape>

    <!-- the lights, one a line -->
"""
)

LIGHT = """\
    <emitter type="point"><point name="position" x="{x:g}" y="{y:g}" z="1"/>\
<rgb name="intensity" value="$i{group}"/></emitter>
"""


def decades() -> str:
    """A grid of 25 by 40 lights over the plate, groups along x; the last one beyond its edge."""
    defaults = "".join(f'    <default name="i{group}" value="1"/>\n' for group in range(GROUPS))
    lights = []
    for group in range(GROUPS):
        for k in range(LIGHTS):
            seen = group == GROUPS - 1 and k == LIGHTS - 1
            x, y = (-0.5, 0.25) if seen else (0.25 + group / 16, (k - 19.5) / 16)
            lights.append(LIGHT.format(x=x, y=y, group=group))
    return HEAD.format(defaults=defaults) + "".join(lights) + "</scene>\n"


def strips() -> str:
    """x from -32 to 32, y from -4 to 4, z = 0."""
    vertices = [f"{column - STRIPS // 2} {y} 0" for column in range(STRIPS + 1) for y in (-4, 4)]
    triangles = []
    for k in range(0, 2 * STRIPS, 2):
        triangles += [f"3 {k} {k + 2} {k + 3}", f"3 {k} {k + 3} {k + 1}"]
    head = f"""ply
format ascii 1.0
element vertex {len(vertices)}
property float x
property float y
property float z
element face {len(triangles)}
property list uchar int vertex_indices
end_header
"""
    return head + "\n".join([*vertices, *triangles]) + "\n"


def sky(exponent: int) -> bytes:
    """16 × 9 pixels of 1, of which a square of nine is black but for its middle."""
    one, black = bytes((128, 128, 128, 129)), bytes(4)
    pixels = [[one] * 16 for _ in range(9)]
    for row in (1, 2, 3):
        pixels[row][4:7] = [black] * 3
    pixels[2][5] = one[:3] + bytes((129 + exponent,))
    head = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 9 +X 16\n"
    return head + b"".join(_packed(row) for row in pixels)


def _packed(row: list[bytes]) -> bytes:
    """A line of RGBE in runs, of one byte each."""
    planes = bytes(pixel[channel] for channel in range(4) for pixel in row)
    return bytes((2, 2, 0, len(row))) + b"".join(bytes((129, byte)) for byte in planes)


def main() -> None:
    default = Path(__file__).resolve().parent.parent / "scenes" / "stiff"
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else default
    (folder / "meshes").mkdir(parents=True, exist_ok=True)
    (folder / "decades.xml").write_text(decades(), encoding="utf-8", newline="\n")
    (folder / "pictures").mkdir(exist_ok=True)
    for exponent in SUNS:
        (folder / "pictures" / f"sun-{exponent}.hdr").write_bytes(sky(exponent))
    (folder / "meshes" / "strips.ply").write_text(strips(), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
