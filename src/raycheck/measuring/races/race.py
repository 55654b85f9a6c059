"""One race: the contestants of a scene in interleaved rounds, their pictures kept until it is finished."""

import hashlib
import json
import shutil
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from raycheck.base.errors import NotFound, RenderError
from raycheck.base.files import whole, write_whole
from raycheck.base.images import Image
from raycheck.base.seeds import make_seeds
from raycheck.judging import checks
from raycheck.judging.timetable import pace
from raycheck.measuring.contestants import Contestant, Shot
from raycheck.scene.variants import Variant
from raycheck.truth.expected import Truth

LEAST_SPP, MOST_SPP = 1, 4096
LEAST_LEVELS = 6
PACED = (4, 16)
"""Samples per pixel of the two pictures that tell what a contestant costs."""


@dataclass
class Entry:
    """A contestant with what it rendered so far."""

    contestant: Contestant
    opened: dict[str, float] = field(default_factory=dict)
    levels: list[int] = field(default_factory=list)
    shots: dict[tuple[int, int], Shot] = field(default_factory=dict)
    """Pictures by samples per pixel and round."""
    reason: str = ""
    is_open: bool = False

    @property
    def name(self) -> str:
        return self.contestant.name


class Shelf:
    """Pictures of an unfinished scene on disk: a folder that belongs to just this race."""

    def __init__(self, folder: Path, key: str):
        self.folder = folder
        marker = folder / "key"
        if not marker.is_file() or marker.read_text() != key:
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir(parents=True)
            marker.write_text(key)

    def _path(self, name: str, what: str) -> Path:
        return self.folder / f"{hashlib.blake2b(name.encode(), digest_size=8).hexdigest()}-{what}"

    def shot(self, name: str, what: str, render: Callable[[], Shot]) -> Shot:
        """The picture that is there, else a new one."""
        path = self._path(name, f"{what}.npz")
        if path.is_file():
            with np.load(path) as kept:
                return Shot(kept["image"].astype(np.float64), float(kept["seconds"]))
        made = render()
        with whole(path) as partial:
            np.savez(partial, image=made.image.astype(np.float32), seconds=made.seconds)
        return Shot(made.image.astype(np.float32).astype(np.float64), made.seconds)

    def note(self, name: str, make: Callable[[], object]) -> object:
        """A decision or measurement that is made once."""
        path = self._path(name, "note.json")
        if path.is_file():
            return json.loads(path.read_text())
        value = make()
        write_whole(path, json.dumps(value))
        return value


def doubling(start: float, each: float, seconds: float, rounds: int) -> list[int]:
    """1, 2, 4, …: as many as take `seconds` in all rounds, at least six."""
    levels = [LEAST_SPP << k for k in range(LEAST_LEVELS)]
    while levels[-1] < MOST_SPP:
        more = [*levels, 2 * levels[-1]]
        if rounds * sum(start + each * spp for spp in more) > seconds:
            break
        levels = more
    return levels


@dataclass
class Race:
    """The race over one scene."""

    of: Variant
    truth: Truth
    contestants: Sequence[Contestant]
    seconds: float
    """Seconds of each contestant, all rounds together."""
    rounds: int
    shelf: Shelf
    tell: Callable[[str], None]

    def run(self) -> list[Entry]:
        entries = [Entry(one) for one in self.contestants]
        try:
            for entry in entries:
                self._attempt(entry, partial(self._prepare, entry))
            for number in range(self.rounds):
                for entry in entries:
                    self._attempt(entry, partial(self._round, entry, number))
                    self.tell(entry.name)
            for entry in entries:
                if not entry.reason:
                    entry.reason = self._problem(entry) or ""
            return entries
        except BaseException:
            self.close(entries)
            raise

    def close(self, entries: Iterable[Entry]) -> None:
        for entry in entries:
            if entry.is_open:
                entry.contestant.close()
                entry.is_open = False

    def _attempt(self, entry: Entry, action: Callable[[], None]) -> None:
        if entry.reason:
            return
        try:
            action()
        except (RenderError, NotFound) as error:
            entry.reason = str(error)
            self.close([entry])

    def _prepare(self, entry: Entry) -> None:
        """Two pictures tell what it costs, and so how far its samples double."""

        def plan() -> dict[str, Any]:
            opened = self._ready(entry)
            times = {spp: self._render(entry, spp, 1).seconds for spp in PACED}
            found = pace(times)
            levels = doubling(found.start, found.sample, self.seconds, self.rounds)
            return {"opened": opened, "levels": levels}

        noted = self.shelf.note(entry.name, plan)
        assert isinstance(noted, dict)
        entry.opened, entry.levels = noted["opened"], noted["levels"]

    def _ready(self, entry: Entry) -> dict[str, float]:
        if entry.is_open:
            return entry.opened
        entry.is_open = True
        return entry.contestant.open()

    def _render(self, entry: Entry, spp: int, seed: int) -> Shot:
        self._ready(entry)
        made = entry.contestant.render(spp, seed)
        image = Image(made.image)
        problem = checks.size_problem(image, *self.truth.shape) or checks.number_problem(image)
        if problem:
            raise RenderError(problem)
        return made

    def _round(self, entry: Entry, number: int) -> None:
        seeds = make_seeds(f"{self.of.label}/{entry.name}/curves/{number}", len(entry.levels))
        for spp, seed in zip(entry.levels, seeds, strict=True):
            entry.shots[spp, number] = self.shelf.shot(
                entry.name, f"{spp}-{number}", partial(self._render, entry, spp, seed)
            )

    def _problem(self, entry: Entry) -> str | None:
        images = [Image(entry.shots[entry.levels[-1], number].image) for number in range(self.rounds)]
        digests = [checks.digest(image) for image in images]
        return checks.seed_problem(digests, [f"round {k + 1}" for k in range(self.rounds)], self.truth.varies)

    def picture(self, entry: Entry, spp: int, key: str) -> tuple[Shot, int]:
        """Render one more picture; the picture and its seed."""
        [seed] = make_seeds(f"{self.of.label}/{entry.name}/{key}", 1)
        return self.shelf.shot(entry.name, f"{key}-{spp}", lambda: self._render(entry, spp, seed)), seed
