/* The reference over a picture: its rays, threads, and what they find. */
#include "karst/reference.h"

#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "producers/language/oracle/oracle.h"
#include "producers/density/world_file.h"
#include "raycast/cast/cast.h"
#include "raycast/light/atmosphere.clh"
#include "raycast/light/light.h"
#include "raycast/light/skies.h"
#include "raycast/cast/pinhole.h"
#include "raycast/cast/rays.clh"
#include "reference/open.h"
#include "reference/rows.h"
#include "reference/trace.h"

#define DEFAULT_MAX_INTERVALS (1u << 20)

typedef struct {
    const karst_reference_config *config;
    karst_world_file *file;
    karst_camera camera;
    karst_pinhole pinhole;
    double voxel_m;
    karst_reference_ray ray;   /* all but the direction */
    karst_reference_hit *hits; /* or */
    uint8_t *rgba;             /* of a picture of num_columns x rows.num_rows, rays_px^2 rays a pixel */
    int rays_px, num_columns;
    karst_rows rows;
    karst_light light;
    karst_skies *skies;   /* NULL: the world has no atmosphere */
    karst_number *values; /* of the parameters */
    karst_reference_stats stats;
    pthread_mutex_t lock; /* of stats */
} picture;

typedef struct {
    picture *picture;
    karst_ranger *ranger;
    karst_oracle *oracle; /* for colours; NULL: the world has none, or nobody wants them */
} worker;

/* The density that a ray meets at a root's level, or between levels, at t. */
static double density_near(const worker *w, const karst_position *from, const double direction[3],
                           const karst_reference_root *root, double t)
{
    double d = karst_ranger_density(w->ranger, from, direction, t, root->level);
    if (root->weight > 0)
        d += root->weight * (karst_ranger_density(w->ranger, from, direction, t, root->level + 1) - d);
    return d;
}

static bool find_gradient(const worker *w, const double direction[3], const karst_reference_root *root, double t,
                          double gradient[3])
{
    const karst_position *anchor = &w->picture->camera.position;
    double next[3];
    if (!karst_ranger_gradient(w->ranger, anchor, direction, t, root->level, gradient))
        return false;
    if (!(root->weight > 0))
        return true;
    bool known = karst_ranger_gradient(w->ranger, anchor, direction, t, root->level + 1, next);
    for (int i = 0; i < 3; i++)
        gradient[i] += root->weight * (next[i] - gradient[i]);
    return known;
}

/* A root is known within this share of the distance, and somewhat more. */
#define ROOT_ERROR 1e-8
/* How far apart a jump is looked for around the ray, as a share of the distance, and so many times that along it. */
#define JUMP_APART 1e-6
#define JUMP_REACH 64.0
#define JUMP_BISECTIONS 48

/* How far before and behind the root a jump is looked for: what decides it may be a float, and jump somewhere near. */
#define NUM_REACHES 3
static double reach_of(const karst_reference_root *root, int number)
{
    return ldexp(fmax(ROOT_ERROR * root->t, 0x1p-28), 4 * number);
}

/* Whether the density changes far more between two places about the root than its slopes there say. `gradient`: at the
 * root; NULL: it has none. What is flat there can only jump. */
static bool is_jump(const worker *w, const double direction[3], const karst_reference_root *root,
                    const double gradient[3])
{
    const karst_position *anchor = &w->picture->camera.position;
    bool is_flat = true;
    for (int n = 0; n < NUM_REACHES; n++) {
        const double reach = reach_of(root, n);
        double before[3], slope = 0;
        const double rise = density_near(w, anchor, direction, root, root->t + reach) -
                            density_near(w, anchor, direction, root, root->t - reach);
        if (!gradient || !find_gradient(w, direction, root, root->t - reach, before))
            return true;
        for (int i = 0; i < 3; i++)
            slope += fmax(fabs(gradient[i]), fabs(before[i]));
        if (rise > 64 * reach * slope)
            return true;
        is_flat = is_flat && slope == 0;
    }
    return is_flat;
}

