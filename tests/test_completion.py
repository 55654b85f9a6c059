"""Tab completes raycheck and oneray, by what the programs themselves say that they take."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import typer
from typer.core import TyperOption

from raycheck.commands.app import COMMANDS, app
from raycheck.commands.work import completion


def script(shell: str, program: str) -> str:
    words = [sys.executable, "-m", "raycheck", "completion", shell, program]
    return subprocess.run(words, capture_output=True, text=True, check=True).stdout


def completed(line: str, folder: Path) -> list[str]:
    """What bash offers for the last word of a command line."""
    words = line.split(" ")
    program = words[0]
    (folder / "script").write_text(script("bash", program))
    body = (
        f'source "$0"; COMP_WORDS=("$@"); COMP_CWORD={len(words) - 1}; _{program}_completion; '
        'printf "%s\\n" "${COMPREPLY[@]}"'
    )
    done = subprocess.run(
        ["bash", "--norc", "-uc", body, folder / "script", *words], capture_output=True, text=True, check=True
    )
    assert done.stderr == ""
    return done.stdout.split()


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("raycheck cl", ["climb"]),
        ("raycheck verify furn", ["furnace"]),
        ("raycheck verify --technique nee-uniform-h", ["nee-uniform-hemisphere"]),
        ("raycheck verify furnace --jun", ["--junit"]),
        ("raycheck verify --json f", []),
        ("raycheck calibrate nul", ["nulls"]),
        ("raycheck completion z", ["zsh"]),
        ("raycheck report --against m", ["mitsuba"]),
        ("oneray --estimator ", ["walk", "nee", "mis", "light", "bidirectional", "photons"]),
        ("oneray --estimator = w", ["walk"]),
        ("oneray --light-choice =", ["uniform", "power", "contribution", "learned", "resampled"]),
        ("oneray a.xml --checkpoint-s", ["--checkpoint-seconds"]),
        ("oneray a.xml --show --qui", ["--quiet"]),
        ("oneray mer", ["merge"]),
        ("oneray merge --", ["--exposure"]),
        ("oneray -o a", []),
    ],
)
def test_bash(
    line: str, offered: list[str], oneray: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ONERAY", str(oneray))
    assert completed(line, tmp_path) == offered


def test_every_option_of_raycheck_is_there() -> None:
    found = completion.of_raycheck()
    group = typer.main.get_command(app)
    for name in COMMANDS:
        command = group.get_command(None, name)
        for param in (one for one in command.params if isinstance(one, TyperOption)):
            assert set(param.opts) <= set(found[name].options), name


def test_every_option_of_oneray_is_there(oneray: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of its table, each with its values, and whether a word follows it."""
    monkeypatch.setenv("ONERAY", str(oneray))
    source = Path(__file__).parents[1] / "src/oneray/options.c"
    table = re.findall(r'^    \{"(-[-a-zA-Z]+)", (NULL|".*?"), (\w+)', source.read_text(), re.MULTILINE)
    options = completion.of_oneray()[""].options
    assert len(table) > 30 and [name for name, _, _ in table] == list(options)
    for name, argument, kind in table:
        assert options[name].takes == (argument != "NULL" or kind in ("TECHNIQUE", "WORD")), name
        assert bool(options[name].values) == (kind in ("TECHNIQUE", "WORD") or name == "--lanes"), name


@pytest.mark.parametrize("program", ["raycheck", "oneray"])
@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_read_it(shell: str, program: str, oneray: Path, tmp_path: Path) -> None:
    """And fish completes by it."""
    if not shutil.which(shell):
        pytest.skip(f"there is no {shell} here")
    (tmp_path / "script").write_text(script(shell, program))
    subprocess.run([shell, "-n", tmp_path / "script"], check=True)
    if shell == "fish":
        line = "raycheck cl" if program == "raycheck" else "oneray --roulette n"
        words = ["fish", "-c", f"source {tmp_path}/script; complete -C '{line}'"]
        done = subprocess.run(words, capture_output=True, text=True, check=True)
        assert done.stdout.split("\t")[0] == ("climb" if program == "raycheck" else "none")


def test_in_fish_a_line_is_an_option(oneray: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Texts are quoted, whatever stands in them."""
    program = {"": completion.Words({"--a": completion.Option(True, (), "it's \\ so")}, told="")}
    assert completion.fish("x", program).endswith("-l a -r -d 'it\\'s \\\\ so'")
