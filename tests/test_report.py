"""The report is one offline page, and its pictures are the right way up and the right brightness."""

import base64
import json
import re

import numpy as np
import pytest

from raycheck.base import pictures
from raycheck.base.images import decode_srgb, encode_srgb, load_image
from raycheck.measuring.report import write_report
from raycheck.scene import variants
from raycheck.truth import references

SCENES = ("lecture", "furnace", "point-light", "many-lights", "mirror-light", "mesh-light")


@pytest.fixture(scope="module")
def page(oneray, tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ONERAY", str(oneray))
        folder = tmp_path_factory.mktemp("report")
        verdicts = folder / "verdicts.json"
        case = {
            "scene": "point-light",
            "technique": "nee",
            "verdict": "FAIL",
            "reason": "<b>dark</b> & wrong",
        }
        figures = {
            "bias": -0.01,
            "bias_low": -0.02,
            "bias_high": 0.0,
            "mde_image": 0.001,
            "mde_tile_p90": 0.01,
        }
        header = {"mode": "quick", "date": "2024-01-01", "machine": "m", "totals": {"seconds": 1.0}}
        verdicts.write_text(json.dumps(header | {"cases": [case | figures]}))
        scenes = [variants.variant(name) for name in SCENES]
        return write_report(folder, verdicts, scenes=scenes).read_text(encoding="utf-8")


def decoded(page, folder):
    """Every picture of the page as (alt text, linear pixels)."""
    found = re.findall(r'<img src="data:image/png;base64,([^"]+)" alt="([^"]*)"', page)
    result = []
    for index, (data, text) in enumerate(found):
        path = folder / f"{index}.png"
        path.write_bytes(base64.b64decode(data))
        result.append((text, load_image(path).pixels))
    return result


def test_offline(page):
    assert not re.search(r"""(src|href)\s*=\s*["']?(https?:)?//""", page)
    assert "http" not in page and "@import" not in page and "fetch(" not in page
    assert len(page) < 10_000_000


def test_text_is_escaped(page):
    assert "&lt;b&gt;dark&lt;/b&gt; &amp; wrong" in page


def test_has_everything(page):
    for name in SCENES:
        assert f'id="{name}"' in page
    assert page.count("<img") == page.count("alt=") == 2 + 1 + 4 * len(SCENES)
    assert "raycheck verify" in page and "--spp 36" in page
    assert "prefers-color-scheme: dark" in page and "image-rendering: pixelated" in page
    assert 'class="verdict FAIL"' in page


def test_pictures_are_upright_and_as_bright_as_the_reference(page, tmp_path):
    shown = dict(decoded(page, tmp_path))
    for name in SCENES:
        mean = references.load_reference(name).best()[0]
        right = np.clip(mean * pictures.exposure(mean), 0, 1)
        for text, pixels in shown.items():
            if text.startswith(f"{name}, reference") or text.startswith(f"{name}, oneray, "):
                assert np.abs(pixels.mean() / right.mean() - 1) < 0.02, text
                assert np.abs(encode_srgb(pixels) - encode_srgb(right)).mean() < 0.03, text
                flipped = np.abs(encode_srgb(pixels[::-1]) - encode_srgb(right)).mean()
                assert name == "furnace" or flipped > 0.03, text


def test_the_lectures_pictures_have_the_same_mean(page, tmp_path):
    walk, nee = (pixels for text, pixels in decoded(page, tmp_path)[:2])
    assert "random walk" in page
    assert nee.std() < walk.std()


def test_error_map():
    """White where right, blue where dark, red where bright, and nothing is hidden where nothing varies."""
    reference, error = np.ones((1, 5, 3)), np.full((1, 5, 3), 0.1)
    error[0, 3:] = 0
    ours = reference + np.array([-0.4, 0.0, 0.4, 0.0, 0.1])[None, :, None] / np.sqrt(3)
    dark, right, bright, exact, off = pictures.error_map(ours, reference, error)[0].astype(int)
    assert dark[2] > dark[0] + 100 and bright[0] > bright[2] + 100
    assert right.min() > 240 and exact.min() > 240
    assert off[0] > off[2] + 100
    assert list(pictures.colour(np.array([-9.0, -4.0]))[0]) == list(pictures.colour(np.array([-4.0]))[0])


def test_display():
    pixels = pictures.display(np.full((1, 1, 3), 0.25), 2.0)
    assert decode_srgb(pixels / 255) == pytest.approx(0.5, abs=0.003)
