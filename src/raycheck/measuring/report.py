"""The report: an index of all verdicts, and offline pages of scenes and techniques with pictures, error maps,
and error against run time.
"""

import json
import shlex
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from raycheck.base import data, pictures
from raycheck.base.arrays import Array
from raycheck.base.errors import NotFound
from raycheck.base.images import Image
from raycheck.base.machine import machine, raycheck_version, today
from raycheck.base.seeds import make_seeds
from raycheck.base.site import INDEX, Site
from raycheck.judging.cases import Case, Verification
from raycheck.judging.verdict_pages import VERDICTS, page_name
from raycheck.judging.verify import verify
from raycheck.measuring import log_log, price_tables, prices, race_plots, speed
from raycheck.measuring.audit import results as audits
from raycheck.measuring.audit import tables
from raycheck.measuring.contestants import oneray_line
from raycheck.measuring.matrix import matrix
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
    width: int
    height: int
    pictures: list[Picture]
    cases: list[dict[str, Any]]
    left_out: dict[str, list[str]]
    """Techniques without a case, by the reason."""
    reference: str
    curves: dict[str, Any] | None = None
    """What the template curves.html shows, as a dictionary."""
    data: dict[str, Any] = field(default_factory=dict)
    """What its scripts show."""


@dataclass(frozen=True)
class Races:
    """Error curves of scenes, with their pictures where they were just measured."""

    scenes: Sequence[SceneCurves]
    header: Mapping[str, object]
    pictures: Mapping[str, Mapping[str, Array]] = field(default_factory=dict)
    kept: bool = False
    """They were read from the references."""

    def of(self, scene: str) -> SceneCurves | None:
        return next((one for one in self.scenes if one.scene == scene), None)

    def badge(self, scene: SceneCurves | None) -> "Badge":
        """Where and when a scene's were measured, or most."""
        own = {"machine": scene.machine, "date": scene.date} if scene and scene.machine else self.header
        return Badge(str(own.get("machine", "")), str(own.get("date", ""))[:10], self.kept)


def kept_races(path: Path | None = None) -> Races | None:
    """The races of an earlier `report --json`, by default of the references; None if there are none."""
    kept = data.references_dir() / "error_curves.json"
    if path is None and not kept.is_file():
        return None
    scenes, header = read_curves(path or kept)
    return Races(scenes, header, kept=path is None)


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
    single: bool = False,
) -> Path:
    """Write `folder`/index.html, with a page for each scene and technique beside it or, `single`, all in it,
    and return its path; verifies quickly where no result of `verify --json` is given. `benchmark` is a result
    of scripts/benchmark.py, `stability` one of `raycheck stability --json`, by default those of the
    references if there are any. `scenes` are all canonical ones by default.
    """
    measured = speed_section(benchmark)
    stiff = stability_section(stability)
    audited = audit_section()
    wanted = list(scenes) or [variants.variant(name) for name in variants.scene_names()]
    verdicts = _verdicts(verification, on_case, scenes)
    oneray = oneray_path()
    labels = [of.label for of in wanted]
    cases = [case for case in verdicts["cases"] if _shown_at(case["scene"], labels)]
    site = Site(folder, single)
    badges = {"verdicts": _badge(verdicts, verification), "here": Badge(machine(), today(), kept=False)}
    common: dict[str, Any] = {
        "badges": badges, "verdicts": verdicts, "spp": PICTURE_SPP,
        "legend": site.picture("scale", pictures.legend()),
        "verification": "raycheck verify" + (" --thorough" if verdicts.get("mode") == "thorough" else ""),
    }  # fmt: skip
    sections = []
    for of in wanted:
        own = [case for case in cases if _shown_at(case["scene"], [of.label])]
        sections.append(_section(of, oneray, own, races, site, folder))
    raced = _races_summary(races, wanted) if races else None
    costs = _prices(labels)
    site.page(
        INDEX, "One scene file, two renderers, one verdict", "index.html", sections=sections, cases=cases,
        races=raced, lecture=_lecture(oneray, site) if LECTURE_SCENE in labels else [], speed=measured,
        stability=stiff, audit=audited, summary=_summary(cases), machine=machine(),
        version=raycheck_version(),
        techniques=TECHNIQUES, matrix=matrix(wanted, cases), lecture_spp=LECTURE_SPP,
        failed=[case for case in cases if case["verdict"] == Outcome.FAIL], **common,
    )  # fmt: skip
    for before, section, after in zip([None, *sections], sections, [*sections[1:], None], strict=False):
        site.page(
            f"scene-{section.name}", section.name, "scene.html", data=bool(section.data), section=section,
            before=before, after=after, columns=race_plots.COLUMNS, **common,
        )  # fmt: skip
        if section.data:
            site.data(f"scene-{section.name}", section.data)
    for technique_ in TECHNIQUES:
        site.page(
            f"technique-{technique_.name}", technique_.name, "technique.html", technique=technique_,
            cases=[case for case in cases if case["technique"] == technique_.name],
            left_out=_left_out_of(technique_.name, wanted), prices=costs.get(technique_.name, []),
            price_badge=_badge(_header_of("techniques.json"), data.references_dir()), **common,
        )  # fmt: skip
    for name, found in (("speed", measured), ("stability", stiff)):
        if found:
            site.page(name, name.title(), f"{name}.html", data=True, **{name: found}, **common)
            site.data(name, {"plots": found["drawn"]})
    if audited:
        site.page("audit", "Audit", "audit.html", audit=audited, **common)
    return site.finish("One scene file, two renderers, one verdict")


