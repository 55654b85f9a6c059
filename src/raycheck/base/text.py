"""Words and numbers for people, and what stands in for their signs on an output that has ASCII alone."""

import codecs
import difflib
import io
import json
import math
import re
import sys
import unicodedata
from collections.abc import Collection, Iterable, Mapping
from typing import Any, TextIO

ASCII = "raycheck-ascii"
STAND_INS = "raycheck-stand-ins"
"""The name of an error handler of codecs: a sign that the encoding lacks becomes ASCII."""
SIGNS = {
    "−": "-", "–": "-", "—": "-", "±": "+/-", "…": "...", "×": "x", "·": "*", "⋅": "*", "∞": "inf",
    "√": "sqrt", "≤": "<=", "≥": ">=",
    "≠": "!=", "≈": "~", "∝": "~", "→": "->", "←": "<-", "“": '"', "”": '"', "„": '"', "‟": '"',
    "‘": "'", "’": "'", "°": " degrees", "½": "1/2", "¼": "1/4", "¾": "3/4", "∫": "integral", "∪": "or",
    "∩": "and", "⟨": "<", "⟩": ">", "▲": "^", "▼": "v", "━": "-", "╸": "-", "╺": "-", "•": "*", "▀": "#",
    "›": ">", "′": "'", "ϖ": "varpi",
    "ø": "o", "Ø": "O", "ß": "ss", "æ": "ae", "Æ": "AE", "ł": "l", "Ł": "L",
}  # fmt: skip


def stand_in(sign: str) -> str:
    """ASCII for a character: its entry of SIGNS, the name of a Greek letter, "^2" for a superscript, the
    letter without its accent; "?" where there is none.
    """
    if sign in SIGNS:
        return SIGNS[sign]
    name = unicodedata.name(sign, "")
    if name.startswith("GREEK") and " LETTER " in name:
        letter = name.split(" LETTER ")[1].split()[0]
        return letter.capitalize() if " CAPITAL " in name else letter.lower()
    if unicodedata.combining(sign):
        return ""
    plain = "".join(x if x.isascii() else SIGNS.get(x, "") for x in unicodedata.normalize("NFKD", sign))
    raised = unicodedata.decomposition(sign).startswith("<super>")
    return f"^{plain}" if plain and raised else plain or "?"


def _stand_ins(error: UnicodeError) -> tuple[str | bytes, int]:
    """Bytes of a file name that are no text in this encoding came as surrogates, and go out as they came."""
    assert isinstance(error, UnicodeEncodeError)
    sign = error.object[error.start]
    if "\udc80" <= sign <= "\udcff":
        return bytes([ord(sign) - 0xDC00]), error.start + 1
    return stand_in(sign), error.start + 1


codecs.register_error(STAND_INS, _stand_ins)


def _ascii(name: str) -> codecs.CodecInfo | None:
    """ASCII by another name: click takes a stream of that encoding for one whose system means UTF-8."""
    of = codecs.lookup("ascii")
    if name != ASCII.replace("-", "_"):
        return None
    return codecs.CodecInfo(
        of.encode, of.decode, of.streamreader, of.streamwriter, of.incrementalencoder, of.incrementaldecoder,
        name=ASCII,
    )  # fmt: skip


codecs.register(_ascii)


def use_stand_ins(stream: TextIO) -> None:
    """Let ASCII stand in for what the stream's encoding lacks, whoever writes to it."""
    plain = codecs.lookup(stream.encoding).name == "ascii"
    assert isinstance(stream, io.TextIOWrapper)
    stream.reconfigure(encoding=ASCII if plain else None, errors=STAND_INS)


def as_printed(words: str, stream: TextIO) -> str:
    """The text as the stream shows it, or the one behind it where a progress bar stands before it."""
    encoding = getattr(stream, "rich_proxied_file", stream).encoding or "ascii"
    return words.encode(encoding, STAND_INS).decode(encoding, "replace")


def nearest(word: str, known: Collection[str]) -> str:
    """ "; did you mean NAME?" for a known name that is like the word, else nothing."""
    found = difflib.get_close_matches(word, known, n=1)
    return f"; did you mean {found[0]}?" if found else ""


def percent(value: float) -> str:
    """Two or three digits: "12 %", "0.31 %", "0.004 %"."""
    size = abs(value) * 100
    if not math.isfinite(size):
        return "∞ %"
    digits = 0 if size >= 20 else 1 if size >= 2 else 2 if size >= 0.1 else 3
    return f"{size:.{digits}f} %"


def signed(value: float) -> str:
    return ("+" if value >= 0 else "−") + percent(value)


