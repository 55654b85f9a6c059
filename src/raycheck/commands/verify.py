"""raycheck verify: judge a renderer, and show the table of verdicts."""

from collections.abc import Callable
from pathlib import Path

import typer
from rich.markup import escape

from raycheck.base.errors import NotFound
from raycheck.base.files import write_whole
from raycheck.base.text import duration, one_line, percent, signed
from raycheck.commands import options
from raycheck.commands.support import (
    COLOURS,
    make_console,
    make_table,
    parse_settings,
    plain_errors,
    progress_bar,
    writable,
)
from raycheck.judging import sentences
from raycheck.judging.cases import Case, Verification
from raycheck.judging.junit import junit_xml
from raycheck.judging.verify import verify as run_verification
from raycheck.stats.verdict import Limits, Outcome

TILE_LIMITS = Limits.tile / Limits.image


def verify(
    scenes: options.Scenes = None,
    settings: options.Settings = None,
    technique: options.Technique = None,
    renderer: options.RendererCommand = None,
    images: options.Pictures = None,
    json_file: options.JsonFile = None,
    junit: options.JunitFile = None,
    seconds: options.Seconds = None,
    delta: options.Delta = Limits.image,
    thorough: options.Thorough = False,
    resume: options.Resume = False,
    seed: options.Seed = 0,
    spp: options.Spp = None,
    jobs: options.Jobs = None,
    timeout: options.Timeout = None,
) -> None:
    """Judge a renderer: exit status 1 if anything FAILs, else 3 if anything is INCONCLUSIVE, else 0; 2: could
    not run.
    """
    writable(json_file)
    writable(junit)
    with progress_bar("verifying") as on_case, plain_errors():
        if thorough and seconds is not None:
            raise NotFound("--seconds is the budget of a quick run: it does not go with --thorough")
        if resume and json_file is None:
            raise NotFound("--resume goes on with the run in --json FILE: name it")
        going_on = resume and json_file is not None and json_file.is_file()
        kept = Verification.read(json_file).cases if going_on and json_file else []
        result = run_verification(
            renderer, scenes or (), parameters=parse_settings(settings), techniques=technique or (),
            images=images, thorough=thorough, seed=seed, spp=spp, jobs=jobs, timeout=timeout, seconds=seconds,
            limits=Limits(image=delta, tile=TILE_LIMITS * delta),
            earlier=kept, on_case=_saving(json_file, kept, on_case) if thorough else on_case,
        )  # fmt: skip
    show(result)
    if json_file:
        write_whole(json_file, result.to_json())
    if junit:
        write_whole(junit, junit_xml(result))
    raise typer.Exit(result.exit_status)


def show(result: Verification) -> None:
    """The table of verdicts, and a sentence for each that is not PASS."""
    console = make_console()
    figures = ("bias", "interval (99 %)", "detectable: image", "90 % of tiles", "spp", "seconds")
    table = make_table(("scene", "technique", "verdict", *figures), right=figures, wrap=False)
    for case in result.cases:
        verdict = f"[{COLOURS[case.verdict]}]{case.verdict}[/]"
        table.add_row(escape(case.scene), case.technique, verdict, *_row(case))
    console.print(table)
    for case in result.cases:
        if case.verdict is not Outcome.PASS:
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
    for line in sentences.left_out(result.header.get("left_out", {})):
        console.print(line, highlight=False, markup=False, soft_wrap=True)


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


def _saving(
    path: Path | None, kept: list[Case], on_case: Callable[[Case, int], None] | None
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
