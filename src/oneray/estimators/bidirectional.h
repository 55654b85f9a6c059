/* T1 Bidirectional path tracing. Veach, Robust Monte Carlo Methods for Light Transport Simulation, 1997, chapter 10.

   A path x_0 … x_k of k edges starts on a light, x_0, and ends in the eye, x_k. The strategy (s, t), s + t = k + 1, has its
   first s vertices y_0 … y_{s-1} from a light subpath and its last t vertices z_{t-1} … z_0 from an eye subpath, and joins
   y_{s-1} to z_{t-1}:

     (0, t)    the eye subpath meets the light
     (1, t)    next event estimation, by --light-choice
     (s, 1)    y_{s-1} is joined to the eye: a splat, through the pixels' filter
     (s, t)    C = α_y f(y) G f(z) α_z, G = V cosθ_y cosθ_z/d²

   t >= 1: z_0 is the eye, a pinhole or a point of the lens, which all strategies choose alike and which is in no density. That of
   z_1 is over the whole film, cosθ_1/(d² cos³θ A) (Eye): one pass has a pair of subpaths for each pixel, and all light
   subpaths are one sample of the film.

   Its density is p_{s,t} = Π_{i<s} p_forward(x_i) Π_{i>=s} p_reverse(x_i): by area (m⁻²), from the light towards the eye and
   from the eye towards the light. p_forward(x_{i+1}) = p_w(x_{i-1}, x_i → x_{i+1}) cosθ_{i+1}/d², p_w (sr⁻¹) being the one
   function of the material that samples directions. Its weight is

     w_{s,t} = p_{s,t}^β / Σ_{s'} p_{s',t'}^β,   β = 1 balance, 2 power (9.2),

   over all s' <= MOST_LIGHT_VERTICES that can sample the path. Ratios of neighbours are p_{s'+1}/p_{s'} =
   p_forward(x_{s'})/p_reverse(x_{s'}) (10.9): `weight_of` goes from s downwards by the ratios of the light subpath's vertices and
   upwards by those of the eye's. What differs from the thesis:

   - (1, t) has a density of its own for x_0, p_nee, given x_1, where the light subpath's is p_0: a factor p_nee/p_0.
   - A light far away has a direction for x_0 (p_0 in sr⁻¹), and p_forward(x_1) = cosθ_1/(π R²).
   - A delta at x_i is in the densities of all strategies but those that join x_i to a neighbour, which cannot sample it. What is
     left of it in them is its measure, η² cosθ dω (5.2): p_w is η_i² cosθ_i of the direction it leaves by.
   - Roulette is in no density. Survival depends on the subpath's history, which another strategy does not know; weights that
     leave it out sum to 1 all the same, and a subpath that survives is divided by its chance of that.
   - Paths of more edges than a light subpath has vertices are found all the same, from the eye: s' ends where light subpaths do,
     t does not. So memory is bounded: a lane keeps MOST_LIGHT_VERTICES vertices, and as many ratios of its last from the eye.

   Light subpaths carry flux: without η² (Scatter) and with the adjoint's cosines of interpolated normals (light.h).
   All lanes go in step, so that s and t are one for all lanes. */
#pragma once

#include "estimators/light.h"

/* What tests look at, a lane at a time: the vertices, number n of the eye's subpath (side 0) or a light's (1), or a point of a
   light that only next event estimation or a met light has (2); for each (s, t) the density of (other, k + 1 - other) over its
   own; that weight; and whether nothing was in between. */
#ifndef NOTE_VERTEX
#define NOTE_VERTEX(side, n, p) ((void)0)
#define NOTE_DELTA(side, n, delta) ((void)0)
#define NOTE_STRATEGY(other, density) ((void)0)
#define NOTE_WEIGHT(s, t, weight) ((void)0)
#define NOTE_ARRIVAL(arrives) ((void)0)
#endif

enum { MOST_LIGHT_VERTICES = 15, KEPT_RATIOS = 16 };
enum { LIGHT_SUBPATH = 1 << 24 }; /* its random numbers are those of vertices from there on, beyond PATH_LIMIT */

