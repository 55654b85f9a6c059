/* Lanes: W numbers side by side. Everything that runs per path is written once over Real, reads like the
   scalar formula and follows W paths at once. LANES (W) and SINGLE come from the compiler's command line, one
   compilation for each.

   With W = 1 a Real is a plain number and any C99 compiler will do; else it is the vector type that gcc and
   clang share. Every operation here is exact or correctly rounded, or a fixed sequence of such, and
   contraction is off: a lane's bits depend neither on W nor on the compiler nor on the processor. */
#pragma once

#include <float.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#if FLT_EVAL_METHOD != 0
#error "numbers are computed with more digits than they have (FLT_EVAL_METHOD): -msse2 -mfpmath=sse is wanted on x86"
#endif

#ifndef LANES
#define LANES 1
#endif

#if LANES > 1 && defined(__SSE2__)
#include <immintrin.h>
#endif
#if LANES == 1 && defined(__clang__) && __clang_major__ >= 14 /* & of two masks is meant, also of one lane each */
#pragma clang diagnostic ignored "-Wbitwise-instead-of-logical"
#endif

#ifdef SINGLE
typedef float Num;
typedef int32_t Int;
typedef uint32_t Word;
#define NUM_MAX 3.402823466e+38F
#define NUM_BYTES 4
#define BY_PRECISION(in_single, in_double) in_single
#define SQRT sqrtf
#define INTRINSIC(prefix, name) prefix##_##name##_ps
#define MASK_BITS_512 _mm512_movepi32_mask
#else
typedef double Num;
typedef int64_t Int;
typedef uint64_t Word;
#define NUM_MAX 1.7976931348623157e+308
#define NUM_BYTES 8
#define BY_PRECISION(in_single, in_double) in_double
#define SQRT sqrt
#define INTRINSIC(prefix, name) prefix##_##name##_pd
#define MASK_BITS_512 _mm512_movepi64_mask
#endif
#define VECTOR_BYTES (LANES * NUM_BYTES)
#define SIGN_BIT ((uint64_t)1 << (8 * NUM_BYTES - 1))

#define INLINE static inline __attribute__((always_inline, unused))

/* Before a short loop whose counter is to be a constant. */
#ifdef __clang__
#define UNROLLED _Pragma("unroll")
#else
#define UNROLLED _Pragma("GCC unroll 8")
#endif

/* A larger step: part of each specialised instance, where the feature mask is a constant and what it lacks folds
   away; in the generic kernel a function that all calls share. One that few scenes take is there also out of the way of
   the others' registers. APART is a function everywhere: a loop that has the processor's registers to itself, or a step
   of a kind that no instance knows, calls of which fold away; inlined first, such kinds would make the instances eight
   times as long to compile. */
#ifdef SPECIALISED
#define STAGE INLINE
#else
#define STAGE static __attribute__((unused))
#endif
#define APART static __attribute__((unused, noinline))
#define SELDOM static __attribute__((unused, noinline, cold))

#if LANES == 1
typedef Num Real;
typedef Int Index;
typedef Word Bits;
#else
typedef Num Real __attribute__((vector_size(VECTOR_BYTES)));
typedef Int Index __attribute__((vector_size(VECTOR_BYTES)));
typedef Word Bits __attribute__((vector_size(VECTOR_BYTES)));
#endif

/* What a comparison gives: all ones where true, zero elsewhere (for W = 1 one or zero, as C has it). Combine
   with & and |. */
typedef Index Mask;

/* The bits of a Real, and back. */
typedef union { Real real; Bits bits; } RealOrBits;
INLINE Bits real_bits(Real a) { return (RealOrBits){.real = a}.bits; }
INLINE Real bits_real(Bits a) { return (RealOrBits){.bits = a}.real; }

/* As often as there are lanes; written out, the compiler loads it once. */
#if LANES == 1
#define EACH(a) (a)
#elif LANES == 2
#define EACH(a) {a, a}
#elif LANES == 4
#define EACH(a) {a, a, a, a}
#elif LANES == 8
#define EACH(a) {a, a, a, a, a, a, a, a}
#else
#define EACH(a) {a, a, a, a, a, a, a, a, a, a, a, a, a, a, a, a}
#endif

/* The same number in every lane. */
INLINE Real real(double a) { return (Real)EACH((Num)a); }
INLINE Index index_of(int64_t a) { return (Index)EACH((Int)a); }
INLINE Bits bits_of(uint64_t a) { return (Bits)EACH((Word)a); }

/* The product of the low halves of each 64 bits: one instruction where there is one, which the compiler does not
   find by itself. */
