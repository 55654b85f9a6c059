"""Renders the README's pictures with oneray into references/pictures/.

    python scripts/make_pictures.py [lecture] [scenes] [gallery]

lecture.png: the random walk and the walk with next event estimation, 36 samples per pixel each, side by side.
scenes.png: the canonical scenes with their names, eight in a row.
gallery-NAME.jpg: the scenes of docs/gallery.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from raycheck.base import data
from raycheck.base.images import load_image, write_image, write_png
from raycheck.base.pictures import display, exposure
from raycheck.renderers.oneray import oneray_path
from raycheck.scene import variants
from raycheck.truth import references

ROOT = Path(__file__).resolve().parent.parent
FOLDER = data.references_dir() / "pictures"
ZOOM_LECTURE, IN_A_ROW, GAP, GALLERY_SPP, JPEG_QUALITY = 6, 8, 8, 64, 90


def render(scene: Path, *options: str) -> NDArray[np.float64]:
    """Linear radiance, (H, W, 3)."""
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "out.exr"
        subprocess.run([oneray_path(), scene, "-o", output, *options], check=True)
        return load_image(output).pixels


def lecture() -> None:
    factor = exposure(references.load_reference("lecture").mean)
    scene = variants.scene_path("lecture")
    pair = [render(scene, "--spp", "36", "--estimator", estimator) for estimator in ("walk", "nee")]
    shown = [display(picture, factor) for picture in pair]
    zoomed = [one.repeat(ZOOM_LECTURE, axis=0).repeat(ZOOM_LECTURE, axis=1) for one in shown]
    gap = np.full((zoomed[0].shape[0], GAP, 3), 255, np.uint8)
    write_png(FOLDER / "lecture.png", np.concatenate([zoomed[0], gap, zoomed[1]], axis=1))


def scenes() -> None:
    names = variants.scene_names()
    rows = -(-len(names) // IN_A_ROW)
    figure, places = plt.subplots(rows, IN_A_ROW, figsize=(1.5 * IN_A_ROW, 1.62 * rows), dpi=96)
    for place in places.flat:
        place.set_axis_off()
    for name, place in zip(names, places.flat, strict=False):
        picture = render(variants.scene_path(name), "--spp", "1024", "--quiet")
        shown = display(picture, exposure(references.load_reference(name).mean))
        place.imshow(shown, interpolation="nearest")
        place.set_title(name, fontsize=7.5, pad=2)
    figure.subplots_adjust(left=0.005, right=0.995, top=0.975, bottom=0.005, wspace=0.05, hspace=0.14)
    figure.savefig(FOLDER / "scenes.png", metadata={"Software": None})
    plt.close(figure)


def gallery() -> None:
    for scene in sorted((ROOT / "docs/gallery").glob("*.xml")):
        picture = render(scene, "--spp", str(GALLERY_SPP), "--precision", "double", "--quiet")
        pixels = display(picture, 1.0)
        spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], 3, oiio.UINT8)
        spec.attribute("CompressionQuality", JPEG_QUALITY)
        write_image(FOLDER / f"gallery-{scene.stem}.jpg", spec, pixels)


ALL = {"lecture": lecture, "scenes": scenes, "gallery": gallery}


def main() -> None:
    FOLDER.mkdir(exist_ok=True)
    for name in sys.argv[1:] or ALL:
        ALL[name]()


if __name__ == "__main__":
    main()
