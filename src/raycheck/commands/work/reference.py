"""Making references, with what it says about it."""

from collections.abc import Sequence

from rich.progress import Progress

from raycheck.base.text import duration, percent
from raycheck.commands.support import Output
from raycheck.scene import variants
from raycheck.truth import making, mitsuba, references


def wanted(
    scenes: list[str] | None, parameters: dict[str, str], every: bool
) -> list[variants.Variant]:
    if not scenes:
        found = variants.ladder()
        return found if every else [variant for variant in found if not references.is_fresh(variant)]
    return [variants.variant(scene, parameters) for scene in scenes]


def make(wanted: Sequence[variants.Variant], by: str, goal: making.Goal, jobs: int) -> None:
    """Plan all, say how long it will take, then render the short ones first."""
    variant = mitsuba.choose_variant() if by == "mitsuba" else ""
    console = Output()
    work = []
    for of in wanted:
        renderer = mitsuba.MitsubaBatches(of, variant, jobs) if variant else making.OnerayBatches(of, jobs)
        checked = references.closed_form(of) is not None
        plan = making.make_plan(renderer, goal, checked)
        work.append((of, renderer, plan))
        console.print(f"{of.label}: {plan.spp} samples per pixel, about {duration(plan.seconds)}")
    total = sum(plan.seconds for _, _, plan in work)
    console.print(f"about {duration(total)} in all")
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
                soft_wrap=True,
            )
