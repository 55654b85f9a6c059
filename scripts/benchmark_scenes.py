"""Scenes of the benchmark: files that oneray and Mitsuba both read, written into build/benchmark/.

Those of scenes/ are taken with another resolution and depth; the rest is made here from numbers alone. The
same call always writes the same scene.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from make_thousand_lights import HEAD, LAMP
from numpy.typing import NDArray
from scene_text import sensor

ROOT = Path(__file__).resolve().parent.parent
NO_ROULETTE = 1_000_000

ROOM_BALLS = """<bsdf type="conductor" id="mirror"><string name="material" value="none"/></bsdf>
    <bsdf type="dielectric" id="glass">
        <float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/>
    </bsdf>
    <shape type="sphere">
        <point name="center" value="-0.42, -0.6, -0.35"/><float name="radius" value="0.4"/>
        <ref id="mirror"/>
    </shape>
    <shape type="sphere">
        <point name="center" value="0.42, -0.6, 0.3"/><float name="radius" value="0.4"/>
        <ref id="glass"/>
    </shape>

    """

BLOCK = """    <shape type="cube">
        <transform name="to_world">
            <scale x="0.3" y="0.3" z="0.3"/>
            <rotate z="1" angle="25"/>
            <translate x="-0.95" y="-0.7" z="0.29"/>
        </transform>
        <ref id="floor"/>
    </shape>
"""

BALL = (
    """<scene version="3.0.0">
    <integrator type="path">
        <integer name="max_depth" value="6"/>
        <integer name="rr_depth" value="5"/>
    </integrator>
"""
    + sensor("40", "0, -4.2, 2.2", "0, 0, 0.85", 128)
    + """\
    <bsdf type="diffuse" id="floor"><rgb name="reflectance" value="0.7, 0.69, 0.66"/></bsdf>
    <bsdf type="diffuse" id="ball"><rgb name="reflectance" value="0.8, 0.5, 0.3"/></bsdf>
    <bsdf type="diffuse" id="black"><rgb name="reflectance" value="0"/></bsdf>
    <shape type="rectangle">
        <transform name="to_world"><scale x="6" y="6" z="1"/></transform>
        <ref id="floor"/>
    </shape>
    <shape type="ply">
        <string name="filename" value="MESH"/>
        <boolean name="face_normals" value="true"/>
        <transform name="to_world"><translate x="0" y="0" z="1.15"/></transform>
        <ref id="ball"/>
    </shape>
    <shape type="rectangle">
        <transform name="to_world">
            <scale x="0.7" y="0.7" z="1"/>
            <rotate y="1" angle="150"/>
            <translate x="-1.6" y="-1.2" z="3.6"/>
        </transform>
        <ref id="black"/>
        <emitter type="area"><rgb name="radiance" value="14, 13, 11"/></emitter>
    </shape>
