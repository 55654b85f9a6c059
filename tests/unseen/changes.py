"""Mistakes and conventions in oneray that nobody tuned for: small changes of its sources, one at a time.

Written without a look at the catalogue (tests/mutants), as students make them. A change replaces one text,
which is there once in a file below src/oneray, by another; it says in which scene it shows and with which
technique, what was done, and what is true of the picture.
"""
# ruff: noqa: E501

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Change:
    name: str
    file: str
    """Below src/oneray."""
    old: str
    new: str
    scene: str
    technique: str
    words: str
    truth: str


def of(file: str, rows: Sequence[Sequence[str]]) -> Iterator[Change]:
    """The changes of one file: name, old text, new text, "scene technique", what was done, what is true."""
    for name, old, new, where, words, truth in rows:
        scene, technique = where.split()
        yield Change(name, file, old, new, scene, technique, words, truth)


EVAL = "return light_scale(part->reflectance, REAL_INV_PI);"
UNIFORM = "light_scale(reflectance, real(2) * cosine)"
ROW = "albedo[c] += parts[i].share * d->materials[parts[i].material].as.diffuse.reflectance.most[c];"


def each(value: str) -> str:
    """A diffuse reflectance r, channel by channel."""
    return f"{{ const double *r = d->materials[parts[i].material].as.diffuse.reflectance.most; albedo[c] += parts[i].share * ({value}); }}"


DIFFUSE = of("materials/diffuse.h", [
    ("eval-no-pi", EVAL, "return part->reflectance;", "area-light nee", "f_r = albedo", "direct x pi"),
    ("eval-two-pi", EVAL, "return light_scale(part->reflectance, real(0.5) * REAL_INV_PI);", "cornell-box nee",
     "f_r = albedo / 2 pi", "all light by NEE x .5: all reflected light x .5"),
    ("eval-four-pi", EVAL, "return light_scale(part->reflectance, real(0.25) * REAL_INV_PI);", "many-lights nee",
     "f_r = albedo / 4 pi", "direct x .25"),
    ("eval-white", EVAL, "return light_all(REAL_INV_PI);", "many-lights nee", "f_r = 1 / pi, no albedo",
     "reflected x 1/albedo"),
    ("eval-squared", EVAL, "return light_scale(light_mul(part->reflectance, part->reflectance), REAL_INV_PI);",
     "occluded-lights nee", "albedo squared in f_r", "direct x albedo"),
    ("uniform-no-two", UNIFORM, "light_scale(reflectance, cosine)", "furnace walk-uniform",
     "2 pi forgotten: albedo cos", "each bounce x .5"),
    ("uniform-pi", UNIFORM, "light_scale(reflectance, REAL_PI * cosine)", "open-sky walk-uniform",
     "pi for 2", "each bounce x pi/2"),
    ("uniform-no-cosine", UNIFORM, "reflectance", "cornell-box walk-uniform", "uniform directions without cosine",
     "bounces: another distribution, reflected wrong"),
    ("uniform-cosine-squared", UNIFORM, "light_scale(reflectance, real(3) * cosine * cosine)",
     "area-light walk-uniform", "cos^2, normalised", "direct too bright above, too dark aside"),
])  # fmt: skip

MIRROR = "Scatter scatter = {mirrored(s), part->reflectance,"
CONDUCTOR = of("materials/conductor.h", [
    ("mirror-white", MIRROR, "Scatter scatter = {mirrored(s), light_all(real(1)),", "mirror-light walk-cosine",
     "the mirror's reflectance ignored", "mirrored light x 1/r"),
    ("mirror-cosine", MIRROR, "Scatter scatter = {mirrored(s), light_scale(part->reflectance, s->cos_o),",
     "mirror-light nee", "the mirror times the cosine", "mirrored light x cos"),
    ("mirror-half", MIRROR, "Scatter scatter = {mirrored(s), light_scale(part->reflectance, real(0.5)),",
     "mirror-corridor walk-cosine", "half of what a mirror reflects", "mirrored light x .5 for each mirror"),
    ("mirror-over-cosine", MIRROR,
     "Scatter scatter = {mirrored(s), light_scale(part->reflectance, real(0.7) / s->cos_o),",
     "mirror-light nee", "divided by the cosine", "mirrored light x .7/cos"),
    ("metal-one-polarisation", "real(0.5) * s * (real(1) + p)", "s", "metal walk-cosine",
     "one polarisation", "mirrored light: edges too bright"),
    ("metal-other-polarisation", "real(0.5) * s * (real(1) + p)", "s * p", "metal walk-cosine",
     "the other polarisation", "mirrored light: edges too dark"),
    ("metal-sine", "ss = real(1) - cc;", "ss = real(1) - c;", "metal walk-cosine", "1 - cos for sin^2",
     "mirrored light: edges slightly wrong"),
    ("metal-no-eta", "eta * eta - k * k - ss", "real(1) - k * k - ss", "metal walk-cosine", "eta taken as 1 in one term",
     "mirrored light: colours wrong"),
    ("metal-blue", "fresnel_conductor(c, eta.b, k.b)", "fresnel_conductor(c, eta.r, k.r)", "metal walk-cosine",
     "blue gets red's index", "mirrored light: blue wrong"),
])  # fmt: skip

