"""Is what `--precision auto` takes enough? Forty generated scenes with surfaces close to each other, gaps
from 1e-9 to 1, are rendered by oneray in auto and in double with the same seeds: their paths are the same
but for rounding, so that the difference has little of their noise.
"""

import json
import math
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.errors import NotFound
from raycheck.renderers.oneray import oneray_command, oneray_path

COUNT = 40
SEEDS = 8
SPP = 64
ALLOWED = 5e-4
"""Of each channel's mean, beyond SIGMAS paired standard errors."""
SIGMAS = 4.0
TIMEOUT = 600.0

COLUMNS = ("scene", "gap", "reach", "auto takes", "because of", "largest difference", "± 4 standard errors")


@dataclass(frozen=True)
class Scene:
    """A scene file's text, and the meshes that lie beside it by their names."""

    kind: str
    gap: float
    text: str
    meshes: Mapping[str, str]
    reach: float
    """Half the side of its largest surface."""


@dataclass(frozen=True)
class Pair:
    """What a scene's pictures in auto and in double say; difference and error relative to the mean, in the
    channel whose difference is furthest beyond its error.
    """

    scene: str
    gap: float
    reach: float
    precision: str
    reason: str
    difference: float
    error: float

    @property
    def holds(self) -> bool:
        return abs(self.difference) <= ALLOWED + SIGMAS * self.error


@dataclass(frozen=True)
class _World:
    """Where things are: local coordinates, z up from a surface at z = 0, turned and moved."""

    rng: np.random.Generator
    place: Array
    """(4, 4), to the world."""
    reach: float
    small: float
    """Half the side of the smaller surface."""
    gap: float
    tilt: float
    """Of the upper one against the lower, radians."""

    def point(self, *local: float) -> str:
        return ", ".join(repr(float(x)) for x in (self.place @ np.array([*local, 1.0]))[:3])

    def shape(self, kind: str, scale: float, z: float, more: str, turn: float = 0.0) -> str:
        """A unit shape, `scale` times as large, at height z and turned about the vertical; the smaller is
        tilted.
        """
        c, s = math.cos(turn), math.sin(turn)
        local = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
        local[:3] *= scale
        local[2] += (scale == self.small and kind != "sphere") * self.tilt * local[0]
        local[2, 3] = z
        numbers = " ".join(repr(float(x)) for x in (self.place @ local).ravel())
        where = f'<transform name="to_world"><matrix value="{numbers}"/></transform>'
        return f'<shape type="{kind}">{where}{more}</shape>\n'

    def sheet(self, half: float, z: float, first: int = 0) -> tuple[str, int]:
        """Lines of an OBJ file, a square divided in n × n, and how many vertices they have."""
        n = int(self.rng.integers(1, 9))
        at = np.linspace(-half, half, n + 1)
        slope = (half == self.small) * self.tilt
        lines = [f"v {self.point(x, y, z + slope * x).replace(',', '')}" for y in at for x in at]
        for row in range(n):
            for column in range(n):
                a = first + 1 + row * (n + 1) + column
                b = a + n + 1
                lines += [f"f {a} {a + 1} {b + 1}", f"f {a} {b + 1} {b}"]
        return "\n".join(lines) + "\n", (n + 1) ** 2


def _matte(red: float, green: float, blue: float) -> str:
    inside = f'<bsdf type="diffuse"><rgb name="reflectance" value="{red}, {green}, {blue}"/></bsdf>'
    return f'<bsdf type="twosided">{inside}</bsdf>'


DARK, LIGHT = _matte(0.5, 0.3, 0.2), _matte(0.3, 0.6, 0.9)
GLOW = '<emitter type="area"><rgb name="radiance" value="3, 2, 1"/></emitter>'

Made = tuple[str, dict[str, str]]


def _flat(kind: str) -> Callable[[_World], Made]:
    return lambda w: (w.shape(kind, w.reach, 0, DARK) + w.shape(kind, w.small, w.gap, LIGHT), {})


def _cubes(w: _World) -> Made:
    lower = w.shape("cube", w.reach, -w.reach, DARK)
    return lower + w.shape("cube", w.small, w.small + w.gap, LIGHT, w.rng.uniform(0, 1)), {}


