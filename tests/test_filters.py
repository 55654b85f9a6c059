"""P6 Reconstruction filters: a pixel is ∫ w L / ∫ w over the film, by closed form and by Mitsuba's llvm
variant.

Mitsuba's scalar variants use a table of 31 steps for w, and its ratio of sums is biased at few samples: it
renders many.
"""

from __future__ import annotations

import itertools
import os
import subprocess
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from building import kernels

from raycheck.scene import export, variants
from raycheck.scene.reader import read_scene
from raycheck.truth.closed_forms.forms import evaluate

ROOT = Path(__file__).resolve().parents[1]
WIDTH, HEIGHT = 16, 3
KINDS = {
    "gaussian": ('<rfilter type="gaussian"/>', 2.0),
    "wide gaussian": ('<rfilter type="gaussian"><float name="stddev" value="1.3"/></rfilter>', 5.2),
    "tent": ('<rfilter type="tent"/>', 1.0),
    "wide tent": ('<rfilter type="tent"><float name="radius" value="2.6"/></rfilter>', 2.6),
    "narrow tent": ('<rfilter type="tent"><float name="radius" value="0.3"/></rfilter>', 0.3),
    "wide box": ('<rfilter type="box"><float name="radius" value="1.7"/></rfilter>', 1.7),
}
DEPTH = '<integer name="max_depth" value="1"/>'
BORDER = '<boolean name="sample_border" value="true"/>'


def film(inner: str, width: int = WIDTH, height: int = HEIGHT) -> str:
    size = f'<integer name="width" value="{width}"/><integer name="height" value="{height}"/>'
    return f'<film type="hdrfilm">{size}{inner}</film>'


def step(at: float, inner: str) -> str:
    """All that is left of the column `at` of the film shines with radiance 1."""
    edge, far = 1 - 2 * at / WIDTH, 99.0
    place = f'<scale x="{(far - edge) / 2}" y="99"/><rotate y="1" angle="180"/>'
    place += f'<translate x="{(far + edge) / 2}" z="1"/>'
    return f"""<scene version="3.0.0"><integrator type="path">{DEPTH}</integrator>
    <sensor type="perspective"><float name="fov" value="90"/>{film(inner)}</sensor>
    <shape type="rectangle"><transform name="to_world">{place}</transform>
        <emitter type="area"><rgb name="radiance" value="1"/></emitter></shape></scene>"""


def render(oneray: Path, folder: Path, text: str, *options: str) -> np.ndarray:
    scene, out = folder / "scene.xml", folder / "out.exr"
    scene.write_text(text, encoding="utf-8")
    subprocess.run([oneray, scene, "-o", out, "--quiet", *options], check=True, capture_output=True)
    return np.asarray(oiio.ImageBuf(str(out)).get_pixels(oiio.FLOAT), dtype=float)


def weight(kind: str, radius: float, x: np.ndarray) -> np.ndarray:
    inside = np.abs(x) <= radius
    if "box" in kind:
        return inside * 1.0
    if "tent" in kind:
        return inside * (1 - np.abs(x) / radius)
    return inside * (np.exp(-8 * (x / radius) ** 2) - np.exp(-8))


