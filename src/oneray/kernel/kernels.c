/* The kernels that were built, widest first, and which of them this processor runs. */
#include "kernel/kernel.h"

#include <string.h>

#if defined(__x86_64__)
#define HAS_WIDE __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") \
    && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl") \
    && __builtin_cpu_supports("avx512cd")
#define HAS_MIDDLE \
    __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2")
#else
#define HAS_WIDE 0
#define HAS_MIDDLE 0
#endif

/* Row: precision, lanes, processor level that it was compiled for (0 any, 1 AVX2, 2 AVX-512). From the
   Makefile. */
#define X(precision, lanes, level) extern const Kernel kernel_##precision##_##lanes;
KERNELS(X)
#undef X

static const struct {
    const Kernel *kernel;
    int level;
} rows[] = {
#define X(precision, lanes, level) {&kernel_##precision##_##lanes, level},
    KERNELS(X)
#undef X
    {NULL, 0}
};

const Kernel *kernel_built(int i) { return rows[i].kernel; }

int kernel_runs(int i)
{
    return rows[i].level == 0 || (rows[i].level == 1 && HAS_MIDDLE) || (rows[i].level == 2 && HAS_WIDE);
}

const Kernel *kernel_find(const char *precision, int lanes)
{
    for (int i = 0; rows[i].kernel; i++)
        if (!strcmp(rows[i].kernel->precision, precision) && (lanes == 0 || rows[i].kernel->lanes == lanes)
            && kernel_runs(i))
            return rows[i].kernel;
    return NULL;
}
