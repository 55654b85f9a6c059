/* Triangle meshes. */
#pragma once

#include "meshes/mesh.h"
#include "shapes/placed.h"

#include <stdlib.h>

/* Once it is checked, its triangles are among those of the scene, and the fields are done with. */
typedef struct mesh {
    Placed placed;
    bool face_normals, flip_tex_coords;
    int shape_index;
    File filename;
    const Mesh *all;
    int first_triangle, triangle_count;
    bool smooth; /* it has vertex normals */
    int without_uv; /* vertices without texture coordinates, though others have some: an error where they are wanted */
    Extent extent;
} MeshShape;

static inline Side mesh_side(const MeshShape *s, int k)
{
    Side side;
    const double *corner = s->all->vertex[s->all->triangle[s->first_triangle + k][0]];
    triangle_edges(s->all, s->first_triangle + k, 0, side.x, side.y, side.normal);
    side.across = length(side.normal);
    side.area = side.across / 2;
    for (int i = 0; i < 3; i++) {
        side.middle[i] = corner[i] + (side.x[i] + side.y[i]) / 3;
        side.normal[i] = side.across > 0 ? side.normal[i] / side.across : 0;
    }
    return side;
}

/* Half the sides of its box, where it is not flat. A triangle's least height is twice its area over its longest side;
   their mean is by area, as errors are: a few slivers among many others, as at the poles of a ball, are a small share
   of any pixel. */
static inline Extent mesh_measure(const MeshShape *s)
{
    Extent e = {{HUGE_VAL, HUGE_VAL, HUGE_VAL}, {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL}, HUGE_VAL, HUGE_VAL};
    double a[3], b[3], third[3], normal[3], across = 0, longest = 0;
    for (int k = 0; k < s->triangle_count; k++) {
        triangle_edges(s->all, s->first_triangle + k, 0, a, b, normal);
        difference(b, a, third);
        across += norm(normal);
        longest += fmax(norm(a), fmax(norm(b), norm(third)));
        for (int c = 0; c < 9; c++) {
            double x = s->all->vertex[s->all->triangle[s->first_triangle + k][c / 3]][c % 3];
            e.low[c % 3] = fmin(e.low[c % 3], x);
            e.high[c % 3] = fmax(e.high[c % 3], x);
        }
    }
    for (int i = 0; i < 3; i++)
        if (e.high[i] > e.low[i])
            e.least = fmin(e.least, (e.high[i] - e.low[i]) / 2);
    if (longest > 0)
        e.height = across / longest;
    return e;
}
static inline Extent mesh_extent(const MeshShape *s) { return s->extent; }

