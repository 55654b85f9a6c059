"""A floor of some material: what the tracer's own functions (sampling.c) and Mitsuba make of directions."""

from __future__ import annotations

import numpy as np
import pytest
from sampling import Array, Driver, directions


def floor(bsdf: str) -> str:
    """In z = 0, facing up."""
    return f'<shape type="rectangle">{bsdf}</shape>'


def above(n: int, seed: int) -> Array:
    d = directions(n, seed)
    return d * np.sign(d[2])


def polar(cosine: float) -> Array:
    return np.array([[np.sqrt(1 - cosine**2)], [0.0], [cosine]])


class Sampled:
    """What a floor does with rays from wo (3, n), given u (2, n) or (4, n)."""

    def __init__(self, driver: Driver, bsdf: str, wo: Array, u: Array, **technique) -> None:
        u = np.vstack([u, np.full((4 - len(u), u.shape[1]), 0.5)])
        with driver.scene(floor(bsdf), **technique) as scene:
            out = driver("scatter", wo, -wo, u, scene=scene)
        self.wi, self.factor, self.pdf = out[:3], out[3:6], out[6]
        self.delta, self.compression = out[7] > 0, out[8]


def evaluated(driver: Driver, bsdf: str, wo: Array, wi: Array, **technique) -> tuple[Array, Array, Array]:
    """f_r (3, n), pdf (n,), f_r cosθ / pdf (3, n)."""
    with driver.scene(floor(bsdf), **technique) as scene:
        out = driver("evaluate", wo, -wo, wi, scene=scene)
    return out[:3], out[3], out[4:]


def mitsubas(bsdf: str, wo: Array, wi: Array) -> tuple[Array, Array]:
    """f_r |cosθ| (3, n) and pdf (n,) of such a floor, in single precision."""
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    shape = mi.load_string(f'<scene version="3.0.0">{floor(bsdf)}</scene>').shapes()[0]
    at, context = mi.SurfaceInteraction3f(), mi.BSDFContext()
    found, density = np.empty(wo.shape), np.empty(wo.shape[1])
    for k, (o, i) in enumerate(zip(wo.T, wi.T, strict=True)):
        at.wi = mi.Vector3f(*o)
        found[:, k] = shape.bsdf().eval(context, at, mi.Vector3f(*i))
        density[k] = shape.bsdf().pdf(context, at, mi.Vector3f(*i))
    return found, density
