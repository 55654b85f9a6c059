"""The one table of materials: how a scene file says each, and how it is told to others.

By it the reader reads, `export` writes, its schema (`scripts/make_schema.py`) and `code` know the fields. A
new kind of material is a function that reads it, one that tells it, and a row of MATERIALS; so with textures
(textures.py).
What one says that its function does not ask for is an error (plugins.py).
"""

import functools
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from raycheck.base.arrays import Array
from raycheck.scene.coats import NODES, diffuse_fresnel, rough_coat
from raycheck.scene.document import Element
from raycheck.scene.plugins import Said, described, fail
from raycheck.scene.textures import (
    COLOUR,
    NUMBER,
    PIXELS,
    TEXTURES,
    Row,
    Texture,
    instead,
    of_share,
    told_texture,
)  # fmt: skip

TRANSMITTING = ("dielectric", "thindielectric", "roughdielectric", "null")
PRINCIPLED = (
    "roughness", "anisotropic", "metallic", "spec_trans", "spec_tint", "sheen", "sheen_tint", "flatness",
    "clearcoat",
)  # fmt: skip
"""Numbers of a principled material that a texture may stand for."""
ROUGHNESSES = {"alpha": "", "alpha_u": " where u grows", "alpha_v": " across that"}
"""Of microfacets, likewise."""
METALS = Path(__file__).with_name("metals.json")


@dataclass(frozen=True)
class Bump:
    """What turns the normal: a `texture` of heights, `scale` times its luminance, or of normals (x + 1)/2 in
    the surface's frame. If it is `shadowed`, light is taken away by Estevez et al. (2019). From behind, what
    is along the surface is the other way, unless a twosided is around it: `turned`.
    """

    texture: Texture
    by_normals: bool
    scale: float
    shadowed: bool
    turned: bool = False


@dataclass(frozen=True)
class Material:
    """`kind` is Mitsuba's type; reflectance (3,) diffuse or specular.

    `eta` and `k` (3,): complex index of a conductor, `k` −1 for a perfect mirror; `eta` of a dielectric or a
    coat is its inner index over the outer one, and `transmittance` (3,) what of the refracted light goes on.
    `specular` (3,) is what of the light that a coat mirrors goes on; light between the coat and what is under
    it loses colour at every turn if it is `nonlinear`. `alpha` is the roughness along dp/du and across, by
    GGX's distribution if not `beckmann`. A blend has two `parts` and the `weight` of the second. A
    `two_sided` one looks the same from behind, where others are black. A `principled` one has its numbers
    there, by Mitsuba's names. A colour or number that is one of the `textures`, by name, is NaN; of a
    number's texture all channels are equal.
    """

    kind: str
    reflectance: Array
    eta: Array = field(default_factory=lambda: np.zeros(3))
    k: Array = field(default_factory=lambda: np.full(3, -1.0))
    weight: float = 0.0
    parts: tuple["Material", ...] = ()
    two_sided: bool = False
    alpha: tuple[float, float] = (0.0, 0.0)
    beckmann: bool = False
    transmittance: Array = field(default_factory=lambda: np.ones(3))
    specular: Array = field(default_factory=lambda: np.ones(3))
    nonlinear: bool = False
    textures: Mapping[str, Texture] = field(default_factory=dict)
    principled: Mapping[str, float] = field(default_factory=dict)
    bump: Bump | None = None

    @property
    def is_mirror(self) -> bool:
        """A conductor that reflects all."""
        return bool((self.k < 0).all())

    @property
    def has_back(self) -> bool:
        """It, or a part of it, is seen from behind."""
        own = self.two_sided or self.kind in TRANSMITTING or self.principled.get("spec_trans", 0) != 0
        return own or any(part.has_back for part in self.parts)

    @property
    def anisotropic(self) -> bool:
        return not self.rough_alike or self.principled.get("anisotropic", 0) != 0

    @property
    def rough_alike(self) -> bool:
        """In all directions."""
        return self.alpha[0] == self.alpha[1] or "alpha" in self.textures

    @property
    def wants_uv(self) -> bool:
        """It, or a part of it, depends on the texture coordinates of its surface."""
        own = bool(self.textures) or self.bump is not None or self.anisotropic
        return own or any(part.wants_uv for part in self.parts)