static inline void mesh_check(void *plugin, Said *said)
{
    MeshShape *s = plugin;
    const char *file = s->filename.name, *bytes = s->filename.bytes;
    Mesh mesh = {0}, *all = said->triangles;
    Source source = {file, bytes, bytes + s->filename.size, 1};
    bool is_obj = strcmp(said->type, "obj") == 0, is_serialized = strcmp(said->type, "serialized") == 0;
    const char *of_others = is_serialized ? "flip_tex_coords" : "shape_index";
    if (given(said, of_others))
        fail(given(said, of_others), "<shape type=\"%s\"> has no property \"%s\"", said->type, of_others);
    if (is_serialized)
        serialized_read(&source, s->shape_index, &mesh);
    else if (is_obj)
        obj_read(&source, &mesh);
    else
        ply_read(&source, &mesh);
    free(s->filename.bytes);
    s->filename.bytes = NULL;
    if (!mesh.triangle_count)
        die_at(file, 1, "the mesh has no faces");
    if (!mesh_finish(&mesh, file, &s->placed.to_world, s->placed.flip_normals, s->face_normals)) {
        said->left_out = "none of this mesh's triangles has an area: it is left out";
        mesh_free(&mesh);
        return;
    }
    if (all->triangle_count > MESH_MOST - mesh.triangle_count || all->vertex_count > MESH_MOST - mesh.vertex_count)
        fail(said, "the scene's meshes have more than %d triangles or vertices", MESH_MOST);
    s->all = all;
    s->first_triangle = all->triangle_count;
    s->triangle_count = mesh.triangle_count;
    s->smooth = mesh.normal != NULL;
    bool flip = given(said, "flip_tex_coords") ? s->flip_tex_coords : is_obj;
    for (int v = 0; mesh.uv && v < mesh.vertex_count; v++) {
        s->without_uv += isnan(mesh.uv[v][0]) || isnan(mesh.uv[v][1]);
        mesh.uv[v][1] = flip ? 1 - mesh.uv[v][1] : mesh.uv[v][1];
    }
    mesh_append(all, &mesh);
    s->extent = mesh_measure(s);
}
static const Plugin mesh_plugin = {"ply, obj, serialized", mesh_check, {
    {"filename", AS_FILE, offsetof(MeshShape, filename), NULL, NULL},
    PLACED_FIELDS,
    {"face_normals", AS_BOOLEAN, offsetof(MeshShape, face_normals), NULL, "false"},
    {"flip_tex_coords", AS_BOOLEAN, offsetof(MeshShape, flip_tex_coords), NULL, ""}, /* else an OBJ's are */
    {"shape_index", AS_INTEGER, offsetof(MeshShape, shape_index), "[0,2147483647]", "0"}}};

enum { mesh_planes = 0 };

/* What a ray meets among the triangles. */
#ifdef LANES

#include "shapes/frame.h"
#include "shapes/stack.h"
#include "trees/tree.h"

/* Up to eight triangles side by side. Of the places left empty all corners are one point, which no ray
   meets. */
typedef struct {
    Num corner[3][3][8]; /* [corner][axis] */
    int32_t slot[8];
} TriangleLeaf;

/* What TrianglePlane and TriangleScale have, and the vertices' normals. */
typedef struct {
    Num corner[3], face[3], a[3], b[3], normal[3][3], scale, whole, unused;
} TriangleRow;

typedef struct {
    Tree tree;
    TriangleLeaf *leaves;
    const struct few_triangles *few; /* that do not need the tree (few.h), or NULL … */
    const TriangleRow *rows;         /* … and by triangle what is computed of it once for all */
    const int32_t (*corner)[3]; /* by triangle: its vertices, counter-clockwise around the normal */
    const int32_t *row;         /* by triangle: its mesh's row in the tables by slot */
    const Num (*vertex)[3], (*normal)[3];
    const float (*uv)[2];       /* as Mesh has it */
    const int32_t *turned;
    int first_slot;             /* triangle i has the slot first_slot + i */
} Triangles;

/* Which of the leaf's triangles the ray's line meets at t > least, and where: the edge functions of the triangle
   sheared along the ray, which are products of the same rounded numbers on both sides of an edge, so that a
   line can slip through neither edge nor corner. 0 counts as inside. Woop, Benthin, Wald, Watertight
   Ray/Triangle Intersection, JCGT 2(1), 2013. */