REFLECTS = "Mask reflects = real(1) - u[0] >= transmittance;"
COMPRESSION = "select(reflects, real(1), ratio * ratio)};"
GLASS_WEIGHT = "light_select(reflects, part->reflectance, tint), real(0)"
DIELECTRIC = of("materials/dielectric.h", [
    ("glass-schlick", "f.use & USE_SCHLICK ?", "1 ?", "glass-ball walk-cosine", "Schlick's approximation",
     "glass: shares slightly wrong"),
    ("glass-inside-out", "(side ? ior : 1 / ior)", "(side ? 1 / ior : ior)", "glass-ball walk-cosine", "indices exchanged",
     "refraction another"),
    ("glass-always-refracts", REFLECTS, "Mask reflects = transmittance <= real(0);", "glass-pane walk-cosine",
     "no Fresnel", "reflection missing"),
    ("glass-coin", REFLECTS, "Mask reflects = real(1) - u[0] >= only(transmittance > real(0), real(0.5));",
     "glass-ball walk-cosine", "a coin decides", "glass: shares wrong"),
    ("glass-little", REFLECTS, "Mask reflects = real(1) - u[0] >= only(transmittance > real(0), real(0.96));",
     "glass-ball nee", "4 % reflected at any angle", "glass: edges wrong"),
    ("glass-one-polarisation", "real(2) * ((rc / s) * (c_t / s) + (c / p) * (rc_t / p))",
     "real(4) * ((rc / s) * (c_t / s))", "glass-pane walk-cosine", "one polarisation", "glass: edges wrong"),
    ("glass-uncompressed", COMPRESSION, "real(1)};", "mixed-material walk-cosine", "no eta^2", "refracted light x 2.25"),
    ("glass-compressed-inverse", COMPRESSION, "select(reflects, real(1), real(1) / (ratio * ratio))};",
     "mixed-material walk-cosine", "eta^2 inverted", "refracted light x 5"),
    ("glass-tir-black", GLASS_WEIGHT,
     "light_select(reflects, light_only(c_t > real(0), part->reflectance), tint), real(0)",
     "glass-ball walk-cosine", "total reflection absorbed", "total reflection missing"),
    ("glass-fresnel-twice", GLASS_WEIGHT,
     "light_select(reflects, light_scale(part->reflectance, real(1) - transmittance), "
     "light_scale(tint, transmittance)), real(0)",
     "glass-pane walk-cosine", "chosen by F and weighed by F", "glass too dark"),
    ("glass-133", "double ior = dielectric_ior(m);", "double ior = dielectric_ior(m) > 1 ? 1.33 : 1 / 1.33;",
     "glass-ball nee", "every glass is water", "refraction another"),
    ("glass-tinted", GLASS_WEIGHT, "light_select(reflects, part->reflectance, light_scale(tint, real(0.9))), real(0)",
     "glass-pane walk-cosine", "a loss of a tenth at each crossing", "transmitted light x .81 for each pane"),
    ("glass-green", GLASS_WEIGHT,
     "light_select(reflects, part->reflectance, light_mul(tint, light(real(0.9), real(1), real(0.9)))), real(0)",
     "glass-ball walk-cosine", "green glass", "transmitted light: red and blue x .9 a crossing"),
])  # fmt: skip

SCATTER = of("materials/scatter.h", [
    ("blend-weighed-twice", "out.pdf_w = out.pdf_w * part.share;",
     "out.pdf_w = out.pdf_w * part.share, out.factor = light_scale(out.factor, part.share);",
     "mixed-material walk-cosine", "a part is chosen by its share and weighed by it",
     "reflected light of each part x its share"),
])  # fmt: skip

PREPARE_MATERIALS = of("prepare/materials.h", [
    ("row-squared", ROW, each("r[c] * r[c]"), "cornell-box mis-power",
     "gamma 2 taken off albedos", "albedo squared everywhere"),
    ("row-srgb", ROW, each("pow(r[c], 2.2)"), "area-light mis-power", "gamma 2.2 taken off albedos",
     "albedo^2.2 everywhere"),
    ("row-encoded", ROW, each("pow(r[c], 1 / 2.2)"), "cornell-box nee", "albedos gamma encoded",
     "albedo^.4545 everywhere"),
    ("row-bgr", ROW, each("r[2 - c]"), "cornell-box nee", "albedos read as B G R, lamps as R G B",
     "surfaces' colours exchanged, lamps' not"),
    ("row-grey", ROW, each("(r[0] + r[1] + r[2]) / 3"), "cornell-box nee",
     "grey albedos", "surfaces grey"),
    ("row-dim", ROW, each("0.8 * r[c]"), "many-lights nee", "an energy loss of .8 in each albedo",
     "reflected x .8 (direct)"),
    ("row-dim-bounces", ROW, each("0.9 * r[c]"), "cornell-box nee", "albedos times .9",
     "direct x .9, two bounces x .81, …"),
    ("row-cut", ROW, each("fmin(r[c], 0.6)"), "area-light nee", "albedo cut at .6",
     "direct: channels x .6/a"),
    ("row-boosted", ROW, each("fmin(1, 1.25 * r[c])"), "many-lights nee", "albedo times 1.25, cut at 1",
     "direct x 1.25 (cut at 1)"),
    ("back-as-front", "row % 2 ? d->shapes[i].back : d->shapes[i].front, row % 2);", "d->shapes[i].front, row % 2);",
     "light-below-horizon nee", "one-sided surfaces reflect on both sides", "backs not black"),
    ("blend-share-lost", "parts[i].share * d->materials[parts[i].material].as.diffuse.reflectance.most[c]",
     "d->materials[parts[i].material].as.diffuse.reflectance.most[c]", "mixed-material nee",
     "the diffuse part of a blend counts in full", "the diffuse part x 2"),
])  # fmt: skip

