"""What decides whether a technique applies to a scene: its lights, materials and depth."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from raycheck.scene import document

DELTA_LIGHTS = frozenset({"point", "spot", "directional"})
"""Emitters that no random ray can hit."""
SPECULAR = frozenset({"conductor", "dielectric", "thindielectric", "plastic", "null", "mask"})
FLAT = frozenset({"rectangle", "cube"})
"""Shapes whose sides oneray can sample by solid angle."""
MANY_FACES = frozenset({"cube", "ply", "obj"})
"""Shapes that are several lights to choose from, a side or a triangle each."""


@dataclass(frozen=True)
class SceneContent:
    """What decides whether a technique applies to a scene."""

    lights: int
    delta_lights: int
    max_depth: int
    """Mitsuba's meaning: 1 emission only, 2 direct light, −1 no limit."""
    rr_depth: int
    sphere_lights: int = 0
    flat_lights: int = 0
    """Lights with rectangular sides."""
    faces: int = 0
    """Number of lights with several faces, among which one is chosen."""
    specular: bool = False
    """Mirrors, glass or mixed materials are about, where no light path can be joined to the eye."""
    rough: bool = False
    """Microfacets are about."""
    bumps: bool = False
    """A bumpmap or normalmap is about."""
    hide_emitters: bool = False
    filtered: bool = False
    """By a filter wider than a pixel, which makes the noise of neighbours alike; Mitsuba's default is one."""
    radiances: tuple[float, ...] = ()
    """Of the lights that rays can meet, in the channel where it is largest, W·sr⁻¹·m⁻²."""
    unbounded: frozenset[str] = frozenset()
    """Techniques that the scene's comment says have samples without bound ("Unbounded: nee, light: why"), so
    that their variance may be infinite.
    """

    @property
    def has_indirect(self) -> bool:
        return self.max_depth == -1 or self.max_depth > 2

    @property
    def has_area_light(self) -> bool:
        return self.lights > self.delta_lights

    @property
    def has_choice(self) -> bool:
        return self.lights > 1 or self.faces > 0

    @property
    def has_roulette(self) -> bool:
        return self.max_depth == -1 or self.rr_depth < self.max_depth


def read_content(scene: Path, parameters: Mapping[str, str] | None = None) -> SceneContent:
    """What techniques need to know of a scene file; `parameters` replace its `<default>` values."""
    root = document.read(scene, parameters).resolved()

    integrator, sensor = document.integrator(root.find("integrator")), document.sensor(root)

    def setting(kind: str, name: str, default: str) -> str:
        element = integrator.find(f"{kind}[@name='{name}']") if integrator is not None else None
        return element.get("value", "") if element is not None else default

    direct = integrator is not None and integrator.get("type") == "direct"
    kinds = [emitter.get("type", "") for emitter in root.iter("emitter")]
    shining = [s.get("type", "") for s in root.iter("shape") if s.find("emitter") is not None]
    materials = {bsdf.get("type", "") for bsdf in root.iter("bsdf")}
    filters = (
        [rfilter.get("type") for rfilter in sensor.findall("film/rfilter")] if sensor is not None else []
    )
    unbounded = re.search(r"^\s*Unbounded: ([-a-z, ]+):", "\n".join(document.comments(scene)), re.MULTILINE)
    return SceneContent(
        lights=len(kinds), delta_lights=sum(kind in DELTA_LIGHTS for kind in kinds),
        max_depth=2 if direct else int(setting("integer", "max_depth", "-1")),
        rr_depth=int(setting("integer", "rr_depth", "5")), sphere_lights=shining.count("sphere"),
        flat_lights=sum(kind in FLAT for kind in shining), faces=sum(kind in MANY_FACES for kind in shining),
        specular=bool(materials & SPECULAR), rough=any(kind.startswith("rough") for kind in materials),
        bumps=bool(materials & {"bumpmap", "normalmap"}),
        radiances=tuple(
            max(map(float, value.get("value", "").replace(",", " ").split()), default=0.0)
            for value in root.iterfind(".//emitter/rgb[@name='radiance']")
        ),
        hide_emitters=setting("boolean", "hide_emitters", "false") == "true", filtered=filters != ["box"],
        unbounded=frozenset(unbounded.group(1).replace(" ", "").split(",") if unbounded else ()),
    )  # fmt: skip
