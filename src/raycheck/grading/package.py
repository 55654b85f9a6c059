"""A packaged autograder: the zip that Gradescope builds its image from.

https://gradescope-autograders.readthedocs.io/en/latest/specs/: its root has setup.sh, which installs, and
run_autograder, which grades. Besides them raycheck itself, oneray with its libraries, the assignment with its
secret, and the scenes with their references.
"""

import shutil
import tempfile
import zipfile
from importlib import metadata
from pathlib import Path

from raycheck import references
from raycheck.grading.assignment import Assignment
from raycheck.grading.judge import Grader
from raycheck.grading.keys import private_folder
from raycheck.grading.oneray_bundle import bundle_oneray
from raycheck.grading.pages import TEMPLATES
from raycheck.renderers import NotFound

SCRIPTS = ("setup.sh", "run_autograder")
ASSIGNMENT = "assignment.toml"


def write_package(grader: Grader, path: Path) -> None:
    """The zip, whole or not at all; `grader` is prepared: its hidden scenes are made."""
    if not path.absolute().parent.is_dir() or path.is_dir():
        raise NotFound(f"{path}: there is no such folder, or it is one")
    with tempfile.TemporaryDirectory(prefix="raycheck-package-") as place:
        folder = Path(place)
        for name in SCRIPTS:
            shutil.copy(TEMPLATES / "gradescope" / name, folder)
            (folder / name).chmod(0o755)
        _copy_raycheck(folder)
        bundle_oneray(folder / "oneray")
        _copy_assignment(grader.assignment, folder)
        partial = path.with_name(f".{path.name}.part")
        with zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED) as archive:
            for file in sorted(p for p in folder.rglob("*") if p.is_file()):
                archive.write(file, file.relative_to(folder))
        partial.replace(path)


def _copy_raycheck(folder: Path) -> None:
    """Its modules with scenes and references inside, as a wheel has them, its version, and what it needs."""
    package = folder / "packages/raycheck"
    left_out = shutil.ignore_patterns("__pycache__", "scenes", "references")
    shutil.copytree(Path(references.__file__).parent, package, ignore=left_out)
    shutil.copytree(references.scenes_dir(), package / "scenes")
    shutil.copytree(references.references_dir(), package / "references")
    whole = metadata.distribution("raycheck")
    information = folder / f"packages/raycheck-{whole.version}.dist-info"
    information.mkdir()
    (information / "METADATA").write_text(whole.read_text("METADATA") or "", encoding="utf-8")
    needed = [line for line in whole.requires or () if "extra ==" not in line]
    (folder / "requirements.txt").write_text("\n".join(needed) + "\n", encoding="utf-8")


def _copy_assignment(assignment: Assignment, folder: Path) -> None:
    """The file with its secret and hidden scenes, and the scenes beside it with their references."""
    shutil.copy(assignment.path, folder / ASSIGNMENT)
    shutil.copytree(private_folder(assignment.path), private_folder(folder / ASSIGNMENT), dirs_exist_ok=True)
    for task in assignment.tasks:
        for of in map(assignment.scene, task.scenes):
            if of.canonical:
                continue
            root = assignment.path.parent.resolve()
            for file in (of.path, *references.files_of(of.path, of.parameters), *of.folder.iterdir()):
                if not file.resolve().is_relative_to(root):
                    raise NotFound(f"{file}: scenes of a package must be beside or below the assignment")
                target = folder / file.resolve().relative_to(root)
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(file, target)
