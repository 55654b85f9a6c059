"""oneray with mistakes that can be switched on while it runs: what the lecture's pages render "what if I
forget …" with.

A copy of the sources, in which each place that a patch of tests/mutants changes holds both, the right lines
and the wrong ones, and a number that is set before the program starts says which are taken. 0 is no
mistake.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from raycheck.base.errors import PatchError
from raycheck.calibration.mutants import Mutant

NUMBER = "oneray_mistake"
DEFINITION = f"""/* Which mistake of the lecture's pages is made; 0: none. Set before the program starts. */
int {NUMBER};
__attribute__((export_name("mistake"))) void mistake(int number);
void mistake(int number) {{ {NUMBER} = number; }}
"""
_DECLARED = re.compile(r"(\s*)([A-Z]\w+) (\w+) =\s+([^;]*);$")
_UNUSED = re.compile(r"\s*\(void\)\w+;\n")


@dataclass(frozen=True)
class Change:
    """Lines [begin, end) of a file, from 0, and what a mistake has in their place."""

    file: str
    begin: int
    end: int
    number: int
    """Of the mistake."""
    wrong: str


def _hunks(mutant: Mutant) -> list[tuple[str, int, list[str]]]:
    """File, first line from 0, and the lines of each hunk with their signs."""
    found: list[tuple[str, int, list[str]]] = []
    file = ""
    for line in mutant.patch.read_text(encoding="utf-8").split("\n---", 1)[1].splitlines()[1:]:
        if line.startswith("+++ "):
            file = line[4:].split("\t")[0].removeprefix("b/")
        elif at := re.match(r"@@ -(\d+)", line):
            found.append((file, int(at[1]) - 1, []))
        elif line[:1] in ("+", "-", " ") and found and not line.startswith("--- "):
            found[-1][2].append(line)
    return found


def _place(lines: Sequence[str], signed: Sequence[str], near: int) -> tuple[int, Sequence[str]]:
    """Where the hunk's old lines stand now, nearest to where they were, and the hunk without the lines
    around it that are others now: as `patch` does it, at most two at either end.
    """
    for fuzz in range(3):
        left = min(fuzz, next(i for i, line in enumerate(signed) if line[0] != " "))
        right = min(fuzz, next(i for i, line in enumerate(reversed(signed)) if line[0] != " "))
        part = signed[left : len(signed) - right]
        old = [line[1:] for line in part if line[0] != "+"]
        starts = [i for i in range(len(lines) - len(old) + 1) if list(lines[i : i + len(old)]) == old]
        if starts:
            return min(starts, key=lambda i: abs(i - near - left)), part
    raise PatchError("the patch does not apply")


def _ends_statement(line: str) -> bool:
    """A compound literal's brace has no blank in front."""
    return re.search(r"([;}]|\s\{|^\{|\*/)\s*(/\*.*\*/)?\s*$", line) is not None or not line.strip()


def _open_braces(lines: Sequence[str]) -> int:
    text = "".join(lines)
    return text.count("{") - text.count("}")


def changes(mutant: Mutant, number: int, root: Path) -> list[Change]:
    """The whole statements that a mutant's patch changes."""
    found = []
    for file, near, hunk in _hunks(mutant):
        lines = (root / file).read_text(encoding="utf-8").splitlines()
        start, signed = _place(lines, hunk, near)
        changed = [i for i, line in enumerate(signed) if line[0] != " "]
        middle = signed[changed[0] : changed[-1] + 1]
        begin = start + changed[0]
        end = begin + sum(line[0] != "+" for line in middle)
        # Out to whole statements: what stands before ends one, and so does the last line.
        first, last = begin, end
        while not _ends_statement(lines[first - 1]):
            first -= 1
        while not _ends_statement(lines[last - 1]) or _open_braces(lines[first:last]) > 0:
            last += 1
        if _open_braces(lines[first:last]):
            raise PatchError(f"{file}:{first + 1}: the patch changes a part of a block")
        if not lines[first].startswith((" ", "\t")):
            raise PatchError(f"{file}:{first + 1}: the patch changes more than statements")
        wrong = [*lines[first:begin], *(line[1:] for line in middle if line[0] != "-"), *lines[end:last]]
        found.append(Change(file, first, last, number, "".join(line + "\n" for line in wrong)))
    return found


def _both(right: str, made: Sequence[Change]) -> str:
    """The right lines, and the wrong ones of each mistake in the same place. What is declared there is
    declared once.
    """
    declared = _DECLARED.match(right.rstrip("\n"))
    text = ""
    for one in made:
        wrong = _UNUSED.sub("", one.wrong)
        if declared:
            other = _DECLARED.match(wrong.rstrip("\n"))
            if not other or other[3] != declared[3]:
                raise PatchError(f"{one.file}:{one.begin + 1}: no switch can be made of this patch")
            wrong = f"{other[3]} = {other[4]};\n"
        text += f"if ({NUMBER} == {one.number}) {{\n{wrong}}} else "
    if declared:
        return f"{declared[2]} {declared[3]}; {text}{{ {declared[3]} = {declared[4]}; }}\n"
    return f"{text}{{\n{right}}}\n"


def copy_with_switches(root: Path, folder: Path, mistakes: Sequence[Mutant]) -> None:
    """Makefile and sources of a checkout into a folder, mistake number 1 the first. A file that is as it
    was keeps its time, so that make builds what changed. PatchError where no switch can be made of a patch.
    """
    wanted: dict[str, list[Change]] = {}
    for number, mutant in enumerate(mistakes, 1):
        try:
            for one in changes(mutant, number, root):
                wanted.setdefault(one.file, []).append(one)
        except PatchError as error:
            raise PatchError(f"{mutant.name}: {error}") from None
    paths = [root / "Makefile", *(p for p in (root / "src").rglob("*") if p.suffix in (".c", ".h"))]
    kept = {Path("src/wasm/mistake.c")}
    _write(folder / "src/wasm/mistake.c", DEFINITION)
    for path in paths:
        name = path.relative_to(root)
        kept.add(name)
        text = path.read_text(encoding="utf-8")
        if name.as_posix() in wanted:
            text = _switched(text, wanted[name.as_posix()])
        _write(folder / name, text)
    for path in (folder / "src").rglob("*.[ch]"):
        if path.relative_to(folder) not in kept:
            path.unlink()


def _switched(text: str, made: Sequence[Change]) -> str:
    lines = text.splitlines(keepends=True)
    places: dict[tuple[int, int], list[Change]] = {}
    for one in made:
        places.setdefault((one.begin, one.end), []).append(one)
    order = sorted(places)
    for (_, end), (begin, _) in itertools.pairwise(order):
        if begin < end:
            raise PatchError(f"{made[0].file}:{begin + 1}: mistakes that change some of each other's lines")
    for (begin, end), here in sorted(places.items(), reverse=True):
        lines[begin:end] = [_both("".join(lines[begin:end]), here)]
    first = next(i for i, line in enumerate(lines) if line.startswith("#"))
    return "".join([*lines[:first], f"extern int {NUMBER};\n", *lines[first:]])


def _write(path: Path, text: str) -> None:
    if path.is_file() and path.read_text(encoding="utf-8") == text:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")