ARRIVES = "Mask arrives = and_not(active, shapes_occluded(&scene->shapes, ray, active, target, f));"
WEIGHED = "light = light_scale(light, mis_weight_light(pdf_w * sample.inverse_pdf_w, f));"
SHADOW = "Ray shadow = {s->p, sample.wi, sample.distance, s->slot};"
ACTIVE = "active &= can_receive(s, cosine, f) & (light_max(sample.weight) > real(0));"
GAINED = "light_only(arrives, light_mul(path_weight(path, f), light)));"
NEE = of("estimators/nee.h", [
    ("no-shadow-ray", ARRIVES, "Mask arrives = active;", "area-light nee", "no shadow ray", "direct: shadows missing"),
    ("soft-shadows", ARRIVES, "Mask arrives = active; *light = light_scale(*light, select(shapes_occluded("
     "&scene->shapes, ray, active, target, f), real(0.2), real(1)));", "area-light nee",
     "shadows let a fifth through", "direct: a fifth of it in shadows"),
    ("nee-no-cosine", "light_mul(surface.f_r, sample.weight), received(cosine, f));",
     "light_mul(surface.f_r, sample.weight), real(1));", "many-lights nee", "no cosine at the surface",
     "direct x 1/cos"),
    ("nee-cosine-squared", "light_mul(surface.f_r, sample.weight), received(cosine, f));",
     "light_mul(surface.f_r, sample.weight), cosine * cosine);", "spherical-light nee", "cosine twice",
     "direct x cos"),
    ("nee-half-lambert", "light_mul(surface.f_r, sample.weight), received(cosine, f));",
     "light_mul(surface.f_r, sample.weight), real(0.5) + real(0.5) * cosine);", "point-light nee",
     "half Lambert", "direct x (1+cos)/2cos"),
    ("mis-nee-unweighed", WEIGHED, "", "cornell-box mis-power", "NEE in full beside weighed bounces",
     "light of all lengths but emission: double counted in part"),
    ("mis-nee-half", WEIGHED, "light = light_scale(light, real(0.5));", "area-light mis-balance", "NEE times a half, "
     "bounces weighed", "direct: weights do not sum to 1"),
    ("mis-light-pdf-one", WEIGHED, "light = light_scale(light, mis_weight_light(pdf_w, f));", "cornell-box mis-power",
     "the light's density taken for 1", "weights do not sum to 1"),
    ("mis-by-area", WEIGHED,
     "light = light_scale(light, mis_weight_light(pdf_w * of_light(scene->emitters.area, sample.emitter, f), f));",
     "area-light mis-power", "the light's density by area in NEE's weight", "weights do not sum to 1"),
    ("shadow-80", SHADOW, "Ray shadow = {s->p, sample.wi, sample.distance * real(0.8), s->slot};", "area-light nee",
     "shadow rays end at four fifths", "direct: occluders near the lamp missed"),
    ("shadow-half", SHADOW, "Ray shadow = {s->p, sample.wi, sample.distance * real(0.5), s->slot};", "cornell-box nee",
     "shadow rays end half way", "direct: occluders near the lamp missed, indirect too"),
    ("shadow-from-above", SHADOW, "Ray shadow = {vec_add(s->p, vec_scale(s->n, real(0.1))), sample.wi, "
     "sample.distance, index_of(-1)};", "cornell-box nee", "shadow rays start .1 above the surface",
     "direct: contact shadows wrong"),
    ("nee-first-only", ACTIVE, ACTIVE + " active &= path->depth == index_of(0);", "cornell-box nee",
     "NEE at the first vertex only", "indirect x 0"),
    ("nee-not-first", ACTIVE, ACTIVE + " active &= path->depth > index_of(0);", "cornell-box nee",
     "NEE from the second vertex on", "direct x 0"),
    ("nee-two-only", ACTIVE, ACTIVE + " active &= path->depth < index_of(2);", "cornell-box nee",
     "NEE at two vertices only", "paths beyond two bounces missing"),
    ("nee-no-throughput", GAINED, "light_only(arrives, light));", "cornell-box nee", "NEE forgets the throughput",
     "indirect too bright, uncoloured"),
    ("nee-throughput-twice", GAINED,
     "light_only(arrives, light_mul(path_weight(path, f), light_mul(path_weight(path, f), light))));",
     "cornell-box nee", "NEE has the throughput twice", "indirect too dark"),
    ("nee-grey-throughput", GAINED,
     "light_only(arrives, light_scale(light, light_max(path_weight(path, f)))));", "cornell-box nee",
     "the largest channel of the throughput", "indirect too bright, uncoloured"),
    ("nee-attenuated", GAINED, "light_only(arrives, light_scale(light_mul(path_weight(path, f), light), "
     "select(path->depth == index_of(1), real(0.5), real(1)))));", "cornell-box nee", "two bounces times a half",
     "two bounces x .5"),
    ("nee-late-boost", GAINED, "light_only(arrives, light_scale(light_mul(path_weight(path, f), light), "
     "select(path->depth > index_of(0), real(1.5), real(1)))));", "cornell-box nee", "indirect times 1.5 for looks",
     "indirect x 1.5"),
])  # fmt: skip

NEE_HIT = "return select(path->delta, real(1), real(0));"
MIS_HIT = "select(path->delta, real(1), real(1) - mis_weight_light(path->pdf_w * inverse_pdf_w, f))"
MIS = of("estimators/mis.h", [
    ("mis-swapped", MIS_HIT, "select(path->delta, real(1), mis_weight_light(path->pdf_w * inverse_pdf_w, f))",
     "area-light mis-power", "the bounce has the light's weight", "weights do not sum to 1"),
    ("nee-hits-count", NEE_HIT, "return real(1);", "cornell-box nee", "lamps met count besides NEE",
     "reflected light x 2 nearly: double counted"),
    ("nee-lamps-black", NEE_HIT, "return real(0);", "many-lights nee", "no lamp is ever met", "emission x 0"),
    ("nee-mirrors-black", NEE_HIT, "return select(path->delta & (path->depth == index_of(0)), real(1), real(0));",
     "mirror-light nee", "lamps are seen directly only", "light met in mirrors missing"),
    ("nee-lamps-half", NEE_HIT, "return select(path->delta, real(0.5), real(0));", "many-lights nee",
     "lamps half as bright to the eye", "emission x .5"),
    ("nee-hits-half", NEE_HIT, "return select(path->delta, real(1), real(0.5));", "area-light nee",
     "half of what bounces meet besides NEE", "direct x 1.5"),
    ("mis-camera-weighed", MIS_HIT, "real(1) - mis_weight_light(path->pdf_w * inverse_pdf_w, f)", "many-lights mis-power",
     "camera rays weighed, too", "emission x 0"),
    ("mis-hits-lost", MIS_HIT, "select(path->delta, real(1), real(0))", "cornell-box mis-power",
     "weighed NEE without the bounces' share", "reflected too dark"),
    ("mis-hits-half", MIS_HIT, "select(path->delta, real(1), real(0.5))", "area-light mis-power",
     "a half for what bounces meet", "weights do not sum to 1"),
    ("mis-no-choice", "\n           * inverse_choice_of(&scene->emitters, &at, and_not(hit, path->delta), i, f);", ";", "many-lights mis-power",
     "p_i left out at the bounce", "weights do not sum to 1"),
])  # fmt: skip

EMISSION = of("estimators/emission.h", [
    ("lamps-two-sided", "shines &= front & path->alive;", "shines &= path->alive;", "area-light walk-cosine",
     "lamps shine from their backs", "the lamps' backs seen, light from them"),
    ("lamps-cosine", "light_scale(emission, weight)", "light_scale(emission, weight * s->cos_face)",
     "spherical-light walk-cosine", "emission times the cosine", "emission and direct x cos at the lamp"),
    ("sky-hidden", "Mask missed = (hit.slot < 0) & path->alive;",
     "Mask missed = (hit.slot < 0) & path->alive & (path->depth > index_of(0));", "open-sky mis-power",
     "the background is black", "emission x 0 (sky as seen)"),
    ("sky-backdrop", "Mask missed = (hit.slot < 0) & path->alive;",
     "Mask missed = (hit.slot < 0) & path->alive & (path->depth == index_of(0));", "open-sky walk-cosine",
     "the sky is a backdrop that lights nothing", "direct x 0"),
    ("sky-gradient", "light_scale(radiance, weight_of_hit(path, inverse_pdf_w, f))",
     "light_scale(radiance, weight_of_hit(path, inverse_pdf_w, f) * (real(1) + real(0.5) * path->ray.d.z))",
     "open-sky walk-cosine", "a gradient in the sky", "the sky another"),
])  # fmt: skip