#if LANES > 1
typedef uint64_t Pairs __attribute__((vector_size(VECTOR_BYTES)));
INLINE Pairs multiply_halves(Pairs a, Pairs b)
{
#if VECTOR_BYTES == 64 && defined(__AVX512F__)
    return (Pairs)_mm512_mul_epu32((__m512i)a, (__m512i)b);
#elif VECTOR_BYTES == 32 && defined(__AVX2__)
    return (Pairs)_mm256_mul_epu32((__m256i)a, (__m256i)b);
#elif VECTOR_BYTES == 16 && defined(__SSE2__)
    return (Pairs)_mm_mul_epu32((__m128i)a, (__m128i)b);
#else
    return (a & 0xFFFFFFFFu) * (b & 0xFFFFFFFFu);
#endif
}

/* The high halves of a, the low halves of b. */
INLINE Pairs odd_halves(Pairs a, Pairs b)
{
#if VECTOR_BYTES == 64 && defined(__AVX512F__)
    return (Pairs)_mm512_mask_blend_epi32(0xAAAA, (__m512i)b, (__m512i)a);
#elif VECTOR_BYTES == 32 && defined(__AVX2__)
    return (Pairs)_mm256_blend_epi32((__m256i)b, (__m256i)a, 0xAA);
#else
    return (a & ~(uint64_t)0xFFFFFFFFu) | (b & 0xFFFFFFFFu);
#endif
}
#endif

/* a·b of their low 32 bits: 32 bits of it (single) or all 64 (double). */
INLINE Bits multiply_low(Bits a, Bits b)
{
#if defined(SINGLE)
    return a * b;
#elif LANES == 1
    return (a & 0xFFFFFFFFu) * (b & 0xFFFFFFFFu);
#else
    return multiply_halves(a, b);
#endif
}

/* One lane's number, and setting it. */
#if LANES == 1
#define LANE(a, i) (a)
#else
#define LANE(a, i) ((a)[i])
#endif

#if LANES == 1
INLINE Mask mask_none(void) { return 0; }
INLINE Mask mask_all(void) { return 1; }
INLINE Mask mask_not(Mask m) { return !m; }
INLINE Real select(Mask m, Real a, Real b) { return m ? a : b; }
INLINE Index index_select(Mask m, Index a, Index b) { return m ? a : b; }
#else
INLINE Mask mask_none(void) { return (Mask){0}; }
INLINE Mask mask_all(void) { return (Mask){0} - 1; }
INLINE Mask mask_not(Mask m) { return ~m; }
INLINE Real select(Mask m, Real a, Real b)
{
#if VECTOR_BYTES == 32 && defined(__AVX2__)
    return (Real)INTRINSIC(_mm256, blendv)(b, a, (Real)m);
#else
    return bits_real(((Bits)m & real_bits(a)) | (~(Bits)m & real_bits(b)));
#endif
}
INLINE Index index_select(Mask m, Index a, Index b) { return (Index)select(m, (Real)a, (Real)b); }
#endif

/* A bit a lane, lane 0 lowest. */
INLINE unsigned mask_bits(Mask m)
{
#if VECTOR_BYTES == 64 && defined(__AVX512DQ__)
    return MASK_BITS_512((__m512i)m);
#elif VECTOR_BYTES == 32 && defined(__AVX2__)
    return (unsigned)INTRINSIC(_mm256, movemask)((Real)m);
#elif VECTOR_BYTES == 16 && defined(__SSE2__)
    return (unsigned)INTRINSIC(_mm, movemask)((Real)m);
#else
    unsigned bits = 0;
    for (int i = 0; i < LANES; i++)
        bits |= (unsigned)(LANE(m, i) & 1) << i;
    return bits;
#endif
}
/* The other way round. */
INLINE Mask lanes_mask(unsigned bits)
{
    Index own = {0};
    for (int lane = 0; lane < LANES; lane++)
        LANE(own, lane) = (Int)1 << lane;
    return (index_of(bits) & own) != 0;
}
INLINE int any(Mask m) { return mask_bits(m) != 0; }

/* The lowest lane of bits that are not all 0. */
INLINE int lowest_lane(unsigned bits) { return __builtin_ctz(bits); }

INLINE Mask and_not(Mask a, Mask b) { return a & mask_not(b); }              /* a and not b */
INLINE Real only(Mask m, Real a) { return select(m, a, real(0)); }           /* a, or 0 where not m */

