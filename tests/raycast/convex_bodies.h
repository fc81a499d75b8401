/* Convex bodies some 60 voxels wide, around the origin: what tests look at for shadows on themselves. */
#ifndef KARST_TESTS_CONVEX_BODIES_H
#define KARST_TESTS_CONVEX_BODIES_H

#include <math.h>
#include <stdbool.h>

#if defined(__GNUC__)
#define CONVEX_UNUSED __attribute__((unused))
#else
#define CONVEX_UNUSED
#endif

enum { NUM_CONVEX = 5, NUM_CURVED = 3 }; /* the first are curved everywhere, the others have sharp edges */

CONVEX_UNUSED static const char *const convex_names[NUM_CONVEX] = {"sphere", "ellipsoid", "capsule", "box", "cone"};

/* The shapes are turned, so that no axis is special. */
CONVEX_UNUSED static void turn_convex(const double p[3], double q[3])
{
    const double a = 0.7, b = 0.45;
    const double x = cos(a) * p[0] - sin(a) * p[2], z = sin(a) * p[0] + cos(a) * p[2];
    q[0] = x;
    q[1] = cos(b) * p[1] - sin(b) * z;
    q[2] = sin(b) * p[1] + cos(b) * z;
}

CONVEX_UNUSED static double length3(double x, double y, double z) { return sqrt(x * x + y * y + z * z); }

CONVEX_UNUSED static double convex_body(const double p[3], double width, const void *user)
{
    double q[3];
    (void)width;
    turn_convex(p, q);
    const double across = hypot(q[0], q[2]);
    switch (*(const int *)user) {
    case 0:
        return 40 - length3(q[0], q[1], q[2]);
    case 1: { /* an ellipsoid, of slope 1 at most */
        const double k = length3(q[0] / 45, q[1] / 25, q[2] / 33);
        return 25 * (1 - k);
    }
    case 2: /* a capsule */
        return 18 - length3(q[0], q[1] - fmax(-25, fmin(25, q[1])), q[2]);
    case 3: /* a box */
        return -fmax(fmax(fabs(q[0]) - 28, fabs(q[1]) - 20), fabs(q[2]) - 35);
    default: /* a cone, its tip up */
        return fmin((30 - q[1] - 1.6 * across) / hypot(1, 1.6), q[1] + 30);
    }
}

/* The cosine of the angle between the body's true normal at p and a direction. */
CONVEX_UNUSED static double true_cosine(const double p[3], const double direction[3], int shape)
{
    double slope[3];
    for (int a = 0; a < 3; a++) {
        double before[3] = {p[0], p[1], p[2]}, after[3] = {p[0], p[1], p[2]};
        before[a] -= 1e-4, after[a] += 1e-4;
        slope[a] = convex_body(before, 0, &shape) - convex_body(after, 0, &shape);
    }
    return (slope[0] * direction[0] + slope[1] * direction[1] + slope[2] * direction[2]) /
           length3(slope[0], slope[1], slope[2]);
}

/* Whether the sun does not shine on the face at p, or hardly, whatever the normal that was found there. */
CONVEX_UNUSED static bool is_turned_away(const double p[3], const double direction[3], int shape)
{
    return shape >= NUM_CURVED && true_cosine(p, direction, shape) <= 0.03;
}

#endif
