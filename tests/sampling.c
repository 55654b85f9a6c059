/* The header functions over arrays, for tests/test_sampling.py, test_densities.py, test_materials.py and
   test_surfaces.py. Each entry takes n columns of numbers, in[row * n + i], and gives as many, out[row * n + i];
   LANES of them go at a time. */
#include <stddef.h>

/* What a pair of subpaths tells of itself, one lane's: pairs() below. */
enum { NOTED_VERTICES = 8, NOTED = 4 + 5 * NOTED_VERTICES };
typedef struct {
    double point[3][NOTED_VERTICES + 1][3]; /* of the eye's subpath, of the light's, of a light itself */
    int delta[2][NOTED_VERTICES + 1];
    double other[NOTED_VERTICES], *rows;
    size_t count, room, sample;
} Notes;
static Notes notes;
static void note_weight(int s, int t, double weight);
#define NOTE_VERTEX(side, n, p)                                                                              \
    do {                                                                                                     \
        if ((n) < NOTED_VERTICES)                                                                            \
            vec_lane(&(p), 0, notes.point[side][n]);                                                         \
    } while (0)
#define NOTE_DELTA(side, n, is)                                                                              \
    do {                                                                                                     \
        if ((n) < NOTED_VERTICES)                                                                            \
            notes.delta[side][n] = LANE(is, 0) != 0;                                                         \
    } while (0)
#define NOTE_STRATEGY(s, density)                                                                            \
    do {                                                                                                     \
        if ((s) < NOTED_VERTICES)                                                                            \
            notes.other[s] = (double)LANE(density, 0);                                                       \
    } while (0)
#define NOTE_WEIGHT(s, t, weight) note_weight(s, t, (double)LANE(weight, 0))
#define NOTE_ARRIVAL(arrives)                                                                                \
    do {                                                                                                     \
        if (notes.count && LANE(arrives, 0))                                                                 \
            notes.rows[(notes.count - 1) * NOTED + 3] = 1;                                                   \
    } while (0)

#include "estimators/bidirectional.h"
#include "estimators/through.h"
#include "prepare/prepare.h"
#include "scene/stacks.h"

typedef struct {
    const double *in;
    double *out;
    size_t n, at; /* columns, and which of them lane 0 works on */
} Block;

/* Row `row` of the block; lanes beyond the last column repeat it. */
INLINE Real get(const Block *b, size_t row)
{
    Real a = real(0);
    for (size_t lane = 0; lane < LANES; lane++)
        LANE(a, lane) = (Num)b->in[row * b->n + (b->at + lane < b->n ? b->at + lane : b->n - 1)];
    return a;
}
INLINE Vec get_vec(const Block *b, size_t row) { return vec(get(b, row), get(b, row + 1), get(b, row + 2)); }
INLINE Index get_index(const Block *b, size_t row)
{
    Index a = index_of(0);
    for (size_t lane = 0; lane < LANES; lane++)
        LANE(a, lane) = (Int)b->in[row * b->n + (b->at + lane < b->n ? b->at + lane : b->n - 1)];
    return a;
}

INLINE void put(Block *b, size_t row, Real a)
{
    for (size_t lane = 0; lane < LANES && b->at + lane < b->n; lane++)
        b->out[row * b->n + b->at + lane] = (double)LANE(a, lane);
}
INLINE void put_vec(Block *b, size_t row, Vec a)
{
    put(b, row, a.x);
    put(b, row + 1, a.y);
    put(b, row + 2, a.z);
}
INLINE void put_light(Block *b, size_t row, Light a)
{
    put(b, row, a.r);
    put(b, row + 1, a.g);
    put(b, row + 2, a.b);
}
INLINE void put_index(Block *b, size_t row, Index a)
{
    for (size_t lane = 0; lane < LANES && b->at + lane < b->n; lane++)
        b->out[row * b->n + b->at + lane] = (double)LANE(a, lane);
}
INLINE void put_mask(Block *b, size_t row, Mask a) { put(b, row, only(a, real(1))); }

