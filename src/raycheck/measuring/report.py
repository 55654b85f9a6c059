"""The report: one offline page with pictures, error maps, verdicts, and error against run time."""

import json
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from markupsafe import Markup

from raycheck.base import data, pictures
from raycheck.base.arrays import Array
from raycheck.base.data import PACKAGE
from raycheck.base.errors import NotFound
from raycheck.base.files import write_whole
from raycheck.base.images import Image
from raycheck.base.machine import machine, raycheck_version
from raycheck.base.seeds import make_seeds
from raycheck.base.text import duration, percent, signed
from raycheck.judging.cases import Case, Verification
from raycheck.judging.verify import verify
from raycheck.measuring import log_log, race_plots, speed
from raycheck.measuring.contestants import oneray_line
from raycheck.measuring.races.curves import Curve, SceneCurves
from raycheck.measuring.races.curves import read as read_curves
from raycheck.measuring.stability import plots
from raycheck.renderers.oneray import oneray_command, oneray_path
from raycheck.scene import document, variants
from raycheck.scene.content import read_content
from raycheck.scene.techniques import BEST, TECHNIQUES, left_out, technique
from raycheck.scene.variants import Variant
from raycheck.stats.verdict import Outcome
from raycheck.truth import references
from raycheck.truth.expected import truth_of

PICTURE_SPP = 1024
LECTURE_SPP = 36
LECTURE_SCENE = "lecture"


@dataclass(frozen=True)
class Picture:
    """An image of the page, with what a reader who cannot see it needs."""

    uri: str
    caption: str
    command: str = ""
    seconds: float | None = None


@dataclass(frozen=True)
class SceneSection:
    name: str
    about: str
    pictures: list[Picture]
    cases: list[dict[str, Any]]
    left_out: dict[str, list[str]]
    """Techniques without a case, by the reason."""
    reference: str
    curves: dict[str, Any] | None = None
    """What the template curves.html shows, as a dictionary."""


@dataclass(frozen=True)
class Races:
    """Error curves of scenes, with their pictures where they were just measured."""

    scenes: Sequence[SceneCurves]
    header: Mapping[str, object]
    pictures: Mapping[str, Mapping[str, Array]] = field(default_factory=dict)

    def of(self, scene: str) -> SceneCurves | None:
        return next((one for one in self.scenes if one.scene == scene), None)


def kept_races(path: Path | None = None) -> Races | None:
    """The races of an earlier `report --json`, by default of the references; None if there are none."""
    kept = data.references_dir() / "error_curves.json"
    if path is None and not kept.is_file():
        return None
    scenes, header = read_curves(path or kept)
    return Races(scenes, header)


def check_inputs(verification: Path | None, benchmark: Path | None, stability: Path | None) -> None:
    """NotFound or another plain error if `write_report` could not read one of these files: said before a long
    race, not after it.
    """
    if verification:
        Verification.read(verification)
    speed_section(benchmark)
    stability_section(stability)


def write_report(
    folder: Path,
    verification: Path | None = None,
    on_case: Callable[[Case, int], None] | None = None,
    benchmark: Path | None = None,
    stability: Path | None = None,
    scenes: Sequence[Variant] = (),
    races: Races | None = None,
) -> Path:
    """Write `folder`/index.html and return its path; verifies quickly where no result of `verify --json` is
    given. `benchmark` is a result of scripts/benchmark.py, `stability` one of `raycheck stability --json`, by
    default those of the references if there are any. `scenes` are all canonical ones by default.
    """
    measured = speed_section(benchmark)
    stiff = stability_section(stability)
    wanted = scenes or [variants.variant(name) for name in variants.scene_names()]
    verdicts = _verdicts(verification, on_case, scenes)
    oneray = oneray_path()
    labels = [of.label for of in wanted]
    cases = [case for case in verdicts["cases"] if case["scene"] in labels]
    sections = [_section(of, oneray, [c for c in cases if c["scene"] == of.label], races) for of in wanted]
    page = template().render(
        sections=sections, cases=cases, races=_races_summary(races, wanted) if races else None,
        lecture=_lecture(oneray) if LECTURE_SCENE in labels else [], speed=measured, stability=stiff,
        legend=pictures.data_uri(pictures.legend()), range=int(pictures.RANGE), verdicts=verdicts,
        summary=_summary(cases), machine=machine(), version=raycheck_version(), techniques=TECHNIQUES,
        verification="raycheck verify" + (" --thorough" if verdicts.get("mode") == "thorough" else ""),
        percent=percent, signed=signed, duration=duration, spp=PICTURE_SPP, lecture_spp=LECTURE_SPP,
    )  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "index.html"
    write_whole(path, page)
    return path


