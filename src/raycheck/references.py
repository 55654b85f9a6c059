"""The canonical scenes and their references: where they are, whether they are fresh, what they hold.

`references/NAME.exr` has float32 channels R, G, B (mean) and variance.R, variance.G, variance.B (variance
of the mean). `references/manifest.json` says how each was made. A scene with other parameters than its
defaults has a reference of its own, `NAME@a=1,b=2`. A reference belongs to one scene file: the hash of the
file (and of the mesh files that it names) and of the parameters is kept, and a reference whose hash differs
is refused.
"""

import functools
import hashlib
import json
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from raycheck import closed_form_store, closed_forms

Array = NDArray[np.float64]

CHANNELS = ("R", "G", "B", "variance.R", "variance.G", "variance.B")


class ReferenceError_(ValueError):
    """A scene or reference that is missing, stale or unreadable: one line that says what to do."""


@dataclass(frozen=True)
class Reference:
    """What a correct renderer's image is on average.

    Attributes:
        mean: (H, W, 3), Mitsuba's mean of all batches, W·sr⁻¹·m⁻².
        variance_of_mean: (H, W, 3), its variance, measured between the batches.
        skewness: tile size in pixels → (rows, cols, 3), skewness of tile means at one sample per pixel; NaN
            where nothing varies.
        closed_form: (H, W, 3), exact pixel means, NaN in pixels without one; None if the scene has none.
        Outranks `mean`.
    """

    name: str
    parameters: Mapping[str, str]
    mean: Array
    variance_of_mean: Array
    batches: int
    spp_per_batch: int
    entry: Mapping[str, Any]
    skewness: Mapping[int, Array]
    closed_form: Array | None = field(default=None)

    @property
    def made_by(self) -> str:
        """The renderer, for people."""
        version = self.entry.get("mitsuba_version")
        return f"Mitsuba {version}" if version else str(self.entry.get("renderer", "unknown"))

    def best(self) -> tuple[Array, Array]:
        """Mean and its variance (H, W, 3 each): the exact values where they are known, else Mitsuba's."""
        if self.closed_form is None:
            return self.mean, self.variance_of_mean
        known = np.isfinite(self.closed_form)
        return np.where(known, self.closed_form, self.mean), np.where(known, 0.0, self.variance_of_mean)


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
        return self.path.parent == scenes_dir()

    @property
    def folder(self) -> Path:
        """Where its reference is: the package's for canonical scenes, else `references` beside the scene."""
        return references_dir() if self.canonical else self.path.parent / "references"

    @property
    def renew_command(self) -> str:
        """The command that makes its reference anew."""
        settings = "".join(f" -D{k}={v}" for k, v in sorted(self.parameters.items()))
        return f"raycheck reference {self.name if self.canonical else self.path}{settings}"

    def check_parameters(self) -> None:
        """ReferenceError_ if the scene has no `<default>` of that name."""
        known = [d.get("name", "") for d in ElementTree.parse(self.path).getroot().iter("default")]
        for name in self.parameters:
            if name not in known:
                raise ReferenceError_(f"{self.name} has no parameter {name} ({', '.join(known) or 'none'})")


def variant(scene: str | Path, parameters: Mapping[str, str] | None = None) -> Variant:
    """The scene of that name, label ("NAME@a=1") or file; ReferenceError_ with the names there are.

    A file that is a copy of a canonical scene stands for that scene.
    """
    if isinstance(scene, Path) or Path(scene).is_file():
        path = Path(scene).resolve()
        twin = scenes_dir() / path.name
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
    found.check_parameters()
    return found


def ladder() -> list[Variant]:
    """Every canonical scene as it stands and at its other depth: direct light only, or without limit."""
    found = []
    for name in scene_names():
        root = ElementTree.parse(scene_path(name)).getroot()
        depths = [d.get("value") for d in root.iter("default") if d.get("name") == "depth"]
        others = [{"depth": "-1" if depth == "2" else "2"} for depth in depths]
        found += [Variant(scene_path(name), parameters) for parameters in ({}, *others)]
    return found


def scenes_dir() -> Path:
    """Folder of the canonical scenes: in the installed package, else at the top of the checkout."""
    return _data_dir("scenes")