/* void NAME(scene, n, in, out), whose body works on one block b of columns. */
#define OVER_COLUMNS(name)                                                                                   \
    static void name##_block(const Scene *scene, Block *b);                                                     \
    extern void name(const void *scene, size_t n, const double *in, double *out);                            \
    void name(const void *scene, size_t n, const double *in, double *out)                                    \
    {                                                                                                        \
        Block b = {in, out, n, 0};                                                                           \
        for (; b.at < n; b.at += LANES)                                                                      \
            name##_block(scene, &b);                                                                            \
    }                                                                                                        \
    static void name##_block(const Scene *scene, Block *b)

/* ---- sample.h: (u, v, extent) to (x, y, z, pdf). */
OVER_COLUMNS(hemisphere_uniform)
{
    (void)scene;
    put_vec(b, 0, sample_hemisphere_uniform(get(b, 0), get(b, 1)));
    put(b, 3, pdf_w_hemisphere_uniform());
}
OVER_COLUMNS(hemisphere_cosine)
{
    (void)scene;
    Vec d = sample_hemisphere_cosine(get(b, 0), get(b, 1));
    put_vec(b, 0, d);
    put(b, 3, pdf_w_hemisphere_cosine(d.z));
}
OVER_COLUMNS(sphere)
{
    (void)scene;
    put_vec(b, 0, sample_sphere(get(b, 0), get(b, 1)));
    put(b, 3, pdf_w_sphere());
}
OVER_COLUMNS(cone)
{
    (void)scene;
    put_vec(b, 0, sample_cone(get(b, 0), get(b, 1), get(b, 2)));
    put(b, 3, pdf_w_cone(get(b, 2)));
}
/* ---- media/phase.h: g and the direction (3), then (u, v) to (x, y, z, pdf), or the other direction to its pdf. */
OVER_COLUMNS(phase)
{
    (void)scene;
    Vec d = get_vec(b, 1), w = sample_phase(get(b, 0), d, get(b, 4), get(b, 5));
    put_vec(b, 0, w);
    put(b, 3, phase_pdf_w(get(b, 0), d, w));
}
OVER_COLUMNS(phase_pdf)
{
    (void)scene;
    put(b, 0, phase_pdf_w(get(b, 0), get_vec(b, 1), get_vec(b, 4)));
}
OVER_COLUMNS(logarithm)
{
    (void)scene;
    put(b, 0, real_log(get(b, 0)));
}
OVER_COLUMNS(square)
{
    (void)scene;
    Vec p = vec_all(real(0));
    sample_square(get(b, 0), get(b, 1), &p.x, &p.y);
    put_vec(b, 0, p);
    put(b, 3, real(0.25));
}
OVER_COLUMNS(triangle)
{
    (void)scene;
    Vec p = vec_all(real(0));
    sample_triangle(get(b, 0), get(b, 1), &p.x, &p.y);
    put_vec(b, 0, p);
    put(b, 3, real(2));
}
OVER_COLUMNS(disk)
{
    (void)scene;
    Vec p = vec_all(real(0));
    sample_disk(get(b, 0), get(b, 1), &p.x, &p.y);
    put_vec(b, 0, p);
    put(b, 3, REAL_INV_PI);
}

/* The densities at a cosine z, and of a cone: (z, extent) to (hemisphere uniform, cosine, sphere, cone). */
OVER_COLUMNS(densities)
{
    (void)scene;
    put(b, 0, pdf_w_hemisphere_uniform());
    put(b, 1, pdf_w_hemisphere_cosine(get(b, 0)));
    put(b, 2, pdf_w_sphere());
    put(b, 3, pdf_w_cone(get(b, 1)));
}

/* ---- sampler.h: (seed, pixel, sample low, sample high, vertex, dimension, 1 for Sobol') to four numbers; lanes
   share a seed. */
OVER_COLUMNS(numbers)
{
    (void)scene;
    Rng rng = {(Bits)get_index(b, 1), (Bits)get_index(b, 2), (Bits)get_index(b, 3),
        {(uint32_t)b->in[b->at], 0}};
    int dimension = (int)b->in[5 * b->n + b->at];
    Features f = {0, b->in[6 * b->n + b->at] > 0 ? USE_SOBOL : 0};
    Uniforms out = random_block(&rng, get_index(b, 4), dimension, f);
    for (size_t k = 0; k < 4; k++)
        put(b, k, out.u[k]);
}

