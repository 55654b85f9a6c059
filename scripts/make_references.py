#!/usr/bin/env python3
"""Render the references of the canonical scenes with Mitsuba 3: references/NAME.exr and
references/manifest.json.

python scripts/make_references.py                  every reference that is missing or stale
python scripts/make_references.py --all            every one
python scripts/make_references.py cornell-box      this one
python scripts/make_references.py furnace -Ddepth=4   a variant, references/furnace@depth=4.exr

It is `raycheck reference`, at low priority.
"""

import contextlib
import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "src"))

from raycheck.commands.app import app

if __name__ == "__main__":
    with contextlib.suppress(AttributeError, OSError):
        os.nice(10)
    app(["reference", *sys.argv[1:]], prog_name="make_references")
