"""Blender Cycles by the module bpy: the scene is a program that builds it; samples and seed are set here."""

import json
import os
import sys
import tempfile


def main() -> None:
    job = json.load(sys.stdin)
    import bpy
    import numpy as np

    exec(job["scene"], {})
    scene = bpy.context.scene
    scene.cycles.samples = job["samples"]
    image = scene.render.image_settings
    image.file_format, image.color_depth = "OPEN_EXR", "32"
    pictures = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in job["seeds"]:
            scene.cycles.seed = seed
            scene.render.filepath = f"{folder}/{seed}.exr"
            bpy.ops.render.render(write_still=True)
            read = bpy.data.images.load(scene.render.filepath)
            read.colorspace_settings.name = "Non-Color"
            width, height = read.size
            pixels = np.array(read.pixels[:]).reshape(height, width, -1)[::-1, :, :3]
            pictures.append(pixels.tolist())
            bpy.data.images.remove(read)
    print("\n" + json.dumps({"version": bpy.app.version_string, "pictures": pictures}), flush=True)
    os._exit(0)


if __name__ == "__main__":
    main()
