"""The speed of oneray and of Mitsuba 3 on the same scene files, one thread each on one pinned core.

    python scripts/benchmark.py [--scene NAME ...] [--rounds 5] [--seconds 0.5] [--core N] [--json FILE]
    python scripts/benchmark.py --growth-only
    python scripts/benchmark.py --commands-only
    python scripts/benchmark.py --quick

Every round renders each contestant once, in turn, with seeds of its own, so that a machine whose speed drifts
is slow for all; a ratio to Mitsuba llvm is taken within a round. Rendering is timed without start-up and
compilation, which are measured apart. Efficiency is paths per second over the variance of a path,
1/(variance · time); the variance is that between pictures with other seeds, in all renderers alike, and
relative to the squared mean. Stratified and Sobol samples share out a pixel, and theirs is that of the
picture times its samples.

Mitsuba does not count its rays. Where no roulette plays, its paths are taken to have as many as oneray's (≈).
What raycheck's own commands cost before they do anything is in processor seconds, by the median.
Scenes are written to build/benchmark/. Ctrl-C keeps what was measured. --scene, --growth-only and
--commands-only leave the other figures that FILE holds as they are.
"""

from __future__ import annotations

import argparse
import datetime
import importlib.metadata
import json
import os
import platform
import shlex
import subprocess
import sys
import time
from pathlib import Path

from benchmark_commands import measure_commands
from benchmark_contestants import ROOT, oneray_help
from benchmark_growth import AXES, grow
from benchmark_measure import measure_scene
from benchmark_scenes import SCENES, BenchScene

from raycheck.base.files import write_whole
from raycheck.base.machine import machine as processor
from raycheck.measuring import speed

QUICK_SCENE, QUICK_POINTS, QUICK_SECONDS = "cornell-2", 3, 0.03


