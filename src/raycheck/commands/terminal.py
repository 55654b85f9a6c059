"""The terminal: tables that fit it, a bar that shows how far a long run is. Importing it takes rich, so that
commands do so when their words are right.
"""

import shutil
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Protocol

from rich.cells import cell_len
from rich.console import Console, JustifyMethod, RenderableType
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from raycheck.base.text import as_printed

PIPE = (140, 50)
"""Characters of a line, and lines, where there is no terminal."""


class Output(Console):
    """Standard output or error: as wide as the terminal, or wide enough for most tables in a pipe."""

    def __init__(self, stderr: bool = False) -> None:
        there = (sys.stderr if stderr else sys.stdout).isatty()
        width, height = shutil.get_terminal_size(PIPE) if there else PIPE
        super().__init__(
            width=width, height=height, color_system="auto" if there else None, stderr=stderr, emoji=False
        )

    def on_broken_pipe(self) -> None:
        raise BrokenPipeError  # its own exit status would be 1


def put(console: Console, what: RenderableType) -> None:
    """Print at once, also into a pipe, and above a progress bar."""
    with console.capture() as captured:
        console.print(what, soft_wrap=isinstance(what, Text | str), highlight=False)
    print(captured.get(), end="", flush=True)


class Columns:
    """A table without lines. Where it is wider than the terminal, each row becomes lines of a name and a
    value: no number is cut.
    """

    def __init__(self, names: Iterable[str], right: Iterable[str] = (), wrap: Iterable[str] = ()) -> None:
        """Numbers stand to the `right`; the cells of `wrap` may be broken between words."""
        self.names, self.rows = list(names), list[tuple[list[str], str | None]]()
        self.right, self.wrap = set(right), set(wrap)

    def add_row(self, *cells: str, style: str | None = None) -> None:
        self.rows.append((list(cells), style))

    def begin(self, console: Console, widths: Mapping[str, int]) -> Callable[..., None]:
        """Print the header, and each row, of cells and a style, as the function that is returned gets it.
        Columns are as wide as their names and these `widths`, and what is wider goes beyond.
        """
        names = [as_printed(name, sys.stdout) for name in self.names]
        wide = [max(cell_len(name), widths.get(key, 0)) for name, key in zip(names, self.names, strict=True)]
        stacked = sum(wide) + 2 * (len(wide) - 1) > console.width
        count = 0

        def line(cells: Sequence[Text]) -> Text:
            whole = Text()
            for key, cell, width in zip(self.names, cells, wide, strict=True):
                gap = " " * max(width - cell.cell_len, 0)
                whole.append("  " if whole.cell_len else "")
                whole.append_text(Text(gap) + cell if key in self.right else cell + gap)
            whole.rstrip()
            return whole

        def row(*cells: str, style: str | None = None) -> None:
            nonlocal count
            shown = [Text.from_markup(as_printed(cell, sys.stdout)) for cell in cells]
            if stacked:
                if count:
                    put(console, "")
                put(console, self._block(shown, style))
            else:
                put(console, line(shown))
            count += 1

        if not stacked:
            put(console, line([Text(name, "bold") for name in names]))
        return row

    def show(self, console: Console) -> None:
        shown = [[Text.from_markup(as_printed(cell, sys.stdout)) for cell in cells] for cells, _ in self.rows]
        table = Table(box=None, pad_edge=False, header_style="bold")
        for index, name in enumerate(self.names):
            header = as_printed(name, sys.stdout)
            justify: JustifyMethod = "right" if name in self.right else "left"
            table.add_column(header, justify=justify, no_wrap=name not in self.wrap)
            if name not in self.wrap:
                cells = [row[index].cell_len for row in shown if index < len(row)]
                table.columns[index].min_width = max([cell_len(header), *cells])
        for row, (_, style) in zip(shown, self.rows, strict=True):
            table.add_row(*row, style=style)
        if table.__rich_measure__(console, console.options.update(max_width=10_000)).minimum <= console.width:
            console.print(table)
        else:
            self._stack(console, shown)

    def _stack(self, console: Console, shown: Sequence[Sequence[Text]]) -> None:
        for index, (row, (_, style)) in enumerate(zip(shown, self.rows, strict=True)):
            if index:
                console.print()
            console.print(self._block(row, style))

    def _block(self, row: Sequence[Text], style: str | None) -> Table:
        one = Table.grid(padding=(0, 2, 0, 0), pad_edge=False)
        one.add_column(no_wrap=True)
        one.add_column(overflow="fold")
        for name, cell in zip(self.names, row, strict=False):
            if cell:
                one.add_row(as_printed(name, sys.stdout), cell, style=style)
        return one


COLOURS = {"PASS": "green", "FAIL": "bold red", "INCONCLUSIVE": "yellow", "SKIP": "dim"}


class Done(Protocol):
    """What a progress bar shows of a step that was done."""

    @property
    def scene(self) -> str: ...
    @property
    def technique(self) -> str: ...


@contextmanager
def progress_bar(what: str) -> Iterator[Callable[[Done, int], None] | None]:
    """A progress bar with the time left on a terminal's standard error, nothing in a pipe."""
    console = Output(stderr=True)
    if not console.is_terminal:
        yield None
        return
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    seen = sys.stdout.isatty()
    with Progress(*columns, console=console, transient=True, redirect_stdout=seen) as bar:
        task = bar.add_task(what, total=None)

        def on_case(case: Done, total: int) -> None:
            bar.update(task, total=total, advance=1, description=f"{what} {case.scene}, {case.technique}")

        yield on_case
