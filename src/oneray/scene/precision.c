/* --precision auto: single precision where it is certainly enough.

   A single number has a rounding error of u = 2⁻²⁴ of itself, so a point of a scene that reaches out to M is
   known to u M. What matters of it is its share of the smallest thing that the light depends on: the size of a
   shape, a gap between two, the height of a light over a plane, a pixel. Limits are set so that each share is
   below 1e-3, and its part in a pixel's value, where such errors are random and the share of the picture is
   small, below 1e-5. Anything unusual is left to double. */
#include "scene/precision.h"

#include "scene/bounds.h"
#include "message.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#define SMALLEST_SIZE (1.0 / 1024) /* of M: half the side of a shape, the radius of a sphere */
#define SMALLEST_GAP (1.0 / 8192)  /* of M: between shapes, a light and a plane; how slim a mesh may be in the mean */
#define DIMMEST 1e-12
#define BRIGHTEST 1e12
#define RANGE 1e6                  /* of the brightest light over the dimmest */
#define DEEPEST 256                /* vertices beyond which less than a millionth of the light may come */
#define SMALLEST_PIXEL 1e-5        /* radians */
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

static double largest(const double a[3]) { return fmax(fabs(a[0]), fmax(fabs(a[1]), fabs(a[2]))); }

/* A light in a point that is not left out. */
static bool is_point(const Emitter *light)
{
    return (light->kind == EMITTER_POINT || light->kind == EMITTER_SPOT) && emitter_has_power(light);
}

/* M, the largest coordinate, and how far the scene extends along its longest axis. */
static double reach_of(const Description *d, double *extent)
{
    double low[3], high[3], origin[3], reach = 0;
    bounds_of_scene(d, low, high);
    for (int axis = 0; axis < 3; axis++) {
        origin[axis] = d->sensor.to_world.m[axis][3];
        *extent = axis && *extent > high[axis] - low[axis] ? *extent : high[axis] - low[axis];
    }
    reach = fmax(largest(origin), fmax(largest(low), largest(high)));
    for (int i = 0; i < d->emitter_count; i++)
        if (is_point(&d->emitters[i]))
            reach = fmax(reach, largest(d->emitters[i].position));
    return reach;
}

static bool odd_sensor(const Sensor *sensor, Reason reason)
{
    if (sensor->width > WIDEST_IMAGE || sensor->height > WIDEST_IMAGE)
        return because(reason, "an image of more than %d pixels a side", WIDEST_IMAGE);
    double x = 2 * sensor->tan_half_x / sensor->width, y = 2 * sensor->tan_half_y / sensor->height;
    if (fmin(x, y) < SMALLEST_PIXEL)
        return because(reason, "a pixel of %.1g radians", fmin(x, y));
    return false;
}

/* L14, L15, L19 Materials: boundaries that hardly refract, surfaces that hardly absorb, long paths. */
static bool odd_material(const Description *d, Reason reason)
{
    double most = 0;
    for (int i = 0; i < d->material_count; i++) {
        const Material *m = &d->materials[i];
        if (m->kind == MATERIAL_DIELECTRIC && fabs(m->ior - 1) < 1e-3)
            return because(reason, "line %d: an index of refraction within 0.001 of 1", m->line);
        for (int c = 0; c < 3 && m->kind != MATERIAL_BLEND; c++) {
            double albedo = m->kind == MATERIAL_DIELECTRIC ? fmax(m->reflectance[c], m->transmittance[c])
                                                           : m->reflectance[c];
            if (albedo > 0.999 && albedo < 1)
                return because(reason, "line %d: a reflectance within 0.001 of 1", m->line);
            most = fmax(most, albedo);
        }
    }
    if ((d->max_depth < 0 || d->max_depth > DEEPEST) && pow(most, DEEPEST) > 1e-5)
        return because(reason, "paths of more than %d vertices, reflectance %.4g", DEEPEST, most);
    return false;
}

/* What the light gives at the scene's own distance, of the order of a radiance. */
static double met_of(const Emitter *light, int channel, double reach)
{
    return is_point(light) ? light->emission[channel] / (reach * reach) : light->emission[channel];
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
    return brightest > RANGE * dimmest && because(reason, "one light %.1g times as bright as another", brightest / dimmest);
}

static bool odd_light(const Emitter *light, double reach, Reason reason)
{
    for (int c = 0; c < 3; c++) {
        double met = met_of(light, c, reach);
        if (light->emission[c] > 0 && (met < DIMMEST || met > BRIGHTEST))
            return because(reason, "line %d: a light of %.1g", light->line, light->emission[c]);
    }
    if (light->kind == EMITTER_SPOT && emitter_has_power(light)) {
        double rim = light->cutoff_angle - light->beam_width;
        if (light->cutoff_angle < 1e-3 || rim < 1e-3 * light->cutoff_angle)
            return because(reason, "line %d: a spot with a cone or rim of less than 0.001", light->line);
    }
    return false;
}

