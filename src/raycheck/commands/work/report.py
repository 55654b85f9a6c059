"""The races of raycheck report."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from raycheck.base.machine import machine, raycheck_version, today
from raycheck.commands.edge import command_line
from raycheck.commands.terminal import progress_bar
from raycheck.measuring.contestants import (
    Contestant,
    command_contestant,
    mitsuba_contestants,
    oneray_contestants,
    pinned,
)
from raycheck.measuring.races import racing
from raycheck.measuring.report import Races
from raycheck.scene import variants


@dataclass(frozen=True)
class Field:
    """Who races beside oneray's techniques."""

    mitsuba: bool
    commands: Mapping[str, str]
    techniques: Sequence[str]

    def of(self, scene: variants.Variant, folder: Path) -> tuple[list[Contestant], dict[str, str]]:
        own, left_out = oneray_contestants(scene, self.techniques)
        others = [command_contestant(name, cmd, scene, folder) for name, cmd in self.commands.items()]
        return [*own, *(mitsuba_contestants(scene) if self.mitsuba else []), *others], left_out


def race(
    wanted: Sequence[variants.Variant], field: Field, seconds: float, minutes: float | None, rounds: int,
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
    header = {"raycheck": raycheck_version(), "machine": machine(), "date": today(),
              "core": used, "command": command_line()}  # fmt: skip
    return Races([one for one, _ in found], header, {one.scene: pixels for one, pixels in found})
