"""What Python gives displays itself in Jupyter, by the methods that it looks for."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import raycheck
from raycheck.base.images import Image, load_image
from raycheck.stats.verdict import Outcome


def table(html: str) -> list[list[str]]:
    """The words of its cells; it is well-formed, so that no name and no reason can end a tag."""
    return [["".join(cell.itertext()) for cell in row] for row in ElementTree.fromstring(html)]


def test_verdicts_are_a_table() -> None:
    figures = {"bias": 0.5, "bias_low": 0.49, "bias_high": 0.51, "mde_image": 0.001}
    cases = [
        raycheck.Case("furnace", "nee", Outcome.PASS, "nothing differs", **figures),
        raycheck.Case("a & b", "renderer", Outcome.FAIL, "it said: “<script>alert(1)</script>”"),
        raycheck.Case("caustic", "renderer", Outcome.INCONCLUSIVE, "too noisy",
                      **figures | {"mde_image": None}),
        raycheck.Case("lens", "renderer", Outcome.SKIP, "unsupported: lenses"),
    ]  # fmt: skip
    html = raycheck.Verification(cases)._repr_html_()
    assert table(html) == [
        ["scene", "technique", "verdict", "bias", "99 %", "detectable", ""],
        ["furnace", "nee", "PASS", "+50 %", "+49 % … +51 %", "0.10 %", ""],
        ["a & b", "renderer", "FAIL", "", "", "", "it said: “<script>alert(1)</script>”"],
        ["caustic", "renderer", "INCONCLUSIVE", "+50 %", "+49 % … +51 %", "", "too noisy"],
        ["lens", "renderer", "SKIP", "", "", "", "unsupported: lenses"],
    ]
    assert "<script" not in html
    assert table(cases[1]._repr_html_())[1:] == [table(html)[2]]


@pytest.mark.parametrize(("height", "width", "scale"), [(64, 32, 4), (300, 100, 1), (1, 1, 256)])
def test_a_picture_is_a_png(height: int, width: int, scale: int, tmp_path: Path) -> None:
    """Enlarged by whole pixels, row 0 on top, exposed so that most of it is below white; NaN is black."""
    pixels = np.full((height, width, 3), 100.0)
    pixels[0, 0] = np.nan if height > 1 else 100.0
    (tmp_path / "shown.png").write_bytes(Image(pixels)._repr_png_())
    shown = load_image(tmp_path / "shown.png").pixels
    assert shown.shape == (height * scale, width * scale, 3)
    assert shown[-1, -1] == pytest.approx([0.6] * 3, abs=0.01)
    corner = shown[:scale, :scale]
    assert np.all(corner == 0) == (height > 1) and np.count_nonzero(shown == 0) in (0, 3 * scale**2)
