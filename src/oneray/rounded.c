#include "rounded.h"

typedef struct {
    double high, low;                       /* high is their sum, rounded */
} Twofold;

static Twofold two_sum(double a, double b)
{
    double sum = a + b, of_b = sum - a;
    return (Twofold){sum, (a - (sum - of_b)) + (b - of_b)};
}

static Twofold two_product(double a, double b)
{
    const double half = 134217729;          /* 2^27 + 1 */
    double a1 = half * a - (half * a - a), b1 = half * b - (half * b - b), a2 = a - a1, b2 = b - b1, product = a * b;
    return (Twofold){product, ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2};
}

static Twofold of(double a) { return (Twofold){a, 0}; }

static Twofold plus(Twofold a, Twofold b)
{
    Twofold sum = two_sum(a.high, b.high), low = two_sum(a.low, b.low);
    sum = two_sum(sum.high, sum.low + low.high);
    return two_sum(sum.high, sum.low + low.low);
}

static Twofold times(Twofold a, Twofold b)
{
    Twofold product = two_product(a.high, b.high);
    return two_sum(product.high, product.low + (a.high * b.low + a.low * b.high));
}

static Twofold minus(Twofold a) { return (Twofold){-a.high, -a.low}; }

static Twofold over(Twofold a, Twofold b)
{
    double quotient = a.high / b.high;
    Twofold rest = plus(a, minus(times(of(quotient), b)));
    return two_sum(quotient, (rest.high + rest.low) / b.high);
}

/* x - k unit, of which the unit is a sum of three doubles. */
static Twofold less(Twofold x, double k, const double unit[3])
{
    for (int i = 0; i < 3; i++)
        x = plus(x, two_product(-k, unit[i]));
    return x;
}

/* By Taylor series of at most an eighth of a turn. */
static void sine_and_cosine(double x, Twofold *sine, Twofold *cosine)
{
    const double quarter[3] = {0x1.921fb54442d18p0, 0x1.1a62633145c07p-54, -0x1.f1976b7ed8fbcp-110};
    double k = nearbyint(x / quarter[0]);
    Twofold r = less(of(x), k, quarter), minus_square = minus(times(r, r)), s = of(1), c = of(1);
    for (int n = 28; n > 0; n -= 2) {
        s = plus(of(1), over(times(s, minus_square), of(n * (n + 1.))));
        c = plus(of(1), over(times(c, minus_square), of(n * (n - 1.))));
    }
    s = times(s, r);
    int turns = (int)(k - 4 * floor(k / 4));
    *sine = turns == 0 ? s : turns == 1 ? c : turns == 2 ? minus(s) : minus(c);
    *cosine = turns == 0 ? c : turns == 1 ? minus(s) : turns == 2 ? minus(c) : s;
}

/* 2ᵏ eʳ, the Taylor series of |r| <= ln 2/2. */
static Twofold exponential(Twofold x)
{
    const double ln2[3] = {0x1.62e42fefa39efp-1, 0x1.abc9e3b39803fp-56, 0x1.7b57a079a1934p-111};
    double k = nearbyint(x.high / ln2[0]);
    Twofold r = less(x, k, ln2), e = of(1);
    for (int n = 24; n > 0; n--)
        e = plus(of(1), over(times(e, r), of(n)));
    return (Twofold){ldexp(e.high, (int)k), ldexp(e.low, (int)k)};
}

/* ln x from libm's l: x e⁻ˡ is 1 + δ. */
static Twofold logarithm(double x)
{
    double near = log(x);
    Twofold delta = plus(times(of(x), exponential(of(-near))), of(-1));
    return plus(of(near), plus(delta, times(times(delta, delta), of(-.5))));
}

double cr_sin(double x)
{
    Twofold sine, cosine;
    sine_and_cosine(x, &sine, &cosine);
    return sine.high;
}

double cr_cos(double x)
{
    Twofold sine, cosine;
    sine_and_cosine(x, &sine, &cosine);
    return cosine.high;
}

double cr_tan(double x)
{
    Twofold sine, cosine;
    sine_and_cosine(x, &sine, &cosine);
    return over(sine, cosine).high;
}

/* From libm's α: the tangent of what is left is (y cosα - x sinα)/(x cosα + y sinα). */
double cr_atan2(double y, double x)
{
    double near = atan2(y, x);
    if (y == 0 || x == 0)
        return near;
    int exponent;
    frexp(fmax(fabs(x), fabs(y)), &exponent);
    Twofold sine, cosine, to_x = of(ldexp(x, -exponent)), to_y = of(ldexp(y, -exponent));
    sine_and_cosine(near, &sine, &cosine);
    Twofold rest = plus(times(to_y, cosine), minus(times(to_x, sine)));
    return plus(of(near), over(rest, plus(times(to_x, cosine), times(to_y, sine)))).high;
}

double cr_exp(double x) { return fabs(x) < 700 ? exponential(of(x)).high : exp(x); }
double cr_expm1(double x) { return x < 700 ? plus(exponential(of(x)), of(-1)).high : expm1(x); }
double cr_log(double x) { return logarithm(x).high; }

double cr_pow(double x, double y)
{
    Twofold power = x > 0 ? times(logarithm(x), of(y)) : of(0);
    return x > 0 && fabs(power.high) < 700 ? exponential(power).high : pow(x, y);
}

/* One step of Newton's from libm's. */
double cr_cbrt(double x)
{
    double near = cbrt(x);
    if (!(near > 0x1p-300 && near < 0x1p300))
        return near;
    Twofold cube = times(of(near), two_product(near, near));
    return near - (cube.high - x + cube.low) / (3 * near * near);
}
