"""Every construct of the scene format means in oneray what it means in Mitsuba.

Both render the same small scene from the same text with as many samples and the same technique, so with about
the same variance. Each pixel must agree within 6 standard errors of the difference and 2 % of the brightest
pixel: a transform, an axis or a side taken wrongly changes whole pixels. The seeds are fixed; of all choices
of seeds chance alone would fail fewer than 1 in 1000, by Gauss's tail 2e-9 for each of about 2e5 pixels and
channels.
"""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

mi = pytest.importorskip("mitsuba")

SPP = 256

DIRECTIONAL = """<emitter type="directional">
    <vector name="direction" x="-.3" y="-.6" z="1"/>
    <rgb name="irradiance" value="3 2 1"/>
</emitter>"""
CONSTANT = '<emitter type="constant"><rgb name="radiance" value="1 .5 2"/></emitter>'
GLOW = '<emitter type="area"><rgb name="radiance" value="2 3 1"/></emitter>'
PAINT = '<bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value=".9"/></bsdf></bsdf>'
AHEAD = '<translate z="6"/>'
WALL = """<shape type="rectangle">
    <transform name="to_world"><scale value="9"/><rotate y="1" angle="180"/><translate z="7"/></transform>
    <bsdf type="diffuse"><rgb name="reflectance" value=".8 .6 .4"/></bsdf>
</shape>"""
# Three lights at known places, none of them the mirror image of another.
LANDMARKS = "".join(
    f"""<shape type="sphere">
    <point name="center" x="{x}" y="{y}" z="{z}"/>
    <float name="radius" value="{radius}"/>
    <emitter type="area"><rgb name="radiance" value="{radiance}"/></emitter>
</shape>"""
    for x, y, z, radius, radiance in [
        (1.2, 0.8, 6, 0.5, "1 0 0"),
        (-0.7, 0.9, 5, 0.3, "0 1 0"),
        (-0.5, -1.1, 7, 0.6, "0 0 1"),
        (0.9, -0.6, 5.5, 0.4, "1 1 0"),
    ]
)


def transform(steps: str) -> str:
    return f'<transform name="to_world">{steps}</transform>'


FOV = '<float name="fov" value="40"/>'


def scene(body: str, sensor: str = FOV, integrator: str = "", width: int = 16) -> str:
    """A whole scene file; the camera of the plain sensor is in the origin and looks along +z."""
    if "max_depth" not in integrator:
        integrator += '<integer name="max_depth" value="2"/>'
    return f"""<scene version="3.0.0">
<integrator type="path">{integrator}</integrator>
<sensor type="perspective">{sensor}
    <film type="hdrfilm">
        <integer name="width" value="{width}"/>
        <integer name="height" value="16"/>
        <string name="pixel_format" value="rgb"/>
        <string name="component_format" value="float32"/>
        <rfilter type="box"/>
    </film>
    <sampler type="independent"><integer name="sample_count" value="{SPP}"/></sampler>
</sensor>
{body}
</scene>"""


def shape(kind: str, steps: str, more: str = PAINT, light: str = DIRECTIONAL) -> str:
    return scene(f'<shape type="{kind}">{transform(steps)}{more}</shape>' + light)


def lit(light: str) -> str:
    """A wall in front of the camera with this light."""
    return scene(WALL + light)


def material(bsdf: str, turn: int, before: str = "") -> str:
    """A square in all-round light, seen obliquely from its front (180) or its back (0)."""
    place = transform(f'<rotate x="1" angle="35"/><rotate y="1" angle="{turn}"/>{AHEAD}')
    return scene(f'{before}<shape type="rectangle">{place}{bsdf}</shape>{CONSTANT}')


