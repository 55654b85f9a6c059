"""Verdicts as Markdown."""

from __future__ import annotations

from raycheck.judging.cases import Case, Verification
from raycheck.judging.markdown import markdown
from raycheck.stats.verdict import Outcome


def test_a_row_a_verdict_and_a_sentence_where_it_is_no_pass() -> None:
    cases = [
        Case("furnace", "nee", Outcome.PASS, "nothing", bias=0.001, mde_image=0.002, seconds=1.25),
        Case("lens", "renderer", Outcome.FAIL, "it said: “<b>|`x`\n[a](b) *c*”", seconds=3),
    ]
    header = {"totals": {"PASS": 1, "FAIL": 1, "INCONCLUSIVE": 0, "SKIP": 0, "seconds": 4.25}}
    assert markdown(Verification(cases, header)).splitlines()[4:] == [
        "| furnace | nee | PASS | +0.10 % | 0.20 % | 1.2 |",
        "| lens | renderer | **FAIL** |  |  | 3.0 |",
        "",
        r"- **lens**: it said: “&lt;b&gt;\|\`x\`\\n\[a\](b) \*c\*”",
        "",
        "1 PASS, 1 FAIL in 4.2 s",
    ]
