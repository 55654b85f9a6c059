"""What a program in the jail may take."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """The limits of the sandbox."""

    build_seconds: float = 120.0
    picture_seconds: float = 10.0
    task_seconds: float = 300.0
    memory_mb: int = 1024
    processes: int = 64
    output_mb: int = 64
    readable: tuple[str, ...] = ()
    """Folders beyond /usr that programs may read, such as a Python environment."""
