"""raycheck climb: up the ladder to the first FAIL, on from there when the program has changed, and what it
could do is not forgotten.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from test_check_your_renderer import prerender

from raycheck.base.files import write_whole
from raycheck.commands.work.climb import half_blocks
from raycheck.judging.cases import Verification
from raycheck.judging.verdict_pages import drawn
from raycheck.renderers.watched import Watched
from raycheck.truth import references
from raycheck.truth.expected import truth_of

SCENES = ("point-light", "area-light", "checkerboard")
COMMAND = "./mine {scene} --spp {spp} --seed {seed} -o {output}"


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Pictures of three scenes that are right, and in wrong/ twice as bright."""
    folder = tmp_path_factory.mktemp("pictures")
    (folder / "wrong").mkdir()
    for scene in SCENES:
        prerender(scene, 1, folder)
        prerender(scene, 2, folder / "wrong")
    return folder


@pytest.fixture
def place(store: Path, tmp_path: Path) -> Path:
    (tmp_path / "pictures").symlink_to(store)
    return tmp_path


def program(place: Path, wrong: str = "", refused: str = "", more: str = "") -> None:
    """Write ./mine, right but on scenes that are `wrong`, which keeps a list of its calls."""
    text = f"""#!/bin/sh
scene=$(basename "$1" .xml)
echo "$scene $3" >> calls
case " {wrong} " in *" $scene "*) from=pictures/wrong ;; *) from=pictures ;; esac
case " {refused} " in *" $scene "*) echo "unsupported: $scene"; exit 1 ;; esac
file=$from/$scene-$3-$5.pfm
{more}
cp "$file" "$7"
"""
    (place / "new").write_text(text)
    (place / "new").chmod(0o755)
    (place / "new").rename(place / "mine")


def words(*more: str) -> list[str]:
    return [sys.executable, "-m", "raycheck", "climb", "--spp", "8", "--renderer", COMMAND, *more]


def once(place: Path, *more: str) -> tuple[int, str, list[str]]:
    """Exit status, output, and the scenes with samples that were rendered, in order, of one climb."""
    (place / "calls").unlink(missing_ok=True)
    done = subprocess.run(
        words("--once", *(more or SCENES)), cwd=place, capture_output=True, text=True, check=False
    )
    assert done.stderr == "", done.stderr
    calls = (place / "calls").read_text().splitlines() if (place / "calls").exists() else []
    return done.returncode, done.stdout, calls


def rows(output: str) -> list[list[str]]:
    return [line.split()[::2][:2] for line in output.splitlines() if " renderer  " in line]


def kept(place: Path) -> dict[str, str]:
    found = Verification.read(place / "raycheck-climb.json")
    return {case.scene: case.verdict.value for case in found.cases}


def test_it_stops_at_the_first_fail(place: Path) -> None:
    program(place, wrong="area-light")
    status, output, calls = once(place)
    assert (status, rows(output)) == (1, [["point-light", "PASS"], ["area-light", "FAIL"]])
    assert not any(call.startswith("checkerboard") for call in calls)
    assert kept(place) == {"point-light": "PASS", "area-light": "FAIL"}
    end = output[output.index("It can:") :].split()
    assert end.index("point-light") < end.index("cannot") < end.index("area-light") < end.index("Not")
    assert "Not reached: checkerboard (" in output
    assert "a factor of 2" in output, "the sentence"
    assert "difference (-: too dark, +: too bright)" in output and "  ++++++" in output, "the picture"
    assert "a factor of 2" in (place / "raycheck-climb/pages/area-light-renderer.html").read_text("utf-8")


def test_when_it_is_right_it_goes_on_from_there(place: Path) -> None:
    """The scene that FAILed comes first. What PASSed is confirmed by one picture of one sample that has the
    same bits; what nobody has seen yet is next.
    """
    program(place, wrong="area-light")
    once(place)
    program(place)
    status, output, calls = once(place)
    order = list(dict.fromkeys(call.split()[0] for call in calls))
    assert order == ["area-light", "point-light", "checkerboard"]
    assert [call for call in calls if call.startswith("point-light")] == ["point-light 1"]
    assert status == 0 and set(kept(place).values()) == {"PASS"}
    assert "cannot" not in output and "Not reached" not in output


def test_the_same_program_renders_nothing_again(place: Path) -> None:
    program(place)
    once(place, *SCENES[:2])
    status, output, calls = once(place)
    assert {call.split()[0] for call in calls} == {"checkerboard"} and status == 0
    assert all(scene in output for scene in SCENES)
    assert once(place)[::2] == (0, [])


