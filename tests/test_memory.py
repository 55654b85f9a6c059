"""oneray needs no more memory than docs/render.md says."""

import json
import math
import subprocess
import sys
from pathlib import Path

import pytest
from test_meshes import ball, scene, write_ply

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

from benchmark_scenes import hall  # noqa: E402

PROGRAM, SHAPE, TRIANGLE, PIXEL = 8 << 20, 2500, 250, 48


def most(files: int, shapes: int, triangles: int, pixels: int, spp: int) -> float:
    """Bytes: of the program, the files read, shapes and lights, triangles, and the film's layers."""
    layers = 2 + math.log2(spp) + 1
    return PROGRAM + files + SHAPE * shapes + TRIANGLE * triangles + pixels * (PIXEL * layers + PIXEL / 2)


def peak(oneray: Path, file: Path, *words: str) -> int:
    """Through a shell: a process begins with the peak of the one that started it."""
    command = ["sh", "-c", '"$@"; true', "sh", oneray, file, "--quiet", "--stats", "-", *words]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return json.loads(done.stdout)["peak_memory_bytes"]


@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("lamp", [False, True])
def test_a_mesh(oneray: Path, tmp_path: Path, precision: str, lamp: bool) -> None:
    points, faces = ball(24 if lamp else 200)
    write_ply(tmp_path / "ball.ply", points, faces)
    file = scene(tmp_path / "scene.xml", "ball.ply", size=16, depth=4)
    if lamp:
        shines = '<emitter type="area"><rgb name="radiance" value="1"/></emitter></shape>'
        head, tail = file.read_text().split('<shape type="ply">')
        file.write_text(head + '<shape type="ply">' + tail.replace("</shape>", shines, 1))
    found = peak(oneray, file, "--spp", "1", "--precision", precision)
    read = (tmp_path / "ball.ply").stat().st_size
    bound = most(read, 10 + lamp * len(faces), (not lamp) * len(faces), 256, 1)
    assert 4096 < found <= bound


@pytest.mark.parametrize("choice", ["uniform", "contribution", "learned"])
def test_many_lights(oneray: Path, tmp_path: Path, choice: str) -> None:
    file = hall(tmp_path, 5000, size=16)
    found = peak(oneray, file, "--spp", "1", "--light-choice", choice)
    assert found <= most(file.stat().st_size, 5001, 0, 256, 1)


def test_a_large_film(oneray: Path) -> None:
    words = ("--spp", "4", "--width", "1024", "--height", "512")
    found = peak(oneray, ROOT / "scenes/furnace.xml", *words)
    assert found <= most(4096, 2, 0, 1024 * 512, 4)
