/* Single rays through a medium: pools of their own for its bricks, and the oracle beside them. */
#include <math.h>
#include <stdlib.h>

#include "core/engine/engine_parts.h"
#include "karst/medium.h"
#include "karst/query.h"
#include "producers/density/world_internal.h"
#include "producers/language/oracle/oracle.h"
#include "producers/particles/particles_kind.h"
#include "producers/steps/medium.h"

#define NUM_TILES 60000u
#define NUM_BRICKS 6000u
#define MAX_LOADS 2048u
#define MAX_ROUNDS 200
/* Of a picture 1000 pixels high. */
#define PIXEL_CONE 0.001
#define MOST_STEPS 4000000.0

typedef struct {
    const karst_world *world;
    const karst_world_file *air;
    karst_context *context;
    karst_cache *cache;
    karst_producer *producer;
    karst_media *media;
    karst_number *values; /* of the world's parameters, at the time */
    karst_layer *particles;
    karst_buffer *rays, *depths;
    double direction[3], voxel_m, length_m;
    double width_m, cone; /* the footprint is this wide at least, and so much of the way */
} following;

bool karst_world_has_medium(const karst_world *world) { return world->file->content[KARST_CONTENT_AIR] != NULL; }

static bool check(const karst_world *world, const karst_medium_ray *ray, double *length, karst_error *error)
{
    const double *d = ray->direction;
    *length = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    if (!karst_world_has_medium(world))
        return karst_fail(error, KARST_USAGE, "%s has no medium: it says nothing of `medium air(vec3 p)`",
                          world->metadata.name);
    if (!(*length > 0 && *length < INFINITY))
        return karst_fail(error, KARST_USAGE, "a ray's direction has three finite numbers, not all of them 0");
    for (int axis = 0; axis < 3; axis++)
        if (ray->from.voxel[axis] > KARST_ENGINE_MAX_VOXEL || ray->from.voxel[axis] < -KARST_ENGINE_MAX_VOXEL)
            return karst_fail(error, KARST_USAGE, "a ray may not begin beyond 2^61 voxels");
    if (!(fabs(ray->time_s) <= KARST_MOST_TIME_S))
        return karst_fail(error, KARST_USAGE, "a time of %g s: times go from -1e9 to 1e9 s", ray->time_s);
    return (ray->footprint_m >= 0 && ray->footprint_m <= 1e6) ||
           karst_fail(error, KARST_USAGE, "a footprint of %g m: it may be 0 to 10^6", ray->footprint_m);
}

/* Land by proof, on the host. */
static bool find_land(following *f, const karst_medium_ray *ray, karst_medium_depth *depth, karst_error *error)
{
    const karst_query_config config = {.footprint_m = ray->footprint_m};
    karst_query_ray query = {.from = ray->from, .length_m = f->world->metadata.view_distance_m};
    karst_query_hit hit;
    for (int axis = 0; axis < 3; axis++)
        query.direction[axis] = f->direction[axis];
    if (!karst_query_rays(f->world, &config, &query, 1, &hit, error))
        return false;
    const bool is_hit = hit.kind == KARST_QUERY_SURFACE || hit.kind == KARST_QUERY_INSIDE;
    depth->hit_m = is_hit ? hit.t_m : (double)INFINITY;
    depth->length_m = f->length_m = hit.kind == KARST_QUERY_MISS ? query.length_m : hit.t_m;
    return true;
}

/* ---- on the device ---- */

static bool take_particles(following *f, const karst_medium_ray *ray, const karst_world_build *build,
                           karst_error *error)
{
    const karst_layer_scene scene = {.context = f->context,
                                     .program = f->world->file->program,
                                     .values = f->values,
                                     .voxel_log2_m = f->world->metadata.voxel_log2_m,
                                     .time_s = ray->time_s};
    if (!karst_particles_kind.is_named(scene.program))
        return true;
    f->particles = karst_particles_kind.create(&scene, error);
    return f->particles &&
           karst_world_file_set_layers(f->producer, f->air, build, &f->particles, 1, NULL, error);
}

