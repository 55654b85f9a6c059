"""What a run of verify judges, and references of scenes that are not canonical."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from raycheck.base import data
from raycheck.base.errors import NotFound
from raycheck.base.images import load_image
from raycheck.judging import sentences
from raycheck.judging.agenda import COVER, oneray_agenda, renderer_agenda, write_variant
from raycheck.scene import variants
from raycheck.scene.content import read_content
from raycheck.scene.techniques import TECHNIQUES, applicable, left_out
from raycheck.scene.variants import ladder, variant
from raycheck.truth import references


@pytest.fixture(autouse=True)
def built(oneray: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ONERAY", str(oneray))


def everything() -> list[variants.Variant]:
    return [variant(name) for name in variants.scene_names()]


def test_a_thorough_run_has_every_technique_that_applies_and_the_other_depths() -> None:
    agenda = oneray_agenda(everything(), (), variants=True)
    cases = {(task.label, task.technique) for task in agenda.tasks}
    assert len(cases) == len(agenda.tasks)
    for of in everything():
        for one in applicable(read_content(of.path)):
            assert ((of.label, one.name) in cases) != (f"{of.label}, {one.name}" in agenda.left_out)
    for of in ladder():
        judged = of.label in {label for label, _ in cases}
        assert judged != (of.label in agenda.left_out)
        assert judged == references.is_fresh(of)


def test_the_thorough_result_is_of_all_of_them() -> None:
    """The committed one; nothing FAILs in it."""
    path = data.references_dir() / "verification.json"
    found = json.loads(path.read_text(encoding="utf-8"))["cases"]
    tasks = oneray_agenda(everything(), (), variants=True).tasks
    assert [(c["scene"], c["technique"]) for c in found] == [(t.label, t.technique) for t in tasks]
    assert not [c for c in found if c["verdict"] == "FAIL"]


def test_a_quick_run_covers_every_technique_and_every_scene() -> None:
    whole = {(t.label, t.technique) for t in oneray_agenda(everything(), ()).tasks}
    quick = [(t.label, t.technique) for t in oneray_agenda(everything(), (), cover=True).tasks]
    assert set(quick) <= whole and len(quick) < len(whole)
    assert {label for label, _ in quick} == set(variants.scene_names())
    for one in TECHNIQUES:
        everywhere = sum(name == one.name for _, name in whole)
        assert sum(name == one.name for _, name in quick) >= min(COVER, everywhere)


def test_a_reason_is_said_once() -> None:
    found = {
        "metal, light": "pixel (1, 2) shows a mirror",
        "caustic, light": "pixel (3, 4) shows a mirror",
        "metal, light-uniform-choice": "pixel (1, 2) shows a mirror",
        "caustic, light-uniform-choice": "pixel (5, 6) shows a mirror",
        "furnace@depth=2": "there is no fresh reference",
    }
    assert sentences.left_out(found) == [
        "Left out: light, light-uniform-choice on metal, caustic: a pixel shows a mirror.",
        "Left out: furnace@depth=2: there is no fresh reference.",
    ]


def test_light_paths_are_left_out_where_the_eye_sees_a_mirror() -> None:
    agenda = oneray_agenda([variant("mirror-light")], ("nee", "light"))
    assert [task.technique for task in agenda.tasks] == ["nee"]
    assert "shows a mirror or glass" in agenda.left_out["mirror-light, light"]
    with pytest.raises(NotFound, match="shows a mirror or glass"):
        oneray_agenda([variant("mirror-light")], ("light",))


def test_another_renderer_gets_the_variant_as_a_file(tmp_path: Path, oneray: Path) -> None:
    """Its defaults are the parameters, so that the picture is that of oneray with -D, bit for bit."""
    of = variant("furnace@depth=3")
    agenda = renderer_agenda("render {scene} {output}", [of], tmp_path, explicit=True)
    assert agenda.tasks[0].path != of.path
    for scene, options in ((of.path, ["-Ddepth=3"]), (agenda.tasks[0].path, [])):
        target = tmp_path / f"{len(options)}.exr"
        subprocess.run([oneray, scene, "-o", target, "--spp", "2", *options], check=True)
    assert (load_image(tmp_path / "0.exr").pixels == load_image(tmp_path / "1.exr").pixels).all()


def test_a_variant_finds_its_meshes(tmp_path: Path) -> None:
    scene = tmp_path / "a.xml"
    scene.write_text(
        '<scene><default name="x" value="1"/><shape type="ply"><string name="filename" value="m.ply"/>'
        "</shape></scene>"
    )
    (tmp_path / "there").mkdir()
    text = write_variant(variant(scene, {"x": "2"}), tmp_path / "there").read_text()
    assert str(tmp_path / "m.ply") in text and 'value="2"' in text


def raycheck(*words: object, folder: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "raycheck", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, cwd=folder, check=False, env=os.environ)


@pytest.mark.parametrize("by", ["mitsuba", "oneray"])
def test_a_scene_of_ones_own(tmp_path: Path, by: str) -> None:
    """`raycheck reference` makes its reference, verify then judges it; a change makes it stale."""
    scene = tmp_path / "mine.xml"
    text = variants.scene_path("point-light").read_text()
    scene.write_text(text.replace('name="width" value="64"', 'name="width" value="16"'))
    missing = raycheck("verify", scene, folder=tmp_path)
    assert missing.returncode == 2 and f"make it with: raycheck reference {scene}" in missing.stderr
    made = raycheck("reference", "mine.xml", "--by", by, "--image-error", "1e-3", folder=tmp_path)
    assert made.returncode == 0, made.stderr
    assert made.stdout.index("about") < made.stdout.index("standard error")
    entry = json.loads((tmp_path / "references/manifest.json").read_text())["mine"]
    assert entry["width"] == 16 and (entry.get("renderer") == "oneray") == (by == "oneray")
    found = references.load_reference(scene)
    assert np.isfinite(found.mean).all() and found.closed_form is None
    judged = raycheck("verify", "mine.xml", "--technique", "nee", "--spp", "16", folder=tmp_path)
    assert judged.returncode in (0, 3), judged.stdout + judged.stderr
    scene.write_text(scene.read_text() + "<!-- changed -->\n")
    assert "is stale" in raycheck("verify", "mine.xml", folder=tmp_path).stderr


def test_what_no_reference_can_be_made_of(tmp_path: Path) -> None:
    """One line, exit status 2, nothing left behind."""
    broken = tmp_path / "broken.xml"
    broken.write_text('<scene version="3.0.0"><shape type="bsplinecurve"/></scene>')
    for arguments, message in (
        (["nowhere.xml"], "no scene 'nowhere.xml'"),
        ([broken, "--by", "oneray"], '<shape type="bsplinecurve"'),
        (["furnace", "-Dcolour=1"], "has no parameter colour"),
        (["furnace", "-Ddepth"], "-Dname=value is wanted"),
    ):
        done = raycheck("reference", *arguments, folder=tmp_path)
        assert done.returncode == 2
        assert message in done.stderr and len(done.stderr.splitlines()) == 1
    assert list(tmp_path.iterdir()) == [broken]


@pytest.mark.parametrize("name", variants.scene_names())
def test_every_technique_is_judged_or_left_out_for_a_reason(name: str) -> None:
    content = read_content(variants.scene_path(name))
    judged, without = applicable(content), left_out(content)
    names = [t.name for t in judged] + [name for names in without.values() for name in names]
    assert sorted(names) == sorted(t.name for t in TECHNIQUES)
    assert all(why for why in without)
