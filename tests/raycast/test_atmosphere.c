/* The sky's tables against quadrature in double of the same model, which is written anew here. */
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "raycast/light/atmosphere.clh"
#include "raycast/light/atmosphere.h"
#include "tests/raycast/casting.h"

#define GLOBE 6360.0
#define TOP 6460.0
static const double blue_air[3] = {5.802e-3, 13.558e-3, 33.1e-3}, layer[3] = {0.650e-3, 1.881e-3, 0.085e-3};

typedef struct {
    double x, y, z;
} place;

static double product(place a, place b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static place along(place from, place direction, double t)
{
    return (place){from.x + t * direction.x, from.y + t * direction.y, from.z + t * direction.z};
}
static double radius_of(place p) { return sqrt(product(p, p)); }

/* Scattering by air and by dust, and extinction. */
static void medium(place at, double air[3], double *dust, double extinction[3])
{
    double height = radius_of(at) - GLOBE, tent = fmax(0, 1 - fabs(height - 25) / 15), dusty = exp(-height / 1.2);
    *dust = 3.996e-3 * dusty;
    for (int c = 0; c < 3; c++) {
        air[c] = blue_air[c] * exp(-height / 8);
        extinction[c] = air[c] + 4.440e-3 * dusty + layer[c] * tent;
    }
}

/* Where a ray enters a sphere and where it leaves it. */
static bool cross(place from, place direction, double radius, double way[2])
{
    double b = product(from, direction), half = b * b - product(from, from) + radius * radius;
    if (half <= 0)
        return false;
    way[0] = -b - sqrt(half);
    way[1] = -b + sqrt(half);
    return way[1] > 0;
}

/* A way's ends; whether it ends on the ground. */
static bool way_of(place from, place direction, double way[2], bool *is_ground)
{
    double ground[2];
    if (!cross(from, direction, TOP, way))
        return false;
    way[0] = fmax(0, way[0]);
    *is_ground = cross(from, direction, GLOBE, ground) && ground[0] > -1e-9;
    if (*is_ground)
        way[1] = fmax(0, ground[0]);
    return way[1] >= way[0];
}

/* Steps that are short where the way is lowest. */
static double node(const double way[2], double lowest, double share)
{
    double at = fmin(way[1], fmax(way[0], lowest)), first = sqrt(at - way[0]), last = sqrt(way[1] - at);
    double x = share * (first + last) - first;
    return at + x * fabs(x);
}

static void sunlight(place at, place to_sun, int steps, double rgb[3])
{
    double radius = radius_of(at), cosine = product(at, to_sun) / radius, ratio = fmin(1, GLOBE / radius), way[2];
    double horizon = -sqrt(1 - ratio * ratio), edge = ratio * 0.004652, depth[3] = {0, 0, 0};
    double seen = fmin(1, fmax(0, (cosine - horizon) / (2 * edge) + 0.5));
    seen *= seen * (3 - 2 * seen);
    place ray = to_sun;
    if (cosine < horizon) { /* of the half disc that is still there */
        double sine = sqrt(1 - horizon * horizon), old = sqrt(fmax(1e-12, 1 - cosine * cosine));
        place up = along((place){0, 0, 0}, at, 1 / radius), level = along(to_sun, up, -cosine);
        ray = along(along((place){0, 0, 0}, up, horizon), level, sine / old);
    }
    rgb[0] = rgb[1] = rgb[2] = seen;
    if (seen <= 0 || !cross(at, ray, TOP, way))
        return;
    way[0] = fmax(0, way[0]);
    for (int i = 0; i < steps; i++) {
        double from = node(way, -product(at, ray), (double)i / steps);
        double to = node(way, -product(at, ray), (i + 1.0) / steps), air[3], dust, extinction[3];
        medium(along(at, ray, (from + to) / 2), air, &dust, extinction);
        for (int c = 0; c < 3; c++)
            depth[c] += (to - from) * extinction[c];
    }
    for (int c = 0; c < 3; c++)
        rgb[c] *= exp(-depth[c]);
}

/* The same from a table, for what is summed millions of times. */
#define LIT_HEIGHTS 48
#define LIT_COSINES 512
static double lit[LIT_HEIGHTS][LIT_COSINES][3];

static void make_lit(void)
{
    for (int row = 0; row < LIT_HEIGHTS; row++)
        for (int column = 0; column < LIT_COSINES; column++) {
            double y = (double)row / (LIT_HEIGHTS - 1), radius = GLOBE + 100 * y * y * y;
            double horizon = -sqrt(1 - pow(GLOBE / radius, 2)), x = (double)column / (LIT_COSINES - 1);
            double cosine = fmin(1, horizon - 0.01 + (1.01 - horizon) * x * x * x);
            sunlight((place){0, radius, 0}, (place){sqrt(1 - cosine * cosine), cosine, 0}, 64, lit[row][column]);
        }
}

static void find_lit(place at, place to_sun, double rgb[3])
{
    double radius = radius_of(at), cosine = product(at, to_sun) / radius;
    double horizon = -sqrt(1 - pow(fmin(1, GLOBE / radius), 2));
    double y = pow(fmin(1, fmax(0, (radius - GLOBE) / 100)), 1.0 / 3) * (LIT_HEIGHTS - 1);
    double x = cbrt(fmax(0, (cosine - horizon + 0.01) / (1.01 - horizon))) * (LIT_COSINES - 1);
    int row = (int)fmin(y, LIT_HEIGHTS - 2), column = (int)fmin(x, LIT_COSINES - 2);
    for (int c = 0; c < 3; c++) {
        double u = x - column, v = y - row;
        rgb[c] = (1 - v) * ((1 - u) * lit[row][column][c] + u * lit[row][column + 1][c]) +
                 v * ((1 - u) * lit[row + 1][column][c] + u * lit[row + 1][column + 1][c]);
    }
}

/* ---- light of all later orders: a table over height and the sun's cosine ---- */

#define HEIGHTS 24
#define COSINES 128
typedef double again_table[HEIGHTS][COSINES][3];
static again_table again;

static void find(const again_table table, place at, place to_sun, double rgb[3])
{
    double radius = radius_of(at), cosine = product(at, to_sun) / radius;
    double y = pow(fmin(1, fmax(0, (radius - GLOBE) / 100)), 1.0 / 3) * (HEIGHTS - 1);
    double x = (cbrt(cosine) + 1) / 2 * (COSINES - 1);
    int row = (int)fmin(y, HEIGHTS - 2), column = (int)fmin(fmax(x, 0), COSINES - 2);
    for (int c = 0; c < 3; c++) {
        double u = x - column, v = y - row;
        rgb[c] = (1 - v) * ((1 - u) * table[row][column][c] + u * table[row][column + 1][c]) +
                 v * ((1 - u) * table[row + 1][column][c] + u * table[row + 1][column + 1][c]);
    }
}

static double phase_of_air(double x) { return 3 / (16 * M_PI) * (1 + x * x); }
static double phase_of_dust(double x)
{
    return 3 / (8 * M_PI) * 0.36 * (1 + x * x) / (2.64 * pow(1.64 - 1.6 * x, 1.5));
}

/* Radiance along a ray up to `end`. before: of the order before; NULL: of sunlight. more: a table that adds to it. */
static void radiance(place from, place direction, place to_sun, const again_table before, const again_table more,
                     double end, int steps, int sun_steps, double rgb[3], double through[3])
{
    double way[2], angle = product(direction, to_sun), light[3];
    bool is_ground;
    for (int c = 0; c < 3; c++)
        rgb[c] = 0, through[c] = 1;
    if (!way_of(from, direction, way, &is_ground))
        return;
    if (end < way[1])
        way[1] = end, is_ground = false;
    for (int i = 0; i < steps; i++) {
        double a = node(way, -product(from, direction), (double)i / steps);
        double b = node(way, -product(from, direction), (i + 1.0) / steps), air[3], dust, extinction[3], add[3] = {0};
        place at = along(from, direction, (a + b) / 2);
        medium(at, air, &dust, extinction);
        if (before)
            find(before, at, to_sun, light);
        else if (sun_steps)
            sunlight(at, to_sun, sun_steps, light);
        else
            find_lit(at, to_sun, light);
        if (more)
            find(more, at, to_sun, add);
        for (int c = 0; c < 3; c++) {
            double source = before ? light[c] * (air[c] + dust)
                                   : light[c] * (air[c] * phase_of_air(angle) + dust * phase_of_dust(angle));
            double kept = exp(-extinction[c] * (b - a));
            rgb[c] += through[c] * (source + add[c] * (air[c] + dust)) * (1 - kept) / extinction[c];
            through[c] *= kept;
        }
    }
    if (!is_ground)
        return;
    place at = along(from, direction, way[1]);
    double add[3] = {0}, cosine = fmax(0, product(at, to_sun) / GLOBE);
    if (before)
        find(before, at, to_sun, light);
    else if (sun_steps)
        sunlight(at, to_sun, sun_steps, light);
    else
        find_lit(at, to_sun, light);
    if (more)
        find(more, at, to_sun, add);
    for (int c = 0; c < 3; c++)
        rgb[c] += through[c] * 0.3 * (before ? light[c] : light[c] * cosine / M_PI + add[c]);
}

static void make_orders(int side, int num_orders)
{
    static again_table orders[2];
    for (int order = 0; order < num_orders; order++) {
        again_table *after = &orders[order % 2];
        for (int row = 0; row < HEIGHTS; row++)
            for (int column = 0; column < COSINES; column++) {
                double x = 2.0 * column / (COSINES - 1) - 1, cosine = x * x * x, y = (double)row / (HEIGHTS - 1);
                place eye = {0, GLOBE + 100 * y * y * y, 0}, to_sun = {sqrt(fmax(0, 1 - cosine * cosine)), cosine, 0};
                double horizon = -sqrt(1 - pow(GLOBE / eye.y, 2)), *sum = (*after)[row][column];
                sum[0] = sum[1] = sum[2] = 0;
                for (int i = 0; i < 2 * side; i++)
                    for (int j = 0; j < side; j++) {
                        double to = i < side ? 1 : -1, s = (i % side + 0.5) / side, rgb[3], through[3];
                        double up = horizon + (to - horizon) * s * s, weight = fabs(to - horizon) * s / side / side;
                        double flat = sqrt(1 - up * up), around = M_PI * (j + 0.5) / side;
                        place ray = {flat * cos(around), up, flat * sin(around)};
                        radiance(eye, ray, to_sun, order ? orders[1 - order % 2] : NULL, NULL, INFINITY, 24, 0,
                                 rgb, through);
                        for (int c = 0; c < 3; c++)
                            sum[c] += weight * rgb[c];
                    }
                for (int c = 0; c < 3; c++)
                    again[row][column][c] += sum[c];
            }
    }
}

/* ---- the tests ---- */

#define SUN 1.0
typedef struct {
    karst_atmosphere *atmosphere;
    karst_sky sky;
    float table[KARST_SKY_FLOATS];
} fixture;
static fixture the;

static place look(double azimuth, double elevation)
{
    double a = azimuth * M_PI / 180, e = elevation * M_PI / 180;
    return (place){sin(a) * cos(e), sin(e), cos(a) * cos(e)};
}

static void set_sky(double height_km, place to_sun)
{
    const double up[3] = {0, 1, 0}, sun[3] = {to_sun.x, to_sun.y, to_sun.z};
    karst_atmosphere_sky(the.atmosphere, height_km * 1000, up, sun, 1, SUN, &the.sky, the.table);
}

static int compare_doubles(const void *a, const void *b)
{
    return (*(const double *)a > *(const double *)b) - (*(const double *)a < *(const double *)b);
}

/* Peak signal to noise in dB; the peak is what nine tenths of the values lie below, so that the glare around the sun,
 * which pictures show as white, does not count as one. */
static double psnr(const double (*values)[2], int num)
{
    double *sorted = malloc((size_t)num * sizeof *sorted), error = 0;
    assert_non_null(sorted);
    for (int i = 0; i < num; i++)
        sorted[i] = values[i][1];
    qsort(sorted, (size_t)num, sizeof *sorted, compare_doubles);
    const double peak = sorted[num * 9 / 10];
    for (int i = 0; i < num; i++) {
        double off = fmin(values[i][0], 4 * peak) - fmin(values[i][1], 4 * peak);
        error += off * off;
    }
    free(sorted);
    return 10 * log10(peak * peak / (error / num));
}

#define ROWS 28
#define COLUMNS 14
static double values[3 * ROWS * COLUMNS][2];

/* distance_km: of a black surface in all directions; INFINITY: the sky, and the ground. */
static double measure(double height_km, double elevation, double distance_km)
{
    const place to_sun = look(20, elevation), eye = {0, GLOBE + height_km, 0};
    double(*next)[2] = values, way[2];
    set_sky(height_km, to_sun);
    for (int i = 0; i < ROWS; i++)
        for (int j = 0; j < COLUMNS; j++) {
            const place ray = look(21.3 + j * 180.0 / COLUMNS, asin(1 - (2 * i + 1.0) / ROWS) * 180 / M_PI);
            const vector3 direction = {(float)ray.x, (float)ray.y, (float)ray.z};
            const vfloat to = (float)product(ray, to_sun);
            const colour black = {0, 0, 0};
            double rgb[3], through[3];
            bool is_ground = false;
            if (distance_km < INFINITY && way_of(eye, ray, way, &is_ground) && is_ground && way[1] < distance_km)
                continue;
            if (distance_km < INFINITY && radius_of(along(eye, ray, distance_km)) > GLOBE + 12)
                continue;
            radiance(eye, ray, to_sun, NULL, again, distance_km, 64, 32, rgb, through);
            const air_way air = air_way_of(&the.sky, the.table, &direction, to, (float)(distance_km * 1000));
            const colour c = distance_km < INFINITY ? air_through(&air, black)
                                                    : air_sky(&the.sky, the.table, &direction, to);
            const double got[3] = {(double)c.r, (double)c.g, (double)c.b};
            for (int k = 0; k < 3; k++, next++)
                (*next)[0] = got[k], (*next)[1] = rgb[k];
        }
    return psnr((const double(*)[2])values, (int)(next - values));
}

static void skies_are_right(void **state)
{
    (void)state;
    const double heights[] = {0.001, 2, 10, 400}, elevations[] = {-6, -2, 0, 1, 5, 20, 45, 90};
    double worst = INFINITY;
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 8; j++) {
            const double db = measure(heights[i], elevations[j], INFINITY);
            printf("# %g km, sun at %g degrees: %.1f dB\n", heights[i], elevations[j], db);
            worst = fmin(worst, db);
        }
    assert_true(worst >= 40);
}

