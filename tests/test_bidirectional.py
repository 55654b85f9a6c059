"""Bidirectional paths: the densities of all strategies, recomputed from a path's vertices by formulas of
their own and by what must hold of any densities; each strategy alone; pictures.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from building import ROOT
from numpy.typing import NDArray
from sampling import NOTED_VERTICES, Driver
from scipy import stats

from raycheck.calibration import mutants, trials
from raycheck.scene.techniques import technique

Array = NDArray[np.float64]

FOV = 50
PIXELS = 16


@dataclass(frozen=True)
class Panel:
    """A rectangle along the axes: its middle, what is along its edges (half), and its material."""

    middle: tuple[float, float, float]
    turn: str
    """Elements that turn the rectangle, which looks along z."""
    normal: tuple[float, float, float]
    half: float
    material: str
    power: float = 0

    def xml(self) -> str:
        x, y, z = self.middle
        place = f'<scale x="{self.half}" y="{self.half}"/>{self.turn}<translate x="{x}" y="{y}" z="{z}"/>'
        shines = f'<emitter type="area"><rgb name="radiance" value="{self.power}"/></emitter>'
        return (
            f'<shape type="rectangle"><transform name="to_world">{place}</transform>'
            f"{MATERIALS[self.material]}{shines * (self.power > 0)}</shape>"
        )


GLASS = '<float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/></bsdf>'
MATERIALS = {
    "diffuse": '<bsdf type="diffuse"><rgb name="reflectance" value="0.6"/></bsdf>',
    "black": '<bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>',
    "mirror": '<bsdf type="conductor"><string name="material" value="none"/></bsdf>',
    "rough": '<bsdf type="roughconductor"><float name="alpha" value="0.4"/></bsdf>',
    "frosted": f'<bsdf type="roughdielectric"><float name="alpha" value="0.4"/>{GLASS}',
    "plastic": f'<bsdf type="plastic">{GLASS}',
    "glass": f'<bsdf type="dielectric">{GLASS}',
}
UP, DOWN = ("", (0, 0, 1)), ('<rotate x="1" angle="180"/>', (0, 0, -1))
RIGHT = ('<rotate y="1" angle="90"/>', (1, 0, 0))
BACK = ('<rotate x="1" angle="90"/>', (0, -1, 0))
LAMPS = (Panel((0.1, 0, 1.8), *DOWN, 0.3, "black", 5), Panel((0.9, 0.3, 1.1), *DOWN, 0.2, "black", 3))


def panels(side: str, *more: Panel) -> tuple[Panel, ...]:
    """A floor, a ceiling, a side and a back that do not touch, under two lamps."""
    return (
        Panel((0, 0, 0), *UP, 1, "diffuse"), Panel((0, 0, 2.2), *DOWN, 1, "diffuse"),
        Panel((-1.3, 0, 1.1), *RIGHT, 0.8, side), Panel((0, 1.3, 1.1), *BACK, 0.8, "diffuse"), *LAMPS, *more,
    )  # fmt: skip


SLAB = (Panel((-0.1, -0.1, 0.8), *UP, 0.5, "glass"), Panel((-0.1, -0.1, 0.65), *DOWN, 0.5, "glass"))
FROSTED = (Panel((-0.1, -1.2, 1), *BACK, 0.5, "frosted"),)
SCENES = {
    "diffuse": panels("diffuse"), "mirror": panels("mirror"), "glass": panels("diffuse", *SLAB),
    "rough": panels("rough"), "frosted": panels("diffuse", *FROSTED), "plastic": panels("plastic"),
}  # fmt: skip


def scene(folder: Path, of: tuple[Panel, ...] | str, depth: int = 5, lens: float = 0) -> Path:
    """The scene file of these panels, or of elements."""
    kind = '"perspective">'
    if lens:
        kind = f'"thinlens"><float name="aperture_radius" value="{lens}"/>'
        kind += '<float name="focus_distance" value="4"/>'
    body = of if isinstance(of, str) else "\n".join(panel.xml() for panel in of)
    file = folder / "scene.xml"
    file.write_text(f"""<scene version="3.0.0">
