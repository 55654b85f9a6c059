"""What raycheck climb shows: rows as rungs are judged, where it stops a picture, at the end what the renderer
can do.
"""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.cells import cell_len
from rich.text import Text

from raycheck.base.pictures import Bytes
from raycheck.base.site import Site
from raycheck.base.text import as_printed
from raycheck.commands.terminal import Output, progress_bar, put
from raycheck.commands.work.verify import Rows, show, show_sentence
from raycheck.judging.cases import Case
from raycheck.judging.climb import Climb
from raycheck.judging.verdict_pages import Drawn, Gallery
from raycheck.scene import variants
from raycheck.stats.verdict import Outcome

MORE = "--seconds SECONDS gives each scene more"
BETWEEN = 2
"""Columns between two pictures."""
HALF = "▀"
LETTERS = " .:-=+*#%@"
"""From dark to bright, where there are no colours."""
SEEN = 60
"""How much more red than blue, of 255, shows in letters."""


def climb(climbing: Climb, folder: Path, words: Sequence[str], once: bool) -> int:
    """Climbs until the top, or for ever; the exit status. Ctrl-C too ends with what the renderer can do."""
    console = Output()
    gallery = Gallery(Site(folder), words)
    try:
        while True:
            failed, drawn = _ascended(climbing, gallery)
            if not failed:
                break
            put(console, "")
            for line in half_blocks(drawn, console):
                put(console, line)
            page = gallery.finish(climbing.result())
            if once:
                break
            show_sentence(console, failed)
            put(console, Text(f"{page}: open it in a browser"))
            put(console, Text(f"\nWaiting until {climbing.files} changes; Ctrl-C ends."))
            climbing.wait()
    except KeyboardInterrupt:
        put(console, "")
        _show_end(climbing, console)
        raise
    _show_end(climbing, console)
    put(console, Text(f"{gallery.finish(climbing.result())}: open it in a browser"))
    return climbing.result().exit_status


def _ascended(climbing: Climb, gallery: Gallery) -> tuple[Case | None, list[Drawn]]:
    """The case that stopped it, and its pictures."""
    rows, drawn = Rows(), list[Drawn]()
    rows.widths |= {"scene": max(cell_len(of.label) for of in climbing.rungs), "technique": 9}
    with progress_bar("climbing") as bar:

        def on_case(case: Case, pictures: Sequence[tuple[Any, ...]]) -> None:
            rows.add(case)
            for seen in pictures:
                gallery.take(*seen)
            drawn[:] = gallery.add(case)
            if bar:
                bar(case, len(climbing.rungs))

        failed = climbing.ascend(on_case)
    return failed, drawn


def _show_end(climbing: Climb, console: Output) -> None:
    """The verdicts as verify has them; then what the renderer can do, and what not yet."""
    result = climbing.result()
    if result.cases:
        show(result, MORE)
    by = {outcome: [case for case in result.cases if case.verdict is outcome] for outcome in Outcome}
    put(console, "")
    _list(console, "It can:", [case.scene for case in by[Outcome.PASS]], _told)
    unsure = climbing.to_confirm()
    _list(console, "It could, and is to be confirmed as the program has changed:", unsure, _told)
    _list(console, "It cannot yet:", [case.scene for case in by[Outcome.FAIL]], _told)
    _list(console, "Not decided:", [case.scene for case in by[Outcome.INCONCLUSIVE]], _told)
    seen = {case.scene for case in result.cases} | set(unsure)
    others = [of.label for of in climbing.rungs if of.label not in seen]
    if others:
        more = f", and {len(others) - 1} more" if len(others) > 1 else ""
        put(console, Text(f"Not reached: {others[0]} ({_told(others[0])}){more}."))


def _list(console: Output, head: str, scenes: Sequence[str], told: Callable[[str], str]) -> None:
    if scenes:
        put(console, Text(head))
        wide = max(map(cell_len, scenes))
        for scene in scenes:
            gap = " " * (wide - cell_len(scene))
            line = as_printed(f"  {scene}{gap}  {told(scene)}", sys.stdout)
            put(console, Text(line, no_wrap=True, overflow="ellipsis"))


def _told(label: str) -> str:
    """What a scene shows."""
    name, _, settings = label.partition("@")
    if name not in variants.LADDER:
        return ""
    return variants.summary(name) + (f" ({settings})" if settings else "")


def half_blocks(drawn: Sequence[Drawn], console: Output) -> list[Text]:
    """Pictures side by side in the terminal, two rows of pixels a line; letters where there are no colours,
    and of the difference its sign.
    """
    if not drawn:
        return []
    colours = console.color_system is not None and not console.no_color
    colours = colours and as_printed(HALF, sys.stdout) == HALF
    each = (min(console.width, 200) - BETWEEN * (len(drawn) - 1)) // len(drawn)
    titles = {"mine": "mine", "reference": "reference", "error": "difference"}
    blue, red = ("blue", "red") if colours else ("-", "+")
    legend = f" ({blue}: too dark, {red}: too bright)"
    heads, parts = Text(), list[list[Text]]()
    for name, pixels, _ in drawn:
        small = _resampled(pixels, each)
        parts.append([_line(small[row : row + 2], name, colours) for row in range(0, len(small), 2)])
        heads.append(f"{titles[name]:{small.shape[1] + BETWEEN}}")
    heads.rstrip()
    heads.append(legend)
    gap = Text(" " * BETWEEN)
    return [heads, *(gap.join(line) for line in zip(*parts, strict=True))]


def _line(two: Bytes, name: str, colours: bool) -> Text:
    line = Text()
    for upper, lower in zip(two[0].astype(int), two[1].astype(int), strict=True):
        if colours:
            style = "rgb({},{},{}) on rgb({},{},{})".format(*upper, *lower)
            line.append(HALF, style)
        elif name == "error":
            warm = int(upper[0] + lower[0] - upper[2] - lower[2]) // 2
            line.append("+" if warm > SEEN else "-" if warm < -SEEN else " ")
        else:
            line.append(LETTERS[int(upper.sum() + lower.sum()) * len(LETTERS) // (6 * 255 + 1)])
    return line


def _resampled(pixels: Bytes, most: int) -> Bytes:
    """At most so wide, and of an even number of rows half as tall as square pixels' would be twice."""
    height, width = pixels.shape[:2]
    columns = min(width, most)
    rows = 2 * max(round(columns * height / width / 2), 1)
    shown = pixels.astype(float)
    for axis, (size, parts) in enumerate(((height, rows), (width, columns))):
        edges = np.arange(parts) * size // parts
        counts = np.diff(np.append(edges, size))
        shape = [1, 1, 1]
        shape[axis] = parts
        shown = np.add.reduceat(shown, edges, axis=axis) / counts.reshape(shape)
    return shown.round().astype(np.uint8)
