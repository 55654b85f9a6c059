"""A scene's page of the report in a real browser: every control is used, and nothing complains.

The page is that of a race of oneray, Mitsuba, a renderer that is wrong on purpose and one that cannot run.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Locator, Page, sync_playwright

from raycheck.base.images import decode_srgb
from raycheck.measuring import race_plots

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
SIZE = 32
"""Width and height of the scene furnace."""


@pytest.fixture(scope="module")
def made(oneray: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The page's file, and what the command said."""
    folder = tmp_path_factory.mktemp("page")
    verdicts = folder / "verdicts.json"
    header = {"mode": "quick", "date": "2024-01-01", "machine": "m", "totals": {"seconds": 1.0}}
    verdicts.write_text(json.dumps(header | {"cases": []}))
    cut = f'direct only="{oneray}" {{scene}} -o {{output}} --spp {{spp}} --seed {{seed}} -Ddepth=2 --quiet'
    words = ["furnace", "--technique", "mis-default", "--technique", "walk-cosine", "--against", "mitsuba"]
    words += ["--renderer", cut, "--renderer", "broken=false {output} {spp} {seed}", "--rounds", "10"]
    words += ["--seconds", "0.01", "-o", str(folder), "--verification", str(verdicts)]
    words += ["--json", str(folder / "curves.json")]
    done = subprocess.run(
        [sys.executable, "-m", "raycheck", "report", *words], capture_output=True, text=True, check=False,
        env={"ONERAY": str(oneray), **os.environ},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return folder / "pages/scene-furnace.html", done.stdout


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """The system's Chromium, else the one that Playwright installed."""
    found = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    with sync_playwright() as playwright:
        one = playwright.chromium.launch(executable_path=found, args=["--no-sandbox"])
        yield one
        one.close()


@pytest.fixture(scope="module")
def opened(made: tuple[Path, str], browser: Browser) -> tuple[Page, list[str]]:
    """The page, and what it wrote to the console or asked for beyond its own file."""
    one = browser.new_page()
    said: list[str] = []
    one.on("console", lambda message: said.append(message.text))
    one.on("pageerror", lambda error: said.append(str(error)))
    one.on("request", lambda request: said.append(request.url))
    one.goto(made[0].as_uri())
    return one, said


@pytest.fixture
def page(opened: tuple[Page, list[str]], made: tuple[Path, str]) -> Iterator[Page]:
    """The page with every control as at first; a test may not make it complain."""
    one, said = opened
    one.set_viewport_size({"width": 1200, "height": 900})
    one.emulate_media(media="screen", color_scheme="light")
    one.evaluate("""() => {
        for (const e of document.querySelectorAll("select")) {
            const first = [...e.options].findIndex((o) => o.defaultSelected);
            e.selectedIndex = e.className === "b" ? 1 : Math.max(0, first);
            e.dispatchEvent(new Event("input"));
        }
        for (const e of document.querySelectorAll("input")) {
            e.value = e.defaultValue;
            e.dispatchEvent(new Event("input"));
        }
    }""")
    yield one
    folder = made[0].parents[1].as_uri()
    assert [x for x in said if not x.startswith((folder, "data:"))] == []


def pixels(canvas: Locator) -> list[int]:
    """Read from a copy, since Chromium warns of canvases that are read often."""
    return canvas.evaluate("""c => {
        const copy = Object.assign(document.createElement("canvas"), { width: c.width, height: c.height });
        const context = copy.getContext("2d", { willReadFrequently: true });
        context.drawImage(c, 0, 0);
        return [...context.getImageData(0, 0, c.width, c.height).data].filter((_, i) => i % 4 < 3);
    }""")


def main(page: Page, kind: str = "samples") -> Locator:
    return page.locator(f".view[data-kind={kind}] canvas.main")


def test_the_command_names_who_is_wrong_and_who_cannot_run(made: tuple[Path, str], page: Page) -> None:
    assert re.search("furnace, direct only: bias: the indirect light is missing", made[1])
    assert "direct only" in page.locator(".curves p", has=page.locator(".FAIL")).first.inner_text()
    index = (made[0].parents[1] / "index.html").read_text(encoding="utf-8")
    assert '#scene-furnace.error">furnace</a>, direct only: <b class="FAIL">bias</b>' in index
    broken = page.locator(".curves tr", has_text="broken").first
    assert "failed: exit status 1" in broken.inner_text()
    rows = page.locator(".curves tbody tr").all_inner_texts()
    names = ["mis-default", "walk-cosine", "mitsuba scalar", "direct only", "broken"]
    assert [name for name in names if any(name in row for row in rows)] == names
    curves = json.loads((made[0].parents[1] / "curves.json").read_text())
    assert curves["machine"] and "--against mitsuba" in curves["command"]


def test_flipping_shows_one_picture_after_the_other(page: Page) -> None:
    page.locator(".by").select_option("flip")
    reference = pixels(main(page))
    page.locator("button.flip").click()
    ours = pixels(main(page))
    assert ours != reference
    assert sum(ours) == pytest.approx(sum(reference), rel=0.02)
    main(page).focus()
    page.keyboard.press("Space")
    assert pixels(main(page)) == reference
    page.locator(".b").select_option("direct only")
    page.locator("button.flip").click()
    assert sum(pixels(main(page))) < 0.9 * sum(reference)
    assert main(page).get_attribute("aria-label") == "furnace, direct only"
    page.locator("button.flip").click()


def test_the_slider_divides_two_pictures(page: Page) -> None:
    def at(percent: int) -> list[int]:
        slider = page.locator(".view[data-kind=samples] .split")
        slider.fill(str(percent))
        return pixels(main(page))

    right, left, both = at(0), at(100), at(50)
    for row in range(SIZE):
        start, middle, end = (3 * (row * SIZE + x) for x in (0, SIZE // 2, SIZE))
        assert both[start:middle] == left[start:middle] and both[middle:end] == right[middle:end]
    assert left != right
    slider = page.locator(".view[data-kind=time] .split")
    slider.focus()
    page.keyboard.press("ArrowRight")
    assert slider.input_value() == "51"


def test_exposure(page: Page) -> None:
    before = sum(pixels(main(page)))
    page.locator(".exposure").fill("-2")
    assert sum(pixels(main(page))) < 0.7 * before
    assert page.locator("output").inner_text() == "−2 stops"


def test_signed_errors_have_a_scale(page: Page) -> None:
    """Direct light alone is too dark: blue. The reference is without error: white. A wider scale is paler."""
    page.locator(".b").select_option("direct only")
    page.locator(".what").select_option("error")
    page.locator(".view[data-kind=samples] .split").fill("50")
    shown = pixels(main(page))
    middle = 3 * SIZE * (SIZE // 2)
    assert shown[middle : middle + 3] == [247, 247, 247]
    blue = shown[middle + 3 * (SIZE // 2) : middle + 3 * (SIZE // 2) + 3]
    assert blue[2] > blue[0] + 50
    assert page.locator(".legend .low").first.inner_text() == "−30 % of the mean"
    page.locator("select.range").select_option("1")
    assert page.locator(".legend .high").first.inner_text() == "+100 %"
    paler = pixels(main(page))[middle + 3 * (SIZE // 2) : middle + 3 * (SIZE // 2) + 3]
    assert paler[0] > blue[0]


def test_crops_show_four_times_the_size(page: Page) -> None:
    """A crop is half as wide as the picture and shows an eighth of it."""
    view = page.locator(".view[data-kind=time]")
    crop, whole = view.locator("canvas.crop").first, view.locator("canvas.main")
    assert crop.evaluate("c => c.width") == SIZE // 8
    assert crop.bounding_box()["width"] == pytest.approx(whole.bounding_box()["width"] / 2, abs=3)
    view.locator(".split").fill("100")
    whole.click(position={"x": 3, "y": 3})
    assert pixels(crop)[:12] == pixels(whole)[:12]
    assert "rows 0 to 3, columns 0 to 3" in crop.get_attribute("aria-label")
    whole.focus()
    for key in ("ArrowRight", "ArrowDown", "ArrowDown", "ArrowDown", "ArrowRight", "ArrowRight", "ArrowUp"):
        page.keyboard.press(key)
    assert "rows 0 to 3, columns 1 to 4" in crop.get_attribute("aria-label")
    assert pixels(crop)[:12] == pixels(whole)[3:15]


def test_equal_samples_beside_equal_time(page: Page) -> None:
    page.locator(".b").select_option("mitsuba scalar")
    samples, times = page.locator(".view .about").all_inner_texts()
    spp = [int(re.search(r"([\d,]+) spp", text).group(1).replace(",", "")) for text in (samples, times)]
    assert spp[0] == 32 and spp[1] != 32
    assert "mi.set_variant('scalar_rgb')" in samples and f"spp={spp[1]}" in times


def drawn(page: Page) -> list[list[int]]:
    """The pixels of both plots."""
    return [pixels(one) for one in page.locator("figure.plot canvas").all()]


def test_every_metric_has_its_plots(page: Page) -> None:
    choice = page.locator("select.metric")
    metrics = [*race_plots.METRICS, "bias and standard deviation"]
    assert choice.locator("option").all_inner_texts() == metrics
    seen = []
    for metric in metrics:
        choice.select_option(metric)
        assert page.locator("figure.plot canvas").count() == 2
        found = drawn(page)
        assert found not in seen and all(len(set(zip(*[iter(one)] * 3, strict=True))) > 20 for one in found)
        seen.append(found)
    label = page.locator("figure.plot").first.get_attribute("aria-label")
    assert "over process time" in label and "in the table" in label


def test_the_axes_fit_the_data(page: Page) -> None:
    """What is drawn in a curve's colour reaches over most of the plot, both ways."""
    spans = page.evaluate("""() => [...document.querySelectorAll("figure.plot")].map(box => {
        const { min, max } = box.plot.scales.x, y = box.plot.scales.y, all = box.plot.data;
        const ys = all.slice(1).flat().filter(v => v);
        const share = (values, low, high) =>
            Math.log(Math.max(...values) / Math.min(...values)) / Math.log(high / low);
        return [share(all[0], min, max), share(ys, y.min, y.max)];
    })""")
    assert all(across > 0.8 for across, _ in spans) and all(down > 0.6 for _, down in spans)


def test_a_curve_says_how_long_it_takes_to_one_percent(page: Page) -> None:
    """Under the pointer, and in the table."""
    box = page.locator("figure.plot").first
    box.scroll_into_view_if_needed()
    left, top = box.evaluate("""box => {
        const u = box.plot, one = box.getBoundingClientRect(), over = u.over.getBoundingClientRect();
        const k = u.series.findIndex(s => s.label === "walk-cosine"), i = u.data[k].findIndex(v => v);
        return [over.left + u.valToPos(u.data[0][i], "x"), over.top + u.valToPos(u.data[k][i], "y")];
    }""")
    page.mouse.move(left, top)
    told = box.locator(".told").inner_text()
    assert told.startswith("walk-cosine: 1 % after ") and re.search(r"[\d.]+ % at [\d.]+ (µs|ms|s)", told)
    seconds = re.search(r"after ([\d.,]+) s", told).group(1)
    row = page.locator(".curves tbody tr", has_text="walk-cosine").first
    assert seconds in row.locator("td").all_inner_texts()
    page.mouse.move(0, 0)
    assert box.locator(".told").is_hidden()


def test_choosing_brings_a_curve_out(page: Page) -> None:
    width = "name => document.querySelector('figure.plot').plot.series.find(s => s.label === name).width"
    before = drawn(page)
    chosen = page.locator("button.choose", has_text="direct only")
    chosen.focus()
    page.keyboard.press("Enter")
    assert chosen.get_attribute("aria-pressed") == "true"
    assert page.evaluate(width, "direct only") > page.evaluate(width, "mis-default") and drawn(page) != before
    chosen.click()
    assert page.evaluate(width, "direct only") == page.evaluate(width, "mis-default")


def test_tables_sort(page: Page) -> None:
    """By every column, up and down; numbers as numbers."""
    table = page.locator(".curves table.sortable")
    heads = table.locator("thead th button")
    for index in range(heads.count()):
        for order in ("ascending", "descending"):
            heads.nth(index).click()
            assert table.locator("thead th").nth(index).get_attribute("aria-sort") == order
    heads.nth(heads.all_inner_texts().index("ms per sample")).click()
    cells = table.locator("tbody tr td:nth-child(9)").all_inner_texts()
    costs = [float(cell.replace(",", "")) for cell in cells]
    assert costs == sorted(costs) and len(costs) == 5
    heads.first.click()
    names = table.locator("button.choose").all_inner_texts()
    assert names == sorted(names)


def test_commands_reproduce(page: Page) -> None:
    page.locator(".curves details summary").click()
    assert "oneray scenes/furnace.xml -o furnace.exr" in page.locator(".curves details").inner_text()
    assert "raycheck report furnace --technique" in page.locator(".curves > p code").inner_text()


def test_on_a_phone_nothing_is_cut_off(page: Page) -> None:
    page.set_viewport_size({"width": 360, "height": 740})
    assert page.evaluate("document.documentElement.scrollWidth") <= 360


def test_plots_that_are_still_as_wide_as_before_do_not_widen_a_phone(
    made: tuple[Path, str], browser: Browser
) -> None:
    """Between a change of the window's size and the drawing anew they are; here it never comes."""
    with closing(browser.new_page(viewport={"width": 1200, "height": 900})) as one:
        one.add_init_script("addEventListener('resize', (e) => e.stopImmediatePropagation())")
        one.goto(made[0].as_uri())
        one.set_viewport_size({"width": 360, "height": 740})
        widths = "[...document.querySelectorAll('.plot canvas')].map((c) => c.clientWidth)"
        assert max(one.evaluate(widths)) > 360
        assert one.evaluate("document.documentElement.scrollWidth") <= 360


def test_printing_leaves_the_controls_out(page: Page) -> None:
    page.emulate_media(media="print")
    assert page.locator(".controls:visible").count() == 0
    assert main(page).is_visible() and len(page.pdf()) > 10_000


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_stands_out(page: Page, scheme: str) -> None:
    """Every colour of text has the contrast 4.5 that WCAG 2.1 asks for, against page and panel."""
    page.emulate_media(color_scheme=scheme)
    names = ("ink", "faint", "line-blue", "violet", "teal", "good", "bad", "open")
    read = "n => getComputedStyle(document.documentElement).getPropertyValue('--' + n).trim()"

    def luminance(name: str) -> float:
        code = page.evaluate(read, name).removeprefix("#")
        return float(decode_srgb(np.array(list(bytes.fromhex(code))) / 255) @ (0.2126, 0.7152, 0.0722))

    for name in names:
        for ground in ("page", "panel"):
            low, high = sorted((luminance(name), luminance(ground)))
            assert (high + 0.05) / (low + 0.05) >= 4.5, (name, ground)


SEVERE = ("serious", "critical")


@pytest.fixture(scope="module")
def pages(made: tuple[Path, str]) -> list[Path]:
    """One of each kind."""
    folder = made[0].parents[1]
    names = ("scene-furnace", "technique-nee", "speed", "stability", "audit")
    return [folder / "index.html", *(folder / f"pages/{name}.html" for name in names)]


@pytest.mark.sample(1)
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_nothing_stands_in_the_way_of_those_who_do_not_see(
    browser: Browser, pages: list[Path], scheme: str
) -> None:
    """By axe-core, at both widths."""
    for width in (390, 1400):
        with closing(browser.new_page(color_scheme=scheme, viewport={"width": width, "height": 900})) as one:
            for page in pages:
                one.goto(page.as_uri())
                found = Axe().run(one).response["violations"]
                severe = [(v["id"], v["nodes"][0]["html"]) for v in found if v["impact"] in SEVERE]
                assert severe == [], page.name


def test_every_page_fits_a_phone_and_asks_for_nothing_elsewhere(browser: Browser, pages: list[Path]) -> None:
    with closing(browser.new_page(viewport={"width": 390, "height": 740})) as one:
        asked: list[str] = []
        one.on("request", lambda request: asked.append(request.url))
        for page in pages:
            one.goto(page.as_uri())
            assert one.evaluate("document.documentElement.scrollWidth") <= 390, page.name
        assert asked and {url.partition(":")[0] for url in asked} <= {"file", "data"}


def test_the_first_column_stays(page: Page) -> None:
    page.set_viewport_size({"width": 390, "height": 740})
    table = page.locator(".curves .wide").first
    table.evaluate("box => box.scrollLeft = 200")
    assert table.locator("tbody th").first.bounding_box()["x"] < 40


def test_every_page_prints_on_few_sheets(browser: Browser, pages: list[Path]) -> None:
    """At most a dozen each, by the style's own size of a sheet, and no plot is wider than its place."""
    with closing(browser.new_page()) as one:
        for page in pages:
            one.goto(page.as_uri())
            printed = one.pdf(prefer_css_page_size=True)
            assert len(re.findall(rb"/Type\s*/Page\b(?!s)", printed)) <= 12, page.name
            one.emulate_media(media="print")
            over = "box => box.querySelector('canvas')?.clientWidth > box.clientWidth + 1"
            assert not any(plot.evaluate(over) for plot in one.locator(".plot").all()), page.name
