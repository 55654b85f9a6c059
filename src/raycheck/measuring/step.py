"""A step of a long measurement."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Step:
    """A render that was done, for a progress bar."""

    scene: str
    technique: str
