"""Blender Cycles: the checks of its materials, lights, volume and defaults, by the module bpy."""

from math import pi

from raycheck.measuring.audit import forms
from raycheck.measuring.audit.check import Check, colours
from raycheck.measuring.audit.truths import (
    BLEND,
    BLENDED,
    CLEAR_GLASS,
    FURNACE,
    HALF_SPACE,
    LAMP_ABOVE,
    ROUGH_MIRROR,
    SKY_ON_MATTE,
    SUN_BALL,
    exactly,
    one,
)

START = """import bpy

bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.engine = "CYCLES"
scene.render.threads_mode, scene.render.threads = "FIXED", 1
scene.render.resolution_x = scene.render.resolution_y = 8
cycles = scene.cycles
cycles.use_adaptive_sampling = cycles.use_denoising = False
cycles.pixel_filter_type = "BOX"
world = scene.world = bpy.data.worlds.new("world")
world.use_nodes = True
world.node_tree.nodes["Background"].inputs["Color"].default_value = ({sky}, {sky}, {sky}, 1)
camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
camera.data.type, camera.data.ortho_scale = "ORTHO", {scale}
camera.data.clip_start, camera.data.clip_end = 0.001, 10000
camera.location = (0, 0, {height})
scene.collection.objects.link(camera)
scene.camera = camera

def material(name, kind, **inputs):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes = made.node_tree.nodes
    nodes.clear()
    node = nodes.new(kind)
    for key, value in inputs.items():
        node.inputs[key.replace("_", " ")].default_value = value
    made.node_tree.links.new(node.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    return made, node

def give(made):
    bpy.context.object.data.materials.append(made)
"""
UNLIMITED = """cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = 1024
cycles.transmission_bounces = cycles.volume_bounces = cycles.transparent_max_bounces = 1024
cycles.sample_clamp_indirect = cycles.blur_glossy = 0
"""


def scene(
    *parts: str, sky: float = 0, scale: float = 0.1, height: float = 0.5, defaults: bool = False
) -> str:
    """A program; without `defaults`, paths have no limit of length, and nothing is clamped or blurred."""
    start = START.replace("{sky}", str(sky)).replace("{scale}", str(scale)).replace("{height}", str(height))
    return start + ("" if defaults else UNLIMITED) + "".join(parts)


PLANE = "bpy.ops.mesh.primitive_plane_add(size=2, location=(0.3, -0.2, 0))\n"
"""Its diagonal, where two triangles meet, is not in the picture."""


def room(albedo: float) -> str:
    """Closed, a cube that glows with 1 − albedo within."""
    return f"""bpy.ops.mesh.primitive_cube_add(size=2)
made, node = material("wall", "ShaderNodeBsdfDiffuse", Color=({albedo}, {albedo}, {albedo}, 1))
tree = made.node_tree
glow, both = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeAddShader")
glow.inputs["Strength"].default_value = {round(1 - albedo, 6)}
tree.links.new(node.outputs[0], both.inputs[0])
tree.links.new(glow.outputs[0], both.inputs[1])
tree.links.new(both.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
give(made)
"""


def surface(kind: str, more: str = "", **inputs: object) -> str:
    said = "".join(f", {name}={value!r}" for name, value in inputs.items())
    return f'made, node = material("surface", "{kind}"{said})\n{more}give(made)\n'


def grey(value: float) -> tuple[float, float, float, int]:
    return (value, value, value, 1)


def matte(value: float) -> str:
    return surface("ShaderNodeBsdfDiffuse", Color=grey(value))


def anisotropic(roughness: float, distribution: str) -> str:
    return surface(
        "ShaderNodeBsdfAnisotropic", f'node.distribution = '
        f'"{distribution}"\n', Color=grey(1), Roughness=roughness
    )


MIRROR_AND_MATTE = """made, node = material("surface", "ShaderNodeBsdfDiffuse", Color=(0.2, 0.6, 0.9, 1))
tree = made.node_tree
mirror, mix = tree.nodes.new("ShaderNodeBsdfAnisotropic"), tree.nodes.new("ShaderNodeMixShader")
mirror.inputs["Color"].default_value = (1, 1, 1, 1)
mirror.inputs["Roughness"].default_value = 0
mix.inputs[0].default_value = 0.3
tree.links.new(node.outputs[0], mix.inputs[1])
tree.links.new(mirror.outputs[0], mix.inputs[2])
tree.links.new(mix.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
give(made)
"""


def glass_ball(roughness: float, distribution: str) -> str:
    ball = "bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32)\nbpy.ops.object.shade_smooth()\n"
    more = f'node.distribution = "{distribution}"\n'
    return ball + surface("ShaderNodeBsdfGlass", more, Color=grey(1), Roughness=roughness, IOR=1.5)


def lamp(kind: str, height: float, **settings: object) -> str:
    said = "".join(f"data.{name} = {value!r}\n" for name, value in settings.items())
    return f"""data = bpy.data.lights.new("lamp", "{kind}")
{said}lamp = bpy.data.objects.new("lamp", data)
lamp.location = (0, 0, {height})
scene.collection.objects.link(lamp)
"""


