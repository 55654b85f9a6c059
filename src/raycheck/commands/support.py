"""What the commands share: errors in one line, the terminal, a bar that shows how far a long run is."""

import os
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from raycheck.base.errors import ImageError, NotFound, PatchError, ReferenceError_, RenderError
from raycheck.base.text import one_line


def make_console() -> Console:
    """Standard output: as wide as the terminal, or wide enough for the table in a pipe."""
    options: dict[str, Any] = {} if sys.stdout.isatty() else {"width": 140, "color_system": None}
    return Console(emoji=False, **options)


def make_table(columns: Iterable[str], right: Iterable[str] = (), wrap: bool = True) -> Table:
    """A table without lines; columns of `right`, which hold numbers, stand to the right."""
    table = Table(box=None, pad_edge=False, header_style="bold")
    for name in columns:
        table.add_column(name, justify="right" if name in right else "left", no_wrap=not wrap)
    return table


@contextmanager
def plain_errors() -> Iterator[None]:
    """One line on standard error and exit status 2 where nothing could be judged."""
    try:
        yield
    except (NotFound, ReferenceError_, ImageError, RenderError, PatchError) as error:
        typer.echo(one_line(f"raycheck: {error}"), err=True)
        raise typer.Exit(2) from None
    except KeyboardInterrupt:
        typer.echo("raycheck: interrupted", err=True)
        raise typer.Exit(130) from None


def parse_settings(settings: list[str] | None) -> dict[str, str]:
    """["a=1", "b=2"] as {"a": "1", "b": "2"}; NotFound for anything else."""
    pairs = [setting.partition("=") for setting in settings or ()]
    for name, equals, _ in pairs:
        if not name or not equals:
            raise NotFound(f"-D{name}: -Dname=value is wanted")
    return {name: value for name, _, value in pairs}


def writable(path: Path | None) -> None:
    """Say before a long run, not after it, that its result cannot be written."""
    if path is not None and (path.is_dir() or not Path(os.path.realpath(path)).parent.is_dir()):
        typer.echo(f"raycheck: {path}: there is no such folder, or it is one", err=True)
        raise typer.Exit(2)


COLOURS = {"PASS": "green", "FAIL": "bold red", "INCONCLUSIVE": "yellow"}


class Done(Protocol):
    """What a progress bar shows of a step that was done."""

    @property
    def scene(self) -> str: ...
    @property
    def technique(self) -> str: ...


def command_line() -> str:
    """The one that was typed, for whoever reads its result."""
    return shlex.join(["raycheck", *sys.argv[1:]])


@contextmanager
def progress_bar(what: str) -> Iterator[Callable[[Done, int], None] | None]:
    """A progress bar with the time left on a terminal's standard error, nothing in a pipe."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield None
        return
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(what, total=None)

        def on_case(case: Done, total: int) -> None:
            bar.update(task, total=total, advance=1, description=f"{what} {case.scene}, {case.technique}")

        yield on_case
