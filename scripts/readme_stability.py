"""Put the table of references/stability.json into the README, between <!-- stability --> and
<!-- /stability -->.

python scripts/readme_stability.py
"""

from __future__ import annotations

import re
from pathlib import Path

from raycheck import stability

ROOT = Path(__file__).resolve().parent.parent


def main() -> None:
    readme = ROOT / "README.md"
    results, _ = stability.read(ROOT / "references" / "stability.json")
    table = f"<!-- stability -->\n{stability.markdown(results)}\n<!-- /stability -->"
    text = readme.read_text(encoding="utf-8")
    readme.write_text(
        re.sub(r"<!-- stability -->.*?<!-- /stability -->", lambda _: table, text, flags=re.DOTALL),
        encoding="utf-8",
    )


if __name__ == "__main__":
    main()
