"""The tracer's own sampling functions, called over arrays (sampling.c), and the statistics to judge them."""

from __future__ import annotations

import ctypes
import hashlib
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from building import ROOT, build
from numpy.typing import ArrayLike, NDArray
from scipy import stats

Array = NDArray[np.float64]

SOURCES = ROOT / "src/oneray"
PROGRAM = {"main", "kernel", "instances", "kernels", "options", "render", "output", "film", "exr", "picture"}
PROGRAM |= {"stats", "darkness"}
"""What is not needed here."""
FLAGS = ["-std=c99", "-D_XOPEN_SOURCE=700", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"]
FLAGS += ["-Wall", "-Wextra", "-pedantic", "-Wconversion", "-Wshadow", "-Werror", "-O1", "-fPIC", "-shared"]
FLAGS += ["-Wno-psabi"]  # lanes wider than any register of this processor are no argument of others

# All statistical checks of a test file together raise a false alarm once in 10⁴ choices of its seeds (Šidák).
FALSE_ALARMS, CHECKS = 1e-4, 160
LEVEL = -np.expm1(np.log1p(-FALSE_ALARMS) / CHECKS)
FEWEST_EXPECTED = 10.0

ESTIMATORS = {"walk": 0, "nee": 1, "mis": 2, "light": 3, "bidirectional": 4}
HEMISPHERES = {"uniform": 0, "cosine": 1}
NORMALS = {"all": 0, "visible": 1}
CHOICES = {"uniform": 0, "power": 1, "contribution": 2, "learned": 3}
POINTS = {"area": 0, "facing": 1, "cone": 2}

NOTED_VERTICES = 8
NOTED = 4 + 5 * NOTED_VERTICES

# The numbers that each entry of sampling.c gives for a column.
ROWS = {
    **dict.fromkeys(("hemisphere_uniform", "hemisphere_cosine", "sphere", "cone", "densities"), 4),
    **dict.fromkeys(("square", "disk", "triangle"), 4),
    **{"dielectric": 3, "conductor": 1, "scatter": 21, "light_sample": 9, "light_hit": 4, "choose": 2},
    **{"sky": 4, "choice_of": 1, "emit": 10, "film_ray": 7, "eye": 9, "numbers": 4, "candidate_number": 1},
    **{"phase": 4, "phase_pdf": 1, "logarithm": 1},
    **{"frame": 12, "evaluate": 7, "receiver": 8, "visibility": 4},
}

SCENE = """<scene version="3.0.0">
<integrator type="path"><integer name="max_depth" value="5"/></integrator>
<sensor type="perspective"><float name="fov" value="40"/>
    <film type="hdrfilm">
        <string name="pixel_format" value="rgb"/><string name="component_format" value="float32"/>
        <rfilter type="box"/>
    </film>
    <sampler type="independent"/>
</sensor>
{}
</scene>
"""


def compiled(precision: str, lanes: int) -> Path:
    """The library, of these very sources: kept, since every process that runs tests wants it."""
    sources = [*sorted(SOURCES.rglob("*.[ch]")), ROOT / "tests/sampling.c"]
    settings = [*FLAGS, f"-DLANES={lanes}", *(["-DSINGLE"] if precision == "single" else [])]
    digest = hashlib.sha256(repr(settings).encode())
    for path in sources:
        digest.update(f"{path.name} {path.stat().st_size}\n".encode() + path.read_bytes())
    target = ROOT / "build/drivers" / f"{digest.hexdigest()[:24]}.so"
    if target.is_file():
        return target
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=target.parent) as folder:
        build(Path(folder), goal="kinds")
        files = [path for path in sources if path.suffix == ".c" and path.stem not in PROGRAM]
        made = Path(folder) / "made.so"
        ask = ["pkg-config", "--cflags", "--libs", "expat", "zlib", "OpenEXR"]
        libraries = subprocess.check_output(ask, text=True)
        shared = [*libraries.replace("-I/", "-isystem/").split(), "-lm"]
        command = ["cc", *settings, f"-I{SOURCES}", f"-I{folder}", *files, *shared, "-o", made]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr[-3000:]
        made.replace(target)
    return target