def test_other_settings_are_confirmed(place: Path) -> None:
    program(place)
    once(place, "point-light")
    assert len(once(place, "point-light", "--seed", "0", "--timeout", "50")[2]) == 1
    assert len(once(place, "point-light", "--delta", "0.02")[2]) > 60


def test_a_change_that_breaks_what_it_could_is_seen(place: Path) -> None:
    program(place)
    once(place)
    program(place, wrong="point-light", more="# another program")
    status, output, _ = once(place)
    assert status == 1 and rows(output) == [["point-light", "FAIL"]]
    assert "It could, and is to be confirmed as the program has changed:\n  area-light" in output
    assert "It can:" not in output
    assert kept(place) == {"point-light": "FAIL", "area-light": "PASS", "checkerboard": "PASS"}


def test_what_it_refuses_is_no_stop(place: Path) -> None:
    program(place, refused="point-light")
    status, output, _ = once(place)
    assert status == 0 and rows(output)[0] == ["point-light", "SKIP"] and len(rows(output)) == 3
    program(place, refused=" ".join(SCENES))
    assert once(place, "--state", "other.json", *SCENES)[0] == 2


def test_a_manifest_is_the_renderer_and_has_the_state(place: Path, tmp_path: Path) -> None:
    program(place)
    (place / "raycheck.toml").write_text(f'command = "{COMMAND}"\nneeds = ["point light"]\n')
    command = [sys.executable, "-m", "raycheck", "climb", "--once", "--spp", "8", *SCENES]
    (place / "elsewhere").mkdir()
    for where, more in ((place, []), (place / "elsewhere", ["--renderer", ".."])):
        done = subprocess.run([*command, *more], cwd=where, capture_output=True, text=True, check=False)
        assert "Left out: area-light, checkerboard: needs area light." in done.stdout, done.stdout
        assert kept(place) == {"point-light": "PASS"} and done.returncode == 0
    assert sorted(path.name for path in (place / "elsewhere").iterdir()) == []