def _verdicts(
    path: Path | None, on_case: Callable[[Case, int], None] | None, scenes: Sequence[Variant]
) -> dict[str, Any]:
    if path is None:
        names = [of.label if of.canonical else of.path for of in scenes]
        found = verify(None, names, on_case=on_case)
    else:
        found = Verification.read(path)
    result: dict[str, Any] = json.loads(found.to_json())
    try:
        return result | {key: found.header[key] for key in ("mode", "date", "machine", "totals")}
    except KeyError as error:
        raise NotFound(f"{path}: an unfinished result of raycheck verify --json (no {error})") from None


def template(name: str = "report.html") -> jinja2.Template:
    """The page, or a part of it."""
    loader = jinja2.FileSystemLoader(PACKAGE / "templates")
    environment = jinja2.Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True)
    return environment.get_template(name)


def _section(of: Variant, oneray: Path, cases: list[dict[str, Any]], races: Races | None) -> SceneSection:
    reference = references.load_reference(of)
    truth = truth_of(reference)
    raced = races.of(of.label) if races else None
    ours, shown = _render(oneray, of, BEST, PICTURE_SPP)
    stderr = ours.stderr if ours.stderr is not None else np.zeros_like(ours.pixels)
    factor = pictures.exposure(truth.mean)
    source = "closed form" if truth.closed_form else reference.made_by
    samples = reference.batches * reference.spp_per_batch
    error = pictures.error_map(ours.pixels, truth.mean, np.sqrt(stderr**2 + truth.variance))
    return SceneSection(
        name=of.label,
        about=_about(of.path),
        pictures=[
            Picture(pictures.data_uri(pictures.display(truth.mean, factor)), f"reference: {source}"),
            Picture(pictures.data_uri(pictures.display(ours.pixels, factor)),
                    f"oneray, {BEST}, {PICTURE_SPP} spp", shown.command, shown.seconds),
            Picture(pictures.data_uri(error), "oneray − reference, in standard errors"),
        ],
        cases=cases,
        left_out=left_out(read_content(of.path, of.parameters)),
        reference=f"{source}; {reference.made_by} rendered {samples:,} samples per pixel "
        f"in {reference.batches} batches",
        curves=_curves_section(raced, races) if races and raced else None,
    )  # fmt: skip


def _curves_section(found: SceneCurves, races: Races) -> dict[str, Any]:
    """What curves.html shows of a scene."""
    colours = race_plots.colours(found)
    return {
        "scene": found.scene, "width": found.width, "height": found.height, "floor": found.floor,
        "epsilon": found.epsilon, "baseline": found.baseline,
        "viewer": race_plots.viewer(found, races.pictures.get(found.scene, {})),
        "figures": race_plots.figures(found),
        "marks": [(name, Markup(log_log.key(index))) for name, index in colours.items()],
        "columns": race_plots.COLUMNS, "rows": race_plots.rows(found),
        "bars": race_plots.efficiency_bars(found), "startup": race_plots.startup_lines(found),
        "command": _scene_command(str(races.header["command"]), found.scene),
    }  # fmt: skip


def _scene_command(command: str, scene: str) -> str:
    """The command of the whole report, for one scene alone."""
    words = shlex.split(command)
    named = {one.partition("@")[0] for one in variants.scene_names()}
    rest = [word for word in words[2:] if word.partition("@")[0] not in named]
    return shlex.join([*words[:2], scene, *rest])


