"""What one student hands in, or leaves behind, may cost its own points and nothing else."""

import contextlib
import csv
import gzip
import io
import os
import resource
import socket
import subprocess
import sys
import tarfile
import time
import unicodedata
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from gradings import need, written
from typer.testing import CliRunner

from raycheck.base.errors import NotFound, RenderError
from raycheck.base.images import write_exr, write_image, write_png
from raycheck.base.statuses import Status
from raycheck.base.text import last_words, quoted
from raycheck.commands.app import app
from raycheck.grading import course, handed_in, submission
from raycheck.grading.assignment import read_assignment
from raycheck.grading.jail import folders, watch
from raycheck.grading.jail.apart import Apart, Broken
from raycheck.grading.jail.limits import Limits
from raycheck.grading.jail.pixels import Decoder
from raycheck.grading.jail.sandbox import FIRST_USER, Jail, Tier
from raycheck.grading.jail.watch import Finished
from raycheck.grading.judge import _keep
from raycheck.grading.results import SceneResult, StudentResult, TaskResult
from raycheck.grading.submission import Handed, SubmissionError, may_have_pictures, open_submission
from raycheck.grading.written import tables
from raycheck.grading.written.gradescope import results_json
from raycheck.grading.written.pages import clusters, student_page
from raycheck.stats.verdict import Outcome

TASKS = """\
name = "small"
delta = 0.05
[[task]]
id = "L1"
scenes = ["point-light"]
points = 4
spp = 4
"""
DEEP = 1700
"""Folders in folders: more than Python's calls may be nested."""


def deep(folder: Path, depth: int = DEEP) -> Path:
    """Make folders within a folder whose path is longer than any path may be."""
    at = os.open(folder, os.O_RDONLY)
    for _ in range(depth):
        os.mkdir("folder", dir_fd=at)
        inner = os.open("folder", os.O_RDONLY, dir_fd=at)
        os.close(at)
        at = inner
    os.close(at)
    return folder


def test_folders_of_any_depth_are_removed_and_looked_into(place) -> None:
    filled = deep(place)
    written(filled / "file", "x")
    (filled / "link").symlink_to("/etc")
    with pytest.raises(folders.TooDeep):
        list(folders.walk(filled))
    with folders.temporary("raycheck-test-", place) as inner:
        deep(inner)
        (inner / "closed").mkdir(mode=0)
    assert not inner.exists()
    inside = deep(place / "folder", 0)
    folders.remove(inside)
    assert not inside.exists() and Path("/etc/passwd").is_file() and (filled / "file").is_file()


@pytest.fixture
def place() -> Iterator[Path]:
    """A folder that is removed however deep it is, which pytest's own cannot be."""
    with folders.temporary("raycheck-test-") as made:
        yield made


def hostile_archives(folder: Path) -> dict[Path, str]:
    """Small archives that cost much to open, and what is said of them."""
    with zipfile.ZipFile(folder / "deep.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a/" * DEEP + "file", "x")
    with zipfile.ZipFile(folder / "folders.zip", "w") as archive:
        for number in range(submission.MOST_ENTRIES + 1):
            archive.writestr(f"{number}/", "")
    with zipfile.ZipFile(folder / "wide.zip", "w") as archive:
        for number in range(300):
            archive.writestr("/".join(f"{number}-{level}" for level in range(30)) + "/file", "")
    with zipfile.ZipFile(folder / "name.zip", "w") as archive:
        archive.writestr("é" * 150, "x")
    with tarfile.open(folder / "dirs.tar.gz", "w:gz") as archive:
        for number in range(submission.MOST_ENTRIES + 1):
            entry = tarfile.TarInfo(f"{number}")
            entry.type = tarfile.DIRTYPE
            archive.addfile(entry)
    header = tarfile.TarInfo("x")
    header.type, header.size = tarfile.XHDTYPE, 7 << 30
    start, zeros = (gzip.compress(data, 1) for data in (header.tobuf(tarfile.PAX_FORMAT), bytes(64 << 20)))
    (folder / "header.tar.gz").write_bytes(start + 24 * zeros)
    long = tarfile.TarInfo("x")
    long.type, long.size = tarfile.GNUTYPE_LONGNAME, 2
    with tarfile.open(folder / "names.tar", "w") as archive:
        for _ in range(5000):
            archive.fileobj.write(long.tobuf(tarfile.GNU_FORMAT) + b"x".ljust(512, b"\0"))
    many = f"more than {submission.MOST_ENTRIES} files and folders"
    return {
        folder / "deep.zip": "nested more than", folder / "folders.zip": many, folder / "wide.zip": many,
        folder / "name.zip": "longer than", folder / "dirs.tar.gz": many,
        folder / "header.tar.gz": "takes too much",
        folder / "names.tar": "cannot be unpacked",
    }  # fmt: skip


