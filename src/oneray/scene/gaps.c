#include "scene/gaps.h"

#include "scene/facets.h"

#include <float.h>
#include <stdlib.h>
#include <string.h>

/* Two faces bound a gap where they lie over each other and are nearly parallel: at another angle the gap is narrow
   along a line only. It is one as well if it opens up to WIDE times the limit. */
#define PARALLEL 0.999
#define WIDE 40

/* Cuts off what of a polygon is nearer than `inset` to the outer side of the face's edge, or beyond. */
static int cut(const Facet *face, int edge, double inset, double p[][3], int count)
{
    double along[3], inwards[3], kept[MOST_CORNERS * 2][3], depth[MOST_CORNERS * 2], out[3];
    int n = 0;
    difference(face->corner[(edge + 1) % face->corners], face->corner[edge], along);
    cross(face->normal, along, inwards);
    inset *= norm(inwards);
    for (int c = 0; c < count; c++) {
        difference(p[c], face->corner[edge], out);
        depth[c] = dot(inwards, out) - inset;
    }
    for (int c = 0; c < count; c++) {
        int next = (c + 1) % count;
        if (depth[c] > 0)
            memcpy(kept[n++], p[c], sizeof *kept);
        if ((depth[c] > 0) != (depth[next] > 0)) {
            double share = depth[c] / (depth[c] - depth[next]);
            for (int i = 0; i < 3; i++)
                kept[n][i] = p[c][i] + share * (p[next][i] - p[c][i]);
            n++;
        }
    }
    memcpy(p, kept, (size_t)n * sizeof *kept);
    return n;
}

/* The least and the largest distance between two faces, seen along the first's normal, where they lie over each other
   by more than `inset`; the least is 0 where they cross. False: nowhere. */
static bool distance_between(const Facet *a, const Facet *b, double inset, double *least, double *most)
{
    double p[MOST_CORNERS * 2][3], low = HUGE_VAL, high = -HUGE_VAL;
    int count = b->corners;
    memcpy(p, b->corner, sizeof b->corner);
    for (int edge = 0; edge < a->corners && count; edge++)
        count = cut(a, edge, inset, p, count);
    for (int c = 0; c < count; c++) {
        low = fmin(low, height_over(a, p[c]));
        high = fmax(high, height_over(a, p[c]));
    }
    *least = fmax(fmax(low, -high), 0);
    *most = fmax(high, -low);
    return count > 0;
}

/* What the search knows of the scene. */
typedef struct {
    const Description *d;
    Gap *gap;
    double rounding; /* of doubles: what is closer is in one place */
    int64_t patience;
    int32_t *shape;  /* by triangle: the index of its shape */
    TreeBox all;     /* around shapes, camera and lights */
    bool far_light;
} Search;

static bool found(Search *s, const Shape *a, const Shape *b)
{
    s->gap->one = a->line < b->line ? a->line : b->line;
    s->gap->other = a->line < b->line ? b->line : a->line;
    return true;
}

/* ---- Does it matter which of two faces in one place a ray meets? */

static bool transmits(const Description *d, int material)
{
    if (material == MATERIAL_NONE)
        return false;
    const Material *m = &d->materials[material];
    if (m->kind == MATERIAL_BLEND)
        return transmits(d, m->as.blend.first) || transmits(d, m->as.blend.second);
    return material_traits(m).transmitted != NULL;
}

static bool opaque_and_dark(const Description *d, const Shape *shape)
{
    return shape->emitter < 0 && !transmits(d, shape->front) && !transmits(d, shape->back);
}

static TreeBox box_of(const Extent *e)
{
    return (TreeBox){{e->low[0], e->low[1], e->low[2]}, {e->high[0], e->high[1], e->high[2]}};
}

/* Can light be within it, or an eye? What else may be there is seen by neither. */
static bool is_empty(const Search *s, const Shape *solid)
{
    SensorTraits sensor = sensor_traits(&s->d->sensor);
    Extent e = shape_extent(solid), eye = ball_extent(sensor.origin, sensor.reach);
    TreeBox box = box_of(&e), other = box_of(&eye);
    bool empty = boxes_apart(&box, &other, 0);
    for (int i = 0; i < s->d->emitter_count && empty; i++) {
        const Emitter *light = &s->d->emitters[i];
        EmitterTraits traits = emitter_traits(light);
        if (light->shape < 0 && !traits.position)
            continue;
        Extent at = light->shape < 0 ? ball_extent(traits.position, traits.radius)
                                     : shape_extent(&s->d->shapes[light->shape]);
        other = box_of(&at);
        empty = boxes_apart(&box, &other, light->shape < 0 ? 0 : -s->gap->touch);
    }
    return empty;
}

