/* Light from all around, alike in all directions. */
#ifndef ONERAY_EMITTERS_CONSTANT_H
#define ONERAY_EMITTERS_CONSTANT_H

#include "emitters/from.h"

typedef struct constant {
    double radiance[3]; /* W·sr⁻¹·m⁻² */
} Constant;

static const Field constant_fields[] = {
    {"radiance", AS_COLOUR, offsetof(Constant, radiance), "[0,inf)", "1"},
    {0},
};
static const Plugin constant_plugin = {"constant", constant_fields, NULL};

enum { constant_from = FROM_AROUND };
static inline const double *constant_emission(const Constant *e) { return e->radiance; }
static inline const double *constant_position(const Constant *e) { return (void)e, NULL; }
static inline double constant_flux(const Constant *e, double area, double radius)
{
    return (void)e, (void)area, 4 * PI * PI * radius * radius;
}
static inline const char *constant_odd(const Constant *e) { return (void)e, NULL; }

#endif
