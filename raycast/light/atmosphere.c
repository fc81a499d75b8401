/* Tables of a clear atmosphere: see raycast/light/atmosphere.h. Lengths are in km. */
#include "raycast/light/atmosphere.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "raycast/light/atmosphere.clh"

#define AIR_TOP 100.0 /* above it there is none */
#define AIR_HEIGHT 8.0
#define DUST_HEIGHT 1.2
#define OZONE_HEIGHT 25.0
#define OZONE_HALF_WIDTH 15.0
#define GROUND_ALBEDO 0.3
#define SUN_RADIUS 0.004652 /* rad */

static const double air_scattering[3] = {5.802e-3, 13.558e-3, 33.1e-3};
static const double ozone_absorption[3] = {0.650e-3, 1.881e-3, 0.085e-3};
static const double dust_scattering = 3.996e-3, dust_extinction = 4.440e-3;

/* Sunlight that is left, over height and the sun's cosine, for rays that miss the ground. */
#define SUNLIGHT_COSINES 160
#define SUNLIGHT_HEIGHTS 48
#define SUNLIGHT_STEPS 64
/* What is scattered more than once, over the sun's cosine and height: radiance of an even sky, for a sun of 1. */
#define AGAIN_COSINES 84
#define AGAIN_HEIGHTS 20
#define AGAIN_DIRECTIONS 8 /* above the horizon, below it, and around */
#define AGAIN_STEPS 14
#define AGAIN_ORDERS 3
/* Of each part of a ray. */
#define SKY_STEPS 32
#define MOST_STEPS (2 * SKY_STEPS)
#define MOST_KM 200.0

struct karst_atmosphere {
    double globe, dust;
    float sunlight[SUNLIGHT_HEIGHTS][SUNLIGHT_COSINES][3];
    float again[AGAIN_HEIGHTS][AGAIN_COSINES][3];
};

/* ---- the medium ---- */

typedef struct {
    double air, dust, ozone; /* as thick as where each is thickest */
} thickness;

static thickness thickness_at(const karst_atmosphere *a, double height)
{
    thickness at = {exp(-height / AIR_HEIGHT), a->dust * exp(-height / DUST_HEIGHT),
                    fmax(0, 1 - fabs(height - OZONE_HEIGHT) / OZONE_HALF_WIDTH)};
    return at;
}

static double extinction_of(const thickness *at, int channel)
{
    return air_scattering[channel] * at->air + dust_extinction * at->dust + ozone_absorption[channel] * at->ozone;
}

/* ---- rays and the globe ---- */

/* Along a ray from a radius, whose cosine to the zenith is given. */
static double radius_along(double radius, double cosine, double t)
{
    return sqrt(fmax(0, radius * radius + t * (t + 2 * radius * cosine)));
}

static double cosine_of_horizon(const karst_atmosphere *a, double radius)
{
    double ratio = fmin(1, a->globe / radius);
    return -sqrt(1 - ratio * ratio);
}

/* Where the ray enters and leaves the air; false if it meets none. */
static bool find_way(const karst_atmosphere *a, double radius, double cosine, bool to_ground, double way[2])
{
    double top = a->globe + AIR_TOP, nearest = -radius * cosine, square = radius * radius * (1 - cosine * cosine);
    double half = top * top - square;
    if (half <= 0 || (radius > top && cosine > 0))
        return false;
    way[0] = fmax(0, nearest - sqrt(half));
    way[1] = nearest + sqrt(half);
    if (to_ground)
        way[1] = nearest - sqrt(fmax(0, a->globe * a->globe - square));
    way[1] = fmax(way[1], way[0]);
    return true;
}

/* ---- sunlight ---- */

/* Heights grow closer together at the ground. */
static double height_of_row(int row, int num_rows)
{
    double share = (double)row / (num_rows - 1);
    return AIR_TOP * share * share;
}

static double row_of_height(double height, int num_rows)
{
    return sqrt(fmin(1, fmax(0, height / AIR_TOP))) * (num_rows - 1);
}