<integrator type="path"><integer name="max_depth" value="{depth}"/>
    <integer name="rr_depth" value="100"/></integrator>
<sensor type={kind}<float name="fov" value="{FOV}"/>
    <transform name="to_world"><lookat origin="0, -4, 1.1" target="0, 0, 1.1" up="0, 0, 1"/></transform>
    <film type="hdrfilm"><integer name="width" value="{PIXELS}"/><integer name="height" value="{PIXELS}"/>
        <string name="pixel_format" value="rgb"/><string name="component_format" value="float32"/>
        <rfilter type="box"/></film>
    <sampler type="independent"/>
</sensor>
{body}
</scene>
""")
    return file


EYE = np.array([0, -4, 1.1])
FILM_AREA = (2 * np.tan(np.radians(FOV / 2))) ** 2


class Recomputed:
    """Densities of a path x_0 … x_k from its vertices alone, Veach 1997, 10.2 and 10.3."""

    def __init__(self, of: tuple[Panel, ...], x: Array, delta: Array) -> None:
        self.of, self.x, self.k, self.delta = of, np.vstack([x, EYE]), len(x), delta
        self.panel = [self._panel(point) for point in x]
        self.normal = [np.array(panel.normal, float) for panel in self.panel]
        powers = np.array([lamp.power * lamp.half**2 for lamp in LAMPS])
        lamp = self.panel[0]
        self.p_0 = powers[LAMPS.index(lamp)] / powers.sum() / (4 * lamp.half**2)
        """Of x_0, which next event estimation by power and uniform by area chooses alike."""

    def _panel(self, point: Array) -> Panel:
        def beyond(panel: Panel) -> float:
            along = np.abs(point - panel.middle)
            axis = int(np.argmax(np.abs(panel.normal)))
            return max(along[axis] * 1e6, *(np.delete(along, axis) - panel.half))

        return min(self.of, key=beyond)

    def _edge(self, i: int, j: int) -> tuple[Array, float]:
        between = self.x[j] - self.x[i]
        return between / np.linalg.norm(between), float(between @ between)

    def cosine(self, i: int, j: int) -> float:
        return abs(float(self.normal[i] @ self._edge(i, j)[0]))

    def index(self, i: int, j: int) -> float:
        """Of refraction, on the side of x_i's surface that x_j is on."""
        inside = self.panel[i].material == "glass" and float(self.normal[i] @ self._edge(i, j)[0]) < 0
        return 1.5 if inside else 1.0

    def scatter(self, i: int, to: int) -> float:
        """p_w at x_i, towards x_to; of a delta its measure η² cosθ dω."""
        if self.delta[i]:
            return self.index(i, to) ** 2 * self.cosine(i, to)
        return self.cosine(i, to) / np.pi

    def area(self, p_w: float, i: int, j: int) -> float:
        """From sr⁻¹ at x_i to m⁻² at x_j."""
        return p_w * self.cosine(j, i) / self._edge(i, j)[1]

    def strategy(self, s: int) -> float:
        """p_{s,t}; 0 where it cannot sample the path."""
        k, joined = self.k, {s - 1, s} & set(range(1, self.k))
        if any(self.delta[i] for i in joined):
            return 0.0
        p = self.p_0 if s > 0 else 1.0
        for i in range(1, s):
            p *= self.area(self.scatter(i - 1, i), i - 1, i)
        for i in range(k - 1, s - 1, -1):
            if i == k - 1:
                direction, square = self._edge(k, i)
                p *= self.cosine(i, k) / square / (FILM_AREA * float(direction[1]) ** 3)
            else:
                p *= self.area(self.scatter(i + 1, i), i + 1, i)
        return p


@dataclass(frozen=True)
class Noted:
    """The columns of what pairs of subpaths weighed."""

    rows: Array
    pairs: int

    @property
    def s(self) -> Array:
        return self.rows[:, 1]

    @property
    def t(self) -> Array:
        return self.rows[:, 2]

    @property
    def k(self) -> Array:
        return self.s + self.t - 1

    @property
    def free(self) -> Array:
        return self.rows[:, 3]

    @property
    def other(self) -> Array:
        """By s' the density of (s', k + 1 - s') over this one's; at s' = s the weight."""
        return self.rows[:, 4 + 4 * NOTED_VERTICES :]