STEPS = {
    "translate": '<translate x=".5" y="-.2" z="7"/>',
    "translate-x": f'<translate x=".5"/>{AHEAD}',
    "translate-value": '<translate value=".5, -.2 7"/>',
    "translate-one": f'<translate value=".4"/>{AHEAD}',
    "rotate-x": f'<rotate x="1" angle="25"/>{AHEAD}',
    "rotate-y": f'<rotate y="1" angle="25"/>{AHEAD}',
    "rotate-z": f'<rotate z="1" angle="25"/>{AHEAD}',
    "rotate-negative-axis": f'<rotate y="-1" angle="25"/>{AHEAD}',
    "rotate-value": f'<rotate value=".48, .6, .64" angle="-70"/>{AHEAD}',
    "scale-one": f'<scale value=".5"/>{AHEAD}',
    "scale-three": f'<scale value=".5 1 .2"/>{AHEAD}',
    "scale-xyz": f'<scale x=".5" z="2"/><rotate y="1" angle="30"/>{AHEAD}',
    "scale-mirror": f'<rotate z="1" angle="25"/><rotate y="1" angle="25"/><scale x="-1"/>{AHEAD}',
    "lookat": '<lookat origin=".3 .2 6" target="1 -.5 9" up=".1 1 .2"/>',
    "lookat-without-up": '<lookat origin=".3 .2 6" target="1 -.5 9"/>',
    "lookat-without-up-backwards": '<lookat origin=".3 .2 6" target="1 -.5 3"/>',
    "lookat-then-scale": '<lookat origin="0 0 3" target=".3 .2 4" up="0 1 0"/><scale value="2"/>',
    "matrix-16": '<matrix value="1 .3 0 .2  0 .8 .1 -.1  .2 0 1 6  0 0 0 1"/>',
    "matrix-9": f'<matrix value="1 .3 0, 0 .8 .1, .2 0 1"/>{AHEAD}',
    "rotate-then-translate": f'<rotate z="1" angle="50"/><translate x=".8"/>{AHEAD}',
    "translate-then-rotate": f'<translate x=".8"/><rotate z="1" angle="50"/>{AHEAD}',
    "scale-then-rotate": f'<scale x=".3"/><rotate z="1" angle="50"/>{AHEAD}',
    "rotate-then-scale": f'<rotate z="1" angle="50"/><scale x=".3"/>{AHEAD}',
}
TURN = f'<rotate y="1" angle="150"/>{AHEAD}'
SIDES = {
    "away": AHEAD,
    "facing": TURN,
    "mirrored-x": f'<scale x="-1"/>{TURN}',
    "mirrored-z": f'<scale x="1" y="1" z="-1"/>{TURN}',
    "mirrored-all": f'<scale value="-1"/>{TURN}',
}
AXES = ["x", "y", "diagonal", "smaller", "larger"]
VIEWS = {
    "lookat": '<lookat origin="2 1 0" target=".2 0 6" up=".3 1 0"/>',
    "roll": '<rotate z="1" angle="20"/><translate x=".3"/>',
    "mirrored": '<scale x="-1"/><rotate y="1" angle="5"/>',
    "from-behind": '<lookat origin="0 0 12" target="0 0 6" up="0 1 0"/>',
}
SPHERES = {
    "center-radius": '<point name="center" x=".4" y=".3" z="5"/><float name="radius" value=".7"/>',
    "center-vector": '<vector name="center" value=".4 .3 5"/><integer name="radius" value="1"/>',
    "center-then-to-world": '<point name="center" value=".4 .3 1"/><float name="radius" value=".35"/>'
    + transform('<scale value="2"/><rotate z="1" angle="70"/><translate z="4"/>'),
    "to-world": transform(f'<scale value=".6"/><rotate x="1" angle="30"/><translate x=".3"/>{AHEAD}'),
    "mirrored-center": '<point name="center" value=".4 .3 0"/>' + transform(f'<scale x="-1"/>{AHEAD}'),
}
MATERIALS = {
    "none": "",
    "diffuse-default": '<bsdf type="diffuse"/>',
    "diffuse-three": '<bsdf type="diffuse"><rgb name="reflectance" value=".9, .5 ,.1"/></bsdf>',
    "diffuse-one": '<bsdf type="diffuse"><rgb name="reflectance" value=".7"/></bsdf>',
    "diffuse-float": '<bsdf type="diffuse"><float name="reflectance" value=".7"/></bsdf>',
    "diffuse-integer": '<bsdf type="diffuse"><integer name="reflectance" value="1"/></bsdf>',
    "mirror": '<bsdf type="conductor"><string name="material" value="none"/></bsdf>',
    "mirror-tinted": '<bsdf type="conductor"><string name="material" value="none"/>'
    '<rgb name="specular_reflectance" value=".9 .5 .1"/></bsdf>',
    "metal": '<bsdf type="conductor"><rgb name="eta" value=".2 .92 1.1"/>'
    '<rgb name="k" value="3.9 2.4 2.1"/></bsdf>',
    "metal-float-tinted": '<bsdf type="conductor"><float name="eta" value="1.5"/><float name="k" value="1"/>'
    '<float name="specular_reflectance" value=".5"/></bsdf>',
    "twosided": '<bsdf type="twosided"><bsdf type="diffuse"/></bsdf>',
    "twosided-two": '<bsdf type="twosided"><bsdf type="diffuse"><float name="reflectance" value=".8"/></bsdf>'
    '<bsdf type="diffuse"><float name="reflectance" value=".2"/></bsdf></bsdf>',
    "twosided-mirror-diffuse": '<bsdf type="twosided"><bsdf type="conductor">'
    '<string name="material" value="none"/></bsdf><bsdf type="diffuse"/></bsdf>',
    "glowing": GLOW,
    "glowing-diffuse": '<bsdf type="twosided"><bsdf type="diffuse"/></bsdf>' + GLOW,
    "area-default": '<emitter type="area"/>',
}
PAINTS = """<bsdf type="diffuse" id="a"><float name="reflectance" value=".9"/></bsdf>
<bsdf type="diffuse" id="b"/>"""
REFERENCES = {
    "ref": '<ref id="a"/>',
    "ref-with-name": '<ref name="bsdf" id="b"/>',
    "ref-twosided": '<bsdf type="twosided"><ref id="a"/></bsdf>',
    "ref-twosided-two": '<bsdf type="twosided"><ref id="b"/><ref id="a"/></bsdf>',
    "ref-twosided-mixed": '<bsdf type="twosided"><bsdf type="diffuse"/><ref id="a"/></bsdf>',
}