/* Where a jump decides, the surface is the jump's: from where neighbours of the ray meet it. false: they do not. */
static bool find_neighbours_gradient(const worker *w, const double direction[3], const karst_reference_root *root,
                                     double gradient[3])
{
    const karst_position *anchor = &w->picture->camera.position;
    double apart = fmax(JUMP_APART * root->t, 0x1p-20), side[2][3];
    int least = fabs(direction[0]) < fabs(direction[1]) ? 0 : 1;
    least = fabs(direction[2]) < fabs(direction[least]) ? 2 : least;
    double length = sqrt(1 - direction[least] * direction[least]);
    for (int i = 0; i < 3; i++) {
        gradient[i] = direction[i];
        side[0][i] = ((i == least) - direction[least] * direction[i]) / length;
    }
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        side[1][i] = direction[j] * side[0][k] - direction[k] * side[0][j];
    }
    for (int s = 0; s < 2; s++) {
        double t[2] = {root->t, root->t};
        int num_known = 0;
        for (int sign = 0; sign < 2; sign++) {
            karst_position from = karst_reference_place(anchor, side[s], sign ? apart : -apart);
            double air = root->t - JUMP_REACH * apart, solid = root->t + JUMP_REACH * apart;
            if (density_near(w, &from, direction, root, air) > 0 ||
                !(density_near(w, &from, direction, root, solid) > 0))
                continue;
            for (int i = 0; i < JUMP_BISECTIONS; i++) {
                double middle = 0.5 * (air + solid);
                *(density_near(w, &from, direction, root, middle) > 0 ? &solid : &air) = middle;
            }
            t[sign] = solid;
            num_known++;
        }
        if (num_known == 0)
            return false;
        double steep = (t[1] - t[0]) / (num_known * apart);
        for (int i = 0; i < 3; i++)
            gradient[i] -= steep * side[s][i];
    }
    return true;
}

/* From the argument that jumps, if that is known. */
static bool find_jump_gradient(const worker *w, const double direction[3], const karst_reference_root *root,
                               double gradient[3])
{
    for (int n = 0; n < NUM_REACHES; n++) {
        const double reach = reach_of(root, n);
        if (karst_ranger_jump(w->ranger, &w->picture->camera.position, direction, root->t - reach, root->t + reach,
                              root->level, gradient))
            return true;
    }
    return find_neighbours_gradient(w, direction, root, gradient);
}

static void trace_ray(const worker *w, vector3 direction, karst_reference_hit *hit, karst_reference_stats *stats)
{
    const picture *p = w->picture;
    karst_reference_ray ray = p->ray;
    ray.direction[0] = (double)direction.x;
    ray.direction[1] = (double)direction.y;
    ray.direction[2] = (double)direction.z;
    const karst_position *anchor = &p->camera.position;
    karst_reference_root root = karst_reference_first(w->ranger, anchor, &ray);
    bool is_miss = root.kind == KARST_REFERENCE_MISS;
    *hit = (karst_reference_hit){.kind = root.kind, .level = root.level};
    hit->t_m = is_miss ? INFINITY : root.t * p->voxel_m;
    hit->footprint_m = root.t * (double)p->pinhole.cone * p->voxel_m;
    double gradient[3], length = 0;
    bool known = !is_miss && find_gradient(w, ray.direction, &root, root.t, gradient);
    if (root.kind == KARST_REFERENCE_SURFACE && is_jump(w, ray.direction, &root, known ? gradient : NULL))
        known = find_jump_gradient(w, ray.direction, &root, gradient) || known;
    if (known)
        length = sqrt(gradient[0] * gradient[0] + gradient[1] * gradient[1] + gradient[2] * gradient[2]);
    for (int i = 0; i < 3; i++)
        hit->normal[i] = length > 0 ? -gradient[i] / length : -ray.direction[i];
    stats->num_intervals += root.num_intervals;
    stats->num_grazes += root.num_grazes;
    stats->num_unresolved += root.kind == KARST_REFERENCE_UNRESOLVED;
}

/* Linear light along a ray. */
static colour light_of_ray(const worker *w, vector3 direction, karst_reference_stats *stats)
{
    const picture *p = w->picture;
    karst_reference_hit hit;
    trace_ray(w, direction, &hit, stats);
    float to_sun = dot3(&direction, p->light.sun_direction);
    if (hit.kind == KARST_REFERENCE_MISS)
        return p->skies ? air_sky_with_sun(karst_skies_sky(p->skies), karst_skies_table(p->skies), &p->light,
                                           &direction, to_sun)
                        : sky_colour(&p->light, &direction, to_sun);
    const float facing[KARST_FACING_FLOATS] = {(float)hit.normal[0], (float)hit.normal[1], (float)hit.normal[2]};
    const vector3 n = {facing[0], facing[1], facing[2]};
    colour albedo = plain_albedo(&p->light, &n), own = {0, 0, 0};
    if (w->oracle) {
        const double d[3] = {(double)direction.x, (double)direction.y, (double)direction.z};
        karst_position at = karst_reference_place(&p->camera.position, d, hit.t_m / p->voxel_m);
        karst_oracle_value values[KARST_NUM_ROOTS];
        karst_oracle_shading(w->oracle, &at, facing, -1, values);
        const karst_oracle_value *rgb = values + KARST_ROOT_COLOUR, *emitted = values + KARST_ROOT_EMISSION;
        albedo.r = lane_unit((float)rgb[0].precise);
        albedo.g = lane_unit((float)rgb[1].precise);
        albedo.b = lane_unit((float)rgb[2].precise);
        own.r = own_light((float)emitted[0].precise);
        own.g = own_light((float)emitted[1].precise);
        own.b = own_light((float)emitted[2].precise);
    }
    colour ground = ground_colour(&p->light, &n, albedo, lane_max(dot3(&n, p->light.sun_direction), 0.0f));
    ground = add_colour(ground, own, 1.0f);
    const float t = (float)(hit.t_m / p->voxel_m);
    if (!p->skies)
        return hazy_colour(&p->light, ground, &direction, to_sun, t);
    const air_way way = air_way_of(karst_skies_sky(p->skies), karst_skies_table(p->skies), &direction, to_sun, t);
    return air_through(&way, ground);
}

