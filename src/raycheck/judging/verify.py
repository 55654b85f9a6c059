"""Verify: render with many seeds, judge against the references, say what was found."""

import datetime
import math
import os
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from raycheck.base.errors import CannotRender, NotFound, RenderError
from raycheck.base.machine import machine, raycheck_version
from raycheck.judging.agenda import Agenda, Task, oneray_agenda, renderer_agenda
from raycheck.judging.cases import Case, Verification
from raycheck.judging.consistent import Sweep, judge_limit
from raycheck.judging.judge_images import image_paths, judge_files
from raycheck.judging.judge_renderer import Planned, judge_task, plan_to_detect
from raycheck.judging.repeated import Repeated, judge_until
from raycheck.judging.settings import (
    QUICK_CASE_SECONDS,
    QUICK_SECONDS,
    THOROUGH_SECONDS,
    Settings,
    case_seeds,
)
from raycheck.renderers.renderer import Renderer
from raycheck.scene import variants
from raycheck.stats.verdict import ALPHA, LEAST_ALPHA, Limits, Outcome
from raycheck.truth import references
from raycheck.truth.expected import Truth, truth_of


def verify(
    renderer: str | Callable[[Path, int, int], ArrayLike] | Renderer | None = None,
    scenes: str | Path | Sequence[str | Path] = (),
    *,
    parameters: Mapping[str, str] | None = None,
    techniques: Sequence[str] = (),
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
    on_plan: Callable[[Sequence[Planned]], None] | None = None,
) -> Verification:
    """Judge a renderer on scenes that have references.

    `renderer` is a command with {output} and where it can {scene} {spp} {seed}, a callable render(scene, spp,
    seed) that returns (H, W, 3) linear radiance, or None for oneray with every technique that applies (or
    those named). A callable is called from this thread alone, one call after another, unless `jobs` says how
    many threads call it at a time; what it returns is copied, so that it may be a film that the next call
    fills again. Commands run two at a time unless `jobs` says otherwise; one that ends with exit status 77
    cannot render the scene, which is left out.

    `images`, a glob or paths, judges pictures of one scene that were already rendered. `scenes` are canonical
    names, labels ("furnace@depth=2") or scene files, or one of these; none means all canonical ones, of which
    a quick run of oneray picks cases that take in every technique and scene, and a thorough one adds the
    scenes' other depths. `parameters` replace `<default>` values of the scenes. `seconds` is the budget of a
    quick run. With `until` what is not decided is looked at again, with fresh samples, for so many seconds.
    With `detect` each case takes the samples that show such a relative bias of the image with 90 %
    probability, however long; `on_plan` is called first with what that is.
    With `consistent`, "PARAM=v1,v2,v3,v4" from coarse to fine, the limit of the bias is judged of a command
    that takes {PARAM}. `level` is the chance that any FAIL of the whole run is wrong, by default 1e-5 for
    each case. Verdicts of `earlier` stand where the renderer's first picture and the reference are still the
    same. `on_case(case, cases in all)` is called after each verdict. Raises `raycheck.NotFound` where nothing
    can be judged.
    """
    started = time.perf_counter()
    scenes = [scenes] if isinstance(scenes, str | Path) else scenes
    named = [variants.variant(scene, parameters) for scene in scenes or variants.scene_names()]
    jobs = jobs or (min(2, os.cpu_count() or 1) if isinstance(renderer, str | None) else 1)
    if images is not None:
        cases = [_judge_pictures(named, len(scenes), images, bool(renderer or techniques), limits)]
        if on_case:
            on_case(cases[0], 1)
        return Verification(cases, _header(started, cases, {}, thorough, seed, jobs))
    if renderer is not None and techniques:
        raise NotFound("--technique chooses among oneray's techniques: it does not go with --renderer")
    budget = QUICK_SECONDS if seconds is None else seconds
    settings = Settings(
        thorough=thorough, seed=seed, spp=spp, jobs=jobs, limits=limits,
        timeout=timeout or (600.0 if thorough or detect else max(60.0, until or 0.0)),
        repeated=until is not None,
        earlier={case.fingerprint: case for case in earlier if case.fingerprint},
    )  # fmt: skip
    sweep = Sweep.parse(consistent) if consistent is not None else None
    with tempfile.TemporaryDirectory(prefix="raycheck-") as folder:
        agendas: list[Agenda] = []
        if sweep:
            if not isinstance(renderer, str):
                raise NotFound("--consistent sweeps a parameter of a command: name the --renderer")
            for command in sweep.commands(renderer):
                agendas.append(renderer_agenda(command, named, Path(folder), explicit=bool(scenes)))
            agenda = agendas[-1]
        elif renderer is None:
            whole = not scenes and not techniques and not parameters
            agenda = oneray_agenda(
                named, techniques, cover=whole and not thorough, variants=whole and thorough
            )
        else:
            agenda = renderer_agenda(renderer, named, Path(folder), explicit=bool(scenes))
        for of in {task.label: task.of for task in agenda.tasks}.values():
            references.require(of)
        settings = replace(settings, alpha=level_of_case(level, len(agenda.tasks)))
        if sweep:
            cases = _judge_limits(sweep, agendas, replace(settings, case_seconds=budget), on_case)
        elif detect is not None:
            cases = _judge_planned(agenda, replace(settings, detect=detect), on_plan, on_case)
        elif until is None:
            cases = _judge_all(agenda, settings, budget, started, on_case)
        else:
            cases = _judge_until(agenda, settings, started + until, on_case)
    if isinstance(renderer, str) and not sweep:
        cases = [may_shrink(case) for case in cases]
    header = _header(started, cases, agenda.left_out, thorough, seed, jobs, settings.alpha)
    return Verification(cases, header | ({} if until is None else {"until": until}))