def emitter(kind: str, inside: str = "") -> str:
    return f'<emitter type="{kind}">{inside}</emitter>'


AIM = transform('<lookat origin=".5 1 1" target=".8 0 7" up="0 0 1"/>')
AIM_WITHOUT_UP = transform('<lookat origin=".5 1 1" target=".8 0 7"/>')
CUTOFF = '<float name="cutoff_angle" value="12"/>'
LIGHTS = {
    "point-default": emitter("point"),
    "point-position": emitter("point", '<point name="position" x="1" y=".5" z="5"/>'),
    "point-to-world": emitter("point", AIM + '<float name="intensity" value="2"/>'),
    "point-intensity": emitter("point", '<rgb name="intensity" value="20 10 5"/>'),
    "spot-default": emitter("spot"),
    "spot-aimed": emitter("spot", AIM + '<rgb name="intensity" value="9 5 2"/>'),
    "spot-aimed-without-up": emitter("spot", AIM_WITHOUT_UP),
    "spot-cutoff": emitter("spot", CUTOFF),
    "spot-beam": emitter("spot", CUTOFF + '<float name="beam_width" value="3"/>'),
    "spot-hard": emitter("spot", CUTOFF + '<float name="beam_width" value="12"/>'),
    "spot-scaled": emitter("spot", transform('<scale value="-2"/><rotate y="1" angle="170"/>')),
    "directional-default": emitter("directional"),
    "directional-direction": DIRECTIONAL,
    "directional-point-value": emitter("directional", '<point name="direction" value="1 0 4"/>'),
    "directional-to-world": emitter("directional", transform('<rotate x="1" angle="40"/><translate x="3"/>')),
    "constant-default": emitter("constant"),
    "constant-float": emitter("constant", '<float name="radiance" value="2"/>'),
    "two-lights": emitter("point") + DIRECTIONAL,
}
DEPTH_5 = '<integer name="max_depth" value="5"/>'
HIDE = '<boolean name="hide_emitters" value="true"/>'
PATHS = {
    **{f"max-depth-{depth}": f'<integer name="max_depth" value="{depth}"/>' for depth in [-1, 1, 2, 3, 4]},
    "hide-emitters": DEPTH_5 + HIDE,
    "hide-emitters-depth-1": '<integer name="max_depth" value="1"/>' + HIDE,
    "show-emitters": DEPTH_5 + '<boolean name="hide_emitters" value="FALSE"/>',
}
MIRROR = f"""<shape type="rectangle">{transform('<rotate y="1" angle="160"/><translate x="-1.2" z="6"/>')}
    <bsdf type="conductor"><string name="material" value="none"/></bsdf></shape>"""


def clipped(near: float, far: float) -> str:
    fov = '<float name="fov" value="60"/>'
    return fov + f'<float name="near_clip" value="{near}"/><float name="far_clip" value="{far}"/>'