def noted(driver: Driver, file: Path, n: int, seed: int, choice: str, points: str) -> Noted:
    with driver.scene(file, "bidirectional", choice=choice, points=points) as opened:
        return Noted(driver.pairs(opened, n, seed), n)


@pytest.mark.parametrize("name", ["diffuse", "mirror", "glass"])
def test_densities_are_those_of_the_vertices(driver: Driver, tmp_path: Path, name: str) -> None:
    """Of thousands of paths of up to five edges every strategy's density, over that of the strategy that made
    the path, and the balance heuristic's weight, which are recomputed from the vertices alone.
    """
    of = SCENES[name]
    all_of = noted(driver, scene(tmp_path, of), 4000, 1, "power", "area")
    seen, deltas = set(), 0
    for row, s, k in zip(all_of.rows, all_of.s.astype(int), all_of.k.astype(int), strict=True):
        vertices = row[4 : 4 + 4 * k].reshape(k, 4)
        path = Recomputed(of, vertices[:, :3], vertices[:, 3] > 0)
        p = np.array([path.strategy(other) for other in range(k + 1)])
        expected = p / p[s]
        expected[s] = p[s] / p.sum()
        np.testing.assert_allclose(row[4 + 4 * NOTED_VERTICES :][: k + 1], expected, rtol=1e-6, atol=1e-12)
        seen.add((s, k + 1 - s))
        deltas += int(path.delta.any())
    assert seen == {(s, k + 1 - s) for k in range(1, 6) for s in range(k + 1)}
    assert (deltas > 100) == (name != "diffuse")


@pytest.mark.parametrize(("choice", "points"), [("contribution", "cone"), ("uniform", "area")])
@pytest.mark.parametrize("name", SCENES)
def test_each_density_integrates_to_what_others_reach(
    driver: Driver, tmp_path: Path, name: str, choice: str, points: str
) -> None:
    """∫ p_{s'} over the paths that s can sample, too: by s the mean of p_{s'}/p_s, by s' their share."""
    n, seed = 40000, 7
    all_of = noted(driver, scene(tmp_path, SCENES[name], depth=4), n, seed, choice, points)
    values = []
    for k in range(1, 5):
        for s in range(k + 1):
            for other in set(range(k + 1)) - {s}:
                ours = (all_of.k == k) & (all_of.s == s)
                theirs = (all_of.k == k) & (all_of.s == other)
                by_ratio = (all_of.free * all_of.other[:, other])[ours]
                by_count = (all_of.free * (all_of.other[:, s] > 0))[theirs]
                mean = np.array([by_ratio.sum(), by_count.sum()]) / n
                square = np.array([(by_ratio**2).sum(), (by_count**2).sum()]) / n
                error = np.sqrt(((square - mean**2) / n).sum())
                if by_count.sum() < 200 or len(by_ratio) < 200:
                    continue
                values.append((2 * stats.norm.sf(abs(mean[0] - mean[1]) / error), k, s, other, *mean))
    assert len(values) >= 15
    worst = min(values)
    assert worst[0] * len(values) > 1e-4, worst


BRIGHTER = ("--spp", "256")
PAIRS = ("--estimator", "bidirectional")
SEEDS = range(12)


def render(oneray: Path, file: Path, target: Path, *options: str | Path) -> Array:
    """The picture's channels, (height, width, 3)."""
    command = [oneray, file, "-o", target, "--quiet", *options]
    subprocess.run(command, check=True, capture_output=True, text=True)
    return oiio.ImageBuf(str(target)).get_pixels(oiio.FLOAT)[..., :3].astype(float)


def quarters(oneray: Path, file: Path, seeds: Iterable[int], *options: str) -> Array:
    """Means of the four quarters of a picture, by seed: (seeds, 4)."""
    found = []
    for seed in seeds:
        image = render(oneray, file, file.with_suffix(".exr"), "--seed", str(seed), *options).mean(-1)
        half = image.shape[0] // 2
        found.append(image.reshape(2, half, 2, half).mean((1, 3)).ravel())
    return np.array(found)


