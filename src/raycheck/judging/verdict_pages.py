"""A page for each verdict: what was rendered, the reference, and where they differ, with the sentence and the
commands that repeat it and go on.
"""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from raycheck.base import pictures
from raycheck.base.arrays import Array
from raycheck.base.images import write_exr
from raycheck.base.site import INDEX, Site
from raycheck.judging.cases import Case, Verification
from raycheck.judging.looks import FEWEST
from raycheck.stats.verdict import Outcome
from raycheck.truth.expected import Truth

VERDICTS = "verdicts"
"""Folder of these pages in a report."""
MOST_KEPT = 64
"""Pictures of a FAIL that are kept for raycheck diagnose."""


def page_name(scene: str, technique: str) -> str:
    """Of the page of a verdict; the scene may be a path."""
    return "-".join((Path(scene).stem if "/" in scene else scene, technique)).replace("=", "")


Drawn = tuple[str, pictures.Bytes, str]
"""A picture: its name, 8-bit pixels (H, W, 3), and what it shows."""


def drawn(images: Array, truth: Truth) -> list[Drawn]:
    """What the pictures (B, H, W, 3) show beside the truth: mine, the reference, and where they differ."""
    mean = images.mean(axis=0)
    own = images.var(axis=0, ddof=1) / len(images) if len(images) >= FEWEST else truth.sample_variance
    error = pictures.error_map(mean, truth.mean, np.sqrt(own + truth.variance))
    factor = pictures.exposure(truth.mean)
    return [
        ("mine", pictures.display(mean, factor), f"mine: the mean of {len(images)} pictures"),
        ("reference", pictures.display(truth.mean, factor),
         "closed form" if truth.closed_form else "the reference, by Mitsuba"),
        ("error", error, "mine − reference, in units of its standard error"),
    ]  # fmt: skip


@dataclass
class Gallery:
    """Takes in the pictures of a run as they are rendered, and writes the page of each verdict."""

    site: Site
    words: Sequence[str] = ()
    """Options of the command that made the verdicts, which its repetition needs."""
    files: Sequence[str] = ()
    """Pictures that were not rendered but given."""
    seen: dict[tuple[str, str], tuple[Truth, dict[int, list[Array]]]] = field(default_factory=dict)
    """Of each case, by scene and technique: truth, and pictures (B, H, W, 3) by their samples per pixel."""
    shown: list[tuple[str, Case]] = field(default_factory=list)

    def take(self, scene: str, technique: str, truth: Truth, spp: int, images: Array) -> None:
        """Keep the pictures."""
        _, kept = self.seen.setdefault((scene, technique), (truth, {}))
        kept.setdefault(spp, []).append(images)

    def add(self, case: Case) -> list[Drawn]:
        """Write the page of a case, if it has pictures, and give what it shows: of the judged sets, the most
        that were rendered at a time, or those that were enough for a verdict.
        """
        if (case.scene, case.technique) not in self.seen:
            return []
        truth, kept = self.seen.pop((case.scene, case.technique))
        most = max(len(images) for sets in kept.values() for images in sets)
        judged = [[images for images in sets if len(images) == most] for sets in kept.values()]
        return self._write(case, np.concatenate(max(judged, key=len)), truth)

    def finish(self, result: Verification) -> Path:
        """The index of the pages, FAILs first."""
        order = [Outcome.FAIL, Outcome.INCONCLUSIVE, Outcome.PASS, Outcome.SKIP]
        names = {(case.scene, case.technique): name for name, case in self.shown}
        rows = [(names.get((one.scene, one.technique), ""), one) for one in result.cases]
        rows.sort(key=lambda row: order.index(row[1].verdict))
        self.site.page(INDEX, "Verdicts", "verdicts.html", rows=rows)
        return self.site.finish("Verdicts")

    def _write(self, case: Case, images: Array, truth: Truth) -> list[Drawn]:
        name, shown = page_name(case.scene, case.technique), drawn(images, truth)
        height, width = truth.shape
        files = self._kept(name, images) if case.verdict is Outcome.FAIL else []
        diagnose = ["raycheck", "diagnose", *files, "--scene", case.scene] if files else []
        self.site.page(
            name, f"{case.scene}, {case.technique}: {case.verdict}", "verdict.html", case=case,
            legend=self.site.picture("scale", pictures.legend()),
            pictures=[(self.site.picture(f"{name}-{what}", pixels), told) for what, pixels, told in shown],
            tile=share_of(case.tile, height, width), repeat=self.repeat(case), diagnose=_globbed(diagnose),
        )  # fmt: skip
        self.shown.append((name, case))
        return shown

    def _kept(self, name: str, images: Array) -> list[str]:
        """The pictures as files, for other commands; those that were given are there."""
        if self.files:
            return list(self.files)
        folder = self.site.folder / "images"
        folder.mkdir(exist_ok=True)
        paths = [folder / f"{name}-{number:02}.exr" for number in range(min(len(images), MOST_KEPT))]
        for path, image in zip(paths, images, strict=False):
            write_exr(path, {c: image[..., i].astype(np.float32) for i, c in enumerate("RGB")})
        return [str(path) for path in paths]

    def repeat(self, case: Case) -> str:
        """The command that gives this verdict again, by the same seeds and samples."""
        own = ["--technique", case.technique] if case.technique not in ("renderer", "images") else []
        spp = ["--spp", str(case.spp)] if case.spp and case.looks == 1 and "--spp" not in self.words else []
        return shlex.join(["raycheck", "verify", case.scene, *own, *self.words, *spp])


def _globbed(words: Sequence[str]) -> str:
    """A command line in which files that are alike but for their numbers stand as one pattern, unquoted."""
    files = [word for word in words if word.endswith("-00.exr")]
    if not files:
        return shlex.join(words)
    stem = files[0].removesuffix("-00.exr")
    rest = [word for word in words if not word.startswith(f"{stem}-")]
    return f"{shlex.join(rest[:2])} {shlex.quote(stem)}-*.exr {shlex.join(rest[2:])}"


def share_of(tile: Sequence[int] | None, height: int, width: int) -> dict[str, float] | None:
    """Row, column, height and width of a tile in percent of the picture."""
    if not tile:
        return None
    row, column, rows, columns = tile
    return {
        "top": 100 * row / height, "left": 100 * column / width, "height": 100 * rows / height,
        "width": 100 * columns / width,
    }  # fmt: skip
