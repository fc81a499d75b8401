#include "producers/language/oracle/look.h"

#include <math.h>
#include <stdlib.h>

enum { COLUMNS = 14, ROWS = 8, NUM_RAYS = COLUMNS * ROWS, MAX_STEPS = 150, BISECTIONS = 5, MAX_CAMERAS = 24 };
static const double MAX_NODE_EVALUATIONS = 3e7;
static const double SKY = INFINITY;

typedef struct {
    karst_oracle *oracle;
    int voxel_log2_m;
    double budget, cost; /* evaluations of nodes that are left; of a point */
    double farthest_m;
    double growth; /* a step's share of what was gone */
} prober;

static double density_at(prober *p, const double at_m[3])
{
    karst_position at = karst_position_add_m((karst_position){{0}, {0}}, at_m, p->voxel_log2_m);
    p->budget -= p->cost;
    return karst_oracle_precise_density(p->oracle, &at, -1);
}

static double density_along(prober *p, const double eye_m[3], const double direction[3], double t)
{
    double at_m[3];
    for (int k = 0; k < 3; k++)
        at_m[k] = eye_m[k] + t * direction[k];
    return density_at(p, at_m);
}

/* How far a ray from the air goes, by signs alone: a density need be no distance, nor in metres. Steps grow with what
 * was gone, as what is to be seen does, and more so beyond what a camera is there for. */
