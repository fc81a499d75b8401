#include "reference/open.h"

#include <stdlib.h>

karst_world_file *karst_reference_open(const karst_reference_config *config, karst_error *error)
{
    karst_parameter_value *given = calloc(config->num_parameters + 1, sizeof *given);
    if (!given) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    for (size_t i = 0; i < config->num_parameters; i++)
        given[i] = (karst_parameter_value){config->parameters[i].name, config->parameters[i].value};
    karst_world_file *file = karst_world_file_open(config->world, given, config->num_parameters, NULL, error);
    free(given);
    /* It would be told as error what models add. */
    if (file && file->program->header.num_models > 0) {
        karst_fail(error, KARST_USAGE,
                   "%s: it has models of points, which the reference does not know: measure the world without them",
                   file->info.name);
        karst_world_file_destroy(file);
        return NULL;
    }
    return file;
}
