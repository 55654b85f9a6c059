"""What students get of an assignment, and pictures instead of a program."""

import csv
import io
import json
import shutil
import sys
from pathlib import Path

import junitparser
import pytest
from gradings import written
from typer.testing import CliRunner

from raycheck.base.errors import NotFound
from raycheck.base.images import write_pfm
from raycheck.commands.app import app
from raycheck.grading import attacks, c_functions, course, hidden
from raycheck.grading.assignment import read_assignment
from raycheck.grading.handout import write_handout
from raycheck.grading.jail import sandbox
from raycheck.grading.jail.sandbox import Tier
from raycheck.grading.judge import Grader
from raycheck.scene import export, variants
from raycheck.stats.verdict import Outcome
from raycheck.truth import references
from raycheck.truth.making import Goal

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "scripts"))
import example_class  # noqa: E402

SOURCE = r"""
#define BRACES(x) { x /* { */ \
    {
/* int no(void) { } */
static const char *const text = "int no(void) { \" }";
enum { OPEN = '{', CLOSE = '}' };
typedef struct {
    int (*no)(void);
} Table;
__attribute__((noreturn)) static void stops(void);
#if 1
static __attribute__((unused)) int first(int a, int (*call)(int))
{
    if (a == '}') { // }
        return call(a);
    }
    return '"';
}
#endif
int second(void) { return "}"[0]; }
const Table table = {second};
"""
TASKS = """\
name = "handout"
delta = 0.3
build = "make"
[[task]]
id = "L1"
lecture = "L1"
scenes = ["point-light"]
points = 1
spp = 2
technique = "nee"
[[task]]
id = "L5"
lecture = "L5"
scenes = ["spherical-light"]
points = 1
spp = 2
technique = "nee-facing"
functions = ["sample_facing", "sample_hemisphere_uniform"]
[[task]]
id = "L8"
lecture = "L8"
scenes = ["open-sky"]
points = 1
spp = 2
technique = "walk-uniform"
functions = ["sample_hemisphere_uniform"]
[[task]]
id = "L16"
lecture = "L16"
scenes = ["mixed-material"]
points = 1
spp = 2
technique = "nee-uniform-choice"
functions = ["choose_part"]
"""
PICTURES = """\
name = "pictures"
delta = 0.2
[[task]]
id = "L1"
lecture = "L1"
scenes = ["point-light"]
points = 4
accepts = "pictures"
variants = 2
[[task]]
id = "L3"
lecture = "L3"
scenes = ["area-light"]
points = 4
"""

needs_jail = pytest.mark.skipif(
    sys.platform != "linux" or bool(sandbox.why_not(Tier.BUBBLEWRAP)), reason="bubblewrap does not work here"
)


def test_functions_are_found_by_tokens(tmp_path) -> None:
    path = written(tmp_path / "a.c", SOURCE)
    found = {f.name: SOURCE[f.begin : f.end] for f in c_functions.functions(path, SOURCE)}
    assert list(found) == ["first", "second"]
    assert found["second"] == '{ return "}"[0]; }'
    assert found["first"].startswith("{\n    if (a") and found["first"].endswith("return '\"';\n}")
    assert c_functions.find(tmp_path, "first").line == 1 + SOURCE[: SOURCE.index("first")].count("\n")


def test_a_function_that_is_not_there_once_is_one_line(tmp_path) -> None:
    written(tmp_path / "a.c", "void twice(void) {}\nvoid twice(void) {}\n")
    with pytest.raises(NotFound, match=r"'twice' is defined 2 times: a\.c:1, a\.c:2"):
        c_functions.find(tmp_path, "twice")
    with pytest.raises(NotFound, match="'never' is defined nowhere"):
        c_functions.find(tmp_path, "never")
    with pytest.raises(NotFound, match="braces do not match"):
        c_functions.functions(tmp_path, "void f(void) {")


LEFT = {
    "lecture12": {"next_event", "sample_facing", "survival", "choose_part"},
    "materials": {"ggx_density", "plastic_sample", "envmap_pdf_w"},
}


