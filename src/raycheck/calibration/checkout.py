"""The checkout that calibrations depend on: the same on every machine that takes part."""

import platform
from dataclasses import dataclass

from raycheck.base.data import ROOT
from raycheck.base.errors import NotFound
from raycheck.calibration import mutants
from raycheck.renderers import builds


@dataclass(frozen=True)
class Checkout(builds.Build):
    """A build, with the sources from which mutants are made."""

    sources: str = ""
    """A name for oneray's sources and the way in which mutants are made of them here."""


def of_checkout() -> Checkout:
    """The checkout on this machine."""
    return Checkout(raycheck=builds.raycheck_hash(), sources=mutants.program_path(None).parent.parent.name)


def require(wanted: Checkout) -> None:
    """NotFound where this machine has another."""
    builds.require(wanted)
    if _sources() != wanted.sources:
        raise NotFound(
            f"{ROOT} on {platform.node()} has other sources of oneray, or its processor lacks AVX2 "
            "where another has it: calibrations need the same checkout on machines of one kind"
        )


def _sources() -> str:
    try:
        return mutants.program_path(None).parent.parent.name
    except NotFound as error:
        raise NotFound(f"{platform.node()}: {error}") from None