def arguments_of(words: list[str] | None = None) -> argparse.Namespace:
    """The command line; a mistake is one line and exit status 2."""
    parser = argparse.ArgumentParser(
        prog="benchmark", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    names = [scene.name for scene in SCENES]
    parser.add_argument("--scene", action="append", metavar="NAME", help=f"one of {', '.join(names)}")
    parser.add_argument("--rounds", type=int, default=None, help="5, with --quick 2")
    parser.add_argument("--seconds", type=float, default=None, help="of each render: 0.5")
    parser.add_argument("--core", type=int, help="the core that everything is pinned to: the first")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures here as well")
    parser.add_argument("--no-growth", action="store_true", help="leave out how cost grows")
    parser.add_argument("--growth-only", action="store_true", help="measure only how cost grows")
    parser.add_argument("--commands-only", action="store_true", help="measure only raycheck's start-up")
    parser.add_argument("--quick", action="store_true", help="one scene and few points, to see that it works")
    parser.error = lambda message: parser.exit(2, f"benchmark: {message}\n")  # type: ignore[method-assign]
    given = parser.parse_args(words)
    given.rounds = given.rounds if given.rounds is not None else 2 if given.quick else 5
    given.seconds = given.seconds if given.seconds is not None else QUICK_SECONDS if given.quick else 0.5
    unknown = [name for name in given.scene or [] if name not in names]
    if unknown:
        parser.error(f"no scene {unknown[0]!r}; there are {', '.join(names)}")
    if given.rounds < 2:
        parser.error("--rounds is at least 2: a variance needs two pictures")
    if not 0 < given.seconds <= 60:
        parser.error("--seconds is above 0 and at most 60")
    if given.growth_only and (given.no_growth or given.commands_only):
        other = "--no-growth" if given.no_growth else "--commands-only"
        parser.error(f"{other} and --growth-only leave nothing")
    cores = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else {0}
    given.core = min(cores) if given.core is None else given.core
    if given.core not in cores:
        parser.error(f"there is no core {given.core} here")
    if given.json and not given.json.resolve().parent.is_dir():
        parser.error(f"{given.json}: no such folder")
    if not (ROOT / "build/oneray").is_file():
        parser.error("build/oneray is missing: run make")
    return given


def _first_line(*command: str) -> str:
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError:
        return ""
    return (done.stdout.splitlines() or [""])[0]


def machine() -> dict[str, object]:
    """What the figures depend on; the load average tells whether others were at work."""
    info = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").is_file() else ""
    flags = next((x.split() for x in info.splitlines() if x.startswith("flags")), [])
    try:
        mitsuba = importlib.metadata.version("mitsuba")
    except importlib.metadata.PackageNotFoundError:
        mitsuba = "missing"
    return {
        "processor": processor(),
        "vectors": [x for x in ("sse4_2", "avx2", "fma", "avx512f", "avx512dq") if x in flags],
        "virtual": "hypervisor" in flags,
        "cores": os.cpu_count(),
        "kernel": platform.release(),
        "load_average_before": os.getloadavg()[0],
        "compiler": _first_line("cc", "--version"),
        "oneray": _first_line(str(ROOT / "build/oneray"), "--version"),
        "mitsuba": mitsuba,
        "llvm": os.environ.get("DRJIT_LIBLLVM_PATH", ""),
    }


STARTED = time.monotonic()


def log(line: str) -> None:
    """A line of progress on standard error."""
    print(f"[{time.monotonic() - STARTED:6.1f} s] {line}", file=sys.stderr, flush=True)


def save(path: Path | None, result: dict) -> None:
    """Whole or not at all."""
    if path is None:
        return
    write_whole(path, json.dumps(result, indent=1, ensure_ascii=False) + "\n")


def chosen(given: argparse.Namespace) -> list[BenchScene]:
    wanted = given.scene or ([QUICK_SCENE] if given.quick else [scene.name for scene in SCENES])
    none = given.growth_only or given.commands_only
    return [] if none else [scene for scene in SCENES if scene.name in wanted]


def kept(given: argparse.Namespace) -> dict | None:
    """A whole result in FILE, of which only a part is to be measured again: by this machine, but for the
    commands, which name their own.
    """
    part = given.scene or given.growth_only or given.commands_only
    if not (given.json and given.json.is_file() and part):
        return None
    earlier = speed.read(given.json)
    same = earlier["machine"]["processor"] == processor() and earlier["rounds"] == given.rounds
    return dict(earlier) if (same or given.commands_only) and earlier["complete"] else None


def put(found: list[dict], one: dict, key: str) -> None:
    """In the place of what is called the same, else at the end."""
    names = [other[key] for other in found]
    place = names.index(one[key]) if one[key] in names else len(names)
    found[place : place + 1] = [one]


def run(given: argparse.Namespace, result: dict) -> None:
    """Fills `result`, which is saved after each scene and axis."""
    offer = oneray_help()
    for scene in chosen(given):
        one = measure_scene(scene, given.rounds, given.seconds, offer, log)
        put(result["scenes"], one, "name")
        save(given.json, result)
        print("\n".join([speed.plain(one), *(f"  start-up {x}" for x in speed.startup_lines(one)), ""]))
        sys.stdout.flush()
        if one["interrupted"]:
            raise KeyboardInterrupt
    if not (given.growth_only or given.scene):
        result["commands"] = {"machine": processor(), "rows": measure_commands(given.rounds)}
        save(given.json, result)
        print(speed.commands_line(result))
    for axis in () if given.no_growth or given.commands_only else AXES:
        if given.quick and axis.name != "spp":
            continue
        one = grow(axis, log, QUICK_POINTS if given.quick else None)
        put(result["growth"], one, "axis")
        save(given.json, result)
        if one["interrupted"]:
            raise KeyboardInterrupt
    result["complete"] = True


def main() -> int:
    given = arguments_of()
    os.environ.setdefault("DRJIT_LIBLLVM_PATH", "libLLVM.so.19.1")
    result: dict = kept(given) or {
        "command": shlex.join(["scripts/benchmark.py", *sys.argv[1:]]),
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "machine": machine(),
        "rounds": given.rounds,
        "seconds": given.seconds,
        "core": given.core,
        "complete": False,
        "scenes": [],
        "growth": [],
    }
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {given.core})
    try:
        run(given, result)
    except KeyboardInterrupt:
        log("interrupted: what was measured is kept")
    save(given.json, result)
    print("\n".join(speed.growth_lines(result)))
    return 0 if result["complete"] else 130


if __name__ == "__main__":
    sys.exit(main())
