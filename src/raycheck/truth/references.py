"""The canonical scenes and their references: where they are, whether they are fresh, what they hold.

`references/NAME.exr` has float32 channels R, G, B (mean) and variance.R, variance.G, variance.B (variance
of the mean). `references/manifest.json` says how each was made. A scene with other parameters than its
defaults has a reference of its own, `NAME@a=1,b=2`. A reference belongs to one scene file: the hash of the
file (and of the mesh files that it names) and of the parameters is kept, and a reference whose hash differs
is refused.
"""

import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio

from raycheck.base import data
from raycheck.base.arrays import Array
from raycheck.base.errors import ReferenceError_
from raycheck.base.files import whole
from raycheck.base.images import write_image
from raycheck.scene.variants import Variant, ladder, scene_hash, variant
from raycheck.truth.closed_forms import forms, store
from raycheck.truth.manifest import dump_manifest, read_manifest

CHANNELS = ("R", "G", "B", "variance.R", "variance.G", "variance.B")


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

    @property
    def seeds(self) -> range:
        """The seeds of its batches."""
        first, count = self.entry["seeds"]
        return range(int(first), int(first) + int(count))

    def best(self) -> tuple[Array, Array]:
        """Mean and its variance (H, W, 3 each): the exact values where they are known, else Mitsuba's."""
        if self.closed_form is None:
            return self.mean, self.variance_of_mean
        known = np.isfinite(self.closed_form)
        return np.where(known, self.closed_form, self.mean), np.where(known, 0.0, self.variance_of_mean)


def is_fresh(wanted: Variant) -> bool:
    """Whether there is a reference of just this scene file."""
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
    result: dict[str, Any] = entry
    return result


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
        name=wanted.name, parameters=wanted.parameters, mean=pixels[..., :3],
        variance_of_mean=pixels[..., 3:], batches=entry["batches"], spp_per_batch=entry["spp"], entry=entry,
        skewness={int(size): np.array(table, dtype=np.float64) for size, table in entry["skewness"].items()},
        closed_form=closed_form(wanted),
    )  # fmt: skip


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
    digest = store.digest(scene_hash(path, of.parameters))
    kept = store.read(closed_form_file(of), digest)
    return forms.evaluate(path.stem, path, of.parameters) if kept is None else kept


def closed_form_file(of: Variant) -> Path:
    """Where the closed form of a canonical scene is kept, if it takes its time."""
    return data.references_dir() / "closed-forms" / f"{of.label}.npz"


def keep_closed_forms() -> Iterator[str]:
    """Evaluate those of all canonical scenes and depths anew, and keep them; the labels of those kept."""
    for of in ladder():
        content = scene_hash(of.path, of.parameters)
        if store.keep(closed_form_file(of), content, of.path, of.parameters):
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
    listing = folder / "manifest.json"
    with whole(listing) as manifest, whole(path) as image:  # the manifest takes its place last
        spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], oiio.FLOAT)
        spec.channelnames = CHANNELS
        spec.attribute("compression", "zip")
        write_image(image, spec, pixels)
        entries = dict(sorted({**read_manifest(folder), label: dict(entry)}.items()))
        manifest.write_text(dump_manifest(entries))
    return path