</scene>
"""
)


@dataclass(frozen=True)
class BenchScene:
    """A scene of the table."""

    name: str
    about: str
    write: Callable[[Path], Path]
    """Writes the file into a folder and returns its path."""
    options: tuple[str, ...] = ()
    """What oneray needs for the same as Mitsuba does by the file alone."""
    roulette: bool = True
    """Paths may end by roulette, whose rule differs: then rays per path differ as well."""
    choices: tuple[str, ...] = ()
    """Of light, that oneray is measured with as well."""


def film(text: str, size: int) -> str:
    """Another resolution, square."""
    return re.sub(r'(name="(?:width|height)" value=)"\d+"', rf'\1"{size}"', text)


def deep(text: str, depth: int, rr_depth: int | None = None) -> str:
    """Another depth, and another depth from which paths may end by roulette."""
    text = re.sub(r'(<default name="depth" value=)"-?\d+"', rf'\1"{depth}"', text)
    return text if rr_depth is None else re.sub(r'(name="rr_depth" value=)"\d+"', rf'\1"{rr_depth}"', text)


def _saved(folder: Path, name: str, text: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.xml"
    path.write_text(text, encoding="utf-8")
    return path


def canonical(name: str) -> str:
    """The text of a scene of scenes/."""
    return (ROOT / "scenes" / f"{name}.xml").read_text(encoding="utf-8")


def cornell(folder: Path, depth: int, roulette: bool = True, size: int = 128) -> Path:
    """The Cornell box."""
    name = f"cornell-box-{size}-depth-{depth}" + ("" if roulette else "-no-roulette")
    text = deep(film(canonical("cornell-box"), size), depth, None if roulette else NO_ROULETTE)
    return _saved(folder, name, text)


def glass_box(folder: Path) -> Path:
    """The Cornell box with a mirror ball and a glass ball in place of its blocks."""
    text = deep(film(canonical("cornell-box"), 128), 12)
    before, rest = text.split("<!-- short block -->")
    after = rest[rest.index("<!-- shines down -->") :]
    return _saved(folder, "glass-box", before + ROOM_BALLS + after)


def sphere_light(folder: Path) -> Path:
    """scenes/spherical-light.xml with a block in the light."""
    text = film(canonical("spherical-light"), 128)
    return _saved(folder, "sphere-light", text.replace("</scene>", BLOCK + "</scene>"))


def as_it_is(folder: Path, name: str) -> Path:
    """A scene of scenes/, with its pictures where they are."""
    text = film(canonical(name), 128)
    return _saved(folder, name, text.replace('value="pictures/', f'value="{ROOT}/scenes/pictures/'))


def hall(folder: Path, lights: int, size: int = 64) -> Path:
    """The hall of scenes/thousand-lights.xml with `lights` lamps, of the same area in all."""
    columns = max(1, round(math.sqrt(1.6 * lights)))
    rows = math.ceil(lights / columns)
    half = 0.035 * math.sqrt(1000 / lights)
    lamps = []
    for i in range(lights):
        x, y = ((i % columns + 0.5) / columns - 0.5) * 10, (i // columns + 0.5) / rows * 6.25
        red, green, blue = (7 * (0.62 + 0.38 * math.cos(2.4 * x + k)) for k in (0.0, 2.1, 4.2))
        lamps.append(LAMP.format(half=round(half, 5), x=x, y=y, z=0.5, r=red, g=green, b=blue))
    return _saved(folder, f"hall-{lights}", film(HEAD, size) + "".join(lamps) + "</scene>\n")


def displaced_ball(rings: int) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """A closed ball with bumps of three sizes: vertices (V, 3), 4·rings·(rings − 1) outward triangles."""
    side = 2 * rings
    step = np.pi / rings
    theta, phi = np.meshgrid(step * np.arange(1, rings), step * np.arange(side), indexing="ij")
    around = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    points = np.concatenate([around.reshape(-1, 3), [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]])
    bumps = (0.3 / f * np.prod(np.sin(points * [f, f + 1, f - 1] + f), axis=1) for f in (4, 11, 29))
    points *= 1 + sum(bumps)[:, None]
    row, j = np.arange(rings - 2)[:, None] * side, np.arange(side)[None]
    k, last, pole = (j + 1) % side, (rings - 2) * side, len(points) - 2 + 0 * j
    a, b, c, d = row + j, row + k, row + side + j, row + side + k
    corners = [(a, c, d), (a, d, b), (pole, j, k), (pole + 1, last + k, last + j)]
    faces = np.concatenate([np.stack(corner, axis=-1).reshape(-1, 3) for corner in corners])
    return points.astype(np.float32), faces.astype(np.int32)


def write_ply(path: Path, points: NDArray[np.float32], faces: NDArray[np.int32]) -> None:
    """Binary PLY."""
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    head += "".join(f"property float {c}\n" for c in "xyz")
    head += f"element face {len(faces)}\nproperty list uchar int vertex_index\nend_header\n"
    rows = np.empty(len(faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, faces
    path.write_bytes(head.encode() + points.astype("<f4").tobytes() + rows.tobytes())


def rings_for(triangles: int) -> int:
    """The rings of the displaced ball that come nearest to so many triangles, at least 2."""
    return max(2, round((1 + math.sqrt(1 + triangles)) / 2))


@cache
def ball(folder: Path, triangles: int, size: int = 128) -> Path:
    """A displaced ball on a floor under a lamp."""
    folder.mkdir(parents=True, exist_ok=True)
    mesh = f"ball-{triangles}.ply"
    write_ply(folder / mesh, *displaced_ball(rings_for(triangles)))
    return _saved(folder, f"ball-{triangles}", film(BALL.replace("MESH", mesh), size))


Quads = NDArray[np.float64]
"""Corners (F, 4, 3), counter-clockwise as seen from the front."""


def quad(center: Sequence[float], x: Sequence[float], y: Sequence[float]) -> Quads:
    """A parallelogram about a point with half edges x and y, which faces along x × y."""
    c, a, b = (np.array(v, dtype=float) for v in (center, x, y))
    return np.array([[c - a - b, c + a - b, c + a + b, c - a + b]])


def block(center: Sequence[float], half: Sequence[float], angle: float) -> Quads:
    """A cuboid's six faces, turned about y by an angle in degrees."""
    turn = math.radians(angle)
    edges = np.array([[math.cos(turn), 0, -math.sin(turn)], [0, 1, 0], [math.sin(turn), 0, math.cos(turn)]])
    x, y, z = edges * np.array(half)[:, None]
    c = np.array(center)
    sides = [(x, y, z), (-x, z, y), (y, z, x), (-y, x, z), (z, x, y), (-z, y, x)]
    return np.concatenate([quad(c + out, a, b) for out, a, b in sides])


