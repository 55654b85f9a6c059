"""Copies of oneray with one mistake each: raycheck must see them, and what is right must pass.

`tests/mutants/NAME.patch` is a patch of the sources under a header; the sources hold no trace of it. Here is
a sample; `raycheck calibrate mutants` judges all of them.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from building import ROOT, build
from typer.testing import CliRunner

from raycheck.base.errors import PatchError
from raycheck.calibration import mutants, payloads, trials
from raycheck.commands.app import app
from raycheck.judging import conventions, mistakes
from raycheck.scene.techniques import technique

CATALOGUE = {mutant.name: mutant for mutant in mutants.catalogue()}
SAMPLE = (
    "nee-no-cosine", "emission-lost-after-mirror", "emission-twice", "light-not-scaled-by-n",
    "no-visibility-ray", "roulette-no-compensation", "mis-one-pdf-twice", "fresnel-counted-twice",
    "film-clamp", "seed-per-row", "visibility-ray-nearly", "twosided-back-dark", "sphere-back-dark",
    "mesh-light-mean-area",
)  # fmt: skip
CONTROLS = ("film-float", "light-choice-uniform")


def test_the_catalogue() -> None:
    """Sixty mistakes and more, each said in the words of who made it, and negative controls with a reason."""
    assert sum(mutant.catalogued for mutant in CATALOGUE.values()) >= 60
    assert sum(mutant.equivalent is not None for mutant in CATALOGUE.values()) >= 8
    for mutant in CATALOGUE.values():
        technique(mutant.shows)
        assert (ROOT / f"scenes/{mutant.scene}.xml").is_file(), mutant.name
        assert mutant.variant is None or CATALOGUE[mutant.variant].catalogued, mutant.name
        assert not (mutant.variant and mutant.equivalent), mutant.name


COMMON = (
    "albedo-srgb", "lamps-black", "lamps-end-paths", "filter-shifted", "pixel-middle",
    "filter-tent", "film-tone-mapped", "film-luminance", "film-white-balance", "total-reflection-absorbed",
    "throughput-clamped", "indirect-clamped", "sphere-no-cosine", "light-choice-elsewhere",
    "mis-choice-elsewhere", "visibility-ray-short", "visibility-ray-nearly", "sphere-dark-inside",
    "sphere-back-dark", "twosided-back-dark", "mesh-light-mean-area", "disk-no-root", "disk-light-no-root",
    "triangle-no-root", "hemisphere-uniform-angle", "cosine-uniform-angle", "rectangle-solid-angle-area-pdf",
)  # fmt: skip
"""Mistakes that people make often."""


def test_what_is_often_done_wrong_can_be_named() -> None:
    """Each has a signature in a scene that shows it; a wider filter also has the words of a convention."""
    signed = mistakes.manifest()["mistakes"]
    for name in COMMON:
        assert CATALOGUE[name].catalogued and name in signed, name
    said = " ".join(convention.words for convention, _ in conventions.pictures(np.ones((8, 8, 3))))
    assert CATALOGUE["filter-gaussian"].catalogued and "a gaussian of" in said and "a tent of" in said
    assert CATALOGUE["roulette-by-albedo"].equivalent, "any chance to survive is right, if it is divided by"


def test_every_patch_applies() -> None:
    """To the sources as they are: one that no longer does is of no use to anyone."""
    stale = []
    for mutant in CATALOGUE.values():
        command = ["patch", "--dry-run", "-p1", "--fuzz=1", "-f", "-i", str(mutant.patch)]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        if done.returncode:
            stale.append(f"{mutant.name}: {done.stdout.strip().splitlines()[-1]}")
    assert not stale, "\n".join(stale)


@pytest.fixture(scope="module")
def kinds(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the headers that the build writes."""
    folder = tmp_path_factory.mktemp("kinds")
    build(folder, goal="kinds")
    return folder


OTHERS = {
    mutant.name: mutant
    for folder in ("mutants_bidirectional", "mutants_resampled", "mutants_photons", "mutants_media")
    for mutant in mutants.catalogue(ROOT / "tests" / folder)
}


