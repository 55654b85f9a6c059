/* A tree of boxes around things that rays meet: which box is in which. The bounds are the kernel's. */
#pragma once

#include <stdint.h>

enum { BVH_WIDTH = 8, BVH_DEPTH = 40 };

/* A thing, and the box around it, of which a fourth number is 0: compilers take four at once. Only how well the tree is
   built depends on the box. */
typedef struct {
    float low[4], high[4];
    int32_t id;
} BvhItem;

/* Where a node's child is: a node with a higher number, -1 for none, or -2 - leaf. */
typedef struct {
    int32_t child[BVH_WIDTH];
} BvhNode;

typedef struct {
    BvhNode *nodes;       /* 0 is the root */
    int32_t (*leaves)[2]; /* the first item, and how many */
    int node_count, leaf_count;
} Bvh;

/* Puts the items into the order of the leaves, at most leaf_most in each. */
Bvh bvh_build(BvhItem *items, int count, int leaf_most);
void bvh_free(Bvh *bvh);