INLINE unsigned leaf_meets(const TriangleLeaf *leaf, const Beams *beams, int lane, Num least_t, Num t[8])
{
    const Int x_axis = beams->axis[0][lane], y_axis = beams->axis[1][lane], z_axis = beams->axis[2][lane];
    unsigned bits = 0;
    for (int part = 0; part < 8; part += PIECE) {
        Piece x[3], y[3], z[3], zero = {0};
        UNROLLED for (int c = 0; c < 3; c++) {
            memcpy(&x[c], leaf->corner[c][x_axis] + part, sizeof x[c]);
            memcpy(&y[c], leaf->corner[c][y_axis] + part, sizeof y[c]);
            memcpy(&z[c], leaf->corner[c][z_axis] + part, sizeof z[c]);
            z[c] = z[c] - PIECE_OF(beams->o[2][lane]);
            x[c] = (x[c] - PIECE_OF(beams->o[0][lane])) - PIECE_OF(beams->shear[0][lane]) * z[c];
            y[c] = (y[c] - PIECE_OF(beams->o[1][lane])) - PIECE_OF(beams->shear[1][lane]) * z[c];
        }
        Piece u = x[2] * y[1] - y[2] * x[1], v = x[0] * y[2] - y[0] * x[2], w = x[1] * y[0] - y[1] * x[0];
        Piece least = PIECE_MIN(PIECE_MIN(u, v), w), most = PIECE_MAX(PIECE_MAX(u, v), w);
        PieceMask inside = (least >= zero) | (most <= zero);
        if (!piece_bits(&inside))
            continue;
        Piece sum = u + v + w, at = (u * z[0] + v * z[1] + w * z[2]) * PIECE_OF(beams->shear[2][lane]) / sum;
        inside &= (sum != zero) & (at > PIECE_OF(least_t));
        memcpy(t + part, &at, sizeof at);
        bits |= piece_bits(&inside) << part;
    }
    return bits;
}

/* What rays want to know: the nearest before t, or as near and of a lower slot; or whether any is before t. */
typedef struct {
    const Beams *beams;
    const Vec *d;
    Index from, target; /* slots, or -1: where the rays start and end, as *start and *end; with stacks the places of these */
    const Index *start, *end;
    const Int *shines; /* by row, what the rays of `hidden` pass by */
    unsigned hidden;
    const StackTables *stacks; /* HAS_STACKS, else NULL */
    Real t;
    Index slot;
    unsigned blocked; /* a bit a lane */
} Wanted;

INLINE StackedRay stacked_ray(const Wanted *w, int lane)
{
    (void)lane;
    return (StackedRay){w->stacks, {LANE(w->d->x, lane), LANE(w->d->y, lane), LANE(w->d->z, lane)},
        LANE(*w->start, lane), LANE(*w->end, lane)};
}

/* What a triangle is compared with w->from and w->target by. */
INLINE Int place_of(const Wanted *w, Int slot) { return w->stacks ? w->stacks->of[slot] : slot; }

/* IN_ORDER: is the triangle `here` met, and before the nearest so far? *at becomes 0 where the ray starts in its stack. */
INLINE int stacked_nearer(const StackedRay *ray, Int here, Num *at, Num t, Int slot)
{
    if (in_one_stack(ray->stacks, ray->start, here)) {
        *at = 0;
        if (!slot_before(ray, ray->start, here))
            return 0;
    } else if (!(*at > 0)) {
        return 0;
    }
    if (in_one_stack(ray->stacks, here, slot))
        return slot_before(ray, here, slot);
    return *at < t || (*at == t && here < slot);
}

/* IN_ORDER: is the triangle `here` between the ray's ends? */
INLINE int stacked_between(const StackedRay *ray, Int here, Num at, Num t)
{
    int from_start = in_one_stack(ray->stacks, ray->start, here);
    int to_end = in_one_stack(ray->stacks, here, ray->end);
    return (from_start ? slot_before(ray, ray->start, here) : at > 0)
           && (to_end ? slot_before(ray, here, ray->end) : at < t || from_start);
}

/* How triangles are told from where the ray starts and ends: by their slots, by their places, or by the order of
   layers. By places is the faster way, and meets the same as the order does
   - if nothing overlaps the start behind it, nor the end before it, and they are not in one stack: in their stacks the
     order lets nothing be met but what is so there;
   - if nothing overlaps what is met before it. In its stack the order lets it be met before all that the ray meets, and
     before all others it is by its distance, whichever is looked at first.
   What overlaps is known but for slivers of 1e-6 of a surface's width at its edges (facets.h). There the other way may
   be taken than elsewhere, but never another from q to p than from p to q. */
enum { BY_SLOTS, BY_PLACES, IN_ORDER };

