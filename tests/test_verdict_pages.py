"""After a verdict there is something to look at: the picture, the reference, where they differ, and commands
that go on from there.
"""

from __future__ import annotations

import html
import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import raycheck
from raycheck.base.images import load_image, write_pfm
from raycheck.base.site import Site
from raycheck.commands.app import app
from raycheck.judging.verdict_pages import Gallery, page_name
from raycheck.truth import references
from raycheck.truth.expected import truth_of

DARK = (slice(16, 24), slice(40, 48))
"""Rows and columns of the tile that is wrong."""


def codes(page: str) -> list[str]:
    return [html.unescape(one) for one in re.findall(r"<pre><code>(.*?)</code></pre>", page, re.DOTALL)]


def run(*words: str) -> str:
    """What a command prints, of any verdict."""
    done = CliRunner().invoke(app, list(words))
    assert done.exit_code in (0, 1, 3), done.output
    return done.output


@pytest.fixture(scope="module")
def dark(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, raycheck.Verification]:
    """Pages of a renderer one of whose tiles is a tenth too dark in one scene; in another it is right."""
    folder = tmp_path_factory.mktemp("pages")
    gallery = Gallery(Site(folder))

    def render(scene: Path, spp: int, seed: int) -> np.ndarray:
        mean = truth_of(references.load_reference(scene.stem)).mean.copy()
        if scene.stem == "area-light":
            mean[DARK] *= 0.9
        return mean * np.random.default_rng(seed).gamma(4 * spp, 1 / (4 * spp), (*mean.shape[:2], 1))

    result = raycheck.verify(
        render, ["area-light", "point-light"], spp=16, on_images=gallery.take,
        on_case=lambda case, _: gallery.add(case),
    )  # fmt: skip
    assert gallery.finish(result) == folder / "index.html"
    return folder, result


def test_a_fail_shows_the_tile(dark: tuple[Path, raycheck.Verification]) -> None:
    folder, result = dark
    case = result.cases[0]
    assert case.verdict == "FAIL" and case.tile is not None
    row, column, height, width = case.tile
    assert (row, column, height, width) == (16, 40, 8, 8) and "rows 16–23, columns 40–47" in case.reason
    page = (folder / "pages/area-light-renderer.html").read_text(encoding="utf-8")
    assert page.count('<i style="top:25.0%;left:62.5%;height:12.5%;width:12.5%">') == 3
    assert case.reason[1:] in html.unescape(page) and "rows 16–23, columns 40–47" in page
    assert "mine: the mean of 64 pictures" in page


def test_its_pictures_are_of_what_was_judged(dark: tuple[Path, raycheck.Verification]) -> None:
    """The tile is blue in the difference, and darker than in the reference."""
    mine, reference, error = (
        load_image(dark[0] / f"pictures/area-light-renderer-{what}.png").pixels
        for what in ("mine", "reference", "error")
    )
    blue, around = error[DARK][..., 2] - error[DARK][..., 0], error[..., 2] - error[..., 0]
    assert np.median(blue) > 0.3 and abs(np.median(around)) < 0.15
    assert mine[DARK].sum() / reference[DARK].sum() == pytest.approx(0.9, abs=0.02)


def test_a_pass_has_a_page_and_nothing_to_diagnose(dark: tuple[Path, raycheck.Verification]) -> None:
    folder, result = dark
    assert result.cases[1].verdict == "PASS"
    page = (folder / "pages/point-light-renderer.html").read_text(encoding="utf-8")
    assert "raycheck diagnose" not in page and "<i style" not in page
    assert codes(page) == ["raycheck verify point-light --spp 16"]
    index = (folder / "index.html").read_text(encoding="utf-8")
    assert index.index("area-light") < index.index("point-light")


def test_the_commands_do_what_they_say(oneray: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The one repeats the verdict to the digit, the other looks at the very pictures."""
    monkeypatch.setenv("ONERAY", str(oneray))
    cut = f"'{oneray}' {{scene}} -o {{output}} --spp {{spp}} --seed {{seed}} -Ddepth=2 --quiet"
    words = ["verify", "furnace", "--renderer", cut, "--seed", "5", "--spp", "4", "--delta", "0.02"]
    first, again = tmp_path / "first.json", tmp_path / "again.json"
    told = run(*words, "--json", str(first), "--html", str(tmp_path / "see"))
    assert f"{tmp_path / 'see/index.html'}: open it in a browser" in told
    page = (tmp_path / "see/pages/furnace-renderer.html").read_text(encoding="utf-8")
    diagnose, repeat = codes(page)
    assert shlex.split(repeat)[0] == "raycheck"
    run(*shlex.split(repeat)[1:], "--json", str(again))
    of = ("verdict", "reason", "bias", "bias_low", "mde_image", "p_tile", "spp", "tile")
    one, two = (json.loads(file.read_text())["cases"][0] for file in (first, again))
    assert {key: one[key] for key in of} == {key: two[key] for key in of} and one["verdict"] == "FAIL"
    expanded = [found for word in shlex.split(diagnose)[1:] for found in (matching(word) or [word])]
    assert sum(word.endswith(".exr") for word in expanded) == one["images"]
    assert "The indirect light is missing" in run(*expanded)


def matching(word: str) -> list[str]:
    path = Path(word)
    return sorted(map(str, path.parent.glob(path.name)))


def test_pictures_that_are_given_are_named(tmp_path: Path) -> None:
    mean = truth_of(references.load_reference("point-light")).mean
    for seed in range(8):
        noise = np.random.default_rng(seed).gamma(16, 1 / 16, (*mean.shape[:2], 1))
        write_pfm(tmp_path / f"mine-{seed}.pfm", 0.8 * mean * noise)
    run("verify", "point-light", "--images", str(tmp_path / "mine-*.pfm"), "--html", str(tmp_path / "see"))
    page = (tmp_path / "see/pages/point-light-images.html").read_text(encoding="utf-8")
    diagnose, repeat = codes(page)
    assert diagnose.split()[2] == str(tmp_path / "mine-0.pfm") and diagnose.count(".pfm") == 8
    assert shlex.split(repeat)[3:] == ["--images", str(tmp_path / "mine-*.pfm")]
    assert not (tmp_path / "see/images").exists()


def test_names_of_pages() -> None:
    assert page_name("furnace@depth=2", "nee") == "furnace@depth2-nee"
    assert page_name("/a/b/mine.xml", "renderer") == "mine-renderer"
