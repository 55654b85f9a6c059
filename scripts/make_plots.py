"""Draws error against run time from references/error_curves.json, for the README and for slides:
references/pictures/error-SCENE.png and .svg.

    python scripts/make_plots.py [SCENE ...]
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, NullFormatter

from raycheck.base import data
from raycheck.base.text import number
from raycheck.measuring.race_plots import colours
from raycheck.measuring.races.curves import Curve, SceneCurves, read

SCENES = ("occluded-lights", "spherical-light", "mirror-light", "cornell-box", "caustic", "thousand-lights")
STYLES = (("#7a5600", "o"), ("#b3171f", "s"), ("#1c5fa8", "^"), ("#7a3fa0", "D"), ("#0b6e6e", "P"))
"""Colour and marker: each tells a curve by itself."""
TARGET = 0.01


def seconds(value: float, _: int = 0) -> str:
    return f"{1e3 * value:g} ms" if value < 1 else f"{value:g} s"


def share(value: float, _: int = 0) -> str:
    return f"{100 * value:g} %"


def word(one: Curve) -> str:
    """What stands at a line."""
    told = f"\n1 % in {number(one.seconds_to_target)} s" if one.seconds_to_target else ""
    return f"{one.name}{told}"


def spread(wanted: list[float], gap: float) -> list[float]:
    """Places, in points, as near to the wanted ones as the gap between them allows."""
    placed = dict.fromkeys(range(len(wanted)), 0.0)
    last = -float("inf")
    for index in sorted(placed, key=wanted.__getitem__):
        placed[index] = last = max(wanted[index], last + gap)
    shift = sum(placed.values()) / len(wanted) - sum(wanted) / len(wanted)
    return [placed[index] - shift for index in range(len(wanted))]


def draw(axes: Axes, scene: SceneCurves) -> None:
    chosen = colours(scene)
    named: list[tuple[Curve, float, float, str]] = []
    for one in scene.curves:
        if not one.levels:
            continue
        xs = [one.seconds(level.spp) for level in one.levels]
        ys = [level.rmse.value / scene.mean for level in one.levels]
        if one.name not in chosen:
            axes.plot(xs, ys, color="#b9bec3", linewidth=0.8, zorder=1)
            continue
        colour, marker = STYLES[chosen[one.name]]
        axes.plot(xs, ys, color=colour, marker=marker, markersize=4, linewidth=1.5, zorder=3)
        named.append((one, xs[-1], ys[-1], colour))
    axes.set(xscale="log", yscale="log", xlabel="process time", ylabel="RMSE over the mean")
    axes.margins(0.04)
    low, high = axes.get_ylim()
    if low / 3 < TARGET < high:
        axes.axhline(TARGET, color="#5f646b", linewidth=0.8)
    if scene.floor and low / 3 < scene.floor / scene.mean < high:
        axes.axhline(scene.floor / scene.mean, color="#5f646b", linewidth=0.8, linestyle=":")
    for axis, text in ((axes.xaxis, seconds), (axes.yaxis, share)):
        axis.set_major_formatter(FuncFormatter(text))
        axis.set_minor_formatter(NullFormatter())
    axes.grid(color="#e3e5e7", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    slope(axes)
    words(axes, named)


def slope(axes: Axes) -> None:
    """A short line of slope −½ in the corner that falling curves leave empty."""
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    left, right, bottom = x0 * (x1 / x0) ** 0.06, x0 * (x1 / x0) ** 0.26, y0 * (y1 / y0) ** 0.06
    fall, grey = (right / left) ** 0.5, "#5f646b"
    axes.plot([left, right], [bottom * fall, bottom], color=grey, dashes=(4, 3), linewidth=1)
    middle = ((left * right) ** 0.5, bottom * fall**0.5)
    axes.annotate("slope −½", middle, (8, 3), color=grey, textcoords="offset points", fontsize=8)
    axes.set(xlim=(x0, x1), ylim=(y0, y1))


def words(axes: Axes, named: list[tuple[Curve, float, float, str]]) -> None:
    """Beside the plot, at the height of the curves' ends as far as there is room, joined to them."""
    to_points = 72 / axes.figure.dpi
    heights = [axes.transData.transform((x, y))[1] * to_points for _, x, y, _ in named]
    right = axes.transAxes.transform((1, 0))[0] * to_points
    for (one, x, y, colour), place in zip(named, spread(heights, 25.0), strict=True):
        at = axes.transData.transform((x, y)) * to_points
        axes.annotate(
            word(one), (x, y), (right + 10 - at[0], place - at[1]), textcoords="offset points", color=colour,
            fontsize=8.5, va="center",
            arrowprops={"arrowstyle": "-", "color": colour, "linewidth": 0.6, "linestyle": ":"},
        )  # fmt: skip


def picture(scene: SceneCurves, folder: Path) -> None:
    mpl.rcParams |= {"font.size": 9, "svg.fonttype": "none", "svg.hashsalt": scene.scene}
    figure, axes = plt.subplots(figsize=(7.4, 4.2), dpi=120)
    figure.subplots_adjust(left=0.1, right=0.78, top=0.94, bottom=0.13)
    axes.set_title(scene.scene, fontsize=10, loc="left")
    draw(axes, scene)
    for suffix, more in (("png", {"Software": None}), ("svg", {"Date": None})):
        figure.savefig(folder / f"error-{scene.scene}.{suffix}", metadata=more)
    plt.close(figure)


def main() -> None:
    scenes, _ = read(data.references_dir() / "error_curves.json")
    for scene in scenes:
        if scene.scene in (sys.argv[1:] or SCENES):
            picture(scene, data.references_dir() / "pictures")


if __name__ == "__main__":
    main()
