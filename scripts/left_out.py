"""What each feature that a scene does not have would cost it: instructions of the Cornell box at depth 8.

    python scripts/left_out.py

For each feature that the specialised instance of the scene lacks and that needs no table, an instance with
that feature beside is compiled and run under valgrind's callgrind, at 4 lanes in double precision. Printed is
a table of the instructions more, as docs/how-it-is-built.md has it. Takes some minutes.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SCENE = ROOT / "scenes/cornell-box.xml"
ROOM = "HAS_PERSPECTIVE|HAS_ALIGNED|HAS_CUBE|HAS_DIFFUSE|HAS_AREA|HAS_FLAT_LIGHT"
USES = "USE_NEE|USE_MIS|USE_COSINE|USE_SOLID_ANGLE|USE_ROULETTE"
FEATURES = {
    "HAS_RECTANGLE": "rectangles at an angle to the axes",
    "HAS_DISK": "disks",
    "HAS_SPHERE": "spheres",
    "HAS_CONDUCTOR": "mirrors",
    "HAS_MANY_LIGHTS": "more lights than one",
    "HAS_SPHERE_LIGHT": "sphere lights",
    "HAS_MESH_LIGHT": "mesh lights",
    "HAS_POINT": "point lights",
    "HAS_SPOT": "spots",
    "HAS_DIRECTIONAL": "directional lights",
    "HAS_CONSTANT": "an environment",
}


def instructions(oneray: Path, kernel: str) -> int:
    """Per 8 samples of each pixel, without start-up."""
    counts = []
    for spp in (9, 1):
        with tempfile.TemporaryDirectory() as folder:
            render = [oneray, SCENE, "--precision", "double", "--lanes", "4", "--kernel", kernel]
            command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={folder}/out", *render]
            command += ["--spp", str(spp), "--quiet", "-o", f"{folder}/out.exr"]
            done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=True)
        found = re.search(r"Collected : (\d+)", done.stderr)
        if not found:
            sys.exit(f"valgrind counted nothing: {done.stderr.strip()}")
        counts.append(int(found.group(1)))
    return counts[0] - counts[1]


def film(oneray: Path, kernel: str) -> bytes:
    """The samples that a kernel renders, to see that a feature more changes none."""
    with tempfile.TemporaryDirectory() as folder:
        render = [oneray, SCENE, "--precision", "double", "--lanes", "4", "--kernel", kernel]
        command = [*render, "--samples", "0:4", "--film", f"{folder}/film", "--quiet"]
        subprocess.run([str(c) for c in command], check=True)
        return Path(folder, "film").read_bytes()


def build(folder: Path, features: str) -> Path:
    """oneray with one instance, `room`, for scenes that have these features."""
    make = ["make", "-C", str(ROOT), f"BUILD={folder}", "KERNEL_LIST=double:4:1:special"]
    subprocess.run([*make, "all"], check=True, capture_output=True)
    again = [*make, "-n", "-W", "src/oneray/kernel/instances.c", "all"]
    commands = subprocess.run(again, check=True, capture_output=True, text=True).stdout
    commands = re.sub(r"^make.*$", "", commands, flags=re.M)
    commands = commands.replace(
        "-DSPECIALISED", f"-DSPECIALISED -D'LIST(X)=X(room, trace_paths, {features}, {USES})'"
    )
    subprocess.run(["sh", "-ec", commands], check=True, cwd=ROOT)
    return folder / "oneray"


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        oneray = build(Path(folder), ROOM)
        lean, generic = (instructions(oneray, kernel) for kernel in ("auto", "generic"))
        print("| feature | instructions more |\n| --- | --- |")
        for feature, words in FEATURES.items():
            built = build(Path(folder), f"{ROOM}|{feature}")
            if film(built, "auto") != film(built, "generic"):
                sys.exit(f"{feature}: not the same picture")
            cost = instructions(built, "auto")
            print(f"| {words} | {100 * (cost / lean - 1):.1f} % |", flush=True)
        print(f"| all, asked for as it runs (`--kernel generic`) | {100 * (generic / lean - 1):.1f} % |")


if __name__ == "__main__":
    main()
