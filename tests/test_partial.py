"""Renderers of parts of the ladder: what they refuse is SKIP with its reason, in every output, and scenes are
chosen by what they need.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import jsonschema
import junitparser
import numpy as np
import pytest
from gradings import written

import raycheck
from raycheck.base.errors import NotFound
from raycheck.grading import points
from raycheck.grading.assignment import read_assignment
from raycheck.grading.jail.sandbox import Tier
from raycheck.grading.judge import Grader
from raycheck.grading.results import SceneResult, StudentResult
from raycheck.grading.written import tables
from raycheck.grading.written.gradescope import results_json
from raycheck.grading.written.pages import clusters, student_page
from raycheck.judging.junit import junit_xml
from raycheck.renderers.manifest import command_of, read_manifest
from raycheck.renderers.watched import program_files
from raycheck.scene import export, variants
from raycheck.scene.support import KINDS, Support, segments
from raycheck.stats.verdict import Outcome

HERE = Path(__file__).parent
PARTIAL = (
    f'"{sys.executable}" "{HERE / "partial_renderer.py"}" {{json}} {{scene}} {{output}} {{spp}} {{seed}}'
)
TASKS = """\
name = "small"
[[task]]
id = "L1"
scenes = ["furnace"]
points = 4
"""


def command(*words: object) -> "subprocess.CompletedProcess[str]":
    done = subprocess.run(
        [sys.executable, "-m", "raycheck", *map(str, words)], capture_output=True, text=True, check=False
    )
    assert "Traceback" not in done.stderr
    return done


def refusing(body: str) -> raycheck.Case:
    renderer = f'"{sys.executable}" -c "import sys; {body}" {{output}}'
    [case] = raycheck.verify(renderer, "furnace").cases
    return case


class TestRefusals:
    @pytest.mark.parametrize(
        ("body", "reason"),
        [
            ("print('unsupported: spheres'); sys.exit(1)", "unsupported: spheres"),
            ("print('unsupported: spheres', file=sys.stderr); sys.exit(3)", "unsupported: spheres"),
            ("print('  unsupported: spheres  '); print('bye')", "unsupported: spheres"),
            ("print('unsupported: spheres'); print('x' * 100000); sys.exit(1)", "unsupported: spheres"),
            ("print('no spheres'); sys.exit(77)", "(exit status 77); it said: “no spheres”"),
            ("sys.exit(77)", "the renderer does not support the scene (exit status 77)"),
        ],
    )
    def test_a_refusal_is_skip_with_its_reason(self, body: str, reason: str) -> None:
        case = refusing(body)
        assert case.verdict is Outcome.SKIP and case.reason.endswith(reason)

    @pytest.mark.parametrize(
        "body", ["sys.exit(1)", "sys.exit(76)", "print('it is unsupported: so'); sys.exit(1)"]
    )
    def test_what_is_no_refusal_fails(self, body: str) -> None:
        assert refusing(body).verdict is Outcome.FAIL

    def test_a_callable_refuses_by_not_implemented_error(self) -> None:
        def render(scene, spp, seed):
            raise NotImplementedError("spheres")

        result = raycheck.verify(render, "furnace")
        assert [case.reason for case in result.cases] == ["unsupported: spheres"]
        assert result.exit_status == 2

    @pytest.mark.parametrize(("outcomes", "status"), [("S", 2), ("SS", 2), ("SP", 0), ("SI", 3), ("SF", 1)])
    def test_exit_status(self, outcomes: str, status: int) -> None:
        full = {outcome.value[0]: outcome for outcome in Outcome}
        cases = [raycheck.Case("s", "t", full[one], "") for one in outcomes]
        assert raycheck.Verification(cases).exit_status == status

    def test_it_is_in_table_json_and_junit(self, tmp_path: Path, oneray: Path) -> None:
        found, junit = tmp_path / "found.json", tmp_path / "junit.xml"
        words = ("area-light", "furnace", "caustic", "--spp", 4, "--json", found, "--junit", junit)
        done = command("verify", *words, "--renderer", PARTIAL)
        assert done.returncode in (0, 3), done.stdout + done.stderr
        rows = [line.split()[:3] for line in done.stdout.splitlines()[1:4]]
        assert rows[1:] == [["furnace", "renderer", "SKIP"], ["caustic", "renderer", "SKIP"]]
        assert "SKIP: furnace, caustic: unsupported: I have no sphere." in done.stdout
        assert "2 SKIP in" in done.stdout
        header = json.loads(found.read_text(encoding="utf-8"))
        assert header["totals"]["SKIP"] == 2 and header["totals"]["FAIL"] == 0
        assert [case["verdict"] for case in header["cases"]][1:] == ["SKIP", "SKIP"]
        [suite] = list(junitparser.JUnitXml.fromstring(junit.read_bytes()))
        assert suite.skipped >= 2 and suite.failures == 0
        assert suite.skipped == junit_xml(raycheck.Verification.read(found)).count("<skipped")

    def test_all_skipped_could_not_run(self, tmp_path: Path, oneray: Path) -> None:
        done = command("verify", "furnace", "--renderer", PARTIAL + " by=status")
        assert done.returncode == 2
        assert done.stderr == "raycheck: nothing was judged: the renderer supports none of these scenes\n"
        assert "SKIP: furnace: the renderer does not support the scene (exit status 77)" in done.stdout


class TestNeeds:
    def test_words_are_those_of_the_scenes(self) -> None:
        """Every word that a scene's JSON has can be named, and alone lets that scene through."""
        known = {word for kind in KINDS.values() for word in kind}
        for name in variants.scene_names():
            needs = export.export(variants.variant(name))["needs"]
            assert all(word in known or segments(word) for word in needs), name
            assert Support.of(needs).lacks(needs) == []

    @pytest.mark.parametrize(
        ("said", "needs", "lacks"),
        [
            ("rectangle", ["parallelogram", "diffuse"], []),
            ("rectangle", ["parallelogram", "sphere", "diffuse"], ["sphere"]),
            ("Rectangle, SPHERE", ["parallelogram", "sphere", "dielectric"], []),
            ("diffuse", ["sphere", "diffuse", "dielectric"], ["dielectric"]),
            ("point-light", ["point light", "sun"], ["sun"]),
            ("area light", ["area light", "sky"], ["sky"]),
            ("paths of 2 segments", ["paths of 2 segments"], []),
            ("paths of 2 segments", ["paths of 7 segments"], ["paths of 7 segments"]),
            ("paths of 20 segments", ["bounces without limit"], ["bounces without limit"]),
            ("bounces without limit", ["paths of 7 segments"], []),
        ],
    )
    def test_a_kind_that_is_named_has_no_other(self, said: str, needs: list[str], lacks: list[str]) -> None:
        assert Support.of(said.split(",")).lacks(needs) == lacks

    def test_scenes_are_chosen(self, tmp_path: Path, oneray: Path) -> None:
        words = ("area-light", "furnace", "--needs", "rectangle,triangle", "--spp", 1)
        done = command("verify", *words, "--renderer", PARTIAL)
        assert "Left out: furnace: needs sphere." in done.stdout and "SKIP" not in done.stdout

    @pytest.mark.parametrize(
        ("words", "said"),
        [
            (
                ("--needs", "rectangel"),
                "--needs: 'rectangel'; did you mean rectangle?; there are rectangle, ",
            ),
            (("--needs", ""), "--needs: ''; there are rectangle, "),
            (("furnace", "--needs", "rectangle"), "no scene is left: furnace: needs sphere\n"),
            (("furnace", "--images", "x.pfm", "--needs", "sphere"), "--needs chooses scenes for a renderer"),
        ],
    )
    def test_what_makes_no_sense_is_a_line(self, words: tuple[str, ...], said: str) -> None:
        renderer = () if "--images" in words else ("--renderer", PARTIAL)
        done = command("verify", *words, *renderer)
        assert done.returncode == 2 and done.stdout == ""
        assert done.stderr.startswith(f"raycheck: {said}") and done.stderr.count("\n") == 1