/* Below `root`: the nearest of each of these lanes, or L3 is anything in the way. */
INLINE void triangles_walk(
    const Triangles *triangles, unsigned lanes, int32_t root, int nearest, int way, Wanted *w)
{
    Ways ways;
    start_below(&ways, lanes, root);
    while (ways.inner | ways.leaves) {
        unsigned leaves = step(triangles->tree.nodes, w->beams, &w->t, nearest, &ways);
        for (; leaves; leaves &= leaves - 1) {
            int lane = lowest_lane(leaves);
            const TriangleLeaf *leaf = &triangles->leaves[-2 - ways.at[lane]];
            StackedRay ray;
            if (way == IN_ORDER)
                ray = stacked_ray(w, lane);
            Num at[8], t = LANE(w->t, lane);
            Int slot = LANE(w->slot, lane), from = LANE(w->from, lane);
            for (unsigned met = leaf_meets(leaf, w->beams, lane, way == IN_ORDER ? -NUM_MAX : 0, at); met;
                met &= met - 1) {
                int k = lowest_lane(met), here = leaf->slot[k];
                Int place = way == BY_PLACES ? w->stacks->of[here] : here;
                if (!nearest) {
                    if (way == IN_ORDER ? stacked_between(&ray, here, at[k], t)
                                        : at[k] < t && place != from && place != LANE(w->target, lane))
                        w->blocked |= 1u << lane;
                    continue;
                }
                if (way == IN_ORDER ? !stacked_nearer(&ray, here, &at[k], t, slot)
                                    : place == from || !(at[k] < t || (at[k] == t && here < slot)))
                    continue;
                if (w->hidden >> lane & 1 && w->shines[triangles->row[here - triangles->first_slot]])
                    continue;
                LANE(w->t, lane) = t = at[k];
                LANE(w->slot, lane) = slot = here;
            }
            if (nearest || !(w->blocked >> lane & 1))
                to_next(&ways, lane, LIMIT(t), nearest);
        }
    }
}

APART void triangles_nearest_by_slots(const Triangles *triangles, unsigned lanes, int32_t root, Wanted *w)
{
    triangles_walk(triangles, lanes, root, 1, BY_SLOTS, w);
}
APART void triangles_block_by_slots(const Triangles *triangles, unsigned lanes, int32_t root, Wanted *w)
{
    triangles_walk(triangles, lanes, root, 0, BY_SLOTS, w);
}
APART void triangles_by_places(const Triangles *triangles, unsigned lanes, int32_t root, int nearest, Wanted *w)
{
    triangles_walk(triangles, lanes, root, nearest, BY_PLACES, w);
}
APART void triangles_in_order(const Triangles *triangles, unsigned lanes, int nearest, Wanted *w)
{
    triangles_walk(triangles, lanes, 0, nearest, IN_ORDER, w);
}

INLINE void triangles_nearest(const Triangles *triangles, unsigned lanes, int32_t root, Wanted *w)
{
    if (w->stacks)
        triangles_by_places(triangles, lanes, root, 1, w);
    else
        triangles_nearest_by_slots(triangles, lanes, root, w);
}
INLINE void triangles_block(const Triangles *triangles, unsigned lanes, int32_t root, Wanted *w)
{
    if (w->stacks)
        triangles_by_places(triangles, lanes, root, 0, w);
    else
        triangles_block_by_slots(triangles, lanes, root, w);
}

/* The least and largest coordinates of each triangle's corners along an axis, less the tree's center. */
INLINE void corner_range(const TriangleLeaf *leaf, int axis, Num center, float low[8], float high[8])
{
    for (int part = 0; part < 8; part += PIECE) {
        Piece corner[3];
        UNROLLED for (int c = 0; c < 3; c++)
            memcpy(&corner[c], leaf->corner[c][axis] + part, sizeof corner[c]);
        Piece least = PIECE_MIN(PIECE_MIN(corner[0], corner[1]), corner[2]) - PIECE_OF(center);
        Piece most = PIECE_MAX(PIECE_MAX(corner[0], corner[1]), corner[2]) - PIECE_OF(center);
        for (int k = 0; k < PIECE; k++)
            low[part + k] = (float)least[k], high[part + k] = (float)most[k];
    }
}

