/* The layer of edits: its table, and the device's copy of the list. */
#include "producers/edits/edits.h"
#include "producers/steps/layer_kernels.h"

#include <stdlib.h>
#include <string.h>

typedef struct {
    karst_buffer_layer on;
    karst_context *context;
    karst_edit_list list;
    uint32_t num_sent; /* edits that the device has */
    karst_drop_box *dirty;
    size_t num_dirty, max_dirty;
} edits_layer;

/* ---- the device's copy ---- */

static bool send(edits_layer *edits, karst_error *error)
{
    karst_edit_list *list = &edits->list;
    uint32_t num = karst_edit_list_num(list), sent = edits->num_sent < num ? edits->num_sent : num;
    if (!edits->on.data || edits->on.data->size_bytes != list->size_bytes) {
        karst_buffer *data = karst_buffer_create(edits->context, "edits", list->size_bytes, list->data, error);
        if (!data)
            return false;
        karst_finish(edits->context, NULL); /* nothing may read the old one any more */
        karst_buffer_destroy(edits->on.data);
        edits->on.data = data;
    } else if (list->is_rearranged) {
        if (!karst_buffer_write(edits->on.data, 0, list->data, list->size_bytes, error))
            return false;
    } else {
        size_t at = (size_t)((const char *)(karst_edit_list_records(list) + sent) - (const char *)list->data);
        if (!karst_buffer_write(edits->on.data, at, (const char *)list->data + at,
                                (num - sent) * sizeof(karst_edit_record), error) ||
            !karst_buffer_write(edits->on.data, 0, list->data, sizeof(karst_edits_head), error))
            return false;
    }
    list->is_rearranged = false;
    edits->num_sent = num;
    edits->on.base.version++;
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

const karst_buffer *karst_edits_data(const karst_layer *layer) { return ((const edits_layer *)layer)->on.data; }

/* ---- the layer ---- */

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
    karst_buffer_layer_finish(&edits->on);
    karst_edit_list_finish(&edits->list);
    free(edits->dirty);
    free(edits);
}

static const karst_layer_ops edits_ops = {.kind = "edits",
                                          .bound_tiles = karst_buffer_layer_bound_tiles,
                                          .bound_loads = karst_buffer_layer_bound_loads,
                                          .evaluate = karst_buffer_layer_evaluate,
                                          .take_dirty = take_dirty,
                                          .check = check,
                                          .destroy = destroy};

bool karst_edits_allow_colours(karst_layer *layer, karst_error *error)
{
    return karst_layer_kernels_build_coloured(&((edits_layer *)layer)->on.kernels, error);
}

karst_layer *karst_edits_create(karst_context *context, karst_shape shape, int voxel_log2_m, karst_error *error)
{
    edits_layer *edits = calloc(1, sizeof *edits);
    if (!edits) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    edits->on.base.ops = &edits_ops;
    edits->context = context;
    if (karst_edit_list_init(&edits->list, voxel_log2_m, error) && send(edits, error) &&
        karst_layer_kernels_build(&edits->on.kernels, context, shape, "producers/edits/edits_layer.clh", error))
        return &edits->on.base;
    destroy(&edits->on.base);
    return NULL;
}