def level_of_case(level: float | None, cases: int) -> float:
    """The chance of a wrong FAIL of each case; NotFound where tails so far out were never measured."""
    each = ALPHA if level is None else level / cases
    if each < LEAST_ALPHA:
        many = f"for {cases} cases is {each:.2g} each"
        raise NotFound(
            f"--level {level:g} {many}, and p-values are known to {LEAST_ALPHA:g}: name fewer scenes"
        )
    return each


def _judge_limits(
    sweep: Sweep, agendas: Sequence[Agenda], settings: Settings, on_case: Callable[[Case, int], None] | None
) -> list[Case]:
    """The limit of each scene's bias, of agendas that differ in the value of the parameter."""
    scenes = list(zip(*(agenda.tasks for agenda in agendas), strict=True))
    timed = replace(settings, case_seconds=settings.case_seconds / len(scenes))
    cases = []
    for tasks in scenes:
        reference = references.load_reference(tasks[0].of)
        truth, taken = truth_of(reference), _reference_seeds(reference)
        try:
            cases.append(judge_limit(sweep, tasks, truth, taken, timed))
        except CannotRender as error:
            agendas[-1].left_out[f"{tasks[0].label}, {tasks[0].technique}"] = str(error)
            continue
        if on_case:
            on_case(cases[-1], len(scenes))
    if not cases:
        raise NotFound("; ".join(f"{case}: {why}" for case, why in agendas[-1].left_out.items()))
    return cases


def may_shrink(case: Case) -> Case:
    """The case of a command, with what a small bias may also be."""
    small = case.bias is not None and abs(case.bias) < MAY_SHRINK
    if case.verdict is not Outcome.FAIL or not small:
        return case
    return replace(case, reason=f"{case.reason}; {SHRINKS}")


MAY_SHRINK = 0.1
"""Bias of an image that filters and photon maps may have on purpose."""
SHRINKS = (
    "of a method that is only consistent (photon map, filter, denoiser) a bias that shrinks may be meant: "
    "--consistent PARAM=v1,v2,v3,v4 judges its limit"
)


def _judge_planned(
    agenda: Agenda, settings: Settings, on_plan: Callable[[Sequence[Planned]], None] | None,
    on_case: Callable[[Case, int], None] | None,
) -> list[Case]:  # fmt: skip
    """All verdicts, with the samples that a detectable bias needs; what these are is said first."""
    planned: list[tuple[Planned, Truth, range]] = []
    for task in agenda.tasks:
        reference = references.load_reference(task.of)
        truth, taken = truth_of(reference), _reference_seeds(reference)
        try:
            planned.append((plan_to_detect(task, truth, taken, settings), truth, taken))
        except RenderError as error:
            agenda.left_out[f"{task.label}, {task.technique}"] = str(error)
    if on_plan:
        on_plan([one for one, _, _ in planned])
    cases = []
    for one, truth, taken in planned:
        cases.append(judge_task(one.task, truth, taken, replace(settings, spp=one.spp)))
        if on_case:
            on_case(cases[-1], len(planned))
    if not cases:
        raise NotFound("; ".join(f"{case}: {why}" for case, why in agenda.left_out.items()))
    return cases


