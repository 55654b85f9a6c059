"""raycheck completion: what a shell reads so that Tab completes raycheck and oneray."""

from enum import StrEnum
from typing import Annotated

import typer


class Shell(StrEnum):
    BASH = "bash"
    ZSH = "zsh"
    FISH = "fish"


class Program(StrEnum):
    RAYCHECK = "raycheck"
    ONERAY = "oneray"


def completion(
    shell: Annotated[Shell, typer.Argument(metavar="bash|zsh|fish", help="Which shell reads it.")],
    program: Annotated[
        Program, typer.Argument(metavar="[raycheck|oneray]", help="What it completes.")
    ] = Program.RAYCHECK,
) -> None:
    """Print what completes commands, options, scenes and techniques: eval "$(raycheck completion bash)"."""
    from raycheck.commands.work import completion as work

    of = work.of_oneray() if program is Program.ONERAY else work.of_raycheck()
    print(work.fish(program, of) if shell is Shell.FISH else work.bash(program, of, zsh=shell is Shell.ZSH))