/* ---- resampled.h: (u, which of four numbers, i, M) to the number of candidate i; lanes share all but u. */
OVER_COLUMNS(candidate_number)
{
    const double *in = b->in + b->at;
    (void)scene;
    put(b, 0, turn_by(get(b, 0), step_of((int)in[b->n], (int)in[2 * b->n], (int)in[3 * b->n])));
}

/* ---- Fresnel: (cosine, ratio) to (cosine beyond, transmittances: exact, Schlick); (cosine, η, k) to the conductor's. */
OVER_COLUMNS(dielectric)
{
    (void)scene;
    Real c = get(b, 0), ratio = get(b, 1), c_t = refracted_cosine(c, ratio);
    put(b, 0, c_t);
    put(b, 1, fresnel_transmittance(c, c_t, ratio));
    put(b, 2, schlick_transmittance(c, c_t, ratio));
}
OVER_COLUMNS(conductor)
{
    (void)scene;
    put(b, 0, fresnel_conductor(get(b, 0), get(b, 1), get(b, 2)));
}

/* ---- A scene, and the technique by which it is sampled. The description must live as long as the scene. */
extern void *scene_read(const char *file);
void *scene_read(const char *file)
{
    Description *d = description_read(file, NULL, 0, NULL, NULL);
    find_stacks(d, file, NUM_ROUNDING);
    return d;
}
extern void *scene_open(
    const void *description, int estimator, int hemisphere, int normals, int choice, int points, int schlick, int uv);
void *scene_open(
    const void *description, int estimator, int hemisphere, int normals, int choice, int points, int schlick, int uv)
{
    Technique technique = {.estimator = estimator,
        .hemisphere = hemisphere,
        .normals = normals,
        .light_choice = choice,
        .light_points = points,
        .fresnel = schlick};
    Features f = features_of(description, &technique);
    f.has |= uv ? HAS_UV : 0;
    return prepare(description, &technique, f);
}
extern void scene_close(void *scene, void *description);
void scene_close(void *scene, void *description)
{
    release(scene);
    description_free(description);
}
extern int mesh_without_uv(const void *description);
int mesh_without_uv(const void *description) { return ((const Description *)description)->shapes[0].as.mesh.without_uv; }
extern int emitter_count(const void *scene);
int emitter_count(const void *scene) { return ((const Scene *)scene)->emitters.count; }
extern int light_slot(const void *scene, int light);
int light_slot(const void *scene, int light) { return (int)((const Scene *)scene)->emitters.slot[light]; }

/* As if a lesson had been taken in this box (low x y z, high x y z): of 60 rays to each node, any number were
   seen to arrive. */
extern void learn_anything(void *scene, const double box[6], uint32_t seed);
void learn_anything(void *prepared, const double box[6], uint32_t seed)
{
    Scene *scene = prepared;
    LightTree *tree = &scene->emitters.tree;
    Lesson lesson;
    memset(&lesson, 0, sizeof lesson);
    store(lesson.low, box);
    store(lesson.high, box + 3);
    size_t numbers = lay_regions(tree, &lesson, 4);
    tree->visible = keep(scene, numbers, sizeof *tree->visible);
    tree->p_by_count = (Num)LEARNED_P_BY_COUNT;
    for (size_t k = 0; k < numbers; k++) {
        seed = seed * 1664525u + 1013904223u;
        tree->visible[k] = (Num)learned_share((seed >> 16) % 61, 60);
    }
}

/* ---- Materials: a ray (o, d) and u[4] to (wi, factor, pdf, delta, compression, n, f_r, pdf and f_r cosθ/
   pdf of wi, the row that choose_part takes, 1 where a surface is met). */
