"""The README shows what was measured."""

import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

import readme  # noqa: E402

TEXT = readme.README.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", readme.TABLES)
def test_each_table_has_its_place(name: str) -> None:
    assert [place.group(2) for place in readme.PLACE.finditer(TEXT)].count(name) == 1


def test_the_tables_are_those_of_the_results() -> None:
    assert readme.renewed(TEXT) == TEXT


def test_the_techniques_are_where_it_says() -> None:
    """`file` `function`, `function`, … in the table of the lecture's techniques."""
    rows = re.findall(r"^\| L\d+.*? \| .* \| (`.*) \|$", TEXT, re.MULTILINE)
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