static void air_before_land_is_right(void **state)
{
    (void)state;
    const double heights[] = {0.1, 2, 10}, elevations[] = {1, 8, 45}, distances[] = {1, 5, 20, 60, 150};
    double worst = INFINITY;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            for (int k = 0; k < 5; k++) {
                const double db = measure(heights[i], elevations[j], distances[k]);
                printf("# %g km high, sun at %g degrees, land %g km away: %.2f dB\n", heights[i], elevations[j],
                       distances[k], db);
                worst = fmin(worst, db + (distances[k] > 60 ? 10 : 0));
            }
    assert_true(worst >= 39.9);
}

/* Directions from the horizon up to the zenith and down to the nadir, closer together at the horizon. */
#define HORIZON_ROWS 12
static place beside_horizon(double height_km, int row, double azimuth)
{
    const double dip = acos(GLOBE / (GLOBE + height_km)) * 180 / M_PI,
                 share = (row % (HORIZON_ROWS / 2) + 0.2) / (HORIZON_ROWS / 2.0),
                 up = row < HORIZON_ROWS / 2 ? 90 + dip : -(90 - dip);
    return look(azimuth, -dip + up * share * share * share);
}

static void sky_towards(place ray, place to_sun, double rgb[3])
{
    const vector3 direction = {(float)ray.x, (float)ray.y, (float)ray.z};
    const colour c = air_sky(&the.sky, the.table, &direction, (float)product(ray, to_sun));
    rgb[0] = (double)c.r, rgb[1] = (double)c.g, rgb[2] = (double)c.b;
}