@dataclass(frozen=True)
class Source:
    """What a <bsdf> says, and the materials in it."""

    said: Said
    parts: list[Material]
    pictures: list[Element]
    """The textures in it that are no property."""
    texture: Callable[[Element], Texture]
    """That of a <texture>, or of the one that a <ref> means."""

    def colours(self, **properties: str) -> Row:
        """Fields of a Material, by the properties that give them: colours or textures."""
        elements = {name: self.said.texture(said) for name, said in properties.items()}
        textures = {name: self.texture(one) for name, one in elements.items() if one is not None}
        colours = {
            name: np.full(3, np.nan) if name in textures else self.said.triple(said)
            for name, said in properties.items()
        }
        return {**colours, "textures": textures}

    def shares(self, *names: str) -> tuple[dict[str, float], dict[str, Texture]]:
        """Numbers, and the textures that stand for some."""
        elements = {name: self.said.texture(name) for name in names}
        textures = {name: of_share(self.texture(one)) for name, one in elements.items() if one is not None}
        numbers = {name: np.nan if name in textures else self.said.number(name) for name in names}
        return numbers, textures

    def ratio(self) -> Array:
        """(3,) the index inside over that outside."""
        return np.full(3, self.said.number("int_ior") / self.said.number("ext_ior"))

    def metal(self) -> tuple[Array, Array]:
        """η and k (3,) of a conductor, by name or as they stand."""
        said = self.said
        index = [said.given(name) is not None for name in ("eta", "k")]
        if index[0] != index[1] or (index[0] and said.given("material") is not None):
            fail(said.element, f'{described(said.element)}: write "eta" and "k", or "material"')
        beside = said.number("ext_eta")
        if index[0]:
            return said.triple("eta") / beside, said.triple("k") / beside
        name = said.word("material") or "none"
        if name == "none":
            return np.zeros(3), np.full(3, -1.0)
        if name not in _metals():
            fail(said.element, f'{described(said.element)}: no metal is called "{name}"')
        return np.array(_metals()[name]["eta"]) / beside, np.array(_metals()[name]["k"]) / beside


@functools.cache
def _metals() -> dict[str, dict[str, list[float]]]:
    """Mitsuba's indices of refraction, by name (scripts/make_metals.py)."""
    found: dict[str, dict[str, list[float]]] = json.loads(METALS.read_text(encoding="utf-8"))
    return found


# What the schema says of fields.
TEXTURED: dict[str, Row] = {
    name: {"$ref": f"#/$defs/{name}"} for name in ("reflectance", "transmittance", "specular")
}
"""Colours for which a texture may stand."""
SHARES: dict[str, Row] = {name: {"$ref": f"#/$defs/{name}"} for name in ("weight_of_second", *PRINCIPLED)}
"""Numbers of 0 … 1 for which a texture may stand."""
REFLECTANCE = {"reflectance": TEXTURED["reflectance"]}
INDEX = {**NUMBER, "description": "Index inside over index outside"}
GLASS: dict[str, Row] = {**REFLECTANCE, "transmittance": TEXTURED["transmittance"], "eta": INDEX}
PLASTIC: dict[str, Row] = {
    **REFLECTANCE, "specular": TEXTURED["specular"], "eta": INDEX,
    "internal": {**NUMBER, "description": "Of diffuse light under the coat, what that sends back"},
    "nonlinear": {"type": "boolean", "description": "Light loses colour at every turn under the coat"},
}  # fmt: skip
METAL: dict[str, Row] = {**REFLECTANCE, "eta": COLOUR, "k": COLOUR}


def _roughness(what: str) -> Row:
    meaning = f"Roughness of microfacets with Smith's separable G{what}; of a texture at least 1e-4"
    return {**NUMBER, "exclusiveMinimum": 0, "description": meaning}


ALPHAS: dict[str, Row] = {name: {"$ref": f"#/$defs/{name}"} for name in ROUGHNESSES}
BECKMANN: Row = {"type": "boolean", "description": "Beckmann's distribution of them, else GGX"}
ISOTROPIC = {"alpha": ALPHAS["alpha"], "beckmann": BECKMANN}
ANISOTROPIC = {"alpha_u": ALPHAS["alpha_u"], "alpha_v": ALPHAS["alpha_v"], "beckmann": BECKMANN}
TABLE: Row = {
    "type": "array", "items": NUMBER, "minItems": NODES, "maxItems": NODES,
    "description": "Of light at cosines of 0 … 1, evenly spaced, what the coat lets through; linear between",
}  # fmt: skip
SHARE = {**NUMBER, "minimum": 0, "maximum": 1}
DISNEY: dict[str, Row] = {
    **REFLECTANCE, "eta": INDEX, **{name: SHARES[name] for name in PRINCIPLED},
    "clearcoat_gloss": {**SHARE, "description": "The coat's GTR1 has the α .1 at 0 and .001 at 1"},
}  # fmt: skip
PARTS = {"type": "array", "items": {"$ref": "#/$defs/material"}, "minItems": 2, "maxItems": 2}


