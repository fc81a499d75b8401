/* Points on bodies, with their normals, as files that worlds' headers name. */
#ifndef KARST_TESTS_POINTS_BODIES_H
#define KARST_TESTS_POINTS_BODIES_H

#include "tests/points/clouds.h"

/* A ball of radius 1 around a hollow of half that. */
static inline double hollow_value(const double p[3], double gradient[3])
{
    const double r = sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) + 1e-30, side = r < 0.75 ? 1 : -1;
    for (int a = 0; a < 3; a++)
        gradient[a] = side * p[a] / r;
    return side > 0 ? r - 0.5 : 1 - r;
}

static const known_surface hollow_ball = {"hollow ball", hollow_value, 1.05, 5 * PI, -1};

/* Imports num points of a surface, spread evenly, without a colour. false: it failed, and *error says why. */
static inline bool make_body(const char *path, const known_surface *of, size_t num, karst_error *error)
{
    char input[128];
    snprintf(input, sizeof input, "%s.ply", path);
    FILE *file = fopen(input, "wb");
    if (!file)
        abort();
    fprintf(file,
            "ply\nformat binary_little_endian 1.0\nelement vertex %zu\nproperty float x\nproperty float y\n"
            "property float z\nproperty float nx\nproperty float ny\nproperty float nz\nend_header\n",
            num);
    for (size_t i = 0; i < num; i++) {
        double p[3], normal[3];
        float words[6];
        random_on_surface(of, p, normal);
        for (int a = 0; a < 3; a++) {
            words[a] = (float)p[a];
            words[3 + a] = (float)normal[a];
        }
        fwrite(words, sizeof *words, 6, file);
    }
    fclose(file);
    const karst_points_import_config config = {.input = input, .output = path, .axes = KARST_POINTS_AS_THEY_ARE};
    const bool done = karst_points_import(&config, NULL, error);
    unlink(input);
    return done;
}

#endif
