"""The table of verdicts, and how raycheck verify keeps them."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.cells import cell_len
from rich.markup import escape
from rich.text import Text

from raycheck.base.files import write_whole
from raycheck.base.text import duration, one_line, percent, signed
from raycheck.commands.terminal import COLOURS, Columns, Output, put
from raycheck.judging import baseline, sentences
from raycheck.judging.cases import Case, Verification
from raycheck.judging.judge_renderer import Planned
from raycheck.judging.timetable import Timetable
from raycheck.stats.verdict import ALPHA, Outcome

if TYPE_CHECKING:
    from raycheck.judging.verdict_pages import Gallery

WIDTHS = {"verdict": 12, "bias": 8, "interval (99 %)": 19, "spp": 4, "seconds": 7}
"""Of most figures, in characters."""


class Rows:
    """The table of verdicts, a row as each is decided."""

    def __init__(self) -> None:
        self.widths = dict(WIDTHS)
        self.row: Callable[..., None] | None = None

    def plan(self, plan: Timetable) -> None:
        """Say which cases will be judged, where these are not all, or how long they take."""
        for column, names in zip(("scene", "technique"), zip(*plan.cases, strict=True), strict=True):
            self.widths[column] = max(map(cell_len, names))
        if str(plan):
            put(Output(), Text(f"{plan}\n"))

    def samples(self, planned: Sequence[Planned], bias: float) -> None:
        """Say how many samples each case takes so that such a bias is noticed, and how long that is."""
        open_ones = [one for one in planned if not one.found.case]
        told = f"So that a bias of {percent(bias)} of the image is noticed with 90 % probability:"
        put(Output(), Text(told))
        table = Columns(("scene", "technique", "spp", "time"), right=("spp", "time"))
        row = table.begin(Output(), self.widths | {"spp": 5, "time": 11})
        for one in open_ones:
            row(escape(one.task.label), one.task.technique, str(one.spp), duration(one.seconds))
        put(Output(), Text(f"About {duration(sum(one.seconds for one in open_ones))} in all.\n"))

    def add(self, case: Case) -> None:
        """The row of a case, under the names of the columns if it is the first."""
        if self.row is None:
            figures = ("bias", "interval (99 %)", "detectable: image", "90 % of tiles", "spp", "seconds")
            table = Columns(("scene", "technique", "verdict", *figures), right=figures)
            own = {"scene": cell_len(case.scene), "technique": cell_len(case.technique)}
            self.row = table.begin(Output(), own | self.widths)
        verdict = f"[{COLOURS[case.verdict]}]{case.verdict}[/]"
        self.row(escape(case.scene), case.technique, verdict, *_row(case))


UNTIL = "--until SECONDS goes on until it is decided"


def show(result: Verification, more: str = UNTIL) -> None:
    """A sentence for each verdict that is not PASS, and what they are together; `more` says what decides."""
    console = Output()
    skipped = {case.name: case.reason for case in result.cases if case.skipped}
    for case in result.cases:
        quiet = case.verdict is Outcome.PASS and case.order is None
        if not quiet and not case.skipped:
            console.print()
            show_sentence(console, case)
    totals = result.header.get("totals", {})
    told = [o for o in Outcome if o is not Outcome.SKIP or totals.get(o.value)]
    counts = ", ".join(f"{totals.get(o.value, 0)} {o.value}" for o in told)
    seen = [case.mde_image for case in result.cases if case.mde_image is not None]
    sentence = f"{counts} in {duration(float(totals.get('seconds', 0.0)))}"
    if seen:
        sentence += f"; a bias of {percent(max(seen))} of the image mean would have been noticed everywhere"
    console.print()
    console.print(sentence + ".", highlight=False)
    if totals.get(Outcome.INCONCLUSIVE.value):
        console.print(_open_ones(more), highlight=False, markup=False, soft_wrap=True)
    judged = [case for case in result.cases if not case.skipped]
    if judged:
        for line in (_judged_against(judged), _chance(result, judged)):
            console.print(line, highlight=False, markup=False, soft_wrap=True)
    left_out = sentences.left_out(result.header.get("left_out", {}))
    for line in (*sentences.left_out(skipped, "SKIP"), *left_out):
        console.print(line, highlight=False, markup=False, soft_wrap=True)


def show_sentence(console: Output, case: Case) -> None:
    """What the verdict says."""
    verdict = f"[{COLOURS[case.verdict]}]{case.verdict}[/]"
    console.print(f"{escape(case.scene)}, {case.technique}: {verdict}", end=" ")
    sentence = one_line(case.reason[:1].upper() + case.reason[1:] + ".")
    console.print(sentence, markup=False, highlight=False, soft_wrap=True)


def _open_ones(more: str) -> str:
    """What an INCONCLUSIVE means, and what decides it."""
    return f"INCONCLUSIVE: too few samples to tell; nothing is known to be wrong. {more}."


def show_changes(before: Verification, now: Verification) -> None:
    """What changed since the baseline."""
    console = Output()
    console.print()
    for line in baseline.lines(before, now):
        console.print(one_line(line), highlight=False, markup=False, soft_wrap=True)


def _chance(result: Verification, judged: Sequence[Case]) -> str:
    """Says how often a run like this of a renderer that is right has a FAIL, at most."""
    alpha, cases = float(result.header.get("alpha", ALPHA)), len(judged)
    each = f"{cases} case{'s' if cases != 1 else ''} × {alpha:.2g}"
    return f"Chance of a wrong FAIL in such a run: at most {cases * alpha:.2g} ({each})."


def _judged_against(cases: list[Case]) -> str:
    """Says which scenes have a closed form, which outranks Mitsuba, and which do not."""
    closed = sorted({case.scene for case in cases if case.closed_form})
    rendered = sorted({case.scene for case in cases if not case.closed_form})
    parts = [f"closed forms: {', '.join(closed)}"] if closed else []
    parts += [f"Mitsuba's references: {', '.join(rendered)}"] if rendered else []
    return f"Judged against {'; '.join(parts)}."


def _row(case: Case) -> list[str]:
    last = [str(case.spp or ""), f"{case.seconds:.1f}"]
    figures = (case.bias, case.bias_low, case.bias_high, case.mde_image, case.mde_tile_p90)
    known = [figure for figure in figures if figure is not None]
    if len(known) < len(figures):
        return ["", "", "", "", *last]
    bias, low, high, image, tiles = known
    return [signed(bias), f"{signed(low)} … {signed(high)}", percent(image), percent(tiles), *last]


def verdict_pages(folder: Path, words: Sequence[str], files: Sequence[Path]) -> "Gallery":
    """Of a run with these options, or of these pictures."""
    from raycheck.base.site import Site
    from raycheck.judging.verdict_pages import Gallery

    return Gallery(Site(folder), words, [str(file) for file in files])


def saving(
    path: Path | None, kept: Sequence[Case], rows: Rows, pages: "Gallery | None",
    on_case: Callable[[Case, int], None] | None,
) -> Callable[[Case, int], None]:  # fmt: skip
    """Writes each verdict as it comes, to the terminal, to its page and beside those kept: a long run can be
    interrupted and resumed.
    """
    done: dict[tuple[str, str], Case] = {(case.scene, case.technique): case for case in kept}

    def save(case: Case, total: int) -> None:
        done[case.scene, case.technique] = case
        rows.add(case)
        if pages:
            pages.add(case)
        if path:
            write_whole(path, Verification(list(done.values())).to_json())
        if on_case:
            on_case(case, total)

    return save