#define MOST_RATIO BY_PRECISION(1e18, 1e150) /* another strategy's density over this one's: its square is finite */
#define LEAST_SQUARE BY_PRECISION(1e-20, 1e-40) /* m², of edges: surfaces in one place are no distance apart */

/* What the weights want to know of a subpath's vertices. */
typedef struct {
    Real ratio[KEPT_RATIOS]; /* of vertex i (of the eye's: i % KEPT_RATIOS) the other subpath's density over its own */
    Mask delta[KEPT_RATIOS]; /* it sent the path on by a delta */
} Chain;

/* A subpath on its way. */
typedef struct {
    Path path;
    Chain chain;
    Real p_own;       /* of the last vertex: p_forward of the light's, p_reverse of the eye's, m⁻² */
    Real p_before;    /* the same of the vertex before it */
    Real to_before;   /* cosθ/d² at the vertex before: from p_w at the last vertex to the other subpath's p of that, m⁻² */
    Vec face;         /* at the last vertex, of its surface */
    Real compression; /* (η_o/η_i)² of the boundaries so far */
} Subpath;

/* A vertex of the light subpath, and what it is reached with. */
typedef struct {
    Surface at;  /* as the vertex before sees it; not of y_0 */
    Light alpha; /* α, of y_0 its radiance over p_0: W */
    Mask alive;
    Real p_forward, p_before, to_before; /* Subpath */
} LightVertex;

typedef struct {
    const Scene *scene;
    Subpath light, eye;
    LightVertex y[MOST_LIGHT_VERTICES];
    int vertices;          /* of the longest light subpath */
    int most_s, most_edges;
    Index emitter;         /* that the light subpath starts at */
    EmitPdf start;         /* its densities, p_0 with the choice of the light */
    Real nee_over_start;   /* p_nee/p_0 of y_0, for y_1 */
} Pair;

/* β */
INLINE Real heuristic(Real p, Features f) { return f.use & USE_BALANCE ? p : p * p; }

/* Of the two vertices at either end of the edge that a strategy joins: p_reverse/p_forward of y_{s-1} and y_{s-2}, and
   p_forward/p_reverse of z_{t-1} and z_{t-2}. */
typedef struct {
    Real y, y_before, z, z_before;
    Real nee_over_start; /* p_nee/p_0 */
    Mask met;            /* (0, k + 1) can sample it: x_0 is no delta */
} Joined;

/* w_{s,t}. */
STAGE Real weight_of(const Pair *pair, int s, int t, const Joined *joined, Features f)
{
    const Chain *light = &pair->light.chain, *eye = &pair->eye.chain;
    Real own = s == 1 && t > 1 ? joined->nee_over_start : real(1), sum = heuristic(own, f), p = real(1), other;
    for (int i = s - 1; i >= 0; i--) { /* (i, k + 1 - i), which joins x_{i-1} to x_i */
        Mask can = i ? mask_all() : joined->met;
        p = real_min(p * (i == s - 1 ? joined->y : i == s - 2 ? joined->y_before : light->ratio[i]), real(MOST_RATIO));
        if (i > 0 && i < s - 1)
            can = and_not(can, light->delta[i]);
        if (i > 1)
            can = and_not(can, light->delta[i - 1]);
        other = only(can, i == 1 ? p * joined->nee_over_start : p);
        NOTE_STRATEGY(i, other / own);
        sum = sum + heuristic(other, f);
    }
    p = real(1);
    for (int j = t - 1; j >= 1 && s + t - j <= pair->most_s; j--) { /* (s + t - j, j), which joins z_j to z_{j-1} */
        Mask can = mask_all();
        p = real_min(p * (j == t - 1 ? joined->z : j == t - 2 ? joined->z_before : eye->ratio[j % KEPT_RATIOS]), real(MOST_RATIO));
        if (j < t - 1)
            can = and_not(can, eye->delta[j % KEPT_RATIOS]);
        if (j > 1)
            can = and_not(can, eye->delta[(j - 1) % KEPT_RATIOS]);
        other = only(can, s + t - j == 1 && j > 1 ? p * joined->nee_over_start : p);
        NOTE_STRATEGY(s + t - j, other / own);
        sum = sum + heuristic(other, f);
    }
    NOTE_WEIGHT(s, t, heuristic(own, f) / sum);
    return heuristic(own, f) / sum;
}