class TestJson:
    def test_it_is_written_once_for_each_scene(self, tmp_path: Path) -> None:
        """The same file for every picture, of the scene as it is asked for."""
        seen = tmp_path / "seen.txt"
        body = f"import sys,json; d=json.load(open(sys.argv[1])); open(r'{seen}','a').write(sys.argv[1]+' '"
        body += "+d['scene']+' '+str(d['max_depth'])+chr(10)); sys.exit(1 if sys.argv[3]=='16' else 77)"
        renderer = f'"{sys.executable}" -c "{body}" {{json}} {{output}} {{spp}}'
        raycheck.verify(renderer, ["furnace", "furnace@depth=2"])
        lines = [line.split() for line in seen.read_text(encoding="utf-8").splitlines()]
        assert [line[1:] for line in lines] == [["furnace", "10"], ["furnace@depth=2", "2"]]

    def test_a_failure_keeps_it(self) -> None:
        renderer = f'"{sys.executable}" -c "import sys; sys.exit(1)" {{json}} {{output}}'
        [case] = raycheck.verify(renderer, "furnace").cases
        kept = next(word for word in case.reason.split() if word.endswith("furnace.json"))
        assert json.loads(Path(kept).read_text(encoding="utf-8"))["scene"] == "furnace"


def a_folder(place: Path, text: str) -> Path:
    place.mkdir(exist_ok=True)
    written(place / "raycheck.toml", text)
    return place


