"""Where raycheck and oneray meet the system: terminals, encodings, exit statuses, start-up, full disks."""

from __future__ import annotations

import ast
import errno
import io
import os
import re
import shlex
import signal
import subprocess
import sys
import tempfile
import time
import unicodedata
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from building import ROOT
from disks import on_a_full_disk
from rich.console import Console

from raycheck import cli
from raycheck.base import files, images, text
from raycheck.base.errors import NotFound
from raycheck.base.statuses import Status
from raycheck.commands import edge
from raycheck.commands.app import COMMANDS
from raycheck.commands.terminal import Columns
from raycheck.truth import references
from raycheck.truth.expected import truth_of

ASSIGNMENT = ROOT / "docs/lecture12.toml"
CALIBRATIONS = ("nulls", "mde", "mutants", "signatures", "parts", "naming", "gradings")
EVERY = [(name,) for name in COMMANDS] + [("calibrate", name) for name in CALIBRATIONS]
HEAVY = {"numpy", "scipy", "OpenImageIO", "jinja2", "trimesh", "mpmath", "mitsuba", "distributed"}


def raycheck(*words: object, **settings: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "raycheck", *map(str, words)],
        capture_output=True, encoding="utf-8", errors="surrogateescape", stdin=subprocess.DEVNULL, **settings,
    )  # fmt: skip


# ---- Encodings.


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """right-N.pfm show point-light, wrong-N.pfm with a corner too dark; a.exr and b.exr have standard errors
    and differ.
    """
    folder = tmp_path_factory.mktemp("pictures")
    mean = truth_of(references.load_reference("point-light")).mean
    broken = mean * np.where(np.add.outer(np.arange(64), np.arange(64)) < 40, 0.9, 1.0)[..., None]
    for seed in range(8):
        noise = np.random.default_rng(seed).gamma(100, 0.01, (64, 64, 1))
        images.write_pfm(folder / f"wrong-{seed}.pfm", broken * noise)
        images.write_pfm(folder / f"right-{seed}.pfm", mean * noise)
    for name, of in (("a", mean), ("b", broken)):
        channels = {c: of[..., i] for i, c in enumerate("RGB")}
        errors = {f"stderr.{c}": 0.01 * mean[..., i] for i, c in enumerate("RGB")}
        images.write_exr(folder / f"{name}.exr", channels | errors)
    return folder


def examples(pictures: Path, folder: Path) -> dict[str, list[object]]:
    """A line of each command that has something to say, in seconds."""
    wrong = str(pictures / "wrong-*.pfm")
    found = {
        "list": ["list"],
        "verify": ["verify", "point-light", "--images", wrong, "--json", folder / "verified.json"],
        "climb": ["climb", "--renderer", "none… {scene} {output}"],
        "compare": ["compare", pictures / "a.exr", pictures / "b.exr"],
        "diagnose": ["diagnose", pictures / "wrong-0.pfm", "--scene", "point-light"],
        "scene": ["scene", "mixed-material"],
        "techniques": ["techniques", "point-light", "--spp", 2],
        "stability": ["stability", "grazing", "--quick"],
        "report": ["report", "point-light", "--seconds", 0, "--verification", folder / "verified.json",
                   "-o", folder / "report"],
        "render": ["render", "point-light", "-o", folder / "π.pfm", "--spp", 2, "--jobs", 1],
        "reference": ["reference", "nowhere…"],
        "grade": ["grade", "--assignment", ASSIGNMENT, folder / "none…"],
        "handout": ["handout", "--assignment", folder / "none…", "-o", folder / "handout"],
        "variants": ["variants", "--assignment", folder / "none…", "-o", folder / "variants", "Zoë"],
        "selftest": ["selftest", "--attacks", "--only", "none…"],
        "completion": ["completion", "nowhere…"],
        "calibrate": ["calibrate", "mde", "--work", folder / "none…"],
    }  # fmt: skip
    assert set(found) == set(COMMANDS)
    return found


