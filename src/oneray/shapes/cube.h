/* The cube [-1,1]³, with normals outwards. Its side k is at +1 or, for an odd k, -1 of axis k/2. */
#pragma once

#include "shapes/placed.h"

typedef struct cube {
    Placed placed;
} Cube;

static const Plugin cube_plugin = {"cube", NULL, {PLACED_FIELDS}};

enum { cube_planes = 6 };
static inline Side cube_side(const Cube *s, int k) { return placed_side(&s->placed, k / 2, 1 - 2 * (k % 2)); }
static inline Extent cube_extent(const Cube *s) { return placed_extent(&s->placed, false); }

#ifdef LANES

#include "shapes/shape.h"

typedef struct cube_row {
    Local to_unit;
} CubeRow;
static inline void cube_row(const Cube *s, CubeRow *row) { row->to_unit = local_of(&s->placed.to_world); }

/* The slabs |x|, |y|, |z| <= 1 of the cube's own space, entered at -(x/dx + 1/|dx|), left at 1/|dx| - x/dx. `faces`
   gets the face entered and left by: 0 … 5 for the normals +x -x +y -y +z -z. A ray that starts on face `on` starts
   exactly there, so that one that goes out of it has its far end at 0: it meets nothing. */
typedef struct {
    Index enter, leave;
} Faces;

STAGE Stretch cube_stretch(const CubeRow *cube, const Ray *ray, Index on, Faces *faces)
{
    Real before = real(NUM_MAX), after = real(NUM_MAX);
    Real side = bits_real(real_bits(real(1)) | (Bits)on << (8 * NUM_BYTES - 1));
    UNROLLED for (int axis = 0; axis < 3; axis++) {
        Real x = row_point(cube->to_unit.row[axis], ray->o), dx = row_direction(cube->to_unit.row[axis], ray->d);
        x = select(on >> 1 == index_of(axis), side, x);
        dx = select(dx == real(0), real(NEARLY_PARALLEL), dx);
        Real inverse = real(1) / dx, middle = x * inverse, half = real_abs(inverse);
        Real enter = middle + half, leave = half - middle;
        if (faces) {
            Index face = (Index)(real_bits(dx) >> (8 * NUM_BYTES - 1)) + 2 * axis;
            faces->enter = index_select(enter < before, face, faces->enter);
            faces->leave = index_select(leave < after, face, faces->leave);
        }
        before = real_min(enter, before);
        after = real_min(leave, after);
    }
    if (faces)
        faces->enter ^= 1;
    Mask met = -before <= after;
    return (Stretch){-before, after, met, met};
}

/* Does the ray meet the cube, where, and which of its faces? */
INLINE Mask cube_meets(const Shapes *shapes, int i, int slot, const Ray *ray, Hit *at)
{
    Faces faces = {index_of(0), index_of(0)};
    Index face = ray->from - slot;
    Mask on = (face >= 0) & (face < 6);
    Stretch s = cube_stretch(&ROWS(shapes, CUBE, Cube)[i], ray, face, &faces);
    at->t = stretch_hit(s, on);
    Mask entering = at->t == s.near;
    at->slot = slot + index_select(entering, faces.enter, faces.leave);
    return s.entered & (at->t > real(0));
}

/* Where the ray is in the cube, and the slots of the faces that it enters and leaves by; it starts on slot `on`. */
INLINE Stretch cube_through(const Shapes *shapes, int i, int slot, const Ray *ray, Index on, Index through[2])
{
    Faces faces = {index_of(0), index_of(0)};
    Stretch s = cube_stretch(&ROWS(shapes, CUBE, Cube)[i], ray, on - slot, &faces);
    through[0] = slot + faces.enter;
    through[1] = slot + faces.leave;
    return s;
}

INLINE Mask cube_blocks(const Shapes *shapes, int i, int slot, const Ray *ray, Index target)
{
    Index face = ray->from - slot, aim = target - slot;
    Mask on = (face >= 0) & (face < 6);
    Stretch s = cube_stretch(&ROWS(shapes, CUBE, Cube)[i], ray, face, NULL);
    return stretch_blocks(s, ray, on, (aim >= 0) & (aim < 6));
}

/* Where u and v grow, two rows a face, and one more that is read along with the last. */
static const Num cube_axes[13][3] = {{0, 1, 0}, {0, 0, -1}, {0, 1, 0}, {0, 0, 1}, {-1, 0, 0}, {0, 0, -1}, {0, 0, 1},
    {1, 0, 0}, {0, 1, 0}, {1, 0, 0}, {0, -1, 0}, {1, 0, 0}};

INLINE SurfaceFrame cube_uv(Vec at, Index nth)
{
    Index face = nth % 6;
    return frame_of_square(vec_gather(cube_axes, face * 2), vec_gather(cube_axes, face * 2 + 1), at);
}

#endif