def _races_summary(races: Races, wanted: Sequence[Variant]) -> dict[str, Any]:
    """What the page says of all scenes together."""
    shown = [one for of in wanted if (one := races.of(of.label))]
    unbounded = {of.label: read_content(of.path, of.parameters).unbounded for of in wanted}
    within, total = race_plots.slopes_summary(shown, unbounded)
    names = list(dict.fromkeys(name for one in shown for name in race_plots.colours(one)))
    return {
        "rounds": shown[0].rounds if shown else 0,
        "core": races.header.get("core"),
        "machine": races.header.get("machine"),
        "command": races.header.get("command"),
        "within": within, "total": total, "names": names,
        "targets": [(one.scene, [_target_cell(one, name) for name in names]) for one in shown],
        "flagged": race_plots.flagged(shown),
    }  # fmt: skip


def _target_cell(scene: SceneCurves, name: str) -> race_plots.Cell:
    curve: Curve | None = next((one for one in scene.curves if one.name == name and not one.reason), None)
    return race_plots.Cell(*race_plots.to_target(curve)) if curve else race_plots.Cell("", float("inf"))


def _lecture(oneray: Path) -> list[Picture]:
    """The lecture's two pictures: the same scene and samples, without and with next event estimation."""
    if LECTURE_SCENE not in variants.scene_names():
        return []
    factor = pictures.exposure(truth_of(references.load_reference(LECTURE_SCENE)).mean)
    result = []
    for name, caption in (("walk-cosine", "random walk"), ("nee", "random walk with next event estimation")):
        image, shown = _render(oneray, variants.variant(LECTURE_SCENE), name, LECTURE_SPP)
        uri = pictures.data_uri(pictures.display(image.pixels, factor))
        result.append(Picture(uri, f"{caption}, {LECTURE_SPP} spp", shown.command, shown.seconds))
    return result


@dataclass(frozen=True)
class _Shown:
    command: str
    seconds: float


def _render(oneray: Path, of: Variant, name: str, spp: int) -> tuple[Image, _Shown]:
    """Render with oneray; the command that reproduces the picture comes along."""
    options = technique(name).options
    seed = make_seeds(f"report/{of.label}/{name}", 1)[0]
    command = oneray_command(oneray, options, of.parameters)
    made = command.render(of.path, spp, seed, timeout=600.0)
    shown = oneray_line(of, options)
    text = shown.replace("{spp}", str(spp)).replace("{seed}", str(seed))
    return made.image, _Shown(text, made.seconds)


@dataclass(frozen=True)
class _Plot:
    """How cost grows along an axis."""

    label: str
    scene: str
    svg: Markup
    curves: list[tuple[str, str, str]]
    """Name, exponent, and why it ends where it does."""


def speed_section(path: Path | None) -> dict[str, Any] | None:
    """What speed.html shows; None where there is no benchmark and none was asked for."""
    kept = data.references_dir() / "benchmark.json"
    if path is None and not kept.is_file():
        return None
    found = speed.read(path or kept)
    plots = []
    for one in found["growth"]:
        points = {c["name"]: [(p["x"], p["render"]) for p in c["points"]] for c in one["curves"]}
        legend = [(c["name"], speed.exponent_text(c), c["reason"]) for c in one["curves"]]
        svg = Markup(log_log.log_log(points, one["label"], "seconds"))
        plots.append(_Plot(one["label"], one["scene"], svg, legend))
    return {
        "scenes": [(scene, speed.rows(scene), speed.startup_lines(scene)) for scene in found["scenes"]],
        "columns": speed.COLUMNS,
        "plots": plots,
        "marks": [Markup(log_log.key(index)) for index in range(3)],
        "made_with": speed.made_with(found),
        "command": found["command"],
        "complete": found["complete"],
    }


def stability_section(path: Path | None) -> dict[str, Any] | None:
    """What stability.html shows; None where nothing was measured and nothing was asked for."""
    kept = data.references_dir() / "stability.json"
    if path is None and not kept.is_file():
        return None
    compared = data.references_dir() / "precisions.json"
    return plots.section(path or kept, compared if compared.is_file() else None)


def _about(scene: Path) -> str:
    """The comment that a scene file begins with."""
    first, *_ = document.comments(scene) or [""]
    return " ".join(first.split())


def _summary(cases: list[Mapping[str, Any]]) -> dict[str, int]:
    return {name: sum(c["verdict"] == name for c in cases) for name in Outcome}
