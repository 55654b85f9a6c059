"""The records for the terminal and for docs/audit.md."""

from collections.abc import Mapping, Sequence
from typing import Any

from raycheck.measuring.audit.results import Record, Value


def deviation(value: Value) -> str:
    """In per cent, with the interval."""
    low, high = (100 * (x / value.expected - 1) for x in (value.low, value.high))
    return f"{100 * value.off:+.3g} % ({low:+.3g} … {high:+.3g})"


def line(record: Record) -> str:
    """One line for the terminal."""

    return f"{record.verdict:24} {record.id:34} {deviation(worst(record))}"


def worst(record: Record) -> Value:
    return max(record.values, key=lambda value: abs(value.off))


def findings(records: Sequence[Record]) -> str:
    """A section for each record that is not health."""
    return "\n\n".join(_section(one) for one in records if one.verdict != "health")


def _section(one: Record) -> str:
    rows = [
        f"| {value.name} | {value.expected:.6g} | {value.measured:.6g} | {value.low:.6g} … {value.high:.6g} "
        f"| {100 * value.off:+.2f} % |"
        for value in one.values
    ]
    said = [
        f"### {one.id}",
        f"**{one.renderer} {one.version}, {one.verdict}**: {one.says}.",
        "| value | expected | measured | interval | off |\n| --- | ---: | ---: | --- | ---: "
        "|\n" + "\n".join(rows),
        f"Why it is sure: {one.why}",
        *([f"Documented: {one.documented}."] if one.documented else []),
        *([f"What to look at: {one.act}"] if one.act else []),
        *([f"Public report: {one.report}."] if one.report else []),
        f"    {one.command}",
        f"<details><summary>Scene, {one.samples} samples a pixel</summary>",
        f"```\n{one.scene.strip()}\n```",
        "</details>",
    ]
    return "\n\n".join(said)


def health(records: Sequence[Record]) -> str:
    """A table of those that are right."""
    rows = [
        f"| {one.renderer} {one.version} | `{one.id}` | {one.says} | {deviation(worst(one))} |"
        for one in records
        if one.verdict == "health"
    ]
    head = "| renderer | id | what is right | off, with its interval |\n| --- | --- | --- | --- |\n"
    return head + "\n".join(rows)


def summary(records: Sequence[Record]) -> str:
    """How many of each verdict, by renderer."""
    verdicts = ("finding", "documented approximation", "health", "undecided")
    rows = []
    for renderer in dict.fromkeys(one.renderer for one in records):
        own = [one for one in records if one.renderer == renderer]
        counts = [sum(one.verdict == verdict for one in own) for verdict in verdicts]
        rows.append(f"| {renderer} {own[0].version} | " + " | ".join(str(n) for n in counts) + " |")
    head = "| | findings | documented approximations | health | undecided |\n"
    return head + "| --- | ---: | ---: | ---: | ---: |\n" + "\n".join(rows)


def alarms(records: Sequence[Record], header: Mapping[str, Any]) -> str:
    """The false-alarm budget, the day and the machine."""
    count = sum(len(one.values) for one in records)
    return (
        f"{count} intervals, each of which misses the truth with probability {header['level']:g}: any of "
        f"them does with at "
        f"most {count * header['level']:.2g}, of {header['budget']:g} that are allowed. Measured on "
        f"{header['date']}, "
        f"{header['machine']}."
    )


def markdown(records: Sequence[Record], header: Mapping[str, Any]) -> str:
    """What docs/audit.md shows."""
    parts = (summary(records), alarms(records, header), "## Findings", findings(records), "## What is right")
    return "\n\n".join((*parts, health(records)))
