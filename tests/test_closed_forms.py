"""oneray against closed forms, which outrank every other renderer; and the formulas against integrals."""

from __future__ import annotations

import dataclasses
import math
import subprocess
from pathlib import Path

import numpy as np
import pytest

from raycheck.base.images import load_image
from raycheck.scene import meshes
from raycheck.scene.content import read_content
from raycheck.scene.materials import Material
from raycheck.scene.reader import Shape
from raycheck.scene.techniques import TECHNIQUES, applicable, technique
from raycheck.stats.tiles import quad_tree, region_means, region_variances, whole
from raycheck.truth.closed_forms import forms, furnace, lamp_grid, mirrors, solids
from raycheck.truth.closed_forms.glass import _glass_reflectance, glass_pane
from raycheck.truth.references import closed_form

FURNACE = ["walk-uniform", "walk-cosine", "nee", "mis-power", "mis-balance", "nee-no-roulette"]
WALKED = ["inside-light", "mixed-material", "open-sky", "light-below-horizon", "mirror-corridor"]
CASES = [
    *[("point-light", name) for name in ("nee", "mis-power")],
    *[("furnace", name) for name in FURNACE],
    *[(name, "mis-power") for name in sorted(forms.FORMS) if name not in ("point-light", "furnace")],
    *[(name, "walk-cosine") for name in WALKED],
]


def deviations(
    oneray: Path, scene: Path, name: str, folder: Path, spp: int, factor: float = 1.0
) -> np.ndarray:
    """(regions, 3) standard errors by which oneray's image and tiles are off `factor` times the closed form.

    Pixels that hold an edge have no closed form and are left out. What does not vary within a pixel at all is
    held to 1e-6 of its value.
    """
    options = [*technique(name).options, "--spp", str(spp), "--seed", "20"]
    subprocess.run([oneray, scene, "-o", folder / "out.exr", *options], check=True)
    image, exact = load_image(folder / "out.exr"), closed_form(scene.stem, {}) * factor
    known = np.isfinite(exact)
    assert known.mean() > (0.7 if scene.stem in forms.BORDERS else 0.9)
    residual = np.where(known, image.pixels - exact, 0.0)
    variance = np.where(known, np.maximum(image.stderr, 1e-6 * np.abs(image.pixels)) ** 2, 0.0)
    height, width = residual.shape[:2]
    regions = [whole(height, width), *quad_tree(height, width, {}, spp)]
    error = np.sqrt(region_variances(variance, regions))
    return region_means(residual, regions) / np.where(error > 0, error, np.inf)


@pytest.mark.parametrize(("name", "technique_name"), CASES)
def test_within_five_standard_errors(
    oneray: Path, scene, tmp_path: Path, name: str, technique_name: str
) -> None:
    """Image and 8×8 tiles: at most 195 numbers, so that a right renderer is beyond 5 once in 9,000 runs."""
    found = deviations(oneray, scene(name), technique_name, tmp_path, 1024)
    assert np.abs(found).max() < 5


def test_the_check_can_fail(oneray: Path, scene, tmp_path: Path) -> None:
    """An answer that is 1 % off is seen in the furnace, and one of 0.1 % at the point light."""
    assert np.abs(deviations(oneray, scene("furnace"), "mis-power", tmp_path, 1024, 1.01)).max() > 5
    assert np.abs(deviations(oneray, scene("point-light"), "nee", tmp_path, 1024, 1.001)).max() > 5


def test_unlimited_depth(oneray: Path, scene, tmp_path: Path) -> None:
    """The furnace without depth limit: only roulette ends paths, and the sum of all bounces is right."""
    output = tmp_path / "out.exr"
    subprocess.run(
        [oneray, scene("furnace"), "-Ddepth=-1", "-o", output, "--spp", "1024", "--seed", "4"], check=True
    )
    image, exact = load_image(output), closed_form("furnace", {"depth": "-1"})
    known = np.isfinite(exact)
    off = np.where(known, image.pixels - exact, 0).sum(axis=(0, 1))
    assert (np.abs(off) < 5 * np.sqrt(np.where(known, image.stderr**2, 0).sum(axis=(0, 1)))).all()


def test_techniques_named_here_apply(scene) -> None:
    names = {t.name for t in TECHNIQUES}
    for name, chosen in CASES:
        assert chosen in names
        assert technique(chosen) in applicable(read_content(scene(name)))


# ---- formulas against integrals and against each other ----


def turned(kind: str, size: float, place: tuple[float, float, float]) -> Shape:
    to_world = np.diag([size, size, size, 1.0])
    to_world[:3, 3] = place
    return Shape(kind, to_world, False, Material("diffuse", np.zeros(3)), np.ones(3))


