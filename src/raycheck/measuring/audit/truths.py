"""Why the expected values of the audit are sure, in the words of its records."""

from collections.abc import Callable

from raycheck.measuring.audit import forms

FURNACE = (
    "A closed room of albedo a that glows with 1 − a: L = 1 − a + a L has the one solution L = 1, everywhere "
    "and in "
    "every direction."
)
WITHIN = (
    "Within a closed surface of albedo a = ½ that glows with ½, light of no and of one bounce is ½ + ½ · ½: "
    "every "
    "direction brings ½."
)
SKY_ON_MATTE = "A convex matte surface of reflectance ρ under a sky of 1 has radiance ρ/π · π = ρ."
LAMP_ABOVE = (
    "Lambert's formula for the form factor from a patch to a rectangle above its corner, four times (any "
    "textbook; "
    "checked by quadrature of cos θ cos θ′ / (π d²))."
)
BLENDED = (0.44, 0.72, 0.93)
BLEND = (
    "A blend's reflectance is (1 − w) ρ + w · 1 by its definition, w = .3; under a sky of 1 that is its "
    "radiance."
)
ROUGH_MIRROR = (
    "With the viewer on the normal his own masking is 1, so ∫ D(h) G₁(2θ) cos θ dω over half vectors is the "
    "share that "
    "one reflection sends back, by quadrature; 1 − ln 2 for α = 1."
)
ENERGY = "No surface sends back more than comes in: a radiance above 1 under a sky of 1 is gained."
CLEAR_GLASS = "Clear glass absorbs nothing and keeps radiance over η²: under a sky of 1 it is 1."
SUN_BALL = (
    "A ball of radius r and radiance L = (d/r)² straight above at distance d gives irradiance π L (r/d)² = "
    "π, whatever r; "
    "a white matte floor has radiance 1."
)
HALF_SPACE = (
    "A half space of isotropic scattering with albedo ϖ = .9 under a sky of 1 has radiance 1 − √(1−ϖ) H(μ), "
    "with "
    "Chandrasekhar's H; seen straight on .414947. The body is 1000 wide and 2000 mean free paths deep."
)
STEP = (
    "The ratio Σ w L / Σ w of a pixel tends to the filter's integral over the light side of the edge by that "
    "over all, "
    "error functions for a Gaussian; its second coordinate cancels."
)
STEPS = tuple(forms.filtered_step(x) for x in (0.75, -0.25, -1.25))


def one() -> tuple[float, ...]:
    return (1.0,)


def exactly(
    form: Callable[..., float], *numbers: float, times: float = 1.0
) -> Callable[[], tuple[float, ...]]:
    """What a closed form gives for these numbers, evaluated when it is asked for."""
    return lambda: (times * form(*numbers),)
