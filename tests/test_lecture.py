"""The lecture's pages: oneray as WebAssembly has the bits of the program, its mistakes are those of the
catalogue, and the page works in a browser, from the disk.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from building import ROOT
from playwright.sync_api import Browser, Page, sync_playwright

from raycheck.calibration import mutants
from raycheck.calibration import payloads as mutant_payloads
from raycheck.renderers.films import payload
from raycheck.scene.techniques import technique

sys.path.insert(0, str(ROOT / "scripts"))

import lecture_switches
import make_lecture

SECTIONS = make_lecture.read_sections()
SIX = (
    ("cornell-box", "mis-power", "double"),
    ("many-lights", "nee-contribution", "single"),
    ("glass-ball", "walk-cosine", "auto"),
    ("smooth-mesh", "nee", "single"),
    ("occluded-lights", "mis-learned", "double"),
    ("area-light", "light", "single"),
)


def test_every_technique_of_the_lecture_has_its_section() -> None:
    assert [one.name for one in SECTIONS[:19]] == [f"L{n}" for n in range(1, 20)]


@pytest.mark.parametrize("section", SECTIONS, ids=lambda one: one.name)
def test_what_a_section_names_is_there(section: make_lecture.Section) -> None:
    """Functions, scenes, mistakes of which a switch can be made; and it has a drawing, a formula, a check."""
    catalogue = {one.name: one for one in mutants.catalogue()}
    for place in section.about["code"]:
        assert make_lecture.code_of(place)["html"].count("\n") >= 2
    for way in section.ways:
        assert (ROOT / f"scenes/{way['scene']}.xml").is_file()
        assert (ROOT / f"references/{way['reference']}.exr").is_file()
    for name, way in section.mistakes:
        assert way < len(section.ways)
        assert lecture_switches.changes(catalogue[name], 1, ROOT)
    assert section.about["check"] and "<svg" in section.text and "$$" in section.text
    assert 'class="measure"' in section.text


@pytest.mark.parametrize("command", sorted({line for one in SECTIONS for line in one.about["check"]}))
def test_the_checks_are_commands_that_there_are(command: str) -> None:
    words = command.split()
    if words[:2] != ["raycheck", "verify"] or "--renderer" in words:
        return
    for at, word in enumerate(words[2:], 2):
        if words[at - 1] == "--technique":
            technique(word)
        elif word != "--technique":
            assert (ROOT / f"references/{word}.exr").is_file()


def test_a_switch_is_made_of_whole_statements_only(tmp_path: Path) -> None:
    """A patch of a function's head, or of a part of a block, is refused rather than made into something
    else.
    """
    catalogue = {one.name: one for one in mutants.catalogue()}
    with pytest.raises(lecture_switches.PatchError, match="more than statements"):
        lecture_switches.changes(catalogue["disk-no-root"], 1, ROOT)
    pair = [catalogue["light-choice-careless"], catalogue["light-skipped-not-renormalised"]]
    with pytest.raises(lecture_switches.PatchError, match="each other's lines"):
        lecture_switches.copy_with_switches(ROOT, tmp_path, pair)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page; its build is kept in build/lecture, so that only what changed is compiled."""
    if lacking := make_lecture.lacking():
        pytest.skip(f"the lecture's page needs {lacking}: apt-get install {make_lecture.PACKAGES}")
    return make_lecture.make(ROOT / "build/lecture")


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    found = next((path for name in ("chromium", "google-chrome") if (path := shutil.which(name))), None)
    with sync_playwright() as playwright:
        one = playwright.chromium.launch(executable_path=found, args=["--no-sandbox"])
        yield one
        one.close()


@pytest.fixture(scope="module")
def opened(made: Path, browser: Browser) -> Iterator[tuple[Page, list[str]]]:
    """The page, and what it complained of or asked for beyond itself."""
    one = browser.new_page()
    said: list[str] = []
    one.on("console", lambda message: said.append(message.text))
    one.on("pageerror", lambda error: said.append(str(error)))
    one.on("request", lambda request: said.append(request.url))
    one.goto(made.as_uri())
    one.wait_for_selector("[data-head][data-done]", timeout=60_000)
    yield one, said
    one.close()


@pytest.fixture
def page(opened: tuple[Page, list[str]]) -> Page:
    return opened[0]


RENDER = """async ([scene, options, samples, mistake]) => {
    const done = await lecture.render(0, scene, options, 0, samples, 0, mistake);
    let text = "";
    for (const byte of done.film ?? []) text += String.fromCharCode(byte);
    return [done.status, done.errors, btoa(text)];
}"""


def film_of(page: Page, scene: str, options: list[str], samples: int = 5, mistake: int = 0) -> bytes:
    """A canonical scene by the page's worker."""
    for path in (ROOT / f"scenes/{scene}.xml", *(ROOT / "scenes/meshes").iterdir()):
        file = path.relative_to(ROOT / "scenes").as_posix()
        page.evaluate("([name, text]) => lecture.add(name, text)", [file, path.read_text(encoding="utf-8")])
    status, errors, film = page.evaluate(RENDER, [scene, options, samples, mistake])
    assert status == 0, errors
    return base64.b64decode(film)


