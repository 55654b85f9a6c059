"""raycheck techniques: what each technique costs."""

from typing import Annotated

import typer

from raycheck.base.files import write_whole
from raycheck.base.machine import machine, raycheck_version, today
from raycheck.commands import options
from raycheck.commands.edge import command_line
from raycheck.commands.words import parse_settings, writable


def techniques(
    scenes: options.Scenes = None,
    settings: options.Settings = None,
    spp: Annotated[
        int | None, typer.Option(min=2, help="Samples per pixel of each round, instead of --seconds.")
    ] = None,
    seconds: Annotated[
        float, typer.Option(min=0.001, help="Rendering of each technique in each scene, all rounds together.")
    ] = 0.6,
    rounds: Annotated[int, typer.Option(min=3, help="Interleaved, with seeds of their own.")] = 3,
    json_file: options.JsonFile = None,
) -> None:
    """What each technique of oneray costs: variance and time of a sample, against the plain random walk."""
    from raycheck.commands.terminal import progress_bar
    from raycheck.commands.work import techniques as work
    from raycheck.measuring import prices

    writable(json_file)
    with progress_bar("pricing") as on_case:
        wanted = prices.scenes_named(scenes or (), parse_settings(settings))
        result = prices.price_list(wanted, rounds=rounds, seconds=seconds, spp=spp, on_case=on_case)
    work.show(result)
    if json_file:
        budget = {"spp": spp} if spp else {"seconds": seconds}
        made = {"raycheck": raycheck_version(), "machine": machine(), "date": today()}
        header = made | {"command": command_line()} | budget
        write_whole(json_file, prices.to_json(result, header))
