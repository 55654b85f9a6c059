"""What scenes need of a renderer, and what a renderer supports, in the words of a scene's JSON.

The words are of six kinds: shapes, lights, surfaces, cameras, films and path lengths. Every scene without
another has a perspective camera and a box filter, which it does not name. A renderer that names any of a kind
supports no others of it; of a kind that it does not name it supports all.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from raycheck.base.errors import NotFound
from raycheck.base.text import nearest
from raycheck.scene.materials import MATERIALS
from raycheck.scene.textures import TEXTURES

UNLIMITED = "bounces without limit"
KINDS: Mapping[str, Sequence[str]] = {
    "shapes": ("parallelogram", "sphere", "disk", "triangle", "cylinder"),
    "lights": ("area light", "point light", "spot light", "sun", "sky", "environment map"),
    "surfaces": (
        *dict.fromkeys(name for kind in MATERIALS.values() for name in kind.fields), *TEXTURES, "two-sided",
    ),
    "cameras": ("perspective camera", "thin lens", "orthographic camera"),
    "films": ("box filter", "reconstruction filter"),
}  # fmt: skip
"""All words, by their kind; paths have a number beside."""
ALSO = {"rectangle": "parallelogram"}
"""Other names: of a scene file's own."""
PATHS = re.compile(r"paths of (\d+) segments?")


def segments(word: str) -> float | None:
    """The longest path that a word speaks of; None for a word of another kind."""
    if word == UNLIMITED:
        return float("inf")
    found = PATHS.fullmatch(word)
    return float(found[1]) if found else None


@dataclass(frozen=True)
class Support:
    """What a renderer supports."""

    words: frozenset[str]
    """Of the kinds that it names."""
    longest: float = float("inf")
    """Segments of the longest path."""

    @classmethod
    def of(cls, words: Iterable[str], where: str = "--needs") -> "Support":
        """NotFound for a word that no scene has, with those like it and all that there are."""
        known = {word.replace("-", " "): word for kind in KINDS.values() for word in kind}
        known |= {also: word for also, word in ALSO.items()}
        found, lengths = set[str](), list[float]()
        for said in words:
            plain = " ".join(re.split(r"[-_\s]+", said.strip().lower()))
            length = segments(plain)
            if length is not None:
                lengths.append(length)
            elif plain in known:
                found.add(known[plain])
            else:
                listed = ", ".join((*ALSO, *(word for kind in KINDS.values() for word in kind)))
                raise NotFound(
                    f"{where}: {said.strip()!r}{nearest(plain, known)}; there are {listed}, paths of N "
                    f"segments, {UNLIMITED}"
                )
        return cls(frozenset(found), max(lengths, default=float("inf")))

    def lacks(self, needs: Iterable[str]) -> list[str]:
        """What of a scene's needs it does not support."""
        named = {word for kind in KINDS.values() if self.words & set(kind) for word in kind}
        return [
            word
            for word in needs
            if (word in named and word not in self.words) or (segments(word) or 0.0) > self.longest
        ]
