"""The verdicts of a run, as they are kept in a file."""

import html
import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from raycheck.base.errors import NotFound
from raycheck.base.statuses import Status
from raycheck.base.text import percent, signed
from raycheck.stats.verdict import Outcome
from raycheck.truth.provenance import Provenance


@dataclass(frozen=True)
class Case:
    """The verdict on one scene and one technique; figures are relative, None where a plain check already
    failed.
    """

    scene: str
    technique: str
    verdict: Outcome
    reason: str
    bias: float | None = None
    bias_low: float | None = None
    bias_high: float | None = None
    mde_image: float | None = None
    mde_tile_p90: float | None = None
    spp: int | None = None
    """Samples per pixel of each image, None where the renderer chooses."""
    seconds: float = 0.0
    images: int = 0
    """Judged images of both sets together."""
    tiles: int = 0
    tile: Sequence[int] | None = None
    """Row, column, height and width of the tile that is furthest off or, INCONCLUSIVE, known least."""
    channel: str | None = None
    mde_tile_max: float | None = None
    p_image: float | None = None
    p_tile: float | None = None
    p_omnibus: float | None = None
    tile_differences: int = 0
    heavy_tailed: int = 0
    more_samples: float | None = None
    """INCONCLUSIVE: how many times the samples would probably decide…"""
    more_seconds: float | None = None
    """…and the seconds that pictures of so many samples take."""
    closed_form: bool = False
    """Nine pixels in ten or more have a closed form, which outranks the Mitsuba reference."""
    unbounded: bool = False
    """The scene says that this technique's samples have no bound: no small detectable bias is asked then."""
    late: bool = False
    """It FAILs because a picture took longer than it may."""
    looks: int = 1
    """How often it was judged, each time with fresh samples; the figures are the last one's."""
    order: float | None = None
    """Judged is the limit of a bias that falls with this power of a parameter, see judging.consistent."""
    means: Sequence[float] | None = None
    """Bias of the image by channel, relative, which another day's is compared with…"""
    errors: Sequence[float] | None = None
    """…and its standard error, without the reference's, which is the same."""
    noise: float | None = None
    """Mean variance of a pixel for one sample, over the squared mean of the image…"""
    noise_error: float | None = None
    """…and its relative standard error."""
    sample_seconds: float | None = None
    """That a sample of every pixel takes, start-up apart; None where that hides it."""
    fingerprint: str = ""
    """A digest of the reference, the settings and the renderer's first picture: a case that has it need not
    be judged again.
    """
    provenance: Provenance = field(default_factory=dict)
    """The pictures that the verdict rests on, and METHOD of renders."""

    @property
    def name(self) -> str:
        """ "scene, technique", or the scene alone of another renderer."""
        return self.scene if self.technique == "renderer" else f"{self.scene}, {self.technique}"

    @property
    def skipped(self) -> bool:
        """The renderer does not support the scene."""
        return self.verdict is Outcome.SKIP

    def _repr_html_(self) -> str:
        """How Jupyter shows it."""
        return Verification([self])._repr_html_()


INK = {
    Outcome.FAIL: "#b2182b", Outcome.INCONCLUSIVE: "#8a6d00", Outcome.PASS: "#1a7f37", Outcome.SKIP: "#666",
}  # fmt: skip
"""Colours of verdicts in Jupyter."""


@dataclass(frozen=True)
class Verification:
    """All verdicts of a run; the header says how they were made."""

    cases: list[Case]
    header: dict[str, Any] = field(default_factory=dict)

    @property
    def exit_status(self) -> int:
        """1 if any FAIL, else 3 if any INCONCLUSIVE, else 0; 2 if all are SKIP."""
        outcomes = {case.verdict for case in self.cases}
        if Outcome.FAIL in outcomes:
            return Status.FAIL
        if Outcome.INCONCLUSIVE in outcomes:
            return Status.INCONCLUSIVE
        return Status.COULD_NOT_RUN if outcomes == {Outcome.SKIP} else Status.DONE

    @classmethod
    def read(cls, path: Path) -> "Verification":
        """What `to_json` wrote; NotFound if it is anything else."""
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
            cases = [Case(**{**case, "verdict": Outcome(case["verdict"])}) for case in found.pop("cases")]
        except OSError as error:
            raise NotFound(f"{path}: {error.strerror}") from None
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise NotFound(f"{path}: not a result of raycheck verify --json ({error})") from None
        return cls(cases, found)

    def _repr_html_(self) -> str:
        """How Jupyter shows it: a table of verdicts with their figures, and why where it is no PASS."""
        head = ("scene", "technique", "verdict", "bias", "99 %", "detectable", "")
        rows = [_row("th", map(html.escape, head))]
        for case in self.cases:
            known = case.bias is not None and case.bias_low is not None and case.bias_high is not None
            figures = [
                signed(case.bias or 0.0), f"{signed(case.bias_low or 0.0)} … {signed(case.bias_high or 0.0)}",
                percent(case.mde_image) if case.mde_image is not None else "",
            ]  # fmt: skip
            verdict = f'<b style="color:{INK[case.verdict]}">{case.verdict}</b>'
            plain = map(html.escape, (case.scene, case.technique))
            why = "" if case.verdict is Outcome.PASS else html.escape(case.reason)
            rows.append(_row("td", [*plain, verdict, *(figures if known else ["", "", ""]), why]))
        return f"<table>{''.join(rows)}</table>"

    def to_json(self) -> str:
        cases = [asdict(case) for case in self.cases]
        for values in cases:
            for key, value in values.items():
                if isinstance(value, float):
                    values[key] = float(f"{value:.6g}") if np.isfinite(value) else None
        return (
            json.dumps({**self.header, "cases": cases}, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
        )


def _row(cell: str, texts: Iterable[str]) -> str:
    cells = "".join(f'<{cell} style="text-align:left">{text}</{cell}>' for text in texts)
    return f"<tr>{cells}</tr>"
