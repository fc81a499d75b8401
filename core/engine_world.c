/* Which world an engine shows: finding it, compiling it, and what draws and produces it. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/engine_parts.h"

static const karst_world_info *find_world(const char *name, karst_error *error)
{
    const karst_world_info *world = name ? karst_world_find(name) : NULL;
    if (world)
        return world;
    char names[512] = "";
    for (size_t i = 0; karst_world_at(i); i++) {
        size_t length = strlen(names);
        snprintf(names + length, sizeof names - length, "%s%s", i ? ", " : "", karst_world_at(i)->name);
    }
    karst_fail(error, KARST_BAD_WORLD, "no world is called '%s'; there are: %s", name ? name : "", names);
    return NULL;
}

/* Hands the compiler's lines, if any, to the log. */
static void log_lines(const karst_log *log, karst_log_level level, char *lines)
{
    for (char *line = lines, *end; line && *line; line = end) {
        end = line + strcspn(line, "\n");
        if (*end)
            *end++ = 0;
        karst_log_print(log, level, "%s", line);
    }
}

static bool is_path(const char *name)
{
    size_t length = name ? strlen(name) : 0;
    return length && (strchr(name, '/') || (length > 6 && !strcmp(name + length - 6, ".karst")));
}

/* The world and, if it is a file, what it compiles to. */
bool karst_engine_open_world(karst_engine *engine, const karst_engine_config *config, karst_error *error)
{
    if (!is_path(config->world)) {
        engine->world = find_world(config->world, error);
        if (engine->world && config->num_parameters)
            return karst_fail(error, KARST_USAGE, "the world %s has no parameters", config->world);
        return engine->world != NULL;
    }
    karst_parameter_value *given = calloc(config->num_parameters + 1, sizeof(*given));
    if (!given)
        return karst_fail(error, KARST_FAILED, "out of memory");
    for (size_t i = 0; i < config->num_parameters; i++)
        given[i] = (karst_parameter_value){config->parameters[i].name, config->parameters[i].value};
    char *diagnostics = NULL;
    engine->world_file = karst_world_file_open(config->world, given, config->num_parameters, &diagnostics, error);
    log_lines(engine->log, KARST_LOG_WARNING, diagnostics);
    free(diagnostics);
    free(given);
    engine->world = engine->world_file ? &engine->world_file->info : NULL;
    return engine->world != NULL;
}

bool karst_engine_create_shader(karst_engine *engine, karst_error *error)
{
    const karst_cache_buffers *buffers = karst_cache_get_buffers(engine->cache);
    if (!engine->world_file || !engine->world_file->code.colour_source) {
        engine->shader = karst_shader_create(engine->context, buffers, engine->shadows, error);
    } else {
        karst_shade_colour colour = {.source = engine->world_file->code.colour_source,
                                     .options = "-DWORLD_HAS_DATA",
                                     .data = engine->producer->data[0]};
        engine->shader = karst_shader_create_coloured(engine->context, buffers, engine->shadows, &colour, error);
    }
    return engine->shader != NULL;
}

bool karst_engine_create_producer(karst_engine *engine, uint32_t seed, karst_error *error)
{
    engine->producer =
        engine->world_file
            ? karst_world_file_producer(engine->context, engine->world_file, seed, engine->budget_bricks, error)
            : karst_density_producer_create(engine->context, engine->world, seed, engine->budget_bricks, error);
    return engine->producer != NULL;
}

const char *karst_world_name(size_t index)
{
    const karst_world_info *world = karst_world_at(index);
    return world ? world->name : NULL;
}

const char *karst_world_description(const char *name)
{
    const karst_world_info *world = karst_world_find(name);
    return world ? world->description : NULL;
}
