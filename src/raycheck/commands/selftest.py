"""raycheck selftest: does the grader survive hostile submissions here?"""

from typing import Annotated

import typer

from raycheck.base.errors import NotFound
from raycheck.base.statuses import Status
from raycheck.grading.jail.tiers import Tier


def selftest(
    attack: Annotated[bool, typer.Option("--attacks", help="Grade hostile submissions.")] = False,
    only: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Only this attack; may be repeated.")
    ] = None,
    tier: Annotated[
        Tier | None,
        typer.Option("--sandbox", help="Which sandbox: the strongest that works by default."),
    ] = None,
) -> None:
    """Show on this machine that hostile submissions get no points, harm nothing and disturb nobody: exit
    status 1 if one does.
    """
    if not attack:
        raise NotFound("selftest needs --attacks")
    from raycheck.commands.work.selftest import survive

    raise typer.Exit(Status.DONE if survive(only or (), tier) else Status.FAIL)
