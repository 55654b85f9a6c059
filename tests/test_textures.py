"""Textures: colours of points are Mitsuba's, on every shape; of one colour they change no bit, in whatever
place they stand.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Sequence
from pathlib import Path

import mitsuba as mi
import numpy as np
import OpenImageIO as oiio
import pytest
from sampling import SCENE, Array, Driver, uniforms
from test_surfaces import CASES, drivers, folder, rays, shape  # noqa: F401

from raycheck.base.images import decode_srgb, write_image, write_png
from raycheck.renderers.films import payload

TO_UV = {
    "as it is": "",
    "scaled": '<scale x="5" y="-3"/>',
    "moved": '<scale x="4" y="4"/><rotate z="1" angle="30"/><translate x="0.3" y="-2.2"/>',
    "sheared": '<matrix value="3 1.5 0 0.2  -0.5 2 0 -7.4  0 0 1 0  0 0 0 1"/>',
    "turned out of its plane": '<scale value="6"/><rotate x="0.6" y="0.8" angle="50"/><translate z="9"/>',
    "nine numbers": '<matrix value="3 1 0.4  0 3 0.2  0 0 1"/>',
}
COLOURS = ((0.1, 0.5, 0.9), (0.8, 0.6, 0.3))


def board(name: str, to_uv: str = "", colours: Sequence[Sequence[float]] = COLOURS) -> str:
    inside = "".join(
        f'<rgb name="color{i}" value="{" ".join(map(str, colour))}"/>' for i, colour in enumerate(colours)
    )
    place = f'<transform name="to_uv">{to_uv}</transform>' if to_uv else ""
    return f'<texture type="checkerboard" name="{name}">{inside}{place}</texture>'


def painted(body: str, bsdf: str) -> str:
    return body.replace("</shape>", f'<bsdf type="twosided">{bsdf}</bsdf></shape>')


@pytest.fixture(autouse=True, scope="module")
def _mitsuba() -> None:
    mi.set_variant("scalar_rgb")
    mi.set_log_level(mi.LogLevel.Error)


def colours(driver: Driver, body: str, way: Array) -> Array:
    """1 where a surface is met, and f_r π (4, n) there."""
    with driver.scene(body) as scene:
        out = driver("scatter", way, 0.5, 0.5, 0.5, 0.5, scene=scene)
    return np.vstack([out[20], out[12:15] * np.pi])


def by_mitsuba(body: str, way: Array) -> Array:
    scene = mi.load_string(SCENE.format(body))
    out = np.zeros((4, way.shape[1]))
    for i, (o, d) in enumerate(zip(way[:3].T, way[3:].T, strict=True)):
        si = scene.ray_intersect(mi.Ray3f(o, d), mi.RayFlags.All, True)
        if si.is_valid():
            value = si.bsdf().eval(mi.BSDFContext(), si, si.wi)
            out[:, i] = np.concatenate([[1], np.array(value) * np.pi / abs(si.wi.z)])
    return out


def agree(ours: Array, theirs: Array) -> None:
    """Mitsuba's numbers are single: a few rays near an edge of a shape or of a field differ."""
    both = (ours[0] > 0) & (theirs[0] > 0)
    assert (ours[0] == theirs[0]).mean() > 0.99 and both.mean() > 0.15
    assert (np.abs(ours - theirs)[:, both] < 1e-4).all(axis=0).mean() > 0.985


@pytest.mark.parametrize(
    ("name", "way"), [(n, w) for n, w, flip in CASES if flip and w in ("turned", "quarter")]
)
def test_colours_are_mitsubas(drivers: dict[str, Driver], folder: Path, name: str, way: str) -> None:  # noqa: F811
    bsdf = f'<bsdf type="diffuse">{board("reflectance", TO_UV["moved"])}</bsdf>'
    body = painted(shape(folder, name, way, flip=True), bsdf)
    along = rays(body, 7)
    theirs = by_mitsuba(body, along)
    met = theirs[1, theirs[0] > 0]
    assert min((met < 0.4).mean(), (met > 0.4).mean()) > 0.1  # both colours are seen
    for one in drivers.values():
        agree(colours(one, body, along), theirs)


@pytest.mark.parametrize("to_uv", TO_UV)
def test_to_uv_is_mitsubas(drivers: dict[str, Driver], folder: Path, to_uv: str) -> None:  # noqa: F811
    """On coordinates of both signs."""
    bsdf = f'<bsdf type="diffuse">{board("reflectance", TO_UV[to_uv])}</bsdf>'
    for name in ("rectangle", "u.ply"):
        body = painted(shape(folder, name, "turned"), bsdf)
        along = rays(body, 9)
        theirs = by_mitsuba(body, along)
        for one in drivers.values():
            agree(colours(one, body, along), theirs)