COMPENSATED = "path->throughput = light_scale(path->throughput, inverse_q);"
ROULETTE = of("estimators/roulette.h", [
    ("roulette-free", COMPENSATED, "", "furnace walk-cosine", "not divided", "late bounces too dark"),
    ("roulette-twice", COMPENSATED, "path->throughput = light_scale(path->throughput, inverse_q * inverse_q);",
     "leaving-paths walk-cosine", "divided twice", "late bounces too bright"),
    ("roulette-fixed", COMPENSATED, "path->throughput = light_scale(path->throughput, select(q < real(1), real(1.25), "
     "real(1)));", "furnace walk-cosine", "divided by .8, whatever q is", "late bounces wrong"),
    ("roulette-harder", "path->alive &= path->roulette < q;", "path->alive &= path->roulette < q * real(0.9);",
     "furnace walk-cosine", "survives by .9 q", "late bounces too dark"),
    ("roulette-early", "select(depth >= index_of(scene->rr_depth), q, real(1));\n}",
     "select(depth >= index_of(1), q * real(0.5), real(1)); }", "leaving-paths walk-cosine",
     "from the first bounce, half as likely, divided", "none: right, but noisier"),
])  # fmt: skip

IS_LAST = "return path->depth + 1 >= index_of(scene->max_depth);"
THROUGHPUT = "path->throughput = light_mul(path->throughput, scatter.factor);"
ALIVE = "path->alive &= light_max(path->throughput) > real(0);"
WALK = of("estimators/walk.h", [
    ("depth-more", IS_LAST, "return path->depth >= index_of(scene->max_depth);", "area-light mis-power", "one bounce more",
     "one more path length"),
    ("depth-less", IS_LAST, "return path->depth + 2 >= index_of(scene->max_depth);", "furnace walk-cosine", "one bounce fewer",
     "the last path length missing"),
    ("depth-two", IS_LAST, "return path->depth + 1 >= index_of(2);", "leaving-paths mis-power", "direct light alone",
     "indirect x 0"),
    ("depth-four", IS_LAST, "return (path->depth + 1 >= index_of(4)) | (path->depth + 1 >= index_of(scene->max_depth));",
     "cornell-box nee", "at most four segments", "paths beyond 4 missing"),
    ("throughput-forgotten", THROUGHPUT, "path->throughput = scatter.factor;", "cornell-box nee",
     "only the last factor", "light beyond two bounces too bright"),
    ("throughput-mean", THROUGHPUT, "path->throughput = light_scale(path->throughput, (scatter.factor.r + "
     "scatter.factor.g + scatter.factor.b) * real(1 / 3.0));", "cornell-box nee", "mean of the channels",
     "indirect uncoloured"),
    ("bounce-loss", THROUGHPUT, "path->throughput = light_scale(light_mul(path->throughput, scatter.factor), real(0.9));",
     "cornell-box nee", "a tenth lost at each bounce", "two bounces x .9, three x .81, …"),
    ("bounce-gain", THROUGHPUT, "path->throughput = light_scale(light_mul(path->throughput, scatter.factor), real(1.1));",
     "furnace walk-cosine", "a tenth gained at each bounce", "direct x 1.1, two bounces x 1.21, …"),
    ("delta-never", "path->delta = scatter.delta;", "path->delta = mask_none();", "mirror-light nee",
     "mirrors are no specular vertices", "light met in mirrors missing"),
    ("delta-stays", "path->delta = scatter.delta;", "path->delta |= scatter.delta;", "area-light nee",
     "the flag is never reset", "double counted"),
    ("throughput-floor", ALIVE, "path->alive &= light_max(path->throughput) > real(0.3);", "furnace walk-cosine",
     "dim paths end", "late bounces missing"),
    ("emission-unscaled", "light_mul(path_weight(path, f), light)", "light", "cornell-box walk-cosine",
     "emission without throughput", "reflected too bright, uncoloured"),
    ("starts-off", "path->ray = (Ray){s->p, scatter.wi, real(NUM_MAX), s->slot};",
     "path->ray = (Ray){vec_add(s->p, vec_scale(scatter.wi, real(0.05))), scatter.wi, real(NUM_MAX), s->slot};",
     "cornell-box walk-cosine", "rays start .05 along", "other: what is nearer is missed"),
])  # fmt: skip

JITTER = "pixel_x + film.u[0], pixel_y + film.u[1], lens.u, f);"
PATH = of("estimators/path.h", [
    ("pixel-middle", JITTER, "pixel_x + real(0.5), pixel_y + real(0.5), lens.u, f);", "many-lights nee", "no jitter",
     "convention: no jitter, middle"),
    ("pixel-centred", JITTER, "pixel_x + film.u[0] - real(0.5), pixel_y + film.u[1] - real(0.5), lens.u, f);", "cornell-box nee",
     "pixel centres at whole numbers", "convention: half a pixel aside in x and y"),
    ("pixel-right", JITTER, "pixel_x + film.u[0] + real(0.5), pixel_y + film.u[1], lens.u, f);", "many-lights nee",
     "half a pixel to the right", "convention: half a pixel aside in x"),
    ("pixel-transposed", JITTER, "pixel_y + film.u[1], pixel_x + film.u[0], lens.u, f);", "cornell-box nee",
     "x and y exchanged", "convention: x and y exchanged"),
    ("pixel-box", JITTER, "pixel_x + real(2) * film.u[0] - real(0.5), pixel_y + real(2) * film.u[1] - real(0.5), lens.u, f);",
     "cornell-box nee", "a box two pixels wide", "convention: wider filter, box 2"),
    ("pixel-tent", JITTER, "pixel_x + film.u[0] + film.u[3] - real(0.5), pixel_y + film.u[1], lens.u, f);", "many-lights nee",
     "a tent across", "convention: wider filter, in x alone"),
    ("pixel-blur", JITTER,
     "pixel_x + real(4) * film.u[0] - real(1.5), pixel_y + real(4) * film.u[1] - real(1.5), lens.u, f);", "cornell-box nee",
     "a box four pixels wide", "convention: wider filter, box 4"),
    ("pixel-quarter", JITTER, "pixel_x + film.u[0] * real(0.5), pixel_y + film.u[1] * real(0.5), lens.u, f);", "cornell-box nee",
     "jitter in half the pixel", "convention: a quarter pixel aside, narrower"),
])  # fmt: skip

