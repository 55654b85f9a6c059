"""The benchmark measures what it says, and the README and the report show it. No test judges a speed."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from raycheck.base.errors import NotFound
from raycheck.base.site import Site
from raycheck.measuring import log_log, report, speed

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

from benchmark import put  # noqa: E402
from benchmark_contestants import Failed, Mitsuba, Oneray, Render, oneray_contestants, spp_for  # noqa: E402
from benchmark_growth import exponent  # noqa: E402
from benchmark_measure import Entry, best_of, path_variances, row, run_rounds, spread, variance_error  # noqa: E402
from benchmark_scenes import SCENES, displaced_ball, rings_for  # noqa: E402


def benchmark(*words: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(ROOT / "scripts/benchmark.py"), *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert "Traceback" not in done.stderr, done.stderr
    return done


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What --quick writes."""
    file = tmp_path_factory.mktemp("benchmark") / "benchmark.json"
    done = benchmark("--quick", "--rounds", 3, "--json", file)
    assert done.returncode == 0, done.stderr
    assert "cornell-2: Cornell box, direct light; 128 × 128, 3 rounds" in done.stdout
    assert "seconds grow with exponent" in done.stdout
    assert "round 3 of 3" in done.stderr
    return file


def test_every_contestant_has_figures(quick: Path) -> None:
    found = speed.read(quick)
    assert found["complete"] and found["machine"]["processor"] and "--quick" in found["command"]
    (scene,) = found["scenes"]
    names = [one["name"] for one in scene["contestants"]]
    assert names[0] == speed.BASELINE
    assert {"mitsuba scalar", "oneray double", "oneray single"} < set(names)
    assert all(one["status"] == "ok" for one in scene["contestants"])
    for one in scene["contestants"]:
        for figure in one["figures"].values():
            assert 0 < figure["min"] <= figure["median"] <= figure["max"]
        assert one["peak_memory_bytes"] > 1e6
        assert abs(one["difference"]["sigmas"]) < 6, one["name"]
    assert {one["name"] for one in scene["startup"]} > {"oneray double", "mitsuba llvm"}
    assert all(one["total"]["min"] > 0 for one in scene["startup"])


def test_a_process_is_charged_with_its_own_memory_alone(quick: Path) -> None:
    """A Cornell box takes oneray a few megabytes, though Python with numpy starts it."""
    (scene,) = speed.read(quick)["scenes"]
    peak = {one["name"]: one["peak_memory_bytes"] for one in scene["contestants"]}
    assert peak["oneray double"] < 15e6


def test_ratios_are_those_of_the_figures(quick: Path) -> None:
    """In each round; and efficiency is 1/(variance · time)."""
    (scene,) = speed.read(quick)["scenes"]
    base = scene["contestants"][0]["rounds"]
    for one in scene["contestants"]:
        rounds = one["rounds"]
        assert np.allclose(rounds["efficiency"], np.divide(rounds["paths_per_second"], rounds["variance"]))
        paths = scene["width"] * scene["height"] * one["spp"]
        assert np.allclose(rounds["paths_per_second"], paths / np.array(rounds["seconds"]))
        for key, ratio in one["ratios"].items():
            assert ratio == pytest.approx(spread(list(np.divide(rounds[key], base[key]))))
    assert all(value == 1 for ratio in scene["contestants"][0]["ratios"].values() for value in ratio.values())


def test_the_pilot_says_what_it_chose_among(quick: Path) -> None:
    (scene,) = speed.read(quick)["scenes"]
    names = [one["name"] for one in scene["contestants"]]
    for variant, outcome in scene["pilot"].items():
        assert len(outcome) == 5
        assert [one["cost"] for one in outcome] == sorted(one["cost"] for one in outcome)
        assert f"{variant} {best_of(outcome)}" in names


def test_the_page_and_the_table_show_it(quick: Path, tmp_path: Path) -> None:
    found = report.speed_section(quick)
    page = Site(tmp_path).page("speed", "Speed", "speed.html", data=True, speed=found)
    shown = page.read_text(encoding="utf-8")
    assert shown.count('class="plot"') == len(found["drawn"]) == 1
    assert [len(one["xs"]) > 1 for one in found["drawn"][0]["curves"]] == [True] * 3
    assert "oneray single: exponent" in shown and "http" not in shown
    assert "| Cornell box, direct light | " in speed.markdown(speed.read(quick))


