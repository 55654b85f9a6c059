"""Verify: render with many seeds, judge against the references, say what was found."""

import datetime
import math
import os
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from raycheck.base.errors import NotFound
from raycheck.base.machine import machine, raycheck_version
from raycheck.judging.agenda import Agenda, Task, oneray_agenda, renderer_agenda, supported
from raycheck.judging.cases import Case, Verification
from raycheck.judging.consistent import Sweep, judge_limit
from raycheck.judging.judge_images import image_paths, judge_files
from raycheck.judging.judge_renderer import (
    Planned,
    Survey,
    judge_surveyed,
    judge_task,
    plan_to_detect,
    survey,
)
from raycheck.judging.repeated import Repeated, judge_until
from raycheck.judging.settings import (
    PILOT_SPP,
    QUICK_CASE_SECONDS,
    QUICK_SECONDS,
    THOROUGH_SECONDS,
    OnImages,
    Settings,
    case_seeds,
)
from raycheck.judging.timetable import FEWEST_SPP, Budget, Timetable
from raycheck.renderers.commands import Command
from raycheck.renderers.manifest import manifest_for, written_command
from raycheck.renderers.renderer import Renderer
from raycheck.scene import variants
from raycheck.scene.support import Support
from raycheck.stats.verdict import ALPHA, LEAST_ALPHA, Limits, Outcome
from raycheck.truth import references
from raycheck.truth.expected import Truth, truth_of


