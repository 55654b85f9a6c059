"""The report: one offline page with pictures, error maps and verdicts."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import jinja2
import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from raycheck import curves, pictures, references, renderers, speed, stability_plots, words
from raycheck.images import Image
from raycheck.renderers import NotFound
from raycheck.seeds import make_seeds
from raycheck.techniques import BEST, TECHNIQUES, left_out, read_content, technique
from raycheck.truth import truth_of
from raycheck.verify import Case, Verification, machine, raycheck_version, verify

Array = NDArray[np.float64]

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
    cases: list[dict]
    left_out: dict[str, list[str]]
    """Techniques without a case, by the reason."""
    reference: str


def write_report(
    folder: Path,
    verification: Path | None = None,
    on_case: Callable[[Case, int], None] | None = None,
    benchmark: Path | None = None,
    stability: Path | None = None,
) -> Path:
    """Write `folder`/index.html and return its path; verifies quickly where no result of `verify --json` is
    given. `benchmark` is a result of scripts/benchmark.py, `stability` one of `raycheck stability --json`, by
    default those of the references if there are any.
    """
    measured = speed_section(benchmark)
    stiff = stability_section(stability)
    verdicts = _verdicts(verification, on_case)
    oneray = renderers.oneray_path()
    cases = verdicts["cases"]
    sections = [
        _section(name, oneray, [c for c in cases if c["scene"] == name]) for name in references.scene_names()
    ]
    page = template().render(
        sections=sections,
        lecture=_lecture(oneray),
        speed=measured,
        stability=stiff,
        legend=pictures.data_uri(pictures.legend()),
        range=int(pictures.RANGE),
        verdicts=verdicts,
        summary=_summary(cases),
        machine=machine(),
        version=raycheck_version(),
        techniques=TECHNIQUES,
        verification="raycheck verify" + (" --thorough" if verdicts.get("mode") == "thorough" else ""),
        percent=words.percent,
        signed=words.signed,
        duration=words.duration,
        spp=PICTURE_SPP,
        lecture_spp=LECTURE_SPP,
    )
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "index.html"
    partial = folder / ".index.html.part"
    partial.write_text(page, encoding="utf-8")
    partial.replace(path)
    return path


def _verdicts(path: Path | None, on_case: Callable[[Case, int], None] | None) -> dict:
    if path is None:
        result: Verification = verify(on_case=on_case)
        return json.loads(result.to_json())
    found = Verification.read(path)
    try:
        return json.loads(found.to_json()) | {
            key: found.header[key] for key in ("mode", "date", "machine", "totals")
        }
    except KeyError as error:
        raise NotFound(f"{path}: an unfinished result of raycheck verify --json (no {error})") from None


def template(name: str = "report.html") -> jinja2.Template:
    """The page, or a part of it."""
    loader = jinja2.FileSystemLoader(Path(__file__).parent / "templates")
    environment = jinja2.Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True)
    return environment.get_template(name)


def _section(name: str, oneray: Path, cases: list[dict]) -> SceneSection:
    reference = references.load_reference(name)
    truth = truth_of(reference)
    ours, shown = _render(oneray, name, BEST, PICTURE_SPP)
    stderr = ours.stderr if ours.stderr is not None else np.zeros_like(ours.pixels)
    factor = pictures.exposure(truth.mean)
    source = "closed form" if truth.closed_form else reference.made_by
    samples = reference.batches * reference.spp_per_batch
    error = pictures.error_map(ours.pixels, truth.mean, np.sqrt(stderr**2 + truth.variance))
    return SceneSection(
        name=name,
        about=_about(references.scene_path(name)),
        pictures=[
            Picture(pictures.data_uri(pictures.display(truth.mean, factor)), f"reference: {source}"),
            Picture(pictures.data_uri(pictures.display(ours.pixels, factor)),
                    f"oneray, {BEST}, {PICTURE_SPP} spp", shown.command, shown.seconds),
            Picture(pictures.data_uri(error), "oneray − reference, in standard errors"),
        ],
        cases=cases,
        left_out=left_out(read_content(references.scene_path(name))),
        reference=f"{source}; {reference.made_by} rendered {samples:,} samples per pixel "
        f"in {reference.batches} batches",
    )  # fmt: skip


def _lecture(oneray: Path) -> list[Picture]:
    """The lecture's two pictures: the same scene and samples, without and with next event estimation."""
    if LECTURE_SCENE not in references.scene_names():
        return []
    factor = pictures.exposure(truth_of(references.load_reference(LECTURE_SCENE)).mean)
    result = []
    for name, caption in (("walk-cosine", "random walk"), ("nee", "random walk with next event estimation")):
        image, shown = _render(oneray, LECTURE_SCENE, name, LECTURE_SPP)
        uri = pictures.data_uri(pictures.display(image.pixels, factor))
        result.append(Picture(uri, f"{caption}, {LECTURE_SPP} spp", shown.command, shown.seconds))
    return result


@dataclass(frozen=True)
class _Shown:
    command: str
    seconds: float


def _render(oneray: Path, scene: str, name: str, spp: int) -> tuple[Image, _Shown]:
    """Render with oneray; the command that reproduces the picture comes along."""
    options = technique(name).options
    seed = make_seeds(f"report/{scene}/{name}", 1)[0]
    command = renderers.oneray_command(oneray, options)
    made = command.render(references.scene_path(scene), spp, seed, timeout=600.0)
    text = f"oneray scenes/{scene}.xml -o {scene}.exr --spp {spp} --seed {seed} {' '.join(options)}"
    return made.image, _Shown(text, made.seconds)


@dataclass(frozen=True)
class _Plot:
    """How cost grows along an axis."""

    label: str
    scene: str
    svg: Markup
    curves: list[tuple[str, str, str]]
    """Name, exponent, and why it ends where it does."""


def speed_section(path: Path | None) -> dict | None:
    """What speed.html shows; None where there is no benchmark and none was asked for."""
    kept = references.references_dir() / "benchmark.json"
    if path is None and not kept.is_file():
        return None
    found = speed.read(path or kept)
    plots = []
    for one in found["growth"]:
        points = {c["name"]: [(p["x"], p["render"]) for p in c["points"]] for c in one["curves"]}
        legend = [(c["name"], speed.exponent_text(c), c["reason"]) for c in one["curves"]]
        svg = Markup(curves.log_log(points, one["label"], "seconds"))
        plots.append(_Plot(one["label"], one["scene"], svg, legend))
    return {
        "scenes": [(scene, speed.rows(scene), speed.startup_lines(scene)) for scene in found["scenes"]],
        "columns": speed.COLUMNS,
        "plots": plots,
        "marks": [Markup(curves.key(index)) for index in range(3)],
        "made_with": speed.made_with(found),
        "command": found["command"],
        "complete": found["complete"],
    }


def stability_section(path: Path | None) -> dict | None:
    """What stability.html shows; None where nothing was measured and nothing was asked for."""
    kept = references.references_dir() / "stability.json"
    if path is None and not kept.is_file():
        return None
    return stability_plots.section(path or kept)


def _about(scene: Path) -> str:
    """The comment that a scene file begins with."""
    text = scene.read_text(encoding="utf-8")
    start, end = text.find("<!--"), text.find("-->")
    return " ".join(text[start + 4 : end].split()) if 0 <= start < end else ""


def _summary(cases: list[Mapping]) -> dict[str, int]:
    return {name: sum(c["verdict"] == name for c in cases) for name in ("PASS", "FAIL", "INCONCLUSIVE")}