def references_dir() -> Path:
    """Folder of the references, found like `scenes_dir`."""
    return _data_dir("references")


def _data_dir(name: str) -> Path:
    package = Path(__file__).resolve().parent
    places = (package / name, package.parent.parent / name)
    return next((place for place in places if place.is_dir()), places[-1])


def scene_names() -> list[str]:
    """Names of the canonical scenes, sorted."""
    return sorted(path.stem for path in scenes_dir().glob("*.xml"))


def scene_path(name: str) -> Path:
    """Path of a canonical scene; ReferenceError_ with the names there are."""
    path = scenes_dir() / f"{name}.xml"
    if not path.is_file():
        raise ReferenceError_(f"no scene {name!r}; there are: {', '.join(scene_names())}")
    return path


def scene_hash(path: Path, parameters: Mapping[str, str] | None = None) -> str:
    """SHA-256 of a scene file, of the files that it names, and of the parameters; line ends do not matter."""
    digest = hashlib.sha256(path.read_bytes().replace(b"\r\n", b"\n"))
    for named in files_of(path, parameters):
        digest.update(named.read_bytes())
    digest.update(json.dumps(sorted((parameters or {}).items())).encode())
    return digest.hexdigest()


def files_of(path: Path, parameters: Mapping[str, str] | None = None) -> list[Path]:
    """The files that a scene file names, in its order."""
    root = ElementTree.fromstring(path.read_bytes())
    values = {default.attrib["name"]: default.attrib["value"] for default in root.iter("default")}
    values |= parameters or {}
    found = []
    for element in root.iter("string"):
        if element.attrib.get("name") == "filename":
            name = element.attrib["value"]
            for parameter in sorted(values, key=len, reverse=True):
                name = name.replace(f"${parameter}", values[parameter])
            found.append(path.parent / name)
    return found


def read_manifest(folder: Path | None = None) -> dict[str, Any]:
    """manifest.json of a folder of references (the package's by default), empty if there is none yet."""
    path = (folder or references_dir()) / "manifest.json"
    if not path.is_file():
        return {}
    found = path.stat()
    return dict(_parsed(path, (found.st_mtime_ns, found.st_size, found.st_ino)))


@functools.lru_cache(maxsize=8)
def _parsed(path: Path, version: tuple[int, ...]) -> dict[str, Any]:
    """A manifest of that time, size and number: thousands of lines that each scene asks for."""
    del version
    return json.loads(path.read_text())


def is_fresh(wanted: Variant) -> bool:
    """Is there a reference of just this scene file?"""
    try:
        require(wanted)
    except ReferenceError_:
        return False
    return True


def require(wanted: Variant) -> dict[str, Any]:
    """The manifest's entry of a reference; ReferenceError_ if it is missing or stale."""
    entry = read_manifest(wanted.folder).get(wanted.label)
    if entry is None or not (wanted.folder / f"{wanted.label}.exr").is_file():
        raise ReferenceError_(
            f"there is no reference for {wanted.label}; make it with: {wanted.renew_command}"
        )
    if entry["hash"] != scene_hash(wanted.path, wanted.parameters):
        raise ReferenceError_(
            f"the reference {wanted.label} is stale: its scene has changed since; "
            f"renew it with: {wanted.renew_command}"
        )
    return entry


def load_reference(scene: str | Path | Variant, parameters: Mapping[str, str] | None = None) -> Reference:
    """Load a reference and its closed form; ReferenceError_ if it is missing or stale."""
    wanted = scene if isinstance(scene, Variant) else variant(scene, parameters)
    entry = require(wanted)
    path = wanted.folder / f"{wanted.label}.exr"
    pixels = read_exr(path)
    if pixels.shape != (entry["height"], entry["width"], len(CHANNELS)):
        raise ReferenceError_(
            f"{path} is not the image that the manifest describes; {wanted.renew_command} renews it"
        )
    return Reference(
        name=wanted.name,
        parameters=wanted.parameters,
        mean=pixels[..., :3],
        variance_of_mean=pixels[..., 3:],
        batches=entry["batches"],
        spp_per_batch=entry["spp"],
        entry=entry,
        skewness={int(size): np.array(table, dtype=np.float64) for size, table in entry["skewness"].items()},
        closed_form=closed_form(wanted),
    )


