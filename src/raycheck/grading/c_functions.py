"""Bodies of C functions, found by their tokens: strings, comments and preprocessor lines hold no braces."""

import re
from dataclasses import dataclass
from pathlib import Path

from raycheck.base.errors import NotFound

_HIDDEN = re.compile(
    r"/\*.*?\*/|//[^\n]*"  # comments
    r'|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\''  # strings and characters
    r"|^[ \t]*#(?:\\\n|/\*.*?\*/|[^\n])*",  # the preprocessor's lines, continued ones too
    re.DOTALL | re.MULTILINE,
)
_DEFINES = re.compile(r"(\w+)\s*\($")


@dataclass(frozen=True)
class Function:
    """A definition: text[begin:end] is its body, from the opening brace to the closing one."""

    name: str
    path: Path
    begin: int
    end: int
    line: int
    """The line of the name, from 1."""


def functions(path: Path, text: str) -> list[Function]:
    """All that are defined in a file; NotFound if its braces do not match."""
    plain = _HIDDEN.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), text)
    found, depth, begin, head = [], 0, 0, 0
    for brace in re.finditer(r"[{};]", plain):
        at = brace.start()
        if brace[0] == "{":
            begin = at if depth == 0 else begin
            depth += 1
        elif brace[0] == "}":
            depth -= 1
            if depth < 0:
                break
            if depth == 0:
                name = _defined(plain[head:begin])
                if name:
                    where = head + name.start()
                    line = plain.count("\n", 0, where) + 1
                    found.append(Function(name[1], path, begin, at + 1, line))
                    head = at + 1
        elif depth == 0:
            head = at + 1
    if depth:
        raise NotFound(f"{path}: the braces do not match")
    return found


def _defined(head: str) -> re.Match[str] | None:
    """The name in what stands before a brace, if that ends with a list of parameters."""
    head = head.rstrip()
    if not head.endswith(")"):
        return None
    depth = 0
    for at in range(len(head) - 1, -1, -1):
        depth += (head[at] == ")") - (head[at] == "(")
        if depth == 0:
            return _DEFINES.search(head[: at + 1])
    return None


def find(folder: Path, name: str) -> Function:
    """The one definition in the sources below a folder; NotFound where there is none, or more than one."""
    paths = sorted((*folder.rglob("*.h"), *folder.rglob("*.c")))
    found = [f for p in paths for f in functions(p, p.read_text(encoding="utf-8")) if f.name == name]
    if len(found) != 1:
        places = ", ".join(f"{f.path.relative_to(folder)}:{f.line}" for f in found)
        what = f"is defined {len(found)} times: {places}" if found else "is defined nowhere"
        raise NotFound(f"the function {name!r} {what} in {folder}; name one that is there once")
    return found[0]