def test_colours_without_to_uv_are_by_halves(driver: Driver) -> None:
    """Mitsuba's defaults: .4 in the first field and the one across, .2 in the other two."""
    bsdf = '<bsdf type="diffuse"><texture name="reflectance" type="checkerboard"/></bsdf>'
    floor = f'<shape type="rectangle">{bsdf}</shape>'
    x, y = np.array([-0.5, 0.5, -0.5, 0.5]), np.array([-0.5, -0.5, 0.5, 0.5])
    along = np.stack([x, y, 0 * x + 1, 0 * x, 0 * x, 0 * x - 1])
    np.testing.assert_allclose(colours(driver, floor, along)[1], [0.4, 0.2, 0.2, 0.4], rtol=1e-12)


ONE = (0.25, 0.5, 0.8125)
GGX = '<string name="distribution" value="ggx"/><float name="alpha" value="0.3"/>'
DIELECTRIC = '<float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/>'
PLAIN = '<bsdf type="diffuse"><rgb name="reflectance" value="0.7 0.6 0.5"/></bsdf>'
METAL = '<string name="material" value="Cu"/>'
PARAMETERS = {
    "diffuse": '<bsdf type="diffuse">{reflectance}</bsdf>',
    "mirror": '<bsdf type="conductor">{specular_reflectance}</bsdf>',
    "metal": f'<bsdf type="conductor">{METAL}{{specular_reflectance}}</bsdf>',
    "rough metal": f'<bsdf type="roughconductor">{GGX}{METAL}{{specular_reflectance}}</bsdf>',
    "reflected by glass": f'<bsdf type="dielectric">{DIELECTRIC}{{specular_reflectance}}</bsdf>',
    "through glass": f'<bsdf type="dielectric">{DIELECTRIC}{{specular_transmittance}}</bsdf>',
    "a blend's mirror": '<bsdf type="blendbsdf"><float name="weight" value="0.3"/>'
    f'<bsdf type="conductor">{{specular_reflectance}}</bsdf>{PLAIN}</bsdf>',
    "a blend's rough metal": '<bsdf type="blendbsdf"><float name="weight" value="0.3"/>'
    f'<bsdf type="roughconductor">{GGX}{{specular_reflectance}}</bsdf>{PLAIN}</bsdf>',
}
"""Materials with a place for each reflectance that may be a texture."""
COLOUR = f'<rgb name="{{}}" value="{" ".join(map(str, ONE))}"/>'
WAYS = (
    "", "--estimator walk", "--estimator nee", "--mis-pdf survival", "--estimator light",
    "--estimator bidirectional",
)  # fmt: skip


def filled(material: str, colour: str) -> str:
    """A material whose reflectances are what `colour` makes of their names."""
    words = {
        name: colour.format(name)
        for name in ("reflectance", "specular_reflectance", "specular_transmittance")
    }
    return material.format(**words)


def room(bsdf: str) -> str:
    """A ball of a material in front of a plate of it, between two lamps."""
    lamp = '<shape type="sphere"><point name="center" x="{}" y="2" z="3"/><float name="radius" value="0.4"/>'
    lamp += '<emitter type="area"><rgb name="radiance" value="{}"/></emitter></shape>'
    return f"""<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="8"/>
<integer name="rr_depth" value="3"/></integrator><sensor type="perspective"><float name="fov" value="45"/>
<transform name="to_world"><lookat origin="0, 0, 5" target="0, 0, 0" up="0, 1, 0"/></transform>
<film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="16"/>
<string name="pixel_format" value="rgb"/><string name="component_format" value="float32"/>
<rfilter type="box"/></film></sensor><shape type="sphere">{bsdf}</shape>
<shape type="rectangle">{bsdf}<transform name="to_world"><scale value="3"/><translate z="-2"/></transform>
</shape>{lamp.format(-2, "5 4 3")}{lamp.format(2, "1 2 3")}</scene>"""


def picture(oneray: Path, place: Path, scene: str, options: str) -> tuple[str, str]:
    """A digest of the samples of a picture, "" if there is none; and what was said."""
    (place / "scene.xml").write_text(scene)
    film = place / "scene.film"
    command = [str(oneray), "scene.xml", "--samples", "0:8", "--film", film.name, *options.split()]
    done = subprocess.run(command, cwd=place, capture_output=True, text=True, check=False)
    result = payload(film.read_bytes()) if done.returncode == 0 else ""
    film.unlink(missing_ok=True)
    return result, done.stderr


