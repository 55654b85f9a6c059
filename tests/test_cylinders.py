"""Cylinders, as bodies and as lamps: by closed form, by quadrature, by Mitsuba."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from building import kernels

from raycheck.scene import export, variants

AREA = '<emitter type="area"><rgb name="radiance" value="{}"/></emitter>'
GREY = '<bsdf type="diffuse"><rgb name="reflectance" value="{}"/></bsdf>'
TECHNIQUES = {
    "walk": ("--estimator", "walk"),
    "nee": ("--estimator", "nee"),
    "mis": (),
    "light": ("--estimator", "light"),
    "by power": ("--light-choice", "power", "--mis", "power"),
}


def scene(shapes: str, depth: int, origin: str, target: str, size: int = 8, half: float = 0) -> str:
    """`half`: of the width of what is seen without perspective."""
    up = "0,1,0" if origin.split(",")[:2] == target.split(",")[:2] else "0,0,1"
    side = f'<integer name="width" value="{size}"/><integer name="height" value="{size}"/>'
    scale, sensor = (f'<scale value="{half}"/>', "orthographic") if half else ("", "perspective")
    return f"""<scene version="3.0.0"><integrator type="path">
    <integer name="max_depth" value="{depth}"/></integrator>
    <sensor type="{sensor}"><transform name="to_world">{scale}
    <lookat origin="{origin}" target="{target}" up="{up}"/></transform><film type="hdrfilm">
    <string name="pixel_format" value="rgb"/>{side}<rfilter type="box"/></film></sensor>
    {shapes}</scene>"""


def cylinder(p0: str, p1: str, radius: float, inside: str) -> str:
    ends = "".join(
        f'<point name="p{i}" x="{x}" y="{y}" z="{z}"/>'
        for i, (x, y, z) in enumerate(p.split(",") for p in (p0, p1))
    )
    return f'<shape type="cylinder">{ends}<float name="radius" value="{radius}"/>{inside}</shape>'


def disk(z: float, radius: float, turn: int, inside: str) -> str:
    place = f'<scale value="{radius}"/><rotate x="1" angle="{turn}"/><translate z="{z}"/>'
    return f'<shape type="disk"><transform name="to_world">{place}</transform>{inside}</shape>'


def render(oneray: Path, folder: Path, text: str, *options: str) -> np.ndarray:
    file, out = folder / "scene.xml", folder / "out.exr"
    file.write_text(text, encoding="utf-8")
    subprocess.run([oneray, file, "-o", out, "--quiet", *options], check=True, capture_output=True)
    return np.asarray(oiio.ImageBuf(str(out)).get_pixels(oiio.FLOAT), dtype=float)


FLOOR = '<shape type="rectangle"><transform name="to_world"><scale value="9"/></transform>'
FLOOR += f"{GREY.format(0.5)}</shape>"
FLIP = '<boolean name="flip_normals" value="true"/>'


@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("technique", TECHNIQUES)
def test_a_can_that_glows_is_a_furnace(oneray: Path, tmp_path: Path, technique: str, precision: str) -> None:
    """A wall and two lids that shine E inwards and reflect ρ: E (1 + ρ + ρ² + ρ³) all over, four rays."""
    inside = GREY.format(0.6) + AREA.format(0.5)
    can = cylinder("0,0,0", "0,0,2", 1, FLIP + inside) + disk(0, 1, 0, inside) + disk(2, 1, 180, inside)
    text = scene(can, 4, "0.2,-0.3,0.5", "-0.4,0.5,1.2")
    options = ("--spp", "4096", "--precision", precision, *TECHNIQUES[technique])
    found = render(oneray, tmp_path, text, *options)
    expected = 0.5 * (1 + 0.6 + 0.36 + 0.216)
    mean, error = found[..., 0].mean(), np.sqrt((found[..., 3] ** 2).sum()) / 64
    assert abs(mean - expected) < 5 * error + 1e-6 and error < 0.006 * expected


@pytest.mark.parametrize("technique", TECHNIQUES)
def test_a_tube_lamp_over_a_floor(oneray: Path, tmp_path: Path, technique: str) -> None:
    """E = L ∫ cosθ cosθ' / d² dA over what of the wall faces the point, by quadrature; it hides nothing
    of itself that shines there.
    """
    p0, p1, radius = np.array([-0.8, 0.3, 1.0]), np.array([1.1, 0.9, 1.4]), 0.3
    tube = cylinder("-0.8,0.3,1.0", "1.1,0.9,1.4", radius, AREA.format(2))
    floor = FLOOR
    text = scene(tube + floor, 2, "0.3,-2,3", "0.3,-0.2,0", 2, 0.3)
    found = render(oneray, tmp_path, text, "--spp", "65536", *TECHNIQUES[technique])[..., :4]
    axis = (p1 - p0) / np.linalg.norm(p1 - p0)
    u = np.cross(axis, [0, 0, 1.0])
    u /= np.linalg.norm(u)
    v = np.cross(axis, u)
    angle = (np.arange(400) + 0.5) / 400 * 2 * np.pi
    along = (np.arange(100) + 0.5) / 100
    n = np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * v
    q = p0 + along[:, None, None] * (p1 - p0) + radius * n
    view = np.array([0, 1.8, -3.0]) / np.hypot(1.8, 3)
    up = np.cross([1.0, 0, 0], view)
    places = ((np.arange(12) + 0.5) / 6 - 1) * 0.3
    cosine = []
    for x in places:
        for y in places:
            start = np.array([0.3, -2, 3]) + [x, 0, 0] + y * up
            way = start - start[2] / view[2] * view - q
            d2 = (way**2).sum(axis=-1)
            cosine.append(
                (np.maximum((way * n).sum(axis=-1), 0) * np.maximum(-way[..., 2], 0) / d2**2).mean()
            )
    area = 2 * np.pi * radius * np.linalg.norm(p1 - p0)
    expected = 0.5 / np.pi * 2 * np.mean(cosine) * area
    mean, error = found[..., 0].mean(), np.sqrt((found[..., 3] ** 2).sum()) / 4
    most = 0.02 if technique == "light" else 0.01
    assert abs(mean - expected) < 5 * error + 1e-4 * expected and error < most * expected


@pytest.mark.parametrize(
    ("flip", "origin", "expected"),
    [
        ("", "5,0,0.5", 1),
        ("", "0.3,0,9", 0),
        (FLIP, "5,0,0.5", 0),
        (FLIP, "0.3,0,9", 1),
        (FLIP, "0.4,0,0.5", 1),
    ],
)
def test_it_is_open_and_shines_to_one_side(
    oneray: Path, tmp_path: Path, flip: str, origin: str, expected: int
) -> None:
    """From outside the outer side, through an end the inner one."""
    shape = cylinder("0,0,0", "0,0,1", 1, flip + AREA.format(1))
    target = "0,0,0.5" if origin.startswith("5") else "1.05,0,0.3" if origin.endswith("9") else "-1,0,0.5"
    text = scene(shape, 1, origin, target, 1, 0.005)
    assert (render(oneray, tmp_path, text, "--spp", "16")[..., 0] == expected).all()


@pytest.mark.parametrize(
    ("shape", "seen"),
    [
        ('<float name="radius" value="0"/>', "has no size and is left out"),
        (
            '<point name="p0" x="1" y="2" z="3"/><point name="p1" x="1" y="2" z="3"/>',
            "has no size and is left out",
        ),
    ],
)
def test_one_of_no_size_is_left_out(oneray: Path, tmp_path: Path, shape: str, seen: str) -> None:
    shapes = f'<shape type="cylinder">{shape}</shape><emitter type="constant"/>'
    text = scene(shapes, 2, "5,0,0.5", "0,0,0.5")
    assert (render(oneray, tmp_path, text, "--spp", "4")[..., 0] == 1).all()
    done = subprocess.run(
        [oneray, tmp_path / "scene.xml", "--check"], capture_output=True, text=True, check=True
    )
    assert seen in done.stderr and done.stderr.count("\n") == 1
    assert export.export(variants.Variant(tmp_path / "scene.xml"))["primitives"] == []


BOARD = """<bsdf type="twosided"><bsdf type="diffuse"><texture type="checkerboard" name="reflectance">
    <transform name="to_uv"><scale x="5" y="3"/><translate x="0.1" y="0.2"/></transform>
    <rgb name="color0" value=".9 .1 .1"/><rgb name="color1" value=".1 .8 .9"/></texture></bsdf></bsdf>"""
BRUSHED = """<bsdf type="twosided"><bsdf type="roughconductor"><string name="distribution" value="ggx"/>
    <float name="alpha_u" value=".5"/><float name="alpha_v" value=".15"/></bsdf></bsdf>"""
PLACED = """<shape type="cylinder"><float name="radius" value=".25"/>{}
    <transform name="to_world">{}</transform>{}</shape>"""
TURNED = '<rotate x="1" angle="20"/><translate z="-1"/>'
BODIES = {
    "leaning": cylinder("-0.4,0,-1", "0.3,-0.5,0.2", 0.5, BOARD),
    "hanging": cylinder("0.3,-0.5,0.2", "-0.4,0,-1", 0.5, BOARD),
    "brushed": cylinder("-0.4,0,-1", "0.3,-0.5,0.2", 0.5, BRUSHED),
    "scaled": PLACED.format("", '<scale x="2" y="2" z="1.2"/>' + TURNED, BOARD),
    "mirrored": PLACED.format("", '<scale x="2" y="-2" z="1.2"/>' + TURNED, BOARD),
    "upside down": PLACED.format("", '<scale x="2" y="2" z="-1.2"/><rotate x="1" angle="20"/>', ""),
    "inside out": PLACED.format(FLIP, '<scale x="2" y="2" z="1.2"/>' + TURNED.replace("20", "50"), ""),
    "turned by p0 and p1": PLACED.format(
        '<point name="p0" x=".1" y=".2" z="-.5"/><point name="p1" x="-.5" y=".3" z=".1"/>',
        '<scale value="1.5"/><rotate y="1" angle="100"/>', BOARD,
    ),
}  # fmt: skip


@pytest.mark.parametrize("body", BODIES)
def test_means_what_it_means_in_mitsuba(oneray: Path, tmp_path: Path, body: str) -> None:
    """(u, v), frame, sides and ends, within the errors of both."""
    mi = pytest.importorskip("mitsuba")
    os.environ.setdefault("DRJIT_LIBLLVM_PATH", "libLLVM.so.19.1")
    mi.set_variant("llvm_ad_rgb")
    mi.set_log_level(mi.LogLevel.Error)
    lamp = f"""<shape type="rectangle"><transform name="to_world"><scale value="0.5"/>
        <rotate x="1" angle="180"/><translate y="-.5" z="1.5"/></transform>{AREA.format(5)}</shape>
        <emitter type="constant"/>"""
    text = scene(BODIES[body] + lamp, 3, "1,-4,1.4", "0,0,-0.4", 24)
    text = text.replace("<lookat", '<scale value="1"/><lookat').replace(
        '<sensor type="perspective">', '<sensor type="perspective"><float name="fov" value="30"/>'
    )
    loaded = mi.load_string(text)
    theirs = np.array([np.array(mi.render(loaded, spp=1024, seed=seed)) for seed in range(12)], dtype=float)
    ours = np.array(
        [render(oneray, tmp_path, text, "--spp", "512", "--seed", str(seed))[..., :3] for seed in range(12)]
    )
    for means in (lambda images: images.mean(axis=(1, 2)), lambda images: images):
        a, b = means(ours), means(theirs)
        error = np.sqrt((a.var(axis=0, ddof=1) + b.var(axis=0, ddof=1)) / 12)
        varies = error > 1e-6
        normal = (a.mean(axis=0) - b.mean(axis=0))[varies] / error[varies]
        assert np.abs(normal).max() < 7.5 and np.sqrt((normal**2).mean()) < (1.3 if normal.size > 100 else 3)


@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("technique", ["mis", "light", "walk"])
def test_the_bits_depend_on_no_lanes(oneray: Path, tmp_path: Path, technique: str, precision: str) -> None:
    """Alone, in a tree with others, and beside surfaces in one place."""
    tube = cylinder("-0.8,0.3,1.0", "1.1,0.9,1.4", 0.2, AREA.format(2))
    floor = FLOOR
    others = "".join(
        cylinder(f"{x},0,0", f"{x},0.3,0.5", 0.1, BOARD) for x in np.linspace(-1, 1, 40).round(3)
    )
    for shapes in (tube + floor, tube + floor + others, tube + floor + floor + BODIES["leaning"]):
        text = scene(shapes, 3, "1,-4,1.4", "0,0,0.4")
        options = ("--spp", "8", "--precision", precision, *TECHNIQUES[technique])
        whole = render(oneray, tmp_path, text, *options)
        assert whole[..., 0].any()
        for lanes in (str(lanes) for name, lanes in kernels(oneray) if name == precision):
            assert np.array_equal(whole, render(oneray, tmp_path, text, "--lanes", lanes, *options))


def test_two_in_one_place_are_told_apart(oneray: Path, tmp_path: Path) -> None:
    """What shines is in front, whichever way round the other stands: from outside there is nothing else."""
    for ends in (("0,0,0", "0,0,1"), ("0,0,1", "0,0,0")):
        other = cylinder(*ends, 1, GREY.format(0.9))
        shapes = other + cylinder("0,0,0", "0,0,1", 1, AREA.format(1))
        for origin, target, expected in (("5,1,0.5", "0,0,0.5", 1), ("0.3,0,9", "1.05,0,0.3", 0)):
            lit = render(oneray, tmp_path, scene(shapes, 4, origin, target, 4, 0.005), "--spp", "16")[..., 0]
            assert (lit == expected).all()
