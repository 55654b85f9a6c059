"""Bidirectional paths: the densities of all strategies, recomputed from a path's vertices by formulas of its own
and by what must hold of any densities; each strategy alone; pictures.
"""

from __future__ import annotations

import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from building import ROOT
from numpy.typing import NDArray
from sampling import NOTED_VERTICES, Driver
from scipy import stats

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


MATERIALS = {
    "diffuse": '<bsdf type="diffuse"><rgb name="reflectance" value="0.6"/></bsdf>',
    "both": '<bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.6"/></bsdf></bsdf>',
    "black": '<bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>',
    "mirror": '<bsdf type="conductor"><string name="material" value="none"/></bsdf>',
    "rough": '<bsdf type="roughconductor"><float name="alpha" value="0.4"/></bsdf>',
    "frosted": '<bsdf type="roughdielectric"><float name="alpha" value="0.4"/>'
    '<float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/></bsdf>',
    "plastic": '<bsdf type="plastic"><float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/></bsdf>',
    "glass": '<bsdf type="dielectric"><float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/></bsdf>',
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
FROSTED = (Panel((-0.1, -0.1, 0.8), *UP, 0.5, "frosted"),)
SCENES = {
    "diffuse": panels("diffuse"), "mirror": panels("mirror"), "glass": panels("diffuse", *SLAB),
    "rough": panels("rough"), "frosted": panels("diffuse", *FROSTED), "plastic": panels("plastic"),
}  # fmt: skip


def scene(folder: Path, of: tuple[Panel, ...] | str, depth: int = 5, lens: float = 0) -> Path:
    """The scene file of these panels, or of elements."""
    kind = f'thinlens"><float name="aperture_radius" value="{lens}"/><float name="focus_distance" value="4"/' if (
        lens) else 'perspective"'  # fmt: skip
    body = of if isinstance(of, str) else "\n".join(panel.xml() for panel in of)
    file = folder / "scene.xml"
    file.write_text(f"""<scene version="3.0.0">
<integrator type="path"><integer name="max_depth" value="{depth}"/><integer name="rr_depth" value="100"/></integrator>
<sensor type="{kind}><float name="fov" value="{FOV}"/>
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
    """Of thousands of paths of up to five edges every strategy's density, over that of the strategy that made the
    path, and the balance heuristic's weight, which are recomputed from the vertices alone.
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
    """∫ p_{s'} over the paths that s can sample, too: by s the mean of p_{s'}/p_s, by s' how many they are."""
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


def pictures(oneray: Path, file: Path, target: Path, seeds: range, *options: str) -> Array:
    """Means of the four quarters of a picture, by seed: (seeds, 4)."""
    found = []
    for seed in seeds:
        command = [oneray, file, "-o", target, "--seed", str(seed), "--quiet", *options]
        subprocess.run(command, check=True, capture_output=True, text=True)
        image = oiio.ImageBuf(str(target)).get_pixels(oiio.FLOAT)[..., :3].astype(float).mean(-1)
        half = image.shape[0] // 2
        found.append(image.reshape(2, half, 2, half).mean((1, 3)).ravel())
    return np.array(found)


def p_alike(a: Array, b: Array) -> float:
    """p-value of "both have these means", of quarters by seed; that of the worst quarter, for four."""
    return float(min(1, 4 * np.min(stats.ttest_ind(a, b, equal_var=False).pvalue)))


PAIRS = ("--estimator", "bidirectional")
SEEDS = range(12)


@pytest.mark.parametrize("lens", [0, 0.3])
def test_each_strategy_alone_is_all_of_the_light(oneray: Path, tmp_path: Path, lens: float) -> None:
    """Where nothing is a delta and no surfaces touch every strategy renders all light on paths of its length, which
    by next event estimation is what one more bounce brings.
    """
    values = []
    for k in range(1, 6):
        whole = pictures(oneray, scene(tmp_path, SCENES["diffuse"], k, lens), tmp_path / "a.exr", SEEDS, "--spp", "256")
        if k > 1:
            whole -= pictures(
                oneray, scene(tmp_path, SCENES["diffuse"], k - 1, lens), tmp_path / "a.exr", range(100, 112),
                "--spp", "256",
            )  # fmt: skip
        file = scene(tmp_path, SCENES["diffuse"], 5, lens)
        for s in range(k + 1):
            alone = pictures(
                oneray, file, tmp_path / "b.exr", SEEDS, *PAIRS, "--strategy", f"{s},{k + 1 - s}", "--spp", "256"
            )
            values.append((p_alike(alone, whole), s, k + 1 - s, alone.mean(), whole.mean()))
    worst = min(values)
    assert worst[0] * len(values) > 1e-3, worst


def test_a_strategy_samples_its_class_of_paths_alone(oneray: Path, tmp_path: Path) -> None:
    """Before a mirror on which light paths of three edges go eye, floor or back, mirror, lamp, next event estimation
    and joins at the mirror find none of them.
    """
    of = (Panel((0, 0, 0), *UP, 1, "diffuse"), Panel((-1.3, 0, 1.1), *RIGHT, 0.8, "mirror"), *LAMPS)
    file = scene(tmp_path, of, 3)
    whole = pictures(oneray, file, tmp_path / "a.exr", SEEDS, "--spp", "256")
    whole -= pictures(oneray, scene(tmp_path, of, 2), tmp_path / "a.exr", range(100, 112), "--spp", "256")
    scene(tmp_path, of, 3)
    met = pictures(oneray, file, tmp_path / "b.exr", SEEDS, *PAIRS, "--strategy", "0,4", "--spp", "1024")
    joined = [
        pictures(oneray, file, tmp_path / "b.exr", SEEDS, *PAIRS, "--strategy", f"{s},{4 - s}", "--spp", "256")
        for s in (1, 2, 3)
    ]
    assert p_alike(met, whole) > 1e-3
    for some, s in zip(joined, (1, 2, 3), strict=True):
        """The eye sees lamps in the mirror by (1, 3) only after the floor, by (3, 1) only before it."""
        assert some.mean() < 0.98 * whole.mean(), s


@pytest.mark.parametrize("name", ["diffuse", "glass", "frosted", "plastic", "rough"])
def test_lamp_and_eye_can_be_exchanged(oneray: Path, tmp_path: Path, name: str) -> None:
    """The light that comes to a point from all around is the same if the point lamp stands where the eye was and the
    eye where the lamp was: a picture's mean, each pixel by its solid angle, cos³θ, since all panels are in view.
    """
    places, found = (np.array([-0.6, -3.5, 1.3]), np.array([0.7, -3.2, 0.9])), []
    unlit = tuple(panel for panel in SCENES[name] if not panel.power)
    for eye, lamp in (places, places[::-1]):
        light = f'<emitter type="point"><point name="position" value="{lamp[0]}, {lamp[1]}, {lamp[2]}"/>'
        light += '<rgb name="intensity" value="10"/></emitter>'
        file = scene(tmp_path, light + "".join(panel.xml() for panel in unlit), 6)
        text = file.read_text().replace("0, -4, 1.1", ", ".join(map(str, eye))).replace("0, 0, 1.1", f"{eye[0]}, 0, 1.1")
        file.write_text(text.replace(f'"fov" value="{FOV}"', '"fov" value="80"'))
        by_seed = []
        for seed in range(16):
            command = [oneray, file, "-o", tmp_path / "a.exr", "--seed", str(seed), "--quiet", *PAIRS, "--spp", "512"]
            subprocess.run(command, check=True, capture_output=True, text=True)
            image = oiio.ImageBuf(str(tmp_path / "a.exr")).get_pixels(oiio.FLOAT)[..., 0].astype(float)
            across = ((np.arange(PIXELS) + 0.5) / PIXELS * 2 - 1) * np.tan(np.radians(40))
            cosine = 1 / np.sqrt(1 + across[:, None] ** 2 + across**2)
            by_seed.append((image * cosine**3).mean())
        found.append(np.array(by_seed))
    assert stats.ttest_ind(*found, equal_var=False).pvalue > 1e-4, [x.mean() for x in found]
