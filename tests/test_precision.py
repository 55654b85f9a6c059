"""--precision auto: single where it is certainly enough, by the rules of src/oneray/scene/precision.c.

That single is enough is shown with the same samples in both precisions: their paths are the same but for
rounding, so that the difference has little of their noise.
"""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from batches import diffuse, floor, glow, square, world
from building import ROOT

from raycheck.base.images import load_image

SCENES = sorted((ROOT / "scenes").glob("*.xml"))
ADDED = 1e-5
"""What single may add to the picture's mean, relative."""
SIGMAS = 4.5
"""In standard errors; 30 scenes together raise a false alarm once in 5000 choices of the seeds."""


def chosen(oneray: Path, scene: Path, *options: str) -> tuple[str, str]:
    """The precision that auto takes, and why."""
    command = [oneray, scene, "--spp", "1", "--quiet", "--stats", "-", *options]
    stats = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    return stats["precision"], stats["precision_chosen_for"]


def pixels(oneray: Path, scene: Path, target: Path, precision: str, seed: int) -> np.ndarray:
    command = [oneray, scene, "--precision", precision, "--spp", "64", "--seed", str(seed), "--quiet"]
    subprocess.run([*command, "-o", target], check=True)
    return np.asarray(load_image(target).pixels)


@pytest.mark.parametrize("scene", SCENES, ids=lambda path: path.stem)
def test_single_adds_no_bias_where_it_is_chosen(oneray: Path, tmp_path: Path, scene: Path) -> None:
    if chosen(oneray, scene)[0] == "double":
        pytest.skip("double is chosen")
    means, differences = [], []
    for seed in range(8):
        double, single = (
            pixels(oneray, scene, tmp_path / "out.exr", name, seed) for name in ("double", "single")
        )
        means.append(double.mean())
        differences.append((single - double).mean())
    error = np.std(differences, ddof=1) / np.sqrt(len(differences)) / np.mean(means)
    assert abs(np.mean(differences) / np.mean(means)) <= ADDED + SIGMAS * error
    assert error < 10 * ADDED


def test_most_canonical_scenes_are_ordinary(oneray: Path) -> None:
    assert sum(chosen(oneray, scene)[0] == "single" for scene in SCENES) >= 24


def sphere(x: float, y: float, z: float, radius: float, inside: str) -> str:
    return (
        f'<shape type="sphere"><point name="center" x="{x}" y="{y}" z="{z}"/>'
        f'<float name="radius" value="{radius}"/>{inside}</shape>'
    )


FLOOR = floor(diffuse(0.5))
STIFF = {
    "tiny lamp": (FLOOR + square(0, 1, 1e-5, glow(3)), "a shape of"),
    "sphere light close to the floor": (FLOOR + sphere(0, 0, 0.5001, 0.5, glow(3)), "a gap"),
    "occluder just below the lamp": (FLOOR + square(0, 1, 0.5, glow(3)) + square(0, 1 - 1e-6, 0.5), "a gap"),
    "far light": (FLOOR + sphere(0, 0, 1e8, 1e6, glow(3)), "reaches out"),
    "dim light": (FLOOR + square(0, 1, 0.5, glow(1e-30)), "a light of"),
    "bright light": (FLOOR + square(0, 1, 0.5, glow(1e30)), "a light of"),
}


@pytest.mark.parametrize("name", STIFF)
def test_what_is_stiff_is_left_to_double(oneray: Path, tmp_path: Path, name: str) -> None:
    shapes, rule = STIFF[name]
    scene = tmp_path / "scene.xml"
    scene.write_text(world(shapes), encoding="utf-8")
    assert chosen(oneray, scene)[0] == "double"
    assert rule in chosen(oneray, scene)[1]


def test_an_ordinary_room_is_single(oneray: Path, tmp_path: Path) -> None:
    scene = tmp_path / "scene.xml"
    scene.write_text(world(FLOOR + square(0, 1, 0.5, glow(3))), encoding="utf-8")
    assert chosen(oneray, scene)[0] == "single"


@pytest.mark.parametrize(
    ("settings", "material", "rule"),
    [
        ({"fov": 0.001}, diffuse(0.5), "a pixel of"),
        ({"depth": -1}, diffuse(0.98), "paths of more than"),
        ({}, diffuse(0.9999), "a reflectance within"),
        ({"eye": "0, 0, 1e7"}, diffuse(0.5), "reaches out"),
    ],
)
def test_sensor_depth_and_materials_count_too(
    oneray: Path, tmp_path: Path, settings: dict, material: str, rule: str
) -> None:
    scene = tmp_path / "scene.xml"
    scene.write_text(world(floor(material) + square(0, 1, 0.5, glow(3)), **settings), encoding="utf-8")
    precision, reason = chosen(oneray, scene)
    assert precision == "double"
    assert rule in reason


def test_a_scene_away_from_the_origin_is_double(oneray: Path, tmp_path: Path) -> None:
    text = world(square(1e4, 1e4, 0.5, glow(3)) + square(1e4, 1e4 + 5, 20), eye="1e4, 0, 1e4")
    scene = tmp_path / "scene.xml"
    scene.write_text(text, encoding="utf-8")
    assert chosen(oneray, scene)[0] == "double"
