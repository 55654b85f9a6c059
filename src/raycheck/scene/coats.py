"""What a coat over a diffuse base sends back and lets through: Mitsuba's fits and tables."""

import functools

import numpy as np

from raycheck.base.arrays import Array

NODES = 64
"""Of the tables: at cosines of 0 … 1, between which they are linear. The number is Mitsuba's."""
CAP, TURN = 48, 24
"""Facets that the integrals of a table take, by their tilt and in half a turn."""


def diffuse_fresnel(eta: float) -> float:
    """Reflectance of a coat for diffuse light from inside, eta its index over that outside: Mitsuba's fits,
    of Egan and Hilgeman (1973), and where eta is below 1 of d'Eon and Irving (2011).
    """
    if eta > 1:
        return 0.0636 * eta + 0.6681 + (0.7099 - 1.4399 / eta) / eta
    return float(np.polyval([-1.36881, 4.98554, -7.80989, 6.75335, -3.4793, 0.919317], eta))


@functools.cache
def rough_coat(alpha: float, beckmann: bool, eta: float) -> tuple[Array, float]:
    """Of a rough coat: (NODES,) what of the light at each cosine it lets through, and its reflectance for
    diffuse light from inside, by Mitsuba's sum, which is 1/64 short. Both count facets that are not masked.
    """
    cosines = np.maximum(np.linspace(0, 1, NODES), 1e-6)
    through = _by_facets(alpha, beckmann, eta, cosines)[1]
    inside = _by_facets(alpha, beckmann, 1 / eta, cosines)[0]
    return through, float(2 * (inside * cosines).mean())


def _by_facets(alpha: float, beckmann: bool, eta: float, cosines: Array) -> tuple[Array, Array]:
    """∫ of F G1(θi) and of (1 - F) G1(θi) over the visible normals (Walter et al., EGSR 2007), by GGX's on
    spherical caps (Dupuy & Benyoub, HPG 2023), steep ones taken finely.
    """
    v, turn = np.meshgrid((np.arange(CAP) + 0.5) / CAP, np.pi * (np.arange(TURN) + 0.5) / TURN)
    c = cosines[:, None, None]
    s = np.sqrt(1 - c * c)
    stretch = np.hypot(c, alpha * s)
    up = v * v * (1 + c / stretch)
    ring = np.sqrt(np.maximum(1 - (up - c / stretch) ** 2, 0))
    x = alpha * (ring * np.cos(turn) + alpha * s / stretch)
    steep = np.hypot(x, alpha * ring * np.sin(turn)) / up
    tilt = 1 / np.sqrt(1 + steep**2)
    o = np.minimum((s * x / up + c) * tilt, 1)
    beyond = np.sqrt(np.maximum(1 - (1 - o * o) / eta**2, 0))
    fresnel = (
        ((o - eta * beyond) / (o + eta * beyond)) ** 2 + ((eta * o - beyond) / (eta * o + beyond)) ** 2
    ) / 2
    weight = v * (1 + (steep / alpha) ** 2) ** 2 * np.exp(-((steep / alpha) ** 2)) if beckmann else v
    weight = np.broadcast_to(weight, o.shape) * (1 / weight.sum(axis=(-2, -1), keepdims=True))
    back, on = 2 * o * tilt - c, c / eta - tilt * (o / eta - beyond)
    sums = [
        (weight * share * shadowing(np.where(o > 0, way, 0), alpha, beckmann)).sum(axis=(1, 2))
        for share, way in ((fresnel, back), (1 - fresnel, on))
    ]
    return sums[0], sums[1]


def shadowing(c: Array, alpha: float, beckmann: bool) -> Array:
    """Smith's G1 at cosines, 0 from below: GGX's, or Mitsuba's fit of Beckmann's, which is within .35 %."""
    cosine = np.clip(c, 1e-12, 1)
    q = alpha * np.sqrt(1 - cosine * cosine)
    if not beckmann:
        g1 = 2 * cosine / (cosine + np.hypot(cosine, q))
    else:
        fit = cosine * (3.535 * q + 2.181 * cosine) / (q * (q + 2.276 * cosine) + 2.577 * cosine**2)
        g1 = np.where(cosine < 1.6 * q, fit, 1)
    return np.where(c > 0, g1, 0)
