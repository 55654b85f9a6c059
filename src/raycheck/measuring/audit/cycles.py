"""Blender Cycles: the checks of its materials, lights, volume and defaults, by the module bpy on one thread."""

from raycheck.measuring.audit import forms
from raycheck.measuring.audit.check import Check, colours

START = """import bpy
from mathutils import Vector

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


def scene(*parts: str, sky: float = 0, scale: float = 0.1, height: float = 0.5, defaults: bool = False) -> str:
    """A program; without `defaults`, paths have no limit of length, and nothing is clamped or blurred."""
    start = START.replace("{sky}", str(sky)).replace("{scale}", str(scale)).replace("{height}", str(height))
    return start + ("" if defaults else UNLIMITED) + "".join(parts)


PLANE = "bpy.ops.mesh.primitive_plane_add(size=2)\n"


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