@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("kind", PARAMETERS)
def test_one_colour_is_no_texture(oneray: Path, tmp_path: Path, kind: str, precision: str) -> None:
    """To the bit, whatever the technique; and two colours are another picture."""
    boards = [board("{}", TO_UV["moved"], pair) for pair in ((ONE, ONE), (ONE, (0.5, 0.5, 0.5)))]
    scenes = [room(filled(PARAMETERS[kind], text)) for text in (COLOUR, *boards)]
    pictures = 0
    for way in WAYS:
        options = f"{way} --precision {precision}"
        (colour, refused), one, two = (picture(oneray, tmp_path, scene, options) for scene in scenes)
        assert one == (colour, refused), options
        assert not colour or two[0] != colour, options
        pictures += bool(colour)
    assert pictures >= len(WAYS) - 1  # light paths have no mirrors in view


def test_a_texture_by_reference_is_the_texture(oneray: Path, tmp_path: Path) -> None:
    texture = board("reflectance", TO_UV["moved"])
    scene = room(f'<bsdf type="diffuse">{texture}</bsdf>')
    named = scene.replace(texture, '<ref name="reflectance" id="board"/>').replace(
        "<integrator", texture.replace('name="reflectance"', 'id="board"') + "<integrator"
    )
    assert picture(oneray, tmp_path, named, "") == picture(oneray, tmp_path, scene, "")


def test_parts_of_a_blend_keep_their_textures(driver: Driver) -> None:
    """f_r is the mean of the parts' by their shares, where one is diffuse with a texture and one without."""
    one = f'<bsdf type="diffuse">{board("reflectance")}</bsdf>'
    blend = f'<bsdf type="blendbsdf"><float name="weight" value="0.25"/>{one}{PLAIN}</bsdf>'
    along = np.vstack(
        [uniforms(200, 3, 2, low=-1), np.ones((1, 200)), np.zeros((2, 200)), -np.ones((1, 200))]
    )
    found = [
        colours(driver, f'<shape type="rectangle">{bsdf}</shape>', along) for bsdf in (blend, one, PLAIN)
    ]
    np.testing.assert_allclose(found[0], 0.75 * found[1] + 0.25 * found[2], rtol=1e-12)


def test_lanes_and_kernels_agree(wide: list[Driver], driver: Driver, folder: Path) -> None:  # noqa: F811
    bsdf = f'<bsdf type="diffuse">{board("reflectance", TO_UV["sheared"])}</bsdf>'
    for name in ("disk", "sphere", "u.ply"):
        body = painted(shape(folder, name, "turned"), bsdf)
        along = rays(body, 19)
        np.testing.assert_array_equal(colours(driver, body, along), colours(wide[0], body, along))


def test_what_is_large_has_no_fraction(driver: Driver, wide: list[Driver]) -> None:
    """However often it repeats there is one of the two colours, and nothing else."""
    for repeats in (1e3, 1e7, 1e15, 1e17, 1e30):
        scale = f'<scale x="{repeats}" y="{repeats}"/>'
        floor = f'<shape type="rectangle"><bsdf type="diffuse">{board("reflectance", scale)}</bsdf></shape>'
        along = np.vstack(
            [uniforms(200, 5, 2, low=-1), np.ones((1, 200)), np.zeros((2, 200)), -np.ones((1, 200))]
        )
        for one in (driver, *wide):
            value = colours(one, floor, along)[1]
            assert (np.minimum(abs(value - 0.1), abs(value - 0.8)) < 1e-6).all()


@pytest.mark.parametrize(
    ("side", "wanted"), [("", True), ('<bsdf type="twosided">{}</bsdf>', True), ("plain", False)]
)
def test_a_mesh_with_some_texture_coordinates_is_refused_where_they_are_wanted(
    oneray: Path, tmp_path: Path, side: str, wanted: bool
) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nf 1/1 2/2 3\n")
    bsdf = f'<bsdf type="diffuse">{"" if side == "plain" else board("reflectance")}</bsdf>'
    bsdf = side.format(bsdf) if "{}" in side else bsdf
    body = f'<shape type="obj"><string name="filename" value="a.obj"/>\n{bsdf}</shape>'
    scene = room(bsdf).replace("</scene>", body + "</scene>")
    result, said = picture(oneray, tmp_path, scene, "")
    assert bool(result) != wanted
    if wanted:
        assert "1 vertices of this mesh have no texture coordinates" in said and said.count("\n") == 1


