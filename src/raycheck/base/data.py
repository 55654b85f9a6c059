"""Where the scenes and references are: beside the modules as installed, or at the top of a checkout."""

from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]
"""raycheck's modules, with their templates and schemas."""
ROOT = PACKAGE.parents[1]
"""The top of a checkout, for what only a checkout has."""
PAYLOADS = ROOT / "tests/payloads.json"
"""The payloads of oneray's pictures, by scene, technique and precision."""
MUTANT_PAYLOADS = ROOT / "tests/mutants/payloads.json"
"""The payloads of programs with a mistake, by its name."""


def scenes_dir() -> Path:
    """Folder of the canonical scenes."""
    return _found("scenes")


def references_dir() -> Path:
    """Folder of the references."""
    return _found("references")


def _found(name: str) -> Path:
    """The folder as a wheel has it, in the package, else as a checkout has it."""
    places = (PACKAGE / name, ROOT / name)
    return next((place for place in places if place.is_dir()), places[-1])
