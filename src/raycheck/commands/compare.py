"""raycheck compare: two images with standard errors."""

from pathlib import Path
from typing import Annotated

import typer

from raycheck.base.files import write_whole
from raycheck.base.text import one_line
from raycheck.commands import options
from raycheck.commands.words import writable


def compare(
    a: Annotated[Path, typer.Argument(metavar="A.exr[:LAYER]")],
    b: Annotated[Path, typer.Argument(metavar="B.exr[:LAYER]")],
    json_file: options.JsonFile = None,
) -> None:
    """Do two images with standard errors show the same mean? Exit status as in verify."""
    from raycheck.commands.terminal import COLOURS, Output
    from raycheck.judging.compare import compare as compare_images

    writable(json_file)
    result = compare_images(a, b)
    console = Output()
    console.print(f"[{COLOURS[result.verdict]}]{result.verdict}[/]", end=" ")
    console.print(one_line(result.reason), markup=False, highlight=False, soft_wrap=True)
    if json_file:
        write_whole(json_file, result.to_json())
    raise typer.Exit(result.exit_status)