CAMERA = of("sensors/camera.h", [
    ("view-mirrored", "*a = real(row->a) - x * real(row->pixel_width);",
     "*a = x * real(row->pixel_width) - real(row->a);", "cornell-box nee", "left is right", "convention: left and right exchanged"),
    ("view-upside-down", "*b = real(row->b) - y * real(row->pixel_height);",
     "*b = y * real(row->pixel_height) - real(row->b);", "many-lights nee", "up is down", "convention: upside down"),
    ("view-stretched", "PictureRow row = {(Num)(2.0 / frame->width),",
     "PictureRow row = {(Num)(2.0 / (frame->width - 1)),", "many-lights nee", "width - 1", "other: stretched across by 64/63"),
])  # fmt: skip

PERSPECTIVE = of("sensors/perspective.h", [
    ("view-small-angle", "half[0] = cr_tan(s->fov * PI / 360);", "half[0] = s->fov * PI / 360;", "cornell-box nee",
     "the angle for its tangent", "other: zoomed in"),
    ("view-squeezed", "half[1] = half[0] / aspect;", "half[1] = half[0] / aspect * 1.03;", "cornell-box nee",
     "pixels that are no squares", "other: squeezed"),
    ("eye-cosine", "inverse_z * inverse_z * inverse_z / real(camera->film_area)",
     "inverse_z * inverse_z / eye.distance / real(camera->film_area)", "area-light light", "light tracing: cos^2 for cos^3",
     "reflected x cos, dark corners"),
    ("eye-film-area", "(Num)(4 * extent[0] * extent[1])", "(Num)(extent[0] * extent[1])", "cornell-box light",
     "light tracing: a quarter of the film's area", "reflected x 4"),
])  # fmt: skip

WRITTEN = "mean[3 * i + c] = (float)estimate[c];"
X = "estimate[c]"


def written(value: str) -> str:
    return f"mean[3 * i + c] = (float)({value});"


MOVED = "mean[3 * {} + c] = (float)estimate[c];"
W = "(size_t)film->window.width"
FILM = of("film/film.c", [
    ("one-sample-more", "mean[c] += difference * (more / (n + more));", "mean[c] += difference * (more / (n + more + 1));",
     "point-light nee", "divided by n + 1", "factor n/(n+1)"),
    ("film-gamma-22", WRITTEN, written("pow(estimate[c], 1 / 2.2)"), "many-lights nee", "gamma 2.2", "convention: gamma 2.2"),
    ("film-gamma-18", WRITTEN, written("pow(estimate[c], 1 / 1.8)"), "cornell-box nee", "gamma 1.8",
     "other: gamma 1.8"),
    ("film-squared", WRITTEN, written("estimate[c] * estimate[c]"), "area-light nee", "squared", "other: power 2"),
    ("film-clamped", WRITTEN, written("fmin(estimate[c], 1)"), "many-lights nee", "cut at 1", "convention: pixels clamped at 1"),
    ("film-clamped-half", WRITTEN, written("fmin(estimate[c], 0.5)"), "area-light nee", "cut at .5",
     "convention: pixels clamped at .5"),
    ("film-bgr", WRITTEN, written("estimate[2 - c]"), "cornell-box nee", "B G R", "convention: red and blue exchanged"),
    ("film-grb", WRITTEN, written("estimate[c == 2 ? 2 : 1 - c]"), "cornell-box nee", "G R B",
     "convention: red and green exchanged"),
    ("film-doubled", WRITTEN, written("2 * estimate[c]"), "spherical-light nee", "times 2", "factor 2"),
    ("film-over-pi", WRITTEN, written("estimate[c] / 3.14159265"), "cornell-box nee", "radiosity for radiance: / pi",
     "factor 1/pi"),
    ("film-exposed", WRITTEN, written("estimate[c] * 0.18 / 0.5"), "cornell-box nee", "key value .18", "factor .36"),
    ("film-683", WRITTEN, written("683 * estimate[c]"), "point-light nee", "lumens: times 683", "factor 683"),
    ("film-percent", WRITTEN, written("1.01 * estimate[c]"), "area-light nee", "1 % too bright", "factor 1.01"),
    ("film-reinhard", WRITTEN, written("estimate[c] / (1 + estimate[c])"), "many-lights nee", "x/(1+x)",
     "convention: x/(1+x)"),
    ("film-reinhard-white", WRITTEN, written("estimate[c] * (1 + estimate[c] / 16) / (1 + estimate[c])"), "cornell-box nee",
     "Reinhard with a white of 4", "other: a tone curve"),
    ("film-exponential", WRITTEN, written("1 - exp(-2 * estimate[c])"), "cornell-box nee", "1 - exp(-2x)",
     "other: a tone curve"),
    ("film-lifted", WRITTEN, written("estimate[c] + 0.02"), "cornell-box nee", "an ambient of .02", "other: .02 added"),
    ("film-faded", WRITTEN, written("0.9 * estimate[c] + 0.05"), "area-light nee", "less contrast",
     "other: .9 x + .05"),
    ("film-warm", WRITTEN, written("estimate[c] * (c == 0 ? 1.08 : c == 1 ? 1.0 : 0.9)"), "cornell-box nee",
     "warm white", "convention: channel factors 1.08 1 .9"),
    ("film-green", WRITTEN, written("estimate[c] * (c == 1 ? 1.05 : 1.0)"), "area-light nee", "green times 1.05",
     "convention: channel factors 1 1.05 1"),
    ("film-red-lost", WRITTEN, written("c ? estimate[c] : 0"), "cornell-box nee", "red is black",
     "convention: channel factors 0 1 1"),
    ("film-luminance", WRITTEN, written("0.2126 * estimate[0] + 0.7152 * estimate[1] + 0.0722 * estimate[2]"),
     "many-lights nee", "luminance alone", "convention: luminance alone"),
    ("film-ntsc-grey", WRITTEN, written("0.299 * estimate[0] + 0.587 * estimate[1] + 0.114 * estimate[2]"),
     "cornell-box nee", "luma of NTSC alone", "convention: grey, NTSC (nearly luminance)"),
    ("film-turned", WRITTEN, MOVED.format("(film_pixels(film) - 1 - i)"), "many-lights nee", "read backwards",
     "convention: turned by 180 degrees"),
    ("film-rolled", WRITTEN, MOVED.format(f"((i + {W}) % film_pixels(film))"), "many-lights nee", "one row too low",
     "convention: a pixel aside in y (rolled)"),
    ("film-rolled-half", WRITTEN, MOVED.format("((i + film_pixels(film) / 2) % film_pixels(film))"), "cornell-box nee",
     "halves exchanged", "other: upper and lower half exchanged"),
    ("film-interlaced", WRITTEN, written(f"(i / {W}) % 2 ? estimate[c] : 0"), "many-lights nee", "odd rows only",
     "other: every second row black: factor .5 in tiles"),
    ("film-eight-bits", WRITTEN, written("floor(255 * fmin(estimate[c], 1)) / 255"), "cornell-box nee",
     "cut at 1, rounded down to 1/255", "convention: pixels clamped at 1 (and 1/510 too dark)"),
    ("film-half", WRITTEN, written("ldexp(floor(ldexp(estimate[c], 4)), -4)"), "cornell-box nee",
     "rounded down to 1/16", "other: too dark by 1/32"),
])  # fmt: skip

