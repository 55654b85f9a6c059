"""Put the table of references/benchmark.json into the README, between <!-- benchmark --> and
<!-- /benchmark -->.

    python scripts/readme_benchmark.py
"""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from pathlib import Path

from raycheck import speed
from raycheck.renderers import NotFound

ROOT = Path(__file__).resolve().parent.parent


def renewed(readme: str, found: Mapping) -> str:
    """The README with today's table."""
    text = f"<!-- benchmark -->\n{speed.markdown(found)}\n<!-- /benchmark -->"
    return re.sub(r"<!-- benchmark -->.*?<!-- /benchmark -->", lambda _: text, readme, flags=re.DOTALL)


def main() -> int:
    readme = ROOT / "README.md"
    try:
        found = speed.read(ROOT / "references" / "benchmark.json")
    except NotFound as problem:
        print(f"readme_benchmark: {problem}", file=sys.stderr)
        return 2
    readme.write_text(renewed(readme.read_text(encoding="utf-8"), found), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
