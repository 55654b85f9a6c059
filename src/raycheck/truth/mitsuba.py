"""Batches by Mitsuba 3, for references.

Its film adds samples in single precision and drifts with their number (−2.2e-4 at 2¹⁸ samples per pixel,
measured), so a batch has few.

Seeds are 32 bits wide, those of references at or above 2³¹, and tests stay below. The llvm variants hash
the seed; neighbouring seeds showed no correlation (mirror-light, 4096 batches of 4 samples and 1024 of 64:
neighbours' correlation at most 0.06, means of groups of 4 and 16 vary as they should). The scalar variants,
by their source, use stream seed · pixels + pixel, modulo 2³²: neighbouring seeds have nothing in common
there either, but seeds that are 2³² / pixels apart give one and the same picture, so that seeds must not be
spaced by powers of two, and a scalar test may by chance repeat a scalar reference's batch.

Mitsuba is imported only when something is rendered.
"""

import ctypes.util
import os
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.errors import NotFound, ReferenceError_
from raycheck.base.seeds import reference_seed
from raycheck.renderers.mitsuba_scene import load_scene
from raycheck.scene.document import place
from raycheck.scene.variants import Variant

FILTERS = "box, tent, gaussian"
NEGATIVE = ("mitchell", "catmullrom", "lanczos")
"""Filters that no choice of samples can stand for."""
MAX_PIXELS = 2**16
MAX_SPP_PER_BATCH = 4096

LLVM_PLACES = (
    "/usr/lib/llvm-*/lib/libLLVM*.so*",
    "/usr/lib/*-linux-gnu/libLLVM*.so*",
    "/usr/lib64/libLLVM*.so*",
    "/usr/local/lib/libLLVM*.so*",
    "/opt/homebrew/opt/llvm*/lib/libLLVM.dylib",
    "/usr/local/opt/llvm*/lib/libLLVM.dylib",
)

_PROBE = """
import sys
import mitsuba as mi
mi.set_variant(sys.argv[1])
scene = mi.load_dict({"type": "scene", "integrator": {"type": "path"}, "light": {"type": "constant"},
    "sensor": {"type": "perspective", "film": {"type": "hdrfilm", "width": 4, "height": 4}}})
print("mean", float(mi.render(scene, spp=4).numpy().mean()))
"""


def llvm_candidates() -> list[Path]:
    """LLVM libraries here, the most promising first: newest, 14 to 16 last (they crash with AVX-512)."""
    found = {Path(os.environ["DRJIT_LIBLLVM_PATH"])} if os.environ.get("DRJIT_LIBLLVM_PATH") else set()
    libraries = {path.resolve() for place in LLVM_PLACES for path in Path("/").glob(place[1:])}
    named = ctypes.util.find_library("LLVM")

    def version(path: Path) -> int:
        number = re.search(r"(?:LLVM[-.](?:so\.)?|llvm[-@]?)(\d+)", str(path))
        return int(number.group(1)) if number else 0

    ordered = sorted(libraries, key=lambda p: (14 <= version(p) <= 16, -version(p), str(p)))
    return [*found, *ordered, *([Path(named)] if named else [])]


def choose_variant(wanted: str | None = None) -> str:
    """The fastest variant that works here; sets DRJIT_LIBLLVM_PATH.

    Each is tried in a process of its own, since LLVM may crash. NotFound if not even the scalar one runs.
    """
    if wanted != "scalar_rgb":
        for library in llvm_candidates():
            if _probe("llvm_ad_rgb", library) is None:
                os.environ["DRJIT_LIBLLVM_PATH"] = str(library)
                return "llvm_ad_rgb"
        if wanted is not None:
            raise NotFound(f"{wanted} does not run here (no LLVM library works)")
    problem = _probe("scalar_rgb", None)
    if problem is not None:
        raise NotFound(f"Mitsuba does not run here: {problem} (pip install mitsuba)")
    return "scalar_rgb"


