"""Grading: what is asked, what is handed in, what crosses the border, and what it is worth."""

import csv
import io
import json
import math
import os
import re
import subprocess
import sys
import tarfile
import time
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import jsonschema
import junitparser
import numpy as np
import pytest
from gradings import need, written
from typer.testing import CliRunner

from raycheck.base.errors import NotFound, RenderLate, RenderTimeout
from raycheck.base.images import Image, write_pfm
from raycheck.commands.app import app
from raycheck.grading import attacks, course, hidden, points, speed
from raycheck.grading import judge as judge_module
from raycheck.grading.assignment import read_assignment
from raycheck.grading.jail import sandbox
from raycheck.grading.jail.limits import Limits
from raycheck.grading.jail.pixels import Decoder
from raycheck.grading.jail.sandbox import Jail, Tier
from raycheck.grading.judge import Attempt, Grader
from raycheck.grading.keys import Keys, digest_of, read_keys
from raycheck.grading.program import Program, Taken
from raycheck.grading.results import SceneResult, StudentResult, TaskResult
from raycheck.grading.submission import Submission, SubmissionError, may_have_pictures, open_submission
from raycheck.grading.written import tables
from raycheck.grading.written.gradescope import failed_json, results_json
from raycheck.grading.written.pages import clusters, course_page, student_page
from raycheck.judging import checks
from raycheck.judging.settings import PILOT_IMAGES
from raycheck.renderers import builds
from raycheck.renderers.renderer import Rendering
from raycheck.scene import export, variants
from raycheck.stats.verdict import Outcome
from raycheck.truth import references
from raycheck.truth.making import Goal

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "scripts"))
import example_class  # noqa: E402

TASKS = """\
name = "small"
delta = 0.05
[[task]]
id = "L1"
lecture = "L1"
scenes = ["point-light"]
points = 4
spp = 4
hint = "Divide by d²."
"""
AREA = """\
[[task]]
id = "L3"
lecture = "L3"
scenes = ["area-light"]
points = 4
spp = 4
technique = "nee"
noise_points = 2
"""


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name = 3", "no \\[\\[task\\]\\]"),
        ('[[task]]\nid = "a"\nscenes = ["point-light"]\npoints = 1', "'name' is missing"),
        ('name = "a"\n[[task]]\nid = "a"\nscenes = ["no-such"]\npoints = 1', "no scene 'no-such'"),
        ('name = "a"\n[[task]]\nid = "a"\nscenes = ["point-light"]\npoints = "1"', "points is '1', float"),
        ('name = "a"\n[[task]]\nid = "a"\nscenes = ["point-light"]\npoint = 1', "unknown key 'point'"),
        (TASKS + TASKS[TASKS.index("[[task") :], "two tasks have the id 'L1'"),
        (TASKS + "noise_points = 1\n", "need the technique"),
        (TASKS + 'technique = "no-such"\n', "no technique 'no-such'"),
        ("name = ", "not TOML"),
        (TASKS.replace("delta = 0.05", 'inconclusive = "never"'), "inconclusive is 'never'"),
        ('name = "a"\n[task]\nid = "a"', "tasks are written \\[\\[task\\]\\]"),
        (TASKS.replace('["point-light"]', '"point-light"'), "scenes is 'point-light', a list of strings is"),
        (TASKS.replace("points = 4", "points = nan"), "points is nan, a number is wanted"),
        ("limits = 3\n" + TASKS, "limits is 3, a table"),
        (TASKS + "[limits]\nmemory_mb = 0\n", "memory_mb is 0, more than 0"),
        (TASKS + '[limits]\nreadable = ["/no/such"]\n', "readable: there is no folder /no/such"),
        (TASKS + "noise_limit = 0\n", "noise_limit is wanted to be more than 0"),
    ],
)
def test_what_is_wrong_with_an_assignment_is_said(tmp_path, text: str, words: str) -> None:
    with pytest.raises(NotFound, match=words):
        read_assignment(written(tmp_path / "a.toml", text))


def test_the_example_assignment_is_one() -> None:
    assignment = read_assignment(ROOT / "docs/lecture12.toml")
    assert assignment.most == 100
    assert {task.lecture for task in assignment.tasks} == {f"L{n}" for n in range(1, 17)}


def test_an_archive_is_unpacked_below_its_folder_alone(tmp_path) -> None:
    (tmp_path / "class").mkdir()
    for name, words in attacks.hostile_archives(tmp_path / "class").items():
        archive = next((tmp_path / "class").glob(f"{name}.*"))
        (tmp_path / name / "into").mkdir(parents=True)
        with pytest.raises(SubmissionError, match=words):
            open_submission(archive, tmp_path / name / "into")
    assert not list(tmp_path.rglob("escaped.txt"))


def broken_archives(folder: Path) -> Iterator[tuple[Path, str]]:
    """Archives that make Python's readers raise something of their own, or whose names are no text."""
    link = tarfile.TarInfo("\udcdcbung")
    link.type, link.linkname = tarfile.SYMTYPE, "x"
    with tarfile.open(folder / "link.tar", "w", encoding="latin-1", errors="surrogateescape") as archive:
        archive.addfile(link)
    yield folder / "link.tar", "is a link or a device"
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("render.cpp", "int main() {}" * 100)
    data = whole.getvalue()
    central = data.index(b"PK\x01\x02")
    for name, at, value in (("version", central + 6, 99), ("deflate", data.index(b"cpp") + 4, 0xFF)):
        path = folder / f"{name}.zip"
        path.write_bytes(data[:at] + bytes([value]) * 3 + data[at + 3 :])
        yield path, "cannot be unpacked"


def test_what_cannot_be_unpacked_is_said_and_ends_nothing(tmp_path) -> None:
    """Of the student that handed it in; whether there may be pictures is asked before, of all."""
    for path, words in broken_archives(tmp_path):
        (into := tmp_path / path.stem).mkdir()
        with pytest.raises(SubmissionError, match=words) as caught:
            open_submission(path, into)
        assert str(caught.value).encode()
        assert may_have_pictures(path, "L1") in (True, False)


