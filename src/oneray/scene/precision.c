/* --precision auto: single precision where it is certainly enough.

   A single number has a rounding error of u = 2⁻²⁴ of itself, so a point of a scene that reaches out to M is
   known to u M. What matters of it is its share of the smallest thing that the light depends on: the size of a
   shape, a gap between two, the height of a light over a plane, a pixel. Limits are set so that each share is
   below 1e-3, and its part in a pixel's value, where such errors are random and the share of the picture is
   small, below 1e-5. Surfaces closer than the rounding itself are in one place, and only where it does not matter
   which of them a ray meets (gaps.c). Anything unusual is left to double. */
#include "scene/precision.h"

#include "scene/gaps.h"

#include <stdarg.h>
#include <stdio.h>

#define SMALLEST_SIZE (1.0 / 1024) /* of M: half the side of a shape, the radius of a sphere */
#define SMALLEST_GAP (1.0 / 8192)  /* of M: between shapes, a light and a plane; how slim a mesh may be in the mean */
#define TOUCH (2.0 / (1 << 24))    /* of M: closer surfaces are in one place */
#define DIMMEST 1e-12
#define BRIGHTEST 1e12
#define RANGE 1e6                  /* of the brightest light over the dimmest */
#define DEEPEST 256                /* vertices beyond which less than a millionth of the light may come */
#define SMALLEST_PIXEL 1e-5        /* radians */
#define THINNEST 1e-9              /* optical thickness of the scene */
#define MOST_REPEATS 1000          /* of a texture over (u, v) from 0 to 1 */
#define WIDEST_IMAGE 4096

typedef struct {
    char *text;
    int size;
} Reason;

/* Notes why double is wanted. */
static bool because(Reason reason, const char *format, ...) PRINTF_LIKE(2, 3);
static bool because(Reason reason, const char *format, ...)
{
    va_list words;
    va_start(words, format);
    vsnprintf(reason.text, (size_t)reason.size, format, words);
    va_end(words);
    return true;
}

/* A light in a point that is not left out. */
static bool is_point(const Emitter *light) { return emitter_traits(light).position && emitter_has_power(light); }

/* M, the largest coordinate, and how far the scene extends along its longest axis. */
static double reach_of(const Description *d, double *extent)
{
    double low[3], high[3], reach;
    scene_bounds(d, low, high);
    *extent = fmax(high[0] - low[0], fmax(high[1] - low[1], high[2] - low[2]));
    SensorTraits eye = sensor_traits(&d->sensor);
    reach = fmax(extent_of(eye.origin) + eye.reach, fmax(extent_of(low), extent_of(high)));
    for (int i = 0; i < d->emitter_count; i++) {
        EmitterTraits traits = emitter_traits(&d->emitters[i]);
        if (is_point(&d->emitters[i]))
            reach = fmax(reach, extent_of(traits.position) + traits.radius);
    }
    return reach;
}

static bool odd_sensor(const Sensor *sensor, double reach, Reason reason)
{
    SensorTraits traits = sensor_traits(sensor);
    double pixel = fmax(traits.pixel, traits.side / reach);
    if (sensor->frame.width > WIDEST_IMAGE || sensor->frame.height > WIDEST_IMAGE)
        return because(reason, "an image of more than %d pixels a side", WIDEST_IMAGE);
    return pixel < SMALLEST_PIXEL && because(reason, "a pixel of %.1g radians", pixel);
}

/* Of the texture some is, where most is 1 and least is not: then it may be. */
static bool nearly_one(const Reflectance *r, int c)
{
    return (r->most[c] > 0.999 && r->most[c] < 1) || (r->least[c] > 0.999 && r->least[c] < 1);
}

/* L14, L15, L19 Materials: boundaries that hardly refract, surfaces that hardly absorb, long paths. */
static bool odd_material(const Description *d, Reason reason)
{
    double most = 0;
    for (int i = 0; i < d->material_count; i++) {
        const Material *m = &d->materials[i];
        MaterialTraits traits = material_traits(m);
        if (traits.odd)
            return because(reason, "line %d: %s", m->line, traits.odd);
        for (int c = 0; c < 3 && traits.reflected; c++) {
            double albedo = fmax(traits.reflected->most[c], traits.transmitted ? traits.transmitted->most[c] : 0);
            if (nearly_one(traits.reflected, c) || (traits.transmitted && nearly_one(traits.transmitted, c)))
                return because(reason, "line %d: a reflectance within 0.001 of 1", m->line);
            most = fmax(most, albedo);
        }
    }
    for (int i = 0; i < d->texture_count; i++) {
        const double(*to_uv)[4] = texture_traits(&d->textures[i]).to_uv->m;
        for (int k = 0; k < 8; k++)
            if (fabs(to_uv[k / 4][k % 4]) > MOST_REPEATS)
                return because(reason, "line %d: a texture that repeats more than %d times", d->textures[i].line, MOST_REPEATS);
    }
    return (d->max_depth < 0 || d->max_depth > DEEPEST) && cr_pow(most, DEEPEST) > 1e-5
           && because(reason, "paths of more than %d vertices, reflectance %.4g", DEEPEST, most);
}

/* M1 Media so dense that their vertices are close to each other, or so thin that paths go far out; those that hardly
   absorb. */
static bool odd_medium(const Description *d, double reach, Reason reason)
{
    for (int i = 0; d->passing && i < d->medium_count; i++) {
        const Homogeneous *m = &d->media[i].as.homogeneous;
        for (int c = 0; c < 3; c++) {
            if (m->sigma_t[c] > 0 && (m->sigma_t[c] * reach * SMALLEST_GAP > 1 || m->sigma_t[c] * reach < THINNEST))
                return because(reason, "line %d: a mean free path of %.1g in a scene of %.1g", d->media[i].line,
                    1 / m->sigma_t[c], reach);
            if (m->sigma_t[c] > 0 && m->albedo[c] > 0.999)
                return because(reason, "line %d: an albedo of %.9g", d->media[i].line, m->albedo[c]);
        }
    }
    return false;
}