/* How far the box reaches along n beyond p. */
static double beyond(const double low[3], const double high[3], const double n[3], const double p[3])
{
    double reach = 0;
    for (int i = 0; i < 3; i++)
        reach += n[i] * ((n[i] > 0 ? high[i] : low[i]) - p[i]);
    return reach;
}

static double shorter_side(const Facet *face)
{
    double one[3], next[3];
    difference(face->corner[1], face->corner[0], one);
    difference(face->corner[2], face->corner[1], next);
    return fmin(norm(one), norm(next));
}

/* Does nothing look at the face from the side that n points to? No camera and no light is there, and what else is
   there is so low, of a 32nd of the smaller face at most, that less than a thousandth of the light that came round
   the edge goes to it and back. */
static bool is_bottom(const Search *s, const Facet *a, const Facet *b, const double n[3])
{
    const double *p = a->corner[0];
    double deepest = beyond(s->all.low, s->all.high, n, p), touch = s->gap->touch;
    double size = fmin(shorter_side(a), shorter_side(b));
    if (deepest <= touch)
        return true;
    SensorTraits sensor = sensor_traits(&s->d->sensor);
    bool bottom = deepest <= size / 32 && !s->far_light
                  && beyond(sensor.origin, sensor.origin, n, p) + sensor.reach <= touch;
    for (int i = 0; i < s->d->emitter_count && bottom; i++) {
        const Emitter *light = &s->d->emitters[i];
        EmitterTraits traits = emitter_traits(light);
        Extent at = light->shape < 0 ? ball_extent(traits.position, traits.radius)
                                     : shape_extent(&s->d->shapes[light->shape]);
        bottom = beyond(at.low, at.high, n, p) <= touch;
    }
    return bottom;
}

/* Is this side of it within a solid that nothing can look out of? */
static bool is_inside(const Search *s, const Facet *face, const double n[3])
{
    const Shape *shape = &s->d->shapes[face->shape];
    return shape->kind == SHAPE_CUBE && dot(face->normal, n) < 0 && is_empty(s, shape);
}

/* Is the surface of both the same on this side, wherever on them it is? */
static bool same_surface(const Search *s, const Shape *a, int of_a, const Shape *b, int of_b)
{
    bool smooth =
        (a->kind == SHAPE_MESH && a->as.mesh.smooth) || (b->kind == SHAPE_MESH && b->as.mesh.smooth);
    return of_a == of_b && (of_a == MATERIAL_NONE || (!smooth && !material_wants_uv(s->d, of_a)));
}

static bool exchange_shows(const Search *s, const Facet *a, const Facet *b)
{
    const Shape *one = &s->d->shapes[a->shape], *other = &s->d->shapes[b->shape];
    if (!opaque_and_dark(s->d, one) || !opaque_and_dark(s->d, other))
        return true;
    bool same = dot(a->normal, b->normal) * a->front * b->front > 0;
    for (int side = -1; side <= 1; side += 2) {
        double to = side * a->front, n[3] = {to * a->normal[0], to * a->normal[1], to * a->normal[2]};
        int of_a = side > 0 ? one->front : one->back;
        int of_b = (side > 0) == same ? other->front : other->back;
        bool alike = same_surface(s, one, of_a, other, of_b) && (same || of_a == MATERIAL_NONE);
        if (!alike && !is_inside(s, a, n) && !is_inside(s, b, n) && !is_bottom(s, a, b, n))
            return true;
    }
    return false;
}

/* ---- Faces. */

static bool narrow_faces(const Search *s, const Facet *a, const Facet *b)
{
    const Gap *gap = s->gap;
    double least, most;
    if (fabs(dot(a->normal, b->normal)) <= PARALLEL || !distance_between(a, b, gap->touch, &least, &most))
        return false;
    if (least >= gap->limit || most > WIDE * gap->limit || most <= s->rounding)
        return false;
    return most > gap->touch || exchange_shows(s, a, b);
}

/* Asks the tree of triangles for those whose boxes are within `limit` of a box, and also of the plane of a face if
   that is not NULL; goes on until `use` returns true. */
typedef struct {
    const Description *d;
    TreeBox box;
    const Facet *face;
    double limit;
    void *to;
    bool (*use)(void *to, int triangle);
} Query;

static bool may_hold(const void *query, const TreeBox *box)
{
    const Query *q = query;
    double center[3], reach = q->limit;
    if (boxes_apart(box, &q->box, q->limit))
        return false;
    if (!q->face)
        return true;
    for (int i = 0; i < 3; i++) {
        center[i] = 0.5 * box->low[i] + 0.5 * box->high[i];
        reach += fabs(q->face->normal[i]) * (box->high[i] - center[i]);
    }
    return fabs(height_over(q->face, center)) <= reach;
}

