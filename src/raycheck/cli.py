"""The command line: raycheck verify, compare, report, techniques, stability, reference, render, diagnose,
scene, grade, handout, variants, calibrate, selftest.

What only one command needs and takes a tenth of a second to import, that command imports.
"""

import functools
import math
import os
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from raycheck import (
    assignment_cli,
    calibrate_cli,
    diagnose_cli,
    error_curves,
    grade_cli,
    prices,
    render_command,
    scene_cli,
    selftest_cli,
)
from raycheck import cli_options as options
from raycheck.base.errors import NotFound
from raycheck.base.files import write_whole
from raycheck.base.machine import machine, raycheck_version
from raycheck.base.text import duration, percent, signed
from raycheck.cli_support import make_console, parse_settings, plain_errors, writable
from raycheck.contestants import (
    Contestant,
    command_contestant,
    mitsuba_contestants,
    named_commands,
    oneray_contestants,
    pinned,
)
from raycheck.error_plots import flagged
from raycheck.judging import sentences
from raycheck.judging.compare import compare as compare_images
from raycheck.judging.junit import junit_xml
from raycheck.judging.verdicts import Case, Verification
from raycheck.judging.verify import verify as run_verification
from raycheck.scene import variants
from raycheck.scene.techniques import TECHNIQUES
from raycheck.stats.verdict import Limits, Outcome
from raycheck.truth import making, mitsuba, references

if TYPE_CHECKING:
    from raycheck import stability as stiff
    from raycheck.report import Races

TILE_LIMITS = Limits.tile / Limits.image
COLOURS = {Outcome.PASS: "green", Outcome.FAIL: "bold red", Outcome.INCONCLUSIVE: "yellow"}
FEW_COMMANDS = """\
raycheck judges Monte Carlo renderers against references. The commands that matter:

  raycheck verify point-light --renderer "./mine {scene} --spp {spp} --seed {seed} -o {output}"
      Is your renderer right on average? PASS, FAIL and what is wrong, or INCONCLUSIVE and what would decide.
  raycheck verify cornell-box --images 'mine-*.exr'
      The same for pictures that are already rendered.
  raycheck diagnose mine.exr
      Which known mistake makes an image like this?
  raycheck compare A.exr B.exr
      Do two renders with standard errors show the same mean?

raycheck COMMAND --help says more.
"""

app = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
app.add_typer(calibrate_cli.app, name="calibrate")
app.command()(diagnose_cli.diagnose)
app.command()(scene_cli.scene)
app.command()(grade_cli.grade)
app.command()(assignment_cli.handout)
app.command()(assignment_cli.variants)
app.command()(selftest_cli.selftest)


