/* What media show of the light, over a picture: its scene, threads, and sums. */
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "producers/density/world_internal.h"
#include "raycast/cast/pinhole.h"
#include "raycast/light/light.h"
#include "reference/open.h"
#include "reference/rows.h"
#include "reference/scatter_path.h"

#define MOST_PATHS (1u << 24)
#define MOST_NODES (1u << 24)
#define MOST_VOXEL ((int64_t)1 << 61) /* as engines have it */

typedef struct {
    const karst_reference_config *config;
    karst_reference_light light; /* defaults filled in */
    karst_world_file *file;
    karst_world air; /* what samplers of the extinction read; borrows from the file */
    karst_camera camera;
    karst_pinhole pinhole;
    karst_scatter_tree tree;
    karst_scatter_scene scene;
    double from[3];
    double *rgb, *deviation;
    karst_rows rows;
    pthread_mutex_t lock; /* of what follows */
    karst_reference_light_stats stats;
    double exceeded;
} picture;

typedef struct {
    picture *picture;
    karst_scatter_walker walker;
} worker;

/* Through a place of the picture, in pixels. */
static void direction_through(const karst_pinhole *p, double x, double y, double d[3])
{
    const double across = (2 * x / p->width_px - 1) * (double)p->half_width,
                 up = (1 - 2 * y / p->height_px) * (double)p->half_height;
    double square = 0;
    for (int i = 0; i < 3; i++) {
        d[i] = across * (double)p->right[i] + up * (double)p->up[i] + (double)p->forward[i];
        square += d[i] * d[i];
    }
    for (int i = 0; i < 3; i++)
        d[i] /= sqrt(square);
}

static void trace_pixel(worker *w, int x, int y)
{
    picture *p = w->picture;
    double direction[3], mean[3] = {0, 0, 0}, squares[3] = {0, 0, 0};
    const size_t pixel = (size_t)y * (size_t)p->config->width_px + (size_t)x;
    const uint32_t num = p->light.paths_px;
    direction_through(&p->pinhole, x + 0.5, y + 0.5, direction);
    for (uint32_t i = 0; i < num; i++) {
        double rgb[3] = {0, 0, 0};
        if (p->light.spread_px) {
            /* R. Roberts' sequence, which fills a square evenly. */
            const double u = i * 0.7548776662466927, v = i * 0.5698402909980532;
            direction_through(&p->pinhole, x + (u - floor(u)), y + (v - floor(v)), direction);
        }
        karst_scatter_path(&w->walker, pixel, i, p->from, direction, rgb);
        for (int c = 0; c < 3; c++) {
            const double off = rgb[c] - mean[c];
            mean[c] += off / (i + 1);
            squares[c] += off * (rgb[c] - mean[c]);
        }
    }
    for (size_t c = 0; c < 3; c++) {
        p->rgb[3 * pixel + c] = mean[c];
        if (p->deviation)
            p->deviation[3 * pixel + c] = num > 1 ? sqrt(squares[c] / (num - 1) / num) : INFINITY;
    }
}

static void *trace_rows(void *user)
{
    worker *w = user;
    picture *p = w->picture;
    for (int y; (y = karst_rows_take(&p->rows)) >= 0;) {
        for (int x = 0; x < p->config->width_px && !atomic_load(&p->rows.stop); x++)
            trace_pixel(w, x, y);
        karst_rows_finish(&p->rows);
    }
    pthread_mutex_lock(&p->lock);
    p->stats.num_lookups += w->walker.num_lookups;
    p->stats.num_collisions += w->walker.num_collisions;
    p->exceeded = fmax(p->exceeded, w->walker.exceeded);
    pthread_mutex_unlock(&p->lock);
    return NULL;
}

/* ---- what is asked for ---- */

static bool is_light(const double rgb[3])
{
    bool good = true;
    for (int c = 0; c < 3; c++)
        good = good && rgb[c] >= 0 && isfinite(rgb[c]);
    return good;
}