static double length(const double a[3]) { return hypot(hypot(a[0], a[1]), a[2]); }

static void column(const Shape *shape, int j, double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = shape->to_world.m[i][j];
}

/* Twice a triangle's area, and its longest side: its least height is one over the other. */
static double triangle_area(const Mesh *mesh, int triangle, double *longest)
{
    const int32_t *corner = mesh->triangle[triangle];
    double a[3], b[3], c[3], across[3];
    for (int i = 0; i < 3; i++) {
        a[i] = mesh->vertex[corner[1]][i] - mesh->vertex[corner[0]][i];
        b[i] = mesh->vertex[corner[2]][i] - mesh->vertex[corner[0]][i];
        c[i] = b[i] - a[i];
    }
    for (int i = 0; i < 3; i++)
        across[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
    *longest = fmax(length(a), fmax(length(b), length(c)));
    return length(across);
}

/* How slim a mesh's triangles are: the mean of one over their height, by area, as errors are. A few slivers among
   many others, as at the poles of a ball, are a small share of any pixel. */
static double mean_height(const Description *d, const Shape *shape)
{
    double area = 0, sides = 0, longest;
    for (int k = 0; k < shape->triangle_count; k++) {
        area += triangle_area(&d->mesh, shape->first_triangle + k, &longest);
        sides += longest;
    }
    return sides > 0 ? area / sides : HUGE_VAL;
}

/* Sizes: half the sides of a shape; of a mesh those of its box, where it is not flat, and how slim its triangles are. */
static bool odd_size(const Description *d, const Shape *shape, double reach, Reason reason)
{
    double side[3], low[3], high[3], smallest = HUGE_VAL;
    bounds_of_shape(d, shape, low, high);
    for (int j = 0; j < (shape->kind == SHAPE_CUBE || shape->kind == SHAPE_MESH ? 3 : 2); j++) {
        column(shape, j, side);
        double half = shape->kind == SHAPE_MESH ? (high[j] - low[j]) / 2 : length(side);
        smallest = shape->kind == SHAPE_MESH && half == 0 ? smallest : fmin(smallest, half);
    }
    if (smallest < SMALLEST_SIZE * reach)
        return because(reason, "line %d: a shape of %.1g in a scene of %.1g", shape->line, smallest, reach);
    double height = mean_height(d, shape);
    if (height < SMALLEST_GAP * reach)
        return because(reason, "line %d: triangles %.1g slim in a scene of %.1g", shape->line, height, reach);
    return false;
}

typedef struct {
    double point[3], normal[3];
} Plane;

/* A shape as the search for gaps sees it: its box, and the planes of a rectangle, disk or cube. */
typedef struct {
    const Shape *shape;
    double low[3], high[3];
    int plane_count;
    Plane planes[6];
} Body;

static Body body_of(const Description *d, const Shape *shape)
{
    Body body = {.shape = shape};
    bounds_of_shape(d, shape, body.low, body.high);
    if (shape->kind == SHAPE_SPHERE || shape->kind == SHAPE_MESH)
        return body;
    body.plane_count = shape->kind == SHAPE_CUBE ? 6 : 1;
    for (int k = 0; k < body.plane_count; k++) {
        Plane *plane = &body.planes[k];
        int j = body.plane_count == 1 ? 2 : k / 2;
        double x[3], y[3], across[3], axis[3];
        column(shape, (j + 1) % 3, x);
        column(shape, (j + 2) % 3, y);
        column(shape, j, axis);
        for (int i = 0; i < 3; i++) {
            across[i] = x[(i + 1) % 3] * y[(i + 2) % 3] - x[(i + 2) % 3] * y[(i + 1) % 3];
            plane->point[i] = shape->to_world.m[i][3]
                              + (body.plane_count == 1 ? 0 : k % 2 ? -axis[i] : axis[i]);
        }
        for (int i = 0; i < 3; i++)
            plane->normal[i] = across[i] / length(across);
    }
    return body;
}

/* Along the plane's normal, from it to the point. */
static double height_over(const Plane *plane, const double p[3])
{
    double height = 0;
    for (int i = 0; i < 3; i++)
        height += plane->normal[i] * (p[i] - plane->point[i]);
    return height;
}

/* How far the point is beyond one of the three pairs of a cube's planes: no further than from the cube. */
static double height_over_cube(const Body *cube, const double p[3])
{
    double most = 0;
    for (int k = 0; k < 6; k += 2) {
        double one = height_over(&cube->planes[k], p), other = height_over(&cube->planes[k + 1], p);
        most = one * other > 0 ? fmax(most, fmin(fabs(one), fabs(other))) : most;
    }
    return most;
}

/* Do two planes nearly coincide? What does coincide is no gap. */
static bool nearly_coincide(const Plane *a, const Plane *b, double limit)
{
    double along = 0, height = fabs(height_over(a, b->point));
    for (int i = 0; i < 3; i++)
        along += a->normal[i] * b->normal[i];
    return fabs(along) > 0.999 && height > 0 && height < limit;
}

/* A sphere that shines may not come near anything, boxes may not nearly touch, planes not nearly coincide. */
static bool narrow(const Body *a, const Body *b, double limit)
{
    double center[3], gap = 0;
    for (int axis = 0; axis < 3; axis++)
        gap = fmax(gap, fmax(a->low[axis] - b->high[axis], b->low[axis] - a->high[axis]));
    if (gap > 0)
        return gap < limit;
    for (int side = 0; side < 2; side++) {
        const Body *ball = side ? b : a, *other = side ? a : b;
        if (ball->shape->kind != SHAPE_SPHERE || ball->shape->emitter < 0)
            continue;
        if (!other->plane_count)
            return true;
        column(ball->shape, 3, center);
        double radius = fabs(ball->shape->to_world.m[0][0]);
        double apart = other->plane_count == 6 ? height_over_cube(other, center) - radius
                                               : fabs(fabs(height_over(other->planes, center)) - radius);
        if (apart < 8 * limit)
            return true;
    }
    for (int i = 0; i < a->plane_count; i++)
        for (int k = 0; k < b->plane_count; k++)
            if (nearly_coincide(&a->planes[i], &b->planes[k], limit))
                return true;
    return false;
}

static int by_low(const void *a, const void *b)
{
    const Body *p = a, *q = b;
    return (p->low[0] > q->low[0]) - (p->low[0] < q->low[0]);
}

/* Gaps, by a sweep along x; and lights in a point close to a plane. */
static bool odd_gap(const Description *d, double reach, Reason reason)
{
    int count = d->shape_count;
    double limit = SMALLEST_GAP * reach;
    Body *bodies = allocate((size_t)count + 1, sizeof *bodies);
    bool found = false;
    for (int i = 0; i < count; i++)
        bodies[i] = body_of(d, &d->shapes[i]);
    for (int i = 0; i < count && !found; i++)
        for (int k = 0; k < d->emitter_count && bodies[i].plane_count && !found; k++) {
            const Emitter *light = &d->emitters[k];
            if (is_point(light)
                && fabs(height_over(bodies[i].planes, light->position)) < limit)
                found = because(reason, "line %d: a light in the plane of line %d", light->line,
                    bodies[i].shape->line);
        }
    qsort(bodies, (size_t)count, sizeof *bodies, by_low);
    for (int i = 0; i < count && !found; i++)
        for (int k = i + 1; k < count && bodies[k].low[0] <= bodies[i].high[0] + limit && !found; k++)
            if (narrow(&bodies[i], &bodies[k], limit)) {
                int one = bodies[i].shape->line, other = bodies[k].shape->line;
                found = because(reason, "a gap between the shapes of lines %d and %d", one < other ? one : other,
                    one < other ? other : one);
            }
    free(bodies);
    return found;
}

const char *precision_for(const Description *d, char *text, int size)
{
    Reason reason = {text, size};
    double extent = 0, reach = reach_of(d, &extent);
    if (odd_sensor(&d->sensor, reason) || odd_material(d, reason))
        return "double";
    if (!(reach > 1e-6 && reach < 1e6))
        return because(reason, "a scene that reaches out to %.1g", reach), "double";
    if (d->shape_count && reach > 16 * extent)
        return because(reason, "a scene of size %.1g at %.1g from the origin", extent, reach), "double";
    if (odd_range(d, reach, reason))
        return "double";
    for (int i = 0; i < d->emitter_count; i++)
        if (odd_light(&d->emitters[i], reach, reason))
            return "double";
    for (int i = 0; i < d->shape_count; i++)
        if (odd_size(d, &d->shapes[i], reach, reason))
            return "double";
    if (odd_gap(d, reach, reason))
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
        for (int c = 0; c < 3; c++)
            if (!(d->emitters[i].emission[c] <= SINGLE_BRIGHTEST))
                die_at(file, d->emitters[i].line, "--precision single: a light of %.1g, beyond %g (auto takes double)",
                    d->emitters[i].emission[c], SINGLE_BRIGHTEST);
}