/* What the light gives at the scene's own distance, of the order of a radiance. */
static double met_of(const Emitter *light, int channel, double reach)
{
    double emission = emitter_traits(light).emission[channel];
    return is_point(light) ? emission / (reach * reach) : emission;
}

static bool odd_range(const Description *d, double reach, Reason reason)
{
    double brightest = 0, dimmest = HUGE_VAL;
    for (int i = 0; i < d->emitter_count; i++) {
        double most = 0;
        for (int c = 0; c < 3; c++)
            most = fmax(most, met_of(&d->emitters[i], c, reach));
        brightest = fmax(brightest, most);
        dimmest = most > 0 ? fmin(dimmest, most) : dimmest;
    }
    return brightest > RANGE * dimmest
           && because(reason, "one light %.1g times as bright as another", brightest / dimmest);
}

static bool odd_light(const Description *d, double reach, Reason reason)
{
    for (int i = 0; i < d->emitter_count; i++) {
        const Emitter *light = &d->emitters[i];
        EmitterTraits traits = emitter_traits(light);
        for (int c = 0; c < 3; c++) {
            double met = met_of(light, c, reach);
            if (traits.emission[c] > 0 && (met < DIMMEST || met > BRIGHTEST))
                return because(reason, "line %d: a light of %.1g", light->line, traits.emission[c]);
        }
        if (traits.odd && emitter_has_power(light))
            return because(reason, "line %d: %s", light->line, traits.odd);
    }
    return false;
}

static bool odd_size(const Description *d, double reach, Reason reason)
{
    for (int i = 0; i < d->shape_count; i++) {
        int line = d->shapes[i].line;
        Extent size = shape_extent(&d->shapes[i]);
        if (size.least < SMALLEST_SIZE * reach)
            return because(reason, "line %d: a shape of %.1g in a scene of %.1g", line, size.least, reach);
        if (size.height < SMALLEST_GAP * reach)
            return because(reason, "line %d: triangles %.1g slim in a scene of %.1g", line, size.height, reach);
    }
    return false;
}

/* Lights in a point, or in a ball, close to a plane; of a mesh's triangles those count that are as large as they are
   far from it, and not beyond a twelfth of the scene, from where a light so low adds nothing that shows. */
static bool odd_height(const Description *d, double reach, double limit, Reason reason)
{
    for (int k = 0; k < d->emitter_count; k++) {
        const Emitter *light = &d->emitters[k];
        EmitterTraits traits = emitter_traits(light);
        int line = 0;
        for (int i = 0; i < d->shape_count && is_point(light) && !line; i++) {
            Side plane = shape_side(&d->shapes[i], 0);
            double up[3];
            difference(traits.position, plane.middle, up);
            if (shape_planes(d->shapes[i].kind) && fabs(dot(plane.normal, up)) < limit + traits.radius)
                line = d->shapes[i].line;
        }
        if (line || (is_point(light) && near_triangles(d, traits.position, limit + traits.radius, reach / 12, &line)))
            return because(reason, "line %d: a light in the plane of line %d", light->line, line);
    }
    return false;
}

static bool odd_gap(const Description *d, double reach, double limit, Reason reason)
{
    Gap gap = {.limit = limit, .touch = TOUCH * reach};
    if (!find_narrow_gap(d, &gap))
        return false;
    return gap.one ? because(reason, "a gap between the shapes of lines %d and %d", gap.one, gap.other)
                   : because(reason, "triangles that are close to thousands of others each");
}

static bool odd_reach(const Description *d, double reach, double extent, Reason reason)
{
    if (!(reach > 1e-6 && reach < 1e6))
        return because(reason, "a scene that reaches out to %.1g", reach);
    return d->shape_count && reach > 16 * extent
           && because(reason, "a scene of size %.1g at %.1g from the origin", extent, reach);
}

const char *precision_for(const Description *d, char *text, int size)
{
    Reason reason = {text, size};
    double extent = 0, reach = reach_of(d, &extent), gap = SMALLEST_GAP * reach;
    if (odd_sensor(&d->sensor, reach, reason) || odd_material(d, reason) || odd_reach(d, reach, extent, reason)
        || odd_medium(d, reach, reason)
        || odd_range(d, reach, reason) || odd_light(d, reach, reason) || odd_size(d, reach, reason)
        || odd_height(d, reach, gap, reason) || odd_gap(d, reach, gap, reason))
        return "double";
    because(reason, "no small size, narrow gap, long path or extreme light");
    return "single";
}

/* Beyond these a square overflows single floats, or underflows. */
#define SINGLE_LARGEST 1e15
#define SINGLE_BRIGHTEST 1e36

void refuse_beyond_single(const Description *d, const char *file)
{
    double extent = 0, reach = reach_of(d, &extent);
    if (!(reach <= SINGLE_LARGEST))
        die("%s: --precision single: the scene reaches out to %.1g, beyond %g (auto takes double)", file, reach,
            SINGLE_LARGEST);
    for (int i = 0; i < d->emitter_count; i++)
        for (int c = 0; c < 3; c++) {
            double emission = emitter_traits(&d->emitters[i]).emission[c];
            if (!(emission <= SINGLE_BRIGHTEST))
                fail(&d->emitters[i], "--precision single: a light of %.1g, beyond %g (auto takes double)",
                    emission, SINGLE_BRIGHTEST);
        }
}
