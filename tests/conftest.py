"""What the tests share: the renderer under test, and scenes."""

import os
from pathlib import Path

import pytest
from sampling import Driver

pytest_plugins = ["pytester"]
ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def oneray() -> Path:
    """The built renderer, $ONERAY or build/oneray; a test that needs it fails where it is missing."""
    path = Path(os.environ.get("ONERAY", ROOT / "build" / "oneray"))
    assert path.is_file(), f"{path} is not built: run make"
    return path.resolve()


@pytest.fixture(scope="session")
def scene():
    """scene(name) is the path of a canonical scene."""

    def path(name: str) -> Path:
        found = ROOT / "scenes" / f"{name}.xml"
        assert found.is_file(), f"no scene {name}"
        return found

    return path


@pytest.fixture(scope="session")
def driver(tmp_path_factory: pytest.TempPathFactory) -> Driver:
    """The functions of the headers, in double precision, one lane."""
    return Driver(tmp_path_factory.mktemp("driver"))


@pytest.fixture(scope="session")
def wide(tmp_path_factory: pytest.TempPathFactory) -> list[Driver]:
    """The same for two lanes in double precision and four in single, which any processor here has."""
    folder = tmp_path_factory.mktemp("wide")
    return [Driver(folder, "double", 2), Driver(folder, "single", 4)]


@pytest.fixture
def decoder():
    """Of the pictures of a submission."""
    from raycheck.grading.jail.pixels import Decoder  # it sets how many threads OpenImageIO has

    with Decoder() as one:
        yield one
