#include "producers/language/oracle/look.h"

#include <math.h>
#include <stdlib.h>

enum { COLUMNS = 14, ROWS = 8, NUM_RAYS = COLUMNS * ROWS, MAX_STEPS = 40 };
static const double MAX_NODE_EVALUATIONS = 2e7;
static const double SKY = INFINITY;

typedef struct {
    karst_oracle *oracle;
    int voxel_log2_m;
    double budget, cost; /* evaluations of nodes that are left; of a point */
    double farthest_m;
} prober;

static double density_at(prober *p, const double at_m[3])
{
    karst_position at = karst_position_add_m((karst_position){{0}, {0}}, at_m, p->voxel_log2_m);
    p->budget -= p->cost;
    return karst_oracle_precise_density(p->oracle, &at, -1);
}

/* How far a ray from the air goes. A density is taken for a distance, but no step is shorter or longer than a share of
 * what was gone: so steep ones are not crept along and flat ones not jumped over. */
static double trace(prober *p, const double eye_m[3], const double direction[3], double start_m)
{
    double t = 0, step = start_m;
    for (int i = 0; i < MAX_STEPS && t < p->farthest_m; i++) {
        t += step;
        double at_m[3];
        for (int k = 0; k < 3; k++)
            at_m[k] = eye_m[k] + t * direction[k];
        double d = density_at(p, at_m);
        if (!(d <= 0)) /* what is not a number is air, but no way on */
            return isnan(d) ? SKY : t - 0.5 * step;
        step = fmin(fmax(-0.8 * d, fmax(0.02 * t, 0.25 * start_m)), 0.5 * t + start_m);
    }
    return SKY;
}

/* The direction of ray i of a camera; its length along the camera's axis is 1 / the value. */
static double ray_of(const karst_look *look, int i, double direction[3])
{
    karst_camera camera = {.yaw_deg = look->yaw_deg, .pitch_deg = look->pitch_deg, .fov_deg = KARST_LOOK_FOV_DEG};
    double axes[3][3];
    karst_camera_axes(&camera, axes[0], axes[1], axes[2]);
    double half_height = tan(KARST_LOOK_FOV_DEG * M_PI / 360), half_width = half_height * 16 / 9;
    double x = ((i % COLUMNS + 0.5) * 2 / COLUMNS - 1) * half_width,
           y = (1 - (i / COLUMNS + 0.5) * 2 / ROWS) * half_height;
    double length = sqrt(1 + x * x + y * y);
    for (int k = 0; k < 3; k++)
        direction[k] = (axes[2][k] + x * axes[0][k] + y * axes[1][k]) / length;
    return length;
}

/* What a camera shows: distances along its axis, row by row. */
static void probe(prober *p, const karst_look *look, double start_m, double z_m[NUM_RAYS])
{
    for (int i = 0; i < NUM_RAYS; i++) {
        double direction[3], length = ray_of(look, i, direction);
        z_m[i] = trace(p, look->eye_m, direction, start_m) / length;
    }
}

/* Of three rays in a row: is there something in the middle? A plane has 1 / z in proportion to the place in the
 * picture, so what bends that is a shape, and so is an edge against the sky. */