def test_names_that_are_no_text_are_names(tmp_path) -> None:
    """Of files, which a Latin-1 system wrote, and of students."""
    name = os.fsdecode(b"\xdcbung.cpp")
    with tarfile.open(tmp_path / "a.tar", "w", errors="surrogateescape") as archive:
        archive.addfile(tarfile.TarInfo(name))
    (into := tmp_path / "into").mkdir()
    assert (open_submission(tmp_path / "a.tar", into).folder / name).is_file() and len(digest_of(into)) == 64
    (folder := tmp_path / "class").mkdir()
    for name in (b"J\xfcrgen", b"team_1", b"team_2", b"Eve_12_assignsubmission_file", b"bob_LATE_3_4_b.zip"):
        (folder / os.fsdecode(name)).mkdir()
    students = [entry.student for entry in course.entries(folder, [])]
    assert students == ["Eve", "J\ufffdrgen", "bob", "team_1", "team_2"]


def test_a_manifest_is_commands_and_pictures_are_files(tmp_path) -> None:
    written(tmp_path / "raycheck.toml", 'command = "./mine\\u0000 {output}"')
    (into := tmp_path.with_name("into-nul")).mkdir()
    with pytest.raises(SubmissionError, match="NUL byte"):
        open_submission(tmp_path, into)
    (tmp_path / "pictures/L1/a.exr").mkdir(parents=True)
    assert Submission(tmp_path).pictures("L1") == []


def test_a_folder_in_an_archive_is_the_submission(tmp_path) -> None:
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr("mine/raycheck.toml", 'command = "./mine {output}"')
        archive.writestr("__MACOSX/mine", "")
    (tmp_path / "into").mkdir()
    found = open_submission(tmp_path / "a.zip", tmp_path / "into")
    assert found.folder == tmp_path / "into/mine" and found.manifest.command == "./mine {output}"


def test_speed_is_a_ratio_with_an_interval_and_earns_points_up_to_a_limit(tmp_path) -> None:
    rng = np.random.default_rng(3)
    pairs = [(0.2 * math.exp(rng.normal(0, 0.1)), 0.1) for _ in range(8)]
    found = speed.ratio_of(pairs, "nee")
    assert found.low < 2 < found.high and found.high / found.low < 1.5 and found.technique == "nee"
    text = TASKS + 'technique = "nee"\nspeed_points = 3\nspeed_limit = '
    for limit, earns in ((0.5 * found.low, 0.0), (1.01 * found.low, 3.0), (2 * found.high, 3.0)):
        assignment = read_assignment(written(tmp_path / "a.toml", f"{text}{limit}\n"))
        scene = SceneResult("point-light", False, Outcome.PASS, "no bias", speed=asdict(found))
        task = points.earned(assignment, assignment.tasks[0], [scene])
        assert (task.points, task.speed_points, task.most) == (4 + earns, earns, 7)
        assert ("too slow" in task.comment) == (not earns)
        failed = replace(scene, verdict=Outcome.FAIL)
        assert points.earned(assignment, assignment.tasks[0], [failed]).points == 0
    assert read_assignment(written(tmp_path / "b.toml", TASKS)).tasks[0].most == 4


@pytest.mark.parametrize("tier", [Tier.BUBBLEWRAP, Tier.LANDLOCK])
def test_speed_is_measured_beside_oneray_in_the_same_jail(tmp_path, oneray: Path, monkeypatch, tier) -> None:
    need(tier)
    monkeypatch.setenv("ONERAY", str(oneray))
    example_class.write(tmp_path, read_assignment(ROOT / "docs/lecture12.toml"), ("one-scene",))
    text = TASKS + 'technique = "nee"\nspeed_points = 0\n'
    grader = Grader.prepare(read_assignment(written(tmp_path / "a.toml", text)), tier)
    compare = speed.compare
    again = lambda *what: compare(*what)[0] and compare(*what)  # noqa: E731  as after a late picture
    monkeypatch.setattr(speed, "compare", again)
    [task] = grader.grade(tmp_path / "one-scene", "one-scene").tasks
    assert task.points == task.most == 4, task.comment
    found = task.scenes[0].speed
    assert 0.2 < found["low"] <= found["ratio"] <= found["high"] < 20 and found["seconds"] > 0
    assert "what oneray's nee takes" in task.comment and "points for speed" not in task.comment


def test_a_hidden_variant_is_another_picture_and_not_to_be_guessed() -> None:
    of = variants.variant("area-light")
    one, other = (hidden.vary(of, "area-light/0/0", Keys("a", secret)) for secret in (b"1", b"2"))
    assert one == hidden.vary(of, "area-light/0/0", Keys("a", b"1"))
    assert len({one, other, of.path.read_text(encoding="utf-8")}) == 3


LECTURE = read_assignment(ROOT / "docs/lecture12.toml")
"""The assignment that ships."""


def test_every_task_that_ships_has_hidden_variants() -> None:
    assert all(task.hidden for task in LECTURE.tasks)
    assert not any(task.noise_points > 0 or task.speed_points > 0 for task in LECTURE.tasks)


@pytest.mark.parametrize("label", sorted({scene for task in LECTURE.tasks for scene in task.scenes}))
def test_a_hidden_variant_changes_what_interpolation_cannot_follow(tmp_path, label: str) -> None:
    """Colours of lights and surfaces, sizes or places, where the camera is and what it sees, long paths."""
    of = variants.variant(label)
    made = variants.variant(written(tmp_path / "variant.xml", hidden.vary(of, "x", Keys("a", b"secret"))))
    before, after = export.export(of), export.export(made)
    cameras = [scene["camera"] for scene in (before, after)]
    assert cameras[0]["origin"] != cameras[1]["origin"]
    heights = [np.array(camera["origin"]) for camera in cameras]
    assert np.abs(heights[0] - heights[1]).min() > 0, "turned about the axis and raised"
    places = ("corner", "edge_u", "edge_v", "radius", "center", "position")
    shapes = [
        [[one.get(key) for key in places] for one in (*scene["primitives"], *scene["lights"])]
        for scene in (before, after)
    ]
    assert shapes[0] != shapes[1]
    depths = [scene["max_depth"] or 0 for scene in (before, after)]
    assert depths[1] < depths[0] if depths[0] >= hidden.LONG else depths[1] == depths[0]
    root, varied = of.document().resolved(), made.document().resolved()
    for what in ("reflectance", "radiance", "intensity"):
        colours = [[e.get("value") for e in r.iter("rgb") if e.get("name") == what] for r in (root, varied)]
        black = ("0", "0, 0, 0")
        pairs = [pair for pair in zip(*colours, strict=True) if pair[0] not in black]
        assert all(one != other for one, other in pairs)
    fovs = [next(e.get("value") for e in r.iter("float") if e.get("name") == "fov") for r in (root, varied)]
    assert fovs[0] != fovs[1]


