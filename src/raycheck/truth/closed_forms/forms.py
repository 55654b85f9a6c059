"""Exact images of the scenes whose light can be written down.

Each formula is evaluated in double precision from the numbers in the scene file and averaged over each
pixel's square on the film, which is what a box filter does. Pixels that hold an edge (two surfaces, or a
light's rim), or where a formula does not hold, are NaN. Where finite, the values are accurate to 1e-9 of
a pixel and outrank every rendered reference.
"""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from raycheck.base.arrays import Array
from raycheck.scene.reader import Scene, read_scene
from raycheck.truth.closed_forms.furnace import furnace
from raycheck.truth.closed_forms.glass import glass_pane, mixed_material, mixed_material_lines
from raycheck.truth.closed_forms.lamp_grid import lamp_grid
from raycheck.truth.closed_forms.lamps import flat_and_round_lights, point_light
from raycheck.truth.closed_forms.mirrors import metal, mirror_corridor, mirror_light
from raycheck.truth.closed_forms.outdoors import open_sky, sun_and_spot
from raycheck.truth.closed_forms.pixel_quadrature import Radiance, pixel_means
from raycheck.truth.closed_forms.plastic import plastic
from raycheck.truth.closed_forms.rough import rough_metal
from raycheck.truth.closed_forms.solids import edges, in_view, kinks, with_faces


def evaluate(name: str, path: Path, parameters: Mapping[str, str]) -> Array | None:
    """Exact pixel means (H, W, 3) of the canonical scene `name`, W·sr⁻¹·m⁻²; None if it has no closed form.

    Raises ValueError for a parameter that the scene does not have.
    """
    scene = with_faces(read_scene(path, parameters))
    seen_plainly = scene.camera.filter.is_pixel and scene.camera.is_pinhole and scene.sky_map is None
    form = FORMS.get(name) if seen_plainly else None
    radiance = form(scene) if form else None
    if radiance is None:
        return None
    camera, border = scene.camera, BORDERS.get(name, 1)
    if form is mixed_material:
        return pixel_means(camera, radiance, np.zeros((0, 3)), mixed_material_lines(scene))
    if form is lamp_grid:
        return pixel_means(camera, radiance, edges(in_view(scene)), np.zeros((0, 3)))
    return pixel_means(camera, radiance, edges(scene), kinks(scene), border)


RECTANGLES_AND_BALLS = (
    "area-light", "spherical-light", "sphere-light-near", "sphere-light-far", "light-below-horizon",
    "occluded-lights", "hidden-light", "checkerboard", "touching-light", "many-lights", "shaded-lamp", "crop",
)  # fmt: skip
FORMS: dict[str, Callable[[Scene], Radiance | None]] = {
    **dict.fromkeys(RECTANGLES_AND_BALLS, flat_and_round_lights),
    "point-light": point_light, "thousand-lights": lamp_grid, "sun-and-spot": sun_and_spot,
    "open-sky": open_sky, **dict.fromkeys(("inside-light", "furnace", "integrating-sphere"), furnace),
    "mirror-light": mirror_light, "mirror-corridor": mirror_corridor, "metal": metal,
    "glass-pane": glass_pane, "mixed-material": mixed_material, "rough-metal": rough_metal,
    "brushed-metal": rough_metal, "plastic": plastic,
}  # fmt: skip

BORDERS = {"mirror-corridor": 64, "glass-pane": 64, "metal": 64, "sun-and-spot": 64, "plastic": 64}
"""Scenes with edges that only looking finds: steps along a pixel's side."""
