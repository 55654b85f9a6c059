"""Scenes as Mitsuba's XML, which oneray reads too, and the checks of Mitsuba 3 by its scalar_rgb variant."""

from math import radians, sqrt, tan

from raycheck.measuring.audit import forms
from raycheck.measuring.audit.check import Check, colours, columns
from raycheck.measuring.audit.truths import (
    BLEND,
    BLENDED,
    CLEAR_GLASS,
    ENERGY,
    FURNACE,
    HALF_SPACE,
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


def picture(
    sampler: str = "independent", scale: float = 0.1, height: float = 0.5, film: str = "",
    cosine: float = 1.0, size: int = 8,
) -> str:
    """An orthographic camera that looks at the origin, at this cosine; `film` is its filter."""
    far = height * sqrt(1 - cosine**2)
    look = f'<lookat origin="{far}, 0, {height * cosine}" target="0, 0, 0" up="0, 1, 0"/>'
    pixels = f'<integer name="width" value="{size}"/><integer name="height" value="{size}"/>'
    return f"""<sensor type="orthographic">
    <transform name="to_world"><scale x="{scale}" y="{scale}"/>{look}</transform>
    <film type="hdrfilm">{pixels}{film or '<rfilter type="box"/>'}</film>
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
    return f"""<shape type="sphere">
    <point name="center" x="0" y="0" z="{distance}"/><float name="radius" value="{radius}"/>
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


def mirror_and_matte(weight: float = 0.3) -> str:
    """A blend of a matte surface and a mirror, which has this share."""
    mirror = '<bsdf type="conductor"><string name="material" value="none"/></bsdf>'
    share = f'<float name="weight" value="{weight}"/>'
    return f'<bsdf type="blendbsdf">{share}{diffuse("0.2, 0.6, 0.9")}{mirror}</bsdf>'


def rough_conductor(alpha: float) -> str:
    said = '<string name="material" value="none"/><string name="distribution" value="ggx"/>'
    return f'<bsdf type="roughconductor">{said}<float name="alpha" value="{alpha}"/></bsdf>'


PRINCIPLED = (
    '<bsdf type="principled"><rgb name="base_color" value="1"/><float name="roughness" value="0.5"/></bsdf>'
)
GLASS = '<bsdf type="dielectric"><float name="int_ior" value="1.5"/></bsdf>'
GLASS_BALL = f'<shape type="sphere">{GLASS}</shape>\n'
STEP_SCENE = (
    '<shape type="rectangle"><transform name="to_world"><translate x="-0.99375"/></transform>'
    '<emitter type="area"><rgb name="radiance" value="1"/></emitter></shape>\n'
)
"""Light left of a straight edge, a quarter of a pixel left of the centre of the fifth column."""
GAUSSIAN = '<rfilter type="gaussian"/>'


def furnace(
    sampler: str = "independent", albedo: float = 0.5, kind: str = "cube", depth: int = -1, rr_depth: int = 0,
    size: int = 8,
) -> str:
    roulette = {"rr_depth": rr_depth} if rr_depth else {}
    way = integrator("path", max_depth=depth, **roulette)
    return scene(way, picture(sampler, size=size), room(kind, albedo))


SAMPLER_ACT = {
    "stratified": (
        "A permutation of the strata for each dimension is drawn from 24 (four samples) by a seed plus the "
        "dimension's number, and every second 1-D dimension gets nearly the same: next_1d of dimensions 1 "
        "and 3 "
        "correlate by .92 over seeds. Roulette that survives once survives again, and its weights multiply. "
        "With rr_depth beyond the path's end the furnace is right."
    ),
    "multijitter": (
        "Permutations of few samples by neighbouring seeds are not independent from dimension to dimension; "
        "with "
        "four samples the roulette of successive bounces is correlated."
    ),
    "ldsampler": (
        "next_1d of successive dimensions correlate by −.17 to .13 over seeds (four samples), so that the "
        "roulette "
        "of successive bounces does. With rr_depth beyond the path's end the furnace is right."
    ),
}  # fmt: skip
NONE_FOUND = "none found in the project's issues"


def _sampler(name: str, samples: int) -> Check:
    return Check(
        id=f"mitsuba-{name}-{samples}",
        renderer="mitsuba",
        says=f"path with the {name} sampler at {samples} samples, roulette from the fifth bounce, in a "
        f"closed room",
        scene=furnace(name, size=round(128 / samples**0.5)),
        samples=samples,
        expected=one,
        why=FURNACE,
        within=4e-3,
        act=SAMPLER_ACT.get(name, ""),
        report=NONE_FOUND,
    )


def _volume(
    kind: str, rr_depth: int, samples: int, within: float, says: str, act: str = "", report: str = ""
) -> Check:
    roulette = "roulette" if rr_depth < 100 else "no-roulette"
    return Check(
        id=f"mitsuba-{kind}-{roulette}",
        renderer="mitsuba",
        says=says,
        scene=scene(integrator(kind, max_depth=-1, rr_depth=rr_depth), picture(scale=0.01), SKY, MEDIUM),
        samples=samples,
        expected=exactly(forms.half_space, 0.9),
        why=HALF_SPACE,
        within=within,
        act=act,
        report=report,
    )


CHECKS = (
    Check(
        "mitsuba-matte", "mitsuba", "diffuse under a constant sky",
        scene(integrator(), picture(), SKY, floor(diffuse("0.2, 0.6, 0.9"))), 4096,
        lambda: (0.6,), SKY_ON_MATTE,
    ),
    *(_sampler(name, samples)
      for name in ("independent", "stratified", "multijitter", "orthogonal", "ldsampler")
      for samples in (4, 16, 64)),
    Check(
        "mitsuba-stratified-no-roulette", "mitsuba",
        "path with the stratified sampler at 4 samples and without roulette, in a closed room",
        furnace("stratified", depth=24, rr_depth=1000, size=64), 4, one, FURNACE, within=4e-3,
    ),
    Check(
        "mitsuba-furnace-bright", "mitsuba", "path with roulette in a closed room of albedo 0.9",
        furnace(albedo=0.9), 512, one, FURNACE, within=1e-2,
    ),
    *(Check(
        f"mitsuba-{kind}-lamp", "mitsuba", f"{kind}: a square lamp above a matte floor",
        scene(integrator(kind), picture(scale=0.001), floor(diffuse()), LAMP), 1024,
        exactly(forms.square_above, 1, 1, times=0.5), LAMP_ABOVE,
    ) for kind in ("path", "direct")),
    Check(
        "mitsuba-ptracer-lamp", "mitsuba", "ptracer: a square lamp above a matte floor",
        scene(
            integrator("ptracer", max_depth=2),
            picture().replace("orthographic", "perspective").replace(
                '<scale x="0.1" y="0.1"/>', "").replace("<film", '<float name="fov" value="60"/><film'),
            floor(diffuse()), LAMP,
        ), 4096,
        exactly(forms.over_square, 0.5 * tan(radians(30)), times=0.5),
        LAMP_ABOVE + " The mean over the square that the camera "
        "sees, by quadrature of the same formula.", within=1e-2,
    ),
    Check(
        "mitsuba-blend-of-mirror", "mitsuba", "blendbsdf of a matte surface and a mirror is too dark",
        scene(integrator(), picture(), SKY, floor(mirror_and_matte())), 256,
        lambda: BLENDED, BLEND, names=("red", "green", "blue"), measure=colours,
        act="blendbsdf.cpp, sample(): the density of the other nested BSDF is added to the probability of a "
        "delta lobe, "
        "and its value to the mirror's. Seen straight on, the mirror's sample has weight (w + (1−w) a/π) / "
        "(w + (1−w)/π), "
        ".659 for a = .2, where it must be 1; then .14 + .3 · .659 = .338. A delta lobe takes no other's "
        "density.",
        report="the densities of samples came with pull request 1681 of mitsuba-renderer/mitsuba3 (July "
        "2025), whose own "
        "tests blend materials without delta lobes; of this effect none was found",
    ),
    Check(
        "mitsuba-blend-of-matte", "mitsuba", "blendbsdf of two matte surfaces",
        scene(integrator(), picture(), SKY, floor(mirror_and_matte().replace(
            '<bsdf type="conductor"><string name="material" value="none"/></bsdf>', diffuse("1")))), 4096,
        lambda: BLENDED, BLEND, names=("red", "green", "blue"), measure=colours, within=4e-3,
    ),
    *(Check(
        f"mitsuba-rough-mirror-{alpha}", "mitsuba", f"roughconductor, GGX, α = {alpha}, under a constant sky",
        scene(integrator(), picture(), SKY, floor(rough_conductor(alpha))), 4096,
        exactly(forms.rough_mirror, alpha), ROUGH_MIRROR, within=4e-3,
    ) for alpha in (0.5, 1.0)),
    Check(
        "mitsuba-glass", "mitsuba", "a ball of clear glass under a constant sky",
        scene(integrator(max_depth=-1), picture(height=5), SKY, GLASS_BALL), 256, one, CLEAR_GLASS,
    ),
    *(Check(
        f"mitsuba-principled-{cosine}", "mitsuba",
        f"a white principled surface sends back more light than comes in, seen at cosine {cosine}",
        scene(integrator(), picture(scale=0.01, height=2, cosine=cosine), SKY, floor(PRINCIPLED)), 256,
        one, ENERGY,
        documented="Burley 2012 and 2015, which it implements, do not claim that energy is conserved: the "
        "diffuse lobe's "
        "retroreflection and the specular lobe are added",
        report="known of the model; Mitsuba's page does not say so",
    ) for cosine in (1.0, 0.1)),
    Check(
        "mitsuba-sun-ball", "mitsuba", "a spherical lamp as large as the sun lights a floor .34 % too "
        "brightly",
        scene(integrator(), picture(scale=0.001), floor(diffuse("1")), ball(100, 0.465)), 64, one, SUN_BALL,
        act="sphere.cpp, sample_direction: the density of the cone is 1 / (2π (1 − cos θ)) with cos θ in "
        "single precision, "
        "about 181 steps of 2⁻²⁴ here; sin²θ / (1 + cos θ) is the same without the cancellation. At a fifth "
        "of "
        "this radius it is 7.3 %.",
        report=NONE_FOUND,
    ),
    Check(
        "mitsuba-within-a-ball-lamp", "mitsuba",
        "within a glowing sphere its light on its own wall is too bright: direct light at one bounce",
        furnace(kind="sphere", depth=2), 256, lambda: (0.75,), WITHIN,
        act="sphere.cpp, sample_direction and pdf_direction: look first at which branch a point takes that "
        "lies on the sphere itself, inside or outside by rounding; both functions have to decide alike, and "
        "for inside.",
        report=NONE_FOUND,
    ),
    _volume("volpath", 5, 1024, 1e-2, "volpath with roulette: a half space of fog under a constant sky"),
    _volume("volpath", 100000, 256, 1e-2, "volpath without roulette: a half space of fog under a constant "
    "sky"),
    _volume(
        "volpathmis", 5, 1024, 1e-2, "volpathmis with roulette is too dark: a half space of fog under a "
        "constant sky",
        act="volpathmis.cpp: without roulette it is right, and volpath is with roulette, so look first at "
        "how the probability of surviving goes into p_over_f and p_over_f_nee.",
        report=NONE_FOUND,
    ),
    _volume("volpathmis", 100000, 256, 1e-2, "volpathmis without roulette: a half space of fog under a "
    "constant sky"),
    Check(
        "mitsuba-filter-step", "mitsuba",
        "the scalar variants' Gaussian filter is a staircase of 31 steps: pixels at an edge are off",
        scene(integrator(), picture(film=GAUSSIAN), STEP_SCENE), 1024, lambda: STEPS, STEP,
        names=("left", "right", "two right"), measure=columns(3, 4, 5), within=5e-2,
        act="rfilter.h: eval_discretized takes the table's value to the left, MI_FILTER_RESOLUTION (31) "
        "steps over the "
        "radius, in imageblock.cpp; a finer table, or linear interpolation in it, does it.",
        report=NONE_FOUND,
    ),
)  # fmt: skip
