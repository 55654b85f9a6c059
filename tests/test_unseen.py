"""Mistakes that nobody tuned for: a sample of them, and what is kept of all."""

import json

import pytest

from raycheck.base.data import references_dir
from raycheck.calibration import unseen
from raycheck.commands.calibrate import LINES
from raycheck.judging.verify import verify
from raycheck.stats.verdict import Outcome

SPP = 64
"""Of each image: enough for a verdict, however busy the machine is."""


@pytest.fixture(scope="module")
def every() -> dict[str, unseen.Unseen]:
    return {one.name: one for one in unseen.every()}


def test_there_are_enough_of_both_kinds(every: dict[str, unseen.Unseen]) -> None:
    """Names are unique, and neither half is small."""
    assert len(every) == len(unseen.every())
    for source in ("renderer", "oneray"):
        halves = [one.half for one in every.values() if one.source == source]
        assert len(halves) >= 120 and min(halves.count("odd"), halves.count("even")) >= 50


@pytest.mark.parametrize("scene", ["point-light", "furnace", "mixed-material"])
def test_without_a_mistake_the_renderer_is_right(scene: str) -> None:
    right = unseen.Unseen("none", "renderer", scene, "", "")
    [case] = verify(unseen.command(right), [scene], spp=SPP).cases
    assert case.verdict is Outcome.PASS


@pytest.mark.parametrize("name", ["rotated_half_turn", "no_pi", "one_over_d", "lamps_unseen", "gamma_22"])
def test_what_is_named_is_so(every: dict[str, unseen.Unseen], name: str) -> None:
    found = unseen.judge(every[name], SPP)
    labels = json.loads((unseen.FOLDER / "labels.json").read_text(encoding="utf-8"))
    assert unseen.named(found["said"]) in labels[name]["true"]


ONCE_FALSE = {
    "albedo_halved": "the direct light is # % ± # % too dark; everything else agrees",
    "albedo_srgb": "I decoded the albedos of the scene file as sRGB",
    "glass_tir_black": "I returned black where there is no refracted ray",
    "throughput_clamped": "",
    "lamps_clamped": "what the eye sees of the lamps themselves is",
    "roulette_all_free": "",
}
"""What may be said of mistakes that another sentence fits nearly as well, if anything is."""


def test_nothing_else_is_said_of_them() -> None:
    """Not another mistake, and no part of the light that is right."""
    rows = json.loads((references_dir() / "calibration.json").read_text(encoding="utf-8"))["unseen"]["rows"]
    said = {row["name"]: row for row in rows if row["name"] in ONCE_FALSE}
    assert set(said) == set(ONCE_FALSE)
    for name, words in ONCE_FALSE.items():
        assert said[name]["verdict"] == "FAIL" and "clamped" not in said[name]["said"]
        told = unseen.named(said[name]["said"])
        assert not told or (words and words in told), name


@pytest.mark.parametrize("name", ["glass_tir_black", "roulette_all_free"])
def test_nothing_false_is_said(every: dict[str, unseen.Unseen], name: str) -> None:
    """Total reflection absorbed is not roulette, and roulette is not direct light."""
    told = unseen.named(unseen.judge(every[name], 16)["said"])
    assert not told or (ONCE_FALSE[name] and ONCE_FALSE[name] in told)


def test_only_what_a_sentence_names_counts() -> None:
    where = "the image as a whole is 2.0 % ± 0.1 % too dark; all 64 tiles differ, most of all rows 0–7"
    assert unseen.named(where) == ""
    looks = f"{where} (correct renderers never look like this by chance); it looks like this mistake: “a; b”"
    assert unseen.named(looks) == "it looks like this mistake: “a; b”"
    assert unseen.named("everything is 2.0 ± 0.1 times as bright as it should be").startswith(
        "everything is #"
    )


def test_the_figures_are_those_of_the_lines() -> None:
    """Every sentence that names something has been looked at."""
    kept = json.loads((references_dir() / "calibration.json").read_text(encoding="utf-8"))["unseen"]
    assert kept == unseen.summary(LINES / "unseen.jsonl", unseen.every())
    for half in ("odd", "even"):
        low, high = kept[half]["false_rate"]
        assert low <= len(kept[half]["false"]) / kept[half]["named"] <= high