def _spheres(w: _World) -> Made:
    """One just within the other, or a ball over a square."""
    if w.rng.random() < 0.5:
        return w.shape("sphere", w.small, 0, DARK) + w.shape("sphere", w.small + w.gap, 0, LIGHT), {}
    return w.shape("rectangle", w.reach, 0, DARK) + w.shape("sphere", w.small, w.small + w.gap, LIGHT), {}


def _mesh(name: str, more: str) -> str:
    faces = '<boolean name="face_normals" value="true"/>'
    return f'<shape type="obj"><string name="filename" value="{name}"/>{faces}{more}</shape>\n'


def _meshes(w: _World) -> Made:
    files = {"lower.obj": w.sheet(w.reach, 0)[0], "upper.obj": w.sheet(w.small, w.gap)[0]}
    return _mesh("lower.obj", DARK) + _mesh("upper.obj", LIGHT), files


def _one_mesh(w: _World) -> Made:
    lower, count = w.sheet(w.reach, 0)
    return _mesh("both.obj", DARK), {"both.obj": lower + w.sheet(w.small, w.gap, count)[0]}


def _lamp(w: _World) -> Made:
    """Over a wall, its back to it or its face; a ball just above it."""
    kind = str(w.rng.choice(["rectangle", "disk", "sphere", "mesh"]))
    wall = w.shape("rectangle", w.reach, 0, DARK)
    if kind == "mesh":
        return wall + _mesh("lamp.obj", GLOW), {"lamp.obj": w.sheet(w.small, w.gap)[0]}
    turned = f'<boolean name="flip_normals" value="{str(bool(w.rng.random() < 0.5)).lower()}"/>'
    if kind == "sphere":
        return wall + w.shape(kind, w.small, w.small + w.gap, GLOW), {}
    return wall + w.shape(kind, w.small, w.gap, turned + GLOW), {}


def _box_on_a_floor(w: _World) -> Made:
    """Above it, or sunk into it."""
    height = w.gap if w.rng.random() < 0.5 else -w.gap
    floor = w.shape("rectangle", w.reach, 0, DARK)
    return floor + w.shape("cube", w.small, w.small + height, LIGHT, w.rng.uniform(0, 1)), {}


KINDS: Mapping[str, Callable[[_World], Made]] = {
    "rectangles": _flat("rectangle"),
    "disks": _flat("disk"),
    "cubes": _cubes,
    "spheres": _spheres,
    "meshes": _meshes,
    "within a mesh": _one_mesh,
    "lamp near a wall": _lamp,
    "box on a floor": _box_on_a_floor,
}


def _turned(rng: np.random.Generator) -> Array:
    """A rotation, uniform."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return np.asarray(q * np.sign(np.linalg.det(q)))


def scene(index: int, draw: int = 0) -> Scene:
    """One of COUNT: its kind by turns, its gap by decades; tilted, placed, lit and seen by chance, the same
    in each draw.
    """
    rng = np.random.default_rng((draw, index))
    kind = list(KINDS)[index % len(KINDS)]
    gap = 10 ** (-9 + 9 * index / (COUNT - 1))
    reach = float(10 ** rng.uniform(0.3, 3))
    small = reach * rng.uniform(0.1, 0.4)
    place = np.eye(4)
    if rng.random() < 0.7:
        place[:3, :3] = _turned(rng)
        place[:3, 3] = rng.uniform(-reach, reach, 3)
    tilt = 10 ** rng.uniform(-6, -1) if rng.random() < 0.3 else 0.0
    world = _World(rng, place, reach, small, gap, tilt)
    body, meshes = KINDS[kind](world)
    angle, rise, far = rng.uniform(0, 2 * math.pi), rng.uniform(0.6, 1.4), small * rng.uniform(3, 5)
    flat = far * math.cos(rise)
    eye = (flat * math.cos(angle), flat * math.sin(angle), far * math.sin(rise) + gap)
    body += _light(world, far)
    return Scene(kind, gap, _file(world, body, eye), meshes, reach)


def _light(w: _World, far: float) -> str:
    if w.rng.random() < 0.5:
        return '<emitter type="constant"><rgb name="radiance" value="1, 0.9, 0.8"/></emitter>'
    x, y = w.rng.uniform(-far, far, 2)
    power = ", ".join(repr(float(c * far**2)) for c in (3, 2, 1))
    x, y, z = w.point(x, y, far).split(", ")
    return (
        f'<emitter type="point"><point name="position" x="{x}" y="{y}" z="{z}"/>'
        f'<rgb name="intensity" value="{power}"/></emitter>'
    )


def _file(w: _World, body: str, eye: tuple[float, float, float]) -> str:
    up = ", ".join(repr(float(x)) for x in w.place[:3, :3] @ np.array([0.0, 0.1, 1.0]))
    look = f'<lookat origin="{w.point(*eye)}" target="{w.point(0, 0, 0)}" up="{up}"/>'
    return f"""<scene version="3.0.0">
