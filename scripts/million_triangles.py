"""Loads a bumpy ball of a million triangles: seconds to load and build, bytes a triangle, rays a second."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from test_meshes import ball, scene, statistics, write_ply  # noqa: E402


def main() -> None:
    """One line for each precision and size; the smallest ball is what the program itself takes."""
    with tempfile.TemporaryDirectory() as folder:
        for precision in ("double", "single"):
            least = 0
            for rings in (3, 160, 501):
                points, faces = ball(rings)
                write_ply(Path(folder) / "ball.ply", points, faces)
                file = scene(Path(folder) / "scene.xml", "ball.ply", size=256, depth=4)
                stats = statistics(ROOT / "build/oneray", file, "--spp", "16", "--precision", precision)
                seconds, peak = stats["seconds"], stats["peak_memory_bytes"]
                least = least or peak
                rays = (stats["rays"] + stats["shadow_rays"]) / seconds["render"] / 1e6
                print(
                    f"{precision}, {stats['lanes']} lanes, {len(faces)} triangles: "
                    f"load {seconds['load']:.2f} s, "
                    f"build {seconds['build']:.2f} s, {(peak - least) / len(faces):.0f} bytes a triangle, "
                    f"{rays:.2f} million rays/s"
                )


if __name__ == "__main__":
    main()
