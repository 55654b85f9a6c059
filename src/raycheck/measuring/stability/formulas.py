"""Closed forms that several stiff cases share, with 60 digits."""

import mpmath
from mpmath import mp, mpf

from raycheck.measuring.stability.case import DIGITS, Parsed, Truth


def cone_irradiance(sine: mpf, cosine: mpf) -> mpf:
    """E/L, sr: ∫ max(0, cosθ) dω over a cone with sinα = `sine` whose axis has this cosine to the normal.

    About the axis, the ring at the angle t spans the azimuths where a + b cosψ > 0, a = cosφ cos t,
    b = sinφ sin t.
    """
    with mp.workdps(DIGITS):
        alpha, phi = mpmath.asin(sine), mpmath.acos(cosine)
        if phi + alpha <= mp.pi / 2:
            return mp.pi * sine**2 * cosine

        def ring(t: mpf) -> mpf:
            a, b = cosine * mpmath.cos(t), mpmath.sin(phi) * mpmath.sin(t)
            if a >= b:
                return 2 * mp.pi * a * mpmath.sin(t)
            if a <= -b:
                return mpf(0)
            psi = mpmath.acos(-a / b)
            return 2 * (a * psi + b * mpmath.sin(psi)) * mpmath.sin(t)

        edge = abs(mp.pi / 2 - phi)
        first = [mpf(0), edge] if cosine > 0 else [edge]
        return mpmath.quad(ring, [*(t for t in first if t < alpha), alpha]) if edge < alpha else mpf(0)


def rectangle_irradiance(x0: mpf, x1: mpf, y0: mpf, y1: mpf, height: mpf) -> mpf:
    """E/L, sr, from a rectangle parallel to the receiver: Lambert's formula, corner by corner."""
    with mp.workdps(DIGITS):

        def corner(x: mpf, y: mpf) -> mpf:
            a, b = mpmath.sqrt(x * x + height**2), mpmath.sqrt(y * y + height**2)
            return (x / a * mpmath.atan(y / a) + y / b * mpmath.atan(x / b)) / 2

        return corner(x1, y1) - corner(x0, y1) - corner(x1, y0) + corner(x0, y0)


def same(value: mpf) -> Truth:
    return Truth(value, abs(value))


def lambert(p: Parsed, albedo: float = 0.5) -> mpf:
    """BRDF of a diffuse surface, sr⁻¹."""
    return p.number(albedo) / mp.pi


def sphere_light(p: Parsed, x: mpf, z: mpf, radius: mpf) -> Truth:
    """A sphere light at (x, 0, z), all of it above a floor at the origin."""
    d = mpmath.sqrt(x * x + z * z)
    return same(lambert(p) * p("radiance") * mp.pi * (radius / d) ** 2 * z / d)


def point_light(p: Parsed, intensity: mpf, height: mpf, distance: mpf) -> mpf:
    return lambert(p) * intensity * height / distance**3
