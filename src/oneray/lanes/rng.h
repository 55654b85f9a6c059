/* Random numbers by counting: a number depends on (seed, pixel, sample, dimension) alone, so that any split
   of the samples over lanes, processes or machines gives the same samples.

   Philox4x32 with 7 rounds, the fewest that pass BigCrush: Salmon, Moraes, Dror, Shaw, Parallel Random
   Numbers: As Easy as 1, 2, 3, SC 2011. The counter is (dimension, sample low, pixel, sample high), the key
   is the seed. */
#pragma once

#include "lanes/vec.h"

/* Which block of four numbers. The camera's: the point of the film, roulette. For each vertex of the path two:
   the point on the light, the direction of the bounce; and where there are several, which light, which part of
   the material. For the start of a light path, beside the camera's. For a stretch of a path through a medium, with
   its number counted downwards from 0 for the vertex: how far it flies. */
enum { DIMENSION_FLIGHT = -2, DIMENSION_EMITTER, DIMENSION_CAMERA, DIMENSION_VERTEX, DIMENSION_CHOICE };

typedef struct {
    Bits pixel, sample_low, sample_high;    /* 32 bits each */
    uint32_t key[2];
} Rng;

/* Each in (0, 1), on the midpoints of 2^32 (single: 2^23) equal cells. */
typedef struct { Real u[4]; } Uniforms;

#define LOW_32 0xFFFFFFFFu

/* The high 32 bits, and in the low half of *low the low ones, of the low half of a times a constant. */
INLINE void multiply_32(Bits a, uint32_t by, Bits *high, Bits *low)
{
#if LANES == 1
    uint64_t product = (a & LOW_32) * (uint64_t)by;
    *high = (Word)(product >> 32);
    *low = (Word)product;
#elif !defined(SINGLE)
    Bits product = multiply_low(a, bits_of(by));
    *high = product >> 32;
    *low = product;
#else
    Pairs factor = (Pairs){0} + by;
    Pairs even = multiply_halves((Pairs)a, factor), odd = multiply_halves((Pairs)a >> 32, factor);
    *high = (Bits)odd_halves(odd, even >> 32);
    *low = a * bits_of(by);
#endif
}

INLINE Real uniform_of(Bits word)
{
#ifdef SINGLE
    return (bits_real((word >> 9) | bits_of(0x3F800000u)) - real(1)) + real(1.0 / 16777216.0);
#else
    Real count = bits_real((word & bits_of(LOW_32)) | bits_of(0x4330000000000000u)) - real(4503599627370496.0);
    return (count + real(0.5)) * real(1.0 / 4294967296.0);
#endif
}

/* Philox's four words of 32 bits for a counter (a, b, c, d). */
STAGE void philox(Bits a, Bits b, Bits c, Bits d, const uint32_t key[2], Bits word[4])
{
    Bits key_0 = bits_of(key[0]), key_1 = bits_of(key[1]);
    for (int round = 0; round < 7; round++) {
        Bits high_a, low_a, high_c, low_c;
        multiply_32(a, 0xD2511F53u, &high_a, &low_a);
        multiply_32(c, 0xCD9E8D57u, &high_c, &low_c);
        a = high_c ^ b ^ key_0;
        c = high_a ^ d ^ key_1;
        b = low_c;
        d = low_a;
        key_0 += bits_of(0x9E3779B9u);
        key_1 += bits_of(0xBB67AE85u);
    }
    word[0] = a, word[1] = b, word[2] = c, word[3] = d;
}

STAGE Uniforms rng_block(const Rng *rng, Index vertex, int dimension)
{
    Bits word[4];
    philox((Bits)(vertex * 2 + dimension), rng->sample_low, rng->pixel, rng->sample_high, rng->key, word);
    return (Uniforms){{uniform_of(word[0]), uniform_of(word[1]), uniform_of(word[2]), uniform_of(word[3])}};
}
