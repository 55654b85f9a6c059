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

from raycheck.base.errors import NotFound
from raycheck.base.machine import machine, raycheck_version
from raycheck.judging.agenda import Agenda, Task, oneray_agenda, renderer_agenda, supported
from raycheck.judging.cases import Case, Verification
from raycheck.judging.judge_images import image_paths, judge_files
from raycheck.judging.judge_renderer import judge_task
from raycheck.judging.settings import QUICK_CASE_SECONDS, QUICK_SECONDS, THOROUGH_SECONDS, Settings
from raycheck.renderers.manifest import manifest_for
from raycheck.renderers.renderer import Renderer
from raycheck.scene import variants
from raycheck.scene.support import Support
from raycheck.stats.verdict import Limits, Outcome
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
    timeout: float | None = None,
    limits: Limits = Limits(),
    earlier: Sequence[Case] = (),
    on_case: Callable[[Case, int], None] | None = None,
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
    scenes' other depths. `parameters` replace `<default>` values of the scenes. `seconds` is the budget of a
    quick run. Verdicts of `earlier` stand where the renderer's first picture and the reference are still the
    same. `on_case(case, cases in all)` is called after each verdict. Raises `raycheck.NotFound` where nothing
    can be judged.
    """
    started = time.perf_counter()
    scenes = [scenes] if isinstance(scenes, str | Path) else scenes
    named = [variants.variant(scene, parameters) for scene in scenes or variants.scene_names()]
    own = manifest_for(renderer)
    one = not isinstance(renderer, str | Path | None)
    jobs = jobs or own.limits.jobs or (1 if one else min(2, os.cpu_count() or 1))
    if images is not None:
        if needs is not None:
            raise NotFound("--needs chooses scenes for a renderer: it does not go with --images")
        cases = [_judge_pictures(named, len(scenes), images, bool(renderer or techniques), limits)]
        if on_case:
            on_case(cases[0], 1)
        return Verification(cases, _header(started, cases, {}, thorough, seed, jobs))
    if renderer is not None and techniques:
        raise NotFound("--technique chooses among oneray's techniques: it does not go with --renderer")
    named, left_out = supported(named, own.needs if needs is None else Support.of(needs))
    budget = QUICK_SECONDS if seconds is None else seconds
    settings = Settings(
        thorough=thorough, seed=seed, spp=spp, jobs=jobs, limits=limits,
        timeout=timeout or own.limits.picture_seconds or (600.0 if thorough else 60.0),
        earlier={case.fingerprint: case for case in earlier if case.fingerprint},
    )  # fmt: skip
    with tempfile.TemporaryDirectory(prefix="raycheck-") as folder:
        if renderer is None:
            whole = not scenes and not techniques and not parameters and not left_out
            agenda = oneray_agenda(
                named, techniques, cover=whole and not thorough, variants=whole and thorough
            )
        else:
            agenda = renderer_agenda(renderer, named, Path(folder), explicit=bool(scenes))
        agenda.left_out |= left_out
        for of in {task.label: task.of for task in agenda.tasks}.values():
            references.require(of)
        cases = _judge_all(agenda, settings, budget, started, on_case)
    return Verification(cases, _header(started, cases, agenda.left_out, thorough, seed, jobs))


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
    """All verdicts, a quick run's within the budget in seconds.
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
        case = judge_task(task, truths[task.label], taken[task.label], timed)
        cases.append(_second_look(case, task, truths[task.label], taken[task.label], timed))
        if on_case:
            on_case(cases[-1], len(agenda.tasks))
    return cases


def _second_look(case: Case, task: Task, truth: Truth, taken: range, settings: Settings) -> Case:
    """A thorough run does what an INCONCLUSIVE case says would decide, where it has the time: fresh samples,
    judged alone. Two looks double the chance of a wrong FAIL.
    """
    planned = case.spp if settings.thorough and settings.spp is None else None
    more = case.more_samples if case.verdict is Outcome.INCONCLUSIVE and case.looks == 1 else None
    if not (planned and more and case.seconds * more < THOROUGH_SECONDS):
        return case
    found = judge_task(task, truth, taken, replace(settings, spp=math.ceil(planned * more), look=1))
    return replace(found, looks=2, fingerprint=case.fingerprint, seconds=found.seconds + case.seconds)


def _reference_seeds(reference: references.Reference) -> range:
    first, count = reference.entry["seeds"]
    return range(int(first), int(first) + int(count))


def _header(
    started: float, cases: list[Case], left_out: Mapping[str, str], thorough: bool, seed: int, jobs: int
) -> dict[str, Any]:
    spent = time.perf_counter() - started
    totals = {outcome.value: sum(case.verdict is outcome for case in cases) for outcome in Outcome}
    return {
        "raycheck": raycheck_version(),
        "date": datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ"), "machine": machine(),
        "mode": "thorough" if thorough else "quick", "seed": seed, "jobs": jobs, "alpha": 1e-5,
        "totals": totals | {"seconds": round(max(spent, sum(case.seconds for case in cases)), 1)},
        "left_out": dict(left_out),
    }  # fmt: skip
