/* Media in pictures: what fills the space outside matter, from the world's store of air. */
#include <math.h>
#include <string.h>

#include "core/engine/engine_parts.h"
#include "karst/change.h"

/* Voxels of media are so many times as wide as those of land: they are soft, and rays pass through all that there are
 * before what is behind. */
#define MEDIA_DETAIL 3.0f
/* Where light in media is to be as it is, they are as fine as land. */
#define MEDIA_TRUE_DETAIL 1.0f
/* And finer, where nothing but their samples makes them wrong: where extinction begins, what lies between two samples
 * is told too thick, by as much as their distance squared. A cloud's rim is thin enough that this is seen. */
#define MEDIA_ONCE_DETAIL 0.5f

void karst_engine_configure_media(karst_engine *engine, const karst_engine_config *config)
{
    engine->media_mode = config->media;
    engine->has_own_bounces = config->bounces != 0;
    engine->scattering = config->scattering;
}

static uint32_t mode_of(karst_media_mode mode)
{
    return mode == KARST_MEDIA_MODE_BASIC    ? KARST_MEDIA_BASIC
           : mode == KARST_MEDIA_MODE_SHADOW ? KARST_MEDIA_SHADOW
                                             : KARST_MEDIA_FULL;
}

bool karst_engine_has_path_media(const karst_engine *engine)
{
    return engine->integrator == KARST_INTEGRATOR_FULL && engine->stores[KARST_CONTENT_AIR].store != NULL;
}

/* Those of the world that is shown, as its content is now. */
static bool prepare(karst_engine *engine, karst_error *error)
{
    const karst_producer *producer = engine->shown.content[KARST_CONTENT_AIR].producer;
    if (engine->media && engine->media_of == producer) {
        const bool stale = engine->media_is_stale;
        engine->media_is_stale = false;
        return !stale || karst_media_forget(engine->media, error);
    }
    const karst_world_file *file = engine->shown.file->content[KARST_CONTENT_AIR];
    char options[KARST_WORLD_FILE_OPTIONS_BYTES];
    karst_world_file_colour_options(file, options);
    const karst_media_config config = {
        .air = karst_store_get_buffers(engine->stores[KARST_CONTENT_AIR].store),
        .land = engine->shadows && !engine->alone.is_on ? karst_cache_get_buffers(engine->cache) : NULL,
        .mode = mode_of(engine->media_mode),
        .scattering = engine->alone.is_on ? KARST_SCATTERING_OCTAVES : engine->scattering,
        .has_atmosphere = engine->shown.skies != NULL && !engine->alone.is_on,
        .has_streams = !engine->alone.is_on && (engine->bounce || engine->clear),
        .passes = engine->pass && engine->clear,
        .glows = karst_has_output(file->program->world.root, KARST_OUTPUT_EMISSION),
        .has_phase = karst_has_output(file->program->world.root, KARST_OUTPUT_MIRROR),
        .has_paths = karst_engine_has_path_media(engine) && !engine->alone.is_on,
        .has_lamps = !engine->alone.is_on && engine->world->num_lights > 0,
        .is_alone = engine->alone.is_on,
        .groups = engine->media_groups,
        .fluence_packets = engine->fluence_packets,
        .look = {.source = file->code.colour_source, .options = options, .data = producer->data[0]}};
    if (!karst_finish(engine->context, error))
        return false;
    karst_media_destroy(engine->media);
    engine->media = karst_media_create(engine->context, &config, error);
    engine->media_of = producer;
    engine->media_is_stale = false;
    return engine->media != NULL;
}

static float detail_of(const karst_engine *engine)
{
    if (engine->integrator == KARST_INTEGRATOR_FULL)
        return MEDIA_TRUE_DETAIL;
    return engine->scattering == KARST_SCATTERING_OCTAVES ? MEDIA_DETAIL
           : engine->scattering == KARST_SCATTERING_ONCE  ? MEDIA_ONCE_DETAIL
                                                          : MEDIA_TRUE_DETAIL;
}

