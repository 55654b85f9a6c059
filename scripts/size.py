"""How much code there is: lines without comments and blanks, of C after clang-format with .clang-format.

    python scripts/size.py
    python scripts/size.py --json references/size.json  # for docs/how-it-is-built.md: then scripts/readme.py

C is src/oneray, by folder; headers that the build writes are not counted, and tables that were generated from
data (a file that begins with "/* Generated") apart. Python is without docstrings, by package.
"""

from __future__ import annotations

import argparse
import ast
import io
import json
import re
import shutil
import subprocess
import sys
import tokenize
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BUDGET = 7200
"""Lines of C that what there is shall fit into."""
GENERATED = "generated tables"
ELSEWHERE = "main, options, …"
"""What stands in no folder."""
NO_CODE = {"COMMENT", "NL", "NEWLINE", "INDENT", "DEDENT", "ENDMARKER"}


def lines_of_c(text: str) -> int:
    """Without comments and blanks. A comment may stand in a string, and a string in a comment."""
    token = r'"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'|/\*.*?\*/|//[^\n]*'
    plain = re.sub(token, lambda found: " " if found[0][0] == "/" else found[0], text, flags=re.DOTALL)
    return sum(bool(line.strip()) for line in plain.splitlines())


def lines_of_python(text: str) -> int:
    """Without comments, blanks and docstrings."""
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if tokenize.tok_name[token.type] not in NO_CODE:
            lines.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            lines -= {*range(node.lineno, node.end_lineno + 1)}
    return len(lines)


def _formatter() -> str:
    beside = Path(sys.executable).with_name("clang-format")
    found = str(beside) if beside.is_file() else shutil.which("clang-format")
    if not found:
        sys.exit("size: clang-format is missing: pip install -e '.[test]'")
    return found


def of_c(root: Path = ROOT) -> Counter[str]:
    """By folder of src/oneray."""
    sources, found, style = root / "src/oneray", Counter(), ROOT / ".clang-format"
    for path in sorted(sources.rglob("*.[ch]")):
        command = [_formatter(), f"--style=file:{style}", path]
        text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        folder = path.relative_to(sources).parent.as_posix()
        generated = text.startswith("/* Generated")
        found[GENERATED if generated else ELSEWHERE if folder == "." else folder] += lines_of_c(text)
    return found


def of_python(root: Path = ROOT) -> Counter[str]:
    """By package of src/raycheck, and the scripts and tests beside it."""
    found: Counter[str] = Counter()
    for path in sorted((root / "src/raycheck").rglob("*.py")):
        package = path.relative_to(root / "src").parts[:-1][:2]
        found[".".join(package)] += lines_of_python(path.read_text(encoding="utf-8"))
    for folder in ("scripts", "tests"):
        for path in sorted((root / folder).rglob("*.py")):
            found[folder] += lines_of_python(path.read_text(encoding="utf-8"))
    return found


def counted(root: Path = ROOT) -> dict[str, dict[str, int]]:
    return {"C": dict(of_c(root)), "Python": dict(of_python(root))}


def printed(size: dict[str, dict[str, int]]) -> str:
    lines = []
    for language, parts in size.items():
        whole = sum(lines for name, lines in parts.items() if name != GENERATED)
        budget = f" of {BUDGET:,}" if language == "C" else ""
        lines += [f"{language:<24}{whole:>7,}{budget}"]
        lines += [f"    {name:<20}{count:>7,}" for name, count in sorted(parts.items())]
    return "\n".join(lines)


def markdown(size: dict[str, dict[str, int]]) -> str:
    """The totals."""
    c, python = dict(size["C"]), dict(size["Python"])
    generated, scripts, tests = c.pop(GENERATED, 0), python.pop("scripts", 0), python.pop("tests", 0)
    rows = {
        "oneray, C": sum(c.values()),
        "oneray, tables generated from data": generated,
        "raycheck, Python": sum(python.values()),
        "scripts, Python": scripts,
        "tests, Python": tests,
    }
    lines = [f"| {what} | {count:,} |" for what, count in rows.items() if count]
    return "\n".join(("| | lines of code |", "| --- | ---: |", *lines))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, metavar="FILE", help="write them there, too")
    parser.add_argument("--root", type=Path, default=ROOT, metavar="FOLDER", help="of another checkout")
    asked = parser.parse_args()
    size = counted(asked.root)
    print(printed(size))
    if asked.json:
        asked.json.write_text(json.dumps(size, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