MATERIALS = read_assignment(ROOT / "docs/materials.toml")


@pytest.mark.parametrize(
    "label", sorted({scene for one in (LECTURE, MATERIALS) for task in one.tasks for scene in task.scenes})
)
def test_bodies_and_lamps_change_their_shape_within_where_they_were(tmp_path, label: str) -> None:
    """No stored light map follows that, and no surface comes to lie where another is."""
    of = variants.variant(label)
    hidden._copy_meshes(of, tmp_path)
    made = variants.variant(written(tmp_path / "variant.xml", hidden.vary(of, "x", Keys("a", b"1"))))
    pairs = zip(*(export.export(one)["primitives"] for one in (of, made)), strict=True)
    changed = [(old, new) for old, new in pairs if old != new]
    for old, new in (pair for pair in changed if pair[0]["type"] == "sphere"):
        apart = np.linalg.norm(np.subtract(old["center"], new["center"]))
        assert 0 < apart <= old["radius"] - new["radius"] + 1e-5
    flat = [pair for pair in changed if pair[0]["type"] == "parallelogram"]
    before, after = (np.array([corners(pair[i]) for pair in flat]).reshape(-1, 4, 3) for i in (0, 1))
    for number, (old, _) in enumerate(flat):
        lamp = any(old["radiance"])
        own = np.s_[number : number + 1] if lamp else np.s_[:]
        ends = [[f(of[own] @ np.array(old[edge])) for of in (before, after)] for edge in ("edge_u", "edge_v")
                for f in (np.max, lambda x: -np.min(x))]  # fmt: skip
        assert all(new <= old + 1e-4 for old, new in ends)
        off = (after[number] - before[number]) @ np.array(old["normal"])
        assert not lamp or np.allclose(off, 0, atol=1e-5)
    shapes = [[np.linalg.norm(new[e]) / np.linalg.norm(old[e]) for e in ("edge_u", "edge_v")]
              for old, new in flat]  # fmt: skip
    assert all(u != pytest.approx(v, rel=1e-4) for u, v in shapes)
    assert changed or label == "point-light"


def corners(face: dict) -> list[np.ndarray]:
    at, u, v = (np.array(face[key]) for key in ("corner", "edge_u", "edge_v"))
    return [at, at + u, at + v, at + u + v]


def test_the_secret_is_kept_and_is_the_owner_s_alone(tmp_path) -> None:
    keys = read_keys(tmp_path / "a.toml", "a")
    assert read_keys(tmp_path / "a.toml", "a") == keys and len(keys.secret) == 32
    assert (tmp_path / "a.private").stat().st_mode & 0o077 == 0
    assert keys.number("x", hidden=True) != Keys("a", b"other").number("x", hidden=True)
    assert keys.number("x", hidden=False) == Keys("a", b"other").number("x", hidden=False)


def a_result(verdict: Outcome, reason: str, pending: float = 0.0) -> StudentResult:
    scene = SceneResult("point-light", False, verdict, reason, mde_image=0.01)
    points = 4.0 if verdict is Outcome.PASS else 0.0
    task = TaskResult("L1", "L1", "L1", verdict, points, pending, 4.0, [scene])
    return StudentResult("<b>Eve</b>", "small", [task], "no sandbox")


def test_what_students_control_is_escaped_everywhere(tmp_path) -> None:
    assignment = read_assignment(written(tmp_path / "a.toml", TASKS))
    result = a_result(Outcome.FAIL, "it said: <script>alert(1)</script>\x00")
    page = student_page(assignment, result)
    assert "<script" not in page and "<b>Eve" not in page and "http" not in page
    [suite] = list(junitparser.JUnitXml.fromstring(tables.junit_xml([result]).encode()))
    assert suite.name == "<b>Eve</b>" and suite.failures == 1
    result.student = "=HYPERLINK(1)"
    assert tables.grades_csv(assignment, [result], []).splitlines()[1].startswith("\"'=HYPERLINK")


def test_an_open_verdict_is_neither_lost_nor_won(tmp_path) -> None:
    found = json.loads(results_json(a_result(Outcome.INCONCLUSIVE, "too noisy", pending=4.0)))
    assert "score" not in found["tests"][0] and "status" not in found["tests"][0]
    assert found["score"] == 0 and "4 points are open" in found["output"]
    passed = json.loads(results_json(a_result(Outcome.PASS, "no bias")))
    assert passed["tests"][0]["status"] == "passed" and passed["score"] == 4


def test_points_for_noise_and_speed_wait_with_an_open_verdict(tmp_path) -> None:
    text = TASKS + 'technique = "nee"\nnoise_points = 2\nspeed_points = 1\n'
    found = {"ratio": 1.0, "low": 0.9, "high": 1.1, "seconds": 0.1}
    noisy = SceneResult("point-light", False, Outcome.INCONCLUSIVE, "too noisy", noise=found)
    late = SceneResult("point-light", False, Outcome.INCONCLUSIVE, "the time was over")
    too_noisy = replace(noisy, noise={"ratio": 9.0, "low": 8.0, "high": 10.0})
    right = SceneResult("point-light", False, Outcome.PASS, "no bias", noise=found)
    for scene, sure, waits in ((noisy, 0, 7), (late, 0, 7), (too_noisy, 0, 5), (right, 6, 1)):
        for inconclusive, share in (('"review"', 0.0), ("0.5", 0.5)):
            asked = read_assignment(written(tmp_path / "a.toml", f"inconclusive = {inconclusive}\n" + text))
            task = points.earned(asked, asked.tasks[0], [scene])
            assert task.points == sure + share * waits and task.pending == (0 if share else waits)
    handed_in = points.earned(asked, asked.tasks[0], [right], executed=False)
    assert (handed_in.points, handed_in.pending, handed_in.executed) == (4, 0, False)


STORED = SceneResult("point-light", True, Outcome.FAIL, "it shows the published scene", stored=True)
RIGHT = SceneResult("point-light", False, Outcome.PASS, "no bias")
WRONG = SceneResult("point-light", False, Outcome.FAIL, "too dark")
OPEN = SceneResult("point-light", False, Outcome.INCONCLUSIVE, "too noisy")


