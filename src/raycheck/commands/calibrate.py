"""raycheck calibrate: measure raycheck itself, into references/calibration.json.

`nulls`, `looks`, `mutants` and `gradings` are split over processes or machines, each of which needs the
checkout.
What measures is imported by the command that needs it: scipy.stats, for the rules of others, takes a second.
"""

import json
from pathlib import Path
from typing import Annotated

import typer

from raycheck.base import data
from raycheck.base.errors import NotFound
from raycheck.base.files import write_whole
from raycheck.calibration import mutants
from raycheck.calibration.mutants import Mutant
from raycheck.renderers import pools
from raycheck.scene import variants

app = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    help="Measure raycheck itself: false alarms, kill rate, detectable bias, naming.",
)

WORK = data.ROOT / "build/calibration"
LINES = data.references_dir() / "calibration"
"""Verdicts one by one, committed: a run judges what they do not have of today's pictures."""
Names = Annotated[list[str] | None, typer.Argument(metavar="[MUTANT]...", help="All by default.")]
Scenes = Annotated[list[str] | None, typer.Argument(metavar="[SCENE]...", help="Names; all by default.")]
Folder = Annotated[
    Path, typer.Option("--work", metavar="DIR", help="Where results are kept, so that a run can go on.")
]
Jobs = Annotated[int | None, typer.Option(min=1, help="Processes here, one a core by default.")]
Cluster = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="The scheduler of a Dask cluster, with a checkout on each machine."),
]
Result = Annotated[
    Path | None,
    typer.Option("--json", metavar="FILE", help="The section is put in here; references/calibration.json."),
]


@app.command(name="nulls")
def run_nulls(
    sets: Annotated[
        int, typer.Option(min=1, help="Of images, for each configuration; 8 verdicts each.")
    ] = 40,
    work: Folder = LINES,
    jobs: Jobs = None,
    dask: Cluster = None,
    json_file: Result = None,
) -> None:
    """False alarms: correct renderers judged with fresh seeds, and p-values that should be even."""
    from raycheck.calibration import nulls

    file = _ready(work) / "nulls.jsonl"
    for found in nulls.measure_nulls(file, sets, pool=_pool(jobs, dask)):
        failed = [found.outcomes.count("FAIL"), found.whole == "FAIL"]
        print(f"{found.configuration} {found.index}: {'FALSE ALARM' if any(failed) else 'no alarm'}")
    summary = nulls.summary(file)
    summary.pop("power")
    _put("nulls", summary, json_file)


@app.command(name="looks")
def run_looks(
    sets: Annotated[int, typer.Option(min=1, help="Of looks, for each configuration; 8 verdicts each.")] = 40,
    work: Folder = LINES,
    jobs: Jobs = None,
    dask: Cluster = None,
    json_file: Result = None,
) -> None:
    """Correct renderers looked at many times over: false alarms, and the power of looks that add up."""
    from raycheck.calibration import many_looks

    file = _ready(work) / "looks.jsonl"
    for found in many_looks.measure(file, sets, pool=_pool(jobs, dask)):
        failed = any("FAIL" in outcomes for outcomes in (*found["outcomes"], found["whole"]))
        print(f"{found['configuration']} {found['index']}: {'FALSE ALARM' if failed else 'no alarm'}")
    _put("looks", many_looks.summary(file), json_file)


@app.command()
def mde(work: Folder = LINES, json_file: Result = None) -> None:
    """The printed detectable bias, injected at 0.5, 1 and 2 times into the images of `nulls`."""
    from raycheck.calibration import nulls
    from raycheck.calibration.lines import read_lines

    file = work / "nulls.jsonl"
    if not read_lines(file):
        raise NotFound(f"{file}: there are no images yet; run raycheck calibrate nulls first")
    _put("mde", nulls.summary(file)["power"], json_file)


@app.command(name="mutants")
def run_mutants(
    names: Names = None,
    work: Folder = LINES,
    jobs: Jobs = None,
    dask: Cluster = None,
    json_file: Result = None,
) -> None:
    """Kill rate, beside the rules of other projects on the same images."""
    from raycheck.calibration import kills

    wanted, file = _wanted(names), _ready(work) / "kills.jsonl"
    for found in kills.measure_kills(file, wanted, _pool(jobs, dask)):
        rules = [rule for rule, rejected in found[0].rejected.items() if rejected]
        effect = "no image" if found[0].effect is None else f"{found[0].effect:.3g} detectable biases"
        print(f"{found[0].name} ({effect}): rejected by {', '.join(rules) or 'none'}")
    _put("mutants", kills.summary(file, wanted), json_file)


