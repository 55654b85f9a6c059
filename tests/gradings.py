"""What tests of grading share."""

import sys
from pathlib import Path

import pytest

from raycheck.grading.jail import sandbox
from raycheck.grading.jail.sandbox import Tier


def written(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def need(tier: Tier) -> None:
    """Skip, with the reason, where that jail does not work."""
    problem = "grading needs Linux" if sys.platform != "linux" else sandbox.why_not(tier)
    if problem:
        pytest.skip(f"{tier}: {problem}")
