"""Options that commands share, and the long ones of verify and report."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

Scenes = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[SCENE]...", help="Names, labels such as furnace@depth=2, or files; all by default."
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option("-D", metavar="name=value", help="Another value for a <default> of the scene."),
]
Technique = Annotated[
    list[str] | None, typer.Option(metavar="NAME", help="Only this technique of oneray; may be repeated.")
]
RendererCommand = Annotated[
    str | None,
    typer.Option(
        metavar="CMD",
        help="This command, with {output} and where it can {scene} or {json}, {spp} {seed}; or a folder with "
        "a raycheck.toml.",
    ),
]
Needs = Annotated[
    str | None,
    typer.Option(
        metavar="WORDS",
        help="Only scenes that need no other shapes, lights or surfaces than these, such as "
        "rectangle,sphere; in the words that raycheck scene prints.",
    ),
]
Pictures = Annotated[
    str | None,
    typer.Option(
        metavar="GLOB[:LAYER]", help="Judge pictures of one SCENE that are already rendered, or their LAYER."
    ),
]
JsonFile = Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Also write all figures here.")]
JunitFile = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Also write the verdicts here as JUnit XML, for CI.")
]
MarkdownFile = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Also write the verdicts here as Markdown, for the summary of a job."),
]
HtmlFolder = Annotated[
    Path | None,
    typer.Option(
        "--html",
        metavar="DIR",
        help="Also leave a page for each verdict: your picture, the reference, and where they differ.",
    ),
]
Seconds = Annotated[
    float | None, typer.Option(min=1, help="Budget of the whole run, 90 by default; not for --thorough.")
]
Until = Annotated[
    float | None,
    typer.Option(
        min=1,
        metavar="SECONDS",
        help="Look again, with fresh samples, at what is not decided, so long; the level holds all the same.",
    ),
]
Detect = Annotated[
    str | None,
    typer.Option(
        metavar="PERCENT",
        help="Take the samples that show such a bias of the image, as in 0.5%; says first how long.",
    ),
]
Consistent = Annotated[
    str | None,
    typer.Option(
        metavar="PARAM=v1,v2,v3,v4",
        help="Judge what the bias tends to as {PARAM} of the --renderer goes from coarse to fine.",
    ),
]
Baseline = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE", help="An earlier verify --json: also say which scenes changed since, and by how much."
    ),
]
Level = Annotated[
    float | None,
    typer.Option(
        min=1e-7,
        max=0.05,
        help="Chance that any FAIL of the whole run is wrong; by default 1e-5 for each case.",
    ),
]
Delta = Annotated[
    float | None,
    typer.Option(
        min=1e-4,
        max=0.5,
        help="A PASS means: the image within this of the reference, 0.01 by default, tiles within 5 times.",
    ),
]
Thorough = Annotated[bool, typer.Option("--thorough", help="As many samples as the committed result has.")]
Resume = Annotated[
    bool,
    typer.Option(
        "--resume", help="Keep the verdicts of --json FILE whose renderer and reference are the same."
    ),
]
Seed = Annotated[int, typer.Option(help="Another number gives all-new samples.")]
Spp = Annotated[int | None, typer.Option(min=1, help="Samples per pixel of each judged image.")]
Jobs = Annotated[int | None, typer.Option(min=1, help="Renders at a time, 2 by default.")]
Timeout = Annotated[float | None, typer.Option(help="Seconds that one render may take.")]

Watch = Annotated[
    list[Path] | None,
    typer.Option(
        metavar="FILE", help="What the program is, where not the files of its command; may be repeated."
    ),
]
ClimbState = Annotated[
    Path | None,
    typer.Option(
        "--state", metavar="FILE", help="What is kept between runs, by default raycheck-climb.json in the "
        "renderer's folder, or here.",
    ),
]  # fmt: skip
ClimbPages = Annotated[
    Path | None,
    typer.Option("--html", metavar="DIR", help="Where the pages go; by default named as the state."),
]
RungSeconds = Annotated[
    float | None, typer.Option(min=1, help="Budget of each scene, by default 20 or what it takes.")
]


class Other(StrEnum):
    """Renderers that a report can race oneray against."""

    MITSUBA = "mitsuba"


Against = Annotated[
    Other | None, typer.Option(help="Race against Mitsuba's variants llvm_ad_rgb and scalar_rgb too.")
]
Racers = Annotated[
    list[str] | None,
    typer.Option(
        metavar='NAME="CMD"',
        help="Race against this command too, with {output} {spp} {seed} and where it can {scene}; "
        "may be repeated.",
    ),
]
RaceSeconds = Annotated[
    float,
    typer.Option(
        min=0,
        help="Process time of each contestant in each scene, all rounds together; 0 shows the error "
        "curves of --curves and races nothing.",
    ),
]
RaceMinutes = Annotated[
    float | None, typer.Option(min=0.1, help="Lower --seconds so that all races are done in this time.")
]
Core = Annotated[int | None, typer.Option(help="The core that renderers are pinned to; by default the last.")]
ReportFolder = Annotated[
    Path,
    typer.Option(
        "--output", "--out", "-o", metavar="DIR",
        help="Where index.html goes; an interrupted run there is continued.",
    ),
]  # fmt: skip
CurvesJson = Annotated[
    Path | None, typer.Option("--json", metavar="FILE", help="Also write all figures of the curves here.")
]
Verdicts = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Verdicts of an earlier verify --json; verifies otherwise."),
]
EarlierCurves = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE", help="With --seconds 0: an earlier report --json; by default the references'."
    ),
]
BenchmarkFigures = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Figures of scripts/benchmark.py; by default those of the references."),
]
StabilityFigures = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Figures of stability --json; by default those of the references."),
]


Assigned = Annotated[Path, typer.Option(metavar="FILE.toml", help="What is asked.")]
