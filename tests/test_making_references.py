"""raycheck reference: what can be a reference, how long it takes, and what another Mitsuba would change."""

import json
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from raycheck.base.arrays import Array
from raycheck.base.errors import NotFound, ReferenceError_
from raycheck.scene.variants import Variant, scene_hash, variant
from raycheck.truth import drift, making, mitsuba, references

INSTALLED = f"Mitsuba {version('mitsuba')}"
RNG = np.random.default_rng(1)
MEAN, VARIANCE = RNG.uniform(1, 2, (8, 16, 3)), RNG.uniform(1, 2, (8, 16, 3))
# ---- what can be a reference

MINE = """\
<scene version="3.0.0">
    <integrator type="path"><integer name="max_depth" value="3"/></integrator>
    <sensor type="perspective">
        <float name="fov" value="40"/>
        <transform name="to_world"><lookat origin="0, 1, 6" target="0, 0, 0" up="0, 1, 0"/></transform>
        <film type="hdrfilm">
            <integer name="width" value="16"/><integer name="height" value="16"/><rfilter type="box"/>
        </film>
    </sensor>
    <shape type="sphere"/>
    <emitter type="constant"/>
</scene>
"""
FORMAT = '<string name="pixel_format" value="{}"/><rfilter'


def command(*words: object) -> subprocess.CompletedProcess[str]:
    program = [sys.executable, "-m", "raycheck", "reference", *map(str, words)]
    return subprocess.run(program, capture_output=True, text=True, check=False, timeout=300)


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        (MINE.replace("box", "mitchell"), 7, '<rfilter type="mitchell"> weighs some of the film below 0'),
        (MINE.replace("<rfilter", FORMAT.format("luminance")), 7, 'pixel_format "luminance"'),
        (MINE.replace("<rfilter", FORMAT.format("xyz")), 7, 'pixel_format "xyz"'),
        (MINE.replace("<rfilter", FORMAT.format("rgba")), 7, 'pixel_format "rgba"'),
        (MINE.replace("integrator", "notes"), None, "no integrator"),
        (MINE.replace("film", "notes"), None, "no film"),
    ],
)
def test_a_picture_that_is_no_reference_is_refused_before_it_is_rendered(
    tmp_path: Path, text: str, line: int | None, message: str
) -> None:
    path = tmp_path / "mine.xml"
    path.write_text(text, encoding="utf-8")
    done = command(path)
    assert (done.returncode, done.stdout) == (2, "") and done.stderr.count("\n") == 1
    assert done.stderr.startswith(f"raycheck: {path}:{line}: " if line else f"raycheck: {path}: ")
    assert message in done.stderr and not (tmp_path / "references").exists()


@pytest.mark.parametrize(
    "integrator",
    [
        '<integrator type="aov"><string name="aovs" value="d:depth"/><integrator type="path"/></integrator>',
        '<integrator type="moment"><integrator type="path"/></integrator>',
    ],
)
def test_so_is_one_of_other_channels(tmp_path: Path, integrator: str) -> None:
    path = tmp_path / "mine.xml"
    begin, end = MINE.index("<integrator"), MINE.index("<sensor")
    path.write_text(MINE[:begin] + integrator + MINE[end:], encoding="utf-8")
    renderer = mitsuba.MitsubaBatches(Variant(path), "scalar_rgb")
    with pytest.raises(NotFound, match=r"mine.xml: Mitsuba renders it with \d+ channels"):
        next(renderer.batches(0, 1, 1))


def test_what_mitsuba_cannot_render_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "mine.xml"
    monkeypatch.setattr(mitsuba, "check_film", lambda *of: None)
    path.write_text(re.sub("<integrator.*</integrator>", "", MINE), encoding="utf-8")
    renderer = mitsuba.MitsubaBatches(Variant(path), "scalar_rgb")
    with pytest.raises(NotFound, match=r"mine.xml: Mitsuba cannot render it: ") as told:
        next(renderer.batches(0, 1, 1))
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("element", "name"),
    [
        ('<include filename="part.xml"/>', "part.xml"),
        ('<shape type="sphere"><bsdf type="diffuse"><spectrum name="reflectance" filename="part.spd"/></bsdf>'
         "</shape>", "part.spd"),
        ('<emitter type="envmap"><string name="filename" value="part.exr"/></emitter>', "part.exr"),
    ],
)  # fmt: skip
def test_a_reference_belongs_to_all_files_of_its_scene(tmp_path: Path, element: str, name: str) -> None:
    of = Variant(tmp_path / "mine.xml")
    of.path.write_text(f'<scene version="3.0.0">{element}</scene>', encoding="utf-8")
    (tmp_path / name).write_text('<scene version="3.0.0"/>', encoding="utf-8")
    entry = {"hash": scene_hash(of.path), "height": 8, "width": 16, "batches": 64, "spp": 256, "skewness": {}}
    references.write_reference(of, MEAN, VARIANCE, entry)
    assert references.is_fresh(of)
    (tmp_path / name).write_text('<scene version="3.0.0"> </scene>', encoding="utf-8")
    assert not references.is_fresh(of)
    (tmp_path / name).unlink()
    with pytest.raises(ReferenceError_, match=f"{name}: No such file"):
        references.require(of)