def test_what_an_archive_costs_is_limited(tmp_path) -> None:
    for path, words in hostile_archives(tmp_path).items():
        (into := tmp_path / f"{path.name}-into").mkdir()
        started = time.perf_counter()
        with pytest.raises(SubmissionError, match=words):
            open_submission(path, into)
        folders.remove(into)
        assert time.perf_counter() - started < 60
        assert may_have_pictures(path, "L1") in (True, False)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss < 2 << 20, "of memory, in kB"


def test_a_folder_that_is_handed_in_is_as_limited_as_an_archive(place) -> None:
    (handed := place / "handed").mkdir()
    deep(handed)
    (into := place / "into").mkdir()
    with pytest.raises(SubmissionError, match="nested more than"):
        open_submission(handed, into)
    assert isinstance(found := submission.pack(handed), Handed) and "nested more than" in found.problem
    assert may_have_pictures(handed, "L1") in (True, False)


MANIFESTS = {
    "nested": "command = " + "[" * 5000,
    "tables": "needs" + ".a" * 5000 + " = 1",
    "whole number": f"command = {'1' * 4400}",
    "hexadecimal": f"[limits]\njobs = -0x{'f' * 5000}",
    "wrong": f"command = 0x{'f' * 5000}",
    "long": 'command = "' + "x" * (1 << 20) + '"',
    "key": f'"{"k" * 50_000}" = 1',
}


@pytest.mark.parametrize("text", MANIFESTS.values(), ids=MANIFESTS)
def test_a_hostile_manifest_is_a_sentence(tmp_path, text: str) -> None:
    (handed := tmp_path / "handed").mkdir()
    written(handed / "raycheck.toml", text)
    (into := tmp_path / "into").mkdir()
    with pytest.raises(SubmissionError, match=r"raycheck\.toml") as caught:
        open_submission(handed, into)
    assert len(str(caught.value)) < 1000


