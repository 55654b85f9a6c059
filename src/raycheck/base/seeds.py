"""Seeds: the same in every run, and none used twice."""

import hashlib
from collections.abc import Collection

FIRST_REFERENCE_SEED = 2**31
MOST_REFERENCE_SEEDS = 2**16


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


def reference_seed(batch: int) -> int:
    """The seed of a reference's batch 0, 1, …: at or above 2³¹, where no test's is."""
    if not 0 <= batch < MOST_REFERENCE_SEEDS:
        raise ValueError(f"batch {batch}: there are seeds for {MOST_REFERENCE_SEEDS}")
    return FIRST_REFERENCE_SEED + batch