/* Within half a degree of the horizon, on both sides: a seam would be an error of one of them. */
static void the_horizon_has_no_seam(void **state)
{
    (void)state;
    const double heights[] = {0.001, 2, 10, 400}, elevations[] = {-6, 0, 5, 45};
    double worst = INFINITY;
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) {
            const place to_sun = look(20, elevations[j]), eye = {0, GLOBE + heights[i], 0};
            const double dip = acos(GLOBE / eye.y) * 180 / M_PI;
            double(*next)[2] = values;
            set_sky(heights[i], to_sun);
            for (int row = 0; row < 10; row++)
                for (int column = 0; column < 5; column++) {
                    const double off = (row - 4.5) / 4.5;
                    const place ray = look(21 + 43.0 * column, -dip + 0.5 * off * fabs(off));
                    double rgb[3], through[3], got[3];
                    radiance(eye, ray, to_sun, NULL, again, INFINITY, 96, 32, rgb, through);
                    sky_towards(ray, to_sun, got);
                    for (int c = 0; c < 3; c++, next++)
                        (*next)[0] = got[c], (*next)[1] = rgb[c];
                }
            const double db = psnr((const double(*)[2])values, (int)(next - values));
            printf("# %g km, sun at %g degrees, at the horizon: %.1f dB\n", heights[i], elevations[j], db);
            worst = fmin(worst, db);
        }
    assert_true(worst >= 40); /* in deep twilight; by day 46 */
}

