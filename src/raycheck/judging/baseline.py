"""Yesterday against today: which cases changed, by how much, and what became of noise and speed.

In come the verdicts of two runs. Both judged against the same reference, whose error is the same in both, so
that the difference of two biases has the errors of the two renders alone.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from raycheck.base.text import percent
from raycheck.judging.cases import Case, Verification
from raycheck.judging.sentences import CHANNELS

CHANCE = 1e-3
"""That any picture of a whole run is said to have changed which has not."""
NOISE_ERRORS, NOISE_TRIFLE = 4.0, 0.05
"""Standard errors, and a relative difference, beyond which the noise is another."""
SPEED_TRIFLE = 0.25
"""Relative difference of times beyond which the speed is another; less is the machine's mood."""


@dataclass(frozen=True)
class Change:
    """One case, today beside the baseline."""

    scene: str
    technique: str
    same_pictures: bool
    """The first picture is the same, bit for bit."""
    verdicts: tuple[str, str]
    difference: float | None = None
    """Of the image's mean, relative, in the channel where it is surest; None where it was not measured."""
    half: float = 0.0
    """Half of its 99 % interval."""
    channel: str = ""
    changed: bool = False
    noise: float | None = None
    """Variance of a sample, over the baseline's."""
    noisier: bool = False
    """Or less noisy, beyond chance."""
    time: float | None = None
    """Seconds of a sample, over the baseline's."""
    slower: bool = False
    """Or faster, by more than times vary."""

    @property
    def other(self) -> bool:
        """Whether what the renderer computes changed; its speed is also the machine's and does not count."""
        return self.verdicts[0] != self.verdicts[1] or self.changed or self.noisier

    @property
    def sentence(self) -> str:
        """What changed, its speed among it; empty if nothing did."""
        parts = []
        if self.verdicts[0] != self.verdicts[1]:
            parts.append(f"was {self.verdicts[0]}, is {self.verdicts[1]}")
        if self.changed and self.difference is not None:
            size = f"{percent(abs(self.difference))} ± {percent(self.half)}"
            parts.append(f"{size} {'brighter' if self.difference > 0 else 'darker'} in {self.channel}")
        if self.noisier and self.noise is not None:
            parts.append(f"{self.noise:.2f} times the variance of a sample")
        if self.slower and self.time is not None:
            parts.append(f"{self.time:.2f} times the time of a sample")
        return ", ".join(parts)


def changes(before: Verification, now: Verification) -> list[Change]:
    """The cases that both runs have, in today's order, but those that both skip."""
    known = {(case.scene, case.technique): case for case in before.cases}
    pairs = [(known[key], case) for case in now.cases if (key := (case.scene, case.technique)) in known]
    pairs = [(old, new) for old, new in pairs if not (old.skipped and new.skipped)]
    alike = _same_machine(before, now)
    return [_change(old, new, len(pairs), alike) for old, new in pairs]


def _same_machine(before: Verification, now: Verification) -> bool:
    """Whether times can be compared."""
    return bool(before.header.get("machine") == now.header.get("machine"))


def alone(before: Verification, now: Verification) -> tuple[list[str], list[str]]:
    """The cases that only the baseline has, and those that only today has."""
    names = [[f"{case.scene}, {case.technique}" for case in run.cases] for run in (before, now)]
    return [n for n in names[0] if n not in names[1]], [n for n in names[1] if n not in names[0]]


def _change(old: Case, new: Case, cases: int, timed: bool) -> Change:
    same = bool(old.fingerprint) and old.fingerprint == new.fingerprint
    verdicts = (old.verdict.value, new.verdict.value)
    known = old.means and old.errors and new.means and new.errors
    if not (known and old.means and new.means and old.errors and new.errors):
        return Change(new.scene, new.technique, same, verdicts)
    difference = np.subtract(new.means, old.means)
    error = np.maximum(np.hypot(new.errors, old.errors), 1e-7)  # what float32 sums may differ by
    at = int(np.argmax(np.abs(difference) / error))
    critical = -float(special.ndtri(CHANCE / cases / 3 / 2))
    noise = new.noise / old.noise if old.noise and new.noise else None
    noise_error = math.hypot(old.noise_error or 0.0, new.noise_error or 0.0)
    timed = bool(timed and old.sample_seconds and new.sample_seconds)
    time = (new.sample_seconds or 0.0) / (old.sample_seconds or 1.0) if timed else None
    return Change(
        new.scene, new.technique, same, verdicts, float(difference[at]), float(2.576 * error[at]),
        CHANNELS[at], bool(abs(difference[at]) > critical * error[at]) and not same,
        noise, _beyond(noise, NOISE_TRIFLE, NOISE_ERRORS * noise_error),
        time, _beyond(time, SPEED_TRIFLE, 0.0),
    )  # fmt: skip


def _beyond(ratio: float | None, trifle: float, error: float) -> bool:
    return ratio is not None and abs(math.log(ratio)) > math.log1p(trifle) + error


def lines(before: Verification, now: Verification) -> list[str]:
    """What to print: the cases that changed, then how many did not."""
    found = changes(before, now)
    told = [f"{one.scene}, {one.technique}: {one.sentence}." for one in found if one.sentence]
    quiet = [one for one in found if not one.other]
    same = sum(one.same_pictures for one in quiet)
    unmeasured = sum(one.difference is None for one in quiet)
    rest = [f"{same} with the same pictures"] * (same > 0)
    if len(quiet) > same:
        most = max((one.half for one in quiet if not one.same_pictures), default=0.0)
        rest.append(f"{len(quiet) - same} within {percent(most)}")
    if unmeasured:
        rest.append(f"{unmeasured} of which no means were kept")
    day = before.header.get("date", "an unknown day")
    paces = sum(one.slower for one in found)
    speed = f"; {paces} at another speed" if paces else ""
    told.append(f"Since {day}: {len(found) - len(quiet)} changed, {len(quiet)} not{_listed(rest)}{speed}.")
    for words, names in zip(("Only in the baseline", "Not in the baseline"), alone(before, now), strict=True):
        told += [f"{words}: {'; '.join(names)}."] if names else []
    if not _same_machine(before, now):
        told.append("The baseline is of another machine: times are not compared.")
    return told


def _listed(parts: Sequence[str]) -> str:
    return f" ({', '.join(parts)})" if parts else ""