def verify(
    renderer: str | Path | Callable[[Path, int, int], ArrayLike] | Renderer | None = None,
    scenes: str | Path | Sequence[str | Path] = (),
    *,
    parameters: Mapping[str, str] | None = None,
    techniques: Sequence[str] = (),
    needs: Sequence[str] | None = None,
    images: str | Sequence[str | Path] | None = None,
    thorough: bool = False,
    seed: int = 0,
    spp: int | None = None,
    jobs: int | None = None,
    seconds: float | None = None,
    until: float | None = None,
    detect: float | None = None,
    consistent: str | None = None,
    level: float | None = None,
    timeout: float | None = None,
    limits: Limits = Limits(),
    earlier: Sequence[Case] = (),
    on_case: Callable[[Case, int], None] | None = None,
    on_plan: Callable[[Timetable], None] | None = None,
    on_samples: Callable[[Sequence[Planned]], None] | None = None,
    on_images: OnImages | None = None,
    clock: Callable[[], float] = time.perf_counter,
    times: bool = True,
) -> Verification:
    """Judge a renderer on scenes that have references.

    `renderer` is a command with {output} and where it can {scene} or {json}, {spp} and {seed}, a folder with
    a raycheck.toml, a callable render(scene, spp, seed) that returns (H, W, 3) linear radiance, or None for
    oneray with every technique that applies (or those named). `needs` are words of scene.support: scenes that
    need more than these are left out; by default those of its raycheck.toml. A callable is called from this
    thread alone, one call after another, unless `jobs` says how many threads call it at a time; what it
    returns is copied, so that it may be a film that the next call fills again. Commands run two at a time
    unless `jobs` says otherwise. SKIP is of a scene that the renderer says that it does not support: by exit
    status 77, by a line "unsupported: why", or a callable by NotImplementedError.

    `images`, a glob or paths, judges pictures of one scene that were already rendered. `scenes` are canonical
    names, labels ("furnace@depth=2") or scene files, or one of these; none means all canonical ones, of which
    a quick run of oneray picks cases that take in every technique and scene, and a thorough one adds the
    scenes' other depths. `parameters` replace `<default>` values of the scenes. Verdicts of `earlier` stand
    where the renderer's first picture and the reference are still the same. `on_case(case, cases in all)` is
    called after each verdict.

    `seconds` is the budget of a quick run: what it is not enough for is not started, and left out. It is 90
    where nothing is said, which one case alone may exceed, and none with `spp`. `on_plan` hears of it before
    the first verdict. With `until` what is not decided is looked at again, with fresh samples, for so many
    seconds. With `detect` each case takes the samples that show such a relative bias of the image with 90 %
    probability, however long; `on_samples` hears of these before the first verdict. With `consistent`,
    "PARAM=v1,v2,v3,v4" from coarse to fine, the limit of the bias is judged of a command that takes {PARAM}.
    `on_images(scene, technique, truth, spp, images)` hears of the pictures as they are rendered.
    `level` is the chance that any FAIL of the whole run is wrong, by default 1e-5 for each case. Time goes by
    `clock`, and `times` says whether a picture may be rendered for its time alone where `spp` is given.
    Raises `raycheck.NotFound` where nothing can be judged.
    """
    started = clock()
    scenes = [scenes] if isinstance(scenes, str | Path) else scenes
    named = [variants.variant(scene, parameters) for scene in scenes or variants.scene_names()]
    own = manifest_for(renderer)
    one = not isinstance(renderer, str | Path | None)
    jobs = jobs or own.limits.jobs or (1 if one else min(2, os.cpu_count() or 1))
    if images is not None:
        if needs is not None:
            raise NotFound("--needs chooses scenes for a renderer: it does not go with --images")
        cases = [_judge_pictures(named, len(scenes), images, bool(renderer or techniques), limits, on_images)]
        if on_case:
            on_case(cases[0], 1)
        return Verification(cases, _header(clock() - started, cases, {}, thorough, seed, jobs))
    if renderer is not None and techniques:
        raise NotFound("--technique chooses among oneray's techniques: it does not go with --renderer")
    named, left_out = supported(named, own.needs if needs is None else Support.of(needs))
    planned = thorough or spp or until or detect is not None
    whole_time = seconds or (math.inf if planned else QUICK_SECONDS)
    budget = Budget(whole_time, seconds is not None, clock, started)
    settings = Settings(
        thorough=thorough, seed=seed, spp=spp, jobs=jobs, limits=limits,
        timeout=timeout or own.limits.picture_seconds
        or (600.0 if thorough or detect else max(60.0, until or 0.0)),
        detect=detect, repeated=until is not None,
        earlier={case.fingerprint: case for case in earlier if case.fingerprint},
        budget=whole_time, clock=clock, times=times, on_images=on_images,
    )  # fmt: skip
    sweep = Sweep.parse(consistent) if consistent is not None else None
    with tempfile.TemporaryDirectory(prefix="raycheck-") as folder:
        sweeps: list[Agenda] = []
        if sweep:
            sweeps = _sweep_agendas(sweep, renderer, named, Path(folder), explicit=bool(scenes))
            agenda = sweeps[-1]
        elif renderer is None:
            whole = not scenes and not techniques and not parameters and not left_out
            agenda = oneray_agenda(
                named, techniques, cover=whole and not thorough, variants=whole and thorough
            )
        else:
            agenda = renderer_agenda(renderer, named, Path(folder), explicit=bool(scenes))
        agenda.left_out |= left_out
        for of in {task.label: task.of for task in agenda.tasks}.values():
            references.require(of)
        settings = replace(settings, alpha=level_of_case(level, len(agenda.tasks)))
        run = _Run(agenda, settings, budget, on_case, on_plan)
        if sweep:
            run.judge_limits(sweep, sweeps)
        elif detect is not None:
            run.judge_detecting(on_samples)
        elif until is not None:
            run.judge_until(started + until)
        else:
            run.judge_all()
    header = _header(clock() - started, run.cases, agenda.left_out, thorough, seed, jobs, settings.alpha)
    return Verification(run.cases, header | ({} if until is None else {"until": until}))


def _sweep_agendas(
    sweep: Sweep, renderer: object, named: Sequence[variants.Variant], folder: Path, *, explicit: bool
) -> list[Agenda]:
    """The agenda of each value of the parameter, which differ in nothing else."""
    if not isinstance(renderer, str | Path):
        raise NotFound("--consistent sweeps a parameter of a command: name the --renderer")
    text, place = written_command(renderer)
    agendas = []
    for number, command in enumerate(sweep.commands(text)):
        own = folder / str(number)
        own.mkdir()
        agendas.append(renderer_agenda(Command.parse(command, place), named, own, explicit=explicit))
    return agendas


def level_of_case(level: float | None, cases: int) -> float:
    """The chance of a wrong FAIL of each case; NotFound where tails so far out were never measured."""
    each = ALPHA if level is None else level / cases
    if each < LEAST_ALPHA:
        many = f"for {cases} cases is {each:.2g} each"
        raise NotFound(
            f"--level {level:g} {many}, and p-values are known to {LEAST_ALPHA:g}: name fewer scenes"
        )
    return each


