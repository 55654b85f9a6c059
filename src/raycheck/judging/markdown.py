"""Verdicts as Markdown, which a job on GitHub shows as its summary."""

import html
import re

from raycheck.base.text import duration, one_line, percent, signed
from raycheck.judging.cases import Case, Verification
from raycheck.stats.verdict import Outcome


def markdown(result: Verification) -> str:
    """A table of verdicts, and why where one is no PASS."""
    lines = ["### raycheck", "", "| scene | technique | verdict | bias | detectable | seconds |"]
    lines += ["| --- | --- | --- | ---: | ---: | ---: |", *map(_row, result.cases), ""]
    lines += [
        f"- **{plain(case.name)}**: {plain(case.reason)}"
        for case in result.cases if case.verdict is not Outcome.PASS
    ]  # fmt: skip
    totals = result.header.get("totals", {})
    told = [f"{totals[one.value]} {one.value}" for one in Outcome if totals.get(one.value)]
    return "\n".join([*lines, "", f"{', '.join(told)} in {duration(float(totals.get('seconds', 0)))}", ""])


def _row(case: Case) -> str:
    bias = "" if case.bias is None else signed(case.bias)
    seen = "" if case.mde_image is None else percent(case.mde_image)
    verdict = f"**{case.verdict}**" if case.verdict is Outcome.FAIL else str(case.verdict)
    cells = (plain(case.scene), plain(case.technique), verdict, bias, seen)
    return f"| {' | '.join(cells)} | {case.seconds:.1f} |"


def plain(text: str) -> str:
    """A stranger's words, none of whose signs mean anything to Markdown or HTML."""
    return re.sub(r"([\\`*_\[\]|~#])", r"\\\1", html.escape(one_line(text), quote=False))
