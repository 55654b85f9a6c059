/* From a Description to a kernel's Scene: the triangles, and the trees of them and of other shapes. */
#pragma once

#include "prepare/base.h"

#include <float.h>

/* A box in the kernel's numbers. */
typedef struct {
    Num low[3], high[3];
} Bounds;

static void bounds_join(Bounds *bounds, const Num low[3], const Num high[3])
{
    for (int i = 0; i < 3; i++) {
        bounds->low[i] = low[i] < bounds->low[i] ? low[i] : bounds->low[i];
        bounds->high[i] = high[i] > bounds->high[i] ? high[i] : bounds->high[i];
    }
}

static Bounds bounds_empty(void)
{
    return (Bounds){{NUM_MAX, NUM_MAX, NUM_MAX}, {-NUM_MAX, -NUM_MAX, -NUM_MAX}};
}

/* The builder's boxes are floats: about the center of all, so that far from the origin they still differ. */
static void set_item(BvhItem *item, const Bounds *bounds, const Bounds *all, int id)
{
    item->id = id;
    for (int i = 0; i < 3; i++) {
        double center = 0.5 * (double)all->low[i] + 0.5 * (double)all->high[i];
        item->low[i] = (float)fmax((double)bounds->low[i] - center, -(double)FLT_MAX);
        item->high[i] = (float)fmin((double)bounds->high[i] - center, (double)FLT_MAX);
    }
}

/* The orders of the children as rays meet their middles. */
static void order_children(TreeNode *node)
{
    for (int octant = 0; octant < ORDERS; octant++) {
        uint8_t *order = node->order[octant];
        float far[BVH_WIDTH];
        for (int k = 0, at; k < BVH_WIDTH; k++) {
            far[k] = -FLT_MAX;
            for (int i = 0; i < 3 && node->where.child[k] != -1; i++)
                far[k] = (i ? far[k] : 0)
                         + (octant >> i & 1 ? -0.5f : 0.5f) * (node->plane[i][k] + node->plane[3 + i][k]);
            for (at = k; at > 0 && far[order[at - 1]] < far[k]; at--)
                order[at] = order[at - 1];
            order[at] = (uint8_t)k;
        }
    }
}

/* The nodes' bounds, from the leaves upwards: a child has a higher number than its node. */
static void prepare_nodes(Scene *scene, Tree *tree, const Bvh *bvh, const Bounds *of_leaf, const Bounds *all)
{
    for (int i = 0; i < 3; i++) {
        tree->center[i] = (Num)0.5 * all->low[i] + (Num)0.5 * all->high[i];
        tree->extent[i] = (Num)0.5 * all->high[i] - (Num)0.5 * all->low[i];
    }
    tree->nodes = keep_lines(scene, (size_t)bvh->node_count, sizeof *tree->nodes);
    for (int n = bvh->node_count - 1; n >= 0; n--) {
        TreeNode *node = &tree->nodes[n];
        node->where = bvh->nodes[n];
        for (int k = 0; k < BVH_WIDTH; k++) {
            int child = node->where.child[k];
            Bounds bounds = child < -1 ? of_leaf[-2 - child] : bounds_empty();
            for (int i = 0; i < 3; i++) {
                float low = (float)(bounds.low[i] - tree->center[i]);
                float high = (float)(bounds.high[i] - tree->center[i]);
                for (int j = 0; child >= 0 && j < BVH_WIDTH; j++) {
                    low = fminf(low, tree->nodes[child].plane[i][j]);
                    high = fmaxf(high, tree->nodes[child].plane[3 + i][j]);
                }
                node->plane[i][k] = low;
                node->plane[3 + i][k] = high;
            }
        }
        order_children(node);
    }
    for (int i = 0; i < 3; i++) {
        tree->low[i] = FLT_MAX, tree->high[i] = -FLT_MAX;
        for (int k = 0; k < BVH_WIDTH; k++) {
            tree->low[i] = fminf(tree->low[i], tree->nodes[0].plane[i][k]);
            tree->high[i] = fmaxf(tree->high[i], tree->nodes[0].plane[3 + i][k]);
        }
    }
}

/* Vectors in the kernel's numbers: the description's own if these are doubles. */
static const Num (*numbers_of(Scene *scene, double (*from)[3], size_t count))[3]
{
#ifdef SINGLE
    Num(*to)[3] = keep(scene, count, sizeof *to);
    for (size_t i = 0; i < count; i++)
        store(to[i], from[i]);
    return (const Num(*)[3])to;
#else
    (void)scene, (void)count;
    return (const Num(*)[3])from;
#endif
}

