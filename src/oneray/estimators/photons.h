/* T2 Photon mapping. A pass sends light paths off, keeps a photon at each of their vertices that is not a delta alone, and
   then follows the eye's paths through mirrors and glass to the first vertex where light scatters. There

     L_o(p, ω_o) ≈ Σ f_r(ω_i, ω_o) ΔΦ / (N π r²)

   over the photons within r of p that lie on its surface: all reflected light, direct light too. What the eye sees of lights
   before that vertex is seen by itself. Jensen, Global Illumination using Photon Maps, 1996. The estimate is blurred over the
   disc, which shrinks from pass to pass (photon_radius): consistent, not unbiased. */
#pragma once

#include "estimators/light.h"
#include "trees/photon_map.h"

/* A photon lies on the surface around p if their planes are nearly the same: an edge, a wall's other side and a layer below
   are cut off. */
#define LEAST_COSINE .8 /* of the angle between the normals, on either side */
#define MOST_ALONG .2   /* of the radius, along the normal */

INLINE void keep_photons(
    Photons *photons, const Path *path, const Surface *s, const size_t items[], Mask active)
{
    Light flux = light_mul(path->flux, path->throughput);
    for (unsigned left = mask_bits(active); left; left &= left - 1) {
        int lane = lowest_lane(left);
        double power[3];
        if (photons->count == photons->room) {
            photons->room = 2 * photons->room + 1024;
            photons->list = reallocate(photons->list, photons->room, sizeof *photons->list);
        }
        Photon *photon = &photons->list[photons->count++];
        const Vec *vectors[] = {&s->wo, &s->face};
        float *to[] = {photon->to, photon->normal};
        for (int i = 0; i < 2; i++) {
            to[i][0] = (float)LANE(vectors[i]->x, lane);
            to[i][1] = (float)LANE(vectors[i]->y, lane);
            to[i][2] = (float)LANE(vectors[i]->z, lane);
        }
        photon->p[0] = (double)LANE(s->p.x, lane);
        photon->p[1] = (double)LANE(s->p.y, lane);
        photon->p[2] = (double)LANE(s->p.z, lane);
        light_lane(&flux, lane, power);
        for (int c = 0; c < 3; c++)
            photon->flux[c] = (float)power[c];
        photon->path = (uint32_t)items[lane];
        photon->edges = (uint32_t)LANE(path->depth, lane) + 1;
    }
}

/* One vertex of a light path. */
STAGE void photon_step(Path *path, const Scene *scene, const size_t items[], Photons *photons, Features f)
{
    Surface surface;
    if (!light_path_arrives(path, scene, &surface, f))
        return;
    Mask scatters = and_not(path->alive, surface.delta);
    if (!(f.has & BRIGHT_WHERE_BLACK))
        scatters &= light_max(surface.reflectance) > real(0);
    keep_photons(photons, path, &surface, items, scatters);
    Uniforms random = random_block(&path->rng, path->depth, DIMENSION_VERTEX, f);
    light_path_goes_on(path, scene, &surface, random.u + 2, f);
}

/* The photons that a lane's point gathers, one after the other. */
typedef struct {
    double p[3], normal[3];
    uint32_t cells[8], at, end, most_edges;
    int left; /* cells */
} Search;

static void search_from(Search *search, const PhotonMap *map, const Surface *s, int lane, Int most_edges)
{
    (void)lane; /* of one lane */
    *search =
        (Search){.p = {(double)LANE(s->p.x, lane), (double)LANE(s->p.y, lane), (double)LANE(s->p.z, lane)},
            .normal = {(double)LANE(s->face.x, lane), (double)LANE(s->face.y, lane),
                (double)LANE(s->face.z, lane)},
            .most_edges = (uint32_t)most_edges};
    search->left = photon_cells(map, search->p, search->cells);
}

static bool lies_on(const Photon *photon, const Search *search, double radius)
{
    double apart[3], square = 0, along = 0, cosine = 0;
    for (int axis = 0; axis < 3; axis++) {
        apart[axis] = photon->p[axis] - search->p[axis];
        square += apart[axis] * apart[axis];
    }
    if (square > radius * radius)
        return false;
    for (int axis = 0; axis < 3; axis++) {
        along += apart[axis] * search->normal[axis];
        cosine += (double)photon->normal[axis] * search->normal[axis];
    }
    return fabs(along) <= MOST_ALONG * radius && fabs(cosine) >= LEAST_COSINE;
}