@pytest.mark.parametrize(
    ("bsdf", "precision"),
    [
        (board("reflectance"), "single"),
        (board("reflectance", colours=(ONE, (0.9995, 0, 0))), "double"),
        (board("reflectance", colours=((1, 1, 1), (0.9995, 1, 1))), "double"),
        (board("reflectance", '<scale x="2000" y="1"/>'), "double"),
    ],
)
def test_precision_looks_at_every_colour(oneray: Path, tmp_path: Path, bsdf: str, precision: str) -> None:
    (tmp_path / "a.xml").write_text(room(f'<bsdf type="diffuse">{bsdf}</bsdf>'))
    command = [str(oneray), "a.xml", "--spp", "1", "-o", "a.exr", "--stats", "-"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout)["precision"] == precision


@pytest.mark.parametrize(
    ("other", "warned"), [((1, 1, 1), True), ((1, 0.5, 0.5), True), ((0.9, 0.9, 0.9), False)]
)
def test_a_texture_absorbs_nothing_if_no_colour_does(
    oneray: Path, tmp_path: Path, other: Sequence[float], warned: bool
) -> None:
    white = board("reflectance", colours=((1, 1, 1), other))
    scene = room(f'<bsdf type="diffuse">{white}</bsdf>').replace(
        '"max_depth" value="8"', '"max_depth" value="-1"'
    )
    assert ("absorbs nothing" in picture(oneray, tmp_path, scene, "")[1]) == warned


PICTURES = ("grey.png", "colour.png", "wide.png", "colour.jpg", "colour.exr", "colour.hdr")
BITMAPS = {
    "as it is": "",
    "raw": '<boolean name="raw" value="true"/>',
    "nearest": '<string name="filter_type" value="nearest"/>',
    **{
        wrap: f'<string name="wrap_mode" value="{wrap}"/><transform name="to_uv">{TO_UV["moved"]}</transform>'
        for wrap in ("repeat", "mirror", "clamp")
    },
}


def save_picture(path: Path) -> None:
    """6 × 5 pixels of any colour; `wide` has 16 bits, `grey` one channel."""
    values = np.random.default_rng(4).random((5, 6, 3))
    bits = np.uint16 if path.stem == "wide" else np.uint8
    if path.suffix in (".exr", ".hdr"):
        mi.Bitmap(values.astype(np.float32)).write(str(path))
    else:
        whole = (values * np.iinfo(bits).max).astype(bits)
        mi.Bitmap(whole[:, :, :1] if path.stem == "grey" else whole).write(str(path))


def bitmap(path: Path, more: str = "") -> str:
    file = f'<string name="filename" value="{path}"/>'
    return f'<bsdf type="diffuse"><texture type="bitmap" name="reflectance">{file}{more}</texture></bsdf>'


@pytest.mark.parametrize("more", BITMAPS)
@pytest.mark.parametrize("picture", PICTURES)
def test_bitmaps_are_mitsubas(
    drivers: dict[str, Driver], folder: Path, tmp_path: Path, picture: str, more: str  # noqa: F811
) -> None:
    """Of 16 bits it keeps 11 (halves), and JPEG leaves decoders some freedom."""
    save_picture(tmp_path / picture)
    body = painted(shape(folder, "rectangle", "turned"), bitmap(tmp_path / picture, BITMAPS[more]))
    along = rays(body, 9)
    theirs = by_mitsuba(body, along)
    assert np.ptp(theirs[1, theirs[0] > 0]) > 0.3
    for one in drivers.values():
        ours = colours(one, body, along)
        both = (ours[0] > 0) & (theirs[0] > 0)
        assert both.mean() > 0.15
        close = {"wide.png": 6e-4, "colour.jpg": 3 / 255}.get(picture, 1e-4)
        assert (np.abs(ours - theirs)[:, both] < close).all(axis=0).mean() > 0.985


@pytest.mark.parametrize("name", ["sphere", "disk", "cube", "u.ply"])
def test_bitmaps_lie_on_every_shape_as_mitsubas(
    drivers: dict[str, Driver], folder: Path, tmp_path: Path, name: str  # noqa: F811
) -> None:
    save_picture(tmp_path / "colour.png")
    body = painted(shape(folder, name, "turned"), bitmap(tmp_path / "colour.png", BITMAPS["mirror"]))
    along = rays(body, 9)
    theirs = by_mitsuba(body, along)
    for one in drivers.values():
        agree(colours(one, body, along), theirs)


