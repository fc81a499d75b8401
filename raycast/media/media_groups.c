/* Groups: which grids towards the sun are made anew, while it moves. */
#include <stdlib.h>

#include "raycast/media/media_internal.h"

/* A grid of an earlier time. */
typedef struct {
    uint32_t slot, age, looks;
} stale;

static int compare_stale(const void *a, const void *b)
{
    const stale *p = a, *q = b;
    if (p->age != q->age)
        return p->age > q->age ? -1 : 1;
    if (p->looks != q->looks)
        return p->looks > q->looks ? -1 : 1;
    return p->slot < q->slot ? -1 : p->slot > q->slot;
}

/* What the device knows of each slot. */
typedef struct {
    uint32_t *used, *looks, *chosen;
    karst_sun_depth *states;
    karst_brick_owner *owners;
    stale *stale;
} slots;

static bool read_slots(const karst_media *media, uint32_t num, slots *s, karst_error *error)
{
    s->used = malloc(num * sizeof *s->used);
    s->looks = malloc(num * sizeof *s->looks);
    s->chosen = calloc(num, sizeof *s->chosen);
    s->states = malloc(num * sizeof *s->states);
    s->owners = malloc(num * sizeof *s->owners);
    s->stale = malloc(num * sizeof *s->stale);
    if (!s->used || !s->looks || !s->chosen || !s->states || !s->owners || !s->stale)
        return karst_fail(error, KARST_FAILED, "out of memory for the grids of %u bricks", num);
    return karst_buffer_read(media->used, 0, s->used, num * sizeof *s->used, error) &&
           karst_buffer_read(media->looks, 0, s->looks, num * sizeof *s->looks, error) &&
           karst_buffer_read(media->states, 0, s->states, num * sizeof *s->states, error) &&
           karst_buffer_read(media->air.brick_owner, 0, s->owners, num * sizeof *s->owners, error);
}

/* Bricks without a grid have one made at once, and grids that lacked something are made whole; of the rest the share
 * that has its turn. */
static void choose(const karst_media *media, uint32_t num, uint32_t serial, slots *s)
{
    uint32_t num_grids = 0, num_stale = 0;
    for (uint32_t i = 0; i < num; i++) {
        const karst_sun_depth *state = &s->states[i];
        if (s->used[i] != serial || s->owners[i].owner == KARST_NO_NODE)
            continue;
        const bool has_grid = state->sun && state->owner == s->owners[i].owner &&
                              state->owner_generation == s->owners[i].owner_generation;
        num_grids += has_grid;
        if (has_grid && state->sun != media->sun_number)
            s->stale[num_stale++] = (stale){i, media->sun_number - state->sun, s->looks[i]};
        else
            s->chosen[i] = serial;
    }
    const uint32_t most = (num_grids + media->config.groups - 1) / media->config.groups;
    qsort(s->stale, num_stale, sizeof *s->stale, compare_stale);
    for (uint32_t i = 0; i < num_stale && i < most; i++)
        s->chosen[s->stale[i].slot] = serial;
}

bool karst_media_choose(karst_media *media, uint32_t serial, karst_error *error)
{
    const uint32_t num = media->air.num_bricks + KARST_CACHE_ROOT_BRICKS;
    slots s = {0};
    bool done = read_slots(media, num, &s, error);
    if (done) {
        choose(media, num, serial, &s);
        done = karst_buffer_write(media->chosen, 0, s.chosen, num * sizeof *s.chosen, error) &&
               karst_buffer_fill(media->looks, 0, 0, num * sizeof *s.looks, error) &&
               karst_finish(media->context, error); /* the memory goes */
    }
    free(s.used);
    free(s.looks);
    free(s.chosen);
    free(s.states);
    free(s.owners);
    free(s.stale);
    return done;
}