static bool check(const karst_reference_config *c, const karst_reference_light *light, karst_error *error)
{
    if (!c->world)
        return karst_fail(error, KARST_USAGE, "the reference needs a world file");
    if (c->width_px < 1 || c->width_px > 16384 || c->height_px < 1 || c->height_px > 16384)
        return karst_fail(error, KARST_USAGE, "a picture of %dx%d: each side must be 1 to 16384", c->width_px,
                          c->height_px);
    if (!(c->view_distance_m >= 0) || !isfinite(c->view_distance_m))
        return karst_fail(error, KARST_USAGE, "view distance %g m: must be positive", c->view_distance_m);
    if (c->num_threads < 0 || c->num_threads > KARST_ROWS_MAX_THREADS)
        return karst_fail(error, KARST_USAGE, "%d threads: must be 0 to %d", c->num_threads, KARST_ROWS_MAX_THREADS);
    if (light->paths_px > MOST_PATHS)
        return karst_fail(error, KARST_USAGE, "%u paths a pixel: must be 1 to %u", light->paths_px, MOST_PATHS);
    if (light->max_nodes != 0 && (light->max_nodes < 9 || light->max_nodes > MOST_NODES))
        return karst_fail(error, KARST_USAGE, "%u nodes of bounds: must be 9 to %u", light->max_nodes, MOST_NODES);
    if (!is_light(light->above) || !is_light(light->below))
        return karst_fail(error, KARST_USAGE, "light from above and below must be finite, and 0 or more");
    return true;
}

static bool open_world(picture *p, karst_error *error)
{
    const karst_reference_config *c = p->config;
    p->file = karst_reference_open(c, error);
    if (!p->file)
        return false;
    if (!p->file->content[KARST_CONTENT_AIR])
        return karst_fail(error, KARST_USAGE, "%s has no medium: it says nothing of `medium air(vec3 p)`",
                          p->file->info.name);
    if (p->file->program->header.num_particles > 0)
        return karst_fail(error, KARST_USAGE, "%s has particles, of which paths of light know nothing",
                          p->file->info.name);
    return true;
}

/* The extinction as a world of its own, as samplers take it. */
static bool open_air(picture *p, karst_error *error)
{
    karst_world_file *file = p->file->content[KARST_CONTENT_AIR];
    const karst_program_graph *program = file->program;
    const uint32_t seed = p->config->has_seed ? p->config->seed : program->header.seed;
    const int voxel_log2_m = p->file->info.voxel_log2_m;
    karst_number *values = calloc(program->num_parameters + 1, sizeof *values);
    p->air = (karst_world){.file = file, .metadata = {.voxel_log2_m = voxel_log2_m, .seed = seed}};
    p->air.data = calloc(file->layout.num_words, sizeof *p->air.data);
    for (uint32_t i = 0; values && i < program->num_parameters; i++)
        values[i] = program->parameters[i].value;
    const bool done = values && p->air.data &&
                      karst_world_data_fill(&file->layout, values, seed, voxel_log2_m, p->air.data) &&
                      (p->air.oracle = karst_oracle_create(&program->world, values, seed, voxel_log2_m, error));
    free(values);
    return done || karst_fail(error, KARST_FAILED, "out of memory");
}

static void set_scene(picture *p)
{
    const karst_world_info *info = &p->file->info;
    const karst_light sun = karst_light_of_sun(info->sun_azimuth_deg, info->sun_elevation_deg);
    double length = 0;
    p->scene = (karst_scatter_scene){.tree = &p->tree, .light = &p->light, .voxel_m = ldexp(1, info->voxel_log2_m)};
    for (int i = 0; i < 3; i++) {
        p->scene.to_sun[i] = (double)sun.sun_direction[i];
        p->scene.sun_colour[i] = (double)(info->has_sun_colour ? info->sun_colour[i] : sun.sun_colour[i]);
        length += p->scene.to_sun[i] * p->scene.to_sun[i];
        p->from[i] = (double)(p->camera.position.voxel[i] - p->tree.corner.voxel[i]) +
                     ldexp((double)p->camera.position.fraction[i], -32);
    }
    for (int i = 0; i < 3; i++)
        p->scene.to_sun[i] /= sqrt(length);
    const double sun_share = p->light.no_sun ? 0 : 0.5 * fmax(p->scene.to_sun[1], 0);
    for (int c = 0; c < 3; c++) {
        p->scene.sky[c] = 0.5 * ((double)info->sky_zenith[c] + (double)info->sky_horizon[c]);
        p->scene.ground[c] = (double)info->ground_flat[c] * (p->scene.sky[c] + sun_share * p->scene.sun_colour[c]);
    }
    p->scene.has_emission =
        karst_has_output(p->file->content[KARST_CONTENT_AIR]->program->world.root, KARST_OUTPUT_EMISSION);
}

