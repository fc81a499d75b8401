/* Points on known surfaces, and files of them. */
#ifndef KARST_TESTS_POINTS_CLOUDS_H
#define KARST_TESTS_POINTS_CLOUDS_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "karst/points.h"
#include "tests/noise/random.h"

/* A surface: a function's zeros, negative outside, in a box around the origin, and how large it is. */
typedef struct {
    const char *name;
    double (*value)(const double p[3], double gradient[3]);
    double half, area;
    double edge; /* how far from the box's faces it is looked at: open surfaces end there */
} known_surface;

static inline double sphere_value(const double p[3], double gradient[3])
{
    double r = sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) + 1e-30;
    for (int a = 0; a < 3; a++)
        gradient[a] = -p[a] / r;
    return 1 - r;
}

static inline double torus_value(const double p[3], double gradient[3])
{
    double ring = sqrt(p[0] * p[0] + p[2] * p[2]) + 1e-30, x = ring - 1, r = sqrt(x * x + p[1] * p[1]) + 1e-30;
    gradient[0] = -x / r * p[0] / ring;
    gradient[1] = -p[1] / r;
    gradient[2] = -x / r * p[2] / ring;
    return 0.4 - r;
}

static inline double gyroid_value(const double p[3], double gradient[3])
{
    double s[3], c[3];
    for (int a = 0; a < 3; a++) {
        s[a] = sin(3 * p[a]);
        c[a] = cos(3 * p[a]);
    }
    gradient[0] = 3 * (c[0] * c[1] - s[2] * s[0]);
    gradient[1] = 3 * (c[1] * c[2] - s[0] * s[1]);
    gradient[2] = 3 * (c[2] * c[0] - s[1] * s[2]);
    return s[0] * c[1] + s[1] * c[2] + s[2] * c[0];
}

#define PI 3.14159265358979323846
static const known_surface known_surfaces[] = {
    {"sphere", sphere_value, 1.05, 4 * PI, -1},
    {"torus", torus_value, 1.45, 4 * PI *PI * 0.4, -1},
    /* 3.0915 times the square of its period, which is the box's side. */
    {"gyroid", gyroid_value, PI / 3, 3.0915 * (2 * PI / 3) * (2 * PI / 3), 0.06},
};
#define NUM_KNOWN_SURFACES 3

/* A place in the box goes to the surface along the gradient; false: it was too far off. Places that do not are spread
 * evenly over the surface, as they come from a layer of even thickness. */
static inline bool onto_surface(const known_surface *of, double thickness, double p[3], double normal[3])
{
    double gradient[3], length = 0;
    for (int i = 0; i < 6; i++) {
        double value = of->value(p, gradient), square = 0;
        for (int a = 0; a < 3; a++)
            square += gradient[a] * gradient[a];
        length = sqrt(square);
        if (!(fabs(value) < (i == 0 ? thickness : 1) * length))
            return false;
        for (int a = 0; a < 3; a++)
            p[a] -= value * gradient[a] / square;
    }
    for (int a = 0; a < 3; a++)
        normal[a] = -gradient[a] / length;
    return true;
}

static inline void random_on_surface(const known_surface *of, double p[3], double normal[3])
{
    do {
        for (int a = 0; a < 3; a++)
            p[a] = (2 * random_unit() - 1) * of->half;
    } while (!onto_surface(of, 0.02, p, normal));
}

static inline double random_normal(void) { return sqrt(-2 * log(1 - random_unit())) * cos(2 * PI * random_unit()); }

static inline double spacing_of(const known_surface *of, size_t num) { return sqrt(of->area / (double)num); }

/* A binary PLY of points, with noise of so many spacings, red from left to right and green upwards. */
static inline void write_cloud(const char *path, const known_surface *of, size_t num, double noise)
{
    FILE *file = fopen(path, "wb");
    if (!file)
        abort();
    fprintf(file,
            "ply\nformat binary_little_endian 1.0\nelement vertex %zu\nproperty double x\nproperty double y\n"
            "property double z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n",
            num);
    for (size_t i = 0; i < num; i++) {
        double p[3], normal[3];
        random_on_surface(of, p, normal);
        for (int a = 0; a < 3; a++)
            p[a] += noise * spacing_of(of, num) * random_normal();
        fwrite(p, sizeof *p, 3, file);
        const unsigned char rgb[3] = {(unsigned char)fmin(fmax(128 + 60 * p[0], 0), 255),
                                      (unsigned char)fmin(fmax(128 + 60 * p[1], 0), 255), 40};
        fwrite(rgb, 1, 3, file);
    }
    fclose(file);
}

#endif
