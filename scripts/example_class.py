"""A class to try grading on: example_class.py DIR writes submissions that are right, one of each typical
mistake, pictures instead of a program, the handout as it is, and every attack of tests/attacks.

    example_class.py class --assignment assignment.toml
    raycheck grade --assignment assignment.toml --class class --out grades
    example_class.py --compare grades/grades.csv earlier/grades.csv

The last prints where two tables of grades differ: points, verdicts, totals; comments hold figures, and only
those of attacks are looked at, for the reason.
"""

import argparse
import csv
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable, Sequence
from pathlib import Path

from raycheck.calibration import mutants
from raycheck.grading import attacks
from raycheck.grading.assignment import PICTURES, Assignment, Task, read_assignment
from raycheck.grading.handout import write_handout
from raycheck.grading.hidden import pool_index
from raycheck.grading.judge import picture_pool
from raycheck.grading.keys import read_keys
from raycheck.renderers.oneray import oneray_command, oneray_path
from raycheck.scene import code, export, variants
from raycheck.scene.techniques import technique

ROOT = Path(__file__).resolve().parents[1]
SUBMISSIONS = ROOT / "tests/submissions"
PICTURES_EACH, PICTURES_SPP = 16, 64


def write(folder: Path, assignment: Assignment, only: Sequence[str] = ()) -> None:
    """The submissions, or some of them, each in a folder of its own."""
    for name, writer in writers(assignment).items():
        if not only or name in only:
            writer(folder / name)
    if not only:
        attacks.hostile_archives(folder)


def writers(assignment: Assignment) -> dict[str, Callable[[Path], None]]:
    """What makes each submission, by its name."""
    tables = tomllib.loads((SUBMISSIONS / "mistakes.toml").read_text(encoding="utf-8"))
    found = {
        name: lambda to, t=table: _mistaken(to, t["changes"], t.get("tasks"))
        for name, table in tables.items()
    }
    found |= {"honest": _honest, "one-scene": _one_scene, "hopeless": _hopeless}
    for name in ("pictures", "pictures-of-another"):
        found[name] = lambda to, n=name: _pictures(to, assignment, step=n != "pictures")
    found["handout"] = lambda to: write_handout(assignment, to)
    found["handout-solved"] = lambda to: _oneray(to, assignment, None)
    for patch, name, tasks in (
        ("light-path-no-cosine", "light", ("L2",)), ("learned-floor", "nee-learned", ("L6",)),
    ):  # fmt: skip
        found[f"oneray-{patch}"] = lambda to, p=patch, n=name, t=tasks: _oneray(to, assignment, p, n, t)
    return found | {one.name: lambda to, a=one: _attack(to, a) for one in attacks.read_attacks()}


def _attack(folder: Path, attack: attacks.Attack) -> None:
    """What imitates a renderer does so for two tasks; what hangs, swells or breaks out does so in all."""
    attacks.hand_in(attack, folder)
    if "{spp}" in attack.run:
        _only_for(folder, ("L1", "L2"))


def _honest(folder: Path) -> None:
    shutil.copytree(SUBMISSIONS / "honest", folder)


def _mistaken(folder: Path, changes: list[list[str]], tasks: list[str] | None) -> None:
    _honest(folder)
    source = folder / "render.cpp"
    text = source.read_text(encoding="utf-8")
    for right, wrong in changes:
        if text.count(right) != 1:
            raise ValueError(f"{source}: {right!r} stands there {text.count(right)} times, once is needed")
        text = text.replace(right, wrong)
    source.write_text(text, encoding="utf-8")
    if tasks:
        _only_for(folder, tasks)


def _only_for(folder: Path, tasks: Sequence[str]) -> None:
    """Of a student who got to these tasks."""
    script = f"""\
case $1 in
{"|".join(tasks)}) shift; exec "$@" ;;
*) echo "$1 is not written yet" >&2; exit 1 ;;
esac
"""
    (folder / "some.sh").write_text(script, encoding="utf-8")
    manifest = folder / "raycheck.toml"
    text = manifest.read_text(encoding="utf-8")
    manifest.write_text(text.replace('command = "', 'command = "sh some.sh {task} '), encoding="utf-8")


def _one_scene(folder: Path) -> None:
    shutil.copytree(SUBMISSIONS / "one-scene", folder)
    data = export.export(variants.variant("point-light"))
    (folder / "scene.hpp").write_text(code.source(data, code.CPP), encoding="utf-8")