/* Cosines from the horizon's to 1, closer together at the horizon. */
static double share_of_cosine(double cosine, double horizon)
{
    return sqrt(fmin(1, fmax(0, (cosine - horizon) / (1 - horizon))));
}

static void make_sunlight(karst_atmosphere *a)
{
    for (int row = 0; row < SUNLIGHT_HEIGHTS; row++) {
        double radius = a->globe + height_of_row(row, SUNLIGHT_HEIGHTS), horizon = cosine_of_horizon(a, radius);
        for (int i = 0; i < SUNLIGHT_COSINES; i++) {
            double share = (double)i / (SUNLIGHT_COSINES - 1), way[2] = {0, 0};
            double cosine = horizon + (1 - horizon) * share * share, depth[3] = {0, 0, 0};
            find_way(a, radius, cosine, false, way);
            /* Closer together where the ray begins, as air is thickest there. */
            for (int step = 0; step < SUNLIGHT_STEPS; step++) {
                double from = (double)step / SUNLIGHT_STEPS, to = (step + 1.0) / SUNLIGHT_STEPS;
                double t = way[1] * (from * from + to * to) / 2, width = way[1] * (to * to - from * from);
                thickness at = thickness_at(a, radius_along(radius, cosine, t) - a->globe);
                for (int c = 0; c < 3; c++)
                    depth[c] += width * extinction_of(&at, c);
            }
            for (int c = 0; c < 3; c++)
                a->sunlight[row][i][c] = (float)exp(-depth[c]);
        }
    }
}

/* A table's value between four of its places. */
static inline void look_up(const float *table, int width, int height, double x, double y, double rgb[3])
{
    int column = (int)x, row = (int)y;
    column = column > width - 2 ? width - 2 : column;
    row = row > height - 2 ? height - 2 : row;
    const float u = (float)(x - column), v = (float)(y - row);
    const float *at = table + 3 * (row * width + column), *next = at + 3 * width;
    for (int c = 0; c < 3; c++) {
        float above = at[c] + u * (at[3 + c] - at[c]), below = next[c] + u * (next[3 + c] - next[c]);
        rgb[c] = (double)(above + v * (below - above));
    }
}

/* What looking up at a radius needs, whatever the sun's cosine. */
typedef struct {
    double radius, horizon, edge;
    double sunlight_row, again_row;
} level;

static level level_of(const karst_atmosphere *a, double radius)
{
    level l = {.radius = radius, .horizon = cosine_of_horizon(a, radius), .edge = a->globe / radius * SUN_RADIUS};
    l.sunlight_row = row_of_height(radius - a->globe, SUNLIGHT_HEIGHTS);
    l.again_row = row_of_height(radius - a->globe, AGAIN_HEIGHTS);
    return l;
}

static inline void find_sunlight(const karst_atmosphere *a, const level *l, double cosine, double rgb[3])
{
    /* The share of the disc that is above the horizon. */
    double seen = (cosine - l->horizon) / (2 * l->edge) + 0.5;
    rgb[0] = rgb[1] = rgb[2] = 0;
    if (seen <= 0)
        return;
    seen = seen < 1 ? seen * seen * (3 - 2 * seen) : 1;
    if (l->radius >= a->globe + AIR_TOP)
        rgb[0] = rgb[1] = rgb[2] = 1;
    else
        look_up(a->sunlight[0][0], SUNLIGHT_COSINES, SUNLIGHT_HEIGHTS,
                share_of_cosine(cosine, l->horizon) * (SUNLIGHT_COSINES - 1), l->sunlight_row, rgb);
    for (int c = 0; c < 3; c++)
        rgb[c] *= seen;
}

/* ---- along a ray ---- */

/* What is scattered at a place reaches the eye with `weight`, for a scattering of 1 a km. */
typedef struct {
    double t;
    level level;
    thickness at;
    double weight[3];
} step;

typedef struct {
    int num_steps;
    step steps[MOST_STEPS];
    bool to_ground;
    double through[3]; /* of what comes from its end */
    double length, air, dust;
} march;

/* The part of a ray on one side of where it is lowest: nodes are closer together there. */
typedef struct {
    double from, to;
    bool rises;
} stretch;

