"""raycheck reference: make references anew, and say first how long it will take."""

import math
import os
from enum import StrEnum
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import Progress

from raycheck.base.text import duration, percent
from raycheck.commands import options
from raycheck.commands.support import make_console, parse_settings, plain_errors
from raycheck.scene import variants
from raycheck.truth import making, mitsuba, references


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
        float, typer.Option(help="Relative standard error of the image to reach.")
    ] = making.Goal.image,
    tile_error: Annotated[
        float, typer.Option(help="The same of 90 % of its 8×8 tiles; twice that beside a closed form.")
    ] = making.Goal.tile,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Threads or processes, one a core by default.")
    ] = None,
    closed_forms: Annotated[
        bool, typer.Option("--closed-forms", help="Instead: evaluate those of the canonical scenes anew.")
    ] = False,
) -> None:
    """Make the reference of a scene, after a time estimate. Those of your own scene files go into a folder
    "references" beside them.
    """
    goal = making.Goal(image=image_error, tile=tile_error, checked_tile=2 * tile_error, most_seconds=seconds)
    if closed_forms:
        for label in references.keep_closed_forms():
            typer.echo(label)
        return
    with plain_errors():
        wanted = _wanted_references(scenes, parse_settings(settings), every)
        if not wanted:
            typer.echo("all references are fresh")
            return
        _make_references(wanted, by, goal, jobs or os.cpu_count() or 1)


def _wanted_references(
    scenes: list[str] | None, parameters: dict[str, str], every: bool
) -> list[variants.Variant]:
    if not scenes:
        found = variants.ladder()
        return found if every else [variant for variant in found if not references.is_fresh(variant)]
    return [variants.variant(scene, parameters) for scene in scenes]


def _make_references(wanted: list[variants.Variant], by: Maker, goal: making.Goal, jobs: int) -> None:
    """Plan all, say how long it will take, then render the short ones first."""
    variant = mitsuba.choose_variant() if by is Maker.MITSUBA else ""
    console = make_console()
    work = []
    for of in wanted:
        renderer = mitsuba.MitsubaBatches(of, variant, jobs) if variant else making.OnerayBatches(of, jobs)
        checked = references.closed_form(of) is not None
        plan = making.make_plan(renderer, goal, checked)
        work.append((of, renderer, plan))
        line = f"{of.label}: {plan.spp} samples per pixel, about {duration(plan.seconds)}"
        console.print(line, markup=False, soft_wrap=True)
    total = sum(plan.seconds for _, _, plan in work)
    console.print(f"about {duration(total)} in all")
    batches = sum(plan.spp // goal.spp_per_batch for _, _, plan in work)
    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=batches)
        for of, renderer, plan in sorted(work, key=lambda job: job[2].seconds):
            bar.update(task, description=of.label)
            entry = making.make_reference(of, renderer, plan, goal, lambda: bar.advance(task))
            console.print(
                f"{of.label}: {entry['batches']} batches, {duration(entry['seconds'])}, standard error "
                f"{percent(entry['image_error'])} of the image and "
                f"{percent(entry['tile_error_p90'])} of nine tenths of the tiles: "
                f"{of.folder / of.label}.exr",
                markup=False,
                soft_wrap=True,
            )
