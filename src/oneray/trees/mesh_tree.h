/* The tree of a scene's triangles, built once: what a kernel's rays go through, and what asks for triangles that are
   close to each other. */
#pragma once

#include "meshes/mesh.h"
#include "trees/bvh.h"

#include <stdbool.h>

typedef struct {
    double low[3], high[3];
} TreeBox;

static inline TreeBox mesh_box(const Mesh *mesh, int triangle)
{
    const int32_t *corner = mesh->triangle[triangle];
    TreeBox box;
    for (int i = 0; i < 3; i++) {
        double x = mesh->vertex[corner[0]][i], y = mesh->vertex[corner[1]][i], z = mesh->vertex[corner[2]][i];
        double low = x < y ? x : y, high = x < y ? y : x;
        box.low[i] = low < z ? low : z;
        box.high[i] = high > z ? high : z;
    }
    return box;
}

static inline bool boxes_apart(const TreeBox *a, const TreeBox *b, double by)
{
    for (int i = 0; i < 3; i++)
        if (a->low[i] > b->high[i] + by || b->low[i] > a->high[i] + by)
            return true;
    return false;
}

typedef struct {
    Bvh bvh;
    int32_t *triangle; /* in the order of the leaves */
    int count;         /* of triangles */
    TreeBox *node, *leaf, all; /* around what is in each */
} MeshTree;

enum { LEAF_TRIANGLES = 8 };

/* Empty for a mesh without triangles. */
MeshTree mesh_tree_build(const Mesh *mesh);
/* What a search may spend, in boxes that are compared: enough where triangles meet a hundred others each. Where all meet
   all, as in a fan of thousands, it ends early, so that its time goes with the triangles and not with their square. */
static inline int64_t mesh_tree_patience(const MeshTree *tree) { return (1 << 24) + 2048 * (int64_t)tree->count; }

/* Goes down into the boxes that `enters`, until `use` of a triangle in one of them returns true; did it? It takes from
   `patience`, and ends where that is below 0. */
bool mesh_tree_visit(const MeshTree *tree, int64_t *patience, const void *query,
    bool (*enters)(const void *, const TreeBox *), void *to, bool (*use)(void *to, int triangle));
/* The same with pairs of triangles whose boxes are no farther than `slack` apart along each axis, each pair once. */
bool mesh_tree_pairs(const MeshTree *tree, int64_t *patience, const Mesh *mesh, double slack, void *to,
    bool (*use)(void *to, int one, int other));
void mesh_tree_free(MeshTree *tree);
