"""The sandboxes that there are, the strongest first."""

from enum import StrEnum


class Tier(StrEnum):
    """How programs are jailed."""

    BUBBLEWRAP = "bubblewrap"
    LANDLOCK = "landlock"
    USER = "user"
    """Another user and the filter of system calls alone."""
    NONE = "none"
