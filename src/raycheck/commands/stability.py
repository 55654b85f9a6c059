"""raycheck stability: how far renderers hold in stiff cases."""

from typing import Annotated

import typer

from raycheck.base.files import write_whole
from raycheck.base.machine import machine, raycheck_version, today
from raycheck.base.statuses import Status
from raycheck.commands import options
from raycheck.commands.edge import command_line
from raycheck.commands.words import writable


def stability(
    cases: Annotated[
        list[str] | None, typer.Argument(metavar="[CASE]...", help="Names of stiff cases; all by default.")
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Three values of each, oneray alone: half a minute.")
    ] = False,
    seed: options.Seed = 0,
    json_file: options.JsonFile = None,
) -> None:
    """How far oneray, and Mitsuba where it is installed, hold in stiff cases, against closed forms: exit
    status 1 if oneray misses a goal.
    """
    from raycheck.commands.terminal import Columns, Output, progress_bar
    from raycheck.measuring.stability import sweeps, tables
    from raycheck.measuring.stability.results import to_json

    writable(json_file)
    with progress_bar("sweeping") as on_case:
        wanted = sweeps.cases_named(cases or ())
        results = sweeps.run(wanted, quick, seed, on_case)
    table = Columns(tables.COLUMNS, wrap=tables.COLUMNS[4:])
    for result in results:
        table.add_row(*tables.row(result), style=None if result.holds() else "red")
    table.show(Output())
    missed = [result.case for result in results if not result.holds()]
    met = "all that was swept holds" if quick else f"all {len(results)} goals are met"
    Output().print(f"goals missed: {', '.join(missed)}" if missed else met)
    if json_file:
        made = {"raycheck": raycheck_version(), "machine": machine(), "date": today()}
        header = made | {"command": command_line()}
        write_whole(json_file, to_json(results, header))
    raise typer.Exit(Status.FAIL if missed else Status.DONE)