@pytest.mark.parametrize(
    ("shown", "first", "second", "sure", "waits"),
    [
        (RIGHT, RIGHT, RIGHT, 6, 0),
        (RIGHT, STORED, WRONG, 0, 0),  # a stored picture, also as one that ends, hangs or differs elsewhere
        (RIGHT, WRONG, WRONG, 0, 2),
        (RIGHT, OPEN, OPEN, 0, 6),
        (RIGHT, RIGHT, WRONG, 4, 0),
        (RIGHT, RIGHT, OPEN, 4, 2),
        (OPEN, OPEN, OPEN, 0, 6),
        (OPEN, RIGHT, RIGHT, 4, 2),
        (WRONG, WRONG, WRONG, 0, 0),
    ],
)
def test_a_picture_counts_where_hidden_variants_show_that_it_is_not_stored(
    tmp_path, monkeypatch, shown, first, second, sure, waits
) -> None:
    """By what is found of a scene and its two variants; another scene of the task does not matter."""
    text = TASKS.replace('"point-light"', '"point-light", "area-light"').replace("points = 4", "points = 12")
    asked = read_assignment(written(tmp_path / "a.toml", text))
    of, other = (variants.variant(name) for name in ("point-light", "area-light"))
    rendered = [(of, "a", None), (of, "a", of), (of, "a", of), (other, "b", None), (other, "b", other)]
    found = [shown, first, second, RIGHT, RIGHT]
    grader = Grader(replace(asked, tasks=asked.tasks), Keys("a", b"s"), {"L1": rendered}, Tier.NONE)

    def scene(self, task, of, name, varies, attempt, work: Path, share: float) -> SceneResult:
        number = int(work.name.removeprefix("L1-"))
        assert share == pytest.approx(1e6 / (5 - number), rel=1e-3), "what is left, shared by those that wait"
        return replace(found[number], hidden=varies is not None)

    monkeypatch.setattr(Grader, "_scene", scene)
    jail = Jail(Tier.NONE, Limits(), ends=time.perf_counter() + 1e6)
    attempt = Attempt("a", Submission(tmp_path), "x", "", jail, tmp_path, None, lambda: None, 5)
    task = grader._task(asked.tasks[0], attempt)
    share = 12 / 5
    assert task.points == pytest.approx(2 * share + sure / 2 * share, abs=1e-3)
    assert task.pending == pytest.approx(waits / 2 * share, abs=1e-3)


def test_the_leaderboard_shows_noise_and_time_of_what_is_right() -> None:
    result = a_result(Outcome.PASS, "no bias")
    [scene] = result.tasks[0].scenes
    scene.noise, scene.speed = {"ratio": 1.2345}, {"ratio": 8.0}
    expected = [
        {"name": "Points", "value": 4.0},
        {"name": "L1 noise", "value": 1.23, "order": "asc"},
        {"name": "L1 time", "value": 8.0, "order": "asc"},
    ]
    assert json.loads(results_json(result))["leaderboard"] == expected
    schema("tests/gradescope.schema.json").validate(json.loads(results_json(result)))
    result.tasks[0].verdict = Outcome.FAIL
    assert json.loads(results_json(result))["leaderboard"] == expected[:1]


@dataclass
class Noisy(Taken):
    """A right program in a test's own clock: gamma noise on the reference, and seconds for each picture."""

    seconds: Callable[[int, int], float]
    """By samples per pixel and number of the picture."""
    noise: float = 0.8
    bias: Callable[[int], float] = lambda number: 1.0
    """A factor by number of the picture."""
    exchanged: bool = False
    """Whether each tile of 8×8 pixels is upside down."""
    seeds: list[int] = field(default_factory=list)
    task_seconds: float = 300.0
    takes_scene: bool = True
    takes_spp: bool = True
    takes_seed: bool = True

    @property
    def limits(self) -> Limits:
        return Limits(picture_seconds=2.0, task_seconds=self.task_seconds)

    def render(self, scene: Path, spp: int, seed: int, timeout: float) -> Rendering:
        self.check_time()
        number = self.taken.total()
        seconds = self.seconds(spp, number)
        self.seeds.append(seed)
        if seconds > timeout:
            raise RenderLate("no picture: not finished")
        mean = references.load_reference(variants.variant("point-light")).mean
        k = spp / self.noise**2
        grains = np.random.default_rng(seed).gamma(k, 1 / k, (*mean.shape[:2], 1))
        pixels = self.bias(number) * mean * grains
        if self.exchanged:
            pixels = pixels.reshape(-1, 8, *pixels.shape[1:])[:, ::-1].reshape(pixels.shape)
        self.take(spp, seconds, pixels)
        return Rendering(Image(pixels), seconds)


@pytest.mark.parametrize(
    ("seconds", "noise", "verdict", "looks"),
    [
        (lambda spp, number: 1.9 if number == 20 else 0.004 * spp, 2.0, Outcome.PASS, 2),
        (lambda spp, number: 0.004 * spp if spp <= 16 else 2.1, 2.0, Outcome.PASS, 2),
        (lambda spp, number: 0.1 * spp, 2.0, Outcome.INCONCLUSIVE, 1),
        (lambda spp, number: 0.004 * spp if number < 100 else 2.1, 2.0, Outcome.INCONCLUSIVE, 1),
        (lambda spp, number: 0.02 * spp if spp <= 16 else 2.0, 2.0, Outcome.PASS, 2),
        (lambda spp, number: 0.03 * spp if spp <= 16 else 2.0, 2.0, Outcome.PASS, 2),
        (lambda spp, number: 0.004 * spp if number < 73 else 2.1, 0.4, Outcome.PASS, 1),
        (lambda spp, number: 0.004 * spp if spp <= 16 else 2.1, 0.4, Outcome.PASS, 1),
    ],
    ids=[
        "one late picture",
        "slow with more samples",
        "hopeless",
        "too slow at last",
        "slow",
        "very slow",
        "calm",
        "calm, slow",
    ],
)
def test_the_clock_decides_no_verdict(tmp_path, seconds, noise: float, verdict: Outcome, looks: int) -> None:
    """Fresh samples follow where noise wants them, and where they take too long it stays as it was."""
    found = looked_at(tmp_path, Noisy(seconds, noise))
    assert (found.verdict, found.looks) == (verdict, looks), found.reason
    assert found.bias is not None


