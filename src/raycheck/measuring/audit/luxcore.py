"""LuxCore: the checks of its path tracer PATHCPU, by the module pyluxcore and its scene language.

Each picture takes a second at least, so that one high picture is divided into 32: its samples are independent
of each other, as those of different seeds are.
"""

from math import radians

import numpy as np

from raycheck.base.arrays import Array
from raycheck.measuring.audit import forms
from raycheck.measuring.audit.check import Check, colours
from raycheck.measuring.audit.truths import (
    BLEND,
    BLENDED,
    CLEAR_GLASS,
    ENERGY,
    FURNACE,
    HALF_SPACE,
    LAMP_ABOVE,
    SKY_ON_MATTE,
    exactly,
    one,
)


def scene(
    *parts: str, scale: float = 0.1, height: float = 0.5, depth: int = 64, roulette: bool = True
) -> str:
    """Configuration and an orthographic camera that looks straight down on the origin."""
    rest = "" if roulette else "path.russianroulette.depth = 1000\n"
    kinds = ("total", "diffuse", "glossy", "specular")
    depths = "".join(f"path.pathdepth.{kind} = {depth}\n" for kind in kinds)
    return f"""renderengine.type = "PATHCPU"
sampler.type = "RANDOM"
native.threads.count = 1
film.width = 8
film.height = 256
film.filter.type = "NONE"
film.outputs.0.type = "RGB"
film.outputs.0.filename = "picture.exr"
{depths}{rest}scene.camera.type = "orthographic"
scene.camera.lookat.orig = 0 0 {height}
scene.camera.lookat.target = 0 0 0
scene.camera.up = 0 1 0
scene.camera.screenwindow = -{scale} {scale} -{scale} {scale}
scene.camera.cliphither = 0.001
scene.camera.clipyon = 100000
""" + "".join(parts)


SKY = 'scene.lights.sky.type = "constantinfinite"\nscene.lights.sky.color = 1 1 1\n'


def material(name: str, **said: str) -> str:
    return "".join(f"scene.materials.{name}.{key} = {value}\n" for key, value in said.items())


def mesh(name: str, vertices: Array, faces: Array) -> str:
    points, corners = (" ".join(f"{x:g}" for x in np.ravel(a)) for a in (vertices, faces))
    return f"""scene.shapes.{name}.type = "inlinedmesh"
scene.shapes.{name}.vertices = {points}
scene.shapes.{name}.faces = {corners}
scene.objects.{name}.shape = "{name}"
scene.objects.{name}.material = "{name}"
"""


def square(name: str, half: float, height: float, up: bool, shift: tuple[float, float] = (0, 0)) -> str:
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half + np.array(shift)
    faces = np.array([(0, 1, 2), (0, 2, 3)])
    return mesh(name, np.column_stack([corners, np.full(4, height)]), faces if up else faces[:, ::-1])


FLOOR = square("floor", 1, 0, True, (0.3, -0.2))
"""Its diagonal, where two triangles meet, is not in the picture."""


def cube(name: str, half: float, centre: float = 0.0, inwards: bool = True) -> str:
    points = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    outwards = np.array([face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))])
    return mesh(name, points + np.array([0, 0, centre]), outwards[:, ::-1] if inwards else outwards)


def room(albedo: float) -> str:
    """Closed, that glows with 1 − albedo within."""
    reflects, glows = " ".join([f"{albedo:g}"] * 3), " ".join([f"{1 - albedo:g}"] * 3)
    return cube("room", 1) + material("room", type='"matte"', kd=reflects, emission=glows)


LAMP = square("lamp", 0.5, 1, False) + material("lamp", type='"matte"', kd="0 0 0", emission="1 1 1")
MIRROR_AND_MATTE = (
    material("matte", type='"matte"', kd="0.2 0.6 0.9")
    + material("mirror", type='"mirror"', kr="1 1 1")
    + material("floor", type='"mix"', material1='"matte"', material2='"mirror"', amount="0.3")
)
FOG = (
    """scene.volumes.medium.type = "homogeneous"
scene.volumes.medium.absorption = 0.4 0.4 0.4
scene.volumes.medium.scattering = 3.6 3.6 3.6
scene.volumes.medium.asymmetry = 0 0 0
scene.volumes.medium.multiscattering = 1
"""
    + cube("fog", 500, -500, inwards=False)
    + material("fog", type='"null"', **{"volume.interior": '"medium"'})
)
ROULETTE = (
    "pathtracer.cpp: DirectLightSampling multiplies the density of the material by the probability of "
    "surviving roulette "
    "before the heuristic weighs both strategies; DirectHitFiniteLight and DirectHitInfiniteLight, which "
    "weigh the other "
    "one, take it without. The two weights of one path then sum to more than 1, from "
    "path.russianroulette.depth on. Both "
    "have to have it, or neither. Without roulette the closed room is right."
)
NONE_FOUND = "none found in the project's issues"


