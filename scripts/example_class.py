"""A class to try grading on: example_class.py DIR writes a correct submission, one of each typical mistake,
one of a single scene made from what `raycheck scene` prints, and a hopeless one.
"""

import argparse
import shutil
import tomllib
from pathlib import Path

from raycheck import references, scene_code, scene_export

SUBMISSIONS = Path(__file__).resolve().parents[1] / "tests/submissions"


def write(folder: Path, only: tuple[str, ...] = ()) -> None:
    """The submissions, or some of them, each in a folder of its own."""
    tables = tomllib.loads((SUBMISSIONS / "mistakes.toml").read_text(encoding="utf-8"))
    writers = {name: lambda to, t=table: _mistaken(to, t["changes"]) for name, table in tables.items()}
    writers |= {"honest": _honest, "one-scene": _one_scene, "hopeless": _hopeless}
    for name, writer in writers.items():
        if not only or name in only:
            writer(folder / name)


def _honest(folder: Path) -> None:
    shutil.copytree(SUBMISSIONS / "honest", folder)


def _mistaken(folder: Path, changes: list[list[str]]) -> None:
    _honest(folder)
    source = folder / "render.cpp"
    text = source.read_text(encoding="utf-8")
    for right, wrong in changes:
        if text.count(right) != 1:
            raise ValueError(f"{source}: {right!r} stands there {text.count(right)} times, once is needed")
        text = text.replace(right, wrong)
    source.write_text(text, encoding="utf-8")


def _one_scene(folder: Path) -> None:
    shutil.copytree(SUBMISSIONS / "one-scene", folder)
    data = scene_export.export(references.variant("point-light"))
    (folder / "scene.hpp").write_text(scene_code.source(data, scene_code.CPP), encoding="utf-8")


def _hopeless(folder: Path) -> None:
    folder.mkdir(parents=True)
    (folder / "render.cpp").write_text("int main() { return 0 }\n", encoding="utf-8")
    manifest = 'build = "g++ -o render render.cpp"\nrun = "./render {output}"\n'
    (folder / "raycheck.toml").write_text(manifest, encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, metavar="DIR")
    write(parser.parse_args().folder)
