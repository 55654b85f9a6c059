"""A packaged autograder: the zip from which Gradescope builds its image.

https://gradescope-autograders.readthedocs.io/en/latest/specs/: its root has setup.sh, which installs, and
run_autograder, which grades. Besides them raycheck itself, oneray with its libraries, the assignment with its
secret, and the scenes with their references.
"""

import shutil
import tempfile
import zipfile
from importlib import metadata
from pathlib import Path

from raycheck.base import data
from raycheck.base.data import PACKAGE
from raycheck.base.errors import NotFound
from raycheck.base.files import whole
from raycheck.grading.assignment_bundle import copy_assignment, write_all
from raycheck.grading.judge import Grader
from raycheck.grading.written.pages import TEMPLATES
from raycheck.renderers.bundle import bundle_oneray

SCRIPTS = ("setup.sh", "run_autograder")


def write_package(grader: Grader, path: Path) -> None:
    """The zip, whole or not at all; `grader` is prepared: its hidden scenes are made."""
    if not path.absolute().parent.is_dir() or path.is_dir():
        raise NotFound(f"{path}: there is no such folder, or it is one")
    with tempfile.TemporaryDirectory(prefix="raycheck-package-") as place:
        folder = Path(place)
        copy_scripts(folder)
        _copy_raycheck(folder)
        bundle_oneray(folder / "oneray")
        copy_assignment(grader.assignment, folder)
        with whole(path) as partial, zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED) as archive:
            write_all(archive, folder)


def copy_scripts(folder: Path) -> None:
    """With the line ends of Unix, whatever git made of them."""
    for name in SCRIPTS:
        script = (TEMPLATES / "gradescope" / name).read_bytes()
        (folder / name).write_bytes(script.replace(b"\r\n", b"\n"))
        (folder / name).chmod(0o755)


def _copy_raycheck(folder: Path) -> None:
    """Put in raycheck's modules with scenes and references inside, as a wheel has them, its version, and what
    it needs.
    """
    package = folder / "packages/raycheck"
    left_out = shutil.ignore_patterns("__pycache__", "scenes", "references")
    shutil.copytree(PACKAGE, package, ignore=left_out)
    shutil.copytree(data.scenes_dir(), package / "scenes")
    shutil.copytree(data.references_dir(), package / "references")
    whole = metadata.distribution("raycheck")
    information = folder / f"packages/raycheck-{whole.version}.dist-info"
    information.mkdir()
    (information / "METADATA").write_text(whole.read_text("METADATA") or "", encoding="utf-8")
    needed = [line for line in whole.requires or () if "extra ==" not in line]
    (folder / "requirements.txt").write_text("\n".join(needed) + "\n", encoding="utf-8", newline="\n")