DEFAULTS = f"""<default name="size" value=".6"/>
<default name="red" value=".9"/>
<default name="color" value="$red .5, .2"/>
<default name="kind" value="sphere"/>
<shape type="$kind">
    <point name="center" value="$size -$size 5"/>
    <float name="radius" value="$size"/>
    <bsdf type="diffuse"><rgb name="reflectance" value="$color"/></bsdf>
</shape>{DIRECTIONAL}"""

# A bent sheet of two triangles, four-sided prisms, with and without normals of its own; faces that the
# camera sees from both sides.
MESHES = {
    "sheet.ply": """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 2
property list uchar int vertex_indices
end_header
-1 -1 0
1 -1 0.4
1 1 0
-1 1 0.5
3 0 1 2
3 0 2 3
""",
    "sheet-normals.ply": """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
property float nx
property float ny
property float nz
element face 2
property list uchar int vertex_index
end_header
-1 -1 0 -0.5 -0.5 2
1 -1 0.4 0.6 -0.3 1
1 1 0 0.2 0.7 1
-1 1 0.5 0 0 3
3 0 1 2
3 0 2 3
""",
    "roof.obj": """v -1 -1 0
v 1 -1 0
v 1 0 0.8
v -1 0 0.8
v 1 1 0
v -1 1 0
v 0 1.5 -0.3
f 1 2 3 4
f 4 3 5 7 6
""",
    "roof-normals.obj": """v -1 -1 0
v 1 -1 0
v 1 0 0.8
v -1 0 0.8
v 1 1 0
v -1 1 0
vn -0.3 -0.6 1
vn 0.4 -0.2 2
vn 0 0.5 1
vt 0 0
vt 1 0
f 1//1 2//2 3//2 4//1
f 4/1/3 3/2/3 5/1/2 6/2/1
""",
    "roof-seams.obj": """v -1 -1 0
v 1 -1 0
v 1 0 0.8
v -1 0 0.8
v 1 1 0
v -1 1 0
vt 0 0
vt 1 0
f 1/1 2/2 3/1 4/1
f 4/2 3/1 5/1 6/2
""",
}
FACETED = '<boolean name="face_normals" value="true"/>'


def mesh(name: str, steps: str, more: str = PAINT) -> str:
    return f"""<shape type="{name[-3:]}"><string name="filename" value="{name}"/>
    {transform(f'<scale value=".9"/>{steps}')}{more}</shape>"""


MESH_TURNS = {
    "facing": f'<rotate y="1" angle="165"/><rotate x="1" angle="20"/>{AHEAD}',
    "away": f'<rotate x="1" angle="20"/>{AHEAD}',
    "mirrored": f'<scale x="-1"/><rotate y="1" angle="165"/>{AHEAD}',
    "mirrored-facing": f'<scale z="-1"/><rotate x="1" angle="20"/>{AHEAD}',
    "stretched": f'<scale x=".6" y="1" z="2"/><rotate y="1" angle="165"/>{AHEAD}',
}
FLIP = '<boolean name="flip_normals" value="true"/>'

