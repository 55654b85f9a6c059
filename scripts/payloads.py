"""Do the pictures still have the same bits? Payloads of films, tests/payloads.json.

    python scripts/payloads.py --write [--oneray PATH]
    python scripts/payloads.py --check [--oneray PATH] [--every-kernel] [--sample N] [--jobs N]

Each scene is rendered small with each technique that applies to it, in both precisions, and canonical ones in
the precision that oneray chooses, at their other depths too: what measured results rest on, as on the scenes
of the benchmark (raycheck.truth.provenance). The payload of a film
is a hash of its numbers alone, so that it does not depend on how scenes, techniques and the program name
themselves. --check lists every difference and ends with status 1 where there is one.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import benchmark_scenes

from raycheck.base.data import PAYLOADS as FILE
from raycheck.judging.agenda import standard_technique
from raycheck.renderers.films import payload
from raycheck.scene.content import read_content
from raycheck.scene.techniques import ON_REQUEST, TECHNIQUES, applicable
from raycheck.scene.variants import ladder

ROOT = Path(__file__).resolve().parent.parent
SAMPLES = "0:5"
WIDTH = ("--width", "48")
"""Of the canonical scenes; those of tests/ are small already."""
AUTO = "auto"
PRECISIONS = ("double", "single")
BEYOND = {
    "mis-schlick": ("--fresnel", "schlick"),
    "walk-sobol": ("--estimator", "walk", "--sampler", "sobol"),
    "light-sobol": ("--estimator", "light", "--sampler", "sobol"),
    **{one.name: one.options for one in ON_REQUEST},
}
"""Code that no technique of the lecture uses."""
STIFF = ("walk-cosine", "nee", "mis-default", "light")
"""For scenes/stiff, which are about numbers rather than techniques."""
REFUSED = "refused"
"""In place of a payload: oneray says in a line why it does not render this."""


@dataclass(frozen=True)
class Picture:
    """A scene with a technique in a precision."""

    scene: Path
    technique: str
    options: tuple[str, ...]
    precision: str
    parameters: tuple[tuple[str, str], ...] = ()
    """Names and values that replace those of the scene's `<default>`s."""

    @property
    def key(self) -> str:
        """Its name in the file: "cornell-box mis-power double"."""
        name = self.scene.relative_to(ROOT).with_suffix("").as_posix()
        at = "@" * bool(self.parameters) + ",".join(f"{k}={v}" for k, v in self.parameters)
        return f"{re.sub('^(scenes|build)/', '', name)}{at} {self.technique} {self.precision}"


@dataclass(frozen=True)
class Kernel:
    """How wide, and whether specialised for the scene where there is such an instance."""

    lanes: int
    """0: as many as oneray has for the precision that it chooses."""
    specialised: bool = True

    @property
    def options(self) -> tuple[str, ...]:
        """As oneray takes them."""
        return ("--lanes", str(self.lanes or "auto"), "--kernel", "auto" if self.specialised else "generic")


def pictures() -> list[Picture]:
    """All that are compared, in the order of their keys."""
    everything = {t.name: t.options for t in TECHNIQUES} | BEYOND
    found: list[Picture] = []

    def add(scene: Path, names: Iterable[str], precisions: Iterable[str] = PRECISIONS) -> None:
        found.extend(Picture(scene, n, everything[n], p) for n in names for p in precisions)

    for scene in (ROOT / "scenes").glob("*.xml"):
        possible = [t.name for t in applicable(read_content(scene))]
        add(scene, [*possible, *BEYOND])
        add(scene, possible, [AUTO])
    for of in (of for of in ladder() if of.parameters):
        one = standard_technique(of)
        found.append(Picture(of.path, one.name, one.options, AUTO, tuple(sorted(of.parameters.items()))))
    for measured in benchmark_scenes.SCENES:
        add(measured.write(ROOT / "build/benchmark"), ["mis-default"])
    for scene in (ROOT / "scenes/stiff").glob("*.xml"):
        add(scene, [t.name for t in applicable(read_content(scene)) if t.name in STIFF])
    for scene in (ROOT / "tests/everything.xml", *(ROOT / "tests/odd").glob("*.xml")):
        add(scene, everything)
    return sorted(found, key=lambda one: one.key)


