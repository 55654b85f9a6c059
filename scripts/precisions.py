"""Is what --precision auto takes enough? Forty generated scenes with narrow gaps, in auto and in double.

    python scripts/precisions.py [--json FILE] [--scenes N ...]

Exit status 1 if the two differ in one. A minute.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from raycheck.base.files import write_whole
from raycheck.base.machine import machine, raycheck_version, today
from raycheck.measuring.stability import precisions


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument(
        "--json", type=Path, metavar="FILE", help="the result, for references/precisions.json"
    )
    parser.add_argument("--scenes", type=int, nargs="+", metavar="N", help=f"of 0 to {precisions.COUNT - 1}")
    options = parser.parse_args()

    def show(pair: precisions.Pair) -> None:
        print("ok " if pair.holds else "OFF", "  ".join(precisions.row(pair)), flush=True)

    pairs = precisions.run(options.scenes or range(precisions.COUNT), show)
    print(precisions.summary(pairs))
    if options.json:
        command = "python scripts/precisions.py --json references/precisions.json"
        header = {"raycheck": raycheck_version(), "machine": machine(), "date": today(), "command": command}
        write_whole(options.json, precisions.to_json(pairs, header))
    return 0 if all(pair.holds for pair in pairs) else 1


if __name__ == "__main__":
    sys.exit(main())