INLINE Real largest(Vec a) { return real_max(real_max(real_abs(a.x), real_abs(a.y)), real_abs(a.z)); }

/* The unit normal of the edges a, b from one corner, whatever their lengths: no square underflows. */
INLINE Vec normal_of_edges(Vec a, Vec b)
{
    Vec across = vec_cross(vec_scale(a, real(1) / largest(a)), vec_scale(b, real(1) / largest(b)));
    return vec_normalize(vec_scale(across, real(1) / largest(across)));
}

INLINE Index gather_int32(const int32_t *table, Index i)
{
    Index a = index_of(0);
    for (int lane = 0; lane < LANES; lane++)
        LANE(a, lane) = table[LANE(i, lane)];
    return a;
}

/* A triangle, from a corner. */
typedef struct {
    Vec corner, a, b, face; /* the edges a, b from it; the unit normal */
} TrianglePlane;

INLINE TrianglePlane triangle_plane(const Vec vertex[3])
{
    Vec a = vec_sub(vertex[1], vertex[0]), b = vec_sub(vertex[2], vertex[0]);
    return (TrianglePlane){vertex[0], a, b, normal_of_edges(a, b)};
}

/* Edges by their larger length, and one over the area. */
typedef struct {
    Vec a, b;
    Real scale, whole;
} TriangleScale;

INLINE TriangleScale triangle_scale(const TrianglePlane *plane)
{
    Real scale = real(1) / real_max(largest(plane->a), largest(plane->b));
    Vec a = vec_scale(plane->a, scale), b = vec_scale(plane->b, scale);
    return (TriangleScale){a, b, scale, real(1) / vec_dot(plane->face, vec_cross(a, b))};
}

/* Barycentric coordinates of a point of the plane, seen from the corner. */
INLINE void barycentric(const TriangleScale *edges, Vec face, Vec at, Real share[3])
{
    at = vec_scale(at, edges->scale);
    share[1] = vec_dot(face, vec_cross(at, edges->b)) * edges->whole;
    share[2] = vec_dot(face, vec_cross(edges->a, at)) * edges->whole;
    share[0] = real(1) - share[1] - share[2];
}

INLINE void corners_of(const Triangles *triangles, Index i, Index corner[3], Vec vertex[3])
{
    for (int c = 0; c < 3; c++) {
        corner[c] = gather_int32(&triangles->corner[0][c], i * 3);
        vertex[c] = vec_gather(triangles->vertex, corner[c]);
    }
}

#define ROW_VEC(row, member)                                                                                 \
    vec((row)[IN_ROW(TriangleRow, member)], (row)[IN_ROW(TriangleRow, member) + 1], (row)[IN_ROW(TriangleRow, member) + 2])

/* Puts p onto the triangle's plane. Gives the normal of the plane, and the interpolated one that light is
   reflected by: Mitsuba's, the mean of the vertices' by barycentric coordinates. */
