"""Films of oneray: the payload tells whether two hold the same samples, whatever they are called."""

import hashlib

NUMBERS = 6
"""Numbers of a pixel in a layer: sums of R G B, then squared deviations of R G B; little-endian doubles."""


class FilmError(Exception):
    """Bytes that are no film: one plain sentence."""


def payload(film: bytes) -> str:
    """The first 16 hex digits of the SHA-256 of the numbers of all layers in order, without the lines that
    say what the film is of. Raises FilmError.
    """
    try:
        magic, _, sizes, rest = film.split(b"\n", 3)
        width, height, layers = (int(word) for word in sizes.split()[-3:])
    except ValueError:
        raise FilmError("this is not a film") from None
    if not magic.startswith(b"oneray film "):
        raise FilmError("this is not a film")
    size = NUMBERS * 8 * width * height
    whole = hashlib.sha256()
    for _ in range(layers):
        _, newline, rest = rest.partition(b"\n")
        if not newline or len(rest) < size:
            raise FilmError("the film ends early")
        whole.update(rest[:size])
        rest = rest[size:]
    if rest:
        raise FilmError(f"the film has {len(rest)} bytes more than its layers")
    return whole.hexdigest()[:16]
