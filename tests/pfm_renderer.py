"""A renderer of the point-light scene in plain Python: it reads no scene and shares no code with what judges
it.

    python pfm_renderer.py OUTPUT.pfm SPP SEED [forget-cosine]

A floor z = 0 with reflectance ρ under a point light of intensity I, seen from (0, −5, 4) towards the origin
with a field of view of 40°. One sample is a random point of the pixel; where its ray meets the floor, L = ρ/π
· I cosθ / d².
"""

import math
import random
import struct
import sys
from pathlib import Path

SIZE, FLOOR = 64, 12.0
EYE, LIGHT = (0.0, -5.0, 4.0), (0.4, 0.3, 1.5)
REFLECTANCE, INTENSITY = (0.8, 0.75, 0.7), (7.5, 6.5, 5.0)
TAN = math.tan(math.radians(20))
DISTANCE = math.hypot(EYE[1], EYE[2])
FORWARD = (-EYE[1] / DISTANCE, -EYE[2] / DISTANCE)  # in y and z; right is +x
UP = (-FORWARD[1], FORWARD[0])


def radiance(u: float, v: float, forget_cosine: bool) -> float:
    """Irradiance per intensity at the floor seen at (u, v) in the image, both from −1 to 1, v upwards."""
    x, y, z = u * TAN, FORWARD[0] + v * TAN * UP[0], FORWARD[1] + v * TAN * UP[1]
    if z >= 0:
        return 0.0
    t = -EYE[2] / z
    px, py = EYE[0] + t * x, EYE[1] + t * y
    if abs(px) > FLOOR or abs(py) > FLOOR:
        return 0.0
    squared = (px - LIGHT[0]) ** 2 + (py - LIGHT[1]) ** 2 + LIGHT[2] ** 2
    cosine = 1.0 if forget_cosine else LIGHT[2] / math.sqrt(squared)
    return cosine / squared


def main(output: str, spp: int, seed: int, forget_cosine: bool) -> None:
    rng = random.Random(seed).random
    scale = [r / math.pi * i for r, i in zip(REFLECTANCE, INTENSITY, strict=True)]
    with Path(output).open("wb") as file:
        file.write(f"PF\n{SIZE} {SIZE}\n-1\n".encode())
        for row in reversed(range(SIZE)):  # PFM begins with the bottom row
            for column in range(SIZE):
                total = 0.0
                for _ in range(spp):
                    u, v = 2 * (column + rng()) / SIZE - 1, 1 - 2 * (row + rng()) / SIZE
                    total += radiance(u, v, forget_cosine)
                file.write(struct.pack("<3f", *(s * total / spp for s in scale)))


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), "forget-cosine" in sys.argv[4:])
