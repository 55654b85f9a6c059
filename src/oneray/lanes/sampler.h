/* The sampler: four numbers in (0, 1) for each choice of a path. Independent ones (rng.h), or points of a Sobol'
   sequence, which fill the square more evenly than chance: each number is uniform as before, but the samples of
   a pixel balance each other, and the error falls faster than 1/√samples where the integrand is smooth.

   Every block has a sequence of its own in four dimensions: the samples of a pixel run through it in an order of
   its own, so that blocks are uncorrelated (padding: Kollig, Keller, Efficient Multidimensional Sampling, EG
   2002). Owen's scrambling makes each point uniform: at each digit a coin, one for
   every value of the digits before it (Owen, Randomly Permuted (t,m,s)-Nets and (t,s)-Sequences, 1995). Coins
   and order are made of Philox's words for (seed, pixel, block, sample / 2^32).

   Bits are kept in reverse, the first digit lowest, where sums and products carry from earlier digits to later
   ones alone: any sequence of them is such a scramble (Burley, Practical Hash-based Owen Scrambling, JCGT 9(4),
   2020). */
#pragma once

#include "lanes/rng.h"
#include "technique.h"

INLINE Bits swap(Bits a, int by, uint32_t low) { return (a >> by & bits_of(low)) | (a & bits_of(low)) << by; }

/* The low 32 bits in reverse order. */
INLINE Bits reverse_32(Bits a)
{
    a = swap(a, 1, 0x55555555u);
    a = swap(a, 2, 0x33333333u);
    a = swap(a, 4, 0x0F0F0F0Fu);
    a = swap(a, 8, 0x00FF00FFu);
    return swap(a, 16, 0x0000FFFFu);
}

/* Owen's scramble of the low 32 bits of x; two words choose it. The summand makes every x uniform. The factor
   makes what follows the first different digit of two x independent, (x - x') · factor being uniform above its
   lowest bit: all that the variance depends on. The even products carry each digit on to those after it, for
   points by threes and more. Vegdahl, Building a Better LK Hash, 2021, with a factor of its own. */
INLINE Bits scramble(Bits x, Bits summand, Bits factor)
{
    x ^= multiply_low(x, bits_of(0x3D20ADEAu));
    x += summand;
    x = multiply_low(x, factor | bits_of(1));
    x ^= multiply_low(x, bits_of(0x05526C56u));
    x ^= multiply_low(x, bits_of(0x53A22864u));
    return x & bits_of(LOW_32);
}

/* A place in the order of samples: Owen's scramble of the index, first digit highest. Relative to that of 0, so
   that it stays below the power of two above the index: the scramble of the point makes up for the rest. */
INLINE Bits shuffle(Bits index, Bits summand, Bits factor)
{
    Bits place = scramble(reverse_32(index), summand, factor) ^ scramble(bits_of(0), summand, factor);
    return reverse_32(place);
}

/* Point `index` of Sobol's sequence, digits in reverse. A dimension's direction numbers v_k follow its primitive
   polynomial from the ones that begin it: x + 1, 1; x² + x + 1, 1 3; x³ + x + 1, 1 3 1. Joe, Kuo, Constructing
   Sobol Sequences with Better Two-Dimensional Projections, SIAM J. Sci. Comput. 30, 2008. */
INLINE void sobol_point(Bits index, Bits x[4])
{
    uint32_t v[3] = {1, 1, 1}, w[2] = {3, 3}, next = 4; /* v_k of each, v_{k+1} of two and v_{k+2} of one */
    x[0] = index;
    x[1] = x[2] = x[3] = bits_of(0);
    for (; any(index != 0); index >>= 1) {
        Bits digit = 0 - (index & 1);
        for (int d = 0; d < 3; d++)
            x[d + 1] ^= digit & bits_of(v[d]);
        uint32_t w_0 = w[0] ^ v[1] ^ v[1] << 2, after = w[1] ^ v[2] ^ v[2] << 3;
        v[0] ^= v[0] << 1;
        v[1] = w[0], w[0] = w_0;
        v[2] = w[1], w[1] = next, next = after;
    }
}

STAGE Uniforms sobol_block(const Rng *rng, Index vertex, int dimension)
{
    Bits block = (Bits)(vertex * 2 + dimension), sum[4], more[4], x[4];
    philox(block, bits_of(0), rng->pixel, rng->sample_high, rng->key, sum);
    philox(block, bits_of(1), rng->pixel, rng->sample_high, rng->key, more);
    sobol_point(shuffle(rng->sample_low, more[0], more[1]), x);
    const Bits factor[4] = {more[2], more[2] >> 16, more[3], more[3] >> 16};
    Uniforms result;
    for (int d = 0; d < 4; d++)
        result.u[d] = uniform_of(reverse_32(scramble(x[d], sum[d], factor[d])));
    return result;
}

/* Four numbers for a vertex of the path. */
STAGE Uniforms random_block(const Rng *rng, Index vertex, int dimension, Features f)
{
    return f.use & USE_SOBOL ? sobol_block(rng, vertex, dimension) : rng_block(rng, vertex, dimension);
}
