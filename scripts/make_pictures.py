"""Renders the README's pictures with oneray into references/pictures/.

    python scripts/make_pictures.py

lecture.png: the random walk and the walk with next event estimation, 36 samples per pixel each, side by side.
scenes.png: the canonical scenes, eight in a row.
"""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from raycheck.base import data
from raycheck.base.images import load_image, write_png
from raycheck.base.pictures import display, exposure
from raycheck.renderers.oneray import oneray_path
from raycheck.scene import variants
from raycheck.truth import references

ZOOM_LECTURE, SIDE_SCENE, IN_A_ROW, GAP = 6, 192, 8, 8


def render(scene: str, *options: str) -> NDArray[np.float64]:
    """Linear radiance, (H, W, 3)."""
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "out.exr"
        subprocess.run([oneray_path(), variants.scene_path(scene), "-o", output, *options], check=True)
        return load_image(output).pixels


def row(pictures: list[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Pictures of one height side by side on white."""
    gap = np.full((pictures[0].shape[0], GAP, 3), 255, np.uint8)
    parts = [part for picture in pictures for part in (picture, gap)][:-1]
    return np.concatenate(parts, axis=1)


def enlarge(picture: NDArray[np.uint8], zoom: int) -> NDArray[np.uint8]:
    return picture.repeat(zoom, axis=0).repeat(zoom, axis=1)


def main() -> None:
    folder = data.references_dir() / "pictures"
    folder.mkdir(exist_ok=True)
    factor = exposure(references.load_reference("lecture").mean)
    pair = [render("lecture", "--spp", "36", "--estimator", estimator) for estimator in ("walk", "nee")]
    lecture = row([enlarge(display(picture, factor), ZOOM_LECTURE) for picture in pair])
    write_png(folder / "lecture.png", lecture)

    tiles = []
    for name in variants.scene_names():
        if name == "lecture":
            continue
        picture = render(name, "--spp", "1024")
        shown = display(picture, exposure(references.load_reference(name).mean))
        tiles.append(enlarge(shown, SIDE_SCENE // shown.shape[0]))
    blank = np.full_like(tiles[0], 255)
    tiles += [blank] * (-len(tiles) % IN_A_ROW)
    rows = [row(tiles[first : first + IN_A_ROW]) for first in range(0, len(tiles), IN_A_ROW)]
    gap = np.full((GAP, rows[0].shape[1], 3), 255, np.uint8)
    parts = [part for one in rows for part in (one, gap)][:-1]
    write_png(folder / "scenes.png", np.concatenate(parts, axis=0))


if __name__ == "__main__":
    main()