/* Of the sample that was drawn last. */
static karst_media_picture picture_of(const karst_engine *engine, const karst_cast_view *view,
                                      const karst_pinhole *pinhole, const karst_light *light)
{
    const bool has_clear = engine->clear && karst_engine_has_content(engine, KARST_CONTENT_CLEAR);
    const double voxel_m = exp2(engine->world->voxel_log2_m);
    karst_media_picture picture = {.view = view,
                                   .pinhole = pinhole,
                                   .light = light,
                                   .anchor = &engine->camera.position,
                                   .skies = engine->shown.skies,
                                   .metres = (float)voxel_m,
                                   .detail = detail_of(engine),
                                   .hits = engine->hits,
                                   .parts = karst_radiance_parts(engine->radiance),
                                   .has_sun = engine->shadows,
                                   .has_mirror = engine->bounce || engine->clear,
                                   .over_hits = has_clear ? karst_clear_first_hits(engine->clear) : NULL,
                                   .makes_all = engine->settles,
                                   .coarser = (float)karst_ladder_factor(&engine->ladder)};
    if (has_clear && karst_engine_is_in_clear(engine, &engine->camera.position, picture.absorption))
        for (int c = 0; c < 3; c++)
            picture.absorption[c] *= (float)voxel_m;
    return picture;
}

/* The world's own. */
static bool add_lamps(const karst_engine *engine, const karst_media_picture *picture, karst_error *error)
{
    karst_lamp lamps[KARST_MOST_LAMPS];
    const uint32_t num = karst_engine_own_lamps(engine, lamps, 0);
    return engine->alone.is_on || karst_media_add_lamps(engine->media, picture, lamps, num, error);
}

bool karst_engine_draw_media(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                             const karst_light *light, karst_error *error)
{
    uint32_t num_lacking, num_made;
    if (!karst_engine_has_content(engine, KARST_CONTENT_AIR))
        return true;
    const karst_media_picture picture = picture_of(engine, view, pinhole, light);
    const bool moves = engine->media_moves;
    engine->media_moves = false;
    if (moves && engine->media)
        karst_media_age(engine->media);
    /* What moved has new bricks: their depth towards the sun is there before they are drawn. */
    return prepare(engine, error) &&
           (!moves || (karst_media_look(engine->media, &picture, error) &&
                       karst_media_survey_sun(engine->media, &picture, error))) &&
           karst_media_take_counts(engine->media, &num_lacking, &num_made, error) &&
           karst_media_find_fluence(engine->media, &picture, error) &&
           karst_media_pixels(engine->media, &picture, error) && add_lamps(engine, &picture, error);
}

bool karst_engine_veil_stream(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                              const karst_light *light, const karst_media_stream *stream, karst_error *error)
{
    if (!karst_engine_has_content(engine, KARST_CONTENT_AIR) || !engine->media)
        return true;
    const karst_media_picture picture = picture_of(engine, view, pinhole, light);
    return karst_media_stream_rays(engine->media, &picture, stream, error);
}

/* ---- for paths ---- */

static bool meet_paths(void *user, const karst_path_media_stream *stream, karst_error *error)
{
    const karst_engine_path_air *air = user;
    return karst_media_meet_paths(air->engine->media, &air->picture, stream, error);
}

static bool turn_paths(void *user, const karst_path_media_stream *stream, karst_error *error)
{
    const karst_engine_path_air *air = user;
    return karst_media_turn_paths(air->engine->media, &air->picture, stream, error);
}

static bool dim_lamps(void *user, karst_buffer *rays, const karst_buffer *count, uint32_t max_rays, karst_error *error)
{
    const karst_engine_path_air *air = user;
    return karst_media_dim(air->engine->media, &air->picture, rays, count, max_rays, error);
}

