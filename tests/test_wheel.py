"""What pip installs: raycheck, which needs no compiler, and oneray apart."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import tomllib
import zipfile
from pathlib import Path

import pytest
from building import ROOT


def wheel(folder: Path, source: Path, *settings: str, **environment: str) -> Path:
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation"]
    command += ["-w", str(folder / "dist"), f"-Cbuild-dir={folder}/build", *settings, str(source)]
    subprocess.run(command, check=True, env=os.environ | environment, capture_output=True)
    (made,) = (folder / "dist").glob(f"{source.name if source != ROOT else 'raycheck'}-*.whl")
    return made


def raycheck(folder: Path, made: list[Path], *words: str) -> subprocess.CompletedProcess[str]:
    """Runs the wheel's raycheck in a virtual environment that has nothing else but what it depends on."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder / "clean"], check=True)
    python = folder / "clean/bin/python"
    install = [sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-deps", *made]
    subprocess.run(install, check=True)
    (site,) = (folder / "clean/lib").glob("python*/site-packages")
    (site / "dependencies.pth").write_text(f"{Path(pytest.__file__).parents[1]}\n")
    command = [folder / "clean/bin/raycheck", *words]
    return subprocess.run(
        command, capture_output=True, text=True, cwd=folder, env={"PATH": "/usr/bin:/bin"}, check=False
    )


def places(folder: Path) -> list[str]:
    """Where the installed package, and it alone, finds its scenes and references, and that it has types."""
    program = """
from raycheck.base.data import PACKAGE, references_dir, scenes_dir
from raycheck.scene import variants
assert len(variants.scene_names()) > 20 and (references_dir() / "manifest.json").is_file()
found = (scenes_dir(), references_dir(), PACKAGE / "py.typed")
print(*(path.relative_to(PACKAGE.parent) for path in found if path.exists()))
"""
    command = [folder / "clean/bin/python", "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder, env={}, check=True)
    return done.stdout.split()


RENDER = ("render", "mesh-room", "-o", "a.exr", "--spp", "2", "--jobs", "1")


@pytest.fixture(scope="module")
def pure(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Made with neither a compiler nor CMake."""
    folder = tmp_path_factory.mktemp("pure")
    (folder / "bin").mkdir()
    return wheel(folder, ROOT, CC="/bin/false", PATH=str(folder / "bin"))


def test_both_wheels_render(oneray: Path, pure: Path, tmp_path: Path) -> None:
    """A clean environment has both programs, and the scenes."""
    made = wheel(tmp_path, ROOT / "src/oneray", f"-Ccmake.define.ONERAY={oneray}")
    assert made.name.endswith(f"-py3-none-{sysconfig.get_platform().replace('-', '_')}.whl")
    done = raycheck(tmp_path, [pure, made], *RENDER)
    assert done.returncode == 0, done.stderr
    subprocess.run(
        [oneray, ROOT / "scenes/mesh-room.xml", "-o", tmp_path / "b.pfm", "--spp", "2"], check=True
    )
    assert places(tmp_path) == [f"raycheck/{name}" for name in ("scenes", "references", "py.typed")]
    assert raycheck_mean(tmp_path / "a.exr") == raycheck_mean(tmp_path / "b.pfm")


def test_raycheck_alone(pure: Path, tmp_path: Path) -> None:
    """It is pure, judges pictures, has its plugin and schemas, and says what it has not."""
    assert pure.name.endswith("-py3-none-any.whl")
    done = raycheck(tmp_path, [pure], *RENDER)
    assert done.returncode == 2
    assert "oneray was not found" in done.stderr
    names = set(zipfile.ZipFile(pure).namelist())
    assert "raycheck/schemas/verify.schema.json" in names and not any("bin/" in name for name in names)
    (tmp_path / "test_it.py").write_text("import pytest\n@pytest.mark.raycheck\ndef test_it():\n    pass\n")
    words = [tmp_path / "clean/bin/python", "-m", "pytest", "-rs", "-p", "no:cacheprovider", "test_it.py"]
    done = subprocess.run(words, cwd=tmp_path, env={}, capture_output=True, text=True, check=False)
    assert "takes --raycheck" in done.stdout, done.stdout + done.stderr


def test_both_have_one_version() -> None:
    files = [ROOT / name for name in ("pyproject.toml", "src/oneray/pyproject.toml")]
    first, second = (tomllib.loads(file.read_text(encoding="utf-8"))["project"]["version"] for file in files)
    assert first == second
    assert f'#define ONERAY_VERSION "{first}"' in (ROOT / "src/oneray/version.h").read_text(encoding="utf-8")


def raycheck_mean(path: Path) -> float:
    from raycheck.base.images import load_image

    return float(load_image(path).pixels.sum())
