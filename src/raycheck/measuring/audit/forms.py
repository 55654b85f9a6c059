"""The closed forms of the audit: pure numbers, each with its derivation."""

from functools import cache
from math import atan, cos, exp, pi, sin, sqrt, tan

import numpy as np
from scipy import integrate, special

from raycheck.base.arrays import Array


def square_above(side: float, height: float) -> float:
    """Form factor from a small patch to a parallel square whose centre is straight above: irradiance over π
    for radiance 1. Four times Lambert's formula for the rectangle above a corner.
    """
    x = side / 2 / height
    return 4 / (2 * pi) * 2 * x / sqrt(1 + x * x) * atan(x / sqrt(1 + x * x))


ORDER = 120
"""Gauss–Legendre nodes for H."""


@cache
def _h_nodes(albedo: float) -> tuple[Array, Array, Array]:
    """Nodes t in 0…1, their weights, and H there to the last digit, by iteration."""
    nodes, weights = special.roots_legendre(ORDER)
    t, w, h = (nodes + 1) / 2, weights / 2, np.ones(ORDER)
    kernel = albedo / 2 * w * t / (t + t[:, None])
    for _ in range(1000):
        old, h = h, 1 / (sqrt(1 - albedo) + kernel @ h)
        if np.max(np.abs(h - old)) < 1e-15:
            break
    return t, w, h


def h_function(albedo: float, mu: float) -> float:
    """Chandrasekhar's H of isotropic scattering: 1/H(μ) = √(1−ϖ) + ϖ/2 ∫₀¹ t H(t)/(t+μ) dt (Radiative
    Transfer, 1950, chapter 5).
    """
    t, w, h = _h_nodes(albedo)
    return float(1 / (sqrt(1 - albedo) + albedo / 2 * (w * t * h / (t + mu)).sum()))


def half_space(albedo: float, mu: float = 1.0) -> float:
    """Radiance of a half space of isotropic scattering under a sky of 1, at cosine μ: 1 − √(1−ϖ) H(μ)."""
    return 1 - sqrt(1 - albedo) * h_function(albedo, mu)


def rough_mirror(alpha: float) -> float:
    """Share of the light that a white GGX mirror without multiple scattering sends back, seen straight on.

    With the viewer on the normal, ∫ D(h) G₁(2θ) (h·n) dω over half vectors, the same for the separable and
    the correlated G, since the viewer's own part is 1. For α = 1 it is 1 − ln 2.
    """

    def integrand(theta: float) -> float:
        c, slope = cos(theta), tan(theta)
        d = alpha**2 / (pi * c**4 * (alpha**2 + slope**2) ** 2)
        g = 2 / (1 + sqrt(1 + alpha**2 * tan(2 * theta) ** 2))
        return d * g * c * 2 * pi * sin(theta)

    return float(integrate.quad(integrand, 0, pi / 4, epsabs=1e-13, epsrel=1e-13)[0])


def filtered_step(offset: float, deviation: float = 0.5, radius: float = 2.0) -> float:
    """A pixel that a Gaussian, less its value at `radius`, filters, of a picture that is 1 up to `offset`
    right of the pixel's centre and 0 beyond.
    """
    tail = exp(-(radius**2) / (2 * deviation**2))

    def weight(x: float) -> float:
        if abs(x) >= radius:
            return 0.0 if x < 0 else weight_all
        bell = deviation * sqrt(pi / 2) * (
            special.erf(x / (deviation * sqrt(2))) + special.erf(radius / (deviation * sqrt(2)))
        )
        return float(bell - tail * (x + radius))

    weight_all = float(
        deviation * sqrt(2 * pi) * special.erf(radius / (deviation * sqrt(2))) - 2 * tail * radius
    )
    return weight(offset) / weight_all


def over_square(half: float, side: float = 1.0, height: float = 1.0) -> float:
    """The mean of that form factor over a square of the floor, 2·half wide and centred below."""

    def at(y: float, x: float) -> float:
        def corner(a: float, b: float) -> float:
            a, b = a / height, b / height
            p, q = sqrt(1 + a * a), sqrt(1 + b * b)
            return (a / p * atan(b / p) + b / q * atan(a / q)) / (2 * pi)

        s = side / 2
        return corner(s - x, s - y) + corner(s + x, s - y) + corner(s - x, s + y) + corner(s + x, s + y)

    whole = integrate.dblquad(at, -half, half, -half, half, epsabs=1e-12, epsrel=1e-10)[0]
    return float(whole / (2 * half) ** 2)
