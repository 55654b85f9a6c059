"""What kinds.h promises: a new kind of thing is a file and a line. Three that oneray does not have are added
to a copy of the sources, and all that asks for a material, a light or a texture in general serves them.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence

import numpy as np
import pytest
from batches import Oneray, diffuse, glow, interval, sky, square, world
from building import ROOT, build

LINES = {
    '    X(ROUGHCONDUCTOR, roughconductor, "rough conductor")':
        ' X(TRANSMITTER, transmitter, "diffuse transmitter")',
    '    X(DIRECTIONAL, directional, "directional light")': ' X(DISKSPOT, diskspot, "disk-shaped spot")',
    '    X(BITMAP, bitmap, "bitmap")': ' X(RAMP, ramp, "ramp")',
}  # fmt: skip
"""Of kinds.h, and what is put behind them."""

WAYS = (
    "--estimator walk", "--estimator nee", "", "--hemisphere uniform", "--mis-pdf survival",
    "--estimator light", "--estimator bidirectional", "--light-choice resampled",
)  # fmt: skip
LIGHT_WAYS = (
    "--estimator nee", "", "--light-choice learned", "--light-choice uniform", "--estimator light",
    "--estimator bidirectional", "--light-choice resampled",
)  # fmt: skip
REFLECTANCE, TRANSMITTANCE = np.array([0.5, 0.3, 0.0]), np.array([0.3, 0.5, 0.6])
SHEET = f"""<bsdf type="transmitter"><rgb name="reflectance" value="{", ".join(map(str, REFLECTANCE))}"/>
    <rgb name="transmittance" value="{", ".join(map(str, TRANSMITTANCE))}"/></bsdf>"""


@pytest.fixture(scope="module")
def renderer(tmp_path_factory: pytest.TempPathFactory) -> Oneray:
    """Of a oneray that has all of them."""
    folder = tmp_path_factory.mktemp("new-kinds")
    copy = folder / "oneray"
    shutil.copytree(ROOT / "src/oneray", copy / "src/oneray")
    shutil.copy(ROOT / "Makefile", copy)
    shutil.copy(ROOT / "tests/kinds/transmitter.h", copy / "src/oneray/materials")
    shutil.copy(ROOT / "tests/kinds/diskspot.h", copy / "src/oneray/emitters")
    shutil.copy(ROOT / "tests/kinds/ramp.h", copy / "src/oneray/textures")
    kinds = copy / "src/oneray/kinds.h"
    text = kinds.read_text(encoding="utf-8")
    for line, more in LINES.items():
        assert text.count(line) == 1
        text = text.replace(line, line + more)
    kinds.write_text(text, encoding="utf-8")
    program = build(folder / "build", copy, KERNELS="generic", LANES="native", CFLAGS="-O1")
    return Oneray(program, folder)


def sheet(bsdf: str) -> str:
    """Two metres wide; the camera sees its middle."""
    return f'<shape type="rectangle">{bsdf}</shape>'


def shows(
    renderer: Oneray, scene: str, options: str, wanted: Sequence[float], spp: int = 256, slack: float = 1e-5
) -> None:
    """Each channel of the picture's mean is what is wanted, by an interval that errs once in 10⁴ times."""
    pixels = renderer.batches(scene, options, spp).pixels
    for channel, value in enumerate(wanted):
        found = interval(pixels[..., channel].mean(axis=(1, 2)))
        what = (options, channel, value, found)
        assert found.low - slack * value <= value <= found.high + slack * value, what
        assert found.width <= 0.2 * value + 1e-6, what


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("z", [1, -1], ids=["front", "back"])
def test_a_sheet_under_a_sky_shows_all_that_it_lets_go_on(renderer: Oneray, way: str, z: int) -> None:
    scene = world(sheet(SHEET) + sky(), eye=f"0, 0, {z}", fov=40)
    shows(renderer, scene, way, REFLECTANCE + TRANSMITTANCE)


@pytest.mark.parametrize("way", WAYS)
def test_a_sheet_with_a_ramp_is_as_bright_as_the_ramp_is_there(renderer: Oneray, way: str) -> None:
    """A quarter of the way around its middle, where u is 1/2, halved; a checkerboard is beside it."""
    ramp = """<rgb name="color0" value="0.2, 0.6, 0.1"/><rgb name="color1" value="0.8, 0.2, 0.1"/>
        <transform name="to_uv"><scale x="0.5" y="1"/></transform>"""
    sheets = [
        f"""<shape type="rectangle"><transform name="to_world"><translate x="{x}"/></transform>
        <bsdf type="diffuse"><texture name="reflectance" type="{kind}">{says}</texture></bsdf></shape>"""
        for x, kind, says in ((0, "ramp", ramp), (2.5, "checkerboard", ""))
    ]
    scene = world("".join(sheets) + sky(), eye="0, 0, 1", fov=40)
    shows(renderer, scene, way, (0.35, 0.5, 0.1), spp=1024, slack=1e-3)


@pytest.mark.parametrize("way", WAYS)
def test_a_plain_diffuse_beside_it_stays_dark_behind(renderer: Oneray, way: str) -> None:
    """Lit from behind alone, in a scene where something else lets light through."""
    body = sheet(f'<bsdf type="twosided">{diffuse(0.8)}</bsdf>') + square(0, -0.5, 0.3, glow(10)).replace(
        '<rotate x="1" angle="180"/>', ""
    )  # fmt: skip
    elsewhere = f'<shape type="sphere"><point name="center" x="4" y="0" z="-9"/>{SHEET}</shape>'
    shows(renderer, world(body + elsewhere, fov=40), way, (0, 0, 0))


