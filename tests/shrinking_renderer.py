"""pfm_renderer.py as a method that is only consistent: its bias shrinks with a radius.

    python shrinking_renderer.py OUTPUT.pfm SPP SEED RADIUS [order=2] [limit=0]

Everything is 1 + limit + RADIUS^order times as bright as it should be.
"""

import sys

import pfm_renderer


def main(output: str, spp: str, seed: str, radius: str, *options: str) -> None:
    chosen = dict(option.split("=") for option in options)
    factor = 1 + float(chosen.get("limit", 0)) + float(radius) ** float(chosen.get("order", 2))
    pfm_renderer.INTENSITY = tuple(factor * i for i in pfm_renderer.INTENSITY)
    pfm_renderer.main(output, int(spp), int(seed), False)


if __name__ == "__main__":
    main(*sys.argv[1:])
