"""Seeds: the same in every run, and none used twice."""

import hashlib
from collections.abc import Collection


def make_seeds(key: str, count: int, taken: Collection[int] = ()) -> list[int]:
    """`count` different seeds below 2³¹ derived from `key`, none of them in `taken`."""
    seeds: list[int] = []
    used = set(taken)
    index = 0
    while len(seeds) < count:
        word = hashlib.blake2b(f"{key}/{index}".encode(), digest_size=8).digest()
        seed = int.from_bytes(word, "little") & 0x7FFFFFFF
        index += 1
        if seed not in used:
            used.add(seed)
            seeds.append(seed)
    return seeds
