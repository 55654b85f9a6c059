"""Write JSON Schemas: what that of scenes as JSON says of materials, the end of
src/raycheck/scene/scene.schema.json, and of what commands write by --json, src/raycheck/schemas.

python scripts/make_schema.py [FILE of the first alone]
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from raycheck.base.data import PACKAGE
from raycheck.judging.cases import Case
from raycheck.judging.compare import Comparison
from raycheck.measuring.audit.results import Record
from raycheck.measuring.prices import ScenePrices
from raycheck.measuring.races.curves import SceneCurves
from raycheck.measuring.stability.results import Result
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


FOLDER = PACKAGE / "schemas"
STRING, NUMBER, WHOLE = ({"type": name} for name in ("string", "number", "integer"))
MEASURED = {"raycheck": STRING, "machine": STRING, "date": STRING, "command": STRING}
"""How figures were measured."""
VERIFIED: dict[str, Any] = {
    "raycheck": STRING, "machine": STRING, "date": STRING, "mode": {"enum": ["quick", "thorough"]},
    "seed": WHOLE, "jobs": WHOLE, "alpha": NUMBER,
    "totals": {"type": "object", "additionalProperties": NUMBER},
    "left_out": {"type": "object", "additionalProperties": STRING},
}  # fmt: skip
ONCE = {"until": NUMBER, "programs": {"type": "object", "additionalProperties": STRING}}
"""Of some runs: seconds of --until; of raycheck climb, the program of each verdict, by scene."""
FILES: dict[str, tuple[Any, str, dict[str, Any], dict[str, Any]]] = {
    "verify": (Case, "cases", VERIFIED, ONCE),
    "compare": (Comparison, "", {}, {}),
    "techniques": (ScenePrices, "scenes", MEASURED, {"seconds": NUMBER, "spp": WHOLE}),
    "stability": (Result, "cases", MEASURED, {}),
    "report": (SceneCurves, "scenes", MEASURED, {"core": WHOLE}),
    "audit": (Record, "records", MEASURED | {key: NUMBER for key in ("level", "budget", "false_alarms")}, {}),
}
"""By command, or script: of what dataclass a file has a list, its key, or "" where it is one; what else it
has, and may have.
"""


def schema_of(command: str) -> dict[str, Any]:
    """Of what a command writes by --json."""
    kind, key, header, more = FILES[command]
    made = TypeAdapter(kind).json_schema(mode="serialization")
    defs = made.pop("$defs", {})
    if key:
        defs[kind.__name__] = made
        rows = {"type": "array", "items": {"$ref": f"#/$defs/{kind.__name__}"}}
        made = {"type": "object", "properties": {**header, **more, key: rows}}
    for one in (made, *defs.values()):
        one.pop("description", None)
        if "properties" in one:
            one |= {"additionalProperties": False}
            one["required"] = [name for name in one["properties"] if name not in more]
    if command == "techniques":  # which its file calls so
        of = defs["ScenePrices"]
        of["properties"]["techniques"] = of["properties"].pop("prices")
        of["required"] = list(of["properties"])
    program = "scripts/audit.py" if command == "audit" else f"raycheck {command}"
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": f"{program} --json"}
    return head | _slim(made) | ({"$defs": _slim(defs)} if defs else {})


def _slim(found: Any) -> Any:
    """Without titles and defaults, which say nothing of a file."""
    if isinstance(found, dict):
        texts = {key for key in ("title", "default") if not isinstance(found.get(key), dict)}
        return {key: _slim(value) for key, value in found.items() if key not in texts}
    return [_slim(one) for one in found] if isinstance(found, list) else found


def written(command: str) -> str:
    return json.dumps(schema_of(command), indent=1, ensure_ascii=False) + "\n"


def main() -> None:
    Path(sys.argv[1] if len(sys.argv) > 1 else SCHEMA).write_text(text(), encoding="utf-8")
    if len(sys.argv) == 1:
        FOLDER.mkdir(exist_ok=True)
        for command in FILES:
            (FOLDER / f"{command}.schema.json").write_text(written(command), encoding="utf-8")


if __name__ == "__main__":
    main()