@pytest.mark.parametrize("text", [MINE.replace("box", "gaussian"), MINE.replace('<rfilter type="box"/>', "")])
def test_the_scalar_variants_make_none_of_other_filters(tmp_path: Path, text: str) -> None:
    """They look the gaussian up in a table of 31 steps."""
    path = tmp_path / "mine.xml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(
        NotFound, match=r"mine.xml:\d: the reference of a gaussian filter is rendered by Mitsuba's llvm"
    ):
        mitsuba.MitsubaBatches(Variant(path), "scalar_rgb")


def test_pixels_that_share_samples_have_the_variance_of_their_tiles() -> None:
    """Blurred noise: neighbours vary together, and the mean of a tile more than by its pixels alone."""
    noise = np.random.default_rng(7).normal(1, 1, (400, 18, 18, 3))
    blurred = sum(noise[:, i : i + 16, j : j + 16] for i in range(3) for j in range(3)) / 9
    tiles = blurred.reshape(400, 2, 8, 2, 8, 3).mean(axis=(2, 4)).var(axis=0, ddof=1) / 400
    for shared in (False, True):
        _, variance, _ = making.accumulate(iter(blurred), shared=shared)
        by_pixels = variance.reshape(2, 8, 2, 8, 3).sum(axis=(1, 3)) / 64**2
        ratio = by_pixels.mean() / tiles.mean()
        assert ratio == pytest.approx(1, rel=1e-6) if shared else ratio < 0.2


def test_what_is_rounding_of_weights_is_no_difference() -> None:
    """Two black pixels of a picture with a lamp: Mitsuba gives them up to 1e-8 of it where a filter ends."""
    images = np.zeros((4, 8, 8, 3))
    images[:, 0, 0] = 5.0
    images[:, 7, 7] = 1e-8
    mean, variance, _ = making.accumulate(
        iter(images + 1e-3 * np.arange(4)[:, None, None, None] * images), shared=True
    )
    assert 1e-8 < 3 * np.sqrt(variance[7, 7]).max() < 1e-5 and mean[7, 7].max() == pytest.approx(
        1e-8, rel=0.01
    )


# ---- how long it takes


@dataclass
class Fake:
    """Batches of one spread and mean; `seconds` for each sample per pixel."""

    mean: Array
    seconds: float = 0.0
    made_by: Mapping[str, str] = field(default_factory=lambda: {"mitsuba_version": "4.0.0"})
    taken: list[int] = field(default_factory=list)

    def batches(self, first: int, count: int, spp: int) -> Iterator[Array]:
        for batch in range(first, first + count):
            self.taken.append(batch)
            time.sleep(self.seconds * spp)
            noise = np.random.default_rng(batch).normal(size=self.mean.shape) / np.sqrt(spp)
            yield self.mean + 0.1 * noise


SMALL = making.Goal(small_batches=16, min_batches=8, image=1e-3, tile=1.0)


def test_the_time_told_counts_from_the_start() -> None:
    """4 samples a batch before, 256 afterwards, and what was done before that."""
    renderer = Fake(MEAN, seconds=1e-4)
    began = time.perf_counter() - 10
    plan = making.make_plan(renderer, SMALL, began=began)
    before = 10 + (17 * 4 + 2 * 256) * 1e-4
    assert before < plan.spent < before + 8
    assert plan.total == plan.spent + plan.seconds
    assert making.make_plan(renderer, SMALL).spent < 8


def test_the_time_that_it_may_take_counts_from_the_start() -> None:
    """Of 20 s 15 are left: 585 batches of 25.6 ms, and never fewer than the least."""
    renderer = Fake(MEAN, seconds=1e-4)
    goal = making.Goal(small_batches=16, min_batches=8, image=1e-6, tile=1.0, most_seconds=20)
    late = making.make_plan(renderer, goal, began=time.perf_counter() - 5)
    assert 200 * 256 < late.spp < 600 * 256
    assert making.make_plan(renderer, goal, began=time.perf_counter() - 30).spp == 8 * 256
    few = making.Goal(small_batches=16, min_batches=8, image=1e-4, tile=1.0)
    plan = making.make_plan(renderer, few)
    assert 8 * 256 < plan.spp < 100 * 256
    short = replace(few, most_seconds=10 * plan.seconds)
    assert making.make_plan(renderer, short, began=time.perf_counter() - short.most_seconds).spp == 8 * 256


