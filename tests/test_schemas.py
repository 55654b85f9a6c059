"""What --json writes keeps to the schemas that come with raycheck, made of the program's own types."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

import raycheck
from raycheck.base.images import write_exr
from raycheck.judging.compare import compare
from raycheck.truth import references
from raycheck.truth.expected import truth_of

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

import make_schema  # noqa: E402


def wrong(command: str, found: Any) -> list[str]:
    """What the schema has against a file."""
    file = ROOT / f"src/raycheck/schemas/{command}.schema.json"
    schema = json.loads(file.read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)
    errors = jsonschema.Draft202012Validator(schema).iter_errors(found)
    return [f"{'/'.join(map(str, one.absolute_path))}: {one.message}" for one in errors]


@pytest.mark.parametrize("command", make_schema.FILES)
def test_they_are_those_of_the_program(command: str) -> None:
    """python scripts/make_schema.py renews them."""
    file = ROOT / f"src/raycheck/schemas/{command}.schema.json"
    assert file.read_text(encoding="utf-8") == make_schema.written(command)


def render(scene: Path, spp: int, seed: int) -> np.ndarray:
    if scene.stem == "furnace":
        raise NotImplementedError("spheres")
    mean = truth_of(references.load_reference(scene.stem)).mean * (1.1 if scene.stem == "area-light" else 1)
    return mean * np.random.default_rng(seed).gamma(spp, 1 / spp, (*mean.shape[:2], 1))


@pytest.fixture(scope="module")
def verified() -> dict[str, Any]:
    """A PASS or INCONCLUSIVE, a FAIL and a SKIP."""
    found = raycheck.verify(render, ["point-light", "area-light", "furnace"], spp=4, until=20)
    assert {case.verdict.value for case in found.cases} >= {"FAIL", "SKIP"}
    result: dict[str, Any] = json.loads(found.to_json())
    return result


def test_verify(verified: dict[str, Any]) -> None:
    assert wrong("verify", verified) == []


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (("cases", 0, "verdict"), "MAYBE"), (("cases", 0, "bias"), "3 %"), (("cases", 0, "tile"), [1, "2"]),
        (("cases", 0, "more"), 1), (("mode",), "slow"), (("totals",), None), (("cases",), {}),
    ],
)  # fmt: skip
def test_what_is_wrong_is_seen(verified: dict[str, Any], place: Sequence[Any], value: Any) -> None:
    changed = json.loads(json.dumps(verified))
    at = changed
    for key in place[:-1]:
        at = at[key]
    at[place[-1]] = value
    assert wrong("verify", changed)
    del at[place[-1]]
    assert wrong("verify", changed) or place[-1] == "more"


def test_compare(tmp_path: Path) -> None:
    for name, value in (("a", 1.0), ("b", 1.1)):
        channels = {f"{e}{c}": np.full((8, 8), v, np.float32) for c in "RGB" for e, v in
                    (("", value), ("stderr.", 0.01))}  # fmt: skip
        write_exr(tmp_path / f"{name}.exr", channels)
    assert wrong("compare", json.loads(compare(tmp_path / "a.exr", tmp_path / "b.exr").to_json())) == []


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("techniques", ("techniques", "point-light", "--spp", "2")),
        ("stability", ("stability", "grazing", "--quick")),
    ],
)
def test_measured(command: str, words: Sequence[str], oneray: Path, tmp_path: Path) -> None:
    subprocess.run(
        [sys.executable, "-m", "raycheck", *words, "--json", tmp_path / "found.json"],
        env={"ONERAY": str(oneray), "PATH": "/usr/bin:/bin"}, check=True, capture_output=True,
    )  # fmt: skip
    assert wrong(command, json.loads((tmp_path / "found.json").read_text(encoding="utf-8"))) == []


@pytest.mark.parametrize(
    ("command", "file"),
    [
        ("verify", "verification"), ("techniques", "techniques"), ("stability", "stability"),
        ("report", "error_curves"), ("audit", "audit"),
    ],
)  # fmt: skip
def test_the_committed_results(command: str, file: str) -> None:
    """Verdicts that are older than a figure have it not."""
    found = wrong(command, json.loads((ROOT / f"references/{file}.json").read_text(encoding="utf-8")))
    assert [one for one in found if command != "verify" or "is a required property" not in one] == []