def _hopeless(folder: Path) -> None:
    folder.mkdir(parents=True)
    (folder / "render.cpp").write_text("int main() { return 0 }\n", encoding="utf-8")
    manifest = 'build = "g++ -o render render.cpp"\ncommand = "./render {output}"\n'
    (folder / "raycheck.toml").write_text(manifest, encoding="utf-8")


def _pictures(folder: Path, assignment: Assignment, step: int) -> None:
    """By oneray, in place of a renderer that cannot run here; of the variant of the student whose name the
    folder has, or of the next one.
    """
    for task in assignment.tasks:
        if task.accepts == PICTURES:
            (folder / "pictures" / task.id).mkdir(parents=True)
            _render_variant(folder / "pictures" / task.id, assignment, task, folder.name, step)


def _render_variant(folder: Path, assignment: Assignment, task: Task, student: str, step: int) -> None:
    keys = read_keys(assignment.path, assignment.name)
    index = pool_index(assignment.scene(task.scenes[0]), student, task.variants, keys) + step
    of = picture_pool(assignment, keys, task)[index % task.variants]
    options = technique(task.technique).options if task.technique else ()
    command = oneray_command(oneray_path(), options, of.parameters)
    for seed in range(PICTURES_EACH):
        words = command.arguments(of.path, folder / f"{seed}.exr", PICTURES_SPP, seed)
        subprocess.run(words, check=True)


def _oneray(
    folder: Path, assignment: Assignment, patch: str | None, name: str = "", tasks: Sequence[str] = ()
) -> None:
    """The handout with everything in it, or with a mistake, in the tasks' techniques or in one for some."""
    with tempfile.TemporaryDirectory() as place:
        write_handout(assignment, Path(place) / "handout")
        shutil.copytree(Path(place) / "handout", folder)
    shutil.copytree(ROOT / "src/oneray", folder / "src/oneray", dirs_exist_ok=True)
    if patch:
        mutants.apply(mutants.read(mutants.FOLDER / f"{patch}.patch"), folder)
    if name:
        command = "build/oneray {scene} --spp {spp} --seed {seed} -o {output} --quiet"
        run = " ".join((command, *technique(name).options))
        (folder / "raycheck.toml").write_text(f'build = "make"\ncommand = "{run}"\n', encoding="utf-8")
        _only_for(folder, tasks)


def differences(found: Path, expected: Path) -> list[str]:
    """Where two tables of grades say something else, a line each: points, verdicts, totals, and the reasons
    that hostile submissions must get.
    """
    ours, theirs = _table(found), _table(expected)
    reasons = {one.name: one.reason for one in attacks.read_attacks()} | attacks.ARCHIVES
    lines = [f"{name}: in {expected} alone" for name in theirs if name not in ours]
    lines += [f"{name}: in {found} alone" for name in ours if name not in theirs]
    for name in ours.keys() & theirs.keys():
        comment = ours[name].pop("comment", "")
        if not re.search(reasons.get(name, ""), comment):
            lines.append(f"{name}: the comment does not say {reasons[name]!r}: {comment}")
        for column in theirs[name].keys() - {"comment"}:
            if ours[name].get(column) != theirs[name][column]:
                lines.append(
                    f"{name}, {column}: {ours[name].get(column)!r}, {theirs[name][column]!r} is expected"
                )
    return sorted(lines)


def _table(path: Path) -> dict[str, dict[str, str]]:
    """The rows of a grades.csv by student."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return {row.pop("student"): row for row in rows}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path, metavar="DIR", nargs="?")
    parser.add_argument("--assignment", type=Path, metavar="FILE.toml", default=ROOT / "docs/lecture12.toml")
    parser.add_argument("--compare", type=Path, nargs=2, metavar="grades.csv")
    arguments = parser.parse_args()
    if (arguments.folder is None) == (arguments.compare is None):
        parser.error("a folder to write, or --compare")
    if arguments.folder:
        if arguments.folder.exists():
            parser.error(f"{arguments.folder} is there already: name a new folder")
        write(arguments.folder, read_assignment(arguments.assignment))
        return 0
    lines = differences(*arguments.compare)
    print("\n".join(lines) or "no difference")
    return bool(lines)


if __name__ == "__main__":
    sys.exit(main())
