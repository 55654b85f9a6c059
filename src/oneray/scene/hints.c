#include "scene/hints.h"

#include <string.h>

/* The way from a point to a triangle of a mesh, which others of it may block. */
typedef struct {
    const Description *d;
    const MeshShape *mesh;
    double o[3], way[3];
    int triangle;
} Way;

static bool may_block(const void *query, const TreeBox *box)
{
    const Way *way = query;
    double enter = 0, leave = 1;
    for (int i = 0; i < 3; i++) {
        double one = (box->low[i] - way->o[i]) / way->way[i],
               other = (box->high[i] - way->o[i]) / way->way[i];
        enter = fmax(enter, fmin(one, other));
        leave = fmin(leave, fmax(one, other));
    }
    return enter <= leave;
}

/* Möller, Trumbore, Fast, Minimum Storage Ray/Triangle Intersection, JGT 2(1), 1997. */
static bool blocks(void *query, int t)
{
    const Way *way = query;
    double a[3], b[3], across[3], out[3], turned[3];
    if (t == way->triangle || t < way->mesh->first_triangle
        || t >= way->mesh->first_triangle + way->mesh->triangle_count)
        return false;
    triangle_edges(&way->d->mesh, t, 0, a, b, across);
    difference(way->o, way->d->mesh.vertex[way->d->mesh.triangle[t][0]], out);
    cross(way->way, out, turned);
    double whole = -dot(way->way, across), u = -dot(b, turned) / whole, v = dot(a, turned) / whole;
    double at = dot(out, across) / whole;
    return u >= 0 && v >= 0 && u + v <= 1 && at > 0 && at < 1 - 1e-6;
}

/* Does a part of the mesh show its front to the point? Front faces are looked at here and there, until one has none
   before it. */
static bool mesh_shows_front(const Description *d, const MeshShape *mesh, const double p[3])
{
    enum { STEP = 7919, LOOKS = 64 };
    int count = mesh->triangle_count, step = count % STEP ? STEP : 1;
    int64_t patience = INT64_MAX;
    for (int64_t k = 0, looks = 0; k < count && looks < LOOKS; k++) {
        int one = (int)(k * step % count);
        Side side = mesh_side(mesh, one);
        Way way = {.d = d, .mesh = mesh, .triangle = mesh->first_triangle + one};
        difference(side.middle, p, way.way);
        if (dot(side.normal, way.way) >= 0)
            continue;
        memcpy(way.o, p, sizeof way.o);
        looks++;
        if (!mesh_tree_visit(&d->mesh_tree, &patience, &way, may_block, &way, blocks))
            return true;
    }
    return false;
}

/* A cylinder shows its inside to what is within its wall's prolongation; to others its outside, and through its ends it may
   show the other. */
static bool cylinder_shows_front(const Shape *shape, const double p[3])
{
    Side side = shape_side(shape, 0);
    double to_p[3], across[3];
    difference(p, side.middle, to_p);
    cross(side.axis, to_p, across);
    return norm(across) >= norm(side.axis) * norm(side.x) || shape->as.placed.flip_normals;
}

/* A cube or a sphere shows its front outside, or inside if it is turned over. */
static bool shows_front(const Description *d, const Shape *shape, const double p[3])
{
    double to_p[3];
    bool inside = true;
    if (shape->kind == SHAPE_MESH)
        return mesh_shows_front(d, &shape->as.mesh, p);
    if (shape->kind == SHAPE_CYLINDER)
        return cylinder_shows_front(shape, p);
    for (int k = 0; k < shape_sides(shape); k++) {
        Side side = shape_side(shape, k);
        difference(p, side.middle, to_p);
        inside = inside && (shape_planes(shape->kind) ? dot(side.normal, to_p) < 0 : norm(to_p) < side.x[0]);
    }
    return inside == shape->as.placed.flip_normals;
}

/* May it be in view: does the ball around its box reach into the cone of what the camera sees? */
static bool may_be_seen(const Shape *shape, const SensorTraits *eye)
{
    Extent e = shape_extent(shape);
    double center[3], half[3];
    for (int i = 0; i < 3; i++) {
        half[i] = (e.high[i] - e.low[i]) / 2;
        center[i] = (e.high[i] + e.low[i]) / 2 - eye->origin[i];
    }
    double distance = norm(center), radius = norm(half) + eye->reach;
    if (distance <= radius)
        return true;
    return acos(fmax(-1, fmin(1, dot(center, eye->axis) / distance))) - asin(radius / distance)
           < acos(eye->cosine);
}

/* Of bodies and meshes: a single flat shape may well be there to show its back, as a screen does. */
static bool shows_back_alone(const Description *d, const Shape *shape, const SensorTraits *eye)
{
    bool one_sided = shape->front != MATERIAL_NONE && shape->back == MATERIAL_NONE && shape->emitter < 0;
    return one_sided && shape_planes(shape->kind) != 1 && may_be_seen(shape, eye)
           && !shows_front(d, shape, eye->origin);
}

bool scene_hints(const Description *d, const char *file)
{
    SensorTraits eye = sensor_traits(&d->sensor);
    bool hinted = !d->emitter_count;
    if (hinted)
        warn("%s: the scene has no light, the picture is black: an <emitter> is wanted", file);
    for (int i = 0; i < d->shape_count; i++) {
        if (!shows_back_alone(d, &d->shapes[i], &eye))
            continue;
        hinted = true;
        note(&d->shapes[i], "from the camera this shape shows its back alone, which is black: put its bsdf into "
             "<bsdf type=\"twosided\">, or set flip_normals");
    }
    return hinted;
}
