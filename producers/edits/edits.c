/* The layer of edits: launches of edits.cl, and the device's copy of the list. */
#include "producers/edits/edits.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    karst_layer base;
    karst_context *context;
    karst_program *program, *coloured_program;
    cl_kernel tiles, loads, bricks;
    cl_kernel coloured_bricks; /* NULL: no edit may have a colour */
    size_t group_size;         /* work-items a brick */
    karst_edit_list list;
    karst_buffer *data;
    uint32_t num_sent; /* edits that the device has */
    karst_drop_box *dirty;
    size_t num_dirty, max_dirty;
} edits_layer;

/* ---- the device's copy ---- */

static bool send(edits_layer *edits, karst_error *error)
{
    karst_edit_list *list = &edits->list;
    uint32_t num = karst_edit_list_num(list), sent = edits->num_sent < num ? edits->num_sent : num;
    if (!edits->data || edits->data->size_bytes != list->size_bytes) {
        karst_buffer *data = karst_buffer_create(edits->context, "edits", list->size_bytes, list->data, error);
        if (!data)
            return false;
        karst_finish(edits->context, NULL); /* nothing may read the old one any more */
        karst_buffer_destroy(edits->data);
        edits->data = data;
    } else if (list->is_rearranged) {
        if (!karst_buffer_write(edits->data, 0, list->data, list->size_bytes, error))
            return false;
    } else {
        size_t at = (size_t)((const char *)(karst_edit_list_records(list) + sent) - (const char *)list->data);
        if (!karst_buffer_write(edits->data, at, (const char *)list->data + at,
                                (num - sent) * sizeof(karst_edit_record), error) ||
            !karst_buffer_write(edits->data, 0, list->data, sizeof(karst_edits_head), error))
            return false;
    }
    list->is_rearranged = false;
    edits->num_sent = num;
    edits->base.version++;
    return true;
}

/* Room for so many dirty boxes more, so that nothing fails once the list has changed. */
static bool reserve_dirty(edits_layer *edits, size_t num, karst_error *error)
{
    size_t most = edits->max_dirty ? edits->max_dirty : 64;
    while (most < edits->num_dirty + num)
        most *= 2;
    if (most == edits->max_dirty)
        return true;
    karst_drop_box *dirty = realloc(edits->dirty, most * sizeof *dirty);
    if (!dirty)
        return karst_fail(error, KARST_FAILED, "out of memory for %zu edits", num);
    edits->dirty = dirty;
    edits->max_dirty = most;
    return true;
}

static void mark(edits_layer *edits, uint32_t first, uint32_t end)
{
    for (uint32_t i = first; i < end; i++)
        edits->dirty[edits->num_dirty++] = karst_edit_record_box(&karst_edit_list_records(&edits->list)[i]);
}

bool karst_edits_append(karst_layer *layer, const karst_edit *new_edits, size_t num, karst_error *error)
{
    edits_layer *edits = (edits_layer *)layer;
    uint32_t before = karst_edit_list_num(&edits->list);
    if (num > KARST_MAX_EDITS)
        return karst_fail(error, KARST_USAGE, "%zu edits: %u are the most", num, KARST_MAX_EDITS);
    if (!reserve_dirty(edits, num, error) || !karst_edit_list_append(&edits->list, new_edits, num, error))
        return false;
    if (edits->num_sent > before) /* what was undone is overwritten */
        edits->num_sent = before;
    mark(edits, before, karst_edit_list_num(&edits->list));
    return send(edits, error);
}

bool karst_edits_set_num(karst_layer *layer, uint32_t num, karst_error *error)
{
    edits_layer *edits = (edits_layer *)layer;
    uint32_t before = karst_edit_list_num(&edits->list);
    if (num > edits->list.num_made)
        num = edits->list.num_made;
    if (!reserve_dirty(edits, num > before ? num - before : before - num, error))
        return false;
    karst_edit_list_set_num(&edits->list, num);
    mark(edits, num < before ? num : before, num < before ? before : num);
    return send(edits, error);
}

const karst_edit_list *karst_edits_list(const karst_layer *layer) { return &((const edits_layer *)layer)->list; }

/* ---- the layer ---- */

static bool bound_tiles(karst_layer *self, const karst_cache_buffers *cache, const karst_work *work, karst_error *error)
{
    edits_layer *edits = (edits_layer *)self;
    return KARST_ARGUMENTS(edits->tiles, error, KARST_BUFFER_ARG(work->subdivide_tiles),
                           KARST_VALUE_ARG(work->num_subdivides), KARST_BUFFER_ARG(cache->nodes),
                           KARST_BUFFER_ARG(cache->tile_info), KARST_BUFFER_ARG(edits->data)) &&
           karst_launch(edits->context, edits->tiles, KARST_STAGE_SUBDIVIDE,
                        (size_t)work->num_subdivides * KARST_TILE_NODES, 1, error);
}