/* b where either is nan. */
INLINE Real real_min(Real a, Real b)
{
#if VECTOR_BYTES == 64 && defined(__AVX512F__)
    return (Real)INTRINSIC(_mm512, min)(a, b);
#elif VECTOR_BYTES == 32 && defined(__AVX2__)
    return (Real)INTRINSIC(_mm256, min)(a, b);
#else
    return select(a < b, a, b);
#endif
}
INLINE Real real_max(Real a, Real b)
{
#if VECTOR_BYTES == 64 && defined(__AVX512F__)
    return (Real)INTRINSIC(_mm512, max)(a, b);
#elif VECTOR_BYTES == 32 && defined(__AVX2__)
    return (Real)INTRINSIC(_mm256, max)(a, b);
#else
    return select(a > b, a, b);
#endif
}
INLINE Real real_abs(Real a) { return bits_real(real_bits(a) & ~bits_of(SIGN_BIT)); }

/* a with its sign flipped where b is negative (or -0). */
INLINE Real flip_sign(Real a, Real b)
{
    return bits_real(real_bits(a) ^ (real_bits(b) & bits_of(SIGN_BIT)));
}

INLINE Real real_sqrt(Real a)
{
#if VECTOR_BYTES == 64 && defined(__AVX512F__)
    return (Real)INTRINSIC(_mm512, sqrt)(a);
#elif VECTOR_BYTES == 32 && defined(__AVX2__)
    return (Real)INTRINSIC(_mm256, sqrt)(a);
#elif VECTOR_BYTES == 16 && defined(__SSE2__)
    return (Real)INTRINSIC(_mm, sqrt)(a);
#else
    Real b = {0};
    for (int i = 0; i < LANES; i++)
        LANE(b, i) = SQRT(LANE(a, i));
    return b;
#endif
}

/* table[i] for each lane's i. */
INLINE Real gather(const Num *table, Index i)
{
    Real a = {0};
    for (int lane = 0; lane < LANES; lane++)
        LANE(a, lane) = table[LANE(i, lane)];
    return a;
}

INLINE Index gather_index(const Int *table, Index i)
{
    Index a = {0};
    for (int lane = 0; lane < LANES; lane++)
        LANE(a, lane) = table[LANE(i, lane)];
    return a;
}

/* In each lane the number of the lane named. */
INLINE Index index_of_lanes(Index a, Index lane)
{
    (void)lane;
#if LANES > 1 && !defined(__clang__)
    return __builtin_shuffle(a, lane);
#else
    Index b = a;
    for (int k = 0; k < LANES; k++)
        LANE(b, k) = LANE(a, (int)LANE(lane, k));
    return b;
#endif
}
INLINE Real real_of_lanes(Real a, Index lane)
{
    return bits_real((Bits)index_of_lanes((Index)real_bits(a), lane));
}

/* From rows of four floats, ROWS(k) those of lanes k, k + 4, … side by side, to four numbers of each lane. */
#define TRANSPOSE_FOURS(Type, prefix)                                                                        \
    Type row_0 = ROWS(0), row_1 = ROWS(1), row_2 = ROWS(2), row_3 = ROWS(3);                                 \
    Type a = prefix##_unpacklo_ps(row_0, row_1), b = prefix##_unpacklo_ps(row_2, row_3);                     \
    Type c = prefix##_unpackhi_ps(row_0, row_1), d = prefix##_unpackhi_ps(row_2, row_3);                     \
    out[0] = (Real)prefix##_shuffle_ps(a, b, 0x44);                                                          \
    out[1] = (Real)prefix##_shuffle_ps(a, b, 0xEE);                                                          \
    out[2] = (Real)prefix##_shuffle_ps(c, d, 0x44);                                                          \
    out[3] = (Real)prefix##_shuffle_ps(c, d, 0xEE)

/* Four numbers in a row of a table, from table[at] on, for each lane. Reads all four also where fewer are used:
   tables have room for it at their end. */