@pytest.mark.parametrize("name", LEFT)
def test_every_function_of_the_example_assignments_can_be_left_out(tmp_path, name: str) -> None:
    left = write_handout(read_assignment(ROOT / f"docs/{name}.toml"), tmp_path / "h")
    assert {f.name for f in left} >= LEFT[name]
    for function in left:
        [path] = (tmp_path / "h/src/oneray").rglob(function.path.name)
        text = path.read_text(encoding="utf-8")
        [again] = [f for f in c_functions.functions(function.path, text) if f.name == function.name]
        assert "not implemented: " + function.name in text[again.begin : again.end]
    assert (tmp_path / "h/scenes" / ("lecture.xml" if name == "lecture12" else "environment.xml")).is_file()


def test_a_bad_request_leaves_nothing_behind(tmp_path) -> None:
    asked = written(tmp_path / "a.toml", TASKS.replace('"choose_part"', '"no_such"'))
    done = CliRunner().invoke(app, ["handout", "--assignment", str(asked), "-o", str(tmp_path / "h")])
    assert done.exit_code == 2 and "'no_such' is defined nowhere" in done.output
    assert list(tmp_path.iterdir()) == [asked]
    (tmp_path / "h").mkdir()
    written(tmp_path / "h/mine", "")
    with pytest.raises(NotFound, match="is there already"):
        write_handout(read_assignment(written(asked, TASKS)), tmp_path / "h")


@needs_jail
def test_the_handout_fails_the_tasks_that_it_leaves_to_the_student_and_no_other(tmp_path) -> None:
    """Built with small kernels; solved, it is oneray's own sources."""
    tmp_path.chmod(0o755)
    asked = read_assignment(written(tmp_path / "a.toml", TASKS))
    write_handout(asked, tmp_path / "handout")
    manifest = tmp_path / "handout/raycheck.toml"
    text = manifest.read_text(encoding="utf-8")
    written(manifest, text.replace("make", "make KERNEL_LIST='double:2:0 single:4:0' CFLAGS=-O1", 1))
    shutil.copytree(tmp_path / "handout", tmp_path / "solved")
    shutil.copytree(ROOT / "src/oneray", tmp_path / "solved/src/oneray", dirs_exist_ok=True)
    grader = Grader.prepare(asked, Tier.BUBBLEWRAP)
    given, solved = (grader.grade(tmp_path / name, name) for name in ("handout", "solved"))
    assert not given.problem and not solved.problem
    assert {t.id: t.verdict for t in solved.tasks} == dict.fromkeys(("L1", "L5", "L8", "L16"), Outcome.PASS)
    assert [t.id for t in given.tasks if t.verdict is Outcome.FAIL] == ["L5", "L8", "L16"]
    assert given.tasks[0].verdict is Outcome.PASS
    reason = given.tasks[3].scenes[0].reason
    assert "exit status 2; it said: “oneray: not implemented: choose_part, for L16" in reason