def looked_at(tmp_path, program: Noisy, **more) -> SceneResult:
    """What is said of point-light with 16 samples per pixel, within 1 %."""
    text = TASKS.replace("delta = 0.05", "delta = 0.01").replace("spp = 4", "spp = 16")
    grader = Grader.prepare(read_assignment(written(tmp_path / "a.toml", text)), Tier.NONE)
    [task] = grader.assignment.tasks
    asked = replace(grader.assignment, limits=program.limits)
    of = variants.variant("point-light")
    return replace(grader, assignment=asked).judge(task, of, "point-light", False, program, "clock", **more)


def test_fresh_samples_follow_until_they_decide(tmp_path) -> None:
    """Each picture has the samples of the assignment, and a seed of its own; not all are kept."""
    program = Noisy(lambda spp, number: 0.001 * spp, noise=4.0)
    found = looked_at(tmp_path, program)
    assert found.verdict is Outcome.PASS and found.looks > 3, found.reason
    assert f"(after {found.looks} looks)" in found.reason
    assert set(program.taken) == {1, 16, 64} and program.taken[64] == judge_module.FEW_IMAGES
    assert program.taken[16] == PILOT_IMAGES + 64 * found.looks > len(program.pictures[16])
    assert len(program.seeds) == len(set(program.seeds))


def test_a_bias_that_one_look_does_not_show_fails_by_many_and_is_confirmed(tmp_path) -> None:
    program = Noisy(lambda spp, number: 0.001 * spp, noise=3.0, bias=lambda number: 1.016)
    found = looked_at(tmp_path, program)
    assert found.verdict is Outcome.FAIL and not found.borderline
    assert found.looks >= 3 and found.bias == pytest.approx(0.016, abs=0.006)


@pytest.mark.parametrize(("noise", "takes_spp"), [(0.005, True), (0.005, False), (0.4, True), (0.4, False)])
def test_noise_that_hides_what_a_task_asks_for_waits_for_a_look(tmp_path, noise: float, takes_spp) -> None:
    """A stored light map passes within delta where noise enough is added, points for noise or not."""
    text = TASKS.replace("spp = 4", "spp = 16") + 'technique = "nee"\n'
    grader = Grader.prepare(read_assignment(written(tmp_path / "a.toml", text)), Tier.NONE)
    program = Noisy(lambda spp, number: 0.001 * spp, noise * (1 if takes_spp else 0.25), takes_spp=takes_spp)
    [task] = grader.assignment.tasks
    found = grader.judge(task, variants.variant("point-light"), "point-light", False, program, "noisy")
    assert found.verdict is (Outcome.PASS if noise < 0.1 else Outcome.INCONCLUSIVE), found.reason
    assert ("times the variance of oneray's nee" in found.reason) == (noise > 0.1)
    assert found.noise is None


@pytest.mark.parametrize("noise", [0.4, 3.0])
def test_exchanged_pixels_fail_and_are_confirmed_however_many_looks(tmp_path, noise: float) -> None:
    found = looked_at(tmp_path, Noisy(lambda spp, number: 0.001 * spp, noise, exchanged=True))
    assert found.verdict is Outcome.FAIL and "does not follow the reference" in found.reason
    assert found.looks >= 2 and not found.borderline


def test_what_fresh_samples_do_not_confirm_is_no_fail(tmp_path) -> None:
    """Here the pictures of the first look alone are biased."""
    first = 1 + PILOT_IMAGES + 64
    program = Noisy(lambda spp, number: 0.01, bias=lambda number: 1.03 if number < first else 1.0)
    found = looked_at(tmp_path, program)
    assert found.verdict is Outcome.PASS and found.borderline and found.looks == 2


@pytest.mark.parametrize(("share", "looks"), [(60.0, 1), (200.0, 3), (math.inf, 5)])
def test_further_looks_leave_their_time_to_other_scenes(tmp_path, share: float, looks: int) -> None:
    """A look takes 26 s; half of what there is remains for confirming a FAIL."""
    found = looked_at(tmp_path, Noisy(lambda spp, number: 0.4, noise=4.5), share=share)
    assert (found.verdict, found.looks) == (Outcome.INCONCLUSIVE, looks), found.reason


def test_time_that_ends_before_the_judged_pictures_leaves_it_open(tmp_path) -> None:
    """Neither noise nor more samples are looked at then."""
    asked = read_assignment(written(tmp_path / "a.toml", TASKS + 'technique = "nee"\nnoise_points = 1\n'))
    program = Noisy(lambda spp, number: 1.2, task_seconds=10.0)
    grader = replace(Grader.prepare(asked, Tier.NONE), assignment=replace(asked, limits=program.limits))
    of = variants.variant("point-light")
    found = grader.judge(asked.tasks[0], of, "point-light", False, program, "clock")
    assert found.verdict is Outcome.INCONCLUSIVE and "were over after 9 pictures" in found.reason


def test_a_late_picture_fails_no_scene_that_passed(tmp_path, monkeypatch) -> None:
    """Speed is measured with more samples, else with the assignment's, else not."""
    grader = Grader.prepare(read_assignment(written(tmp_path / "a.toml", TASKS)), Tier.NONE)
    [task], tried = grader.assignment.tasks, []

    def compare(program, spp, technique, seeds):
        tried.append(spp)
        if spp > in_time:
            raise RenderLate("no picture: not finished")
        return speed.ratio_of([(2.0, 1.0), (2.1, 1.0)], technique), []

    monkeypatch.setattr(speed, "compare", compare)
    in_time = 4
    of = variants.variant("point-light")
    found, _ = grader._speed(task, of, Noisy(lambda spp, number: 0.1), "speed")
    assert tried == [16, 4] and found is not None and 2.0 < found["ratio"] < 2.1
    in_time = 1
    assert grader._speed(task, of, Noisy(lambda spp, number: 0.1), "speed") == (None, "")