INLINE void gather_four(const Num *table, Index at, Real out[4])
{
#if defined(SINGLE) && LANES == 16 && defined(__AVX512DQ__)
#define QUARTER(rows, k, part) _mm512_insertf32x4(rows, _mm_loadu_ps(table + at[k + 4 * part]), part)
#define ROWS(k) QUARTER(QUARTER(QUARTER(_mm512_castps128_ps512(_mm_loadu_ps(table + at[k])), k, 1), k, 2), k, 3)
    TRANSPOSE_FOURS(__m512, _mm512);
#undef QUARTER
#undef ROWS
#elif defined(SINGLE) && LANES == 8 && defined(__AVX2__)
#define ROWS(k) _mm256_loadu2_m128(table + at[k + 4], table + at[k])
    TRANSPOSE_FOURS(__m256, _mm256);
#undef ROWS
#elif !defined(SINGLE) && LANES == 8 && defined(__AVX512DQ__)
#define HALF(k) _mm256_loadu_pd(table + at[k])
#define ROWS(k) _mm512_insertf64x4(_mm512_castpd256_pd512(HALF(k)), HALF(k + 4), 1)
    __m512d row_0 = ROWS(0), row_1 = ROWS(1), row_2 = ROWS(2), row_3 = ROWS(3);
#undef ROWS
#undef HALF
    __m512d a = _mm512_unpacklo_pd(row_0, row_1), b = _mm512_unpacklo_pd(row_2, row_3);
    __m512d c = _mm512_unpackhi_pd(row_0, row_1), d = _mm512_unpackhi_pd(row_2, row_3);
    const __m512i low = _mm512_setr_epi64(0, 1, 8, 9, 4, 5, 12, 13), high = low + 2;
    out[0] = (Real)_mm512_permutex2var_pd(a, low, b);
    out[1] = (Real)_mm512_permutex2var_pd(c, low, d);
    out[2] = (Real)_mm512_permutex2var_pd(a, high, b);
    out[3] = (Real)_mm512_permutex2var_pd(c, high, d);
#elif !defined(SINGLE) && LANES == 4 && defined(__AVX2__)
    __m256d row_0 = _mm256_loadu_pd(table + at[0]), row_1 = _mm256_loadu_pd(table + at[1]);
    __m256d row_2 = _mm256_loadu_pd(table + at[2]), row_3 = _mm256_loadu_pd(table + at[3]);
    __m256d a = _mm256_unpacklo_pd(row_0, row_1), b = _mm256_unpacklo_pd(row_2, row_3);
    __m256d c = _mm256_unpackhi_pd(row_0, row_1), d = _mm256_unpackhi_pd(row_2, row_3);
    out[0] = (Real)_mm256_permute2f128_pd(a, b, 0x20);
    out[1] = (Real)_mm256_permute2f128_pd(c, d, 0x20);
    out[2] = (Real)_mm256_permute2f128_pd(a, b, 0x31);
    out[3] = (Real)_mm256_permute2f128_pd(c, d, 0x31);
#else
    for (int k = 0; k < 4; k++)
        out[k] = gather(table + k, at);
#endif
}

/* All `size` numbers of each lane's row of a table of structs, a multiple of four; a member by name: out[IN_ROW(Name,
   member)]. */
#define IN_ROW(Name, member) (offsetof(Name, member) / sizeof(Num))
INLINE void gather_row(const void *table, Index row, int size, Real *out)
{
    UNROLLED for (int k = 0; k < size; k += 4)
        gather_four((const Num *)table + k, row * size, out + k);
}

/* Numbers below the first, 2^22 or 2^51, and the second, 3·2^22 or 3·2^51: added to such a number, it leaves the nearest
   integer in the low bits of the fraction. */
#define INTEGER_MOST real(BY_PRECISION(4194304.0, 2251799813685248.0))
#define INTEGERS real(BY_PRECISION(12582912.0, 6755399441055744.0))

/* The integer part of a, 0 <= a < INTEGER_MOST. */
INLINE Index real_floor(Real a)
{
    const Real big = INTEGERS;
    Real nearest = (a + big) - big;
    Bits low = real_bits(nearest + big) - real_bits(big);
    return (Index)low - index_select(nearest > a, index_of(1), index_of(0));
}

/* The same number, 0 <= i < INTEGER_MOST. */
INLINE Real real_of(Index i)
{
    const Real big = INTEGERS;
    return bits_real((Bits)i + real_bits(big)) - big;
}

/* a - ⌊a⌋, of any sign; 0 where a has no digits behind the point but perhaps one half. */
INLINE Real real_fraction(Real a)
{
    const Real big = INTEGERS;
    Real nearest = (a + big) - big, floor = nearest - only(nearest > a, real(1));
    return only(real_abs(a) < INTEGER_MOST, a - floor);
}

#define REAL_PI real(3.14159265358979323846)
#define REAL_INV_PI real(0.318309886183790671538)

/* sine and cosine of 2π u, 0 <= u < 1. The angle is folded to an eighth of a turn either side of the nearest
   quarter; there the Taylor series reach 1e-17 (double: x^15, x^16) or 1e-8 (single: x^7, x^8). */