def one_line(text: str) -> str:
    """Control characters, and bytes of a file's name that are no text, as escapes. In a locale of ASCII all
    other letters of a name are such bytes, and stay as they are.
    """
    bytes_of_names = r"\ud800-\udfff" if sys.getfilesystemencoding() == "utf-8" else ""
    control = rf"[\x00-\x1f\x7f-\x9f\u2028\u2029{bytes_of_names}]"
    return re.sub(control, lambda found: repr(found[0])[1:-1], text)


def shown(value: object, most: int = 80) -> str:
    """A value that somebody wrote, as a sentence shows it: not longer than that, and no end of quotations."""
    text = _unquoted(repr(value))
    return text if len(text) <= most else text[: most - 1] + "…"


def plain(text: str) -> str:
    """A stranger's words in one line, with a sign for all that is not to be seen, or turns what follows."""
    return "".join(c if c.isprintable() else " " if c in "\t\r\n" else "�" for c in text)


def quoted(text: str, most: int = 1000) -> str:
    """A stranger's words between “ and ”, neither of which is among them: where they end is certain."""
    words = _unquoted(plain(text)).strip()
    return f"“{words if len(words) <= most else words[: most - 1] + '…'}”"


def _unquoted(text: str) -> str:
    return re.sub("[“”„‟]", '"', text)


def last_words(said: str) -> str:
    """The last three lines of what a program said, and before them the first that speaks of an error, as the
    end of a sentence; empty if it said nothing. Of bytes that are no text, a row is one sign.
    """
    text = re.sub("[\ufffd\\x00-\\x08\\x0e-\\x1f]{4,}", "…", said)
    lines = [line.strip()[:300] for line in text.splitlines() if line.strip()]
    error = next((line for line in lines[:-3] if re.search(r"\berror\b", line, re.IGNORECASE)), None)
    kept = [error, "…"] if error else []
    return f"; it said: {quoted(' | '.join([*kept, *lines[-3:]]))}" if lines else ""


UNSUPPORTED = "unsupported:"
"""How the line begins by which a renderer says what of a scene it does not support."""


def refusal(said: Iterable[str]) -> str:
    """The line, of those that a renderer said, by which it refuses a scene; empty if there is none."""
    return next((line.strip()[:300] for line in said if line.lstrip().startswith(UNSUPPORTED)), "")


def duration(seconds: float) -> str:
    """Two digits or so: "1.5 s", "45 s", "4 minutes", "1.6 hours", "12 days"."""
    if seconds < 120:
        return f"{seconds:.1f} s" if seconds < 10 else f"{seconds:.0f} s"
    if seconds < 5400:
        return f"{seconds / 60:.0f} minutes"
    if seconds < 48 * 3600:
        return f"{seconds / 3600:.1f} hours" if seconds < 36000 else f"{seconds / 3600:.0f} hours"
    return f"{times(seconds / 86400)} days" if math.isfinite(seconds) else "for ever"


def times(value: float) -> str:
    """Two digits, never as a power of ten: "1.2", "23", "110", "1,300"."""
    if not math.isfinite(value):
        return "∞"
    rounded = float(f"{value:.2g}")
    return f"{rounded:,.0f}" if rounded >= 10 else f"{rounded:g}"


def number(value: float) -> str:
    """Three digits: "0.0123", "1.00", "45.6", "1,230"."""
    if value == 0 or not math.isfinite(value):
        return "0" if value == 0 else "∞"
    decimals = max(0, 2 - math.floor(math.log10(abs(value)) + 1e-12))
    if value >= 1000:
        return f"{float(f'{value:.3g}'):,.0f}"
    return f"{value:.{min(decimals, 8)}f}"


def rounded(value: object) -> object:
    """Every number in dictionaries and lists to four digits."""
    if isinstance(value, float):
        return float(f"{value:.4g}")
    if isinstance(value, dict):
        return {key: rounded(v) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(v) for v in value]
    return value


def scenes_json(header: Mapping[str, object], key: str, scenes: Iterable[Mapping[str, Any]]) -> str:
    """A header, and scenes, each with its figures and under `key` a row a line: a new measurement is a
    readable difference. All numbers have four digits.
    """
    listed = []
    for scene in scenes:
        head, rows = {k: v for k, v in scene.items() if k != key}, scene[key]
        text, *lines = (json.dumps(rounded(x), ensure_ascii=False, allow_nan=False) for x in (head, *rows))
        listed.append(f'{text[:-1]}, "{key}": [\n   ' + ",\n   ".join(lines) + "]}")
    top = json.dumps(dict(header), indent=1, ensure_ascii=False).removesuffix("\n}")
    return f'{top},\n "scenes": [\n  ' + ",\n  ".join(listed) + "\n ]\n}\n"
