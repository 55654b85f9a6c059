"""What pip installs: with oneray inside, or without a compiler without it."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
from pathlib import Path

from building import ROOT


def wheel(folder: Path, *settings: str, **environment: str) -> Path:
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation"]
    command += ["-w", str(folder), f"-Cbuild-dir={folder}/build", *settings, str(ROOT)]
    subprocess.run(command, check=True, env=os.environ | environment, capture_output=True)
    (made,) = folder.glob("*.whl")
    return made


def raycheck(folder: Path, made: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Runs the wheel's raycheck in a virtual environment that has nothing else but what it depends on."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder / "clean"], check=True)
    python = folder / "clean/bin/python"
    install = [sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-deps", made]
    subprocess.run(install, check=True)
    (site,) = (folder / "clean/lib").glob("python*/site-packages")
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
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


def test_a_wheel_with_oneray_renders(oneray: Path, tmp_path: Path) -> None:
    """A clean environment has both programs, and the scenes."""
    made = wheel(tmp_path, f"-Ccmake.define.ONERAY={oneray}")
    assert made.name.endswith(f"-py3-none-{sysconfig.get_platform().replace('-', '_')}.whl")
    done = raycheck(tmp_path, made, "render", "mesh-room", "-o", "a.exr", "--spp", "2", "--jobs", "1")
    assert done.returncode == 0, done.stderr
    subprocess.run(
        [oneray, ROOT / "scenes/mesh-room.xml", "-o", tmp_path / "b.pfm", "--spp", "2"], check=True
    )
    assert places(tmp_path) == [f"raycheck/{name}" for name in ("scenes", "references", "py.typed")]
    assert raycheck_mean(tmp_path / "a.exr") == raycheck_mean(tmp_path / "b.pfm")


def test_a_wheel_without_a_compiler(tmp_path: Path) -> None:
    """It is pure, judges pictures, and says what it has not."""
    made = wheel(tmp_path, CC="/bin/false")
    assert made.name.endswith("-py3-none-any.whl")
    done = raycheck(tmp_path, made, "render", "mesh-room", "-o", "a.exr", "--spp", "2", "--jobs", "1")
    assert done.returncode == 2
    assert "oneray was not found" in done.stderr


def raycheck_mean(path: Path) -> float:
    from raycheck.base.images import load_image

    return float(load_image(path).pixels.sum())