static bool open_pools(following *f, const karst_medium_ray *ray, karst_error *error)
{
    const karst_world_build build = {.shape = KARST_SHAPE_AUTO,
                                     .options = KARST_MEDIUM_OPTION,
                                     .finalise_options = "-DKARST_BRICK_BITS=32 " KARST_MEDIUM_OPTION};
    f->context = karst_context_create(ray->device, 0, ray->log, error);
    f->cache = f->context ? karst_cache_create_of(f->context, NUM_TILES, NUM_BRICKS, 0, 32, error) : NULL;
    f->producer = f->cache ? karst_world_file_producer_built(f->context, f->air, f->world->metadata.seed, MAX_LOADS,
                                                             &build, error)
                           : NULL;
    if (!f->producer || !take_particles(f, ray, &build, error) ||
        !karst_world_file_set_parameters(f->producer, f->air, f->values, f->world->metadata.seed, error))
        return false;
    const karst_media_config config = {.air = karst_cache_get_buffers(f->cache)};
    return (f->media = karst_media_create(f->context, &config, error)) &&
           (f->rays = karst_buffer_create(f->context, "rays", sizeof(karst_ray), NULL, error)) &&
           (f->depths = karst_buffer_create(f->context, "rays", sizeof(float), NULL, error));
}

static void close_pools(following *f)
{
    if (f->context)
        karst_finish(f->context, NULL);
    karst_buffer_destroy(f->rays);
    karst_buffer_destroy(f->depths);
    karst_media_destroy(f->media);
    karst_producer_destroy(f->producer);
    if (f->particles)
        f->particles->ops->destroy(f->particles);
    free(f->values);
    karst_cache_destroy(f->cache);
    karst_context_destroy(f->context);
}

static bool place_root(following *f, const karst_position *from, int64_t corner[3], int *top_level,
                       karst_error *error)
{
    *top_level = 0;
    while (ldexp(KARST_BRICK_CELLS, *top_level) < 4 * f->length_m / f->voxel_m)
        ++*top_level;
    for (int axis = 0; axis < 3; axis++)
        corner[axis] = ((from->voxel[axis] >> (*top_level + KARST_BRICK_CELLS_LOG2 - 2)) - 2) >> 2;
    return karst_cache_place_root(f->cache, corner, *top_level, error);
}

static bool answer(following *f, const karst_work *work, karst_error *error)
{
    return karst_producer_answer(f->producer, karst_cache_get_buffers(f->cache), work, error) &&
           karst_cache_publish(f->cache, work, NULL, NULL, error);
}

/* Follows the ray until nothing is lacking. */
static bool follow(following *f, const karst_medium_ray *ray, double *optical_depth, karst_error *error)
{
    int64_t corner[3];
    int top_level;
    uint32_t num_missing = 1;
    float depth = 0;
    karst_work work;
    karst_ray r = {.t_max = (float)(f->length_m / f->voxel_m),
                   .width = (float)(f->width_m / f->voxel_m),
                   .cone = (float)f->cone};
    for (int axis = 0; axis < 3; axis++)
        r.direction[axis] = (float)f->direction[axis];
    if (!place_root(f, &ray->from, corner, &top_level, error) || !karst_buffer_write(f->rays, 0, &r, sizeof r, error))
        return false;
    for (uint32_t serial = 1; num_missing; serial++) {
        karst_cast_view view;
        karst_cast_view_init(&view, &ray->from, corner, top_level);
        view.serial = serial;
        const karst_collect_params params = {.serial = serial,
                                             .frame = serial,
                                             .turn = serial,
                                             .camera = ray->from,
                                             .max_tiles = MAX_LOADS,
                                             .max_bricks = MAX_LOADS};
        if (!karst_cache_root_work(f->cache, serial, &work, error) || (work.num_loads && !answer(f, &work, error)) ||
            !karst_media_depths(f->media, &view, f->rays, 1, (float)f->voxel_m, f->depths, &num_missing, error) ||
            !karst_cache_collect(f->cache, &params, &work, error))
            return false;
        if (work.num_starved_bricks + work.num_starved_tiles > 0 || serial > MAX_ROUNDS)
            return karst_fail(error, KARST_USAGE,
                              "the ray passes more than %u bricks: ask for a larger footprint than %g m", NUM_BRICKS,
                              ray->footprint_m);
        if (work.num_loads + work.num_subdivides > 0 && !answer(f, &work, error))
            return false;
    }
    if (!karst_buffer_read(f->depths, 0, &depth, sizeof depth, error))
        return false;
    *optical_depth = (double)depth;
    return true;
}

