"""The README and the pages of docs/ show what was measured, and lead where they say."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from raycheck.base.images import load_image
from raycheck.base.text import number
from raycheck.measuring.race_plots import colours
from raycheck.measuring.races.curves import read

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

import make_plots  # noqa: E402
import readme  # noqa: E402

TEXTS = {page: page.read_text(encoding="utf-8") for page in readme.PAGES}
README = ROOT / "README.md"
ALL = [*readme.PAGES, ROOT / "scenes/README.md"]


@pytest.mark.parametrize("name", readme.TABLES)
def test_each_table_has_its_place(name: str) -> None:
    places = [place.group(2) for text in TEXTS.values() for place in readme.PLACE.finditer(text)]
    assert places.count(name) == 1


@pytest.mark.parametrize("page", TEXTS, ids=lambda page: page.name)
def test_the_tables_are_those_of_the_results(page: Path) -> None:
    assert readme.renewed(TEXTS[page], page.parent != ROOT) == TEXTS[page]


def test_the_techniques_are_where_it_says() -> None:
    """`file` `function`, `function`, … in the table of the lecture's techniques."""
    rows = re.findall(r"^\| L\d+.*? \| .* \| (`.*) \|$", TEXTS[ROOT / "docs/techniques.md"], re.MULTILINE)
    assert len(rows) > 10
    for row in rows:
        text = ""
        for name in re.findall("`(.*?)`", row):
            if "/" in name:
                text = (ROOT / "src/oneray" / name).read_text(encoding="utf-8")
            else:
                assert re.search(rf"^[A-Za-z].*\b{name}\(", text, re.MULTILINE), row


def test_old_tables_are_replaced() -> None:
    old = "a <!-- stability -->STALE<!-- /stability --> b <!-- prices: cornell-box -->STALE<!-- /prices --> c"
    new = readme.renewed(old)
    assert "STALE" not in new and "| tiny-disk | " in new and "| `nee` | " in new
    assert new.startswith("a <!-- stability -->\n| ") and new.endswith("\n<!-- /prices --> c")


def test_tables_of_a_page_below_lead_from_there() -> None:
    old = "<!-- harness --><!-- /harness -->"
    assert "](scripts/" in readme.renewed(old) and "](../scripts/" in readme.renewed(old, 1)


def anchors(page: Path) -> set[str]:
    """Of the headings, as GitHub makes them."""
    heads = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


@pytest.mark.parametrize("page", ALL, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_to_what_is_there(page: Path) -> None:
    targets = re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8"))
    for target in (one for one in targets if not one.startswith(("http:", "https:"))):
        name, _, anchor = target.partition("#")
        other = (page.parent / name).resolve() if name else page
        assert other.exists(), target
        assert not anchor or anchor in anchors(other), target


def test_the_readme_is_short_and_leads_to_every_page() -> None:
    """A screen for each reader; what is looked up stands in docs/."""
    text = TEXTS[README]
    assert text.count("\n") <= 200 and "\n\n".join(text.split("\n\n")[1:3]).count("\n") <= 10
    for page in (ROOT / "docs").glob("*.md"):
        assert f"](docs/{page.name}" in text, page.name
    readers = re.findall(r"^## You .*\n\n\*In .*minute.*\*$", text, re.MULTILINE)
    assert len(readers) == 4


def test_versions_agree() -> None:
    """Of the package, of what is cited, of the newest changes, and of oneray."""
    [version] = re.findall(r'^version = "(.*)"$', (ROOT / "pyproject.toml").read_text(), re.MULTILINE)
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert cited["version"] == version and cited["cff-version"] == "1.2.0" and cited["title"]
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.findall(r"^## (\S+)", changes, re.MULTILINE)[0] == version
    licence = (ROOT / "LICENSE").read_text(encoding="utf-8")
    assert all(name in licence for name in ("CIE", "uPlot", "Leon Sorokin", "pictures"))


@pytest.mark.parametrize("scene", sorted((ROOT / "docs/gallery").glob("*.xml")), ids=lambda one: one.stem)
def test_the_gallery_has_a_picture_of_each_scene(scene: Path, oneray: Path) -> None:
    """Of the size that the scene says, and the scene is right."""
    shown = load_image(ROOT / f"references/pictures/gallery-{scene.stem}.jpg").pixels
    assert shown.shape == (480, 640, 3) and f"docs/gallery/{scene.name}" in TEXTS[README]
    done = subprocess.run([oneray, scene, "--check"], capture_output=True, text=True, check=True)
    assert "no errors, 0 warnings" in done.stdout


def test_the_plots_of_slides_say_how_long(tmp_path: Path) -> None:
    """Words at the lines, as text that slides can search; the slope has its own."""
    scenes, _ = read(ROOT / "references/error_curves.json")
    found = next(one for one in scenes if one.scene == "cornell-box")
    make_plots.picture(found, tmp_path)
    drawn = (tmp_path / "error-cornell-box.svg").read_text(encoding="utf-8")
    assert (tmp_path / "error-cornell-box.png").stat().st_size > 10_000
    for one in found.curves:
        if one.name in colours(found):
            assert f">{one.name}<" in drawn and f">1 % in {number(one.seconds_to_target)} s<" in drawn
    assert ">slope −½<" in drawn


def test_the_pictures_are_small() -> None:
    names = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", TEXTS[README])
    assert len(names) >= 3
    assert sum((ROOT / name).stat().st_size for name in names) < 1.5e6
