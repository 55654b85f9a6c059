"""What counts as a line of code."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))

import size


def test_comments_and_blanks_do_not_count_in_c() -> None:
    text = '/* a\n   b */\n\n#include "x.h" /* c */\nchar *s = "/* no comment"; // d\n'
    text += "// e\nint c = '\"';\n/* f */ int d;\n"
    assert size.lines_of_c(text) == 4


def test_comments_blanks_and_docstrings_do_not_count_in_python() -> None:
    text = '"""A\n\nB"""\n\nx = (  # c\n    "y"\n)\nz = """a\nb"""\n\n\n'
    text += 'def f():\n    """D"""\n    # e\n    return 1\n'
    assert size.lines_of_python(text) == 7


def test_generated_tables_stand_apart() -> None:
    shown = size.markdown({"C": {"film": 10, size.GENERATED: 3}, "Python": {"raycheck": 5, "tests": 2}})
    assert "| oneray, C | 10 |" in shown and "| oneray, tables generated from data | 3 |" in shown
    assert "scripts" not in shown
