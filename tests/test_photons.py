"""Photon mapping: right where its blur changes nothing, closer to right as its radius shrinks, and whatever a
pass's radius, photons of what the point lies on, each with the right number of edges.
"""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from building import ROOT
from numpy.typing import NDArray

from raycheck.calibration import mutants

Array = NDArray[np.float64]
PHOTONS = ("--estimator", "photons")
IRRADIANCE = 2.0
FLOOR = f"""<scene version="3.0.0">
<default name="depth" value="2"/>
<integrator type="path"><integer name="max_depth" value="$depth"/></integrator>
<sensor type="perspective"><float name="fov" value="20"/>
<transform name="to_world"><lookat origin="{{camera}}" target="{{target}}" up="0, 0, 1"/></transform>
<film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="16"/>
<rfilter type="box"/></film>
</sensor>
<emitter type="directional"><vector name="direction" x="0" y="0" z="-1"/>
<rgb name="irradiance" value="{IRRADIANCE}"/></emitter>
<shape type="rectangle"><transform name="to_world"><scale value="2"/></transform>
<bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf></shape>
{{more}}
</scene>"""
TABLE = """<shape type="rectangle">
<transform name="to_world"><scale value="2"/><translate z="0.1"/></transform>
<bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf></shape>"""


def floor(folder: Path, camera: str = "0, -1, 3", target: str = "0, 0, 0", more: str = "") -> Path:
    """A square of 4 m that the sun shines on from above."""
    file = folder / "floor.xml"
    file.write_text(FLOOR.format(camera=camera, target=target, more=more))
    return file