def in_process(monkeypatch: pytest.MonkeyPatch, words: Sequence[object], encoding: str) -> tuple[int, bytes]:
    """Exit status, and all output of a command whose terminal has that encoding."""
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding=encoding) for _ in range(2))
    with monkeypatch.context() as changed:
        changed.setattr(sys, "stdout", out)
        changed.setattr(sys, "stderr", err)
        changed.setattr(sys, "argv", ["raycheck", *map(str, words)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        out.flush()
        err.flush()
    return int(ended.value.code or 0), out.buffer.getvalue() + err.buffer.getvalue()


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_on_every_terminal(
    command: str, pictures: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """ASCII stands in for what an encoding lacks; status and words are those of UTF-8."""
    lines = examples(pictures, tmp_path)
    if command == "report":
        in_process(monkeypatch, lines["verify"], "utf-8")
    status, shown = in_process(monkeypatch, lines[command], "utf-8")
    assert status in (Status.DONE, Status.FAIL, Status.COULD_NOT_RUN, Status.INCONCLUSIVE)
    whole = shown.decode()
    assert not whole.isascii() or command in ("report", "diagnose"), "an example without a sign shows nothing"
    for encoding in ("ascii", "cp1252", "latin-1"):
        again, other = in_process(monkeypatch, lines[command], encoding)
        found = other.decode(encoding)
        assert again == status and found.count("?") == whole.count("?"), found
        assert encoding != "ascii" or found.isascii()
        numbers = re.compile(r"\d+" if command not in ("techniques", "verify", "render") else r"PASS|FAIL")
        stood_in = whole.encode(encoding, text.STAND_INS).decode(encoding)
        assert numbers.findall(found) == numbers.findall(stood_in)
    for help_words in ([command, "--help"], [command, "-h"]):
        ended, helped = in_process(monkeypatch, help_words, "ascii")
        assert ended == 0 and helped.decode("ascii").startswith(f"Usage: raycheck {command} ")


@pytest.mark.parametrize("command", ["compare", "verify", "list"])
def test_the_c_locale(command: str, pictures: Path, tmp_path: Path) -> None:
    """What Python makes of LC_ALL=C, with a file name that is no ASCII, which comes out as it went in."""
    (tmp_path / "größe").mkdir()
    words = examples(pictures, tmp_path / "größe")[command]
    environment = {**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    environment.pop("PYTHONIOENCODING", None)
    done = raycheck(*words, env=environment)
    assert done.returncode == (0 if command == "list" else 1), done.stderr
    assert done.stdout.isascii() and done.stderr == ""
    missing = raycheck("compare", tmp_path / "größe/none.exr", tmp_path / "none.exr", env=environment)
    assert missing.returncode == 2
    assert missing.stderr == f"raycheck: {tmp_path}/größe/none.exr: No such file or directory\n"


def test_every_sign_has_a_stand_in() -> None:
    """Of all that raycheck's sources and data can print; no data has a sign that ends as a question mark."""
    wanted = set()
    for path in (ROOT / "src/raycheck").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                wanted |= set(node.value)
    for path in [*ROOT.glob("scenes/*.xml"), *ROOT.glob("tests/mutants/*"), *ROOT.glob("references/*.json")]:
        wanted |= set(path.read_text(encoding="utf-8"))
    none = {"\ufffd", *(sign for sign in wanted if unicodedata.category(sign) in ("Co", "Cs", "Cn"))}
    stand_ins = {sign: text.stand_in(sign) for sign in wanted - none if not sign.isascii()}
    assert len(stand_ins) > 60
    assert [sign for sign, found in stand_ins.items() if not found.isascii() or found == "?"] == []


def test_what_stands_in() -> None:
    shown = "−0.03 % … +0.05 % ± 2×10⁻¹² “θ ≤ Π/½” Größe 漢"
    assert shown.encode("ascii", text.STAND_INS).decode() == (
        '-0.03 % ... +0.05 % +/- 2x10^-^1^2 "theta <= Pi/1/2" Grosse ?'
    )
    assert shown.encode("cp1252", text.STAND_INS).decode("cp1252").startswith("-0.03 % … +0.05 % ± 2×10^-")
    assert b"a\xff".decode("ascii", "surrogateescape").encode("utf-8", text.STAND_INS) == b"a\xff"


# ---- Exit statuses.


def test_the_page_of_verdicts_lists_the_statuses(oneray: Path) -> None:
    """One table for both programs, and nothing else in it."""
    page = (ROOT / "docs/verdicts.md").read_text(encoding="utf-8")
    table = page.split("## Exit statuses", 1)[1].split("\n##", 1)[0]
    listed = [int(number) for number in re.findall(r"^\| (\d+) \|", table, re.MULTILINE)]
    assert listed == [int(one) for one in Status]
    said = subprocess.run([oneray, "--help"], capture_output=True, text=True, check=True).stdout
    assert {int(n) for n in re.findall(r"(?:^|[:;] |\n)(\d+) ", said.split("exit status")[1])} == {0, 2, 70}


def with_a_bug(what: str, *words: str) -> subprocess.CompletedProcess[str]:
    """raycheck list, where reading the scenes' names does `what`."""
    program = f"""
import sys
from raycheck import cli
from raycheck.scene import variants
def broken():
    {what}
variants.scene_names = broken
sys.argv = ["raycheck", "list", *{list(words)!r}]
cli.main()
"""
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)


def test_a_bug_is_no_verdict(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One line, and the command with the traceback in a file."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    done = with_a_bug("1 / 0")
    assert done.returncode == 70 and done.stdout == "" and done.stderr.count("\n") == 1
    assert done.stderr.startswith("raycheck: a bug, please report it: ZeroDivisionError: division by zero (")
    [report] = tmp_path.iterdir()
    assert str(report) in done.stderr
    told = report.read_text(encoding="utf-8")
    assert told.startswith("raycheck list\n") and "Traceback" in told and "in broken" in told


@pytest.mark.parametrize(
    ("what", "status", "line"),
    [
        ("raise MemoryError", 2, "raycheck: out of memory"),
        ("raise KeyboardInterrupt", 130, "raycheck: interrupted"),
        ("raise OSError(28, 'No space', '/x/y')", 2, "raycheck: /x/y: No space"),
        ("raise OSError(28, 'No space')", 2, "raycheck: No space"),
        ("raise OSError(2, 'No file', '/x')", 70, "raycheck: a bug, please report it: FileNotFoundError"),
        ("import no_such_package", 2, "raycheck: the Python package no_such_package is missing"),
        ("import raycheck.nothing", 70, "raycheck: a bug, please report it: ModuleNotFoundError"),
        ("from raycheck import ImageError; raise ImageError('two words')", 2, "raycheck: two words"),
    ],
)
def test_every_end_has_its_status(
    what: str, status: int, line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    done = with_a_bug(what)
    assert done.returncode == status and done.stderr.startswith(line) and done.stderr.count("\n") == 1


def test_a_traceback_that_cannot_be_written(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(tempfile, "NamedTemporaryFile", full)
    assert edge.status_of(lambda: int("x")) == 70
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "test_edge.py:" in said and "No space left on device" in said


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="Linux")
def test_standard_output_that_is_full_or_closed() -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "raycheck", "list"], stdout=full, stderr=subprocess.PIPE, text=True
        )
    assert (done.returncode, done.stderr) == (2, "raycheck: No space left on device\n")
    words = f"{shlex.quote(sys.executable)} -m raycheck list"
    piped = f"{words} | true; echo ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", piped], capture_output=True, text=True)
    assert done.stdout.strip() in ("141", "0") and done.stderr == ""  # 0 if all is written before it ends
    reading, writing = os.pipe()
    os.close(reading)
    listing = [sys.executable, "-m", "raycheck", "list"]
    done = subprocess.run(listing, stdout=writing, stderr=subprocess.PIPE, text=True)
    os.close(writing)
    assert (done.returncode, done.stderr) == (141, "")


# ---- Start-up.


def imported_by(*words: str) -> tuple[int, set[str]]:
    """Exit status of a command line, and the packages that it imported."""
    program = f"""
import sys
from raycheck import cli
sys.argv = ["raycheck", *{list(words)!r}]
try:
    cli.main()
finally:
    sys.stderr.write("\\n" + " ".join({{name.partition(".")[0] for name in sys.modules}}))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    return done.returncode, set(done.stderr.splitlines()[-1].split())


@pytest.mark.parametrize("words", [(), *EVERY], ids=" ".join)
def test_help_imports_what_reads_words_alone(words: tuple[str, ...]) -> None:
    for more, status in ((["--help"], 0), (["-h"], 0), (["--no-such-option"], 2)):
        ended, found = imported_by(*words, *more)
        assert ended == status and not found & {*HEAVY, "rich"}, (more, found & {*HEAVY, "rich"})


@pytest.mark.parametrize(
    ("words", "status"),
    [
        (["--version"], 0), ([], 0), (["verfiy"], 2), (["verify", "--spp", "many"], 2),
        (["verify", "nowhere"], 2), (["verify", "--technique", "nothing"], 2), (["grade"], 2),
        (["scene", "nowhere"], 2), (["diagnose"], 2), (["selftest"], 2), (["list"], 0),
        (["report", "nowhere"], 2), (["verify", "--thorough", "--seconds", "5"], 2),
    ],
)  # fmt: skip
def test_wrong_words_take_no_time(words: list[str], status: int) -> None:
    ended, found = imported_by(*words)
    assert ended == status and not found & HEAVY, found & HEAVY


@pytest.mark.parametrize(
    ("words", "like"),
    [
        (["verfiy"], "no command 'verfiy'; did you mean verify?"),
        (["verify", "cornel-box"], "no scene 'cornel-box'; did you mean cornell-box?"),
        (["scene", "furnase@depth=2"], "no scene 'furnase'; did you mean furnace?"),
        (["verify", "--technique", "mis-powr"], "no technique 'mis-powr'; did you mean mis-power?"),
        (["render", "furnace", "-o", "x.exr", "--spp", "1", "--technique", "walk"], "no technique 'walk'"),
        (["verify", "furnace", "--sed", "3"], "No such option: --sed"),
        (
            ["verify", "furnace", "--renderer", "mine {scene} {output} {samples}"],
            "the renderer command has {samples}; there are {output} {scene} {json} {name} {spp} {seed}",
        ),
        (["verify", "furnace", "--renderer", "mine {scen} {output}"], "{scen}; did you mean scene?"),
        (["diagnose", "--renderer", "mine {scene} {outptu}"], "{outptu}; did you mean output?"),
        (["report", "furnace", "--renderer", "mine=x {output} {sede}"], "{sede}; did you mean seed?"),
    ],
)
def test_a_wrong_word_is_one_line(words: list[str], like: str, tmp_path: Path) -> None:
    done = raycheck(*words, cwd=tmp_path)
    assert done.returncode == 2 and done.stdout == ""
    assert like in done.stderr and done.stderr.count("\n") == 1, done.stderr


def test_a_word_of_the_shell_is_no_placeholder() -> None:
    from raycheck.renderers.commands import Command

    assert Command.parse("sh -c 'x ${HOME} {output}'").words[2] == "x ${HOME} {output}"
    with pytest.raises(NotFound, match=r"\{HOME\}"):
        Command.parse("sh -c 'x {HOME} {output}'")


# ---- Terminals.


def on_a_terminal(words: Sequence[object], columns: int, **environment: str) -> str:
    """What a command shows on a terminal that is so wide."""
    import fcntl
    import pty
    import struct
    import termios

    parent, child = pty.openpty()
    fcntl.ioctl(child, termios.TIOCSWINSZ, struct.pack("HHHH", 50, columns, 0, 0))
    says = ("COLUMNS", "LINES", "NO_COLOR", "FORCE_COLOR", "TERM")
    kept = {k: v for k, v in os.environ.items() if k not in says}
    process = subprocess.Popen(
        [sys.executable, "-m", "raycheck", *map(str, words)], stdin=child, stdout=child, stderr=child,
        env={**kept, "TERM": "xterm-256color", **environment},
    )  # fmt: skip
    os.close(child)
    shown = b""
    try:
        while block := os.read(parent, 1 << 16):
            shown += block
    except OSError:  # Linux's end of a terminal
        pass
    process.wait()
    os.close(parent)
    return shown.decode().replace("\r\n", "\n")


SGR = re.compile(r"\x1b\[[0-9;]*m")


@pytest.mark.parametrize("columns", [40, 80, 100, 140])
def test_tables_stack_instead_of_cutting_numbers(columns: int, pictures: Path) -> None:
    words = ["verify", "point-light", "--images", str(pictures / "right-*.pfm")]
    wide = raycheck(*words).stdout
    shown = on_a_terminal(words, columns, NO_COLOR="1")
    drawn = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]|verifying[^\r\n]*|\r", "", shown)  # rows, without the bar
    table = [line.rstrip() for line in drawn.split("1 PASS")[0].splitlines() if line.strip()]
    numbers = re.findall(r"[−+]?\d[\d.]*(?: %)?", wide.splitlines()[1])[:-1]  # seconds differ
    assert len(numbers) > 4
    assert all(any(number in line for line in table) for number in numbers), shown
    assert max(map(len, table)) <= columns
    assert (len(table) == 2) == (columns == 140), "a row a line where there is room for it"


@pytest.mark.parametrize("columns", [40, 80, 100])
@pytest.mark.parametrize("settings", [{"NO_COLOR": "1"}, {"TERM": "dumb"}, {}])
def test_a_terminal_gets_what_it_can_show(settings: dict[str, str], columns: int, pictures: Path) -> None:
    shown = on_a_terminal(["compare", pictures / "a.exr", pictures / "b.exr"], columns, **settings)
    assert "FAIL" in shown
    codes = set(re.findall(r"\x1b\[[0-9;?]*[A-Za-z]", shown))
    if settings.get("TERM") == "dumb":
        assert not codes
    elif settings:
        assert not any(re.search(r"\b[34]\d|\b9\d", code) for code in codes), codes
    else:
        assert any("31" in code for code in codes)
    listed = SGR.sub("", on_a_terminal(["list"], columns, **settings))
    assert max(map(len, listed.splitlines())) <= columns and "cornell-box" in listed


def test_a_table_stacks_where_it_does_not_fit() -> None:
    table = Columns(("name", "value"), right=("value",))
    table.add_row("a long name of it", "[bold]1,234,567.25[/]", style="red")
    table.add_row("b", "")
    for width, lines in ((31, 3), (30, 4), (19, 5)):
        console = Console(width=width, file=io.StringIO())
        table.show(console)
        shown = console.file.getvalue()  # type: ignore[attr-defined]
        assert shown.count("\n") == lines and "1,234,567.25" in shown, shown


def test_a_pipe_is_as_wide_as_most_tables(pictures: Path) -> None:
    """Whatever COLUMNS is: a script reads a row a line."""
    words = ["verify", "point-light", "--images", str(pictures / "right-*.pfm")]
    narrow, wide = (raycheck(*words, env={**os.environ, "COLUMNS": n}).stdout for n in ("40", "300"))
    assert narrow.splitlines()[0] == wide.splitlines()[0] and narrow.splitlines()[1].count(" %") == 5


# ---- Full disks, and what killed processes leave.


def test_every_file_is_whole_or_not_there(tmp_path: Path) -> None:
    """On a full disk each way to write a file ends with the reason, and leaves nothing."""
    program = """
import sys
import numpy as np
from pathlib import Path
from raycheck.base import files, images
noise = np.random.default_rng(0).random((200, 200, 3))
folder = Path(sys.argv[1])
ways = {
    "x.exr": lambda path: images.write_exr(path, {c: noise[..., i] for i, c in enumerate("RGB")}),
    "x.png": lambda path: images.write_png(path, (255 * noise).astype(np.uint8)),
    "x.pfm": lambda path: images.write_pfm(path, noise),
    "x.txt": lambda path: files.write_whole(path, "x" * 1_000_000),
}
for name, write in ways.items():
    try:
        write(folder / name)
        print(name, "is written")
    except OSError as error:
        print(error.filename == str(folder / name), error.strerror, *folder.iterdir())
"""
    done = on_a_full_disk(tmp_path, [sys.executable, "-c", program, tmp_path])
    assert done.stdout == 4 * "True No space left on device\n", done.stdout + done.stderr


def test_a_class_on_a_full_disk(tmp_path: Path) -> None:
    """grade --out ends in a line."""
    out, student = tmp_path / "out", tmp_path / "student"
    out.mkdir()
    student.mkdir()
    (student / "raycheck.toml").write_text('run = "false {output}"\n', encoding="utf-8")
    assignment = tmp_path / "a.toml"
    assignment.write_text(
        'name = "a"\nrun = "false {output}"\n[[task]]\nid = "t"\nscenes = ["point-light"]\npoints = 1\n',
        encoding="utf-8",
    )
    words = ["grade", "--assignment", assignment, "--out", out, "--no-sandbox", student]
    done = on_a_full_disk(out, [sys.executable, "-m", "raycheck", *words], size="4k")
    assert done.returncode == 2, done.stderr
    line = rf"raycheck: {out}/\S+: No space left on device\n(students\n)?"
    assert re.fullmatch(line, done.stderr), done.stderr


def test_what_killed_processes_leave_is_swept(tmp_path: Path) -> None:
    """By the next process that can lock it; what a living one writes stays."""
    program = """
import sys, time
from pathlib import Path
from raycheck.base.files import whole
with whole(Path(sys.argv[1]) / "x.txt") as partial:
    partial.write_text("half")
    print("there", flush=True)
    time.sleep(60)
"""
    process = subprocess.Popen([sys.executable, "-c", program, tmp_path], stdout=subprocess.PIPE, text=True)
    assert process.stdout and process.stdout.readline() == "there\n"
    [living] = tmp_path.iterdir()
    files._sweep.cache_clear()
    files.write_whole(tmp_path / "y.txt", "y")
    assert living.is_dir()
    process.send_signal(signal.SIGKILL)
    process.wait()
    files._sweep.cache_clear()
    files.write_whole(tmp_path / "z.txt", "z")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["y.txt", "z.txt"]


# ---- Renderers.


@pytest.fixture
def mean() -> np.ndarray:
    return truth_of(references.load_reference("point-light")).mean


def judged(render: object, **settings: object) -> object:
    import raycheck as public

    [case] = public.verify(render, ["point-light"], **{"spp": 16} | settings).cases
    return case


def gamma(mean: np.ndarray, spp: int, seed: int) -> np.ndarray:
    return mean * np.random.default_rng(seed).gamma(4 * spp, 1 / (4 * spp), (64, 64, 1))


def test_a_callable_may_fill_one_film(mean: np.ndarray) -> None:
    """Of doubles, which numpy would hand on as they are, at module level: its calls come from one thread, and
    what it returns is copied.
    """
    import threading

    film = np.empty((64, 64, 3))
    threads = set()

    def render(scene: Path, spp: int, seed: int) -> np.ndarray:
        threads.add(threading.get_ident())
        film[:] = 0
        time.sleep(0.001)  # another thread would come in between
        film[:] += gamma(mean, spp, seed)
        return film

    case = judged(render)
    assert case.verdict == "PASS", case.reason
    assert threads == {threading.get_ident()}
    threads.clear()
    judged(lambda *words: render(*words).copy(), jobs=3)
    assert len(threads - {threading.get_ident()}) == 3, "this thread has the first pictures"
    import raycheck as public

    assert "thread" in public.verify.__doc__ and "copied" in public.verify.__doc__


def test_a_correlation_is_within_one(mean: np.ndarray) -> None:
    """Two seeds that share noise, and more of it than the others have."""

    def render(scene: Path, spp: int, seed: int) -> np.ndarray:
        seen.append(seed)
        wild = len(seen) in (20, 40)
        image = gamma(mean, 1 if wild else 100, 7 if wild else seed)
        return image + 1e-9 * len(seen)

    seen: list[int] = []
    case = judged(render)
    assert case.verdict == "FAIL" and "share noise" in case.reason
    correlation = float(re.search(r"correlation ([\d.]+)", case.reason)[1])
    assert 0.9 < correlation <= 1.0


def script(folder: Path, body: str) -> str:
    path = folder / "mine.py"
    path.write_text(body, encoding="utf-8")
    return f"{sys.executable} {path} {{scene}} --spp {{spp}} --seed {{seed}} -o {{output}}"


@pytest.mark.parametrize(
    ("body", "says"),
    [
        ("import os; os.kill(os.getpid(), 11)", "ended by signal SIGSEGV"),
        ("import sys; print('no lamp', file=sys.stderr); sys.exit(7)", "exit status 7; it said: “no lamp”"),
        ("pass", "exit status 0, but {output} was not written"),
        ("import sys; open(sys.argv[-1], 'w').write('hello')", "image.exr: not an image that can be read"),
    ],
)
def test_a_crash_says_how_to_repeat_it(
    body: str, says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Seed, samples and the command, which does the same when it is typed, also where the scene was written
    for the run.
    """
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    depth = {} if "SEGV" in says else {"depth": "-1"}
    command = script(tmp_path, f"import sys; open(sys.argv[1]).close()\n{body}")
    case = judged(command, spp=None, parameters=depth)
    assert case.verdict == "FAIL" and says in case.reason
    found = re.search(r" \(seed (\d+), 1 sample per pixel; again: `(.*)`\)$", case.reason)
    assert found, case.reason
    assert f"--spp 1 --seed {found[1]} -o image.exr" in found[2]
    assert Path(shlex.split(found[2])[2]).name == f"point-light{'@depth=-1' if depth else ''}.xml"
    status = subprocess.run(shlex.split(found[2]), cwd=tmp_path, capture_output=True).returncode
    assert status == (-11 if "SIGSEGV" in says else 7 if "status 7" in says else 0)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["render", "furnace", "-o", "x.exr", "--spp", "64", "--jobs", "1"], "was ended by SIGSEGV (again: "),
        (["techniques", "furnace", "--spp", "2"], "walk-uniform: exit status -11 (seed "),
        (["verify", "furnace", "--technique", "nee"], "Ended by signal SIGSEGV (seed "),
    ],
)
def test_a_crash_of_oneray_says_how_to_repeat_it(words: list[str], says: str, tmp_path: Path) -> None:
    """Wherever it runs: the command without the temporary folder that it ran in."""
    fake = tmp_path / "oneray"
    fake.write_text("#!/bin/sh\nkill -SEGV $$\n", encoding="utf-8")
    fake.chmod(0o755)
    done = raycheck(*words, cwd=tmp_path, env={**os.environ, "ONERAY": str(fake)})
    assert done.returncode == (1 if words[0] == "verify" else 2)
    said = done.stdout + done.stderr
    assert says in said, said
    again = shlex.split(re.search("again: `(.*)`", said)[1])
    assert again[0] == str(fake) and "--seed" in again and not any("raycheck-" in word for word in again)
    assert "--spp" in again or again[again.index("--samples") + 1] == "0:2"


