"""Instructions that a path takes, counted by valgrind, which no load of the machine disturbs.

    python scripts/instructions.py ONERAY [OTHER] [--json FILE] [--jobs N] [--only TEXT]

The benchmark's scenes, small and with few samples, in single precision at 8 lanes and in double at 4, the
widest that valgrind knows. Two numbers of samples are counted: their difference is the paths', what remains
is reading the scene, building trees and writing the picture. With OTHER, a program or a file kept by --json,
the ratio to it, and status 1 where a path takes more than 1.02 times its instructions or where another
instance of the kernel renders the scene.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

from benchmark_scenes import as_it_is, ball, cornell, deep, glass_box, obj_box, sphere_light

MOST = 1.02
SIDE = 16
FEW, MANY = 16, 48
"""Samples per pixel: multiples of the lanes."""
WIDTHS = {"single": 8, "double": 4}


class Failed(Exception):
    """Nothing could be counted: one plain sentence."""


@dataclass(frozen=True)
class Case:
    """What is counted."""

    name: str
    write: Callable[[Path], Path]
    """Writes the scene into a folder and returns its path."""
    options: tuple[str, ...] = ()


@dataclass(frozen=True)
class Count:
    """What came out."""

    path: float
    """Instructions of a path."""
    set_up: float
    """Instructions of all that does not grow with the samples."""
    instance: str
    """Of the kernel, by --stats."""


def ball_direct(folder: Path) -> Path:
    """The ball of 100,000 triangles with direct light only."""
    whole = ball(folder, 100_000)
    target = whole.with_name("ball-direct.xml")
    text = whole.read_text(encoding="utf-8")
    target.write_text(re.sub(r'("max_depth" value=)"\d+"', r'\1"2"', text), encoding="utf-8")
    return target


def thousand_spheres(folder: Path) -> Path:
    """The hall of a thousand lights with a small ball for each lamp."""
    whole = as_it_is(folder, "thousand-lights")
    target = whole.with_name("thousand-spheres.xml")
    place = r'value="\S+ 0 0 (\S+) 0 -\S+ 0 (\S+) 0 0 -1 (\S+) 0 0 0 1"'
    lamp = rf'<shape type="rectangle"><transform name="to_world"><matrix {place}/></transform>'
    small = (
        r'<shape type="sphere"><point name="center" value="\1, \2, \3"/><float name="radius" value="0.03"/>'
    )
    text, count = re.subn(lamp, small, whole.read_text(encoding="utf-8"))
    if count != 1000:
        raise Failed(f"{whole.name} has {count} lamps, not 1,000")
    target.write_text(text, encoding="utf-8")
    return target


def metal_box(folder: Path) -> Path:
    """scenes/metal.xml at depth 6."""
    target = folder / "metal.xml"
    shown = Path(__file__).resolve().parent.parent / "scenes/metal.xml"
    target.write_text(deep(shown.read_text(encoding="utf-8"), 6), encoding="utf-8")
    return target


CASES = (
    Case("cornell-8-no-roulette", lambda f: cornell(f, 8, False), ("--roulette", "none")),
    Case("cornell-8", lambda f: cornell(f, 8)),
    Case("cornell-2", lambda f: cornell(f, 2)),
    Case("obj-box", obj_box),
    Case("sphere-light", sphere_light),
    Case("glass-box", glass_box),
    Case("ball-100k", lambda f: ball(f, 100_000)),
    Case("ball-100k-2", ball_direct),
    Case("thousand-lights", lambda f: as_it_is(f, "thousand-lights")),
    Case("thousand-spheres", thousand_spheres),
    Case("metal", metal_box),
    Case("cornell-8-walk", lambda f: cornell(f, 8), ("--estimator", "walk")),
    Case("cornell-8-nee", lambda f: cornell(f, 8), ("--estimator", "nee")),
    Case("cornell-8-light", lambda f: cornell(f, 8), ("--estimator", "light")),
    Case("cornell-8-sobol", lambda f: cornell(f, 8), ("--sampler", "sobol")),
    Case("cornell-8-no-roulette generic", lambda f: cornell(f, 8, False),
         ("--roulette", "none", "--kernel", "generic")),
    Case("glass-box generic", glass_box, ("--kernel", "generic")),
    Case("ball-100k generic", lambda f: ball(f, 100_000), ("--kernel", "generic")),
)  # fmt: skip


def instructions(oneray: Path, words: Sequence[str], samples: int) -> tuple[int, str]:
    """Of one run, and the kernel's instance."""
    with tempfile.TemporaryDirectory(prefix="instructions-") as folder:
        program = Path(folder) / "oneray"  # without what valgrind might not read: clang's notes for debuggers
        subprocess.run(["strip", "-o", str(program), str(oneray)], check=True)
        command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={folder}/out", str(program), *words]
        command += ["--spp", str(samples), "--quiet", "--stats", "-", "-o", f"{folder}/out.exr"]
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    found = re.search(r"Collected : (\d+)", done.stderr)
    if "unrecognised instruction" in done.stderr or "unhandled instruction" in done.stderr:
        raise Failed(f"valgrind does not know an instruction of {oneray}, of AVX-512 or another new one")
    if done.returncode or not found:
        raise Failed(f"{' '.join(command)}: {done.stderr.strip()[-500:]}")
    return int(found.group(1)), json.loads(done.stdout)["kernel"]


