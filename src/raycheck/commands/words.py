"""The words of a command, as its options share them: what they say, or one line that says what is wanted."""

import os
import re
from collections.abc import Mapping
from pathlib import Path

from raycheck.base.errors import NotFound


def parse_settings(settings: list[str] | None) -> dict[str, str]:
    """["a=1", "b=2"] as {"a": "1", "b": "2"}; NotFound for anything else."""
    pairs = [setting.partition("=") for setting in settings or ()]
    for name, equals, _ in pairs:
        if not name or not equals:
            raise NotFound(f"-D{name}: -Dname=value is wanted")
    return {name: value for name, _, value in pairs}


def parse_bias(text: str) -> float:
    """ "0.5%" as 0.005; NotFound for anything else, and for what no verdict can show."""
    found = re.fullmatch(r"\s*([0-9]+(?:\.[0-9]*)?|\.[0-9]+)\s*%\s*", text)
    if not found:
        raise NotFound(f"--detect {text}: a percentage of the image is wanted, such as 0.5%")
    bias = float(found[1]) / 100
    if not LEAST_BIAS < bias <= MOST_BIAS:
        least, most = 100 * LEAST_BIAS, 100 * MOST_BIAS
        raise NotFound(f"--detect {text}: above {least:g}%, up to which no bias ever FAILs, to {most:g}%")
    return bias


LEAST_BIAS, MOST_BIAS = 5e-4, 0.5
"""The first is stats.verdict.SYSTEMATIC; importing that takes numpy."""


def writable(path: Path | None) -> None:
    """Say before a long run, not after it, that its result cannot be written."""
    if path is not None and (path.is_dir() or not Path(os.path.realpath(path)).parent.is_dir()):
        raise NotFound(f"{path}: there is no such folder, or it is one")


def options_of(values: Mapping[str, object]) -> list[str]:
    """Options, by name, as words of a command line; those that are None are left out."""
    return [word for name, value in values.items() if value is not None for word in (f"--{name}", str(value))]