/* Has it a normal in the kernel's precision? Else no ray may meet it. */
static int has_normal(const Triangles *triangles, int i)
{
    Vec corner[3];
    for (int c = 0; c < 3; c++)
        corner[c] = vec_of(triangles->vertex[triangles->corner[i][c]]);
    Vec n = normal_of_edges(vec_sub(corner[1], corner[0]), vec_sub(corner[2], corner[0]));
    return any(vec_dot(n, n) > real(0.5));
}

static void fill_leaf(TriangleLeaf *leaf, const Triangles *triangles, const int32_t *ids, int count)
{
    for (int k = 0; k < LEAF_TRIANGLES; k++) {
        leaf->slot[k] = -1;
        if (k >= count || !has_normal(triangles, ids[k]))
            continue;
        for (int c = 0; c < 3; c++)
            for (int i = 0; i < 3; i++)
                leaf->corner[c][i][k] = triangles->vertex[triangles->corner[ids[k]][c]][i];
        leaf->slot[k] = triangles->first_slot + ids[k];
    }
}

/* The description's box in the kernel's numbers, which are rounded as its corners are. */
static Bounds bounds_of(const TreeBox *box)
{
    Bounds bounds;
    store(bounds.low, box->low);
    store(bounds.high, box->high);
    return bounds;
}

static void prepare_triangle_tree(Scene *scene, const MeshTree *tree)
{
    Triangles *triangles = &scene->shapes.triangles;
    const Bvh *bvh = &tree->bvh;
    Bounds all = bounds_of(&tree->all), *of_leaf = allocate((size_t)bvh->leaf_count, sizeof *of_leaf);
    triangles->leaves = keep_lines(scene, (size_t)bvh->leaf_count, sizeof *triangles->leaves);
    for (int n = 0; n < bvh->leaf_count; n++) {
        of_leaf[n] = bounds_of(&tree->leaf[n]);
        fill_leaf(&triangles->leaves[n], triangles, tree->triangle + bvh->leaves[n][0], bvh->leaves[n][1]);
    }
    prepare_nodes(scene, &triangles->tree, bvh, of_leaf, &all);
    free(of_leaf);
}

/* The number of this corner among the few, FEW_CORNERS where there is no room. */
static int few_corner(struct few_triangles *few, const Num p[3])
{
    int k = 0;
    while (k < few->corner_count
           && !(few->corner[k][0] == p[0] && few->corner[k][1] == p[1] && few->corner[k][2] == p[2]))
        k++;
    if (k == few->corner_count && k < FEW_CORNERS)
        memcpy(few->corner[few->corner_count++], p, 3 * sizeof *p);
    return k;
}

static int few_edge_between(struct few_triangles *few, int from, int to)
{
    int k = 0;
    while (k < few->edge_count && !(few->edge[k][0] == from && few->edge[k][1] == to))
        k++;
    if (k == few->edge_count && k < FEW_EDGES) {
        few->edge[k][0] = (uint8_t)from;
        few->edge[k][1] = (uint8_t)to;
        few->edge_count++;
    }
    return k;
}

/* Puts the triangle among the few; gives whether there was room. The edge functions are those of leaf_meets. */
static bool add_to_few(struct few_triangles *few, const Triangles *triangles, int i)
{
    FewTriangle *one = &few->triangle[few->count++];
    int corner[3];
    for (int c = 0; c < 3; c++) {
        corner[c] = few_corner(few, triangles->vertex[triangles->corner[i][c]]);
        if (corner[c] == FEW_CORNERS)
            return false;
        one->corner[c] = (uint8_t)corner[c];
    }
    for (int c = 0; c < 3; c++) {
        int from = corner[(c + 2) % 3], to = corner[(c + 1) % 3];
        int edge = few_edge_between(few, from < to ? from : to, from < to ? to : from);
        if (edge == FEW_EDGES)
            return false;
        one->edge[c] = (uint8_t)edge;
        one->turned[c] = from < to ? 0 : (Word)SIGN_BIT;
        one->left[c] = (uint8_t)(2 * edge + (from > to));
        one->right[c] = (uint8_t)(2 * edge + (from < to));
    }
    one->slot = triangles->first_slot + i;
    return true;
}

static void store_lane(Num to[3], Vec from)
{
    to[0] = LANE(from.x, 0), to[1] = LANE(from.y, 0), to[2] = LANE(from.z, 0);
}

