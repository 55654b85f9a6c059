"""Committed results name the pictures and the version of the method that they rest on: what has changed is
measured anew, and nothing else.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from dataclasses import asdict, replace
from pathlib import Path

import pytest
from building import ROOT

from raycheck.base import data
from raycheck.calibration import kills, lines, mutants, nulls, signatures
from raycheck.renderers import workers
from raycheck.truth import provenance
from raycheck.truth.closed_forms import store

sys.path.insert(0, str(ROOT / "scripts"))

import stale

BOX = "cornell-box mis-power auto"
BY_FILE = {(one.file, one.at): one for one in stale.RESULTS}


def with_another(monkeypatch: pytest.MonkeyPatch, *names: str) -> None:
    """As if these pictures had other numbers."""
    right = provenance.payload
    monkeypatch.setattr(provenance, "payload", lambda name: "another" if name in names else right(name))


def test_nothing_that_is_committed_is_stale() -> None:
    assert list(stale.lines()) == [], "python scripts/stale.py --measure"


def test_every_committed_result_is_known() -> None:
    """Those of the harness's own tests, of its estimates, of the code's size and of others' files rest on no
    picture; those of an audit on pictures that it makes by itself.
    """
    files = {
        path.relative_to(data.references_dir()).as_posix() for path in data.references_dir().rglob("*.json")
    }
    own = {"manifest.json", "harness_mutants.json", "size.json", "precisions.json", "public_scenes.json"}
    own |= {"estimates.json", "audit.json"}
    assert files - own == {one.file for one in stale.RESULTS}
    sections = {one.at for one in stale.RESULTS if one.file == "calibration.json"}
    assert sections == json.loads((data.references_dir() / "calibration.json").read_text()).keys()


@pytest.mark.parametrize("result", stale.RESULTS, ids=lambda one: f"{one.file}-{one.at}")
def test_every_entry_rests_on_pictures(result: stale.Result) -> None:
    for name, entry in result.entries().items():
        pictures = entry["provenance"]["pictures"]
        assert pictures and all(pictures.values()), name
        assert len(pictures) >= len(entry.get("techniques", ())), name
        if result.file == "verification.json":
            assert pictures.keys() == {f"{name.replace(',', '')} auto", f"reference {entry['scene']}"}


def test_another_picture_makes_stale_what_rests_on_it(monkeypatch: pytest.MonkeyPatch) -> None:
    with_another(monkeypatch, BOX)
    found = [line.removeprefix("references/").split(": ")[:2] for line in stale.lines()]
    assert found == [
        ["verification.json", "cornell-box, mis-power"], ["techniques.json", "cornell-box"],
        ["error_curves.json", "cornell-box"],
    ]  # fmt: skip
    assert all(f"{BOX} was " in line and line.endswith(", and is another today") for line in stale.lines())


def test_another_reference_makes_verdicts_stale_and_prices_not(monkeypatch: pytest.MonkeyPatch) -> None:
    with_another(monkeypatch, "reference furnace")
    files = Counter(line.split(": ")[0].removeprefix("references/") for line in stale.lines())
    assert files.keys() == {"verification.json", "error_curves.json", "calibration.json"}
    assert files["verification.json"] == 18


def test_another_method_makes_stale_what_it_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    result = BY_FILE["stability.json", "cases"]
    other = replace(result, method=result.method + 1)
    assert other.stale().keys() == result.entries().keys()
    monkeypatch.setattr(store, "VERSION", store.VERSION + 1)
    provenance.payload.cache_clear()
    try:
        assert "cornell-box, mis-power" in BY_FILE["verification.json", "cases"].stale()
    finally:
        provenance.payload.cache_clear()


def test_what_says_nothing_is_stale() -> None:
    assert provenance.changes({}, 1) == ["it does not say what it rests on"]


def test_a_picture_that_is_gone_is_told() -> None:
    kept = {"method": 1, "pictures": {"no-such-scene nee auto": "0123456789abcdef"}}
    [line] = provenance.changes(kept, 1)
    assert line == "no-such-scene nee auto was 0123456789abcdef, and is no picture today"


def test_a_scene_that_was_never_measured_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """As the first entry were if it were not there."""
    result = BY_FILE["signatures/manifest.json", "scenes"]
    [first, *rest] = result.entries().items()
    monkeypatch.setattr(stale.Result, "entries", lambda self: dict(rest))
    assert result.stale() == {first[0]: ["it is not measured yet"]}


@pytest.mark.parametrize("section", ["mutants", "naming"])
def test_a_mistake_that_was_never_judged_is_told(section: str, monkeypatch: pytest.MonkeyPatch) -> None:
    result = BY_FILE["calibration.json", section]
    entry = json.loads(json.dumps(result.entries()[section]))
    del entry["provenance"]["pictures"]["mutant nee-no-cosine"]
    monkeypatch.setattr(stale.Result, "entries", lambda self: {section: entry})
    assert result.stale() == {section: ["mutant nee-no-cosine is not in it"]}


def pretend_to_measure(monkeypatch: pytest.MonkeyPatch, folder: Path, fresh: dict[str, object]) -> None:
    """Results are in the folder, and whatever command is run measures this scene."""

    class Done:
        returncode = 0

    def measured(words: list[str], cwd: Path, check: bool) -> Done:
        Path(words[-1]).write_text(json.dumps({"scenes": [fresh]}), encoding="utf-8")
        return Done()

    monkeypatch.setattr(stale, "REFERENCES", folder)
    monkeypatch.setattr(stale.subprocess, "run", measured)


def test_only_what_is_stale_is_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The command gets the names of these scenes, and the others' figures stay to the letter."""
    result = BY_FILE["techniques.json", "scenes"]
    kept = json.loads(result.path.read_text(encoding="utf-8"))
    fresh = {"scene": "cornell-box", "techniques": [], "provenance": {}}
    assert stale.command(result, ["cornell-box"], tmp_path)[3:] == [
        "techniques", "cornell-box", "--json", str(tmp_path),
    ]  # fmt: skip
    benchmark = BY_FILE["benchmark.json", "scenes"]
    assert "--scene cornell-2 --scene ball-1m" in " ".join(
        stale.command(benchmark, ["cornell-2", "ball-1m"], tmp_path)
    )

    (tmp_path / result.file).write_text(result.path.read_text(encoding="utf-8"), encoding="utf-8")

    pretend_to_measure(monkeypatch, tmp_path, fresh)
    stale.measure(result, ["cornell-box"])
    now = json.loads((tmp_path / result.file).read_text(encoding="utf-8"))
    for old, new in zip(kept["scenes"], now["scenes"], strict=True):
        assert new == (fresh if old["scene"] == "cornell-box" else old)
    monkeypatch.undo()
    lines_of = [
        (path / result.file).read_text(encoding="utf-8").splitlines()
        for path in (data.references_dir(), tmp_path)
    ]
    assert set(lines_of[1]) - set(lines_of[0]) == {
        '  {"scene": "cornell-box", "provenance": {}, "techniques": [',
        "   ]},",
    }