def oren_nayar(degrees: float) -> float:
    """Reflectance of a white rough matte surface seen straight on: A = 1 − ½ σ²/(σ² + .33)."""
    square_of = radians(degrees) ** 2
    return float(1 - 0.5 * square_of / (square_of + 0.33))


CHECKS = (
    Check(
        "luxcore-matte", "luxcore", "matte under a constant sky",
        scene(SKY, FLOOR, material("floor", type='"matte"', kd="0.2 0.6 0.9")), 1024,
        lambda: (0.6,), SKY_ON_MATTE,
    ),
    *(Check(
        f"luxcore-furnace-{albedo}", "luxcore",
        f"roulette (the default, from the third bounce) makes a closed room of albedo {albedo} too bright",
        scene(room(albedo), depth=1024), 128, one, FURNACE, within=1e-2, act=ROULETTE, report=NONE_FOUND,
    ) for albedo in (0.5, 0.9)),
    Check(
        "luxcore-furnace-no-roulette", "luxcore", "a closed room of albedo 0.5 without roulette",
        scene(room(0.5), depth=24, roulette=False), 128, one, FURNACE, within=1e-2,
    ),
    Check(
        "luxcore-lamp", "luxcore", "a glowing square above a matte floor",
        scene(LAMP, FLOOR, material("floor", type='"matte"', kd="0.5 0.5 0.5"), scale=0.001), 1024,
        exactly(forms.square_above, 1, 1, times=0.5), LAMP_ABOVE, within=4e-3,
    ),
    Check(
        "luxcore-blend-of-mirror", "luxcore", "mix of a matte surface and a mirror",
        scene(SKY, FLOOR, MIRROR_AND_MATTE), 1024,
        lambda: BLENDED, BLEND, names=("red", "green", "blue"), measure=colours, within=4e-3,
    ),
    Check(
        "luxcore-rough-matte", "luxcore", "roughmatte of σ = 20°, seen straight on",
        scene(SKY, FLOOR, material("floor", type='"roughmatte"', kd="1 1 1", sigma=f"{radians(20):.9g}")),
        1024,
        exactly(oren_nayar, 20),
        "Oren and Nayar's A = 1 − ½ σ²/(σ² + .33) is the reflectance of a white surface seen straight on, "
        "where the other "
        "term has factor 0; σ is in radians here.", within=4e-3,
    ),
    Check(
        "luxcore-thin-glass", "luxcore", "archglass, white, sends on 4 % more light than comes in",
        scene(
            SKY, FLOOR, material("floor", type='"archglass"', kr="1 1 1", kt="1 1 1", interiorior="1.5"),
            height=5,
        ),
        1024, one, ENERGY,
        act="Reflection has Fresnel's share F = .04, transmission all of kt instead of (1 − F) kt, or of (1 "
        "− F)² / (1 − F²) "
        "for both interfaces.",
        report=NONE_FOUND,
    ),
    Check(
        "luxcore-glass", "luxcore", "a cube of clear glass under a constant sky",
        scene(
            SKY, cube("glass", 1, inwards=False),
            material("glass", type='"glass"', kr="1 1 1", kt="1 1 1", interiorior="1.5"), height=5,
        ), 1024, one, CLEAR_GLASS, within=1e-2,
    ),
    Check(
        "luxcore-half-space", "luxcore",
        "roulette (the default) makes a half space of fog under a constant sky too bright",
        scene(SKY, FOG, scale=0.01, depth=1024), 256, exactly(forms.half_space, 0.9), HALF_SPACE,
        within=1e-2,
        act=ROULETTE, report=NONE_FOUND,
    ),
    Check(
        "luxcore-half-space-no-roulette", "luxcore",
        "a half space of fog without roulette, up to 128 "
        "bounces",
        scene(SKY, FOG, scale=0.01, depth=96, roulette=False), 64, exactly(forms.half_space, 0.9),
        HALF_SPACE, within=2e-2,
        act="Not known; a path that is cut short loses light, so it is none of that. Few samples: take more "
        "before looking further.",
        report=NONE_FOUND,
    ),
)  # fmt: skip