OVER_COLUMNS(scatter)
{
    Features f = scene->features;
    Ray ray = {get_vec(b, 0), get_vec(b, 3), real(NUM_MAX), index_of(-1)};
    const Real u[2] = {get(b, 6), get(b, 7)}, which[2] = {get(b, 9), get(b, 8)};
    Hit hit = shapes_hit(&scene->shapes, &ray, mask_all(), mask_none(), f);
    Mask front;
    Surface s = surface_at(&scene->shapes, &scene->materials, &ray, hit, &front, f);
    Scatter out = sample_material(&scene->materials, &s, which, u, f);
    Features asked = {f.has, f.use | USE_SURVIVAL_PDF};
    Evaluation wi = evaluate_material(&scene->materials, &s, out.wi, vec_dot(s.n, out.wi), asked);
    put_vec(b, 0, out.wi);
    put_light(b, 3, out.factor);
    put(b, 6, out.pdf_w);
    put_mask(b, 7, out.delta);
    put(b, 8, out.compression);
    put_vec(b, 9, s.n);
    put_light(b, 12, wi.f_r);
    put(b, 15, wi.pdf_w);
    put_light(b, 16, wi.factor);
    put_index(b, 19, f.has & HAS_BLEND ? choose_part(&scene->materials, &s, which[0], f) : s.row);
    put_mask(b, 20, hit.slot >= index_of(0));
}

/* A ray (o, d) and a direction to what the material met makes of light from there: (f_r, pdf, f_r cosθ/pdf). */
OVER_COLUMNS(evaluate)
{
    Features f = scene->features, asked = {f.has, f.use | USE_SURVIVAL_PDF};
    Ray ray = {get_vec(b, 0), get_vec(b, 3), real(NUM_MAX), index_of(-1)};
    Hit hit = shapes_hit(&scene->shapes, &ray, mask_all(), mask_none(), f);
    Mask front;
    Surface s = surface_at(&scene->shapes, &scene->materials, &ray, hit, &front, f);
    Vec wi = get_vec(b, 6);
    Evaluation e = evaluate_material(&scene->materials, &s, wi, vec_dot(s.n, wi), asked);
    put_light(b, 0, e.f_r);
    put(b, 3, e.pdf_w);
    put_light(b, 4, e.factor);
}

/* A ray (o, d) to the surface met, as a receiver (p, n, slot), and 1 where it can receive, being no delta. */
OVER_COLUMNS(receiver)
{
    Features f = scene->features;
    Ray ray = {get_vec(b, 0), get_vec(b, 3), real(NUM_MAX), index_of(-1)};
    Hit hit = shapes_hit(&scene->shapes, &ray, mask_all(), mask_none(), f);
    Mask front;
    Surface s = surface_at(&scene->shapes, &scene->materials, &ray, hit, &front, f);
    put_vec(b, 0, s.p);
    put_vec(b, 3, s.n);
    put_index(b, 6, hit.slot);
    put_mask(b, 7, and_not(hit.slot >= index_of(0), s.delta));
}

/* ---- Surfaces, of a scene opened for (u, v): a ray (o, d) to (1 where one is met, p, u, v, dp/du, dp/dv). */
OVER_COLUMNS(frame)
{
    Features f = scene->features;
    Ray ray = {get_vec(b, 0), get_vec(b, 3), real(NUM_MAX), index_of(-1)};
    Hit hit = shapes_hit(&scene->shapes, &ray, mask_all(), mask_none(), f);
    Mask front;
    Surface s = surface_at(&scene->shapes, &scene->materials, &ray, hit, &front, f);
    SurfaceFrame at = surface_frame(&scene->shapes, s.slot, s.of, s.p, f);
    put_mask(b, 0, hit.slot >= index_of(0));
    put_vec(b, 1, s.p);
    put(b, 4, at.u);
    put(b, 5, at.v);
    put_vec(b, 6, at.dp_du);
    put_vec(b, 9, at.dp_dv);
}

/* Two rays (o, d) to: do both meet something; is the way free from the point that the first meets to that of the second, and
   back; the lesser of its cosines at the ends, without sign. */