class TestWaiting:
    @pytest.fixture
    def waiting(self, place: Path) -> Iterator[subprocess.Popen[str]]:
        """It has found that area-light is wrong."""
        program(place, wrong="area-light")
        process = subprocess.Popen(
            words(*SCENES), cwd=place, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self.until(process, "Waiting until mine changes; Ctrl-C ends.")
        yield process
        process.kill()
        process.communicate()

    @staticmethod
    def until(process: subprocess.Popen[str], said: str) -> None:
        assert process.stdout
        for line in process.stdout:
            if said in line:
                return
        pytest.fail(f"it never said {said}: {process.stderr and process.stderr.read()}")

    def test_it_goes_on_when_the_program_changes(self, waiting: subprocess.Popen[str], place: Path) -> None:
        program(place, wrong="area-light", more="# no better")
        self.until(waiting, "Waiting until")
        program(place)
        output, errors = waiting.communicate(timeout=120)
        assert (waiting.returncode, errors) == (0, "")
        assert rows(output) == [["area-light", "PASS"], ["point-light", "PASS"], ["checkerboard", "PASS"]]

    def test_interrupted_it_says_what_it_can(self, waiting: subprocess.Popen[str], place: Path) -> None:
        waiting.send_signal(signal.SIGINT)
        output, errors = waiting.communicate(timeout=30)
        assert (waiting.returncode, errors) == (130, "raycheck: interrupted\n")
        assert "It can:\n  point-light" in output and "It cannot yet:\n  area-light" in output
        assert kept(place) == {"point-light": "PASS", "area-light": "FAIL"}
        names = {path.name for path in place.iterdir()}
        assert names == {"calls", "mine", "pictures", "raycheck-climb", "raycheck-climb.json"}


def test_a_verdict_is_of_one_program(place: Path) -> None:
    """What was written while pictures were rendered is judged, and no mixture of two programs."""
    (place / "source").write_text("one")
    program(place, wrong="$(cat source)", more='[ -f done ] || { touch done; echo "none" > source; }')
    (place / "source").write_text("point-light")
    status, output, calls = once(place, "point-light", "--watch", "source")
    assert status == 0 and rows(output) == [["point-light", "PASS"]]
    assert calls.count("point-light 1") == 2


def test_a_file_that_is_written_is_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Written anew with the same bytes it is no other; while it is gone, or grows, nobody goes on."""
    file = tmp_path / "mine"
    file.write_text("one")
    watched = Watched([file])
    before = watched.digest()
    assert before
    steps: Iterator[str | None] = iter(["one", "one", None, None, "tw", "two", "two!", "two!", "late"])

    def sleep(_: float) -> None:
        text = next(steps)
        if text is None:
            file.unlink(missing_ok=True)
        elif not file.exists() or file.read_text() != text or text == "one":
            file.write_text(text)

    monkeypatch.setattr("raycheck.renderers.watched.time.sleep", sleep)
    after = watched.until_other(before)
    assert file.read_text() == "two!" and after == watched.digest() != before and list(steps) == ["late"]


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--renderer", ""], "the renderer command is empty"),
        (["--renderer", "./mine {scene}"], "the renderer command has no {output}"),
        (["--renderer", "./mine {output}"], "the renderer command has no {scene}: name the one SCENE"),
        (["--renderer", "./none {scene} {output}"], "./none: there is no such program"),
        (["--renderer", COMMAND, "--watch", "none"], "none: there is no such file to watch"),
        (["--renderer", COMMAND, "--needs", "spheer"], "--needs: 'spheer'; did you mean sphere?"),
        (["--renderer", COMMAND, "--state", "none/a.json"], "none/a.json: there is no such folder"),
        (["--renderer", COMMAND, "--state", "broken.json"], "broken.json: not a result of raycheck verify"),
        (["--renderer", COMMAND, "--state", "verify.json"], "verify.json: not what raycheck climb keeps"),
        (["--renderer", COMMAND, "--spp", "4", "--seconds", "9"], "--seconds and --spp both say how many"),
        (["--renderer", COMMAND, "furnase"], "no scene 'furnase'; did you mean furnace?"),
        ([], "climb needs --renderer CMD, or a raycheck.toml here"),
    ],
)
def test_what_makes_no_sense_is_a_line(place: Path, more: list[str], said: str) -> None:
    program(place)
    (place / "broken.json").write_text("{")
    write_whole(place / "verify.json", Verification([]).to_json())
    before = {path: path.read_bytes() for path in place.iterdir() if path.is_file()}
    command = [sys.executable, "-m", "raycheck", "climb", "--once", *more]
    done = subprocess.run(command, cwd=place, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "") and done.stderr.count("\n") == 1
    assert done.stderr.startswith(f"raycheck: {said}")
    assert {path: path.read_bytes() for path in place.iterdir() if path.is_file()} == before


class Screen:
    """Of a rich console, what a picture depends on."""

    def __init__(self, width: int, color_system: str | None) -> None:
        self.width, self.color_system, self.no_color = width, color_system, False


def test_pictures_in_the_terminal() -> None:
    """A tile that is too dark is dark, and in the difference blue or a minus, in its place; at any width."""
    truth = truth_of(references.load_reference("point-light"))
    mine = truth.mean.copy()
    mine[32:48, 48:] *= 0.01
    shown = drawn(np.stack([mine] * 8), truth)
    for width in (40, 80, 400):
        letters = half_blocks(shown, Screen(width, None))
        each = min(64, (min(width, 200) - 4) // 3)
        head, *lines = [line.plain for line in letters]
        assert head.startswith("mine") and "difference (-: too dark, +: too bright)" in head
        assert {len(line) for line in lines} == {3 * each + 4} and len(lines) == round(each / 2)
        middle = lines[len(lines) * 5 // 8]
        assert middle[each - 1] == " " != middle[2 * each + 1] and middle.endswith("-" * (each // 4 - 1))
        assert middle[2 * each + 4] == " "
        coloured = half_blocks(shown, Screen(width, "truecolor"))
        assert coloured[1].plain.startswith("▀" * each)
        style = str(coloured[1 + len(lines) * 5 // 8].spans[-1].style)
        red, _, blue = map(int, style[style.index("(") + 1 : style.index(")")].split(","))
        assert blue > red + 100


def test_the_state_is_what_verify_writes(place: Path) -> None:
    """So that it can be a --baseline."""
    program(place)
    once(place, "point-light")
    text = json.loads((place / "raycheck-climb.json").read_text("utf-8"))
    assert text["totals"]["PASS"] == 1 and text["mode"] == "quick"
    assert set(text["programs"]) == {"point-light"}


def test_what_is_not_decided_is_no_stop(place: Path) -> None:
    """It says which option decides, of those that it has."""
    program(place, more='[ -f "$file" ] || file=$(ls "$from/$scene-8-"* | head -1)')
    noisy = ["point-light", "area-light", "--delta", "0.0001"]
    status, output, _ = once(place, *noisy)
    assert status == 3 and [row[1] for row in rows(output)] == ["INCONCLUSIVE"] * 2
    assert "--seconds SECONDS gives each scene more." in output and "--until" not in output
    assert "Not decided:\n  point-light" in output
