"""Seeds and choices: reproducible at a regrade, and where no student may know them, not guessable.

Shown scenes take their seeds from a published key, the assignment's name, so that a check at home sees what
the grader sees. Hidden ones take HMAC-SHA-256(secret, what it is for).
"""

import hashlib
import hmac
import os
import re
import secrets
from dataclasses import dataclass
from pathlib import Path

from raycheck.base.errors import NotFound
from raycheck.base.files import one_process, whole
from raycheck.grading.jail import folders

SECRET_BYTES = 32


@dataclass(frozen=True)
class Keys:
    published: str
    secret: bytes

    def number(self, purpose: str, hidden: bool) -> int:
        """A number below 2⁶³ for that purpose."""
        key = self.secret if hidden else self.published.encode()
        return int.from_bytes(hmac.digest(key, purpose.encode(), "sha256")[:8], "little") >> 1

    def fraction(self, purpose: str) -> float:
        """0 ≤ x < 1, secret."""
        return self.number(purpose, hidden=True) / 2**63


def private_folder(assignment: Path) -> Path:
    """What no student may see: FILE.private beside FILE.toml, with the secret and the hidden scenes."""
    folder = assignment.with_suffix(".private")
    folder.mkdir(mode=0o700, exist_ok=True)
    return folder


def read_keys(assignment: Path, published: str) -> Keys:
    """The secret is made at the first use, and kept: without it a regrade has other seeds and scenes."""
    path = private_folder(assignment) / "secret"
    with one_process(path.parent):
        if not path.is_file():
            with whole(path) as partial:
                partial.touch(mode=0o600)
                partial.write_text(secrets.token_hex(SECRET_BYTES) + "\n", encoding="ascii")
    text = path.read_text(encoding="ascii", errors="replace").strip()
    if not re.fullmatch(f"[0-9a-f]{{{2 * SECRET_BYTES}}}", text):
        raise NotFound(
            f"{path}: it holds no {2 * SECRET_BYTES} hexadecimal digits: put back the secret, or remove the "
            "file for a new one and other hidden scenes"
        )
    return Keys(published, bytes.fromhex(text))


def digest_of(folder: Path) -> str:
    """A digest of all files below a folder, their names and contents."""
    whole = hashlib.sha256()
    for name in sorted((f.path for f in folders.walk(folder) if f.is_file), key=lambda name: name.split("/")):
        written = os.fsencode(name)
        whole.update(len(written).to_bytes(4, "little") + written)
        whole.update(hashlib.sha256((folder / name).read_bytes()).digest())
    return whole.hexdigest()
