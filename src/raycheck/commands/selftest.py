"""raycheck selftest: does the grader survive hostile submissions here?"""

import tempfile
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from raycheck.base.errors import NotFound
from raycheck.commands.support import make_console, make_table, plain_errors
from raycheck.grading import attacks
from raycheck.grading.jail import sandbox
from raycheck.grading.jail.limits import Limits
from raycheck.grading.results import StudentResult
from raycheck.grading.written.pages import sentence


def selftest(
    attack: Annotated[bool, typer.Option("--attacks", help="Grade hostile submissions.")] = False,
    only: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Only this attack; may be repeated.")
    ] = None,
    tier: Annotated[
        sandbox.Tier | None,
        typer.Option("--sandbox", help="Which sandbox: the strongest that works by default."),
    ] = None,
) -> None:
    """Show on this machine that hostile submissions get no points, harm nothing and disturb nobody: exit
    status 1 if one does.
    """
    with plain_errors():
        if not attack:
            raise NotFound("selftest needs --attacks")
        chosen = [one for one in attacks.read_attacks() if not only or one.name in only]
        if not chosen:
            names = ", ".join(one.name for one in attacks.read_attacks())
            raise NotFound(f"there is no attack {', '.join(only or [])}; there are {names}")
        tier = _usable(tier) if tier else sandbox.best_tier()
        progress = Console(stderr=True)

        def on_result(result: StudentResult) -> None:
            progress.print(result.student, highlight=False, markup=False)

        with tempfile.TemporaryDirectory(prefix="raycheck-selftest-", ignore_cleanup_errors=True) as work:
            survived = attacks.survive(chosen, Path(work), tier, on_result)
    _show(survived, sandbox.Jail(tier, Limits()).describe())
    raise typer.Exit(1 if any(one.problem for one in survived) else 0)


def _usable(tier: sandbox.Tier) -> sandbox.Tier:
    """NotFound where it does not work here; hostile programs are never run without any."""
    problem = "attacks need a sandbox" if tier is sandbox.Tier.NONE else sandbox.why_not(tier)
    if problem:
        raise NotFound(f"--sandbox {tier}: {problem}")
    return tier


def _show(survived: list[attacks.Survived], sandbox_: str) -> None:
    console = make_console()
    table = make_table(("attack", "survived", "reason"))
    for one in survived:
        good = "[green]yes[/]" if not one.problem else "[bold red]NO[/]"
        table.add_row(one.name, good, (one.problem or one.reason).replace("[", "(")[:110])
    console.print(table)
    failed = sum(bool(one.problem) for one in survived)
    count = f"{len(survived) - failed} of {len(survived)} survived."
    console.print(f"{count} {sentence(sandbox_)}", highlight=False, soft_wrap=True)
