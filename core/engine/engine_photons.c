/* Caustics: photons of a view, traced batch by batch while it stands. */
#include <math.h>
#include <string.h>

#include "core/engine/engine_layers.h"

/* Photons of a batch at most: with a budget in ms a frame traces one. */
#define BATCH_RAYS 16384u
/* Surfaces that a photon may turn at, if the configuration does not say. */
#define DEFAULT_BOUNCES 12u

bool karst_engine_has_caustics(const karst_engine *engine) { return engine->photons.photons != NULL; }

bool karst_engine_check_caustics(const karst_engine_config *config, karst_error *error)
{
    if (config->caustics > KARST_ENGINE_MAX_PHOTONS)
        return karst_fail(error, KARST_USAGE, "%u photons for caustics: it may be 1 to %d", config->caustics,
                          KARST_ENGINE_MAX_PHOTONS);
    if (config->caustics && config->integrator == KARST_INTEGRATOR_FULL)
        return karst_fail(error, KARST_USAGE,
                          "full light finds caustics by itself: leave photons out, or use direct light");
    return !config->caustics || !config->no_shadows ||
           karst_fail(error, KARST_USAGE, "caustics without shadows would be lit twice: leave one of them out");
}

/* Whether any light of the world has shadows, which is what photons stand for. */
static bool has_light(const karst_world_info *world)
{
    const float *sun = world->sun_colour;
    bool has = !world->has_sun_colour || sun[0] > 0 || sun[1] > 0 || sun[2] > 0;
    for (uint32_t i = 0; i < world->num_lights; i++)
        has = has || world->lights[i].shadow;
    return has;
}

bool karst_engine_wants_caustics(const karst_engine_config *config, const karst_world_info *world)
{
    const bool mirrors = karst_engine_mirror_share(config->mirror, world) > 0 ||
                         (world->has_own_mirror && config->mirror >= 0);
    return config->caustics && (mirrors || world->has_clear) && has_light(world);
}

bool karst_engine_create_photons(karst_engine *engine, const karst_engine_config *config, karst_error *error)
{
    const karst_world_info *world = engine->world;
    karst_engine_photons *of = &engine->photons;
    if (!config->caustics)
        return true;
    if (!karst_engine_wants_caustics(config, world)) {
        karst_log_print(engine->log, KARST_LOG_WARNING, "%s: nothing makes caustics, as %s: pictures are as without",
                        world->name,
                        has_light(world) ? "no land mirrors and no matter is clear" : "no light has shadows");
        return true;
    }
    const double has = (double)engine->context->global_memory_bytes,
                 has_largest = (double)engine->context->max_allocation_bytes;
    double held = 0, largest;
    const double sum = karst_photons_bytes(config->caustics, &largest);
    for (const karst_buffer *b = engine->context->buffers; b; b = b->next)
        held += (double)b->size_bytes;
    if (sum > has - held || largest > has_largest)
        return karst_fail(error, KARST_FAILED,
                          "%u photons take %.1f GiB beside the %.1f that the pool and the rest take, of the device's "
                          "%.1f: use fewer (--caustics %u), or a smaller --pool",
                          config->caustics, sum * 0x1p-30, held * 0x1p-30, has * 0x1p-30, config->caustics / 4);
    if (karst_engine_world_bends(&engine->shown))
        karst_log_print(engine->log, KARST_LOG_WARNING,
                        "%s: photons go straight through clear matter whose index varies: its caustics are not true",
                        world->name);
    of->bounces = config->bounces ? config->bounces : DEFAULT_BOUNCES;
    of->num = config->caustics;
    of->photons = karst_photons_create(engine->context, config->caustics, BATCH_RAYS, error);
    return of->photons != NULL;
}

void karst_engine_forget_photons(karst_engine *engine)
{
    karst_engine_photons *of = &engine->photons;
    of->num_begun = 0;
    of->is_aiming = of->is_aimed = of->is_whole = of->is_first_stage = of->is_stale = false;
}

void karst_engine_change_detail_of_photons(karst_engine *engine)
{
    karst_engine_photons *of = &engine->photons;
    if (of->is_first_stage && engine->budget_ns > 0)
        of->is_stale = true;
    else
        karst_engine_forget_photons(engine);
}