def render(program: Path, scene: Path, folder: Path, *options: object) -> Array:
    """Rows of RGB."""
    output = folder / "photons.exr"
    words = [str(word) for word in (program, scene, "-o", output, "--quiet", *options)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return np.asarray(oiio.ImageBuf(str(output)).get_pixels(), dtype=np.float64)[..., :3]


def off_on_a_floor(program: Path, folder: Path, *options: object) -> float:
    """Of ρE/π, relative: irradiance is the same within any disc, so that there is no blur."""
    seen = render(
        program, floor(folder), folder, *PHOTONS, "--radius", 0.8, "--photons", 20000, "--spp", 64, *options
    )
    return float(seen.mean() / (0.5 * IRRADIANCE / np.pi) - 1)


def noise_of_pass(program: Path, folder: Path, number: int, *options: object) -> float:
    """Variance of one pass on that floor, in which photons are as many as N πr² over its square."""
    part, variance = folder / "part.film", []
    for seed in range(40):
        words = ["--samples", f"{number - 1}:1", "--film", part, "--seed", seed, "--radius", 0.3]
        command = [program, floor(folder), *PHOTONS, *words, "--photons", 2000, "--quiet", *options]
        subprocess.run([str(word) for word in command], check=True)
        output = folder / "part.exr"
        subprocess.run([str(program), "merge", str(part), "-o", str(output)], check=True)
        variance.append(np.asarray(oiio.ImageBuf(str(output)).get_pixels())[8, 8, 0])
    return float(np.var(variance))


def light_below(program: Path, folder: Path, *options: object) -> float:
    """On the floor, where a table 10 cm above it keeps all of the sun; the radius is 30 cm."""
    scene = floor(folder, camera="0, -1, 0.05", target="0, -0.8, 0", more=TABLE)
    return float(render(program, scene, folder, *PHOTONS, "--radius", 0.3, "--spp", 16, *options).max())


def off_from_paths(
    program: Path, right: Path, scene: str, folder: Path, *options: object
) -> tuple[float, float]:
    """Of the picture's mean by paths, relative, and the standard error of that."""
    means = []
    for seed in range(8):
        way = (*PHOTONS, "--radius", 0.02, "--spp", 16, "--seed", seed)
        means.append(render(program, ROOT / f"scenes/{scene}.xml", folder, *way, *options).mean())
    paths = [
        render(right, ROOT / f"scenes/{scene}.xml", folder, "--spp", 256, "--seed", seed, *options).mean()
        for seed in range(8)
    ]
    error = np.hypot(np.std(means, ddof=1), np.std(paths, ddof=1)) / np.sqrt(8) / np.mean(paths)
    return float(np.mean(means) / np.mean(paths) - 1), float(error)


def shrinks_as_said(program: Path, folder: Path, *options: object) -> bool:
    """Pass 1000 has the noise of 8.9 times fewer photons, by the product of (i + 2/3)/(i + 1)."""
    i = np.arange(1, 1000)
    expected = 1 / np.prod((i + 2 / 3) / (i + 1))
    ratio = noise_of_pass(program, folder, 1000, *options) / noise_of_pass(program, folder, 1, *options)
    return bool(expected / 2.5 < ratio < expected * 2.5)


def agrees(
    program: Path, right: Path, scene: str, folder: Path, *options: object, within: float = 0.025
) -> bool:
    """But for the blur: over the edges of the ladder's scenes it amounts to 2.5 % at most."""
    off, error = off_from_paths(program, right, scene, folder, *options)
    return abs(off) < within + 5 * error


def test_there_is_no_bias_where_irradiance_is_constant(oneray: Path, tmp_path: Path) -> None:
    assert abs(off_on_a_floor(oneray, tmp_path)) < 0.01


def test_the_radius_shrinks_by_the_pass(oneray: Path, tmp_path: Path) -> None:
    assert shrinks_as_said(oneray, tmp_path)


def test_photons_of_another_layer_are_left_out(oneray: Path, tmp_path: Path) -> None:
    assert light_below(oneray, tmp_path) == 0


SCENES = sorted(
    path.stem
    for path in (ROOT / "scenes").glob("*.xml")
    if not any(word in path.read_text(encoding="utf-8") for word in ("bumpmap", "normalmap", "hide_emitters"))
)
CLOSE = {
    "sphere-light-near",
    "touching-light",
    "sphere-light-far",
    "light-below-horizon",
    "integrating-sphere",
}
"""Light changes within two centimetres there, or that is much of what is seen."""


@pytest.mark.sample(10)
@pytest.mark.parametrize("scene", [name for name in SCENES if name not in CLOSE])
def test_all_scenes_have_the_light_of_paths(oneray: Path, tmp_path: Path, scene: str) -> None:
    assert agrees(oneray, oneray, scene, tmp_path)


def test_evenly_spread_samples_have_the_same_light(oneray: Path, tmp_path: Path) -> None:
    assert agrees(oneray, oneray, "cornell-box", tmp_path, "--sampler", "sobol")


@pytest.mark.parametrize("depth", [1, 2, 3])
def test_depth_counts_the_edges_of_both_ends(oneray: Path, tmp_path: Path, depth: int) -> None:
    assert agrees(oneray, oneray, "cornell-box", tmp_path, f"-Ddepth={depth}")


def test_bias_falls_with_the_radius(oneray: Path, tmp_path: Path) -> None:
    """At shadows and corners like r: by a factor of four or so from 32 cm to 8."""
    scene = ROOT / "scenes/cornell-box.xml"
    right = render(oneray, scene, tmp_path, "--spp", 4096)

    def bias(radius: float) -> float:
        seen = render(oneray, scene, tmp_path, *PHOTONS, "--radius", radius, "--spp", 1024)
        tiles = (seen - right).reshape(8, 8, 8, 8, 3).mean(axis=(1, 3))
        return float(np.sqrt((tiles**2).mean()) / right.mean())

    wide, narrow = bias(0.32), bias(0.08)
    assert narrow < 0.4 * wide
    assert wide > 0.02


def test_the_bits_are_those_of_any_split(oneray: Path, tmp_path: Path) -> None:
    """Lanes, kernel, parts in any order, and a part of the picture, whose photons are those of the whole."""
    scene = ROOT / "scenes/glass-ball.xml"
    way = (*PHOTONS, "--spp", 6, "--precision", "double")
    whole = render(oneray, scene, tmp_path, *way)
    for options in (("--lanes", 1), ("--lanes", 2), ("--kernel", "generic")):
        np.testing.assert_array_equal(render(oneray, scene, tmp_path, *way, *options), whole)
    part = render(oneray, scene, tmp_path, *way, "--crop", "3,5,20,10")
    np.testing.assert_array_equal(part, whole[5:15, 3:23])
    films = [tmp_path / f"{first}.film" for first in (4, 0)]
    for film, first, count in zip(films, (4, 0), (2, 4), strict=True):
        words = [
            oneray,
            scene,
            *PHOTONS,
            "--precision",
            "double",
            "--samples",
            f"{first}:{count}",
            "--film",
            film,
        ]
        subprocess.run([str(word) for word in words], check=True)
    joined = tmp_path / "joined.exr"
    subprocess.run([oneray, "merge", *films, "-o", joined], check=True)
    np.testing.assert_array_equal(np.asarray(oiio.ImageBuf(str(joined)).get_pixels())[..., :3], whole)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--radius", "0.1"), "--radius is one of --estimator photons'"),
        (("--estimator", "nee", "--photons", "9"), "--photons is one of --estimator photons'"),
        ((*PHOTONS, "--radius", "0"), "--radius 0: a number between 0 and"),
        ((*PHOTONS, "--photons", "0"), "--photons 0: a whole number from 1 to"),
        ((*PHOTONS, "--mis", "power"), "--mis weighs two ways"),
        ((*PHOTONS, "--light-points", "cone"), "--estimator photons starts anywhere on a light"),
        ((*PHOTONS, "--light-choice", "contribution"), "--light-choice uniform or power"),
        ((*PHOTONS, "--strategy", "1,2"), "--strategy is one of --estimator bidirectional's"),
    ],
)
def test_what_makes_no_sense_is_refused(
    oneray: Path, tmp_path: Path, options: tuple[str, ...], words: str
) -> None:
    output = tmp_path / "a.exr"
    command = [oneray, ROOT / "scenes/cornell-box.xml", *options, "-o", output]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2 and words in done.stderr and done.stderr.count("\n") == 1, done.stderr
    assert not output.exists()