@pytest.mark.parametrize("way", WAYS)
def test_blends_evaluate_their_finite_parts_together(renderer: Oneray, way: str) -> None:
    """A quarter of it a white Lambert surface: each shows its share of the sum."""
    blend = f'<bsdf type="blendbsdf"><float name="weight" value="0.25"/>{SHEET}{diffuse(1)}</bsdf>'
    scene = world(sheet(blend) + sky(), fov=40)
    shows(renderer, scene, way, 0.75 * (REFLECTANCE + TRANSMITTANCE) + 0.25)


@pytest.mark.parametrize("way", [way for way in WAYS if way != "--estimator light"])
def test_a_lamp_behind_it_is_transmitted(renderer: Oneray, way: str) -> None:
    """E·transmittance/π from a small square lamp below: E = 4 a/√(1+a²) arctan(a/√(1+a²)) for half its side a
    in units of its distance (a parallel rectangle as seen from below its corner, four times).
    """
    lamp = square(0, -1, 0.2, glow(1)).replace('<rotate x="1" angle="180"/>', "")
    b = 0.2 / np.hypot(1, 0.2)
    irradiance = 4 * b * np.arctan(b)
    shows(renderer, world(sheet(SHEET) + lamp), way, irradiance * TRANSMITTANCE / np.pi, spp=4096)


SPOT = """<emitter type="{kind}"><transform name="to_world"><lookat origin="{x}, 0, 2" target="{x}, 0, 0"
    up="0, 1, 0"/></transform><float name="cutoff_angle" value="40"/><float name="intensity" value="{power}"/>
    {more}</emitter>"""


def irradiance_of_spots(radius: float) -> float:
    """Of the origin, by spots of intensity 1 in all points of a disk of that radius two metres above it: the
    mean over the disk, by quadrature.
    """
    r = radius * np.sqrt((np.arange(4000) + 0.5) / 4000)
    cosine = 2 / np.hypot(r, 2)
    angle, cutoff, beam = np.arccos(cosine), np.radians(40), np.radians(30)
    falloff = np.where(angle <= beam, 1, np.clip((cutoff - angle) / (cutoff - beam), 0, None))
    return float((falloff * cosine / (r * r + 4)).mean())


@pytest.mark.parametrize("way", LIGHT_WAYS)
@pytest.mark.parametrize("radius", [0, 1.5])
def test_a_spot_with_a_disk_for_its_place(renderer: Oneray, way: str, radius: float) -> None:
    """Beside a point light below, so that there is a choice of lights."""
    spot = SPOT.format(kind="diskspot", x=0, power=10, more=f'<float name="radius" value="{radius}"/>')
    below = '<emitter type="point"><point name="position" x="0" y="0" z="-5"/></emitter>'
    wanted = [10 * 0.5 / np.pi * irradiance_of_spots(radius)] * 3
    traced = way in ("--estimator light", "--estimator bidirectional")
    fov, spp, slack = (8, 16384, 2e-3) if traced else (0.1, 1024, 1e-5)
    shows(renderer, world(sheet(diffuse(0.5)) + spot + below, fov=fov), way, wanted, spp, slack)


SMALL = """<shape type="rectangle"><transform name="to_world"><scale value="0.4"/></transform>{}</shape>"""
WALL = """<shape type="rectangle"><transform name="to_world"><scale value="20"/><rotate y="1" angle="90"/>
    <translate x="-0.5"/></transform></shape>"""


def test_a_wall_that_it_reaches_through_hides_what_is_behind(renderer: Oneray) -> None:
    """Its middle and all else are on one side of the wall, a part of the disk on the other."""
    spot = SPOT.format(kind="diskspot", x=0, power=10, more='<float name="radius" value="1.5"/>')
    at = (np.arange(2000) + 0.5) / 1000 * 1.5 - 1.5
    x, y = np.meshgrid(at, at)
    r2 = x * x + y * y
    cosine = 2 / np.sqrt(r2 + 4)
    angle, cutoff, beam = np.arccos(cosine), np.radians(40), np.radians(30)
    falloff = np.where(angle <= beam, 1, np.clip((cutoff - angle) / (cutoff - beam), 0, None))
    seen = np.where(x > -0.5, falloff * cosine / (r2 + 4), 0)[r2 <= 1.5**2].mean()
    shows(
        renderer,
        world(SMALL.format(diffuse(0.5)) + WALL + spot),
        "",
        [10 * 0.5 / np.pi * seen] * 3,
        4096,
        1e-3,
    )


@pytest.mark.parametrize(("radius", "wanted"), [(0.1, "single"), (0.5, "double")])
def test_its_radius_counts_for_the_precision(renderer: Oneray, radius: float, wanted: str) -> None:
    """Half a metre from a wall."""
    spot = SPOT.format(kind="diskspot", x=0, power=10, more=f'<float name="radius" value="{radius}"/>')
    scene = renderer.scene(world(SMALL.format(diffuse(0.5)) + WALL.replace("20", "2") + spot))
    command = [str(renderer.program), str(scene), "--stats", "-", "--spp", "1"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert f'"precision": "{wanted}"' in done.stdout


def test_no_random_ray_meets_it(renderer: Oneray) -> None:
    scene = renderer.scene(world(sheet(diffuse(0.5)) + SPOT.format(kind="diskspot", x=0, power=1, more="")))
    command = [str(renderer.program), str(scene), "--stats", "-", "--estimator", "walk"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "no random ray hits a disk-shaped spot" in done.stderr
