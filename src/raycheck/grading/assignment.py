"""What is asked: the TOML file of an assignment, checked key by key."""

import math
import tomllib
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields
from pathlib import Path
from typing import Any

from raycheck.base.errors import NotFound, ReferenceError_
from raycheck.grading.jail.limits import Limits
from raycheck.scene.techniques import TECHNIQUES, technique
from raycheck.scene.variants import Variant, variant
from raycheck.truth import references

REVIEW = "review"
PROGRAM, PICTURES = "program", "pictures"


@dataclass(frozen=True)
class Task:
    """One thing to get right."""

    id: str
    scenes: tuple[str, ...]
    """Names, labels, or files beside the assignment."""
    points: float
    """Points for pictures without bias, shared by the scenes."""
    title: str = ""
    lecture: str = ""
    """Id of the lecture's technique."""
    hint: str = ""
    """What the student reads where the task fails."""
    spp: int = 64
    """Samples per pixel of each of the 64 judged pictures."""
    hidden: int = 0
    """How many variants of each scene, with a turned camera and other light, no student sees."""
    technique: str = ""
    """oneray's technique that is asked for: the noise is compared with it, and the handout renders by it."""
    noise_points: float = math.nan
    """Points for noise that is no worse than that technique's; 0 only shows it, NaN does not even that."""
    noise_limit: float = 2.0
    """Variance of a sample, over oneray's, up to which the noise points are earned."""
    speed_points: float = math.nan
    """Points for speed beside oneray's technique in the same jail; 0 only shows it, NaN measures none."""
    speed_limit: float = 20.0
    """Times oneray's seconds up to which the speed points are earned."""
    functions: tuple[str, ...] = ()
    """Functions of oneray that the task needs and that the handout leaves to the student."""
    accepts: str = PROGRAM
    """PROGRAM, or PICTURES: then a student may hand in pictures of a variant of the scene instead."""
    variants: int = 4
    """How many there are of that scene; a student's is decided by the secret."""

    @property
    def heading(self) -> str:
        return self.title or self.id

    @property
    def most(self) -> float:
        return self.points + sum(x for x in (self.noise_points, self.speed_points) if not math.isnan(x))

    @property
    def shows_noise(self) -> bool:
        return not math.isnan(self.noise_points)

    @property
    def measures_speed(self) -> bool:
        return not math.isnan(self.speed_points)


@dataclass(frozen=True)
class Assignment:
    path: Path
    name: str
    tasks: tuple[Task, ...]
    title: str = ""
    build: str = ""
    run: str = ""
    """Commands where a submission names none."""
    delta: float = 0.02
    """A PASS means: the image's mean within this of the reference, tiles within five times."""
    inconclusive: str | float = REVIEW
    """What too much noise to decide earns: a manual review, or a share of the points."""
    limits: Limits = field(default_factory=Limits)

    @property
    def most(self) -> float:
        return sum(task.most for task in self.tasks)

    def path_of(self, scene: str) -> Path:
        """The file of a task's scene."""
        return self.scene(scene).path

    def scene(self, name: str) -> Variant:
        """The scene of a task; ReferenceError_ if there is none."""
        beside = self.path.parent / name
        return variant(beside if beside.is_file() else name)