/* From the ground to beyond the air by steps of 3 %: what light is like between two heights is their mean, to a step of
 * a picture's 255. A jump would be half as large whatever the steps are. */
static void the_sky_is_continuous_on_the_way_up(void **state)
{
    (void)state;
    enum { NUM = HORIZON_ROWS * 3 };
    const bool is_full = getenv("KARST_TEST_FULL") != NULL;
    const double elevations[] = {12, -3, 40}, step = is_full ? 1.015 : 1.03;
    for (int e = 0; e < (is_full ? 3 : 1); e++) {
        const place to_sun = look(20, elevations[e]);
        double last[2][NUM] = {{0}}, peak = 0, most = 0, at_km = 0;
        int num = 0;
        for (double km = 0.002; km < 1500; km *= step, num++) {
            double now[NUM];
            set_sky(km, to_sun);
            for (int row = 0; row < HORIZON_ROWS; row++)
                sky_towards(beside_horizon(km, row, 60), to_sun, now + 3 * row);
            for (int i = 0; i < NUM; i++) {
                const double bend = fabs(now[i] - 2 * last[0][i] + last[1][i]) / 2;
                peak = fmax(peak, now[i]);
                if (num > 1 && bend > most)
                    most = bend, at_km = km / step;
            }
            memcpy(last[1], last[0], sizeof now);
            memcpy(last[0], now, sizeof now);
        }
        printf("# up to 1500 km, sun at %g degrees: %.5f of the brightest off the mean at most, at %.3g km\n",
               elevations[e], most / peak, at_km);
        assert_true(most < peak / 255);
    }
}

static int set_up(void **state)
{
    (void)state;
    const karst_air air = {GLOBE * 1000, 1};
    karst_error error;
    the.atmosphere = karst_atmosphere_create(&air, &error);
    make_lit();
    make_orders(6, 6);
    return the.atmosphere ? 0 : 1;
}

static int tear_down(void **state)
{
    (void)state;
    karst_atmosphere_destroy(the.atmosphere);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(skies_are_right), cmocka_unit_test(air_before_land_is_right),
                                       cmocka_unit_test(the_horizon_has_no_seam),
                                       cmocka_unit_test(the_sky_is_continuous_on_the_way_up)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
