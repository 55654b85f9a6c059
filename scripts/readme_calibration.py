"""Put the figures of references/calibration.json into the README, between the comments
<!-- calibration --> and <!-- /calibration -->.

    python scripts/readme_calibration.py
"""

from __future__ import annotations

import json
import re
from pathlib import Path

from raycheck.calibration.table import markdown

ROOT = Path(__file__).resolve().parent.parent


def renewed(readme: str, found: dict) -> str:
    """The README with today's figures."""
    text = f"<!-- calibration -->\n{markdown(found)}\n<!-- /calibration -->"
    return re.sub(r"<!-- calibration -->.*?<!-- /calibration -->", lambda _: text, readme, flags=re.DOTALL)


def main() -> None:
    readme = ROOT / "README.md"
    found = json.loads((ROOT / "references/calibration.json").read_text(encoding="utf-8"))
    readme.write_text(renewed(readme.read_text(encoding="utf-8"), found), encoding="utf-8")


if __name__ == "__main__":
    main()