def write_obj(path: Path, quads: Quads, normals: bool = False) -> None:
    """Quads as scenes export them: four corners each, and with `normals` the face's own at each of these."""
    lines = [f"v {x:.6g} {y:.6g} {z:.6g}" for x, y, z in quads.reshape(-1, 3)]
    across = np.cross(quads[:, 1] - quads[:, 0], quads[:, 3] - quads[:, 0])
    across /= np.linalg.norm(across, axis=1)[:, None]
    if normals:
        lines += [f"vn {x:.6g} {y:.6g} {z:.6g}" for x, y, z in across]
    for k in range(len(quads)):
        corners = (f"{4 * k + i}//{k + 1}" if normals else f"{4 * k + i}" for i in range(1, 5))
        lines.append(f"f {' '.join(corners)}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def obj_box(folder: Path, size: int = 128) -> Path:
    """The Cornell box as many scene files have it: each wall, the lamp and each block an OBJ mesh of quads,
    the blocks with vertex normals, and where the lamp is let in a second face, turned over, on the ceiling.
    """
    folder.mkdir(parents=True, exist_ok=True)
    out, up, right = (0, 0, 1), (0, 1, 0), (1, 0, 0)
    ceiling = quad((0, 1, 0), right, out)
    let_in = quad((0, 1, 0), (0, 0, 0.42), (0.42, 0, 0))
    lamp = '\n        <emitter type="area"><rgb name="radiance" value="6.6, 5.4, 3.7"/></emitter>'
    meshes = (
        ("floor", quad((0, -1, 0), out, right), "white", ""),
        ("ceiling", np.concatenate([ceiling, let_in]), "white", ""),
        ("back", quad((0, 0, -1), right, up), "white", ""),
        ("left", quad((-1, 0, 0), up, out), "red", ""),
        ("right", quad((1, 0, 0), out, up), "green", ""),
        ("short-block", block((0.335, -0.7, 0.38), (0.3, 0.3, 0.3), -17), "white", ""),
        ("tall-block", block((-0.33, -0.39, -0.28), (0.3, 0.61, 0.3), 18.25), "white", ""),
        ("lamp", quad((0, 0.999, 0), (0.42, 0, 0), (0, 0, 0.42)), "lamp", lamp),
    )
    shapes = ""
    for name, quads, material, emitter in meshes:
        write_obj(folder / f"obj-box-{name}.obj", quads, normals="block" in name)
        shapes += (
            f'    <shape type="obj">\n        <string name="filename" value="obj-box-{name}.obj"/>\n'
            f'        <ref id="{material}"/>{emitter}\n    </shape>\n'
        )
    head = deep(film(canonical("cornell-box"), size), 6).split("    <!-- floor -->")[0]
    return _saved(folder, "obj-box", head + shapes + "</scene>\n")


SCENES = (
    BenchScene("cornell-2", "Cornell box, direct light", lambda f: cornell(f, 2), roulette=False),
    BenchScene("cornell-8", "Cornell box, depth 8, roulette", lambda f: cornell(f, 8)),
    BenchScene("cornell-8-no-roulette", "Cornell box, depth 8, no roulette", lambda f: cornell(f, 8, False),
               ("--roulette", "none"), roulette=False),
    BenchScene("obj-box", "Cornell box of OBJ meshes with a mesh lamp, depth 6, roulette", obj_box),
    BenchScene("sphere-light", "sphere light and a block in the open, direct light", sphere_light,
               roulette=False),
    BenchScene("glass-box", "Cornell box with mirror and glass balls, depth 12, roulette", glass_box),
    BenchScene("rough-metal", "rough metal under a sky and a lamp, direct light",
               lambda f: as_it_is(f, "rough-metal"), roulette=False),
    BenchScene("principled", "principled paint, metal, cloth and glass, depth 4",
               lambda f: as_it_is(f, "principled"), roulette=False),
    BenchScene("textured-room", "textured room, depth 4, roulette", lambda f: as_it_is(f, "textured-room")),
    BenchScene("environment", "environment map, depth 3", lambda f: as_it_is(f, "environment"),
               roulette=False),
    BenchScene("thousand-lights", "1,000 lights, direct light", lambda f: as_it_is(f, "thousand-lights"),
               roulette=False, choices=("learned", "uniform")),
    BenchScene("ball-100k", "displaced ball of 100,000 triangles, depth 6, roulette",
               lambda f: ball(f, 100_000)),
    BenchScene("ball-1m", "displaced ball of 1,000,000 triangles, depth 6, roulette",
               lambda f: ball(f, 1_000_000)),
)  # fmt: skip
"""Every scene of the table, the simplest first."""
