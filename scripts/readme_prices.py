"""Put the table of references/techniques.json into the README, between the comments that name its scenes:
<!-- prices: SCENE ... --> and <!-- /prices -->.

    python scripts/readme_prices.py
"""

from __future__ import annotations

import re
from pathlib import Path

from raycheck import prices

ROOT = Path(__file__).resolve().parent.parent


def renewed(readme: str, found: list[prices.ScenePrices]) -> str:
    """The README with today's table."""
    by_name = {one.scene: one for one in found}

    def table(match: re.Match[str]) -> str:
        text = prices.markdown([by_name[name] for name in match.group(1).split()])
        return f"<!-- prices: {match.group(1)} -->\n{text}\n<!-- /prices -->"

    return re.sub(r"<!-- prices: (.*?) -->.*?<!-- /prices -->", table, readme, flags=re.DOTALL)


def main() -> None:
    readme = ROOT / "README.md"
    text = readme.read_text(encoding="utf-8")
    readme.write_text(renewed(text, prices.read(ROOT / "references" / "techniques.json")), encoding="utf-8")


if __name__ == "__main__":
    main()
