"""One reader of scene files: whatever looks into one reads defaults, references and file names by the same
rules,
which are Mitsuba's and oneray's.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from raycheck.base.errors import ReferenceError_
from raycheck.calibration import part_making
from raycheck.grading import hidden
from raycheck.grading.handout import write_handout
from raycheck.grading.program import write_scene
from raycheck.judging.agenda import write_variant
from raycheck.renderers import shards
from raycheck.scene import export, variants
from raycheck.scene.content import read_content
from raycheck.scene.reader import read_scene

ROOT = Path(__file__).resolve().parents[1]
MESH = ROOT / "scenes/meshes/coarse-ball.ply"
SCENE = """\
<scene version="3.0.0">
    <default value="2" name="depth"/>
    <default value="parts/ball" name="mesh"/>
    <default name="meshes" value="$mesh.ply"/>
    <integrator type="path">
        <integer value="$depth" name="max_depth"/>
    </integrator>
    <sensor type="perspective">
        <float value="40" name="fov"/>
        <transform name="to_world"><lookat target="0, 0, 0" origin="0, -4, 0" up="0, 0, 1"/></transform>
        <film type="hdrfilm">
            <integer value="16" name="width"/>
            <integer value="16" name="height"/>
            <rfilter type="box"/>
        </film>
    </sensor>
    <bsdf type="twosided" id="paint">
        <ref id="grey"/>
    </bsdf>
    <bsdf type="blendbsdf" id="mix">
        <float value="0.25" name="weight"/>
        <ref id="grey"/>
        <bsdf type="conductor"><string value="none" name="material"/></bsdf>
    </bsdf>
    <bsdf type="diffuse" id="grey">
        <rgb value="0.25" name="reflectance"/>
    </bsdf>
    <shape type="ply">
        <string value="$meshes" name="filename"/>
        <ref id="paint"/>
    </shape>
    <shape type="sphere">
        <float value="0.5" name="radius"/>
        <ref id="mix"/>
    </shape>
    <emitter type="constant"/>
