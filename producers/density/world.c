#include "producers/density/world_internal.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "producers/language/check.h"
#include "producers/language/graph/words.h"
#include "producers/density/bounds_cost.h"
#include "producers/density/try_code.h"
#include "producers/density/world_find.h"
#include "producers/points/points_kind.h"

/* ---- opening ---- */

static bool choose_part(karst_world *world, const karst_world_config *config, karst_error *error)
{
    static const struct {
        karst_content content;
        const char *what, *function;
    } parts[] = {[KARST_WORLD_CLEAR] = {KARST_CONTENT_CLEAR, "clear matter", "float clear(vec3 p)"},
                 [KARST_WORLD_AIR] = {KARST_CONTENT_AIR, "air", "medium air(vec3 p)"}};
    const char *name = world->whole->info.name;
    if ((unsigned)config->part > KARST_WORLD_AIR)
        return karst_fail(error, KARST_USAGE, "there is no part %d of a world", (int)config->part);
    world->file = world->whole->content[parts[config->part].content];
    if (!world->file)
        return karst_fail(error, KARST_USAGE, "%s has no %s: it does not define %s", name, parts[config->part].what,
                          parts[config->part].function);
    if (config->part == KARST_WORLD_AIR && world->whole->program->header.num_particles > 0)
        karst_log_print(config->log, KARST_LOG_WARNING, "%s: its particles are left out", name);
    return true;
}

static bool find(karst_world *world, const karst_world_config *config, karst_error *error)
{
    char path[PATH_MAX];
    world->file = world->whole = karst_world_find(config, path, error);
    if (!world->whole || (config->part != KARST_WORLD_LAND && !choose_part(world, config, error)))
        return false;
    world->path = strdup(path);
    return world->path || karst_fail(error, KARST_FAILED, "out of memory");
}

/* ---- what samplers need ---- */

static bool make_oracles(karst_world *world, karst_error *error)
{
    const karst_program_graph *program = world->file->program;
    uint32_t seed = world->metadata.seed;
    int voxel_log2_m = program->header.voxel_log2_m;
    karst_error too_large = {0};
    karst_number *values = calloc(program->num_parameters + 1, sizeof *values);
    world->data = karst_world_words_create(&world->file->layout, world->file->layout.num_words * sizeof *world->data);
    world->derived = karst_derive(&program->world, &too_large);
    bool done = values && world->data;
    for (uint32_t i = 0; done && i < program->num_parameters; i++)
        values[i] = program->parameters[i].value;
    done = done && karst_world_data_fill(&world->file->layout, values, seed, voxel_log2_m, world->data) &&
           (world->oracle = karst_oracle_create(&program->world, values, seed, voxel_log2_m, error)) &&
           (!world->derived ||
            (world->gradient_oracle = karst_oracle_create(&world->derived->world, values, seed, voxel_log2_m, error)));
    free(values);
    return done || karst_fail(error, KARST_FAILED, "out of memory");
}

static bool open_models(karst_world *world, karst_error *error)
{
    size_t num;
    const bool is_clear = world->file == world->whole->content[KARST_CONTENT_CLEAR];
    karst_model *models =
        karst_named_models(world->file->program, is_clear, world->metadata.voxel_log2_m, &num, error);
    bool done = models && (num == 0 || karst_model_list_init(&world->models, models, num, world->metadata.voxel_log2_m,
                                                             UINT64_MAX, NULL, error));
    karst_named_models_free(models, num);
    return done;
}

/* ---- what it says of itself ---- */

static double open_end(double bound)
{
    return bound == DBL_MAX ? (double)INFINITY : bound == -DBL_MAX ? -(double)INFINITY : bound;
}

static bool list_parameters(karst_world *world, karst_error *error)
{
    const karst_program_graph *program = world->file->program;
    world->parameters = calloc(program->num_parameters + 1, sizeof *world->parameters);
    if (!world->parameters)
        return karst_fail(error, KARST_FAILED, "out of memory");
    world->metadata.parameters = world->parameters;
    for (uint32_t i = 0; i < program->num_parameters; i++) {
        const karst_world_parameter *from = &program->parameters[i];
        if (from->is_implicit)
            continue;
        world->parameters[world->metadata.num_parameters++] = (karst_parameter_info){
            .name = from->name,
            .label = from->label,
            .unit = from->unit,
            .value = from->value.value,
            .min = open_end(from->min),
            .max = open_end(from->max),
            .step = from->step,
            .is_structural = from->is_structural,
            .is_used = from->is_used,
        };
    }
    return true;
}

static bool describe(karst_world *world, const karst_world_config *config, karst_error *error)
{
    const karst_world_header *header = &world->file->program->header;
    const karst_world_info *info = &world->file->info;
    world->metadata = (karst_world_metadata){
        .path = world->path,
        .name = info->name,
        .author = header->author,
        .description = header->description,
        .voxel_log2_m = header->voxel_log2_m,
        .seed = config->has_seed ? config->seed : header->seed,
        .camera = {.fov_deg = 60},
        .sun_azimuth_deg = info->sun_azimuth_deg,
        .sun_elevation_deg = info->sun_elevation_deg,
        .view_distance_m = info->view_distance_m,
        .extent_m = header->has_extent ? header->extent_m : 0,
        .declared_lipschitz = header->has_lipschitz ? header->lipschitz : 0,
        .has_colour = world->file == world->whole
                          ? karst_has_output(world->file->program->root, KARST_OUTPUT_COLOUR)
                          : world->file->program->world.root[KARST_ROOT_COLOUR] != KARST_NO_EXPR,
    };
    karst_camera_parse(info->camera, header->voxel_log2_m, &world->metadata.camera, NULL);
    return list_parameters(world, error);
}

karst_world *karst_world_open(const karst_world_config *config, karst_error *error)
{
    karst_world *world = calloc(1, sizeof *world);
    if (!world) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    if (find(world, config, error) && describe(world, config, error) && make_oracles(world, error) &&
        (world->file == world->whole->content[KARST_CONTENT_AIR] || open_models(world, error)))
        return world;
    karst_world_close(world);
    return NULL;
}

void karst_world_close(karst_world *world)
{
    if (!world)
        return;
    karst_oracle_destroy(world->gradient_oracle);
    karst_oracle_destroy(world->oracle);
    karst_gradient_world_destroy(world->derived);
    karst_model_list_finish(&world->models);
    if (world->data)
        karst_world_words_destroy(&world->file->layout, world->data,
                                  world->file->layout.num_words * sizeof *world->data);
    karst_world_file_destroy(world->whole);
    free(world->parameters);
    free(world->path);
    free(world);
}

const karst_world_metadata *karst_world_get_metadata(const karst_world *world) { return &world->metadata; }

bool karst_world_check(const karst_world *world, void (*print)(void *user, const char *line), void *user,
                       karst_error *error)
{
    if (!karst_language_check(world->file->program, print, user, error))
        return false;
    karst_bounds_cost_say(&world->file->tape, print, user);
    return true;
}

bool karst_world_try_code(const karst_world *world, const char *device, karst_error *error)
{
    karst_error refusal = {0};
    karst_context *context = karst_context_create(device, 0, NULL, error);
    if (!context)
        return false;
    bool good = karst_try_world(context, world->file, world->derived ? &world->derived->world : NULL, &refusal);
    karst_context_destroy(context);
    return good || karst_fail(error, refusal.status,
                              "the device's compiler refuses the code of this world. This is a mistake of Karst, not "
                              "of the text: please report it. It says: %.700s",
                              refusal.message);
}