/* What is shaded there must know the anchor, before the picture says it once more. */
static karst_photon_scene scene_of(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                                   const karst_light *light)
{
    const karst_world_info *world = engine->world;
    const bool has_clear = engine->clear && karst_engine_has_content(engine, KARST_CONTENT_CLEAR);
    const karst_position *eye = &engine->camera.position;
    karst_photon_scene scene = {
        .land = engine->caster,
        .clear = has_clear ? engine->stores[KARST_CONTENT_CLEAR].caster : NULL,
        .shader = engine->shader,
        .clear_shader = engine->shown.clear_shader,
        /* That of the text alone. */
        .land_refiner = engine->edits || karst_engine_world_names_layers(&engine->shown, KARST_LAYER_LAND)
                            ? NULL
                            : engine->shown.photon_refining.refiner,
        .clear_refiner = engine->shown.content[KARST_CONTENT_CLEAR].refining.refiner,
        .view = view,
        .pinhole = pinhole,
        .light = light,
        .voxel_m = exp2(world->voxel_log2_m),
        .bounces = engine->photons.bounces,
        .mirrors = karst_engine_mirror_share(engine->mirror, world) > 0 ||
                   (world->has_own_mirror && engine->mirror >= 0),
        .parts = karst_radiance_parts(engine->radiance),
        .counters = engine->counters,
    };
    memcpy(scene.anchor.voxel, eye->voxel, sizeof scene.anchor.voxel);
    memcpy(scene.anchor.fraction, eye->fraction, sizeof scene.anchor.fraction);
    karst_shader_set_anchor(engine->shader, eye);
    if (has_clear)
        karst_clear_shader_set_anchor(engine->shown.clear_shader, eye);
    return scene;
}