def read_assignment(path: Path) -> Assignment:
    """NotFound with the file, the place and what would be right."""
    try:
        found = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise NotFound(f"{path}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise NotFound(f"{path}: not TOML: {error}") from None
    tables, limited = found.pop("task", []), found.pop("limits", {})
    if not (isinstance(tables, list) and all(isinstance(table, dict) for table in tables)):
        raise NotFound(f"{path}: tasks are written [[task]], each a table")
    if not isinstance(limited, dict):
        raise NotFound(f"{path}: limits is {limited!r}, a table [limits] is wanted")
    limits = _limits(_table(Limits, limited, f"{path}: [limits]"), f"{path}: [limits]")
    tasks = tuple(_task(table, f"{path}: task {i + 1}") for i, table in enumerate(tables))
    if not tasks:
        raise NotFound(f"{path}: there is no [[task]]")
    ids = [task.id for task in tasks]
    doubled = next((i for i in ids if ids.count(i) > 1), None)
    if doubled:
        raise NotFound(f"{path}: two tasks have the id {doubled!r}")
    assignment = _table(Assignment, found, str(path), path=path, tasks=tasks, limits=limits)
    _check(assignment)
    result: Assignment = assignment
    return result


def _limits(limits: Limits, where: str) -> Limits:
    for key, value in vars(limits).items():
        if key != "readable" and not value > 0:
            raise NotFound(f"{where}: {key} is {value:g}, more than 0 is wanted")
    for place in limits.readable:
        if not Path(place).is_dir():
            raise NotFound(f"{where}: readable: there is no folder {place}")
    return limits


def _task(table: Mapping[str, Any], where: str) -> Task:
    task = _table(Task, table, where)
    if not task.scenes or task.points < 0 or task.spp < 1 or task.hidden < 0:
        raise NotFound(f"{where}: it needs scenes, points ≥ 0, spp ≥ 1 and hidden ≥ 0")
    if task.accepts not in (PROGRAM, PICTURES) or task.variants < 1:
        raise NotFound(f'{where}: accepts is "{PROGRAM}" or "{PICTURES}", variants ≥ 1')
    if task.accepts == PICTURES and len(task.scenes) != 1:
        raise NotFound(f"{where}: a task that accepts pictures has one scene")
    for points, key in ((task.noise_points, "noise_points"), (task.speed_points, "speed_points")):
        if points < 0:
            raise NotFound(f"{where}: {key} is {points:g}, at least 0 is wanted")
        if not getattr(task, key.replace("points", "limit")) > 0:
            raise NotFound(f"{where}: {key.replace('points', 'limit')} is wanted to be more than 0")
        if key in table and not task.technique:
            raise NotFound(f"{where}: {key} need the technique of oneray to compare with")
    result: Task = task
    return result


def _table(kind: type, table: Mapping[str, Any], where: str, **given: Any) -> Any:
    """A dataclass from a table whose keys and types are its fields'."""
    known = {f.name: f for f in fields(kind) if f.name not in given}
    unknown = sorted(set(table) - set(known))
    if unknown:
        raise NotFound(f"{where}: unknown key {unknown[0]!r} (there are {', '.join(known)})")
    missing = [n for n, f in known.items() if n not in table and f.default is f.default_factory is MISSING]
    if missing:
        raise NotFound(f"{where}: the key {missing[0]!r} is missing")
    values = {name: _value(table[name], known[name].type, f"{where}: {name}") for name in table}
    return kind(**values, **given)


_KINDS = {
    str: (str,), float: (int, float), int: (int,), bool: (bool,),
    str | float: (str, int, float), tuple[str, ...]: (list, tuple),
}  # fmt: skip


def _value(value: Any, kind: Any, where: str) -> Any:
    accepted: tuple[Any, ...] = _KINDS[kind]
    if not isinstance(value, accepted) or (isinstance(value, bool) and bool not in accepted):
        wanted = "a list of strings" if accepted[0] is list else getattr(kind, "__name__", kind)
        raise NotFound(f"{where} is {value!r}, {wanted} is wanted")
    if accepted[0] is list:
        if not all(isinstance(v, str) for v in value):
            raise NotFound(f"{where}: a list of strings is wanted")
        return tuple(value)
    if isinstance(value, float) and not math.isfinite(value):
        raise NotFound(f"{where} is {value}, a number is wanted")
    return float(value) if kind is float else value


def _check(assignment: Assignment) -> None:
    """Scenes and techniques that there are not, and shares beyond 1."""
    for task in assignment.tasks:
        where = f"{assignment.path}: task {task.id!r}"
        for scene in task.scenes:
            try:
                references.require(assignment.scene(scene))
            except ReferenceError_ as error:
                raise NotFound(f"{where}: {error}") from None
        if task.technique:
            try:
                technique(task.technique)
            except KeyError:
                names = ", ".join(t.name for t in TECHNIQUES)
                raise NotFound(f"{where}: no technique {task.technique!r}; there are {names}") from None
    share = assignment.inconclusive
    if share != REVIEW and not (isinstance(share, int | float) and 0 <= share <= 1):
        raise NotFound(
            f'{assignment.path}: inconclusive is {share!r}, "review" or a share from 0 to 1 is wanted'
        )
    if not 1e-4 <= assignment.delta <= 0.5:
        raise NotFound(f"{assignment.path}: delta is {assignment.delta}, 0.0001 to 0.5 is wanted")