def test_what_is_measured_for_the_first_time_gets_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = json.loads((data.references_dir() / "techniques.json").read_text(encoding="utf-8"))
    names = [entry["scene"] for entry in kept["scenes"]]
    result = replace(BY_FILE["techniques.json", "scenes"], all=lambda: names)
    kept["scenes"] = [entry for entry in kept["scenes"] if entry["scene"] != "caustic"]
    (tmp_path / result.file).write_text(json.dumps(kept), encoding="utf-8")

    pretend_to_measure(monkeypatch, tmp_path, {"scene": "caustic", "techniques": [], "provenance": {}})
    stale.measure(result, ["caustic"])
    now = json.loads((tmp_path / result.file).read_text(encoding="utf-8"))
    assert [entry["scene"] for entry in now["scenes"]] == names


@pytest.mark.parametrize("result", [one for one in stale.RESULTS if one.text], ids=lambda one: one.file)
def test_a_file_is_written_as_its_command_writes_it(result: stale.Result) -> None:
    text = result.path.read_text(encoding="utf-8")
    assert result.text is not None and result.text(json.loads(text)) == text


class TestCalibration:
    """What a run has judged already it does not judge again, whatever the sources look like."""

    def pieces(self, monkeypatch: pytest.MonkeyPatch, measure) -> list[str]:
        """The names or labels that a run would measure."""
        found: list[str] = []

        def run(pool, work, pieces):
            found.extend(getattr(piece[0], "label", piece[0]) for piece in pieces)
            return iter(())

        monkeypatch.setattr(workers, "run", run)
        list(measure())
        return found

    def test_mutants(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        wanted = [mutants.read(mutants.FOLDER / f"{name}.patch") for name in ("brdf-2pi", "brdf-no-pi")]
        file = tmp_path / "kills.jsonl"
        lines.append_lines(file, [
            asdict(kills.Kill(one.name, "mistake", 1.0, 9.0, {}, "", kills.digest(one))) for one in wanted
        ])  # fmt: skip
        measure = lambda: kills.measure_kills(file, wanted)  # noqa: E731
        assert self.pieces(monkeypatch, measure) == []
        monkeypatch.setattr(mutants, "_digest", lambda mutant: "sources of another structure")
        assert self.pieces(monkeypatch, measure) == []
        with_another(monkeypatch, "mutant brdf-2pi")
        assert self.pieces(monkeypatch, measure) == ["brdf-2pi"]
        with_another(monkeypatch, "area-light nee double", *(kills.rests_on(wanted[0])[1:2]))
        assert set(self.pieces(monkeypatch, measure)) >= {"brdf-2pi"}
        monkeypatch.setattr(kills, "METHOD", kills.METHOD + 1)
        assert self.pieces(monkeypatch, measure) == ["brdf-2pi", "brdf-no-pi"]

    def test_nulls(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        chosen, file = nulls.CONFIGURATIONS[:2], tmp_path / "nulls.jsonl"
        lines.append_lines(file, [
            asdict(nulls.Set(one.label, 0, ["PASS"], "PASS", {}, {}, {}, one.digest)) for one in chosen
        ])  # fmt: skip
        measure = lambda: nulls.measure_nulls(file, 1, chosen)  # noqa: E731
        assert self.pieces(monkeypatch, measure) == []
        with_another(monkeypatch, chosen[1].rests_on[0])
        assert self.pieces(monkeypatch, measure) == [chosen[1].label]

    def test_signatures_have_a_file_for_each_picture(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        pair = signatures.Pair(mutants.read(mutants.FOLDER / "brdf-2pi.patch"), "area-light")
        kept = signatures.means_file(tmp_path, pair)
        monkeypatch.setattr(mutants, "_digest", lambda mutant: "sources of another structure")
        assert signatures.means_file(tmp_path, pair) == kept
        with_another(monkeypatch, "mutant brdf-2pi")
        assert signatures.means_file(tmp_path, pair) != kept