# ---- what another version changes


@pytest.fixture(scope="module")
def mine(tmp_path_factory: pytest.TempPathFactory) -> Variant:
    """A scene with a small reference by Mitsuba."""
    of = Variant(tmp_path_factory.mktemp("drift") / "mine.xml")
    of.path.write_text(MINE, encoding="utf-8")
    goal = making.Goal(image=1e-3, tile=1e-2, spp_per_batch=64, small_batches=64, min_batches=64)
    renderer = mitsuba.MitsubaBatches(of, "scalar_rgb")
    making.make_reference(of, renderer, making.make_plan(renderer, goal), goal)
    return of


def changed(mine: Variant, folder: Path, change: Callable[[dict[str, Any], Array], Array]) -> Variant:
    """A copy of the scene with another reference."""
    of = Variant(folder / "mine.xml")
    of.path.write_bytes(mine.path.read_bytes())
    found = references.load_reference(mine)
    entry = dict(found.entry)
    references.write_reference(of, change(entry, found.mean), found.variance_of_mean, entry)
    return of


def test_new_batches_share_no_seed_with_the_reference(mine: Variant) -> None:
    entry = references.require(mine)
    renderer = Fake(references.load_reference(mine).mean)
    found = drift.measure(mine, renderer, 0.1)
    assert min(renderer.taken) == 64 + entry["batches"] and max(renderer.taken) < 64 + entry["batches"] + 64
    assert (found.before, found.now, found.same_version) == (INSTALLED, "Mitsuba 4.0.0", False)


@pytest.mark.parametrize(("factor", "outcome"), [(1.0, "PASS"), (1.03, "FAIL"), (0.97, "FAIL")])
def test_a_drift_is_noticed_and_measured(mine: Variant, factor: float, outcome: str) -> None:
    mean = references.load_reference(mine).mean
    found = drift.measure(mine, Fake(mean * factor), 1.0)
    judged = found.judgement
    assert judged.outcome == outcome
    assert judged.bias_low < factor - 1 < judged.bias_high and judged.bias == pytest.approx(
        factor - 1, abs=5e-3
    )


def test_the_command_compares_versions(mine: Variant, tmp_path: Path) -> None:
    def older(entry: dict[str, Any], mean: Array) -> Array:
        entry["mitsuba_version"] = "3.8.0"
        return mean

    def brighter(entry: dict[str, Any], mean: Array) -> Array:
        return mean * 1.05

    for name in ("same", "older", "brighter"):
        (tmp_path / name).mkdir()
    paths = [mine.path, changed(mine, tmp_path / "older", older).path,
             changed(mine, tmp_path / "brighter", brighter).path]  # fmt: skip
    done = command("--drift", "--seconds", "2", *paths)
    same, old, differs = done.stdout.splitlines()
    assert done.returncode == 1, done.stderr
    assert same.startswith("mine: the same, ") and same.endswith(f"both by {INSTALLED}")
    assert old.startswith("mine: the same, ") and old.endswith(f"{INSTALLED} after Mitsuba 3.8.0")
    assert differs.startswith("mine: differs, −4.") and "of the image" in differs


def test_a_reference_by_oneray_cannot_drift(mine: Variant, tmp_path: Path) -> None:
    def by_oneray(entry: dict[str, Any], mean: Array) -> Array:
        del entry["mitsuba_version"]
        entry["renderer"] = "oneray"
        return mean

    done = command("--drift", changed(mine, tmp_path, by_oneray).path)
    assert done.returncode == 2 and "its reference is not Mitsuba's, but oneray's" in done.stderr
    assert command("--drift", "--by", "oneray").returncode == 2


def test_one_thread_reads_openexr() -> None:
    """Mitsuba's pool of one thread waits for itself where a scene has an OpenEXR file."""
    pytest.importorskip("mitsuba")
    orders = [
        {"load": str(variant("environment").path)},
        {"render": 1, "seed": 1, "save": None},
    ]
    done = subprocess.run(
        [sys.executable, "-m", "raycheck.renderers.mitsuba_worker", "scalar_rgb"],
        input="".join(json.dumps(order) + "\n" for order in orders), capture_output=True, text=True,
        check=True, timeout=100,
    )  # fmt: skip
    assert [set(json.loads(line)) >= {"seconds"} for line in done.stdout.splitlines()[1:]] == [True, True]
