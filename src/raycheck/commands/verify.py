"""raycheck verify: judge a renderer, and show the table of verdicts."""

from pathlib import Path

import typer

from raycheck.base.errors import NotFound
from raycheck.base.files import made_folder, write_whole
from raycheck.base.statuses import Status
from raycheck.commands import options
from raycheck.commands.words import options_of, parse_bias, parse_settings, writable
from raycheck.scene import techniques, variants


def verify(
    scenes: options.Scenes = None,
    settings: options.Settings = None,
    technique: options.Technique = None,
    renderer: options.RendererCommand = None,
    needs: options.Needs = None,
    images: options.Pictures = None,
    json_file: options.JsonFile = None,
    junit: options.JunitFile = None,
    markdown: options.MarkdownFile = None,
    html: options.HtmlFolder = None,
    seconds: options.Seconds = None,
    until: options.Until = None,
    detect: options.Detect = None,
    consistent: options.Consistent = None,
    level: options.Level = None,
    baseline: options.Baseline = None,
    delta: options.Delta = None,
    thorough: options.Thorough = False,
    resume: options.Resume = False,
    seed: options.Seed = 0,
    spp: options.Spp = None,
    jobs: options.Jobs = None,
    timeout: options.Timeout = None,
) -> None:
    """Judge a renderer: exit status 1 if anything FAILs, else 3 if anything is INCONCLUSIVE, else 0; 2: could
    not run.
    """
    writable(json_file)
    writable(junit)
    writable(markdown)
    if thorough and seconds is not None:
        raise NotFound("--seconds is the budget of a quick run: it does not go with --thorough")
    if until is not None and (thorough or seconds is not None):
        raise NotFound(
            "--until says how long the run may take: it goes with neither --seconds nor --thorough"
        )
    bias = parse_bias(detect) if detect is not None else None
    if bias is not None and (thorough or any(x is not None for x in (seconds, until, spp))):
        raise NotFound("--detect says how many samples: not with --seconds, --until, --spp or --thorough")
    if images is not None and any(x is not None for x in (until, bias, level)):
        raise NotFound("--images judges what there is: it goes with neither --until, --detect nor --level")
    if consistent is not None and (thorough or any(x is not None for x in (until, bias, images, technique))):
        raise NotFound("--consistent goes with a --renderer, and not with --until, --detect or --thorough")
    if resume and json_file is None:
        raise NotFound("--resume goes on with the run in --json FILE: name it")
    parameters = parse_settings(settings)
    for scene in scenes or ():
        variants.variant(scene, parameters)
    for name in technique or ():
        techniques.technique(name)
    if html:
        made_folder(html)
    from raycheck.commands.terminal import progress_bar
    from raycheck.commands.work import verify as work
    from raycheck.judging.cases import Verification
    from raycheck.judging.judge_images import image_paths
    from raycheck.judging.junit import junit_xml
    from raycheck.judging.markdown import markdown as markdown_of
    from raycheck.judging.verify import verify as run_verification
    from raycheck.renderers.manifest import MANIFEST
    from raycheck.stats.verdict import Limits

    if renderer is None and images is None and not technique and Path(MANIFEST).is_file():
        renderer = MANIFEST

    limits = Limits.of(delta)
    going_on = resume and json_file is not None and json_file.is_file()
    before = Verification.read(baseline) if baseline else None
    pages = None
    if html:
        own = options_of({
            "renderer": renderer, "images": images, "delta": delta, "level": level, "timeout": timeout,
            "consistent": consistent, "seed": seed or None, "spp": spp,
        })  # fmt: skip
        files = image_paths(images) if images else ()
        pages = work.verdict_pages(html, [*(f"-D{one}" for one in settings or ()), *own], files)
    with progress_bar("verifying") as on_case:
        kept = Verification.read(json_file).cases if going_on and json_file else []
        rows = work.Rows()
        result = run_verification(
            renderer, scenes or (), parameters=parameters, techniques=technique or (),
            needs=needs.split(",") if needs is not None else None,
            images=images, thorough=thorough, seed=seed, spp=spp, jobs=jobs, timeout=timeout, seconds=seconds,
            until=until, detect=bias, consistent=consistent, level=level, limits=limits, earlier=kept,
            on_case=work.saving(json_file, kept, rows, pages, on_case), on_plan=rows.plan,
            on_images=pages.take if pages else None,
            on_samples=lambda planned: rows.samples(planned, bias or 0.0),
        )  # fmt: skip
    work.show(result)
    if before:
        work.show_changes(before, result)
    if pages:
        print(f"{pages.finish(result)}: open it in a browser")
    if json_file:
        write_whole(json_file, result.to_json())
    if junit:
        write_whole(junit, junit_xml(result))
    if markdown:
        write_whole(markdown, markdown_of(result))
    if result.exit_status == Status.COULD_NOT_RUN:
        raise NotFound("nothing was judged: the renderer supports none of these scenes")
    raise typer.Exit(result.exit_status)
