#include "trees/photon_map.h"

#include "message.h"
#include "rounded.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define ALPHA (2.0 / 3)
#define PI 3.14159265358979323846

double photon_radius(double first, uint64_t pass)
{
    enum { MULTIPLIED = 1 << 12 }; /* passes; further on (i/n)^(α - 1), the product within 1e-4 */
    double square = 1;
    uint64_t n = pass < MULTIPLIED ? pass : MULTIPLIED;
    for (uint64_t i = 1; i < n; i++)
        square *= ((double)i + ALPHA) / ((double)i + 1);
    if (pass > n)
        square *= cr_pow((double)pass / (double)n, ALPHA - 1);
    return first * sqrt(square);
}

void photons_in_order(Photons *photons, size_t first, size_t paths)
{
    size_t count = photons->count - first, *next = allocate(paths + 1, sizeof *next);
    Photon *list = photons->list + first, *unsorted = allocate(count, sizeof *unsorted);
    memcpy(unsorted, list, count * sizeof *list);
    for (size_t i = 0; i < count; i++)
        next[unsorted[i].path + 1]++;
    for (size_t path = 0; path < paths; path++)
        next[path + 1] += next[path];
    for (size_t i = 0; i < count; i++)
        list[next[unsorted[i].path]++] = unsorted[i];
    free(unsorted);
    free(next);
}

/* Teschner, Heidelberger, Müller, Pomeranets, Gross, Optimized Spatial Hashing, 2003. */
static uint32_t hash_of(const PhotonMap *map, int64_t x, int64_t y, int64_t z)
{
    uint64_t mixed = (uint64_t)x * 73856093u ^ (uint64_t)y * 19349663u ^ (uint64_t)z * 83492791u;
    return (uint32_t)((mixed ^ mixed >> 17) & map->mask);
}

static uint32_t cell_of(const PhotonMap *map, const double p[3])
{
    return hash_of(map, (int64_t)floor(p[0] / map->cell), (int64_t)floor(p[1] / map->cell),
        (int64_t)floor(p[2] / map->cell));
}

int photon_cells(const PhotonMap *map, const double p[3], uint32_t found[8])
{
    int64_t low[3];
    int count = 0;
    for (int axis = 0; axis < 3; axis++) /* the ball reaches this cell and the next */
        low[axis] = (int64_t)floor(p[axis] / map->cell - .5);
    for (int corner = 0; corner < 8; corner++) {
        uint32_t cell =
            hash_of(map, low[0] + (corner & 1), low[1] + (corner >> 1 & 1), low[2] + (corner >> 2));
        bool there = false;
        for (int i = 0; i < count; i++)
            there = there || found[i] == cell;
        if (!there && map->first[cell] < map->first[cell + 1])
            found[count++] = cell;
    }
    return count;
}

PhotonMap photon_map(Photons *photons, uint64_t paths, double radius)
{
    PhotonMap map = {.mask = 1, .radius = radius, .cell = 2 * radius};
    if (photons->count > UINT32_MAX / 2)
        die("--photons: a pass has more than 2^31 photons");
    while (map.mask < photons->count)
        map.mask = 2 * map.mask + 1;
    map.share = 1 / ((double)paths * PI * radius * radius);
    map.first = allocate((size_t)map.mask + 2, sizeof *map.first);
    map.photon = allocate(photons->count, sizeof *map.photon);
    for (size_t i = 0; i < photons->count; i++)
        map.first[cell_of(&map, photons->list[i].p) + 1]++;
    for (size_t cell = 0; cell <= map.mask; cell++)
        map.first[cell + 1] += map.first[cell];
    uint32_t *next = allocate((size_t)map.mask + 1, sizeof *next);
    memcpy(next, map.first, ((size_t)map.mask + 1) * sizeof *next);
    for (size_t i = 0; i < photons->count; i++)
        map.photon[next[cell_of(&map, photons->list[i].p)]++] = photons->list[i];
    free(next);
    return map;
}

void photon_map_free(PhotonMap *map)
{
    free(map->photon);
    free(map->first);
}