static bool is_shape(double a, double b, double c)
{
    int hits = isfinite(a) + isfinite(b) + isfinite(c);
    if (hits != 3)
        return hits != 0;
    return fabs(1 / a - 2 / b + 1 / c) * b > 0.04;
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* How much there is to see, 0 to 1: shapes, but not so many that all is noise; something, and some way off. */
static double judge(double z_m[NUM_RAYS], double reach_m, double *near_m)
{
    int shapes = 0, triples = 0, hits = 0;
    for (int i = 0; i < NUM_RAYS; i++) {
        int column = i % COLUMNS, row = i / COLUMNS;
        hits += isfinite(z_m[i]);
        if (column > 0 && column < COLUMNS - 1)
            triples++, shapes += is_shape(z_m[i - 1], z_m[i], z_m[i + 1]);
        if (row > 0 && row < ROWS - 1)
            triples++, shapes += is_shape(z_m[i - COLUMNS], z_m[i], z_m[i + COLUMNS]);
    }
    qsort(z_m, NUM_RAYS, sizeof *z_m, compare);
    double share = (double)hits / NUM_RAYS, wealth = (double)shapes / triples;
    *near_m = z_m[hits / 10];
    if (hits == 0)
        return 0;
    double score = wealth * (1 - 0.6 * wealth) * fmin(share / 0.3, 1);
    if (hits > NUM_RAYS * 0.9) /* the sky gives scale */
        score *= 0.6;
    return score * fmin(*near_m / (0.3 * reach_m), 1);
}

/* ---- the sun ---- */

enum {
    SUN_RAYS = 37,
    SUN_STEPS = 120,
    NUM_SUNS = 7
}; /* of a picture; the first of the suns is what headers have by default */
static const double suns_deg[NUM_SUNS][2] = {{135, 40}, {225, 40}, {45, 40}, {315, 40}, {135, 65}, {225, 65}, {0, 80}};
static const double SUNLIT_ENOUGH = 0.2, SUNLIT_LEAST = 0.04; /* shares of what is seen */

/* Points in the air just before what a camera shows; how many. */
static int points_seen(prober *p, const karst_look *look, double points_m[SUN_RAYS][3])
{
    int num_points = 0;
    for (int i = 1; i < NUM_RAYS && num_points < SUN_RAYS; i += 3) {
        double direction[3], *at_m = points_m[num_points];
        ray_of(look, i, direction);
        double t = trace(p, look->eye_m, direction, 0.02 * look->near_m);
        bool in_air = false;
        for (int back = 0; isfinite(t) && back < 4 && !in_air; back++, t *= 0.97) {
            for (int k = 0; k < 3; k++)
                at_m[k] = look->eye_m[k] + t * direction[k];
            in_air = density_at(p, at_m) < 0;
        }
        num_points += in_air;
    }
    return num_points;
}

/* Whether the way to the sun is free, in shorter steps than a camera's: roofs may be thin. */
static bool is_sunlit(prober *p, const double from_m[3], const double direction[3], double start_m)
{
    double t = 0, step = start_m;
    for (int i = 0; i < SUN_STEPS && t < p->farthest_m; i++) {
        t += step;
        double at_m[3];
        for (int k = 0; k < 3; k++)
            at_m[k] = from_m[k] + t * direction[k];
        double d = density_at(p, at_m);
        if (!(d <= 0))
            return isnan(d);
        step = fmin(fmax(-0.6 * d, fmax(0.02 * t, 0.25 * start_m)), 0.15 * t + start_m);
    }
    return true;
}

/* The sun that headers have by default, unless another one reaches far more of what is seen. */
static void choose_sun(prober *p, karst_look *look)
{
    double points_m[SUN_RAYS][3], best = -1;
    look->sun_azimuth_deg = suns_deg[0][0];
    look->sun_elevation_deg = suns_deg[0][1];
    look->is_indoors = false;
    p->budget = MAX_NODE_EVALUATIONS;
    if (p->budget < p->cost * SUN_RAYS * SUN_STEPS * (NUM_SUNS + 1))
        return;
    int num_points = points_seen(p, look, points_m);
    for (int sun = 0; sun < NUM_SUNS && num_points && best < SUNLIT_ENOUGH; sun++) {
        double azimuth = suns_deg[sun][0] * (M_PI / 180), elevation = suns_deg[sun][1] * (M_PI / 180);
        const double direction[3] = {sin(azimuth) * cos(elevation), sin(elevation), cos(azimuth) * cos(elevation)};
        int num_lit = 0;
        for (int i = 0; i < num_points; i++)
            num_lit += is_sunlit(p, points_m[i], direction, 0.02 * look->near_m);
        double lit = (double)num_lit / num_points;
        if (lit > best) {
            best = lit;
            look->sun_azimuth_deg = suns_deg[sun][0];
            look->sun_elevation_deg = suns_deg[sun][1];
        }
    }
    look->is_indoors = num_points && best < SUNLIT_LEAST;
}

bool karst_look_around(karst_oracle *oracle, uint32_t num_nodes, int voxel_log2_m, double nearest_m, double farthest_m,
                       karst_look *best)
{
    prober p = {oracle, voxel_log2_m, MAX_NODE_EVALUATIONS, num_nodes, farthest_m};
    double best_score = 0;
    for (int i = -1;; i++) {
        double reach_m = nearest_m * (i < 0 ? 2 : exp2(0.5 * i));
        /* As is the custom: a few steps in front of the origin. Then farther and farther off, to the side and above. */
        karst_look look = {.eye_m = {0, 0.25 * reach_m, -reach_m}, .yaw_deg = 0, .pitch_deg = -10};
        if (i >= 0)
            look = (karst_look){
                .eye_m = {-0.45 * reach_m, 0.4 * reach_m, -0.8 * reach_m}, .yaw_deg = 29.36, .pitch_deg = -20};
        if (reach_m > 0.25 * farthest_m || p.budget < NUM_RAYS * MAX_STEPS * 0.5 * p.cost) {
            if (best_score > 0)
                choose_sun(&p, best);
            return best_score > 0;
        }
        if (!(density_at(&p, look.eye_m) < 0))
            continue;
        double z_m[NUM_RAYS], score;
        probe(&p, &look, 0.02 * reach_m, z_m);
        score = judge(z_m, reach_m, &look.near_m) * pow(0.93, abs(i - 2));
        if (score > best_score) {
            best_score = score;
            *best = look;
        }
    }
}