static bool use_if_close(void *query, int t)
{
    const Query *q = query;
    TreeBox box = mesh_box(&q->d->mesh, t);
    return may_hold(q, &box) && q->use(q->to, t);
}

/* Yes, as well, where it ends early: then nobody knows. */
static bool ask(Query *q, int64_t *patience)
{
    return mesh_tree_visit(&q->d->mesh_tree, patience, q, may_hold, q, use_if_close) || *patience < 0;
}

typedef struct {
    Search *search;
    Facet *face;
    int triangle; /* that the face is, or -1 */
} FaceQuery;

static bool face_meets(void *to, int t)
{
    FaceQuery *q = to;
    double least, most;
    if (t == q->triangle)
        return false;
    Facet other = flat_triangle(&q->search->d->mesh, t);
    if (fabs(dot(other.normal, q->face->normal)) <= PARALLEL
        || !distance_between(q->face, &other, q->search->gap->touch, &least, &most))
        return false;
    const Shape *all = q->search->d->shapes;
    other.shape = q->search->shape[t];
    if (q->triangle >= 0)
        q->face->shape = q->search->shape[q->triangle];
    return narrow_faces(q->search, q->face, &other) && found(q->search, &all[q->face->shape], &all[other.shape]);
}

static bool face_near_triangles(Search *s, Facet *face, int triangle)
{
    FaceQuery to = {s, face, triangle};
    return ask(&(Query){s->d, box_around(face, 0), face, s->gap->limit, &to, face_meets}, &s->patience);
}

/* ---- Spheres. */

/* Triangles near a sphere: any at all, if it shines; else so many that they are more than where a ball touches a plane,
   which has an area of 2π r limit within the limit. */
typedef struct {
    Search *search;
    const Shape *ball;
    double area;
} BallQuery;

static double far_from(const double center[3], const TreeBox *box, bool nearest)
{
    double away[3];
    for (int i = 0; i < 3; i++) {
        double below = box->low[i] - center[i], above = center[i] - box->high[i];
        away[i] = nearest ? fmax(fmax(below, above), 0) : fmax(fabs(below), fabs(above));
    }
    return norm(away);
}

static bool ball_meets(void *to, int t)
{
    BallQuery *q = to;
    const Sphere *ball = &q->ball->as.sphere;
    double limit = q->search->gap->limit, least = HUGE_VAL, most = 0;
    TreeBox box = mesh_box(&q->search->d->mesh, t);
    bool shines = q->ball->emitter >= 0;
    if (far_from(ball->center, &box, true) > ball->radius + 8 * limit
        || far_from(ball->center, &box, false) < ball->radius - 8 * limit)
        return false;
    Facet face = flat_triangle(&q->search->d->mesh, t);
    if (fabs(height_over(&face, ball->center)) > ball->radius + 8 * limit)
        return false;
    for (int c = 0; c < 3; c++) {
        double out[3];
        difference(face.corner[c], ball->center, out);
        double gap = fabs(norm(out) - ball->radius);
        least = fmin(least, gap);
        most = fmax(most, gap);
    }
    double a[3], b[3], across[3];
    triangle_edges(&q->search->d->mesh, t, 0, a, b, across);
    if (least < limit && most < WIDE * limit)
        q->area += norm(across) / 2;
    bool shell = q->area > 3 * (2 * PI * ball->radius * limit);
    return (shines || shell) && found(q->search, q->ball, &q->search->d->shapes[q->search->shape[t]]);
}

static bool ball_near_triangles(Search *s, const Shape *ball)
{
    BallQuery to = {s, ball, 0};
    Extent e = shape_extent(ball);
    return ask(&(Query){s->d, box_of(&e), NULL, 8 * s->gap->limit, &to, ball_meets}, &s->patience);
}

/* Two spheres, one that shines near the other's surface, or one just within the other. */
static bool narrow_spheres(const Shape *one, const Shape *other, double limit, double rounding)
{
    const Sphere *a = &one->as.sphere, *b = &other->as.sphere;
    double between[3], within = fabs(a->radius - b->radius);
    difference(a->center, b->center, between);
    double distance = norm(between), least = fabs(distance - within), most = distance + within;
    if ((one->emitter >= 0 || other->emitter >= 0) && distance - a->radius - b->radius < 8 * limit
        && within - distance < 8 * limit)
        return true;
    return least < limit && most < WIDE * limit && most > rounding;
}