/* ---- by the oracle ---- */

static double extinction_at(const following *f, karst_oracle *oracle, const karst_position *from, double t_m)
{
    const double footprint = fmax(fmax(f->width_m, f->cone * t_m) / f->voxel_m, 1);
    double offset_m[3];
    for (int axis = 0; axis < 3; axis++)
        offset_m[axis] = f->direction[axis] * t_m;
    const karst_position at = karst_position_add_m(*from, offset_m, f->world->metadata.voxel_log2_m);
    const double value = karst_oracle_precise_density(oracle, &at, ilogb(footprint));
    return value > 0 && isfinite(value) ? value : 0;
}

static bool find_values(following *f, double time_s, karst_error *error)
{
    const karst_program_graph *program = f->air->program;
    f->values = calloc(program->num_parameters + 1, sizeof *f->values);
    if (!f->values)
        return karst_fail(error, KARST_FAILED, "out of memory");
    for (uint32_t i = 0; i < program->num_parameters; i++)
        f->values[i] = program->parameters[i].value;
    if (time_s != 0)
        karst_program_put_time(program, time_s, f->values);
    return true;
}

/* In pieces half as long as the footprint there; particles are met where they are. */
static bool integrate(const following *f, const karst_medium_ray *ray, double *optical_depth, karst_error *error)
{
    const karst_program_graph *program = f->air->program;
    karst_oracle *oracle = karst_oracle_create(&program->world, f->values, f->world->metadata.seed,
                                               program->header.voxel_log2_m, error);
    double of_particles = 0;
    if (!oracle)
        return karst_fail(error, KARST_FAILED, "out of memory");
    if (f->particles && !karst_particle_list_depth(karst_particles_layer_list(f->particles), &ray->from, f->direction,
                                                   f->length_m, &of_particles, error)) {
        karst_oracle_destroy(oracle);
        return false;
    }
    *optical_depth = 0;
    double first = extinction_at(f, oracle, &ray->from, 0);
    for (double t = 0; t < f->length_m;) {
        double step = fmax(fmax(f->width_m, f->cone * t), f->voxel_m) / 2;
        step = fmin(fmax(step, f->length_m / MOST_STEPS), f->length_m - t);
        const double middle = extinction_at(f, oracle, &ray->from, t + step / 2),
                     last = extinction_at(f, oracle, &ray->from, t + step);
        *optical_depth += (first + 4 * middle + last) * step / 6;
        first = last;
        t += step;
    }
    *optical_depth += of_particles;
    karst_oracle_destroy(oracle);
    return true;
}

bool karst_world_medium_depth(const karst_world *world, const karst_medium_ray *ray, karst_medium_depth *depth,
                              karst_error *error)
{
    double length;
    if (!check(world, ray, &length, error))
        return false;
    following f = {.world = world,
                   .air = world->file->content[KARST_CONTENT_AIR],
                   .voxel_m = ldexp(1, world->metadata.voxel_log2_m),
                   .width_m = ray->footprint_m,
                   .cone = ray->footprint_m > 0 ? 0 : PIXEL_CONE};
    for (int axis = 0; axis < 3; axis++)
        f.direction[axis] = ray->direction[axis] / length;
    *depth = (karst_medium_depth){0};
    bool done = find_land(&f, ray, depth, error) && find_values(&f, ray->time_s, error);
    if (done && f.length_m > 0)
        done = open_pools(&f, ray, error) && follow(&f, ray, &depth->optical_depth, error) &&
               integrate(&f, ray, &depth->oracle_optical_depth, error);
    depth->transmittance = exp(-depth->optical_depth);
    close_pools(&f);
    return done;
}