def test_pictures_whose_time_is_taken_are_judged(tmp_path, monkeypatch) -> None:
    """Black ones take none."""
    grader = Grader.prepare(read_assignment(written(tmp_path / "a.toml", TASKS)), Tier.NONE)
    of, [task] = variants.variant("point-light"), grader.assignment.tasks
    mean, rng = references.load_reference(of).mean, np.random.default_rng(5)
    right = [mean * rng.gamma(50, 1 / 50, (*mean.shape[:2], 1)) for _ in range(8)]
    program = Noisy(lambda spp, number: 0.1)
    for pictures, wrong in (
        (right, False),
        ([0 * one for one in right], True),
        (right[:4] + 4 * [0 * mean], False),
    ):
        found = speed.ratio_of([(2.0, 1.0), (2.1, 1.0)], "nee"), pictures
        monkeypatch.setattr(speed, "compare", lambda *what, found=found: found)
        said = grader._speed(task, of, program, "speed")[1]
        assert bool(said) == wrong and (not wrong or "whose time was taken" in said)


def test_less_noise_than_the_technique_has_waits_for_a_look(tmp_path) -> None:
    """More samples than {spp} says are cheap noise points; a better technique is not known from them."""
    text = TASKS + 'technique = "nee"\nnoise_points = 2\nnoise_limit = 2\n'
    assignment = read_assignment(written(tmp_path / "a.toml", text))
    for ratio, earns, waits in ((1.0, 2.0, 0.0), (0.6, 2.0, 0.0), (0.2, 0.0, 2.0), (3.0, 0.0, 0.0)):
        found = {"ratio": ratio, "low": 0.95 * ratio, "high": 1.05 * ratio}
        scene = SceneResult("point-light", False, Outcome.PASS, "no bias", noise=found)
        task = points.earned(assignment, assignment.tasks[0], [scene])
        assert (task.points, task.pending) == (4 + earns, waits)
        assert ("wait for a look" in task.comment) == bool(waits)


def test_more_samples_show_the_same_picture() -> None:
    """Black, NaN or anything else in no time would be fast."""
    rng = np.random.default_rng(4)
    few = 0.3 + 0.1 * rng.standard_normal((64, 3))
    assert checks.another_picture(few, 4, 0.3 + 0.05 * rng.standard_normal((8, 3)), 16) is None
    for many in (np.zeros((8, 3)), np.full((8, 3), 0.6), few[:8] * [1, 1, 3]):
        assert "another picture" in checks.another_picture(few, 4, many, 16)
    assert "NaN" in checks.another_picture(few, 4, np.full((8, 3), np.nan), 16)


@pytest.mark.skipif(sys.platform != "linux", reason="grading needs Linux")
def test_what_the_time_of_the_whole_cuts_short_is_open(tmp_path, decoder: Decoder) -> None:
    """Not failed: a picture that was begun, and those that were not."""
    for name in ("scene", "scratch", "mine"):
        (tmp_path / name).mkdir()
    jail = Jail(Tier.NONE, Limits(picture_seconds=5.0), ends=time.perf_counter() + 0.3)
    program = Program(
        jail, tmp_path / "mine", "sh -c 'sleep 3' {output}", tmp_path / "scene", "a", (4, 4), "L1",
        tmp_path / "scratch", decoder,
    )  # fmt: skip
    for _ in range(2):
        with pytest.raises(RenderTimeout, match="the whole grading was over"):
            program.render(tmp_path, 1, 1, 5.0)
    in_time = replace(program, jail=Jail(Tier.NONE, Limits(picture_seconds=0.2)))
    with pytest.raises(RenderLate, match="not finished"):
        in_time.render(tmp_path, 1, 1, 5.0)


@pytest.mark.skipif(sys.platform != "linux", reason="grading needs Linux")
def test_a_late_picture_is_made_once_more_where_others_were_in_time(tmp_path, decoder: Decoder) -> None:
    """A busy machine fails nobody; what hangs always, or twice, does fail."""
    for name in ("scene", "scratch", "mine"):
        (tmp_path / name).mkdir()
    write_pfm(tmp_path / "mine/picture.pfm", np.full((4, 4, 3), 0.5))
    written(
        tmp_path / "mine/render.sh",
        """\
read -r hangs rest <hangs
echo "$rest" >hangs
test "$hangs" = yes && sleep 20
cp picture.pfm "$1"
""",
    )
    program = Program(
        Jail(Tier.NONE, Limits(picture_seconds=2.5)), tmp_path / "mine", "sh render.sh {output}",
        tmp_path / "scene", "a", (4, 4), "L1", tmp_path / "scratch", decoder,
    )  # fmt: skip

    def render(hangs: str) -> int:
        """How many of these were looked at."""
        written(tmp_path / "mine/hangs", hangs)
        try:
            program.render(tmp_path, 1, 1, 5.0)
        except RenderLate:
            return -len(hangs.split()) + len((tmp_path / "mine/hangs").read_text().split())
        return len(hangs.split()) - len((tmp_path / "mine/hangs").read_text().split())

    assert [render("yes no"), render("no no"), render("yes no"), render("yes yes")] == [-1, 1, 2, -2]
    assert program.lost == pytest.approx(3 * 2.5) and program.spent > program.lost


def test_a_hidden_scene_s_reference_is_as_fine_as_the_assignment_asks(tmp_path, oneray, monkeypatch) -> None:
    monkeypatch.setenv("ONERAY", str(oneray))
    goal = Goal(image=0.02, tile=0.1, small_batches=16, spp_per_batch=4, min_batches=16)
    monkeypatch.setattr(hidden, "GOAL", goal)
    of = hidden.pool_variant(variants.variant("point-light"), 0, Keys("a", b"secret"), tmp_path)
    errors = []
    for delta in (0.5, 0.5, 0.002, 0.01):
        entry = references.require(hidden.with_reference(of, delta))
        errors.append((entry["image_error"], entry["batches"]))
    assert errors[0] == errors[1] and errors[2] == errors[3] and errors[2][1] > errors[0][1]
    assert errors[2][0] < 2 * 0.02 * 0.002


def test_what_is_graded_by_is_part_of_what_is_kept(tmp_path, monkeypatch) -> None:
    grader = Grader.prepare(read_assignment(written(tmp_path / "a.toml", TASKS)), Tier.NONE)
    before = grader.state("x")
    assert grader.state("x") == before != grader.state("y")
    monkeypatch.setattr(builds, "raycheck_hash", lambda: "another")
    assert grader.state("x") != before
    monkeypatch.undo()
    entry = references.require(variants.variant("point-light"))
    monkeypatch.setattr(references, "require", lambda of: entry | {"date": "another reference"})
    assert grader.state("x") != before