/* --strategy: only one, and all of it. */
INLINE int is_wanted(const Scene *scene, int s, int t)
{
    return !scene->strategy[1] || (scene->strategy[0] == s && scene->strategy[1] == t);
}
INLINE Real share_of(const Pair *pair, int s, int t, const Joined *joined, Features f)
{
    return pair->scene->strategy[1] ? real(1) : weight_of(pair, s, t, joined, f);
}

STAGE Evaluation evaluate_at(const Scene *scene, const Surface *s, Vec wi, Real cosine, Features f)
{
    return evaluate_material(&scene->materials, s, wi, cosine, f);
}

/* p_w(next, s → before), sr⁻¹: the surface's own density with its two directions exchanged. */
STAGE Real pdf_w_reverse(const Scene *scene, const Surface *s, Vec next, Features f)
{
    Surface seen = surface_seen_from(&scene->materials, s, next, f);
    Real cosine = vec_dot(seen.n, s->wo);
    return only(can_receive(&seen, cosine, f), evaluate_at(scene, &seen, s->wo, cosine, f).pdf_w);
}

INLINE Real inverse_square(Real dd) { return real(1) / real_max(dd, real(LEAST_SQUARE)); }

/* The subpath has come to a surface, a point of which has this density. */
INLINE void arrive(Subpath *subpath, const Surface *s, Real p_own, Real to_before)
{
    subpath->p_before = subpath->p_own;
    subpath->p_own = p_own;
    subpath->to_before = to_before;
    subpath->face = s->face;
}

/* The subpath goes on from its vertex number i, at s; sets the ratio of the vertex before, to which the other subpath would
   come by p_w(next, s → before). */
STAGE void go_on(Subpath *subpath, const Scene *scene, const Surface *s, int i, Uniforms choice, Uniforms random, Features f)
{
    Path *path = &subpath->path;
    path->compression = real(1);
    bounce(path, scene, s, choice.u + 2, random.u + 2, f);
    subpath->compression = subpath->compression * path->compression;
    Mask delta = path->delta;
    Real reverse = s->cos_o * path->compression;
    path->pdf_w = select(delta, real_abs(vec_dot(s->n, path->ray.d)), path->pdf_w);
    if (any(and_not(path->alive, delta)))
        reverse = select(delta, reverse, pdf_w_reverse(scene, s, path->ray.d, f));
    subpath->chain.delta[i % KEPT_RATIOS] = delta;
    NOTE_DELTA(f.use & USE_LIGHT_PATHS ? 1 : 0, i, delta);
    subpath->chain.ratio[(i - 1) % KEPT_RATIOS] = reverse * subpath->to_before / subpath->p_before;
}

/* p_nee/p_0 of a point on light i at which a receiver sees it: 1/p_i by next event estimation, and 1/pdf_w for the point on an
   area light, 0 if it cannot be one. */
INLINE Real nee_over_start(const Emitters *emitters, Index i, Real inverse_choice, Real inverse_pdf_w, Real dd, Real cosine, Features f)
{
    Real choice = f.has & HAS_MANY_LIGHTS ? gather(emitters->inverse_choice, i) / inverse_choice : real(1);
    if (!(f.has & HAS_AREA))
        return choice;
    Mask area = index_of_light(emitters->kind, i, f) == index_of(EMITTER_AREA);
    Real place = of_light(emitters->area, i, f) * cosine * inverse_square(dd) / inverse_pdf_w;
    return select(area, only(inverse_pdf_w > real(0), choice * place), choice);
}