</scene>
"""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """With a mesh whose name comes out of two defaults, `value` before `name`, and materials by reference."""
    (tmp_path / "parts").mkdir()
    shutil.copy(MESH, tmp_path / "parts/ball.ply")
    shutil.copy(MESH, tmp_path / "parts/other.ply")
    path = tmp_path / "named.xml"
    path.write_text(SCENE)
    return path


def primitives(path: Path) -> list[dict]:
    return export.export(variants.variant(path))["primitives"]


def test_oneray_agrees(oneray: Path, scene: Path, tmp_path: Path) -> None:
    command = [oneray, scene, "-o", tmp_path / "out.exr", "--spp", "1"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_the_mesh_and_the_parameters_are_found(scene: Path) -> None:
    assert variants.files_of(scene) == [scene.parent / "parts/ball.ply"]
    assert variants.files_of(scene, {"mesh": "parts/other"}) == [scene.parent / "parts/other.ply"]
    assert variants.variant(scene, {"depth": "1"}).label == "named@depth=1"
    assert read_content(scene).max_depth == 2
    assert read_content(scene, {"depth": "7"}).max_depth == 7
    assert len(primitives(scene)) > 40


def test_a_scene_belongs_to_its_mesh(scene: Path) -> None:
    before = variants.scene_hash(scene)
    (scene.parent / "parts/ball.ply").write_bytes(MESH.read_bytes() + b"\n")
    assert variants.scene_hash(scene) != before


def test_materials_by_reference_are_read_inside_others(scene: Path) -> None:
    ball, sphere = read_scene(scene).shapes
    assert ball.material.two_sided and np.all(ball.material.reflectance == 0.25)
    first, second = sphere.material.parts
    assert (first.kind, second.kind) == ("diffuse", "conductor") and np.all(first.reflectance == 0.25)


def test_a_lamp_without_material_is_black(scene: Path) -> None:
    lamp = '<shape type="rectangle"><emitter type="area"/></shape><shape type="cube"/>'
    scene.write_text(SCENE.replace("</scene>", f"{lamp}</scene>"))
    *_, lamp, cube = read_scene(scene).shapes
    assert not lamp.material.reflectance.any() and np.all(cube.material.reflectance == 0.5)


@pytest.mark.parametrize("mesh", ["parts/ball", "parts/other"])
def test_a_variant_written_elsewhere_shows_the_same(scene: Path, tmp_path: Path, mesh: str) -> None:
    of = variants.variant(scene, {"mesh": mesh, "depth": "3"})
    (tmp_path / "far").mkdir()
    written = write_variant(of, tmp_path / "far")
    assert variants.files_of(written) == [scene.parent / f"{mesh}.ply"]
    assert primitives(written) == export.export(of)["primitives"]
    assert read_content(written).max_depth == 3


def test_a_submission_gets_the_mesh_beside_the_scene(scene: Path, tmp_path: Path) -> None:
    folder = tmp_path / "task"
    assert write_scene(variants.variant(scene), "named", folder) == (16, 16)
    assert {path.name for path in folder.iterdir()} == {"scene.xml", "scene.json", "ball.ply"}
    assert variants.files_of(folder / "scene.xml") == [folder / "ball.ply"]
    assert json.loads((folder / "scene.json").read_text())["primitives"] == primitives(folder / "scene.xml")


def test_a_split_render_takes_the_mesh_along(scene: Path) -> None:
    assert set(shards.Work(scene, {}, ()).files()) == {"named.xml", "parts/ball.ply"}


def test_hidden_variants_and_templates_find_the_mesh(scene: Path, tmp_path: Path) -> None:
    of = variants.variant(scene, {"mesh": "parts/other"})
    hidden._copy_meshes(of, tmp_path / "hidden")
    assert (tmp_path / "hidden/parts/other.ply").is_file()
    names = [e.get("value") for e in part_making.parse(of).iter("string") if e.get("name") == "filename"]
    assert names == [str(scene.parent / "parts/other.ply")]


def test_students_get_the_mesh(scene: Path, tmp_path: Path) -> None:
    from raycheck.grading import handout

    class Asked:
        """An assignment of the one scene."""

        tasks = (type("Task", (), {"scenes": ("named.xml",)}),)

        def path_of(self, name: str) -> Path:
            return scene.parent / name

    handout._copy_scenes(Asked(), tmp_path / "scenes")
    assert (tmp_path / "scenes/parts/ball.ply").is_file()
    assert callable(write_handout)


def test_included_files_belong_to_the_scene(scene: Path, tmp_path: Path) -> None:
    """Where they stand, by the defaults before them."""
    begin = SCENE.index('<bsdf type="twosided"')
    end = SCENE.index('<shape type="ply"')
    (tmp_path / "materials.xml").write_text(f'<scene version="3.0.0">{SCENE[begin:end]}</scene>')
    whole = tmp_path / "whole.xml"
    whole.write_text(f'{SCENE[:begin]}<default name="what" value="materials"/>'
                     f'<include filename="$what.xml"/>{SCENE[end:]}')  # fmt: skip
    assert variants.files_of(whole) == [tmp_path / "materials.xml", tmp_path / "parts/ball.ply"]
    assert primitives(whole) == primitives(scene)
    before = variants.scene_hash(whole)
    (tmp_path / "materials.xml").write_text((tmp_path / "materials.xml").read_text().replace("0.25", "0.5"))
    assert variants.scene_hash(whole) != before


def test_a_default_holds_from_where_it_stands_and_the_longest_name_counts(tmp_path: Path) -> None:
    path = tmp_path / "names.xml"
    head = '<default name="a" value="1"/><default name="ab" value="\\$a$a2"/>'
    path.write_text(SCENE.replace("<integrator", f"{head}<default name='abc' value='$ab'/><integrator"))
    from raycheck.scene import document

    assert document.read(path).defaults["abc"] == "$a12"
    assert document.read(path, {"a": "$x"}).defaults["abc"] == "$a$x2"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (SCENE.replace("</scene>", ""), "named.xml: no element found"),
        (SCENE.replace("$depth", "$deep"), r"named.xml: undefined parameter \$deep \(.*depth, mesh, meshes"),
        (SCENE.replace('<default value="2" name="depth"/>', ""), r"undefined parameter \$depth"),
        (SCENE.replace('<default value="2" name', "<default name"), 'default lacks its attribute "value"'),
        (SCENE.replace('<ref id="mix"/>', '<ref id="none"/>'), r'<ref id="none"/>: nothing has this id'),
        (SCENE.replace("</scene>", '<include filename="named.xml"/></scene>'), "includes itself"),
        (SCENE.replace("</scene>", '<include filename="none.xml"/></scene>'), "none.xml: No such file"),
    ],
)
def test_what_cannot_be_read_is_one_plain_line(scene: Path, text: str, message: str) -> None:
    scene.write_text(text)
    with pytest.raises(ReferenceError_, match=message):
        read_scene(scene)
    done = subprocess.run(
        [sys.executable, "-m", "raycheck", "scene", str(scene)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2 and done.stderr.startswith("raycheck: ") and done.stderr.count("\n") == 1
