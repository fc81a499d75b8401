/* Launching the floor kernel. */
#include "raycast/cast/floor.h"

#include <stdlib.h>

#include "raycast/cast/cast_shared.h"
#include "raycast/cast/floor_shared.h"

struct karst_floor {
    karst_context *context;
    int width_px, height_px;
    karst_program *program;
    cl_kernel kernel;
    karst_buffer *table, *bricks, *out;
};

/* A table whose walks from neighbouring starts stay together for a while, and bricks of a sloping plane. */
static bool fill(karst_floor *f, karst_error *error)
{
    const size_t num_samples = (size_t)KARST_FLOOR_BRICKS * KARST_BRICK_STRIDE;
    uint32_t *table = malloc(KARST_FLOOR_TABLE * sizeof(*table));
    int16_t *samples = malloc(num_samples * sizeof(*samples));
    bool ok = table && samples;
    if (!ok)
        karst_fail(error, KARST_FAILED, "out of memory");
    for (uint32_t i = 0; ok && i < KARST_FLOOR_TABLE; i++)
        table[i] = (i / 16 * 2654435761u >> 12 & ~15u) + i % 16;
    for (size_t i = 0; ok && i < num_samples; i++)
        samples[i] = (int16_t)(1000 - (int)(i % KARST_BRICK_STRIDE) / 2);
    ok = ok && karst_buffer_write(f->table, 0, table, KARST_FLOOR_TABLE * sizeof(*table), error) &&
         karst_buffer_write(f->bricks, 0, samples, num_samples * sizeof(*samples), error);
    free(table);
    free(samples);
    return ok;
}

karst_floor *karst_floor_create(karst_context *context, int width_px, int height_px, karst_error *error)
{
    karst_floor *f = calloc(1, sizeof(*f));
    if (!f) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    f->context = context;
    f->width_px = width_px;
    f->height_px = height_px;
    f->table = karst_buffer_create(context, "floor", KARST_FLOOR_TABLE * sizeof(uint32_t), NULL, error);
    f->bricks = karst_buffer_create(context, "floor", (size_t)KARST_FLOOR_BRICKS * KARST_BRICK_STRIDE * sizeof(int16_t),
                                    NULL, error);
    f->out = karst_buffer_create(context, "floor", (size_t)width_px * (size_t)height_px * sizeof(float), NULL, error);
    f->program = karst_program_build(context, "raycast/cast/floor.cl", "", NULL, 0, error);
    f->kernel = f->program ? karst_program_kernel(f->program, "floor_picture", error) : NULL;
    if (!f->table || !f->bricks || !f->out || !f->kernel || !fill(f, error)) {
        karst_floor_destroy(f);
        return NULL;
    }
    return f;
}

void karst_floor_destroy(karst_floor *f)
{
    if (!f)
        return;
    if (f->kernel)
        clReleaseKernel(f->kernel);
    karst_program_destroy(f->program);
    karst_buffer_destroy(f->table);
    karst_buffer_destroy(f->bricks);
    karst_buffer_destroy(f->out);
    free(f);
}

bool karst_floor_run(karst_floor *f, uint64_t *time_ns, karst_error *error)
{
    uint64_t ns[KARST_NUM_STAGES] = {0};
    cl_int width = f->width_px, height = f->height_px;
    size_t across = ((size_t)width + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE,
           down = ((size_t)height + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE;
    size_t local_size = KARST_PACKET_RAYS * KARST_GROUP_PACKETS / (size_t)f->context->lanes;
    bool ok = KARST_ARGUMENTS(f->kernel, error, KARST_BUFFER_ARG(f->table), KARST_BUFFER_ARG(f->bricks),
                              KARST_VALUE_ARG(width), KARST_VALUE_ARG(height), KARST_BUFFER_ARG(f->out)) &&
              karst_launch(f->context, f->kernel, KARST_STAGE_CAST, across * down * local_size, local_size, error) &&
              karst_profile_collect(f->context, ns, error);
    *time_ns = ns[KARST_STAGE_CAST];
    return ok;
}
