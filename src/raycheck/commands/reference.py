"""raycheck reference: make references anew, and say first how long it will take."""

import math
import os
from enum import StrEnum
from typing import Annotated

import typer

from raycheck.commands import options
from raycheck.commands.words import parse_settings

DRIFT_SECONDS = 10.0


class Maker(StrEnum):
    """Renderers that make references."""

    MITSUBA = "mitsuba"
    ONERAY = "oneray"


def reference(
    scenes: Annotated[
        list[str] | None,
        typer.Argument(metavar="[SCENE]...", help="Names or files; all whose reference is stale by default."),
    ] = None,
    settings: options.Settings = None,
    by: Annotated[Maker, typer.Option(help="Who renders it.")] = Maker.MITSUBA,
    every: Annotated[bool, typer.Option("--all", help="Renew fresh references too.")] = False,
    seconds: Annotated[
        float, typer.Option(min=1, help="About how long each may take, even if its errors are larger then.")
    ] = math.inf,
    image_error: Annotated[
        float | None,
        typer.Option(min=1e-9, help="Relative standard error of the image to reach, 1e-4 by default."),
    ] = None,
    tile_error: Annotated[
        float | None,
        typer.Option(
            min=1e-9,
            help="The same of 90 % of its 8×8 tiles, 5e-4 by default; twice that beside a closed form.",
        ),
    ] = None,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Threads or processes, one a core by default.")
    ] = None,
    closed_forms: Annotated[
        bool, typer.Option("--closed-forms", help="Instead: evaluate those of the canonical scenes anew.")
    ] = False,
    drift: Annotated[
        bool,
        typer.Option(
            "--drift",
            help="Instead: how far this version of Mitsuba renders what the references show; --seconds for "
            "each, 10 by default. Exit status 1 where one differs, 3 where noise hides too much.",
        ),
    ] = False,
) -> None:
    """Make the reference of a scene, after a time estimate. Those of your own scene files go into a folder
    "references" beside them.
    """
    parameters = parse_settings(settings)
    from raycheck.commands.work import reference as work
    from raycheck.truth import making, references

    if closed_forms:
        for label in references.keep_closed_forms():
            print(label)
        return
    if drift:
        if by is not Maker.MITSUBA:
            raise typer.BadParameter("--drift is of Mitsuba alone")
        each = seconds if math.isfinite(seconds) else DRIFT_SECONDS
        raise typer.Exit(work.drift(scenes, parameters, each, jobs))
    standard = making.Goal()
    tile = tile_error or standard.tile
    goal = making.Goal(image_error or standard.image, tile, checked_tile=2 * tile, most_seconds=seconds)
    wanted = work.wanted(scenes, parameters, every)
    if wanted:
        work.make(wanted, by, goal, jobs or os.cpu_count() or 1)
    else:
        print("all references are fresh")