def of_length(oneray: Path, folder: Path, of: tuple[Panel, ...], k: int, lens: float = 0) -> Array:
    """The light on paths of k edges, by next event estimation: what one more bounce brings."""
    whole = quarters(oneray, scene(folder, of, k, lens), SEEDS, *BRIGHTER)
    if k > 1:
        whole = whole - quarters(oneray, scene(folder, of, k - 1, lens), range(100, 112), *BRIGHTER)
    return whole


def alone(oneray: Path, file: Path, s: int, t: int, *options: str) -> Array:
    return quarters(oneray, file, SEEDS, *PAIRS, "--strategy", f"{s},{t}", *(options or BRIGHTER))


def p_alike(a: Array, b: Array) -> float:
    """p-value of "both have these means", of quarters by seed; that of the worst quarter, for four."""
    return float(min(1, 4 * np.min(stats.ttest_ind(a, b, equal_var=False).pvalue)))


@pytest.mark.sample(2)
@pytest.mark.parametrize(("name", "lens"), [("diffuse", 0), ("diffuse", 0.3), ("frosted", 0), ("rough", 0)])
def test_each_strategy_alone_is_all_of_the_light(
    oneray: Path, tmp_path: Path, name: str, lens: float
) -> None:
    """Where nothing is a delta and no surfaces touch: of all the light on paths of its length."""
    of, values = SCENES[name], []
    for k in range(1, 6 if name == "diffuse" else 5):
        whole = of_length(oneray, tmp_path, of, k, lens)
        file = scene(tmp_path, of, 5, lens)
        for s in range(k + 1):
            found = alone(oneray, file, s, k + 1 - s)
            values.append((p_alike(found, whole), s, k + 1 - s, found.mean(), whole.mean()))
    worst = min(values)
    assert worst[0] * len(values) > 1e-3, worst


def test_a_strategy_samples_its_class_of_paths_alone(oneray: Path, tmp_path: Path) -> None:
    """Beside a mirror three edges can be eye, floor, mirror, lamp, which (1, 3) and (2, 2) cannot join, or
    eye, mirror, floor, lamp, which (2, 2) and (3, 1) cannot; a lamp that is met has all of them.
    """
    mirror = Panel((-1.3, 0, 1.1), *RIGHT, 0.8, "mirror")
    of = (Panel((0, 0, 0), *UP, 1, "diffuse"), mirror, *LAMPS)
    whole = of_length(oneray, tmp_path, of, 3)
    file = scene(tmp_path, of, 3)
    assert p_alike(alone(oneray, file, 0, 4, "--spp", "1024"), whole) > 1e-3
    assert alone(oneray, file, 2, 2).mean() == 0
    some = [alone(oneray, file, s, 4 - s) for s in (1, 3)]
    assert min(part.mean() for part in some) > 0.01 * whole.mean()
    assert p_alike(some[0] + some[1], whole) > 1e-3


