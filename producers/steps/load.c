/* Launches of load.cl. */
#include "producers/steps/load.h"

#include <stdio.h>
#include <stdlib.h>

struct karst_loader {
    karst_context *context;
    karst_program *program;
    cl_kernel bricks;
    cl_mem data;       /* of the world; NULL: none */
};

karst_loader *karst_loader_create(karst_context *context, const karst_channel_layout *layout,
                                  const karst_virtual_file *world, const char *options, karst_error *error)
{
    karst_loader *loader = calloc(1, sizeof *loader);
    char all_options[1024], channels[512];
    if (!loader) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    loader->context = context;
    karst_channels_options(layout, channels, sizeof channels);
    snprintf(all_options, sizeof all_options, "%s %s", options, channels);
    loader->program = karst_program_build(context, "producers/steps/load.cl", all_options, world, 1, error);
    if (!loader->program ||
        !(loader->bricks = karst_program_kernel(loader->program, "karst_load_bricks", error))) {
        karst_loader_destroy(loader);
        return NULL;
    }
    return loader;
}

void karst_loader_destroy(karst_loader *loader)
{
    if (!loader)
        return;
    if (loader->bricks)
        clReleaseKernel(loader->bricks);
    karst_program_destroy(loader->program);
    free(loader);
}

void karst_loader_move(karst_loader *loader, karst_context *context)
{
    loader->context = context;
    karst_program_move(loader->program, context);
}

void karst_loader_set_data(karst_loader *loader, const karst_buffer *data)
{
    loader->data = data ? data->mem : NULL;
}

static bool launch(karst_loader *loader, const karst_cache_buffers *cache, const karst_work *work, uint32_t first,
                   uint32_t count, const karst_load_books *books, cl_mem total, size_t num_items, karst_error *error)
{
    karst_buffer *const *b = cache->bricks;
    return KARST_ARGUMENTS(loader->bricks, error, KARST_BUFFER_ARG(work->load_nodes),
                           KARST_BUFFER_ARG(work->load_slots), KARST_VALUE_ARG(first), KARST_VALUE_ARG(count),
                           KARST_BUFFER_ARG(cache->nodes), KARST_BUFFER_ARG(cache->tile_info),
                           KARST_BUFFER_ARG(work->load_results), KARST_BUFFER_ARG(books->least),
                           KARST_BUFFER_ARG(cache->brick_info), KARST_BUFFER_ARG(books->loads),
                           KARST_BUFFER_ARG(books->scrubs), KARST_VALUE_ARG(total),
                           KARST_VALUE_ARG(cache->bricks_per_segment), KARST_BUFFER_ARG(b[0]), KARST_BUFFER_ARG(b[1]),
                           KARST_BUFFER_ARG(b[2]), KARST_BUFFER_ARG(b[3]), KARST_BUFFER_ARG(b[4]),
                           KARST_BUFFER_ARG(b[5]), KARST_BUFFER_ARG(b[6]), KARST_BUFFER_ARG(b[7]),
                           KARST_VALUE_ARG(loader->data)) &&
           karst_launch(loader->context, loader->bricks, KARST_STAGE_EVALUATE, num_items, 1, error);
}

bool karst_load_bricks(karst_loader *loader, const karst_cache_buffers *cache, const karst_work *work, uint32_t first,
                       uint32_t count, const karst_load_books *books, karst_error *error)
{
    return launch(loader, cache, work, first, count, books, NULL, count ? count : 1, error) &&
           (count == 0 || launch(loader, cache, work, first, count, books, books->total->mem, 1, error));
}