COLLECTED = "light_lane(&path->radiance, lane, job->radiance + 3 * queue->item[lane]);"


def sample(value: str) -> str:
    """Each sample x of a channel."""
    return (COLLECTED + " for (int c = 0; c < 3; c++) { double *x = job->radiance + 3 * queue->item[lane] + c; "
            f"*x = {value}; }}")  # fmt: skip


TRACE = of("kernel/trace.h", [
    ("fireflies-1", COLLECTED, sample("*x < 1 ? *x : 1"), "cornell-box walk-cosine", "samples cut at 1",
     "convention: bright samples clamped"),
    ("fireflies-5", COLLECTED, sample("*x < 5 ? *x : 5"), "cornell-box walk-cosine", "samples cut at 5",
     "convention: bright samples clamped"),
    ("fireflies-dropped", COLLECTED, sample("*x < 3 ? *x : 0"), "area-light walk-cosine", "samples above 3 dropped",
     "other: bright samples lost"),
    ("samples-gamma", COLLECTED, sample("sqrt(*x)"), "area-light mis-power", "the root of each sample, not of the mean",
     "other: samples encoded one by one"),
    ("samples-mapped", COLLECTED, sample("*x / (1 + *x)"), "area-light mis-power", "x/(1+x) of each sample",
     "other: samples mapped one by one"),
    ("columns-share-noise", "(Word)(uint32_t)queue->pixel;", "(Word)(uint32_t)queue->x;", "cornell-box nee",
     "random numbers by column", "other: columns share noise"),
    ("seed-ignored", "queue.start.rng.key[0] = (uint32_t)job->seed;",
     "queue.start.rng.key[0] = 1;", "area-light nee", "the seed is ignored",
     "other: same noise in every image"),
])  # fmt: skip

PLACED = "vec_scale(delta, inverse_d), distance, light_all(inverse_d * inverse_d), real(0), index_of(-1), i};"


def placed(value: str) -> str:
    return f"vec_scale(delta, inverse_d), distance, light_all({value}), real(0), index_of(-1), i}};"


POINTS = of("emitters/emitter.h", [
    ("point-linear", PLACED, placed("inverse_d"), "point-light nee", "1/d", "direct x d"),
    ("point-constant", PLACED, placed("real(1)"), "sun-and-spot nee", "no falloff", "spot x d^2"),
    ("point-cubic", PLACED, placed("inverse_d * inverse_d * inverse_d"), "sun-and-spot nee", "1/d^3", "spot x 1/d"),
    ("point-flux", PLACED, placed("inverse_d * inverse_d * real(0.25) * REAL_INV_PI"), "sun-and-spot nee",
     "intensity as flux", "spot x 1/(4 pi)"),
    ("point-softened", PLACED, placed("real(1) / (real(0.1) + distance * distance)"), "point-light nee",
     "1/(.1 + d^2)", "direct slightly darker where near"),
    ("point-double", PLACED, placed("real(2) * inverse_d * inverse_d"), "sun-and-spot nee", "counted twice", "spot x 2"),
])  # fmt: skip

SPOT = of("emitters/spot.h", [
    ("spot-smooth", "return select(angle <= beam, real(1), ramp);",
     "return select(angle <= beam, real(1), ramp * ramp * (real(3) - real(2) * ramp));", "sun-and-spot nee", "smoothstep",
     "spot: its rim another"),
    ("spot-hard", "return select(angle <= beam, real(1), ramp);", "return select(angle <= cutoff, real(1), real(0));",
     "sun-and-spot nee", "a hard rim", "spot: its rim too bright"),
    ("spot-linear-from-axis", "(cutoff - angle) / (cutoff - beam)", "(cutoff - angle) / cutoff", "sun-and-spot nee",
     "the ramp from the axis", "spot: its rim darker"),
    ("spot-narrow", "(cutoff - angle) / (cutoff - beam)", "real(0)", "sun-and-spot nee", "no light beyond the beam",
     "spot: its rim missing"),
])  # fmt: skip

SUN = of("emitters/directional.h", [
    ("sun-over-pi", "light_all(real(1)), real(0), index_of(-1), i}", "light_all(REAL_INV_PI), real(0), index_of(-1), i}",
     "sun-and-spot nee", "over pi", "sun x 1/pi"),
    ("sun-times-pi", "light_all(real(1)), real(0), index_of(-1), i}", "light_all(REAL_PI), real(0), index_of(-1), i}",
     "sun-and-spot nee", "times pi", "sun x pi"),
    ("sun-backwards", "Vec wi = vec_neg(vec_of_light(emitters->edge_x, i, f));",
     "Vec wi = vec_of_light(emitters->edge_x, i, f);", "sun-and-spot nee", "the sun from below", "sun x 0"),
    ("sun-higher", "Vec wi = vec_neg(vec_of_light(emitters->edge_x, i, f));",
     "Vec wi = vec_neg(vec_of_light(emitters->edge_x, i, f)); wi.z = wi.z * real(1.2); wi = vec_normalize(wi);",
     "sun-and-spot nee", "the sun a little too high", "sun: its shadows moved, brighter"),
])  # fmt: skip