def rendered(images: np.ndarray, spp: int, seconds: float = 1.0) -> list[Render]:
    return [Render(image, spp, seconds, 0.0, None, 0, "") for image in images]


def test_variance_of_a_path() -> None:
    """Pictures of 16 samples with variance 4 and mean 2 each: 4/2²."""
    images = np.random.default_rng(3).normal(2, 2 / np.sqrt(16), size=(5, 64, 64, 3))
    found = path_variances(rendered(images, 16))
    assert np.mean(found) == pytest.approx(1, rel=0.03)
    assert np.mean(found) == pytest.approx(16 * images.var(axis=0, ddof=1).mean() / images.mean() ** 2)


def test_the_error_of_a_variance() -> None:
    """It is how much variances of other pictures scatter, though a few pixels have most of it."""
    scale = np.ones((16, 16, 1))
    scale[0, :8] = 10
    generator = np.random.default_rng(4)
    trials = [rendered(1 + scale * generator.normal(0, 0.1, (5, 16, 16, 1)).repeat(3, axis=3), 1)
              for _ in range(400)]  # fmt: skip
    variances = [
        np.mean([one.image for one in trial]) ** 2 * np.mean(path_variances(trial)) for trial in trials
    ]
    real = np.std(variances) / np.mean(variances)
    assert np.sqrt(np.mean([variance_error(trial) ** 2 for trial in trials])) == pytest.approx(real, rel=0.15)


class Slow:
    """A renderer that takes `fixed` seconds before its first sample and `each` for one."""

    name = "slow"

    def __init__(self, fixed: float, each: float) -> None:
        self.fixed, self.each = fixed, each

    def open(self, scene: Path) -> None: ...
    def close(self) -> None: ...

    def render(self, spp: int, seed: int) -> Render:
        return rendered(np.ones((1, 2, 2, 3)), spp, self.fixed + spp * self.each)[0]


@pytest.mark.parametrize(
    ("fixed", "each", "spp"), [(0, 0.01, 50), (0.2, 0.01, 80), (0, 1e-9, 4096), (9, 0.1, 40)]
)
def test_samples_for_a_time(fixed: float, each: float, spp: int) -> None:
    """Half a second; four times what comes before the first sample; never more than four seconds."""
    assert spp_for(Slow(fixed, each), 0.5) == pytest.approx(spp, abs=1)


def test_exponent() -> None:
    """The last decade where it has four points, else the last two; a flat start is left out."""
    assert exponent([1, 10, 100, 1000], [5, 7, 49, 343])["value"] == pytest.approx(np.log10(7))
    steep = exponent([1, 2, 4, 8, 16, 32, 64], [9, 9, 9, 64, 256, 1024, 4096])
    assert (steep["points"], steep["from"]) == (4, pytest.approx(8))
    assert steep["value"] == pytest.approx(2) and steep["error"] < 1e-9
    assert exponent([1, 10], [1, 2]) is None
    noisy = [exponent(2.0 ** np.arange(4), 2.0 ** (np.arange(4) + np.random.default_rng(i).normal(0, 0.1, 4)))
             for i in range(400)]  # fmt: skip
    spread_of_values = np.std([one["value"] for one in noisy])
    assert np.sqrt(np.mean([one["error"] ** 2 for one in noisy])) == pytest.approx(spread_of_values, rel=0.15)


class Fails:
    """A contestant that fails at its second round."""

    name = "fails"

    def __init__(self) -> None:
        self.renders = 0

    def open(self, scene: Path) -> None: ...
    def close(self) -> None: ...

    def render(self, spp: int, seed: int) -> Render:
        self.renders += 1
        if self.renders > 2:
            raise Failed("out of paper")
        return rendered(np.ones((1, 2, 2, 3)), spp)[0]


class Works(Fails):
    name = "works"

    def render(self, spp: int, seed: int) -> Render:
        return rendered(np.random.default_rng(seed).random((1, 2, 2, 3)), spp)[0]


def test_a_failure_costs_one_row() -> None:
    entries = [Entry(Works(), 1), Entry(Fails(), 1)]
    run_rounds(SCENES[0], entries, 3, 0.1, lambda line: None)
    works, fails = (row(entry, entries[0], None) for entry in entries)
    assert works["status"] == "ok" and len(works["rounds"]["seconds"]) == 3
    assert fails == {"name": "fails", "status": "failed", "reason": "out of paper"}