def closed_form(scene: str | Variant, parameters: Mapping[str, str] | None = None) -> Array | None:
    """Exact pixel means (H, W, 3) of a canonical scene, NaN in pixels without; None if there are none."""
    wanted = scene if isinstance(scene, Variant) else variant(scene, parameters)
    if not wanted.canonical:
        return None
    image = _closed_form(wanted.path, tuple(sorted(wanted.parameters.items())))
    return None if image is None else image.copy()


@functools.lru_cache(maxsize=64)
def _closed_form(path: Path, parameters: tuple[tuple[str, str], ...]) -> Array | None:
    of = Variant(path, dict(parameters))
    digest = closed_form_store.digest(scene_hash(path, of.parameters))
    kept = closed_form_store.read(closed_form_file(of), digest)
    return closed_forms.evaluate(path.stem, path, of.parameters) if kept is None else kept


def closed_form_file(of: Variant) -> Path:
    """Where that of a canonical scene is kept, if it takes its time."""
    return references_dir() / "closed-forms" / f"{of.label}.npz"


def keep_closed_forms() -> Iterator[str]:
    """Evaluate those of all canonical scenes and depths anew, and keep them; the labels of those kept."""
    for of in ladder():
        content = scene_hash(of.path, of.parameters)
        if closed_form_store.keep(closed_form_file(of), content, of.path, of.parameters):
            yield of.label


def read_exr(path: Path) -> Array:
    """Channels (H, W, 6) of a reference file in the order of `CHANNELS`."""
    file = oiio.ImageInput.open(str(path))
    if file is None:
        raise ReferenceError_(f"{path}: {oiio.geterror().splitlines()[0]}")
    try:
        names = list(file.spec().channelnames)
        pixels = file.read_image(oiio.FLOAT)
    finally:
        file.close()
    missing = [name for name in CHANNELS if name not in names]
    if missing or pixels is None:
        raise ReferenceError_(
            f"{path}: no channel {', '.join(missing)}" if missing else f"{path} cannot be read"
        )
    return np.asarray(pixels, dtype=np.float64)[..., [names.index(name) for name in CHANNELS]]


def write_reference(of: Variant, mean: Array, variance_of_mean: Array, entry: Mapping[str, Any]) -> Path:
    """Write image and manifest entry, each to a temporary file that then takes its place."""
    folder, label = of.folder, of.label
    folder.mkdir(parents=True, exist_ok=True)
    pixels = np.ascontiguousarray(np.concatenate([mean, variance_of_mean], axis=-1), dtype=np.float32)
    path = folder / f"{label}.exr"
    with tempfile.TemporaryDirectory(dir=folder, prefix=".writing-") as scratch:
        image = Path(scratch) / "image.exr"
        spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], oiio.FLOAT)
        spec.channelnames = CHANNELS
        spec.attribute("compression", "zip")
        file = oiio.ImageOutput.create(str(image))
        if (
            file is None
            or not file.open(str(image), spec)
            or not file.write_image(pixels)
            or not file.close()
        ):
            raise OSError(f"{path}: {file.geterror() if file else oiio.geterror()}")
        listing = Path(scratch) / "manifest.json"
        manifest = dict(sorted({**read_manifest(folder), label: dict(entry)}.items()))
        listing.write_text(dump_manifest(manifest))
        image.replace(path)
        listing.replace(folder / "manifest.json")
    return path


def dump_manifest(manifest: Mapping[str, Any]) -> str:
    """JSON with one line for each table of skewness, so that a changed reference is a small difference."""
    tables = {
        f"@{label}/{size}@": table
        for label, entry in manifest.items()
        for size, table in entry.get("skewness", {}).items()
    }
    slim = {
        label: {**entry, "skewness": {size: f"@{label}/{size}@" for size in entry.get("skewness", {})}}
        for label, entry in manifest.items()
    }
    text = json.dumps(slim, indent=2, ensure_ascii=False)
    for mark, table in tables.items():
        text = text.replace(json.dumps(mark, ensure_ascii=False), json.dumps(table, separators=(",", ":")))
    return text + "\n"