CASES: dict[str, str] = {
    **{
        f"mesh-{name}-{turn}-{words}": scene(mesh(name, steps, more) + DIRECTIONAL)
        for name in MESHES
        for turn, steps in MESH_TURNS.items()
        for words, more in {
            "twosided": PAINT,
            "plain": "",
            "faceted": FACETED,
            "flipped": FLIP,
            "flipped-faceted": FLIP + FACETED,
        }.items()
    },
    **{
        f"mesh-light-{name}-{turn}-{words}": scene(mesh(name, steps, more + GLOW) + WALL, integrator=DEPTH_5)
        for name in MESHES
        for turn, steps in MESH_TURNS.items()
        for words, more in {"faceted": FACETED, "flipped-faceted": FLIP + FACETED}.items()
    },
    # Mitsuba samples a smooth light by another cosine than it is seen by: here it is only seen.
    **{
        f"mesh-glow-{name}-{turn}-{flip and 'flipped'}": scene(mesh(name, steps, flip + GLOW))
        for name in MESHES
        for turn, steps in MESH_TURNS.items()
        for flip in ["", FLIP]
    },
    **{f"cube-{name}": shape("cube", f'<scale value=".7"/>{steps}') for name, steps in STEPS.items()},
    **{
        f"{kind}-{name}{flip and '-flipped'}": shape(kind, steps, flip + GLOW, WALL + DIRECTIONAL)
        for kind in ["rectangle", "disk", "sphere", "cube"]
        for name, steps in SIDES.items()
        for flip in ["", '<boolean name="flip_normals" value="true"/>']
    },
    **{
        f"sphere-{name}": scene(f'<shape type="sphere">{place}{PAINT}</shape>{DIRECTIONAL}')
        for name, place in SPHERES.items()
    },
    **{
        f"fov-axis-{axis}-{width}x16": scene(
            LANDMARKS, f'<float name="fov" value="35"/><string name="fov_axis" value="{axis}"/>', width=width
        )
        for axis in AXES
        for width in [8, 16, 32]
    },
    "fov-axis-default-32x16": scene(LANDMARKS, '<integer name="fov" value="35"/>', width=32),
    **{f"view-{name}": scene(LANDMARKS, FOV + transform(steps)) for name, steps in VIEWS.items()},
    "near-clip": scene(LANDMARKS, clipped(5.1, 100)),
    "far-clip": scene(LANDMARKS + WALL + DIRECTIONAL, clipped(0.1, 5.2)),
    "far-clip-sees-constant": scene(LANDMARKS + WALL + CONSTANT, clipped(0.1, 6)),
    **{f"{name}-front": material(bsdf, 180) for name, bsdf in MATERIALS.items()},
    **{f"{name}-back": material(bsdf, 0) for name, bsdf in MATERIALS.items()},
    **{f"{name}-front": material(bsdf, 180, PAINTS) for name, bsdf in REFERENCES.items()},
    **{f"{name}-back": material(bsdf, 0, PAINTS) for name, bsdf in REFERENCES.items()},
    **{name: lit(light) for name, light in LIGHTS.items()},
    **{name: scene(LANDMARKS + WALL + MIRROR + CONSTANT, integrator=path) for name, path in PATHS.items()},
    "rr-depth": scene(
        LANDMARKS + WALL + CONSTANT, integrator=DEPTH_5 + '<integer name="rr_depth" value="1"/>'
    ),
    "default": scene(DEFAULTS),
}
BLACK = {"hide-emitters-depth-1"}

POINT_X, POINT_Y = (
    f'<float name="principal_point_offset_{axis}" value="{by}"/>' for axis, by in (("x", 0.125), ("y", -0.1))
)
CROP = "".join(
    f'<integer name="crop_{name}" value="{value}"/>'
    for name, value in (("offset_x", 5), ("offset_y", 2), ("width", 9), ("height", 12))
)
SPECTRUM = "400:0.2, 480:0.7 550:.1, 620:.9 720:0.3"


def cropped(text: str) -> str:
    """Of the film of a scene."""
    return text.replace('<film type="hdrfilm">', f'<film type="hdrfilm">{CROP}')


def spectrum(name: str, value: str = SPECTRUM) -> str:
    return f'<spectrum name="{name}" value="{value}"/>'


WHITE, SKY = '<rgb name="reflectance" value=".8 .6 .4"/>', '<rgb name="radiance" value="1 .5 2"/>'
WEIGHT = '<float name="sampling_weight" value="3"/>'
OTHERS = scene(LANDMARKS + WALL + CONSTANT, FOV + POINT_X, DEPTH_5)
CASES |= {
    "focal-length": scene(LANDMARKS, '<string name="focal_length" value="35mm"/>', width=32),
    "focal-length-default": scene(LANDMARKS, "", width=8),
    "principal-point-x": scene(LANDMARKS, FOV + POINT_X, width=32),
    "principal-point-y": scene(LANDMARKS, FOV + POINT_Y),
    "crop": cropped(scene(LANDMARKS, FOV, width=32)),
    "crop-principal-point": cropped(scene(LANDMARKS, FOV + POINT_X + POINT_Y, width=24)),
    "direct": OTHERS.replace('type="path">' + DEPTH_5, 'type="direct">'),
    "direct-samples": OTHERS.replace(
        'type="path">' + DEPTH_5, 'type="direct"><integer name="emitter_samples" value="3"/>'
    ),
    "volpath": OTHERS.replace('type="path"', 'type="volpath"'),
    "spectrum-of-reflectance": scene(WALL.replace(WHITE, spectrum("reflectance")) + CONSTANT),
    "spectrum-of-light": lit(CONSTANT.replace(SKY, spectrum("radiance"))),
    "spectrum-of-light-uniform": lit(CONSTANT.replace(SKY, spectrum("radiance", "2"))),
    "spectrum-beyond-rgb": lit(CONSTANT.replace(SKY, spectrum("radiance", "500:0 501:9 510:9 511:0"))),
    "sampling-weight": lit(CONSTANT.replace(SKY, WEIGHT + SKY) + DIRECTIONAL),
    "dielectric-default": material('<bsdf type="dielectric"/>', 180),
    "alias": scene(WALL.replace("<bsdf", '<bsdf id="paint"', 1) + '<alias id="paint" as="colour"/>'
                   f'<shape type="sphere">{transform(AHEAD)}<ref id="colour"/></shape>{CONSTANT}'),
}  # fmt: skip