def _probe(variant: str, library: Path | None) -> str | None:
    """Try a tiny render: None if it works, else the last line of what went wrong."""
    environment = dict(os.environ)
    if library is not None:
        environment["DRJIT_LIBLLVM_PATH"] = str(library)
    command = [sys.executable, "-c", _PROBE, variant]
    try:
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=120, check=False
        )
    except subprocess.TimeoutExpired:
        return "no answer in 120 s"
    if done.returncode == 0 and done.stdout.startswith("mean 1"):
        return None
    return (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]


def check_film(of: Variant, variant: str = "llvm_ad_rgb") -> None:
    """ReferenceError_ where Mitsuba would render, but no reference of colours R, G and B; its scalar variants
    take a filter other than a pixel's square from a table of 31 steps.
    """
    root = of.document().resolved()
    if root.find("integrator") is None:
        raise ReferenceError_(f'{of.path}: no integrator: write <integrator type="path"/>')
    films = list(root.iter("film"))
    if not films:
        raise ReferenceError_(
            f"{of.path}: no film, and Mitsuba's default of 768 x 576 pixels is too large for a reference"
        )
    for film in films:
        rfilter = film.find("rfilter")
        kind = "gaussian" if rfilter is None else rfilter.get("type", "")
        where = place(film if rfilter is None else rfilter)
        if kind in NEGATIVE:
            raise ReferenceError_(
                f'{where}: <rfilter type="{kind}"> weighs some of the film below 0 ({FILTERS})'
            )
        if kind != "box" and not variant.startswith("llvm"):
            raise NotFound(
                f"{where}: the reference of a {kind} filter is rendered by Mitsuba's llvm variants, which do "
                "not run here"
            )
        for said in film.iter("string"):
            name = said.get("name", "").replace("_", "").lower()
            if name == "pixelformat" and said.get("value", "").lower() != "rgb":
                channels = "a reference has the channels R, G and B"
                raise ReferenceError_(f'{place(said)}: pixel_format "{said.get("value")}": {channels}, "rgb"')


class MitsubaBatches:
    """A scene loaded into Mitsuba, rendered in batches; `variant` as `choose_variant` gave it."""

    def __init__(self, of: Variant, variant: str, threads: int | None = None):
        check_film(of, variant)
        import mitsuba as mi

        if mi.variant() != variant:
            mi.set_variant(variant)
        if threads is not None and variant.startswith("llvm"):
            import drjit as dr

            dr.set_thread_count(threads)
        self.made_by: Mapping[str, str] = {"mitsuba_version": str(mi.__version__), "variant": variant}
        self._mi: Any = mi
        self._path = of.path
        try:
            self._scene: Any = load_scene(of.path, of.parameters)
        except RuntimeError as error:
            reason = str(error).strip().splitlines()[-1].strip()
            raise NotFound(f"{of.path}: Mitsuba cannot load it: {reason}") from None

    def batches(self, first: int, count: int, spp: int) -> Iterator[Array]:
        """Images (H, W, 3) of batches first … first + count − 1, `spp` samples per pixel each."""
        if not 0 < spp <= MAX_SPP_PER_BATCH:
            raise ValueError(
                f"{spp} samples per pixel in a batch; Mitsuba's film drifts beyond {MAX_SPP_PER_BATCH}"
            )
        for batch in range(first, first + count):
            seed = reference_seed(batch)
            try:
                image = np.array(self._mi.render(self._scene, spp=spp, seed=seed), dtype=np.float64)
            except Exception as error:  # Mitsuba names no errors of its own
                reason = (str(error).strip() or type(error).__name__).splitlines()[-1].strip()
                raise NotFound(f"{self._path}: Mitsuba cannot render it: {reason}") from None
            if image.ndim != 3 or image.shape[2] != 3:
                channels = image.shape[2] if image.ndim == 3 else 1
                raise NotFound(
                    f"{self._path}: Mitsuba renders it with {channels} channels; a reference has three, "
                    "R, G and B"
                )
            if image.shape[0] * image.shape[1] > MAX_PIXELS:
                raise NotFound(f"references are for images of at most {MAX_PIXELS} pixels")
            yield image