/* The densities of light i's first ray, with the choice of the light. */
INLINE EmitPdf start_pdf(const Emitters *emitters, Index i, Vec o, Vec d, Features f)
{
    EmitPdf pdf = pdf_of_first_ray(emitters, i, o, d, f);
    if (f.has & HAS_MANY_LIGHTS)
        pdf.p_0 = pdf.p_0 / gather(emitters->inverse_choice, i);
    return pdf;
}

/* (s, 1): y_{s-1}, at p on a slot, reaches the eye with this flux times f, sr⁻¹, and the cosine of its surface. */
INLINE void splat(Pair *pair, int s, const Eye *eye, Vec p, Index slot, Light light, Mask active, const Joined *joined,
    const size_t items[], Splats *splats, Features f)
{
    Ray shadow = {p, eye->wi, eye->to_near, slot};
    light = light_scale(light, eye->weight * share_of(pair, s, 1, joined, f));
    active &= light_max(light) > real(0);
    if (!any(active))
        return;
    Mask arrives = comes_through(&pair->light.path, pair->scene, &shadow, active, index_of(-1), &light, f);
    NOTE_ARRIVAL(arrives);
    give_splats(splats, items, pair->scene, only(arrives, eye->x), only(arrives, eye->y), light, arrives, f);
}

/* (s, 1) of s >= 2. */
STAGE void join_to_eye(Pair *pair, int s, const Surface *y, Mask active, const Real lens[2], const size_t items[], Splats *splats,
    Features f)
{
    const Scene *scene = pair->scene;
    const LightVertex *at = &pair->y[s - 1];
    Eye eye = eye_from(&scene->camera, y->p, lens, f);
    Real cosine = vec_dot(y->n, eye.wi), face = real_abs(vec_dot(y->face, eye.wi));
    active &= eye.seen & can_receive(y, cosine, f);
    if (!any(active))
        return;
    Evaluation surface = evaluate_at(scene, y, eye.wi, cosine, as_flux(f));
    Joined joined = {.nee_over_start = pair->nee_over_start, .met = pair->start.met};
    joined.y = eye.weight * face / at->p_forward;
    joined.y_before = pdf_w_reverse(scene, y, eye.wi, f) * at->to_before / at->p_before;
    splat(pair, s, &eye, y->p, y->slot, light_scale(light_mul(at->alpha, surface.f_r), face), active, &joined, items, splats, f);
}

/* y_0, and (1, 1), by which only an area light is seen. Sets the first ray. */
STAGE void start_light_subpath(Pair *pair, const Rng *rng, Mask active, const size_t items[], Splats *splats, Features f)
{
    const Scene *scene = pair->scene;
    const Emitters *emitters = &scene->emitters;
    Path *path = &pair->light.path;
    Index first = index_of(LIGHT_SUBPATH);
    Uniforms random = random_block(rng, first, DIMENSION_EMITTER, f), choice = random_block(rng, first, DIMENSION_CAMERA, f);
    Uniforms lens = {{real(0)}};
    Features by_table = f;
    Real inverse_choice;
    by_table.use &= ~USE_CONTRIBUTION;
    Index i = pair->emitter = choose_light(emitters, NULL, choice.u[0], choice.u[1], &inverse_choice, by_table);
    FirstRay ray = sample_first_ray(emitters, i, random.u, random.u + 2, f);
    Light emission = emission_of(emitters, i, f);
    EmitPdf start = pair->start = start_pdf(emitters, i, ray.o, ray.d, f);
    path_start(path, active);
    path->alive = active;
    path->rng = *rng;
    path->roulette = choice.u[2];
    path->ray = (Ray){ray.o, ray.d, real(NUM_MAX), ray.from};
    path->flux = light_scale(light_mul(ray.flux, emission), inverse_choice);
    path->pdf_w = start.p_1;
    pair->light.p_own = start.p_0;
    pair->light.chain.delta[0] = mask_none();
    pair->y[0] = (LightVertex){.alpha = light_scale(emission, real(1) / start.p_0), .alive = active, .p_forward = start.p_0};
    pair->vertices = 1;
    NOTE_VERTEX(1, 0, ray.o);
    if (!(f.has & HAS_AREA) || !is_wanted(scene, 1, 1))
        return;
    if (f.has & HAS_LENS)
        lens = random_block(rng, first, DIMENSION_VERTEX, f);
    Eye eye = eye_from(&scene->camera, ray.o, lens.u, f);
    Real cosine = area_cosine(emitters, i, ray.o, eye.wi, f);
    active &= eye.seen & (cosine > real(0)) & (index_of_light(emitters->kind, i, f) == index_of(EMITTER_AREA));
    Joined joined = {.y = eye.weight * cosine / start.p_0, .nee_over_start = real(1), .met = mask_all()};
    splat(pair, 1, &eye, ray.o, ray.from, light_scale(pair->y[0].alpha, cosine), active, &joined, items, splats, f);
}