/* Where `wanted`, and the world has air. */
static bool open_air(karst_engine *engine, const karst_path_picture *picture, bool wanted, karst_engine_path_air *air,
                     karst_error *error)
{
    *air = (karst_engine_path_air){
        .is_there = wanted && karst_engine_has_content(engine, KARST_CONTENT_AIR) && !engine->alone.is_on};
    if (!air->is_there)
        return true;
    if (!prepare(engine, error))
        return false;
    air->engine = engine;
    air->picture = picture_of(engine, picture->view, picture->pinhole, picture->light);
    air->media = (karst_path_media){.meet = meet_paths, .turn = turn_paths, .dim = dim_lamps, .user = air};
    return true;
}

bool karst_engine_media_of_paths(karst_engine *engine, const karst_path_picture *picture, karst_engine_path_air *air,
                                 karst_error *error)
{
    uint32_t num_lacking, num_made;
    return open_air(engine, picture, karst_engine_has_path_media(engine), air, error) &&
           (!air->is_there || picture->again ||
            karst_media_take_counts(engine->media, &num_lacking, &num_made, error));
}

bool karst_engine_media_of_lamps(karst_engine *engine, const karst_path_picture *picture, karst_engine_path_air *air,
                                 karst_error *error)
{
    return open_air(engine, picture, engine->media_mode == KARST_MEDIA_MODE_FULL, air, error);
}

bool karst_engine_survey_media(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                               const karst_light *light, karst_error *error)
{
    if (!karst_engine_has_content(engine, KARST_CONTENT_AIR))
        return true;
    const karst_media_picture picture = picture_of(engine, view, pinhole, light);
    return karst_media_survey_sun(engine->media, &picture, error);
}

bool karst_engine_look_at_media(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                                karst_error *error)
{
    if (!karst_engine_has_content(engine, KARST_CONTENT_AIR) || !engine->media)
        return true;
    const karst_media_picture picture = picture_of(engine, view, pinhole, NULL);
    return karst_media_look(engine->media, &picture, error);
}

bool karst_engine_end_media(karst_engine *engine, karst_error *error)
{
    uint32_t num_lacking = 0, num_made = 0;
    if (engine->media && karst_engine_has_content(engine, KARST_CONTENT_AIR) &&
        !karst_media_take_counts(engine->media, &num_lacking, &num_made, error))
        return false;
    engine->media_lacks = num_lacking + num_made > 0;
    return true;
}

bool karst_engine_set_media_groups(karst_engine *engine, uint32_t groups, karst_error *error)
{
    if (groups < 1 || groups > KARST_ENGINE_MAX_MEDIA_GROUPS)
        return karst_fail(error, KARST_USAGE, "%u groups: there are 1 to %u", groups, KARST_ENGINE_MAX_MEDIA_GROUPS);
    if (groups != engine->media_groups)
        engine->media_of = NULL; /* it is made anew, for so many */
    engine->media_groups = groups;
    return true;
}

static const char *const mode_names[KARST_NUM_MEDIA_MODES] = {"full", "shadow", "basic"};

bool karst_media_mode_parse(const char *name, karst_media_mode *mode, karst_error *error)
{
    for (int i = 0; i < KARST_NUM_MEDIA_MODES; i++)
        if (strcmp(name, mode_names[i]) == 0) {
            *mode = (karst_media_mode)i;
            return true;
        }
    return karst_fail(error, KARST_USAGE, "media are shown in no mode '%.40s'; there are: full, shadow, basic", name);
}

static const char *const scattering_names[KARST_NUM_SCATTERINGS] = {"octaves", "once", "paths", "fluence"};

bool karst_scattering_parse(const char *name, karst_scattering *scattering, karst_error *error)
{
    for (int i = 0; i < KARST_NUM_SCATTERINGS; i++)
        if (strcmp(name, scattering_names[i]) == 0) {
            *scattering = (karst_scattering)i;
            return true;
        }
    return karst_fail(error, KARST_USAGE, "media scatter light in no way '%.40s'; there are: octaves, once, paths, "
                                           "fluence",
                      name);
}
