"""Regions of an image: the whole of it and the tiles of a quad-tree, coarse where samples are skewed."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raycheck.base.arrays import Array

SMALLEST = 8
"""Side of the smallest tile, pixels."""
MAX_SKEWNESS = 0.4
"""Beyond this skewness of a batch's tile mean the corrected t gives too many false alarms."""


@dataclass(frozen=True)
class Tile:
    """A rectangle of pixels; rows count from the top."""

    row: int
    column: int
    height: int
    width: int

    @property
    def pixels(self) -> int:
        return self.height * self.width

    @property
    def window(self) -> tuple[slice, slice]:
        return slice(self.row, self.row + self.height), slice(self.column, self.column + self.width)


def quad_tree(
    height: int, width: int, skewness: Mapping[int, Array], spp: float, smallest: int = SMALLEST
) -> list[Tile]:
    """Tiles of a height × width image, `smallest` pixels wide and high at the finest.

    `skewness[size]` (rows, cols, 3) is the skewness of one-sample-per-pixel tile means, NaN where nothing
    varies; that of a batch of `spp` samples is 1/√spp of it. Four tiles become one wherever any of them is
    beyond `MAX_SKEWNESS`.
    """
    root = smallest
    while root < max(height, width):
        root *= 2

    def too_skewed(size: int, row: int, column: int) -> bool:
        table = skewness.get(size)
        if table is None or row // size >= table.shape[0] or column // size >= table.shape[1]:
            return False
        values = np.abs(table[row // size, column // size])
        return bool(np.any(values[np.isfinite(values)] > MAX_SKEWNESS * np.sqrt(spp)))

    def divide(size: int, row: int, column: int) -> tuple[list[Tile], bool]:
        """Tiles of a square, and whether all of them are tame enough to stand on their own."""
        if row >= height or column >= width:
            return [], True
        whole = Tile(row, column, min(size, height - row), min(size, width - column))
        tame = not too_skewed(size, row, column)
        if size > smallest:
            half = size // 2
            parts = [divide(half, row + dr, column + dc) for dr in (0, half) for dc in (0, half)]
            if all(good for _, good in parts):
                return [tile for tiles, _ in parts for tile in tiles], True
        return [whole], tame

    return divide(root, 0, 0)[0]


def grid(height: int, width: int, side: int = SMALLEST) -> list[Tile]:
    """Squares of `side` pixels, row by row, cut off at the rim."""
    return [
        Tile(row, column, min(side, height - row), min(side, width - column))
        for row in range(0, height, side)
        for column in range(0, width, side)
    ]


def tile_sums(images: Array, side: int) -> tuple[Array, Array]:
    """Sums (…, rows, cols, 3) of images (…, H, W, 3) over the squares of `grid`, and their sizes."""
    height, width = images.shape[-3:-1]
    rows, cols = np.arange(0, height, side), np.arange(0, width, side)
    sums = np.add.reduceat(np.add.reduceat(images, rows, axis=-3), cols, axis=-2)
    return sums, np.outer(np.diff(np.append(rows, height)), np.diff(np.append(cols, width)))


def tile_means(images: Array, side: int) -> Array:
    """Means (…, rows, cols, 3) of images (…, H, W, 3) over the squares of `grid`."""
    sums, pixels = tile_sums(images, side)
    return sums / pixels[..., None]


def in_squares(tile: Tile) -> Tile:
    """The squares of `grid` that a tile consists of, counted in squares."""
    row, column = tile.row // SMALLEST, tile.column // SMALLEST
    bottom, right = -(-(tile.row + tile.height) // SMALLEST), -(-(tile.column + tile.width) // SMALLEST)
    return Tile(row, column, bottom - row, right - column)


def means_of_sums(sums: Array, regions: list[Tile]) -> Array:
    """`region_means` of images of which only the sums (…, rows, cols, 3) over the smallest squares are known,
    of which the regions consist.
    """
    squares = [in_squares(region) for region in regions]
    share = np.array([[one.pixels / region.pixels] for one, region in zip(squares, regions, strict=True)])
    means: Array = region_means(sums, squares) * share
    return means


def region_means(images: NDArray[np.floating], regions: list[Tile]) -> Array:
    """Means of images (…, H, W, 3) over each region: (…, len(regions), 3), summed in double.

    Over the cells first that the edges of all regions divide the image into: most regions are one of them.
    """
    spans = np.array([(t.row, t.row + t.height, t.column, t.column + t.width) for t in regions])
    rows, columns = np.unique(spans[:, :2]), np.unique(spans[:, 2:])
    cells = _sums(_sums(images, rows, -3), columns, -2)
    spans[:, :2], spans[:, 2:] = np.searchsorted(rows, spans[:, :2]), np.searchsorted(columns, spans[:, 2:])
    means = cells[..., spans[:, 0], spans[:, 2], :]
    several = (spans[:, 1] - spans[:, 0] > 1) | (spans[:, 3] - spans[:, 2] > 1)
    for index in np.flatnonzero(several):
        top, bottom, left, right = spans[index]
        means[..., index, :] = cells[..., top:bottom, left:right, :].sum(axis=(-3, -2))
    return np.asarray(means / np.array([[t.pixels] for t in regions]))


def _sums(values: NDArray[np.floating], edges: NDArray[np.integer], axis: int) -> Array:
    """Along an axis, from each edge to the next; from the last to the end, if anything is left there."""
    return np.add.reduceat(values, edges[edges < values.shape[axis]], axis, dtype=np.float64)


def region_variances(variance_of_pixels: Array, regions: list[Tile]) -> Array:
    """Variance of region means (len(regions), 3) from that of pixels (H, W, 3), which must be independent."""
    return np.stack([variance_of_pixels[t.window].sum(axis=(0, 1)) / t.pixels**2 for t in regions])


def whole(height: int, width: int) -> Tile:
    return Tile(0, 0, height, width)


def place(tile: Tile, height: int, width: int) -> str:
    """Where a tile is, for people: "rows 16–23, columns 40–47 (upper right)"."""
    middle_row, middle_column = tile.row + tile.height / 2, tile.column + tile.width / 2
    vertical = "upper" if middle_row < height * 0.4 else "lower" if middle_row > height * 0.6 else ""
    horizontal = "left" if middle_column < width * 0.4 else "right" if middle_column > width * 0.6 else ""
    name = f"{vertical} {horizontal}".strip() or "middle"
    rows = f"rows {tile.row}–{tile.row + tile.height - 1}"
    return f"{rows}, columns {tile.column}–{tile.column + tile.width - 1} from the top left ({name})"
