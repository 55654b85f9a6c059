#!/usr/bin/env python3
"""Render the references of the canonical scenes with Mitsuba 3: references/NAME.exr and
references/manifest.json.

python scripts/make_references.py                  every reference that is missing or stale
python scripts/make_references.py --all            every one
python scripts/make_references.py cornell-box      this one
python scripts/make_references.py furnace -Ddepth=4   a variant, references/furnace@depth=4.exr
"""

import argparse
import contextlib
import os
import sys
from pathlib import Path

from rich.progress import Progress

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "src"))

from raycheck import mitsuba_reference, references
from raycheck.mitsuba_reference import Goal, Renderer


def arguments() -> argparse.Namespace:
    goal = Goal()
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "scenes", nargs="*", metavar="SCENE", help="canonical scenes; default: all that need it"
    )
    parser.add_argument(
        "-D", action="append", default=[], dest="settings", metavar="name=value", help="scene parameter"
    )
    parser.add_argument("--all", action="store_true", help="renew fresh references too")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="threads (default: all)")
    parser.add_argument(
        "--image-error", type=float, default=goal.image, help="relative standard error of the image"
    )
    parser.add_argument(
        "--tile-error",
        type=float,
        default=goal.tile,
        help="… of 90 %% of the 8×8 tiles (twice that with closed form)",
    )
    parser.add_argument(
        "--variant", choices=["llvm_ad_rgb", "scalar_rgb"], help="default: llvm_ad_rgb if it runs"
    )
    return parser.parse_args()


def is_fresh(name: str, parameters: dict[str, str]) -> bool:
    entry = references.read_manifest().get(references.key(name, parameters))
    return entry is not None and entry["hash"] == references.scene_hash(
        references.scene_path(name), parameters
    )


def main() -> int:
    args = arguments()
    try:
        parameters = mitsuba_reference.parse_parameters(args.settings)
        names = args.scenes or references.scene_names()
        for name in names:
            references.scene_path(name)
        if not args.scenes and not args.all:
            names = [name for name in names if not is_fresh(name, parameters)]
        if not names:
            print("all references are fresh")
            return 0
        variant = mitsuba_reference.choose_variant(args.variant)
    except (ValueError, RuntimeError) as error:
        print(f"make_references: {error}", file=sys.stderr)
        return 2
    with contextlib.suppress(AttributeError, OSError):
        os.nice(10)
    goal = Goal(image=args.image_error, tile=args.tile_error, checked_tile=2 * args.tile_error)
    print(f"Mitsuba {variant}, {args.jobs} threads; first {goal.small_batches} small batches of each scene")
    work = []
    for name in names:
        renderer = Renderer(references.scene_path(name), parameters, variant, args.jobs)
        checked = references.closed_form(name, parameters) is not None
        plan = mitsuba_reference.pilot(renderer, goal, checked)
        work.append((name, renderer, plan))
        print(f"  {name:18} {plan.spp:7} samples per pixel, about {plan.seconds:.0f} s")
    total = sum(plan.seconds for _, _, plan in work)
    print(f"about {total / 60:.1f} minutes in all")
    with Progress() as progress:
        task = progress.add_task("", total=sum(plan.spp // goal.spp_per_batch for _, _, plan in work))
        for name, renderer, plan in sorted(work, key=lambda job: job[2].seconds):
            label = references.key(name, parameters)
            progress.update(task, description=label)
            entry = mitsuba_reference.make_reference(
                name, renderer, plan, goal, variant, parameters, lambda: progress.advance(task)
            )
            progress.console.print(
                f"{label:18} {entry['batches']} batches, {entry['seconds']:.0f} s, standard error "
                f"{entry['image_error']:.1e} of the image, {entry['tile_error_p90']:.1e} of tiles"
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
