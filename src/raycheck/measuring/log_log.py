"""Curves on logarithmic axes as SVG that takes its colours from the page: class `curve0`, `curve1`, …"""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from html import escape

WIDTH, HEIGHT = 460, 320
LEFT, RIGHT, TOP, BOTTOM = 52, 12, 12, 42
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

Points = Sequence[tuple[float, float]]


def power_of_ten(exponent: int) -> str:
    """1, 10, 100, else 10ⁿ."""
    return str(10**exponent) if 0 <= exponent <= 3 else "10" + str(exponent).translate(SUPERSCRIPT)


def _range(values: Sequence[float]) -> tuple[int, int]:
    """Whole decades that hold all values."""
    low, high = math.floor(math.log10(min(values)) + 1e-9), math.ceil(math.log10(max(values)) - 1e-9)
    return low, max(high, low + 1)


def _ticks(low: int, high: int, most: int = 9) -> Iterator[int]:
    """Exponents to be marked: all, or of many every 2nd, 5th, 10th, 20th."""
    step = next(step for step in (1, 2, 5, 10, 20, 50, 100) if (high - low) / step < most)
    return (n for n in range(low, high + 1) if n % step == 0)


class Axes:
    """Logarithmic axes over whole decades: where points are, and the grid with its numbers."""

    def __init__(self, xs: Sequence[float], ys: Sequence[float]):
        self.x0, self.x1 = _range(xs)
        self.y0, self.y1 = _range(ys)

    def place(self, x: float, y: float) -> tuple[float, float]:
        across = (math.log10(x) - self.x0) / (self.x1 - self.x0) * (WIDTH - LEFT - RIGHT)
        down = (self.y1 - math.log10(y)) / (self.y1 - self.y0) * (HEIGHT - TOP - BOTTOM)
        return LEFT + across, TOP + down

    def begin(self, x_label: str, y_label: str, about: str) -> list[str]:
        """The opening tag and the axes."""
        said = escape(about)
        parts = [f'<svg class="plot" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{said}">']
        bottom, right = HEIGHT - BOTTOM, WIDTH - RIGHT
        for n in _ticks(self.x0, self.x1):
            x, _ = self.place(10.0**n, 10.0**self.y0)
            parts.append(f'<line class="grid" x1="{x:.1f}" y1="{TOP}" x2="{x:.1f}" y2="{bottom}"/>')
            parts.append(f'<text x="{x:.1f}" y="{bottom + 16}" text-anchor="middle">{power_of_ten(n)}</text>')
        for n in _ticks(self.y0, self.y1):
            _, y = self.place(10.0**self.x0, 10.0**n)
            parts.append(f'<line class="grid" x1="{LEFT}" y1="{y:.1f}" x2="{right}" y2="{y:.1f}"/>')
            parts.append(f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{power_of_ten(n)}</text>')
        middle = (LEFT + right) / 2
        parts.append(f'<text x="{middle}" y="{HEIGHT - 6}" text-anchor="middle">{escape(x_label)}</text>')
        parts.append(f'<text transform="translate(12 {(TOP + bottom) / 2}) rotate(-90)" text-anchor="middle">'
                     f"{escape(y_label)}</text>")  # fmt: skip
        return parts


def log_log(curves: Mapping[str, Points], x_label: str, y_label: str, plain: Collection[str] = ()) -> str:
    """The curves, each a line with markers of its own shape, so that they differ without colour as well;
    those that are `plain` are dashed and have none.
    """
    every = [point for points in curves.values() for point in points]
    if not every:
        return ""
    axes = Axes([x for x, _ in every], [y for _, y in every])
    parts = axes.begin(x_label, y_label, f"{y_label} over {x_label}: {', '.join(curves)}")
    for index, (name, points) in enumerate(curves.items()):
        places = [axes.place(x, y) for x, y in points]
        parts.append(curve(index, places, [] if name in plain else places))
    return "".join([*parts, "</svg>"])


def curve(index: int, places: Points, marked: Points) -> str:
    line = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
    marks = "".join(_marker(index, x, y) for x, y in marked)
    dashes = "" if marked else ' stroke-dasharray="6 4"'
    return f'<g class="curve{index}"><polyline points="{line}"{dashes}/>{marks}</g>'


def _marker(index: int, x: float, y: float) -> str:
    """A disk, a square, a triangle, and again."""
    if index % 3 == 0:
        return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5"/>'
    if index % 3 == 1:
        return f'<rect x="{x - 3.2:.1f}" y="{y - 3.2:.1f}" width="6.4" height="6.4"/>'
    return f'<path d="M{x:.1f} {y - 4.4:.1f}l4.4 7.4h-8.8z"/>'


def key(index: int, plain: bool = False) -> str:
    """The line and its marker alone, for a legend."""
    drawn = curve(index, [(0, 6), (24, 6)], [] if plain else [(12, 6)])
    return f'<svg class="plot key" viewBox="0 0 24 12" aria-hidden="true">{drawn}</svg>'
