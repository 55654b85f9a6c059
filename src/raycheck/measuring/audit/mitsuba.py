"""Mitsuba 3: the checks of its integrators, samplers, lights, materials and filters, by its scalar_rgb variant."""

from raycheck.measuring.audit import forms
from raycheck.measuring.audit.check import Check, colours, columns

NONE_FOUND = "none found"


def picture(sampler: str = "independent", scale: float = 0.1, height: float = 0.5, more: str = "") -> str:
    """An orthographic camera that looks straight down on the origin; `more` goes to the film."""
    return f"""<sensor type="orthographic">
    <transform name="to_world"><scale x="{scale}" y="{scale}"/><lookat origin="0, 0, {height}" target="0, 0, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="8"/>{more or '<rfilter type="box"/>'}</film>
    <sampler type="{sampler}"/>
</sensor>
"""  # fmt: skip


def integrator(kind: str = "path", **settings: int) -> str:
    said = "".join(f'<integer name="{name}" value="{value}"/>' for name, value in settings.items())
    return f'<integrator type="{kind}">{said}</integrator>\n'


def scene(*parts: str) -> str:
    return '<scene version="3.0.0">\n' + "".join(parts) + "</scene>\n"


SKY = '<emitter type="constant"><rgb name="radiance" value="1"/></emitter>\n'


def diffuse(reflectance: str = "0.5") -> str:
    return f'<bsdf type="diffuse"><rgb name="reflectance" value="{reflectance}"/></bsdf>'


def floor(bsdf: str) -> str:
    return f'<shape type="rectangle">{bsdf}</shape>\n'


def room(kind: str, albedo: float) -> str:
    """Closed, of one albedo, that glows with 1 − albedo on its inside."""
    turned = '<boolean name="flip_normals" value="true"/>'
    glow = f'<emitter type="area"><rgb name="radiance" value="{round(1 - albedo, 6)}"/></emitter>'
    return f'<shape type="{kind}">{turned}{diffuse(str(albedo))}{glow}</shape>\n'


LAMP = """<shape type="rectangle">
    <transform name="to_world"><scale value="0.5"/><rotate x="1" angle="180"/><translate z="1"/></transform>
    <emitter type="area"><rgb name="radiance" value="1"/></emitter>
</shape>
"""


def ball(distance: float, radius: float) -> str:
    """A lamp whose irradiance straight below is π."""
    glow = (distance / radius) ** 2
    return f"""<shape type="sphere"><point name="center" x="0" y="0" z="{distance}"/><float name="radius" value="{radius}"/>
    <emitter type="area"><rgb name="radiance" value="{glow!r}"/></emitter></shape>
"""  # fmt: skip


MEDIUM = """<shape type="cube">
    <transform name="to_world"><translate z="-1"/><scale value="500"/></transform>
    <bsdf type="null"/>
    <medium name="interior" type="homogeneous">
        <float name="sigma_t" value="0.5"/><float name="scale" value="8"/><float name="albedo" value="0.9"/>
    </medium>
</shape>
"""
FURNACE = "A closed room of albedo a that glows with 1 − a: L = 1 − a + a L, so L = 1 everywhere and in every direction."
SAMPLERS = {"independent": (4, 16, 64), "stratified": (4, 16, 64), "multijitter": (4, 16, 64), "orthogonal": (4, 16, 64), "ldsampler": (4, 16, 64)}
