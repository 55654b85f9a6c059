"""The tables of raycheck techniques."""

from collections.abc import Sequence

from raycheck.commands.terminal import Columns, Output
from raycheck.measuring import price_tables, prices
from raycheck.scene.techniques import TECHNIQUES


def show(result: Sequence[prices.ScenePrices]) -> None:
    """A table of each scene, and what the techniques in them are."""
    console = Output()
    for one in result:
        table = Columns(price_tables.COLUMNS, right=price_tables.COLUMNS[2:])
        for each in one.prices:
            table.add_row(*price_tables.row(each), style="bold" if each.technique == one.baseline else None)
        console.print(f"[bold]{one.scene}[/], {one.rounds} rounds, against {one.baseline}", highlight=False)
        table.show(console)
        for note in price_tables.footnotes(one):
            console.print(note, markup=False, highlight=False, soft_wrap=True)
        console.print()
    priced = {each.technique for one in result for each in one.prices}
    legend = Columns(("technique", "what it does"), wrap=("what it does",))
    for known in TECHNIQUES:
        if known.name in priced:
            legend.add_row(known.name, known.summary)
    legend.show(console)