@dataclass(frozen=True)
class Badge:
    """Where and when figures were measured: kept in the references, or just now."""

    machine: str
    date: str
    kept: bool = True


def _badge(header: Mapping[str, Any], path: Path | None) -> Badge:
    """Of a result with this header that was read from a file; none was read where this run made it."""
    where = header.get("machine", "another machine")
    if not isinstance(where, str):
        where = where.get("processor", "another machine")
    kept = path is not None and path.resolve().is_relative_to(data.references_dir().resolve())
    return Badge(where, str(header.get("date", ""))[:10], kept)


def _header_of(name: str) -> dict[str, Any]:
    path = data.references_dir() / name
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    return found


def _shown_at(label: str, scenes: Sequence[str]) -> bool:
    """Whether one of these scenes' pages tells of a scene or of its variant."""
    return label in scenes or label.partition("@")[0] in scenes


def _left_out_of(name: str, wanted: Sequence[Variant]) -> dict[str, list[str]]:
    """The scenes that a technique does not apply to, by the reason."""
    found: dict[str, list[str]] = {}
    for of in wanted:
        if why := technique(name).why_not(read_content(of.path, of.parameters)):
            found.setdefault(why, []).append(of.label)
    return found


def _prices(labels: Collection[str]) -> dict[str, list[tuple[str, ...]]]:
    """What each technique costs, a row of a scene each, of the references."""
    path = data.references_dir() / "techniques.json"
    found: dict[str, list[tuple[str, ...]]] = {}
    for scene in prices.read(path) if path.is_file() else ():
        for price in scene.prices if scene.scene in labels else ():
            _, _, *cells = price_tables.row(price)
            found.setdefault(price.technique, []).append((scene.scene, *cells))
    return found


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


def _section(
    of: Variant, oneray: Path, cases: list[dict[str, Any]], races: Races | None, site: Site, folder: Path
) -> SceneSection:
    reference = references.load_reference(of)
    truth = truth_of(reference)
    raced = races.of(of.label) if races else None
    ours, shown = _render(oneray, of, BEST, PICTURE_SPP)
    stderr = ours.stderr if ours.stderr is not None else np.zeros_like(ours.pixels)
    factor = pictures.exposure(truth.mean)
    source = "closed form" if truth.closed_form else reference.made_by
    samples = reference.batches * reference.spp_per_batch
    error = pictures.error_map(ours.pixels, truth.mean, np.sqrt(stderr**2 + truth.variance))
    height, width = truth.shape

    def kept(what: str, pixels: pictures.Bytes) -> str:
        return site.picture(f"{of.label}-{what}", pixels)

    return SceneSection(
        name=of.label,
        about=_about(of.path),
        width=width,
        height=height,
        pictures=[
            Picture(kept("reference", pictures.display(truth.mean, factor)), f"reference: {source}"),
            Picture(kept("oneray", pictures.display(ours.pixels, factor)),
                    f"oneray, {BEST}, {PICTURE_SPP} spp", shown.command, shown.seconds),
            Picture(kept("error", error), "oneray − reference, in standard errors"),
        ],
        cases=[case | _shown_case(case, of, folder) for case in cases],
        left_out=left_out(read_content(of.path, of.parameters)),
        reference=f"{source}; {reference.made_by} rendered {samples:,} samples per pixel "
        f"in {reference.batches} batches",
        curves=_curves_section(raced, races) if races and raced else None,
        data=_curves_data(raced, races) if races and raced else {},
    )  # fmt: skip