static int cut_way(double radius, double cosine, const double way[2], stretch parts[2])
{
    double lowest = -radius * cosine;
    if (lowest <= way[0] || lowest >= way[1]) {
        parts[0] = (stretch){way[0], way[1], lowest <= way[0]};
        return 1;
    }
    parts[0] = (stretch){way[0], lowest, false};
    parts[1] = (stretch){lowest, way[1], true};
    return 2;
}

static double node_of(const stretch *part, int i, int num)
{
    double share = part->rises ? (double)i / num : 1 - (double)i / num, length = part->to - part->from;
    return part->rises ? part->from + length * share * share : part->to - length * share * share;
}

/* Each step is taken to be as thick all along as in its middle; what it does to its own light is exact. */
static void march_ray(const karst_atmosphere *a, double radius, double cosine, bool to_ground, int num_steps, march *m)
{
    double way[2];
    stretch parts[2];
    *m = (march){.to_ground = to_ground, .through = {1, 1, 1}};
    if (!find_way(a, radius, cosine, to_ground, way))
        return;
    m->length = way[1];
    int num_parts = cut_way(radius, cosine, way, parts);
    for (int p = 0; p < num_parts; p++)
        for (int i = 0; i < num_steps; i++) {
            step *s = &m->steps[m->num_steps++];
            double from = node_of(&parts[p], i, num_steps), to = node_of(&parts[p], i + 1, num_steps);
            double width = to - from;
            s->t = (from + to) / 2;
            s->level = level_of(a, fmax(a->globe, radius_along(radius, cosine, s->t)));
            s->at = thickness_at(a, s->level.radius - a->globe);
            m->air += width * s->at.air;
            m->dust += width * s->at.dust;
            for (int c = 0; c < 3; c++) {
                double depth = extinction_of(&s->at, c) * width, kept = exp(-depth);
                s->weight[c] = m->through[c] * (depth > 1e-9 ? width * (1 - kept) / depth : width);
                m->through[c] *= kept;
            }
        }
}

/* The sun's cosine to the zenith further along. */
static double sun_cosine_along(double radius, double sun_cosine, double to_sun, double t, double there)
{
    return fmin(1, fmax(-1, (radius * sun_cosine + t * to_sun) / there));
}

/* ---- light that is scattered again ---- */

/* The sun's cosines are close together where it has set and light changes fastest, until there is none. */
#define AGAIN_DARK -0.3
static double cosine_of_column(int column)
{
    double x = 2.0 * column / (AGAIN_COSINES - 1) - 1;
    return x < 0 ? -x * AGAIN_DARK : x * x;
}

static inline void find_again(const float table[AGAIN_HEIGHTS][AGAIN_COSINES][3], const level *l, double sun_cosine,
                              double rgb[3])
{
    double x = sun_cosine < 0 ? fmax(-1, -sun_cosine / AGAIN_DARK) : sqrt(sun_cosine);
    look_up(table[0][0], AGAIN_COSINES, AGAIN_HEIGHTS, (x + 1) / 2 * (AGAIN_COSINES - 1), l->again_row, rgb);
}

/* Light that comes along a ray: of sunlight that is scattered once, and what the ground sends up of it; or, if there
 * is a table of an order of light, of what becomes of that. */
static void look_along(const karst_atmosphere *a, const float (*before)[AGAIN_COSINES][3], const march *m,
                       double radius, double sun_cosine, double to_sun, double rgb[3])
{
    double light[3], air = before ? 1 : (double)air_phase((float)to_sun);
    const double dust = before ? 1 : (double)dust_phase((float)to_sun);
    rgb[0] = rgb[1] = rgb[2] = 0;
    for (int i = 0; i < m->num_steps; i++) {
        const step *s = &m->steps[i];
        double cosine = sun_cosine_along(radius, sun_cosine, to_sun, s->t, s->level.radius);
        if (before)
            find_again(before, &s->level, cosine, light);
        else
            find_sunlight(a, &s->level, cosine, light);
        for (int c = 0; c < 3; c++)
            rgb[c] +=
                s->weight[c] * light[c] * (air * air_scattering[c] * s->at.air + dust * dust_scattering * s->at.dust);
    }
    if (!m->to_ground)
        return;
    const level ground = level_of(a, a->globe);
    double cosine = sun_cosine_along(radius, sun_cosine, to_sun, m->length, a->globe);
    if (before)
        find_again(before, &ground, cosine, light);
    else
        find_sunlight(a, &ground, cosine, light);
    for (int c = 0; c < 3; c++)
        rgb[c] += m->through[c] * light[c] * GROUND_ALBEDO * (before ? 1 : fmax(0, cosine) / M_PI);
}