@app.command(name="signatures")
def run_signatures(work: Folder = WORK) -> None:
    """Signature images of the mistakes, into references/signatures."""
    from raycheck.calibration import signatures

    wanted = _wanted(None)
    for pair in signatures.render_pairs(_ready(work) / "signatures", wanted):
        print(f"{pair.mutant.name} on {pair.scene}")
    print(str(signatures.write_signatures(work / "signatures", wanted)))


@app.command(name="parts")
def run_parts(scenes: Scenes = None) -> None:
    """What each light, path length and surface adds to a scene's image, into references/parts."""
    from raycheck.calibration import part_making

    for scene in part_making.write(scenes or variants.scene_names()):
        print(scene)


@app.command(name="naming")
def run_naming(work: Folder = WORK, json_file: Result = None) -> None:
    """How often a mistake is called by its name, by the images that `signatures` made."""
    from raycheck.calibration import naming

    _put("naming", naming.summary(work / "signatures", _wanted(None)), json_file)


@app.command(name="unseen")
def run_unseen(
    names: Annotated[list[str] | None, typer.Argument(metavar="[NAME]...", help="All by default.")] = None,
    work: Folder = LINES,
    json_file: Result = None,
) -> None:
    """What is said of mistakes that nobody tuned for, and how often it is false."""
    from raycheck.calibration import unseen

    every, file = unseen.every(), _ready(work) / "unseen.jsonl"
    unknown = set(names or ()) - {one.name for one in every}
    if unknown:
        raise NotFound(f"there is no mistake {', '.join(sorted(unknown))} in {unseen.FOLDER}")
    for found in unseen.measure(file, [one for one in every if not names or one.name in names]):
        print(f"{found['name']}: {found['verdict']} {found['said']}")
    _put("unseen", unseen.summary(file, every), json_file)


@app.command(name="gradings")
def run_gradings(
    assignment: Annotated[Path, typer.Option(metavar="FILE.toml", help="Whose tasks are graded.")],
    count: Annotated[int, typer.Option(min=1, help="Of an honest program, with fresh keys each.")] = 500,
    work: Folder = LINES,
    jobs: Jobs = None,
    dask: Cluster = None,
    json_file: Result = None,
) -> None:
    """False failures of the grader: oneray graded as an honest program, many times over."""
    from raycheck.calibration import gradings
    from raycheck.grading.assignment import read_assignment
    from raycheck.grading.jail.sandbox import Tier
    from raycheck.grading.judge import Grader

    asked = gradings.quick(read_assignment(assignment))
    grader, file = Grader.prepare(asked, Tier.NONE), _ready(work) / "gradings.jsonl"
    for found in gradings.measure(file, grader, count, _pool(jobs, dask)):
        print(f"{found.index}: {'; '.join(found.reasons) or 'no failure'}")
    _put("gradings", gradings.summary(file, asked), json_file)


def _pool(jobs: int | None, dask: str | None) -> pools.Pool | None:
    """The pool that was asked for; None is this process."""
    pool = pools.chosen(jobs, dask)
    return None if pool == pools.Here(1) else pool


def _wanted(names: list[str] | None) -> list[Mutant]:
    found = mutants.catalogue()
    unknown = set(names or ()) - {mutant.name for mutant in found}
    if unknown:
        raise NotFound(f"there is no mutant {', '.join(sorted(unknown))} in {mutants.FOLDER}")
    return [mutant for mutant in found if not names or mutant.name in names]


def _ready(work: Path) -> Path:
    work.mkdir(parents=True, exist_ok=True)
    return work


def _put(section: str, figures: object, json_file: Path | None) -> None:
    """Replace one section of the file as a whole or not at all, and print it."""
    path = json_file or data.references_dir() / "calibration.json"
    found = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    text = json.dumps({**found, section: figures}, indent=1, ensure_ascii=False) + "\n"
    write_whole(path, text)
    print(json.dumps(figures, indent=1, ensure_ascii=False))