def _shown_case(case: Mapping[str, Any], of: Variant, folder: Path) -> dict[str, Any]:
    """The commands of a verdict and of its picture, and the page that has its pictures."""
    name = case["technique"]
    command = shlex.join(["raycheck", "verify", case["scene"], "--technique", name])
    page = folder / VERDICTS / "pages" / f"{page_name(case['scene'], name)}.html"
    known = next((one for one in TECHNIQUES if one.name == name), None)
    judged = variants.variant(case["scene"]) if of.canonical else of
    picture = oneray_line(judged, known.options) if known else ""
    return {
        "command": command, "picture": picture.replace("{spp}", "1024").replace("{seed}", "1"),
        "page": f"{VERDICTS}/pages/{page.name}" if page.is_file() else "",
    }  # fmt: skip


def _curves_section(found: SceneCurves, races: Races) -> dict[str, Any]:
    """What curves.html shows of a scene."""
    chosen = race_plots.colours(found)
    return {
        "scene": found.scene, "width": found.width, "height": found.height, "floor": found.floor,
        "epsilon": found.epsilon, "baseline": found.baseline,
        "viewer": bool(found.equal_samples and races.pictures.get(found.scene)),
        "drawn": race_plots.plots(found) is not None,
        "choices": [*race_plots.METRICS, "bias and standard deviation"],
        "colours": chosen, "columns": race_plots.COLUMNS, "rows": race_plots.rows(found),
        "bars": race_plots.efficiencies(found), "startup": race_plots.startup_lines(found),
        "command": _scene_command(str(races.header["command"]), found.scene),
        "badge": races.badge(found),
    }  # fmt: skip


def _curves_data(found: SceneCurves, races: Races) -> dict[str, Any]:
    """What the scripts show of a scene."""
    viewer = race_plots.viewer(found, races.pictures.get(found.scene, {}))
    return {"races": race_plots.plots(found), "viewer": viewer}


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
        "command": races.header.get("command"),
        "badge": races.badge(None),
        "within": within, "total": total, "names": names,
        "targets": [(one.scene, [_target_cell(one, name) for name in names]) for one in shown],
        "flagged": race_plots.flagged(shown),
    }  # fmt: skip


def _target_cell(scene: SceneCurves, name: str) -> race_plots.Cell:
    curve: Curve | None = next((one for one in scene.curves if one.name == name and not one.reason), None)
    return race_plots.Cell(*race_plots.to_target(curve)) if curve else race_plots.Cell("–", float("inf"))


def _lecture(oneray: Path, site: Site) -> list[Picture]:
    """The lecture's two pictures: the same scene and samples, without and with next event estimation."""
    if LECTURE_SCENE not in variants.scene_names():
        return []
    factor = pictures.exposure(truth_of(references.load_reference(LECTURE_SCENE)).mean)
    result = []
    for name, caption in (("walk-cosine", "random walk"), ("nee", "random walk with next event estimation")):
        image, shown = _render(oneray, variants.variant(LECTURE_SCENE), name, LECTURE_SPP)
        uri = site.picture(f"{LECTURE_SCENE}-{name}", pictures.display(image.pixels, factor))
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
    drawn: dict[str, Any]
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
        drawn = log_log.log_log(points, one["label"], "seconds")
        plots.append(_Plot(one["label"], one["scene"], drawn, legend))
    return {
        "scenes": [(scene, speed.rows(scene), speed.startup_lines(scene)) for scene in found["scenes"]],
        "columns": speed.COLUMNS,
        "plots": plots,
        "drawn": [plot.drawn for plot in plots],
        "badge": _badge(found, path or kept),
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
    found = plots.section(path or kept, compared if compared.is_file() else None)
    drawn = [plot.drawn for case in found["cases"] for plot in case.plots]
    return found | {"drawn": drawn, "badge": _badge(found, path or kept)}


def audit_section() -> dict[str, Any] | None:
    """What audit.html shows of the references' audit of renderers; None without one."""
    kept = data.references_dir() / "audit.json"
    if not kept.is_file():
        return None
    records, header = audits.read(kept)
    intervals = sum(len(one.values) for one in records)
    return tables.for_report(records) | {
        "badge": _badge(header, kept), "intervals": intervals,
        "level": f"{header['level']:g}".replace("e-0", "e-"),
        "alarms": f"{intervals * header['level']:.2g}",
    }  # fmt: skip


def _about(scene: Path) -> str:
    """The comment that a scene file begins with."""
    first, *_ = document.comments(scene) or [""]
    return " ".join(first.split())


def _summary(cases: list[Mapping[str, Any]]) -> dict[str, int]:
    return {name: sum(c["verdict"] == name for c in cases) for name in Outcome}
