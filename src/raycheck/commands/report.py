"""raycheck report: race renderers, and leave offline pages."""

from pathlib import Path
from typing import Annotated

import typer

from raycheck.base.files import made_folder, write_whole
from raycheck.commands import options
from raycheck.commands.words import writable
from raycheck.scene import variants


def report(
    scenes: options.Scenes = None,
    against: options.Against = None,
    renderer: options.Racers = None,
    technique: options.Technique = None,
    seconds: options.RaceSeconds = 1.0,
    minutes: options.RaceMinutes = None,
    rounds: Annotated[int, typer.Option(min=6, help="Interleaved, with seeds of their own.")] = 8,
    core: options.Core = None,
    output: options.ReportFolder = Path("report"),
    json_file: options.CurvesJson = None,
    verification: options.Verdicts = None,
    curves: options.EarlierCurves = None,
    benchmark: options.BenchmarkFigures = None,
    stability: options.StabilityFigures = None,
    single: Annotated[bool, typer.Option("--single", help="All of it in one file.")] = False,
) -> None:
    """Leave offline pages: verdicts, and of each scene pictures, error maps and error against run time."""
    writable(json_file)
    wanted = [variants.variant(scene) for scene in scenes or ()]
    from raycheck.commands.terminal import progress_bar
    from raycheck.commands.work import report as work
    from raycheck.measuring.contestants import named_commands
    from raycheck.measuring.race_plots import flagged
    from raycheck.measuring.races.curves import to_json
    from raycheck.measuring.report import Races, check_inputs, kept_races, write_report

    check_inputs(verification, benchmark, stability)
    made_folder(output)
    if seconds > 0:
        field = work.Field(against is not None, named_commands(renderer or ()), technique or ())
        races: Races | None = work.race(wanted, field, seconds, minutes, rounds, core, output)
    else:
        races = kept_races(curves)
    with progress_bar("verifying") as on_case:
        page = write_report(output, verification, on_case, benchmark, stability, wanted, races, single)
    if json_file and races:
        write_whole(json_file, to_json(races.scenes, races.header))
    for scene, curve in flagged(races.scenes if races and seconds > 0 else ()):
        print(f"{scene}, {curve.name}: {curve.flag}: {curve.why}")
    print(f"{page}: open it in a browser")
