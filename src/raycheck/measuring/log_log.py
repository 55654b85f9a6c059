"""Curves on logarithmic axes, as data that templates/report/plots.js draws with uPlot."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

Points = Sequence[tuple[float, float]]


def log_log(
    curves: Mapping[str, Points], x_label: str, y_label: str, plain: Collection[str] = ()
) -> dict[str, Any]:
    """The curves, each a line with markers of its own shape, so that they differ without colour as well;
    those that are `plain` are dashed and have none. Nothing of a curve without points is drawn.
    """
    return {
        "x": x_label, "y": y_label,
        "curves": [
            {
                "name": name, "colour": index, "plain": name in plain,
                "xs": [x for x, _ in points], "ys": [y for _, y in points],
            }
            for index, (name, points) in enumerate(curves.items()) if points
        ],
    }  # fmt: skip
