#include "producers/density/try_code.h"

#include <stdlib.h>

bool karst_try_code(karst_context *context, const char *source, const char *options, karst_error *error)
{
    const karst_virtual_file world = {"world.clh", source};
    return karst_program_try(context, "producers/density/try_code.cl", options, &world, 1, error);
}

static bool try_gradient(karst_context *context, const karst_resolved_world *gradient, karst_error *error)
{
    karst_world_layout layout;
    karst_error why = {0};
    char *source = NULL;
    if (!karst_world_layout_init(&layout, gradient))
        return karst_fail(error, KARST_FAILED, "out of memory");
    if (!karst_emit_surface(&layout, &source, &why)) /* too large: there is no code, and refining says so */
        return why.status == KARST_BAD_WORLD || karst_fail(error, why.status, "%s", why.message);
    bool good = karst_try_code(context, source, "-DWORLD_HAS_DATA", error);
    free(source);
    return good;
}

bool karst_try_world(karst_context *context, const karst_world_file *file, const karst_resolved_world *gradient,
                     karst_error *error)
{
    char options[KARST_WORLD_FILE_OPTIONS_BYTES], colour_options[KARST_WORLD_FILE_OPTIONS_BYTES];
    karst_density_program program;
    karst_world_file_program(file, NULL, options, &program);
    karst_world_file_colour_options(file, colour_options);
    return karst_try_code(context, program.source, options, error) &&
           karst_try_code(context, program.bounds_source, options, error) &&
           (!file->code.colour_source || karst_try_code(context, file->code.colour_source, colour_options, error)) &&
           (!gradient || try_gradient(context, gradient, error));
}