class Driver:
    """sampling.c, compiled for one precision and number of lanes."""

    def __init__(self, folder: Path, precision: str = "double", lanes: int = 1) -> None:
        self.folder = folder
        self.library = ctypes.CDLL(str(compiled(precision, lanes)))
        self.library.scene_read.restype = ctypes.c_void_p
        self.library.scene_open.restype = ctypes.c_void_p

    def __call__(self, name: str, *columns: ArrayLike, scene: int | None = None) -> Array:
        """What entry `name` gives, (ROWS[name], n), for columns (n,), (k, n), or the same for all."""
        given = [np.asarray(column, dtype=np.float64) for column in columns]
        n = max(column.shape[-1] for column in given if column.ndim)
        wide = [
            np.broadcast_to(c, (n,)) if c.ndim < 2 else np.broadcast_to(c, (c.shape[0], n)) for c in given
        ]
        inputs = np.ascontiguousarray(np.vstack(wide))
        out = np.empty((ROWS[name], n))
        pointers = (inputs.ctypes.data_as(ctypes.c_void_p), out.ctypes.data_as(ctypes.c_void_p))
        getattr(self.library, name)(ctypes.c_void_p(scene), ctypes.c_size_t(n), *pointers)
        return out

    @contextmanager
    def scene(
        self,
        body: str | Path,
        estimator: str = "mis",
        hemisphere: str = "cosine",
        normals: str = "visible",
        choice: str = "uniform",
        points: str = "cone",
        schlick: bool = False,
        uv: bool = False,
    ) -> Iterator[int]:
        """A scene file, or one of these elements, prepared for a technique; `uv`: as if for textures."""
        file = body
        if isinstance(body, str):
            file = self.folder / "scene.xml"
            file.write_text(SCENE.format(body))
        way = (
            ESTIMATORS[estimator], HEMISPHERES[hemisphere], NORMALS[normals], CHOICES[choice], POINTS[points]
        )  # fmt: skip
        description = ctypes.c_void_p(self.library.scene_read(str(file).encode()))
        opened = self.library.scene_open(description, *way, int(schlick), int(uv))
        yield opened
        self.library.scene_close(ctypes.c_void_p(opened), description)

    def mesh_without_uv(self, file: Path) -> int:
        """How many vertices of a file's first shape, a mesh, lack texture coordinates that others have."""
        description = ctypes.c_void_p(self.library.scene_read(str(file).encode()))
        return self.library.mesh_without_uv(description)

    def pairs(self, scene: int, n: int, seed: int) -> Array:
        """What n pairs of subpaths weighed, (paths, NOTED): sampling.c says in which columns."""
        rows = np.zeros((40 * n, NOTED))
        self.library.pairs.restype = ctypes.c_size_t
        count = self.library.pairs(
            ctypes.c_void_p(scene), ctypes.c_uint32(seed), ctypes.c_size_t(n),
            rows.ctypes.data_as(ctypes.c_void_p), ctypes.c_size_t(len(rows)),
        )  # fmt: skip
        assert count < len(rows)
        return rows[:count]

    def light_count(self, scene: int) -> int:
        return self.library.emitter_count(ctypes.c_void_p(scene))

    def light_slot(self, scene: int, light: int) -> int:
        return self.library.light_slot(ctypes.c_void_p(scene), light)

    def learn_anything(self, scene: int, low: ArrayLike, high: ArrayLike, seed: int) -> None:
        box = np.concatenate([low, high]).astype(np.float64)
        self.library.learn_anything(ctypes.c_void_p(scene), box.ctypes.data_as(ctypes.c_void_p), seed)


def column(vector: ArrayLike) -> Array:
    """A vector as a column, (3, 1)."""
    return np.asarray(vector, dtype=np.float64).reshape(3, 1)


def uniforms(n: int, seed: int, rows: int = 2, low: float = 0.0, high: float = 1.0) -> Array:
    """Numbers in (low, high), (rows, n)."""
    return low + (high - low) * (np.random.default_rng(seed).integers(0, 2**32, (rows, n)) + 0.5) / 2**32


def directions(n: int, seed: int) -> Array:
    """Unit vectors, (3, n)."""
    vectors = np.random.default_rng(seed).normal(size=(3, n))
    return vectors / np.linalg.norm(vectors, axis=0)


def chi_squared(observed: Array, expected: Array) -> float:
    """p-value of counts, given those expected of each bin; 0 where something fell into an impossible one.

    The bins with the fewest expected are put together until each has at least FEWEST_EXPECTED.
    """
    observed, expected = np.ravel(observed), np.ravel(expected)
    np.testing.assert_allclose(
        expected.sum(), observed.sum(), rtol=1e-5, err_msg="the bins are not all there is"
    )
    if observed[expected < 1e-12 * expected.sum()].any():
        return 0.0
    order = np.argsort(expected)
    total = np.cumsum(expected[order])
    small = np.searchsorted(expected[order], FEWEST_EXPECTED)
    small = max(small, int(np.searchsorted(total, FEWEST_EXPECTED)) + 1) if small else 0
    seen = np.concatenate([[observed[order[:small]].sum()], observed[order[small:]]])[0 if small else 1 :]
    meant = np.concatenate([[expected[order[:small]].sum()], expected[order[small:]]])[0 if small else 1 :]
    return float(stats.chi2.sf(((seen - meant) ** 2 / meant).sum(), len(seen) - 1))


def mean_p(values: Array, truth: float) -> float:
    """p-value of "the mean of these independent values is `truth`", two-sided, by the central limit."""
    error = values.std(ddof=1) / np.sqrt(values.size)
    if error <= 1e-13 * abs(truth):
        return float(abs(values.mean() - truth) <= 1e-10 * abs(truth))
    return float(2 * stats.norm.sf(abs(values.mean() - truth) / error))


def cell(places: Array, shape: tuple[int, ...]) -> NDArray[np.intp]:
    """The bin, counted through, that each place in [0,1]^k, (k, n), lies in."""
    sizes = np.array(shape).reshape(-1, 1)
    return np.ravel_multi_index(tuple(np.clip((places * sizes).astype(int), 0, sizes - 1)), shape)


def nodes(shape: tuple[int, int], order: int) -> tuple[Array, Array, NDArray[np.intp]]:
    """Gauss–Legendre in each of shape bins of the unit square: places (2, n), weights (n,), bins (n,)."""
    x, w = np.polynomial.legendre.leggauss(order)
    lines, weights = [], []
    for bins in shape:
        lines.append(((np.arange(bins)[:, None] + (x + 1) / 2) / bins).ravel())
        weights.append(np.tile(w / 2 / bins, bins))
    a, b = np.meshgrid(*lines, indexing="ij")
    places = np.stack([a.ravel(), b.ravel()])
    return places, np.outer(*weights).ravel(), cell(places, shape)


def jacobian(image, places: Array, step: float = 1e-5) -> Array:
    """|∂image/∂u × ∂image/∂v| of a map of (2, n) to (3, n), by central differences: area per area."""
    sides = []
    for shift in (np.array([[step], [0]]), np.array([[0], [step]])):
        sides.append((image(places + shift) - image(places - shift)) / (2 * step))
    return np.linalg.norm(np.cross(*sides, axis=0), axis=0)