@pytest.mark.parametrize("height", [1.5, 0.5, 0.2, 0.0, -0.3, -0.49, -0.6])
def test_a_ball_is_cut_off_at_the_horizon(height: float) -> None:
    """Midpoint rule over 4 million directions of the cone that a ball fills, less those below the horizon."""
    ball = solids.Ball(turned("sphere", 0.5, (1.2, 0.0, height)))
    d = math.hypot(1.2, height)
    steps = (np.arange(2000) + 0.5) / 2000
    extent = 1 - math.sqrt(1 - (0.5 / d) ** 2)
    cosine = 1 - extent * steps[:, None]
    sine = np.sqrt(1 - cosine**2)
    up = cosine * height / d + sine * np.cos(2 * math.pi * steps) * 1.2 / d
    expected = 2 * math.pi * extent * np.maximum(up, 0).mean()
    found = solids.ball_solid_angle(np.zeros((1, 3)), np.array([[0.0, 0, 1]]), ball)[0]
    assert found == pytest.approx(expected, rel=1e-5, abs=1e-7)


def test_a_rectangle_is_cut_off_at_the_horizon() -> None:
    """The part above, by itself, is what the cut one counts for; a wholly sunken one counts nothing."""
    p, n = np.zeros((1, 3)), np.array([[0.0, 0, 1]])
    corners = np.array([[1.0, -1, -1], [1, 1, -1], [1, 1, 2], [1, -1, 2]])
    above = np.array([[1.0, -1, 0], [1, 1, 0], [1, 1, 2], [1, -1, 2]])
    found = solids.above_horizon(p, n, corners)
    assert found == pytest.approx(solids.projected_solid_angle(p, n, above), rel=1e-12)
    assert solids.above_horizon(p, n, corners - [0, 0, 3]) == 0


def test_shadows_that_overlap_are_not_counted_twice() -> None:
    """Three plates in a row hide as much as the one that contains the shadows of the others."""
    light = solids.Plate(turned("rectangle", 1.0, (0, 0, 2)))
    flipped = light.shape.to_world @ np.diag([1.0, -1, -1, 1])
    light = solids.Plate(Shape("rectangle", flipped, False, light.shape.material, np.ones(3)))
    plates = [turned("rectangle", size, (0.1, 0.2, z)) for size, z in ((0.4, 1.0), (0.3, 1.1), (0.1, 0.9))]
    p, n = np.array([[0.3, -0.1, 0]]), np.array([[0.0, 0, 1]])
    one = solids.visible_solid_angle(p, n, light, plates[:1])
    assert solids.visible_solid_angle(p, n, light, plates) == pytest.approx(one, rel=1e-12)
    assert one < solids.visible_solid_angle(p, n, light, [])


def test_the_thousand_lights_are_a_sum_of_lamberts_formula(scene) -> None:
    """One point of the floor, lamp by lamp, by another formula for the same."""
    content = forms.read_scene(scene("thousand-lights"), {})
    lamps = [solids.Plate(shape) for shape in content.shapes if shape.emits]
    assert len(lamps) == 1000
    d = content.camera.directions(np.array([11.3]), np.array([20.1]))
    radiance = lamp_grid.lamp_grid(content)
    assert radiance is not None
    _, distance, value = radiance(content.camera.origin[None], d)
    p, n = content.camera.origin + distance[:, None] * d, np.array([[0.0, 0, 1]])
    light = sum(solids.projected_solid_angle(p, n, lamp.corners)[0] * lamp.shape.radiance for lamp in lamps)
    assert value[0] == pytest.approx(0.8 / math.pi * light, rel=1e-9)


def test_fresnels_formulas_at_normal_incidence_and_beyond_the_critical_angle() -> None:
    one = np.ones(1)
    assert _glass_reflectance(one, one, 1 / 1.5) == pytest.approx(0.04)
    assert _glass_reflectance(one, one, 1.5) == pytest.approx(0.04)
    assert _glass_reflectance(one * 0.1, one * 0, 1.5) == 1
    gold = Material("conductor", np.ones(3), np.full(3, 0.143), np.full(3, 3.983))
    expected = ((0.143 - 1) ** 2 + 3.983**2) / ((0.143 + 1) ** 2 + 3.983**2)
    assert mirrors.reflectance_of(gold, one)[0] == pytest.approx([expected] * 3)
    glass = Material("conductor", np.ones(3), np.full(3, 1.5), np.zeros(3))
    inside = np.sqrt(1 - (1 - 0.3**2) / 1.5**2)
    dielectric = _glass_reflectance(one * 0.3, one * inside, 1 / 1.5)
    assert mirrors.reflectance_of(glass, one * 0.3)[0] == pytest.approx(np.repeat(dielectric, 3))