@dataclass(frozen=True)
class Kind:
    """A kind of material."""

    read: Callable[[Source], Material]
    told: Callable[[Material], Row]
    """As plain data, with its type."""
    fields: Mapping[str, Mapping[str, Row]]
    """What the schema says of the fields that this has, by type."""
    holds: tuple[str, ...] = ()
    """The elements that give its parts."""


def _diffuse(of: Source) -> Material:
    return Material("diffuse", **of.colours(reflectance="reflectance"))


def _conductor(of: Source) -> Material:
    eta, k = of.metal()
    return Material("conductor", **of.colours(reflectance="specular_reflectance"), eta=eta, k=k)


def _told_metal(one: Material) -> Row:
    return {**_told_colour(one, "reflectance"), "eta": one.eta.tolist(), "k": one.k.tolist()}


def _told_conductor(one: Material) -> Row:
    if one.is_mirror:
        return {"type": "mirror", **_told_colour(one, "reflectance")}
    return {"type": "conductor", **_told_metal(one)}


def _rough(one: Material, of: Source) -> Material:
    """The same of microfacets."""
    said = of.said
    write = f"{described(said.element)}: write"
    along, across = said.given("alpha_u") is not None, said.given("alpha_v") is not None
    if along != across or (along and said.given("alpha") is not None):
        fail(said.element, f"{write} alpha, or both alpha_u and alpha_v")
    names = ("alpha_u", "alpha_v") if along else ("alpha", "alpha")
    numbers, textures = of.shares(*names)
    u, v = (max(numbers[name], 1e-4) for name in names)
    return replace(
        one, kind=said.type, alpha=(u, v), beckmann=said.word("distribution") == "beckmann",
        textures={**one.textures, **textures},
    )  # fmt: skip


def _told_facets(one: Material) -> Row:
    names, row = ("alpha",) if one.rough_alike else ("alpha_u", "alpha_v"), Row()
    for name, number in zip(names, one.alpha, strict=False):
        row |= _told_share(one, name, name, number)
    return {**row, "beckmann": one.beckmann}


def _told_rough(one: Material, kind: str, rest: Row) -> Row:
    which = "rough" if one.rough_alike else "anisotropic"
    return {"type": f"{which} {kind}", **rest, **_told_facets(one)}


def _roughconductor(of: Source) -> Material:
    return _rough(_conductor(of), of)


def _told_roughconductor(one: Material) -> Row:
    whole = replace(one, k=np.ones(3)) if one.is_mirror else one  # k 1 reflects all then, as η is 0
    return _told_rough(one, "conductor", _told_metal(whole))


def _dielectric(of: Source) -> Material:
    said = of.said
    if said.given("int_ior") is None or said.given("ext_ior") is None:
        which = described(said.element)
        fail(said.element, f"{which} needs both int_ior and ext_ior (as <float>, or by name)")
    return _glass(of)


def _glass(of: Source) -> Material:
    colours = of.colours(reflectance="specular_reflectance", transmittance="specular_transmittance")
    return Material(of.said.type, **colours, eta=of.ratio())


def _told_glass(one: Material) -> Row:
    colours = {**_told_colour(one, "reflectance"), **_told_colour(one, "transmittance")}
    return {**colours, "eta": float(one.eta[0])}


def _roughdielectric(of: Source) -> Material:
    one = _rough(_glass(of), of)
    if one.eta[0] == 1:
        fail(of.said.element, f"{described(of.said.element)}: int_ior and ext_ior must differ")
    return one


def _coated(of: Source) -> Material:
    colours = of.colours(reflectance="diffuse_reflectance", specular="specular_reflectance")
    return Material(of.said.type, **colours, eta=of.ratio(), nonlinear=of.said.flag("nonlinear"))


