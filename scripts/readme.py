"""Put the measured figures of references/*.json into the README and the pages of docs/, each between its
comments, <!-- NAME --> and <!-- /NAME -->; <!-- prices: SCENE ... --> says which scenes.

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

import mutate_harness
import numpy as np
import public_scenes
import size

from raycheck.base.errors import NotFound
from raycheck.base.files import write_whole
from raycheck.calibration import table
from raycheck.measuring import price_tables, prices, speed
from raycheck.measuring.audit import results as audit_results
from raycheck.measuring.audit import tables as audit_tables
from raycheck.measuring.stability import tables
from raycheck.measuring.stability.results import read
from raycheck.stats.verdict import Outcome

ROOT = Path(__file__).resolve().parent.parent
REFERENCES = ROOT / "references"
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))


def _prices(scenes: Sequence[str]) -> str:
    found = {one.scene: one for one in prices.read(REFERENCES / "techniques.json")}
    return price_tables.markdown([found[name] for name in scenes])


def _calibration(words: Sequence[str]) -> str:
    return table.markdown(_calibrated())


def _trust(words: Sequence[str]) -> str:
    return table.sentence(_calibrated())


def _calibrated() -> Any:
    return json.loads((REFERENCES / "calibration.json").read_text(encoding="utf-8"))


def _harness(words: Sequence[str]) -> str:
    return mutate_harness.sentence(json.loads(mutate_harness.RESULT.read_text(encoding="utf-8")))


def _stability(words: Sequence[str]) -> str:
    return tables.markdown(read(REFERENCES / "stability.json")[0])


def _benchmark(words: Sequence[str]) -> str:
    found = speed.read(REFERENCES / "benchmark.json")
    return f"{speed.markdown(found)}\n\n{speed.commands_line(found)}"


def _size(words: Sequence[str]) -> str:
    return size.markdown(json.loads((REFERENCES / "size.json").read_text(encoding="utf-8")))


def _public(words: Sequence[str]) -> str:
    results = json.loads((REFERENCES / "public_scenes.json").read_text(encoding="utf-8"))["files"]
    return public_scenes.markdown(results)


def _verification(words: Sequence[str]) -> str:
    cases = _cases()
    sentences = [_verdicts(words)]
    sentences += [
        f"{case['verdict']}: {_named(case)}, {case['reason']}."
        for case in cases
        if case["verdict"] != Outcome.PASS
    ]
    return " ".join((*sentences, _detectable([case for case in cases if not case["unbounded"]])))


def _verdicts(words: Sequence[str]) -> str:
    cases = _cases()
    count = Counter(case["verdict"] for case in cases)
    scenes = {case["scene"].split("@")[0] for case in cases}
    verdicts = ", ".join(f"{count[one]} {one}" for one in Outcome if one is not Outcome.SKIP or count[one])
    return f"{verdicts} in {len(cases)} cases of {len(scenes)} scenes."


def _cases() -> Any:
    return json.loads((REFERENCES / "verification.json").read_text(encoding="utf-8"))["cases"]


def _detectable(cases: Sequence[Mapping[str, Any]]) -> str:
    image, tiles = (np.array([case[key] or 0.0 for case in cases]) for key in ("mde_image", "mde_tile_p90"))
    closed = image[[case["closed_form"] for case in cases]]
    coarse = [
        f"{_named(case)} ({100 * bias:.2g} %)"
        for case, bias in zip(cases, image, strict=True)
        if bias > WANTED_IMAGE
    ]
    half, most = (f"{100 * np.quantile(tiles, share):.1f} %" for share in (0.5, 0.9))
    return (
        f"In the {len(cases)} whose samples have a bound, a bias of 0.3 % of the image, or a smaller one, "
        f"would have been noticed, but in {len(coarse)}: {', '.join(coarse) or 'none'}; one of 0.1 % in "
        f"{(closed <= 0.001).sum()} of the {len(closed)} that have a closed form. Of nine tenths of the "
        f"tiles, a bias of 1 % would have been noticed in {100 * (tiles <= 0.01).mean():.0f} % of these "
        f"cases, of {half} in half of them, of {most} in nine tenths."
    )


def _named(case: Mapping[str, Any]) -> str:
    return f"`{case['technique']}` on `{case['scene']}`"


def _audit(words: Sequence[str]) -> str:
    return audit_tables.markdown(*audit_results.read(REFERENCES / "audit.json"))


TABLES: dict[str, Callable[[Sequence[str]], str]] = {
    "calibration": _calibration,
    "harness": _harness,
    "prices": _prices,
    "stability": _stability,
    "benchmark": _benchmark,
    "verification": _verification,
    "verdicts": _verdicts,
    "trust": _trust,
    "size": _size,
    "public": _public,
    "audit": _audit,
}
WANTED_IMAGE = 0.003
PLACE = re.compile(rf"(<!-- ({'|'.join(TABLES)})(?:: (.*?))? -->).*?(<!-- /\2 -->)", re.DOTALL)


LINK = re.compile(r"\]\((?!\w+:|#)")


def renewed(page: str, below: int = 0) -> str:
    """A page, so many folders below the top, with today's tables; NotFound where a result is not there."""

    def filled(place: re.Match[str]) -> str:
        first, name, words, last = place.groups()
        text = LINK.sub(f"]({'../' * below}", TABLES[name]((words or "").split()))
        return f"{first}\n{text}\n{last}"

    return PLACE.sub(filled, page)


def main() -> int:
    try:
        texts = {page: renewed(page.read_text(encoding="utf-8"), page.parent != ROOT) for page in PAGES}
    except NotFound as problem:
        print(f"readme: {problem}", file=sys.stderr)
        return 2
    for page, text in texts.items():
        write_whole(page, text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
