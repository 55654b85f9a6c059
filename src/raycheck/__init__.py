"""raycheck: a judge of Monte Carlo renderers.

import raycheck
result = raycheck.verify(lambda scene, spp, seed: my_render(scene, spp, seed), ["point-light"])
assert result.exit_status == 0, result.cases[0].reason
"""

from raycheck.base.errors import ImageError, NotFound
from raycheck.base.images import Image, load_image
from raycheck.judging.compare import Comparison, compare
from raycheck.judging.verdicts import Case, Verification
from raycheck.judging.verify import verify
from raycheck.stats.verdict import Limits, Outcome

__all__ = [
    "Case",
    "Comparison",
    "Image",
    "ImageError",
    "Limits",
    "NotFound",
    "Outcome",
    "Verification",
    "compare",
    "load_image",
    "verify",
]