def test_help_says_what_is_meant_by_default() -> None:
    """Where a default is not imported to say it."""
    from raycheck.measuring import prices
    from raycheck.measuring.races import racing
    from raycheck.stats.verdict import Limits
    from raycheck.truth.making import Goal

    def told(command: str) -> str:
        return " ".join(raycheck(command, "--help").stdout.split())

    wider = Limits().tile / Limits().image
    assert f"{Limits().image} by default, tiles within {wider:g} times" in told("verify")
    for error in (Goal().image, Goal().tile):
        assert f"{error:.0e} by default".replace("e-0", "e-") in told("reference")
    assert f"x>={prices.LEAST_ROUNDS}" in told("techniques")
    assert f"default: {racing.ROUNDS}; x>={racing.LEAST_ROUNDS}" in told("report")


def test_a_renderer_that_says_that_it_cannot(tmp_path: Path) -> None:
    """Exit status 77: the scene is SKIP; if nothing else is there to judge, that is status 2."""
    body = """
import sys
if "point-light" not in sys.argv[1]:
    print("this renderer knows no such light", file=sys.stderr)
    sys.exit(77)
sys.argv[1:] = [sys.argv[-1], sys.argv[3], sys.argv[5]]
exec(open(FILE).read())
"""
    command = script(tmp_path, body.replace("FILE", repr(str(ROOT / "tests/pfm_renderer.py"))))
    done = raycheck("verify", "point-light", "area-light", "--renderer", command, "--spp", 1)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "1 PASS, 0 FAIL" in done.stdout
    why = "the renderer does not support the scene (exit status 77)"
    says = f"{why}; it said: “this renderer knows no such light”"
    assert f"SKIP: area-light: {says}" in done.stdout
    done = raycheck("verify", "area-light", "--renderer", command, "--spp", 1)
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert "nothing was judged: the renderer supports none of these scenes" in done.stderr
    assert f"SKIP: area-light: {says}" in done.stdout
