"""raycheck variants: the scenes of which students hand in pictures."""

from pathlib import Path
from typing import Annotated

import typer

from raycheck.base.errors import NotFound
from raycheck.base.files import made_folder, write_whole
from raycheck.commands.options import Assigned


def variants(
    assignment: Assigned,
    output: Annotated[Path, typer.Option("-o", metavar="DIR", help="Gets a folder for each student.")],
    students: Annotated[list[str] | None, typer.Argument(metavar="[STUDENT]...")] = None,
    roster: Annotated[
        Path | None, typer.Option(metavar="FILE.csv", help="All students, in a column student.")
    ] = None,
) -> None:
    """Write the scenes that each student hands in pictures of: as XML, JSON and text."""
    from raycheck.grading import course
    from raycheck.grading.assignment import PICTURES, read_assignment
    from raycheck.grading.hidden import pool_index
    from raycheck.grading.judge import picture_pool
    from raycheck.grading.keys import read_keys
    from raycheck.grading.program import write_scene
    from raycheck.grading.written import tables
    from raycheck.scene import code, export

    asked = read_assignment(assignment)
    names = [*(students or ()), *(tables.read_roster(roster) if roster else ())]
    tasks = [task for task in asked.tasks if task.accepts == PICTURES]
    if not names:
        raise NotFound("variants needs students, by name or as --roster FILE.csv")
    if not tasks:
        raise NotFound(f'{assignment}: no task says accepts = "pictures"')
    keys = read_keys(asked.path, asked.name)
    made_folder(output)
    for name in names:
        for task in tasks:
            index = pool_index(asked.scene(task.scenes[0]), name, task.variants, keys)
            of = picture_pool(asked, keys, task)[index]
            folder = output / course.folder_name(name) / task.id
            write_scene(of, task.scenes[0], folder)
            text = code.text({**export.export(of), "scene": task.scenes[0]})
            write_whole(folder / "scene.txt", text)
    print(f"{output}: scenes for {len(names)} student{'s' if len(names) > 1 else ''}")