def _show_version(value: bool) -> None:
    if value:
        typer.echo(f"raycheck {raycheck_version()}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def few_commands(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """A judge of Monte Carlo renderers."""
    if context.invoked_subcommand is None:
        typer.echo(FEW_COMMANDS, nl=False)


@app.command()
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
    with _progress("verifying") as on_case, plain_errors():
        if thorough and seconds is not None:
            raise NotFound("--seconds is the budget of a quick run: it does not go with --thorough")
        if resume and json_file is None:
            raise NotFound("--resume goes on with the run in --json FILE: name it")
        kept = Verification.read(json_file).cases if resume and json_file.is_file() else []
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


@app.command()
def compare(
    a: Annotated[Path, typer.Argument(metavar="A.exr")],
    b: Annotated[Path, typer.Argument(metavar="B.exr")],
    json_file: options.JsonFile = None,
) -> None:
    """Do two images with standard errors show the same mean? Exit status as in verify."""
    writable(json_file)
    with plain_errors():
        result = compare_images(a, b)
    console = make_console()
    console.print(f"[{COLOURS[result.verdict]}]{result.verdict}[/]", end=" ")
    console.print(result.reason, markup=False)
    if json_file:
        json_file.write_text(result.to_json(), encoding="utf-8")
    raise typer.Exit(result.exit_status)


@app.command()
def report(
    scenes: options.Scenes = None,
    against: options.Against = None,
    renderer: options.Racers = None,
    technique: options.Technique = None,
    seconds: options.RaceSeconds = 1.0,
    minutes: options.RaceMinutes = None,
    rounds: Annotated[
        int, typer.Option(min=error_curves.LEAST_ROUNDS, help="Interleaved, with seeds of their own.")
    ] = error_curves.ROUNDS,
    core: options.Core = None,
    output: options.ReportFolder = Path("report"),
    json_file: options.CurvesJson = None,
    verification: options.Verdicts = None,
    curves: options.EarlierCurves = None,
    benchmark: options.BenchmarkFigures = None,
    stability: options.StabilityFigures = None,
) -> None:
    """Leave one offline page: error against run time, pictures, error maps and verdicts."""
    from raycheck import report as page_of

    writable(json_file)
    with plain_errors():
        wanted = [variants.variant(scene) for scene in scenes or ()]
        page_of.check_inputs(verification, benchmark, stability)
        if seconds > 0:
            field = _Field(against is not None, named_commands(renderer or ()), technique or ())
            races = _races(wanted, field, seconds, minutes, rounds, core, output)
        else:
            races = page_of.kept_races(curves)
        with _progress("verifying") as on_case:
            page = page_of.write_report(output, verification, on_case, benchmark, stability, wanted, races)
    if json_file and races:
        write_whole(json_file, error_curves.to_json(races.scenes, races.header))
    for scene, curve in flagged(races.scenes if races and seconds > 0 else ()):
        typer.echo(f"{scene}, {curve.name}: {curve.flag}: {curve.why}")
    typer.echo(f"{page}: open it in a browser")


@dataclass(frozen=True)
class _Field:
    """Who races beside oneray's techniques."""

    mitsuba: bool
    commands: Mapping[str, str]
    techniques: Sequence[str]

    def of(self, scene: variants.Variant, folder: Path) -> tuple[list[Contestant], dict[str, str]]:
        own, left_out = oneray_contestants(scene, self.techniques)
        others = [command_contestant(name, cmd, scene, folder) for name, cmd in self.commands.items()]
        return [*own, *(mitsuba_contestants(scene) if self.mitsuba else []), *others], left_out


def _races(
    wanted: Sequence[variants.Variant], field: _Field, seconds: float, minutes: float | None, rounds: int,
    core: int | None, output: Path,
) -> "Races":  # fmt: skip
    """Race all; unfinished work is in `output`/curves."""
    from raycheck.report import Races

    folder = output / "curves"
    folder.mkdir(parents=True, exist_ok=True)
    scenes = wanted or [variants.variant(name) for name in variants.scene_names()]
    runners = [(of, *field.of(of, folder)) for of in scenes]
    with _progress("racing") as on_step, pinned(core) as used:
        found = error_curves.race_all(
            runners, seconds=seconds, minutes=minutes, rounds=rounds, folder=folder, on_step=on_step
        )
    header = {"raycheck": raycheck_version(), "machine": machine(), "core": used, "command": _command_line()}
    return Races([one for one, _ in found], header, {one.scene: pixels for one, pixels in found})


@app.command()
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
    with _progress("pricing") as on_case, plain_errors():
        wanted = prices.scenes_named(scenes or (), parse_settings(settings))
        result = prices.price_list(wanted, rounds=rounds, seconds=seconds, spp=spp, on_case=on_case)
    _show_prices(result)
    if json_file:
        budget = {"spp": spp} if spp else {"seconds": seconds}
        header = {"raycheck": raycheck_version(), "machine": machine(), "command": _command_line()} | budget
        write_whole(json_file, prices.to_json(result, header))


@app.command()
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
    writable(json_file)
    from raycheck import stability as stiff

    with _progress("sweeping") as on_case, plain_errors():
        wanted = stiff.cases_named(cases or ())
        results = stiff.run(wanted, quick, seed, on_case)
    table = Table(box=None, pad_edge=False, header_style="bold")
    for index, name in enumerate(stiff.COLUMNS):
        table.add_column(name, no_wrap=index < 4)
    for result in results:
        table.add_row(*stiff.row(result), style=None if result.holds() else "red")
    make_console().print(table)
    missed = [result.case for result in results if not result.holds()]
    met = "all that was swept holds" if quick else f"all {len(results)} goals are met"
    make_console().print(f"goals missed: {', '.join(missed)}" if missed else met)
    if json_file:
        header = {"raycheck": raycheck_version(), "machine": machine(), "command": _command_line()}
        write_whole(json_file, stiff.to_json(results, header))
    raise typer.Exit(1 if missed else 0)


def _show_prices(result: list[prices.ScenePrices]) -> None:
    """A table of each scene, and what the techniques in them are."""
    console = make_console()
    for one in result:
        table = Table(box=None, pad_edge=False, header_style="bold")
        for index, name in enumerate(prices.COLUMNS):
            table.add_column(name, justify="left" if index < 2 else "right", no_wrap=True)
        for each in one.prices:
            table.add_row(*prices.row(each), style="bold" if each.technique == one.baseline else None)
        console.print(f"[bold]{one.scene}[/], {one.rounds} rounds, against {one.baseline}", highlight=False)
        console.print(table)
        for note in prices.footnotes(one):
            console.print(note, markup=False, highlight=False, soft_wrap=True)
        console.print()
    priced = {each.technique for one in result for each in one.prices}
    legend = Table(box=None, pad_edge=False, show_header=False)
    for each in TECHNIQUES:
        if each.name in priced:
            legend.add_row(each.name, each.summary)
    console.print(legend)


def _command_line() -> str:
    return shlex.join(["raycheck", *sys.argv[1:]])


class Maker(StrEnum):
    """Renderers that make references."""

    MITSUBA = "mitsuba"
    ONERAY = "oneray"


@app.command()
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
        plan = making.pilot(renderer, goal, checked)
        work.append((of, renderer, plan))
        console.print(f"{of.label}: {plan.spp} samples per pixel, about {duration(plan.seconds)}")
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
                soft_wrap=True,
            )