<integrator type="path"><integer name="max_depth" value="4"/></integrator>
<sensor type="perspective"><float name="fov" value="40"/>
    <float name="near_clip" value="{w.reach * 1e-4!r}"/><float name="far_clip" value="{w.reach * 1e4!r}"/>
    <transform name="to_world">{look}</transform>
    <film type="hdrfilm"><integer name="width" value="32"/><integer name="height" value="32"/>
    <rfilter type="box"/></film>
</sensor>
{body}
</scene>
"""


def compare(made: Scene, folder: Path, options: Sequence[str] = ()) -> Pair:
    """Render it in both precisions; `folder` is for its files."""
    for name, text in made.meshes.items():
        (folder / name).write_text(text, encoding="utf-8")
    path, stats = folder / "scene.xml", folder / "stats.json"
    path.write_text(made.text, encoding="utf-8")
    means: dict[str, list[Array]] = {"auto": [], "double": []}
    for name, found in means.items():
        words = ("--precision", name, *options, *(("--stats", str(stats)) if name == "auto" else ()))
        command = oneray_command(oneray_path(), words)
        for seed in range(SEEDS):
            image = command.render(path, SPP, seed, TIMEOUT).image
            found.append(image.pixels.mean(axis=(0, 1)))
    chosen = json.loads(stats.read_text(encoding="utf-8"))
    right = np.array(means["double"])
    differences = (np.array(means["auto"]) - right) / right.mean(axis=0)
    error = differences.std(axis=0, ddof=1) / math.sqrt(SEEDS)
    worst = int(np.argmax(np.abs(differences.mean(axis=0)) - SIGMAS * error))
    return Pair(
        made.kind, made.gap, made.reach, chosen["precision"], chosen.get("precision_chosen_for", ""),
        float(differences.mean(axis=0)[worst]), float(error[worst]),
    )  # fmt: skip


def run(indices: Sequence[int], on_scene: Callable[[Pair], None] | None = None, draw: int = 0) -> list[Pair]:
    """Compare these scenes."""
    found = []
    for index in indices:
        with tempfile.TemporaryDirectory() as folder:
            found.append(compare(scene(index, draw), Path(folder)))
        if on_scene:
            on_scene(found[-1])
    return found


def row(pair: Pair) -> tuple[str, ...]:
    """The cells of a scene's line."""
    return (
        pair.scene, f"{pair.gap:.2g}", f"{pair.reach:.3g}", pair.precision, pair.reason,
        f"{abs(pair.difference):.1e}", f"{SIGMAS * pair.error:.1e}",
    )  # fmt: skip


def summary(pairs: Sequence[Pair]) -> str:
    """How many agree, how many of them were in single precision, and by how much they differ at most."""
    single = [one for one in pairs if one.precision == "single"]
    most = max((abs(one.difference) for one in pairs), default=0.0)
    return (
        f"{sum(one.holds for one in pairs)} of {len(pairs)} scenes agree within {100 * ALLOWED:g} % and "
        f"{SIGMAS:g} paired standard errors; auto takes single precision for {len(single)}, and no channel's "
        f"means differ by more than {most:.1e}."
    )


def to_json(pairs: Sequence[Pair], header: Mapping[str, Any]) -> str:
    """What `read` reads."""
    return (
        json.dumps({**header, "pairs": [asdict(one) for one in pairs]}, indent=1, ensure_ascii=False) + "\n"
    )


def read(path: Path) -> tuple[list[Pair], dict[str, Any]]:
    """A result of scripts/precisions.py --json, and its header; NotFound if it is none."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        return [Pair(**one) for one in found.pop("pairs")], found
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise NotFound(f"{path}: no result of scripts/precisions.py --json ({error})") from None
