"""An assignment with all that grading needs beside it, to be graded elsewhere: its secret and hidden scenes,
and the scenes of its own with their references.
"""

import io
import shutil
import tempfile
import zipfile
from pathlib import Path

from raycheck.base.errors import NotFound
from raycheck.grading.assignment import Assignment
from raycheck.grading.keys import private_folder
from raycheck.scene import variants

ASSIGNMENT = "assignment.toml"


def copy_assignment(assignment: Assignment, folder: Path) -> None:
    """Copy the assignment into `folder`, its file under the name ASSIGNMENT."""
    shutil.copy(assignment.path, folder / ASSIGNMENT)
    shutil.copytree(private_folder(assignment.path), private_folder(folder / ASSIGNMENT), dirs_exist_ok=True)
    for task in assignment.tasks:
        for of in map(assignment.scene, task.scenes):
            if of.canonical:
                continue
            root = assignment.path.parent.resolve()
            made = (path for path in of.folder.iterdir() if path.is_file())
            for file in (of.path, *variants.files_of(of.path, of.parameters), *made):
                if not file.resolve().is_relative_to(root):
                    raise NotFound(f"{file}: the scenes of an assignment must be beside or below it")
                target = folder / file.resolve().relative_to(root)
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(file, target)


def pack(assignment: Assignment) -> bytes:
    """The assignment as a zip."""
    whole = io.BytesIO()
    with tempfile.TemporaryDirectory(prefix="raycheck-") as place:
        copy_assignment(assignment, Path(place))
        with zipfile.ZipFile(whole, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
            write_all(archive, Path(place))
    return whole.getvalue()


def write_all(archive: zipfile.ZipFile, folder: Path) -> None:
    """Write files below a folder, by their names there."""
    for file in sorted(p for p in folder.rglob("*") if p.is_file()):
        archive.write(file, file.relative_to(folder))


def unpack(data: bytes, folder: Path) -> Path:
    """Unpack a zip of `pack` and return the assignment's file; the folder holds its secret from then on."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        archive.extractall(folder)
    return folder / ASSIGNMENT