static double trace(prober *p, const double eye_m[3], const double direction[3], double start_m)
{
    double t = 0, step = start_m, far_m = fmin(p->farthest_m, 3200 * start_m);
    for (int i = 0; i < MAX_STEPS && t < far_m; i++) {
        t += step;
        double d = density_along(p, eye_m, direction, t);
        if (isnan(d)) /* air, but no way on */
            return SKY;
        if (d > 0) {
            double air = t - step, solid = t;
            for (int k = 0; k < BISECTIONS; k++) {
                double middle = 0.5 * (air + solid);
                *(density_along(p, eye_m, direction, middle) > 0 ? &solid : &air) = middle;
            }
            return 0.5 * (air + solid);
        }
        step = fmax((t < 150 * start_m ? 1 : 3) * p->growth * t, 0.5 * start_m);
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
            in_air = density_at(p, at_m) <= 0;
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
        step = fmax(0.06 * t, 0.5 * start_m);
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

/* ---- bodies ---- */

enum { GRID = 12, MAX_LOOKS = 10 }; /* points on a side; even, so that none is the origin */

/* The box of what is solid of a grid over centre + [-half, half]^3. */
typedef struct {
    double low_m[3], high_m[3];
} solid_box;

static void point_of(int i, const double centre_m[3], double half_m, double at_m[3])
{
    const int at[3] = {i % GRID, i / GRID % GRID, i / (GRID * GRID)};
    for (int k = 0; k < 3; k++)
        at_m[k] = centre_m[k] + half_m * (2.0 * at[k] / (GRID - 1) - 1);
}

/* false: nothing is. */
static bool look_for_solids(prober *p, const double centre_m[3], double half_m, solid_box *box)
{
    bool any = false;
    double at_m[3];
    for (int i = 0; i < GRID * GRID * GRID; i++) {
        point_of(i, centre_m, half_m, at_m);
        if (!(density_at(p, at_m) > 0))
            continue;
        for (int k = 0; k < 3; k++) {
            box->low_m[k] = any ? fmin(box->low_m[k], at_m[k]) : at_m[k];
            box->high_m[k] = any ? fmax(box->high_m[k], at_m[k]) : at_m[k];
        }
        any = true;
    }
    return any;
}

/* Whether all that is solid is one body around the origin: then the cube about
 * it. From grids that halve in size,
 * the first with something in it; then from grids about that, as large as it is. */
static bool find_body(prober *p, double nearest_m, double centre_m[3], double *reach_m)
{
    solid_box box;
    double half_m = p->farthest_m;
    for (int k = 0; k < 3; k++)
        centre_m[k] = 0;
    if (p->budget < 3 * MAX_LOOKS * GRID * GRID * GRID * p->cost || look_for_solids(p, centre_m, half_m, &box))
        return false;
    do
        half_m *= 0.5;
    while (half_m > nearest_m / 64 && !look_for_solids(p, centre_m, half_m, &box));
    if (half_m <= nearest_m / 64)
        return false;
    for (int look = 0; look < MAX_LOOKS; look++) {
        double cell_m = 2 * half_m / (GRID - 1);
        *reach_m = 0;
        for (int k = 0; k < 3; k++) {
            *reach_m = fmax(*reach_m, 0.5 * (box.high_m[k] - box.low_m[k]) + cell_m);
            centre_m[k] = 0.5 * (box.low_m[k] + box.high_m[k]);
        }
        if (!look_for_solids(p, centre_m, *reach_m, &box) || *reach_m > 0.25 * p->farthest_m)
            return false;
        bool is_held = true;
        for (int k = 0; k < 3; k++)
            is_held &= box.low_m[k] > centre_m[k] - 0.999 * *reach_m && box.high_m[k] < centre_m[k] + 0.999 * *reach_m;
        bool is_close = *reach_m > 0.8 * half_m;
        half_m = *reach_m;
        if (is_held && is_close)
            return true;
    }
    return false;
}

/* From where all of a body is in the picture, if that is 4:3 or wider, seen a little from above. */
static bool frame_body(prober *p, double nearest_m, karst_look *look)
{
    double centre_m[3], reach_m, away_m = 0, nearest_z_m = 0;
    if (!find_body(p, nearest_m, centre_m, &reach_m))
        return false;
    *look = (karst_look){.yaw_deg = 29.36, .pitch_deg = -20};
    karst_camera camera = {.yaw_deg = look->yaw_deg, .pitch_deg = look->pitch_deg, .fov_deg = KARST_LOOK_FOV_DEG};
    double axes[3][3], half_height = tan(KARST_LOOK_FOV_DEG * M_PI / 360), cell_m = 2 * reach_m / (GRID - 1);
    karst_camera_axes(&camera, axes[0], axes[1], axes[2]);
    for (int i = 0; i < GRID * GRID * GRID; i++) {
        double at_m[3], along[3] = {0, 0, 0};
        point_of(i, centre_m, reach_m, at_m);
        if (!(density_at(p, at_m) > 0))
            continue;
        for (int axis = 0; axis < 3; axis++)
            for (int k = 0; k < 3; k++)
                along[axis] += axes[axis][k] * (at_m[k] - centre_m[k]);
        away_m = fmax(away_m, (fabs(along[1]) + cell_m) / half_height - along[2]);
        away_m = fmax(away_m, (fabs(along[0]) + cell_m) / (half_height * 4 / 3) - along[2]);
        nearest_z_m = fmin(nearest_z_m, along[2] - cell_m);
    }
    for (int k = 0; k < 3; k++)
        look->eye_m[k] = centre_m[k] - away_m * axes[2][k];
    look->near_m = fmax(away_m + nearest_z_m, 0.1 * away_m);
    return density_at(p, look->eye_m) <= 0;
}

bool karst_look_around(karst_oracle *oracle, uint32_t num_nodes, int voxel_log2_m, double nearest_m, double farthest_m,
                       karst_look *best)
{
    prober p = {oracle, voxel_log2_m, MAX_NODE_EVALUATIONS, num_nodes, farthest_m, 0};
    /* Finer steps where a point costs little. */
    p.growth = fmin(fmax(0.05 * NUM_RAYS * 100 * MAX_CAMERAS * p.cost / MAX_NODE_EVALUATIONS, 0.05), 0.2);
    if (frame_body(&p, nearest_m, best)) {
        choose_sun(&p, best);
        return true;
    }
    p.budget = MAX_NODE_EVALUATIONS;
    double best_score = 0;
    for (int i = -1;; i++) {
        double reach_m = nearest_m * (i < 0 ? 2 : exp2(0.5 * i));
        /* As is the custom: a few steps in front of the origin. Then farther and farther off, to the side and above. */
        karst_look look = {.eye_m = {0, 0.25 * reach_m, -reach_m}, .yaw_deg = 0, .pitch_deg = -10};
        if (i >= 0)
            look = (karst_look){
                .eye_m = {-0.45 * reach_m, 0.4 * reach_m, -0.8 * reach_m}, .yaw_deg = 29.36, .pitch_deg = -20};
        if (reach_m > 0.25 * farthest_m || p.budget < NUM_RAYS * 20 * p.cost) {
            if (best_score > 0)
                choose_sun(&p, best);
            return best_score > 0;
        }
        if (!(density_at(&p, look.eye_m) <= 0))
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