def show(result: Verification) -> None:
    """The table of verdicts, and a sentence for each that is not PASS."""
    console = make_console()
    table = Table(box=None, pad_edge=False, header_style="bold")
    for name in ("scene", "technique"):
        table.add_column(name, no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    for name in ("bias", "interval (99 %)", "detectable: image", "90 % of tiles", "spp", "seconds"):
        table.add_column(name, justify="right", no_wrap=True)
    for case in result.cases:
        table.add_row(case.scene, case.technique, f"[{COLOURS[case.verdict]}]{case.verdict}[/]", *_row(case))
    console.print(table)
    for case in result.cases:
        if case.verdict is not Outcome.PASS:
            console.print()
            console.print(
                f"{case.scene}, {case.technique}: [{COLOURS[case.verdict]}]{case.verdict}[/]", end=" "
            )
            console.print(
                case.reason[:1].upper() + case.reason[1:] + ".", markup=False, highlight=False, soft_wrap=True
            )
    totals = result.header.get("totals", {})
    counts = ", ".join(f"{totals.get(o.value, 0)} {o.value}" for o in Outcome)
    figures = [case.mde_image for case in result.cases if case.mde_image is not None]
    sentence = f"{counts} in {duration(float(totals.get('seconds', 0.0)))}"
    if figures:
        sentence += (
            f"; a bias of {percent(max(figures))} of the image mean would have been noticed everywhere"
        )
    console.print()
    console.print(sentence + ".", highlight=False)
    console.print(_judged_against(result.cases), highlight=False, soft_wrap=True)
    for line in sentences.left_out(result.header.get("left_out", {})):
        console.print(line, highlight=False, markup=False, soft_wrap=True)


def _judged_against(cases: list[Case]) -> str:
    """Which scenes have a closed form, which outranks Mitsuba, and which do not."""
    closed = sorted({case.scene for case in cases if case.closed_form})
    rendered = sorted({case.scene for case in cases if not case.closed_form})
    parts = [f"closed forms: {', '.join(closed)}"] if closed else []
    parts += [f"Mitsuba's references: {', '.join(rendered)}"] if rendered else []
    return f"Judged against {'; '.join(parts)}."


def _row(case: Case) -> list[str]:
    if case.bias is None:
        return ["", "", "", "", str(case.spp or ""), f"{case.seconds:.1f}"]
    return [
        signed(case.bias),
        f"{signed(case.bias_low)} … {signed(case.bias_high)}",
        percent(case.mde_image),
        percent(case.mde_tile_p90),
        str(case.spp or ""),
        f"{case.seconds:.1f}",
    ]


@contextmanager
def _progress(what: str):
    """A progress bar with the time left on a terminal's standard error, nothing in a pipe."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield None
        return
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(what, total=None)

        def on_case(case: "Case | prices.Step | stiff.Step", total: int) -> None:
            bar.update(task, total=total, advance=1, description=f"{what} {case.scene}, {case.technique}")

        yield on_case


def _with_plain_errors(command: Callable[..., None]) -> Callable[..., None]:
    @functools.wraps(command)
    def run(*values: object, **options: object) -> None:
        with plain_errors():
            command(*values, **options)

    return run


app.command()(_with_plain_errors(render_command.render))


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


def main() -> None:
    app(prog_name="raycheck")
