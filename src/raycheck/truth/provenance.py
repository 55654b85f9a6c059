"""What a kept result rests on: pictures, by their payloads, and the version of the method that measured it.

A result keeps {"method": 1, "pictures": {NAME: PAYLOAD, …}}. The number is METHOD of the module that
measures, to be raised with any change of what comes out of it, and with no other. A payload is a hash of the
numbers of a picture, and a picture has a name:

    SCENE TECHNIQUE PRECISION   oneray's, in tests/payloads.json
    mutant NAME                 that of a program with a mistake, in tests/mutants/payloads.json
    reference LABEL             what a scene is judged by: the image's bytes, and the closed forms' version

Tests hold both files to the programs, so that nothing is rendered to see which results are stale
(scripts/stale.py). A change of structure changes no payload and makes nothing stale.
"""

import functools
import hashlib
import json
from collections.abc import Iterable, Mapping
from typing import Any

from raycheck.base import data
from raycheck.truth.closed_forms import store

Provenance = dict[str, Any]


@functools.cache
def _kept() -> Mapping[str, str]:
    """The payloads of all of oneray's pictures and of mistakes; none outside a checkout."""
    found: dict[str, str] = {}
    for file, kind in ((data.PAYLOADS, ""), (data.MUTANT_PAYLOADS, "mutant ")):
        if file.is_file():
            found |= {kind + name: value for name, value in json.loads(file.read_text()).items()}
    return found


@functools.cache
def payload(name: str) -> str:
    """The payload of a picture as it is today; "" where none is known."""
    kind, _, label = name.partition(" ")
    if kind != "reference":
        return _kept().get(name, "")
    file = data.references_dir() / f"{label}.exr"
    if not file.is_file():
        return ""
    return hashlib.sha256(file.read_bytes() + b"closed forms %d" % store.VERSION).hexdigest()[:16]


def provenance(method: int, names: Iterable[str]) -> Provenance:
    """What a result that was measured today keeps; pictures without a payload are left out."""
    return {"method": method, "pictures": {name: payload(name) for name in sorted(names) if payload(name)}}


def digest(method: int, names: Iterable[str]) -> str:
    """The same in 16 hex digits, for results that are kept by the hundred."""
    return hashlib.sha256(json.dumps(provenance(method, names)).encode()).hexdigest()[:16]


def changes(kept: Mapping[str, Any], method: int) -> list[str]:
    """Why a result that keeps this is stale, a phrase for each reason; none if it is not."""
    if not kept:
        return ["it does not say what it rests on"]
    other = [f"its method was version {kept['method']}, today's is {method}"] * (kept["method"] != method)
    return other + [
        f"{name} was {old}, and is {payload(name) or 'no picture'} today"
        for name, old in kept["pictures"].items()
        if payload(name) != old
    ]