@pytest.mark.parametrize("border", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_a_step_edge_is_the_integral_of_the_filter(
    oneray: Path, tmp_path: Path, kind: str, border: bool
) -> None:
    """At places of all distances from pixels' middles and from the film's edge, where it is cut, or, with a
    border, less so: so also its second moment.
    """
    inner, radius = KINDS[kind]
    beyond = np.ceil(radius - 0.5) if border else 0.0
    for at in (0.37, 1.0, 5.5, 7.81, 15.2):
        text, options = step(at, BORDER * border + inner), ("--sampler", "sobol", "--spp", "4096")
        found = render(oneray, tmp_path, text, *options)[1, :, 0]
        for column in range(WIDTH):
            x = np.linspace(-beyond, WIDTH + beyond, 20_001)[:-1] + (WIDTH + 2 * beyond) / 40_000
            w = weight(kind, radius, x - column - 0.5)
            assert found[column] == pytest.approx(w[x < at].sum() / w.sum(), abs=1.5e-3)


def parabola(inner: str, strips: int) -> str:
    """Columns of the film of radiance 1 + (x - 8)², in strips of equal width."""
    shapes = []
    for i in range(strips):
        left, right = (1 - 2 * at / strips for at in (i, i + 1))
        low, high = (at * WIDTH / strips - WIDTH / 2 for at in (i, i + 1))
        level = 1 + (high**3 - low**3) / 3 / (high - low)
        place = f'<scale x="{(left - right) / 2!r}" y="99"/><rotate y="1" angle="180"/>'
        place += f'<translate x="{(left + right) / 2!r}" z="1"/>'
        shapes.append(
            f"""<shape type="rectangle"><transform name="to_world">{place}</transform>
            <emitter type="area"><rgb name="radiance" value="{level!r}"/></emitter></shape>"""
        )
    return f"""<scene version="3.0.0"><integrator type="path">{DEPTH}</integrator>
    <sensor type="perspective"><float name="fov" value="90"/>{film(inner)}</sensor>
    {"".join(shapes)}</scene>"""


@pytest.mark.parametrize("kind", [kind for kind in KINDS if KINDS[kind][1] < 5])
def test_a_parabola_shows_the_second_moment(oneray: Path, tmp_path: Path, kind: str) -> None:
    """Far from the film's edge it is raised by the filter's variance: a ramp shows nothing."""
    inner, radius = KINDS[kind]
    x = np.linspace(-radius, radius, 200_001)
    w = weight(kind, radius, x)
    variance = (w * x**2).sum() / w.sum()
    text = parabola(inner, 16 * WIDTH)
    found = render(oneray, tmp_path, text, "--sampler", "sobol", "--spp", "4096", "--precision", "double")[
        1, :, 0
    ]
    for column in range(4, WIDTH - 4):
        assert found[column] - (1 + (column + 0.5 - WIDTH / 2) ** 2) == pytest.approx(
            variance, rel=0.02, abs=1e-3
        )


SCENE = """<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="2"/></integrator>
<sensor type="perspective"><float name="fov" value="40"/>{film}</sensor>
<shape type="sphere"><point name="center" x="0.7" y="0.3" z="6"/>
    <emitter type="area"><rgb name="radiance" value="1 2 3"/></emitter></shape>
<shape type="rectangle"><transform name="to_world"><scale value="0.4"/><rotate x="1" angle="180"/>
    <translate x="-1.9" y="-1.2" z="6"/></transform>
    <emitter type="area"><rgb name="radiance" value="5 0.5 1"/></emitter></shape>
<shape type="rectangle"><transform name="to_world"><scale value="9"/><rotate y="1" angle="180"/>
    <translate z="7"/></transform></shape>
<emitter type="point"><point name="position" x="1" y="2" z="4"/></emitter></scene>"""
CROP = '<integer name="crop_offset_x" value="2"/><integer name="crop_width" value="9"/>'


@pytest.mark.parametrize(
    "inner",
    [KINDS["gaussian"][0], "", BORDER, BORDER + KINDS["wide tent"][0], CROP + KINDS["wide gaussian"][0]],
)
def test_means_what_it_means_in_mitsuba(oneray: Path, tmp_path: Path, inner: str) -> None:
    """Within the errors of both, of which Mitsuba's are taken to be half of oneray's at a fourth of its
    samples; with light tracing, whose paths reach all pixels around, too. Chance exceeds 5 once in 2e6.
    """
    mi = pytest.importorskip("mitsuba")
    os.environ.setdefault("DRJIT_LIBLLVM_PATH", "libLLVM.so.19.1")
    mi.set_variant("llvm_ad_rgb")
    mi.set_log_level(mi.LogLevel.Error)
    text = SCENE.format(film=film(inner, 13, 9))
    theirs = np.array(mi.render(mi.load_string(text), spp=1 << 14, seed=1))
    for estimator in ("mis", "light"):
        ours = render(oneray, tmp_path, text, "--spp", "4096", "--estimator", estimator, "--seed", "1")
        assert ours.shape[:2] == theirs.shape[:2]
        error = np.sqrt(1.25 * ours[..., 3:] ** 2 + (2e-4 * theirs) ** 2 + 1e-12)
        normal = (ours[..., :3] - theirs) / error
        assert np.abs(normal).max() < 5 and 0.6 < np.sqrt((normal**2).mean()) < 1.25


def test_without_a_filter_it_is_mitsubas_gaussian(oneray: Path, tmp_path: Path) -> None:
    plain = render(oneray, tmp_path, SCENE.format(film=film(KINDS["gaussian"][0], 13, 9)), "--spp", "4")
    assert np.array_equal(plain, render(oneray, tmp_path, SCENE.format(film=film("", 13, 9)), "--spp", "4"))
    small = ("--spp", "4", "--width", "16")
    whole = film(KINDS["gaussian"][0], 768, 576)
    first = render(oneray, tmp_path, SCENE.format(film=whole), *small)
    assert np.array_equal(first, render(oneray, tmp_path, SCENE.format(film=""), *small))


def test_a_filter_as_wide_as_a_pixel_is_a_box_to_mitsuba(oneray: Path, tmp_path: Path) -> None:
    tent = '<rfilter type="tent"><float name="radius" value="0.5"/></rfilter>'
    plain = render(oneray, tmp_path, SCENE.format(film=film('<rfilter type="box"/>')), "--spp", "4")
    assert np.array_equal(plain, render(oneray, tmp_path, SCENE.format(film=film(tent)), "--spp", "4"))


@pytest.mark.parametrize("estimator", ["mis", "light"])
@pytest.mark.parametrize("precision", ["double", "single"])
def test_the_bits_depend_on_no_way_of_rendering(
    oneray: Path, tmp_path: Path, precision: str, estimator: str
) -> None:
    """Lanes, a window of the picture, parts that are merged."""
    text = SCENE.format(film=film(BORDER + KINDS["gaussian"][0], 13, 9))
    options = ("--precision", precision, "--estimator", estimator)
    whole = render(oneray, tmp_path, text, "--spp", "8", *options)
    for lanes in (str(lanes) for name, lanes in kernels(oneray) if name == precision):
        again = render(oneray, tmp_path, text, "--spp", "8", "--lanes", lanes, *options)
        assert np.array_equal(whole, again)
    window = render(oneray, tmp_path, text, "--spp", "8", "--crop", "10,5,3,4", *options)
    assert np.array_equal(window[-4:, -3:], whole[5:9, 10:13])
    parts = [tmp_path / f"{first}.film" for first in (0, 3)]
    for part, samples in zip(parts, ("0:3", "3:5"), strict=True):
        command = [oneray, tmp_path / "scene.xml", "--samples", samples, "--film", part, "--quiet", *options]
        subprocess.run(command, check=True, capture_output=True)
    subprocess.run([oneray, "merge", *parts, "-o", tmp_path / "merged.exr"], check=True, capture_output=True)
    merged = oiio.ImageBuf(str(tmp_path / "merged.exr")).get_pixels(oiio.FLOAT)
    assert np.array_equal(merged, whole)


def test_the_precisions_agree(oneray: Path, tmp_path: Path) -> None:
    """The same samples, but for rounding."""
    text = SCENE.format(film=film(KINDS["wide gaussian"][0], 13, 9))
    pictures = [render(oneray, tmp_path, text, "--spp", "64", "--precision", p) for p in ("double", "single")]
    assert np.abs(pictures[0] - pictures[1]).mean() < 1e-4 * pictures[0].mean()


def test_raycheck_says_which_filter_a_scene_has(tmp_path: Path) -> None:
    for (inner, radius), border in itertools.product(KINDS.values(), (False, True)):
        path = tmp_path / "scene.xml"
        path.write_text(SCENE.format(film=film(BORDER * border + inner, 13, 9)), encoding="utf-8")
        camera = export.export(variants.Variant(path))["camera"]
        kind = inner.split('"')[1]
        edge = int(np.ceil(radius - 0.5)) if border else 0
        assert camera["filter"] == {"kind": kind, "radius": radius, "border": max(edge, 0)}
    path.write_text(SCENE.format(film=film('<rfilter type="box"/>', 13, 9)), encoding="utf-8")
    assert "filter" not in export.export(variants.Variant(path))["camera"]


def test_no_closed_form_is_given_for_a_filter_that_it_does_not_know(tmp_path: Path) -> None:
    """Those are means over squares."""
    scene = tmp_path / "area-light.xml"
    text = (ROOT / "scenes/area-light.xml").read_text(encoding="utf-8")
    scene.write_text(text.replace('type="box"', 'type="tent"'), encoding="utf-8")
    assert read_scene(scene).camera.filter.kind == "tent"
    assert evaluate("area-light", scene, {}) is None
    assert evaluate("area-light", ROOT / "scenes/area-light.xml", {}) is not None
