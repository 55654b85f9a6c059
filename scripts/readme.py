"""Put the measured figures of references/*.json into the README, each between its comments, <!-- NAME --> and
<!-- /NAME -->; <!-- prices: SCENE ... --> says which scenes.

    python scripts/readme.py
"""

from __future__ import annotations

import json
import re
import sys
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from raycheck import prices, speed, stability
from raycheck.calibration import table
from raycheck.renderers import NotFound
from raycheck.verdict import Outcome

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


def _verification(words: Sequence[str]) -> str:
    cases = json.loads((REFERENCES / "verification.json").read_text(encoding="utf-8"))["cases"]
    count = Counter(case["verdict"] for case in cases)
    scenes = {case["scene"].split("@")[0] for case in cases}
    verdicts = ", ".join(f"{count[one]} {one}" for one in Outcome)
    sentences = [f"{verdicts} in {len(cases)} cases of {len(scenes)} scenes."]
    sentences += [
        f"{case['verdict']}: {_named(case)}, {case['reason']}."
        for case in cases
        if case["verdict"] != Outcome.PASS
    ]
    coarse = [f"{_named(case)} ({100 * case['mde_image']:.2g} %)" for case in cases if _is_coarse(case)]
    if coarse:
        sentences.append(
            "A bias of 0.3 % of the image, or a smaller one, would have been noticed in all cases whose "
            f"samples have a bound but {len(coarse)}: {', '.join(coarse)}."
        )
    return " ".join(sentences)


def _named(case: Mapping[str, Any]) -> str:
    return f"`{case['technique']}` on `{case['scene']}`"


def _is_coarse(case: Mapping[str, Any]) -> bool:
    return not case["unbounded"] and (case["mde_image"] or 0.0) > 0.003


TABLES: dict[str, Callable[[Sequence[str]], str]] = {
    "calibration": _calibration,
    "prices": _prices,
    "stability": _stability,
    "benchmark": _benchmark,
    "verification": _verification,
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
