/* Functions of uniform values, in double. Series, written out: they run once per world, not per voxel, and must give
 * the same bits on every host, which a host's libm does not. sqrt, fma, floor and rint are IEEE's and exact. */
#include "producers/language/base/number.h"

#include <math.h>
#include <string.h>

#define PI 3.14159265358979323846
#define LN2 0.69314718055994530942

/* pi/2 in three parts, the first two with 33 bits: products with counts up to 2^20 are exact. */
static const double half_pi[3] = {0x1.921fb544p+0, 0x1.0b4611a6p-34, 0x1.3198a2e037073p-69};

/* sin of r, |r| <= 1.2 */
static double sin_series(double r)
{
    double x = r * r, sum = 0;
    for (int k = 27; k >= 3; k -= 2)
        sum = (1 + sum) * -x / (double)(k * (k - 1));
    return r * (1 + sum);
}

static double cos_series(double r)
{
    double x = r * r, sum = 0;
    for (int k = 26; k >= 2; k -= 2)
        sum = (1 + sum) * -x / (double)(k * (k - 1));
    return 1 + sum;
}

static double sin_quadrant(double x, int quarter)
{
    if (!isfinite(x))
        return (double)NAN;
    double n = rint(x * (2 / PI));
    double r = fma(-n, half_pi[2], fma(-n, half_pi[1], fma(-n, half_pi[0], x)));
    r = r > 1.2 ? 1.2 : r < -1.2 ? -1.2 : r; /* far out, where a double no longer knows the phase */
    quarter += (int)(n - 4 * floor(n / 4));
    double s = quarter & 1 ? cos_series(r) : sin_series(r);
    return quarter & 2 ? -s : s;
}

double karst_double_sin(double x) { return sin_quadrant(x, 0); }
double karst_double_cos(double x) { return sin_quadrant(x, 1); }

double karst_double_exp2(double x)
{
    if (isnan(x))
        return x;
    x = x < -126 ? -126 : x > 126 ? 126 : x;
    double n = rint(x), r = (x - n) * LN2, sum = 0;
    for (int k = 20; k >= 1; k--)
        sum = (1 + sum) * r / k;
    uint64_t bits = (uint64_t)(1023 + (int)n) << 52;
    double power;
    memcpy(&power, &bits, 8);
    return (1 + sum) * power;
}

double karst_double_log(double x)
{
    if (isnan(x) || x == (double)INFINITY)
        return x;
    if (!(x >= 0x1p-126))
        x = 0x1p-126;
    uint64_t bits;
    memcpy(&bits, &x, 8);
    int e = (int)(bits >> 52) - 1023;
    bits = (bits & (((uint64_t)1 << 52) - 1)) | (uint64_t)1023 << 52;
    double m;
    memcpy(&m, &bits, 8);
    if (m > 1.4142135623730951) {
        m /= 2;
        e++;
    }
    double s = (m - 1) / (m + 1), z = s * s, sum = 0; /* log m = 2 artanh s */
    for (int k = 29; k >= 3; k -= 2)
        sum = z * (1.0 / k + sum);
    return fma((double)e, LN2, 2 * s * (1 + sum));
}

/* t in [0, 1] */
static double atan_unit(double t)
{
    double base = 0;
    if (t > 0.41421356237309503) { /* tan(pi/8) */
        base = PI / 4;
        t = (t - 1) / (t + 1);
    }
    t = t / (1 + sqrt(1 + t * t)); /* half the angle: |t| < 0.2 */
    double z = t * t, sum = 0;
    for (int k = 31; k >= 3; k -= 2)
        sum = -z * (1.0 / k + sum); /* alternating signs: each turn flips */
    return base + 2 * t * (1 + sum);
}

double karst_double_atan(double y, double x)
{
    if (isnan(x) || isnan(y))
        return (double)NAN;
    double ax = fabs(x), ay = fabs(y), big = ax > ay ? ax : ay, small = ax > ay ? ay : ax;
    if (big == 0)
        return 0;
    double a = atan_unit(big == small ? 1 : small / big);
    if (ay > ax)
        a = PI / 2 - a;
    if (x < 0)
        a = PI - a;
    return y < 0 ? -a : a;
}