static bool bound_loads(karst_layer *self, karst_buffer *loads, uint32_t count, karst_error *error)
{
    edits_layer *edits = (edits_layer *)self;
    return KARST_ARGUMENTS(edits->loads, error, KARST_BUFFER_ARG(loads), KARST_VALUE_ARG(count),
                           KARST_BUFFER_ARG(edits->data)) &&
           karst_launch(edits->context, edits->loads, KARST_STAGE_EVALUATE, count, 1, error);
}

static bool evaluate(karst_layer *self, karst_buffer *loads, uint32_t count, karst_buffer *staging,
                     uint32_t stride_floats, const karst_layer_colours *colours, karst_error *error)
{
    edits_layer *edits = (edits_layer *)self;
    if (colours && edits->coloured_bricks)
        return KARST_ARGUMENTS(edits->coloured_bricks, error, KARST_BUFFER_ARG(loads), KARST_VALUE_ARG(count),
                               KARST_BUFFER_ARG(staging), KARST_VALUE_ARG(stride_floats),
                               KARST_BUFFER_ARG(colours->planes), KARST_BUFFER_ARG(colours->coloured),
                               KARST_BUFFER_ARG(edits->data)) &&
               karst_launch(edits->context, edits->coloured_bricks, KARST_STAGE_EVALUATE,
                            (size_t)count * edits->group_size, edits->group_size, error);
    return KARST_ARGUMENTS(edits->bricks, error, KARST_BUFFER_ARG(loads), KARST_VALUE_ARG(count),
                           KARST_BUFFER_ARG(staging), KARST_VALUE_ARG(stride_floats), KARST_BUFFER_ARG(edits->data)) &&
           karst_launch(edits->context, edits->bricks, KARST_STAGE_EVALUATE, (size_t)count * edits->group_size,
                        edits->group_size, error);
}

static size_t take_dirty(karst_layer *self, const karst_drop_box **boxes)
{
    edits_layer *edits = (edits_layer *)self;
    size_t num = edits->num_dirty;
    *boxes = edits->dirty;
    edits->num_dirty = 0;
    return num;
}

static bool check(karst_layer *self, karst_error *error)
{
    return karst_edit_list_check(&((edits_layer *)self)->list, error);
}

static void destroy(karst_layer *self)
{
    edits_layer *edits = (edits_layer *)self;
    cl_kernel kernels[] = {edits->tiles, edits->loads, edits->bricks, edits->coloured_bricks};
    for (size_t i = 0; i < sizeof kernels / sizeof *kernels; i++)
        if (kernels[i])
            clReleaseKernel(kernels[i]);
    karst_program_destroy(edits->program);
    karst_program_destroy(edits->coloured_program);
    karst_buffer_destroy(edits->data);
    karst_edit_list_finish(&edits->list);
    free(edits->dirty);
    free(edits);
}

static const karst_layer_ops edits_ops = {.kind = "edits",
                                          .bound_tiles = bound_tiles,
                                          .bound_loads = bound_loads,
                                          .evaluate = evaluate,
                                          .take_dirty = take_dirty,
                                          .check = check,
                                          .destroy = destroy};

static karst_program *build(const edits_layer *edits, const char *more_options, karst_error *error)
{
    char options[64];
    snprintf(options, sizeof options, "-DKARST_GROUP=%zu%s", edits->group_size, more_options);
    return karst_program_build(edits->context, "producers/edits/edits.cl", options, NULL, 0, error);
}

bool karst_edits_allow_colours(karst_layer *layer, karst_error *error)
{
    edits_layer *edits = (edits_layer *)layer;
    if (!edits->coloured_program)
        edits->coloured_program = build(edits, " -DEDITS_COLOURED", error);
    if (edits->coloured_program && !edits->coloured_bricks)
        edits->coloured_bricks = karst_program_kernel(edits->coloured_program, "karst_edit_coloured_bricks", error);
    return edits->coloured_bricks != NULL;
}

karst_layer *karst_edits_create(karst_context *context, karst_shape shape, int voxel_log2_m, karst_error *error)
{
    edits_layer *edits = calloc(1, sizeof *edits);
    if (!edits) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    edits->base.ops = &edits_ops;
    edits->context = context;
    edits->group_size = karst_shape_group_size(shape, context->is_cpu);
    if (karst_edit_list_init(&edits->list, voxel_log2_m, error) && send(edits, error) &&
        (edits->program = build(edits, "", error)) &&
        (edits->tiles = karst_program_kernel(edits->program, "karst_edit_tiles", error)) &&
        (edits->loads = karst_program_kernel(edits->program, "karst_edit_loads", error)) &&
        (edits->bricks = karst_program_kernel(edits->program, "karst_edit_bricks", error)))
        return &edits->base;
    destroy(&edits->base);
    return NULL;
}
