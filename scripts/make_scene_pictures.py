#!/usr/bin/env python3
"""Writes the pictures that scenes name: scenes/pictures/sky.exr, tiles.png, waves.png and studs.png.

    python scripts/make_scene_pictures.py [FOLDER]

The sky is 64 × 32 pixels: blue above, brown below, and in it a sun of one pixel that gives more light than
all the rest together. The tiles are 32 × 32 pixels of 8 bits, each tile of another colour, so that what is
mirrored or upside down shows. Waves are 24 × 24 heights, the same either side of
their edges, and studs as many normals, of one hump.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from raycheck.base.images import write_exr, write_png

SUN, LIGHT = (9, 41), (900.0, 800.0, 600.0)


def sky() -> np.ndarray:
    """(32, 64, 3) W·sr⁻¹·m⁻²"""
    height = np.cos(np.pi * np.arange(32) / 31)[:, None, None]
    around = np.sin(2 * np.pi * (np.arange(64) + 0.5) / 64)[None, :, None]
    above = np.array([0.15, 0.3, 0.6]) + np.array([0.5, 0.4, 0.2]) * (1 - height) ** 4 * (1.2 + around)
    below = np.array([0.12, 0.09, 0.06]) * (1.2 + around)
    pixels = np.where(height > 0, above, below)
    pixels[SUN] = LIGHT
    return pixels


def tiles() -> np.ndarray:
    """(32, 32, 3) of 8 bits: 4 × 4 tiles with dark gaps."""
    row, column = np.indices((32, 32))
    i, j = row // 8, column // 8
    shade = np.stack([90 + 40 * i, 200 - 30 * j, 70 + 10 * (i + 3 * j)], axis=-1)
    gap = (row % 8 == 0) | (column % 8 == 0)
    return np.where(gap[:, :, None], 30, shade).astype(np.uint8)


def waves() -> np.ndarray:
    """(24, 24, 3) of 8 bits, grey."""
    y, x = 2 * np.pi * (np.indices((24, 24)) + 0.5) / 24
    height = 0.5 + 0.22 * np.sin(x) + 0.2 * np.cos(2 * y + np.sin(x))
    return np.repeat(np.round(255 * height)[:, :, None], 3, axis=2).astype(np.uint8)


def studs() -> np.ndarray:
    """(24, 24, 3) of 8 bits, (n + 1)/2 of normals n that lean outwards around the middle."""
    y, x = (np.indices((24, 24)) - 11.5) / 12
    steep = 1.6 * np.maximum(1 - np.hypot(x, y), 0)
    n = np.stack([steep * x, steep * y, np.ones_like(x)])
    n /= np.linalg.norm(n, axis=0)
    return np.round(255 * (n + 1) / 2).astype(np.uint8).transpose(1, 2, 0)


def main() -> None:
    root = Path(__file__).resolve().parent.parent
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else root / "scenes/pictures"
    folder.mkdir(parents=True, exist_ok=True)
    pixels = sky()
    write_exr(folder / "sky.exr", {name: pixels[:, :, i].astype(np.float32) for i, name in enumerate("RGB")})
    for name, drawn in (("tiles", tiles()), ("waves", waves()), ("studs", studs())):
        write_png(folder / f"{name}.png", drawn)


if __name__ == "__main__":
    main()
