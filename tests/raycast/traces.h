/* What a cast leaves behind, for tests that it is the same: hits, stamps, wishes. */
#ifndef KARST_TESTS_RAYCAST_TRACES_H
#define KARST_TESTS_RAYCAST_TRACES_H

#include "tests/raycast/casting.h"

#define NUM_STAMPS 7

/* Ground with bumps of every size, of which coarser levels lack the finer ones. */
SCENE_UNUSED static double bumps(const double p[3], double width, const void *user)
{
    (void)user;
    double sum = width - 3 - p[1], size = 32, height = 5;
    for (int i = 0; i < 5; i++, size *= 0.5, height *= 0.5)
        if (size >= 2 * width)
            sum += height * sin(p[0] / size * 3 + i) * cos(p[2] / size * 3 - p[1] / size);
    return sum;
}

/* A scene of which nothing is known yet. */
SCENE_UNUSED static scene open_scene_in(uint32_t num_segments, scene_density density, const void *user)
{
    scene s = scene_create(contexts[0], 3000, 6000, num_segments, 5, density, user);
    s.lipschitz = 8;
    scene_classify_tile(&s, KARST_ROOT_TILE);
    for (uint32_t i = 8; i < 16; i++)
        s.nodes[i].link = KARST_NODE_LINK(KARST_STATE_UNKNOWN, 0);
    scene_upload(&s);
    return s;
}

SCENE_UNUSED static scene open_scene(scene_density density, const void *user)
{
    return open_scene_in(1, density, user);
}

typedef struct {
    karst_hit *hits;
    uint32_t *stamps[NUM_STAMPS];
} traces;

SCENE_UNUSED static karst_buffer *stamp_buffer(const scene *s, int i)
{
    karst_buffer *const all[NUM_STAMPS] = {s->buffers.tile_stamp, s->buffers.brick_stamp,   s->buffers.brick_fallback,
                                           s->buffers.want_brick, s->buffers.want_children, s->buffers.want_chunk,
                                           s->buffers.want_rays};
    return all[i];
}

SCENE_UNUSED static void forget_stamps(const scene *s)
{
    karst_error error = {0};
    for (int i = 0; i < NUM_STAMPS; i++)
        scene_check(karst_buffer_fill(stamp_buffer(s, i), 0, 0, stamp_buffer(s, i)->size_bytes, &error), &error);
}

SCENE_UNUSED static void release(traces *t)
{
    free(t->hits);
    for (int i = 0; i < NUM_STAMPS; i++)
        free(t->stamps[i]);
}

/* How many hits and stamps are not the same in both. */
SCENE_UNUSED static size_t count_differences(const scene *s, const traces *a, const traces *b, size_t num_hits)
{
    size_t count = 0;
    for (size_t i = 0; i < num_hits; i++)
        count += memcmp(&a->hits[i], &b->hits[i], sizeof(karst_hit)) != 0;
    for (int i = 0; i < NUM_STAMPS; i++)
        for (size_t k = 0; k < stamp_buffer(s, i)->size_bytes / 4; k++)
            count += a->stamps[i][k] != b->stamps[i][k];
    return count;
}

#endif
