/* Random numbers by counting: a number depends on (seed, pixel, sample, dimension) alone, so that any split
   of the samples over lanes, processes or machines gives the same samples.

   Philox4x32 with 7 rounds, the fewest that pass BigCrush: Salmon, Moraes, Dror, Shaw, Parallel Random
   Numbers: As Easy as 1, 2, 3, SC 2011. The counter is (dimension, sample low, pixel, sample high), the key
   is the seed. */
#ifndef ONERAY_RNG_H
#define ONERAY_RNG_H

#include "vec.h"

/* Which block of four numbers: the camera's, and two for each vertex of the path. */
enum { DIMENSION_CAMERA, DIMENSION_BOUNCE, DIMENSION_LIGHT };

typedef struct {
    Bits pixel, sample_low, sample_high;    /* 32 bits each */
    uint32_t key[2];
} Rng;

/* Each in (0, 1), on the midpoints of 2^32 (single: 2^23) equal cells. */
typedef struct { Real u[4]; } Uniforms;

#define LOW_32 0xFFFFFFFFu

/* The product of the low halves of each 64 bits: one instruction where there is one, which the compiler does not
   find by itself. */
#if LANES > 1
typedef uint64_t Pairs __attribute__((vector_size(VECTOR_BYTES)));
INLINE Pairs multiply_low_halves(Pairs a, uint32_t by)
{
    Pairs b = (Pairs){0} + by;
#if VECTOR_BYTES == 64 && defined(__AVX512F__)
    return (Pairs)_mm512_mul_epu32((__m512i)a, (__m512i)b);
#elif VECTOR_BYTES == 32 && defined(__AVX2__)
    return (Pairs)_mm256_mul_epu32((__m256i)a, (__m256i)b);
#elif VECTOR_BYTES == 16 && defined(__SSE2__)
    return (Pairs)_mm_mul_epu32((__m128i)a, (__m128i)b);
#else
    return (a & LOW_32) * b;
#endif
}
#endif

/* The high 32 bits, and in the low half of *low the low ones, of the low half of a times a constant. */
INLINE void multiply_32(Bits a, uint32_t by, Bits *high, Bits *low)
{
#if LANES == 1
    uint64_t product = (a & LOW_32) * (uint64_t)by;
    *high = (Word)(product >> 32);
    *low = (Word)product;
#elif !defined(SINGLE)
    Bits product = multiply_low_halves(a, by);
    *high = product >> 32;
    *low = product;
#else
    Pairs even = multiply_low_halves((Pairs)a, by), odd = multiply_low_halves((Pairs)a >> 32, by);
    *high = (Bits)(even >> 32 | (odd & ~(uint64_t)LOW_32));
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

STAGE Uniforms rng_block(const Rng *rng, Index vertex, int dimension)
{
    Bits a = (Bits)(vertex * 2 + dimension), b = rng->sample_low, c = rng->pixel, d = rng->sample_high;
    uint32_t key_0 = rng->key[0], key_1 = rng->key[1];
    for (int round = 0; round < 7; round++) {
        Bits high_a, low_a, high_c, low_c;
        multiply_32(a, 0xD2511F53u, &high_a, &low_a);
        multiply_32(c, 0xCD9E8D57u, &high_c, &low_c);
        a = high_c ^ b ^ bits_of(key_0);
        c = high_a ^ d ^ bits_of(key_1);
        b = low_c;
        d = low_a;
        key_0 += 0x9E3779B9u;
        key_1 += 0xBB67AE85u;
    }
    return (Uniforms){{uniform_of(a), uniform_of(b), uniform_of(c), uniform_of(d)}};
}

#endif
