"""Scripts by which shells complete a command line: of raycheck by its commands' own parameters, of oneray by
what its table of options says in --help.
"""

import re
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import typer
from typer.core import TyperOption

from raycheck.commands.app import COMMANDS, app
from raycheck.renderers.oneray import oneray_path
from raycheck.scene import techniques, variants

ZSH = (
    "autoload -Uz compinit bashcompinit",
    "(( $+functions[compdef] )) || compinit",  # a second time it forgets what was completed before
    "bashcompinit",
)


@dataclass
class Option:
    """Of a command."""

    takes: bool
    """A value follows."""
    values: Sequence[str] = ()
    """What it may be; a file or anything else where there are none."""
    told: str = ""


@dataclass
class Words:
    """What may follow a command."""

    options: dict[str, Option] = field(default_factory=dict)
    words: Sequence[str] = ()
    """Without an option; files beside."""
    told: str = ""


Program = Mapping[str, Words]
"""By command; of the name "" what stands before or without one."""


def of_raycheck() -> Program:
    group: Any = typer.main.get_command(app)
    found = {"": _words([group], COMMANDS)}
    for name in COMMANDS:
        command = group.get_command(None, name)
        inner = list(getattr(command, "commands", {}))
        commands = [command, *(command.commands[one] for one in inner)]
        named = {param.name for one in commands for param in one.params}
        words = inner or (variants.scene_names() if "scenes" in named or "scene" in named else ())
        if name == "completion":
            words = [one for param in command.params for one in _choices(param)]
        found[name] = _words(commands, words)
        found[name].told = (command.get_short_help_str(60) or "").rstrip(".")
    return found


def _words(commands: Sequence[Any], words: Sequence[str]) -> Words:
    found = Words(words=words, options={"--help": Option(False, told="Show this message and exit")})
    for param in (param for one in commands for param in one.params):
        if isinstance(param, TyperOption):
            named = [one.name for one in techniques.TECHNIQUES] if param.name == "technique" else []
            for name in (*param.opts, *param.secondary_opts):
                takes = not (param.is_flag or param.count)
                found.options[name] = Option(takes, named or _choices(param), (param.help or "").rstrip("."))
    return found


def _choices(param: Any) -> list[str]:
    """The words of an enumeration, as one Typer or another knows them."""
    kind = getattr(getattr(param, "type_descriptor", None), "annotation", None)
    if isinstance(kind, type) and issubclass(kind, Enum):
        return [str(one.value) for one in kind]
    return [str(one) for one in getattr(getattr(param, "type", None), "choices", ())]


def of_oneray() -> Program:
    text = subprocess.run([oneray_path(), "--help"], capture_output=True, text=True, check=True).stdout
    [merging] = re.findall(r"oneray merge (.*)", text)
    options, last = dict[str, Option](), Option(False)
    for line in text.splitlines():
        option = re.match(r"  (-D|--?[a-z-]+)(?: ?(\S+))?(?: +(\S.*))?$", line)
        value = re.match(r"      ([a-z]+) +\*? +\S", line)
        if option:
            name, argument, told = option.groups(default="")
            last = options[name] = Option(bool(argument), [], told)
        elif value:
            last.takes, last.values = True, [*last.values, value[1]]
    merges = {name: one for name, one in options.items() if f"{name} " in merging}
    return {"": Words(options, ["merge"]), "merge": Words(merges, told="joins PART.film")}


def bash(name: str, program: Program, zsh: bool = False) -> str:
    """A function that bash calls, and zsh by its bashcompinit."""
    lines = [
        *(ZSH if zsh else ()),
        f"_{name}_completion() {{",
        "    local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]}",
        "    local command=${COMP_WORDS[1]} all=; COMPREPLY=()",
        "    [ \"$before\" = = ] && before=${COMP_WORDS[COMP_CWORD-2]}; [ \"$word\" = = ] && word=",
        "    [ $COMP_CWORD -eq 1 ] && command=",
        '    case "$command" in',
    ]
    for command, words in sorted(program.items(), reverse=True):
        pattern = command or "*"
        names = [*words.words, *words.options]
        lines += [f"    {pattern}) all='{' '.join(names)}'", '        case "$before" in']
        taking: dict[str, list[str]] = {}
        for option, of in words.options.items():
            if of.takes:
                taking.setdefault(" ".join(of.values), []).append(option)
        for values, options in taking.items():
            lines.append(f"        {'|'.join(options)}) all='{values}' ;;")
        lines += ["        esac ;;"]
    lines += [
        "    esac",
        '    COMPREPLY=($(compgen -W "$all" -- "$word"))',
        "}",
        f"complete -o default -F _{name}_completion {name}",
    ]
    return "\n".join(lines)


def fish(name: str, program: Program) -> str:
    """A line for each option."""
    commands = [command for command in program if command]
    lines = []
    for command, words in program.items():
        if command:
            when = f" -n '__fish_seen_subcommand_from {command}'"
            lines.append(f"complete -c {name} -n __fish_use_subcommand -a {command} -d {_quoted(words.told)}")
        else:
            when = f" -n 'not __fish_seen_subcommand_from {' '.join(commands)}'"
        others = [word for word in words.words if word not in commands]
        if others:
            lines.append(f"complete -c {name}{when} -a '{' '.join(others)}'")
        for option, of in words.options.items():
            kind = f"-l {option[2:]}" if option.startswith("--") else f"-s {option[1:]}"
            value = f" -x -a '{' '.join(of.values)}'" if of.values else " -r" if of.takes else ""
            lines.append(f"complete -c {name}{when} {kind}{value} -d {_quoted(of.told)}")
    return "\n".join(lines)


def _quoted(text: str) -> str:
    return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"
