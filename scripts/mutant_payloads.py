"""Is each patch of tests/mutants still the mistake that it was? Payloads, tests/mutants/payloads.json.

    python scripts/mutant_payloads.py --check [NAME ...] [--jobs N]
    python scripts/mutant_payloads.py --write [NAME ...] [--jobs N]

Each mutant is built and renders a few samples of the scene that shows it, with seed 0. --check lists every
patch that cannot be built or has another payload than the kept one, and ends with status 1 where there is
one. --write keeps the payloads, after a patch was added or a change that is meant to change pictures. Both
list the mistakes that do not show: their payload is that of the program without a mistake.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor

from raycheck.base.errors import PatchError, RenderError
from raycheck.calibration import mutants, payloads
from raycheck.calibration.mutants import Mutant


def compute(wanted: Sequence[Mutant], jobs: int) -> Iterator[tuple[Mutant, str | None, str]]:
    """Each mutant with its payload, or None and why there is none."""

    def one(mutant: Mutant) -> tuple[Mutant, str | None, str]:
        try:
            return mutant, payloads.of_mutant(mutant), ""
        except (PatchError, RenderError) as error:
            return mutant, None, str(error)

    mutants.program(None)
    with ThreadPoolExecutor(jobs) as pool:
        yield from pool.map(one, wanted)


def chosen(names: Sequence[str]) -> list[Mutant]:
    """All where none is named."""
    found = {mutant.name: mutant for mutant in mutants.catalogue()}
    if unknown := sorted(set(names) - found.keys()):
        sys.exit(f"mutant_payloads: {mutants.FOLDER} has no {', '.join(unknown)}")
    return [found[name] for name in names] or list(found.values())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--write", action="store_true")
    what.add_argument("--check", action="store_true")
    parser.add_argument("names", metavar="NAME", nargs="*", help="a mutant; all by default")
    parser.add_argument("--jobs", type=int, default=1, metavar="N")
    given = parser.parse_args()
    wanted, kept = chosen(given.names), payloads.kept()
    found: dict[str, str] = {}
    wrong = 0
    for mutant, payload, reason in compute(wanted, given.jobs):
        if payload is None:
            print(f"{mutant.name}: {reason}", flush=True)
            wrong += 1
            continue
        found[mutant.name] = payload
        if payload == payloads.of_correct(*payloads.where(mutant)):
            print(f"{mutant.name}: does not show", flush=True)
        if given.check and payload != kept.get(mutant.name):
            print(f"{mutant.name}: {payload}, kept is {kept.get(mutant.name, 'none')}", flush=True)
            wrong += 1
    if given.write:
        payloads.keep(found)
        print(f"{payloads.FILE}: {len(found)} written, {wrong} failed")
    else:
        print(f"{len(wanted)} mutants, {wrong} differences")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