def _judge_pictures(
    named: Sequence[variants.Variant], scenes: int, images: str | Sequence[str | Path], more: bool,
    limits: Limits, on_images: OnImages | None,
) -> Case:  # fmt: skip
    """The verdict on pictures that are already rendered; NotFound where the request makes no sense."""
    if more:
        raise NotFound("--images judges pictures: it goes with neither --renderer nor --technique")
    if scenes != 1:
        raise NotFound("--images needs one SCENE, the one that the pictures show")
    return judge_files(named[0], image_paths(images), limits, on_images)


@dataclass
class _Run:
    """The cases of a run, and the ways to judge them."""

    agenda: Agenda
    settings: Settings
    budget: Budget
    on_case: Callable[[Case, int], None] | None
    on_plan: Callable[[Timetable], None] | None
    cases: list[Case] = field(default_factory=list)
    truths: dict[str, tuple[Truth, range]] = field(default_factory=dict)
    """And the seeds of their references."""

    def judge_all(self) -> None:
        """Each case is surveyed, and those that the seconds are enough for are judged; NotFound where the
        user's are not enough for any.
        """
        if math.isinf(self.budget.seconds):
            self._plan(Timetable(self.budget, self._names()))
            for task in self.agenda.tasks:
                self._add(_thorough(task, *self._truth(task), self.settings))
            return
        waiting = list(self.agenda.tasks)
        chosen, longer, plan = self._survey(waiting)
        self._plan(plan)
        while chosen:
            self._judge(chosen, plan.forced)
            chosen = chosen[1:]
            plan.planned = sum(map(self._worth, chosen))
            while not chosen and waiting and plan.has_room:  # something was judged sooner than planned
                one = self._opened(waiting.pop(0))
                if plan.take(one.task.label, self._least(one), self._worth(one), decided=bool(one.case)):
                    chosen.append(one)
                else:
                    longer.append(one)
        for task in (*(one.task for one in longer), *waiting):
            self.agenda.left_out[task.name] = plan.why_not

    def judge_detecting(self, on_samples: Callable[[Sequence[Planned]], None] | None) -> None:
        """With the samples that a detectable bias needs; what these are is said first."""
        self._plan(Timetable(self.budget, self._names()))
        planned = [plan_to_detect(task, *self._truth(task), self.settings) for task in self.agenda.tasks]
        if on_samples:
            on_samples(planned)
        for one in planned:
            self._add(judge_surveyed(one.found, replace(self.settings, spp=one.spp)))

    def judge_until(self, ends: float) -> None:
        """Each by as many looks as it takes."""
        self._plan(Timetable(self.budget, self._names()))
        looked = []
        for task in self.agenda.tasks:
            truth, taken = self._truth(task)
            looked.append(Repeated(task, truth, set(taken), self.settings))
        judge_until(looked, ends, self._add)
        order = {(task.label, task.technique): number for number, task in enumerate(self.agenda.tasks)}
        self.cases.sort(key=lambda case: order[case.scene, case.technique])

    def judge_limits(self, sweep: Sweep, agendas: Sequence[Agenda]) -> None:
        """The limit of each scene's bias, of agendas that differ in the value of the parameter."""
        self._plan(Timetable(replace(self.budget, seconds=math.inf), self._names()))
        scenes = list(zip(*(agenda.tasks for agenda in agendas), strict=True))
        timed = replace(
            self.settings, case_seconds=min(self.budget.seconds, QUICK_SECONDS) / len(scenes),
            ends=self.budget.ends if self.budget.asked else math.inf,
        )  # fmt: skip
        for tasks in scenes:
            self._add(judge_limit(sweep, tasks, *self._truth(tasks[0]), timed))

    def _names(self) -> list[tuple[str, str]]:
        return [(task.label, task.technique) for task in self.agenda.tasks]

    def _plan(self, plan: Timetable) -> None:
        if self.on_plan:
            self.on_plan(plan)

    def _survey(self, waiting: list[Task]) -> tuple[list[Survey], list[Survey], Timetable]:
        """Cases, taken from those `waiting`, that the seconds are enough for, and others that take longer. Of
        these the shortest is judged all the same, where there is no other and the user set no seconds.
        """
        plan = Timetable(self.budget, self._names())
        chosen: list[Survey] = []
        longer: list[Survey] = []
        while waiting and plan.has_room:
            one = self._opened(waiting.pop(0))
            if self._worth(one) > plan.left:
                one.make_again()
            if plan.take(one.task.label, self._least(one), self._worth(one), decided=bool(one.case)):
                chosen.append(one)
            else:
                longer.append(one)
        if longer and all(one.case and one.case.verdict is Outcome.SKIP for one in chosen):
            shortest = min(longer, key=self._least)
            if self.budget.asked:
                raise NotFound(plan.not_enough(shortest.task.label, self._least(shortest)))
            plan.forced = True
            plan.fits.append(shortest.task.label)
            longer.remove(shortest)
            chosen.append(shortest)
        return chosen, longer, plan

    def _opened(self, task: Task) -> Survey:
        truth, taken = self._truth(task)
        ends = self.budget.ends - self.budget.own if self.budget.asked else math.inf
        return survey(task, truth, taken, replace(self.settings, ends=ends))

    def _least(self, one: Survey) -> float:
        """Seconds of a case that hardly has samples."""
        return one.least(self.settings.jobs, self.budget.own, FEWEST_SPP)

    def _worth(self, one: Survey) -> float:
        """Seconds from which a case is better judged than others that have more."""
        return one.least(self.settings.jobs, self.budget.own, PILOT_SPP)

    def _judge(self, chosen: Sequence[Survey], forced: bool) -> None:
        """The first of those chosen, which leaves to each of the others what it takes at least; `forced`, it
        takes what it takes.
        """
        budget, one = self.budget, chosen[0]
        least = self._least(one)
        spare = budget.left - sum(map(self._least, chosen))
        share = min(least + max(spare, 0.0) / len(chosen), math.inf if budget.asked else QUICK_CASE_SECONDS)
        timed = replace(
            self.settings, case_seconds=max(share, least) - budget.own,
            ends=math.inf if forced else budget.ends - budget.own,
        )  # fmt: skip
        self._add(judge_surveyed(one, timed))
        if one.case is None:
            budget.own = max(budget.own, budget.clock() - one.renders.there[-1])

    def _add(self, case: Case) -> None:
        self.cases.append(case)
        if self.on_case:
            self.on_case(case, len(self.agenda.tasks))

    def _truth(self, task: Task) -> tuple[Truth, range]:
        if task.label not in self.truths:
            reference = references.load_reference(task.of)
            self.truths[task.label] = truth_of(reference), reference.seeds
        return self.truths[task.label]