@pytest.mark.parametrize("kind", ["bilinear", "nearest"])
def test_a_picture_of_one_colour_is_no_texture(oneray: Path, tmp_path: Path, kind: str) -> None:
    mi.Bitmap(np.full((4, 4, 3), 0.25, np.float32)).write(str(tmp_path / "one.exr"))
    plain = room('<bsdf type="diffuse"><rgb name="reflectance" value="0.25"/></bsdf>')
    drawn = room(bitmap(tmp_path / "one.exr", f'<string name="filter_type" value="{kind}"/>'))
    for precision in ("single", "double"):
        one, other = (picture(oneray, tmp_path, s, f"--precision {precision}")[0] for s in (plain, drawn))
        assert one == other != ""


@pytest.mark.parametrize("kind", [".tga", ".bmp", ".ppm", ".exr"])
def test_other_formats_are_the_same_picture(oneray: Path, tmp_path: Path, kind: str) -> None:
    """An EXR file in tiles of what a PNG file has by sRGB's curve."""
    values = (np.random.default_rng(4).random((70, 90, 3)) * 255).astype(np.uint8)
    write_png(tmp_path / "a.png", values)
    spec = oiio.ImageSpec(90, 70, 3, "float" if kind == ".exr" else "uint8")
    if kind == ".exr":
        spec.tile_width = spec.tile_height = 32
    linear = decode_srgb(values / 255).astype(np.float32)
    write_image(tmp_path / f"b{kind}", spec, linear if kind == ".exr" else values)
    scenes = (room(bitmap(tmp_path / name)) for name in ("a.png", f"b{kind}"))
    one, other = (picture(oneray, tmp_path, scene, "")[0] for scene in scenes)
    assert one == other != ""


BROKEN = {
    "empty.png": (b"", "the file is empty"),
    "text.png": (b"hello, world", "no picture that can be read (PNG, JPEG, TGA, BMP, PNM, HDR or OpenEXR)"),
    "half.png": ("colour.png", "no picture that can be read"),
    "half.jpg": ("colour.jpg", "no picture that can be read"),
    "half.exr": ("colour.exr", "an OpenEXR file that cannot be read"),
    "huge.bmp": (b"BM" + bytes(8) + b"6\0\0\0(\0\0\0" + 2 * b"\xff\xff\xff\x7f" + b"\1\0\x18" + bytes(25),
                 "it says 2147483647 x 2147483647 pixels, and a picture has 1 to 134217728"),
    "huge.png": (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\1\x86\xa0\0\1\x86\xa0\x08\2\0\0\0" + bytes(25),
                 "it says 100000 x 100000 pixels, and a picture has 1 to 134217728"),
    "none.png": (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + bytes(8) + b"\x08\2\0\0\0" + bytes(25),
                 "it says 0 x 0 pixels, and a picture has 1 to 134217728"),
    "bright.hdr": (3.0, "a reflectance must be in [0,1], and this picture has 3"),
    "nan.exr": (float("nan"), "pixel (0, 0) is infinite or not a number"),
    "dark.exr": (-0.5, "a reflectance must be in [0,1], and this picture has -0.5"),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_what_is_no_picture_is_refused_in_one_line(oneray: Path, tmp_path: Path, name: str) -> None:
    made, says = BROKEN[name]
    path = tmp_path / name
    if isinstance(made, bytes):
        path.write_bytes(made)
    elif isinstance(made, str):
        save_picture(tmp_path / made)
        whole = (tmp_path / made).read_bytes()
        path.write_bytes(whole[: len(whole) // (4 if made.endswith("jpg") else 2)])
    else:
        mi.Bitmap(np.full((4, 4, 3), made, np.float32)).write(str(path))
    (tmp_path / "s.xml").write_text(SCENE.format(f'<shape type="sphere">{bitmap(path)}</shape>'))
    command = [oneray, tmp_path / "s.xml", "--check"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2 and says in done.stderr and done.stderr.count("\n") == 1, done.stderr
    line = 1 + (tmp_path / "s.xml").read_text().partition(name)[0].count("\n")
    assert done.stderr.startswith(f"{tmp_path / 's.xml'}:{line}: ") and name in done.stderr


def test_a_picture_that_is_not_there(oneray: Path, tmp_path: Path) -> None:
    body = f'<shape type="sphere">{bitmap(Path("none.png"))}</shape>'
    (tmp_path / "s.xml").write_text(SCENE.format(body))
    command = [oneray, tmp_path / "s.xml", "--check"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2 and "none.png: No such file or directory" in done.stderr
