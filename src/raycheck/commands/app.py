"""raycheck verify, compare, report, …: each command is the function, or the Typer app, of its name in a
module of this package. The module is imported when its command is called, and with it only what reads its
words.
"""

import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperGroup

from raycheck.base.errors import NotFound
from raycheck.base.text import nearest
from raycheck.commands.edge import status_of

FEW_COMMANDS = """\
raycheck judges Monte Carlo renderers against references. The commands that matter:

  raycheck verify point-light --renderer "./mine {scene} --spp {spp} --seed {seed} -o {output}"
      Is your renderer right on average? PASS, FAIL and what is wrong, or INCONCLUSIVE and what would decide.
  raycheck climb --renderer "./mine {scene} --spp {spp} --seed {seed} -o {output}"
      Scene by scene, from the simplest, while you write it: again whenever the program changes.
  raycheck verify cornell-box --images 'mine-*.exr'
      The same for pictures that are already rendered.
  raycheck diagnose mine.exr
      Which known mistake makes an image like this?
  raycheck compare A.exr B.exr
      Do two renders with standard errors show the same mean?

raycheck list names the scenes and techniques; raycheck COMMAND --help says more.
"""
COMMANDS = (
    "diagnose", "scene", "grade", "handout", "variants", "selftest", "verify", "climb", "compare", "report",
    "techniques", "stability", "reference", "render", "calibrate", "list", "completion",
)  # fmt: skip
UsageError: type[Exception] = typer.BadParameter.__bases__[0]


class Commands(TyperGroup):
    """The group of all COMMANDS: each comes from its module."""

    def list_commands(self, ctx: Any) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name not in COMMANDS:
            like = nearest(cmd_name, COMMANDS)
            raise NotFound(f"no command {cmd_name!r}{like} (raycheck --help lists them)")
        module = import_module(f"raycheck.commands.{cmd_name}")
        one: typer.Typer = getattr(module, "app", None) or plain_app()
        if not hasattr(module, "app"):
            one.command(name=cmd_name)(getattr(module, cmd_name))
        found = typer.main.get_command(one)
        found.name = cmd_name
        return found

    def main(self, args: Sequence[str] | None = None, *_: Any, **__: Any) -> NoReturn:
        sys.exit(status_of(lambda: self._ended(list(sys.argv[1:] if args is None else args))))

    def _ended(self, words: list[str]) -> int | None:
        """The exit status of the command; NotFound where it cannot be made of these words."""
        try:
            with self.make_context("raycheck", list(words)) as context:
                self.invoke(context)
        except typer.Exit as ended:
            return ended.exit_code
        except typer.Abort:
            raise KeyboardInterrupt from None
        except UsageError as error:
            said = " ".join(error.format_message().split()).rstrip(".")  # type: ignore[attr-defined]
            command = " ".join(["raycheck", *(word for word in words[:1] if word in COMMANDS)])
            raise NotFound(f"{said} ({command} --help says more)") from None
        return None


def plain_app(cls: type[TyperGroup] | None = None) -> typer.Typer:
    """Without completion, markup or framed errors."""
    return typer.Typer(
        cls=cls, add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )  # fmt: skip


app = plain_app(Commands)


def _show_version(value: bool) -> None:
    if value:
        from raycheck.base.machine import raycheck_version

        print(f"raycheck {raycheck_version()}")
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
        print(FEW_COMMANDS, end="")