OVER_COLUMNS(visibility)
{
    Features f = scene->features;
    Surface at[2];
    Mask met = mask_all(), front;
    for (size_t k = 0; k < 2; k++) {
        Ray ray = {get_vec(b, 6 * k), get_vec(b, 6 * k + 3), real(NUM_MAX), index_of(-1)};
        Hit hit = shapes_hit(&scene->shapes, &ray, mask_all(), mask_none(), f);
        at[k] = surface_at(&scene->shapes, &scene->materials, &ray, hit, &front, f);
        met &= hit.slot >= index_of(0);
    }
    put_mask(b, 0, met);
    for (size_t k = 0; k < 2; k++) {
        Vec delta = vec_sub(at[1 - k].p, at[k].p);
        Real distance = vec_length(delta);
        Ray ray = {at[k].p, vec_scale(delta, real(1) / distance), distance, at[k].slot};
        put_mask(b, 1 + k, mask_not(shapes_occluded(&scene->shapes, &ray, met, at[1 - k].slot, f)));
        put(b, 3, real_min(real_abs(vec_dot(at[0].face, ray.d)), real_abs(vec_dot(at[1].face, ray.d))));
    }
}

/* ---- Lights. A receiver is (p, n, slot). */
INLINE Receiver get_receiver(const Block *b)
{
    return (Receiver){get_vec(b, 0), get_vec(b, 3), get_index(b, 6), mask_none()};
}

/* A receiver, a light and (u, v) to (wi, distance, weight, 1/pdf_w, slot). */
OVER_COLUMNS(light_sample)
{
    Receiver at = get_receiver(b);
    Index i = get_index(b, 7);
    LightSample s =
        sample_light_point(&scene->emitters, i, real(1), &at, get(b, 8), get(b, 9), scene->features);
    put_vec(b, 0, s.wi);
    put(b, 3, s.distance);
    put_light(b, 4, s.weight);
    put(b, 7, s.inverse_pdf_w);
    put_index(b, 8, s.slot);
}

/* A direction to what is seen there of an environment that is a picture: (radiance, pdf_w). */
OVER_COLUMNS(sky)
{
    Vec wi = get_vec(b, 0);
    put_light(b, 0, envmap_radiance(&scene->emitters, wi));
    put(b, 3, envmap_pdf_w(&scene->emitters, wi));
}

/* A receiver and a direction to what MIS knows of the light met there: (light or -1, distance, cosine,
   1/pdf_w). */
OVER_COLUMNS(light_hit)
{
    Features f = scene->features;
    Receiver at = get_receiver(b);
    Ray ray = {at.p, get_vec(b, 7), real(NUM_MAX), at.slot};
    Hit hit = shapes_hit(&scene->shapes, &ray, mask_all(), mask_none(), f);
    Mask front;
    Surface s = surface_at(&scene->shapes, &scene->materials, &ray, hit, &front, f);
    Light emission = light_gather(scene->emitters.slot_emission[0], s.of * 3);
    Mask shines = front & (hit.slot >= 0) & (light_max(emission) > real(0));
    Index i = gather_index(scene->emitters.slot_light, s.of);
    i = index_select(shines, i + index_select(s.slot == s.of, index_of(0), s.slot), index_of(0));
    put_index(b, 0, index_select(shines, i, index_of(-1)));
    put(b, 1, hit.t);
    put(b, 2, s.cos_face);
    put(b, 3, inverse_pdf_w_hit(&scene->emitters, i, &at, hit.t, s.cos_face, f));
}

/* A receiver and (u, v) to the light chosen and 1/p_i; a receiver and a light to its 1/p_i. */
OVER_COLUMNS(choose)
{
    Receiver at = get_receiver(b);
    Real inverse;
    put_index(b, 0, choose_light(&scene->emitters, &at, get(b, 7), get(b, 8), &inverse, scene->features));
    put(b, 1, inverse);
}
OVER_COLUMNS(choice_of)
{
    Receiver at = get_receiver(b);
    put(b, 0, inverse_choice_of(&scene->emitters, &at, mask_all(), get_index(b, 7), scene->features));
}

/* ---- L17: the number of a path to its first ray and flux (o, d, from, flux). */
OVER_COLUMNS(emit)
{
    Start start;
    memset(&start, 0, sizeof start);
    start.rng.key[0] = 20240229u;
    start.rng.pixel = (Bits)get_index(b, 0);
    start_at_light(&start, scene, scene->features);
    put_vec(b, 0, start.ray.o);
    put_vec(b, 3, start.ray.d);
    put_index(b, 6, start.ray.from);
    put_light(b, 7, start.flux);
}

