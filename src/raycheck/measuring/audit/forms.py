"""The closed forms of the audit: pure numbers, each with its derivation."""

from functools import cache
from math import atan, cos, exp, pi, sin, sqrt, tan

import numpy as np
from scipy import integrate, special


def square_above(side: float, height: float) -> float:
    """Form factor from a small patch to a parallel square whose centre is straight above: irradiance over π
    for radiance 1. Four times Lambert's formula for the rectangle above a corner.
    """
    x = side / 2 / height
    return 4 / (2 * pi) * 2 * x / sqrt(1 + x * x) * atan(x / sqrt(1 + x * x))


@cache
def h_function(albedo: float, mu: float, order: int = 200) -> float:
    """Chandrasekhar's H of isotropic scattering: 1/H(μ) = √(1−ϖ) + ϖ/2 ∫₀¹ t H(t)/(t+μ) dt, iterated to the
    last digit on Gauss–Legendre nodes (Chandrasekhar, Radiative Transfer, 1950, chapter 5).
    """
    nodes, weights = special.roots_legendre(order)
    t, w = (nodes + 1) / 2, weights / 2
    h = np.ones(order)
    root = sqrt(1 - albedo)

    def at(x: np.ndarray) -> np.ndarray:
        return np.asarray(1 / (root + albedo / 2 * (w * t * h / (t + x[:, None])).sum(axis=1)))

    for _ in range(1000):
        new = at(t)
        done = np.max(np.abs(new - h)) < 1e-15
        h = new
        if done:
            break
    return float(at(np.array([mu]))[0])


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