def _thorough(task: Task, truth: Truth, taken: range, settings: Settings) -> Case:
    """The verdict of a run without a budget. A thorough one does what an INCONCLUSIVE case says would decide,
    where it has the time: further looks, at fresh samples alone, until one decides. Half of the level is for
    them, however many they are.
    """
    if not settings.thorough or settings.spp is not None:
        return judge_task(task, truth, taken, settings)
    half = replace(settings, alpha=settings.alpha / 2)
    case = judge_task(task, truth, taken, half)
    more = case.more_samples if case.verdict is Outcome.INCONCLUSIVE and case.looks == 1 else None
    if not (case.spp and more and case.seconds * more < THOROUGH_SECONDS):
        return case
    had = {*taken, *case_seeds(task.label, task.technique, settings.seed, taken)}
    asked = replace(half, spp=math.ceil(case.spp * more), look=1, earlier={})
    again = Repeated(task, truth, had, asked)
    judge_until([again], settings.clock() + THOROUGH_SECONDS, lambda _: None)
    found = again.case or case
    seconds = case.seconds + again.seconds
    return replace(found, looks=1 + found.looks, fingerprint=case.fingerprint, seconds=seconds)


def _header(
    spent: float, cases: list[Case], left_out: Mapping[str, str], thorough: bool, seed: int, jobs: int,
    alpha: float = ALPHA,
) -> dict[str, Any]:  # fmt: skip
    return {
        "raycheck": raycheck_version(),
        "date": datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ"), "machine": machine(),
        "mode": "thorough" if thorough else "quick", "seed": seed, "jobs": jobs, "alpha": alpha,
        "totals": totals(cases, spent),
        "left_out": dict(left_out),
    }  # fmt: skip


def totals(cases: Sequence[Case], spent: float = 0.0) -> dict[str, float]:
    """How many verdicts of each kind there are, and the seconds that they took."""
    counts = {outcome.value: sum(case.verdict is outcome for case in cases) for outcome in Outcome}
    return counts | {"seconds": round(max(spent, sum(case.seconds for case in cases)), 1)}