/* One order of light, from the one before: at each place the mean over all directions of what comes to it. */
static void gather(const karst_atmosphere *a, const float (*before)[AGAIN_COSINES][3], float (*after)[AGAIN_COSINES][3])
{
    march m;
    double rgb[3];
    memset(after, 0, sizeof a->again);
    for (int row = 0; row < AGAIN_HEIGHTS; row++) {
        double radius = a->globe + height_of_row(row, AGAIN_HEIGHTS), horizon = cosine_of_horizon(a, radius);
        for (int i = 0; i < 2 * AGAIN_DIRECTIONS; i++) {
            bool below = i >= AGAIN_DIRECTIONS;
            double from = (double)(i % AGAIN_DIRECTIONS) / AGAIN_DIRECTIONS, to = from + 1.0 / AGAIN_DIRECTIONS;
            double extent = below ? -1 - horizon : 1 - horizon;
            double cosine = horizon + extent * (from * from + to * to) / 2, sine = sqrt(fmax(0, 1 - cosine * cosine));
            double share = fabs(extent) * (to * to - from * from) / 2 / AGAIN_DIRECTIONS;
            march_ray(a, radius, cosine, below, AGAIN_STEPS, &m);
            for (int column = 0; column < AGAIN_COSINES; column++) {
                double sun = cosine_of_column(column), sun_sine = sqrt(fmax(0, 1 - sun * sun));
                for (int j = 0; j < AGAIN_DIRECTIONS; j++) {
                    double around = cos(M_PI * (j + 0.5) / AGAIN_DIRECTIONS);
                    look_along(a, before, &m, radius, sun, cosine * sun + sine * sun_sine * around, rgb);
                    for (int c = 0; c < 3; c++)
                        after[row][column][c] += (float)(share * rgb[c]);
                }
            }
        }
    }
}

/* Each order is a part of the one before, and the parts are soon the same: the rest is a geometric series. */
static bool make_again(karst_atmosphere *a)
{
    float(*orders)[AGAIN_HEIGHTS][AGAIN_COSINES][3] = calloc(AGAIN_ORDERS, sizeof *orders);
    if (!orders)
        return false;
    for (int order = 0; order < AGAIN_ORDERS; order++)
        gather(a, order ? orders[order - 1] : NULL, orders[order]);
    for (int row = 0; row < AGAIN_HEIGHTS; row++)
        for (int column = 0; column < AGAIN_COSINES; column++)
            for (int c = 0; c < 3; c++) {
                float sum = 0, last = orders[AGAIN_ORDERS - 1][row][column][c];
                float before = orders[AGAIN_ORDERS - 2][row][column][c], ratio = before > 0 ? last / before : 0;
                for (int order = 0; order < AGAIN_ORDERS; order++)
                    sum += orders[order][row][column][c];
                a->again[row][column][c] = sum + (ratio < 0.9f ? last * ratio / (1 - ratio) : 0);
            }
    free(orders);
    return true;
}

/* ---- the sky of an eye ---- */

/* What the ground at a ray's end sends up it, of sunlight and of what the air scatters down. */
static void ground_light(const karst_atmosphere *a, const march *m, double radius, double sun_cosine, double to_sun,
                         double rgb[3])
{
    const level ground = level_of(a, a->globe);
    double cosine = sun_cosine_along(radius, sun_cosine, to_sun, m->length, a->globe), again[3];
    rgb[0] = rgb[1] = rgb[2] = 0;
    if (!m->to_ground)
        return;
    find_sunlight(a, &ground, cosine, rgb);
    find_again(a->again, &ground, cosine, again);
    for (int c = 0; c < 3; c++)
        rgb[c] = m->through[c] * GROUND_ALBEDO * (rgb[c] * fmax(0, cosine) / M_PI + again[c]);
}