FOG = """bpy.ops.mesh.primitive_cube_add(size=1000, location=(0, 0, -500))
made = bpy.data.materials.new("fog")
made.use_nodes = True
tree = made.node_tree
tree.nodes.clear()
out, both = tree.nodes.new("ShaderNodeOutputMaterial"), tree.nodes.new("ShaderNodeAddShader")
scatter, absorb = tree.nodes.new("ShaderNodeVolumeScatter"), tree.nodes.new("ShaderNodeVolumeAbsorption")
scatter.inputs["Color"].default_value, scatter.inputs["Density"].default_value = (1, 1, 1, 1), 3.6
absorb.inputs["Color"].default_value, absorb.inputs["Density"].default_value = (0, 0, 0, 1), 0.4
tree.links.new(scatter.outputs[0], both.inputs[0])
tree.links.new(absorb.outputs[0], both.inputs[1])
tree.links.new(both.outputs[0], out.inputs["Volume"])
give(made)
"""

CHECKS = (
    Check(
        "cycles-matte", "cycles", "Diffuse BSDF under a constant world",
        scene(PLANE, surface("ShaderNodeBsdfDiffuse", Color=(0.2, 0.6, 0.9, 1)), sky=1), 256,
        lambda: (0.6,), SKY_ON_MATTE,
    ),
    *(Check(
        f"cycles-furnace-{albedo}", "cycles", f"roulette in a closed room of albedo {albedo}, paths without "
        f"limit",
        scene(room(albedo)), 1024, one, FURNACE, within=1e-2,
    ) for albedo in (0.5, 0.9)),
    Check(
        "cycles-defaults", "cycles",
        "with Blender's defaults a closed white room of albedo 0.9 is less than half as bright as it is",
        scene(room(0.9), defaults=True), 256, one, FURNACE,
        documented="Blender's manual, Render › Light Paths: Max Bounces, diffuse 4 by default, ends paths; "
        "the value is "
        "1 − .9⁶ = .46856, the light of up to five bounces",
        report="the manual says that too few bounces darken",
    ),
    Check(
        "cycles-lamp", "cycles", "a square area lamp above a matte floor",
        scene(PLANE, matte(0.5), lamp("AREA", 1, shape="SQUARE", size=1.0, energy=pi), scale=0.002), 1024,
        exactly(forms.square_above, 1, 1, times=0.5),
        LAMP_ABOVE + " Power P over π and the area is the lamp's "
        "radiance.",
    ),
    Check(
        "cycles-sun", "cycles", "a sun lamp of the sun's size above a floor",
        scene(PLANE, matte(1), lamp("SUN", 1, angle=0.0093, energy=pi), scale=0.002), 1024, one,
        "A sun of strength E gives irradiance E across the beam (Blender's manual); E = π on white matte is "
        "radiance 1.",
    ),
    Check(
        "cycles-sun-ball", "cycles", "a point lamp with the radius and distance of the sun above a floor",
        scene(
            PLANE, matte(1), lamp("POINT", 100, shadow_soft_size=0.465, energy=4 * pi**2 * 100.0**2),
            scale=0.002,
        ), 1024, one, SUN_BALL + " Power P is 4π² r² L.",
    ),
    Check(
        "cycles-blend-of-mirror", "cycles", "Mix Shader of a matte surface and a mirror",
        scene(PLANE, MIRROR_AND_MATTE, sky=1), 1024,
        lambda: BLENDED, BLEND, names=("red", "green", "blue"), measure=colours,
    ),
    *(Check(
        f"cycles-rough-mirror-{alpha}", "cycles", f"Glossy BSDF, GGX, roughness² = α = {alpha}, under a "
        f"constant world",
        scene(PLANE, anisotropic(alpha**0.5, "GGX"), sky=1), 1024,
        exactly(forms.rough_mirror, alpha), ROUGH_MIRROR,
    ) for alpha in (0.5, 1.0)),
    Check(
        "cycles-multiscatter-mirror", "cycles", "Glossy BSDF, multiscatter GGX, α = 1: white keeps all light",
        scene(PLANE, anisotropic(1.0, "MULTI_GGX"), sky=1), 1024, one,
        "A white mirror of many scatterings absorbs nothing, so under a sky of 1 it is 1 (Blender's manual: "
        "no energy is lost).",
    ),
    Check(
        "cycles-glass", "cycles", "a ball of clear glass under a constant world",
        scene(glass_ball(0, "GGX"), sky=1, height=5), 256, one, CLEAR_GLASS,
    ),
    Check(
        "cycles-multiscatter-glass", "cycles",
        "Glass BSDF, multiscatter GGX, roughness 0.7: a ball of clear glass loses about a hundredth of the "
        "light",
        scene(glass_ball(0.7, "MULTI_GGX"), sky=1, height=5), 1024, one, CLEAR_GLASS,
        documented="Blender's manual says of Multiscatter GGX that it takes multiple scattering into account "
        "by tables; "
        "it does not promise all energy for glass",
    ),
    Check(
        "cycles-principled", "cycles", "Principled BSDF, white, roughness 0.5, under a constant world",
        scene(PLANE, surface("ShaderNodeBsdfPrincipled", Base_Color=grey(1), Roughness=0.5), sky=1), 1024,
        one,
        "A white lossless surface under a sky of 1 is 1; the Principled BSDF keeps energy (Blender's "
        "manual).",
    ),
    Check(
        "cycles-half-space", "cycles", "a half space of fog under a constant world",
        scene(FOG, sky=1, scale=0.02), 1024, exactly(forms.half_space, 0.9), HALF_SPACE,
        within=1e-2,
    ),
)  # fmt: skip
