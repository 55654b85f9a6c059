"""raycheck scene: what a renderer needs to know of a scene that it cannot read."""

from enum import StrEnum
from typing import Annotated

import typer

from raycheck.commands import options
from raycheck.commands.words import parse_settings
from raycheck.scene import variants


class Form(StrEnum):
    TEXT = "text"
    JSON = "json"
    CPP = "cpp"
    RUST = "rust"


def scene(
    name: Annotated[str, typer.Argument(metavar="SCENE", help="A name, a label, or a file.")],
    settings: options.Settings = None,
    form: Annotated[Form, typer.Option("--as", help="How to write it.")] = Form.TEXT,
) -> None:
    """Print a scene for a renderer without an XML parser: the camera's corner rays, primitives in world
    space, linear colours, and what the renderer must support. The JSON's schema is scene.schema.json. What
    cannot be printed is refused with its line.
    """
    of = variants.variant(name, parse_settings(settings))
    from raycheck.scene import code, export

    data = export.export(of)
    if form is Form.JSON:
        print(export.to_json(data), end="")
    elif form is Form.TEXT:
        print(code.text(data), end="")
    else:
        language = code.CPP if form is Form.CPP else code.RUST
        print(code.source(data, language), end="")
