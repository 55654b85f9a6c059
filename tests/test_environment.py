"""Environments that are pictures: what is seen, the density that it is sampled by, and the light that it
gives, by formulas of their own and by Mitsuba's.
"""

from __future__ import annotations

import subprocess
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest
from sampling import LEVEL, Array, Driver, chi_squared, uniforms

from raycheck.base.images import load_image, write_exr
from raycheck.judging.compare import compare

TURNS = {
    "as it is": "",
    "turned": '<rotate x="0.6" y="0.8" angle="50"/><rotate z="1" angle="-130"/>',
    "mirrored": '<scale x="-1"/><rotate x="1" angle="90"/>',
}


def picture(path: Path, height: int = 9, width: int = 16) -> Array:
    """One with a bright pixel beside black ones."""
    rng = np.random.default_rng(7)
    pixels = rng.random((height, width, 3)) ** 4
    pixels[:, : width // 4] = 0
    pixels[height // 3, 2] = (60, 40, 20)
    save(path, pixels)
    return load_image(path).pixels


def save(path: Path, pixels: Array) -> None:
    write_exr(path, dict(zip("RGB", np.moveaxis(pixels, 2, 0).astype(np.float32), strict=True)))


def emitter(path: Path, turn: str = "", scale: float = 1) -> str:
    return (
        f'<emitter type="envmap"><string name="filename" value="{path}"/>'
        f'<float name="scale" value="{scale}"/><transform name="to_world">{turn}</transform></emitter>'
        '<shape type="rectangle"/>'
    )


def seen(pixels: Array, d: Array) -> Array:
    """(n, 3) for directions (3, n) in the picture's frame."""
    height, width, _ = pixels.shape
    x = np.arctan2(d[0], -d[2]) / (2 * np.pi) * width - 0.5
    y = np.arccos(np.clip(d[1], -1, 1)) / np.pi * (height - 1)
    i, j = np.floor(x).astype(int), np.minimum(np.floor(y).astype(int), height - 2)
    total = np.zeros((d.shape[1], 3))
    for a in (0, 1):
        for b in (0, 1):
            share = np.where(a, x - i, 1 - x + i) * np.where(b, y - j, 1 - y + j)
            total += share[:, None] * pixels[j + b, (i + a) % width]
    return total


def directions(n: int, seed: int) -> Array:
    d = np.random.default_rng(seed).normal(size=(3, n))
    return np.asarray(d / np.linalg.norm(d, axis=0))


def test_the_picture_is_seen(driver: Driver, wide: list[Driver], tmp_path: Path) -> None:
    pixels, d = picture(tmp_path / "sky.exr"), directions(5000, 1)
    d[:, :4] = np.array([[1, 0, 0], [-1, 0, 0], [0, 0, 1], [0, 0, -1]]).T
    for one in (driver, *wide):
        with one.scene(emitter(tmp_path / "sky.exr", scale=2.5)) as scene:
            found = one("sky", d, scene=scene)
        np.testing.assert_allclose(found[:3].T, 2.5 * seen(pixels, d), atol=2e-4, rtol=2e-4)


@pytest.mark.parametrize("turn", TURNS)
def test_it_is_mitsubas(driver: Driver, tmp_path: Path, turn: str) -> None:
    picture(tmp_path / "sky.exr")
    d = directions(300, 2)
    said = emitter(tmp_path / "sky.exr", TURNS[turn], 0.5)
    with driver.scene(said) as scene:
        found = driver("sky", d, scene=scene)[:3].T
    mi.set_variant("scalar_rgb")
    loaded = mi.load_string(f'<scene version="3.0.0">{said}</scene>').environment()
    for way, light in zip(d.T, found, strict=True):
        si = mi.SurfaceInteraction3f()
        si.wi = mi.Vector3f(*(-way).tolist())
        np.testing.assert_allclose(light, np.array(loaded.eval(si)), atol=2e-4, rtol=1e-3)


def cells(pixels: Array, order: int = 8) -> tuple[Array, Array, Array]:
    """Directions (3, n) by Gauss's nodes in each cell between four pixels, their solid angles, which cell."""
    height, width, _ = pixels.shape
    x, w = np.polynomial.legendre.leggauss(order)
    x, w = (x + 1) / 2, w / 2
    j, i, b, a = np.meshgrid(*map(np.arange, (height - 1, width, order, order)), indexing="ij")
    turn = (i + 0.5 + x[a]) / width * 2 * np.pi
    polar = (j + x[b]) / (height - 1) * np.pi
    size = np.sin(polar) * w[a] * w[b] * (2 * np.pi / width) * (np.pi / (height - 1))
    d = np.stack([np.sin(polar) * np.sin(turn), np.cos(polar), -np.sin(polar) * np.cos(turn)])
    return d.reshape(3, -1), size.ravel(), (j * width + i).ravel()


def test_samples_have_the_density_that_is_told(driver: Driver, tmp_path: Path) -> None:
    """It integrates to 1, samples lie by it, and the two sides of multiple importance sampling agree."""
    pixels = picture(tmp_path / "sky.exr")
    height, width, _ = pixels.shape
    at, size, cell = cells(pixels)
    n = 400_000
    with driver.scene(emitter(tmp_path / "sky.exr")) as scene:
        share = np.bincount(cell, size * driver("sky", at, scene=scene)[3])
        receiver = [np.zeros((3, 1)), np.array([[0.0], [0], [1]]), -1, 0]
        found = driver("light_sample", *receiver, uniforms(n, 3), scene=scene)
        told = driver("sky", found[:3], scene=scene)
    assert share.sum() == pytest.approx(1, rel=1e-9)
    x = (np.arctan2(found[0], -found[2]) / (2 * np.pi) * width - 0.5) % width
    y = np.arccos(found[1]) / np.pi * (height - 1)
    counts = np.bincount((y.astype(int) * width + x.astype(int)), minlength=share.size)
    assert chi_squared(counts, n * share) > LEVEL
    assert chi_squared(counts, n * np.roll(share, 1)) < LEVEL
    np.testing.assert_allclose(found[7] * told[3], 1, rtol=1e-9)
    np.testing.assert_allclose(found[4:7], told[:3] * found[7], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("height", [2, 3, 64])
def test_the_light_on_a_floor(driver: Driver, tmp_path: Path, height: int) -> None:
    """∫ L cosθ dω."""
    pixels = picture(tmp_path / "sky.exr", height, 2 * height)
    at, size, _ = cells(pixels, 16 if height % 2 else 512 // height)  # the horizon is within a row
    truth = (seen(pixels, at).T * size * np.maximum(at[1], 0)).sum(axis=1)
    up = np.array([[0.0], [1], [0]])
    with driver.scene(emitter(tmp_path / "sky.exr")) as scene:
        found = driver("light_sample", np.zeros((3, 1)), up, -1, 0, uniforms(1_000_000, 4), scene=scene)
    light = found[4:7] * np.maximum(found[1], 0)
    error = light.std(axis=1) / np.sqrt(light.shape[1])
    assert (np.abs(light.mean(axis=1) - truth) < 5 * error).all() and (error < 3e-3 * truth).all()


@pytest.mark.parametrize("height", [3, 9, 65])
def test_a_sky_that_is_the_cosine(driver: Driver, tmp_path: Path, height: int) -> None:
    """Rows of 3 max(0, cosθ), linear between them: 2π ∫ L cosθ sinθ dθ of a floor, which goes to 2π."""
    rows, step = 3 * np.maximum(np.cos(np.linspace(0, np.pi, height)), 0), np.pi / (height - 1)
    save(tmp_path / "sky.exr", np.broadcast_to(rows[:, None, None], (height, 2 * height, 3)))
    a = step * np.arange(height // 2)
    x, w = np.polynomial.legendre.leggauss(8)
    t = a[:, None] + step * (x + 1) / 2
    between = np.interp(t, step * np.arange(height), rows)
    truth = 2 * np.pi * (w * step / 2 * between * np.sin(t) * np.cos(t)).sum()
    assert truth == pytest.approx(2 * np.pi, rel=1.1 * step**2 / 8 + 1e-6)
    up = np.array([[0.0], [1], [0]])
    with driver.scene(emitter(tmp_path / "sky.exr")) as scene:
        found = driver("light_sample", np.zeros((3, 1)), up, -1, 0, uniforms(400_000, 5), scene=scene)
    light = found[4] * np.maximum(found[1], 0)
    error = light.std() / np.sqrt(light.size)
    assert abs(light.mean() - truth) < 5 * error < 5e-3 * truth


BALL = (
    '<shape type="sphere"><bsdf type="diffuse"/></shape><shape type="rectangle"><transform name="to_world">'
    '<scale value="3"/><rotate x="1" angle="-90"/><translate y="-1"/></transform></shape>'
)
FILM = (
    '<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="3"/></integrator>'
    '<sensor type="perspective"><transform name="to_world">'
    '<lookat origin="0, 2, 6" target="0, 0, 0" up="0, 1, 0"/></transform>'
    '<film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="18"/>'
    '<rfilter type="box"/></film></sensor>{}</scene>'
)


def rendered(oneray: Path, folder: Path, name: str, body: str, *options: str) -> Path:
    scene, image = folder / f"{name}.xml", folder / f"{name}.exr"
    scene.write_text(FILM.format(body))
    subprocess.run([oneray, scene, "-o", image, "--quiet", *options], check=True)
    return image


@pytest.mark.parametrize("precision", ["single", "double"])
def test_one_colour_is_a_constant_environment(oneray: Path, tmp_path: Path, precision: str) -> None:
    """Where no ray goes to it but by chance, of the same numbers."""
    save(tmp_path / "grey.exr", np.full((5, 8, 3), (0.3, 0.6, 0.9)))
    bodies = {
        "map": f'<emitter type="envmap"><string name="filename" value="grey.exr"/></emitter>{BALL}',
        "sky": f'<emitter type="constant"><rgb name="radiance" value="0.3, 0.6, 0.9"/></emitter>{BALL}',
    }
    options = ("--spp", "64", "--estimator", "walk", "--precision", precision)
    one, other = (load_image(rendered(oneray, tmp_path, n, b, *options)).pixels for n, b in bodies.items())
    np.testing.assert_allclose(one, other, rtol=3e-6)
    options = ("--spp", "1024", "--estimator", "mis", "--precision", precision)
    one_file, other_file = (rendered(oneray, tmp_path, n, b, *options) for n, b in bodies.items())
    assert compare(one_file, other_file).verdict == "PASS"


@pytest.mark.parametrize("technique", ["nee", "mis", "light"])
def test_all_estimators_show_one_mean(oneray: Path, tmp_path: Path, technique: str) -> None:
    pixels = np.full((9, 16, 3), 0.2)
    pixels[2, 3:5] = (9, 6, 3)
    save(tmp_path / "sky.exr", pixels)
    body = f'<emitter type="envmap"><string name="filename" value="sky.exr"/></emitter>{BALL}'
    walk = rendered(oneray, tmp_path, "walk", body, "--spp", "40000", "--estimator", "walk")
    options = ("--spp", "20000", "--estimator", technique, "--seed", "5")
    other = rendered(oneray, tmp_path, technique, body, *options)
    result = compare(walk, other)
    assert result.verdict == "PASS", result.reason


@pytest.mark.parametrize(
    ("pixels", "says"),
    [
        (np.ones((1, 8, 3)), "an environment is a picture of 2 x 2 pixels or more"),
        (np.full((4, 8, 3), -1.0), "an environment's light cannot be negative, and this picture has -1"),
        (np.full((4, 8, 3), np.nan), "pixel (0, 0) is infinite or not a number"),
    ],
)
def test_what_is_no_environment(oneray: Path, tmp_path: Path, pixels: Array, says: str) -> None:
    save(tmp_path / "sky.exr", pixels)
    (tmp_path / "s.xml").write_text(FILM.format(emitter(Path("sky.exr"))))
    command = [oneray, tmp_path / "s.xml", "--check"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2 and says in done.stderr and done.stderr.count("\n") == 1
