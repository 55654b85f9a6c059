"""The table of verdicts, and how raycheck verify keeps them."""

from collections.abc import Callable, Sequence
from pathlib import Path

from rich.markup import escape

from raycheck.base.files import write_whole
from raycheck.base.text import duration, one_line, percent, signed
from raycheck.commands.support import COLOURS, Columns, Output
from raycheck.judging import baseline, sentences
from raycheck.judging.cases import Case, Verification
from raycheck.judging.judge_renderer import Planned
from raycheck.stats.verdict import ALPHA, Outcome


def show(result: Verification) -> None:
    """The table of verdicts, and a sentence for each that is not PASS."""
    console = Output()
    figures = ("bias", "interval (99 %)", "detectable: image", "90 % of tiles", "spp", "seconds")
    table = Columns(("scene", "technique", "verdict", *figures), right=figures)
    for case in result.cases:
        verdict = f"[{COLOURS[case.verdict]}]{case.verdict}[/]"
        table.add_row(escape(case.scene), case.technique, verdict, *_row(case))
    table.show(console)
    for case in result.cases:
        if case.verdict is not Outcome.PASS or case.order is not None:
            console.print()
            console.print(
                f"{escape(case.scene)}, {case.technique}: [{COLOURS[case.verdict]}]{case.verdict}[/]", end=" "
            )
            console.print(
                one_line(case.reason[:1].upper() + case.reason[1:] + "."),
                markup=False,
                highlight=False,
                soft_wrap=True,
            )
    totals = result.header.get("totals", {})
    counts = ", ".join(f"{totals.get(o.value, 0)} {o.value}" for o in Outcome)
    seen = [case.mde_image for case in result.cases if case.mde_image is not None]
    sentence = f"{counts} in {duration(float(totals.get('seconds', 0.0)))}"
    if seen:
        sentence += f"; a bias of {percent(max(seen))} of the image mean would have been noticed everywhere"
    console.print()
    console.print(sentence + ".", highlight=False)
    console.print(_judged_against(result.cases), highlight=False, markup=False, soft_wrap=True)
    console.print(_chance(result), highlight=False, markup=False, soft_wrap=True)
    for line in sentences.left_out(result.header.get("left_out", {})):
        console.print(line, highlight=False, markup=False, soft_wrap=True)


def show_plan(planned: Sequence[Planned], bias: float) -> None:
    """How long it will take, before it begins."""
    console = Output()
    console.print(f"So that a bias of {percent(bias)} of the image is noticed with 90 % probability:")
    table = Columns(("scene", "technique", "spp", "time"), right=("spp", "time"))
    for one in planned:
        table.add_row(escape(one.task.label), one.task.technique, str(one.spp), duration(one.seconds))
    table.show(console)
    whole = sum(one.seconds for one in planned)
    console.print(f"About {duration(whole)} in all.\n", highlight=False)


def show_changes(before: Verification, now: Verification) -> None:
    """What changed since the baseline."""
    console = Output()
    console.print()
    for line in baseline.lines(before, now):
        console.print(one_line(line), highlight=False, markup=False, soft_wrap=True)


def _chance(result: Verification) -> str:
    """Says how often a run like this of a renderer that is right has a FAIL, at most."""
    alpha, cases = float(result.header.get("alpha", ALPHA)), len(result.cases)
    again = sum(case.looks > 1 for case in result.cases) if result.header.get("mode") == "thorough" else 0
    each = f"{cases} case{'s' if cases != 1 else ''} × {alpha:.2g}"
    each += f", {again} looked at twice" if again else ""
    return f"Chance of a wrong FAIL in such a run: at most {(cases + again) * alpha:.2g} ({each})."


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


def saving(
    path: Path | None, kept: Sequence[Case], on_case: Callable[[Case, int], None] | None
) -> Callable[[Case, int], None]:
    """Writes each verdict as it comes, beside those kept: a long run can be interrupted and resumed."""
    done: dict[tuple[str, str], Case] = {(case.scene, case.technique): case for case in kept}

    def save(case: Case, total: int) -> None:
        done[case.scene, case.technique] = case
        if path:
            write_whole(path, Verification(list(done.values())).to_json())
        if on_case:
            on_case(case, total)

    return save
