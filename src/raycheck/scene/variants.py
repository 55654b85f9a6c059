"""A scene file with the values of its parameters, and the canonical scenes: their names, files and hashes."""

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from raycheck.base import data
from raycheck.base.errors import ReferenceError_
from raycheck.base.text import nearest
from raycheck.scene import document
from raycheck.scene.document import Document


@dataclass(frozen=True)
class Variant:
    """A scene file with the values of its parameters: what a reference belongs to."""

    path: Path
    parameters: Mapping[str, str] = field(default_factory=dict)
    """What replaces the file's `<default>` values."""

    @property
    def name(self) -> str:
        return self.path.stem

    @property
    def label(self) -> str:
        """ "NAME", or "NAME@a=1,b=2" with the parameters sorted."""
        settings = ",".join(f"{k}={v}" for k, v in sorted(self.parameters.items()))
        return f"{self.name}@{settings}" if settings else self.name

    @property
    def canonical(self) -> bool:
        return self.path.parent == data.scenes_dir()

    @property
    def folder(self) -> Path:
        """Where its reference is: the package's for canonical scenes, else `references` beside the scene."""
        return data.references_dir() if self.canonical else self.path.parent / "references"

    @property
    def renew_command(self) -> str:
        """The command that makes its reference anew."""
        settings = "".join(f" -D{k}={v}" for k, v in sorted(self.parameters.items()))
        return f"raycheck reference {self.name if self.canonical else self.path}{settings}"

    def document(self, *, comments: bool = False) -> Document:
        """What the file says; ReferenceError_ if it has no `<default>` of the name of a parameter."""
        return document.read(self.path, self.parameters, comments=comments)


def variant(scene: str | Path, parameters: Mapping[str, str] | None = None) -> Variant:
    """The scene of that name, label ("NAME@a=1") or file; ReferenceError_ with the names there are.

    A file that is a copy of a canonical scene stands for that scene.
    """
    if isinstance(scene, Path) or Path(scene).is_file():
        path = Path(scene).resolve()
        twin = data.scenes_dir() / path.name
        if not path.is_file():
            raise ReferenceError_(f"no scene {scene}")
        if twin.is_file() and twin.read_bytes() == path.read_bytes():
            path = twin
        settings = ""
    else:
        name, _, settings = scene.partition("@")
        path = scene_path(name)
    stated = dict(pair.partition("=")[::2] for pair in settings.split(",") if pair)
    found = Variant(path, stated | dict(parameters or {}))
    found.document()
    return found


def ladder() -> list[Variant]:
    """Every canonical scene as it stands and at other depths: direct light only, and without limit."""
    found = []
    for name in scene_names():
        depth = document.read(scene_path(name)).defaults.get("depth")
        others = [{"depth": other} for other in ("2", "-1") if depth not in (None, other)]
        found += [Variant(scene_path(name), parameters) for parameters in ({}, *others)]
    return found


LADDER = (
    "point-light", "area-light", "checkerboard", "touching-light", "crop", "many-lights",
    "occluded-lights", "hidden-light", "sun-and-spot", "spherical-light", "sphere-light-near",
    "sphere-light-far", "light-below-horizon", "mesh-light", "filter", "lens", "shaded-lamp",
    "thousand-lights", "open-sky", "mixed-material", "mirror-light", "leaving-paths", "furnace",
    "integrating-sphere", "inside-light", "cornell-box", "cylinder", "mesh-room", "smooth-mesh",
    "lecture", "mirror-corridor", "metal", "rough-metal", "brushed-metal", "plastic", "rough-plastic",
    "textured-room", "principled", "environment", "bump", "glass-pane", "lamp-behind-glass", "glass-ball",
    "caustic",
)  # fmt: skip
"""The order of the canonical scenes: each adds one thing to those before it."""


def scene_names() -> list[str]:
    """Names of the canonical scenes, in the order of the ladder."""
    place = {name: number for number, name in enumerate(LADDER)}
    names = {path.stem for path in data.scenes_dir().glob("*.xml")}
    return sorted(names, key=lambda name: (place.get(name, len(place)), name))


def summary(name: str) -> str:
    """What a canonical scene shows: the first sentence of its first comment."""
    text = scene_path(name).read_text(encoding="utf-8")
    found = re.search(r"<!--\s*(.*?)\.?(?:\.\s|-->)", text, re.DOTALL)
    return " ".join(found[1].split()) if found else ""


def scene_path(name: str) -> Path:
    """Path of a canonical scene; ReferenceError_ with the names there are."""
    path = data.scenes_dir() / f"{name}.xml"
    if not path.is_file():
        names = scene_names()
        raise ReferenceError_(f"no scene {name!r}{nearest(name, names)}; there are {', '.join(names)}")
    return path


def scene_hash(path: Path, parameters: Mapping[str, str] | None = None) -> str:
    """SHA-256 of a scene file, of the files that it names, and of the parameters; line ends do not matter.
    ReferenceError_ where one cannot be read.
    """
    try:
        digest = hashlib.sha256(path.read_bytes().replace(b"\r\n", b"\n"))
        for named in files_of(path, parameters):
            digest.update(named.read_bytes())
    except OSError as error:
        raise ReferenceError_(f"{error.filename}: {error.strerror}") from None
    digest.update(json.dumps(sorted((parameters or {}).items())).encode())
    return digest.hexdigest()


def files_of(path: Path, parameters: Mapping[str, str] | None = None) -> list[Path]:
    """The files that a scene file names, in its order."""
    return document.read(path, parameters).files()
