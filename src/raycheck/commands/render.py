"""raycheck render: a picture by several processes or machines."""

import contextlib
import math
import time
from pathlib import Path
from typing import Annotated

import typer

from raycheck.base.errors import NotFound
from raycheck.base.text import duration
from raycheck.commands.words import parse_settings
from raycheck.renderers import pools
from raycheck.scene import variants
from raycheck.scene.techniques import technique as named_technique


def render(
    scene: Annotated[str, typer.Argument(help="A scene's name, label such as furnace@depth=2, or file.")],
    output: Annotated[Path, typer.Option("-o", metavar="PICTURE", help="An .exr, .pfm or .png.")],
    spp: Annotated[int, typer.Option(min=1, help="Samples per pixel.")],
    options: Annotated[
        list[str] | None, typer.Argument(metavar="[-- OPTION...]", help="oneray's, such as -- --width 640.")
    ] = None,
    settings: Annotated[
        list[str] | None, typer.Option("-D", metavar="name=value", help="Another value for a <default>.")
    ] = None,
    technique: Annotated[str | None, typer.Option(metavar="NAME", help="One of raycheck techniques.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Another number gives all-new samples.")] = 0,
    exposure: Annotated[float, typer.Option(help="Stops, of a .png.")] = 0.0,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes here, one a core by default.")] = None,
    dask: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="The scheduler of a Dask cluster that renders.")
    ] = None,
    folder: Annotated[
        Path | None,
        typer.Option("--shards", metavar="FOLDER", help="Keep the parts here, and use those that are there."),
    ] = None,
) -> None:
    """Render with oneray, the samples split over processes or a Dask cluster: the same bits as one run gives.

    Interrupted, the same command goes on from the parts in PICTURE.shards.
    """
    pool = pools.chosen(jobs, dask)
    if not output.absolute().parent.is_dir() or output.suffix.lower() not in (".exr", ".pfm", ".png"):
        raise NotFound(f"{output}: an .exr, .pfm or .png in a folder that is there is wanted")
    if exposure and output.suffix.lower() != ".png":
        raise NotFound(f"--exposure is of a .png: {output} holds the radiance as it is")
    of = variants.variant(scene, parse_settings(settings))
    chosen = named_technique(technique).options if technique else ()
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from raycheck.commands.terminal import Output
    from raycheck.renderers import shards

    work = shards.Work(of.path, of.parameters, (*chosen, *(options or ())), seed)
    kept = folder or output.with_name(f"{output.name}.shards")
    started = time.monotonic()
    console = Output(stderr=True)
    columns = (TextColumn(output.name), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=None)

        def on_shard(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total)

        try:
            new = shards.render(
                work, spp, output, pool, kept, keep=folder is not None, exposure=exposure, on_shard=on_shard
            )
        finally:
            with contextlib.suppress(OSError):
                kept.rmdir()  # only if there is nothing in it
    total = len(shards.ranges(spp))
    found = f" ({total - new} were there)" if new < total else ""
    took = duration(math.ceil(time.monotonic() - started))
    print(f"{output}: {spp} samples per pixel in {total} parts{found}, {took}")