STAGE void triangle_surface(const Triangles *triangles, Index i, int smooth, Vec *p, Vec *n, Vec *face)
{
    enum { SIZE = sizeof(TriangleRow) / sizeof(Num) };
    Index corner[3];
    Vec vertex[3], normal[3];
    TrianglePlane plane;
    TriangleScale edges;
    Real row[SIZE], share[3];
    if (triangles->rows) {
        gather_row(triangles->rows, i, SIZE, row);
        plane.corner = ROW_VEC(row, corner);
        plane.face = ROW_VEC(row, face);
    } else {
        corners_of(triangles, i, corner, vertex);
        plane = triangle_plane(vertex);
    }
    *n = *face = plane.face;
    Vec at = vec_sub(*p, plane.corner);
    Vec off_plane = vec_scale(*face, vec_dot(*face, at));
    *p = vec_sub(*p, off_plane);
    if (!smooth)
        return;
    if (triangles->rows) {
        edges = (TriangleScale){ROW_VEC(row, a), ROW_VEC(row, b), row[IN_ROW(TriangleRow, scale)],
            row[IN_ROW(TriangleRow, whole)]};
        normal[0] = ROW_VEC(row, normal[0]), normal[1] = ROW_VEC(row, normal[1]), normal[2] = ROW_VEC(row, normal[2]);
    } else {
        edges = triangle_scale(&plane);
        for (int c = 0; c < 3; c++)
            normal[c] = vec_gather(triangles->normal, corner[c]);
    }
    barycentric(&edges, *face, vec_sub(at, off_plane), share);
    Vec mean = vec_all(real(0));
    for (int c = 0; c < 3; c++)
        mean = vec_add(mean, vec_scale(normal[c], share[c]));
    *n = vec_select(vec_dot(mean, mean) > real(0), vec_normalize(mean), *face);
}

/* Texture coordinates of the corners. Those of a mesh without are, in its file's order, (0, 0), (1, 0), (0, 1). */
INLINE void uv_of_corners(const Triangles *triangles, const Index corner[3], Mask turned, Real u[3], Real v[3])
{
    u[0] = v[0] = real(0);
    u[1] = v[2] = select(turned, real(0), real(1));
    u[2] = v[1] = real(1) - u[1];
    for (int lane = 0; triangles->uv && lane < LANES; lane++) {
        const float *at[3];
        for (int c = 0; c < 3; c++)
            at[c] = triangles->uv[LANE(corner[c], lane)];
        if (isnan(at[0][0] + at[0][1] + at[1][0] + at[1][1] + at[2][0] + at[2][1]))
            continue;
        for (int c = 0; c < 3; c++) {
            LANE(u[c], lane) = (Num)at[c][0];
            LANE(v[c], lane) = (Num)at[c][1];
        }
    }
}

/* p = p0 + s1 a + s2 b and (u, v) = (u0, v0) + s1 (u1, v1) + s2 (u2, v2), solved for dp: Pharr, Jakob, Humphreys,
   Physically Based Rendering, 4th edition, 6.5.2. Where the texture's triangle has no area the tangents are any:
   Mitsuba's, about the normal by the file's order. */
STAGE SurfaceFrame triangle_uv(const Triangles *triangles, Index i, Vec p)
{
    Index corner[3];
    Vec vertex[3];
    corners_of(triangles, i, corner, vertex);
    TrianglePlane plane = triangle_plane(vertex);
    TriangleScale edges = triangle_scale(&plane);
    Vec a = plane.a, b = plane.b, face = plane.face;
    Mask turned = triangles->turned ? gather_int32(triangles->turned, i) != 0 : mask_none();
    Real s[3], u[3], v[3];
    Vec any_du, any_dv;
    vec_frame(vec_select(turned, vec_neg(face), face), &any_du, &any_dv);
    barycentric(&edges, face, vec_sub(p, vertex[0]), s);
    uv_of_corners(triangles, corner, turned, u, v);
    Real u1 = u[1] - u[0], u2 = u[2] - u[0], v1 = v[1] - v[0], v2 = v[2] - v[0], area = u1 * v2 - u2 * v1;
    Vec dp_du = vec_scale(vec_sub(vec_scale(a, v2), vec_scale(b, v1)), real(1) / area);
    Vec dp_dv = vec_scale(vec_sub(vec_scale(b, u1), vec_scale(a, u2)), real(1) / area);
    Mask flat = area == real(0);
    return (SurfaceFrame){u[0] + s[1] * u1 + s[2] * u2, v[0] + s[1] * v1 + s[2] * v2,
        vec_select(flat, any_du, dp_du), vec_select(flat, any_dv, dp_dv)};
}

#endif