void karst_atmosphere_sky(const karst_atmosphere *a, double height_m, const double up[3], const double to_sun[3],
                          double voxel_m, double sun, karst_sky *sky, float table[KARST_SKY_FLOATS])
{
    double radius = a->globe + fmax(height_m, 1) / 1000, horizon = cosine_of_horizon(a, radius), top = 1;
    double sun_cosine = up[0] * to_sun[0] + up[1] * to_sun[1] + up[2] * to_sun[2];
    sun_cosine = fmin(1, fmax(-1, sun_cosine));
    double sun_sine = sqrt(1 - sun_cosine * sun_cosine), light[3];
    /* Seen from above the air, it ends close above the horizon. */
    if (radius > a->globe + AIR_TOP)
        top = -sqrt(1 - pow((a->globe + AIR_TOP) / radius, 2));
    march m;
    for (int row = 0; row < 2 * KARST_SKY_ROWS; row++) {
        bool below = row >= KARST_SKY_ROWS;
        double share = (double)(row % KARST_SKY_ROWS) / (KARST_SKY_ROWS - 1);
        double cosine = horizon + ((below ? -1 : top) - horizon) * share * share;
        double sine = sqrt(fmax(0, 1 - cosine * cosine));
        march_ray(a, radius, cosine, below, SKY_STEPS, &m);
        for (int column = 0; column < KARST_SKY_COLUMNS; column++) {
            double around = 1 - 2.0 * column / (KARST_SKY_COLUMNS - 1);
            double angle = cosine * sun_cosine + sine * sun_sine * around, again[3];
            double phase = (double)air_phase((float)angle);
            double air[3] = {0, 0, 0}, dust[3] = {0, 0, 0};
            for (int i = 0; i < m.num_steps; i++) {
                const step *s = &m.steps[i];
                double there = sun_cosine_along(radius, sun_cosine, angle, s->t, s->level.radius);
                find_sunlight(a, &s->level, there, light);
                find_again(a->again, &s->level, there, again);
                for (int c = 0; c < 3; c++) {
                    double by_air = air_scattering[c] * s->at.air, by_dust = dust_scattering * s->at.dust;
                    air[c] += s->weight[c] * (by_air * light[c] + (by_air + by_dust) * again[c] / phase);
                    dust[c] += s->weight[c] * by_dust * light[c];
                }
            }
            float *cell = table + KARST_SKY_CELL * (row * KARST_SKY_COLUMNS + column);
            ground_light(a, &m, radius, sun_cosine, angle, light);
            for (int c = 0; c < 3; c++) {
                cell[c] = (float)(sun * air[c]);
                cell[4 + c] = (float)(sun * dust[c]);
                cell[8 + c] = (float)(sun * light[c]);
            }
            cell[3] = (float)m.air;
            cell[7] = (float)m.dust;
            cell[11] = 0;
        }
    }
    /* As far as places lie whose own light is looked up. */
    const double per_column = fmin(2, MOST_KM / a->globe) / ((KARST_SKY_SUNS - 1) / 2);
    for (int row = 0; row < KARST_SKY_HEIGHTS; row++) {
        const level l = level_of(a, a->globe + height_of_row(row, KARST_SKY_HEIGHTS));
        for (int column = 0; column < KARST_SKY_SUNS; column++) {
            double again[3], there = sun_cosine + (column - (KARST_SKY_SUNS - 1) / 2) * per_column;
            float *at = table + KARST_SKY_LIGHTS + 6 * (row * KARST_SKY_SUNS + column);
            there = fmin(1, fmax(-1, there));
            find_sunlight(a, &l, there, light);
            find_again(a->again, &l, there, again);
            for (int c = 0; c < 3; c++) {
                at[c] = (float)(sun * light[c]);
                at[3 + c] = (float)(sun * again[c]);
            }
        }
    }
    *sky = (karst_sky){
        .air = {0, 0, 0, (float)(1 / AIR_HEIGHT)},
        .dust = {0, 0, 0, (float)(1 / DUST_HEIGHT)},
        .ozone = {0, 0, 0, (float)(1 / radius)},
        .from_sun = (float)(1 / fmax(sun_sine, 1e-4)),
        .height_km = (float)(radius - a->globe),
        .voxel_km = (float)(voxel_m / 1000),
        .horizon = (float)horizon,
        .above = (float)(1 / (top - horizon)),
        .below = (float)(1 / (1 + horizon)),
        .globe_km = (float)a->globe,
        .per_sun = (float)(1 / per_column),
        .to_sun = {(float)to_sun[0], (float)to_sun[1], (float)to_sun[2], 0},
    };
    for (int c = 0; c < 3; c++) {
        sky->up[c] = (float)up[c];
        sky->air[c] = (float)air_scattering[c];
        sky->dust[c] = (float)dust_extinction;
        sky->ozone[c] = (float)ozone_absorption[c];
    }
    sky->up[3] = (float)sun_cosine;
}