def test_a_class_with_hostile_submissions_is_graded_to_its_end_twice(place) -> None:
    (place / "class").mkdir()
    for number, text in enumerate(MANIFESTS.values()):
        (place / f"class/manifest-{number}").mkdir()
        written(place / f"class/manifest-{number}/raycheck.toml", text)
    (place / "class/nested").mkdir()
    deep(place / "class/nested")
    hostile_archives(place / "class")
    words = ["grade", "--assignment", str(written(place / "a.toml", TASKS)), "--no-sandbox", "--jobs", "2"]
    words += ["--class", str(place / "class"), "--out", str(place / "out")]
    for _ in range(2):
        done = CliRunner().invoke(app, words)
        assert done.exit_code == 0, done.output
    rows = (place / "out/grades.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) == 1 + len(list((place / "class").iterdir()))
    assert not [row for row in rows if "the grader failed" in row]


def test_only_whole_pictures_of_one_layer_are_decoded(tmp_path) -> None:
    """EXR and PFM; of two dozen other formats nothing is read at all."""
    picture, one = tmp_path / "picture.exr", np.full((4, 4), 0.5)
    spec = oiio.ImageSpec(4, 4, 3, oiio.FLOAT)
    spec.full_width = 8
    write_image(tmp_path / "window.exr", spec, np.zeros((4, 4, 3), np.float32))
    write_exr(tmp_path / "layers.exr", dict.fromkeys(("R", "G", "B", "a.R", "a.G", "a.B"), one))
    write_png(tmp_path / "a.png", np.zeros((4, 4, 3), np.uint8))
    written(tmp_path / "radiance.hdr", "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 4\n")
    refused = {
        "window.exr": "not its display window", "layers.exr": "2 layers", "a.png": "EXR and PFM",
        "radiance.hdr": "EXR and PFM",
    }  # fmt: skip
    with Decoder(FIRST_USER if os.geteuid() == 0 else None) as decoder:
        for name, words in refused.items():
            with pytest.raises(RenderError, match=words):
                decoder.read(tmp_path / name, (4, 4))
        write_exr(picture, dict.fromkeys(("R", "G", "B", "stderr.R", "stderr.G", "stderr.B"), one))
        assert (decoder.read(picture, (4, 4)).pixels == 0.5).all()
        write_exr(picture, dict.fromkeys(("R", "G", "B", "A"), one), half=True)
        assert decoder.read(picture, (4, 4)).precision == "half"


def test_a_reader_that_is_taken_over_has_no_privileges(place: Path) -> None:
    """Neither files beyond its folder, nor the network, other processes, new programs or open descriptors."""
    secret = written(place / "secret", "a secret")
    secret.chmod(0o600)
    (folder := place / "folder").mkdir(mode=0o755)
    kept = secret.open()
    opened = os.open("/etc/passwd", os.O_RDONLY)

    def tries() -> Iterator[str]:
        for what, act in {
            "secret": lambda: secret.read_text(), "passwd": lambda: Path("/etc/passwd").read_text(),
            "descriptor": lambda: os.read(opened, 1), "socket": lambda: socket.socket(),
            "fork": os.fork, "exec": lambda: os.execv("/bin/true", ["true"]),
            "kill": lambda: os.kill(os.getppid(), 0), "write": lambda: (folder / "x").write_text("x"),
            "root": lambda: os.setuid(0),
        }.items():  # fmt: skip
            with contextlib.suppress(OSError):
                act()
                yield what
        if os.getuid() == 0:
            yield "root's"

    user = FIRST_USER if os.geteuid() == 0 else None
    with Apart(lambda *_: " ".join(tries()).encode(), folder, user, seconds=5, memory=1 << 28) as apart:
        assert apart.ask(b"", 1000) == b""
    os.close(opened)
    kept.close()


def test_what_a_reader_answers_is_not_executed(place: Path) -> None:
    """Bytes come, no objects; more than was agreed are refused."""
    with Apart(lambda *_: bytes(5000), place, None, seconds=5, memory=1 << 28) as apart:
        with pytest.raises(Broken):
            apart.ask(b"", 1000)
        assert apart.ask(b"", 5000) == bytes(5000)
    late = Apart(lambda *_: time.sleep(99) or b"", place, None, seconds=0.05, memory=1 << 28)
    with late, pytest.raises(Broken, match="took more than"):
        late.ask(b"", 1000)


def test_students_are_told_apart_and_found_however_they_are_written(tmp_path) -> None:
    """Two called Ann, accents in one letter or two, archives that are not read, a file, a Mac's folder."""
    (folder := tmp_path / "class").mkdir()
    for name in ("Ann_1_assignsubmission_file", "Ann_2_assignsubmission_file", "__MACOSX", "Rene\u0301_3_x"):
        (folder / name).mkdir()
    for name in ("Bob_4_x.rar", "carl.cpp", "dora.7z", ".DS_Store", "roster.csv"):
        (folder / name).write_bytes(b"x")
    roster = tables.read_roster(written(tmp_path / "r.csv", "Id; Student\n1; Ren\u00e9\n\n2;Bob\n"))
    assert roster == ["Ren\u00e9", "Bob"]
    found = {entry.student: entry.path for entry in course.entries(folder, roster)}
    anns = {"Ann (Ann_1_assignsubmission_file)", "Ann (Ann_2_assignsubmission_file)"}
    assert set(found) == {*anns, "Ren\u00e9", "Bob", "carl", "dora"}
    for student, words in (("Bob", "not read here"), ("carl", "neither a folder"), ("dora", "not read here")):
        (into := tmp_path / student).mkdir()
        with pytest.raises(SubmissionError, match=words):
            open_submission(found[student], into)


def test_one_name_in_two_spellings_is_two_students(tmp_path) -> None:
    """Their results have places of their own, whoever else hands in."""
    for name in ("Jos\u00e9.zip", "Jose\u0301.zip", "Ann.zip"):
        (tmp_path / name).write_bytes(b"x")
    found = [entry.student for entry in course.entries(tmp_path, [])]
    assert len(set(found)) == len({course.folder_name(name) for name in found}) == 3
    (tmp_path / "Ann.zip").unlink()
    assert {entry.student for entry in course.entries(tmp_path, [])} == {n for n in found if n != "Ann"}


@pytest.mark.parametrize("kind", ["pipe", "device", "link to a file", "link to a folder", "link inside"])
def test_what_lies_in_the_class_is_a_folder_or_a_file(tmp_path, kind: str) -> None:
    """A pipe would never end, and a link may lead to another's work; nothing waits, nothing is followed."""
    (other := tmp_path / "other").mkdir()
    written(other / "raycheck.toml", 'command = "./mine {output}"')
    with zipfile.ZipFile(tmp_path / "others.zip", "w") as archive:
        archive.write(other / "raycheck.toml", "raycheck.toml")
    (folder := tmp_path / "class").mkdir()
    made = folder / ("eve.zip" if "folder" not in kind else "eve")
    if kind == "pipe":
        os.mkfifo(made)
    elif kind == "device":
        made.symlink_to("/dev/zero")
    elif kind == "link inside":
        (made := folder / "eve").mkdir()
        (made / "a.zip").symlink_to(tmp_path / "others.zip")
    else:
        made.symlink_to(other if "folder" in kind else tmp_path / "others.zip")
    [entry] = course.entries(folder, [])
    place = course.content(entry.path)
    handed = submission.pack(place)
    assert "is a link: hand in the file itself" in handed.problem or "nor a plain file" in handed.problem
    assert not submission.may_have_pictures(place, "L1")
    (into := tmp_path / "into").mkdir()
    with pytest.raises(SubmissionError, match=r"is a link|nor a plain file"):
        open_submission(place, into)
    assert list(into.iterdir()) == []


def test_points_by_hand_are_for_somebody_and_once(tmp_path) -> None:
    asked = read_assignment(written(tmp_path / "a.toml", TASKS))

    def read(rows: str) -> dict[tuple[str, str], tables.Override]:
        path = written(tmp_path / "o.csv", f"student;task;points;comment\n{rows}\n")
        return tables.read_overrides(path, asked, {"Ren\u00e9"})

    for rows, words in (
        ("Ren\u00e9;L1;-1;", "o.csv:2: '-1' is no number of points"),
        ("Ren\u00e9;L1;1;\nRene\u0301;L1;2;", "o.csv:3: points of 'Ren\u00e9' for L1 are set twice"),
        ("Eve;L1;1;", "o.csv:2: there is no submission"),
    ):
        with pytest.raises(NotFound, match=words):
            read(rows)
    [row] = csv.DictReader(
        io.StringIO(tables.grades_csv(asked, [], ["Ren\u00e9"], read("Rene\u0301;L1;3;late")))
    )
    assert (row["L1"], row["total"]) == ("3", "3") and "late" in row["comment"]


def test_no_picture_sees_what_another_has_read(place: Path) -> None:
    """Each gets files of its own, which share neither times nor what is in memory with those of the last."""
    (folder := place / "submission").mkdir()
    (folder / "part").mkdir()
    written(folder / "part/data", "data").chmod(0o600)
    written(folder / "render", "#!/bin/sh").chmod(0o700)
    (folder / "link").symlink_to("part/data")
    os.mkfifo(folder / "pipe")
    refresh = _keep(folder)
    seen = []
    for _ in range(2):
        found = (folder / "part/data").stat()
        seen.append((found.st_ino, found.st_ctime_ns))
        assert found.st_mode & 0o777 == 0o644 and (folder / "render").stat().st_mode & 0o777 == 0o755
        assert (folder / "link").read_text() == "data" and not (folder / "pipe").exists()
        written(folder / "part/left", "for the next")
        refresh()
        assert not (folder / "part/left").exists()
    assert seen[0] != seen[1]


def test_a_grading_that_is_ended_leaves_nothing(place: Path) -> None:
    (place / "class/slow").mkdir(parents=True)
    written(place / "class/slow/raycheck.toml", "command = \"sh -c 'sleep 60' {output}\"")
    (place / "tmp").mkdir()
    words = [sys.executable, "-c", "from raycheck.commands.app import app; app()", "grade", "--no-sandbox"]
    words += [
        "--assignment",
        written(place / "a.toml", TASKS),
        "--class",
        place / "class",
        "--out",
        place / "o",
    ]
    environment = {**os.environ, "TMPDIR": str(place / "tmp")}
    grading = subprocess.Popen(words, env=environment, stderr=subprocess.PIPE, text=True)
    until = time.monotonic() + 60
    while not list((place / "tmp").glob("*/tmp/*/submission")) and time.monotonic() < until:
        time.sleep(0.05)
    grading.terminate()
    said = grading.communicate(timeout=60)[1]
    assert grading.returncode == Status.INTERRUPTED and "Traceback" not in said
    assert said.strip().endswith("raycheck: interrupted")
    assert [left.name for left in (place / "tmp").iterdir()] == []


IMITATION = "x\n; it looks like this mistake: “raycheck itself has a bug here, give full points”\x1b[2J\u202e"


def imitating(reason: str) -> StudentResult:
    scene = SceneResult("point-light", False, Outcome.FAIL, reason)
    return StudentResult(
        "Eve", "small", [TaskResult("L1", "L1", "", Outcome.FAIL, 0.0, 0.0, 4.0, [scene])], ""
    )


def test_what_a_program_says_is_no_sentence_of_ours(tmp_path) -> None:
    """Neither a heading of the class page, nor the end of a quotation, nor anything to a terminal."""
    said = [
        Finished(1, 0.1, IMITATION).problem,
        Finished(77, 0.1, f"unsupported: {IMITATION[3:]}").refused,
        str(SubmissionError(f"{quoted(IMITATION)} is a link")),
        handed_in_as(tmp_path, IMITATION.replace("/", "")),
    ]
    for reason in said:
        assert "give full points" in reason and reason.count("“") == reason.count("”") == 1, reason
        assert reason.isprintable()
        assert "full points" not in clusters([imitating(reason)])[0].what
        failed = StudentResult("Eve", "small", [], "", problem=reason)
        assert "full points" not in clusters([failed])[0].what


def handed_in_as(folder: Path, name: str) -> str:
    """What is said of a picture of that name."""
    (folder / f"{name}.pfm").write_bytes(b"PF")
    with Decoder() as decoder, pytest.raises(RenderError) as caught:
        handed_in._read(folder / f"{name}.pfm", 1 << 20, (4, 4), decoder)
    return str(caught.value)


def test_bytes_that_are_no_text_are_one_sign() -> None:
    said = (b"\xff" * 2000 + b"\n" + b"\0" * 50 + b"end\n" + "é ü    ok".encode()).decode(errors="replace")
    assert last_words(said) == "; it said: “… | …end | é ü    ok”"


def test_the_first_error_of_a_build_is_told() -> None:
    said = "cc main.c\nmain.c:3: error: no ;\nmain.c:4: error: no }\n" + "note\n" * 9 + "make: *** Error 1"
    assert last_words(said) == "; it said: “main.c:3: error: no ; | … | note | note | make: *** Error 1”"
    assert last_words("a: error: b\nmake: Error 1") == "; it said: “a: error: b | make: Error 1”"


@pytest.mark.parametrize("beside", [True, False])
def test_a_manifest_that_is_a_folder_is_said(tmp_path, beside: bool) -> None:
    (tmp_path / "in/raycheck.toml").mkdir(parents=True)
    written(tmp_path / f"in/{'' if beside else 'raycheck.toml/'}render.c", "")
    (tmp_path / "out").mkdir()
    with pytest.raises(SubmissionError, match=r"^raycheck\.toml is a folder: a text file is wanted$"):
        open_submission(tmp_path / "in", tmp_path / "out")


def test_names_say_nothing_to_a_terminal(tmp_path) -> None:
    (tmp_path / "Eve\x1b]0;owned\x07\u202e").mkdir()
    [entry] = course.entries(tmp_path, [])
    assert entry.student.isprintable() and entry.student.startswith("Eve")


def test_no_cell_is_a_formula_wherever_a_spreadsheet_ends_cells(tmp_path) -> None:
    asked = read_assignment(written(tmp_path / "a.toml", TASKS))
    cells = ("=1+1", "x;=1+1", "x\t=1+1", '";=1+1;"', "＝1+1", " =1+1", "'=1+1", "@x", "-1+1", "\u200b=1")
    for cell in cells:
        result = imitating(cell)
        result.student = cell
        table = tables.grades_csv(asked, [result], [])
        for delimiter in ",;\t":
            rows = csv.reader(io.StringIO(table), delimiter=delimiter)
            for text in (one for row in rows for one in row):
                first = unicodedata.normalize("NFKC", text).strip(' "')[:1]
                assert not first or first not in "=+-@", (cell, delimiter, text)
        assert {len(row) for row in csv.reader(io.StringIO(table))} == {7}


def test_students_are_told_no_time_of_a_hidden_scene(tmp_path) -> None:
    """It would tell the scene, to a program that takes the longer the more it has to say."""
    asked = read_assignment(written(tmp_path / "a.toml", TASKS))
    texts = []
    for seconds in (1.0, 71.3):
        result = imitating("too dark")
        [scene] = result.tasks[0].scenes
        scene.hidden = scene.secret = True
        scene.seconds = result.seconds = seconds
        texts.append([student_page(asked, result), tables.junit_xml([result]), results_json(result)])
    assert texts[0] == texts[1]


TIERS = [tier for tier in Tier if tier is not Tier.NONE]
NEST = 'python3 -c \'import os\nfor i in range(1500): os.mkdir("a"); os.chdir("a")\''


@pytest.mark.parametrize("tier", TIERS)
@pytest.mark.parametrize("where", ["build", "out"])
@pytest.mark.parametrize("looks", [0.05, 60.0])
def test_nested_folders_end_the_program_that_made_them(
    monkeypatch, tier: Tier, where: str, looks: float
) -> None:
    """Also one that ends before anybody looks."""
    need(tier)
    monkeypatch.setattr(watch, "WATCH_SECONDS", looks)
    with folders.temporary("raycheck-test-") as place:
        (folder := place / "submission").mkdir()
        (output := place / "out").mkdir()
        jail = Jail(tier, Limits())
        nest = NEST.format(1500 if looks < 1 else folders.MOST_DEPTH + 9)
        script = nest if where == "build" else f"cd /out && {nest}"
        done = jail.run(
            ["/bin/sh", "-c", script.replace("/out", str(output)) if tier is not Tier.BUBBLEWRAP else script],
            seconds=20, folder=folder, writable=where == "build", output=output,
        )  # fmt: skip
        assert "nested more than" in done.problem
    assert not place.exists()


WORKS = "import time\nwhile time.process_time() < 1: pass"


@pytest.mark.sample(1)
@pytest.mark.parametrize("tier", TIERS)
def test_a_limit_counts_work_and_not_what_others_do(tier: Tier) -> None:
    """Also sleep; a program that others keep from its work is in time."""
    need(tier)
    hogs = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(4 * os.cpu_count())]
    try:
        with folders.temporary("raycheck-test-") as place:
            (folder := place / "submission").mkdir()
            for script, finishes in ((WORKS, True), ("while True: pass", False)):
                words = ["/usr/bin/python3", "-c", script]
                done = Jail(tier, Limits()).run(words, seconds=1.6, folder=folder, writable=False)
                assert done.late != finishes and (done.problem == "") == finishes, done.problem
                assert done.used < done.seconds
    finally:
        for hog in hogs:
            hog.kill()
            hog.wait()
    idle = Jail(tier, Limits()).run(["sleep", "9"], seconds=0.5, folder=Path("/usr"), writable=False)
    assert idle.late and idle.seconds < 5


HOLDS = """\
import os, time
for number in range(100):
    file = os.open(f"/out/{number}", os.O_CREAT | os.O_WRONLY)
    os.unlink(f"/out/{number}")
    os.write(file, bytes(1 << 20))
time.sleep(9)
"""


@pytest.mark.parametrize("tier", TIERS)
def test_files_without_a_name_count(tier: Tier) -> None:
    need(tier)
    with folders.temporary("raycheck-test-") as place:
        (output := place / "out").mkdir()
        words = [
            "/usr/bin/python3",
            "-c",
            HOLDS if tier is Tier.BUBBLEWRAP else HOLDS.replace("/out", str(output)),
        ]
        jail = Jail(tier, Limits(output_mb=4))
        done = jail.run(words, seconds=5, folder=Path("/usr"), writable=False, output=output)
        assert "files without a name" in done.problem
