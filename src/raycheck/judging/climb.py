"""The ladder, rung by rung, with a renderer that is being written: up to the first scene that FAILs, and on
from there when the program has changed. What it could do already is kept in a file between runs.
"""

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from raycheck.base.errors import NotFound
from raycheck.base.files import write_whole
from raycheck.judging.cases import Case, Verification
from raycheck.judging.verify import totals, verify
from raycheck.renderers.watched import Watched
from raycheck.scene.variants import Variant
from raycheck.stats.verdict import Outcome
from raycheck.truth import references

STATE = "raycheck-climb.json"
PROGRAMS = "programs"
"""In its header: the program that each verdict is of, by scene."""

OnRung = Callable[[Case, Sequence[tuple[Any, ...]]], None]
"""Hears of a verdict, with what settings.OnImages heard on the way to it."""


@dataclass
class Climb:
    """Verdicts so far, of the program as it is now and as it was."""

    renderer: str
    rungs: Sequence[Variant]
    files: Watched
    """The program's: when they change, it is another."""
    state: Path
    settings: Mapping[str, Any] = field(default_factory=dict)
    """Arguments of judging.verify for every rung."""
    left_out: Mapping[str, str] = field(default_factory=dict)
    """Why scenes are no rungs."""
    cases: dict[str, Case] = field(default_factory=dict)
    programs: dict[str, str] = field(default_factory=dict)
    """Of what program, scene and settings each case is."""

    header: dict[str, Any] = field(default_factory=dict)
    """Of the last verdict."""

    def __post_init__(self) -> None:
        """Reads the state, where there is one; NotFound for a file of another kind."""
        self.program = self.files.digest() or ""
        self.entries = {of.label: references.require(of) for of in self.rungs}
        if self.state.exists():
            kept = Verification.read(self.state)
            programs = kept.header.get(PROGRAMS)
            if not isinstance(programs, dict):
                raise NotFound(f"{self.state}: not what raycheck climb keeps (--state FILE names another)")
            self.header = kept.header
            self.cases = {case.scene: case for case in kept.cases}
            self.programs = {scene: str(program) for scene, program in programs.items()}

    def ascend(self, on_case: OnRung) -> Case | None:
        """Judges the rungs, that which FAILed last first, then the ladder from below; the case that FAILs, or
        None at the top. A PASS of this very program stands; one of an earlier program is confirmed by its
        first picture where that has the same bits, else judged again. Where the program changes meanwhile it
        begins anew.
        """
        self.program = self.files.digest() or self.files.until_other("")
        waiting = list(self._order())
        while waiting:
            of = waiting.pop(0)
            kept = self.cases.get(of.label)
            pictures: list[tuple[Any, ...]] = []
            found = verify(
                self.renderer, of.label if of.canonical else of.path, parameters=of.parameters,
                earlier=[kept] if kept and kept.verdict is Outcome.PASS else [],
                on_images=lambda *seen, into=pictures: into.append(seen), **self.settings,
            )  # fmt: skip
            [case], self.header = found.cases, found.header
            now = self.files.digest() or self.files.until_other("")
            if now != self.program:  # nobody knows which of the two it was
                self.program = now
                waiting = list(self._order())
                continue
            self.cases[case.scene], self.programs[case.scene] = case, self._of(of)
            write_whole(self.state, self._verification(self.cases.values()).to_json())
            on_case(case, [] if case == kept else pictures)
            if case.verdict is Outcome.FAIL:
                return case
        return None

    def wait(self) -> None:
        """Until the program has changed since it was judged."""
        self.files.until_other(self.program)

    def result(self) -> Verification:
        """The verdicts on these rungs, in their order, as verify has them; without those to be confirmed."""
        open_ones = self.to_confirm()
        found = (self.cases.get(of.label) for of in self.rungs if of.label not in open_ones)
        return self._verification([case for case in found if case])

    def to_confirm(self) -> list[str]:
        """Rungs with a PASS of an earlier program."""
        return [of.label for of in self.rungs if self._is(of, Outcome.PASS) and not self._stands(of)]

    def _order(self) -> Iterator[Variant]:
        """The rungs that the program has to be tried on."""
        yield from (of for of in self.rungs if self._is(of, Outcome.FAIL))
        for of in self.rungs:
            if not self._is(of, Outcome.FAIL) and not (self._is(of, Outcome.PASS) and self._stands(of)):
                yield of

    def _is(self, of: Variant, outcome: Outcome) -> bool:
        case = self.cases.get(of.label)
        return case is not None and case.verdict is outcome

    def _stands(self, of: Variant) -> bool:
        """Its verdict is of the program as it is."""
        return self.programs.get(of.label) == self._of(of)

    def _of(self, of: Variant) -> str:
        """A digest of all that a verdict depends on."""
        what = (self.program, self.renderer, sorted(self.settings.items()), self.entries[of.label])
        return hashlib.blake2b(repr(what).encode(), digest_size=16).hexdigest()

    def _verification(self, cases: Iterable[Case]) -> Verification:
        listed = list(cases)
        own = {"totals": totals(listed), "left_out": dict(self.left_out), PROGRAMS: self.programs}
        return Verification(listed, self.header | own)