#define SKYLIGHT_ROWS 12
#define SKYLIGHT_COLUMNS 16

void karst_atmosphere_skylight(const karst_sky *sky, const float table[KARST_SKY_FLOATS], const double to_sun[3],
                               double rgb[3])
{
    const double up[3] = {(double)sky->up[0], (double)sky->up[1], (double)sky->up[2]};
    /* Two directions across. */
    const int least =
        fabs(up[0]) < fabs(up[1]) ? (fabs(up[0]) < fabs(up[2]) ? 0 : 2) : (fabs(up[1]) < fabs(up[2]) ? 1 : 2);
    double east[3], north[3], length = sqrt(1 - up[least] * up[least]);
    for (int axis = 0; axis < 3; axis++)
        east[axis] = ((axis == least) - up[axis] * up[least]) / length;
    for (int axis = 0; axis < 3; axis++)
        north[axis] = up[(axis + 1) % 3] * east[(axis + 2) % 3] - up[(axis + 2) % 3] * east[(axis + 1) % 3];
    rgb[0] = rgb[1] = rgb[2] = 0;
    for (int i = 0; i < SKYLIGHT_ROWS; i++)
        for (int j = 0; j < SKYLIGHT_COLUMNS; j++) {
            /* All of the same weight, as what falls in flatly counts less. */
            const double sine = sqrt((i + 0.5) / SKYLIGHT_ROWS), cosine = sqrt(1 - sine * sine);
            const double azimuth = 2 * M_PI * (j + 0.5) / SKYLIGHT_COLUMNS;
            double d[3], angle = 0;
            for (int axis = 0; axis < 3; axis++) {
                d[axis] = cosine * up[axis] + sine * (cos(azimuth) * east[axis] + sin(azimuth) * north[axis]);
                angle += d[axis] * to_sun[axis];
            }
            const vector3 direction = {(float)d[0], (float)d[1], (float)d[2]};
            const colour light = air_sky(sky, table, &direction, (float)angle);
            const double share = M_PI / (SKYLIGHT_ROWS * SKYLIGHT_COLUMNS);
            rgb[0] += share * (double)light.r;
            rgb[1] += share * (double)light.g;
            rgb[2] += share * (double)light.b;
        }
}

/* ---- opening ---- */

karst_atmosphere *karst_atmosphere_create(const karst_air *air, karst_error *error)
{
    karst_atmosphere *a = calloc(1, sizeof *a);
    if (a) {
        a->globe = air->globe_m / 1000;
        a->dust = air->dust;
        make_sunlight(a);
    }
    if (!a || !make_again(a)) {
        free(a);
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    return a;
}

void karst_atmosphere_destroy(karst_atmosphere *atmosphere) { free(atmosphere); }

void karst_atmosphere_sunlight(const karst_atmosphere *a, double height_m, double sun_cosine, double rgb[3])
{
    const level l = level_of(a, a->globe + fmax(height_m, 0) / 1000);
    find_sunlight(a, &l, fmin(1, fmax(-1, sun_cosine)), rgb);
}