def _plastic(of: Source) -> Material:
    one = _coated(of)
    if diffuse_fresnel(one.eta[0]) >= 1:
        which = described(of.said.element)
        fail(of.said.element, f"{which}: from int_ior 3.85 times ext_ior on its coat would make light")
    return one


def _told_coated(one: Material, internal: float) -> Row:
    colours = {**_told_colour(one, "reflectance"), **_told_colour(one, "specular")}
    return {**colours, "eta": float(one.eta[0]), "internal": internal, "nonlinear": one.nonlinear}


def _told_plastic(one: Material) -> Row:
    return {"type": "plastic", **_told_coated(one, diffuse_fresnel(float(one.eta[0])))}


def _roughplastic(of: Source) -> Material:
    said = of.said
    if any(said.given(name) is not None for name in ("alpha_u", "alpha_v")):
        fail(said.element, f"{described(said.element)} is rough alike in all directions: write alpha")
    if said.texture("alpha") is not None:
        fail(said.element, f"{described(said.element)}: alpha must be a number, as in Mitsuba")
    one = _rough(_coated(of), of)
    if one.eta[0] == 1:
        fail(said.element, f"{described(said.element)}: int_ior and ext_ior must differ")
    return one


def _told_roughplastic(one: Material) -> Row:
    through, internal = rough_coat(one.alpha[0], one.beckmann, float(one.eta[0]))
    rest = {**_told_coated(one, internal), "coat_transmittance": through.tolist()}
    return _told_rough(one, "plastic", rest)


def _principled(of: Source) -> Material:
    said = of.said
    colours, (numbers, textures) = of.colours(reflectance="base_color"), of.shares(*PRINCIPLED)
    numbers["clearcoat_gloss"] = said.number("clearcoat_gloss")
    for lobe in ("main_specular", "clearcoat", "diffuse_reflectance"):
        said.number(f"{lobe}_sampling_rate")  # how it is sampled, not what it is
    if said.given("eta") is not None and said.given("specular") is not None:
        fail(said.element, f"{described(said.element)}: write eta or specular")
    eta, specular = said.number("eta"), said.number("specular")
    if said.given("eta") is None:  # as Mitsuba, also that glass has a boundary
        specular = 1e-3 if specular == 0 and numbers["spec_trans"] != 0 else specular
        eta = 2 / (1 - (0.08 * specular) ** 0.5) - 1
    elif eta == 1 and numbers["spec_trans"] != 0:
        eta = 1.001
    textures |= colours.pop("textures")
    return Material("principled", **colours, eta=np.full(3, eta), principled=numbers, textures=textures)


def _told_principled(one: Material) -> Row:
    numbers = one.principled
    shares = [_told_share(one, name, name, numbers[name]) for name in PRINCIPLED]
    row = {"type": "principled", **_told_colour(one, "reflectance"), "eta": float(one.eta[0])}
    for share in shares:
        row |= share
    return {**row, "clearcoat_gloss": numbers["clearcoat_gloss"]}


def _blend(of: Source) -> Material:
    said = of.said
    if len(of.parts) != 2 or said.given("weight") is None:
        fail(said.element, f'{described(said.element)} needs two bsdfs and the "weight" of the second')
    return _of_parts(of, "weight", tuple(of.parts))


def _of_parts(of: Source, weight: str, parts: tuple[Material, ...]) -> Material:
    """A blend; the property says the weight of the second."""
    numbers, textures = of.shares(weight)
    named = {"weight": textures[weight]} if weight in textures else {}
    mixed = Material("blendbsdf", np.zeros(3), weight=numbers[weight], parts=parts, textures=named)
    if _weights(mixed) > MOST_WEIGHTS:
        which = described(of.said.element)
        fail(of.said.element, f"{which}: textures give the weights of more than two blends, one in another")
    return mixed


MOST_WEIGHTS = 2


def _weights(one: Material) -> int:
    """Of how many blends, one in another, do textures give the weight?"""
    return ("weight" in one.textures) + max(map(_weights, one.parts), default=0)


def _told_blend(one: Material) -> Row:
    weight = _told_share(one, "weight", "weight_of_second", one.weight)
    return {"type": "blend", **weight, "parts": [told(part) for part in one.parts]}


def _mask(of: Source) -> Material:
    """A blend with what lets light pass."""
    if len(of.parts) != 1:
        fail(of.said.element, f"{described(of.said.element)} needs one bsdf inside")
    return _of_parts(of, "opacity", (Material("null", np.ones(3)), of.parts[0]))


