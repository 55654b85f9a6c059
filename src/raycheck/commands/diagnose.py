"""raycheck diagnose: which mistake makes an image like this?"""

from pathlib import Path
from typing import Annotated

import typer

from raycheck.base.errors import NotFound
from raycheck.base.statuses import Status
from raycheck.commands.options import RendererCommand


def diagnose(
    images: Annotated[
        list[Path] | None, typer.Argument(metavar="[IMAGE]...", help="Pictures of one scene, seeds apart.")
    ] = None,
    renderer: RendererCommand = None,
    scene: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="What the pictures show, or what to render; found out by default."),
    ] = None,
    map_file: Annotated[
        Path | None, typer.Option("--map", metavar="FILE.png", help="Also write the error map here.")
    ] = None,
) -> None:
    """The three likeliest mistakes behind a wrong image, or that none of the known ones explains it. Exit
    status 1 if something is wrong, else 0.
    """
    if bool(images) == bool(renderer):
        raise NotFound("diagnose needs either IMAGE files or --renderer CMD")
    from raycheck.commands.terminal import Output
    from raycheck.judging.inspection import of_files, of_renderer, report, write_map

    found = of_renderer(renderer, scene) if renderer else of_files(images or [], scene)
    if map_file and found.worst:
        write_map(map_file, *found.worst)
    text, wrong = report(found)
    console = Output()
    console.print(text, markup=False, highlight=False, soft_wrap=True)
    raise typer.Exit(Status.FAIL if wrong else Status.DONE)