/* NULL: there are no more. */
static const Photon *next_photon(Search *search, const PhotonMap *map)
{
    for (;;) {
        for (; search->at < search->end; search->at++) {
            const Photon *photon = &map->photon[search->at];
            if (photon->edges <= search->most_edges && lies_on(photon, search, map->radius))
                return search->at++, photon;
        }
        if (!search->left)
            return NULL;
        uint32_t cell = search->cells[--search->left];
        search->at = map->first[cell];
        search->end = map->first[cell + 1];
    }
}

/* Σ f_r ΔΦ / (N π r²), W·sr⁻¹·m⁻². */
STAGE Light gather_photons(
    const PhotonMap *map, const Scene *scene, const Surface *s, Mask active, Index most_edges, Features f)
{
    Light sum = light_all(real(0));
    Search search[LANES];
    unsigned left = mask_bits(active);
    for (unsigned lanes = left; lanes; lanes &= lanes - 1) {
        int lane = lowest_lane(lanes);
        search_from(&search[lane], map, s, lane, LANE(most_edges, lane));
    }
    while (left) {
        Mask found = mask_none();
        Vec wi = s->n;
        Light flux = light_all(real(0));
        for (unsigned lanes = left; lanes; lanes &= lanes - 1) {
            int lane = lowest_lane(lanes);
            const Photon *photon = next_photon(&search[lane], map);
            if (!photon) {
                left &= ~(1u << lane);
                continue;
            }
            LANE(found, lane) = LANE(mask_all(), lane);
            LANE(wi.x, lane) = (Num)photon->to[0];
            LANE(wi.y, lane) = (Num)photon->to[1];
            LANE(wi.z, lane) = (Num)photon->to[2];
            LANE(flux.r, lane) = (Num)photon->flux[0];
            LANE(flux.g, lane) = (Num)photon->flux[1];
            LANE(flux.b, lane) = (Num)photon->flux[2];
        }
        Real cosine = vec_dot(s->n, wi);
        found &= can_receive(s, cosine, f);
        if (!any(found))
            continue;
        Evaluation surface = evaluate_material(&scene->materials, s, wi, cosine, f);
        sum = light_add(sum, light_only(found, light_mul(surface.f_r, flux)));
    }
    return light_scale(sum, real((Num)map->share));
}

/* One vertex of the eye's path. It goes on by deltas alone: what else is reflected there the photons have. */
STAGE void gather_step(Path *path, const Scene *scene, const PhotonMap *map, Features f)
{
    Mask front, hiding = f.has & HAS_HIDDEN ? path->depth == index_of(0) : mask_none();
    Hit hit = next_hit(path, scene, hiding, f);
    if (!any(path->alive))
        return;
    Surface surface = surface_at(&scene->shapes, &scene->materials, &path->ray, hit, &front, f);
    if (f.has & (HAS_AREA | HAS_ANY(SKIES))) {
        Light light = emission_met(path, scene, hit, &surface, front, f);
        path->radiance = light_add(path->radiance, light_mul(path_weight(path, f), light));
    }
    path->alive = goes_on(path, scene, hit);
    if (!(f.has & BRIGHT_WHERE_BLACK))
        path->alive &= light_max(surface.reflectance) > real(0);
    if (!any(path->alive))
        return;
    Mask gathers = and_not(path->alive, surface.delta);
    if (any(gathers)) {
        Index most = index_of(scene->max_depth) - (path->depth + 1);
        Light light = gather_photons(map, scene, &surface, gathers, most, f);
        path->radiance =
            light_add(path->radiance, light_only(gathers, light_mul(path_weight(path, f), light)));
    }
    path->alive &= has_delta(&scene->materials, &surface, f);
    if (!any(path->alive))
        return;
    Uniforms random = random_block(&path->rng, path->depth, DIMENSION_VERTEX, f), choice = choices(path, f);
    bounce(path, scene, &surface, choice.u + 2, random.u + 2, f);
    path->alive &= path->delta;
}