class TestManifest:
    def test_it_is_the_renderer(self, tmp_path: Path, oneray: Path) -> None:
        """A folder, its file, or none where verify is called in it: the command runs there."""
        mine = a_folder(tmp_path / "mine", "")
        (mine / "mine.py").write_text((HERE / "partial_renderer.py").read_text("utf-8"), "utf-8")
        quoted = json.dumps(f"'{sys.executable}' mine.py {{json}} {{scene}} {{output}} {{spp}} {{seed}}")
        a_folder(
            mine, f'command = {quoted}\nneeds = ["rectangle"]\n[limits]\npicture_seconds = 30\njobs = 1\n'
        )
        environment = {"ONERAY": str(oneray)}
        for where, words in ((tmp_path, ("--renderer", "mine")), (mine, ())):
            done = subprocess.run(
                [sys.executable, "-m", "raycheck", "verify", "furnace", "area-light", "--spp", "1", *words],
                cwd=where, env={**os.environ, **environment}, capture_output=True, text=True, check=False,
            )  # fmt: skip
            assert "Left out: furnace: needs sphere." in done.stdout, done.stdout + done.stderr
            assert "area-light  renderer" in done.stdout

    @pytest.mark.parametrize(
        ("text", "said"),
        [
            ("command = 3", "command is 3, a string is wanted"),
            ("comand = 'x'", "'comand'; did you mean command?; there are command, needs, limits, build"),
            ("needs = 'sphere'", "needs is 'sphere', a list such as"),
            ("needs = ['spere']", "needs: 'spere'; did you mean sphere?"),
            ("limits = 3", "limits is 3, a table [limits] is wanted"),
            ("[limits]\npicture_secs = 3", "[limits]: picture_secs; did you mean picture_seconds?"),
            ("[limits]\npicture_seconds = -1", "[limits]: picture_seconds is -1, a number above 0 is wanted"),
            ("[limits]\njobs = 1.5", "[limits]: jobs is 1.5, a whole number above 0 is wanted"),
            ("run = 'a'\ncommand = 'b'", "command and run, its older name: give one of them"),
            ("command", "is not TOML"),
        ],
    )
    def test_what_is_wrong_is_said(self, tmp_path: Path, text: str, said: str) -> None:
        with pytest.raises(NotFound) as error:
            read_manifest(written(tmp_path / "raycheck.toml", text))
        assert str(error.value).startswith("raycheck.toml") and said in str(error.value)
        done = command("verify", "furnace", "--renderer", tmp_path)
        assert done.returncode == 2 and done.stdout == "" and done.stderr.count("\n") == 1

    def test_older_files_are_read(self, tmp_path: Path) -> None:
        found = read_manifest(written(tmp_path / "raycheck.toml", 'build = "make"\nrun = "./mine {output}"'))
        assert (found.build, found.command, found.needs) == ("make", "./mine {output}", None)

    def test_a_folder_without_one_or_without_a_command(self, tmp_path: Path) -> None:
        with pytest.raises(NotFound, match=r"a folder without a raycheck\.toml"):
            raycheck.verify(tmp_path, "furnace")
        with pytest.raises(NotFound, match="there is no command: write command ="):
            raycheck.verify(a_folder(tmp_path, ""), "furnace")


