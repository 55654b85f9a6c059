"""What a race showed: the figures of each contestant in a scene, in memory and in a file."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from raycheck.base.errors import NotFound
from raycheck.base.text import scenes_json
from raycheck.stats.convergence import Band, Level
from raycheck.stats.spread import Spread
from raycheck.truth.provenance import Provenance


@dataclass(frozen=True)
class Curve:
    """What one contestant showed in a scene."""

    name: str
    about: str
    command: str
    reason: str = ""
    """Why it has no curve; empty where it has."""
    levels: list[Level] = field(default_factory=list)
    start_seconds: float = 0.0
    """Process time of a picture before its first sample."""
    opened: dict[str, float] = field(default_factory=dict)
    """Seconds to get ready once, by what took them."""
    sample_seconds: Spread | None = None
    """Process time of one sample of every pixel, over the rounds."""
    slope: Band | None = None
    """Slope of log RMSE over log samples."""
    relative_slope: Band | None = None
    """The same of the root of relMSE."""
    slope_without_outliers: Band | None = None
    flag: str = ""
    """"bias", "heavy tails", "slow" or nothing."""
    why: str = ""
    detectable: float | None = None
    """Relative bias of the image mean that would have been found nine times in ten."""
    seconds_to_target: float | None = None
    """None where it does not vary, or its bias is larger."""
    efficiency: Band | None = None
    """1/(variance · time), s⁻¹ (W·sr⁻¹·m⁻²)⁻²."""
    relative_efficiency: Band | None = None

    def seconds(self, spp: float) -> float:
        return spp * self.sample_seconds.median if self.sample_seconds else 0.0


@dataclass(frozen=True)
class Shown:
    """A picture for the page; its pixels are in the scene's file of pictures under `key`."""

    key: str
    name: str
    spp: int
    seconds: float
    rmse: float
    relmse: float
    command: str


@dataclass(frozen=True)
class SceneCurves:
    scene: str
    width: int
    height: int
    rounds: int
    baseline: str
    mean: float
    """Mean of the reference over pixels and channels."""
    epsilon: float
    floor: float
    """RMSE of the reference itself, 0 where a closed form stands."""
    reference: str
    curves: list[Curve]
    left_out: dict[str, str] = field(default_factory=dict)
    equal_samples: list[Shown] = field(default_factory=list)
    equal_time: list[Shown] = field(default_factory=list)
    provenance: Provenance = field(default_factory=dict)
    machine: str = ""
    """Where it was measured, and when; empty where that is the file's header's."""
    date: str = ""


def to_json(scenes: Sequence[SceneCurves], header: Mapping[str, object]) -> str:
    """All figures, four digits each, a contestant a line."""
    return scenes_json(header, "curves", map(asdict, scenes))


def read(path: Path) -> tuple[list[SceneCurves], dict[str, Any]]:
    """The scenes and the header of a file that `to_json` wrote; NotFound if it is none."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        scenes = [from_dict(one) for one in found.pop("scenes")]
    except (OSError, ValueError, KeyError, TypeError) as error:
        what = error or "wrong structure"
        raise NotFound(f"{path}: no result of raycheck report --json ({what})") from None
    return scenes, found


BANDS = ("slope", "relative_slope", "slope_without_outliers", "efficiency", "relative_efficiency")


def from_dict(found: Mapping[str, Any]) -> SceneCurves:
    """The curves of a scene from what asdict made of them."""
    shown = {k: [Shown(**one) for one in found[k]] for k in ("equal_samples", "equal_time")}
    curves = [_curve_from(one) for one in found["curves"]]
    return SceneCurves(**{**found, **shown, "curves": curves})


def _curve_from(found: Mapping[str, Any]) -> Curve:
    bands = {k: Band(**found[k]) for k in BANDS if found[k]}
    spread = {"sample_seconds": Spread(**found["sample_seconds"])} if found["sample_seconds"] else {}
    levels = [
        Level(**{k: Band(**v) if isinstance(v, dict) else v for k, v in one.items()})  # type: ignore[arg-type]
        for one in found["levels"]
    ]
    return Curve(**{**found, **bands, **spread, "levels": levels})
