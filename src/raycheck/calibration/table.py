"""The figures of references/calibration.json as the README and docs/trust.md show them."""

from collections.abc import Mapping
from typing import Any

from raycheck.calibration.rivals import NAMES


def markdown(found: Mapping[str, Any]) -> str:
    """Kill rates and false alarms by rule, then what else was measured, a line each."""
    return "\n\n".join(
        [_rules(found["mutants"], found["nulls"]), _alarms(found["nulls"]), _power(found["mde"]),
         _looks(found["looks"]), _naming(found["naming"]), _unseen(found["unseen"]),
         _gradings(found["gradings"])]
    )  # fmt: skip


def sentence(found: Mapping[str, Any]) -> str:
    """What they come to: false alarms, and mistakes that are seen."""
    nulls, mutants = found["nulls"], found["mutants"]
    return (
        f"{nulls['false_alarms']} false alarms in {nulls['verdicts']:,} verdicts on images that are right; "
        f"{mutants['killed']['raycheck']} of {mutants['not_equivalent']} known mistakes seen."
    )


def _rules(mutants: Mapping[str, Any], nulls: Mapping[str, Any]) -> str:
    alarms = {"raycheck": nulls["false_alarms_whole"], **nulls["rival_false_alarms"]}
    classes = [row for row in mutants["by_effect"] if row["of"]]
    heads = [f"{_range(row)} ({row['of']})" for row in classes]
    lines = [
        f"| | mistakes seen, of {mutants['not_equivalent']} | {' | '.join(heads)} | "
        f"wrong alarms, of {nulls['sets']} |",
        "| --- |" + " ---: |" * (len(classes) + 2),
    ]
    for rule, name in NAMES.items():
        shares = " | ".join(f"{100 * row[rule] / row['of']:.0f} %" for row in classes)
        lines.append(f"| {name} | {mutants['killed'][rule]} | {shares} | {alarms[rule]} |")
    return "\n".join(lines)


def _range(row: Mapping[str, Any]) -> str:
    if row["to"] is None:
        return f"> {row['from']:g}"
    return f"{row['from']:g}–{row['to']:g}" if row["from"] else f"< {row['to']:g}"


def _alarms(nulls: Mapping[str, Any]) -> str:
    p = nulls["p_values"]
    shares = "; ".join(
        f"{family} {values['0.01']:.4f} and {values['0.001']:.5f} of {values['of']:,}"
        for family, values in p.items()
    )
    return (
        f"False alarms of raycheck: {nulls['false_alarms']} in {nulls['verdicts']:,} verdicts on parts of "
        f"images of {len(nulls['configurations'])} correct configurations. Share of p-values below 0.01 and "
        f"0.001: {shares}."
    )


def _power(mde: Mapping[str, Any]) -> str:
    said = [
        f"{name} {', '.join(f'{100 * share:.0f} %' for share in mde[name])}" for name in ("image", "tile")
    ]
    return (
        "A bias of 0.5, 1 and 2 times the printed detectable one, injected, is noticed by the test that it "
        f"was printed for: {'; '.join(said)}."
    )


def _looks(found: Mapping[str, Any]) -> str:
    power, p, e = found["power"], found["p_values"]["tile"], found["mean_e"]
    lines = [
        "| looks | detectable, together | each by itself | noticed together: image | tile | "
        "each by itself: image | tile |",
        "| ---: |" + " ---: |" * 6,
    ]
    for looks in (name for name in power if name != "strengths"):
        errors, one = power[looks]["standard_errors"], power[looks]
        shares = [one[family][rule][1] for rule in ("together", "apart") for family in ("image", "tile")]
        cells = " | ".join(f"{100 * share:.0f} %" for share in shares)
        lines.append(f"| {looks} | {errors['together']:.2f} | {errors['apart']:.2f} | {cells} |")
    told = (
        f"`verify --until`: {found['looks']} looks at each of {found['verdicts']:,} parts of images that are "
        f"right give {found['false_alarms']} false alarms; the largest evidence is "
        f"{found['largest_evidence']:.3g}, where a FAIL needs {found['needed_evidence']:,.0f}. The mean of e "
        f"is {e['image']:.2f} (image) and {e['tile']:.2f} (tiles), at most 1 as it must be; p-values of "
        f"tiles below 0.01, 0.001 and 0.0001 are {p['0.01']:.4f}, {p['0.001']:.5f} and {p['0.0001']:.6f} of "
        f"{p['of']:,}. What one test at the level of a case notices with 90 % probability, in standard "
        "errors of one of the two sets of a look, and how often the printed bias is noticed, injected:"
    )
    return f"{told}\n\n" + "\n".join(lines)


def _naming(naming: Mapping[str, Any]) -> str:
    parts = []
    for which in ("all scenes", "one image"):
        own, held_out, orphans = (naming[which][kind] for kind in ("catalogued", "held_out", "orphans"))
        parts.append(
            f"By {which}: of {own['of']} catalogued mistakes {own['named']} are called by their names and "
            f"{len(own['wrong'])} by others'; of {held_out['of']} in another form than the catalogue's "
            f"{held_out['named']} and {len(held_out['wrong'])}, {held_out['among_three']} are among the "
            f"nearest three; of {orphans['of']} whose own signature was taken away {len(orphans['wrong'])} "
            "are called by the name of one that looks otherwise"
        )
    return f"Naming mistakes that differ from the reference for sure. {'. '.join(parts)}."


def _unseen(found: Mapping[str, Any]) -> str:
    odd, even = found["odd"], found["even"]
    share = 100 * odd["covered_named"] / max(odd["covered"], 1)
    return (
        f"Mistakes and conventions that nobody tuned for ([tests/unseen](tests/unseen)), {found['renderer']} "
        f"of a renderer of its own and {found['oneray']} changes of oneray, each judged by one scene. In the "
        f"half by which no threshold was chosen, though its first false sentences were seen while the rules "
        f"were made, {odd['failed']} of {odd['of']} FAIL, something is named in "
        f"{odd['named']}, which is false in {len(odd['false'])} ({100 * odd['false_rate'][0]:.1f} … "
        f"{100 * odd['false_rate'][1]:.1f} % at {100 * odd['confidence']:.0f} % confidence); of "
        f"{odd['covered']} that a part of the light, a convention or the catalogue covers, "
        f"{odd['covered_named']} are named at once ({share:.0f} %). In the other half "
        f"{len(even['false'])} of {even['named']} are false, and {even['covered_named']} of "
        f"{even['covered']} named."
    )


def _gradings(found: Mapping[str, Any]) -> str:
    return (
        f"An honest program graded {found['gradings']} times with fresh keys, all tasks of an assignment "
        f"each time: {found['verdicts_failed']} of {found['verdicts']:,} verdicts are FAIL (less than "
        f"{100 * found['verdict_rate_below']:.2g} % are, at {100 * found['confidence']:.0f} % confidence); "
        f"{found['unconfirmed_failures']} looks failed by chance, to be taken back by a second one."
    )