/* One more vertex of the light subpath, y_n. */
STAGE void light_subpath_step(Pair *pair, int n, const size_t items[], Splats *splats, Features f)
{
    const Scene *scene = pair->scene;
    Subpath *light = &pair->light;
    Path *path = &light->path;
    LightVertex *y = &pair->y[n];
    Mask front;
    path->rays += path->alive;
    Hit hit = shapes_hit_or_light(&scene->shapes, &path->ray, &path->alive, mask_none(), mask_none(), 0, f);
    path->alive &= hit.slot >= index_of(0);
    if (!any(path->alive))
        return;
    Surface s = surface_at(&scene->shapes, &scene->materials, &path->ray, hit, &front, f);
    Real inverse_dd = inverse_square(hit.t * hit.t), across = inverse_dd;
    Real leaving = n == 1 ? pair->start.cosine : real_abs(vec_dot(light->face, path->ray.d));
    Mask far = n == 1 ? pair->start.far : mask_none();
    if (any(far))
        across = select(far, real(1), across);
    arrive(light, &s, path->pdf_w * s.cos_face * across, select(far, real(1), leaving * inverse_dd));
    if (n == 1) {
        Receiver at = {s.p, s.n, s.slot, s.both_sides};
        Index i = pair->emitter;
        Real inverse_pdf_w = inverse_pdf_w_hit(&scene->emitters, i, &at, hit.t, leaving, f);
        if (f.has & (HAS_FLAT_LIGHT | HAS_MESH_LIGHT))
            inverse_pdf_w = only(mask_not(is_itself(&scene->emitters, i, &at, f)), inverse_pdf_w);
        Real inverse_choice = inverse_choice_of(&scene->emitters, &at, path->alive, i, f);
        pair->nee_over_start =
            nee_over_start(&scene->emitters, i, inverse_choice, inverse_pdf_w, hit.t * hit.t, leaving, f);
    }
    if (f.has & HAS_SMOOTH)
        path->flux = light_scale(path->flux, arriving_flux(&s));
    if (!(f.has & BRIGHT_WHERE_BLACK))
        path->alive &= light_max(s.reflectance) > real(0);
    *y = (LightVertex){s, light_mul(path->flux, path->throughput), and_not(path->alive, s.delta), light->p_own, light->p_before,
        light->to_before};
    pair->vertices = n + 1;
    NOTE_VERTEX(1, n, s.p);
    Rng *rng = &path->rng;
    Index block = index_of(LIGHT_SUBPATH + n);
    Uniforms random = random_block(rng, block, DIMENSION_VERTEX, f), choice = {{real(0)}};
    if (f.has & (HAS_BLEND | FINITE_TRANSMITTING))
        choice = random_block(rng, block, DIMENSION_CHOICE, f);
    if (is_wanted(scene, n + 1, 1))
        join_to_eye(pair, n + 1, &s, y->alive, random.u, items, splats, f);
    if (n + 1 >= pair->most_s) {
        path->alive = mask_none();
        return;
    }
    go_on(light, scene, &s, n, choice, random, as_flux(f));
    if (f.has & HAS_SMOOTH)
        path->flux = light_scale(path->flux, face_over_shading(&s, path->ray.d));
}