def test_a_pane_transmits_what_the_sum_of_its_reflections_says(scene) -> None:
    """Where all paths see one stripe: (1 − R)/(1 + R) with R at that angle, for unlimited depth."""
    content = solids.with_faces(forms.read_scene(scene("glass-pane"), {"depth": "-1"}))
    radiance = glass_pane(content)
    front = solids.Plate(content.shapes[3])
    towards = front.origin - np.array([0.3, 0, 0]) - content.camera.origin
    d = towards[None] / np.linalg.norm(towards)
    cosine = np.array([-(d[0] @ front.normal)])
    r = _glass_reflectance(cosine, np.sqrt(1 - (1 - cosine**2) / 2.25), 1 / 1.5)[0]
    assert radiance is not None
    value = radiance(content.camera.origin[None], d)[2][0]
    assert 0.04 < r < 0.1
    assert value == pytest.approx(np.array([1.7, 1.6, 1.4]) * (1 - r) / (1 + r), rel=1e-6)


def test_inside_a_light_alone_radiance_is_a_geometric_series(scene) -> None:
    """With a ball that reflects and glows as the wall does, both show L Σ ρᵏ."""
    content = forms.read_scene(scene("inside-light"), {"depth": "5"})
    wall = content.shapes[0]
    ball = dataclasses.replace(content.shapes[1], material=wall.material, radiance=wall.radiance)
    radiance = furnace.furnace(dataclasses.replace(content, shapes=(wall, ball)))
    assert radiance is not None
    expected = sum(wall.radiance * wall.material.reflectance**k for k in range(5))
    for way in ([0.0, 1, 0], [0, 0, 1.0]):
        assert radiance(content.camera.origin[None], np.array([way]))[2][0] == pytest.approx(expected)


def test_a_mesh_that_fills_a_rectangle_is_one(scene, tmp_path: Path) -> None:
    """Triangle by triangle it is seen under the same angle; one with a gap stays a mesh."""
    content = forms.read_scene(scene("shaded-lamp"), {})
    [lamp] = [shape for shape in content.shapes if shape.emits]
    [filled] = [shape for shape in solids.with_faces(content).shapes if shape.emits]
    assert (lamp.kind, filled.kind) == ("ply", "rectangle")
    mesh = meshes.read_mesh(lamp.mesh, "ply")
    corners = np.einsum("ij,fkj->fki", lamp.to_world[:3, :3], mesh.vertices[mesh.faces])
    p, n = np.array([[0.3, -0.7, 0], [1.1, 0.2, 0.4]]), np.array([[0.0, 0, 1], [0, 0, 1]])
    parts = [solids.projected_solid_angle(p, n, three + lamp.to_world[:3, 3]) for three in corners]
    whole_lamp = solids.projected_solid_angle(p, n, solids.Plate(filled).corners)
    assert len(parts) == 12 and sum(parts) == pytest.approx(whole_lamp, rel=1e-12)
    assert (p - solids.Plate(filled).origin) @ solids.Plate(filled).normal == pytest.approx([1.5, 1.1])
    text = lamp.mesh.read_text().replace("face 12", "face 11")
    (tmp_path / "gap.ply").write_text(text.rstrip().rpartition("\n")[0] + "\n")
    gap = dataclasses.replace(lamp, mesh=tmp_path / "gap.ply")
    assert solids.with_faces(dataclasses.replace(content, shapes=(gap,))).shapes == (gap,)


@pytest.mark.parametrize("name", ["shaded-lamp", "integrating-sphere"])
def test_what_is_two_sided_looks_the_same_when_it_is_turned_round(scene, name: str) -> None:
    """The wall of the shaded lamp and the ball around the eye: as one-sided ones that face it."""
    content = solids.with_faces(forms.read_scene(scene(name), {}))
    back = next(i for i, shape in enumerate(content.shapes) if shape.material.two_sided)
    camera = content.camera
    d = camera.directions(np.array([0.3, 0.5, 0.9]) * camera.width, np.full(3, 0.4 * camera.height))

    def shown(flipped: bool, two_sided: bool) -> np.ndarray | None:
        """Radiance in a few directions, some of which show the surface."""
        shapes = list(content.shapes)
        material = dataclasses.replace(shapes[back].material, two_sided=two_sided)
        shapes[back] = dataclasses.replace(shapes[back], material=material, flipped=flipped)
        radiance = forms.FORMS[name](dataclasses.replace(content, shapes=tuple(shapes)))
        return radiance and radiance(np.broadcast_to(camera.origin, d.shape), d)[2]

    as_it_is = shown(flipped=False, two_sided=True)
    assert as_it_is is not None and (as_it_is > 0).any()
    np.testing.assert_allclose(shown(flipped=True, two_sided=False), as_it_is, rtol=1e-12)
    black = shown(flipped=False, two_sided=False)
    assert black is None or not black.any()