def _judge_until(
    agenda: Agenda, settings: Settings, ends: float, on_case: Callable[[Case, int], None] | None
) -> list[Case]:
    """All verdicts, each by as many looks as it takes."""
    cases: list[Case] = []
    looked = []
    for task in agenda.tasks:
        reference = references.load_reference(task.of)
        looked.append(Repeated(task, truth_of(reference), set(_reference_seeds(reference)), settings))

    def add(case: Case) -> None:
        cases.append(case)
        if on_case:
            on_case(case, len(looked))

    agenda.left_out |= judge_until(looked, ends, add)
    if not cases:
        raise NotFound("; ".join(f"{case}: {why}" for case, why in agenda.left_out.items()))
    order = {(task.label, task.technique): number for number, task in enumerate(agenda.tasks)}
    return sorted(cases, key=lambda case: order[case.scene, case.technique])


def _judge_pictures(
    named: Sequence[variants.Variant], scenes: int, images: str | Sequence[str | Path], more: bool,
    limits: Limits,
) -> Case:  # fmt: skip
    """The verdict on pictures that are already rendered; NotFound where the request makes no sense."""
    if more:
        raise NotFound("--images judges pictures: it goes with neither --renderer nor --technique")
    if scenes != 1:
        raise NotFound("--images needs one SCENE, the one that the pictures show")
    return judge_files(named[0], image_paths(images), limits)


def _judge_all(
    agenda: Agenda, settings: Settings, budget: float, started: float,
    on_case: Callable[[Case, int], None] | None,
) -> list[Case]:  # fmt: skip
    """All verdicts, a quick run's within the budget in seconds. What the renderer cannot render is left out;
    NotFound if that is all.
    """
    cases: list[Case] = []
    truths: dict[str, Truth] = {}
    taken: dict[str, range] = {}
    for index, task in enumerate(agenda.tasks):
        if task.label not in truths:
            reference = references.load_reference(task.of)
            truths[task.label] = truth_of(reference)
            taken[task.label] = _reference_seeds(reference)
        share = THOROUGH_SECONDS
        if not settings.thorough:
            each = budget / len(agenda.tasks)
            left = max(budget - (time.perf_counter() - started), 0.0) / (len(agenda.tasks) - index)
            share = min(QUICK_CASE_SECONDS, max(left, each / 2))  # what came before may not starve the rest
        timed = replace(settings, case_seconds=share)
        try:
            case = judge_task(task, truths[task.label], taken[task.label], timed)
        except CannotRender as error:
            agenda.left_out[f"{task.label}, {task.technique}"] = str(error)
            continue
        cases.append(_second_look(case, task, truths[task.label], taken[task.label], timed))
        if on_case:
            on_case(cases[-1], len(agenda.tasks))
    if not cases:
        raise NotFound("; ".join(f"{case}: {why}" for case, why in agenda.left_out.items()))
    return cases


def _second_look(case: Case, task: Task, truth: Truth, taken: range, settings: Settings) -> Case:
    """A thorough run does what an INCONCLUSIVE case says would decide, where it has the time: further looks,
    at fresh samples alone, until one decides. They double the chance of a wrong FAIL, however many they are.
    """
    planned = case.spp if settings.thorough and settings.spp is None else None
    more = case.more_samples if case.verdict is Outcome.INCONCLUSIVE and case.looks == 1 else None
    if not (planned and more and case.seconds * more < THOROUGH_SECONDS):
        return case
    had = {*taken, *case_seeds(task.label, task.technique, settings.seed, taken)}
    asked = replace(settings, spp=math.ceil(planned * more), look=1, earlier={})
    again = Repeated(task, truth, had, asked)
    judge_until([again], time.perf_counter() + THOROUGH_SECONDS, lambda _: None)
    found = again.case or case
    seconds = case.seconds + again.seconds
    return replace(found, looks=1 + found.looks, fingerprint=case.fingerprint, seconds=seconds)


def _reference_seeds(reference: references.Reference) -> range:
    first, count = reference.entry["seeds"]
    return range(int(first), int(first) + int(count))


def _header(
    started: float, cases: list[Case], left_out: Mapping[str, str], thorough: bool, seed: int, jobs: int,
    alpha: float = ALPHA,
) -> dict[str, Any]:  # fmt: skip
    spent = time.perf_counter() - started
    totals = {outcome.value: sum(case.verdict is outcome for case in cases) for outcome in Outcome}
    return {
        "raycheck": raycheck_version(),
        "date": datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ"), "machine": machine(),
        "mode": "thorough" if thorough else "quick", "seed": seed, "jobs": jobs, "alpha": alpha,
        "totals": totals | {"seconds": round(max(spent, sum(case.seconds for case in cases)), 1)},
        "left_out": dict(left_out),
    }  # fmt: skip