STAGE void sincos_turn(Real u, Real *sine, Real *cosine)
{
    Real quarters = real(4) * u;
    Index quarter = real_floor(quarters + real(0.5));
    Real x = (quarters - real_of(quarter)) * real(1.57079632679489661923);
    Real xx = x * x;
    Real s = real(-1 / 5040.0), c = real(1 / 40320.0);
#ifndef SINGLE
    s = real(-1 / 1307674368000.0) * xx + real(1 / 6227020800.0);
    s = (s * xx - real(1 / 39916800.0)) * xx + real(1 / 362880.0);
    s = s * xx - real(1 / 5040.0);
    c = real(1 / 20922789888000.0) * xx - real(1 / 87178291200.0);
    c = (c * xx + real(1 / 479001600.0)) * xx - real(1 / 3628800.0);
    c = c * xx + real(1 / 40320.0);
#endif
    s = ((s * xx + real(1 / 120.0)) * xx - real(1 / 6.0)) * xx * x + x;
    c = (((c * xx - real(1 / 720.0)) * xx + real(1 / 24.0)) * xx - real(0.5)) * xx + real(1);
    Mask odd = (quarter & 1) != 0, upper = ((quarter + 1) & 2) != 0, lower = (quarter & 2) != 0;
    Real sine_of = select(odd, c, s), cosine_of = select(odd, s, c);
    *sine = select(lower, -sine_of, sine_of);
    *cosine = select(upper, -cosine_of, cosine_of);
}

/* eˣ, -80 <= x <= 80: 2ᵏ eʸ with |y| <= ln 2/2, whose Taylor series reaches 1e-17 (double: y^13) or 1e-8 (single: y^7). */
STAGE Real real_exp(Real x)
{
    const int last = BY_PRECISION(7, 13);
    const Real big = INTEGERS;
    Real k = (x * real(1.44269504088896340736) + big) - big;
    Real y = (x - k * real(0.693145751953125)) - k * real(1.42860682030941723212e-6), sum = real(1);
    for (int n = last; n > 0; n--)
        sum = real(1) + sum * y * real(1.0 / n);
    return bits_real(real_bits(sum) + ((real_bits(k + big) - real_bits(big)) << BY_PRECISION(23, 52)));
}

/* ln a of a normal number above 0: a = 2ᵏ m, √½ < m < √2, and the series of the area tangent of (m - 1)/(m + 1), which
   reaches 1e-18 at s^23 (double) or 1e-10 at s^11 (single). */
STAGE Real real_log(Real a)
{
    const int last = BY_PRECISION(11, 23);
    Bits offset = real_bits(a) - real_bits(real(0.70710678118654752440)); /* m begins there */
    Bits k = (Bits)((Index)offset >> BY_PRECISION(23, 52));
    Real m = bits_real(real_bits(a) - (k << BY_PRECISION(23, 52)));
    Real s = (m - real(1)) / (m + real(1)), ss = s * s, sum = real(1.0 / last);
    for (int n = last - 2; n > 0; n -= 2)
        sum = real(1.0 / n) + ss * sum;
    Real count = bits_real(real_bits(INTEGERS) + k) - INTEGERS;
    return count * real(0.69314718055994530942) + (s + s) * sum;
}

/* The angle of (x, y) in [0, π], for y >= 0, not both 0. Folded to an eighth of a turn and turned back by 0, 1
   or 2 sixteenths it is below π/16, where the series of the arctangent reaches 1e-17 at t^21 (double) or 1e-9
   at t^9 (single). */
STAGE Real angle_of(Real y, Real x)
{
    const int last = BY_PRECISION(9, 21);
    Real a = real_abs(x), low = real_min(y, a), high = real_max(y, a);
    Mask one = low > real(0.19891236737965800691) * high; /* tan π/16 */
    Mask two = low > real(0.66817863791929891999) * high; /* tan 3π/16 */
    Real back_cos = select(two, real(0.70710678118654752440), real(0.92387953251128675613));
    Real back_sin = select(two, real(0.70710678118654752440), real(0.38268343236508977173));
    Real t_num = select(one, low * back_cos - high * back_sin, low);
    Real t_den = select(one, high * back_cos + low * back_sin, high);
    Real t = t_num / t_den, tt = t * t, sum = real(1.0 / last);
    for (int n = last - 2; n > 0; n -= 2)
        sum = real(1.0 / n) - tt * sum;
    Real turned = select(two, real(0.78539816339744830962), real(0.39269908169872415481));
    Real angle = t * sum + only(one, turned);
    angle = select(y > a, real(1.57079632679489661923) - angle, angle);
    return select(x < real(0), REAL_PI - angle, angle);
}
