#include "trees/mesh_tree.h"

#include "message.h"

#include <float.h>
#include <stdlib.h>

enum { USE = 32 }; /* what a triangle or a pair of them costs, in boxes */

static TreeBox box_empty(void)
{
    return (TreeBox){{HUGE_VAL, HUGE_VAL, HUGE_VAL}, {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL}};
}

static void box_join(TreeBox *box, const double low[3], const double high[3])
{
    for (int i = 0; i < 3; i++) {
        box->low[i] = low[i] < box->low[i] ? low[i] : box->low[i];
        box->high[i] = high[i] > box->high[i] ? high[i] : box->high[i];
    }
}

/* The builder's boxes are floats: about the center of all, so that far from the origin they still differ. */
static BvhItem item_of(const TreeBox *box, const TreeBox *all, int id)
{
    BvhItem item = {.id = id};
    for (int i = 0; i < 3; i++) {
        double center = 0.5 * all->low[i] + 0.5 * all->high[i];
        item.low[i] = (float)fmax(box->low[i] - center, -(double)FLT_MAX);
        item.high[i] = (float)fmin(box->high[i] - center, (double)FLT_MAX);
    }
    return item;
}

/* A node or a leaf, as nodes name it. */
static const TreeBox *box_of(const MeshTree *tree, int32_t child)
{
    return child >= 0 ? &tree->node[child] : &tree->leaf[-2 - child];
}

/* From the leaves upwards: a child has a higher number than its node. */
static void box_nodes(MeshTree *tree)
{
    const Bvh *bvh = &tree->bvh;
    tree->node = allocate((size_t)bvh->node_count, sizeof *tree->node);
    for (int n = bvh->node_count - 1; n >= 0; n--) {
        tree->node[n] = box_empty();
        for (int k = 0; k < BVH_WIDTH; k++) {
            int child = bvh->nodes[n].child[k];
            if (child != -1)
                box_join(&tree->node[n], box_of(tree, child)->low, box_of(tree, child)->high);
        }
    }
}

MeshTree mesh_tree_build(const Mesh *mesh)
{
    int count = mesh->triangle_count;
    MeshTree tree = {.all = box_empty()};
    if (!count)
        return tree;
    BvhItem *items = allocate((size_t)count, sizeof *items);
    for (int t = 0; t < count; t++)
        for (int c = 0; c < 3; c++)
            box_join(&tree.all, mesh->vertex[mesh->triangle[t][c]], mesh->vertex[mesh->triangle[t][c]]);
    for (int t = 0; t < count; t++) {
        TreeBox box = mesh_box(mesh, t);
        items[t] = item_of(&box, &tree.all, t);
    }
    tree.count = count;
    tree.bvh = bvh_build(items, count, LEAF_TRIANGLES);
    tree.triangle = allocate((size_t)count, sizeof *tree.triangle);
    for (int i = 0; i < count; i++)
        tree.triangle[i] = items[i].id;
    free(items);
    tree.leaf = allocate((size_t)tree.bvh.leaf_count, sizeof *tree.leaf);
    for (int n = 0; n < tree.bvh.leaf_count; n++) {
        const int32_t *leaf = tree.bvh.leaves[n];
        tree.leaf[n] = box_empty();
        for (int k = leaf[0]; k < leaf[0] + leaf[1]; k++) {
            TreeBox box = mesh_box(mesh, tree.triangle[k]);
            box_join(&tree.leaf[n], box.low, box.high);
        }
    }
    box_nodes(&tree);
    return tree;
}

bool mesh_tree_visit(const MeshTree *tree, int64_t *patience, const void *query,
    bool (*enters)(const void *, const TreeBox *), void *to, bool (*use)(void *to, int triangle))
{
    int32_t pending[BVH_DEPTH * BVH_WIDTH] = {0};
    for (int count = tree->bvh.node_count > 0; count > 0 && *patience >= 0;) {
        int32_t next = pending[--count];
        *patience -= BVH_WIDTH;
        for (int k = 0; next >= 0 && k < BVH_WIDTH; k++) {
            int32_t child = tree->bvh.nodes[next].child[k];
            if (child != -1 && enters(query, box_of(tree, child)))
                pending[count++] = child;
        }
        const int32_t *leaf = next < 0 ? tree->bvh.leaves[-2 - next] : NULL;
        for (int i = 0; leaf && i < leaf[1]; i++) {
            *patience -= USE;
            if (use(to, tree->triangle[leaf[0] + i]))
                return true;
        }
    }
    return false;
}

typedef struct {
    const MeshTree *tree;
    const TreeBox *box; /* of the triangles, in the order of the leaves */
    double slack;
    int64_t *patience;
    void *to;
    bool (*use)(void *to, int one, int other);
} Join;

/* Pairs of one triangle of each of two leaves, or of one leaf. */
static bool join_leaves(const Join *j, int one, int other)
{
    const int32_t *a = j->tree->bvh.leaves[one], *b = j->tree->bvh.leaves[other];
    int close[LEAF_TRIANGLES], count = 0;
    *j->patience -= LEAF_TRIANGLES;
    for (int k = b[0]; k < b[0] + b[1]; k++)
        if (!boxes_apart(&j->box[k], &j->tree->leaf[one], j->slack))
            close[count++] = k;
    for (int i = a[0]; i < a[0] + a[1] && count; i++) {
        if (boxes_apart(&j->box[i], &j->tree->leaf[other], j->slack))
            continue;
        for (int k = 0; k < count && (one != other || close[k] < i); k++)
            if (!boxes_apart(&j->box[i], &j->box[close[k]], j->slack)) {
                *j->patience -= USE;
                if (j->use(j->to, j->tree->triangle[i], j->tree->triangle[close[k]]))
                    return true;
            }
    }
    return false;
}

/* What two children have in common, or one with itself. Of a leaf and a node, or of two nodes, the first that is a node
   is opened. */
static bool join(const Join *j, int32_t one, int32_t other)
{
    const Bvh *bvh = &j->tree->bvh;
    bool within = one == other, leaf = one < 0;
    if (leaf && other < 0)
        return join_leaves(j, -2 - one, -2 - other);
    const int32_t *child = bvh->nodes[leaf ? other : one].child;
    const TreeBox *box = box_of(j->tree, leaf ? one : other);
    *j->patience -= BVH_WIDTH;
    for (int k = 0; k < BVH_WIDTH && *j->patience >= 0; k++) {
        if (child[k] == -1 || (!within && boxes_apart(box_of(j->tree, child[k]), box, j->slack)))
            continue;
        if (!within && join(j, leaf ? one : other, child[k]))
            return true;
        for (int i = 0; within && i <= k; i++)
            if (child[i] != -1 && !boxes_apart(box_of(j->tree, child[i]), box_of(j->tree, child[k]), j->slack)
                && join(j, child[i], child[k]))
                return true;
    }
    return false;
}

bool mesh_tree_pairs(const MeshTree *tree, int64_t *patience, const Mesh *mesh, double slack, void *to,
    bool (*use)(void *to, int one, int other))
{
    TreeBox *box = allocate((size_t)mesh->triangle_count, sizeof *box);
    for (int i = 0; i < mesh->triangle_count; i++)
        box[i] = mesh_box(mesh, tree->triangle[i]);
    bool found = tree->bvh.node_count && join(&(Join){tree, box, slack, patience, to, use}, 0, 0);
    free(box);
    return found;
}

void mesh_tree_free(MeshTree *tree)
{
    bvh_free(&tree->bvh);
    free(tree->triangle);
    free(tree->leaf);
    free(tree->node);
    *tree = (MeshTree){0};
}
