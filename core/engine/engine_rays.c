/* Rays that a program asks about, through the engine's bricks: karst/rays.h. */
#include "karst/rays.h"

#include <math.h>
#include <stdlib.h>

#include "core/engine/engine_parts.h"
#include "raycast/cast/rays.clh"

enum { BATCH_RAYS = 1 << 18, DEFAULT_ROUNDS = 1000, BLOCK_PX = 32 };
#define MOST_UNIT_ERROR 1e-5

struct karst_engine_streams {
    karst_caster *caster; /* the engine's own may have no streams */
    karst_buffer *rays, *hits;
};

void karst_engine_destroy_streams(karst_engine *engine)
{
    if (!engine->streams)
        return;
    karst_caster_destroy(engine->streams->caster);
    karst_buffer_destroy(engine->streams->rays);
    karst_buffer_destroy(engine->streams->hits);
    free(engine->streams);
    engine->streams = NULL;
}

static bool need_streams(karst_engine *engine, karst_error *error)
{
    if (engine->streams)
        return true;
    karst_engine_streams *s = engine->streams = calloc(1, sizeof *s);
    if (!s)
        return karst_fail(error, KARST_FAILED, "out of memory");
    s->caster = karst_caster_create_with(engine->context, karst_cache_get_buffers(engine->cache),
                                         KARST_CAST_NO_SHADOWS " " KARST_CAST_FROM_ANCHOR, error);
    s->rays = s->caster
                  ? karst_buffer_create(engine->context, "asked rays", BATCH_RAYS * sizeof(karst_ray), NULL, error)
                  : NULL;
    s->hits = s->rays ? karst_buffer_create(engine->context, "asked rays", BATCH_RAYS * sizeof(karst_hit), NULL, error)
                      : NULL;
    if (s->hits)
        return true;
    karst_engine_destroy_streams(engine);
    return false;
}

static bool has_frame(const karst_engine *engine, karst_error *error)
{
    return (engine->hits && engine->frame > 0 && engine->has_content) ||
           karst_fail(error, KARST_USAGE, "no frame has been drawn yet");
}

/* ---- one batch ---- */

static double length_of(const float v[3])
{
    return sqrt((double)v[0] * (double)v[0] + (double)v[1] * (double)v[1] + (double)v[2] * (double)v[2]);
}

static bool check_ray(const karst_engine_ray *ray, size_t number, karst_error *error)
{
    if (!(fabs(length_of(ray->direction) - 1) <= MOST_UNIT_ERROR))
        return karst_fail(error, KARST_USAGE, "ray %zu: its direction has a length of %g, not 1", number,
                          length_of(ray->direction));
    if (!isfinite(length_of(ray->from_m)) || !(ray->length_m > 0) || !(ray->width_m >= 0) || !isfinite(ray->width_m) ||
        !(ray->cone >= 0) || !isfinite(ray->cone))
        return karst_fail(error, KARST_USAGE,
                          "ray %zu: its start must be finite, its length above 0, its footprint not below 0", number);
    return true;
}

/* Metres become level-0 voxels, whose width is a power of two. */
static karst_ray device_ray(const karst_engine *engine, const karst_engine_ray *ray)
{
    const float voxels_per_m = exp2f(-(float)engine->world->voxel_log2_m);
    const double seen_m = ldexp(engine->view_distance_voxels, engine->world->voxel_log2_m) - length_of(ray->from_m);
    karst_ray r = {.t_max = fminf(ray->length_m, (float)fmax(seen_m, 0)) * voxels_per_m,
                   .width = ray->width_m * voxels_per_m,
                   .cone = ray->cone,
                   .side = KARST_SIDE_ANY};
    for (int axis = 0; axis < 3; axis++) {
        r.origin[axis] = ray->from_m[axis] * voxels_per_m;
        r.direction[axis] = ray->direction[axis];
    }
    return r;
}

