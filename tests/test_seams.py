"""Seams: paths can go through media and boundaries, a blend can have several finite parts, paths can be
bidirectional. They serve where they are asked for, and are not there where not.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from collections import Counter
from pathlib import Path

from building import build
from sampling import SOURCES

# What stands in the sources for nothing else, and how often.
SEAMS = {
    "estimators/nee.h": (r"    if \(f\.has & HAS_PASSING\)\n        return .*\n", 1),
    "kernel/trace.h": (r" +(?:else )?if \(f\.has & HAS_PASSING\)\n +path_.*\n", 3),
    "emitters/choice.h": (r"    if \(f\.has & HAS_ANY\(MEDIA\)\).*\n        d_cos_i = .*\n", 1),
    "materials/scatter.h": (r"    if \(f\.has & HAS_PARTS\)\n        evaluate_other_parts\(.*\n", 1),
}
INSTANCE = "-DLIST(X)=X(room, trace_paths, ROOM | HAS_DIELECTRIC, PANELS)"
WITH_A_SEAM = "-DLIST(X)=X(room, trace_paths, ROOM | HAS_BLEND | HAS_PARTS, PANELS)"

BY_CHANCE = re.compile(r"nop|cs nop|data16|xchg +%ax,%ax|mov|shufps \$0x0,|p?xor(?:ps)? +(%\w+),\1$")
"""What fills a line up, moves, and zeros and other numbers once more in a register or in all lanes of one."""


def instructions(sources: Path, target: Path, kinds: Path, instance: str = INSTANCE) -> Counter[str]:
    """Of one instance: how many of each there are. Which of two numbers a comparison names first, and so
    which way it jumps, is chance; so is BY_CHANCE, now and then.
    """
    command = [
        "cc", "-std=c99", "-O2", "-g0", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math",
        f"-I{sources}", f"-I{kinds}", "-DSINGLE", "-DLANES=4", "-DSPECIALISED", "-DKERNEL=kernel_single_4",
        "-DINSTANCES=instances_single_4", instance,
        "-c", str(sources / "kernel/instances.c"), "-o", str(target),
    ]  # fmt: skip
    subprocess.run(command, check=True, capture_output=True, text=True)
    command = ["objdump", "-d", "--no-show-raw-insn", str(target)]
    listing = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    rows = re.findall(r"^ +[0-9a-f]+:\t(.+)$", listing, re.MULTILINE)
    found = Counter(row.split()[0] for row in rows if not BY_CHANCE.match(row))
    for one, other in (("jl", "jg"), ("jle", "jge"), ("ja", "jb"), ("jae", "jbe")):
        found[f"{one} or {other}"] = found.pop(one, 0) + found.pop(other, 0)
    return Counter({name: count for name, count in found.items() if count})


def test_seams_fold_away(tmp_path: Path) -> None:
    """A scene without them is rendered by the same instructions as if they were not in the sources."""
    copy = tmp_path / "oneray"
    shutil.copytree(SOURCES, copy)
    for name, (seam, count) in SEAMS.items():
        text, found = re.subn(seam, "", (copy / name).read_text(encoding="utf-8"))
        assert found == count, name
        (copy / name).write_text(text, encoding="utf-8")
    build(tmp_path / "build", goal="kinds")
    whole = instructions(SOURCES, tmp_path / "whole.o", tmp_path / "build")
    without = instructions(copy, tmp_path / "without.o", tmp_path / "build")
    assert whole.total() > 1_500
    assert whole == without
    used = instructions(SOURCES, tmp_path / "used.o", tmp_path / "build", WITH_A_SEAM)
    not_used = instructions(copy, tmp_path / "not_used.o", tmp_path / "build", WITH_A_SEAM)
    assert used != not_used, "a seam that is used would be noticed"
