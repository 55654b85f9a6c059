"""Where oneray is, and its command line."""

import os
import shutil
import sys
import sysconfig
from collections.abc import Mapping, Sequence
from pathlib import Path

from raycheck.base.data import ROOT
from raycheck.base.errors import NotFound
from raycheck.renderers.commands import Command

_INSTEAD = "judge your own renderer with --renderer or --images"


def oneray_path() -> Path:
    """oneray: $ONERAY, build/oneray of the checkout, beside Python as from a wheel, then the PATH; NotFound
    where there is none.
    """
    named = os.environ.get("ONERAY")
    if named:
        if not Path(named).is_file():
            raise NotFound(f"ONERAY={named}: there is no such file; {_INSTEAD}")
        return Path(named)
    suffix = ".exe" if sys.platform == "win32" else ""
    built = ROOT / "build" / f"oneray{suffix}"
    installed = Path(sysconfig.get_path("scripts")) / f"oneray{suffix}"
    for place in (built, installed):
        if place.is_file():
            return place
    found = shutil.which("oneray")
    if found:
        return Path(found)
    raise NotFound(f"oneray was not found ($ONERAY, build/oneray, PATH): build it with make, or {_INSTEAD}")


def oneray_command(
    path: Path, options: Sequence[str], parameters: Mapping[str, str] | None = None
) -> Command:
    words = (str(path), "{scene}", "-o", "{output}", "--spp", "{spp}", "--seed", "{seed}", "--quiet")
    settings = (f"-D{name}={value}" for name, value in (parameters or {}).items())
    return Command((*words, *options, *settings))
