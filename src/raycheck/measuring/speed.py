"""What references/benchmark.json says of speed: tables for the terminal, docs/ and the report.

The file is written by scripts/benchmark.py. Figures are over interleaved rounds; a ratio is taken within a
round, and relative to Mitsuba llvm with its sampler `independent`.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from raycheck.base.errors import NotFound
from raycheck.base.text import number

BASELINE = "mitsuba llvm"
SHOWN = ("mitsuba scalar", "oneray double", "oneray single")
Spread = Mapping[str, float]


@dataclass(frozen=True)
class Row:
    """A contestant in a scene, as text: median (minimum … maximum)."""

    name: str
    cells: tuple[str, ...] = ()
    reason: str = ""


COLUMNS = (
    "Mpaths/s", "× llvm", "Mrays/s", "variance", "efficiency, × llvm", "peak MB", "mean off",
)  # fmt: skip


def read(path: Path) -> dict[str, Any]:
    """The file; NotFound if it is not one of the benchmark."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(found["scenes"], list) or not isinstance(found["growth"], list):
            raise TypeError
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise NotFound(f"{path}: no result of scripts/benchmark.py ({error or 'wrong structure'})") from None
    result: dict[str, Any] = found
    return result


def text(spread: Spread | None, scale: float = 1.0) -> str:
    """median (minimum … maximum), three digits; nothing for None."""
    if spread is None:
        return ""
    low, middle, high = (number(spread[key] * scale) for key in ("min", "median", "max"))
    return middle if low == high else f"{middle} ({low} … {high})"


def rows(scene: Mapping[str, Any]) -> list[Row]:
    """The contestants of a scene, in the order of the file."""
    return [_row(one) for one in scene["contestants"]]


def _row(one: Mapping[str, Any]) -> Row:
    if one["status"] != "ok":
        return Row(one["name"], reason=one["reason"])
    figures, ratios = one["figures"], one["ratios"]
    rays = text(figures.get("rays_per_second"), 1e-6)
    cells = (
        text(figures["paths_per_second"], 1e-6),
        text(ratios.get("paths_per_second")),
        f"≈ {rays}" if one["rays_assumed"] else rays,
        f"{number(figures['variance']['median'])} ± {100 * one['variance_error']:.0f} %",
        text(ratios.get("efficiency")),
        number(one["peak_memory_bytes"] / 1e6),
        _difference(one),
    )
    return Row(one["name"], cells)


def _difference(one: Mapping[str, Any]) -> str:
    """The mean against the baseline's."""
    if one["name"] == BASELINE or "difference" not in one:
        return ""
    off = one["difference"]
    return f"{100 * off['relative']:+.2f} % ({off['sigmas']:+.1f} σ)".replace("-", "−")


def plain(scene: Mapping[str, Any]) -> str:
    """The table of a scene for a terminal."""
    size = f"{scene['width']} × {scene['height']}, {scene['rounds']} rounds"
    table = [("", *COLUMNS), *((row.name, *row.cells) for row in rows(scene) if not row.reason)]
    widths = [max(len(line[i]) for line in table) for i in range(len(table[0]))]
    lines = [
        "  ".join(
            cell.ljust(width) if i == 0 else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in table
    ]
    lines += [f"{row.name}: failed: {row.reason}" for row in rows(scene) if row.reason]
    return "\n".join([f"{scene['name']}: {scene['about']}; {size}; median (minimum … maximum)", *lines])


def startup_lines(scene: Mapping[str, Any]) -> list[str]:
    """Seconds from the start of a process to a picture, a line for each contestant."""
    lines = []
    for one in scene["startup"]:
        parts = [f"{key} {text(one[key])}" for key in ("import", "load", "compile") if key in one]
        took = f"{text(one['total'])} s" if "total" in one else f"failed: {one['reason']}"
        lines.append(f"{one['name']}: {took}" + (f", of which {', '.join(parts)}" if parts else ""))
    return lines


def commands_line(found: Mapping[str, Any]) -> str:
    """What raycheck's commands cost before they do anything."""
    seconds = {one["words"]: one["seconds"]["median"] for one in found["commands"]["rows"]}
    slowest = max(seconds, key=seconds.__getitem__)
    return (
        f"Before it does anything raycheck takes {number(seconds['--version'])} s of a core to say its "
        f"version, {number(seconds['--help'])} s its help, and at most {number(seconds[slowest])} s "
        f"(`{slowest}`) the help of a command, or that arguments are wrong ({found['commands']['machine']})."
    )


def exponent_text(curve: Mapping[str, Any]) -> str:
    """The exponent with its standard error."""
    fit = curve["exponent"]
    return f"{fit['value']:.2f} ± {fit['error']:.2f}".replace("-", "−") if fit else "–"


def growth_lines(found: Mapping[str, Any]) -> list[str]:
    """The exponents, a line for each axis."""
    return [
        f"{one['label']} ({one['scene']}): seconds grow with exponent "
        + ", ".join(f"{curve['name']} {exponent_text(curve)}" for curve in one["curves"])
        for one in found["growth"]
    ]


def _named(scene: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    return next((x for x in scene["contestants"] if x["name"] == name and x["status"] == "ok"), {})


def _best_sampler(scene: Mapping[str, Any]) -> str:
    for one in scene["contestants"]:
        if one["name"].startswith(f"{BASELINE} ") and one["status"] == "ok":
            return f"{text(one['ratios'].get('efficiency'))} {one['name'].removeprefix(BASELINE).strip()}"
    return ""


def markdown(found: Mapping[str, Any]) -> str:
    """The table of docs/speed.md: a row for each scene."""
    heads = ["", "Mitsuba llvm, Mpaths/s", *(f"{name}, times its paths/s" for name in SHOWN)]
    heads += [
        *(f"{name}, times its efficiency" for name in SHOWN[1:]),
        "llvm's best sampler, times its efficiency",
    ]
    lines: list[Sequence[str]] = [heads, ["---"] * len(heads)]
    for scene in found["scenes"]:
        base, shown = _named(scene, BASELINE), [_named(scene, name) for name in SHOWN]
        line = [scene["about"], text(base.get("figures", {}).get("paths_per_second"), 1e-6)]
        line += [text(one.get("ratios", {}).get("paths_per_second")) for one in shown]
        line += [text(one.get("ratios", {}).get("efficiency")) for one in shown[1:]]
        lines.append([*line, _best_sampler(scene)])
    table = "\n".join("| " + " | ".join(line) + " |" for line in lines)
    return f"{table}\n\n{made_with(found)}; median (minimum … maximum) of {found['rounds']} rounds."


def made_with(found: Mapping[str, Any]) -> str:
    """Machine, compiler, versions and day."""
    machine = found["machine"]
    day = found["date"][:10]
    return f"{machine['processor']}; {machine['compiler']}; Mitsuba {machine['mitsuba']}; {day}"
