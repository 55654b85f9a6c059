"""oneray: the same scenes as Mitsuba's, the same questions."""

from raycheck.measuring.audit import forms
from raycheck.measuring.audit.check import Check, colours, columns
from raycheck.measuring.audit.mitsuba import (
    GAUSSIAN,
    GLASS_BALL,
    LAMP,
    PRINCIPLED,
    SKY,
    STEP_SCENE,
    ball,
    diffuse,
    floor,
    furnace,
    integrator,
    mirror_and_matte,
    picture,
    rough_conductor,
    scene,
)
from raycheck.measuring.audit.truths import (
    BLEND,
    BLENDED,
    CLEAR_GLASS,
    ENERGY,
    FURNACE,
    LAMP_ABOVE,
    ROUGH_MIRROR,
    SKY_ON_MATTE,
    STEP,
    STEPS,
    SUN_BALL,
    WITHIN,
    exactly,
    one,
)

WIDE = "--width 64 --height 64"
"""More pixels of the same, where they have few samples."""

CHECKS = (
    Check(
        "oneray-matte", "oneray", "diffuse under a constant sky",
        scene(integrator(), picture(), SKY, floor(diffuse("0.2, 0.6, 0.9"))), 4096,
        lambda: (0.6,), SKY_ON_MATTE, within=4e-3,
    ),
    Check(
        "oneray-independent-4", "oneray", "independent samples, 4 a pixel, with roulette, in a closed room",
        furnace(), 4, one, FURNACE, batches=64, within=4e-3, settings={"options": WIDE},
    ),
    *(Check(
        f"oneray-sobol-{samples}", "oneray",
        f"--sampler sobol at {samples} samples a pixel, with roulette, in a closed room",
        furnace(), samples, one, FURNACE, batches=64, within=4e-3,
        settings={"options": f"{WIDE} --sampler sobol"},
    ) for samples in (4, 16)),
    Check(
        "oneray-furnace-bright", "oneray", "roulette in a closed room of albedo 0.9",
        furnace(albedo=0.9), 1024, one, FURNACE, within=1e-2,
    ),
    Check(
        "oneray-lamp", "oneray", "a square lamp above a matte floor",
        scene(integrator(), picture(scale=0.001), floor(diffuse()), LAMP), 1024,
        exactly(forms.square_above, 1, 1, times=0.5), LAMP_ABOVE,
    ),
    Check(
        "oneray-blend-of-mirror", "oneray", "a blend of a matte surface and a mirror",
        scene(integrator(), picture(), SKY, floor(mirror_and_matte())), 16384,
        lambda: BLENDED, BLEND, names=("red", "green", "blue"), measure=colours,
    ),
    *(Check(
        f"oneray-rough-mirror-{alpha}", "oneray", f"roughconductor, GGX, α = {alpha}, under a constant sky",
        scene(integrator(), picture(), SKY, floor(rough_conductor(alpha))), 4096,
        exactly(forms.rough_mirror, alpha), ROUGH_MIRROR, within=4e-3,
    ) for alpha in (0.5, 1.0)),
    Check(
        "oneray-glass", "oneray", "a ball of clear glass under a constant sky",
        scene(integrator(max_depth=-1), picture(height=5), SKY, GLASS_BALL), 256, one, CLEAR_GLASS,
    ),
    Check(
        "oneray-principled-0.1", "oneray",
        "a white principled surface sends back more light than comes in, seen at cosine 0.1",
        scene(integrator(), picture(scale=0.01, height=2, cosine=0.1), SKY, floor(PRINCIPLED)), 1024,
        one, ENERGY,
        documented="the model of Burley 2012 and 2015, term by term as Mitsuba has it, does not claim that "
        "energy is conserved",
    ),
    Check(
        "oneray-sun-ball", "oneray", "a spherical lamp as large as the sun above a floor",
        scene(integrator(), picture(scale=0.001), floor(diffuse("1")), ball(100, 0.465)), 64, one, SUN_BALL,
    ),
    Check(
        "oneray-within-a-ball-lamp", "oneray", "direct light within a glowing sphere on its own wall",
        furnace(kind="sphere", depth=2), 1024, lambda: (0.75,), WITHIN,
    ),
    Check(
        "oneray-filter-step", "oneray", "pixels of a Gaussian filter at an edge",
        scene(integrator(), picture(film=GAUSSIAN), STEP_SCENE), 16384, lambda: STEPS, STEP,
        names=("left", "right", "two right"), measure=columns(3, 4, 5), within=8e-2,
    ),
)  # fmt: skip