static void shade_pixel(const worker *w, int x, int y, uint8_t *rgba, karst_reference_stats *stats)
{
    const picture *p = w->picture;
    double sum[3] = {0, 0, 0}, share = 1.0 / (p->rays_px * p->rays_px);
    for (int i = 0; i < p->rays_px * p->rays_px; i++) {
        int u = x * p->rays_px + i % p->rays_px, v = y * p->rays_px + i / p->rays_px;
        colour c = light_of_ray(w, pinhole_direction(&p->pinhole, u, v), stats);
        sum[0] += (double)c.r * share;
        sum[1] += (double)c.g * share;
        sum[2] += (double)c.b * share;
    }
    for (int i = 0; i < 3; i++)
        rgba[i] = (uint8_t)tone_byte((float)sum[i], tone_dither(x, y));
    rgba[3] = 255;
}

static void *trace_rows(void *user)
{
    worker *w = user;
    picture *p = w->picture;
    karst_reference_stats stats = {0};
    for (int y; (y = karst_rows_take(&p->rows)) >= 0;) {
        for (int x = 0; x < p->num_columns && !atomic_load(&p->rows.stop); x++) {
            size_t pixel = (size_t)y * (size_t)p->num_columns + (size_t)x;
            if (p->hits)
                trace_ray(w, pinhole_direction(&p->pinhole, x, y), &p->hits[pixel], &stats);
            else
                shade_pixel(w, x, y, p->rgba + 4 * pixel, &stats);
        }
        karst_rows_finish(&p->rows);
    }
    pthread_mutex_lock(&p->lock);
    p->stats.num_intervals += stats.num_intervals;
    p->stats.num_grazes += stats.num_grazes;
    p->stats.num_unresolved += stats.num_unresolved;
    pthread_mutex_unlock(&p->lock);
    return NULL;
}

static bool check_config(const karst_reference_config *c, karst_error *error)
{
    if (!c->world)
        return karst_fail(error, KARST_USAGE, "the reference needs a world file");
    if (c->width_px < 1 || c->width_px > 16384 || c->height_px < 1 || c->height_px > 16384)
        return karst_fail(error, KARST_USAGE, "a picture of %dx%d: each side must be 1 to 16384", c->width_px,
                          c->height_px);
    if (c->detail_px != 0 && !(c->detail_px >= 0.25 && c->detail_px <= 64))
        return karst_fail(error, KARST_USAGE, "detail %g: must be 0.25 to 64 pixels per voxel", c->detail_px);
    if (!(c->view_distance_m >= 0) || !isfinite(c->view_distance_m))
        return karst_fail(error, KARST_USAGE, "view distance %g m: must be positive", c->view_distance_m);
    if (c->num_threads < 0 || c->num_threads > KARST_ROWS_MAX_THREADS)
        return karst_fail(error, KARST_USAGE, "%d threads: must be 0 to %d", c->num_threads, KARST_ROWS_MAX_THREADS);
    return true;
}

static bool set_light(picture *p, karst_error *error)
{
    const karst_world_info *info = &p->file->info;
    p->light = karst_light_of_sun(info->sun_azimuth_deg, info->sun_elevation_deg);
    const karst_haze haze = {info->haze_distance_m, info->haze_height_m, info->haze_globe_m};
    double eye_m[3];
    for (int axis = 0; axis < 3; axis++)
        eye_m[axis] = (double)p->camera.position.voxel[axis] * p->voxel_m;
    karst_light_set_haze(&p->light, &haze, eye_m, p->voxel_m);
    memcpy(p->light.sky_zenith, info->sky_zenith, sizeof info->sky_zenith);
    memcpy(p->light.sky_horizon, info->sky_horizon, sizeof info->sky_horizon);
    memcpy(p->light.ground_flat, info->ground_flat, sizeof info->ground_flat);
    memcpy(p->light.ground_steep, info->ground_steep, sizeof info->ground_steep);
    if (!info->has_atmosphere)
        return true;
    karst_sky_view view = {.globe_m = info->haze_globe_m, .voxel_m = p->voxel_m};
    memcpy(view.eye_m, eye_m, sizeof eye_m);
    memcpy(view.sun_direction, p->light.sun_direction, sizeof view.sun_direction);
    p->skies = karst_skies_create(NULL, info->haze_globe_m, info->dust, error);
    if (!p->skies || !karst_skies_aim(p->skies, &view, error))
        return false;
    karst_skies_light(p->skies, &p->light);
    return true;
}