/* ---- Cylinders: whatever comes near the box of one that shines, and what of triangles and round shapes at all. */

static bool tube_meets(void *to, int t)
{
    BallQuery *q = to;
    return found(q->search, q->ball, &q->search->d->shapes[q->search->shape[t]]);
}

static bool tube_near_triangles(Search *s, const Shape *tube)
{
    BallQuery to = {s, tube, 0};
    Extent e = shape_extent(tube);
    return ask(&(Query){s->d, box_of(&e), NULL, s->gap->limit, &to, tube_meets}, &s->patience);
}

/* ---- Shapes: a sweep along x. */

/* A shape that is no mesh has faces, or is round. */
typedef struct {
    const Shape *shape;
    Extent box;
    Facet *faces;
    int count;
} Body;

/* Is it a sphere that shines, and near the other? Of a solid's planes it is from the farthest that it is below. */
static bool shines_near(const Body *ball, const Body *other, double limit)
{
    const Sphere *sphere = &ball->shape->as.sphere;
    double height = 0;
    if (ball->shape->kind != SHAPE_SPHERE || ball->shape->emitter < 0 || !other->count)
        return false;
    if (other->count == 1)
        return fabs(fabs(height_over(other->faces, sphere->center)) - sphere->radius) < 8 * limit;
    for (int k = 0; k < other->count; k++)
        height = fmax(height, height_over(&other->faces[k], sphere->center));
    return height - sphere->radius < 8 * limit;
}

static bool narrow(const Search *s, const Body *a, const Body *b)
{
    double gap = 0, limit = s->gap->limit;
    for (int axis = 0; axis < 3; axis++)
        gap = fmax(gap, fmax(a->box.low[axis] - b->box.high[axis], b->box.low[axis] - a->box.high[axis]));
    bool in_one_place =
        gap <= s->gap->touch && opaque_and_dark(s->d, a->shape) && opaque_and_dark(s->d, b->shape);
    if (gap > 0 && !in_one_place)
        return gap < limit;
    bool close = shines_near(a, b, limit) || shines_near(b, a, limit);
    if (a->shape->kind == SHAPE_SPHERE && b->shape->kind == SHAPE_SPHERE)
        close = narrow_spheres(a->shape, b->shape, limit, s->rounding);
    else if (a->shape->kind == SHAPE_CYLINDER || b->shape->kind == SHAPE_CYLINDER)
        close = (!a->count && !b->count) || a->shape->emitter >= 0 || b->shape->emitter >= 0;
    for (int i = 0; i < a->count; i++)
        for (int k = 0; k < b->count; k++)
            close = close || narrow_faces(s, &a->faces[i], &b->faces[k]);
    return close;
}

static int by_low(const void *a, const void *b)
{
    double p = ((const Body *)a)->box.low[0], q = ((const Body *)b)->box.low[0];
    return (p > q) - (p < q);
}

static bool narrow_among(Search *s, Body *bodies, int count)
{
    qsort(bodies, (size_t)count, sizeof *bodies, by_low);
    for (int i = 0; i < count; i++)
        for (int k = i + 1; k < count && bodies[k].box.low[0] <= bodies[i].box.high[0] + s->gap->limit; k++)
            if (narrow(s, &bodies[i], &bodies[k]))
                return found(s, bodies[i].shape, bodies[k].shape);
    return false;
}

static bool narrow_at_triangles(Search *s, Body *body)
{
    for (int k = 0; k < body->count; k++)
        if (face_near_triangles(s, &body->faces[k], -1))
            return true;
    return (body->shape->kind == SHAPE_SPHERE && ball_near_triangles(s, body->shape))
           || (body->shape->kind == SHAPE_CYLINDER && tube_near_triangles(s, body->shape));
}

static bool narrow_between_shapes(Search *s)
{
    const Description *d = s->d;
    int faces = 0, used = 0, count = d->shape_count;
    for (int i = 0; i < count; i++)
        faces += shape_planes(d->shapes[i].kind);
    Body *bodies = allocate((size_t)count, sizeof *bodies);
    Facet *all = allocate((size_t)faces, sizeof *all);
    for (int i = 0; i < count; i++) {
        const Shape *shape = &d->shapes[i];
        bodies[i] = (Body){shape, shape_extent(shape), all + used, shape_planes(shape->kind)};
        for (int k = 0; k < bodies[i].count; k++)
            all[used++] = facet_of(d, i, k);
    }
    bool close = narrow_among(s, bodies, count);
    for (int i = 0; i < count && !close; i++)
        close = narrow_at_triangles(s, &bodies[i]);
    free(bodies);
    free(all);
    return close;
}