static karst_engine_hit engine_hit(const karst_engine *engine, const karst_hit *hit)
{
    const uint32_t kind = KARST_HIT_KIND(hit->kind);
    const karst_engine_hit_kind kinds[] = {[KARST_HIT_MISS] = KARST_ENGINE_MISS,
                                           [KARST_HIT_SURFACE] = KARST_ENGINE_SURFACE,
                                           [KARST_HIT_PROVISIONAL] = KARST_ENGINE_SURFACE,
                                           [KARST_HIT_SOLID] = KARST_ENGINE_SOLID};
    karst_engine_hit h = {.t_m = INFINITY,
                          .kind = kinds[kind],
                          .is_final = kind != KARST_HIT_PROVISIONAL && !(hit->kind & KARST_HIT_INCOMPLETE)};
    if (kind == KARST_HIT_MISS)
        return h;
    h.t_m = hit->t * exp2f((float)engine->world->voxel_log2_m);
    h.level = (int)KARST_HIT_LEVEL(hit->kind);
    for (int axis = 0; axis < 3; axis++)
        h.normal[axis] = hit->normal[axis];
    return h;
}

/* Device time of the casts since it was asked for last. */
static bool take_cast_ns(karst_engine *engine, uint64_t *cast_ns, karst_error *error)
{
    uint64_t ns[KARST_NUM_STAGES] = {0};
    if (!karst_profile_collect(engine->context, ns, error))
        return false;
    *cast_ns = ns[KARST_STAGE_CAST];
    return true;
}

/* Whether all start at the camera, with one footprint. */
static bool are_from_camera(const karst_ray *rays, uint32_t num)
{
    for (uint32_t i = 0; i < num; i++)
        for (int axis = 0; axis < 3; axis++)
            if (rays[i].origin[axis] != 0 || rays[i].width != rays[0].width || rays[i].cone != rays[0].cone)
                return false;
    return true;
}

static bool cast(karst_engine *engine, const karst_cast_view *view, uint32_t num, bool from_camera, karst_error *error)
{
    karst_engine_streams *s = engine->streams;
    return from_camera ? karst_cast_rays_from_anchor(s->caster, view, s->rays, num, s->hits, error)
                       : karst_cast_rays(s->caster, view, s->rays, num, false, s->hits, error);
}

/* Rounds until nothing is asked for, or nothing more can be made. */
static bool settle_batch(karst_engine *engine, uint32_t num, bool from_camera, uint32_t max_rounds,
                         karst_engine_rays_report *report, karst_error *error)
{
    const karst_camera camera = engine->camera;
    karst_cast_view view;
    karst_pinhole pinhole;
    karst_work work = {.num_requests = 1};
    uint64_t cast_ns = 0;
    engine->camera = engine->drawn;
    karst_engine_picture_view(engine, &view, &pinhole);
    engine->camera = camera;
    for (uint32_t round = 0; round < max_rounds; round++) {
        karst_allowance left = {.bricks = UINT32_MAX, .tiles = UINT32_MAX, .ns = 1e18};
        karst_engine_next_serial(engine);
        view.serial = engine->serial;
        if (!cast(engine, &view, num, from_camera, error) || !take_cast_ns(engine, &cast_ns, error) ||
            !karst_engine_answer_round(engine, &engine->drawn.position, &left, &work, error))
            return false;
        report->num_rounds++;
        report->num_produced += work.num_loads + work.num_subdivides;
        if (work.num_loads + work.num_subdivides == 0)
            break;
    }
    report->cast_ns += cast_ns;
    return true;
}

