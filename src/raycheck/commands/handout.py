"""raycheck handout: the files with which students start."""

from pathlib import Path
from typing import Annotated

import typer

from raycheck.commands.options import Assigned


def handout(
    assignment: Assigned,
    output: Annotated[Path, typer.Option("-o", metavar="DIR", help="A new folder.")],
) -> None:
    """Make the students' starting point: oneray without the bodies of the functions that the tasks name."""
    from raycheck.grading.assignment import read_assignment
    from raycheck.grading.handout import write_handout

    left = write_handout(read_assignment(assignment), output)
    for function in left:
        print(f"{function.path.name}:{function.line}: {function.name}")
    print(f"{output}: {len(left)} functions are left to the students, as README.md there says")