@pytest.fixture(scope="module")
def handed_in(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Pictures of three students, graded; the folder of the results."""
    if sys.platform != "linux":
        pytest.skip("grading needs Linux")
    work = tmp_path_factory.mktemp("pictures")
    patch = pytest.MonkeyPatch()
    goal = Goal(small_batches=128, min_batches=16, most_seconds=1.0)
    patch.setattr(hidden, "GOAL", goal)
    patch.setattr(example_class, "PICTURES_EACH", 4)
    asked = read_assignment(written(work / "a.toml", PICTURES))
    example_class.write(work / "class", asked, ("pictures", "pictures-of-another"))
    folder = work / "class/bomb/pictures/L1"
    folder.mkdir(parents=True)
    write_pfm(folder / "a.pfm", references.load_reference("area-light").mean[:, :32])
    words = ["grade", "--assignment", str(work / "a.toml"), "--class", str(work / "class"), "--jobs", "1"]
    done = CliRunner().invoke(app, [*words, "--no-sandbox", "--out", str(work / "out")])
    patch.undo()
    assert done.exit_code == 0, done.output
    return work / "out"


def test_pictures_of_the_student_s_own_variant_pass_and_every_page_says_not_executed(handed_in) -> None:
    folder = handed_in / "students/pictures"
    result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    assert result["tasks"][0]["points"] == 4 and not result["tasks"][0]["executed"]
    assert result["tasks"][1]["points"] == 0
    assert "asks for a program" in result["tasks"][1]["scenes"][0]["reason"]
    for page in (folder / "index.html", folder / "results.json", handed_in / "index.html"):
        assert "not executed" in page.read_text(encoding="utf-8")
    tests = json.loads((folder / "results.json").read_text(encoding="utf-8"))["tests"]
    assert "not executed" in tests[0]["tags"] and "not executed" not in tests[1]["tags"]
    [suite] = list(junitparser.JUnitXml.fromstring((folder / "junit.xml").read_bytes()))
    assert [case.name.endswith("(not executed)") for case in suite] == [True, False]
    rows = csv.DictReader(io.StringIO((handed_in / "grades.csv").read_text(encoding="utf-8")))
    verdicts = {row["student"]: row["verdict"] for row in rows}
    assert verdicts["pictures"] == "L1:PASS (not executed) L3:FAIL"


def test_pictures_of_another_variant_fail_with_a_plain_reason(handed_in) -> None:
    def reason(student: str) -> str:
        text = (handed_in / f"students/{student}/result.json").read_text(encoding="utf-8")
        return json.loads(text)["tasks"][0]["scenes"][0]["reason"]

    assert reason("pictures-of-another").startswith("the pictures show another student's variant")
    assert reason("bomb") == "“a.pfm”: the image is 32×64 pixels, the scene asks for 64×64"


def test_each_student_gets_the_scene_that_is_graded(handed_in, tmp_path) -> None:
    asked = str(handed_in.parent / "a.toml")
    words = ["variants", "--assignment", asked, "-o", str(tmp_path / "v"), "pictures", "Jan de Vries"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    folder = tmp_path / "v" / course.folder_name("Jan de Vries") / "L1"
    assert {p.name for p in folder.iterdir()} == {"scene.xml", "scene.json", "scene.txt"}
    pool = [p.read_text(encoding="utf-8") for p in (handed_in.parent / "a.private/pool").glob("*.xml")]
    assert len(set(pool)) == 2
    theirs = json.loads((tmp_path / "v/pictures/L1/scene.json").read_text(encoding="utf-8"))
    published = export.export(variants.variant("point-light"))
    assert theirs["camera"]["origin"] != list(published["camera"]["origin"])
    assert theirs["scene"] == "point-light"


def test_an_assignment_says_what_it_accepts(tmp_path) -> None:
    for wrong, words in (('"films"', "accepts is"), ('"pictures"\nvariants = 0', "accepts is")):
        text = PICTURES.replace('"pictures"\nvariants = 2', wrong)
        with pytest.raises(NotFound, match=words):
            read_assignment(written(tmp_path / "a.toml", text))
    two = PICTURES.replace('["point-light"]', '["point-light", "area-light"]')
    with pytest.raises(NotFound, match="has one scene"):
        read_assignment(written(tmp_path / "a.toml", two))


def test_the_expected_class_is_compared_cell_by_cell(tmp_path) -> None:
    rows = "student,L1,total,comment\na,1,1,x\nb,0,0,y\n"
    expected = written(tmp_path / "expected.csv", rows)
    assert example_class.differences(written(tmp_path / "a.csv", rows.replace("y", "z")), expected) == []
    [line] = example_class.differences(written(tmp_path / "a.csv", rows.replace("b,0", "b,1")), expected)
    assert line == "b, L1: '1', '0' is expected"
    lines = example_class.differences(written(tmp_path / "a.csv", rows.replace("b,", "c,")), expected)
    assert [line.split(":")[0] for line in lines] == ["b", "c"]


def test_the_expected_table_has_every_submission_of_the_example_class() -> None:
    """Attacks have no points in it, the honest program and the solved handout have all."""
    asked = read_assignment(ROOT / "docs/lecture12.toml")
    with (ROOT / "tests/example_class.csv").open(encoding="utf-8", newline="") as file:
        totals = {row["student"]: float(row["total"]) for row in csv.DictReader(file)}
    hostile = {one.name for one in attacks.read_attacks()} | attacks.ARCHIVES.keys()
    assert totals.keys() == example_class.writers(asked).keys() | hostile
    assert not any(totals[name] for name in hostile)
    assert totals["handout-solved"] == totals["honest"] == asked.most