/* ---- Triangles. */

/* Area, m², and the part of the view that a triangle may fill, about. */
static void size_of_triangle(const Description *d, const SensorTraits *eye, int t, double *area, double *view)
{
    double a[3], b[3], across[3], out[3];
    triangle_edges(&d->mesh, t, 0, a, b, across);
    difference(d->mesh.vertex[d->mesh.triangle[t][0]], eye->origin, out);
    double square = dot(out, out), along = dot(out, eye->axis) + fmax(norm(a), norm(b));
    *area = sqrt(dot(across, across)) / 2;
    *view = along > 0 && (eye->reach > 0 || along * along >= eye->cosine * eye->cosine * square) ? *area / (square + *area) : 0;
}

static bool narrow_between_triangles(Search *s)
{
    const Description *d = s->d;
    int count = d->mesh.triangle_count;
    double area, view, areas = DBL_MIN, views = DBL_MIN, due = 0;
    SensorTraits eye = sensor_traits(&d->sensor);
    for (int t = 0; t < count && count > GAP_SAMPLES; t++) {
        size_of_triangle(d, &eye, t, &area, &view);
        areas += area;
        views += view;
    }
    for (int t = 0; t < count; t++) {
        if (count > GAP_SAMPLES) {
            size_of_triangle(d, &eye, t, &area, &view);
            due += (area / areas + view / views) * (double)GAP_SAMPLES / 2;
            if (due < 1)
                continue;
            due = fmod(due, 1);
        }
        Facet face = flat_triangle(&d->mesh, t);
        if (face_near_triangles(s, &face, t))
            return true;
    }
    return false;
}

bool find_narrow_gap(const Description *d, Gap *gap)
{
    Search s = {.d = d, .gap = gap, .patience = mesh_tree_patience(&d->mesh_tree)};
    SensorTraits sensor = sensor_traits(&d->sensor);
    scene_bounds(d, s.all.low, s.all.high);
    for (int i = -1; i < d->emitter_count; i++) {
        EmitterTraits traits =
            i < 0 ? (EmitterTraits){.position = sensor.origin, .radius = sensor.reach} : emitter_traits(&d->emitters[i]);
        if (i >= 0)
            s.far_light |= traits.from == FROM_AFAR || traits.from == FROM_AROUND;
        if (!traits.position)
            continue;
        Extent at = ball_extent(traits.position, traits.radius);
        for (int axis = 0; axis < 3; axis++) {
            s.all.low[axis] = fmin(s.all.low[axis], at.low[axis]);
            s.all.high[axis] = fmax(s.all.high[axis], at.high[axis]);
        }
    }
    s.rounding = 32 * DBL_EPSILON * fmax(extent_of(s.all.low), extent_of(s.all.high));
    s.shape = allocate((size_t)d->mesh.triangle_count, sizeof *s.shape);
    for (int i = 0; i < d->shape_count; i++)
        for (int k = 0; d->shapes[i].kind == SHAPE_MESH && k < d->shapes[i].as.mesh.triangle_count; k++)
            s.shape[d->shapes[i].as.mesh.first_triangle + k] = i;
    bool close = narrow_between_shapes(&s) || narrow_between_triangles(&s);
    free(s.shape);
    return close;
}

/* ---- Points. */

typedef struct {
    const Description *d;
    const double *p;
    double limit;
    int triangle;
} PointQuery;

static bool point_meets(void *to, int t)
{
    PointQuery *q = to;
    Facet face = flat_triangle(&q->d->mesh, t);
    TreeBox box = mesh_box(&q->d->mesh, t);
    double edge[3], size = 0;
    for (int c = 0; c < 3; c++) {
        difference(face.corner[(c + 1) % 3], face.corner[c], edge);
        size = fmax(size, norm(edge));
    }
    q->triangle = t;
    return fabs(height_over(&face, q->p)) < q->limit && far_from(q->p, &box, true) < fmax(size, q->limit);
}

bool near_triangles(const Description *d, const double p[3], double limit, double reach, int *line)
{
    PointQuery to = {d, p, limit, -1};
    Query query = {d, {{p[0], p[1], p[2]}, {p[0], p[1], p[2]}}, NULL, reach, &to, point_meets};
    int64_t patience = INT64_MAX;
    bool close = ask(&query, &patience);
    for (int i = 0; i < d->shape_count && close; i++)
        if (d->shapes[i].kind == SHAPE_MESH && d->shapes[i].as.mesh.first_triangle <= to.triangle)
            *line = d->shapes[i].line;
    return close;
}
