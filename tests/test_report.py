"""The report is an index and offline pages that lead to each other, or one file; pictures are the right way
up and the right brightness.
"""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pytest
from test_report_page import BROWSERS, browser  # noqa: F401

from raycheck.base import pictures
from raycheck.base.data import references_dir
from raycheck.base.images import decode_srgb, encode_srgb, load_image
from raycheck.measuring.report import kept_races, write_report
from raycheck.scene import variants
from raycheck.scene.techniques import TECHNIQUES
from raycheck.truth import references

SCENES = ("lecture", "furnace", "point-light", "many-lights", "mirror-light", "mesh-light")
FIRST_BYTES = 300_000
"""What opening the report may load."""


@pytest.fixture(scope="module")
def folder(oneray, tmp_path_factory) -> Path:
    return made(oneray, tmp_path_factory.mktemp("report"))


@pytest.fixture(scope="module")
def single(oneray, tmp_path_factory) -> str:
    folder = made(oneray, tmp_path_factory.mktemp("single"), single=True)
    assert [path.name for path in folder.iterdir()] == ["index.html"]
    return (folder / "index.html").read_text(encoding="utf-8")


def made(oneray: Path, folder: Path, **how: bool) -> Path:
    verdicts = folder.parent / f"{folder.name}.json"
    case = {"scene": "point-light", "technique": "nee", "verdict": "FAIL", "reason": "<b>dark</b> & wrong"}
    figures = {"bias": -0.01, "bias_low": -0.02, "bias_high": 0.0, "mde_image": 0.001, "mde_tile_p90": 0.01}
    header = {"mode": "quick", "date": "2024-01-01", "machine": "m", "totals": {"seconds": 1.0}}
    other = case | {"technique": "walk-cosine", "verdict": "INCONCLUSIVE", "reason": "too noisy"}
    verdicts.write_text(json.dumps(header | {"cases": [case | figures, other]}))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ONERAY", str(oneray))
        wanted = [variants.variant(name) for name in SCENES]
        write_report(folder, verdicts, scenes=wanted, races=kept_races(), **how)
    return folder


def texts(folder: Path) -> Iterator[tuple[Path, str]]:
    for path in [folder / "index.html", *(folder / "pages").glob("*.html")]:
        yield path, path.read_text(encoding="utf-8")


def test_offline(folder, single):
    for text in [single, *(text for _, text in texts(folder))]:
        text = text.replace("https://github.com/leeoniya/uPlot", "")
        assert not re.search(r"""(src|href)\s*=\s*["']?(https?:)?//""", text)
        assert "http" not in text and "@import" not in text and "fetch(" not in text
    assert len(single) < 10_000_000
    assert "Leon Sorokin" in (folder / "assets/uPlot-LICENSE.txt").read_text(encoding="utf-8")


def test_text_is_escaped(folder):
    index = (folder / "index.html").read_text(encoding="utf-8")
    assert "&lt;b&gt;dark&lt;/b&gt; &amp; wrong" in index and "<b>dark" not in index


def test_every_link_leads_to_what_is_there(folder, single):
    ids = {path: set(re.findall(r'\bid="([^"]+)"', text)) for path, text in texts(folder)}
    for path, text in texts(folder):
        for target in re.findall(r'(?:href|src)="([^"]+)"', text):
            name, _, anchor = unquote(target).partition("#")
            other = (path.parent / name).resolve() if name else path
            assert other.is_file(), (path.name, target)
            assert not anchor or anchor in ids[other], (path.name, target)
    own = set(re.findall(r'\bid="([^"]+)"', single))
    wanted = {unquote(one) for one in re.findall(r'href="#([^"]+)"', single)}
    assert wanted - own == {f"scene-{name}" for name in variants.scene_names() if name not in SCENES} & wanted


def test_the_matrix_has_every_scene_in_the_ladders_order(folder):
    index = (folder / "index.html").read_text(encoding="utf-8")
    rows = re.findall(r'<tr data-find="([\w@=-]+) ', index)
    assert rows == list(SCENES)
    body = re.search(r'<table id="matrix">(.*?)</table>', index, re.DOTALL).group(1)
    assert body.count("<td") == len(SCENES) * len(TECHNIQUES)
    page = "pages/scene-point-light.html#scene-point-light.point-light.nee"
    assert f'<td class="FAIL"><a href="{page}"' in body


def test_blank_cells_are_explained(folder):
    index = (folder / "index.html").read_text(encoding="utf-8")
    signs = set(re.findall(r"<td>(.)</td>", index))
    told = dict(re.findall(r"<li><b>(\S)</b> ([^<]+)", index.split("<h3>No verdict")[1]))
    assert signs <= told.keys() and told["·"] == "it applies, and was not judged in this run"
    assert "there is only one light to choose" in told.values()


def test_each_verdict_has_its_command(folder):
    page = (folder / "pages/scene-point-light.html").read_text(encoding="utf-8")
    assert "<code>raycheck verify point-light --technique nee</code>" in page
    assert "oneray scenes/point-light.xml -o point-light.exr --spp 1024 --seed 1 --estimator nee" in page