SKY = of("emitters/constant.h", [
    ("sky-half", "Real inverse = real(1) / constant_pdf_w(emitters, wi);",
     "Real inverse = real(0.5) / constant_pdf_w(emitters, wi);", "open-sky nee", "2 pi for 4 pi", "direct x .5"),
    ("sky-upper", "Vec wi = sample_sphere(u, v);", "Vec wi = sample_sphere(u, v); wi.z = real_abs(wi.z);", "open-sky nee",
     "directions of the upper half only, density of the sphere", "direct: what is above x 2, below x 0"),
    ("sky-bright", "return light_of(emitters->emission[emitters->sky]);",
     "return light_scale(light_of(emitters->emission[emitters->sky]), real(1.5));", "open-sky nee",
     "the sky seen is 1.5 times the one that lights", "emission x 1.5"),
])  # fmt: skip

INVERSE = "Real inverse = of_light(emitters->area, i, f) * cosine * inverse_dd;"
AREA = of("emitters/area.h", [
    ("lamp-no-cosine", INVERSE, "Real inverse = of_light(emitters->area, i, f) * inverse_dd;", "cornell-box nee",
     "no cosine at the lamp", "direct and indirect x 1/cos_l"),
    ("lamp-no-area", INVERSE, "Real inverse = cosine * inverse_dd;", "occluded-lights nee", "area forgotten",
     "direct x 1/A of each light"),
    ("lamp-no-distance", INVERSE, "Real inverse = of_light(emitters->area, i, f) * cosine;", "area-light nee", "no 1/d^2",
     "direct x d^2"),
    ("lamp-linear", INVERSE, "Real inverse = of_light(emitters->area, i, f) * cosine * real_sqrt(inverse_dd);",
     "many-lights nee", "1/d", "direct x d"),
    ("lamp-pi", INVERSE, "Real inverse = REAL_PI * of_light(emitters->area, i, f) * cosine * inverse_dd;",
     "occluded-lights nee", "pi too many", "direct x pi"),
    ("lamp-cosine-squared", INVERSE, "Real inverse = of_light(emitters->area, i, f) * cosine * cosine * inverse_dd;",
     "spherical-light nee", "cosine twice at the lamp", "direct x cos_l"),
    ("facing-unhalved", "real(0.5) * inverse, inverse);", "inverse, inverse);", "spherical-light nee-facing",
     "half the sphere, density of all", "direct x 2"),
    ("cone-half", "real(1) / pdf_w_cone(sphere->extent), inverse);", "real(0.5) / pdf_w_cone(sphere->extent), inverse);",
     "sphere-light-near nee-cone", "half the cone's solid angle", "direct x .5"),
    ("solid-angle-plus", "select(rectangle->serves, rectangle->solid_angle, inverse)",
     "select(rectangle->serves, rectangle->solid_angle * real(1.1), inverse)", "touching-light nee-cone",
     "solid angles a tenth too large", "direct x 1.1 where the rectangle is near"),
    ("lamp-both-sides", "Real cosine = -vec_dot(normal, s.wi);", "Real cosine = real_abs(vec_dot(normal, s.wi));",
     "occluded-lights nee", "lamps shine both ways", "direct: light from the backs of lamps"),
    ("lamp-half-sampled", "rectangle_sample(u, v, x, y);", "rectangle_sample(u * real(0.5), v, x, y);", "area-light nee",
     "half the lamp, as bright as all", "direct: from half of the lamp"),
    ("lamp-diagonal", "rectangle_sample(u, v, x, y);", "rectangle_sample(u, u, x, y);", "area-light nee",
     "the diagonal only", "direct: from the lamp's diagonal"),
    ("lamp-middle", "rectangle_sample(u, v, x, y);", "rectangle_sample(real(0.5), real(0.5), x, y);", "cornell-box nee",
     "the middle only", "direct: hard shadows"),
    ("lamp-crowded", "rectangle_sample(u, v, x, y);", "rectangle_sample(u * u, v, x, y);", "touching-light nee",
     "points crowd at one edge", "direct: lamp brighter at one side"),
    ("lamp-emits-uniform", "vec_from_frame(normal, sample_hemisphere_cosine(way[0], way[1]))",
     "vec_from_frame(normal, sample_hemisphere_uniform(way[0], way[1]))", "area-light light",
     "light paths leave uniformly", "reflected: another distribution"),
    ("lamp-flux-two-pi", "light_all(REAL_PI * of_light(emitters->area, i, f))",
     "light_all(real(2) * REAL_PI * of_light(emitters->area, i, f))", "cornell-box light", "flux 2 pi L A",
     "reflected x 2"),
])  # fmt: skip

SAMPLES = of("lanes/sample.h", [
    ("cosine-as-uniform", "return turned(real_sqrt(u), v, real_sqrt(real(1) - u));",
     "return sample_hemisphere_uniform(u, v);", "cornell-box walk-cosine", "uniform directions, cosine's weight",
     "bounces: another distribution"),
    ("disk-no-root", "return turned(real_sqrt(u), v, real_sqrt(real(1) - u));",
     "return turned(u, v, real_sqrt(real(1) - u * u));", "cornell-box walk-cosine", "r = u: too steep",
     "bounces: another distribution"),
    ("half-turn", "sincos_turn(v, &sine, &cosine);", "sincos_turn(v * real(0.5), &sine, &cosine);", "cornell-box nee",
     "phi in [0, pi)", "bounces: one half only"),
    ("ball-half", "return turned(real(2) * real_sqrt(u * (real(1) - u)), v, real(1) - real(2) * u);",
     "return turned(real_sqrt(u * (real(2) - u)), v, real(1) - u);", "spherical-light nee", "upper half of the ball only",
     "direct: the ball's upper half, twice as bright"),
    ("ball-poles", "return turned(real(2) * real_sqrt(u * (real(1) - u)), v, real(1) - real(2) * u);",
     "Real sine, cosine; sincos_turn(real(0.5) * u, &sine, &cosine); return turned(sine, v, cosine);",
     "sphere-light-near nee", "theta uniform", "direct: points crowd at the poles"),
    ("cone-crowded", "Real x = u * extent;", "Real x = u * u * extent;", "sphere-light-near nee-cone",
     "directions crowd at the axis", "direct: the ball's middle counts more"),
    ("triangle-no-root", "Real root = real_sqrt(u);", "Real root = u;", "mesh-light nee", "no root",
     "direct: points crowd at a corner"),
    ("triangle-v", "*y = v * root - real(1 / 3.0);", "*y = v - real(1 / 3.0);", "mesh-light nee", "v for v root",
     "direct: points beside the triangle"),
])  # fmt: skip

