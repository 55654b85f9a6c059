"""Making references, or looking whether they still hold, with what that says."""

import os
import time
from collections.abc import Sequence

from rich.progress import Progress

from raycheck.base.errors import NotFound
from raycheck.base.statuses import Status
from raycheck.base.text import duration, percent, signed
from raycheck.commands.terminal import Output
from raycheck.scene import variants
from raycheck.stats.tiles import place
from raycheck.stats.verdict import Outcome
from raycheck.truth import drift as drifts
from raycheck.truth import making, mitsuba, references


def wanted(scenes: list[str] | None, parameters: dict[str, str], every: bool) -> list[variants.Variant]:
    if not scenes:
        found = variants.ladder()
        return found if every else [variant for variant in found if not references.is_fresh(variant)]
    return [variants.variant(scene, parameters) for scene in scenes]


def make(wanted: Sequence[variants.Variant], by: str, goal: making.Goal, jobs: int) -> None:
    """Plan all, say how long it will take, then render the short ones first. The first plan has begun with
    the command: to find out how Mitsuba runs here takes its time too.
    """
    began = time.perf_counter()
    for of in wanted if by == "mitsuba" else ():
        mitsuba.check_film(of)
    variant = mitsuba.choose_variant() if by == "mitsuba" else ""
    console = Output()
    work = []
    for of in wanted:
        renderer = mitsuba.MitsubaBatches(of, variant, jobs) if variant else making.OnerayBatches(of, jobs)
        checked = references.closed_form(of) is not None
        plan = making.make_plan(renderer, goal, checked, began)
        began = time.perf_counter()
        work.append((of, renderer, plan))
        told = f"about {duration(plan.total)} with start and plan"
        line = f"{of.label}: {plan.spp} samples per pixel, {told}"
        console.print(line, markup=False, soft_wrap=True)
    total, spent = (sum(getattr(plan, of) for _, _, plan in work) for of in ("total", "spent"))
    console.print(f"about {duration(total)} in all, of which {duration(spent)} are over")
    batches = sum(plan.spp // goal.spp_per_batch for _, _, plan in work)
    with Progress(console=Output(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=batches)
        for of, renderer, plan in sorted(work, key=lambda job: job[2].seconds):
            bar.update(task, description=of.label)
            entry = making.make_reference(of, renderer, plan, goal, lambda: bar.advance(task))
            console.print(
                f"{of.label}: {entry['batches']} batches, {duration(entry['seconds'])}, standard error "
                f"{percent(entry['image_error'])} of the image and "
                f"{percent(entry['tile_error_p90'])} of nine tenths of the tiles: "
                f"{of.folder / of.label}.exr",
                markup=False,
                soft_wrap=True,
            )


def drift(scenes: list[str] | None, parameters: dict[str, str], seconds: float, jobs: int | None) -> Status:
    """A line for each scene, or for each reference that Mitsuba made; the exit status."""
    if scenes:
        wanted = [variants.variant(scene, parameters) for scene in scenes]
    else:
        fresh = [of for of in variants.ladder() if references.is_fresh(of)]
        wanted = [of for of in fresh if "mitsuba_version" in references.require(of)]
    for of in wanted:
        drifts.require(of)
    variant, console = mitsuba.choose_variant(), Output()
    outcomes = set()
    for of in wanted:
        try:
            renderer = mitsuba.MitsubaBatches(of, variant, jobs or os.cpu_count() or 1)
        except NotFound as error:  # another version may refuse what was a scene before
            console.print(f"{error}: differs", soft_wrap=True)
            outcomes.add(Outcome.FAIL)
            continue
        found = drifts.measure(of, renderer, seconds)
        outcomes.add(found.judgement.outcome)
        console.print(_told(found), soft_wrap=True, highlight=False)
    if Outcome.FAIL in outcomes:
        return Status.FAIL
    return Status.INCONCLUSIVE if Outcome.INCONCLUSIVE in outcomes else Status.DONE


def _told(found: drifts.Drift) -> str:
    judged = found.judgement
    verdict = {Outcome.PASS: "the same", Outcome.FAIL: "differs", Outcome.INCONCLUSIVE: "too noisy to say"}
    versions = f"both by {found.now}" if found.same_version else f"{found.now} after {found.before}"
    interval = f"{signed(judged.bias_low)} … {signed(judged.bias_high)}"
    told = f"{found.label}: {verdict[judged.outcome]}, {signed(judged.bias)} ({interval}) of the image"
    worst = [one for one in (judged.findings or judged.undecided) if one.region > 0][:1]
    for one in worst if judged.outcome is not Outcome.PASS else ():
        height, width = found.regions[0].height, found.regions[0].width
        where = place(found.regions[one.region], height, width)
        told += f", {signed(one.bias)} ({signed(one.low)} … {signed(one.high)}) of the tile at {where}"
    return f"{told}; {drifts.BATCHES} × {found.spp} samples per pixel, {versions}"
