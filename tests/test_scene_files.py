"""Scene files as people have them: other versions, several files or sensors, and what makes no other picture.

What is said in two ways must give the same bits, by oneray, and the same scene, by raycheck's reader.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from raycheck.base.errors import ReferenceError_
from raycheck.scene import document, export, variants
from raycheck.scene.plugins import transform
from raycheck.scene.reader import read_scene

ROOT = Path(__file__).resolve().parents[1]

INTEGRATOR = '<integrator type="path"><integer name="max_depth" value="3"/></integrator>'
FILM = """<film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="6"/>
        <rfilter type="box"/></film>"""
SENSOR = f"""<sensor type="perspective" id="front">
        <float name="fov" value="50"/><float name="near_clip" value="0.1"/>
        <transform name="to_world"><lookat origin="0 0 5" target="0 0 0" up="0 1 0"/></transform>
        {FILM}
        <sampler type="independent"><integer name="sample_count" value="4"/></sampler></sensor>"""
SIDE = SENSOR.replace("front", "side").replace('origin="0 0 5"', 'origin="4 1 2"')
BSDF = '<bsdf type="diffuse" id="paint"><rgb name="reflectance" value="0.5 0.25 0.75"/></bsdf>'
BODY = """<shape type="sphere"><ref id="paint"/></shape>
    <emitter type="point"><point name="position" value="2 3 4"/><rgb name="intensity" value="9"/></emitter>
    <emitter type="constant"><rgb name="radiance" value="0.5"/></emitter>"""


def scene(*parts: str, version: str = "3.0.0") -> str:
    return f'<scene version="{version}">\n' + "\n".join(parts) + "\n</scene>\n"


PLAIN = scene(INTEGRATOR, SENSOR, BSDF, BODY)


def picture(oneray: Path, path: Path, *options: str) -> tuple[np.ndarray, list[str]]:
    """oneray's, and its warnings without the name of the file."""
    out = path.with_suffix(".exr")
    command = [oneray, path, "-o", out, "--quiet", *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    warned = done.stderr.replace(f"{path}:", "").replace("oneray: warning: ", "").splitlines()
    return oiio.ImageBuf(str(out)).get_pixels(oiio.FLOAT), warned


def write(folder: Path, text: str, name: str = "scene.xml") -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def primitives(path: Path) -> dict:
    """What raycheck exports of it, but for its name."""
    return {**export.export(variants.Variant(path)), "scene": ""}


def same(oneray: Path, folder: Path, text: str, *options: str, plain: str = PLAIN) -> list[str]:
    """The warnings with which the text gives the picture and the primitives of the plain one."""
    path, base = write(folder, text), write(folder, plain, "plain.xml")
    found, warned = picture(oneray, path, *options)
    assert np.array_equal(found, picture(oneray, base)[0])
    if not options:
        assert primitives(path) == primitives(base)
    return warned


OLD = (
    PLAIN.replace("to_world", "toWorld")
    .replace("max_depth", "maxDepth")
    .replace("near_clip", "nearClip")
    .replace("reflectance", "diffuseReflectance")
)


@pytest.mark.parametrize("version", ["0.5.0", "0.6.0", "1.9.9"])
def test_old_names_are_todays(oneray: Path, tmp_path: Path, version: str) -> None:
    assert same(oneray, tmp_path, OLD.replace("3.0.0", version)) == []


@pytest.mark.parametrize("version", ["2.0.0", "2.1.0", "3.5.0"])
def test_later_versions_load_as_they_are(oneray: Path, tmp_path: Path, version: str) -> None:
    assert same(oneray, tmp_path, PLAIN.replace("3.0.0", version)) == []
    path = write(tmp_path, OLD.replace("3.0.0", version))
    done = subprocess.run([oneray, path, "--check"], capture_output=True, text=True, check=False)
    assert done.returncode == 2 and 'has no property "toWorld"' in done.stderr
    with pytest.raises(ReferenceError_, match='has no property "maxDepth"'):
        read_scene(path)


def test_what_mitsuba_refuses_is_read_with_a_warning(oneray: Path, tmp_path: Path) -> None:
    text = PLAIN.replace("<lookat", "<lookAt").replace("hdrfilm", "ldrfilm")
    looked, film = same(oneray, tmp_path, text)
    assert looked == "5: <lookAt> is read as <lookat>, which Mitsuba 3 wants"
    assert film.startswith('6: <film type="ldrfilm"> is read as hdrfilm')


@pytest.mark.parametrize("kind", ["conductor", "roughconductor"])
def test_an_index_outside_divides_a_metals_as_in_mitsuba_0(oneray: Path, tmp_path: Path, kind: str) -> None:
    """In both of its names for it; 1.3330 is water's."""
    metal = '<rgb name="eta" value="{} 0.5 0.25"/><rgb name="k" value="{} 1 0.75"/>'
    texts = [
        PLAIN.replace(BSDF, f'<bsdf type="{kind}" id="paint">{metal.format(*numbers)}{more}</bsdf>')
        for numbers, more in (
            ((2, 4), '<float name="ext_eta" value="2"/>'),
            ((2, 4), '<float name="extEta" value="2"/>'),
            ((1, 2), ""),
        )
    ]
    plain = texts[2].replace("0.5 0.25", "0.25 0.125").replace("1 0.75", "0.5 0.375")
    for text in (texts[0], texts[1].replace("3.0.0", "0.6.0")):
        [warned] = same(oneray, tmp_path, text, plain=plain)
        assert "ext_eta divides eta and k, as in Mitsuba 0: Mitsuba 3 refuses it" in warned


def test_trilinear_is_bilinear(oneray: Path, tmp_path: Path) -> None:
    tiles = ROOT / "scenes/pictures/tiles.png"
    painted = (
        '<bsdf type="diffuse" id="paint"><texture type="bitmap" name="reflectance"><string name="filename" '
        f'value="{tiles}"/><string name="filter_type" value="{{}}"/></texture></bsdf>'
    )
    text, plain = (PLAIN.replace(BSDF, painted.format(which)) for which in ("trilinear", "bilinear"))
    [warned] = same(oneray, tmp_path, text, plain=plain)
    assert "is read as bilinear, as by Mitsuba 0" in warned


WITHOUT_EFFECT = {
    "sensor": [
        '<float name="focus_distance" value="3"/>', '<float name="shutter_open" value="0"/>',
        '<float name="shutter_close" value="1"/>',
    ],
    "film": [
        '<string name="file_format" value="openexr"/>', '<boolean name="banner" value="false"/>',
        '<string name="component_format" value="float16"/>', '<boolean name="compensate" value="true"/>',
        '<string name="pixel_format" value="rgba"/>', '<string name="pixel_format" value="xyz"/>',
        '<string name="pixel_format" value="luminance_alpha"/>',
        '<string name="component_format" value="uint32"/>',
    ],
    "sampler": ['<integer name="seed" value="7"/>'],
    "integrator": [
        '<integer name="block_size" value="32"/>', '<integer name="samples_per_pass" value="4"/>',
        '<float name="timeout" value="3"/>',
    ],
    "emitter": ['<float name="sampling_weight" value="2"/>'],
}  # fmt: skip


def put_into(tag: str, inner: str) -> str:
    """The plain scene with something more in the first element of a tag."""
    at = PLAIN.index(">", PLAIN.index(f"<{tag} ")) + 1
    return PLAIN[:at] + inner + PLAIN[at:]


@pytest.mark.parametrize(
    ("tag", "inner"), [(tag, inner) for tag, some in WITHOUT_EFFECT.items() for inner in some]
)
def test_what_has_no_effect_is_left_out_with_a_line(
    oneray: Path, tmp_path: Path, tag: str, inner: str
) -> None:
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    mi.load_string(put_into(tag, inner))
    [line] = same(oneray, tmp_path, put_into(tag, inner))
    name, value = inner.split('"')[1], inner.split('"')[3]
    written = {"component_format": "float32", "pixel_format": "rgb"}.get(name)
    reason = f"pictures are written as {written}" if written else "it changes no mean of a pixel"
    assert line.endswith(f'"{name}" = "{value}" is left out: {reason}')


@pytest.mark.parametrize("text", ["a sphere", "two\nlines of it", "\u200b", "<![CDATA[<shape/>]]>"])
def test_text_between_elements_is_left_out_with_a_line(oneray: Path, tmp_path: Path, text: str) -> None:
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    with_text = PLAIN.replace("</scene>", f"\n{text}</scene>")
    mi.load_string(with_text)
    [line] = same(oneray, tmp_path, with_text)
    assert line.endswith(": text between the elements is left out, as by Mitsuba: values stand in attributes")
    there, here = (put_into("sampler", f"<integer>{one}</integer>") for one in ("", "7"))
    for one, lines in ((there, 1), (here, 2)):
        path = write(tmp_path, one)
        done = subprocess.run([oneray, path, "--check"], capture_output=True, text=True, check=False)
        assert done.returncode == 2 and done.stderr.count("\n") == lines, done.stderr


@pytest.mark.parametrize("kind", ["stratified", "multijitter", "orthogonal", "ldsampler", "halton", "sobol"])
def test_another_sampler_has_the_same_mean(oneray: Path, tmp_path: Path, kind: str) -> None:
    [line] = same(oneray, tmp_path, PLAIN.replace('sampler type="independent"', f'sampler type="{kind}"'))
    assert line == f'8: <sampler type="{kind}"> is left out: samples are independent, or those of --sampler'


DIRECT = '<integrator type="direct"/>'


@pytest.mark.parametrize(
    ("instead", "warnings"),
    [
        (DIRECT, 0),
        ('<integrator type="direct"><integer name="shading_samples" value="4"/></integrator>', 1),
        ('<integrator type="aov"><string name="aovs" value="d:uv"/>' + DIRECT + "</integrator>", 2),
        ('<integrator type="moment"><integrator type="direct"/></integrator>', 1),
        ('<integrator type="volpath"><integer name="max_depth" value="2"/></integrator>', 0),
        ('<integrator type="volpathmis"><integer name="max_depth" value="2"/></integrator>', 1),
    ],
)  # fmt: skip
def test_integrators_of_the_same_mean(oneray: Path, tmp_path: Path, instead: str, warnings: int) -> None:
    direct = PLAIN.replace('value="3"/></integrator>', 'value="2"/></integrator>')
    assert len(same(oneray, tmp_path, PLAIN.replace(INTEGRATOR, instead), plain=direct)) == warnings


OTHERS = {
    "bdpt": ('<boolean name="lightImage" value="true"/>', "has the same mean"),
    "mlt": ('<integer name="directSamples" value="16"/>', "has the same mean"),
    "pssmlt": ('<float name="pLarge" value="0.3"/>', "has the same mean"),
    "volpath_simple": ("", "has the same mean"),
    "ptracer": ('<boolean name="bruteForce" value="true"/>', "and what mirrors and glass show besides"),
    "erpt": ('<float name="numChains" value="1"/>', "has the same mean"),
    "photonmap": ('<integer name="globalPhotons" value="250000"/>', "whose mean its pictures approach"),
    "sppm": ('<string name="lookup" value="kd"/>', "whose mean its pictures approach"),
    "prb_projective": ("", "has the same mean"),
}


@pytest.mark.parametrize("kind", OTHERS)
def test_integrators_of_the_same_integral_are_path(oneray: Path, tmp_path: Path, kind: str) -> None:
    """What only they have is left out, each with a line; so is what is not known of path itself."""
    own, reason = OTHERS[kind]
    text = OLD.replace("3.0.0", "0.6.0").replace('"path">', f'"{kind}">{own}')
    *left, line = same(oneray, tmp_path, text)
    other = "volpath" if kind == "volpath_simple" else "path"
    assert line.startswith(f'2: <integrator type="{kind}"> is rendered as {other}') and line.endswith(reason)
    assert [one.endswith("is left out: it changes no mean of a pixel") for one in left] == [True] * bool(own)
    path = write(tmp_path, OLD.replace("3.0.0", "0.6.0").replace('"path">', f'"path">{own or "<string/>"}'))
    assert subprocess.run([oneray, path, "--check"], capture_output=True, check=False).returncode == 2


def test_direct_by_another_name(oneray: Path, tmp_path: Path) -> None:
    projective = '<integrator type="direct_projective"><integer name="sppi" value="0"/></integrator>'
    direct = PLAIN.replace(INTEGRATOR, DIRECT)
    left, line = same(oneray, tmp_path, PLAIN.replace(INTEGRATOR, projective), plain=direct)
    assert left == '2: "sppi" = "0" is left out: it changes no mean of a pixel'
    assert line == '2: <integrator type="direct_projective"> is rendered as direct, which has the same mean'


def test_strict_normals_matter_where_normals_are_interpolated(oneray: Path, tmp_path: Path) -> None:
    strict = PLAIN.replace('"path">', '"path"><boolean name="strict_normals" value="true"/>')
    assert same(oneray, tmp_path, strict.replace("true", "false")) == []
    assert same(oneray, tmp_path, strict) == [
        '2: "strict_normals" is left out: no shape has interpolated normals'
    ]
    corners = "".join(f"v {p} 0\nvn 0 {n} 1\n" for p, n in (("0 0", 0), ("1 0", 0), ("0 1", 1)))
    write(tmp_path, corners + "f 1//1 2//2 3//3\n", "bent.obj")
    for more, status in (("", 2), ('<boolean name="face_normals" value="true"/>', 0)):
        mesh = f'<shape type="obj"><string name="filename" value="bent.obj"/>{more}</shape></scene>'
        path = write(tmp_path, strict.replace("</scene>", mesh))
        done = subprocess.run([oneray, path, "--check"], capture_output=True, text=True, check=False)
        assert done.returncode == status
        assert ("not supported with interpolated normals" in done.stderr) == (status == 2)


def test_without_an_integrator_it_is_path(oneray: Path, tmp_path: Path) -> None:
    endless = PLAIN.replace(INTEGRATOR, '<integrator type="path"/>')
    [line] = same(oneray, tmp_path, PLAIN.replace(INTEGRATOR, ""), plain=endless)
    assert line.startswith("1: <scene> has no <integrator>: it is rendered by")


def test_sensors_by_name_and_number(oneray: Path, tmp_path: Path) -> None:
    both, side = scene(INTEGRATOR, SENSOR, SIDE, BSDF, BODY), scene(INTEGRATOR, SIDE, BSDF, BODY)
    [line] = same(oneray, tmp_path, both)
    assert line == "3: of 2 sensors this one is rendered: --sensor ID|N takes another (front, side)"
    assert same(oneray, tmp_path, both, "--sensor", "side", plain=side) == []
    assert same(oneray, tmp_path, both, "--sensor", "1", plain=side) == []
    assert same(oneray, tmp_path, both, "--sensor", "0") == []
    done = subprocess.run(
        [oneray, tmp_path / "scene.xml", "--check", "--sensor", "2"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (
        2, "oneray: --sensor 2: the scene has no such sensor (front, side)\n"
    )  # fmt: skip


def test_a_film_of_another_sensor_is_another_film(oneray: Path, tmp_path: Path) -> None:
    path = write(tmp_path, scene(INTEGRATOR, SENSOR, SIDE, BSDF, BODY))
    parts = []
    for sensor, first in (("front", 0), ("side", 1)):
        parts.append(tmp_path / f"{sensor}.film")
        command = [
            oneray,
            path,
            "--sensor",
            sensor,
            "--samples",
            f"{first}:1",
            "--film",
            parts[-1],
            "--quiet",
        ]
        subprocess.run(command, check=True, capture_output=True)
    done = subprocess.run(
        [oneray, "merge", *parts, "-o", tmp_path / "out.exr"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2 and "is a film of something else" in done.stderr


def test_a_sensor_by_reference(oneray: Path, tmp_path: Path) -> None:
    assert (
        len(same(oneray, tmp_path, PLAIN.replace("</scene>", '<ref id="front"/><ref id="paint"/></scene>')))
        == 1
    )


LAMP = '<emitter type="area" id="lamp"><rgb name="radiance" value="3"/></emitter>'
DISK = '<shape type="disk"><transform name="to_world"><translate x="2"/></transform>{}</shape>'


def test_parts_by_reference(oneray: Path, tmp_path: Path) -> None:
    """A film, its filter, a sampler and the light of a shape may stand in the scene, also behind an alias."""
    lit = scene(INTEGRATOR, SENSOR, BSDF, BODY, DISK.format(LAMP))
    film = FILM.replace("<film ", '<film id="f" ').replace('<rfilter type="box"/>', '<ref id="r"/>')
    sampler = '<sampler type="independent" id="s"><integer name="sample_count" value="4"/></sampler>'
    assert sampler.replace(' id="s"', "") in SENSOR
    sensor = SENSOR.replace(FILM, '<ref id="f"/>').replace(sampler.replace(' id="s"', ""), '<ref id="s"/>')
    parts = [film, sampler, '<rfilter type="box" id="r"/>', LAMP, '<alias id="lamp" as="light"/>']
    text = scene(INTEGRATOR, *parts, sensor, BSDF, BODY, DISK.format('<ref id="light"/>'))
    assert same(oneray, tmp_path, text, plain=lit) == []
    assert same(oneray, tmp_path, scene(INTEGRATOR, SENSOR, BSDF, BODY, LAMP)) == []  # of no shape
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    mi.load_string(text)


def test_a_film_that_nothing_can_refer_to(oneray: Path, tmp_path: Path) -> None:
    [line] = same(oneray, tmp_path, PLAIN.replace("</scene>", FILM + "</scene>"))
    assert line == "13: <film> in <scene> is left out: give it an id, and a <ref> where it shall be"


def test_the_first_of_two_defaults_holds(oneray: Path, tmp_path: Path) -> None:
    twice = '<default name="red" value="0.5"/><default name="red" value="0.7"/>'
    text = scene(twice, INTEGRATOR, SENSOR, BSDF.replace("0.5 ", "$red "), BODY)
    [line] = same(oneray, tmp_path, text)
    assert line == '2: the default "red" is given twice: the first holds, as in Mitsuba'
    assert same(oneray, tmp_path, text.replace('red" value="0.5"', 'red" value="0.1"'), "-Dred=0.5") == [line]


def test_a_default_may_stand_in_what_has_a_type(oneray: Path, tmp_path: Path) -> None:
    """It holds from there on, as in Mitsuba."""
    blue = '<bsdf type="diffuse" id="paint"><default name="blue" value="0.75"/>'
    text = PLAIN.replace('<bsdf type="diffuse" id="paint">', blue).replace(
        '0.75"/></bsdf>', '$blue"/></bsdf>'
    )
    assert text.count("$blue") == 1 and same(oneray, tmp_path, text) == []
    later = scene(INTEGRATOR, SENSOR, BSDF, BODY.replace('value="9"', 'value="$nine"'))
    text = later.replace("<film ", '<default name="nine" value="9"/><film ')
    assert same(oneray, tmp_path, text) == []
    assert same(oneray, tmp_path, text.replace('"nine" value="9"', '"nine" value="1"'), "-Dnine=9") == []
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    mi.load_string(text)


CHECKS = '<bsdf type="diffuse" id="paint"><texture type="checkerboard" name="reflectance">{}</texture></bsdf>'
TO_UV = {
    '<float name="uoffset" value="0.3"/><float name="vscale" value="2"/>':
        '<translate x="0.3"/><scale y="2"/>',
    '<float name="uscale" value="4"/><float name="voffset" value="0.1"/><float name="vscale" value="3"/>':
        '<translate y="0.1"/><scale x="4"/><scale y="3"/>',
}  # fmt: skip


@pytest.mark.parametrize("old", TO_UV)
def test_offsets_and_scales_of_version_0_are_to_uv(oneray: Path, tmp_path: Path, old: str) -> None:
    """Mitsuba 3.9.1 moves before it scales."""
    texture = CHECKS.format(f'<transform name="to_uv">{TO_UV[old]}</transform>')
    plain, text = PLAIN.replace(BSDF, texture), PLAIN.replace(BSDF, CHECKS.format(old))
    assert same(oneray, tmp_path, text.replace("3.0.0", "0.6.0"), plain=plain) == []
    path = write(tmp_path, text.replace("3.0.0", "2.0.0"))
    done = subprocess.run([oneray, path, "--check"], capture_output=True, text=True, check=False)
    assert done.returncode == 2 and "has no property" in done.stderr
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    found = [
        mi.traverse(mi.load_string(one))["paint.reflectance.to_uv"]
        for one in (text.replace("3.0.0", "0.6.0"), plain)
    ]
    assert np.allclose(found[0].matrix, found[1].matrix)


def test_a_default_of_such_a_name_stays_a_default(oneray: Path, tmp_path: Path) -> None:
    old = scene('<default name="uscale" value="0.25"/>', INTEGRATOR, SENSOR, BSDF, BODY, version="0.6.0")
    assert same(oneray, tmp_path, old.replace("0.25 0.75", "$uscale 0.75")) == []


SKY = '<rgb name="radiance" value="0.5"/>'


@pytest.mark.parametrize(
    ("instead", "value", "warnings"),
    [
        ('<spectrum name="radiance" type="d65"><float name="scale" value="2"/></spectrum>', "2", 0),
        ('<spectrum name="radiance" type="d65"/>', "1", 0),
        ('<spectrum name="radiance" type="uniform"><float name="value" value="3"/></spectrum>', "3", 0),
        ('<spectrum name="radiance" value="0.5, 0.25 0.125"/>', "0.5 0.25 0.125", 1),
    ],
)
def test_spectra_that_are_colours(
    oneray: Path, tmp_path: Path, instead: str, value: str, warnings: int
) -> None:
    plain = PLAIN.replace(SKY, SKY.replace("0.5", value))
    assert len(same(oneray, tmp_path, PLAIN.replace(SKY, instead), plain=plain)) == warnings


BODIES = {
    3000: (733.6808, 349.94092, 112.810234), 5000: (15274.786, 12094.885, 9603.2),
    9000: (120568.26, 132527.5, 179181.38),
}  # fmt: skip
"""Of a constant sky, by Mitsuba 3.9.1, scalar_spectral, 512,000 samples: standard errors below 1e-3."""


@pytest.mark.parametrize("kelvin", BODIES)
def test_black_bodies(oneray: Path, tmp_path: Path, kelvin: int) -> None:
    inner = f'<float name="temperature" value="{kelvin}"/>'
    body = f'<spectrum name="radiance" type="blackbody">{inner}</spectrum>'
    sky = scene(INTEGRATOR, SENSOR, f'<emitter type="constant">{body}</emitter>')
    pixels, warned = picture(oneray, write(tmp_path, sky))
    assert warned == []
    assert np.allclose(pixels[..., :3].mean(axis=(0, 1)), BODIES[kelvin], rtol=1.5e-3)
    assert np.allclose(read_scene(tmp_path / "scene.xml").sky, BODIES[kelvin], rtol=1.5e-3)
    old = f'<blackbody name="radiance" temperature="{kelvin}K" scale="1"/>'
    [line] = same(oneray, tmp_path, sky.replace(body, old), plain=sky)
    assert line == '9: <blackbody> is read as <spectrum type="blackbody">, which Mitsuba 3 wants'


def test_included_files(oneray: Path, tmp_path: Path) -> None:
    """An include within an include is found beside its own file; of one that is no <scene> the root is put
    there; each has a version of its own.
    """
    write(tmp_path, scene('<include filename="inner.xml"/>', version="2.1.0"), "parts/outer.xml")
    write(tmp_path, scene(SENSOR, BSDF.replace("0.5 ", "$red ")), "parts/inner.xml")
    light = '<emitter version="0.6.0" type="constant"><rgb name="radiance" value="0.5"/></emitter>'
    write(tmp_path, light, "light.xml")
    body = BODY.replace('<emitter type="constant"><rgb name="radiance" value="0.5"/></emitter>', "")
    red, outer = '<default name="red" value="0.5"/>', '<include filename="parts/outer.xml"/>'
    text = scene(INTEGRATOR, red, outer, body, '<include filename="light.xml"/>')
    assert same(oneray, tmp_path, text) == []
    assert [path.name for path in variants.files_of(tmp_path / "scene.xml")] == [
        "outer.xml", "inner.xml", "light.xml"
    ]  # fmt: skip


def test_what_is_included_into_a_shape(oneray: Path, tmp_path: Path) -> None:
    write(
        tmp_path,
        '<bsdf version="3.0.0" type="diffuse"><rgb name="reflectance" value="0.5 0.25 0.75"/></bsdf>',
        "b.xml",
    )
    text = PLAIN.replace(BSDF, "").replace('<ref id="paint"/>', '<include filename="b.xml"/>')
    assert same(oneray, tmp_path, text) == []


def test_an_error_names_the_included_file(oneray: Path, tmp_path: Path) -> None:
    inner = write(tmp_path, scene("", BSDF.replace("0.5 ", "5 ")), "inner.xml")
    path = write(tmp_path, scene(INTEGRATOR, SENSOR, '<include filename="inner.xml"/>', BODY))
    done = subprocess.run([oneray, path, "--check"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (2, f'{inner}:3: "reflectance" must be in [0,1], not 5\n')


def test_an_included_file_is_not_written_over(oneray: Path, tmp_path: Path) -> None:
    inner = write(tmp_path, scene(BSDF), "inner.xml")
    (tmp_path / "inner.exr").symlink_to(inner)
    path = write(tmp_path, scene(INTEGRATOR, SENSOR, '<include filename="inner.xml"/>', BODY))
    done = subprocess.run(
        [oneray, path, "-o", tmp_path / "inner.exr"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2 and inner.read_text() == scene(BSDF)


def test_folders_for_files(oneray: Path, tmp_path: Path) -> None:
    """The last <path> comes first, the scene's own folder last; one of an included file holds in it alone."""
    ply = (ROOT / "scenes/meshes/lamp.ply").read_bytes()
    for folder in ("a", "b", "."):
        (tmp_path / folder).mkdir(exist_ok=True)
    (tmp_path / "a/ball.ply").write_bytes(ply)
    (tmp_path / "b/ball.ply").write_bytes(b"no mesh")
    (tmp_path / "ball.ply").write_bytes(b"no mesh")
    write(tmp_path, scene('<path value="../b"/>'), "a/inner.xml")
    mesh = '<shape type="ply"><string name="filename" value="{}"/><ref id="paint"/></shape>'
    text = scene(
        '<path value="b"/>', '<path value="a"/>', '<include filename="inner.xml"/>', INTEGRATOR, SENSOR, BSDF,
        BODY, mesh.format("ball.ply"),
    )  # fmt: skip
    plain = scene(INTEGRATOR, SENSOR, BSDF, BODY, mesh.format("a/ball.ply"))
    assert same(oneray, tmp_path, text, plain=plain) == []
    moved = tmp_path / "elsewhere/scene.xml"
    moved.parent.mkdir()
    document.write(document.read(tmp_path / "scene.xml").moved(str), moved)
    assert np.array_equal(picture(oneray, moved)[0], picture(oneray, tmp_path / "plain.xml")[0])


def test_other_names_for_what_has_one(oneray: Path, tmp_path: Path) -> None:
    text = PLAIN.replace("<shape", '<alias id="paint" as="colour"/><alias id="colour" as="hue"/><shape')
    assert same(oneray, tmp_path, text.replace('<ref id="paint"/>', '<ref id="hue"/>')) == []


def test_all_that_is_wrong_is_said_at_once(oneray: Path, tmp_path: Path) -> None:
    """One line for each mistake, in whatever element, and none for what follows from one."""
    text = (
        PLAIN.replace('value="3"', 'value="three"')
        .replace('value="50"', 'value="500"')
        .replace('value="8"', 'value="8.5"')
        .replace("independent", "blue")
        .replace("0.25 0.75", "0.25 7")
        .replace(
            "</shape>", '<rgb name="shade" value="1"/></shape><shape type="disk"><ref id="paint"/></shape>'
        )
        .replace('<rgb name="intensity" value="9"/>', '<rgb name="intensity" value="$missing"/>')
        .replace('<rgb name="radiance" value="0.5"/>', '<rgb name="radiance" colour="0.5"/>')
        .replace("</scene>", "<light/></scene>")
    )
    path = write(tmp_path, text)
    done = subprocess.run([oneray, path, "--check"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    told = [line.removeprefix(f"{path}:").partition(": ")[2] for line in done.stderr.splitlines()]
    starts = [
        "<light> is not supported in <scene>", '"three" is not an integer', '"fov" must be in (0,180)',
        '"8.5" is not an integer', '<sampler type="blue"> is not', '"reflectance" must be in [0,1]',
        '<shape type="sphere"> has no property "shade"', "undefined parameter $missing",
        '<rgb> has no attribute "colour"',
    ]  # fmt: skip
    assert all(sum(line.startswith(start) for line in told) == 1 for start in starts)
    assert len(told) == len(starts)


def test_errors_end_at_fifty(oneray: Path, tmp_path: Path) -> None:
    path = write(tmp_path, PLAIN.replace("</scene>", '<bsdf type="paint"/>' * 99 + "</scene>"))
    done = subprocess.run([oneray, path, "--check"], capture_output=True, text=True, check=False)
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 50)


def test_check_renders_nothing(oneray: Path, tmp_path: Path) -> None:
    path = write(tmp_path, put_into("film", '<boolean name="banner" value="true"/>'))
    done = subprocess.run([oneray, path, "--check"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, f"{path}: no errors, 1 warning\n")
    done = subprocess.run(
        [oneray, path, "--check", "-o", "x.exr"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2 and done.stderr.startswith("oneray: --check writes nothing")


def test_a_preview_is_small_and_quick(oneray: Path, tmp_path: Path) -> None:
    path = write(tmp_path, PLAIN)
    found, _ = picture(oneray, path, "--preview")
    assert found.shape[:2] == (192, 256)
    found, _ = picture(oneray, path, "--preview", "--width", "4", "--spp", "2")
    assert found.shape[:2] == (3, 4)


def test_rotations_about_any_axis_are_mitsubas(oneray: Path, tmp_path: Path) -> None:
    """Its matrix, in double precision."""
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    said = '<transform name="to_world"><rotate value="1 2 0.5" angle="25"/></transform>'
    path = write(tmp_path, PLAIN.replace('<shape type="sphere">', f'<shape type="rectangle">{said}'))
    theirs = mi.ScalarTransform4d().rotate([1, 2, 0.5], 25).matrix
    step = document.read(path).root.find("./shape/transform")
    assert step is not None
    assert transform(step) == pytest.approx(np.array(theirs), abs=1e-12)
    matrix = " ".join(repr(float(one)) for one in transform(step).ravel())
    plain = PLAIN.replace(
        '<shape type="sphere">',
        f'<shape type="rectangle"><transform name="to_world"><matrix value="{matrix}"/></transform>',
    )
    first, second = picture(oneray, path), picture(oneray, write(tmp_path, plain, "plain.xml"))
    assert np.allclose(first[0], second[0], rtol=1e-5, atol=1e-6)
    assert "the axis has length 2.29129: as in Mitsuba" in first[1][0]


SPECTRA = ["400:0.2, 480:0.7 550:.1, 620:.9 720:0.3", "300:1 900:2", "500:0 501:1 502:0", "0.5"]


@pytest.mark.parametrize("value", SPECTRA)
@pytest.mark.parametrize("name", ["radiance", "reflectance"])
def test_spectra_are_mitsubas_numbers(oneray: Path, tmp_path: Path, value: str, name: str) -> None:
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    said = f'<spectrum name="{name}" value="{value}"/>'
    text = PLAIN.replace(f'<rgb name="{name}" value="0.5"/>', said) if name == "radiance" else PLAIN.replace(
        '<rgb name="reflectance" value="0.5 0.25 0.75"/>', said
    )  # fmt: skip
    path = write(tmp_path, text)
    if ":" in value:
        pairs = np.array([[float(n) for n in word.split(":")] for word in value.replace(",", " ").split()]).T
        lit = name == "reflectance"
        theirs = np.array(mi.spectrum_list_to_srgb(pairs[0].tolist(), pairs[1].tolist(), lit, lit))
    else:
        theirs = 0.5 * (np.ones(3) if name == "reflectance" else np.array(mi.xyz_to_srgb(mi.Color3f(1))))
    read = read_scene(path)
    assert (read.sky if name == "radiance" else read.shapes[0].material.reflectance) == pytest.approx(
        theirs, abs=1e-5
    )
    if name == "radiance":  # the corner shows it
        assert picture(oneray, path)[0][0, 0, :3] == pytest.approx(theirs, rel=1e-5, abs=1e-6)


def test_spectra_tables_are_what_the_script_makes(tmp_path: Path) -> None:
    pytest.importorskip("mitsuba")
    for name in ("src/oneray/scene/cie.h", "src/raycheck/scene/cie.json"):
        (tmp_path / name).parent.mkdir(parents=True)
    subprocess.run([sys.executable, ROOT / "scripts/make_cie.py", tmp_path], check=True, capture_output=True)
    for name in ("src/oneray/scene/cie.h", "src/raycheck/scene/cie.json"):
        assert (tmp_path / name).read_bytes() == (ROOT / name).read_bytes()
    assert len(json.loads((ROOT / "src/raycheck/scene/cie.json").read_text())["d65"]) == 95