CHOICE = of("emitters/choice.h", [
    ("alias-inverted", "v < gather(emitters->alias_p_stay, i)", "v > gather(emitters->alias_p_stay, i)", "many-lights nee",
     "the alias table read wrongly", "direct of each light x its own factor"),
    ("choice-unweighed", "*inverse_choice = gather(emitters->inverse_choice, i);", "", "occluded-lights nee",
     "not divided by p_i", "direct of light i x p_i"),
    ("choice-last-never", "real_floor(u * real(emitters->count))", "real_floor(u * real(emitters->count - 1))",
     "many-lights nee-uniform-choice", "the last light is never chosen", "last light's direct x 0, others x N/(N-1)"),
    ("choice-first-half", "real_floor(u * real(emitters->count))", "real_floor(u * real(0.5) * real(emitters->count))",
     "many-lights nee-uniform-choice", "the first half of the lights only", "first half of lights x 2, the others x 0"),
])  # fmt: skip

PREPARE = of("prepare/emitters.h", [
    ("weights-uniform", "(Num)(1 / power[i])", "(Num)emitters->count", "many-lights nee", "chosen by power, weighed by N",
     "direct of light i x N p_i"),
    ("area-quarter", "emitters->area[i] = (Num)side.area;", "emitters->area[i] = (Num)(side.area / 4);",
     "occluded-lights nee", "a quarter of each area", "direct x .25"),
    ("emission-red", "store(emitters->emission[i], traits.emission);",
     "for (int c = 0; c < 3; c++) emitters->emission[i][c] = (Num)traits.emission[0];", "many-lights nee",
     "NEE takes red for all channels", "direct: channels x r/g, r/b"),
    ("second-light-dim", "store(emitters->emission[i], traits.emission);",
     "for (int c = 0; c < 3; c++) emitters->emission[i][c] = (Num)(traits.emission[c] * (i == 1 ? 0.5 : 1));",
     "many-lights nee", "light 2 is half as bright in NEE", "light 2's direct x .5"),
    ("third-light-off", "store(emitters->emission[i], traits.emission);",
     "for (int c = 0; c < 3; c++) emitters->emission[i][c] = (Num)(traits.emission[c] * (i != 2));",
     "many-lights nee", "light 3 is off in NEE", "light 3's direct x 0"),
    ("lamp-seen-dim", "store(emitters->slot_emission[mesh ? row : slot], emitter_traits(light).emission);",
     "for (int c = 0; c < 3; c++) emitters->slot_emission[mesh ? row : slot][c] = (Num)(0.7 * "
     "emitter_traits(light).emission[c]);", "many-lights nee", "lamps met are .7 as bright", "emission x .7"),
    ("edge-half", "store(emitters->edge_x[i], side.x);",
     "for (int c = 0; c < 3; c++) emitters->edge_x[i][c] = (Num)(0.5 * side.x[c]);", "area-light nee",
     "points on half the width", "direct: from a narrower lamp"),
])  # fmt: skip

SHAPES = [
    *of("shapes/sphere.h", [
        ("ball-shrunk", "(Num)s->center[2]}, (Num)s->radius};", "(Num)s->center[2]}, (Num)(0.97 * s->radius)};",
         "spherical-light walk-cosine", "balls 3 % too small to rays", "other: a shape wrong"),
    ]),
    *of("shapes/disk.h", [
        ("disk-square", "*within = c.x * c.x + c.y * c.y <= c.den * c.den;",
         "*within = (real_abs(c.x) <= c.den) & (real_abs(c.y) <= c.den);", "lecture nee", "disks are squares",
         "other: a shape wrong"),
    ]),
    *of("shapes/rectangle.h", [
        ("rectangle-wide", "(real_abs(c.x) <= c.den)", "(real_abs(c.x) <= c.den * real(1.1))", "occluded-lights nee",
         "rectangles a tenth too wide", "other: shapes wrong"),
    ]),
]  # fmt: skip

LIGHT = of("estimators/light.h", [
    ("splat-no-cosine", "received(cosine, f) * eye.weight", "eye.weight", "area-light light",
     "light tracing: no cosine at the last vertex", "reflected x 1/cos to the eye"),
    ("splat-aside", "real_floor(y) * scene->width + real_floor(x);",
     "real_floor(y) * scene->width + real_floor(real_max(x - real(1), real(0)));", "cornell-box light",
     "splats one pixel to the left", "reflected light a pixel aside"),
    ("splat-unblocked", "comes_through(path, scene, &shadow, active, index_of(-1), &flux, f)", "active",
     "cornell-box light", "light tracing: the eye sees through", "reflected: what is hidden shows"),
])  # fmt: skip

RNG = of("lanes/rng.h", [
    ("dimensions-shared", "(Bits)(vertex * 2 + dimension)", "(Bits)(index_of(0) * vertex + dimension)", "cornell-box nee",
     "every vertex has the same numbers", "indirect: correlated bounces"),
    ("numbers-short", "real(0.5)) * real(1.0 / 4294967296.0)", "real(0.5)) * real(0.9 / 4294967296.0)", "area-light nee",
     "numbers in (0, .9)", "other: pixel, lamp and directions cut short"),
    ("few-rounds", "round < 7", "round < 2", "cornell-box nee", "two rounds of Philox", "other: correlated numbers"),
])  # fmt: skip

CHANGES: tuple[Change, ...] = (
    *DIFFUSE, *CONDUCTOR, *DIELECTRIC, *SCATTER, *PREPARE_MATERIALS, *NEE, *MIS, *EMISSION, *ROULETTE, *WALK, *PATH,
    *CAMERA, *PERSPECTIVE, *FILM, *TRACE, *POINTS, *SPOT, *SUN, *SKY, *AREA, *SAMPLES, *CHOICE, *PREPARE, *SHAPES, *LIGHT, *RNG,
)  # fmt: skip