/* ---- Camera: a place on the film (x, y) to its ray (o, d, tmax); a point to the eye as it sees it (seen,
   wi, distance, to_near, x, y, weight). */
OVER_COLUMNS(film_ray)
{
    const Real lens[2] = {real(0.5), real(0.5)};
    Ray ray = camera_ray(&scene->camera, get(b, 0), get(b, 1), lens, scene->features);
    put_vec(b, 0, ray.o);
    put_vec(b, 3, ray.d);
    put(b, 6, ray.tmax);
}
OVER_COLUMNS(eye)
{
    const Real lens[2] = {real(0.5), real(0.5)};
    Eye e = eye_from(&scene->camera, get_vec(b, 0), lens, scene->features);
    put_mask(b, 0, e.seen);
    put_vec(b, 1, e.wi);
    put(b, 4, e.distance);
    put(b, 5, e.to_near);
    put(b, 6, e.x);
    put(b, 7, e.y);
    put(b, 8, e.weight);
}

/* ---- Bidirectional paths: a row for each that a strategy has weighed, of up to NOTED_VERTICES vertices: (number of the
   pair, s, t, is nothing in between), then from the light on vertex i (point, is it a delta's), x_k left out, and at 4 + 4
   NOTED_VERTICES + s' the density of (s', k + 1 - s') over this one's, 0 if it cannot sample the path, -1 if there is none. */
static void note_weight(int s, int t, double weight)
{
    int k = s + t - 1;
    if (k >= NOTED_VERTICES || notes.count == notes.room)
        return;
    double *row = notes.rows + NOTED * notes.count++;
    const double head[4] = {(double)notes.sample, s, t, s == 0};
    memcpy(row, head, sizeof head);
    for (int i = 0; i < k; i++) {
        int from_light = i < s && !(s == 1 && t > 1), n = from_light ? i : k - i;
        const double *p = s == 1 && t > 1 && i == 0 ? notes.point[2][0] : notes.point[from_light][n];
        bool inner = from_light ? i < s - 1 && i > 0 : n > 0 && i > s && !(s == 0 && i == 0);
        memcpy(row + 4 + 4 * i, p, 3 * sizeof *p);
        row[7 + 4 * i] = inner && notes.delta[from_light][n];
    }
    notes.other[s] = weight;
    for (int i = 0; i < NOTED_VERTICES; i++)
        row[4 + 4 * NOTED_VERTICES + i] = i <= k ? notes.other[i] : -1;
    memset(notes.other, 0, sizeof notes.other);
}

extern size_t pairs(const void *scene, uint32_t seed, size_t n, double *rows, size_t room);
size_t pairs(const void *prepared, uint32_t seed, size_t n, double *rows, size_t room)
{
    const Scene *scene = prepared;
    Pair pair = {.scene = scene, .most_s = (int)scene->max_depth, .most_edges = (int)scene->max_depth};
    Splats splats = {NULL, 0, 0};
    size_t items[LANES] = {0}, pixels = (size_t)scene->width * (size_t)scene->height;
    Mask active = mask_none();
    memset(&notes, 0, sizeof notes);
    notes.rows = rows;
    notes.room = room;
    LANE(active, 0) = LANE(mask_all(), 0);
    for (notes.sample = 0; notes.sample < n; notes.sample++) {
        size_t pixel = notes.sample % pixels;
        Start start;
        memset(&start, 0, sizeof start);
        start.rng.key[0] = pair.light.path.rng.key[0] = pair.eye.path.rng.key[0] = seed;
        start.rng.pixel = bits_of(pixel);
        start.rng.sample_low = bits_of(notes.sample / pixels);
        start_at(&start, scene, real((double)(pixel % (size_t)scene->width)), real((double)(pixel / (size_t)scene->width)),
            scene->features);
        trace_pair(&pair, &start, active, items, &splats, scene->features);
        splats.count = 0;
    }
    free(splats.list);
    return notes.count;
}
