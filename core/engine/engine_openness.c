/* What bricks prove of how open a picture's surfaces are: on request, for files. */
#include <math.h>
#include <stdlib.h>

#include "core/engine/engine_parts.h"
#include "raycast/light/openness.h"

enum { MOST_ROUNDS = 64, BRICKS_A_ROUND = 4096, ASKING_DEPTH = 1 };

/* What its bounds look at and what the picture itself does, with the engine's serial. */
static bool look(karst_engine *engine, karst_openness *openness, int depth, karst_buffer *bounds, karst_error *error)
{
    karst_cast_view view;
    karst_pinhole pinhole;
    const karst_camera camera = engine->camera;
    engine->camera = engine->drawn;
    karst_engine_picture_view(engine, &view, &pinhole);
    engine->camera = camera;
    return karst_openness_bound(openness, &view, &pinhole, engine->hits, KARST_OCCLUSION_CONE, depth, bounds, NULL,
                                error) &&
           karst_cast_pinhole(engine->caster, &view, &pinhole, NULL, error);
}

/* Finds bounds, and has made what they lack, coarse cells first: these ask for nearly all of it. */
static bool find_bounds(karst_engine *engine, karst_openness *openness, karst_buffer *bounds, karst_error *error)
{
    int depth = ASKING_DEPTH;
    for (int round = 0; round < MOST_ROUNDS; round++) {
        karst_allowance left = {.bricks = BRICKS_A_ROUND, .tiles = BRICKS_A_ROUND, .ns = INFINITY};
        karst_work work;
        karst_engine_next_serial(engine);
        if (!look(engine, openness, depth, bounds, error) ||
            !karst_engine_answer_round(engine, &engine->drawn.position, &left, &work, error))
            return false;
        if (work.num_loads + work.num_subdivides)
            continue;
        if (depth == KARST_OPENNESS_DEPTH)
            return true;
        depth = KARST_OPENNESS_DEPTH;
    }
    return look(engine, openness, KARST_OPENNESS_DEPTH, bounds, error);
}

static bool bound(karst_engine *engine, float *ordered, size_t num, karst_error *error)
{
    karst_openness *openness =
        karst_openness_create(engine->context, karst_cache_get_buffers(engine->cache), error);
    karst_buffer *bounds =
        openness ? karst_buffer_create(engine->context, "occlusion", 2 * num * sizeof(float), NULL, error) : NULL;
    const bool done = bounds && find_bounds(engine, openness, bounds, error) &&
                      karst_buffer_read(bounds, 0, ordered, 2 * num * sizeof *ordered, error);
    karst_buffer_destroy(bounds);
    karst_openness_destroy(openness);
    return done;
}

bool karst_engine_read_openness(karst_engine *engine, float *values, karst_error *error)
{
    const uint32_t width = (uint32_t)engine->width_px, height = (uint32_t)engine->height_px;
    const size_t num = (size_t)width * height;
    float *open = malloc(num * sizeof *open), *ordered = malloc(2 * num * sizeof *ordered);
    const bool done = open && ordered
                          ? karst_engine_read_occlusion(engine, open, num, error) && bound(engine, ordered, num, error)
                          : karst_fail(error, KARST_FAILED, "out of memory for bounds of openness");
    for (uint32_t y = 0; done && y < height; y++)
        for (uint32_t x = 0; x < width; x++) {
            const float *of = ordered + 2 * (size_t)karst_packet_order(x, y, width, height);
            const float least = engine->shown.splats ? 0 : of[0]; /* they are not looked at */
            *values++ = least;
            *values++ = of[1];
            *values++ = fminf(fmaxf(open[(size_t)y * width + x], least), of[1]);
        }
    free(open);
    free(ordered);
    return done;
}