def test_what_was_measured_elsewhere_says_so(folder):
    """Figures of the references name machine and day; what this run did, this machine."""
    index = (folder / "index.html").read_text(encoding="utf-8")
    kept = json.loads((references_dir() / "error_curves.json").read_text(encoding="utf-8"))
    for name in ("error_curves.json", "techniques.json", "stability.json", "benchmark.json"):
        found = json.loads((references_dir() / name).read_text(encoding="utf-8"))
        assert found["machine"] and found["date"], name
    assert kept["machine"]
    assert index.count('class="badge kept"') >= 3 and 'class="badge now">this machine: ' in index
    page = (folder / "pages/technique-nee.html").read_text(encoding="utf-8")
    assert re.search(r'What it costs <span class="badge kept">measured on .+, \d{4}-\d\d-\d\d</span>', page)
    page = (folder / "pages/scene-point-light.html").read_text(encoding="utf-8")
    assert re.search(r'Verdicts\s+<span class="badge now">this machine: m, 2024-01-01</span>', page)


def test_the_audit_has_a_page(folder):
    """All its checks, each once, and the counts that docs/audit.md has."""
    page = (folder / "pages/audit.html").read_text(encoding="utf-8")
    found = json.loads((references_dir() / "audit.json").read_text(encoding="utf-8"))["records"]
    assert all(page.count(f"<code>{record['id']}</code>") == 1 for record in found)
    cells = re.search(r'<th scope="row">Mitsuba [\d.]+</th>((?:<td>\d+</td>)+)', page)
    assert cells and sum(map(int, re.findall(r"\d+", cells[1]))) == sum(
        record["renderer"] == "Mitsuba" for record in found
    )


def test_inconclusive_is_explained_where_it_is_counted(folder):
    index = (folder / "index.html").read_text(encoding="utf-8")
    assert "1 INCONCLUSIVE</b>" in index and "Nothing is\nknown to be wrong" in index


def test_opening_it_loads_little(folder, browser):  # noqa: F811
    """And a search leaves what was looked for."""
    page, asked = browser.new_page(viewport={"width": 1400, "height": 900}), []
    page.on("request", lambda request: asked.append(request.url))
    page.goto((folder / "index.html").as_uri())
    files = [Path(unquote(url.removeprefix("file://"))) for url in asked]
    assert sum(file.stat().st_size for file in files) < FIRST_BYTES
    assert not any(file.parent.name == "data" for file in files)
    shown = page.locator(".gallery img, .large img")
    assert shown.count() == len(SCENES) + 2
    assert set(shown.evaluate_all("all => all.map(one => one.loading)")) == {"lazy"}
    rows = page.locator("#matrix tbody tr:visible th")
    page.locator("#find").fill("mirror")
    assert rows.all_inner_texts() == ["mirror-light"]
    page.locator("#find").fill("learned")
    assert page.locator("#matrix thead th:visible").all_inner_texts()[1:] == ["nee-learned", "mis-learned"]
    page.locator("#find").fill("")
    page.locator("#only").select_option("FAIL")
    assert rows.all_inner_texts() == ["point-light"]
    assert page.locator("#found").inner_text() == "1 scenes, 1 verdicts"
    page.close()


@pytest.mark.parametrize("most", [12])
def test_it_prints_on_few_sheets(folder, browser, most):  # noqa: F811
    page = browser.new_page()
    page.goto((folder / "index.html").as_uri())
    assert len(re.findall(rb"/Type\s*/Page\b", page.pdf(prefer_css_page_size=True))) <= most
    page.close()


def test_single_has_everything(single):
    for name in SCENES:
        assert f'id="scene-{name}"' in single
    assert 'id="technique-nee"' in single and 'id="speed"' in single and '["scene-furnace"] = ' in single
    assert single.count("<img") == single.count("alt=") > 3 * len(SCENES)
    assert "raycheck verify" in single and "--spp 36" in single
    assert "prefers-color-scheme: dark" in single and "image-rendering: pixelated" in single
    assert '<td class="verdict FAIL">' in single


def test_pictures_are_upright_and_as_bright_as_the_reference(folder):
    for name in SCENES:
        mean = references.load_reference(name).best()[0]
        right = np.clip(mean * pictures.exposure(mean), 0, 1)
        for what in ("reference", "oneray"):
            pixels = load_image(folder / f"pictures/{name}-{what}.png").pixels
            assert np.abs(pixels.mean() / right.mean() - 1) < 0.02, name
            assert np.abs(encode_srgb(pixels) - encode_srgb(right)).mean() < 0.03, name
            flipped = np.abs(encode_srgb(pixels[::-1]) - encode_srgb(right)).mean()
            assert name == "furnace" or flipped > 0.03, name


def test_the_lectures_pictures_have_the_same_mean(folder, single, tmp_path):
    files = (folder / f"pictures/lecture-{name}.png" for name in ("walk-cosine", "nee"))
    walk, nee = (load_image(file).pixels for file in files)
    assert nee.std() < walk.std()
    shown = r'<img src="data:image/png;base64,([^"]+)" alt="The scene lecture: random walk, '
    data = re.search(shown, single)
    (tmp_path / "walk.png").write_bytes(base64.b64decode(data.group(1)))
    assert np.array_equal(load_image(tmp_path / "walk.png").pixels, walk)


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
