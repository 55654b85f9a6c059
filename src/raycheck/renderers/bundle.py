"""oneray with the libraries that it needs, in a folder that works on other systems of its architecture."""

import shutil
import subprocess
from pathlib import Path

from raycheck.renderers.oneray import oneray_path

PROGRAM = "oneray.bin"
START = """\
#!/bin/sh
here=${0%/*}
exec "$here/lib/LOADER" --library-path "$here/lib" "$here/oneray.bin" "$@"
"""


def bundle_oneray(into: Path) -> Path:
    """Fill the folder `into`, which is made; the program to call, relative to nothing but itself."""
    program = oneray_path()
    if program.with_name(PROGRAM).is_file():
        shutil.copytree(program.parent, into)
        return into / program.name
    (into / "lib").mkdir(parents=True)
    shutil.copy(program, into / PROGRAM)
    loader = ""
    listed = subprocess.run(["ldd", str(program)], capture_output=True, text=True, check=True).stdout
    for line in listed.splitlines():
        name, arrow, found = line.strip().partition(" => ")
        library = Path((found if arrow else name).split(" (")[0])
        if library.is_absolute():
            shutil.copy(library, into / "lib")
            loader = loader if arrow else library.name
    start = into / "oneray"
    start.write_text(START.replace("LOADER", loader), encoding="ascii", newline="\n")
    start.chmod(0o755)
    return start