class TestGrading:
    def graded(self, tmp_path: Path, text: str) -> tuple[StudentResult, Path]:
        assignment = written(tmp_path / "a.toml", TASKS)
        student = a_folder(tmp_path / "student", text)
        grader = Grader.prepare(read_assignment(assignment), Tier.NONE)
        return grader.grade(student, "student"), assignment

    @pytest.mark.parametrize(
        ("text", "reason"),
        [
            (
                "command = \"sh -c 'echo unsupported: spheres; exit 1' {output}\"",
                "it says “unsupported: spheres”",
            ),
            (
                "command = \"sh -c 'echo unsupported: spheres >&2; exit 1' {output}\"",
                "it says “unsupported: spheres”",
            ),
            (
                "command = \"sh -c 'exit 77' {output}\"",
                "the renderer does not support the scene (exit status 77)",
            ),
            (
                "command = 'false {output}'\nneeds = ['rectangle']",
                "needs sphere, which raycheck.toml does not name",
            ),
        ],
    )
    def test_a_refusal_earns_nothing_and_is_no_failure(self, tmp_path: Path, text: str, reason: str) -> None:
        result, path = self.graded(tmp_path, text)
        [task] = result.tasks
        assert (task.verdict, task.points, task.pending) == (Outcome.SKIP, 0, 0)
        assert task.scenes[0].reason == reason
        schema = json.loads(
            (Path(raycheck.__file__).parent / "grading/result.schema.json").read_text("utf-8")
        )
        jsonschema.validate(json.loads(result.to_json()), schema)
        assert StudentResult.from_json(result.to_json()) == result
        [test] = json.loads(results_json(result))["tests"]
        assert test["score"] == 0 and "status" not in test and "SKIP" in test["tags"]
        assert "SKIP" in test["output"]
        [suite] = list(junitparser.JUnitXml.fromstring(tables.junit_xml([result]).encode()))
        assert (suite.skipped, suite.failures) == (1, 0)
        assignment = read_assignment(path)
        assert "L1:SKIP" in tables.grades_csv(assignment, [result], [])
        assert '<span class="SKIP">SKIP</span>' in student_page(assignment, result)
        assert clusters([result]) == []

    def test_points_of_a_task_whose_scenes_are_skipped_in_part(self, tmp_path: Path) -> None:
        asked = read_assignment(written(tmp_path / "a.toml", TASKS))
        skipped = SceneResult("furnace", False, Outcome.SKIP, "unsupported: spheres")
        right = SceneResult("point-light", False, Outcome.PASS, "no bias")
        wrong = SceneResult("point-light", False, Outcome.FAIL, "too dark")
        for scenes, verdict, earned in (
            ([skipped, right], Outcome.SKIP, 2), ([skipped, wrong], Outcome.FAIL, 0),
            ([skipped], Outcome.SKIP, 0),
        ):  # fmt: skip
            task = points.earned(asked, asked.tasks[0], scenes)
            assert (task.verdict, task.points, task.pending) == (verdict, earned, 0)


def test_a_picture_with_a_refusal_beside_it_is_skipped(tmp_path: Path) -> None:
    """Who says that it does not support the scene is taken by its word."""
    from raycheck.base.images import write_pfm

    picture = tmp_path / "x.pfm"
    write_pfm(picture, np.ones((32, 32, 3)))
    body = f"import sys,shutil; print('unsupported: a lens'); shutil.copy(r'{picture}', sys.argv[1] + '.pfm')"
    [case] = raycheck.verify(f'"{sys.executable}" -c "{body}" {{output}}', "furnace").cases
    assert case.verdict is Outcome.SKIP and case.reason == "unsupported: a lens"


def test_a_command_may_be_longer_than_the_name_of_any_file() -> None:
    words = "x" * 5000
    command = command_of(f"{sys.executable} -c {words} {{output}}")
    assert words in command.words
    assert program_files(command) == [Path(sys.executable)]
