"""Payloads of mutants: what each mistake makes of the numbers, bit for bit, whatever its patch looks like.

`tests/mutants/payloads.json` keeps them. A patch that was made anew, for sources that look otherwise, is that
of the same mistake if its payload is the kept one; signatures belong to the payload, not to the patch. Kept
are those of four lanes, which a processor with AVX2 has: a mistake may depend on what other lanes do.
"""

import functools
import hashlib
import json
import subprocess
import tempfile
from pathlib import Path

from raycheck.base import data
from raycheck.base.errors import RenderError
from raycheck.base.files import write_whole
from raycheck.calibration import mutants
from raycheck.calibration.mutants import OPTIONS, Mutant
from raycheck.renderers import films
from raycheck.scene import variants
from raycheck.scene.techniques import technique

FILE = data.MUTANT_PAYLOADS
SAMPLES, SEED = 4, 0
ELSEWHERE = {
    "light-choice-careless": ("hidden-light", "nee-contribution"),
    "roulette-cap": ("furnace", "walk-uniform"),
}
"""Negative controls that change no sample in the scene and with the technique that their patch names."""


def where(mutant: Mutant) -> tuple[str, str]:
    """The scene and technique that the payload is of: those that show the mistake, with few exceptions."""
    return ELSEWHERE.get(mutant.name, (mutant.scene, mutant.shows))


def of_mutant(mutant: Mutant) -> str:
    """The payload of a mistake; RenderError where there is no picture."""
    return of_program(mutants.program(mutant), *where(mutant))


@functools.lru_cache(maxsize=64)
def of_correct(scene: str, shows: str) -> str:
    """The payload of the program without a mistake."""
    return of_program(mutants.program(None), scene, shows)


def of_program(program: Path, scene: str, shows: str) -> str:
    """A hash of the film's numbers and of the picture that is made of them, 16 hex digits; RenderError."""
    with tempfile.TemporaryDirectory(prefix="payload-") as folder:
        film, picture = Path(folder) / "film", Path(folder) / "picture.pfm"
        words = [str(variants.scene_path(scene)), *technique(shows).options, *OPTIONS, "--quiet"]
        words += ["--samples", f"0:{SAMPLES}", "--seed", str(SEED), "--film", str(film)]
        _run([str(program), *words])
        _run([str(program), "merge", str(film), "-o", str(picture)])
        numbers = picture.read_bytes().split(b"\n", 3)[3]
        return hashlib.sha256(films.payload(film.read_bytes()).encode() + numbers).hexdigest()[:16]


def _run(words: list[str]) -> None:
    done = subprocess.run(words, capture_output=True, text=True, errors="replace", check=False)
    if done.returncode:
        raise RenderError(f"{words[0]}: exit status {done.returncode}: {done.stderr.strip()}")


def kept() -> dict[str, str]:
    """The payloads of all mutants by name, as they are committed."""
    return json.loads(FILE.read_text(encoding="utf-8")) if FILE.is_file() else {}


def keep(found: dict[str, str]) -> None:
    """Those of some mutants; the others stay as they are, without those that are gone."""
    names = {mutant.name for mutant in mutants.catalogue()}
    whole = {name: payload for name, payload in (kept() | found).items() if name in names}
    write_whole(FILE, json.dumps(whole, indent=0, sort_keys=True) + "\n")