def _bump(of: Source) -> Material:
    said, which, by_normals = of.said, described(of.said.element), of.said.type == "normalmap"
    if len(of.parts) != 1 or len(of.pictures) != 1:
        fail(said.element, f"{which} needs a texture and a bsdf inside")
    picture, texture = of.pictures[0], of.texture(of.pictures[0])
    if by_normals and picture.get("name") != "normalmap":
        fail(picture, 'the texture of a normalmap must have name="normalmap"')
    if texture.kind != "bitmap":
        fail(picture, "the texture of a bumpmap or normalmap must be a bitmap")
    if not by_normals and texture.wrap == "mirror":
        fail(picture, '"wrap_mode" = "mirror" is not supported for a bumpmap (repeat, clamp)')
    if not said.flag("flip_invalid_normals"):
        fail(said.element, '"flip_invalid_normals" = "false" is not supported (true)')
    scale = 1.0 if by_normals else said.number("scale")
    return _bumped(of, of.parts[0], Bump(texture, by_normals, scale, said.flag("use_shadowing_function")))


def _bumped(of: Source, one: Material, bump: Bump) -> Material:
    """It, or each of its parts."""
    if one.parts:
        return replace(one, parts=tuple(_bumped(of, part, bump) for part in one.parts))
    if one.bump is not None:
        fail(of.said.element, "a bumpmap or normalmap cannot stand in another")
    if not bump.by_normals and one.anisotropic:
        fail(
            of.said.element,
            "an anisotropic bsdf in a bumpmap is not supported: Mitsuba mixes up its directions",
        )
    return replace(one, bump=bump)


def _turned(one: Material) -> Material:
    """As a twosided has it."""
    bump = one.bump and replace(one.bump, turned=True)
    return replace(one, bump=bump, parts=tuple(map(_turned, one.parts)))


def _told_bump(bump: Bump) -> Row:
    picture = TEXTURES["bitmap"].told(bump.texture)
    kind = "normals" if bump.by_normals else "heights"
    how = {"scale": bump.scale, "shadowed": bump.shadowed, "turned": bump.turned}
    return {"of": kind, **how, **picture}


def _twosided(of: Source) -> Material:
    parts, which = of.parts, described(of.said.element)
    if not 0 < len(parts) < 3:
        fail(of.said.element, f"{which} needs a bsdf inside (one for both sides, or two)")
    if any(part.has_back for part in parts):
        fail(of.said.element, f"{which} cannot hold a bsdf that has a back side (twosided, dielectric)")
    if len(parts) == 2 and parts[0] is not parts[1]:
        fail(of.said.element, f"{which} with two bsdfs is not supported by raycheck: only with one")
    return replace(_turned(parts[0]), two_sided=True)


MATERIALS: dict[str, Kind] = {
    "diffuse": Kind(
        _diffuse, lambda one: {"type": "diffuse", **_told_colour(one, "reflectance")},
        {"diffuse": REFLECTANCE},
    ),
    "conductor": Kind(_conductor, _told_conductor, {"mirror": REFLECTANCE, "conductor": METAL}),
    "roughconductor": Kind(
        _roughconductor, _told_roughconductor,
        {"rough conductor": {**METAL, **ISOTROPIC}, "anisotropic conductor": {**METAL, **ANISOTROPIC}},
    ),
    "dielectric": Kind(
        _dielectric, lambda one: {"type": "dielectric", **_told_glass(one)}, {"dielectric": GLASS}
    ),
    "thindielectric": Kind(
        _glass, lambda one: {"type": "thin dielectric", **_told_glass(one)}, {"thin dielectric": GLASS}
    ),
    "roughdielectric": Kind(
        _roughdielectric, lambda one: _told_rough(one, "dielectric", _told_glass(one)),
        {"rough dielectric": {**GLASS, **ISOTROPIC}, "anisotropic dielectric": {**GLASS, **ANISOTROPIC}},
    ),
    "plastic": Kind(_plastic, _told_plastic, {"plastic": PLASTIC}),
    "roughplastic": Kind(
        _roughplastic, _told_roughplastic,
        {"rough plastic": {**PLASTIC, **ISOTROPIC, "coat_transmittance": TABLE}},
    ),
    "principled": Kind(_principled, _told_principled, {"principled": DISNEY}),
    "blendbsdf": Kind(
        _blend, _told_blend, {"blend": {"weight_of_second": SHARES["weight_of_second"], "parts": PARTS}},
        ("bsdf", "ref"),
    ),
    "null": Kind(lambda _: Material("null", np.ones(3)), lambda _: {"type": "null"}, {"null": {}}),
    "mask": Kind(_mask, _told_blend, {}, ("bsdf", "ref")),
    **{
        kind: Kind(_bump, lambda one: told(one), {}, ("bsdf", "ref", "texture"))
        for kind in ("bumpmap", "normalmap")
    },
    "twosided": Kind(_twosided, lambda one: told(one), {}, ("bsdf", "ref")),
}  # fmt: skip
"""By Mitsuba's name."""


