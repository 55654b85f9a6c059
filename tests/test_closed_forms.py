"""oneray against closed forms, which outrank every other renderer: furnace and point light."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest

from raycheck.images import load_image
from raycheck.references import closed_form
from raycheck.techniques import TECHNIQUES, applicable, read_content, technique
from raycheck.tiles import quad_tree, region_means, region_variances, whole

FURNACE = ["walk-uniform", "walk-cosine", "nee", "mis-power", "mis-balance", "nee-no-roulette"]
CASES = [("point-light", name) for name in ("nee", "mis-power")] + [("furnace", name) for name in FURNACE]


def deviations(
    oneray: Path, scene: Path, name: str, folder: Path, spp: int, factor: float = 1.0
) -> np.ndarray:
    """(regions, 3) standard errors by which oneray's image and tiles are off `factor` times the closed form.

    Pixels that hold an edge have no closed form and are left out. What does not vary within a pixel at all is
    held to 1e-6 of its value.
    """
    options = [*technique(name).options, "--spp", str(spp), "--seed", "20"]
    subprocess.run([oneray, scene, "-o", folder / "out.exr", *options], check=True)
    image, exact = load_image(folder / "out.exr"), closed_form(scene.stem, {}) * factor
    known = np.isfinite(exact)
    assert known.mean() > 0.9
    residual = np.where(known, image.pixels - exact, 0.0)
    variance = np.where(known, np.maximum(image.stderr, 1e-6 * np.abs(image.pixels)) ** 2, 0.0)
    height, width = residual.shape[:2]
    regions = [whole(height, width), *quad_tree(height, width, {}, spp)]
    error = np.sqrt(region_variances(variance, regions))
    return region_means(residual, regions) / np.where(error > 0, error, np.inf)


@pytest.mark.parametrize(("name", "technique_name"), CASES)
def test_within_five_standard_errors(
    oneray: Path, scene, tmp_path: Path, name: str, technique_name: str
) -> None:
    """Image and 8×8 tiles: at most 195 numbers, so that a right renderer is beyond 5 once in 9,000 runs."""
    found = deviations(oneray, scene(name), technique_name, tmp_path, 1024)
    assert np.abs(found).max() < 5


def test_the_check_can_fail(oneray: Path, scene, tmp_path: Path) -> None:
    """An answer that is 1 % off is seen in the furnace, and one of 0.1 % at the point light."""
    assert np.abs(deviations(oneray, scene("furnace"), "mis-power", tmp_path, 1024, 1.01)).max() > 5
    assert np.abs(deviations(oneray, scene("point-light"), "nee", tmp_path, 1024, 1.001)).max() > 5


def test_unlimited_depth(oneray: Path, scene, tmp_path: Path) -> None:
    """The furnace without depth limit: only roulette ends paths, and the sum of all bounces is right."""
    output = tmp_path / "out.exr"
    subprocess.run(
        [oneray, scene("furnace"), "-Ddepth=-1", "-o", output, "--spp", "1024", "--seed", "4"], check=True
    )
    image, exact = load_image(output), closed_form("furnace", {"depth": "-1"})
    known = np.isfinite(exact)
    off = np.where(known, image.pixels - exact, 0).sum(axis=(0, 1))
    assert (np.abs(off) < 5 * np.sqrt(np.where(known, image.stderr**2, 0).sum(axis=(0, 1)))).all()


def test_techniques_named_here_apply(scene) -> None:
    names = {t.name for t in TECHNIQUES}
    for name, chosen in CASES:
        assert chosen in names
        assert technique(chosen) in applicable(read_content(scene(name)))
