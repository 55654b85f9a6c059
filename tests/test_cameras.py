"""P6 Cameras with a lens and without perspective: by closed form, by Mitsuba, by light tracing."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from building import kernels

WIDTH, HEIGHT = 24, 4
BOX = '<rfilter type="box"/>'
CROP = "".join(
    f'<integer name="crop_{name}" value="{value}"/>'
    for name, value in {"offset_x": 7, "offset_y": 3, "width": 10, "height": 6}.items()
)
ROOM = """<shape type="rectangle"><transform name="to_world"><scale value="3"/><rotate x="1" angle="-90"/>
    <translate y="-1"/></transform><bsdf type="diffuse">
    <rgb name="reflectance" value=".7 .5 .3"/></bsdf></shape>
<shape type="cube"><transform name="to_world"><scale value=".3"/><rotate y="1" angle="30"/>
    <translate x="-.5" y="-.7" z=".6"/></transform></shape>
<shape type="sphere"><float name="radius" value=".4"/><point name="center" x=".5" y="-.6" z="-.6"/></shape>
<shape type="rectangle"><transform name="to_world"><scale value=".5"/><rotate x="1" angle="90"/>
    <translate y="1.5"/></transform><emitter type="area">
    <rgb name="radiance" value="5 4 3"/></emitter></shape>"""
LOOK = '<transform name="to_world">{}<lookat origin="1,1,-4" target="0,-.5,0" up="0,1,0"/></transform>'
LENS = '<float name="aperture_radius" value="{}"/><float name="focus_distance" value="{}"/>'


def film(inner: str, width: int = WIDTH, height: int = HEIGHT) -> str:
    size = f'<integer name="width" value="{width}"/><integer name="height" value="{height}"/>'
    return f'<film type="hdrfilm"><string name="pixel_format" value="rgb"/>{size}{inner}</film>'


def scene(sensor: str, shapes: str, depth: int = 1) -> str:
    path = f'<integrator type="path"><integer name="max_depth" value="{depth}"/></integrator>'
    return f'<scene version="3.0.0">{path}{sensor}{shapes}</scene>'


def half_plane(edge: float, depth: float, others: str = "") -> str:
    """What is left (in camera space: x > edge) at this depth, across the view, shines with radiance 1."""
    place = f'<scale x="500" y="500"/><rotate y="1" angle="180"/><translate x="{500 + edge}" z="{depth}"/>'
    return f"""<shape type="rectangle"><transform name="to_world">{place}</transform>{others}
        <emitter type="area"><rgb name="radiance" value="1"/></emitter></shape>"""


def render(oneray: Path, folder: Path, text: str, *options: str) -> np.ndarray:
    file, out = folder / "scene.xml", folder / "out.exr"
    file.write_text(text, encoding="utf-8")
    subprocess.run([oneray, file, "-o", out, "--quiet", *options], check=True, capture_output=True)
    return np.asarray(oiio.ImageBuf(str(out)).get_pixels(oiio.FLOAT), dtype=float)


def pixels(left: float, right: float) -> np.ndarray:
    """(WIDTH, 200): places in camera space, x to the left, across each pixel."""
    return left + (right - left) * (np.arange(200 * WIDTH).reshape(WIDTH, 200) + 0.5) / (200 * WIDTH)


@pytest.mark.parametrize("depth", [1.2, 2.0, 2.9, 3.0, 3.4, 7.0])
def test_an_edge_out_of_focus_is_a_part_of_the_lens(oneray: Path, tmp_path: Path, depth: float) -> None:
    """From the point ℓ of the lens, the place a of the film at distance 1 sees ℓ (1 - z/F) + a z at depth z:
    beyond the edge for the part of a disk on one side of a line, 1/2 + (t √(1 - t²) + asin t)/π. The plane of
    focus is across the view.
    """
    radius, focus, edge = 0.3, 3.0, 0.11
    lens = LENS.format(radius, focus)
    sensor = f'<sensor type="thinlens"><float name="fov" value="90"/>{lens}{film(BOX)}</sensor>'
    text = scene(sensor, half_plane(edge, depth))
    found = render(oneray, tmp_path, text, "--sampler", "sobol", "--spp", "8192")[..., 0].mean(axis=0)
    a = pixels(1.0, -1.0)
    blur = radius * abs(1 - depth / focus)
    t = np.clip((a * depth - edge) / max(blur, 1e-12), -1, 1)
    share = 0.5 + (t * np.sqrt(1 - t * t) + np.arcsin(t)) / np.pi
    assert found == pytest.approx(share.mean(axis=1), abs=2.5e-3)


@pytest.mark.parametrize("depth", [0.5, 40.0])
def test_without_perspective_depth_changes_nothing(oneray: Path, tmp_path: Path, depth: float) -> None:
    """The film is from 1 on the left to -1 on the right, of which a crop is a part, stretched by to_world."""
    to_world = '<transform name="to_world"><scale x="3" y="0.5" z="1"/><translate x="0.25"/></transform>'
    inner = CROP.replace('"7"', '"30"').replace('"10"', f'"{WIDTH}"') + BOX
    sensor = f'<sensor type="orthographic">{to_world}{film(inner, 2 * WIDTH + 12, 12)}</sensor>'
    found = render(
        oneray, tmp_path, scene(sensor, half_plane(-0.6, depth)), "--sampler", "sobol", "--spp", "4096"
    )
    whole = 2 * WIDTH + 12
    x = 0.25 + 3 * pixels(1 - 2 * 30 / whole, 1 - 2 * (30 + WIDTH) / whole)
    assert found.shape[:2] == (6, WIDTH)
    assert found[2, :, 0] == pytest.approx((x > -0.6).mean(axis=1), abs=2e-3)


@pytest.mark.parametrize(
    "sensor", ['<sensor type="orthographic">', '<sensor type="thinlens">' + LENS.format(0.1, 3)]
)
@pytest.mark.parametrize(("depth", "seen"), [(1.9, 0.0), (2.1, 1.0), (3.9, 1.0), (4.1, 0.0)])
def test_they_see_between_their_planes(
    oneray: Path, tmp_path: Path, sensor: str, depth: float, seen: float
) -> None:
    clips = '<float name="near_clip" value="2"/><float name="far_clip" value="4"/>'
    text = scene(f"{sensor}{clips}{film(BOX)}</sensor>", half_plane(-400, depth))
    assert (render(oneray, tmp_path, text, "--spp", "4")[..., 0] == seen).all()


def test_a_lens_of_no_size_is_a_pinhole(oneray: Path, tmp_path: Path) -> None:
    """Bit for bit, with a warning."""
    lens = LENS.format(0, 3)
    pictures = []
    for kind, inside in (("thinlens", lens), ("perspective", "")):
        text = scene(f'<sensor type="{kind}">{inside}{LOOK.format("")}{film(BOX)}</sensor>', ROOM, 4)
        pictures.append(render(oneray, tmp_path, text, "--spp", "4"))
        done = subprocess.run(
            [oneray, tmp_path / "scene.xml", "--check"], capture_output=True, text=True, check=True
        )
        assert ('"aperture_radius" is 0: a pinhole' in done.stderr) == (kind == "thinlens")
    assert np.array_equal(*pictures)


SENSORS = {
    "lens": '<sensor type="thinlens"><float name="fov" value="40"/>'
    + LENS.format(0.3, 3.4)
    + LOOK.format(""),
    "lens by y": '<sensor type="thinlens"><string name="fov_axis" value="y"/><float name="fov" value="30"/>'
    '<float name="near_clip" value="3"/><float name="far_clip" value="5.5"/>'
    + LENS.format(0.2, 4)
    + LOOK.format(""),
    "lens focused far": '<sensor type="thinlens"><float name="aperture_radius" value="0.05"/>'
    + LOOK.format(""),
    "parallel": '<sensor type="orthographic">' + LOOK.format('<scale x="1.5" y="1.5"/>'),
    "stretched": '<sensor type="orthographic"><float name="near_clip" value="2"/>'
    + '<float name="far_clip" value="4.5"/>'
    + LOOK.format('<scale x="1.5" y="-1.3" z="1.3"/><rotate z="1" angle="20"/>'),
    "sheared": '<sensor type="orthographic">'
    + LOOK.format('<matrix value="1.5 .2 .1 0 0 1.2 0 0 0 .1 1 0 0 0 0 1"/>'),
}
FILMS = {
    "box": BOX,
    "crop, tent": CROP + '<rfilter type="tent"/>',
    "crop, gaussian with a border": CROP
    + '<rfilter type="gaussian"/><boolean name="sample_border" value="true"/>',
}


@pytest.mark.sample(8)
@pytest.mark.parametrize("inner", FILMS)
@pytest.mark.parametrize("sensor", SENSORS)
def test_means_what_it_means_in_mitsuba(oneray: Path, tmp_path: Path, sensor: str, inner: str) -> None:
    """Within the errors of both, measured, of the picture and of its pixels; with light tracing too, whose
    splats pixels share. Chance exceeds 5 once in 2e6.
    """
    mi = pytest.importorskip("mitsuba")
    os.environ.setdefault("DRJIT_LIBLLVM_PATH", "libLLVM.so.19.1")
    mi.set_variant("llvm_ad_rgb")
    mi.set_log_level(mi.LogLevel.Error)
    text = scene(SENSORS[sensor] + film(FILMS[inner], 26, 14) + "</sensor>", ROOM, 3)
    loaded = mi.load_string(text)
    theirs = np.array([np.array(mi.render(loaded, spp=2048, seed=seed)) for seed in range(12)], dtype=float)
    for options in (("--spp", "1024"), ("--spp", "1024", "--estimator", "light")):
        ours = np.array(
            [render(oneray, tmp_path, text, *options, "--seed", str(seed))[..., :3] for seed in range(12)]
        )
        assert ours.shape == theirs.shape
        for means in (lambda images: images.mean(axis=(1, 2)), lambda images: images):
            a, b = means(ours), means(theirs)
            error = np.sqrt((a.var(axis=0, ddof=1) + b.var(axis=0, ddof=1)) / 12)
            lit = b.mean(axis=0) > 1e-3
            normal = (a.mean(axis=0) - b.mean(axis=0))[lit] / error[lit]
            assert np.abs(normal).max() < 7, options  # 22 degrees of freedom
            assert np.sqrt((normal**2).mean()) < (1.35 if normal.size > 100 else 3)


@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("sensor", ["lens", "stretched"])
@pytest.mark.parametrize("estimator", ["mis", "light"])
def test_the_bits_depend_on_no_lanes(
    oneray: Path, tmp_path: Path, sensor: str, precision: str, estimator: str
) -> None:
    text = scene(SENSORS[sensor] + film(FILMS["crop, tent"], 26, 14) + "</sensor>", ROOM, 3)
    options = ("--spp", "8", "--precision", precision, "--estimator", estimator)
    whole = render(oneray, tmp_path, text, *options)
    for lanes in (str(lanes) for name, lanes in kernels(oneray) if name == precision):
        assert np.array_equal(whole, render(oneray, tmp_path, text, "--lanes", lanes, *options))
    window = render(oneray, tmp_path, text, "--crop", "3,1,5,4", *options)
    assert np.array_equal(window[-4:, -5:], whole[1:5, 3:8])


def test_another_size_of_a_crop_is_the_same_part_of_the_film(oneray: Path, tmp_path: Path) -> None:
    """Where its edges, and the film's, stay between pixels; else it is refused in a line."""
    sensor = f'<sensor type="perspective"><float name="fov" value="60"/>{film(CROP + BOX, 26, 14)}</sensor>'
    text = scene(sensor, half_plane(0.11, 2))
    small = render(oneray, tmp_path, text, "--sampler", "sobol", "--spp", "4096")[..., 0]
    large = render(oneray, tmp_path, text, "--sampler", "sobol", "--spp", "1024", "--width", "20")[..., 0]
    assert (small.shape, large.shape) == ((6, 10), (12, 20))
    assert large.reshape(6, 2, 10, 2).mean(axis=(1, 3)) == pytest.approx(small, abs=3e-3)
    command = [oneray, tmp_path / "scene.xml", "-o", tmp_path / "no.exr", "--width", "13"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and not (tmp_path / "no.exr").exists()
    assert "do not go with this crop window of the film, whose edges would be within pixels" in done.stderr