static bool cast_batch(karst_engine *engine, const karst_engine_ray *rays, uint32_t num, uint32_t max_rounds,
                       karst_engine_hit *hits, karst_engine_rays_report *report, karst_error *error)
{
    karst_engine_streams *s = engine->streams;
    const size_t largest = sizeof(karst_ray) > sizeof(karst_hit) ? sizeof(karst_ray) : sizeof(karst_hit);
    void *room = malloc(num * largest);
    karst_ray *sent = room;
    karst_hit *found = room;
    bool done = room || karst_fail(error, KARST_FAILED, "out of memory");
    for (uint32_t i = 0; done && i < num; i++)
        sent[i] = device_ray(engine, &rays[i]);
    done = done && karst_buffer_write(s->rays, 0, sent, num * sizeof *sent, error) &&
           settle_batch(engine, num, are_from_camera(sent, num), max_rounds, report, error) &&
           karst_buffer_read(s->hits, 0, found, num * sizeof *found, error);
    for (uint32_t i = 0; done && i < num; i++) {
        hits[i] = engine_hit(engine, &found[i]);
        report->complete = report->complete && hits[i].is_final;
    }
    free(room);
    return done;
}

bool karst_engine_cast_rays(karst_engine *engine, const karst_engine_ray *rays, size_t num, uint32_t max_rounds,
                            karst_engine_hit *hits, karst_engine_rays_report *report, karst_error *error)
{
    karst_engine_rays_report own = {.complete = true};
    if (!has_frame(engine, error))
        return false;
    for (size_t i = 0; i < num; i++)
        if (!check_ray(&rays[i], i + 1, error))
            return false;
    if (!need_streams(engine, error))
        return false;
    /* What the last frame was stays what it was. */
    const karst_stats stats = engine->stats;
    const karst_engine_made made = engine->made;
    uint64_t before_ns;
    bool done = take_cast_ns(engine, &before_ns, error);
    for (size_t i = 0; done && i < num; i += BATCH_RAYS)
        done = cast_batch(engine, rays + i, (uint32_t)(num - i < BATCH_RAYS ? num - i : BATCH_RAYS),
                          max_rounds ? max_rounds : DEFAULT_ROUNDS, hits + i, &own, error);
    engine->stats = stats;
    engine->made = made;
    engine->complete = engine->complete && own.num_produced == 0;
    if (done && report)
        *report = own;
    return done;
}

/* ---- the picture's own ---- */

bool karst_engine_picture_rays(const karst_engine *engine, karst_engine_ray *rays, uint32_t *pixels, size_t num,
                               karst_error *error)
{
    const int width = engine->width_px, height = engine->height_px;
    const float voxel_m = exp2f((float)engine->world->voxel_log2_m);
    karst_pinhole pinhole;
    size_t next = 0;
    if (!has_frame(engine, error))
        return false;
    if (num != (size_t)width * (size_t)height)
        return karst_fail(error, KARST_USAGE, "a picture of %dx%d has %zu rays, not %zu", width, height,
                          (size_t)width * (size_t)height, num);
    karst_engine_pinhole(engine, &engine->drawn, &pinhole);
    pinhole.sample = 0;
    for (uint32_t id = 0; next < num; id++) {
        /* Beams of groups of packets, as pictures have them. */
        const uint32_t across = ((uint32_t)width + BLOCK_PX - 1) / BLOCK_PX, block = id / (BLOCK_PX * BLOCK_PX);
        const uint32_t in = id % (BLOCK_PX * BLOCK_PX), group = in / 256, packet = in / 16 % 16, lane = in % 16;
        const int x = (int)(block % across * BLOCK_PX + group % 2 * 16 + packet % 4 * 4 + lane % 4);
        const int y = (int)(block / across * BLOCK_PX + group / 2 * 16 + packet / 4 * 4 + lane / 4);
        if (x >= width || y >= height)
            continue;
        const vector3 direction = pinhole_direction(&pinhole, x, y);
        pixels[next] = (uint32_t)x + (uint32_t)y * (uint32_t)width;
        rays[next++] = (karst_engine_ray){.direction = {direction.x, direction.y, direction.z},
                                          .length_m = pinhole.t_max * voxel_m,
                                          .cone = pinhole.cone};
    }
    return true;
}
