"""Write what oneray reads of a scene file, which raycheck reads by too: src/raycheck/scene/plugins.json.

    python scripts/make_plugins.py [FILE]

A program that has oneray's readers in it (plugins.c) prints their tables. Run it after one of these has
changed.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
DATA = ROOT / "src/raycheck/scene/plugins.json"
SOURCES = (
    *(f"images/{name}.c" for name in ("image", "openexr")),
    *(f"meshes/{name}.c" for name in ("mesh", "obj", "ply", "serialized")),
    *(f"scene/{name}.c" for name in ("description", "hints")),
    *(f"trees/{name}.c" for name in ("bvh", "mesh_tree")),
    *("message.c", "rounded.c", "text.c"),
)


def printed() -> list[dict[str, Any]]:
    """The rows that the program prints."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(["make", "-s", "-C", str(ROOT), f"BUILD={folder}", "kinds"], check=True)
        source = ROOT / "src/oneray"
        files = [ROOT / "scripts/plugins.c", *(source / name for name in SOURCES)]
        ask = ["pkg-config", "--cflags", "--libs", "expat", "zlib", "OpenEXR"]
        libraries = subprocess.check_output(ask, text=True)
        options = ["-std=c99", "-D_XOPEN_SOURCE=700", f"-I{source}", f"-I{folder}", *libraries.split(), "-lm"]
        program = Path(folder) / "plugins"
        subprocess.run(["cc", *map(str, files), *options, "-o", str(program)], check=True)
        text = subprocess.run([str(program)], check=True, capture_output=True, text=True).stdout
    return [json.loads(line) for line in text.splitlines()]


def tables() -> dict[str, Any]:
    """What plugins.py reads."""
    found: dict[str, Any] = {"attributes": {}, "elements": {}, "mediums": {}, "plugins": []}
    for row in printed():
        if "tags" in row:
            names = row["attributes"].split(", ")
            for tag in re.findall(r"<(\w+)>", row["tags"]):
                found["attributes"][tag] = {
                    "needed": names[: row["needed"]],
                    "others": names[row["needed"] :],
                }
        elif "kind" in row:
            found["elements"][row["kind"]] = re.findall(r"<(\w+)>", row["elements"])
        elif "medium" in row:
            found["mediums"][row["medium"]] = row["ior"]
        else:
            types = row["types"].split(", ")
            found["plugins"].append({"element": row["plugin"], "types": types, "fields": row["fields"]})
    return found


def text(found: dict[str, Any]) -> str:
    """A line for each tag, kind, medium, plugin and field."""
    blocks = []
    for name in ("attributes", "elements", "mediums"):
        rows = ",\n".join(f"  {json.dumps(key)}: {json.dumps(row)}" for key, row in found[name].items())
        blocks.append(f' "{name}": {{\n{rows}\n }}')
    plugins = []
    for one in found["plugins"]:
        fields = ",\n".join(f"    {json.dumps(field)}" for field in one["fields"])
        head = f'  {{"element": "{one["element"]}", "types": {json.dumps(one["types"])}, "fields": ['
        plugins.append(f"{head}\n{fields}]}}" if fields else f"{head}]}}")
    return "{\n" + ",\n".join([*blocks, ' "plugins": [\n' + ",\n".join(plugins) + "\n ]"]) + "\n}\n"


def main() -> None:
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else DATA
    target.write_text(text(tables()), encoding="utf-8")


if __name__ == "__main__":
    main()