def by_oneray(oneray: Path, directory: Path, text: str, *options: str) -> tuple[np.ndarray, np.ndarray]:
    """oneray's picture and its standard error, each [height, width, 3]."""
    (directory / "scene.xml").write_text(text)
    for name, mesh in MESHES.items():
        (directory / name).write_text(mesh)
    picture = directory / "out.exr"
    command = [str(oneray), str(directory / "scene.xml"), "-o", str(picture), "--seed", "1"]
    command += ["--light-choice", "uniform", "--quiet", *options]
    subprocess.run(command, check=True, capture_output=True, timeout=10)
    image = oiio.ImageBuf(str(picture))
    pixels, names = image.get_pixels(oiio.FLOAT), image.spec().channelnames
    mean = pixels[..., [names.index(c) for c in ("R", "G", "B")]]
    error = pixels[..., [names.index(f"stderr.{c}") for c in ("R", "G", "B")]]
    return mean.astype(float), error.astype(float)


def with_meshes(text: str, directory: Path) -> str:
    """The scene with the full names of its mesh files, which are then written."""
    for name, mesh in MESHES.items():
        if f'"{name}"' in text:
            (directory / name).write_text(mesh)
            text = text.replace(f'"{name}"', f'"{directory / name}"')
    return text


def by_mitsuba(text: str, **parameters: str) -> np.ndarray:
    """Mitsuba's picture, [height, width, 3]."""
    mi.set_variant("scalar_rgb")
    mi.set_log_level(mi.LogLevel.Error)
    return np.array(mi.render(mi.load_string(text, **parameters), spp=SPP, seed=1), dtype=float)


def assert_same(ours: np.ndarray, error: np.ndarray, theirs: np.ndarray) -> None:
    tolerance = 6 * np.sqrt(2) * error + 0.02 * max(theirs.max(), ours.max())
    worst = np.unravel_index(np.argmax(np.abs(ours - theirs) - tolerance), ours.shape)
    assert np.all(np.abs(ours - theirs) <= tolerance), (
        f"row, column, channel {tuple(map(int, worst))}: oneray {ours[worst]:.4g} ± {error[worst]:.2g}, "
        f"Mitsuba {theirs[worst]:.4g}"
    )


@pytest.mark.parametrize("name", CASES)
def test_means_what_it_means_in_mitsuba(oneray: Path, tmp_path: Path, name: str) -> None:
    theirs = by_mitsuba(with_meshes(CASES[name], tmp_path))
    assert theirs.shape[-1] == 3
    assert bool(theirs.any()) == (name not in BLACK) or name.startswith("mesh-")
    assert_same(*by_oneray(oneray, tmp_path, CASES[name]), theirs)


def test_parameter_of_the_command_line(oneray: Path, tmp_path: Path) -> None:
    ours = by_oneray(oneray, tmp_path, CASES["default"], "-Dred=.1", "-Dsize=.3")
    theirs = by_mitsuba(CASES["default"], red=".1", size=".3")
    assert_same(*ours, theirs)
    assert not np.allclose(theirs, by_mitsuba(CASES["default"]))


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("cube-rotate-then-translate", "cube-translate-then-rotate"),
        ("cube-rotate-then-scale", "cube-scale-then-rotate"),
        ("cube-rotate-y", "cube-rotate-negative-axis"),
        ("sphere-facing", "sphere-mirrored-x"),
        ("rectangle-facing", "rectangle-facing-flipped"),
        ("fov-axis-x-32x16", "fov-axis-y-32x16"),
        ("spot-default", "spot-beam"),
        ("hide-emitters", "show-emitters"),
        ("metal-front", "mirror-front"),
        ("principal-point-x", "focal-length"),
        ("spectrum-of-light-uniform", "spectrum-of-light"),
    ],
)
def test_different_scenes_are_told_apart(oneray: Path, tmp_path: Path, one: str, other: str) -> None:
    with pytest.raises(AssertionError):
        assert_same(*by_oneray(oneray, tmp_path, CASES[one]), by_mitsuba(CASES[other]))
