"""A ball in a closed sphere, both diffuse and shining."""

import numpy as np

from raycheck.base.arrays import Array, Indices
from raycheck.scene.reader import Scene
from raycheck.truth.closed_forms.pixel_quadrature import Radiance
from raycheck.truth.closed_forms.solids import Ball, nearest


def furnace(scene: Scene) -> Radiance | None:
    """A ball (radius a, emission E, reflectance β) in a closed sphere (radius R, emission D, reflectance ρ),
    which is turned inside out or two-sided; the back of what shines is dark.

    At depth n, from 0: Wₙ = D + ρ (f Bₙ₋₁ + (1−f) Wₙ₋₁), Bₙ = E + β Wₙ₋₁ with f = (a/R)².
    Source: by symmetry each surface has one radiance. The ball covers the fraction f of the wall's
    cosine-weighted hemisphere (the formula of `spherical_light` over π), the wall the rest; the convex ball
    sees only wall. Reciprocity of form factors: 4πR² · f = 4πa² · 1. Unlimited depth is the fixed point.
    """
    if len(scene.shapes) != 2 or any(shape.kind != "sphere" for shape in scene.shapes) or scene.point_lights:
        return None
    inner, outer = sorted((0, 1), key=lambda i: Ball(scene.shapes[i]).radius)
    ball, wall = Ball(scene.shapes[inner]), Ball(scene.shapes[outer])
    inside = wall.shape.flipped or wall.shape.material.two_sided
    if not inside or ball.shape.flipped or (ball.center != wall.center).any():
        return None
    f = (ball.radius / wall.radius) ** 2
    rho, beta = wall.shape.material.reflectance, ball.shape.material.reflectance
    glow, emission = wall.shape.radiance * wall.shape.flipped, ball.shape.radiance
    if scene.max_depth < 0:
        wall_radiance = (glow + rho * f * emission) / (1 - rho * (1 - f + f * beta))
        ball_radiance = emission + beta * wall_radiance
    else:
        wall_radiance = ball_radiance = np.zeros(3)
        for _ in range(scene.max_depth):
            wall_radiance, ball_radiance = (
                glow + rho * (f * ball_radiance + (1 - f) * wall_radiance),
                emission + beta * wall_radiance,
            )

    def radiance(o: Array, d: Array) -> tuple[Indices, Array, Array]:
        index, distance = nearest(scene, o, d)
        value = np.where((index == inner)[:, None], ball_radiance, wall_radiance)
        return index, distance, value

    return radiance