def read_material(
    element: Element, inner: Callable[[Element], Material], texture: Callable[[Element], Texture],
    is_texture: Callable[[Element], bool],
) -> Material:  # fmt: skip
    """Of a <bsdf>; `inner` is that of one inside, `texture` that of a <texture> or <ref>, which
    `is_texture` knows.
    """
    kind = MATERIALS.get(element.attrib["type"])
    holds = kind.holds if kind else ()
    with Said(element, holds) as said:
        if kind is None:
            fail(element, f"{described(element)} is not supported by raycheck")
        held = [one for one in element if one.tag in holds and not said.is_share(one)]
        pictures = [one for one in held if is_texture(one)]
        return kind.read(Source(said, [inner(one) for one in held if one not in pictures], pictures, texture))


def told(one: Material) -> Row:
    """As plain data, which the schema describes."""
    row = MATERIALS[one.kind].told(one)
    bump = {} if one.bump is None else {"bump": _told_bump(one.bump)}
    return {"type": row.pop("type"), "two_sided": one.two_sided, **row, **bump}


def _told_colour(one: Material, name: str) -> Row:
    """It, or the texture instead: `texture` and its fields, after the name of a colour but the first."""
    return told_texture(name, one.textures.get(name)) or {name: getattr(one, name).tolist()}


def _told_share(one: Material, own: str, name: str, number: float) -> Row:
    """Likewise, of a number that `own` is the name of."""
    return told_texture(name, one.textures.get(own)) or {name: number}


def schema() -> tuple[dict[str, list[Row]], list[Row]]:
    """What a colour, number or texture as plain data may be, one of these, by name; and what a material may
    be.
    """
    plain = {**dict.fromkeys(TEXTURED, COLOUR), **dict.fromkeys(SHARES, SHARE)}
    plain |= {name: _roughness(what) for name, what in ROUGHNESSES.items()}
    textured = {
        name: [{"required": [*fields], "properties": fields} for fields in ({name: said}, *instead(name))]
        for name, said in plain.items()
    }
    kinds = [_of_schema(name, fields) for kind in MATERIALS.values() for name, fields in kind.fields.items()]
    return textured, kinds


def schema_of_bump() -> Row:
    """What turns the normal of a material, as plain data."""
    fields = {
        "of": {"enum": ["heights", "normals"]},
        "scale": {**NUMBER, "description": "Of heights: times their luminance"},
        "shadowed": {"type": "boolean", "description": "By Estevez et al., Ray Tracing Gems, 2019"},
        "turned": {"type": "boolean", "description": "From behind what is along the surface stays"},
        **TEXTURES["bitmap"].fields,
    }  # fmt: skip
    return {"type": "object", "required": [*fields], "properties": fields}


def _of_schema(name: str, fields: Mapping[str, Row]) -> Row:
    refers = TEXTURED | SHARES | ALPHAS
    own = {field: said for field, said in fields.items() if field not in refers}
    row: Row = {"required": [*own], "properties": {"type": {"const": name}, **own}}
    others = [said for field, said in fields.items() if field in refers]
    return row | ({"allOf": others} if others else {})


def all_fields() -> dict[str, Row]:
    """What the schema says of the fields that materials may have, in order, but parts and pictures."""
    kinds = [fields for kind in MATERIALS.values() for fields in kind.fields.values()]
    found: dict[str, Row] = {}
    for fields in (*kinds, *(fields for name in TEXTURED for fields in instead(name))):
        for name, said in fields.items():
            found.setdefault(name, said)
    left_out = (PARTS, PIXELS, TABLE)
    return {name: said for name, said in found.items() if "enum" not in said and said not in left_out}
