"""The plugin of pytest: a suite of somebody else judges its renderer."""

from __future__ import annotations

import importlib
import tomllib
from importlib.metadata import entry_points

import pytest
from building import ROOT

PLUGIN = "raycheck.commands.pytest_plugin"
MINE = """
import pytest
import numpy as np
from raycheck.truth import references

def render(scene, spp, seed, factor=1.0, noise=4):
    mean = factor * references.load_reference(scene.stem).best()[0]
    shape = noise * spp
    return mean * np.random.default_rng(seed).gamma(shape, 1 / shape, (*mean.shape[:2], 1))

def darker(scene, spp, seed):
    return render(scene, spp, seed, 0.9)

def noisy(scene, spp, seed):
    return render(scene, spp, seed, 1.0, 1e-4)

def refusing(scene, spp, seed):
    raise NotImplementedError("spheres")
"""


def plugin_words() -> list[str]:
    """What gives pytest the plugin in a checkout that was installed before there was one."""
    return [] if list(entry_points(group="pytest11", name="raycheck")) else ["-p", PLUGIN]


def suite(pytester: pytest.Pytester, text: str, *words: str) -> pytest.RunResult:
    pytester.makepyfile(MINE + text)
    return pytester.runpytest_subprocess("-q", "-p", "no:cacheprovider", *plugin_words(), *words)


CASE = """
@pytest.mark.raycheck({mark})
def test_it(raycheck_case):
    raycheck_case({renderer})
"""


def case(renderer: str = "render", mark: str = '"point-light", spp=4') -> str:
    return CASE.format(mark=mark, renderer=renderer)


def test_the_wheel_has_it() -> None:
    """The name of the entry point is a module that pytest can take."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["entry-points"]["pytest11"] == {"raycheck": PLUGIN}
    assert importlib.import_module(PLUGIN).pytest_addoption


def test_each_scene_is_a_test(pytester: pytest.Pytester) -> None:
    result = suite(pytester, case(mark='"point-light", "area-light", spp=4'), "--raycheck", "-vv")
    result.assert_outcomes(passed=2)
    result.stdout.fnmatch_lines(["*test_it?point-light? PASSED*", "*test_it?area-light? PASSED*"])


def test_without_the_option_it_is_skipped(pytester: pytest.Pytester) -> None:
    other = "\ndef test_other():\n    pass\n"
    result = suite(pytester, case("darker") + other, "-rs")
    result.assert_outcomes(passed=1, skipped=1)
    result.stdout.fnmatch_lines(["*takes --raycheck*"])


def test_a_fail_fails_with_its_sentence(pytester: pytest.Pytester) -> None:
    result = suite(pytester, case("darker"), "--raycheck")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["point-light: FAIL: *too dark*"])
    result.stdout.no_fnmatch_line("*pytest_plugin.py*")


def test_a_refusal_is_skipped(pytester: pytest.Pytester) -> None:
    result = suite(pytester, case("refusing"), "--raycheck", "-rs")
    result.assert_outcomes(skipped=1)
    result.stdout.fnmatch_lines(["*point-light: SKIP: unsupported: spheres*"])


def test_inconclusive_warns(pytester: pytest.Pytester) -> None:
    result = suite(pytester, case("noisy"), "--raycheck")
    assert result.parseoutcomes()["passed"] == 1  # and warnings, that of how it is installed among them
    result.stdout.fnmatch_lines(["*Undecided: point-light: INCONCLUSIVE: *"])
    strict = suite(pytester, case("noisy"), "--raycheck", "-W", f"error::{PLUGIN}.Undecided")
    strict.assert_outcomes(failed=1)


def test_a_command_is_a_renderer(pytester: pytest.Pytester) -> None:
    result = suite(pytester, case('"false {output}"'), "--raycheck")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["point-light: FAIL: exit status 1*"])
    result = suite(pytester, case('"./none {output}"'), "--raycheck")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["point-light: could not run: ./none: cannot be started*"])


@pytest.mark.parametrize(
    ("mark", "said"),
    [
        ('"point-lihgt"', "*test_it: no scene 'point-lihgt'; did you mean point-light?*"),
        ('"point-light", secs=3', "*test_it: the mark raycheck has secs=: *no such option*"),
        ('"point-light", scenes=3', "*test_it: the mark raycheck has scenes=: *"),
    ],
)
def test_a_wrong_mark_is_a_line(pytester: pytest.Pytester, mark: str, said: str) -> None:
    result = suite(pytester, case(mark=mark), "--raycheck")
    assert result.ret != 0
    (result.stderr if "test_it" in result.stderr.str() else result.stdout).fnmatch_lines([said])
    assert "Traceback" not in result.stdout.str() + result.stderr.str()


def test_a_fixture_without_a_mark_is_a_line(pytester: pytest.Pytester) -> None:
    result = suite(pytester, "def test_it(raycheck_case):\n    raycheck_case(render)\n", "--raycheck")
    assert "test_it: raycheck_case wants @pytest.mark.raycheck(SCENE" in result.stdout.str()


def test_pages_and_properties(pytester: pytest.Pytester) -> None:
    words = ("--raycheck", "--raycheck-html", "see", "--junitxml", "junit.xml")
    suite(pytester, case("darker"), *words).assert_outcomes(failed=1)
    index = (pytester.path / "see/index.html").read_text(encoding="utf-8")
    assert "pages/point-light-renderer.html" in index and "FAIL" in index
    assert (pytester.path / "see/pictures/point-light-renderer-error.png").is_file()
    junit = (pytester.path / "junit.xml").read_text(encoding="utf-8")
    assert '<property name="raycheck" value="point-light: FAIL"' in junit


def test_it_costs_other_suites_nothing(pytester: pytest.Pytester) -> None:
    """Where nothing is marked, nothing of raycheck is imported but the plugin."""
    pytester.makepyfile("import sys\ndef test_it():\n    assert not {'numpy', 'typer'} & set(sys.modules)\n")
    pytester.runpytest_subprocess("-q", *plugin_words()).assert_outcomes(passed=1)
