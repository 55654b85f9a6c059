/* A shape that shines, all its surface alike, on the side of the normal. */
#ifndef ONERAY_EMITTERS_AREA_H
#define ONERAY_EMITTERS_AREA_H

#include "emitters/from.h"

typedef struct area {
    double radiance[3]; /* W·sr⁻¹·m⁻² */
} Area;

static const Field area_fields[] = {
    {"radiance", AS_COLOUR, offsetof(Area, radiance), "[0,inf)", "1"},
    {0},
};
static const Plugin area_plugin = {"area", area_fields, NULL};

enum { area_from = FROM_SHAPE };
static inline const double *area_emission(const Area *e) { return e->radiance; }
static inline const double *area_position(const Area *e) { return (void)e, NULL; }
static inline double area_flux(const Area *e, double area, double radius) { return (void)e, (void)radius, PI * area; }
static inline const char *area_odd(const Area *e) { return (void)e, NULL; }

#endif
