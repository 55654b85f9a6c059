"""raycheck techniques: what each technique costs."""

from typing import Annotated

import typer
from rich.table import Table

from raycheck.base.files import write_whole
from raycheck.base.machine import machine, raycheck_version
from raycheck.commands import options
from raycheck.commands.support import (
    command_line,
    make_console,
    make_table,
    parse_settings,
    plain_errors,
    progress_bar,
    writable,
)
from raycheck.measuring import price_tables, prices
from raycheck.scene.techniques import TECHNIQUES


def techniques(
    scenes: options.Scenes = None,
    settings: options.Settings = None,
    spp: Annotated[
        int | None, typer.Option(min=2, help="Samples per pixel of each round, instead of --seconds.")
    ] = None,
    seconds: Annotated[
        float, typer.Option(min=0.001, help="Rendering of each technique in each scene, all rounds together.")
    ] = 0.6,
    rounds: Annotated[
        int, typer.Option(min=prices.LEAST_ROUNDS, help="Interleaved, with seeds of their own.")
    ] = 3,
    json_file: options.JsonFile = None,
) -> None:
    """What each technique of oneray costs: variance and time of a sample, against the plain random walk."""
    writable(json_file)
    with progress_bar("pricing") as on_case, plain_errors():
        wanted = prices.scenes_named(scenes or (), parse_settings(settings))
        result = prices.price_list(wanted, rounds=rounds, seconds=seconds, spp=spp, on_case=on_case)
    _show_prices(result)
    if json_file:
        budget = {"spp": spp} if spp else {"seconds": seconds}
        header = {"raycheck": raycheck_version(), "machine": machine(), "command": command_line()} | budget
        write_whole(json_file, prices.to_json(result, header))


def _show_prices(result: list[prices.ScenePrices]) -> None:
    """A table of each scene, and what the techniques in them are."""
    console = make_console()
    for one in result:
        table = make_table(price_tables.COLUMNS, right=price_tables.COLUMNS[2:], wrap=False)
        for each in one.prices:
            table.add_row(*price_tables.row(each), style="bold" if each.technique == one.baseline else None)
        console.print(f"[bold]{one.scene}[/], {one.rounds} rounds, against {one.baseline}", highlight=False)
        console.print(table)
        for note in price_tables.footnotes(one):
            console.print(note, markup=False, highlight=False, soft_wrap=True)
        console.print()
    priced = {each.technique for one in result for each in one.prices}
    legend = Table(box=None, pad_edge=False, show_header=False)
    for known in TECHNIQUES:
        if known.name in priced:
            legend.add_row(known.name, known.summary)
    console.print(legend)