def test_overrides_stand_and_name_the_line_that_is_wrong(tmp_path) -> None:
    assignment = read_assignment(written(tmp_path / "a.toml", TASKS))
    path = written(tmp_path / "o.csv", "student,task,points,comment\n<b>Eve</b>,L1,3.5,late\n")
    result = a_result(Outcome.INCONCLUSIVE, "too noisy", pending=4.0)
    tables.apply_overrides(result, tables.read_overrides(path, assignment, {"<b>Eve</b>"}))
    assert result.total == 3.5 and not result.review and "late" in result.tasks[0].comment
    overrides = tables.read_overrides(path, assignment, {"<b>Eve</b>"})
    table = tables.grades_csv(assignment, [result], [], overrides)
    [row] = csv.DictReader(io.StringIO(table))
    assert row["total"] == "3.5" and row["comment"].startswith("L1: points set by hand: late")
    for row, words in (
        ("x,L9,1,", "o.csv:2: no task 'L9'"), ("x,L1,much,", "o.csv:2: 'much' is no number"),
        ("x,L1,nan,", "o.csv:2: 'nan' is no number"),
        ("x,L1,40,", "o.csv:2: 40 points for L1, which has"), ("y,L1,1,", "no submission of a student 'y'"),
    ):  # fmt: skip
        with pytest.raises(NotFound, match=words):
            tables.read_overrides(written(path, f"student,task,points,comment\n{row}\n"), assignment, {"x"})


def test_an_override_that_is_taken_back_is_gone_everywhere(tmp_path) -> None:
    assignment = read_assignment(written(tmp_path / "a.toml", TASKS))
    course.write_student(assignment, a_result(Outcome.FAIL, "too dark"), tmp_path)
    told = course.student_folder(tmp_path, "<b>Eve</b>")
    for overrides in ({("<b>Eve</b>", "L1"): tables.Override(1.5, "")}, {}):
        course.write_class(assignment, [a_result(Outcome.FAIL, "too dark")], tmp_path, [], overrides)
        pages = [(told / name).read_text(encoding="utf-8") for name in ("index.html", "results.json")]
        assert all(("by hand" in page) == bool(overrides) for page in pages)


@pytest.fixture(scope="module")
def graded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A class of five, graded; the folder of its results."""
    need(Tier.BUBBLEWRAP)
    work = tmp_path_factory.mktemp("class")
    asked = read_assignment(ROOT / "docs/lecture12.toml")
    example_class.write(work / "class", asked, ("honest", "two-mistakes", "one-scene", "hopeless"))
    (work / "class/one-scene").rename(work / "class/Jan de Vries_4711_assignsubmission_file")
    written(work / "roster.csv", "student\nJan de Vries\nnobody\nhonest\n")
    written(work / "small.toml", TASKS + AREA)
    words = ["grade", "--assignment", str(work / "small.toml"), "--class", str(work / "class"), "--jobs", "1"]
    words += ["--out", str(work / "out"), "--roster", str(work / "roster.csv")]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    again = CliRunner().invoke(app, words)
    assert again.exit_code == 0
    return work / "out"


def test_a_class_is_graded_in_the_order_of_the_roster(graded: Path) -> None:
    rows = list(csv.DictReader(io.StringIO((graded / "grades.csv").read_text(encoding="utf-8"))))
    found = {row["student"]: (row["L1"], row["L3"], row["total"]) for row in rows}
    assert found == {
        "Jan de Vries": ("4", "0", "4"),
        "nobody": ("", "", ""),
        "honest": ("4", "6", "10"),
        "hopeless": ("0", "0", "0"),
        "two-mistakes": ("0", "0", "0"),
    }
    assert [row["student"] for row in rows][:3] == ["Jan de Vries", "nobody", "honest"]
    comments = {row["student"]: row["comment"] for row in rows}
    assert comments["hopeless"].startswith("the build failed: exit status 1, it said: “")
    assert "point-light" not in comments["honest"]


def schema(path: str) -> jsonschema.Draft202012Validator:
    found = json.loads((ROOT / path).read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(found)
    return jsonschema.Draft202012Validator(found)


def test_results_are_as_their_schemas_say(graded: Path) -> None:
    """Gradescope's by its documentation; JUnit by a reader of it, with test names that are unique."""
    gradescope, own = (
        schema("tests/gradescope.schema.json"),
        schema("src/raycheck/grading/result.schema.json"),
    )
    gradescope.validate(json.loads(failed_json("not finished")))
    gradescope.validate(json.loads(results_json(a_result(Outcome.INCONCLUSIVE, "too noisy", pending=4.0))))
    assert not gradescope.is_valid({"tests": [{"score": 1, "status": "PASS"}]})
    folders = list((graded / "students").iterdir())
    assert len(folders) == 4
    for folder in folders:
        gradescope.validate(json.loads((folder / "results.json").read_text(encoding="utf-8")))
        own.validate(json.loads((folder / "result.json").read_text(encoding="utf-8")))
        cases = [case for suite in junitparser.JUnitXml.fromfile(folder / "junit.xml") for case in suite]
        assert len({(case.classname, case.name) for case in cases}) == len(cases) > 0


def test_students_are_told_nothing_of_hidden_scenes(tmp_path) -> None:
    """Neither what is wrong there nor what the program said or drew; the teacher's page has it all."""
    assignment = read_assignment(written(tmp_path / "a.toml", TASKS))
    result = a_result(Outcome.FAIL, "33 % too bright; it said: camera at 1 2 3")
    [scene] = result.tasks[0].scenes
    scene.pictures = [{"uri": "data:image/png;base64,aGlkZGVu", "caption": "your mean"}]
    scene.mistake = "each bounce loses the albedo"
    for_students: list[Callable[[], str]] = [
        lambda: results_json(result),
        lambda: tables.junit_xml([result]),
        lambda: tables.grades_csv(assignment, [result], []),
        lambda: student_page(assignment, result),
    ]
    assert all("camera at" in text() for text in for_students)
    scene.hidden = scene.secret = True
    told = [text() for text in for_students]
    secrets = ("camera at", "33 %", "aGlkZGVu", "loses the albedo")
    assert not [t for t in told if any(secret in t for secret in secrets)]
    assert "point-light (hidden variant): FAIL" in told[0] and all("fail" in t.lower() for t in told)
    page = student_page(assignment, result, everything=True)
    assert "camera at" in page and "aGlkZGVu" in page