static void set_triangle_row(TriangleRow *row, const Triangles *triangles, int i)
{
    Vec vertex[3];
    for (int c = 0; c < 3; c++) {
        vertex[c] = vec_of(triangles->vertex[triangles->corner[i][c]]);
        if (triangles->normal)
            memcpy(row->normal[c], triangles->normal[triangles->corner[i][c]], sizeof row->normal[c]);
    }
    TrianglePlane plane = triangle_plane(vertex);
    TriangleScale edges = triangle_scale(&plane);
    store_lane(row->corner, plane.corner);
    store_lane(row->face, plane.face);
    store_lane(row->a, edges.a);
    store_lane(row->b, edges.b);
    row->scale = LANE(edges.scale, 0);
    row->whole = LANE(edges.whole, 0);
}

static void prepare_few(Scene *scene, int count)
{
    Triangles *triangles = &scene->shapes.triangles;
    if (!FEW_WORTHWHILE || count > FEW_MOST)
        return;
    struct few_triangles *few = keep(scene, 1, sizeof *few);
    TriangleRow *rows = keep(scene, (size_t)count, sizeof *rows);
    for (int i = 0; i < count; i++)
        set_triangle_row(&rows[i], triangles, i);
    triangles->rows = rows;
    for (int i = 0; i < count; i++)
        if (has_normal(triangles, i) && !add_to_few(few, triangles, i))
            return;
    triangles->few = few;
}

static void prepare_triangles(Scene *scene, const Description *d, const int *first_slot)
{
    Triangles *triangles = &scene->shapes.triangles;
    size_t vertices = (size_t)d->mesh.vertex_count;
    if (!d->mesh.triangle_count)
        return;
    int32_t *row = keep(scene, (size_t)d->mesh.triangle_count, sizeof *row);
    for (int i = 0; i < d->shape_count; i++)
        for (int k = 0; d->shapes[i].kind == SHAPE_MESH && k < d->shapes[i].as.mesh.triangle_count; k++)
            row[d->shapes[i].as.mesh.first_triangle + k] = first_slot[i];
    triangles->row = row;
    triangles->corner = (const int32_t(*)[3])d->mesh.triangle;
    triangles->vertex = numbers_of(scene, d->mesh.vertex, vertices);
    if (d->mesh.normal)
        triangles->normal = numbers_of(scene, d->mesh.normal, vertices);
    triangles->uv = (const float(*)[2])d->mesh.uv;
    triangles->turned = d->mesh.turned;
    triangles->first_slot = scene->shapes.slot_count;
    prepare_triangle_tree(scene, &d->mesh_tree);
    prepare_few(scene, d->mesh.triangle_count);
}

/* Beyond this many shapes other than meshes a tree beats the loop over all. */
#ifndef LOOP_MOST
#define LOOP_MOST 32
#endif

static int count_primitives(const Description *d)
{
    int count = 0;
    for (int i = 0; i < d->shape_count; i++)
        count += d->shapes[i].kind != SHAPE_MESH;
    return count;
}

/* The tree of all shapes that are no meshes, one in a leaf. */
static void prepare_shape_tree(Scene *scene, const Description *d, const int *first_slot)
{
    Shapes *s = &scene->shapes;
    int count = 0, most = count_primitives(d);
    Bounds all = bounds_empty();
    BvhItem *items = allocate((size_t)most, sizeof *items);
    Bounds *bounds = allocate((size_t)d->shape_count, sizeof *bounds);
    Bounds *of_leaf = allocate((size_t)most, sizeof *of_leaf);
    for (int i = 0; i < d->shape_count; i++) {
        if (d->shapes[i].kind == SHAPE_MESH)
            continue;
        Extent extent = shape_extent(&d->shapes[i]);
        store(bounds[i].low, extent.low);
        store(bounds[i].high, extent.high);
        bounds_join(&all, bounds[i].low, bounds[i].high);
    }
    for (int i = 0; i < d->shape_count; i++)
        if (d->shapes[i].kind != SHAPE_MESH)
            set_item(&items[count++], &bounds[i], &all, i);
    Bvh bvh = bvh_build(items, count, 1);
    for (int n = 0; n < bvh.leaf_count; n++)
        of_leaf[n] = bounds[items[bvh.leaves[n][0]].id];
    prepare_nodes(scene, &s->tree, &bvh, of_leaf, &all);
    for (int n = 0; n < bvh.node_count; n++)
        for (int k = 0; k < BVH_WIDTH; k++) {
            int32_t *child = &s->tree.nodes[n].where.child[k];
            *child = *child < -1 ? -2 - first_slot[items[bvh.leaves[-2 - *child][0]].id] : *child;
        }
    free(items);
    free(bounds);
    free(of_leaf);
    bvh_free(&bvh);
}
