#!/usr/bin/env python3
"""Writes the meshes of the scenes: scenes/meshes/lamp.ply, coarse-ball.ply, strip.ply and ring.obj.

    python scripts/make_meshes.py [FOLDER]

Numbers have few digits, and no formula is evaluated that machines round differently, so that the files are
the same byte for byte everywhere.
"""

import math
import sys
from pathlib import Path

Vertices = list[tuple[float, float, float]]
Triangles = list[tuple[int, int, int]]

GOLDEN = (1 + math.sqrt(5)) / 2


def icosahedron() -> tuple[Vertices, Triangles]:
    """Twelve vertices at distance 1 from the origin, twenty triangles, counterclockwise from outside."""
    scale = 1 / math.sqrt(1 + GOLDEN**2)
    a, b = scale, scale * GOLDEN
    vertices = [
        *((-a, b, 0.0), (a, b, 0.0), (-a, -b, 0.0), (a, -b, 0.0)),
        *((0.0, -a, b), (0.0, a, b), (0.0, -a, -b), (0.0, a, -b)),
        *((b, 0.0, -a), (b, 0.0, a), (-b, 0.0, -a), (-b, 0.0, a)),
    ]
    triangles = [
        *((0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11)),
        *((1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6), (7, 1, 8)),
        *((3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9)),
        *((4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)),
    ]
    return vertices, triangles


def divided(vertices: Vertices, triangles: Triangles) -> tuple[Vertices, Triangles]:
    """Four triangles in place of each, new vertices on the unit sphere."""
    vertices, middles = list(vertices), {}

    def middle(i: int, j: int) -> int:
        key = (min(i, j), max(i, j))
        if key not in middles:
            x, y, z = (p + q for p, q in zip(vertices[i], vertices[j], strict=True))
            length = math.sqrt(x * x + y * y + z * z)
            middles[key] = len(vertices)
            vertices.append((x / length, y / length, z / length))
        return middles[key]

    smaller = []
    for a, b, c in triangles:
        ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
        smaller += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
    return vertices, smaller


def strip(pieces: int = 6) -> tuple[Vertices, Triangles]:
    """The square [−1, 1]² in z = 0, cut across x into pieces of which each is half as long as the one before,
    the last two alike, of two triangles each; normal +z.
    """
    cuts = [1 - 2.0 ** (1 - k) for k in range(pieces)] + [1.0]
    vertices = [(x, y, 0.0) for x in cuts for y in (-1.0, 1.0)]
    corners = [(2 * k, 2 * k + 2, 2 * k + 3, 2 * k + 1) for k in range(pieces)]
    return vertices, [three for a, b, c, d in corners for three in ((a, b, c), (a, c, d))]


def ply(vertices: Vertices, triangles: Triangles, normals: bool) -> str:
    """ASCII PLY; with `normals` each vertex of a body around the origin has its own, pointing outwards."""
    names = ("x", "y", "z") + (("nx", "ny", "nz") if normals else ())
    head = ["ply", "format ascii 1.0", f"element vertex {len(vertices)}"]
    head += [f"property float {name}" for name in names]
    head += [f"element face {len(triangles)}", "property list uchar int vertex_indices", "end_header"]
    points = [" ".join(f"{value:.5f}" for value in (v * 2 if normals else v)) for v in vertices]
    faces = [f"3 {a} {b} {c}" for a, b, c in triangles]
    return "\n".join(head + points + faces) + "\n"


def ring(around: int = 16, across: int = 8, radius: float = 0.3) -> str:
    """OBJ of a ring around the z axis, of radius 1, with normals and quadrilaterals."""
    lines = []
    for i in range(around):
        a = 2 * math.pi * i / around
        for j in range(across):
            b = 2 * math.pi * j / across
            out = 1 + radius * math.cos(b)
            position = (out * math.cos(a), out * math.sin(a), radius * math.sin(b))
            normal = (math.cos(b) * math.cos(a), math.cos(b) * math.sin(a), math.sin(b))
            lines.append("v " + " ".join(f"{value + 0.0:.4f}" for value in map(_tidy, position)))
            lines.append("vn " + " ".join(f"{value + 0.0:.4f}" for value in map(_tidy, normal)))
    for i in range(around):
        for j in range(across):
            corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
            numbers = [(p % around) * across + q % across + 1 for p, q in corners]
            lines.append("f " + " ".join(f"{number}//{number}" for number in numbers))
    return "\n".join(lines) + "\n"


def _tidy(value: float) -> float:
    """Without the last digits, which machines may round differently, and without −0."""
    return round(value, 9) + 0.0


def main() -> None:
    default = Path(__file__).resolve().parent.parent / "scenes" / "meshes"
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else default
    folder.mkdir(parents=True, exist_ok=True)
    files = {
        "lamp.ply": ply(*icosahedron(), normals=False),
        "coarse-ball.ply": ply(*divided(*icosahedron()), normals=True),
        "strip.ply": ply(*strip(), normals=False),
        "ring.obj": ring(),
    }
    for name, text in files.items():
        (folder / name).write_text(text, encoding="ascii", newline="\n")


if __name__ == "__main__":
    main()