@pytest.mark.parametrize(("scene", "name", "precision"), SIX)
def test_the_browser_renders_the_bits_of_the_program(
    page: Page, scene: str, name: str, precision: str
) -> None:
    """By its worker: the payloads that the program's own pictures have."""
    kept = json.loads((ROOT / "tests/payloads.json").read_text(encoding="utf-8"))
    film = film_of(page, scene, [*technique(name).options, "--precision", precision, "--width", "48"])
    assert payload(film) == kept[f"{scene} {name} {precision}"]


def test_other_techniques_have_other_bits(page: Page) -> None:
    both = [film_of(page, "cornell-box", [*technique(name).options]) for name in ("nee", "mis-power")]
    assert payload(both[0]) != payload(both[1])


def test_each_mistake_has_the_bits_of_its_patch(oneray: Path, page: Page, tmp_path: Path) -> None:
    catalogue, kept, wrong = {one.name: one for one in mutants.catalogue()}, mutant_payloads.kept(), []
    names = make_lecture.mistakes_of(make_lecture.read_sections())
    for number, name in enumerate(names, 1):
        scene, shows = mutant_payloads.where(catalogue[name])
        film = film_of(page, scene, [*technique(shows).options, "--precision", "double"], 4, number)
        (tmp_path / "film").write_bytes(film)
        subprocess.run([oneray, "merge", tmp_path / "film", "-o", tmp_path / "picture.pfm"], check=True)
        numbers = (tmp_path / "picture.pfm").read_bytes().split(b"\n", 3)[3]
        if hashlib.sha256(payload(film).encode() + numbers).hexdigest()[:16] != kept[name]:
            wrong.append(name)
    assert wrong == [] and len(names) > 30


def test_what_is_wrong_is_said(page: Page) -> None:
    text = '<scene version="3.0.0">\n<sensor type="perspective"></scene>'
    page.evaluate("text => lecture.add('broken.xml', text)", text)
    status, errors, _ = page.evaluate(RENDER, ["broken", [], 1, 0])
    assert status == 2 and errors == "broken.xml:2: XML error: mismatched tag (<sensor> of line 2 is open)\n"


def test_nothing_comes_from_elsewhere_and_nothing_complains(opened: tuple[Page, list[str]]) -> None:
    assert [line for line in opened[1] if not line.startswith(("file:", "blob:"))] == []
    assert sum(line.startswith("file:") for line in opened[1]) == 1


def test_the_page_is_small(made: Path) -> None:
    assert sum(path.stat().st_size for path in (made, *made.parent.glob("figures/*"))) < 3e6


def live(page: Page, name: str, act: str = "") -> str:
    """What a section says once it has rendered, after something is done to it."""
    box = page.locator(f"#{name} .live")
    box.scroll_into_view_if_needed()
    page.wait_for_selector(f"#{name} .live[data-done]", timeout=60_000)
    if act:
        before = box.get_attribute("data-done")
        page.evaluate(f"box => {{ {act} }}", box.element_handle())
        done = "([box, n]) => box.dataset.done !== n"
        page.wait_for_function(done, arg=[box.element_handle(), before], timeout=60_000)
    return box.locator(".sum").inner_text()


def test_two_ways_are_one_picture(page: Page) -> None:
    said = live(page, "L10")
    found = re.search(r"^Neither differs .* has ([\d.]+) times the variance", said)
    assert found and float(found[1]) < 0.5
    assert page.locator("#L10 .told").first.inner_text().startswith("the random walk: 64 samples in ")


def test_a_mistake_is_seen(page: Page) -> None:
    button = 'box.parentElement.querySelector("[data-mistake]").click()'
    assert re.search(r"^B is 9\d\s% too dark on average", live(page, "L1", button))
    assert re.search(r"^B is [\d.]+\s% too bright on average", live(page, "L10", button))


def test_another_seed_is_other_noise(page: Page) -> None:
    def picture() -> str:
        return page.locator("#L3 canvas.picture").last.evaluate("c => c.toDataURL()")

    change = "const s = box.querySelector('.seed'); s.value = {}; s.dispatchEvent(new Event('change'))"
    live(page, "L3")
    first = picture()
    live(page, "L3", change.format(7))
    assert picture() != first
    live(page, "L3", change.format(0))
    assert picture() == first


def test_a_section_is_projected_by_itself(page: Page) -> None:
    page.locator("#project").click()
    shown = "[...document.querySelectorAll('main > section')].filter(s => s.offsetHeight).map(s => s.id)"
    assert len(page.evaluate(shown)) == 1
    before = page.evaluate(shown)
    page.keyboard.press("ArrowRight")
    assert page.evaluate(shown) != before and len(page.evaluate(shown)) == 1
    page.keyboard.press("Escape")
    assert len(page.evaluate(shown)) == len(SECTIONS)


@pytest.mark.parametrize(("scheme", "width"), [("light", 390), ("dark", 1400)])
def test_nothing_stands_in_the_way_of_those_who_do_not_see(
    browser: Browser, made: Path, scheme: str, width: int
) -> None:
    """By axe-core, in a few sections, which are all made alike; and nothing is wider than a phone."""
    with closing(browser.new_page(color_scheme=scheme, viewport={"width": width, "height": 900})) as one:
        one.goto(made.as_uri())
        found = Axe().run(one, context={"include": ["header", "#L1", "#L18", "#P5"]}).response["violations"]
        severe = [(v["id"], v["nodes"][0]["html"]) for v in found if v["impact"] in ("serious", "critical")]
        assert severe == []
        assert one.evaluate("document.documentElement.scrollWidth") <= width
