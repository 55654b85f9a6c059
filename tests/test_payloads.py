"""Pictures have the bits that they had: payloads of films, of a sample of scenes × techniques × precisions.

All of them, by every kernel: `python scripts/payloads.py --check --every-kernel`.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from building import ROOT

from raycheck.renderers.films import FilmError, payload

sys.path.insert(0, str(ROOT / "scripts"))

import payloads


@pytest.fixture(scope="module")
def film(oneray: Path, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Of two layers, 4 samples and 1."""
    path = tmp_path_factory.mktemp("film") / "film"
    scene = ROOT / "tests/everything.xml"
    subprocess.run([oneray, scene, "--samples", "0:5", "--film", path, "--quiet"], check=True)
    return path.read_bytes()


def test_pictures_have_the_bits_they_had(oneray: Path) -> None:
    assert payloads.check(oneray, payloads.sample(payloads.pictures(), 60)) == []


def test_every_picture_has_a_payload() -> None:
    """And none is of a scene or technique that is gone."""
    kept = json.loads(payloads.FILE.read_text(encoding="utf-8"))
    assert list(kept) == sorted(kept)
    assert kept.keys() == {one.key for one in payloads.pictures()}, "python scripts/payloads.py --write"


def test_a_payload_is_of_the_numbers_alone(film: bytes) -> None:
    magic, identity, rest = film.split(b"\n", 2)
    assert payload(b"\n".join((magic, identity + b" of another name", rest))) == payload(film)
    first, last = (bytearray(film) for _ in range(2))
    first[film.index(b"\n", film.index(rest)) + 10] ^= 1
    last[-8] ^= 1
    assert len({payload(film), payload(bytes(first)), payload(bytes(last))}) == 3


def test_what_is_no_film_has_no_payload(film: bytes) -> None:
    for data in (b"", b"PF\n1 1\n-1\n", film[:-1], film + b"x"):
        with pytest.raises(FilmError):
            payload(data)


def test_another_picture_has_another_payload(oneray: Path) -> None:
    """The comparison can fail: a technique's own payload is taken for another one's."""
    [one, other] = [
        picture for picture in payloads.pictures()
        if picture.key in ("cornell-box mis-power double", "cornell-box mis-balance double")
    ]  # fmt: skip
    kernel = payloads.Kernel(1, specialised=False)
    found = payloads.render_all(oneray, [one, other], lambda _: kernel)
    swapped = dict(zip(found, reversed(list(found.values())), strict=True))
    assert payloads.differences(found, found) == []
    assert len(payloads.differences(found, swapped)) == 2
