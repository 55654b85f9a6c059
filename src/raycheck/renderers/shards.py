"""A render split into shards: ranges of samples, each rendered once, wherever; merged to the bits of one run.

oneray's random numbers are counted, not drawn, and its film sums samples in a fixed tree, so that it does
not matter who renders which samples. A shard is known by the hash of all that its bytes depend on: scene with
meshes and parameters, the program, its options and seed, and the range of samples.
"""

import contextlib
import hashlib
import json
import os
import shlex
import tempfile
import uuid
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from raycheck.base.errors import Lost, NotFound, RenderError
from raycheck.base.processes import run_process
from raycheck.renderers import builds
from raycheck.renderers.builds import Build
from raycheck.renderers.oneray import oneray_path
from raycheck.renderers.pools import Pool
from raycheck.scene import variants

SHARDS = 32
"""A render has so many shards, or up to twice as many: each of a power of two samples, however many jobs
there are, so that shards are found again by another number of jobs.
"""


class Conflict(RenderError):
    """Two different results for the same shard."""


@dataclass(frozen=True)
class Work:
    """What is rendered: everything that the bits depend on."""

    scene: Path
    parameters: Mapping[str, str]
    options: tuple[str, ...]
    """oneray's, such as those of a technique; none that say which samples or where to write them."""
    seed: int = 0

    def arguments(self) -> tuple[str, ...]:
        settings = (f"-D{name}={value}" for name, value in sorted(self.parameters.items()))
        return (*self.options, *settings, "--seed", str(self.seed))

    def files(self) -> dict[str, bytes]:
        """The scene file and the mesh files that it names, by their names beside it."""
        try:
            found = {self.scene.name: self.scene.read_bytes()}
            for path in variants.files_of(self.scene, self.parameters):
                name = os.path.relpath(path, self.scene.parent)
                if name.startswith(".."):
                    raise NotFound(
                        f"{path}: a split render needs its mesh files beside or below the scene file"
                    )
                found[name] = path.read_bytes()
        except OSError as error:
            raise NotFound(f"{self.scene}: {error}") from None
        return found


@dataclass(frozen=True)
class Shard:
    first: int
    count: int
    key: str

    @property
    def name(self) -> str:
        return f"{self.first:015d}-{self.count}-{self.key[:24]}.film"


def ranges(spp: int, shards: int = SHARDS) -> list[tuple[int, int]]:
    """(first, count) that make up 0 … spp − 1: powers of two, except the last; `shards` to twice as many."""
    size = 1 << max(0, (spp // shards).bit_length() - 1)
    return [(first, min(size, spp - first)) for first in range(0, spp, size)]


def split(work: Work, files: Mapping[str, bytes], spp: int, program: str) -> list[Shard]:
    """The shards of a render of these files by the oneray of that hash."""
    hashes = {name: hashlib.sha256(data).hexdigest() for name, data in files.items()}
    shards = []
    for first, count in ranges(spp):
        whole = json.dumps([work.scene.name, hashes, program, work.arguments(), first, count], sort_keys=True)
        shards.append(Shard(first, count, hashlib.sha256(whole.encode()).hexdigest()))
    return shards


def render_shard(
    files: Mapping[str, bytes], scene: str, arguments: Sequence[str], first: int, count: int, program: str
) -> bytes:
    """Render samples first … first + count − 1 with this machine's oneray, which must be of the hash
    `program`; the bytes of the film.
    """
    builds.require(Build(oneray=program))
    oneray = oneray_path()
    with tempfile.TemporaryDirectory(prefix="raycheck-") as folder:
        for name, data in files.items():
            path = Path(folder) / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
        film = Path(folder) / "raycheck.film"
        words = [
            oneray, Path(folder) / scene, *arguments, "--samples", f"{first}:{count}", "--film", film,
            "--quiet",
        ]  # fmt: skip
        try:
            run_process([str(word) for word in words], hide=folder + os.sep)
        except Lost as error:
            again = shlex.join(str(word).replace(folder + os.sep, "") for word in words)
            raise Lost(f"{error} (again: `{again}`)") from None
        return film.read_bytes()


@dataclass(frozen=True)
class Store:
    """A folder of shards, each written once."""

    folder: Path

    def path(self, shard: Shard) -> Path:
        return self.folder / shard.name

    def has(self, shard: Shard) -> bool:
        return self.path(shard).is_file()

    def put(self, shard: Shard, film: bytes) -> None:
        """Conflict if the shard is there already with other bytes; both are kept."""
        new = self.folder / f"{shard.name}.{uuid.uuid4().hex}.new"
        new.write_bytes(film)
        try:
            os.link(new, self.path(shard))  # fails where there is one, also one of this moment
        except FileExistsError:
            if self.path(shard).read_bytes() != film:
                raise Conflict(
                    f"{self.path(shard)} and {new} should be the same samples, and are not: a machine of the "
                    "cluster computes wrongly"
                ) from None
        new.unlink()

    def remove(self, shards: Sequence[Shard]) -> None:
        """Remove these, and the folder if nothing else is in it."""
        for shard in shards:
            self.path(shard).unlink()
        with contextlib.suppress(OSError):
            self.folder.rmdir()


def render(
    work: Work, spp: int, output: Path, pool: Pool, folder: Path, *, keep: bool = True, exposure: float = 0.0,
    on_shard: Callable[[int, int], None] | None = None,
) -> int:  # fmt: skip
    """Render the shards that `folder` does not hold yet, and merge all into the picture `output`.

    Without `keep` the shards are removed once the picture is there. Calls on_shard(done, all). Returns how
    many were rendered. Raises NotFound, RenderError, Conflict.
    """
    oneray = oneray_path()
    program = builds.oneray_hash()
    files = work.files()
    shards = split(work, files, spp, program)
    folder.mkdir(parents=True, exist_ok=True)
    store = Store(folder)
    missing = [shard for shard in shards if not store.has(shard)]
    pieces = [
        (files, work.scene.name, work.arguments(), shard.first, shard.count, program) for shard in missing
    ]
    for done, (index, film) in enumerate(pool.run(render_shard, pieces), 1 + len(shards) - len(missing)):
        store.put(missing[index], film)
        if on_shard:
            on_shard(done, len(shards))
    words = [oneray, "merge", *map(store.path, shards), "-o", output]
    words += ["--exposure", exposure] if exposure else []
    run_process([str(word) for word in words])
    if not keep:
        store.remove(shards)
    return len(missing)
