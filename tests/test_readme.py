"""The README shows what was measured."""

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


def test_old_tables_are_replaced() -> None:
    old = "a <!-- stability -->STALE<!-- /stability --> b <!-- prices: cornell-box -->STALE<!-- /prices --> c"
    new = readme.renewed(old)
    assert "STALE" not in new and "| tiny-disk | " in new and "| `nee` | " in new
    assert new.startswith("a <!-- stability -->\n| ") and new.endswith("\n<!-- /prices --> c")