def test_a_crash_and_a_mistake_are_failures(oneray: Path, tmp_path: Path) -> None:
    bad = tmp_path / "bad.xml"
    bad.write_text("<scene")
    with pytest.raises(Failed, match=r"bad\.xml"):
        _render_once(Oneray("oneray"), bad)
    with pytest.raises(Failed):
        _render_once(Mitsuba("mitsuba", "scalar_rgb"), bad)
    with pytest.raises(Failed):
        _render_once(Mitsuba("mitsuba", "no_such_variant"), SCENES[0].write(tmp_path))


def _render_once(contestant: Oneray | Mitsuba, scene: Path) -> None:
    contestant.open(scene)
    contestant.render(1, 1)


def test_a_part_that_is_measured_again_takes_its_old_place() -> None:
    found = [{"name": "a", "x": 1}, {"name": "b", "x": 1}]
    put(found, {"name": "a", "x": 2}, "name")
    put(found, {"name": "c", "x": 2}, "name")
    assert [(one["name"], one["x"]) for one in found] == [("a", 2), ("b", 1), ("c", 2)]


def test_contestants_are_what_the_build_offers() -> None:
    """auto and sobol join where --help has them."""
    names = [one.name for one in oneray_contestants("  --precision double*|single\n", (), ())]
    assert names == ["oneray double", "oneray single"]
    offer = "  --precision auto*|double|single\n  --sampler\n      sobol   good\n"
    assert {"oneray auto", "oneray double sobol"} < {x.name for x in oneray_contestants(offer, (), ())}
    learned = oneray_contestants("", ("--roulette", "none"), ("learned",))[-1]
    assert isinstance(learned, Oneray)
    assert learned.options[-4:] == ("--light-choice", "learned", "--roulette", "none")


def test_displaced_ball_is_closed_and_turned_outwards() -> None:
    """Every edge has two triangles, and the enclosed volume is positive, near a ball's."""
    points, faces = displaced_ball(rings_for(2000))
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    assert {tuple(e) for e in edges} == {tuple(e[::-1]) for e in edges} and len(faces) in range(1900, 2100)
    a, b, c = (points[faces[:, i]].astype(float) for i in range(3))
    assert np.sum(a * np.cross(b, c)) / 6 == pytest.approx(4 / 3 * np.pi, rel=0.1)


def test_curves_are_handed_on_as_they_are() -> None:
    """Each with a colour, and a shape, of its own, also beside one that has no points."""
    drawn = log_log.log_log({"": [], "a": [(1, 2), (10, 20)], "b": [(1, 3)]}, "<x>", "seconds", plain=["b"])
    a, b = drawn["curves"]
    assert (a["xs"], a["ys"], b["ys"]) == ([1, 10], [2, 20], [3]) and drawn["x"] == "<x>"
    assert a["colour"] == 1 and b["colour"] == 2 and b["plain"] and not a["plain"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--scene", "nowhere"], "benchmark: no scene 'nowhere'; there are cornell-2"),
        (["--rounds", 1], "benchmark: --rounds is at least 2"),
        (["--seconds", 0], "benchmark: --seconds is above 0"),
        (["--seconds", "nan"], "benchmark: --seconds is above 0"),
        (["--core", 4096], "benchmark: there is no core 4096"),
        (["--json", "/no/such/folder/x.json"], "benchmark: /no/such/folder/x.json: no such folder"),
        (["--no-growth", "--growth-only"], "benchmark: --no-growth and --growth-only leave nothing"),
        (["--commands-only", "--growth-only"], "benchmark: --commands-only and --growth-only leave nothing"),
        (["--fast"], "benchmark: unrecognized arguments: --fast"),
    ],
)
def test_bad_input_is_one_line(words: list[object], message: str) -> None:
    done = benchmark(*words)
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.startswith(message) and done.stderr.count("\n") == 1


def test_another_file_is_no_benchmark(tmp_path: Path) -> None:
    file = tmp_path / "x.json"
    for content in ("{", "[]", json.dumps({"scenes": 1, "growth": []})):
        file.write_text(content)
        with pytest.raises(NotFound, match=r"x\.json: no result of scripts/benchmark\.py"):
            speed.read(file)
