"""Judges other renderers, and oneray, by closed forms: docs/audit.md.

    python scripts/audit.py list
    python scripts/audit.py setup [RENDERER ...]    # Cycles, LuxCore and Raysect by pip, outside the checkout
    python scripts/audit.py setup cycles --package bpy==5.0.1
    python scripts/audit.py run [ID or RENDERER ...] [--json FILE] [--against FILE]
    python scripts/audit.py picture                 # references/pictures/audit.png, of references/audit.json

`run` renders checks, or all, each in a process of its own, and says what is found. --json keeps the records,
those that were there before of other checks too; --against names what changed since a file was written, with
exit status 1 if anything did. A renderer that is not there is said, and its checks are left out: exit status
3; 2 where one gave no picture. The whole takes a quarter of an hour of one core.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from raycheck.base.errors import NotFound, PlainError, RenderError
from raycheck.base.files import write_whole
from raycheck.base.machine import machine, raycheck_version, today
from raycheck.measuring.audit import running, tables
from raycheck.measuring.audit.check import ALLOWED, BUDGET, LEVEL
from raycheck.measuring.audit.checks import CHECKS, false_alarms, named
from raycheck.measuring.audit.results import Record, changed, read, to_json

REFERENCES = Path(__file__).resolve().parent.parent / "references"
COLOURS = {"finding": "#b3171f", "documented approximation": "#7a5600", "health": "#1c5fa8"}


def run(options: argparse.Namespace) -> int:
    old = {one.id: one for one in read(options.against)[0]} if options.against else {}
    kept = {}
    if options.json and options.json.exists():
        kept = {one.id: one for one in read(options.json)[0]}
    missing: set[str] = set()
    differs, failed = 0, False
    for check in named(options.names):
        if check.renderer in missing:
            continue
        try:
            record = running.run(check)
        except NotFound as error:
            missing.add(check.renderer)
            print(f"audit: {error}", file=sys.stderr, flush=True)
            continue
        except RenderError as error:
            failed = True
            print(f"audit: {error}", file=sys.stderr, flush=True)
            continue
        print(tables.line(record), flush=True)
        kept[record.id] = record
        if options.against and (change := changed(old.get(record.id), record)):
            differs += 1
            print(f"    CHANGED: {change}", flush=True)
        if options.json:
            write_whole(options.json, to_json(in_order(kept), header()))
    if options.against:
        print(f"{differs} checks changed" if differs else "nothing changed")
    return 2 if failed else 3 if missing else 1 if differs else 0


def draw() -> None:
    """Every value's deviation and interval, by renderer, on a scale that is linear up to 0.1 %."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    records = read(REFERENCES / "audit.json")[0]
    rows = [(one, value) for one in records for value in one.values]
    figure, axes = plt.subplots(figsize=(8.5, 0.17 * len(rows) + 1), dpi=100, layout="constrained")
    axes.axvspan(-100 * ALLOWED, 100 * ALLOWED, color="#e3e5e7", zorder=0)
    for row, (one, value) in enumerate(rows):
        low, high = (100 * (x / value.expected - 1) for x in (value.low, value.high))
        colour = COLOURS.get(one.verdict, "#5f646b")
        axes.plot([low, high], [row, row], color=colour, linewidth=1.5)
        axes.plot([100 * value.off], [row], color=colour, marker="o", markersize=3.5)
    names = [one.id if len(one.values) == 1 else f"{one.id}, {value.name}" for one, value in rows]
    axes.set_yticks(range(len(rows)), names, fontsize=6.5)
    axes.set_xscale("symlog", linthresh=0.1)
    axes.set_xticks([-10, -1, -0.1, 0, 0.1, 1, 10], ["−10 %", "−1 %", "−0.1 %", "0", "0.1 %", "1 %", "10 %"])
    axes.set(ylim=(len(rows), -1), title="off by, with intervals at 1e-5")
    axes.grid(axis="x", color="#e3e5e7", linewidth=0.8)
    figure.savefig(REFERENCES / "pictures/audit.png", metadata={"Software": None})


def in_order(found: dict[str, Record]) -> list[Record]:
    return [found[check.id] for check in CHECKS if check.id in found]


def header() -> dict[str, object]:
    return {
        "raycheck": raycheck_version(), "machine": machine(), "date": today(),
        "command": "python scripts/audit.py run --json references/audit.json",
        "level": LEVEL, "budget": BUDGET, "false_alarms": false_alarms(),
    }  # fmt: skip


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("list", help="ids, and what each is about")
    commands.add_parser("picture", help="what was found, drawn")
    setup = commands.add_parser("setup", help="install renderers")
    setup.add_argument("names", nargs="*", metavar="RENDERER", help="default: all")
    setup.add_argument("--package", default="", help="another version of the one that is named")
    running_ = commands.add_parser("run", help="render and judge")
    running_.add_argument("names", nargs="*", metavar="ID", help="of a check, or a renderer; default: all")
    running_.add_argument("--json", type=Path, metavar="FILE", help="for references/audit.json")
    running_.add_argument("--against", type=Path, metavar="FILE", help="what changed since")
    options = parser.parse_args()
    try:
        if options.command == "run":
            return run(options)
        if options.command == "list":
            print("\n".join(f"{check.id:34} {check.says}" for check in CHECKS))
            return 0
        if options.command == "picture":
            draw()
            return 0
        if options.package and len(options.names) != 1:
            parser.error("--package is of one renderer: name it")
        for name in options.names or running.RENDERERS:
            if name not in running.RENDERERS:
                raise NotFound(f"no renderer {name}; there are {', '.join(running.RENDERERS)}")
            running.set_up(name, options.package)
        return 0
    except PlainError as error:
        print(f"audit: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
