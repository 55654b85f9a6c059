"""raycheck reference: make references anew, and say first how long it will take."""

import math
import os
import time
from enum import StrEnum
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import Progress

from raycheck.base.errors import NotFound
from raycheck.base.text import duration, percent, signed
from raycheck.commands import options
from raycheck.commands.support import make_console, parse_settings, plain_errors
from raycheck.scene import variants
from raycheck.stats.tiles import place
from raycheck.stats.verdict import Outcome
from raycheck.truth import drift as drifts
from raycheck.truth import making, mitsuba, references

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
    goal = making.Goal(image=image_error, tile=tile_error, checked_tile=2 * tile_error, most_seconds=seconds)
    if closed_forms:
        for label in references.keep_closed_forms():
            typer.echo(label)
        return
    if drift:
        if by is not Maker.MITSUBA:
            raise typer.BadParameter("--drift is of Mitsuba alone")
        with plain_errors():
            status = _drift(
                scenes, parse_settings(settings), seconds if math.isfinite(seconds) else DRIFT_SECONDS, jobs
            )
        raise typer.Exit(status)
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
    """Plan all, say how long it will take, then render the short ones first. The first plan has begun with
    the command: to find out how Mitsuba runs here takes its time too.
    """
    began = time.perf_counter()
    for of in wanted if by is Maker.MITSUBA else ():
        mitsuba.check_film(of)
    variant = mitsuba.choose_variant() if by is Maker.MITSUBA else ""
    console = make_console()
    work = []
    for of in wanted:
        renderer = mitsuba.MitsubaBatches(of, variant, jobs) if variant else making.OnerayBatches(of, jobs)
        checked = references.closed_form(of) is not None
        plan = making.make_plan(renderer, goal, checked, began)
        began = time.perf_counter()
        work.append((of, renderer, plan))
        told = f"about {duration(plan.total)} with start and plan"
        line = f"{of.label}: {plan.spp} samples per pixel, {told}"
        console.print(line, markup=False, soft_wrap=True)
    total, spent = (sum(getattr(plan, of) for _, _, plan in work) for of in ("total", "spent"))
    console.print(f"about {duration(total)} in all, of which {duration(spent)} are over")
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


def _drift(scenes: list[str] | None, parameters: dict[str, str], seconds: float, jobs: int | None) -> int:
    """A line for each scene, or for each reference that Mitsuba made; the exit status."""
    if scenes:
        wanted = [variants.variant(scene, parameters) for scene in scenes]
    else:
        fresh = [of for of in variants.ladder() if references.is_fresh(of)]
        wanted = [of for of in fresh if "mitsuba_version" in references.require(of)]
    for of in wanted:
        drifts.require(of)
    variant, console = mitsuba.choose_variant(), make_console()
    outcomes = set()
    for of in wanted:
        try:
            renderer = mitsuba.MitsubaBatches(of, variant, jobs or os.cpu_count() or 1)
        except NotFound as error:  # another version may refuse what was a scene before
            console.print(f"{error}: differs", soft_wrap=True)
            outcomes.add(Outcome.FAIL)
            continue
        found = drifts.measure(of, renderer, seconds)
        outcomes.add(found.judgement.outcome)
        console.print(_told(found), soft_wrap=True, highlight=False)
    return 1 if Outcome.FAIL in outcomes else 3 if Outcome.INCONCLUSIVE in outcomes else 0


def _told(found: drifts.Drift) -> str:
    judged = found.judgement
    verdict = {Outcome.PASS: "the same", Outcome.FAIL: "differs", Outcome.INCONCLUSIVE: "too noisy to say"}
    versions = f"both by {found.now}" if found.same_version else f"{found.now} after {found.before}"
    interval = f"{signed(judged.bias_low)} … {signed(judged.bias_high)}"
    told = f"{found.label}: {verdict[judged.outcome]}, {signed(judged.bias)} ({interval}) of the image"
    worst = [one for one in (judged.findings or judged.undecided) if one.region > 0][:1]
    for one in worst if judged.outcome is not Outcome.PASS else ():
        height, width = found.regions[0].height, found.regions[0].width
        where = place(found.regions[one.region], height, width)
        told += f", {signed(one.bias)} ({signed(one.low)} … {signed(one.high)}) of the tile at {where}"
    return f"{told}; {drifts.BATCHES} × {found.spp} samples per pixel, {versions}"
