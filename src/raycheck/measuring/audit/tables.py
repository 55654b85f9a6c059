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


VERDICTS = ("finding", "documented approximation", "health", "undecided")


def counts(records: Sequence[Record]) -> dict[str, list[int]]:
    """How many of each verdict, by renderer with its version."""
    found: dict[str, list[int]] = {}
    for one in records:
        row = found.setdefault(f"{one.renderer} {one.version}", [0] * len(VERDICTS))
        row[VERDICTS.index(one.verdict)] += 1
    return found


def for_report(records: Sequence[Record]) -> dict[str, Any]:
    """What the report's page shows of them."""
    rows = [{"id": one.id, "says": one.says, "off": deviation(worst(one))} for one in records]
    by_verdict = {
        verdict: [row for row, one in zip(rows, records, strict=True) if one.verdict == verdict]
        for verdict in VERDICTS
    }
    return {"verdicts": VERDICTS, "counts": counts(records), "by_verdict": by_verdict}


def summary(records: Sequence[Record]) -> str:
    """How many of each verdict, by renderer."""
    rows = [
        f"| {renderer} | " + " | ".join(str(n) for n in row) + " |"
        for renderer, row in counts(records).items()
    ]
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