def test_a_package_for_gradescope_grades_by_itself(tmp_path) -> None:
    """What is in the zip, without the checkout and without apt: once with time, and once with none."""
    need(Tier.LANDLOCK)
    source = tmp_path / "source"
    package = tmp_path / "a.zip"
    words = ["grade", "--package", "gradescope", "-o", str(package)]
    done = CliRunner().invoke(app, [*words, "--assignment", str(written(tmp_path / "a.toml", TASKS))])
    assert done.exit_code == 0, done.output
    with zipfile.ZipFile(package) as archive:
        archive.extractall(source)
        modes = {name: archive.getinfo(name).external_attr >> 16 & 0o777 for name in package_scripts()}
    assert modes == dict.fromkeys(package_scripts(), 0o755)
    assert not list(source.rglob("*.pyc")) and (source / "assignment.private/secret").is_file()
    for program in ("oneray", "oneray.bin", "lib/" + next((source / "oneray/lib").glob("ld-*")).name):
        (source / "oneray" / program).chmod(0o755)
    version = subprocess.run([source / "oneray/oneray", "--help"], capture_output=True, text=True)
    assert "--spp" in version.stdout + version.stderr
    example_class.write(tmp_path / "class", read_assignment(tmp_path / "a.toml"), ("one-scene",))
    (tmp_path / "class/one-scene").rename(tmp_path / "submission")
    (tmp_path / "results").mkdir()
    environment = {"PATH": os.environ["PATH"], "PYTHONPATH": str(source / "packages")}
    results = []
    for seconds in ("540", "0"):
        words = [sys.executable, "-m", "raycheck.grading.autograder", tmp_path, "--seconds", seconds]
        subprocess.run(words, check=True, cwd=tmp_path, env=environment, stdout=subprocess.DEVNULL)
        results.append(json.loads((tmp_path / "results/results.json").read_text(encoding="utf-8")))
    assert [found["score"] for found in results] == [4, 0]
    assert "time for the whole grading" in json.dumps(results[1]) or "not finished" in json.dumps(results[1])


def package_scripts() -> tuple[str, ...]:
    return ("setup.sh", "run_autograder")


def test_each_student_gets_a_page_with_the_reason_and_the_lecture_s_argument(graded: Path) -> None:
    page = (graded / "students/two-mistakes/index.html").read_text(encoding="utf-8")
    assert "too bright" in page and "The lecture's argument: " in page
    assert "Divide by d²." in page and "data:image/png" in page and "http" not in page
    for what in ("your mean of", "what it should be", "where: blue"):
        assert len(re.findall(f'<img [^>]*: {what}[^>]*><i style="top:', page)) == 2
    assert "Outlined: the tile that is furthest off." in page and "what it should be" in page
    assert "<code>raycheck grade --assignment small.toml --no-sandbox FOLDER</code>" in page
    whole = (graded / "index.html").read_text(encoding="utf-8")
    assert "students/two-mistakes/teacher.html" in whole and "The build failed" not in whole


def test_what_is_graded_is_kept_and_what_has_changed_is_graded_anew(graded: Path, monkeypatch) -> None:
    work = graded.parent
    before = (graded / "students/honest/result.json").stat().st_mtime_ns
    assert StudentResult.read(graded / "students/honest/result.json").total == 10
    written(work / "class/hopeless/note.txt", "changed")
    words = ["grade", "--assignment", str(work / "small.toml"), "--class", str(work / "class"), "--jobs", "1"]
    assert CliRunner().invoke(app, [*words, "--out", str(graded)]).exit_code == 0
    assert (graded / "students/honest/result.json").stat().st_mtime_ns == before
    assert StudentResult.read(graded / "students/hopeless/result.json").earlier == [0]
    page = (graded / "index.html").read_text(encoding="utf-8")
    assert "<th>attempts</th>" in page and ">2: 0 → 0</td>" in page


def test_without_a_sandbox_nothing_is_run(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(sandbox, "why_not", lambda tier: f"no {tier} here")
    words = ["grade", "--assignment", str(written(tmp_path / "a.toml", TASKS)), str(tmp_path)]
    done = CliRunner().invoke(app, [*words, "--out", str(tmp_path / "out")])
    assert done.exit_code == 2 and "landlock: no landlock here; " in done.output
    assert not (tmp_path / "out").exists()


def test_a_cause_is_one_row_in_all_tasks_and_what_is_not_written_is_folded(tmp_path) -> None:
    assignment = read_assignment(written(tmp_path / "a.toml", TASKS))
    named = a_result(Outcome.FAIL, "33 % too bright; it looks like this mistake: “emission counted twice”")
    named.tasks.append(replace(named.tasks[0], id="L2"))
    missing = a_result(Outcome.FAIL, "exit status 0, but {output} was not written")
    missing.student = "Bob"
    missing.tasks[0].scenes[0].looks = 1  # it was run, and made no picture
    for task in named.tasks:
        task.scenes[0].looks = 2
        task.scenes[0].pictures = [{"uri": "data:image/png;base64,bWFw", "caption": "where"}]
    close = a_result(Outcome.INCONCLUSIVE, "too noisy", pending=4.0)
    close.student = "Ann"
    results = [named, missing, close]
    page = course_page(assignment, results, {result.student: "x.html" for result in results})
    assert page.count("1 student: emission counted twice") == 1 and "(L1, L2)" in page and "bWFw" in page
    places = [
        page.index(words) for words in ("Too noisy", "emission counted", "<details>", "was not written")
    ]
    assert places == sorted(places) and "; 1 waits for a manual review" in page


def test_failures_that_differ_in_figures_alone_are_one_kind() -> None:
    reasons = (
        "the image as a whole is 33 % ± 0.3 % too bright; x",
        "the image as a whole is 4.1 % ± 2 % too bright",
    )
    results = [a_result(Outcome.FAIL, reason) for reason in reasons]
    results[1].student = "Bob"
    [cluster] = clusters(results)
    assert cluster.what == "the image as a whole is … too bright"
    assert cluster.tasks == {"<b>Eve</b>": ["L1"], "Bob": ["L1"]}
    assert cluster.students == ["<b>Eve</b>", "Bob"]
