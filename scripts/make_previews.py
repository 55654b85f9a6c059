"""Pictures of the report's page for the README, taken in Chromium: references/pictures/error-SCENE.png.

python scripts/make_previews.py REPORT/index.html [SCENE ...]
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

from raycheck.base import data

SCENES = ("cornell-box", "spherical-light")
WIDTH = 1100


def main() -> None:
    if len(sys.argv) < 2 or not Path(sys.argv[1]).is_file():
        sys.exit("make_previews: python scripts/make_previews.py REPORT/index.html [SCENE ...]")
    page_file, scenes = Path(sys.argv[1]).resolve(), sys.argv[2:] or SCENES
    folder = data.references_dir() / "pictures"
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": WIDTH, "height": 900})
        page.goto(page_file.as_uri())
        for scene in scenes:
            section = page.locator(f"#{scene} .curves")
            box, bars = section.locator("div.metric").first.bounding_box(), section.locator("figure.bars")
            below = bars.bounding_box()
            if box is None or below is None:
                sys.exit(f"make_previews: {page_file} has no error curves of {scene}")
            section.locator("div.metric").first.screenshot(path=folder / f"error-{scene}.png")
            bars.screenshot(path=folder / f"efficiency-{scene}.png")
        browser.close()


if __name__ == "__main__":
    main()
