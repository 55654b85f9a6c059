"""raycheck: a judge of Monte Carlo renderers.

import raycheck
result = raycheck.verify(lambda scene, spp, seed: my_render(scene, spp, seed), ["point-light"])
assert result.exit_status == 0, result.cases[0].reason

Packages, each of which imports from those before it alone: `base` (files, images, processes, errors), `stats`
(pure functions of arrays), `scene` (what a scene file says), `renderers` (what makes images, and where),
`truth` (what an image ought to be), `judging` (verdicts, and what a wrong image looks like), `measuring`
(time, cost, stiff cases, the report), `grading` (of submissions that nobody trusts), `calibration` (raycheck
itself, measured) and `commands`.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from raycheck.base.errors import ImageError, NotFound
    from raycheck.base.images import Image, load_image
    from raycheck.judging.cases import Case, Verification
    from raycheck.judging.compare import Comparison, compare
    from raycheck.judging.verify import verify
    from raycheck.stats.verdict import Limits, Outcome

__all__ = [
    "Case", "Comparison", "Image", "ImageError", "Limits", "NotFound", "Outcome", "Verification", "compare",
    "load_image", "verify",
]  # fmt: skip
_PLACES = {
    "base.errors": ("ImageError", "NotFound"),
    "base.images": ("Image", "load_image"),
    "judging.compare": ("Comparison", "compare"),
    "judging.cases": ("Case", "Verification"),
    "judging.verify": ("verify",),
    "stats.verdict": ("Limits", "Outcome"),
}


def __getattr__(name: str) -> object:
    """A public name, from its module when it is first asked for: a command imports what it needs alone."""
    for module, names in _PLACES.items():
        if name in names:
            return globals().setdefault(name, getattr(import_module(f"raycheck.{module}"), name))
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