def test_a_film_says_its_photons(oneray: Path, tmp_path: Path) -> None:
    """Parts of another radius are parts of another picture."""
    films = []
    for first, radius in ((0, 0.1), (1, 0.2)):
        films.append(tmp_path / f"{first}.film")
        words = [oneray, ROOT / "scenes/cornell-box.xml", *PHOTONS, "--radius", radius]
        subprocess.run([*map(str, words), "--samples", f"{first}:1", "--film", films[-1]], check=True)
    command = [oneray, "merge", *films, "-o", tmp_path / "a.exr"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2 and "--radius 0.1" in done.stderr and "--radius 0.2" in done.stderr


MISTAKES = {mutant.name: mutant for mutant in mutants.catalogue(ROOT / "tests/mutants_photons")}
SEEN: dict[str, Callable[[Path, Path, Path], bool]] = {
    "density-by-diameter": lambda p, r, folder: abs(off_on_a_floor(p, folder, *mutants.OPTIONS)) < 0.01,
    "radius-of-first-pass": lambda p, r, folder: shrinks_as_said(p, folder, *mutants.OPTIONS),
    "through-thin-walls": lambda p, r, folder: light_below(p, folder, *mutants.OPTIONS) == 0,
    "direct-light-twice": lambda p, r, folder: agrees(p, r, "cornell-box", folder, *mutants.OPTIONS),
    "edges-of-the-eye-forgotten": lambda p, r, folder: agrees(
        p, r, "mirror-corridor", folder, "-Ddepth=3", *mutants.OPTIONS, within=0.01
    ),
    "photons-at-mirrors-alone": lambda p, r, folder: agrees(p, r, "mirror-light", folder, *mutants.OPTIONS),
}


def test_each_mistake_has_a_check() -> None:
    assert set(SEEN) == set(MISTAKES)


@pytest.mark.sample(2)
@pytest.mark.parametrize("name", SEEN)
def test_a_mistake_is_seen(oneray: Path, tmp_path: Path, name: str) -> None:
    assert SEEN[name](mutants.program(None), oneray, tmp_path)
    assert not SEEN[name](mutants.program(MISTAKES[name]), oneray, tmp_path)
