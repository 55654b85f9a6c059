"""oneray under AddressSanitizer (with leaks) and UndefinedBehaviorSanitizer."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from building import ROOT, build, kernels
from malformed_meshes import MALFORMED as MALFORMED_MESHES
from test_meshes import scene as scene_of_mesh

SCENES = [
    *sorted((ROOT / "scenes").glob("*.xml")),
    ROOT / "tests/everything.xml",
    *sorted((ROOT / "tests/odd").glob("*.xml")),
]
MALFORMED = sorted((ROOT / "tests/malformed").glob("*.xml"))


@pytest.fixture(scope="module")
def sanitized(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Path:
    """A build that ends at the first error of memory or arithmetic: kernels that every processor runs;
    with --all one lane and wide ones too.
    """
    flags = "-O1 -fsanitize=address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer"
    widths = "double:2:0 single:4:0" + " double:8:2 double:1:0" * request.config.getoption("all")
    return build(tmp_path_factory.mktemp("sanitized"), CFLAGS=flags, KERNELS="generic", KERNEL_LIST=widths)


def run(*command: str | Path) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    assert "Sanitizer" not in done.stderr, done.stderr[:2000]
    assert "runtime error" not in done.stderr, done.stderr[:2000]
    return done


@pytest.mark.sample(24)
@pytest.mark.parametrize("scene", SCENES, ids=lambda path: path.stem)
def test_scenes(sanitized: Path, tmp_path: Path, scene: Path) -> None:
    """Each estimator at each width, and the whole way to a picture."""
    for precision, lanes in kernels(sanitized):
        for estimator in ("walk", "nee", "mis"):
            done = run(
                sanitized,
                scene,
                "-o",
                tmp_path / "out.exr",
                "--spp",
                "1",
                "--estimator",
                estimator,
                "--precision",
                precision,
                "--lanes",
                str(lanes),
                "--stats",
                tmp_path / "stats.json",
            )
            assert done.returncode == 0 or "no random ray hits" in done.stderr


def test_hidden_emitters_and_merge(sanitized: Path, tmp_path: Path) -> None:
    scene = ROOT / "tests/everything.xml"
    assert run(sanitized, scene, "-Dhide=true", "--samples", "0:3", "--film", tmp_path / "a").returncode == 0
    assert run(sanitized, scene, "-Dhide=true", "--samples", "3:6", "--film", tmp_path / "b").returncode == 0
    assert run(sanitized, "merge", tmp_path / "b", tmp_path / "a", "-o", tmp_path / "out.exr").returncode == 0


def test_malformed_scenes(sanitized: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All of them in one test: each ends with its error, not with the sanitizer's. What an error
    leaves behind is no leak.
    """
    monkeypatch.setenv("ASAN_OPTIONS", "detect_leaks=0")
    assert len(MALFORMED) >= 60
    for scene in MALFORMED:
        assert run(sanitized, scene, "-o", tmp_path / "out.exr").returncode == 2, scene.name


def test_malformed_meshes(sanitized: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each mesh file with a fault, and beginnings of good ones. What an error leaves behind is no leak."""
    monkeypatch.setenv("ASAN_OPTIONS", "detect_leaks=0")
    files = {name: data for name, (data, _) in MALFORMED_MESHES.items()}
    may_be_whole: set[str] = set()
    for good in sorted((ROOT / "tests/meshes").iterdir()):
        data = good.read_bytes()
        parts = {f"{cut}-{good.name}": data[: len(data) * cut // 24] for cut in range(24)}
        files |= parts
        # An OBJ does not say how long it is, and only the last mesh of several ends where the file does.
        may_be_whole |= set(parts) if good.suffix in (".obj", ".serialized") else set()
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
        scene = scene_of_mesh(tmp_path / "scene.xml", name, size=2)
        done = run(sanitized, scene, "-o", tmp_path / "out.exr", "--spp", "1")
        assert done.returncode == 2 or (name in may_be_whole and done.returncode == 0), name