static void cross(const float a[4], const float b[4], float c[4])
{
    for (int i = 0; i < 3; i++)
        c[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

static void make_unit(float v[4])
{
    const float scale = 1 / sqrtf(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (int i = 0; i < 3; i++)
        v[i] *= scale;
}

/* As lamps of shading are; those without shadows shine through everything, and make no caustics. */
static uint32_t lamps_of(karst_engine *engine, const karst_light *light, karst_photon_lamp into[KARST_MOST_LAMPS])
{
    karst_lamp lamps[KARST_MOST_LAMPS];
    const uint32_t num = karst_engine_lamps(engine, light, lamps);
    uint32_t kept = 0;
    for (uint32_t i = 0; i < num; i++) {
        const karst_lamp *from = &lamps[i];
        const float up[4] = {0, fabsf(from->direction[1]) < 0.7f, fabsf(from->direction[1]) >= 0.7f, 0};
        if (!from->shadow)
            continue;
        karst_photon_lamp *lamp = &into[kept++];
        *lamp = (karst_photon_lamp){.dark = from->dark,
                                    .bright = from->bright,
                                    .least_cosine = from->kind == KARST_LAMP_SPOT ? from->dark : -1,
                                    .kind = from->kind};
        memcpy(lamp->place, from->place, sizeof lamp->place);
        memcpy(lamp->axis, from->direction, sizeof lamp->axis);
        memcpy(lamp->colour, from->colour, 3 * sizeof(float));
        make_unit(lamp->axis);
        cross(up, lamp->axis, lamp->across);
        make_unit(lamp->across);
        cross(lamp->axis, lamp->across, lamp->along);
        const bool has_clear = engine->clear && karst_engine_has_content(engine, KARST_CONTENT_CLEAR);
        if (from->kind == KARST_LAMP_SUN || !has_clear)
            continue;
        double away_m[3];
        const int voxel_log2_m = engine->world->voxel_log2_m;
        for (int axis = 0; axis < 3; axis++)
            away_m[axis] = ldexp(from->place[axis], voxel_log2_m);
        const karst_position at = karst_position_add_m(engine->camera.position, away_m, voxel_log2_m);
        float absorption_per_m[3] = {0, 0, 0};
        lamp->is_inside = karst_engine_is_in_clear(engine, &at, absorption_per_m);
        for (int c = 0; c < 3; c++)
            lamp->absorption[c] = absorption_per_m[c] * (float)ldexp(1, voxel_log2_m);
    }
    return kept;
}

/* Shares out as many photons as the present stage has. */
static bool begin_stage(karst_engine_photons *of, const karst_photon_scene *scene, karst_error *error)
{
    of->num_begun = 0;
    return karst_photons_share(of->photons, scene, of->num >> 2 * of->stages_left, error);
}

static bool begin_aim(karst_engine *engine, const karst_photon_scene *scene, karst_error *error)
{
    karst_engine_photons *of = &engine->photons;
    karst_photon_lamp lamps[KARST_MOST_LAMPS];
    of->is_aiming = of->is_first_stage = true;
    of->detail = scene->view->detail;
    return karst_photons_begin(of->photons, scene, lamps, lamps_of(engine, scene->light, lamps), error);
}

/* Goes on looking where photons are to be sent; once that is known, the first stage begins. */
static bool aim(karst_engine *engine, const karst_photon_scene *scene, karst_error *error)
{
    karst_engine_photons *of = &engine->photons;
    uint32_t num_waiting = 0;
    if ((!of->is_aiming && !begin_aim(engine, scene, error)) ||
        !karst_photons_aim(of->photons, scene, &num_waiting, error))
        return false;
    of->is_aimed = num_waiting == 0;
    if (!of->is_aimed)
        return true;
    /* Who waits for the settled picture has no use for fewer. */
    of->stages_left = 0;
    while (engine->budget_ns > 0 && of->num >> 2 * of->stages_left > BATCH_RAYS)
        of->stages_left++;
    return begin_stage(of, scene, error);
}

/* Those that wait, of all batches that were begun, and then num_more batches. */
static bool trace(karst_engine_photons *of, const karst_photon_scene *scene, uint32_t num_more, karst_error *error)
{
    for (uint32_t batch = 0; batch < of->num_begun; batch++)
        if (!karst_photons_trace(of->photons, scene, batch, error))
            return false;
    for (; num_more; num_more--)
        if (!karst_photons_trace(of->photons, scene, of->num_begun++, error))
            return false;
    return true;
}

/* Rays end at what is missing, and wait. All are of the detail of the first. */
static karst_cast_view sure_view(const karst_engine_photons *of, const karst_cast_view *view)
{
    karst_cast_view sure = *view;
    sure.ends_at_missing = 1;
    sure.detail = of->is_aiming ? of->detail : view->detail;
    return sure;
}

/* Batches. With a budget a frame's picture begins one; the first stage does as soon as it can. */
static uint32_t num_to_begin(const karst_engine *engine, bool draws)
{
    const karst_engine_photons *of = &engine->photons;
    const uint32_t left = karst_photons_num_batches(of->photons) - of->num_begun;
    return engine->budget_ns == 0 ? left : left > 0 && (draws || of->is_first_stage);
}

/* Aims, and once that is done traces. */
static bool aim_and_trace(karst_engine *engine, const karst_photon_scene *scene, bool draws, karst_error *error)
{
    karst_engine_photons *of = &engine->photons;
    if (!of->is_aimed && !aim(engine, scene, error))
        return false;
    return !of->is_aimed || trace(of, scene, num_to_begin(engine, draws), error);
}

/* Whether what was traced is to be seen: stages as a whole; most of the first is better than nothing. */
static bool may_show(const karst_engine *engine)
{
    const karst_engine_photons *of = &engine->photons;
    const uint32_t num_waiting = karst_photons_num_waiting(of->photons, of->num_begun);
    if (!of->is_aimed || of->num_begun < karst_photons_num_batches(of->photons))
        return false;
    if (num_waiting == 0)
        return true;
    const bool waits = engine->settles && engine->budget_ns == 0;
    return !waits && of->is_first_stage && num_waiting < karst_photons_num_done(of->photons, of->num_begun) / 8;
}

static bool show(karst_engine *engine, karst_error *error)
{
    karst_engine_photons *of = &engine->photons;
    of->anchor = engine->camera.position;
    of->is_sorted = true;
    return karst_photons_sort(of->photons, of->num_begun, error);
}

bool karst_engine_trace_photons(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                                karst_error *error)
{
    karst_engine_photons *of = &engine->photons;
    if (!of->photons)
        return true;
    of->shows_all = of->is_whole;
    /* In motion with a budget the last ones are seen from elsewhere. */
    if (of->is_whole || (engine->budget_ns > 0 && engine->motion.moved))
        return true;
    const karst_light light = karst_engine_light(engine);
    const karst_cast_view sure = sure_view(of, view);
    const karst_photon_scene scene = scene_of(engine, &sure, pinhole, &light);
    if (!aim_and_trace(engine, &scene, true, error))
        return false;
    if (!may_show(engine))
        return true;
    if (!show(engine, error))
        return false;
    if (of->is_stale) {
        karst_engine_forget_photons(engine);
        return true;
    }
    const bool is_done = karst_photons_num_waiting(of->photons, of->num_begun) == 0;
    of->shows_all = is_done && of->stages_left == 0;
    if (!is_done || of->shows_all)
        return true;
    of->stages_left--;
    of->is_first_stage = false;
    return begin_stage(of, &scene, error);
}

bool karst_engine_look_at_photons(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                                  karst_error *error)
{
    const karst_engine_photons *of = &engine->photons;
    if (!of->photons || of->is_whole || !of->is_aiming)
        return true;
    if (of->is_aimed && num_to_begin(engine, false) == 0 &&
        karst_photons_num_waiting(of->photons, of->num_begun) == 0)
        return true;
    const karst_light light = karst_engine_light(engine);
    const karst_cast_view sure = sure_view(of, view);
    const karst_photon_scene scene = scene_of(engine, &sure, pinhole, &light);
    return aim_and_trace(engine, &scene, false, error);
}

bool karst_engine_end_photons(karst_engine *engine, bool lacks_nothing)
{
    karst_engine_photons *of = &engine->photons;
    if (!of->photons)
        return lacks_nothing;
    of->is_whole = of->is_whole || (of->shows_all && lacks_nothing);
    karst_stats_caustics *stats = &engine->stats.caustics;
    uint64_t sums[KARST_PHOTON_SUMS];
    double quantum;
    karst_photons_sums(of->photons, of->num_begun, sums, &quantum);
    const double voxel_m = exp2(engine->world->voxel_log2_m), unit = quantum * voxel_m * voxel_m;
    stats->num_photons = karst_photons_num_done(of->photons, of->num_begun);
    stats->num_landed = sums[KARST_PHOTON_SUM_NUM_LANDED];
    stats->emitted = (double)sums[KARST_PHOTON_SUM_GIVEN] * unit;
    stats->deposited = (double)sums[KARST_PHOTON_SUM_LANDED] * unit;
    stats->direct = (double)sums[KARST_PHOTON_SUM_DIRECT] * unit;
    stats->absorbed = (double)(int64_t)sums[KARST_PHOTON_SUM_LOST] * unit;
    stats->escaped = (double)sums[KARST_PHOTON_SUM_ESCAPED] * unit;
    stats->cut_off = (double)sums[KARST_PHOTON_SUM_CUT] * unit;
    return lacks_nothing && of->is_whole;
}

bool karst_engine_gather_photons(karst_engine *engine, const karst_path_picture *picture, const karst_buffer *rays,
                                 const karst_buffer *count, const karst_buffer *hits, karst_error *error)
{
    const karst_engine_photons *of = &engine->photons;
    karst_path_stream at;
    double away_m[3];
    float offset[3];
    if (!of->photons || !of->is_sorted || picture->again)
        return true;
    karst_position_difference_m(of->anchor, engine->camera.position, engine->world->voxel_log2_m, away_m);
    for (int axis = 0; axis < 3; axis++)
        offset[axis] = (float)ldexp(away_m[axis], -engine->world->voxel_log2_m);
    return karst_paths_look_along_normals(engine->paths, picture, rays, count, hits, &at, error) &&
           karst_photons_gather(of->photons, at.rays, at.count, at.max_rays, offset, picture->pinhole, picture->parts,
                                error);
}
