"""Write what the schema of scenes as JSON says of materials: the end of src/raycheck/scene/scene.schema.json.

python scripts/make_schema.py [FILE]
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from raycheck.scene import materials
from raycheck.scene.export import SCHEMA

BEFORE = '    "reflectance": {'


def text() -> str:
    """A line for each kind of texture and material."""
    head, _, _ = SCHEMA.read_text(encoding="utf-8").partition(BEFORE)
    textured, kinds = materials.schema()
    colours = "".join(
        f'    "{name}": {{\n      "oneOf": [\n{_rows(rows)}\n      ]\n    }},\n'
        for name, rows in textured.items()
    )
    return (
        f'{head}{colours}    "bump": {json.dumps(materials.schema_of_bump(), ensure_ascii=False)},\n'
        '    "material": {\n'
        '      "type": "object",\n      "required": ["type", "two_sided"],\n'
        '      "properties": {"two_sided": {"type": "boolean"}, "bump": {"$ref": "#/$defs/bump"}},\n'
        f'      "oneOf": [\n{_rows(kinds)}\n      ]\n    }}\n  }}\n}}\n'
    )


def _rows(rows: list[materials.Row]) -> str:
    return ",\n".join(" " * 8 + json.dumps(row, ensure_ascii=False) for row in rows)


def main() -> None:
    Path(sys.argv[1] if len(sys.argv) > 1 else SCHEMA).write_text(text(), encoding="utf-8")


if __name__ == "__main__":
    main()