static bool prepare(picture *p, karst_error *error)
{
    const karst_reference_config *c = p->config;
    if (!open_world(p, error) || !open_air(p, error))
        return false;
    const int voxel_log2_m = p->file->info.voxel_log2_m;
    p->camera = (karst_camera){.fov_deg = 60};
    if (c->camera)
        p->camera = *c->camera;
    else if (!karst_camera_parse(p->file->info.camera, voxel_log2_m, &p->camera, error))
        return false;
    for (int axis = 0; axis < 3; axis++)
        if (p->camera.position.voxel[axis] > MOST_VOXEL || p->camera.position.voxel[axis] < -MOST_VOXEL)
            return karst_fail(error, KARST_USAGE, "a camera may not be beyond 2^61 voxels");
    const double view_m = c->view_distance_m > 0 ? c->view_distance_m : p->file->info.view_distance_m,
                 view = ldexp(view_m, -voxel_log2_m);
    karst_pinhole_init(&p->pinhole, &p->camera, c->width_px, c->height_px, view);
    karst_sampler *sampler = karst_sampler_create(&p->air, error);
    const bool done = sampler && karst_scatter_tree_init(&p->tree, sampler, voxel_log2_m, &p->camera.position, view,
                                                         p->light.max_nodes, error);
    karst_sampler_destroy(sampler);
    if (done)
        set_scene(p);
    return done;
}

static bool make_worker(picture *p, worker *w, karst_error *error)
{
    w->picture = p;
    w->walker.scene = &p->scene;
    w->walker.sampler = karst_sampler_create(&p->air, error);
    w->walker.oracle = w->walker.sampler ? karst_oracle_clone(p->air.oracle, error) : NULL;
    return w->walker.oracle != NULL;
}

static bool trace(picture *p, bool (*progress)(void *user, double share), void *user, karst_error *error)
{
    worker *workers = calloc(KARST_ROWS_MAX_THREADS, sizeof *workers);
    const int num_threads = karst_rows_num_threads(p->config->num_threads);
    if (!workers)
        return karst_fail(error, KARST_FAILED, "out of memory");
    bool good = true;
    for (int i = 0; good && i < num_threads; i++)
        good = make_worker(p, &workers[i], error);
    pthread_mutex_init(&p->lock, NULL);
    good = good && karst_rows_run(&p->rows, trace_rows, workers, sizeof *workers, num_threads, progress, user, error);
    pthread_mutex_destroy(&p->lock);
    for (int i = 0; i < num_threads; i++) {
        karst_sampler_destroy(workers[i].walker.sampler);
        karst_oracle_destroy(workers[i].walker.oracle);
    }
    free(workers);
    if (good && p->exceeded > 0)
        return karst_fail(error, KARST_FAILED,
                          "an extinction of %g per metre lies above its proved bound: please report it", p->exceeded);
    return good;
}

bool karst_reference_scatter(const karst_reference_config *config, const karst_reference_light *light, double *rgb,
                             double *deviation, bool (*progress)(void *user, double share), void *user,
                             karst_reference_light_stats *stats, karst_error *error)
{
    picture p = {
        .config = config, .rows.num_rows = config->height_px, .light = *light, .rgb = rgb, .deviation = deviation};
    if (!check(config, light, error))
        return false;
    p.light.paths_px = light->paths_px ? light->paths_px : 64;
    p.light.max_nodes = light->max_nodes ? light->max_nodes : 32768;
    const bool good = prepare(&p, error) && trace(&p, progress, user, error);
    p.stats.num_paths = (uint64_t)config->width_px * (uint64_t)config->height_px * p.light.paths_px;
    p.stats.num_nodes = p.tree.num_nodes;
    karst_scatter_tree_finish(&p.tree);
    karst_oracle_destroy(p.air.oracle);
    free(p.air.data);
    karst_world_file_destroy(p.file);
    if (good && stats)
        *stats = p.stats;
    return good;
}
