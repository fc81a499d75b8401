#include "reference/scatter_path.h"

#include <math.h>
#include <string.h>

#include "reference/range.h"

/* As engines have it (raycast/media/media_light.cl). */
#define MOST_G 0.95
/* Below this, chance ends paths, and others count more. */
#define LEAST_THROUGHPUT 0.2

/* S. Vigna's splitmix64. */
static uint64_t next_random(uint64_t *state)
{
    uint64_t z = *state += 0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return z ^ z >> 31;
}

/* Above 0, and 1 at most. */
static double chance(karst_scatter_walker *w) { return (double)((next_random(&w->random) >> 11) + 1) * 0x1p-53; }

typedef struct {
    double albedo[3], g, emission[3];
} look;

static karst_position place_at(const karst_scatter_walker *w, const double at[3])
{
    return karst_reference_place(&w->scene->tree->corner, at, 1);
}

static double extinction_at(karst_scatter_walker *w, const double at[3], double majorant)
{
    const karst_position place = place_at(w, at);
    const double value = karst_sampler_precise_density(w->sampler, &place, 0);
    w->num_lookups++;
    if (!(value > 0) || !isfinite(value))
        return 0;
    if (value > majorant)
        w->exceeded = value;
    return value;
}

static look look_at(karst_scatter_walker *w, const double at[3])
{
    const karst_position place = place_at(w, at);
    const float up[KARST_FACING_FLOATS] = {0, 1, 0};
    karst_oracle_value values[KARST_NUM_ROOTS];
    look l;
    karst_oracle_shading(w->oracle, &place, up, -1, values);
    for (int c = 0; c < 3; c++) {
        l.albedo[c] = fmin(fmax(values[KARST_ROOT_COLOUR + c].precise, 0), 1);
        l.emission[c] = fmax(values[KARST_ROOT_EMISSION + c].precise, 0);
    }
    l.g = fmin(fmax(values[KARST_ROOT_MIRROR].precise, -MOST_G), MOST_G);
    return l;
}

/* Where a ray is in the box that holds all of the medium. */
static bool cross_box(const karst_scatter_tree *tree, const double from[3], const double d[3], double *enter,
                      double *leave)
{
    *enter = 0;
    *leave = INFINITY;
    for (int axis = 0; axis < 3; axis++) {
        if (d[axis] == 0) {
            if (from[axis] < tree->least[axis] || from[axis] > tree->most[axis])
                return false;
            continue;
        }
        const double a = (tree->least[axis] - from[axis]) / d[axis], b = (tree->most[axis] - from[axis]) / d[axis];
        *enter = fmax(*enter, fmin(a, b));
        *leave = fmin(*leave, fmax(a, b));
    }
    return *enter < *leave;
}

/* Goes from `at` to the next collision with the medium: then it is there. false: there is none. `given` (may be NULL)
 * takes what the medium gives off on the way, as false collisions tell it, times `throughput`. */
static bool fly(karst_scatter_walker *w, double at[3], const double d[3], const double *throughput, double *given)
{
    const karst_scatter_scene *scene = w->scene;
    const karst_scatter_tree *tree = scene->tree;
    const bool is_one = scene->light->one_majorant;
    const double nudge = tree->side * 0x1p-46;
    double t, end, exit = -1, majorant = 0, left = -log(chance(w));
    if (!cross_box(tree, at, d, &t, &end))
        return false;
    if (is_one) {
        majorant = tree->majorant;
        exit = end;
    }
    while (t < end) {
        if (t >= exit) {
            majorant = karst_scatter_tree_leaf(tree, at, d, t, &exit)->hi;
            exit = fmin(fmax(exit, t), end) + nudge;
        }
        const double per_voxel = majorant * scene->voxel_m, depth = per_voxel * (exit - t);
        if (left >= depth) {
            left -= depth;
            t = exit;
            continue;
        }
        t += left / per_voxel;
        left = -log(chance(w));
        const double here[3] = {at[0] + t * d[0], at[1] + t * d[1], at[2] + t * d[2]};
        const double extinction = extinction_at(w, here, majorant);
        if (given && scene->has_emission) {
            const look l = look_at(w, here);
            for (int c = 0; c < 3; c++)
                given[c] += throughput[c] * l.emission[c] / majorant;
        }
        if (chance(w) * majorant <= extinction) {
            memcpy(at, here, sizeof here);
            return true;
        }
    }
    return false;
}

