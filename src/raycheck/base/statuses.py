"""How a program ends: the exit statuses of raycheck and oneray, which docs/verdicts.md lists."""

from enum import IntEnum


class Status(IntEnum):
    DONE = 0
    """All that was asked for is done; every verdict is PASS."""
    FAIL = 1
    """Something that was judged is wrong. Nothing else ends so."""
    COULD_NOT_RUN = 2
    """The command line, a file or the machine was wrong, as a line says."""
    INCONCLUSIVE = 3
    """Nothing is known to be wrong, but something is left open."""
    BUG = 70
    """The program itself is wrong; EX_SOFTWARE of sysexits.h."""
    CANNOT = 77
    """What a renderer says that does not support a scene: SKIP; a skipped test of automake."""
    INTERRUPTED = 130
    UNREAD = 141
    """Nobody reads its output any more; as shells say of SIGPIPE."""