def kernels(oneray: Path) -> dict[str, list[int]]:
    """The lanes of each precision that the program has and this processor runs, the widest first; of AUTO
    whatever it takes.
    """
    text = subprocess.run([oneray, "--help"], check=True, capture_output=True, text=True).stdout
    [line] = [line for line in text.splitlines() if line.startswith("kernels that run here:")]
    found: dict[str, list[int]] = {AUTO: [0]}
    for precision, widths in re.findall(r"(double|single) x ([\d, ]+)", line):
        found.setdefault(precision, []).extend(int(lanes) for lanes in widths.strip(" ,").split(", "))
    return {precision: sorted(lanes, reverse=True) for precision, lanes in found.items()}


def render(oneray: Path, picture: Picture, kernel: Kernel) -> str:
    """The payload of the film, or REFUSED, or what went wrong."""
    size = WIDTH if picture.scene.is_relative_to(ROOT / "scenes") else ()
    with tempfile.TemporaryDirectory(prefix="payloads-") as folder:
        film = Path(folder) / "film"
        command = [oneray, picture.scene, "--samples", SAMPLES, "--film", film, "--quiet", *size]
        command += [*picture.options, "--precision", picture.precision, *kernel.options]
        command += [f"-D{name}={value}" for name, value in picture.parameters]
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
        if done.returncode == 0 and film.is_file():
            return payload(film.read_bytes())
    errors = [line for line in done.stderr.splitlines() if not line.startswith("oneray: warning:")]
    return REFUSED if done.returncode == 2 and len(errors) == 1 else f"exit {done.returncode}"


def render_all(
    oneray: Path, wanted: Sequence[Picture], kernel: Callable[[Picture], Kernel], jobs: int = 1
) -> dict[str, str]:
    """Payloads by key."""
    with ThreadPoolExecutor(jobs) as pool:
        found = pool.map(lambda one: render(oneray, one, kernel(one)), wanted)
        return {one.key: value for one, value in zip(wanted, found, strict=True)}


def sample(wanted: Sequence[Picture], count: int) -> list[Picture]:
    """Some pictures, the same ones in every run."""
    return sorted(random.Random(0).sample(list(wanted), min(count, len(wanted))), key=lambda one: one.key)


def differences(found: dict[str, str], kept: dict[str, str]) -> list[str]:
    """A line for each picture that is not the kept one."""
    return [
        f"{key}: {value}, in {FILE.name} {kept.get(key, 'not at all')}"
        for key, value in found.items()
        if value != kept.get(key)
    ]


def check(oneray: Path, wanted: Sequence[Picture], every_kernel: bool = False, jobs: int = 1) -> list[str]:
    """Every difference, with the kernel that shows it; `every_kernel` takes all that run here, specialised
    and generic, otherwise it is the widest one.
    """
    kept = json.loads(FILE.read_text(encoding="utf-8"))
    found = []
    for precision, widths in kernels(oneray).items():
        these = [one for one in wanted if one.precision == precision]
        tried = [Kernel(widths[0])]
        if every_kernel:
            tried = [Kernel(lanes, special) for lanes in widths for special in (True, False)]
        for kernel in tried:
            wrong = differences(render_all(oneray, these, lambda _, k=kernel: k, jobs), kept)
            found += [f"{' '.join(kernel.options)}: {line}" for line in wrong]
            if every_kernel:
                words = f"{len(these)} pictures, {len(wrong)} differ"
                print(f"{precision} {' '.join(kernel.options)}: {words}", flush=True)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--write", action="store_true")
    what.add_argument("--check", action="store_true")
    parser.add_argument("--oneray", type=Path, default=Path(os.environ.get("ONERAY", ROOT / "build/oneray")))
    parser.add_argument("--every-kernel", action="store_true")
    parser.add_argument("--sample", type=int, metavar="N")
    parser.add_argument("--jobs", type=int, default=1, metavar="N")
    given = parser.parse_args()
    oneray, wanted = given.oneray.resolve(), pictures()
    if given.write:
        widest = {precision: Kernel(lanes[0]) for precision, lanes in kernels(oneray).items()}
        found = render_all(oneray, wanted, lambda one: widest[one.precision], given.jobs)
        FILE.write_text(json.dumps(found, indent=0, sort_keys=True) + "\n", encoding="utf-8")
        print(f"{FILE}: {len(found)} pictures, {list(found.values()).count(REFUSED)} of them refused")
        return
    if given.sample is None:
        kept = json.loads(FILE.read_text(encoding="utf-8"))
        missing = [f"{key}: no such picture any more" for key in kept.keys() - {one.key for one in wanted}]
    else:
        wanted, missing = sample(wanted, given.sample), []
    found = check(oneray, wanted, given.every_kernel, given.jobs) + sorted(missing)
    print("\n".join([*found, f"{len(wanted)} pictures, {len(found)} differences"]))
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
