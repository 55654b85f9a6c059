"""The command line: raycheck verify, compare, report, techniques, stability, reference, render, diagnose,
scene, grade, handout, variants, calibrate, selftest.

Each command is the function, or the Typer app, of its name in a module of `commands`. The module is imported
when its command is called, and with it nothing that only others need.
"""

from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from raycheck.base.machine import raycheck_version

FEW_COMMANDS = """\
raycheck judges Monte Carlo renderers against references. The commands that matter:

  raycheck verify point-light --renderer "./mine {scene} --spp {spp} --seed {seed} -o {output}"
      Is your renderer right on average? PASS, FAIL and what is wrong, or INCONCLUSIVE and what would decide.
  raycheck verify cornell-box --images 'mine-*.exr'
      The same for pictures that are already rendered.
  raycheck diagnose mine.exr
      Which known mistake makes an image like this?
  raycheck compare A.exr B.exr
      Do two renders with standard errors show the same mean?

raycheck COMMAND --help says more.
"""
COMMANDS = (
    "diagnose", "scene", "grade", "handout", "variants", "selftest", "verify", "compare", "report",
    "techniques", "stability", "reference", "render", "calibrate",
)  # fmt: skip


class Commands(TyperGroup):
    """The group of all COMMANDS: each comes from its module."""

    def list_commands(self, ctx: Any) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name not in COMMANDS:
            return None
        module = import_module(f"raycheck.commands.{cmd_name}")
        one: typer.Typer = getattr(module, "app", None) or plain_app()
        if not hasattr(module, "app"):
            one.command(name=cmd_name)(getattr(module, cmd_name))
        found = typer.main.get_command(one)
        found.name = cmd_name
        return found


def plain_app(cls: type[TyperGroup] | None = None) -> typer.Typer:
    """Without completion, markup or framed errors."""
    return typer.Typer(cls=cls, add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)


app = plain_app(Commands)


def _show_version(value: bool) -> None:
    if value:
        typer.echo(f"raycheck {raycheck_version()}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def few_commands(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """A judge of Monte Carlo renderers."""
    if context.invoked_subcommand is None:
        typer.echo(FEW_COMMANDS, nl=False)


def main() -> None:
    app(prog_name="raycheck")