/* Opens the world and finds out what all rays share. */
static bool prepare(picture *p, karst_error *error)
{
    const karst_reference_config *c = p->config;
    p->file = karst_reference_open(c, error);
    if (!p->file)
        return false;
    int voxel_log2_m = p->file->info.voxel_log2_m;
    p->camera = (karst_camera){.fov_deg = 60};
    if (c->camera)
        p->camera = *c->camera;
    else if (!karst_camera_parse(p->file->info.camera, voxel_log2_m, &p->camera, error))
        return false;
    p->voxel_m = ldexp(1, voxel_log2_m);
    double view_m = c->view_distance_m > 0 ? c->view_distance_m : p->file->info.view_distance_m;
    p->num_columns = c->width_px;
    p->rows.num_rows = c->height_px;
    karst_pinhole_init(&p->pinhole, &p->camera, c->width_px * p->rays_px, c->height_px * p->rays_px,
                       view_m / p->voxel_m);
    p->ray.t_max = (double)p->pinhole.t_max;
    p->ray.max_intervals = c->max_intervals ? c->max_intervals : DEFAULT_MAX_INTERVALS;
    float detail = c->detail_px > 0 ? (float)c->detail_px : 1.0f, grown = p->pinhole.cone * detail;
    p->ray.blend = c->footprint == KARST_FOOTPRINT_BLENDED ? KARST_BLEND_SHARE : 0;
    bool full = p->rgba || c->footprint == KARST_FOOTPRINT_NONE;
    p->ray.lod_scale = full ? 0 : 1.0f / (grown > 1.0e-20f ? grown : 1.0e-20f);
    if (!set_light(p, error))
        return false;
    const karst_program_graph *program = p->file->program;
    p->values = calloc(program->num_parameters + 1, sizeof *p->values);
    for (uint32_t i = 0; p->values && i < program->num_parameters; i++)
        p->values[i] = program->parameters[i].value;
    return p->values || karst_fail(error, KARST_FAILED, "out of memory");
}

static bool make_worker(picture *p, worker *w, karst_error *error)
{
    const karst_program_graph *program = p->file->program;
    uint32_t seed = p->config->has_seed ? p->config->seed : program->header.seed;
    w->picture = p;
    w->ranger = karst_ranger_create(program, p->values, seed, error);
    if (w->ranger && p->rgba && karst_has_output(program->root, KARST_OUTPUT_COLOUR)) {
        w->oracle = karst_oracle_create(&program->world, p->values, seed, program->header.voxel_log2_m, error);
        return w->oracle != NULL;
    }
    return w->ranger != NULL;
}

static bool run(picture *p, bool (*progress)(void *user, double share), void *user, karst_reference_stats *stats,
                karst_error *error)
{
    const karst_reference_config *config = p->config;
    worker workers[KARST_ROWS_MAX_THREADS] = {{NULL, NULL, NULL}};
    const int num_threads = karst_rows_num_threads(config->num_threads);
    if (!check_config(config, error))
        return false;
    bool good = prepare(p, error);
    /* One after the other: they share the program's arena while they are made. */
    for (int i = 0; good && i < num_threads; i++)
        good = make_worker(p, &workers[i], error);
    pthread_mutex_init(&p->lock, NULL);
    good = good && karst_rows_run(&p->rows, trace_rows, workers, sizeof *workers, num_threads, progress, user, error);
    pthread_mutex_destroy(&p->lock);
    for (int i = 0; i < num_threads; i++) {
        karst_ranger_destroy(workers[i].ranger);
        karst_oracle_destroy(workers[i].oracle);
    }
    free(p->values);
    karst_skies_destroy(p->skies);
    karst_world_file_destroy(p->file);
    if (good && stats)
        *stats = p->stats;
    return good;
}

bool karst_reference_trace(const karst_reference_config *config, karst_reference_hit *hits,
                           bool (*progress)(void *user, double share), void *user, karst_reference_stats *stats,
                           karst_error *error)
{
    picture p = {.config = config, .hits = hits, .rays_px = 1};
    return run(&p, progress, user, stats, error);
}

bool karst_reference_picture(const karst_reference_config *config, int rays_px, uint8_t *rgba,
                             bool (*progress)(void *user, double share), void *user, karst_reference_stats *stats,
                             karst_error *error)
{
    picture p = {.config = config, .rgba = rgba, .rays_px = rays_px};
    if (rays_px < 1 || rays_px > 8)
        return karst_fail(error, KARST_USAGE, "%d rays on a pixel's side: must be 1 to 8", rays_px);
    return run(&p, progress, user, stats, error);
}
