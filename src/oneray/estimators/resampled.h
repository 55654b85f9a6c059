/* T4 Resampled light samples: of M candidates the one that the visibility ray goes to, by what it promises. */
#pragma once

#include "estimators/mis.h"

/* With p̂ the light that a sample would bring if nothing were in between, and p the density of the candidates x_i,

       L_o ≈ f(y)/p̂(y) (1/M) Σ p̂(x_i)/p(x_i),    y = x_i in proportion to its promise p̂(x_i)/p(x_i).

   The mean over the choice is (1/M) Σ f(x_i)/p(x_i), right for any p̂ that is 0 only where f is: it needs each x_i
   to have the density p, and not that they are independent. So they are a lattice: the numbers of one sample, turned
   by steps that spread M of them evenly. Only the one chosen so far and the sum are kept (a reservoir).
   Talbot, Cline, Egbert, Importance Resampling for Global Illumination, EGSR 2005; Chao, A General Purpose Unequal
   Probability Sampling Plan, Biometrika 69(3), 1982; Bitterli et al., Spatiotemporal Reservoir Resampling, ACM
   TOG 39(4), 2020. */

/* Numbers to choose from the reservoir by: a block for each vertex, beyond those of PATH_LIMIT vertices. */
enum { RESERVOIR = 1 << 24 };

/* Candidate i of m turns the light's first number by i/m, and the three others by powers of 1/φ, φ⁴ = φ + 1, which
   keep any m of them apart (Roberts, The Unreasonable Effectiveness of Quasirandom Sequences, 2018). */
INLINE double step_of(int number, int i, int m)
{
    const double step[4] = {1.0 / m, 0.8191725134, 0.6710436067, 0.5497004779};
    return (double)((uint32_t)(i * step[number] * 8388608.0) & 0x7FFFFFu) / 8388608.0;
}

/* u + turn, less 1 from there on: exactly, since turns are whole cells of uniform_of, of which u is a midpoint. */
INLINE Real turn_by(Real u, double turn)
{
    return select(u < real(1 - turn), u + real(turn), u - real(1 - turn));
}

INLINE LightSample candidate(
    const Scene *scene, const Receiver *at, const Real choice[2], const Real point[2], int i, Features f)
{
    const int m = scene->candidates;
    const Real which[2] = {turn_by(choice[0], step_of(0, i, m)), turn_by(choice[1], step_of(1, i, m))};
    const Real where[2] = {turn_by(point[0], step_of(2, i, m)), turn_by(point[1], step_of(3, i, m))};
    LightSample sample = sample_light(&scene->emitters, at, which, where, f);
    sample.inverse_pdf_w = of_candidates(scene, sample.inverse_pdf_w, f);
    return sample;
}

/* p̂/p: the largest channel of what next_event would add to the path, its throughput apart, if nothing were in between.
   By luminance red and blue would have more noise, of coloured lamps up to twice the variance. */
INLINE Real promise_of(
    const Path *path, const Scene *scene, const Surface *s, const LightSample *sample, Features f)
{
    Real cosine = vec_dot(s->n, sample->wi);
    Evaluation surface = evaluate_material(&scene->materials, s, sample->wi, cosine, f);
    Real promise = light_max(light_mul(surface.f_r, sample->weight)) * received(cosine, f);
    if (f.use & USE_MIS)
        promise =
            promise * mis_weight_light(pdf_w_bounce(path, scene, &surface, f) * sample->inverse_pdf_w, f);
    return only(can_receive(s, cosine, f) & (light_max(sample->weight) > real(0)), promise);
}

/* One of M candidates, of which `taken` is the first, the sample of the numbers as they are; its weight becomes that of
   all. */
STAGE LightSample resampled_light(const Path *path, const Scene *scene, const Surface *s, const Receiver *at,
    LightSample taken, const Real choice[2], const Real point[2], Features f)
{
    taken.inverse_pdf_w = of_candidates(scene, taken.inverse_pdf_w, f);
    Real promise = promise_of(path, scene, s, &taken, f), sum = promise;
    Real u = random_block(&path->rng, path->depth + RESERVOIR, DIMENSION_VERTEX, f).u[0];
    for (int i = 1; i < scene->candidates; i++) {
        LightSample one = candidate(scene, at, choice, point, i, f);
        Real its = promise_of(path, scene, s, &one, f);
        sum = sum + its;
        Real p = only(its > real(0), its / sum);
        Mask take = (u < p) | (p >= real(1));
        u = select(take, u / p, (u - p) / (real(1) - p)); /* uniform again, given which */
        promise = select(take, its, promise);
        taken = sample_select(take, one, taken);
    }
    taken.weight = light_scale(taken.weight, only(sum > real(0), sum / (real(scene->candidates) * promise)));
    return taken;
}