def count(oneray: Path, case: Case, precision: str, scene: Path) -> Count:
    """One row."""
    words = [str(scene), "--width", str(SIDE), "--height", str(SIDE), *case.options]
    words += ["--precision", precision, "--lanes", str(WIDTHS[precision])]
    (few, instance), (many, _) = (instructions(oneray, words, samples) for samples in (FEW, MANY))
    per_sample = (many - few) / (MANY - FEW)
    return Count(round(per_sample / SIDE**2, 1), round(few - FEW * per_sample), instance)


def count_all(oneray: Path, only: str, jobs: int) -> dict[str, Count]:
    """By the name of the row, "cornell-2 single"."""
    with tempfile.TemporaryDirectory(prefix="instructions-") as folder, ThreadPoolExecutor(jobs) as pool:
        rows = [(f"{case.name} {precision}", case, precision) for precision in WIDTHS for case in CASES]
        rows = [row for row in rows if only in row[0]]
        scenes = {case.name: case.write(Path(folder)) for _, case, _ in rows}
        found = pool.map(lambda row: count(oneray, row[1], row[2], scenes[row[1].name]), rows)
        return {row[0]: one for row, one in zip(rows, found, strict=True)}


def read(file: Path) -> dict[str, Count]:
    """What --json kept."""
    return {name: Count(**one) for name, one in json.loads(file.read_text(encoding="utf-8")).items()}


def table(found: dict[str, Count], other: dict[str, Count] | None) -> list[str]:
    """Lines of Markdown; with `other` the ratios to it."""
    lines = ["| scene | instance | a path | set-up |", "| --- | --- | --: | --: |"]
    if other is not None:
        lines = [
            f"{line} {end} |"
            for line, end in zip(lines, ("of other | set-up of other", "--: | --:"), strict=True)
        ]
    for name, one in found.items():
        line = f"| {name} | {one.instance} | {one.path:,.1f} | {one.set_up:,} |"
        if other is not None:
            than = other.get(name)
            line += f" {one.path / than.path:.4f} | {one.set_up / than.set_up:.4f} |" if than else " | |"
        lines.append(line)
    return lines


def worse(found: dict[str, Count], other: dict[str, Count]) -> list[str]:
    """What ends with status 1."""
    both = [(name, one, other[name]) for name, one in found.items() if name in other]
    slow = [f"{name}: {one.path / o.path:.4f}" for name, one, o in both if one.path > MOST * o.path]
    turned = [f"{n}: {one.instance}, not {o.instance}" for n, one, o in both if one.instance != o.instance]
    return [*slow, *turned, *(f"{name}: not in the other" for name in found.keys() - other.keys())]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("oneray", type=Path, metavar="ONERAY")
    parser.add_argument("other", type=Path, metavar="OTHER", nargs="?", help="a program, or what --json kept")
    parser.add_argument("--json", type=Path, metavar="FILE", help="keep the counts of ONERAY")
    parser.add_argument("--jobs", type=int, default=1, metavar="N")
    parser.add_argument("--only", default="", metavar="TEXT", help="rows whose name has this in it")
    given = parser.parse_args()
    if not shutil.which("valgrind"):
        sys.exit("instructions: valgrind is not installed")
    try:
        found = count_all(given.oneray.resolve(), given.only, given.jobs)
        other = None
        if given.other:
            kept = given.other.suffix == ".json"
            other = read(given.other) if kept else count_all(given.other.resolve(), given.only, given.jobs)
    except Failed as error:
        sys.exit(f"instructions: {error}")
    if given.json:
        text = json.dumps({name: asdict(one) for name, one in found.items()}, indent=1)
        given.json.write_text(text + "\n", encoding="utf-8")
    print("\n".join(table(found, other)))
    if other is not None and (wrong := worse(found, other)):
        print("\n" + "\n".join(wrong))
        sys.exit(1)


if __name__ == "__main__":
    main()
