"""Hostile submissions, graded, and what it says about them."""

import tempfile
from collections.abc import Sequence
from pathlib import Path

from raycheck.base.errors import NotFound
from raycheck.base.text import plain
from raycheck.commands.terminal import Columns, Output
from raycheck.grading import attacks
from raycheck.grading.jail import sandbox
from raycheck.grading.jail.limits import Limits
from raycheck.grading.results import StudentResult
from raycheck.grading.written.pages import sentence


def survive(only: Sequence[str], tier: sandbox.Tier | None) -> bool:
    """Grade the attacks of these names, or all; whether none does harm."""
    chosen = [one for one in attacks.read_attacks() if not only or one.name in only]
    if not chosen:
        names = ", ".join(one.name for one in attacks.read_attacks())
        raise NotFound(f"there is no attack {', '.join(only)}; there are {names}")
    tier = _usable(tier) if tier else sandbox.best_tier()
    progress = Output(stderr=True)

    def on_result(result: StudentResult) -> None:
        progress.print(result.student, highlight=False, markup=False)

    with tempfile.TemporaryDirectory(prefix="raycheck-selftest-", ignore_cleanup_errors=True) as work:
        survived = attacks.survive(chosen, Path(work), tier, on_result)
    _show(survived, sandbox.Jail(tier, Limits()).describe())
    return not any(one.problem for one in survived)


def _usable(tier: sandbox.Tier) -> sandbox.Tier:
    """NotFound where it does not work here; hostile programs are never run without any."""
    problem = "attacks need a sandbox" if tier is sandbox.Tier.NONE else sandbox.why_not(tier)
    if problem:
        raise NotFound(f"--sandbox {tier}: {problem}")
    return tier


def _show(survived: list[attacks.Survived], sandbox_: str) -> None:
    console = Output()
    table = Columns(("attack", "survived", "reason"), wrap=("reason",))
    for one in survived:
        good = "[green]yes[/]" if not one.problem else "[bold red]NO[/]"
        table.add_row(one.name, good, plain(one.problem or one.reason).replace("[", "(")[:110])
    table.show(console)
    failed = sum(bool(one.problem) for one in survived)
    count = f"{len(survived) - failed} of {len(survived)} survived."
    console.print(f"{count} {sentence(sandbox_)}", highlight=False, soft_wrap=True)