/* (0, t): the eye subpath has met light i, whose densities for a path from it these are. */
INLINE Light weigh_met(Pair *pair, int t, Index i, const EmitPdf *start, Real inverse_pdf_w, Real p_reverse, Real dd, Light light, Features f)
{
    const Emitters *emitters = &pair->scene->emitters;
    const Subpath *eye = &pair->eye;
    Receiver at = last_receiver(&eye->path);
    Joined joined = {.z = start->p_0 / p_reverse, .met = mask_all()};
    Real from = real_abs(vec_dot(eye->face, eye->path.ray.d)) * select(start->far, real(1), inverse_square(dd));
    joined.z_before = start->p_1 * from / eye->p_own;
    joined.nee_over_start = real(1);
    if (t > 2)
        joined.nee_over_start = nee_over_start(
            emitters, i, inverse_choice_of(emitters, &at, eye->path.alive, i, f), inverse_pdf_w, dd, start->cosine, f);
    else
        joined.z = select(start->far, real(0), joined.z); /* no (1, 1) */
    return light_scale(light, share_of(pair, 0, t, &joined, f));
}

/* (0, t), before `arrive`: the eye subpath's p_own is that of the vertex before. */
STAGE Light bidirectional_emission(Pair *pair, int t, Hit hit, const Surface *s, Mask front, Real p_reverse, Features f)
{
    const Scene *scene = pair->scene;
    const Emitters *emitters = &scene->emitters;
    const Path *path = &pair->eye.path;
    Light light = light_all(real(0));
    if (f.has & HAS_AREA) {
        LightMet met = light_met(path, scene, hit, s, front, f);
        if (any(met.shines)) {
            Receiver at = last_receiver(path);
            EmitPdf start = start_pdf(emitters, met.i, s->p, s->wo, f);
            Real inverse_pdf_w = inverse_pdf_w_hit(emitters, met.i, &at, hit.t, s->cos_face, f);
            start.cosine = s->cos_face;
            if (f.has & (HAS_FLAT_LIGHT | HAS_MESH_LIGHT))
                inverse_pdf_w = only(mask_not(is_itself(emitters, met.i, &at, f)), inverse_pdf_w);
            light = light_only(met.shines,
                weigh_met(pair, t, met.i, &start, inverse_pdf_w, p_reverse, hit.t * hit.t, met.emission, f));
        }
    }
    Mask missed = path->alive & (hit.slot < 0);
    if ((f.has & HAS_ANY(SKIES)) && any(missed)) {
        Light radiance = light_all(real(0));
        Index i = index_of(emitters->sky);
#define X(NAME, name, words)                                                                                 \
    if ((f.has & HAS_##NAME) && emitters->kind[emitters->sky] == EMITTER_##NAME)                             \
        radiance = name##_radiance(emitters, path->ray.d);
        SKIES(X)
#undef X
        EmitPdf start = start_pdf(emitters, i, path->ray.o, vec_neg(path->ray.d), f);
        Light met = weigh_met(pair, t, i, &start, real(0), path->pdf_w, real(1), radiance, f);
        light = light_add(light, light_only(missed, met));
    }
    return light;
}

/* What the eye subpath gets by way of its last vertex. */
INLINE void gather_light(Pair *pair, const Scene *scene, const Ray *shadow, Index target, Light light, Mask active, Features f)
{
    Path *path = &pair->eye.path;
    active &= light_max(light) > real(0);
    if (!any(active))
        return;
    Mask arrives = comes_through(path, scene, shadow, active, target, &light, f);
    NOTE_ARRIVAL(arrives);
    path->radiance = light_add(path->radiance, light_only(arrives, light));
}

/* p_reverse of the eye's vertex before, over its own: by way of z from wi. */
INLINE Real eye_ratio_before(const Pair *pair, const Surface *z, Vec wi, int t, Features f)
{
    const Subpath *eye = &pair->eye;
    return t > 2 ? pdf_w_reverse(pair->scene, z, wi, f) * eye->to_before / eye->p_before : real(0);
}

/* (1, t). */
STAGE void bidirectional_next_event(
    Pair *pair, int t, const Surface *z, Light alpha, Mask active, const Real choice[2], const Real point[2], Features f)
{
    const Scene *scene = pair->scene;
    const Emitters *emitters = &scene->emitters;
    Receiver at = {z->p, z->n, z->slot, z->both_sides};
    Real inverse_choice;
    Index i = choose_light(emitters, &at, choice[0], choice[1], &inverse_choice, f);
    LightSample sample = sample_light_point(emitters, i, inverse_choice, &at, point[0], point[1], f);
    Real cosine = vec_dot(z->n, sample.wi), dd = sample.distance * sample.distance;
    active &= can_receive(z, cosine, f) & (light_max(sample.weight) > real(0));
    if (!any(active))
        return;
    Evaluation surface = evaluate_at(scene, z, sample.wi, cosine, f);
    Light light = light_scale(light_mul(surface.f_r, sample.weight), received(cosine, f));
    Vec o = vec_add(z->p, vec_scale(sample.wi, sample.distance));
    EmitPdf start = start_pdf(emitters, i, o, vec_neg(sample.wi), f);
    NOTE_VERTEX(2, 0, o);
    Real inverse_dd = select(start.far, real(1), inverse_square(dd)), face = real_abs(vec_dot(z->face, sample.wi));
    start.cosine = real_abs(start.cosine);
    Joined joined = {.y = surface.pdf_w * start.cosine * inverse_dd / start.p_0,
        .z = start.p_1 * face * inverse_dd / pair->eye.p_own,
        .z_before = eye_ratio_before(pair, z, sample.wi, t, f),
        .nee_over_start = nee_over_start(emitters, i, inverse_choice, sample.inverse_pdf_w / inverse_choice, dd, start.cosine, f),
        .met = start.met};
    light = light_scale(light_mul(alpha, light), share_of(pair, 1, t, &joined, f));
    Ray shadow = {z->p, sample.wi, sample.distance, z->slot};
    gather_light(pair, scene, &shadow, sample.slot, light, active, f);
}

/* (s, t) of s, t >= 2. */
STAGE void join(Pair *pair, int s, int t, const Surface *z, Light alpha, Mask active, Features f)
{
    const Scene *scene = pair->scene;
    const LightVertex *y = &pair->y[s - 1];
    Vec between = vec_sub(y->at.p, z->p);
    Real dd = vec_dot(between, between), d = real_sqrt(dd), inverse_dd = inverse_square(dd);
    Vec wi = vec_scale(between, real_sqrt(inverse_dd)), wo = vec_neg(wi);
    Real cos_z = vec_dot(z->n, wi), cos_y = vec_dot(y->at.n, wo);
    active &= y->alive & can_receive(z, cos_z, f) & can_receive(&y->at, cos_y, f) & (dd > real(LEAST_SQUARE));
    if (!any(active))
        return;
    Evaluation at_z = evaluate_at(scene, z, wi, cos_z, f), at_y = evaluate_at(scene, &y->at, wo, cos_y, as_flux(f));
    Real face_y = real_abs(vec_dot(y->at.face, wi)) * inverse_dd, face_z = real_abs(vec_dot(z->face, wi)) * inverse_dd;
    Light light = light_mul(light_mul(alpha, at_z.f_r), light_mul(y->alpha, at_y.f_r));
    Joined joined = {.y = at_z.pdf_w * face_y / y->p_forward,
        .y_before = pdf_w_reverse(scene, &y->at, wo, f) * y->to_before / y->p_before,
        .z = at_y.pdf_w * face_z / pair->eye.p_own,
        .z_before = eye_ratio_before(pair, z, wi, t, f),
        .nee_over_start = pair->nee_over_start,
        .met = pair->start.met};
    light = light_scale(light, received(cos_z, f) * face_y * share_of(pair, s, t, &joined, f));
    Ray shadow = {z->p, wi, d, z->slot};
    gather_light(pair, scene, &shadow, y->at.slot, light, active, f);
}

/* One more vertex of the eye subpath, z_{t-1}, and all that it joins. */
STAGE void eye_subpath_step(Pair *pair, int t, const Real lens[2], Features f)
{
    const Scene *scene = pair->scene;
    Subpath *eye = &pair->eye;
    Path *path = &eye->path;
    Mask front;
    Hit hit = next_hit(path, scene, mask_none(), f);
    if (!any(path->alive))
        return;
    Surface z = surface_at(&scene->shapes, &scene->materials, &path->ray, hit, &front, f);
    Real inverse_dd = inverse_square(hit.t * hit.t);
    Real p_reverse = path->pdf_w * z.cos_face * inverse_dd;
    if (t == 2) {
        Eye seen = eye_from(&scene->camera, z.p, lens, f);
        p_reverse = seen.weight * z.cos_face;
    }
    Light alpha = light_scale(path->throughput, eye->compression);
    NOTE_VERTEX(0, t - 1, z.p);
    NOTE_VERTEX(2, 0, z.p);
    if (is_wanted(scene, 0, t)) {
        Light met = bidirectional_emission(pair, t, hit, &z, front, p_reverse, f);
        path->radiance = light_add(path->radiance, light_only(path->alive, light_mul(alpha, met)));
    }
    path->alive = goes_on(path, scene, hit);
    if (!(f.has & BRIGHT_WHERE_BLACK))
        path->alive &= light_max(z.reflectance) > real(0);
    if (!any(path->alive))
        return;
    arrive(eye, &z, p_reverse, real_abs(vec_dot(eye->face, path->ray.d)) * inverse_dd);
    Uniforms random = random_block(&path->rng, path->depth, DIMENSION_VERTEX, f), choice = choices(path, f);
    Mask finite = and_not(path->alive, z.delta);
    if (any(finite)) {
        if (scene->emitters.count && is_wanted(scene, 1, t))
            bidirectional_next_event(pair, t, &z, alpha, finite, choice.u, random.u, f);
        for (int s = 2; s <= pair->vertices && s + t - 1 <= pair->most_edges; s++)
            if (is_wanted(scene, s, t))
                join(pair, s, t, &z, alpha, finite, f);
    }
    go_on(eye, scene, &z, t - 1, choice, random, f);
}

/* A pair of subpaths in each active lane. Returns those whose eye subpath never ends. */
STAGE Mask trace_pair(Pair *pair, const Start *start, Mask active, const size_t items[], Splats *splats, Features f)
{
    const Scene *scene = pair->scene;
    Path *eye = &pair->eye.path;
    Mask endless = mask_none();
    Uniforms lens = {{real(0)}};
    pair->vertices = 0;
    if (scene->emitters.count) {
        start_light_subpath(pair, &start->rng, active, items, splats, f);
        for (int n = 1; n < pair->most_s && any(pair->light.path.alive); n++)
            light_subpath_step(pair, n, items, splats, f);
    }
    path_start(eye, active);
    eye->alive = active;
    eye->rng = start->rng;
    eye->ray = start->ray;
    eye->roulette = start->roulette;
    eye->first_hit = start->hit;
    pair->eye.compression = pair->eye.p_own = real(1);
    pair->eye.face = vec_all(real(0));
    if (f.has & HAS_LENS)
        lens = random_block(&eye->rng, index_of(0), DIMENSION_EMITTER, f);
    for (int t = 2; any(eye->alive); t++) {
        eye_subpath_step(pair, t, lens.u, f);
        endless |= eye->alive & (eye->depth + 1 >= index_of(PATH_LIMIT));
        eye->alive = and_not(eye->alive, endless);
    }
    return endless;
}