/* Henyey and Greenstein's phase function times 4 pi. */
static double phase_of(double g, double cosine)
{
    const double d = 1 + g * g - 2 * g * cosine;
    return (1 - g * g) / (d * sqrt(d));
}

static void scatter(karst_scatter_walker *w, double g, double d[3])
{
    const double u = chance(w), turn = 2 * M_PI * chance(w);
    const double s = (1 - g * g) / (1 - g + 2 * g * u);
    const double cosine = fabs(g) < 1e-4 ? 2 * u - 1 : fmin(fmax((1 + g * g - s * s) / (2 * g), -1), 1);
    const double sine = sqrt(1 - cosine * cosine), x = sine * cos(turn), y = sine * sin(turn);
    /* Two directions across d, after T. Duff and others, "Building an orthonormal basis, revisited", 2017. */
    const double sign = d[2] < 0 ? -1 : 1, a = -1 / (sign + d[2]), b = d[0] * d[1] * a;
    const double right[3] = {1 + sign * d[0] * d[0] * a, sign * b, -sign * d[0]},
                 up[3] = {b, sign + d[1] * d[1] * a, -d[1]};
    double length = 0;
    for (int i = 0; i < 3; i++) {
        d[i] = x * right[i] + y * up[i] + cosine * d[i];
        length += d[i] * d[i];
    }
    length = sqrt(length);
    for (int i = 0; i < 3; i++)
        d[i] /= length;
}

/* `scattered`: the path has met the medium. */
static void add_around(const karst_scatter_scene *scene, bool scattered, const double d[3], const double throughput[3],
                       double rgb[3])
{
    const double *around = d[1] > 0 ? scene->light->above : scene->light->below, up = 0.5 + 0.5 * d[1];
    if (scene->light->around_of_world) {
        /* As light_from_around (raycast/light/light.clh). */
        for (int c = 0; scattered && c < 3; c++)
            rgb[c] += throughput[c] * (scene->ground[c] + up * (scene->sky[c] - scene->ground[c]));
        return;
    }
    for (int c = 0; c < 3; c++)
        rgb[c] += throughput[c] * around[c];
}

/* What of the sun is scattered at a place towards where d comes from. */
static void add_sun(karst_scatter_walker *w, const double at[3], const double d[3], double g,
                    const double throughput[3], double rgb[3])
{
    const karst_scatter_scene *scene = w->scene;
    const double *to_sun = scene->to_sun, cosine = d[0] * to_sun[0] + d[1] * to_sun[1] + d[2] * to_sun[2];
    double place[3] = {at[0], at[1], at[2]};
    if (scene->light->no_sun || fly(w, place, to_sun, NULL, NULL))
        return;
    for (int c = 0; c < 3; c++)
        rgb[c] += throughput[c] * 0.25 * phase_of(g, cosine) * scene->sun_colour[c];
}

void karst_scatter_path(karst_scatter_walker *w, uint64_t pixel, uint64_t path, const double from[3],
                        const double direction[3], double rgb[3])
{
    const karst_scatter_scene *scene = w->scene;
    double at[3] = {from[0], from[1], from[2]}, d[3] = {direction[0], direction[1], direction[2]};
    double throughput[3] = {1, 1, 1};
    w->random = pixel;
    w->random = next_random(&w->random) ^ path;
    for (uint32_t bounce = 1;; bounce++) {
        if (!fly(w, at, d, throughput, rgb)) {
            add_around(scene, bounce > 1, d, throughput, rgb);
            return;
        }
        w->num_collisions++;
        const look l = look_at(w, at);
        double most = 0;
        for (int c = 0; c < 3; c++) {
            throughput[c] *= l.albedo[c];
            most = fmax(most, throughput[c]);
        }
        if (most == 0)
            return;
        add_sun(w, at, d, l.g, throughput, rgb);
        const double survives = fmin(most / LEAST_THROUGHPUT, 1);
        if (survives < 1 && chance(w) > survives)
            return;
        for (int c = 0; c < 3; c++)
            throughput[c] /= survives;
        scatter(w, l.g, d);
        if (bounce == scene->light->max_bounces) {
            /* Light from around may still come, that was scattered as often. */
            if (!fly(w, at, d, throughput, rgb))
                add_around(scene, true, d, throughput, rgb);
            return;
        }
    }
}
