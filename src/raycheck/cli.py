"""The program raycheck. What it imports before anything can be told its user is Python's own."""

import sys
from typing import NoReturn

from raycheck.base.text import use_stand_ins
from raycheck.commands.edge import status_of


def main() -> NoReturn:
    """Ends with one of the exit statuses, whatever happens; what standard output and standard error cannot
    encode is told in ASCII.
    """
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            use_stand_ins(stream)
    sys.exit(status_of(_run))


def _run() -> None:
    from raycheck.commands.app import app

    app()
