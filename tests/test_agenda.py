"""Which cases a quick run picks: few, and yet every technique twice and every scene."""

from collections import Counter
from pathlib import Path
from types import SimpleNamespace

from raycheck.judging.agenda import Task, _cover
from raycheck.scene.variants import Variant


def covered(scenes: dict[str, str]) -> list[tuple[str, str]]:
    """The cases picked of scenes and the techniques, a letter each, that apply to them."""
    pairs = [
        (Variant(Path(f"{scene}.xml")), SimpleNamespace(name=one))
        for scene, names in scenes.items()
        for one in names
    ]
    return [(of.label, one.name) for of, one in _cover(pairs)]


def test_each_technique_is_judged_on_two_scenes() -> None:
    found = covered(dict.fromkeys(("s1", "s2", "s3", "s4"), "abc"))
    assert Counter(name for _, name in found) == {"a": 2, "b": 2, "c": 2}


def test_techniques_take_the_scenes_that_have_had_least() -> None:
    found = covered(dict.fromkeys(("s1", "s2", "s3", "s4"), "ab"))
    assert Counter(label for label, _ in found) == {"s1": 1, "s2": 1, "s3": 1, "s4": 1}


def test_techniques_of_few_scenes_choose_first() -> None:
    """Those of many can go where nobody was."""
    found = covered({"s1": "abc", "s2": "abc", "s3": "c", "s4": "c"})
    assert {label for label, name in found if name == "c"} == {"s3", "s4"}


def test_a_scene_that_no_technique_chose_is_judged_too() -> None:
    found = covered(dict.fromkeys(("s1", "s2", "s3", "s4"), "a"))
    assert {label for label, _ in found} == {"s1", "s2", "s3", "s4"}
    assert covered({"s1": "a"}) == [("s1", "a")]


def test_another_renderer_s_samples_are_taken_to_be_independent() -> None:
    def task(name: str) -> Task:
        return Task(Variant(Path("a.xml")), name, None, Path("a.xml"))

    assert task("renderer").independent and task("nee").independent
    assert not task("mis-sobol").independent
