"""raycheck report: race renderers, and leave one offline page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from raycheck.base.files import made_folder, write_whole
from raycheck.base.machine import machine, raycheck_version
from raycheck.commands import options
from raycheck.commands.support import (
    command_line,
    plain_errors,
    progress_bar,
    writable,
)
from raycheck.measuring.contestants import (
    Contestant,
    command_contestant,
    mitsuba_contestants,
    named_commands,
    oneray_contestants,
    pinned,
)
from raycheck.measuring.race_plots import flagged
from raycheck.measuring.races import racing
from raycheck.measuring.races.curves import to_json
from raycheck.measuring.report import Races, check_inputs, kept_races, write_report
from raycheck.scene import variants


def report(
    scenes: options.Scenes = None,
    against: options.Against = None,
    renderer: options.Racers = None,
    technique: options.Technique = None,
    seconds: options.RaceSeconds = 1.0,
    minutes: options.RaceMinutes = None,
    rounds: Annotated[
        int, typer.Option(min=racing.LEAST_ROUNDS, help="Interleaved, with seeds of their own.")
    ] = racing.ROUNDS,
    core: options.Core = None,
    output: options.ReportFolder = Path("report"),
    json_file: options.CurvesJson = None,
    verification: options.Verdicts = None,
    curves: options.EarlierCurves = None,
    benchmark: options.BenchmarkFigures = None,
    stability: options.StabilityFigures = None,
) -> None:
    """Leave one offline page: error against run time, pictures, error maps and verdicts."""
    writable(json_file)
    with plain_errors():
        wanted = [variants.variant(scene) for scene in scenes or ()]
        check_inputs(verification, benchmark, stability)
        made_folder(output)
        if seconds > 0:
            field = _Field(against is not None, named_commands(renderer or ()), technique or ())
            races: Races | None = _races(wanted, field, seconds, minutes, rounds, core, output)
        else:
            races = kept_races(curves)
        with progress_bar("verifying") as on_case:
            page = write_report(output, verification, on_case, benchmark, stability, wanted, races)
    if json_file and races:
        write_whole(json_file, to_json(races.scenes, races.header))
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
) -> Races:  # fmt: skip
    """Race all; unfinished work is in `output`/curves."""
    folder = output / "curves"
    folder.mkdir(parents=True, exist_ok=True)
    scenes = wanted or [variants.variant(name) for name in variants.scene_names()]
    runners = [(of, *field.of(of, folder)) for of in scenes]
    with progress_bar("racing") as on_step, pinned(core) as used:
        found = racing.race_all(
            runners, seconds=seconds, minutes=minutes, rounds=rounds, folder=folder, on_step=on_step
        )
    header = {"raycheck": raycheck_version(), "machine": machine(), "core": used, "command": command_line()}
    return Races([one for one, _ in found], header, {one.scene: pixels for one, pixels in found})
