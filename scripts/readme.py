"""Put the measured tables of references/*.json into the README, each between its comments, <!-- NAME --> and
<!-- /NAME -->; <!-- prices: SCENE ... --> says which scenes.

    python scripts/readme.py
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from raycheck import prices, speed, stability
from raycheck.calibration import table
from raycheck.renderers import NotFound

ROOT = Path(__file__).resolve().parent.parent
README, REFERENCES = ROOT / "README.md", ROOT / "references"


def _prices(scenes: Sequence[str]) -> str:
    found = {one.scene: one for one in prices.read(REFERENCES / "techniques.json")}
    return prices.markdown([found[name] for name in scenes])


def _calibration(words: Sequence[str]) -> str:
    return table.markdown(json.loads((REFERENCES / "calibration.json").read_text(encoding="utf-8")))


def _stability(words: Sequence[str]) -> str:
    return stability.markdown(stability.read(REFERENCES / "stability.json")[0])


def _benchmark(words: Sequence[str]) -> str:
    return speed.markdown(speed.read(REFERENCES / "benchmark.json"))


TABLES: dict[str, Callable[[Sequence[str]], str]] = {
    "calibration": _calibration,
    "prices": _prices,
    "stability": _stability,
    "benchmark": _benchmark,
}
PLACE = re.compile(rf"(<!-- ({'|'.join(TABLES)})(?:: (.*?))? -->).*?(<!-- /\2 -->)", re.DOTALL)


def renewed(readme: str) -> str:
    """The README with today's tables; NotFound where a result is not there."""

    def filled(place: re.Match[str]) -> str:
        first, name, words, last = place.groups()
        return f"{first}\n{TABLES[name]((words or '').split())}\n{last}"

    return PLACE.sub(filled, readme)


def main() -> int:
    try:
        text = renewed(README.read_text(encoding="utf-8"))
    except NotFound as problem:
        print(f"readme: {problem}", file=sys.stderr)
        return 2
    README.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