@pytest.mark.parametrize("name", ["diffuse", "glass", "frosted", "plastic", "rough"])
def test_lamp_and_eye_can_be_exchanged(oneray: Path, tmp_path: Path, name: str) -> None:
    """The light that comes to a point from all around is the same if the point lamp stands where the eye was
    and the eye where the lamp was: a picture's mean, each pixel by its solid angle, cos³θ, all being in view.
    """
    places, found = (np.array([-0.6, -3.5, 1.3]), np.array([0.7, -3.2, 0.9])), []
    of = SCENES[name]
    if name == "frosted":  # a sheet of it, for behind a single boundary all would be glass
        of = (*of, Panel((-0.1, -1.18, 1), '<rotate x="1" angle="-90"/>', (0, 1, 0), 0.5, "frosted"))
    unlit = "".join(panel.xml() for panel in of if not panel.power)
    across = ((np.arange(PIXELS) + 0.5) / PIXELS * 2 - 1) * np.tan(np.radians(40))
    cosine = 1 / np.sqrt(1 + across[:, None] ** 2 + across**2)
    for eye, lamp in (places, places[::-1]):
        light = f'<emitter type="point"><point name="position" value="{lamp[0]}, {lamp[1]}, {lamp[2]}"/>'
        light += '<rgb name="intensity" value="10"/></emitter>'
        file = scene(tmp_path, light + unlit, 6)
        text = file.read_text().replace("0, -4, 1.1", ", ".join(map(str, eye)))
        text = text.replace("0, 0, 1.1", f"{eye[0]}, 0, 1.1")
        file.write_text(text.replace(f'"fov" value="{FOV}"', '"fov" value="80"'))
        by_seed = [
            render(oneray, file, tmp_path / "a.exr", "--seed", str(seed), *PAIRS, "--spp", "512")[..., 0]
            for seed in range(16)
        ]
        found.append((np.array(by_seed) * cosine**3).mean((1, 2)))
    assert stats.ttest_ind(*found, equal_var=False).pvalue > 1e-4, [x.mean() for x in found]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--light-choice learned", "--estimator bidirectional: --light-choice learned is not supported"),
        ("--mis-pdf survival", "--mis-pdf weighs two ways to find a light"),
        ("--strategy 2", "--strategy 2: S,T is wanted"),
        ("--strategy 3,0", "--strategy 3,0: T is 1 at least, the eye"),
        ("--estimator mis --strategy 1,2", "--strategy is one of --estimator bidirectional's"),
    ],
)
def test_what_it_cannot_is_said(oneray: Path, tmp_path: Path, words: str, said: str) -> None:
    command = [oneray, scene(tmp_path, SCENES["diffuse"]), "-o", tmp_path / "a.exr", *PAIRS, *words.split()]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2 and said in done.stderr and len(done.stderr.splitlines()) == 1, done.stderr
    assert not (tmp_path / "a.exr").exists()


@pytest.mark.parametrize(
    ("element", "said"),
    [
        ('<boolean name="hide_emitters" value="true"/>', "hide_emitters is not supported"),
        (None, "a bumpmap or normalmap is not supported"),
    ],
)
def test_a_scene_that_it_cannot_is_refused(
    oneray: Path, tmp_path: Path, element: str | None, said: str
) -> None:
    of = SCENES["diffuse"]
    file = scene(tmp_path, of)
    text = file.read_text()
    picture = f'<string name="filename" value="{ROOT}/scenes/pictures/sky.exr"/>'
    bump = f'<bsdf type="bumpmap"><texture type="bitmap">{picture}</texture><bsdf type="diffuse"/></bsdf>'
    hidden = text.replace('<integrator type="path">', f'<integrator type="path">{element}')
    file.write_text(hidden if element else text.replace(MATERIALS["diffuse"], bump, 1))
    command = [oneray, file, "-o", tmp_path / "a.exr", *PAIRS]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2 and said in done.stderr and "bidirectional" in done.stderr, done.stderr


def test_pieces_and_windows_are_parts_of_the_whole(oneray: Path, tmp_path: Path) -> None:
    """Ranges of samples merged, a run that goes on, and a crop: the same bits."""
    file = scene(tmp_path, SCENES["glass"])

    def run(*words: str | Path) -> None:
        subprocess.run([oneray, file, "--quiet", *PAIRS, *words], check=True, capture_output=True)

    def image(name: str) -> Array:
        return oiio.ImageBuf(str(tmp_path / name)).get_pixels(oiio.FLOAT)

    run("--spp", "24", "-o", tmp_path / "whole.exr")
    for number, samples in enumerate(("0:7", "7:17")):
        run("--samples", samples, "--film", tmp_path / f"{number}.film")
    parts = [tmp_path / "1.film", tmp_path / "0.film"]
    subprocess.run([oneray, "merge", *parts, "-o", tmp_path / "merged.exr"], check=True, capture_output=True)
    run("--spp", "5", "--checkpoint", tmp_path / "kept.film", "-o", tmp_path / "some.exr")
    run("--spp", "24", "--checkpoint", tmp_path / "kept.film", "--resume", "-o", tmp_path / "resumed.exr")
    run("--spp", "24", "--crop", "3,5,8,6", "-o", tmp_path / "crop.exr")
    whole = image("whole.exr")
    assert (image("merged.exr") == whole).all() and (image("resumed.exr") == whole).all()
    assert (image("crop.exr") == whole[5:11, 3:11]).all()
    run("--error", "0.05", "-o", tmp_path / "error.exr")
    run("--time", "0.2", "-o", tmp_path / "time.exr")
    assert abs(image("time.exr")[..., 0].mean() / image("error.exr")[..., 0].mean() - 1) < 0.2


