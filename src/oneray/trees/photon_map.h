/* T2 Photons, and a grid to find those around a point. */
#pragma once

#include <stddef.h>
#include <stdint.h>

/* Where a light path met a surface that is not a delta alone. */
typedef struct {
    double p[3];
    float to[3];     /* towards where it came from */
    float normal[3]; /* of the surface itself, on either side */
    float flux[3];   /* W, of all photons of a pass together that of the lights */
    uint32_t path;   /* of the job's */
    uint32_t edges;  /* from the light to here */
} Photon;

typedef struct {
    Photon *list;
    size_t count, room;
} Photons;

/* Their random numbers are those of pixels from there on, which no image has. */
enum { PHOTON_PATHS = 1 << 30 };

/* Of a pass: its photons cell by cell, each cell's in the order of their paths, so that sums have the same bits whatever
   the lanes. Cells, twice the radius wide, share the `first` of their hash. */
typedef struct {
    Photon *photon;
    uint32_t *first; /* [mask + 2] */
    uint32_t mask;
    double radius, cell; /* m */
    double share;        /* 1/(N π r²), m⁻² */
} PhotonMap;

/* Those of one job, from number `first` on, in the order of their paths; a path's keep theirs. */
void photons_in_order(Photons *photons, size_t first, size_t paths);

/* Takes the photons of N light paths. */
PhotonMap photon_map(Photons *photons, uint64_t paths, double radius);
void photon_map_free(PhotonMap *map);

/* The radius of pass i, from 1 on, m: r²ᵢ₊₁/r²ᵢ = (i + α)/(i + 1), α = ⅔, so that bias and noise both vanish. It depends on
   the pass alone: passes may come in any order. Knaus and Zwicker, Progressive Photon Mapping: A Probabilistic Approach, 2011. */
double photon_radius(double first, uint64_t pass);

/* The `first` of the cells that a ball of the map's radius around p reaches, at most 8, each once. */
int photon_cells(const PhotonMap *map, const double p[3], uint32_t found[8]);
