"""Closed forms of the canonical scenes, kept: some take ten seconds to evaluate, more than a verdict does.

`references/closed-forms/LABEL.npz` has the pixel means in double precision, and a digest of the scene, its
parameters and the version of the formulas. Where any of them has changed it is evaluated anew
(`raycheck reference --closed-forms` keeps that).
"""

import hashlib
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.files import whole
from raycheck.truth.closed_forms import forms

VERSION = 1
"""The version of the formulas, to be raised with any change of what comes out of them, and with no other."""
WORTH_KEEPING = 0.1
"""Seconds of evaluation from which a closed form is kept."""


def digest(scene_hash: str) -> str:
    """A digest of a scene with its parameters, and of the version of what evaluates it."""
    return hashlib.sha256(f"{scene_hash} version {VERSION}".encode()).hexdigest()


def read(file: Path, wanted: str) -> Array | None:
    """(H, W, 3); None if there is none, or one of another digest."""
    if not file.is_file():
        return None
    with np.load(file) as arrays:
        return arrays["image"] if str(arrays["digest"]) == wanted else None


def keep(file: Path, scene_hash: str, scene: Path, parameters: Mapping[str, str]) -> bool:
    """Evaluate one and keep it if that takes its time; whether it did."""
    started = time.perf_counter()
    image = forms.evaluate(scene.stem, scene, parameters)
    if image is None or time.perf_counter() - started < WORTH_KEEPING:
        file.unlink(missing_ok=True)
        return False
    file.parent.mkdir(parents=True, exist_ok=True)
    with whole(file) as partial:
        np.savez_compressed(partial, image=image, digest=np.array(digest(scene_hash)))
    return True
