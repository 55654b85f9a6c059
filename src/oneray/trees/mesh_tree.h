/* The tree of a scene's triangles, built once: what a kernel's rays go through, and what asks for triangles that are
   close to each other. */
#pragma once

#include "meshes/mesh.h"
#include "trees/bvh.h"

#include <stdbool.h>

typedef struct {
    double low[3], high[3];
} TreeBox;

typedef struct {
    Bvh bvh;
    int32_t *triangle; /* in the order of the leaves */
    TreeBox *node, *leaf, all; /* around what is in each */
} MeshTree;

enum { LEAF_TRIANGLES = 8 };

/* Empty for a mesh without triangles. */
MeshTree mesh_tree_build(const Mesh *mesh);
/* Goes down into the boxes that `enters`, until `use` of a triangle in one of them returns true; did it? */
bool mesh_tree_visit(const MeshTree *tree, const void *query, bool (*enters)(const void *, const TreeBox *),
    void *to, bool (*use)(void *to, int triangle));
void mesh_tree_free(MeshTree *tree);