def test_paths_longer_than_what_is_kept_are_found_from_the_eye(oneray: Path, tmp_path: Path) -> None:
    """In a white ball that glows, where one path in twenty ends at a vertex, half of the light is on paths of
    more edges than a light subpath has vertices.
    """
    ball = '<shape type="sphere"><boolean name="flip_normals" value="true"/><float name="radius" value="5"/>'
    ball += '<bsdf type="diffuse"><rgb name="reflectance" value="0.95"/></bsdf>'
    ball += '<emitter type="area"><rgb name="radiance" value="0.05"/></emitter></shape>'
    found = quarters(oneray, scene(tmp_path, ball, depth=-1), range(6), *PAIRS, "--spp", "64").mean(1)
    error = found.std(ddof=1) / np.sqrt(len(found))
    assert abs(found.mean() - 1) < 5 * error and error < 0.02


@pytest.mark.parametrize("name", ["slit", "cove", "small-caustic"])
def test_what_a_walk_hardly_finds(oneray: Path, tmp_path: Path, name: str) -> None:
    """Light through a slit, out of a cove, through a ball of glass: as light tracing finds it, which
    can, for all that is in view is diffuse, and with less than a tenth of the walk's variance.
    """
    file = tmp_path / "scene.xml"
    shutil.copy(ROOT / f"scenes/indirect/{name}.xml", file)
    joined = quarters(oneray, file, SEEDS, *PAIRS, *BRIGHTER)
    traced = quarters(oneray, file, SEEDS, "--estimator", "light", *BRIGHTER)
    assert p_alike(joined, traced) > 1e-3
    walked = [render(oneray, file, tmp_path / "a.exr", "--seed", str(seed), *BRIGHTER) for seed in range(8)]
    by_both = [
        render(oneray, file, tmp_path / "a.exr", "--seed", str(seed), *PAIRS, *BRIGHTER) for seed in range(8)
    ]
    assert np.var(by_both, axis=0).mean() < 0.1 * np.var(walked, axis=0).mean()


MISTAKES = {mutant.name: mutant for mutant in mutants.catalogue(ROOT / "tests/mutants_bidirectional")}
JUDGED = ("strategy-left-out", "density-no-cosine", "delta-light-met")
"""A sample: each takes a program of its own."""


def test_the_mistakes_are_patches_of_the_sources() -> None:
    assert len(MISTAKES) >= 10
    for mutant in MISTAKES.values():
        assert technique(mutant.shows).options[1] == "bidirectional"
        command = ["patch", "--dry-run", "-p1", "--fuzz=1", "-f", "-i", str(mutant.patch)]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{mutant.name}: {done.stdout}"


@pytest.mark.sample(2)
@pytest.mark.parametrize("name", [*JUDGED, None])
def test_a_mistake_is_seen(name: str | None) -> None:
    """By its picture; without one there is nothing to see."""
    mutant = MISTAKES[name or JUDGED[0]]
    program = trials.Program(mutants.program(MISTAKES[name] if name else None), mutant.shows)
    trial = trials.try_program(program, mutant.scene, trials.load_truth(mutant.scene), spp=32)
    assert trial.rejected["raycheck"] == (name is not None), trial.reason


def test_radiance_that_is_not_compressed_is_seen(oneray: Path, tmp_path: Path) -> None:
    """Through rough glass by a strategy whose eye subpath goes through it."""
    file = scene(tmp_path, SCENES["frosted"], 3)
    program = mutants.program(MISTAKES["radiance-not-compressed"])
    right = alone(oneray, file, 3, 1, *BRIGHTER, *mutants.OPTIONS)
    assert p_alike(alone(program, file, 3, 1, *BRIGHTER, *mutants.OPTIONS), right) == 1
    assert p_alike(alone(program, file, 1, 3, *BRIGHTER, *mutants.OPTIONS), right) < 1e-6
