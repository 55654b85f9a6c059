"""Pictures that are handed in instead of a program: of the student's own variant of the scene. Nothing is
run: what made them is unknown, and only their being of this variant shows whose they are.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.errors import RenderError
from raycheck.base.images import Image
from raycheck.base.text import quoted
from raycheck.grading.hidden import look_at, with_reference
from raycheck.grading.jail.pixels import Decoder
from raycheck.judging.cases import Case
from raycheck.judging.judge_images import judge_pictures
from raycheck.scene.variants import Variant
from raycheck.stats.tiles import SMALLEST, tile_means
from raycheck.stats.verdict import Limits, Outcome
from raycheck.truth import references

MOST = 256
"""Pictures of a task that are read."""
NEARER = 0.5
"""Pictures show another variant if they differ from it less than this times what they differ from the own."""


def judge(
    files: Sequence[Path], own: Variant, others: Sequence[tuple[Variant, str]], limits: Limits,
    most_bytes: int, size: tuple[int, int], decoder: Decoder,
) -> tuple[Case, list[Array]]:  # fmt: skip
    """The verdict, and the pictures (H, W, 3). `others` are scenes that they may show by mistake, and what to
    say then. RenderError for a file that is no picture of that height and width.
    """
    if len(files) > MOST:
        raise RenderError(f"{len(files)} pictures are handed in, at most {MOST} are read")
    loaded = [_read(file, most_bytes, size, decoder) for file in files]
    case = judge_pictures(
        with_reference(own, limits.image), loaded, [quoted(file.name, 100) for file in files], limits
    )
    images = [image.pixels for image in loaded]
    if case.verdict is Outcome.FAIL:
        shown = _what_it_shows(np.mean(images, axis=0), own, others)
        case = replace(case, reason=f"{shown}; {case.reason}") if shown else case
    return case, images


def _read(file: Path, most_bytes: int, size: tuple[int, int], decoder: Decoder) -> Image:
    if file.stat().st_size > most_bytes:
        raise RenderError(
            f"{quoted(file.name, 100)} has {file.stat().st_size} bytes, at most {most_bytes} are read"
        )
    try:
        return decoder.read(file, size)
    except RenderError as error:
        raise RenderError(f"{quoted(file.name, 100)}: {str(error).replace('{output}', 'it')}") from None


def shows_rather(mean: Array, other: Variant, own: Variant) -> bool:
    """Whether the picture (H, W, 3) is much nearer to another scene than to the one that it should show."""
    near, far = (_distance(mean, references.load_reference(one).best()[0]) for one in (other, own))
    return near < NEARER * far


def _what_it_shows(mean: Array, own: Variant, others: Sequence[tuple[Variant, str]]) -> str:
    """What is said of the nearest of the others, if it is much nearer to the picture than the own variant."""
    if not np.isfinite(mean).all():
        return ""
    far = NEARER * _distance(mean, references.load_reference(own).best()[0])
    distances = [(_distance(mean, look_at(one)), said) for one, said in others]
    nearest, said = min(distances, default=(np.inf, ""))
    return said if nearest < far else ""


def _distance(a: Array, b: Array) -> float:
    """Root mean square difference of the tiles, whose noise is small."""
    return float(np.sqrt(np.mean((tile_means(a, SMALLEST) - tile_means(b, SMALLEST)) ** 2)))
