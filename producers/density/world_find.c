#include "producers/density/world_find.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "karst/data.h"

#define WORLD_SUFFIX ".karst"
#define MAX_LISTED 64

static bool fail_unknown(const char *name, karst_error *error)
{
    char names[MAX_LISTED][KARST_DATA_NAME_BYTES], list[1024] = "";
    size_t count = karst_data_list("worlds", WORLD_SUFFIX, names, MAX_LISTED);
    for (size_t i = 0; i < count; i++) {
        size_t length = strlen(list);
        snprintf(list + length, sizeof list - length, "%s%s", i ? ", " : "", names[i]);
    }
    if (count == 0)
        return karst_fail(error, KARST_BAD_WORLD,
                          "no world is called '%s', and the worlds that come with Karst are not where they were "
                          "installed: set KARST_DATA_DIR to the folder that holds worlds/, or give a path",
                          name);
    return karst_fail(error, KARST_BAD_WORLD, "no world is called '%s'; there are: %s", name, list);
}

/* Hands the compiler's lines, if any, to the log. */
static void log_lines(const karst_log *log, char *lines)
{
    for (char *line = lines, *end; line && *line; line = end) {
        end = line + strcspn(line, "\n");
        if (*end)
            *end++ = '\0';
        karst_log_print(log, KARST_LOG_WARNING, "%s", line);
    }
}

karst_world_file *karst_world_find(const karst_world_config *config, char path[PATH_MAX], karst_error *error)
{
    char *diagnostics = NULL;
    karst_parameter_value *given = NULL;
    karst_world_file *file = NULL;
    if (!config->world || !*config->world)
        karst_fail(error, KARST_USAGE, "no world is named");
    else if (!karst_data_find("worlds", config->world, WORLD_SUFFIX, path, PATH_MAX, NULL))
        fail_unknown(config->world, error);
    else if (!(given = calloc(config->num_parameters + 1, sizeof *given)))
        karst_fail(error, KARST_FAILED, "out of memory");
    if (!given)
        return NULL;
    for (size_t i = 0; i < config->num_parameters; i++)
        given[i] = (karst_parameter_value){config->parameters[i].name, config->parameters[i].value};
    file = karst_world_file_open(path, given, config->num_parameters, &diagnostics, error);
    log_lines(config->log, diagnostics);
    free(diagnostics);
    free(given);
    return file;
}
