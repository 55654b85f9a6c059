"""All checks, in their order."""

from collections.abc import Sequence

from raycheck.base.errors import NotFound
from raycheck.base.text import nearest
from raycheck.measuring.audit import cycles, luxcore, mitsuba, oneray, raysect, running
from raycheck.measuring.audit.check import LEVEL, Check

CHECKS: tuple[Check, ...] = (
    *mitsuba.CHECKS, *cycles.CHECKS, *luxcore.CHECKS, *raysect.CHECKS, *oneray.CHECKS,
)  # fmt: skip


def false_alarms(checks: Sequence[Check] = CHECKS) -> float:
    """Probability that any claim of the audit is false, at most: Bonferroni over all values."""
    return LEVEL * sum(len(check.names) for check in checks)


def named(names: Sequence[str]) -> list[Check]:
    """The checks of these ids, or of these renderers; all for none. NotFound for another name."""
    found = []
    for name in names:
        these = [check for check in CHECKS if name in (check.id, check.renderer)]
        if not these:
            known = [*running.RENDERERS, *(check.id for check in CHECKS)]
            raise NotFound(f"no check or renderer {name}{nearest(name, known)}; see python scripts/audit.py "
            f"list")
        found += these
    return found if names else list(CHECKS)

