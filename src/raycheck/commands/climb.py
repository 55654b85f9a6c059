"""raycheck climb: up the ladder of scenes with a renderer that is being written."""

from pathlib import Path
from typing import Annotated

import typer

from raycheck.base.errors import NotFound
from raycheck.base.files import made_folder
from raycheck.commands import options
from raycheck.commands.words import options_of, writable
from raycheck.scene import variants


def climb(
    scenes: options.Scenes = None,
    renderer: options.RendererCommand = None,
    watch: options.Watch = None,
    once: Annotated[bool, typer.Option("--once", help="End at the first FAIL; wait for no change.")] = False,
    state: options.ClimbState = None,
    html: options.ClimbPages = None,
    needs: options.Needs = None,
    seconds: options.RungSeconds = None,
    delta: options.Delta = None,
    seed: options.Seed = 0,
    spp: options.Spp = None,
    jobs: options.Jobs = None,
    timeout: options.Timeout = None,
) -> None:
    """Judge a renderer that is being written, scene by scene, up to the first FAIL, and again whenever its
    program changes; exit status as verify's.
    """
    if seconds is not None and spp is not None:
        raise NotFound("--seconds and --spp both say how many samples: give one of them")
    named = [variants.variant(scene) for scene in scenes or variants.scene_names()]
    from raycheck.commands.work import climb as work
    from raycheck.judging.agenda import supported
    from raycheck.judging.climb import STATE, Climb
    from raycheck.renderers.manifest import MANIFEST, command_of, manifest_for, manifest_of
    from raycheck.renderers.watched import Watched, program_files
    from raycheck.scene.support import Support
    from raycheck.stats.verdict import Limits

    if renderer is None:
        if not Path(MANIFEST).is_file():
            raise NotFound(f"climb needs --renderer CMD, or a {MANIFEST} here that says it")
        renderer = MANIFEST
    command, manifest = command_of(renderer), manifest_of(renderer)
    if not command.takes_scene and len(named) > 1:
        raise NotFound("the renderer command has no {scene}: name the one SCENE that it renders")
    words = needs.split(",") if needs is not None else None
    rungs, left_out = supported(named, Support.of(words) if words else manifest_for(renderer).needs)
    files = watch or program_files(command)
    place = state or (command.folder or Path()) / STATE
    writable(place)
    limits = Limits.of(delta)
    climbing = Climb(
        str(renderer), rungs, Watched([*files, *([manifest] if manifest else [])]), place,
        {"seconds": seconds, "limits": limits, "seed": seed, "spp": spp, "jobs": jobs, "timeout": timeout,
         "needs": words},
        left_out=left_out,
    )  # fmt: skip
    own = options_of({
        "renderer": renderer, "delta": delta, "timeout": timeout, "seed": seed or None, "spp": spp,
    })  # fmt: skip
    raise typer.Exit(work.climb(climbing, made_folder(html or place.with_suffix("")), own, once))
