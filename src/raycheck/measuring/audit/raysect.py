"""Raysect: the checks of its path tracer, by its own classes; one wavelength, one pixel."""

from raycheck.measuring.audit import forms
from raycheck.measuring.audit.check import Check
from raycheck.measuring.audit.truths import (
    CLEAR_GLASS,
    FURNACE,
    LAMP_ABOVE,
    ROUGH_MIRROR,
    SKY_ON_MATTE,
    exactly,
    one,
)


def scene(build: str, height: float = 5) -> str:
    """A program that leaves `sight` and `pipeline`: a ray straight down, beside the origin of the floor."""
    return f"""from raysect.core import Point3D, rotate, translate
from raysect.optical import ConstantSF, World
from raysect.optical.material import Add, Dielectric, Lambert, RoughConductor, UniformSurfaceEmitter
from raysect.optical.observer import RadiancePipeline0D, SightLine
from raysect.primitive import Box, Sphere

world = World()
{build}pipeline = RadiancePipeline0D(accumulate=False)
sight = SightLine(
    parent=world, transform=translate(0.0001, 0.00007, {height}) * rotate(0, 180, 0), pipelines=[pipeline],
    spectral_bins=1, min_wavelength=500, max_wavelength=501, ray_max_depth=500,
)
"""


SKY = "Sphere(100, parent=world, material=UniformSurfaceEmitter(ConstantSF(1.0)))\n"


def floor(material: str) -> str:
    return f"Box(Point3D(-1, -1, -1), Point3D(1, 1, 0), parent=world, material={material})\n"


LAMP = (
    "Box(Point3D(-0.5, -0.5, 1), Point3D(0.5, 0.5, 1.0001), parent=world, "
    "material=UniformSurfaceEmitter(ConstantSF(1.0)))\n"
)


def room(albedo: float) -> str:
    glow = f"UniformSurfaceEmitter(ConstantSF({round(1 - albedo, 6)}))"
    return (
        "Box(Point3D(-1, -1, -1), Point3D(1, 1, 1), parent=world, "
        f"material=Add(Lambert(ConstantSF({albedo})), {glow}))\n"
    )


CHECKS = (
    Check(
        "raysect-matte", "raysect", "Lambert within a glowing sphere",
        scene(SKY + floor("Lambert(ConstantSF(0.6))")), 40000, lambda: (0.6,), SKY_ON_MATTE, within=4e-3,
    ),
    Check(
        "raysect-furnace", "raysect", "a closed room of albedo 0.5, with ray extinction as by default",
        scene(room(0.5), 0.5), 20000, one, FURNACE, within=1e-2,
    ),
    Check(
        "raysect-lamp", "raysect", "a glowing square plate above a matte floor",
        scene(floor("Lambert(ConstantSF(0.5))") + LAMP, 0.5), 100000,
        exactly(forms.square_above, 1, 1, times=0.5), LAMP_ABOVE, within=1e-2,
    ),
    Check(
        "raysect-glass", "raysect", "a ball of clear glass within a glowing sphere",
        scene(SKY + "Sphere(1, parent=world, material=Dielectric(index=ConstantSF(1.5), "
        "transmission=ConstantSF(1.0)))\n"),
        20000, one, CLEAR_GLASS,
    ),
    Check(
        "raysect-rough-mirror", "raysect", "RoughConductor of k = 10⁵, roughness 0.5, within a glowing "
        "sphere",
        scene(SKY + floor("RoughConductor(ConstantSF(1.0), ConstantSF(1e5), 0.5)")), 50000,
        exactly(forms.rough_mirror, 0.5), ROUGH_MIRROR + " With k = 10⁵ Fresnel's share is 1 − "
        "4e-10.", within=1e-2,
    ),
)  # fmt: skip