@pytest.mark.sample(30)
@pytest.mark.parametrize("name", [*CATALOGUE, *OTHERS])
def test_every_patch_compiles(tmp_path: Path, kinds: Path, name: str) -> None:
    """What changes around it, as the arguments of a function that it calls, may leave a patch that applies
    and is no program any more.
    """
    mutant = (CATALOGUE | OTHERS)[name]
    shutil.copytree(ROOT / "src/oneray", tmp_path / "src/oneray")
    touched = mutants.apply(mutant, tmp_path)
    files = {path for path in touched if path.endswith(".c")}
    for header in touched - files:
        beside = (tmp_path / header).parent.glob("*.c")
        files |= {str(path.relative_to(tmp_path)) for path in beside if path.stem != "instances"}
        files.add("src/oneray/kernel/kernel.c")
    command = ["cc", "-std=c99", "-D_XOPEN_SOURCE=700", "-fsyntax-only", "-Wall", "-Wno-unused", "-Wno-psabi"]
    command += ["-DLANES=2", "-DKERNEL=kernel_double_2", "-DKERNELS(X)=X(double, 2, 0)"]
    command += ["-Isrc/oneray", f"-I{kinds}"]
    command += subprocess.check_output(["pkg-config", "--cflags", "OpenEXR"], text=True).split()
    done = subprocess.run(
        [*command, *sorted(files)], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[:2000]


def test_a_patch_that_does_not_apply_is_told(tmp_path: Path) -> None:
    patch = tmp_path / "old.patch"
    text = CATALOGUE["nee-no-cosine"].patch.read_text()
    patch.write_text(text.replace("-    Light light", "-    Light lights"))
    with pytest.raises(PatchError, match=r"old\.patch no longer applies"):
        mutants.build(mutants.read(patch), tmp_path / "copy")
    patch.write_text(text.replace("Symptom: ", "Symptoms: "))
    with pytest.raises(PatchError, match="the header needs"):
        mutants.read(patch)


def judged(name: str) -> trials.Trial:
    mutant = CATALOGUE[name]
    program = trials.Program(mutants.program(mutant), mutant.shows)
    return trials.try_program(program, mutant.scene, trials.load_truth(mutant.scene), spp=8)


@pytest.mark.sample(5)
@pytest.mark.parametrize("name", SAMPLE)
def test_a_mistake_fails(name: str) -> None:
    trial = judged(name)
    assert trial.rejected["raycheck"], trial.reason


@pytest.mark.parametrize("name", CONTROLS)
def test_no_mistake_does_not(name: str) -> None:
    trial = judged(name)
    assert trial.images is not None and not trial.rejected["raycheck"], trial.reason


@pytest.mark.parametrize("name", [*SAMPLE, *CONTROLS])
def test_a_patch_is_the_mistake_that_it_was(name: str) -> None:
    """Bit for bit, however the patch is written: what is known of the mistake is known of its payload. All of
    them: `python scripts/mutant_payloads.py --check`.
    """
    assert payloads.of_mutant(CATALOGUE[name]) == payloads.kept()[name]


def test_every_mistake_has_a_payload_of_its_own_picture() -> None:
    """None is missing or of a patch that is gone, and none leaves all numbers as they are."""
    kept = payloads.kept()
    assert list(kept) == sorted(CATALOGUE)
    for name, mutant in CATALOGUE.items():
        assert kept[name] != payloads.of_correct(*payloads.where(mutant)), name


def test_a_patch_of_what_nobody_includes_is_told(tmp_path: Path) -> None:
    """It would leave the program as it is."""
    base = mutants.program(None).parent.parent
    patch = tmp_path / "alone.patch"
    head = CATALOGUE["nee-no-cosine"].patch.read_text().split("\n---")[0]
    name = "src/oneray/alone.h"
    patch.write_text(f"{head}\n--- a/{name}\n+++ b/{name}\n@@ -0,0 +1 @@\n+int alone;\n", encoding="utf-8")
    with pytest.raises(mutants.PatchError, match=f"alone: nothing that is compiled includes {name}"):
        mutants.build(mutants.read(patch), tmp_path / "copy", base)


ASSIGNMENT = """\
name = "check"
delta = 0.1
[limits]
picture_seconds = 1
[[task]]
id = "L4"
lecture = "L4"
scenes = ["many-lights"]
points = 1
spp = 8
technique = "nee-uniform-choice"
"""


@pytest.mark.skipif(sys.platform != "linux", reason="grading needs Linux")
def test_an_assignment_is_tried_out_with_an_honest_program_and_a_mistake(tmp_path: Path) -> None:
    asked = tmp_path / "a.toml"
    asked.write_text(ASSIGNMENT, encoding="utf-8")
    words = ["grade", "--check", str(asked), "--mutants", "light-not-scaled-by-n"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    assert re.search(r"L4 +PASS .* 1 of 1", done.output), done.output
    slow = CliRunner().invoke(app, [*words[:3], "--mutants", "none", "--paths-per-second", "20000"])
    assert slow.exit_code == 2 and "L4: a picture of 8 samples takes 1.7 s" in slow.output
    late = CliRunner().invoke(app, [*words[:3], "--mutants", "none", "--limit", "3"])
    assert late.exit_code == 2 and "all tasks: they take" in late.output
    unknown = CliRunner().invoke(app, [*words[:3], "--mutants", "no-such"])
    assert unknown.exit_code == 2 and "'no-such' is none of few, all, none" in unknown.output
