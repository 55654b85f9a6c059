"""What the tests share: the renderer under test, scenes, and how many cases of large families run."""

import hashlib
import os
import subprocess
from collections import defaultdict
from pathlib import Path

import pytest
from sampling import Driver

pytest_plugins = ["pytester"]
ROOT = Path(__file__).resolve().parents[1]


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("families of cases")
    group.addoption("--all", action="store_true", help="run all cases, and the broad fixtures: an hour")
    group.addoption("--sample", metavar="SEED", help="the sample of cases that an earlier run's head names")


def _seed(config: pytest.Config) -> str:
    """What chooses the samples: another with every commit, so that in time all cases have their turn."""
    if given := config.getoption("--sample"):
        return str(given)
    command = ["git", "-C", str(ROOT), "rev-parse", "--short=12", "HEAD"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError:
        return "none"
    return done.stdout.strip() or "none"


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "sample(n): n of the cases of this test run; all with --all")


def pytest_report_header(config: pytest.Config) -> str:
    if config.getoption("--all"):
        return "families of cases: all of each"
    return f"families of cases: a sample of each (--sample {_seed(config)}; --all for all)"


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keeps of each family the cases whose names hash lowest with the seed. A case that is asked for by its
    own name runs.
    """
    if config.getoption("--all") or any("[" in argument for argument in config.args):
        return
    families: dict[str, list[tuple[bytes, pytest.Item]]] = defaultdict(list)
    seed = _seed(config)
    for item in items:
        if item.get_closest_marker("sample"):
            rank = hashlib.sha256(f"{seed} {item.nodeid}".encode()).digest()
            families[item.nodeid.partition("[")[0]].append((rank, item))
    left: set[pytest.Item] = set()
    for cases in families.values():
        marker = cases[0][1].get_closest_marker("sample")
        assert marker is not None
        left |= {item for _, item in sorted(cases, key=lambda case: case[0])[marker.args[0] :]}
    if left:
        config.hook.pytest_deselected(items=sorted(left, key=lambda item: item.nodeid))
        items[:] = [item for item in items if item not in left]


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
