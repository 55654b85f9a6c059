"""A plugin of pytest, which it finds by itself: tests that judge a renderer.

    @pytest.mark.raycheck("point-light", "area-light", seconds=20)
    def test_right_on_average(raycheck_case):
        raycheck_case(render)

pytest --raycheck runs them; without it they are skipped, as each takes seconds. It imports nothing of
raycheck before such a test runs.
"""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from raycheck.judging.cases import Case

MARKER = "raycheck"
GALLERY = pytest.StashKey[Any]()


class Undecided(UserWarning):
    """A verdict is INCONCLUSIVE: nothing is known to be wrong, nor by so few samples right."""


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("raycheck", "is a renderer right on average?")
    group.addoption("--raycheck", action="store_true", help="run the tests that are marked raycheck")
    told = "leave a page with pictures for each of their verdicts"
    group.addoption("--raycheck-html", metavar="DIR", type=Path, help=told)


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line(
        "markers",
        f"{MARKER}(*scenes, **options): judge a renderer on each of these scenes, all by default, with "
        "options of raycheck.verify such as seconds=20; runs with --raycheck",
    )


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if not config.getoption("--raycheck"):
        for item in items:
            if item.get_closest_marker(MARKER):
                item.add_marker(pytest.mark.skip(reason="takes --raycheck"))


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """A test for each scene of the mark."""
    if "raycheck_scene" in metafunc.fixturenames:
        marker = metafunc.definition.get_closest_marker(MARKER)
        if marker is None:
            raise pytest.UsageError(
                f"{metafunc.definition.nodeid}: raycheck_case wants @pytest.mark.raycheck(SCENE, …)"
            )
        metafunc.parametrize("raycheck_scene", _scenes(metafunc.definition.nodeid, marker))


def _scenes(test: str, marker: pytest.Mark) -> list[str]:
    """Those of the mark, or all; UsageError for one that is none, or an option that verify has not."""
    import raycheck
    from raycheck.base.errors import PlainError
    from raycheck.scene import variants

    known = inspect.signature(raycheck.verify).parameters
    for name in marker.kwargs:
        if name not in known or name in ("renderer", "scenes", "techniques", "images"):
            raise pytest.UsageError(f"{test}: the mark raycheck has {name}=: verify has no such option")
    try:
        for scene in marker.args:
            variants.variant(scene)
    except PlainError as error:
        raise pytest.UsageError(f"{test}: {error}") from None
    return [str(scene) for scene in marker.args] or variants.scene_names()


@pytest.fixture
def raycheck_case(
    request: pytest.FixtureRequest, raycheck_scene: str, record_property: Callable[[str, object], None]
) -> Callable[[Any], Case]:
    """raycheck_case(renderer) judges a callable or a command, as raycheck.verify has them, on the scene of
    this test, and gives the case. The test fails with the sentence of a FAIL, is skipped where the renderer
    says that it does not support the scene, and warns where it is INCONCLUSIVE.
    """

    def judge(renderer: Any) -> Case:
        import raycheck
        from raycheck.base.errors import PlainError

        marker = request.node.get_closest_marker(MARKER)
        gallery = _gallery(request.config)
        try:
            [case] = raycheck.verify(
                renderer, raycheck_scene, on_images=gallery.take if gallery else None, **marker.kwargs
            ).cases
        except PlainError as error:
            pytest.fail(f"{raycheck_scene}: could not run: {error}", pytrace=False)
        record_property("raycheck", f"{case.scene}: {case.verdict}")
        if gallery:
            gallery.add(case)
        sentence = f"{case.scene}: {case.verdict}: {case.reason}"
        if case.verdict == "FAIL":
            pytest.fail(sentence, pytrace=False)
        if case.skipped:
            pytest.skip(sentence)
        if case.verdict == "INCONCLUSIVE":
            warnings.warn(Undecided(sentence), stacklevel=2)
        return case

    return judge


def _gallery(config: pytest.Config) -> Any:
    """Of this process, where pages are wanted; each process of pytest-xdist has a folder of its own."""
    folder = config.getoption("--raycheck-html")
    if folder and GALLERY not in config.stash:
        from raycheck.base.site import Site
        from raycheck.judging.verdict_pages import Gallery

        worker = getattr(config, "workerinput", {}).get("workerid", "")
        config.stash[GALLERY] = Gallery(Site(folder / worker))
    return config.stash.get(GALLERY, None)


def pytest_sessionfinish(session: pytest.Session) -> None:
    """The index of the pages of this process."""
    gallery = session.config.stash.get(GALLERY, None)
    if gallery:
        from raycheck.judging.cases import Verification

        gallery.finish(Verification([case for _, case in gallery.shown]))
